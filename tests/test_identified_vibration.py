"""Fits to frequencies and damping ratios: robots give their own masses, stiffnesses and damping times back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor

GRAVITY = np.array(sr.EARTH_GRAVITY)
ARM = sr.InflatableArm(link_lengths=(0.5, 0.4), stiffness=170.0, damping_time=0.004)
ROD = sr.PccArm(kind="tension", segment_lengths=(0.3,), bending_stiffness=0.02, elastic_sections=1,
                linear_density=0.2, damping_time=0.01)  # fmt: skip


def measured(parameters: ParameterSet, values: Any, commanded: Any, forces: Any, modes: int, rung: Any) -> sr.Measurements:
    """Tip positions of all rows, modes of some, by `solve_equilibrium` and `vibration_modes`."""
    model, rotation = parameters.model(values), pin.exp3(parameters.base(values)[1])
    tips, seen = [], np.full((2, len(commanded), modes), np.nan)
    for row, (motors, force) in enumerate(zip(commanded, forces, strict=True)):
        at = np.asarray(motors) + parameters.motor_offsets(values)
        found = sr.solve_equilibrium(model, at, rotation.T @ force, gravity=rotation.T @ GRAVITY, tolerance=1e-13)
        tips.append(rotation @ found.tip_position)
        if row in rung:
            vibration = sr.vibration_modes(model, found)
            seen[:, row] = vibration.frequencies[:modes], vibration.damping_ratios[:modes]
    arguments = {"tip_position": np.array(tips), "frequencies": seen[0], "damping_ratios": seen[1]}
    return sr.Measurements(commanded, force=forces, gravity=GRAVITY, **arguments)


def arm() -> tuple[ParameterSet, np.ndarray, sr.Measurements]:
    """An arm with other numbers, turned on its base, that was plucked in three of five rows."""
    chosen = ParameterSet.of(ARM, ("link[*].stiffness", "density", "damping_time", "motor[2].offset", "base.rotation.x"))
    true, random = np.array([210.0, 140.0, 1600.0, 0.007, 0.03, 0.1]), np.random.default_rng(1)
    commanded, forces = random.uniform(-0.8, 0.8, (5, 3)), random.normal(0.0, 4.0, (5, 3))
    return chosen, true, measured(chosen, true, commanded, forces, 3, {0, 2, 4})


@pytest.mark.study
def test_an_arm_gives_its_own_mass_stiffness_and_damping_back(tmp_path: Path) -> None:
    chosen, true, data = arm()
    found = sr.identify(ARM, data, ("link[*].stiffness", "density", "damping_time", "motor[2].offset", "base.rotation.x"))
    assert found.message == "converged"
    np.testing.assert_allclose((found.solution - true) / np.where(chosen.logarithmic, true, 1.0), 0.0, atol=1e-9)
    again = sr.load_result(sr.save_result(found, tmp_path / "fit.npz"))
    np.testing.assert_array_equal(again.predicted["damping_ratios"], found.predicted["damping_ratios"])


def test_slopes_are_those_of_modes_of_other_robots() -> None:
    """By central differences of fourth order of equilibria solved to 1e-12."""
    chosen, true, data = arm()
    values = 1.02 * true
    predictor = Predictor(chosen, data)
    predictor.refresh(values)
    slopes = predictor.at(values).slopes()
    for place, value in enumerate(values):
        step, expected = 1e-3 * max(abs(value), 1.0 if not chosen.logarithmic[place] else 0.0), {}
        for number, weight in ((-2, 1.0), (-1, -8.0), (1, 8.0), (2, -1.0)):
            near = Predictor(chosen, data).at(values + number * step * (np.arange(len(values)) == place)).differences()
            for key in ("frequencies", "damping_ratios"):
                expected[key] = expected.get(key, 0.0) + weight * near[key] / (12.0 * step)
        for key, slope in expected.items():
            size = max(np.nanmax(np.abs(slope)), 1e-6 / abs(value))
            known = np.isfinite(slope)
            np.testing.assert_allclose(slopes[key][..., place][known], slope[known], rtol=0.0, atol=1e-8 * size, err_msg=key)


@pytest.mark.study
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_round_rod_whose_modes_come_in_pairs(noise: float) -> None:
    """Both of a pair are measured; with noise the pair is apart, and its mean counts."""
    names = ("bending_stiffness", "linear_density", "damping_time")
    chosen, true = ParameterSet.of(ROD, names), np.array([0.026, 0.25, 0.013])
    data = measured(chosen, true, np.zeros((2, 3)), np.array([[0.0, 0.0, 0.0], [0.0, 0.02, 0.0]]), 2, {0, 1})
    random, seen = np.random.default_rng(2), dict(data.measured)
    told = {
        key: seen[key] * (1.0 + noise * random.standard_normal(seen[key].shape)) for key in ("frequencies", "damping_ratios")
    }
    told["frequencies"].sort(axis=1)
    std = {"tip_position": 1e-4} | {key: 1e-3 * np.abs(values) for key, values in told.items()}
    rows = sr.Measurements(data.q_motors, **data.loads, tip_position=seen["positions.tip"], **told, std=std)
    found = sr.identify(ROD, rows, names)
    assert found.message == "converged"
    np.testing.assert_allclose(found.solution, true, rtol=max(1e-9, 3.0 * noise))


def test_a_decrement_and_the_damping_ratio_that_it_is_tell_one_damping_time() -> None:
    """Without load a damping time is exactly proportional damping, and Clough and Penzien's closed relation holds."""
    model = sr.load_model(ARM)
    frequency = sr.vibration_modes(model, sr.solve_equilibrium(model, (0.0, 0.0, 0.0))).frequencies[0]
    ratio = 0.08
    slow = np.sqrt(1.0 - ratio**2)
    rows = sr.Measurements([[0.0, 0.0, 0.0]], damping_ratios=[[ratio]])
    found = sr.identify(ARM, rows, "damping_time").solution[0]
    expected = sr.damping_time_from_decrement(2.0 * np.pi * ratio / slow, frequency * slow)
    assert found == pytest.approx(expected, rel=1e-9)


def test_rows_that_have_no_modes_are_named() -> None:
    with pytest.raises(sr.ParameterError, match=r"measurements \(row 0\).*moment"):
        sr.identify(ARM, sr.Measurements([[0.0] * 3], wrench=[[0.0, 0, 0, 1, 0, 0]], frequencies=[[4.0]]), "density")
    rubbing = sr.TendonArm(elastic_sections=1, bending_friction=1e-3)
    data = sr.Measurements([sr.load_model(rubbing).relaxed_motors], frequencies=[[4.0]])
    with pytest.raises(sr.ParameterError, match="without dry friction, for frequencies"):
        sr.identify(rubbing, data, "young_modulus")
