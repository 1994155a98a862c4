"""Derivatives of equilibria against central differences of solved equilibria, and reciprocity."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.sensitivity import inverse_stiffness
from tests.support.oracles import central_difference


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
