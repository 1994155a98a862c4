"""The same robot by several models: orders of convergence, MuJoCo, the rods themselves; and what the documentation records."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.tools.kinematics import pose_error
from softrobots.constant_curvature import chain_transform
from softrobots.export.mjcf import to_mjcf
from studies.agreement.comparison import compare
from studies.agreement.robots import AT_THE_START, COUNTS, IN_THE_MIDDLE, STUDIES, pose
from studies.agreement.tables import table
from studies.interop.mujoco_statics import tip_pose
from studies.interop.outcomes import Question
from tests.conftest import CHECKOUT, load_script
from tests.support.helix_rods import HelixRod, solve_helix_rod
from tests.support.muscle_rods import MuscleSegment, solve_muscle_arm
from tests.support.tables import each_row

pytestmark = pytest.mark.study

FORMS = {"link": ("pseudo-rigid, hinge in the middle", "pseudo-rigid, hinge at l1 = 5 %", "lumped", "sections")}
FRESH = {
    "inflatable_link_400N": ((4, 8), FORMS["link"]),
    "pcc_arm": ((4, 8), ("lumped", "sections")),
    "helix_tube_1_turn": ((16, 32), ("lumped", "sections")),
}
"""What is computed anew here: studies, numbers of segments, forms."""
SAME = 1e-12
"""Largest distance of MuJoCo's tip from ours [m]: both stop where forces balance to 1e-13 of some N m, over some N m/rad."""


@cache
def script() -> ModuleType:
    return load_script("agreement")


@cache
def recorded() -> dict[str, Any]:
    return json.loads((CHECKOUT / "docs" / "validation" / "agreement.json").read_text(encoding="utf-8"))


def order(rows: list[dict[str, Any]], key: str = "error_m") -> float:
    one, two = rows[-2:]
    return float(np.log(one[key] / two[key]) / np.log(two["n"] / one["n"]))


def assert_orders(name: str, form: str, rows: list[dict[str, Any]], near: float) -> None:
    """Order two in place and angle, within `near`; of lumped chains at least that. With the hinge at the start, one.

    Hinges have the muscle lengths to second order in the twist: with many of them that is what remains.
    """
    if name == "pcc_arm" and form.startswith("lumped"):
        assert rows[-1]["error_m"] < (4e-4 if rows[-1]["n"] > 16 else 1.2e-3), (name, form, rows[-1])
        return
    for key in ("error_m", "error_rad"):
        found = order(rows, key)
        if form == AT_THE_START:
            assert abs(found - 1.0) < near, (name, form, key, found)
        else:
            assert found > 2.0 - near, (name, form, key, found)
            assert found < 2.0 + near or form.startswith("lumped"), (name, form, key, found)


# --- The rods


def test_the_arm_with_muscles_is_arcs_without_load() -> None:
    """The closed form, docs/theory.md 2.1: to the tolerance of the solve."""
    lengths = np.array([[0.50, 0.53, 0.55], [0.54, 0.51, 0.52]])
    stiffness = {"bending_stiffness": 1.9, "torsional_stiffness": 1.3, "axial_stiffness": 2400.0}
    segments = [
        MuscleSegment.of_three(of_one, 0.04, length=0.524, turn=t, **stiffness)
        for of_one, t in zip(lengths, (0.3, 1.0), strict=True)
    ]
    found = solve_muscle_arm(segments, (0.0, 0.0, 0.0), tol=1e-6)
    exact = chain_transform(sr.constant_curvature.arc_from_muscles(lengths, 0.04), (0.3, 1.0))
    assert max(pose_error(found.pose, exact)) < 1e-9


def test_muscles_act_as_a_rest_curvature() -> None:
    """A rod with the curvature that the muscles' pull would give it, by the solve of the helical rods, has the same tip.

    The pull is the same all along, so it shifts the relaxed curvature by (a, b) / EI; turned about z that is about y, as there.
    Axial stiffness 1e8 N against 1 N: 1e-8.
    """
    segment = MuscleSegment(0.6, 0.0, (0.3, 0.7), 0.0, 1.5, 1.1, 1e8)
    force = np.array([0.8, -1.2, 0.5])
    found = solve_muscle_arm([segment], force, tol=1e-7)
    (a, b, _), bend = found.pulls[0], 1.5
    angle = np.arctan2(-a, b)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])  # takes y to the direction of (a, b)
    position, rotation, _ = solve_helix_rod(
        HelixRod(0.6, float(np.hypot(a, b)) / bend, 0.0, bend, 1.1), (*(turn.T @ force), 0, 0, 0), tol=1e-7
    )
    exact = pose(turn @ position, turn @ rotation @ turn.T)
    assert max(pose_error(found.pose, exact)) < 1e-7
    assert abs(a / bend - 0.5) > 0.05  # not what it is without load: 0.3 / 0.6


# --- Computed anew


@cache
def fresh(name: str) -> dict[str, Any]:
    counts, forms = FRESH[name]
    robot = next(robot for robot in STUDIES if name.startswith(robot))
    study = STUDIES[robot](1, 0)[name]
    chosen = study._replace(counts=counts, forms={form: study.forms[form] for form in forms})
    return compare(chosen, partial(iter), mujoco=True)


@pytest.mark.parametrize("name", FRESH)
def test_chains_converge_to_the_rod(name: str, tool: Callable[[str], ModuleType]) -> None:
    """0.2: room for the next term of the error; 0.4 of the hinge at the start, where it is larger.

    MuJoCo's equilibria are ours. The rod's own error is 1 % of the smallest error or less.
    """
    tool("mujoco")
    result = fresh(name)
    for form, column in result["forms"].items():
        assert [row["n"] for row in column["rows"]] == list(FRESH[name][0])
        assert all(row["stable"] == 1 for row in column["rows"])
        near = 0.2 if form != AT_THE_START else 0.4
        assert_orders(name, form, column["rows"], near)
        assert column["order"] == order(column["rows"])
        assert 100.0 * result["rod"]["largest_m"] < min(row["error_m"] for row in column["rows"])
    assert max(row["largest_m"] for row in result["mujoco"]["apart"]) < SAME
    if "closed_form" in result:
        assert result["closed_form"]["largest_m"] < 1e-9


@pytest.mark.parametrize("name", FRESH)
def test_the_record_says_the_same(name: str, tool: Callable[[str], ModuleType]) -> None:
    """Within 1e-9 m: solves to 1e-13 and rods to 1e-9 on another machine."""
    tool("mujoco")
    for form, column in fresh(name)["forms"].items():
        old = {row["n"]: row for row in recorded()["studies"][name]["forms"][form]["rows"]}
        for row in column["rows"]:
            assert abs(row["error_m"] - old[row["n"]]["error_m"]) < 1e-9
            assert abs(row["error_rad"] - old[row["n"]]["error_rad"]) < 1e-8


# --- The record


def test_the_page_shows_the_record() -> None:
    page = (CHECKOUT / "docs" / "agreement.md").read_text(encoding="utf-8")
    assert table(recorded()["studies"]) in page
    assert (CHECKOUT / "docs" / "images" / "agreement.png").stat().st_size > 50_000


def test_recorded_orders() -> None:
    """Of all forms of all robots; 0.1 of those that are not quite there yet."""
    studies = recorded()["studies"]
    assert set(studies) == {
        "inflatable_link_10N", "inflatable_link_400N", "pcc_arm", "helix_tube_1_turn", "helix_tube_2.7_turns", "steel_rod"
    }  # fmt: skip
    for name, study in studies.items():
        for form, column in study["forms"].items():
            assert_orders(name, form, column["rows"], 0.1)
            assert max(row["n"] for row in column["rows"]) >= 16
            assert all(row["stable"] == (100 if name == "steel_rod" else 1) for row in column["rows"])
        smallest = min(row["error_m"] for column in study["forms"].values() for row in column["rows"])
        assert 100.0 * study["rod"]["error_m"] < smallest
        if name != "steel_rod":
            assert max(row["largest_m"] for row in study["mujoco"]["apart"]) < SAME


def test_what_the_page_says_of_the_record() -> None:
    """48 sections of a steel rod are right to 0.1 mm; hinges of a helix are worse at 12 a turn than before; the arm; and
    what the corrected rule gains.
    """
    studies = recorded()["studies"]
    errors = {
        (name, form, row["n"]): 1e3 * row["error_m"]
        for name, study in studies.items()
        for form, column in study["forms"].items()
        for row in column["rows"]
    }
    assert recorded()["cases"] == 100
    assert errors["steel_rod", "sections", 48] < 0.1
    helix = "helix_tube_2.7_turns"
    assert errors[helix, "lumped", 32] > errors[helix, "lumped", 24]
    assert errors[helix, "lumped", 32] == pytest.approx(0.08, abs=0.005)
    assert errors[helix, "lumped, midpoint", 32] == pytest.approx(0.15, abs=0.005)
    assert errors[helix, "sections", 48] == pytest.approx(152.0 * errors[helix, "lumped", 48], rel=0.01)
    assert errors["pcc_arm", "sections", 4] == pytest.approx(2.8, abs=0.05)
    assert errors["pcc_arm", "lumped", 8] < 0.9
    for n in (4, 8, 16, 32):
        gains = [
            errors[f"inflatable_link_{force}N", IN_THE_MIDDLE, n] / errors[f"inflatable_link_{force}N", "lumped", n]
            for force in (10, 400)
        ]
        assert 50 < gains[0] < 62
        assert 2.5 < gains[1] < 4
    apart = [row["largest_m"] for study in studies.values() if "mujoco" in study for row in study["mujoco"]["apart"]]
    assert max(apart) < 1e-14


# --- The command


def test_it_writes_tables_numbers_and_a_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script()
    monkeypatch.setitem(COUNTS, "steel_rod", (4, 8))
    arguments = ["--robot", "steel_rod", "--cases", "2", "--no-mujoco"]
    assert module.main([*arguments, "--output", str(tmp_path / "out")]) == 0
    out, err = capsys.readouterr()
    result = json.loads((tmp_path / "out" / "agreement.json").read_text(encoding="utf-8"))
    tables = (tmp_path / "out" / "agreement.md").read_text(encoding="utf-8")
    assert table(result["studies"]) + "\n" == tables
    assert tables in out
    assert "| model | 4 | 8 | order | order of the angle |" in tables
    assert "6/6" in err  # a progress bar
    assert set(result["studies"]["steel_rod"]["forms"]) == {"sections", "lumped", "lumped, midpoint"}
    assert order(result["studies"]["steel_rod"]["forms"]["sections"]["rows"]) == pytest.approx(2.0, abs=0.2)
    assert (tmp_path / "out" / "agreement.png").stat().st_size > 20_000
    assert module.main([*arguments, "--output", str(tmp_path / "out")]) == 2
    assert "not empty" in capsys.readouterr().err


@each_row(
    ("arguments", "told"),
    [
        (["--cases", "0"], "--cases"),
        (["--seed", "-1"], "--seed"),
        (["--docs", ".", "--robot", "pcc_arm"], "without --robot"),
        (["--docs", ".", "--no-mujoco"], "without --robot"),
        (["--docs", "nowhere"], "agreement.md"),
    ],
)
def test_bad_options_are_refused_before_the_work(arguments: list[str], told: str, capsys: pytest.CaptureFixture) -> None:
    assert script().main(arguments) == 2
    out, err = capsys.readouterr()
    assert told in err
    assert out == ""


def test_without_scipy_it_says_what_is_missing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.setitem(sys.modules, "tests.support.muscle_rods", None)
    assert script().main(["--robot", "pcc_arm", "--no-mujoco"]) == 2
    assert "scipy" in capsys.readouterr().err


def test_the_pose_of_the_tip_in_mujoco(tool: Callable[[str], ModuleType]) -> None:
    """Its kinematics of the exported arm, by hand: straight along +x, the elbow up by a right angle."""
    tool("mujoco")
    model = sr.load_model(sr.InflatableArm())
    names = model.pinocchio.names[1:]
    question = Question(to_mjcf(model), model.tip, (0.0, 0.0, 0.0), None)
    found = tip_pose(question, dict.fromkeys(names, 0.0) | {"motor_3": np.pi / 2})
    assert np.allclose(found, [[0, 0, -1, 0.6], [0, 1, 0, 0], [1, 0, 0, 0.6], [0, 0, 0, 1]], atol=1e-15)
    with pytest.raises(sr.ParameterError, match="the joints of the file"):
        tip_pose(question, {"motor_3": 0.0})
