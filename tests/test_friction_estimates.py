"""Forces from the tensions of a robot with dry friction: round trips from a state before, and what friction may hide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softrobots as sr

LENGTH, MOMENT = 0.3, 0.05  # of a segment [m], of its friction [N m]


def straight(**fields: object) -> sr.SoftModel:
    """One section at given lengths of three muscles, which hold its bending: `theta` moves the tip across by `LENGTH / 2`."""
    return sr.load_model(sr.PccArm(segment_lengths=(LENGTH,), elastic_sections=1, **fields))


def around(rng: np.random.Generator, **fields: object) -> tuple[sr.SoftModel, sr.Equilibrium, np.ndarray]:
    """A tendon arm somewhere, and where its motors go next."""
    model = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.05), elastic_sections=2, **fields))
    pulls = rng.uniform(-1e-3, 3e-3, model.n_motors)
    before = sr.solve_equilibrium(model, model.relaxed_motors - pulls)
    return model, before, before.q_motors + rng.uniform(-3e-4, 3e-4, model.n_motors)


@pytest.mark.parametrize("fields", [{"bending_friction": 5e-4}, {"guide_friction": 0.1}], ids=["bending", "guides"])
@pytest.mark.parametrize("size", [0.01, 0.3])
def test_a_force_is_found_from_tensions_and_the_state_before(
    rng: np.random.Generator, fields: dict[str, float], size: float
) -> None:
    """Small forces leave most sections stuck, larger ones slip; without the state before the force is within its range."""
    model, before, motors = around(rng, **fields)
    force = size * rng.normal(size=3)
    loaded = sr.solve_equilibrium(model, motors, force, previous=before)
    found = sr.estimate_load(model, motors, loaded.motor_torques, previous=before, restart=False)
    # What the search leaves of the torques is 1e-10 of them, about 1e-9 N; the motors feel 0.3 N of each newton or more.
    assert found.force == pytest.approx(force, abs=1e-7)
    assert found.equilibrium.q_springs == pytest.approx(loaded.q_springs, abs=1e-8)
    assert found.friction_range is not None
    low, high = found.friction_range.T
    assert np.all((low < force) & (force < high))


def test_the_range_holds_the_force_whatever_came_before(rng: np.random.Generator) -> None:
    """Ten histories that the estimate is not told of; to first order, and friction bends the arm little, so 2 % more."""
    hidden = []
    for _ in range(10):
        model, before, motors = around(rng, bending_friction=5e-4)
        force = 0.1 * rng.normal(size=3)
        torques = sr.solve_equilibrium(model, motors, force, previous=before).motor_torques
        found = sr.estimate_load(model, motors, torques, restart=False)
        low, high = found.friction_range.T  # type: ignore[union-attr]
        assert np.all(np.abs(force - 0.5 * (low + high)) < 0.51 * (high - low))
        hidden.append((np.abs(found.force - force) / (high - low)).max())
    assert max(hidden) > 0.1  # what was not told matters


def test_friction_hides_twice_its_moment_over_the_length() -> None:
    """Straight, the moment of the muscles is `f LENGTH / 2` and what friction carries; along the arm they feel all."""
    model = straight(bending_friction=MOMENT)
    rest = model.relaxed_motors
    bend = 0.02 * np.cos([0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0])
    out = sr.solve_equilibrium(model, rest + bend)
    back = sr.solve_equilibrium(model, rest, previous=out)
    for force in ((0.0, 0.0, 0.0), (0.2, -0.1, 3.0)):
        loaded = sr.solve_equilibrium(model, rest, force, previous=out)
        told = sr.estimate_load(model, rest, loaded.motor_torques, previous=out)
        assert told.force == pytest.approx(force, abs=1e-8)
        untold = sr.estimate_load(model, rest, loaded.motor_torques)
        # Way back its friction is whole, in the plane of bending, against none of a robot that was never bent.
        assert np.linalg.norm(untold.force - force) == pytest.approx(2.0 * MOMENT / LENGTH, rel=1e-6)
        for found, middle in ((told, untold.force), (untold, untold.force)):
            half = np.array([2.0 * MOMENT / LENGTH] * 2 + [0.0])
            expected = np.stack([middle - half, middle + half], axis=1)
            assert found.friction_range == pytest.approx(expected, abs=1e-6)
    assert np.abs(back.muscle_forces).max() > 0.1


def test_the_derivatives_are_those_of_small_steps_on_from_there(rng: np.random.Generator) -> None:
    """Central differences of the torques by the force, from the same state before; steps of 1e-6 N stay within the stick."""
    model, before, motors = around(rng, bending_friction=5e-4)
    force, step = np.array([0.05, -0.1, 0.02]), 1e-6
    ends = [
        [sr.solve_equilibrium(model, motors, force + sign * change, previous=before, tolerance=1e-14) for sign in (1, -1)]
        for change in step * np.eye(3)
    ]
    slope = np.array([(one.motor_torques - other.motor_torques) / (2.0 * step) for one, other in ends]).T
    torques = sr.solve_equilibrium(model, motors, force, previous=before).motor_torques
    found = sr.estimate_load(model, motors, torques, previous=before, restart=False)
    assert found.singular_values == pytest.approx(np.linalg.svd(slope)[1], rel=1e-4)


def test_a_robot_with_friction_may_lean_on_a_wall() -> None:
    """Against the wall goes what no motor feels; the other components come back, and the range is theirs."""
    model = sr.load_model(sr.TendonArm(bending_friction=5e-4))
    before = sr.solve_equilibrium(model, model.relaxed_motors - (2e-3, 0, 0, 0, 0, 0, 0, 0, 0))
    wall = sr.Environment([sr.HalfSpace((-1.0, 0.0, 0.0), 0.003 - before.tip_position[0])])
    force = np.array([0.02, 0.01, 0.05])
    leaning = sr.solve_equilibrium(model, before.q_motors, force, previous=before, environment=wall)
    assert sum(contact.normal_force for contact in leaning.contacts) > 0.1
    found = sr.estimate_load(model, before.q_motors, leaning.motor_torques, previous=before, environment=wall, restart=False)
    assert found.force[1:] == pytest.approx(force[1:], abs=1e-7)
    assert np.abs(found.unobservable_directions) == pytest.approx(np.array([[1.0, 0.0, 0.0]]), abs=1e-6)
    low, high = found.friction_range.T  # type: ignore[union-attr]
    assert np.all((low[1:] < force[1:]) & (force[1:] < high[1:]))


def test_an_estimate_with_friction_is_saved_and_told(rng: np.random.Generator, tmp_path: Path) -> None:
    model, before, motors = around(rng, bending_friction=5e-4)
    torques = sr.solve_equilibrium(model, motors, (0.1, 0.0, 0.1), previous=before).motor_torques
    found = sr.estimate_load(model, motors, torques, previous=before, torque_std=1e-3, restart=False)
    again = sr.load_result(sr.save_result(found, tmp_path / "found.npz"))
    assert again.friction_range == pytest.approx(found.friction_range, abs=1e-12)
    assert again.covariance == pytest.approx(found.covariance, rel=1e-9)
    assert "friction unknown" in found.summary()
    loose = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.05), elastic_sections=2))
    plain = sr.estimate_load(loose, motors, sr.solve_equilibrium(loose, motors).motor_torques, restart=False)
    assert plain.friction_range is None


def test_what_estimates_do_not_take_is_refused() -> None:
    model = straight(bending_friction=MOMENT)
    rest, other = model.relaxed_motors, straight(bending_friction=2.0 * MOMENT)
    with pytest.raises(sr.ParameterError, match=r"'alternation' \('newton' takes it\)"):
        sr.estimate_load(model, rest, np.zeros(3), method="alternation")
    with pytest.raises(sr.ParameterError, match="previous"):
        sr.estimate_load(model, rest, np.zeros(3), previous=sr.solve_equilibrium(other, other.relaxed_motors))
    with pytest.raises(sr.ParameterError, match="places of contacts"):
        sr.locate_contact(model, rest, np.zeros(3), torque_std=0.01)
