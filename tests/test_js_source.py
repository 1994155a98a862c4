"""The kernel language in JavaScript, and the script of a robot: its text, and what it computes in Chromium."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled.drivers import intrinsics
from softrobots.compiled.statuses import Status
from softrobots.compiled.translate.javascript import to_javascript
from studies.shared.browser import open_browser
from tests.support.laws import law

ROBOTS: dict[str, tuple[Any, float, float]] = {
    "arm": (sr.InflatableArm(), 5.0, 1.0),
    "arm with wrist": (sr.InflatableArm(wrist=(0.08, 0.12)), 5.0, 1.0),
    "slack wall": (sr.InflatableArm(moment_law="slack_wall"), 5.0, 1.0),
    "PCC, lengths": (sr.PccArm(), 0.5, 0.3),
    "PCC, tensions": (sr.PccArm(kind="tension"), 0.5, 0.1),
    "PCC, elastic": (sr.PccArm(kind="elastic"), 0.5, 0.1),
    "PCC, lumped": (sr.PccArm(chain="lumped"), 0.5, 0.3),
    "flexures": (sr.PccArm(chain="flexures", hinges=3, extension=False, muscle_azimuths=()), 0.5, 0.3),
    "tendons": (sr.TendonArm(), 0.05, 0.3),
    "helix": (sr.HelixTube(), 0.1, 0.3),
    "two hinges": (sr.InflatableArm(link_model="two_hinges", torsion=True), 5.0, 1.0),
}
"""Robots, size of the forces on their tips [N], and how far actuators go from relaxed to anywhere within their limits [-].

Residuals are relative to the tensions, too: under the largest ones 1e-10 of them moves a tip by 2 nm."""
RUBBING: dict[str, tuple[Any, float, float]] = {
    "bent, both frictions": (
        sr.TendonArm(kind="tension", elastic_sections=2, rest_bend_x=0.7, bending_friction=5e-4, guide_friction=0.2),
        0.1,
        0.1,
    ),
    "PCC, guides": (sr.PccArm(elastic_sections=2, guide_friction=0.1), 1.0, 0.1),
}
KERNEL = '''"""Text."""

N = 2
SHIFT = -0.5
TABLE = (1.0, 2.5)
PLACES = (1, 0)
UNUSED = 3.0

def add(w: Array, x: float) -> int:
    """Write; </script> ends nothing."""
    w[0] += x
    return 1

def settle(w: Array, flag: int) -> bool:
    k = -flag * 2
    ready = False
    for i in range(N + flag):
        y = floor(w[PLACES[i]] / 3) + where(w[i] < SHIFT and not ready, TABLE[i], -i)
        w[i] = fabs(y) * sqrt(w[i])
    add(w, 1)
    if k / 2 == 1:
        return True
    return k > 0
'''
TRANSLATED = """\
const $N = 2;
const $SHIFT = -0.5;
const $TABLE = Float64Array.of(1.0, 2.5);
const $PLACES = Int32Array.of(1, 0);

/* Write; </script> ends nothing. */
function $add(w, x)
{
    w[0] = w[0] + x;
    return 1;
}

function $settle(w, flag)
{
    let y = 0.0;
    const k = Math.imul(0 - flag, 2);
    const ready = false;
    const stop_1 = $N + flag;
    for (let i = 0; i < stop_1; i += 1) {
        y = (Math.floor(w[$PLACES[i]] / 3.0) + 0.0) + ((w[i] < $SHIFT) && (!ready) ? $TABLE[i] : 0 - i);
        w[i] = Math.abs(y) * Math.sqrt(w[i]);
    }
    $add(w, 1.0);
    if ((k / 2) == 1.0) {
        return true;
    }
    return k > 0;
}
"""


@cache
def compiled(name: str) -> sr.CompiledModel:
    return sr.compile(sr.load_model((ROBOTS | RUBBING)[name][0]), backend="python")


@cache
def script(name: str) -> str:
    return compiled(name).js_source()


def test_dialect() -> None:
    """Declarations, ints that are never minus zero, intrinsics; what is not used is left out."""
    assert to_javascript(KERNEL, exported=("settle",)) == TRANSLATED


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("def f(w: Array, arguments: int) -> None:\n    w[0] = arguments\n", "keyword"),
        (
            "def g(w: Array) -> float:\n    w[0] = 1.0\n    return 1.0\n"
            "def f(w: Array) -> None:\n    x = where(True, g(w), 2.0)\n",
            "outside of where",
        ),
    ],
)
def test_refusals(text: str, word: str) -> None:
    """Names that JavaScript keeps; a choice whose sides write, both of which Python computes and JavaScript does not."""
    with pytest.raises(sr.ParameterError, match=word):
        to_javascript(text, exported=("f",))


@pytest.mark.study
@law("CompiledModel.js_source")
@given(name=st.sampled_from(["arm", "helix"]), points=st.integers(1, 8))
@settings(max_examples=3)
def test_script_is_self_contained(name: str, points: int) -> None:
    """Every name of the kernel that the text uses is declared in it once; nothing is imported, and no tag of a page ends it."""
    text = compiled(name).js_source(points=points)
    used = set(re.findall(r"\$(\w+)", text)) - (set() if compiled(name).model.muscles else {"put_muscles"})
    declared = re.findall(r"^(?:const|function) \$(\w+)", text, re.MULTILINE)
    assert sorted(declared) == sorted(used)
    assert not re.search(r"\bimport\b|\brequire\b|\bfetch\b|</|<!--", text)
    assert text.count("makeSolver = ") == 1
    assert repr(float(compiled(name).model.chain().stiffness[-1])) in text
    assert text == compiled(name).js_source(gravity=True, points=points)
    with pytest.raises(sr.ParameterError, match="points"):
        compiled(name).js_source(points=0)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with open_browser() as opened:
        yield opened


def random_cases(name: str, count: int) -> list[dict[str, Any]]:
    """Draw actuators, forces, and weight in every other case."""
    model, (_, size, share) = compiled(name).model, ROBOTS[name]
    random, relaxed = np.random.default_rng(3), model.relaxed_motors
    cases = []
    while len(cases) < count:
        drawn = model.actuators.draw(random)
        if drawn is not None:
            motors = relaxed + share * (drawn - relaxed)
            down = [0.0, 0.0, -9.81 if len(cases) % 2 else 0.0]
            cases.append({"motors": motors.tolist(), "force": (size * random.normal(size=3)).tolist(), "gravity": down})
    return cases


def in_browser(browser: Any, name: str, code: str, argument: Any = None, **options: Any) -> Any:
    """Return what a function of JavaScript returns in a page where `solver` solves a robot."""
    page = browser.new_page()
    page.add_script_tag(content=script(name) if not options else compiled(name).js_source(**options))
    page.evaluate("() => { window.solver = makeSolver(); }")
    value = page.evaluate(code, argument)
    page.close()
    return value


SOLVE = """cases => cases.map((one) => { const found = solver.solve(one);
  for (const name of ["springs", "placements", "unknowns", "start"]) found[name] = Array.from(found[name]);
  return found; })"""


def plain_kernel(name: str) -> dict[str, Any]:
    """The generated code, as Python runs it, with its own sines."""
    names: dict[str, Any] = {key: getattr(intrinsics, key) for key in ("Array", "where", "floor", "fabs", "sqrt")}
    exec(compiled(name).source(gravity=True), names)
    return names


@pytest.mark.system
@pytest.mark.parametrize("name", ROBOTS)
def test_answers_are_those_of_python(browser: Any, name: str) -> None:
    """Springs and tip of random cases are those of `solve_equilibrium`; status and unknowns those of the same code in Python.
    Tensions, of slack tendons, too, are the same to 1e-7 of the largest.

    The first to 1e-9: both leave 1e-10 of the load out of balance at most; the second to the last bit. Moments and axial forces
    of inflated links differ by that times their stiffness, up to 100 N m/rad.
    """
    cases, model, kernel = random_cases(name, 20), compiled(name).model, plain_kernel(name)
    place = kernel["UNKNOWN"]
    joints, certified, slack = kernel["N_MOTORS"], 0, 0
    for case, found in zip(cases, in_browser(browser, name, SOLVE, cases), strict=True):
        w = [0.0] * kernel["WORKSPACE_SIZE"]
        w[:joints] = case["motors"][:joints]
        if "put_muscles" in kernel:
            kernel["put_muscles"](w, case["motors"][joints:])
        w[kernel["FORCE"] : kernel["FORCE"] + 3], w[kernel["GRAVITY"] : kernel["GRAVITY"] + 3] = case["force"], case["gravity"]
        status = kernel["settle"](w)
        assert found["status"] == status
        assert found["unknowns"] == w[place : place + len(found["unknowns"])]
        assert found["statusText"] == Status(status).explanation
        if status == Status.CERTIFIED:
            certified += 1
            one = sr.solve_equilibrium(model, case["motors"], case["force"], gravity=case["gravity"])
            assert np.abs(one.q_springs - found["springs"]).max() < 1e-9
            assert np.abs(one.tip_position - found["tip"]).max() < 1e-9
            forces = one.muscle_forces
            slack += sum(one.muscle_slack)
            assert np.abs(forces - found["tensions"]).max(initial=0.0) < 1e-7 * max(1.0, np.abs(forces).max(initial=0.0))
            limits = one.link_limits
            carried = [limits.moments, limits.axial_forces, limits.slack_margins, limits.wrinkling_margins]
            shown = [
                [link[key] for link in found["links"]] for key in ("moment", "axialForce", "slackMargin", "wrinklingMargin")
            ]
            assert np.abs(np.array(shown) - carried).max(initial=0.0) < 1e-7
    assert certified > 0.8 * len(cases)
    assert slack > 0 or name not in ("tendons", "PCC, elastic")


@pytest.mark.system
@pytest.mark.parametrize("name", RUBBING)
def test_steps_with_dry_friction_are_those_of_python(browser: Any, name: str) -> None:
    """Each from the state before: springs are those of `solve_equilibrium` to 1e-9, as above, and what friction remembers
    that of the same code in Python, to rounding."""
    model, (_, size, share) = compiled(name).model, RUBBING[name]
    drawn = model.actuators.draw(np.random.default_rng(4)) - model.relaxed_motors
    parts = np.array([0.2, 1.0, 0.9, 0.0, 0.8, 0.4])  # of the way there, at last on the way back
    cases = [
        {"motors": (model.relaxed_motors + part * share * drawn).tolist(), "force": [part * size, 0.0, 0.0]} for part in parts
    ]
    code = """cases => { let from = null; return cases.map((one) => { from = solver.solve({...one, from});
      return {...from, springs: [...from.springs], memory: from.memory.map((part) => [...part])}; }); }"""
    slow = fast = None
    for case, found in zip(cases, in_browser(browser, name, code, cases), strict=True):
        slow = sr.solve_equilibrium(model, case["motors"], case["force"], previous=slow)
        fast = compiled(name).equilibrium(case["motors"], case["force"], previous=fast)
        assert found["status"] == Status.CERTIFIED
        assert found["springs"] == pytest.approx(slow.q_springs, abs=1e-9)
        assert found["tip"] == pytest.approx(slow.tip_position, abs=1e-9)
        assert found["tensions"] == pytest.approx(slow.muscle_forces, abs=1e-7)
        bending, slip = found["memory"]
        rows = np.reshape(bending, (-1, 4))[: len(fast.friction_bending), :2]  # bend_x and bend_y of each section
        assert rows == pytest.approx(fast.friction_bending, abs=1e-12)
        assert slip == pytest.approx(fast.friction_slip, abs=1e-12)
    from_rest = sr.solve_equilibrium(model, cases[-1]["motors"], cases[-1]["force"])
    assert np.abs(from_rest.tip_position - found["tip"]).max() > 1e-5 * model.reach  # the way matters


@pytest.mark.system
@pytest.mark.parametrize("name", ["arm with wrist", "PCC, lengths", "helix"])
def test_placements_are_those_of_pinocchio(browser: Any, name: str) -> None:
    """Frames of joints and of ends of sections, by forward kinematics at the same coordinates, to rounding."""
    cases, model = random_cases(name, 4), compiled(name).model
    frames = in_browser(browser, name, "() => solver.frames")
    for case, found in zip(cases, in_browser(browser, name, SOLVE, cases), strict=True):
        data = model.pinocchio.createData()
        pin.forwardKinematics(model.pinocchio, data, model.configuration(case["motors"], found["springs"]))
        ends = list(data.oMi)  # the last joint of each section is its end
        rows = np.reshape(found["placements"], (-1, 12))
        assert len(rows) == len(frames)
        assert np.abs(rows[-1, 9:] - found["tip"]).max() < 1e-12
        for frame, row in zip(frames, rows, strict=True):
            if frame["share"] == 1 and frame["kind"] != "tip":
                own = [data.oMi[model.pinocchio.getJointId(frame["name"])]] if frame["kind"] == "joint" else ends
                assert min(np.abs(np.append(one.rotation, one.translation) - row).max() for one in own) < 1e-9


@pytest.mark.system
def test_bad_input_is_told(browser: Any) -> None:
    """A TypeError says what came and what is required; lengths that no shape has are a status; a result is a start."""
    code = """motors => { const found = (one) => { try { return solver.solve(one).status; } catch (error) {
      return `${error.name}: ${error.message}`; } };
      const named = Object.fromEntries(solver.actuators.map((one, i) => [one.name, motors[i]]));
      const here = solver.solve({motors: named, force: [0, 0, 0.3]});
      const near = solver.solve({motors, force: [0, 0, 0.3], from: here});
      return [found({motors: motors.slice(1)}), found({motors, force: [0, NaN, 0]}), found({motors: {...named, other: 1}}),
        found({motors: motors.map((one, i) => i === 2 ? -1 : one)}), found({motors, from: 3}), here.status, near.status,
        Math.hypot(...here.tip.map((one, i) => one - near.tip[i]))]; }"""
    length, force, name, none, start, *settled, apart = in_browser(
        browser, "PCC, lengths", code, compiled("PCC, lengths").model.relaxed_motors.tolist()
    )
    assert length.startswith("TypeError: motors: [")
    assert "required: 6 finite numbers [m]: muscle_1_1, " in length
    assert force == "TypeError: force: [0, NaN, 0] came; required: 3 finite numbers [N]"
    assert name.startswith("TypeError: motors: other is none of them; required: muscle_1_1, ")
    assert none == Status.NOT_A_NUMBER
    assert start.startswith("TypeError: from: 3 came")
    assert settled == [Status.CERTIFIED, Status.CERTIFIED]
    assert apart < 1e-9
