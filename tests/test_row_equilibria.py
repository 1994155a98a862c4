"""Equilibria of many rows at once are those of `solve_equilibrium`, which goes through Pinocchio row by row."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from softrobots.identification.row_equilibria import balanced_rows
from tests.support.law_robots import PUSHES, ROBOTS, model

GRAVITY = np.array(sr.EARTH_GRAVITY)
KINDS = [*ROBOTS, "braided", "chambers"]


def robot_of(kind: str) -> sr.SoftModel:
    """One of the robots of the laws, or one with actuators of another kind."""
    if kind in ROBOTS:
        return model(kind)
    return sr.load_model(sr.PccArm(kind={"braided": "mckibben", "chambers": "pressure"}[kind], elastic_sections=1))


@pytest.mark.parametrize("kind", KINDS)
def test_rows_are_the_equilibria_of_each(kind: str) -> None:
    robot, random, n = robot_of(kind), np.random.default_rng(5), 12
    shares = random.uniform(0.0 if robot.n_motors and robot.actuators.units[-1] == "Pa" else -1.0, 1.0, (n, robot.n_motors))
    motors = robot.relaxed_motors + 0.3 * robot.motor_scale * shares
    forces = 0.1 * PUSHES.get(kind, 2.0) * random.standard_normal((n, 3))
    loads = {robot.tip: np.hstack([forces, np.zeros((n, 3))]), "": np.tile(GRAVITY, (n, 1))}
    each = [sr.solve_equilibrium(robot, q, f, gravity=GRAVITY, tolerance=1e-12) for q, f in zip(motors, forces, strict=True)]
    starts = np.array([one.q_springs for one in each]) * (1.0 + 1e-3 * random.standard_normal((n, robot.n_springs)))
    states, found = balanced_rows(robot, motors, loads, starts, 1e-12)
    if robot.structure.muscle_lengths is not None or robot.n_springs > 24:
        assert not found.any()
        return
    assert np.mean(found) > 0.7  # others, beside a tendon that goes slack or at rounding, are left to the row
    scale = 1.0 / np.sqrt(robot.stiffness)
    for row in np.flatnonzero(found):
        one = each[row]
        # the rounding of the residual, over the softest direction
        np.testing.assert_allclose(states.q_springs[row], one.q_springs, rtol=0, atol=1e-9)
        difference = scale[:, None] * (states.tangent[row] - one.tangent_stiffness) * scale
        np.testing.assert_allclose(difference, 0.0, atol=1e-8)
        np.testing.assert_allclose(
            states.coupling[row], one.coupling, rtol=1e-8, atol=1e-8 * np.abs(one.coupling).max(initial=1.0)
        )
        np.testing.assert_allclose(states.actuator_loads[row], one.motor_torques, rtol=1e-8, atol=1e-8)


def test_an_unstable_equilibrium_is_left() -> None:
    """A straight link pressed along its axis beyond its buckling load balances, but does not stay."""
    arm = model("arm")
    loads = {arm.tip: np.array([[-1e4, 0.0, 0.0, 0.0, 0.0, 0.0]])}
    _, found = balanced_rows(arm, np.zeros((1, arm.n_motors)), loads, np.zeros((1, arm.n_springs)), 1e-12)
    assert not found[0]
    loads = {arm.tip: np.array([[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]])}
    _, found = balanced_rows(arm, np.zeros((1, arm.n_motors)), loads, np.zeros((1, arm.n_springs)), 1e-12)
    assert found[0]


@pytest.mark.parametrize("robot", [sr.InflatableArm(), sr.TendonArm(elastic_sections=1, bending_friction=1e-3)])
def test_moments_and_friction_are_left_to_each_row(robot: object) -> None:
    arm = sr.load_model(robot)
    loads = {arm.tip: np.array([[0.0, 0.0, 0.0, 0.0, 1e-3, 0.0]])}
    states, found = balanced_rows(arm, arm.relaxed_motors[None], loads, arm.rest[None], 1e-12)
    assert not found[0]
    np.testing.assert_array_equal(states.q_springs[0], arm.rest)
