"""Hard cases, each checked by statics written a second time: no hang, no NaN, no wrong "stable", an answer or an error."""

from __future__ import annotations

import ast
import importlib.util
import json
import runpy
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.settings import LARGEST_POSITION
from softrobots.statics.stability import mass_matrix
from studies.soak import jobs, plain_stability, verdicts
from studies.soak.families import FAMILIES, Family, draw_cases
from studies.soak.jobs import STABLE, Answer, Hang, limited
from studies.soak.plain_sections import section_joints, section_slopes
from studies.soak.plain_statics import Case, PlainStatics
from studies.soak.running import again, family_of, parts_of, soak, table
from studies.soak.verdicts import Tally, judge
from tests.conftest import CHECKOUT, missing
from tests.support.law_robots import ROBOTS, model
from tests.support.oracles import central_difference

pytestmark = pytest.mark.study

GRAVITY = np.array(sr.EARTH_GRAVITY)
LARGEST_FORCE = 1000.0  # [N]


def one(motors: Any, force: Any = (0, 0, 0), gravity: Any = (0, 0, 0), moment: Any = (0, 0, 0)) -> Case:
    """One case as a batch."""
    return Case(*(np.array([np.asarray(part, dtype=float).ravel()]) for part in (motors, force, gravity, moment)))


def check(model: sr.SoftModel, case: Case, springs: np.ndarray, *, stable: bool | None = True) -> None:
    """Balance to 1e-10 of the load, and stability, by plain statics."""
    plain = PlainStatics(model)
    balance = plain.balance(case, springs[None])
    tolerance = max(1e-10 * max(float(balance.size[0]), 1e-3), model.rounding) + float(balance.rounding[0])
    assert np.linalg.norm(balance.residual[0]) <= tolerance
    assert balance.held[0] <= 1e-12
    min_pivot, error = plain_stability.least_eigenvalue(plain, case, springs)
    if stable is not None:
        assert (min_pivot > -error) if stable else (min_pivot < error)


# --- Plain statics is right: Pinocchio says the same


def drawn(kind: str, rng: np.random.Generator) -> tuple[sr.SoftModel, Case, np.ndarray]:
    """Three cases of a robot, in no balance at all."""
    robot = model(kind)
    joints = len(robot.structure.motor_joints)
    motors = np.tile(np.array(robot.relaxed_motors), (3, 1))
    motors[:, :joints] = rng.uniform(-3.0, 3.0, (3, joints))
    given = motors[:, joints:]
    tensions = np.array(robot.actuators.units[joints:]) == "N"
    motors[:, joints:] = np.where(
        tensions, rng.uniform(-10.0, 10.0, given.shape), given * (1.0 + rng.uniform(-0.03, 0.03, given.shape))
    )
    vectors = rng.normal(size=(3, 3, 3)) * np.array([5.0, 3.0, 0.3])[:, None, None]
    spread = 0.3 if kind in ("arm", "limp", "three_links", "foreign") else 0.03
    return robot, Case(motors, *vectors), robot.rest + rng.uniform(-spread, spread, (3, robot.n_springs))


@pytest.mark.parametrize("kind", ROBOTS)
def test_plain_torques_and_tips_are_those_of_pinocchio(kind: str, rng: np.random.Generator) -> None:
    """Recursive Newton-Euler with an external force on the tip, at the configuration that plain statics makes."""
    robot, case, springs = drawn(kind, rng)
    plain, rigid = PlainStatics(robot), robot.pinocchio.copy()
    joints = plain._joints(case.motors, plain._strains(case.motors, springs))
    torques, size, tips = plain._torques(case, plain._strains(case.motors, springs))
    tip = rigid.frames[robot.frame_id(robot.tip)]
    for row in range(3):
        q, rigid.gravity.linear = robot.embed(joints[row]), case.gravity[row]
        assert q == pytest.approx(robot.configuration(case.motors[row], springs[row]), abs=1e-12)
        data = rigid.createData()
        pin.framesForwardKinematics(rigid, data, q)
        placed = data.oMf[robot.frame_id(robot.tip)]
        assert tips[row] == pytest.approx(placed.translation, abs=1e-12)
        external = pin.StdVec_Force()
        external.extend([pin.Force.Zero() for _ in range(rigid.njoints)])
        turn = placed.rotation.T
        external[tip.parentJoint] = tip.placement.act(pin.Force(turn @ case.forces[row], turn @ case.moments[row]))
        still = np.zeros(rigid.nv)
        assert torques[row] == pytest.approx(-pin.rnea(rigid, data, q, still, still, external), abs=1e-12 * size[row])


@pytest.mark.parametrize("kind", ROBOTS)
def test_the_solvers_see_the_same_residual_and_tangent(kind: str, rng: np.random.Generator) -> None:
    from softrobots.statics.elastic_state import elastic_state
    from softrobots.statics.loads import Load

    robot, case, springs = drawn(kind, rng)
    plain = PlainStatics(robot)
    balance = plain.balance(case, springs)
    for row in range(3):
        wrench = np.concatenate([case.forces[row], case.moments[row]])
        state = elastic_state(robot, case.motors[row], springs[row], Load.of(robot, wrench=wrench, gravity=case.gravity[row]))
        assert state.residual == pytest.approx(balance.residual[row], abs=1e-12 * balance.size[row] + balance.rounding[row])
        assert state.scale == pytest.approx(balance.size[row], rel=1e-12)
        count = len(robot.structure.motor_joints)
        assert state.load.motors[:count] == pytest.approx(balance.motor_torques[row], abs=1e-12 * balance.size[row])
    # Central differences with steps of 1e-5: 1e-10 of the third derivative; a knee in the way would be worse.
    tangent = plain_stability.tangent(plain, case.row(2), springs[2])
    assert np.abs(tangent - state.tangent).max() <= 1e-7 * np.abs(state.tangent).max()
    mass = plain_stability.mass_matrix(plain, case.row(2), springs[2])
    assert np.abs(mass - mass_matrix(robot, state.point, state.q)).max() <= 1e-7 * np.abs(mass).max()


def test_rounding_is_of_the_spring_loads_also_where_they_are_in_balance() -> None:
    """A spring's load `k q` is exact to an ulp of itself, however little of it is left when the load is taken off."""
    arm, motors, force = model("arm"), (0.3, 0.6, -0.8), (0.0, 10.0, -15.0)
    found = sr.solve_equilibrium(arm, motors, force)
    balance = PlainStatics(arm).balance(one(motors, force), found.q_springs[None])
    loads = 172.71 * np.linalg.norm(found.q_springs)
    assert balance.imbalance[0] < 1e-9 * loads
    assert balance.rounding[0] == pytest.approx(16.0 * np.finfo(float).eps * loads, rel=1e-12, abs=0.0)


def test_slopes_of_a_section_by_complex_steps_are_its_differences(rng: np.random.Generator) -> None:
    for size in (1e-9, 1e-2, 0.1, 1.0):
        z, length = size * rng.normal(size=4) * np.array([1.0, 1.0, 1.0, 0.1]), np.array(0.3)
        expected = central_difference(lambda at, h=length: section_joints(at, h), z)
        assert section_slopes(z, length) == pytest.approx(expected, abs=1e-8)  # differences of steps of 1e-6


# --- The soak: its core small, and that it can fail

DEAR = ("long_rod", "odd_arm_batch", "reach", "helix", "helix_lumped", "lumped", "mounted")  # a second each to make
SMALL = [family for family in FAMILIES if family.name not in DEAR]


def test_a_small_soak_breaks_no_law() -> None:
    tallies = soak(200, seed=1, families=SMALL, compiler=False)
    assert [law for tally in tallies.values() for law in tally.broken] == []
    assert sum(tally.cases for tally in tallies.values()) >= 190
    assert sum(tally.outcomes[STABLE] for tally in tallies.values()) > 170
    assert all(tally.residual <= 1.01 for tally in tallies.values())
    text = table(tallies)
    assert text.count("\n") == len(SMALL) + 2
    assert text.splitlines()[-1].endswith("| 0 |")


def tampered(monkeypatch: pytest.MonkeyPatch, change: Callable[[Answer], Answer], name: str = "arm") -> list[str]:
    """Laws that are broken when the answers of a family are changed."""
    family = family_of(name)
    job = jobs.JOBS[family.job]
    monkeypatch.setitem(jobs.JOBS, family.job, lambda *asked: [change(answer) for answer in job(*asked)])
    tally, _ = judge(family, 3, 0, range(8))
    return [law for _, law in tally.broken]


def moved(answer: Answer, by: float) -> Answer:
    return replace(answer, springs=answer.springs + by)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda answer: moved(answer, 1e-9), "times the tolerance out of balance"),
        (lambda answer: moved(answer, np.nan), "reported as stable, 1e+300 times the tolerance"),
        (lambda answer: replace(answer, outcome="not stable"), "reported as not stable, least eigenvalue"),
        (lambda answer: replace(answer, iterations=201), "201 iterations"),
        (lambda answer: replace(answer, claims={"tip": answer.claims["tip"] + 1e-6}), "the tip is off by 1e-06"),
        (
            lambda answer: replace(answer, claims={"motor_torques": answer.claims["motor_torques"] + 1e-3}),
            "motor torques is off",
        ),
        (lambda answer: replace(answer, broken="a number"), "a number"),
    ],
)
def test_a_soak_sees_what_is_wrong(monkeypatch: pytest.MonkeyPatch, change: Callable[[Answer], Answer], words: str) -> None:
    broken = tampered(monkeypatch, change)
    assert any(words in law for law in broken)


def test_a_soak_sees_a_saddle_that_is_called_stable() -> None:
    """The straight arm beyond its buckling load balances."""
    arm, family = model("arm"), replace(family_of("arm"), tangents=1)
    case, tally = one((0, 0, 0), (-150, 0, 0)), Tally()
    verdicts._check(tally, family, 0, PlainStatics(arm), case, [Answer(0, STABLE, springs=np.zeros(4))])
    assert [law for _, law in tally.broken] == ["reported as stable, least eigenvalue -0.315 within 8e-09"]
    verdicts._check(tally, family, 0, PlainStatics(arm), case, [Answer(0, "not stable", springs=np.zeros(4))])
    assert len(tally.broken) == 1


def test_a_soak_sees_a_wrong_verdict_under_a_moment() -> None:
    """The default arm at a large moment diverges, at one of 20 N m it flutters, at a small one it is stable."""
    arm, family = model("arm"), replace(family_of("arm"), tangents=1)
    kinds = set()
    for moment in ((2, 1, 0.5), (5, 20, -15), (60, -40, 20)):
        case = one((0.3, 0.6, -0.8), (3, 10, -15))._replace(moments=np.array([moment], dtype=float))
        found = sr.solve_equilibrium(arm, case.motors[0], wrench=[*case.forces[0], *moment])
        said = STABLE if found.stable else "not stable"
        for outcome in (STABLE, "not stable"):
            tally = Tally()
            verdicts._check(tally, family, 0, PlainStatics(arm), case, [Answer(0, outcome, springs=found.q_springs)])
            assert [law.startswith(f"reported as {outcome}, vib") for _, law in tally.broken] == [True] * (outcome != said)
        kinds.add(found.stability.kind)
    assert len(kinds) > 1


def test_a_soak_sees_muscles_that_are_not_as_long_as_they_are_given(monkeypatch: pytest.MonkeyPatch) -> None:
    pcc, family = model("pcc"), family_of("pcc")
    tally, case = Tally(), one(pcc.relaxed_motors)
    verdicts._check(tally, family, 0, PlainStatics(pcc), case, [Answer(0, STABLE, springs=np.zeros(pcc.n_springs))])
    assert tally.broken == []
    held = one(pcc.relaxed_motors * 1.01)
    changed = Answer(0, STABLE, springs=np.zeros(pcc.n_springs), changed={"motors": np.array(pcc.relaxed_motors)})
    verdicts._check(tally, family, 0, PlainStatics(pcc), held, [changed])
    assert tally.broken == []  # what was sought counts
    wrong = PlainStatics(pcc)
    strains = wrong._strains
    monkeypatch.setattr(wrong, "_strains", lambda *asked: strains(*asked) + 1e-3)  # [rad and m], of each section
    verdicts._check(tally, family, 0, wrong, case, [Answer(0, STABLE, springs=np.zeros(pcc.n_springs))])
    assert any("a muscle is 0.00" in law and "m from its length" in law for _, law in tally.broken)


@pytest.mark.parametrize("kind", ["pcc", "mounted"])
def test_a_soak_sees_a_direction_that_the_solver_does_not_know(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Out of balance along one elastic coordinate, of a robot whose coordinates leave that one out."""
    robot = model(kind)
    for number, springs in enumerate(1e-3 * np.eye(robot.n_springs)):
        plain = PlainStatics(robot)
        monkeypatch.setattr(plain, "_free", np.delete(plain._free, number, axis=0))
        found = plain.balance(one(robot.relaxed_motors), springs[None])
        assert found.imbalance[0] > 1e-6  # what the soak looks at; 1e-10 is let through
        assert len(found.residual[0]) == robot.n_springs - 1


def test_errors_that_are_not_ours_hangs_and_numbers_that_are_none_are_broken_laws() -> None:
    def ask(what: Callable[[], Any]) -> Answer:
        return jobs._answer(0, lambda row: what())

    def fail(error: BaseException) -> Any:
        raise error

    assert "no error of softrobots" in ask(lambda: 1 / 0).broken
    assert ask(lambda: fail(Hang())).broken.startswith("no answer after")
    found = sr.solve_equilibrium(model("arm"), (0, 0, 0))
    fine = sr.EquilibriumNotFound("none", best=found, residual=1.0, iterations=7)
    answer = ask(lambda: fail(fine))
    assert (answer.outcome, answer.iterations, answer.broken) == ("EquilibriumNotFound", 7, "")
    assert ask(lambda: fail(sr.NeutralEquilibrium("n"))).broken == ""
    nowhere = replace(found, residual=float("nan"))
    for best, words in ((nowhere, "not finite"), (None, "no best iterate")):
        error = sr.EquilibriumNotFound("none", best=best, residual=1.0, iterations=7)
        assert words in ask(lambda error=error: fail(error)).broken


def test_a_call_that_hangs_is_interrupted() -> None:
    begun = time.perf_counter()
    with pytest.raises(Hang), limited(0.05):
        time.sleep(20.0)
    assert time.perf_counter() - begun < 10.0
    with limited(20.0):
        pass


def test_compiled_code_that_hangs_ends_the_soak_with_a_broken_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing interrupts it in its own process; a process that only starts takes longer than this patience."""
    monkeypatch.setattr("studies.soak.running.PATIENCE", 1e-3)
    tallies = soak(6, processes=2, families=[family_of("arm")], compiler=False)
    assert ["nothing was done for 0.001 s" in law for _, law in tallies["arm"].broken] == [True]
    assert tallies["arm"].cases == 0


def test_every_loop_of_the_compiled_solvers_ends() -> None:
    """A loop without a count goes on with a share that it halves or doubles, up to a limit that the share itself has.

    Those of motion advance by a part of the step, which is halved down to a limit, or by a row of the result; those of friction
    have a number of evaluations.
    """
    loops = []
    for file in (CHECKOUT / "softrobots" / "compiled").rglob("*drivers.py"):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for loop in (node for node in ast.walk(tree) if isinstance(node, ast.While)):
            last = loop.test.values[-1] if isinstance(loop.test, ast.BoolOp) else loop.test
            scaled = [ast.unparse(node) for node in ast.walk(loop) if isinstance(node, ast.AugAssign)]
            loops.append((ast.unparse(last), scaled))
        calls = [node.iter for node in ast.walk(tree) if isinstance(node, ast.For)]
        assert all(isinstance(call, ast.Call) and ast.unparse(call.func) == "range" for call in calls)
    goes_on_by = {
        "share > 1e-12 * largest": "share *= 0.5",
        "2.0 * share * length < longest": "share *= 2.0",
        "done < 1.0": "part *= 0.5",
        "left > 0.0": "left -= 1.0",
        "times[row] <= grid[step + 1] or step == n_steps - 1": "row += 1",
        "times[row] <= grid[step + 1] or step == len(grid) - 2": "row += 1",
    }
    assert {test for test, _ in loops} == set(goes_on_by)
    assert all(goes_on_by[test] in changed for test, changed in loops)


def test_cases_are_the_same_in_every_run_and_cover_what_is_hard() -> None:
    family = family_of("arm")
    arm = family.robot(family.random(0, 0))
    case = draw_cases(family, arm, family.random(0, 0))
    twin = draw_cases(family, arm, family.random(0, 0))
    other = draw_cases(family, arm, family.random(0, 1))
    assert all(np.array_equal(a, b) for a, b in zip(case, twin, strict=True))
    assert not np.array_equal(case.motors, other.motors)
    sizes = np.linalg.norm(case.forces, axis=1)
    assert sizes.min() == 0.0
    assert sizes.max() > 0.9 * LARGEST_FORCE
    assert np.any((sizes > 0.0) & (sizes < 1e-3))
    assert np.any(case.motors[:, 2] == 0.0)  # straight elbow
    assert np.any(np.abs(case.motors[:, 2]) == np.pi)  # folded
    on_axis = np.hypot(*sr.solve_equilibrium(arm, (0.4, np.pi / 2, 0.0)).tip_position[:2])
    assert on_axis < 1e-12
    assert np.any((np.abs(case.motors[:, 1]) == np.pi / 2) & (case.motors[:, 2] == 0.0))  # the tip on the axis of motor 1
    assert 0 < np.count_nonzero(case.gravity[:, 2]) < len(sizes)


def test_parts_add_up_and_every_family_has_some() -> None:
    parts = parts_of(1000, FAMILIES)
    assert {part.family for part in parts} == {family.name for family in FAMILIES}
    assert abs(sum(part.rows for part in parts) - 1000) <= len(FAMILIES)
    assert sum(family.share for family in FAMILIES) == pytest.approx(1.0)
    assert max(part.rows for part in parts if part.family == "arm_batch") <= family_of("arm_batch").chunk


def test_a_case_is_run_again_by_its_number() -> None:
    tally, told = again("odd_arm", 41)
    assert tally.cases == 1
    assert tally.broken == []
    assert "outcome: stable" in told
    assert "forces: [" in told
    with pytest.raises(sr.NameNotFound, match="odd_arm"):
        again("arms", 0)
    with pytest.raises(sr.ParameterError, match="zero or above"):
        again("arm", -1)


def test_processes_count_the_same() -> None:
    families = [family_of("odd_arm")]
    alone, together = (soak(30, processes=count, families=families)["odd_arm"] for count in (1, 2))
    assert alone.outcomes == together.outcomes
    assert alone.residual == together.residual


# --- Extreme loads, stiffnesses and poses


def compiled(kind: str) -> CompiledModel:
    return jobs._compiled(model(kind), False)  # shared with the soak above


@pytest.mark.parametrize("motors", [(0.0, 0.0, 0.0), (0.7, np.pi / 2, 0.0), (0.3, 0.5, 0.0), (0.2, 1.0, np.pi - 2.0)])
def test_loads_from_nothing_to_a_kilonewton(motors: tuple[float, float, float], rng: np.random.Generator) -> None:
    """Straight; the tip on the axis of motor 1, upright; straight elbow; on the axis, bent."""
    arm = model("arm")
    forces = np.array([size * direction for size in (0.0, 1e-9, 100.0, 1000.0) for direction in _ways(rng)])
    batch = compiled("arm").equilibria(motors, forces)
    assert batch.certified.all()
    for force, springs in zip(forces, batch.q_springs, strict=True):
        check(arm, one(motors, force), springs)
        found = sr.solve_equilibrium(arm, motors, force)
        assert found.stable
        assert found.iterations <= 200
        check(arm, one(motors, force), found.q_springs)


def _ways(rng: np.random.Generator) -> np.ndarray:
    return np.vstack([np.eye(3), -np.eye(3), [-1.0, 1e-10, 0.0], rng.normal(size=3)])


SADDLES = [  # motors, force, weight: what the compiled descent gave up, beside the straight arm that balances
    ((-1.9623502575, np.pi / 2, 0.0), (2.1615657945e-06, -1.8128338919e-06, -347.845358118675), False),
    ((0.0, 0.0, 0.0), (-314.6394897731249, 2.1445274059e-08, 2.2655829878e-08), False),
    ((0.0, 0.0, 0.0), (-151.52052108961084, -3.769210939931e-06, -4.030008452072e-07), False),
    ((3.006723953, -np.pi / 2, 0.0), (-6.8249930e-09, -7.4794204e-10, 449.5381902919), True),
    ((-0.146144077, np.pi / 2, 0.0), (-6.8271573545e-09, 7.9288727270e-09, -271.86068594546), True),
]


@pytest.mark.parametrize(("motors", "force", "weight"), SADDLES)
def test_the_compiled_descent_leaves_what_is_beside_a_saddle(motors: Any, force: Any, weight: bool) -> None:
    """An axial push with a micronewton aside ended there, neither settled nor stable."""
    gravity = GRAVITY if weight else None
    batch = compiled("arm").equilibria(motors, force, gravity=gravity)
    assert batch.counts() == {Status.CERTIFIED: 1}
    assert np.abs(batch.q_springs).max() > 0.5
    check(model("arm"), one(motors, force, GRAVITY * weight), batch.q_springs[0])


def test_the_weight_of_an_upright_robot_does_not_hide_the_last_digits() -> None:
    """It loads no spring, but its energy is mass times height: rounding of that stopped the descent above the tolerance."""
    motors, force = (-1.80253721856536, np.pi / 2, 0.0), (-0.007623893717, 0.001159839596, -2.9036012594e-05)
    found = sr.solve_equilibrium(model("arm"), motors, force, gravity=sr.EARTH_GRAVITY)
    assert found.stable
    assert found.iterations < 20
    check(model("arm"), one(motors, force, GRAVITY), found.q_springs)
    batch = compiled("arm").equilibria(motors, force, gravity=GRAVITY)
    assert batch.certified.all()


@pytest.fixture(scope="module")
def muscles() -> tuple[sr.SoftModel, CompiledModel]:
    """The arm of muscles with given lengths, four sections a segment."""
    made = sr.load_model(sr.PccArm())
    return made, jobs._compiled(made, False)


@pytest.mark.parametrize("row", [66, 153, 177, 244])
def test_held_sums_do_not_drift(row: int, muscles: tuple[sr.SoftModel, CompiledModel]) -> None:
    """Far beyond buckling the elimination magnifies rounding: certified answers were 16 times the tolerance off."""
    pcc, fast = muscles
    family = family_of("pcc_batch")
    case = draw_cases(family, pcc, family.random(0, 0))
    gravity = case.gravity[row] if case.gravity[row].any() else None
    batch = fast.equilibria(case.motors[row], case.forces[row], gravity=gravity)
    assert batch.certified.all()
    assert np.linalg.norm(PlainStatics(pcc).balance(case.row(row), batch.q_springs).residual) <= 0.2e-10 * 900.0
    check(pcc, case.row(row), batch.q_springs[0])


def test_a_load_that_folds_a_muscle_is_at_the_end_of_the_range_in_both_engines(
    muscles: tuple[sr.SoftModel, CompiledModel],
) -> None:
    pcc, fast = muscles
    motors = (0.48334803, 0.45491895, 0.49956668, 0.58643101, 0.53079498, 0.55294636)
    force = (-30.77011855, 58.61834472, -359.47659668)
    assert fast.equilibria([motors], [force]).counts() == {Status.OUT_OF_RANGE: 1}
    with pytest.raises(sr.EquilibriumNotFound, match="presses section_1_1 to the end of its range"):
        sr.solve_equilibrium(pcc, motors, force)


def test_unequal_muscles_under_weight_settle(muscles: tuple[sr.SoftModel, CompiledModel]) -> None:
    """The energy counts what the lengths lack to second order only; searches that trusted it alone stopped in 6 of 100."""
    pcc, fast = muscles
    random = np.random.default_rng(0)
    motors, forces = 0.524 + random.uniform(-0.06, 0.06, (200, 6)), random.uniform(-30.0, 30.0, (200, 3))
    batch = fast.equilibria(motors, forces, gravity=GRAVITY)
    assert batch.counts() == {Status.CERTIFIED: 200}
    for row in range(0, 200, 40):
        check(pcc, one(motors[row], forces[row], GRAVITY), batch.q_springs[row])


def test_small_loads_on_muscles_of_given_length_settle(muscles: tuple[sr.SoftModel, CompiledModel]) -> None:
    """What the muscles hold is a thousand newtons; its rounding is no residual of the free coordinates."""
    pcc, fast = muscles
    family = family_of("pcc_batch")
    case = draw_cases(family, pcc, family.random(0, 0))
    rows = [204, 256, 343]
    assert np.linalg.norm(case.forces[rows], axis=1).max() < 1e-3
    batch = fast.equilibria(case.motors[rows], case.forces[rows])
    assert batch.certified.all()
    for row, springs in zip(rows, batch.q_springs, strict=True):
        check(pcc, case.row(row), springs)


@pytest.mark.parametrize("force", [(0.0, 10.0, -20.0), (1.0, 10.0, -20.0), (-9.59942319, -6.92074648, -16.03188487)])
def test_the_compiled_descent_of_the_arm_of_muscles_leaves_its_saddle(
    muscles: tuple[sr.SoftModel, CompiledModel], force: tuple[float, float, float]
) -> None:
    pcc, fast = muscles
    batch = fast.equilibria(pcc.relaxed_motors, force, gravity=GRAVITY)
    assert batch.counts() == {Status.CERTIFIED: 1}
    check(pcc, one(pcc.relaxed_motors, force, GRAVITY), batch.q_springs[0])


def test_a_stable_rod_in_a_nearly_round_valley_is_settled() -> None:
    """Upright under its own weight, buckled: the bow turns almost freely, and a whole Newton step leads out of the valley."""
    rod = sr.load_model(sr.PccArm(elastic_sections=3, muscle_azimuths=()))
    text = rod.urdf.replace('EI="1.92"', 'EI="0.5"').replace('GJ="1.28"', 'GJ="60.0"').replace('EA="2400.0"', 'EA="2.5e8"')
    soft = sr.load_model(text)
    for gravity in (8.0, 9.81, 12.0):
        found = sr.solve_equilibrium(soft, (), gravity=(0, 0, -gravity))
        assert np.abs(found.q_springs).max() > 0.05
        check(soft, one((), gravity=(0, 0, -gravity)), found.q_springs, stable=None)


@pytest.mark.parametrize("ratio", [1e-3, 1.0, 1e3, 1e6])
def test_stiffness_ratios(ratio: float, rng: np.random.Generator) -> None:
    arm = model("arm")
    for soft in range(arm.n_springs):
        table = {
            name: (172.71 * (ratio if place == soft else 1.0), 0.1 * place) for place, name in enumerate(arm.spring_joints)
        }
        odd = sr.load_model(arm.urdf, springs=table)
        motors, force = rng.uniform(-3.0, 3.0, 3), rng.normal(size=3) * 30.0
        found = sr.solve_equilibrium(odd, motors, force, gravity=sr.EARTH_GRAVITY)
        assert found.stable
        check(odd, one(motors, force, GRAVITY), found.q_springs)


def test_springs_without_stiffness_are_refused() -> None:
    for stiffness in (0.0, -1.0, 1e-31):
        with pytest.raises(sr.ParameterError, match="positive"):
            sr.load_model(model("arm").urdf, springs={"spring_1_up": stiffness})


@pytest.mark.parametrize(("chain", "count"), [("sections", 1), ("sections", 8), ("lumped", 6)])
def test_chains_of_many_sections(chain: str, count: int) -> None:
    """More than Pinocchio's workspace takes are in the recorded soak: xacro needs half a minute for 200."""
    rod = sr.load_model(
        sr.PccArm(segment_lengths=(1.0,), chain=chain, elastic_sections=count, hinges=count, muscle_azimuths=())
    )
    forces = np.array([[0.3, 0.0, 0.0], [2.0, -1.0, 3.0], [0.1, 0.0, -4.0]])
    batch = sr.compile(rod, backend="python").equilibria((), forces, gravity=0.1 * GRAVITY)
    assert batch.certified.all()
    balance = PlainStatics(rod).balance(
        Case(np.zeros((3, 0)), forces, np.tile(0.1 * GRAVITY, (3, 1)), 0.0 * forces), batch.q_springs
    )
    assert np.all(np.linalg.norm(balance.residual, axis=1) <= 1e-10 * balance.size + balance.rounding)


# --- Numbers too large to compute with


@pytest.mark.parametrize("backend", ["python", "numba"])
def test_what_is_too_large_is_refused_before_it_is_wrong(backend: str) -> None:
    """At 1e16 rad the compiled sine means nothing: certified answers lay 24 km away. And 1e31 N passed unchecked."""
    if backend == "numba" and importlib.util.find_spec("numba") is None:
        missing("numba is not installed")
    fast = compiled("arm") if backend == "python" else sr.compile(model("arm"), backend=backend)
    motors, force = np.array([0.3, 0.6, -0.8]), np.array([0.0, 10.0, -15.0])
    for huge in (2.0 * LARGEST_POSITION, 1e16, 1e29):
        far = np.array([huge, 0.6, -0.8])
        with pytest.raises(sr.ParameterError, match="for compiled solvers"):
            fast.equilibrium(far, force)
        with pytest.raises(sr.ParameterError, match="for compiled solvers"):
            fast.equilibrium(far, force, gravity=GRAVITY)
        batch = fast.equilibria(np.array([far, motors, -far]), force)
        assert batch.status.tolist() == [Status.NOT_A_NUMBER, Status.CERTIFIED, Status.NOT_A_NUMBER]
    for huge in (1e31, 1e100, 1e149):
        with pytest.raises(sr.ParameterError, match="force"):
            fast.equilibrium(motors, np.array([0.0, huge, 0.0]))
    near = fast.equilibrium(np.array([0.9 * LARGEST_POSITION, 0.6, -0.8]), force)
    expected = sr.solve_equilibrium(model("arm"), (0.9 * LARGEST_POSITION, 0.6, -0.8), force)
    assert near.tip_position == pytest.approx(expected.tip_position, abs=1e-9)
    with pytest.raises(sr.ParameterError, match="rest positions of springs within"):
        sr.compile(sr.load_model(model("arm").urdf, springs={"spring_1_up": (1.0, 1e10)}), backend="python")


# --- Moments


def test_where_the_path_of_the_whole_load_turns_back_the_moments_grow_alone() -> None:
    """867 N and 1.4 N m: there is an equilibrium, on no path from zero load."""
    arm = model("arm")
    motors = (0.20626073722580562, -0.6259864319449453, -2.2990825922344698)
    force = (633.6724538307325, -203.96078999479553, 555.9386835480127)
    moment = (-1.2601314632132419, 0.6222672308654772, -0.056069818692433174)
    found = sr.solve_equilibrium(arm, motors, wrench=(*force, *moment), gravity=sr.EARTH_GRAVITY)
    assert found.iterations <= 200
    check(arm, one(motors, force, GRAVITY, moment), found.q_springs, stable=found.stable)


# --- The recorded run


def script() -> dict[str, Any]:
    return runpy.run_path(str(CHECKOUT / "scripts" / "soak.py"))


def test_the_script_counts_records_and_runs_a_case_again(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    (docs / "validation.md").write_text("<!-- soak:begin -->\n<!-- soak:end -->\n")
    run = script()
    few = [family for family in FAMILIES if family.name in ("odd_arm", "arm_moments")]
    monkeypatch.setitem(run["run"].__globals__, "FAMILIES", few)  # the record holds all families
    words = ["--cases", "20", "--processes", "1", "--docs", str(tmp_path)]
    assert run["main"]([*words, "--json", str(tmp_path / "a.json")]) == 0
    out, err = capsys.readouterr()
    assert "20/20" in err
    assert "| **all** | 20 |" in out
    record = json.loads((docs / "validation" / "soak.json").read_text())
    assert record["families"] == json.loads((tmp_path / "a.json").read_text())["families"]
    assert (record["cases"], record["broken"]) == (20, 0)
    assert "| **all** | 20 |" in (docs / "validation.md").read_text()
    assert run["main"](["--case", "odd_arm:3"]) == 0
    assert "outcome: stable" in capsys.readouterr().out
    refused = ["--case", "odd_arm"], ["--case", "odd:1"], ["--cases", "0"], ["--docs", "--families", "odd_arm"]
    for wrong in refused:
        assert run["main"](wrong) == 2
    assert capsys.readouterr().err.count("error: ") == len(refused)


def test_the_script_fails_and_names_the_case_where_a_law_is_broken(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    job = jobs.JOBS["solve"]
    monkeypatch.setitem(jobs.JOBS, "solve", lambda *asked: [moved(answer, 1e-6) for answer in job(*asked)])
    assert script()["main"](["--cases", "3", "--families", "odd_arm", "--processes", "1", "--seed", "5"]) == 1
    assert "python scripts/soak.py --seed 5 --case odd_arm:2" in capsys.readouterr().out
    assert script()["main"](["--case", "odd_arm:2", "--seed", "5"]) == 1


def test_the_recorded_soak_broke_no_law() -> None:
    record = json.loads((CHECKOUT / "docs" / "validation" / "soak.json").read_text(encoding="utf-8"))
    page = (CHECKOUT / "docs" / "validation.md").read_text(encoding="utf-8")
    assert record["broken"] == 0
    assert set(record["families"]) == {family.name for family in FAMILIES}
    for numbers in record["families"].values():
        assert numbers["broken"] == []
        assert numbers["residual"] <= verdicts.MARGIN
        assert numbers["iterations"] <= verdicts.MOST_ITERATIONS
        assert "hang" not in numbers["outcomes"]
    tallies = {name: _tally(record["families"][name]) for name in (family.name for family in FAMILIES)}
    assert table(tallies) in page


def _tally(numbers: dict[str, Any]) -> Tally:
    made = Tally(**{name: value for name, value in numbers.items() if name != "outcomes"})
    made.outcomes.update(numbers["outcomes"])
    return made


def test_shares_of_families_are_what_the_table_says() -> None:
    assert len({family.name for family in FAMILIES}) == len(FAMILIES)
    assert all(isinstance(family, Family) and family.job in jobs.JOBS for family in FAMILIES)
