"""Sets of parameters compared on what a fit has not seen: errors against fits and equilibria done by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.identification.cross_validation import CrossValidation
from tests.support.laws import law

START = sr.InflatableArm(link_lengths=(0.5,), stiffness=150.0)
GRAVITY = (0.0, 0.0, -9.81)


def measured(seed: int, **more: Any) -> sr.Measurements:
    """Nine rows of an arm of 190 N m/rad in a base 5 mm aside, in three families, with noise of 0.5 mm."""
    rng = np.random.default_rng(seed)
    q_motors, masses = rng.uniform(-1.0, 1.0, (9, 2)), rng.uniform(0.5, 2.0, 9)
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.5,), stiffness=190.0))
    cases = zip(q_motors, masses, strict=True)
    tips = [sr.solve_equilibrium(model, q, (0.0, 0.0, -9.81 * m), gravity=GRAVITY).tip_position for q, m in cases]
    tips = np.array(tips) + [0.0, 0.005, 0.0] + 5e-4 * rng.standard_normal((9, 3))
    labels = [f"{name} rep{rep}" for rep in (1, 2, 3) for name in ("up", "down", "side")]
    return sr.Measurements(q_motors, mass=masses, gravity=GRAVITY, tip_position=tips, labels=labels, **more)


@pytest.mark.study
@law("cross_validate", "CrossValidation")
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=1, deadline=None)
def test_the_error_is_that_of_a_fit_without_the_family_on_the_family(seed: int) -> None:
    rows = measured(seed)
    sets = {"springs": "stiffness", "springs and base": ("stiffness", "base.position.y")}
    found = sr.cross_validate(START, rows, sets, r"^\w+")
    assert isinstance(found, CrossValidation)
    assert found.families == ("up", "down", "side")
    assert found.sets == {"springs": ("stiffness",), "springs and base": ("stiffness", "base.position.y")}
    assert found.unit == "m"
    fit = sr.identify(START, rows[[0, 2, 3, 5, 6, 8]], sets["springs and base"])
    left_out, errors = rows[[1, 4, 7]], []
    for row in range(3):
        force = (0.0, 0.0, -9.81 * left_out.loads["mass"][row])
        tip = sr.solve_equilibrium(fit.model, left_out.q_motors[row], force, gravity=GRAVITY).tip_position
        tip = tip + [0.0, fit.values["base.position.y"], 0.0]
        errors.append(np.sum((left_out.measured["positions.tip"][row] - tip) ** 2))
    assert found.errors[1, 1] == pytest.approx(np.sqrt(np.mean(errors)), rel=1e-4)  # fits end 1e-6 of a step apart
    assert found.best == found.least == "springs and base"  # 5 mm of base against 0.5 mm of noise
    assert found.errors[0].min() > 2.0 * found.errors[1].max()


def test_families_errors_and_masks(tmp_path: Path) -> None:
    rows = measured(1, std={"tip_position": 5e-4}, mask=np.arange(9) != 4)
    seen = []

    def worst(fit: sr.Identification) -> float:
        seen.append(fit.validation.measurements.labels)
        return float(np.nanmax(np.abs(fit.validation.residuals["positions.tip"])))

    found = sr.cross_validate(START, rows, {"k": "stiffness"}, lambda label: label[-4:], error=worst, unit="m", loss="huber")
    assert found.families == ("rep1", "rep2", "rep3")
    assert seen == [("up rep1", "down rep1", "side rep1"), ("up rep2", "side rep2"), ("up rep3", "down rep3", "side rep3")]
    assert found.errors.shape == (1, 3)
    again = sr.load_result(sr.save_result(found, tmp_path / "compared.json"))
    assert (again.sets, again.families, again.unit) == (found.sets, found.families, found.unit)
    assert np.array_equal(again.errors, found.errors)
    assert again.summary() == found.summary()


def test_several_quantities_are_compared_in_standard_deviations() -> None:
    """Rows at the values of the fit are predicted to 1 mm and 0.1 N m: each number is one standard deviation off."""
    q_motors = np.array([[0.1, 0.2], [0.3, -0.4], [-0.5, 0.3], [0.2, 0.1]])
    model = sr.load_model(START)
    found = [sr.solve_equilibrium(model, q, (0.0, 0.0, -9.81), gravity=GRAVITY) for q in q_motors]
    signs = np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    rows = sr.Measurements(
        q_motors, mass=np.ones(4), gravity=GRAVITY, tip_position=[one.tip_position for one in found] + 1e-3 * signs,
        motor_torques=[one.motor_torques for one in found] + 0.1 * signs, labels=["a", "a", "b", "b"],
        std={"tip_position": 1e-3, "motor_torques": 0.1},
    )  # fmt: skip
    held = sr.cross_validate(START, rows, {"k": "stiffness"}, priors={"stiffness": (150.0, 1e-9)})
    assert held.unit == "standard deviations"
    assert held.errors == pytest.approx(1.0, rel=1e-6)


def test_the_smallest_set_within_one_standard_error_is_best() -> None:
    sets = {"one": ("a",), "two": ("a", "b"), "other": ("a", "c"), "three": ("a", "b", "c")}
    errors = np.array([[2.0, 3.0, 4.0], [1.1, 2.1, 3.1], [1.3, 2.3, 3.3], [1.0, 2.0, 3.0]])
    found = CrossValidation(sets, ("x", "y", "z"), errors, "m")
    assert found.standard_errors == pytest.approx(1.0 / np.sqrt(3.0))  # the scatter of 1, 2, 3 is 1
    assert found.least == "three"
    assert found.best == "two"  # "one" is 1 off, more than 0.58; "other" is as small as "two", and worse
    assert "least: three; best within one standard error: two" in found.summary()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"parameter_sets": {}}, "at least one set"),
        ({"parameter_sets": ["stiffness"]}, "at least one set"),
        ({"families": "no such"}, "found in every label; 'down rep1' does not have it"),
        ({"families": "("}, "a regular expression"),
        ({"families": 7}, "a regular expression"),
        ({"families": "rep"}, "at least two families"),
        ({"measurements": measured(1)[:3].q_motors}, "must be Measurements"),
        ({"measurements": sr.Measurements(np.zeros((2, 2)), tip_position=np.zeros((2, 3)))}, "with labels"),
        ({"error": lambda fit: float("nan")}, "error must be"),
    ],
)
def test_what_cannot_be_compared_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.cross_validate(**{"robot": START, "measurements": measured(1), "parameter_sets": {"k": "stiffness"}, **change})
    rows = measured(1)
    poses = sr.Measurements(
        rows.q_motors, poses={"tip": np.tile(np.eye(4), (9, 1, 1))}, labels=rows.labels
    )  # position and rotation
    with pytest.raises(sr.ParameterError, match="with standard deviations of all"):
        sr.cross_validate(START, poses, {"k": "stiffness"})
