"""`softrobots solve`, `load` and `ik`: against the library called directly and the reference numbers of the papers' robots."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.cli.main import main, parser
from softrobots.statics.equilibrium_summary import stability_words
from softrobots.statics.stability import Stability
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint
from tests.support.tables import each_row

Told = Callable[..., tuple[int, str, str]]

FORCE = ("--force", "0", "10", "-15")
BENT = ("inflatable_arm", "--motors", "0.3", "0.6", "-0.8")
PCC_LENGTHS = ("0.50", "0.53", "0.55", "0.54", "0.51", "0.52")


@pytest.fixture
def answer(told: Told) -> Callable[..., dict[str, Any]]:
    """Run the command with `--json`, and return the object that it prints."""

    def run(*words: str) -> dict[str, Any]:
        status, out, err = told(*words, "--json")
        assert status == 0, err
        found = json.loads(out, parse_constant=pytest.fail)  # NaN and Infinity are no JSON
        assert isinstance(found, dict)
        return found

    return run


def same(found: dict[str, Any], equilibrium: sr.Equilibrium) -> None:
    """An answer holds exactly the numbers of an equilibrium: JSON keeps all digits of a float."""
    names = ("q_motors", "motor_torques", "q_springs", "spring_torques", "tip_position", "link_moments", "muscle_forces")
    for name in names:
        assert found[name] == getattr(equilibrium, name).tolist(), name
    for name in ("stable", "conservative", "within_limits", "wrinkled", "residual", "tolerance", "iterations", "method"):
        assert found[name] == getattr(equilibrium, name), name
    assert found["transform_tip_to_world"] == equilibrium.transform_tip_to_world.homogeneous.tolist()


# --- softrobots solve


@pytest.mark.parametrize(
    ("motors", "springs", "tip"),
    [
        ("0 0 0", (0.06696, -0.10022, 0.03264, -0.04858), (1.18654, 0.09618, -0.14450)),
        ("0.3 0.6 -0.8", (0.05339, -0.09228, 0.03172, -0.04214), (1.01935, 0.38587, 0.09712)),
        ("1.0 1.2 -2.0", (0.00966, -0.05706, 0.01722, -0.01067), (0.33278, 0.54150, 0.08904)),
    ],
)
def test_solve_gives_the_reference_equilibria(motors: str, springs: object, tip: object, answer, arm: sr.SoftModel) -> None:
    found = answer("solve", "inflatable_arm", "--motors", *motors.split(), *FORCE)
    assert np.allclose(found["q_springs"], springs, rtol=0.0, atol=5.1e-6)  # five digits are given
    assert np.allclose(found["tip_position"], tip, rtol=0.0, atol=5.1e-6)
    same(found, sr.solve_equilibrium(arm, [float(word) for word in motors.split()], (0, 10, -15)))
    assert found["motor_joints"] == ["motor_1", "motor_2", "motor_3"]
    assert found["units"]["q_springs"] == "rad"
    assert found["units"]["spring_torques"] == "N m"
    assert found["load"] == {"wrenches": {"tip": [0.0, 10.0, -15.0, 0.0, 0.0, 0.0]}, "gravity": None}
    limits = sr.solve_equilibrium(arm, [float(word) for word in motors.split()], (0, 10, -15)).link_limits
    for name in ("axial_forces", "slack_moments", "slack_margins", "wrinkling_moments", "wrinkling_margins"):
        assert found[name] == getattr(limits, name).tolist()


def test_solve_tells_a_person_the_same(told: Told, arm: sr.SoftModel) -> None:
    status, out, err = told("solve", *BENT, *FORCE)
    assert (status, err) == (0, "")
    equilibrium = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15))
    for name, position, load in zip(arm.spring_joints, equilibrium.q_springs, equilibrium.spring_torques, strict=True):
        assert re.search(rf"^{name} +{position:.6f}  rad +{load:.6f}  N m$", out, re.M)
    for name, position, load in zip(arm.motor_joints, equilibrium.q_motors, equilibrium.motor_torques, strict=True):
        assert re.search(rf"^{name} +{position:.6f}  rad +{load:.6f}  N m$", out, re.M)
    for line in (
        r"robot +inflatable_arm \(tip: tip\)",
        r"load on tip +force 0  10  -15 N",
        r"gravity +none",
        r"1 +18\.41 N m +-5\.120 N +12\.93 N m +-42\.5 % +20\.30 N m +9\.3 %",
        r"tip position +1.01935  0.385868  0.0971231 m",
        r"tip roll, pitch, yaw +-0.0222051  0.33579  0.367135 rad",
        r"stable +yes, certified",
        r"within limits +yes",
        r"wrinkled +no, at least 9\.3 % of the wrinkling moment is left",
        r"first slack fibre +YES: by membrane theory",
        r"conservative +yes",
        r"residual +\S+ N m \(\S+ N m allowed\), \d+ iterations by newton",
    ):
        assert re.search(rf"^{line}$", out, re.M), line
    roll, pitch, yaw = (float(word) for word in re.search(r"yaw +(\S+)  (\S+)  (\S+) rad", out).groups())
    turned = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    assert np.allclose(turned, equilibrium.transform_tip_to_world.rotation, rtol=0.0, atol=2e-6)  # six digits are told


SEVERAL = [
    word
    for wrench in (("link_1", "0", "0", "-5", *"000"), ("tip", "0", "1", *"000", ".1"), ("link_1", "0", "0", "-1", *"000"))
    for word in ("--wrench", *wrench)
]
LOADS = {
    "gravity": (("--gravity",), {"gravity": sr.EARTH_GRAVITY}),
    "gravity of the Moon": (("--gravity", "0", "0", "-1.62"), {"gravity": (0, 0, -1.62)}),
    "moment": (("--moment", "0", "-1e0", ".5"), {"wrench": (0, 0, 0, 0, -1, 0.5)}),
    "both": ((*FORCE, "--moment", "0", "0", "1"), {"wrench": (0, 10, -15, 0, 0, 1)}),
    "elsewhere": ((*FORCE, "--moment", "1", "0", "0", "--frame", "link_1"), {"wrench": {"link_1": (0, 10, -15, 1, 0, 0)}}),
    "several": ((*FORCE, *SEVERAL), {"wrench": {"tip": (0, 11, -15, 0, 0, 0.1), "link_1": (0, 0, -6, 0, 0, 0)}}),
}


@pytest.mark.parametrize("what", LOADS)
def test_solve_takes_every_load(what: str, answer, arm: sr.SoftModel) -> None:
    words, load = LOADS[what]
    found, expected = answer("solve", *BENT, *words), sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), **load)
    # The load is added up in another order, so that it may differ by rounding.
    for name in ("q_springs", "motor_torques", "tip_position"):
        assert np.allclose(found[name], getattr(expected, name), rtol=0.0, atol=1e-9), name
    assert found["conservative"] == expected.conservative


def test_solve_passes_its_other_options_on(answer, arm: sr.SoftModel) -> None:
    start = ("--start", "0.1", "-0.1", "0", "0")
    found = answer("solve", *BENT, *FORCE, *start, "--method", "fixed_point", "--tolerance", "1e-6")
    options = {"method": "fixed_point", "tolerance": 1e-6, "q_springs0": (0.1, -0.1, 0, 0)}
    same(found, sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15), **options))
    soft = sr.load_model(sr.InflatableArm(stiffness=100.0))
    same(answer("solve", *BENT, *FORCE, "--set", "stiffness=100"), sr.solve_equilibrium(soft, (0.3, 0.6, -0.8), (0, 10, -15)))


def test_solve_tells_of_muscles(answer, told: Told) -> None:
    """The tip of the PCC paper's reference lengths, and a tension that is given instead."""
    found = answer("solve", "pcc_arm", "--motors", *PCC_LENGTHS)
    assert np.allclose(found["tip_position"], (0.44957382, -0.31544214, 0.84384418), rtol=0.0, atol=5.1e-9)  # theory.md 2.3
    assert np.allclose(found["muscle_lengths"], [float(word) for word in PCC_LENGTHS], rtol=0.0, atol=1e-14)
    assert (found["units"]["q_motors"], found["units"]["motor_torques"]) == ("m", "N")
    rows = zip(found["spring_joints"], found["units"]["q_springs"].split(", "), strict=True)
    assert all(unit == ("m" if "stretch" in name else "rad") for name, unit in rows)
    status, out, _ = told("solve", "pcc_arm", "--muscles", "forces", "--motors", "20", *"00000")
    assert status == 0
    assert re.search(r"^muscle_1_1 +\w+ +20.000000  N +0\.\d{6}  m +20.000000  N$", out, re.M)
    assert "wrinkled" not in out


def test_solve_tells_slack_tendons_and_pressures(answer, told: Told) -> None:
    """A motor that lets 3 mm go leaves its tendon slack; a pressure has a unit of its own, and a tension below zero."""
    motors = ("--motors", *["0.06", "0.06", "0.06", "0.1225", "0.1225", "0.1225", "0.1865", "0.1865", "0.1895"])
    found, (_, out, _) = answer("solve", "tendon_arm", *motors), told("solve", "tendon_arm", *motors)
    assert found["muscle_slack"] == [False] * 8 + [True]
    assert (found["units"]["q_motors"], found["units"]["muscle_forces"]) == ("m", "N")
    assert re.search(r"^tendon_3_3 +elastic +0.189500  m +0\.\d{6}  m +0.000000  N +slack$", out, re.M)
    assert len(re.findall(r" slack$", out, re.M)) == 1
    assert re.search(r"^slack tendons +tendon_3_3$", out, re.M)
    pressed = ("pcc_arm", "--set", "kind=pressure", "--motors", "1e5", *"00000")
    assert answer("solve", *pressed)["units"]["q_motors"] == "Pa"
    out = told("solve", *pressed)[1]
    assert re.search(r"^muscle_1_1 +pressure +100000.000000  Pa +\S+  m +-30.000000  N$", out, re.M)  # 3 cm^2
    assert "slack tendons" not in out


def test_solve_takes_somebodys_robot(told: Told, answer, tmp_path: Path) -> None:
    file = tmp_path / "branched.urdf"
    file.write_text(BRANCHED, encoding="utf-8")
    words = (str(file), "--spring", "wrist=20,0.1", "--spring", "slider=800", "--tip", "finger", "--gravity")
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    found = answer("solve", *words)
    same(found, sr.solve_equilibrium(model, model.relaxed_motors, gravity=sr.EARTH_GRAVITY))
    assert (found["units"]["q_springs"], found["units"]["spring_torques"]) == ("rad, m", "N m, N")
    assert re.search(r"^slider +\S+  m +\S+  N$", told("solve", *words)[1], re.M)


def test_solve_says_what_the_kinds_of_stability_mean(told: Told) -> None:
    """Any torque along a straight round arm is flutter without damping; `unknown` has two causes."""
    _, out, _ = told("solve", "inflatable_arm_two_hinges", "--moment", "0.001", "0", "0")
    assert re.search(r"^stable +NO: flutter grows by 9\.\d+e-05 1/s, which damping may suppress$", out, re.M)
    unknown: Any = SimpleNamespace(stability=Stability("unknown", np.zeros(0)))
    assert "a moment acts without masses, or a section is out of range" in stability_words(unknown)


def test_solve_tells_what_is_unstable_wrinkled_or_beyond_limits(told: Told) -> None:
    """Above the buckling load the straight arm is an equilibrium, which the fixed point does not leave."""
    words = ("solve", "inflatable_arm", "--force", "-120", "0", "0", "--method", "fixed_point")
    status, out, _ = told(*words)
    assert status == 0
    assert re.search(r"^stable +NO: divergent, a disturbance grows by [\d.]+ 1/s$", out, re.M)
    assert json.loads(told(*words, "--json")[1])["stable"] is False
    status, out, _ = told("solve", "inflatable_arm", "--force", "0", "0", "-60", "--motors", "0", "4", "0", "--moment", *"001")
    assert status == 0
    assert re.search(r"^within limits +NO: ", out, re.M)
    assert re.search(r"^wrinkled +YES: linear springs no longer hold$", out, re.M)
    assert re.search(r"^conservative +no: a world-fixed moment has no potential$", out, re.M)
    status, out, _ = told("solve", "inflatable_arm", "--set", "max_moment=20.6", "--motors", "0", "0", "0", "--force", *"000")
    assert "plateau" not in out
    without = json.loads(told("solve", "inflatable_arm", "--set", "pressure=0", "--json")[1])
    assert without["wrinkling_margins"] == [None, None]


def test_solve_ends_with_one_if_there_is_no_equilibrium(told: Told) -> None:
    status, out, err = told("solve", *BENT, "--force", "0", "0", "-300", "--method", "fixed_point", "--json")
    assert (status, out) == (1, "")
    assert "error: no equilibrium by 'fixed_point'" in err
    assert "method='newton' converges for larger loads" in err


def test_solve_saves_and_draws_and_overwrites_nothing(told: Told, arm: sr.SoftModel, tool, tmp_path: Path) -> None:
    tool("matplotlib")
    file, picture = tmp_path / "new" / "sagging.npz", tmp_path / "arm.png"
    words = ("solve", *BENT, *FORCE, "-o", str(file), "--plot", str(picture))
    status, out, _ = told(*words)
    assert status == 0
    assert out.endswith(f"\n{file}: written\n{picture}: written\n")
    loaded = sr.load_result(file)
    assert loaded.model == arm
    assert np.array_equal(loaded.q_springs, sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15)).q_springs)
    assert picture.read_bytes().startswith(b"\x89PNG")
    before = file.read_bytes(), picture.read_bytes()
    for kept in (words, (*words[:-2],), (*words[:-4], "--plot", str(picture))):
        status, out, err = told(*kept)
        assert (status, out) == (2, "")
        assert "exists; choose another name or allow overwriting" in err
    assert (file.read_bytes(), picture.read_bytes()) == before
    status, out, _ = told(*words[:-2], "--overwrite", "--json")
    assert (status, json.loads(out)["files"]) == (0, [str(file)])


def test_the_picture_shows_loaded_and_relaxed_arm(arm: sr.SoftModel, tool) -> None:
    tool("matplotlib")
    equilibrium = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15))
    (axes,) = sr.plot(equilibrium).axes
    relaxed, loaded, tip = (np.array(line.get_data_3d()).T for line in axes.lines)
    assert np.allclose(tip, [equilibrium.tip_position], rtol=0.0, atol=1e-12)
    assert np.allclose(loaded[-1], equilibrium.tip_position, rtol=0.0, atol=1e-12)
    rigid = np.array([np.cos(0.3), np.sin(0.3), 1.0])  # the rigid arm lies in the plane of motor 1
    along, up = 0.6 * np.cos(0.6) + 0.6 * np.cos(-0.2), 0.6 * np.sin(0.6) + 0.6 * np.sin(-0.2)
    assert np.allclose(relaxed[-1], rigid * (along, along, up), rtol=0.0, atol=1e-12)
    texts = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert {"rigid arm, same motor angles", "line through the joints", "force 18 N"} <= set(texts)
    with pytest.raises(sr.ParameterError, match="an Equilibrium"):
        sr.plot(arm.pinocchio)


def test_springs_that_are_taken_away_are_told(told) -> None:
    status, out, _ = told("solve", "inflatable_arm", "--spring", "spring_1_up=none")
    assert status == 0
    assert re.search(r"^springs +taken away: spring_1_up; of the file: 3$", out, re.M)
    status, out, _ = told("solve", "inflatable_arm", "--spring", "spring_1_up=none", "--spring", "spring_2_up=50")
    assert re.search(r"^springs +given: spring_2_up; taken away: spring_1_up; of the file: 2$", out, re.M)


def test_the_number_of_hinges_of_a_link_is_told(told) -> None:
    for name, hinges in (("inflatable_arm", ""), ("inflatable_arm_two_hinges", ", 2 hinges a link")):
        assert re.search(rf"^robot +inflatable_arm{hinges} \(tip: tip\)$", told("solve", name)[1], re.M)


# --- softrobots branches


def test_branches_are_printed_saved_and_drawn(answer, told, tool, tmp_path: Path) -> None:
    tool("matplotlib")
    file, picture = tmp_path / "b.npz", tmp_path / "b.png"
    words = ["branches", "inflatable_arm", "--set", "link_lengths=[0.6]", "--direction", "-1", *"00", "--largest-step", "0.2"]
    found = answer(*words, "-o", str(file), "--plot", str(picture))
    saved = sr.load_result(file)
    assert [row["label"] for row in found["branches"]] == [branch.label for branch in saved]
    for row, branch in zip(found["branches"], saved, strict=True):
        assert row["forces"] == branch.forces.tolist()
        assert row["stable"] == branch.stable.tolist()
        assert row["q_springs"] == [one.q_springs.tolist() for one in branch.equilibria]
    assert found["files"] == [str(file), str(picture)]
    assert picture.stat().st_size > 10_000
    status, out, _ = told(*words)
    assert status == 0
    assert "fundamental is crossed at 303 N" in out
    assert len(re.findall(r"114|303 to 378.75", out)) == 8


def test_branches_that_fall_on_the_way_say_how_far(told, tmp_path: Path) -> None:
    """Past a plateau the force falls below the one where the branch starts and where it ends."""
    file = tmp_path / "b.npz"
    words = ("--set", "link_lengths=[0.6]", "max_moment=21.76", "--direction", "-1", "0", "0", "--largest-step", "0.2")
    status, out, _ = told("branches", "inflatable_arm", *words, "-o", str(file))
    assert status == 0
    bent = sr.load_result(file)[1]
    least, most = min(one.load.wrenches["tip"][:3] @ (-1, 0, 0) for one in bent.equilibria), max(bent.forces)
    assert least < 0.9 * min(bent.forces[0], bent.forces[-1])
    assert re.search(rf"^{re.escape(bent.label)} +{bent.forces[0]:.6g} +{least:.6g} to {most:.6g} ", out, re.M)


def test_a_pull_has_no_branches(told) -> None:
    status, out, _ = told("branches", "inflatable_arm", "--direction", "1", "0", "0", "--max-force", "50")
    assert (status, out) == (1, "no branches: the equilibrium stays stable up to 50 N along [1.0, 0.0, 0.0]\n")


# --- Obstacles

ROOM = """\
obstacles:
  - {kind: half_space, name: wall, normal: [-1, 0.2, -0.1], offset: -1.0}
  - {kind: box, name: shelf, size: [0.2, 0.2, 0.2], position: [0.63, 0.235, -0.03]}
"""


@pytest.fixture
def room(tmp_path: Path) -> str:
    """File of obstacles that the arm leans on."""
    (tmp_path / "room.yaml").write_text(ROOM, encoding="utf-8")
    return str(tmp_path / "room.yaml")


LEANING = ("inflatable_arm", "--gravity", "--force", "5", "0", "-20")


def test_solve_lists_the_contacts(room: str, answer, told: Told, arm: sr.SoftModel) -> None:
    """The same contacts as from Python, as a table and as data."""
    words = ("solve", *LEANING, "--motors", "0.3", "0.4", "-0.3", "--environment", room)
    found, around = answer(*words), sr.Environment.from_file(room)
    held = sr.solve_equilibrium(arm, (0.3, 0.4, -0.3), (5, 0, -20), gravity=sr.EARTH_GRAVITY, environment=around)
    same(found, held)
    assert len(held.contacts) == 2
    for row, contact in zip(found["contacts"], held.contacts, strict=True):
        assert (row["link"], row["obstacle"], row["status"]) == (contact.link, contact.obstacle, "pressed")
        assert (row["normal_force"], row["gap"]) == (contact.normal_force, contact.gap)
        assert row["force"] == contact.force.tolist()
        assert row["point"] == contact.point.tolist()
    assert found["load"]["environment"] == around.to_dict()
    _, out, _ = told(*words)
    assert re.search(r"^obstacles +wall, shelf$", out, re.M)
    assert re.search(rf"^link_2 +wall +pressed +{held.contacts[0].normal_force:.6f}  N ", out, re.M)
    away = told("solve", "inflatable_arm", "--motors", "0", "1.2", "0", "--environment", room)[1]
    assert re.search(r"^contacts +none: the robot touches nothing$", away, re.M)


def test_other_commands_lean_on_obstacles(room: str, answer, told: Told, arm: sr.SoftModel, tmp_path: Path) -> None:
    """Motors, modes, forces and paths among the same obstacles as from Python."""
    options = {"gravity": sr.EARTH_GRAVITY, "environment": sr.Environment.from_file(room)}
    held = sr.solve_equilibrium(arm, (0.3, 0.4, -0.3), (5, 0, -20), **options)
    motors = ("--motors", "0.3", "0.4", "-0.3")
    modes = answer("modes", *LEANING, *motors, "--environment", room)
    assert np.allclose(modes["frequencies"], sr.vibration_modes(arm, held).frequencies, rtol=1e-12)
    target = tuple(map(repr, held.tip_position.tolist()))
    found = answer("ik", *LEANING, "--target", *target, "--start", "0.3", "0.4", "-0.3", "--environment", room)
    assert found["error"] < 1e-9
    assert [row["obstacle"] for row in found["equilibrium"]["contacts"]] == ["wall", "shelf"]
    torques = tuple(map(repr, held.motor_torques.tolist()))
    felt = answer("load", "inflatable_arm", "--gravity", *motors, "--torques", *torques, "--environment", room)
    assert len(felt["equilibrium"]["contacts"]) == 2
    path = tmp_path / "path.csv"
    rows = held.tip_position + np.linspace(0.0, 0.05, 3)[:, None] * (-1.0, 0.2, -0.1)
    path.write_text("x,y,z\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist()), encoding="utf-8")
    words = ("ik", *LEANING, "--waypoints", str(path), "--start", "0.3", "0.4", "-0.3", "--environment", room)
    forces = answer(*words)["contact_forces"]
    assert forces["wall"][0] == pytest.approx(held.contacts[0].normal_force, rel=1e-6)
    assert forces["wall"][1:] == [0.0, 0.0]
    table = tmp_path / "followed.csv"
    out = told(*words, "-o", str(table))[1]
    assert re.search(r"^force on wall +up to \S+ N, at waypoint 1$", out, re.M)
    assert "force on wall [N]" in table.read_text(encoding="utf-8").splitlines()[0]


def test_a_file_of_obstacles_that_is_none_is_told(told: Told, tmp_path: Path) -> None:
    file = tmp_path / "room.yaml"
    file.write_text("obstacles: [{kind: teapot}]\n", encoding="utf-8")
    status, _, error = told("solve", "inflatable_arm", "--environment", str(file))
    assert (status, "teapot" in error) == (2, True)
    status, _, error = told("solve", "inflatable_arm", "--environment", str(tmp_path / "nowhere.yaml"))
    assert (status, "nowhere.yaml" in error) == (2, True)


# --- softrobots load


def test_load_finds_the_force_that_the_motors_feel(answer, told: Told, arm: sr.SoftModel) -> None:
    """The torques of the reference case give back its force."""
    torques = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15)).motor_torques
    words = (*BENT, "--torques", *map(repr, torques.tolist()))
    found = answer("load", *words, "--torque-std", "0.05")
    assert np.allclose(found["force"], (0, 10, -15), rtol=0.0, atol=1e-8)
    estimate = sr.estimate_load(arm, (0.3, 0.6, -0.8), torques, torque_std=0.05)
    same(found["equilibrium"], estimate.equilibrium)
    for name in ("force", "singular_values", "covariance", "measured_torques", "torque_std"):
        assert found[name] == getattr(estimate, name).tolist(), name
    assert found["condition_number"] == estimate.condition_number
    assert found["unobservable_directions"] == []
    assert np.allclose(np.square(found["force_std"]), np.diag(estimate.covariance), rtol=1e-12, atol=0.0)
    status, out, _ = told("load", *words, "--torque-std", "0.05", "0.1", "0.2")
    assert status == 0
    assert re.search(r"^force on tip +\S+  10  -15 N$", out, re.M)
    noisy = sr.estimate_load(arm, (0.3, 0.6, -0.8), torques, torque_std=(0.05, 0.1, 0.2)).covariance
    assert f"standard deviation  {'  '.join(f'{x:.6g}' for x in np.sqrt(np.diag(noisy)))} N" in out
    assert re.search(r"^not felt along +no direction$", out, re.M)
    assert "standard deviation" not in told("load", *words)[1]


def test_load_tells_the_parts_of_the_error_and_other_forces(answer, told: Told) -> None:
    """One number for all, or one for each; without starting again there is one force."""
    limp = sr.load_model(sr.InflatableArm(max_moment=12.0))
    torques = sr.solve_equilibrium(limp, (0.3, 0.9, -1.4), (2, 8, -12), gravity=sr.EARTH_GRAVITY).motor_torques
    words = ("inflatable_arm", "--set", "max_moment=12", "--motors", "0.3", "0.9", "-1.4", "--gravity")
    words += ("--torques", *map(repr, torques.tolist()))
    deviations = ("--stiffness-std", "0.03", "0.03", "0.04", "0.04", "--motor-angle-std", "0.01")
    found = answer("load", *words, *deviations)
    options = {"stiffness_std": (0.03, 0.03, 0.04, 0.04), "motor_angle_std": 0.01, "gravity": sr.EARTH_GRAVITY}
    estimate = sr.estimate_load(limp, (0.3, 0.9, -1.4), torques, **options)
    for name, part in estimate.covariance_parts.items():
        assert found["covariance_parts"][name] == part.tolist()
    assert found["motor_angle_std"] == [0.01] * 3
    assert [one["force"] for one in found["alternatives"]] == [one.force.tolist() for one in estimate.alternatives] != []
    same(found["alternatives"][0]["equilibrium"], estimate.alternatives[0].equilibrium)
    _, out, _ = told("load", *words, *deviations)
    assert re.search(r"^ +by motor angles +\S+  \S+  \S+ N$", out, re.M)
    assert re.search(r"^ +explained as well by +2  8  -12 N$", out, re.M)
    assert answer("load", *words, "--no-restart")["alternatives"] == []


def test_load_finds_a_push_on_a_point_along_a_direction(answer, told: Told, arm: sr.SoftModel) -> None:
    """A push on the first link, which the last motor does not feel."""
    marked, force = sr.with_points(arm, {"touched": ("link_1", (0.4, 0.0, 0.05))}), np.array([0.0, 5.0, -10.0])
    torques = sr.solve_equilibrium(marked, (0.3, 0.6, -0.8), force, frame="touched").motor_torques
    words = (*BENT, "--torques", *map(repr, torques.tolist()), "--frame", "link_1", "--point", "0.4", "0", "0.05")
    found = answer("load", *words, "--direction", "0", "1", "-2")
    assert np.allclose(found["force"], force, rtol=0.0, atol=1e-8)
    assert (found["frame"], len(found["singular_values"])) == ("point_of_link_1", 1)
    assert re.search(r"^force on point_of_link_1 +\S+  5  -10 N$", told("load", *words, "--direction", "0", "1", "-2")[1], re.M)
    assert "NOT FELT along" in told("load", *words)[1]


def test_load_names_the_direction_that_is_not_felt(answer, told: Told) -> None:
    """A straight arm does not feel a pull along itself."""
    words = ("inflatable_arm", "--motors", "0", "0", "0", "--torques", "0", "0", "0")
    found = answer("load", *words)
    assert np.allclose(np.abs(found["unobservable_directions"]), [(1, 0, 0)], rtol=0.0, atol=1e-12)
    assert (found["condition_number"] or 1e9) > 1e6  # infinite is null
    assert (found["force_std"], found["covariance"], found["torque_std"]) == (None, None, None)
    status, out, _ = told("load", *words)
    assert status == 0
    assert re.search(r"^NOT FELT along +-?1  0  0$", out, re.M)


def test_load_passes_its_other_options_on(answer, arm: sr.SoftModel, tmp_path: Path) -> None:
    file = tmp_path / "estimate.npz"
    words = (
        "--torques",
        "3",
        "-8",
        "-3",
        "--frame",
        "link_2",
        "--gravity",
        "--method",
        "alternation",
        "--max-iterations",
        "500",
    )
    found = answer("load", *BENT, *words, "-o", str(file))
    options = {"frame": "link_2", "gravity": sr.EARTH_GRAVITY, "method": "alternation", "max_iterations": 500}
    estimate = sr.estimate_load(arm, (0.3, 0.6, -0.8), (3, -8, -3), **options)
    assert found["force"] == estimate.force.tolist()
    assert (found["frame"], found["method"], found["iterations"]) == ("link_2", "alternation", estimate.iterations)
    assert sr.load_result(file).force.tolist() == estimate.force.tolist()


def test_load_ends_with_one_if_no_force_explains_the_torques(told: Told) -> None:
    words = ("--torques", "10", "-16", "-7", "--method", "alternation", "--max-iterations", "1")
    status, out, err = told("load", *BENT, *words)
    assert (status, out) == (1, "")
    assert "error: no force explains the motor torques" in err


# --- softrobots ik


def test_ik_puts_the_loaded_tip_at_the_target(answer, told: Told, arm: sr.SoftModel, tmp_path: Path) -> None:
    file = tmp_path / "solution.npz"
    words = ("inflatable_arm", "--target", "0.9", "0.3", "0.2", *FORCE)
    found = answer("ik", *words, "-o", str(file))
    again = sr.solve_equilibrium(arm, found["q_motors"], (0, 10, -15))
    assert np.allclose(again.tip_position, (0.9, 0.3, 0.2), rtol=0.0, atol=1e-9)  # the tolerance of the search
    solution = sr.solve_ik(arm, (0.9, 0.3, 0.2), (0, 10, -15))
    same(found["equilibrium"], solution.equilibrium)
    assert found["alternatives"] == [other.tolist() for other in solution.alternatives]
    assert (found["error"], found["orientation"]) == (solution.error, None)
    assert np.array_equal(sr.load_result(file).q_motors, solution.q_motors)
    status, out, _ = told("ik", *words)
    assert status == 0
    assert re.search(r"^target +0.9  0.3  0.2 m$", out, re.M)
    assert re.search(rf"^motors +{'  '.join(f'{x:.6g}' for x in solution.q_motors)} rad$", out, re.M)
    assert len(re.findall(r"^another solution  ", out, re.M)) == len(solution.alternatives) >= 1


def test_ik_passes_its_other_options_on(answer, arm: sr.SoftModel) -> None:
    words = (
        "--elbow",
        "up",
        "--start",
        "0.2",
        "0.5",
        "-0.5",
        "--starts",
        "3",
        "--tolerance",
        "1e-6",
        "--method",
        "fixed_point",
    )
    found = answer("ik", "inflatable_arm", "--target", "0.9", "0.3", "0.2", *FORCE, *words)
    options = {"q_motors0": (0.2, 0.5, -0.5), "elbow": "up", "starts": 3, "tolerance": 1e-6, "method": "fixed_point"}
    solution = sr.solve_ik(arm, (0.9, 0.3, 0.2), (0, 10, -15), **options)
    assert found["q_motors"] == solution.q_motors.tolist()
    assert found["iterations"] == solution.iterations


def test_solve_says_which_springs_are_given(told: Told) -> None:
    status, out, _ = told("solve", "inflatable_arm", "--set", "rest_up=0.1", "--spring", "spring_2_up=90")
    assert status == 0
    assert re.search(r"^springs +given: spring_2_up; of the file: 3$", out, re.M)
    assert re.search(r"^spring_2_up +0\.100000 +rad", out, re.M)  # it keeps its rest
    assert "given:" not in told("solve", "inflatable_arm")[1]
    out = told("solve", "inflatable_arm", "--spring", "spring_1_side=none", "--spring", "spring_2_side=none")[1]
    assert re.search(r"^motor\s.*\n(.*\n)*spring_1_side .*\n(.*\n)*spring +position", out, re.M)  # now a motor


def test_solve_says_that_the_limits_of_a_helix_are_upper_bounds(told: Told) -> None:
    bounds = "limits of the wall    upper bounds, of a straight tube: the wall along the actuator is slack before any load"
    for tube in (["--set", "elastic_sections=4", "length=0.3"], ["--set", "chain=lumped", "hinges=4", "length=0.3"]):
        out = told("solve", "helix_tube", *tube, "--gravity")[1]
        assert bounds in out
        assert re.search(r"^wrinkled +no, at most \d+\.\d % ", out, re.M)
    out = told("solve", "inflatable_arm", "--gravity")[1]
    assert "upper bounds" not in out
    assert re.search(r"^wrinkled +no, at least \d+\.\d % ", out, re.M)


def test_ik_turns_the_tip(answer) -> None:
    """The direction of the tip of a robot that has the freedom."""
    found = answer("ik", "pcc_arm", "--target", "0.3", "-0.2", "0.9", "--orientation", "0.5", "0", "1", "--gravity")
    pose = np.array(found["equilibrium"]["transform_tip_to_world"])
    assert np.allclose(pose[:3, 3], (0.3, -0.2, 0.9), rtol=0.0, atol=1e-9)
    assert np.allclose(pose[:3, 2], np.array([0.5, 0, 1]) / np.sqrt(1.25), rtol=0.0, atol=1e-8)
    assert found["orientation_error"] <= 1e-9  # the tolerance of the search


def test_ik_turns_the_tip_as_roll_pitch_and_yaw_say(answer, told: Told, tmp_path: Path) -> None:
    """Seven joints, one of them a spring: the pose of some motors under their weight is a target that can be reached."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0")
    links = f'<link name="base">{INERTIAL}</link>'
    names = ("base", *(f"l{number}" for number in range(7)))
    joints = (joint(f"j{number}", names[number], names[number + 1], axis, xyz="0 0 0.2") for number, axis in enumerate(axes))
    text = f'<robot name="seven">{links}{"".join(joints)}</robot>'
    file = tmp_path / "seven.urdf"
    file.write_text(text, encoding="utf-8")
    model = sr.load_model(text, springs={"j1": 50.0})
    pose = sr.solve_equilibrium(model, (0.3, 0.5, 0.2, -0.4, 0.6, 0.1), gravity=sr.EARTH_GRAVITY).transform_tip_to_world
    place, turn = (map(repr, numbers.tolist()) for numbers in (pose.translation, pin.rpy.matrixToRpy(pose.rotation)))
    words = ("ik", str(file), "--spring", "j1=50", "--target", *place, "--rpy", *turn, "--gravity", "--starts", "2")
    found = answer(*words, "--start", "0.2", "0.4", "0.2", "-0.3", "0.5", "0.1")
    assert np.allclose(found["equilibrium"]["transform_tip_to_world"], pose.homogeneous, rtol=0.0, atol=1e-8)
    assert np.allclose(found["orientation"], pose.rotation, rtol=0.0, atol=1e-12)
    told_text = told(*words, "--start", "0.2", "0.4", "0.2", "-0.3", "0.5", "0.1")[1]
    assert re.search(r"^tip error +\S+ m, \S+ rad, \d+ steps$", told_text, re.M)


def test_ik_ends_with_one_if_the_target_is_out_of_reach(told: Told) -> None:
    status, out, err = told("ik", "inflatable_arm", "--target", "3", "0", "0", "--starts", "2", "--json")
    assert (status, out) == (1, "")
    assert "error: the tip cannot reach [3.0, 0.0, 0.0] m: the nearest of 2 starts" in err


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file of waypoints."""
    file = tmp_path / "path.csv"
    rows = "".join(f"{0.1 * i!r},0.9,{0.3 - 0.05 * i!r},0.2\n" for i in range(6))
    file.write_text("t,x,y,z\n" + rows, encoding="utf-8")
    return file


def test_ik_follows_waypoints(told: Told, answer, arm: sr.SoftModel, path: Path, tool, tmp_path: Path) -> None:
    tool("matplotlib")
    words = ("ik", "inflatable_arm", "--waypoints", str(path), *FORCE, "--elbow", "up")
    npz, csv, picture = tmp_path / "followed.npz", tmp_path / "followed.csv", tmp_path / "poses.png"
    found = answer(*words, "-o", str(npz), "--plot", str(picture))
    points = sr.read_waypoints(path)
    followed = sr.follow_trajectory(arm, points.positions, (0, 10, -15), elbow="up", times=points.times)
    for name in ("times", "targets", "q_motors", "q_springs", "tip_positions", "tip_error", "link_moments"):
        assert found[name] == getattr(followed, name).tolist(), name
    assert found["required_pressure"] == followed.required_pressure
    assert found["wrinkling_margin"] == followed.least_margin("wrinkling_margins")
    assert found["slack_margin"] == min(float(state.link_limits.slack_margins.min()) for state in followed.equilibria)
    assert found["motor_torques"] == [equilibrium.motor_torques.tolist() for equilibrium in followed.equilibria]
    assert (found["stable"], found["wrinkled"]) == ([True] * 6, [False] * 6)
    assert np.array_equal(sr.load_result(npz).q_motors, followed.q_motors)
    assert picture.read_bytes().startswith(b"\x89PNG")
    status, out, err = told(*words, "-o", str(csv))
    assert status == 0
    assert "5/5" in err  # a progress bar, from waypoint to waypoint
    assert csv.read_text(encoding="utf-8") == sr.save_csv(followed, tmp_path / "again.csv").read_text(encoding="utf-8")
    motors = followed.q_motors
    numbers = " +".join(f"{x:.6f}" for x in (motors[0, 2], motors[-1, 2], motors[:, 2].min(), motors[:, 2].max()))
    assert re.search(rf"^motor_3 +{numbers}  rad +\S+  N m$", out, re.M)
    for line in (
        r"waypoints +6, 0.5 s, by newton",
        r"largest tip error +\S+ m at waypoint \d",
        r"stable +at every waypoint",
        r"not wrinkled +at every waypoint",
        rf"largest moment .* {100.0 * followed.least_margin('wrinkling_margins'):.1f} % of the wrinkling moment is left",
        rf"required pressure +{followed.required_pressure:.6g} Pa",
    ):
        assert re.search(rf"^{line}$", out, re.M), line


@pytest.mark.study
def test_ik_follows_as_the_paper_does_and_says_where_a_link_wrinkles(answer, told: Told, arm: sr.SoftModel, path: Path) -> None:
    words = ("ik", "inflatable_arm", "--waypoints", str(path), *FORCE)
    found = answer(*words, "--method", "paper")
    points = sr.read_waypoints(path)
    followed = sr.follow_trajectory(arm, points.positions, (0, 10, -15), times=points.times, method="paper")
    assert found["q_motors"] == followed.q_motors.tolist()
    assert max(found["tip_error"]) > 1e-4  # it lags behind
    status, out, _ = told(*words, "--set", "pressure=30e3")
    assert status == 0
    assert re.search(r"^not wrinkled +NO: not at 6 waypoints, first at waypoint 1$", out, re.M)
    assert answer(*words, "--set", "pressure=0")["wrinkling_margin"] is None


def test_ik_jumps_only_if_told(told: Told, answer, tmp_path: Path) -> None:
    """Motors within +-2 rad, as in tests/test_trajectory.py: motor 1 blocks the way on."""
    rows = "".join(f"{0.7 * math.cos(turn)},{0.7 * math.sin(turn)},0.3\n" for turn in (0.8, 1.2, 1.6, 1.9, 2.1))
    path = tmp_path / "circle.csv"
    path.write_text("x,y,z\n" + rows, encoding="utf-8")
    words = ("ik", "inflatable_arm", "--waypoints", str(path), "--set", "motor_limit=2.0", "--elbow", "up")
    status, out, err = told(*words)
    assert (status, out) == (1, "")
    assert "no continuous motion reaches it" in err
    assert max(answer(*words, "--allow-jumps")["tip_error"]) <= 1e-9


@pytest.mark.parametrize("words", [("solve", "inflatable_arm"), ("ik", *["inflatable_arm", "--target", "0.9", "0.3", "0.2"])])
def test_a_result_is_saved_as_table_or_text(words: tuple[str, ...], tmp_path: Path) -> None:
    """A CSV file of one row, and JSON that comes back as the same equilibrium."""
    for name in ("a.csv", "a.json"):
        assert main([*words, "--force", "0", "0", "-5", "-o", str(tmp_path / name)]) == 0
    head, row = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    loaded = sr.load_result(tmp_path / "a.json")
    held = loaded if isinstance(loaded, sr.Equilibrium) else loaded.equilibrium
    assert float(dict(zip(head.split(","), row.split(","), strict=True))["tip z [m]"]) == held.tip_position[2]


def test_without_a_command_the_help_says_what_to_do_first(capsys: pytest.CaptureFixture[str]) -> None:
    """Each of the three commands is one that can be read."""
    with pytest.raises(SystemExit, match="2"):
        main([])
    shown = capsys.readouterr().out
    commands = re.findall(r"^  softrobots (.+)$", shown, re.M)
    assert [parser().parse_args(command.split()).command for command in commands] == ["urdf", "solve", "view"]


# --- What is refused

CSV = "CSV"  # stands for a file of waypoints
TARGET = ("inflatable_arm", "--target", "0.9", "0.3", "0.2")

REFUSED = [
    (("solve",), "the following arguments are required: ROBOT"),
    (("solve", "nobody"), "no robot or file is called 'nobody'"),
    (("solve", "inflatable_arm", "--motors", "1"), "(it has shape (1,)): motor_1 [rad] (-3.142 to 3.142), motor_2 "),
    (("solve", "inflatable_arm", "--motors", "1", "2", "inf"), "--motors must be an array of shape (3,) of finite numbers"),
    (("solve", "inflatable_arm", "--motors", "1", "2", "x"), "'x': a number or NAME=NUMBER is required"),
    (("solve", "helix_tube", "--motors", "1"), "(it has shape (1,)): the robot has no actuators"),
    (("solve", "inflatable_arm", "--force", "1", "2"), "expected 3 arguments"),
    (("solve", "inflatable_arm", "--force", "1", "2", "nan"), "force must be an array of shape (3,) of finite numbers [N]"),
    (("solve", "inflatable_arm", "--moment", "1", "2", "1e40"), "at most 1e+30 in size"),
    (("solve", "inflatable_arm", "--gravity", "9.81"), "gravity must be an array of shape (3,)"),
    (("solve", "inflatable_arm", "--frame", "tipp"), "no frame is called 'tipp' (did you mean 'tip'?)"),
    (("solve", "inflatable_arm", "--wrench", "tipp", *"000000"), "no frame is called 'tipp'"),
    (("solve", "inflatable_arm", "--wrench", *"0000000"), "no frame is called '0'"),
    (("solve", "inflatable_arm", "--wrench", "tip", *"00000", "x"), "LINK FX FY FZ MX MY MZ: a link and six numbers"),
    (("solve", "inflatable_arm", "--method", "descent"), "invalid choice: 'descent'"),
    (("solve", "inflatable_arm", "--start", "1"), "--start must be an array of shape (4,)"),
    (("solve", "inflatable_arm", "--tolerance", "0"), "tolerance must be positive"),
    (("branches", "inflatable_arm", "--direction", "0", "0", "0"), "--direction must be different from zero"),
    (("solve", "inflatable_arm", "--tip", "nobody"), "no frame is called 'nobody'"),
    (("solve", "inflatable_arm", "--spring", "elbow=3"), "no movable joint is called 'elbow'"),
    (("solve", "pcc_arm_lumped", "--set", "hinges=60"), "the chain has at most 300 joints, not 480"),
    (("solve", "inflatable_arm", "-o", "x.txt"), "-o must be a file name that ends in .npz"),
    (("solve", "inflatable_arm", "-o", "."), "-o must be a file name that ends in .npz"),
    (("solve", "inflatable_arm", "--plot", "x.pdf"), "--plot must be a file name that ends in .png"),
    (("load", "inflatable_arm"), "the following arguments are required: --torques"),
    (
        ("load", "inflatable_arm", "--torques", "1", "2"),
        "--torques must be 3 numbers: motor_1 [N m], motor_2 [N m], motor_3 [N m]",
    ),
    (
        ("load", "inflatable_arm", "--torques", "1", "2", "nan"),
        "--torques must be an array of shape (3,) of finite numbers",
    ),
    (("load", "inflatable_arm", "--torques", *"123", "--torque-std", "1", "2"), "--torque-std must be 3 numbers"),
    (("load", "inflatable_arm", "--torques", *"123", "--torque-std", "-1"), "--torque-std must be positive"),
    (("load", "inflatable_arm", "--torques", *"123", "--stiffness-std", "1", "2"), "spring_1_side [-], spring_1_up [-]"),
    (("load", "inflatable_arm", "--torques", *"123", "--motor-angle-std", "1", "2"), "--motor-angle-std must be 3 numbers"),
    (("load", "pcc_arm", "--torques", *"123456", "--stiffness-std", "1"), "--stiffness-std must be left out for a robot"),
    (("load", "inflatable_arm", "--torques", *"123", "--frame", "nobody"), "no frame is called 'nobody'"),
    (
        ("load", "inflatable_arm", "--torques", *"123", "-o", "x.txt"),
        "-o must be a file name that ends in .npz or .json or .csv",
    ),
    (("load", "helix_tube", "--torques", "1"), "a robot with at least one motor"),
    (("load", "pcc_arm", "--muscles", "forces", "--torques", "1"), "a robot with muscles of given length"),
    (("ik", "inflatable_arm"), "one of the arguments --target --waypoints is required"),
    (("ik", *TARGET, "--waypoints", CSV), "not allowed with argument --target"),
    (("ik", *TARGET, "--start", "1"), "(it has shape (1,)): motor_1 [rad]"),
    (("ik", *TARGET, "--start", "4", "0", "0"), "within the motor limits"),
    (("ik", *TARGET, "--elbow", "left"), "invalid choice: 'left'"),
    (
        ("ik", *TARGET, "--orientation", "1", "0", "0"),
        "--orientation must be left out for this robot: it has 3 freedoms, 5 are needed",
    ),
    (("ik", *TARGET, "--orientation", "0", "0", "0"), "a direction different from zero"),
    (
        ("ik", *TARGET, "--rpy", "0", "0", "0"),
        "--rpy = [0.0, 0.0, 0.0]: --rpy must be left out for this robot: it has 3 freedoms, 6 are needed",
    ),
    (("ik", *TARGET, "--rpy", "0", "0", "inf"), "--rpy must be an array of shape (3,) of finite numbers"),
    (("ik", *TARGET, "--rpy", "0", "0", "0", "--orientation", *"001"), "not allowed with argument --rpy"),
    (("ik", *TARGET, "--starts", "0"), "starts must be a positive integer"),
    (("ik", *TARGET, "--tolerance", "-1"), "tolerance must be positive"),
    (("ik", *TARGET, "--method", "paper"), "--method must be given with --waypoints"),
    (("ik", *TARGET, "--allow-jumps"), "--allow-jumps must be given with --waypoints"),
    (("ik", *TARGET, "-o", "x.txt"), "-o must be a file name that ends in .npz or .json or .csv or .yaml or .mcap"),
    (("ik", "helix_tube", "--target", "0", "0", "1"), "a robot with at least one motor"),
    (("ik", "inflatable_arm", "--waypoints", "nobody.csv"), "cannot read nobody.csv: No such file"),
    (("ik", "inflatable_arm", "--waypoints", CSV, "--orientation", *"001"), "--orientation must be given with --target"),
    (("ik", "inflatable_arm", "--waypoints", CSV, "--rpy", *"000"), "--rpy must be given with --target"),
    (("ik", "inflatable_arm", "--waypoints", CSV, "--starts", "3"), "--starts must be given with --target"),
    (("ik", "inflatable_arm", "--waypoints", CSV, "--method", "paper", "--tolerance", "1"), "another method than paper"),
    (("ik", "inflatable_arm", "--waypoints", CSV, "-o", "x.txt"), "-o must be a file name that ends in .npz or .json or .csv"),
]


@each_row(("words", "message"), REFUSED)
def test_bad_input_is_refused(
    words: tuple[str, ...], message: str, told: Told, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    monkeypatch.chdir(folder)
    status, out, err = told(*(str(path) if word is CSV else word for word in words))
    assert (status, out) == (2, "")
    assert message in err
    assert "error: " in err
    assert list(folder.iterdir()) == []
