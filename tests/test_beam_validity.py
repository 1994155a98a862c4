"""The inflated beam beside the pseudo-rigid link: the oracle against closed forms, and what the guide says of both."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots import inflated_beam
from studies.beam_validity import arm as arm_study
from studies.beam_validity.arm import arm_rod, cases_of, solved
from studies.beam_validity.link import link_at, lumped, reached
from tests.conftest import CHECKOUT, load_script
from tests.support import rods
from tests.support.inflated_rods import InflatedRod, product, solve_inflated_chain, turned

pytestmark = pytest.mark.study

TUBE = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005, "pressure": 50e3}
MODULUS = 138e6
ROD = InflatedRod.tube(young_modulus=MODULUS, **TUBE)
AHEAD = np.array([1.0, 0.0, 0.0, 0.0])
RECORD = CHECKOUT / "docs" / "validation" / "beam_validity.json"


def tip(rod: InflatedRod, force: Any, moment: Any = (0.0, 0.0, 0.0), tol: float = 1e-9) -> tuple[np.ndarray, np.ndarray]:
    found = solve_inflated_chain([rod], [AHEAD], force, moment, tol=tol)
    return found.position, found.rotation


def angle(rotation: np.ndarray) -> float:
    return float(np.arctan2(rotation[1, 0], rotation[0, 0]))


# --- The oracle


def test_a_small_force_deflects_the_rod_as_equation_1_all_along() -> None:
    """The difference is of second order in the force: a hundredth of it for a tenth of the force."""
    x = np.linspace(0.0, 0.6, 21)
    apart = []
    for force in (0.5, 5.0):
        exact = solve_inflated_chain([ROD.planar()], [AHEAD], (0.0, force, 0.0), tol=1e-11).shape[:, 1]
        linear = inflated_beam.deflection(x, force, young_modulus=MODULUS, **TUBE)
        apart.append(np.abs(exact - linear).max() / linear[-1])
    assert apart[0] < 1e-5
    assert apart[1] / apart[0] == pytest.approx(100.0, rel=0.01)  # the next order is (F L^2 / B)^2, 0.2 % at 5 N


@pytest.mark.parametrize("force", [3.0, 60.0, 600.0])
def test_without_shear_the_rod_is_the_elastica(force: float) -> None:
    rod = replace(ROD.planar(), shear=None)
    across, along, turn = rods.elastica_tip(rod.bending, rod.length, force)
    position, rotation = tip(rod, (0.0, force, 0.0))
    assert position == pytest.approx([along, across, 0.0], abs=1e-8)  # the tolerance of the solve
    assert angle(rotation) == pytest.approx(turn, abs=1e-8)


def test_without_shear_the_rod_is_kirchhoffs_in_space() -> None:
    """Forces and moments that bend, twist and stretch it; the other oracle is straight along +z."""
    rod = replace(ROD, shear=None)
    other = rods.Rod(rod.length, rod.bending, rod.twisting, rod.stretching)
    axes = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # its z is our x
    force, moment = np.array([5.0, 40.0, -25.0]), np.array([12.0, -6.0, 9.0])
    there, turn = rods.rod_tip(other, np.r_[axes.T @ force, axes.T @ moment])
    position, rotation = tip(rod, force, moment)
    assert position == pytest.approx(axes @ there, abs=1e-7)  # the tolerances of both solves
    assert rotation == pytest.approx(axes @ turn @ axes.T, abs=1e-7)


@pytest.mark.parametrize("share", [-3.0, 0.5, 0.9])
def test_the_pushed_rod_gives_way_as_a_column_that_shears(share: float) -> None:
    """A small force Q aside and a push F. Linear theory, with c = 1 + F/A and w^2 = F c / B, has (Haringx' column)

    v = c Q / F (tan(w L) / w - L) + Q L / A, which has no bound at w L = pi/2; for a pull, F < 0, tan becomes tanh.
    """
    rod = replace(ROD.planar(), shear=800.0)  # soft, so that shear lowers the buckling load by a fifth
    euler = np.pi**2 * rod.bending / (4.0 * rod.length**2)
    critical = 2.0 * euler / (1.0 + np.sqrt(1.0 + 4.0 * euler / rod.shear))
    assert critical < 0.81 * euler
    push, aside = share * critical, 1e-4
    c = 1.0 + push / rod.shear
    w = np.sqrt(complex(push * c / rod.bending))
    expected = c * aside / push * ((np.tan(w * rod.length) / w).real - rod.length) + aside * rod.length / rod.shear
    position, _ = tip(rod, (-push, aside, 0.0), tol=1e-11)
    assert position[1] == pytest.approx(expected, rel=1e-6)


def test_a_pull_stretches_and_a_moment_twists_and_bends() -> None:
    position, _ = tip(ROD, (100.0, 0.0, 0.0))
    assert position == pytest.approx([0.6 * (1.0 + 100.0 / (MODULUS * 2.0 * np.pi * 0.055 * 0.0005)), 0.0, 0.0], abs=1e-10)
    _, rotation = tip(ROD, (0.0, 0.0, 0.0), (3.0, 0.0, 0.0))
    twist = 3.0 * 0.6 / (2.0 * np.pi * 0.055**3 * (0.0005 * MODULUS / 2.6 + 0.5 * 50e3 * 0.055))  # the wall and its tension
    assert np.arctan2(rotation[2, 1], rotation[1, 1]) == pytest.approx(twist, abs=1e-9)
    across, along, turn = rods.elastica_moment_tip(ROD.bending, 0.6, 15.0)
    position, rotation = tip(ROD, (0.0, 0.0, 0.0), (0.0, 0.0, 15.0))  # no force: no shear, no stretch
    assert position == pytest.approx([along, across, 0.0], abs=1e-9)
    assert angle(rotation) == pytest.approx(turn, abs=1e-9)


def test_a_bent_arm_gives_way_by_bending_shear_and_twist() -> None:
    """Two rods at a right angle, a small force across both: L^3/3B and L/A of each, and the first twists by F L under F L."""
    quarter = turned((0.0, 0.0, 1.0), np.pi / 2)
    found = solve_inflated_chain([ROD, ROD], [AHEAD, quarter], (0.0, 0.0, 1e-3), tol=1e-11)
    beam = 0.6**3 / (3.0 * ROD.bending) + 0.6 / ROD.shear
    assert found.position[2] == pytest.approx(1e-3 * (2.0 * beam + 0.6**3 / ROD.twisting), rel=1e-6)
    assert found.bending_moments == pytest.approx([0.6e-3, 0.6e-3], rel=1e-6)
    stiff = solve_inflated_chain([ROD.planar()] * 2, [AHEAD, quarter], (0.0, 0.0, 1e-3), tol=1e-11)
    assert stiff.position[2] == pytest.approx(2e-3 * beam, rel=1e-6)


def test_one_rod_is_the_same_as_two_halves_and_turns_with_its_load() -> None:
    force, moment = np.array([4.0, 30.0, -12.0]), np.array([2.0, -1.0, 3.0])
    position, rotation = tip(ROD, force, moment)
    half = replace(ROD, length=0.3)
    found = solve_inflated_chain([half, half], [AHEAD, AHEAD], force, moment, tol=1e-9)
    assert found.position == pytest.approx(position, abs=1e-8)
    turn = product(turned((0.0, 0.0, 1.0), 0.7), turned((0.0, 1.0, 0.0), -1.1))
    r = rods.quaternion_rotation(turn[None])[0]
    found = solve_inflated_chain([ROD], [turn], r @ force, r @ moment, tol=1e-9)
    assert found.position == pytest.approx(r @ position, abs=1e-8)
    assert found.rotation == pytest.approx(r @ rotation, abs=1e-8)


# --- Pseudo-rigid links


def two_hinges(links: int, **options: Any) -> sr.SoftModel:
    lengths = (0.6,) * links
    return sr.load_model(sr.InflatableArm(link_lengths=lengths, link_model="two_hinges", young_modulus=MODULUS, **options))


def test_two_hinges_have_the_compliance_of_the_beam() -> None:
    """Deflection and rotation under a force and under a moment at the tip: L^3/3B + L/A, L^2/2B, L/B; and twist: L/C."""
    model = two_hinges(1, torsion=True)
    compliance = sr.compliance(model, sr.solve_equilibrium(model, (0, 0)))
    deflection, rotation, bent = 0.6**3 / (3.0 * ROD.bending) + 0.6 / ROD.shear, 0.6**2 / (2.0 * ROD.bending), 0.6 / ROD.bending
    assert compliance[np.ix_([1, 5], [1, 5])] == pytest.approx(np.array([[deflection, rotation], [rotation, bent]]), rel=1e-12)
    assert compliance[np.ix_([2, 4], [2, 4])] == pytest.approx(
        np.array([[deflection, -rotation], [-rotation, bent]]), rel=1e-12
    )
    assert compliance[3, 3] == pytest.approx(0.6 / ROD.twisting, rel=1e-12)


def test_the_straight_arm_of_the_paper_sags_by_what_its_hinges_say() -> None:
    """For a small force: beams end to end 8 L^3/3B + 2 L/A; hinges at l1 ((2 L - l1)^2 + l2^2) / k, 39 % less."""
    arm, force = sr.load_model(sr.InflatableArm()), (0.0, 1e-4, 0.0)
    rod = InflatedRod.tube(young_modulus=inflated_beam.young_modulus_from_stiffness(172.71, **TUBE), **TUBE)
    beams = solve_inflated_chain([rod.planar()] * 2, [AHEAD] * 2, force, tol=1e-11).position[1]
    assert beams == pytest.approx(1e-4 * (8.0 * 0.6**3 / (3.0 * rod.bending) + 1.2 / rod.shear), rel=1e-6)
    lumped = sr.solve_equilibrium(arm, (0, 0, 0), force).tip_position[1]
    assert lumped == pytest.approx(1e-4 * (1.17**2 + 0.57**2) / 172.71, rel=1e-6)
    assert 1.0 - lumped / beams == pytest.approx(0.386, abs=0.0005)
    soft = solve_inflated_chain([ROD.planar()] * 2, [AHEAD] * 2, force, tol=1e-11).position[1]
    assert sr.solve_equilibrium(two_hinges(2), (0, 0, 0), force).tip_position[1] == pytest.approx(soft, rel=1e-6)


def test_the_error_of_two_hinges_is_of_second_order_in_the_load() -> None:
    model = two_hinges(1)
    apart = []
    for force in (8.0, 16.0, 32.0):
        position, _ = tip(ROD.planar(), (0.0, force, 0.0), tol=1e-10)
        found = sr.solve_equilibrium(model, (0, 0), (0, force, 0)).tip_position
        apart.append(abs(found[1] / position[1] - 1.0))
    orders = np.log2(np.array(apart[1:]) / apart[:-1])
    assert orders == pytest.approx([2.0, 2.0], abs=0.05)
    assert apart[-1] < 1e-3  # at 32 N, just below wrinkling


# --- The script


@pytest.fixture
def script() -> Any:
    return load_script("beam_validity")


def test_the_record_is_what_a_fresh_run_says() -> None:
    """One pressure and two loads of the link, two cases of the arm; recorded with six digits, solved to 1e-6."""
    from tests.support import inflated_rods

    record = json.loads(RECORD.read_text())
    link, arm = record["link"], record["arm"]
    (row,) = [one for one in link["rows"] if one["pressure_Pa"] == 50e3]
    chosen = [link["loads_N"].index(load) for load in (20.0, 60.0)]
    fresh = link_at(inflated_rods, 50e3, [20.0, 60.0])
    assert fresh["deflection_m"] == pytest.approx([row["deflection_m"][i] for i in chosen], rel=2e-5)
    for name, both in fresh["percent"].items():
        for ours, recorded in zip(both, row["percent"][name], strict=True):
            assert ours == pytest.approx([recorded[i] for i in chosen], abs=2e-3)  # percent: 2e-5 of the deflection
    rod = arm_rod(inflated_rods)
    drawn = list(cases_of(inflated_rods, rod, 2, arm["seed"]))
    first = arm["first"]["also twist and stretch"]
    for name in ("as in the paper", "two hinges by (1)", "two hinges that twist"):
        model = sr.load_model(lumped(rod)[name].robot(2))
        for (case, found), recorded in zip(drawn, first[name], strict=False):
            (tip,) = solved(model, [case])
            assert np.linalg.norm(tip[:3, 3] - found.position) == pytest.approx(recorded[0], abs=1e-5)  # of up to 0.2 m


def told_of(errors: dict[str, list[float]]) -> str:
    return f"{100 * errors['share'][0]:.0f} % of the deflection (median), at most {100 * errors['share'][2]:.0f} %"


def beams_of_the_guide() -> np.ndarray:
    rod = InflatedRod.tube(young_modulus=inflated_beam.young_modulus_from_stiffness(172.71, **TUBE), **TUBE).planar()
    turns = [turned((0.0, -1.0, 0.0), 0.7), turned((0.0, -1.0, 0.0), -1.0)]
    return solve_inflated_chain([rod, rod], turns, (0.0, 0.0, -15.0)).position


def test_what_the_guide_says_is_what_was_recorded() -> None:
    """The sentences of docs/agreement.md, each from the numbers it rests on."""
    record = json.loads(RECORD.read_text())
    text = " ".join((CHECKOUT / "docs" / "agreement.md").read_text().split())
    (row,) = [one for one in record["link"]["rows"] if one["pressure_Pa"] == 50e3]
    beams = record["arm"]["beams"]["bend and shear"]
    twisting = record["arm"]["beams"]["also twist and stretch"]
    paper, two = beams["as in the paper"], beams["two hinges by (1)"]
    leaves = row["leaves_at_N"]["(1)"][0]
    for told in (
        f"The linear (1) is 1 % too soft at {leaves[0]:.0f} N and 5 % at {leaves[1]:.0f} N",
        told_of(paper),
        f"misses {100 * two['share'][0]:.1f} % (median), at most {100 * two['share'][2]:.1f} % of the deflection",
        told_of(twisting["beams that do not twist or stretch"]),
        "The tip of two beams is at x = {0:.4f}, z = {2:.4f} m".format(*beams_of_the_guide()),
    ):
        assert told in text, told
    at_wrinkling = {
        name: [
            np.interp(one["wrinkles_at_N"], record["link"]["loads_N"], one["percent"][name][0])
            for one in record["link"]["rows"]
        ]
        for name in row["percent"]
    }
    assert "(1) is right to 2.1 % at any pressure up to 60 kPa" in text
    assert max(at_wrinkling["(1)"]) == pytest.approx(2.1, abs=0.05)
    assert "The paper's link deflects 8 to 11 % less" in text
    assert -11.5 < min(at_wrinkling["as in the paper"]) < max(at_wrinkling["as in the paper"]) < -7.5
    assert two["error_m"][2] < 0.1 * paper["error_m"][2]
    assert record["arm"]["cases"] == 400
    assert two["share"][0] <= 0.005
    assert twisting["two hinges that twist"]["share"][0] <= 0.01


def test_a_small_run_writes_tables_numbers_and_pictures(
    script: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tool: Any
) -> None:
    tool("matplotlib")
    monkeypatch.setattr(script, "PRESSURES", (10_000, 50_000))
    monkeypatch.setattr(script, "LOADS", (1, 30, 60))
    monkeypatch.setattr(arm_study, "EVALUATIONS", 3)
    folder = tmp_path / "out"
    assert script.main(["--cases", "2", "--seed", "5", "--output", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert json.loads((folder / "beam_validity.json").read_text()) == result
    assert {path.name for path in folder.iterdir()} == {"beam_validity.json", "beam_validity.md", *script.PICTURES}
    assert re.search(r"\| 50 \| 169\.4 \|", (folder / "beam_validity.md").read_text())
    assert "one link: 100%" in err
    found = result["arm"]["beams"]["bend and shear"]
    assert found["two hinges by (1)"]["share"][2] < 0.1 < found["as in the paper"]["share"][0]
    assert script.main(["--output", str(folder)]) == 2
    assert "is not empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(["--cases", "0"], "--cases"), (["--seed", "-1"], "--seed"), (["--docs", "nowhere"], "cannot read nowhere")],
)
def test_bad_arguments_are_refused_before_work_starts(
    script: Any, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert script.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert "one link" not in err


@pytest.mark.parametrize(
    ("loads", "percent", "limit", "expected"),
    [([1, 4, 8], [0.0, 1.0, -3.0], 2.0, 6.0), ([1, 4], [-9.0, -8.0], 5.0, 0.0), ([1, 4], [0.1, 0.2], 1.0, None)],
)
def test_the_load_at_which_a_model_leaves_the_beam(
    loads: list[float], percent: list[float], limit: float, expected: float | None
) -> None:
    assert reached(loads, percent, limit) == expected
