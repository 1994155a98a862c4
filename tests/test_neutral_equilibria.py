"""Round robots: turning one about its own axis changes nothing, and a bow that can turn is a neutral equilibrium."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.statics.elastic_state import ElasticState, elastic_state
from softrobots.statics.loads import Load

ROUND: dict[str, dict[str, Any]] = {
    "two segments": {"segment_lengths": (0.75, 0.75)},
    "turned between segments": {"segment_lengths": (0.3, 0.5, 0.2), "offset": 0.7, "elastic_sections": 2},
    "light": {"segment_lengths": (0.4,), "linear_density": 0.004, "elastic_sections": 3},
}
"""PCC arms; the last has tiny links of less than 0.1 g, 5 % of the halves of its sections."""


@cache
def rod(name: str) -> sr.SoftModel:
    return sr.load_model(sr.PccArm(**ROUND[name]), muscles="forces")


def turned(y: np.ndarray, angle: float) -> np.ndarray:
    """The elastic coordinates of the robot with every bend turned about its axis."""
    rows, cos, sin = y.reshape(-1, 4), np.cos(angle), np.sin(angle)
    return np.column_stack([cos * rows[:, 0] - sin * rows[:, 1], sin * rows[:, 0] + cos * rows[:, 1], rows[:, 2:]]).ravel()


def under_weight(model: sr.SoftModel, y: np.ndarray) -> ElasticState:
    return elastic_state(model, np.zeros(model.n_motors), y, Load.of(model, gravity=(0, 0, -9.81)))


@pytest.mark.parametrize("name", ROUND)
@given(seed=st.integers(0, 2**32 - 1), angle=st.floats(-3.2, 3.2))
@settings(max_examples=10)
def test_turning_a_bent_arm_about_its_axis_changes_no_energy_and_turns_the_residual(name: str, seed: int, angle: float) -> None:
    """To rounding, 1e-12 of the energy: no mass stands beside the chord or the ends of its section."""
    model = rod(name)
    y = (np.random.default_rng(seed).normal(size=(model.n_springs // 4, 4)) * (0.3, 0.3, 0.3, 0.01)).ravel()
    one, other = under_weight(model, y), under_weight(model, turned(y, angle))
    assert abs(other.energy - one.energy) <= 1e-12 * abs(one.energy)
    assert np.allclose(other.residual, turned(one.residual, angle), rtol=0, atol=1e-12 * np.abs(one.residual).max())
