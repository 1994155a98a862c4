"""Simulators that get an exported file, and nothing else, find Pinocchio's equilibrium, live and in the recorded run."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import softrobots as sr
from softrobots.core.errors import NotConverged
from softrobots.export import to_mjcf, to_sdf
from studies.interop import drake_statics, mujoco_statics
from studies.interop.cases import FORCES, MUSCLE_POSES, WELDED, EquilibriumCase, equilibrium_cases
from studies.interop.measurement import agreed
from studies.interop.newton import balance_point
from studies.interop.outcomes import Question
from studies.interop.results import BEGIN, END, PAGE, page_with, read_results
from studies.interop.simulators import SIMULATORS, EquilibriumRow, compare_equilibrium
from studies.interop.springs_read import springs_read
from tests.conftest import CHECKOUT, load_script
from tests.support.tables import each_row

pytestmark = pytest.mark.study

ROBOTS = tuple(FORCES)
STATIC, SIMULATED, SINGLE = 1e-9, 1e-6, 1e-3  # allowed differences [rad or m]
Tool = Callable[[str], ModuleType]


def run_script(arguments: list[str]) -> int:
    return load_script("interoperability").main(arguments)


@lru_cache
def cases(robot: str) -> tuple[EquilibriumCase, ...]:
    return tuple(equilibrium_cases([robot]))


def bent(robot: str) -> list[EquilibriumCase]:
    """The third pose, weightless and under gravity: of the arm one that bends both links, of the tubes the one on its axis."""
    return list(cases(robot)[4:6])


# --- The cases


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_cases_are_worth_comparing(robot: str) -> None:
    """Stable, within limits and wrinkling, all different, and bent by the load by far more than the tolerances."""
    assert len(cases(robot)) == 10
    assert len({case.name for case in cases(robot)}) == 10
    for case in cases(robot):
        found = case.expected
        assert found.stable
        assert found.within_limits
        assert not found.wrinkled
        rest = {name: rest for name, (_, rest) in case.model.spring_table.items()}
        assert case.difference(rest) > 5e-3
        assert found.load.wrenches["tip"][:3] == pytest.approx(FORCES[robot])
    for number, case in enumerate(cases(robot)):
        others = cases(robot)[number + 1 :]
        assert all(case.difference(other.joints) > 1e-5 for other in others if other.joints.keys() == case.joints.keys())


def test_tensions_hold_the_muscle_lengths_that_were_chosen() -> None:
    """The arm is solved with lengths, and again with the tensions that hold them: the same lengths, to rounding."""
    rest = sr.load_model(sr.PccArm(chain="lumped")).relaxed_motors
    for case in cases("pcc_arm_lumped"):
        assert case.model.muscle_input == "forces"
        assert np.abs(case.expected.muscle_lengths - rest - MUSCLE_POSES[case.pose]).max() < 1e-11


def test_a_case_refuses_other_robots_and_other_joints() -> None:
    with pytest.raises(sr.ParameterError, match="helix_tube_lumped"):
        next(equilibrium_cases(["helix_tube"]))
    case = cases("inflatable_arm")[0]
    some = dict(list(case.joints.items())[1:])
    with pytest.raises(sr.ParameterError, match="the spring joints of the robot, spring_1_side"):
        case.difference(some)
    assert case.difference(case.joints) == 0.0
    assert case.difference({name: value - 0.25 for name, value in case.joints.items()}) == 0.25


# --- Simulators


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("name", "module"), [("MuJoCo", "mujoco"), ("Drake", "pydrake")])
def test_forces_balance_where_pinocchio_says(tool: Tool, name: str, module: str, robot: str) -> None:
    tool(module)
    for case in cases(robot):
        row = compare_equilibrium(case, name, simulated=False)
        assert row.static_difference is not None
        assert row.static_difference <= STATIC, case.name
        assert row.contacts == 0
        assert row.agrees


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("name", "module"), [("MuJoCo", "mujoco"), ("Drake", "pydrake")])
def test_a_minute_of_simulation_ends_where_pinocchio_says(tool: Tool, name: str, module: str, robot: str) -> None:
    """Default settings, contacts on. A pose of the chains under gravity (seconds each), all of the arm; the script does all."""
    tool(module)
    chosen = cases(robot) if robot == "inflatable_arm" else bent(robot)[1:]
    with ThreadPoolExecutor(2) as pool:
        rows = list(pool.map(lambda case: compare_equilibrium(case, name, static=False), chosen))
    for case, row in zip(chosen, rows, strict=True):
        assert row.simulated_difference is not None
        assert row.simulated_difference <= SIMULATED, case.name
        assert row.final_speed is not None
        assert row.final_speed < 1e-12
        assert row.contacts == 0
        assert row.agrees


@pytest.mark.parametrize("robot", ROBOTS)
def test_pybullet_rests_where_pinocchio_says(bullet: ModuleType, robot: str) -> None:
    for case in bent(robot):
        row = compare_equilibrium(case, "PyBullet")
        assert row.static_difference is None  # it does not tell its torques
        assert row.simulated_difference is not None
        assert row.simulated_difference <= SINGLE, case.name
        assert row.agrees


def changed(text: str, stiffness: float) -> str:
    """A file with the first stiffness in it changed by a factor."""
    pattern = r'(stiffness="|<spring_stiffness>)([0-9.e+-]+)'
    made, count = re.subn(pattern, lambda found: f"{found[1]}{float(found[2]) * stiffness!r}", text, count=1)
    assert count == 1
    return made


def question(case: EquilibriumCase, text: str) -> Question:
    return Question(text, case.model.tip, case.force, case.gravity)


def test_mujoco_answers_from_the_file_alone(tool: Tool) -> None:
    """A spring softer by a thousandth bends by a thousandth more: its answer comes from the number in the file."""
    tool("mujoco")
    case = bent("inflatable_arm")[1]
    text = to_mjcf(case.model, case.expected.q_motors, actuators=WELDED, gravity=case.gravity)
    softer = changed(text, 0.999)
    first = next(iter(case.joints))
    for found in (mujoco_statics.static_equilibrium(question(case, softer)), mujoco_statics.simulate(question(case, softer))):
        assert found.joints[first] == pytest.approx(case.joints[first] / 0.999, rel=2e-4)
        assert case.difference(found.joints) > 1e-5
    weightless = to_mjcf(case.model, case.expected.q_motors, actuators=WELDED)
    assert case.difference(mujoco_statics.static_equilibrium(question(case, weightless)).joints) > 1e-3


def test_contacts_are_on(tool: Tool) -> None:
    """The links of the folded arm touch across their motor; without the exported exclusion that holds them apart."""
    tool("mujoco")
    case = next(case for case in cases("inflatable_arm") if case.pose == "folded")
    text = to_mjcf(case.model, case.expected.q_motors, actuators=WELDED, gravity=case.gravity)
    assert text.count("<exclude") == 1
    found = mujoco_statics.simulate(question(case, re.sub(r"<exclude[^>]*/>", "", text)), 10.0)
    assert found.contacts > 0
    assert case.difference(found.joints) > 1e-3


def test_drake_answers_from_the_file_alone(tool: Tool) -> None:
    tool("pydrake")
    case = bent("inflatable_arm")[1]
    softer = changed(to_sdf(case.model, case.expected.q_motors, actuators=WELDED), 0.999)
    first = next(iter(case.joints))
    for found in (drake_statics.static_equilibrium(question(case, softer)), drake_statics.simulate(question(case, softer))):
        assert found.joints[first] == pytest.approx(case.joints[first] / 0.999, rel=2e-4)
        assert case.difference(found.joints) > 1e-5


def test_an_unstable_simulation_is_told(tool: Tool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo would start anew from its initial state, which looks like an answer. It writes a log where it runs."""
    tool("mujoco")
    monkeypatch.chdir(tmp_path)
    case = cases("inflatable_arm")[0]
    text = re.sub(r' damping="[^"]*"', "", to_mjcf(case.model, case.expected.q_motors, actuators=WELDED))
    with pytest.raises(NotConverged, match="found its simulation unstable") as caught:
        mujoco_statics.simulate(question(case, changed(text, 1e9)), 1.0)
    assert caught.value.best.keys() == case.joints.keys()


def test_what_does_not_balance_is_told() -> None:
    with pytest.raises(NotConverged, match="no balance in 8 iterations") as caught:
        balance_point(lambda q: 1.0 + q**2, np.array([0.3]), most=8)
    assert caught.value.iterations == 8
    assert caught.value.residual >= 1.0


def test_newton_finds_a_root_in_closed_form() -> None:
    """Pendulums with `k q = m sin q`, against their fixed points by iteration; far starts are shortened."""
    stiffness = np.array([2.0, 4.0])
    found, _ = balance_point(lambda q: np.cos(q) - stiffness * (q - 3.0), np.zeros(2))
    expected = np.full(2, 3.0)
    for _ in range(200):
        expected = 3.0 + np.cos(expected) / stiffness
    assert np.allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("balance", [lambda q: np.ones(2), lambda q: np.full(2, np.nan)], ids=["singular", "nan"])
def test_what_has_no_tangent_is_told(balance: Callable) -> None:
    with pytest.raises(NotConverged, match="no balance in 1 iterations"):
        balance_point(balance, np.zeros(2))


def test_no_answer_is_a_row_that_does_not_agree(tool: Tool, monkeypatch: pytest.MonkeyPatch) -> None:
    tool("mujoco")

    def stuck(_: Question) -> None:
        raise NotConverged("it swings", best=None, residual=1.0, iterations=1)

    broken = dict(SIMULATORS) | {"MuJoCo": dataclasses.replace(SIMULATORS["MuJoCo"], simulate=stuck)}
    monkeypatch.setattr("studies.interop.simulators.SIMULATORS", broken)
    row = compare_equilibrium(cases("inflatable_arm")[0], "MuJoCo")
    assert row.problem == "it swings"
    assert row.static_difference is not None
    assert row.simulated_difference is None
    assert not row.agrees


@pytest.mark.parametrize(("difference", "agrees"), [(0.9e-9, True), (1.1e-9, False)])
def test_a_row_agrees_up_to_the_tolerance(difference: float, agrees: bool) -> None:
    row = EquilibriumRow("Drake", "1", "inflatable_arm", "up", True, static_difference=difference, simulated_difference=0.9e-6)
    assert row.agrees is agrees
    assert not dataclasses.replace(row, simulated_difference=1.1e-6).agrees


def test_an_unknown_simulator_is_refused() -> None:
    with pytest.raises(sr.NameNotFound, match="no simulator is called 'Gazebo'"):
        compare_equilibrium(cases("inflatable_arm")[0], "Gazebo")


# --- Which springs arrive


def texts_of(case: EquilibriumCase) -> dict[str, str]:
    motors = case.expected.q_motors
    return {
        "URDF": case.model.urdf,
        "MJCF": to_mjcf(case.model, motors, actuators=WELDED),
        "SDF": to_sdf(case.model, motors, actuators=WELDED),
    }


@pytest.mark.parametrize(
    ("name", "module", "springs"),
    [
        ("MuJoCo", "mujoco", {"URDF": 0, "MJCF": 4, "SDF": None}),
        ("Drake", "pydrake", {"URDF": 0, "MJCF": 0, "SDF": 4}),
    ],
)
def test_springs_arrive_by_our_files_only(tool: Tool, name: str, module: str, springs: dict[str, int | None]) -> None:
    tool(module)
    texts = texts_of(cases("inflatable_arm")[0])
    assert {kind: springs_read(name, text, kind) for kind, text in texts.items()} == springs


def test_pybullet_reads_no_springs(bullet: ModuleType) -> None:
    texts = texts_of(cases("inflatable_arm")[0])
    assert {kind: springs_read("PyBullet", text, kind) for kind, text in texts.items()} == {"URDF": 0, "MJCF": 0, "SDF": None}


def test_a_torque_that_is_there_is_counted_in_pybullet(bullet: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `springs_read` would see if PyBullet had springs: torques set on all joints, once its brakes are off."""
    original = bullet.setJointMotorControl2

    def pushed(robot: int, joint: int, mode: int, **options: object) -> None:
        original(robot, joint, mode, **options)
        original(robot, joint, bullet.TORQUE_CONTROL, force=-0.1, physicsClientId=options["physicsClientId"])

    monkeypatch.setattr(bullet, "setJointMotorControl2", pushed)
    assert springs_read("PyBullet", cases("inflatable_arm")[0].model.urdf, "URDF") == 7


def test_springs_read_refuses_other_tools_and_formats() -> None:
    with pytest.raises(sr.ParameterError, match="'MuJoCo', 'Drake', 'PyBullet'"):
        springs_read("Gazebo", "", "SDF")
    with pytest.raises(sr.ParameterError, match="'URDF', 'MJCF', 'SDF'"):
        springs_read("MuJoCo", "", "USD")


# --- The script and what it wrote

RECORDED = CHECKOUT / "docs" / "interoperability.json"


def test_the_tables_of_the_page_are_those_of_the_recorded_run() -> None:
    results = read_results(RECORDED)
    page = (CHECKOUT / PAGE).read_text(encoding="utf-8")
    assert page_with(page, results) == page
    assert agreed(results)
    assert {row["tool"] for row in results["equilibrium"]} == {"MuJoCo", "Drake", "PyBullet"}
    for robot in ROBOTS:
        for name in SIMULATORS:
            rows = [row for row in results["equilibrium"] if (row["robot"], row["tool"]) == (robot, name)]
            assert [(row["pose"], row["gravity"]) for row in rows] == [(c.pose, c.gravity is not None) for c in cases(robot)]
            assert all(row["simulated_difference"] <= (SINGLE if name == "PyBullet" else SIMULATED) for row in rows)
            assert all(row["static_difference"] <= STATIC for row in rows if name != "PyBullet")
    assert (CHECKOUT / "docs/images/interoperability.png").stat().st_size > 10_000


def test_the_script_compares_what_it_is_told_to(tool: Tool, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    tool("mujoco")
    target = tmp_path / "results.json"
    arguments = ["--tools", "MuJoCo", "yourdfpy", "--robots", "inflatable_arm", "--poses", "1", "--no-simulation"]
    assert run_script([*arguments, "--output", str(target)]) == 0
    printed, results = capsys.readouterr().out, json.loads(target.read_text(encoding="utf-8"))
    assert [row["pose"] for row in results["equilibrium"]] == ["up", "up"]
    assert {row["tool"] for row in results["kinematics"]} == {"MuJoCo", "yourdfpy"}
    assert re.search(r"\| MuJoCo [0-9.]+ \| none \| all \| - \|", printed)
    assert "| inflatable arm |" in printed
    assert "helical tube" not in printed
    assert "all agree" in printed
    assert run_script(["--from", str(target)]) == 0
    assert capsys.readouterr().out == printed.partition("\nwritten: ")[0]
    assert run_script([*arguments, "--output", str(target)]) == 2  # it is there
    assert "exists" in capsys.readouterr().err
    assert run_script(["--from", str(target), "--docs", str(tmp_path)]) == 2
    assert "all tools, robots and poses" in capsys.readouterr().err


def test_docs_are_made_of_the_recorded_run(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "docs" / "images").mkdir(parents=True)
    before, after = "# softrobots\n\n", "\n\nThe end.\n"
    (tmp_path / PAGE).write_text(f"{before}{BEGIN}\nold\n{END}\n{after}", encoding="utf-8")
    assert run_script(["--from", str(RECORDED), "--docs", str(tmp_path)]) == 0
    made = (tmp_path / PAGE).read_text(encoding="utf-8")
    assert made.startswith(before)
    assert made.endswith(after)
    assert "| helical tube |" in made
    assert "old" not in made
    assert (tmp_path / "docs/interoperability.json").read_text() == RECORDED.read_text()
    assert (tmp_path / "docs/images/interoperability.png").read_bytes()[:4] == b"\x89PNG"
    (tmp_path / PAGE).write_text("no marks\n", encoding="utf-8")
    assert run_script(["--from", str(RECORDED), "--docs", str(tmp_path)]) == 2
    assert "interoperability:begin" in capsys.readouterr().err


def test_a_tool_that_does_not_agree_ends_with_status_1(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    results = json.loads(RECORDED.read_text(encoding="utf-8"))
    results["equilibrium"][0] |= {"agrees": False, "problem": "it swings"}
    file = tmp_path / "results.json"
    file.write_text(json.dumps(results), encoding="utf-8")
    assert run_script(["--from", str(file)]) == 1
    printed = capsys.readouterr().out
    assert "FAILED" in printed
    assert "| inflatable arm | failed |" in printed


@each_row("text", ["", "[]", '{"springs": []}', '{"springs": [], "equilibrium": [1], "kinematics": []}', None])
def test_other_files_are_refused(text: str | None, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    file = tmp_path / "other.json"
    if text is not None:
        file.write_text(text, encoding="utf-8")
    assert run_script(["--from", str(file)]) == 2
    assert "other.json" in capsys.readouterr().err


@pytest.mark.parametrize("poses", ["0", "6"])
def test_the_script_refuses_numbers_of_poses_that_do_not_exist(poses: str, capsys: pytest.CaptureFixture) -> None:
    assert run_script(["--poses", poses]) == 2
    assert "from 1 to 5" in capsys.readouterr().err


def test_the_script_refuses_to_compare_nothing(capsys: pytest.CaptureFixture) -> None:
    assert run_script(["--equilibrium-only", "--tools", "yourdfpy"]) == 2
    assert "tools with one of MuJoCo, Drake, PyBullet" in capsys.readouterr().err
    assert run_script(["--kinematics-only", "--poses", "2"]) == 2
    assert "without --robots, --poses" in capsys.readouterr().err


def test_the_script_tells_of_a_tool_that_is_missing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setattr("studies.interop.tools.installed_version", lambda package: None)
    assert run_script(["--tools", "Drake"]) == 2
    assert "pip install 'softrobots[interop]'" in capsys.readouterr().err
