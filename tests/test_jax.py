"""Functions of JAX: transformations agree with each other and with differences, in batches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softrobots as sr

NAMES = ("stiffness", "hinge_offset", "motor[2].offset")
MOTORS, FORCES = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, -0.6]]), np.array([[1.0, 2.0, -3.0], [0.0, -4.0, 2.0]])


@pytest.fixture(scope="module")
def jax() -> Any:
    """JAX with numbers of 64 bits."""
    import jax

    jax.config.update("jax_enable_x64", True)
    return jax


@pytest.fixture(scope="module")
def equilibrium(jax: Any) -> Any:
    """The equilibrium of an arm."""
    return sr.jax.equilibrium(sr.InflatableArm(), NAMES, backend="python")


def test_derivatives_are_differences_in_both_modes(jax: Any, equilibrium: Any) -> None:
    """Of a function under `jit`; parameters are shared by the cases."""
    from jax.test_util import check_grads

    def of_scaled(motors: Any, forces: Any, scaled: Any) -> Any:
        return equilibrium(motors, forces, scaled * np.array([100.0, 0.1, 1.0]))

    scaled = equilibrium.values / np.array([100.0, 0.1, 1.0])
    # Central differences with steps of 1e-4 have errors of about 1e-8 and, of what is solved to 1e-13, 1e-9.
    check_grads(jax.jit(of_scaled), (MOTORS, FORCES, scaled), 1, eps=1e-4, atol=1e-6, rtol=1e-6)


@pytest.mark.study
def test_transformations_agree(jax: Any, equilibrium: Any) -> None:
    """A batch by `vmap`, by leading dimensions and row by row; forward and reverse mode."""
    values = equilibrium.values

    def height(motors: Any, force: Any, values: Any) -> Any:
        return equilibrium(motors, force, values)[1][..., 2].sum()

    by_all = jax.jit(jax.grad(height, argnums=(0, 1, 2)))(MOTORS, FORCES, values)
    first = jax.grad(height, argnums=(0, 1, 2))(MOTORS[0], FORCES[0], values)
    by_vmap = jax.vmap(jax.grad(height, argnums=(0, 1, 2)), (0, 0, None))(MOTORS, FORCES, values)
    for place in range(3):
        rows = np.asarray(by_vmap[place])
        assert rows[0] == pytest.approx(np.asarray(first[place]), abs=1e-13)
        assert np.asarray(by_all[place]) == pytest.approx(rows if place < 2 else rows.sum(axis=0), abs=1e-13)
    summed = jax.grad(lambda p: jax.vmap(height, (0, 0, None))(MOTORS, FORCES, p).sum())(values)
    assert np.asarray(summed) == pytest.approx(np.asarray(by_all[2]), abs=1e-13)
    each = np.stack([values, values * 1.1])
    robots = jax.vmap(jax.jacfwd(equilibrium, argnums=2), (None, None, 0))(MOTORS, FORCES, each)
    back = jax.vmap(jax.jacrev(equilibrium, argnums=2), (None, None, 0))(MOTORS, FORCES, each)
    for a, b in zip(robots, back, strict=True):
        assert np.asarray(a) == pytest.approx(np.asarray(b), abs=1e-12)


def test_a_load_estimate_inverts_the_equilibrium(jax: Any) -> None:
    """The force by the motor torques has the inverse of the derivatives of the torques by the force."""
    arm = sr.InflatableArm()
    model = sr.load_model(arm)
    found = sr.solve_equilibrium(model, MOTORS[0], FORCES[0])
    estimate = sr.jax.load_estimate(arm, backend="python")
    assert np.asarray(estimate(MOTORS[0], found.motor_torques)[2]) == pytest.approx(FORCES[0], abs=1e-9)
    by_torques = jax.jacrev(estimate, argnums=1)(MOTORS[0], found.motor_torques)[2]
    assert np.asarray(by_torques) @ sr.elastostatic_jacobian(found.model, found)[:3].T == pytest.approx(np.eye(3), abs=1e-9)


def test_gradients_of_a_tendon_arm_are_differences(jax: Any) -> None:
    """Of a robot that is not compiled, under `jit` and `vmap`."""
    arm = sr.TendonArm(segment_lengths=(0.06,), elastic_sections=2)
    solve = sr.jax.equilibrium(arm, ("tendon_stiffness", "tendon_pretension"), gravity=sr.EARTH_GRAVITY)
    pulled, force = np.array([[0.058, 0.064, 0.062], [0.06, 0.059, 0.061]]), np.array([0.2, 0.1, -0.1])

    def height(scaled: Any) -> Any:
        return jax.vmap(lambda q: solve(q, force, scaled * solve.values)[1][0])(pulled).sum()

    slopes = np.asarray(jax.jit(jax.grad(height))(np.ones(2)))
    for place, slope in enumerate(slopes):
        step = 1e-4 * np.eye(2)[place]
        assert slope == pytest.approx(float(height(1.0 + step) - height(1.0 - step)) / 2e-4, rel=1e-5)


def test_what_jax_functions_refuse(jax: Any, equilibrium: Any) -> None:
    with pytest.raises(NotImplementedError, match="first derivatives only"):
        jax.hessian(lambda q: equilibrium(q, FORCES[0])[1].sum())(MOTORS[0])
    with pytest.raises(sr.ParameterError, match=r"shape \(\.\.\., 3\)"):
        equilibrium(np.zeros(4), FORCES)
    with pytest.raises(sr.ParameterError, match="leading dimensions"):
        jax.jit(equilibrium)(np.zeros((2, 3)), np.zeros((3, 3)))
    with pytest.raises(sr.ParameterError, match="finite motors and loads"):
        equilibrium(np.full(3, np.nan), FORCES[0])
    with pytest.raises(Exception, match=r"rows = \[0\]"):  # of a kind of JAX, which holds ours
        jax.jit(equilibrium)(np.full(3, np.nan), FORCES[0])
    jax.config.update("jax_enable_x64", False)
    try:
        with pytest.raises(sr.ParameterError, match="jax_enable_x64"):
            equilibrium(MOTORS, FORCES)
    finally:
        jax.config.update("jax_enable_x64", True)
