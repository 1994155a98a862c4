"""Derivatives of equilibria against central differences of solved equilibria, and reciprocity."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.statics.sensitivity import inverse_stiffness, tip_columns, tip_motion
from tests.support.oracles import central_difference

# Step 1e-5 on equilibria solved to 1e-13: truncation 1e-10, rounding 1e-13 * 20 / 172 / 1e-5 = 1e-9; 1e-6 is required.
RELATIVE = 1e-6


def cases(rng: np.random.Generator, count: int = 6) -> list[tuple[np.ndarray, np.ndarray, tuple | None]]:
    gravities = (None, sr.EARTH_GRAVITY)
    return [(rng.uniform(-2, 2, 3), 15 * rng.normal(size=3), gravities[i % 2]) for i in range(count)]


def test_elastostatic_jacobian_matches_solved_equilibria(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for motors, force, gravity in cases(rng):
        found = sr.elastostatic_jacobian(arm, sr.solve_equilibrium(arm, motors, force, gravity=gravity))

        def tip(q: np.ndarray, force=force, gravity=gravity) -> np.ndarray:
            return sr.solve_equilibrium(arm, q, force, gravity=gravity, tolerance=1e-13).tip_position

        expected = central_difference(tip, motors, 1e-5)
        assert np.abs(found - expected).max() < RELATIVE * np.abs(expected).max()


def test_elastostatic_jacobian_with_a_moment(arm: sr.SoftModel) -> None:
    motors, wrench = np.array([0.3, 0.6, -0.8]), np.array([5.0, 10.0, -8.0, 3.0, -2.0, 4.0])
    found = sr.elastostatic_jacobian(arm, sr.solve_equilibrium(arm, motors, wrench=wrench))
    expected = central_difference(
        lambda q: sr.solve_equilibrium(arm, q, wrench=wrench, tolerance=1e-13).tip_position, motors, 1e-5
    )
    assert np.abs(found - expected).max() < RELATIVE * np.abs(expected).max()


def test_compliance_matches_solved_equilibria(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for motors, force, gravity in cases(rng):
        start = sr.solve_equilibrium(arm, motors, force, gravity=gravity, tolerance=1e-13)
        rotation = start.transform_tip_to_world.rotation

        def pose(extra: np.ndarray, motors=motors, force=force, gravity=gravity, rotation=rotation) -> np.ndarray:
            wrench = np.r_[force, np.zeros(3)] + extra
            moved = sr.solve_equilibrium(arm, motors, wrench=wrench, gravity=gravity, tolerance=1e-13).transform_tip_to_world
            return np.r_[moved.translation, pin.log3(moved.rotation @ rotation.T)]

        expected = central_difference(pose, np.zeros(6), 1e-3)  # truncation (1e-3 / 172)^2
        found = sr.compliance(arm, start)
        assert np.abs(found - expected).max() < RELATIVE * np.abs(expected).max()


def test_compliance_is_reciprocal_for_forces_and_positive(odd_arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """Maxwell-Betti: symmetric; a stable robot never moves against a push: no negative eigenvalue."""
    start = sr.solve_equilibrium(odd_arm, rng.uniform(-1, 1, 4), (5, -5, -10), gravity=sr.EARTH_GRAVITY)
    found = sr.compliance(odd_arm, start)
    assert np.abs(found - found.T).max() < 1e-15
    assert np.linalg.eigvalsh(found).min() > -1e-15


def test_motor_torques_by_tip_force_match_solved_equilibria(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    for motors, force, gravity in cases(rng, 3):
        found = sr.solve_equilibrium(arm, motors, force, gravity=gravity)
        columns = (part[:3] for part in tip_columns(arm, found.q_motors, found.q_springs))
        expected = central_difference(
            lambda f, motors=motors, gravity=gravity: (
                sr.solve_equilibrium(arm, motors, f, gravity=gravity, tolerance=1e-13).motor_torques
            ),
            force,
            1e-3,
        )
        slope = tip_motion(arm, *columns, found.tangent_stiffness, found.coupling)[0].T
        assert np.abs(slope - expected).max() < RELATIVE * np.abs(expected).max()


def test_jacobian_of_the_unloaded_arm_is_the_rigid_one(arm: sr.SoftModel) -> None:
    from tests.support.oracles import rigid_table

    motors = np.array([0.3, 0.6, -0.8])
    found = sr.elastostatic_jacobian(arm, sr.solve_equilibrium(arm, motors))
    assert np.allclose(found, central_difference(lambda q: rigid_table(q)[:3, 3], motors), atol=1e-9)


def test_bad_input_is_refused(arm: sr.SoftModel, odd_arm: sr.SoftModel) -> None:
    start = sr.solve_equilibrium(arm, (0, 0, 0), (0, 0, 1))
    for function in (sr.elastostatic_jacobian, sr.compliance):
        with pytest.raises(sr.ParameterError, match="equilibrium of the model given"):
            function(odd_arm, start)
        with pytest.raises(sr.ParameterError, match="an Equilibrium of the model"):
            function(arm, start.q)


def test_a_neutral_equilibrium_has_no_derivative() -> None:
    """Stiffness 1 N m/rad on one planar spring pushed by exactly k / l2: the tangent is exactly singular."""
    text = sr.InflatableArm(link_lengths=(0.75,), hinge_offset=0.25, stiffness=1.0).urdf()
    model = sr.load_model(text, springs={"spring_1_side": None})
    balanced = sr.solve_equilibrium(model, (0, 0, 0), (-2.0, 0, 0))  # k / l2 = 1 / 0.5
    assert not balanced.stable
    for function in (sr.compliance, sr.elastostatic_jacobian):
        with pytest.raises(sr.NeutralEquilibrium, match="neutral"):
            function(model, balanced)


@pytest.mark.parametrize("unsymmetric", [0.0, 0.3])
def test_the_smallest_eigenvalue_decides_in_all_units(unsymmetric: float, rng: np.random.Generator) -> None:
    """1e-9 of the springs' own stiffness, as for stability; also two at once, and springs from 1 to 1e6 N m/rad."""
    model: Any = SimpleNamespace(stiffness=np.array([1.0, 1e2, 1e4, 1e6]))
    turn, units = np.linalg.qr(rng.normal(size=(4, 4)))[0], np.sqrt(np.outer(model.stiffness, model.stiffness))
    for least in ((2e-9,), (1.1e-9, -1.1e-9), (-2e-9,), (9e-10,), (-9e-10, 2e-9), (0.0,)):
        relative = np.diag([*least, 0.5, 0.7, 1.2][:4])
        relative[2, 3] = unsymmetric
        tangent = units * (turn @ relative @ turn.T)
        if min(map(abs, least)) > 1e-9:
            # Eigenvalues of 1e-9 lose 1e-16 / 1e-9 to rounding.
            assert np.allclose(
                inverse_stiffness(model, tangent) * units, turn @ np.linalg.inv(relative) @ turn.T, rtol=1e-5, atol=1e3
            )
        else:
            with pytest.raises(sr.NeutralEquilibrium, match="singular"):
                inverse_stiffness(model, tangent)
