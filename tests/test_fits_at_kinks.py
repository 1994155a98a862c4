"""Fits of robots whose tendons go slack: where one does, the derivatives of its row jump, and the sum of squares has a kink."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.core.errors import ParameterError
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.prediction import Predictor

ARM = sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=1, tendon_pretension=0.5)
NAMES = ("motor[*].offset", "tendon[*].tendon_stiffness", "segment[*].bending_stiffness", "offset[2]")
PRIORS = {
    "motor[*].offset": (0.0, 2.5e-4),
    "tendon[*].tendon_stiffness": (8e3, 2e3),
    "segment[*].bending_stiffness": (0.00245, 0.0002),
}


@pytest.fixture(scope="module")
def rows() -> sr.Measurements:
    """Thirty random pulls of an arm with tendons of different stiffness, to 1 mm; half of the tendons are slack."""
    rng = np.random.default_rng(1)
    pulls = rng.uniform(-6e-3, 6e-3, (30, 6))
    stiffness = tuple((8e3 * np.exp(rng.normal(0.0, 0.2, 6))).tolist())
    true = sr.load_model(
        sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=1, tendon_pretension=0.5, tendon_stiffness=stiffness,
                     offset=(0.0, 0.3))
    )  # fmt: skip
    found = [sr.solve_equilibrium(true, true.relaxed_motors - pull) for pull in pulls]
    assert 0.3 < np.mean([np.asarray(one.muscle_forces) == 0.0 for one in found]) < 0.7
    tips = np.array([one.tip_position for one in found]) + rng.normal(0.0, 1e-3, (30, 3))
    return sr.Measurements(pulls, tip_position=tips, relative=True, std=1e-3)


@pytest.fixture(scope="module")
def fit(rows: sr.Measurements) -> sr.Identification:
    return sr.identify(ARM, rows, NAMES, priors=PRIORS)


def test_a_fit_that_ends_at_a_kink_has_converged(rows: sr.Measurements, fit: sr.Identification) -> None:
    """The sum of squares, of equilibria solved anew, is lower nowhere within 1, 0.1 and 0.01 standard errors."""
    chosen = ParameterSet.of(ARM, NAMES)
    means, stds = np.array([fit.priors.get(name, (0.0, np.inf)) for name in fit.names]).T

    def squares(values: np.ndarray) -> float:
        robot = sr.load_model(chosen.robot(values))
        motors = robot.relaxed_motors - rows.q_motors + values[:6]
        tips = np.array([sr.solve_equilibrium(robot, one).tip_position for one in motors])
        missed = (rows.measured["positions.tip"] - tips) / 1e-3
        return float(np.sum(missed**2) + np.sum(((values - means) / stds) ** 2))

    least, rng = squares(fit.solution), np.random.default_rng(2)
    assert fit.message == "converged"
    assert least == pytest.approx(2.0 * fit.history.cost[-1], rel=1e-6)
    for size in (1.0, 0.1, 0.01):
        for step in size * rng.multivariate_normal(np.zeros(len(fit.names)), fit.covariance, 8):
            assert squares(fit.solution + step) > (1.0 - 1e-4) * least


def test_a_search_that_comes_back_needs_no_equilibrium_twice(
    rows: sr.Measurements, fit: sr.Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From other starts a row need not have its equilibrium again: a second search for one at the best values is not made."""
    solve, seen = Predictor._solve, list[tuple[int, bytes]]()

    def once(predictor: Predictor, model: sr.SoftModel, values: np.ndarray) -> Any:
        if (id(predictor), values.tobytes()) in seen:
            raise ParameterError("measurements", rows, "of other starts")
        seen.append((id(predictor), values.tobytes()))
        return solve(predictor, model, values)

    monkeypatch.setattr(Predictor, "_solve", once)
    assert sr.identify(ARM, rows, NAMES, priors=PRIORS).solution == pytest.approx(fit.solution, rel=1e-3, abs=1e-6)
