"""Round robots: turning one about its own axis changes nothing, and a bow that can turn is a neutral equilibrium."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled import Status
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


BOWED = {"two segments": {}, "pulled": {"motors": -5.0}, "pushed": {"force": (0, 0, -6.0)}, "light": {"force": (0, 0, -33.0)}}
"""What bows a PCC arm with given muscle forces: its weight, and more [N]."""


def ring(case: str, *, start: np.ndarray | None = None) -> sr.Equilibrium:
    model = rod(case if case in ROUND else "two segments")
    load = {"motors": 0.0, "force": None} | BOWED[case]
    motors = np.full(model.n_motors, load["motors"])
    return sr.solve_equilibrium(model, motors, load["force"], gravity=(0, 0, -9.81), q_springs0=start)


@pytest.mark.parametrize("case", BOWED)
def test_a_bow_that_can_turn_is_neutral_and_every_place_of_its_ring_solves(case: str, rng: np.random.Generator) -> None:
    """Also places a little beside the ring: they settle on it, nearby. Nothing in the solvers knows of the ring."""
    found = ring(case)
    assert np.abs(found.q_springs).max() > 0.01
    assert (found.stability.kind, found.stable) == ("neutral", False)
    for angle in rng.uniform(-np.pi, np.pi, 3):
        there = turned(found.q_springs, angle)
        again = ring(case, start=there)
        assert again.stability.kind == "neutral"
        assert np.abs(again.q_springs - there).max() < 1e-8
        beside = ring(case, start=there + 1e-3 * rng.normal(size=len(there)) * (np.arange(len(there)) % 4 < 3))
        assert beside.stability.kind == "neutral"
        assert abs(beside.tip_position[2] - found.tip_position[2]) < 1e-8
        assert np.abs(beside.q_springs - there).max() < 0.05


@pytest.mark.parametrize("function", [sr.compliance, sr.elastostatic_jacobian])
def test_a_neutral_equilibrium_has_no_derivatives(function: Any) -> None:
    """A ring, whose tangent has an eigenvalue of rounding, never exactly zero; and the arm at its own buckling load."""
    model = rod("two segments")
    arm = sr.load_model(sr.InflatableArm())
    push = sr.critical_load(arm, (0, 0, 0), (-1, 0, 0))
    for robot, found in ((model, ring("two segments")), (arm, sr.solve_equilibrium(arm, (0, 0, 0), (-push, 0, 0)))):
        assert found.stability.kind == "neutral"
        with pytest.raises(sr.NeutralEquilibrium, match="singular"):
            function(robot, found)
    held = sr.solve_equilibrium(model, np.zeros(model.n_motors), (0.1, 0, 0), gravity=(0, 0, -9.81))
    assert np.abs(function(model, held)).max() < 100.0  # [m/N]; about 1 / (0.1 N) where a bow can nearly turn


def test_what_cannot_turn_is_not_neutral() -> None:
    """The same arm with a side force; and the inflatable arm, whose universal joints are not round."""
    model = rod("two segments")
    held = sr.solve_equilibrium(model, np.zeros(model.n_motors), (0.1, 0, 0), gravity=(0, 0, -9.81))
    assert held.stability.kind == "stable"
    arm = sr.load_model(sr.InflatableArm())
    assert sr.solve_equilibrium(arm, (0, 0, 0), (-130.0, 0, 0)).stability.kind == "stable"


def test_a_saved_result_tells_the_stability(tmp_path: Path) -> None:
    """A neutral equilibrium, and one that flutters under a moment."""
    arm = sr.load_model(sr.InflatableArm())
    fluttering = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), wrench=(3, 10, -15, 60, -40, 20))
    for number, (found, kind) in enumerate(((ring("two segments"), "neutral"), (fluttering, "flutter"))):
        again = sr.load_result(sr.save_result(found, tmp_path / f"{number}.npz"))
        assert found.stability.kind == again.stability.kind == kind
        assert again.stable is False
        assert again.stability.eigenvalues == pytest.approx(found.stability.eigenvalues, rel=1e-9, abs=1e-6)


def test_the_compiled_solvers_name_the_ring(rng: np.random.Generator) -> None:
    """From rest, and from each place of the ring; a side force makes it stable again."""
    model = rod("two segments")
    solver = sr.compile(model, backend="python")
    motors, start = np.zeros(model.n_motors), ring("two segments").q_springs
    for angle in (None, *rng.uniform(-np.pi, np.pi, 2)):
        options = {} if angle is None else {"q_springs0": turned(start, angle)}
        found = solver.equilibrium(motors, gravity=(0, 0, -9.81), **options)
        assert (found.status, found.stable) == (Status.NEUTRAL, False)
        assert abs(found.tip_position[2] - ring("two segments").tip_position[2]) < 1e-8
        if angle is not None:
            assert np.abs(found.q_springs - turned(start, angle)).max() < 1e-8
    held = solver.equilibrium(motors, (0.1, 0, 0), gravity=(0, 0, -9.81))
    assert (held.status, held.stable) == (Status.CERTIFIED, True)
    batch = solver.equilibria(motors, [(0, 0, 0), (0.1, 0, 0)], gravity=(0, 0, -9.81))
    assert batch.status.tolist() == [Status.NEUTRAL, Status.CERTIFIED]
