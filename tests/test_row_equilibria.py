"""Equilibria of many rows at once are those of `solve_equilibrium`, which goes through Pinocchio row by row."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from softrobots.identification import row_equilibria
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.row_equilibria import balanced_course, balanced_rows
from softrobots.model.friction_coordinates import memory_of
from softrobots.statics.elastostatics import LARGEST_STEP
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
    states = States.at(robot, motors, starts, loads)
    found = balanced_rows(robot, states, 1e-12)
    if robot.structure.muscle_lengths is not None or robot.n_springs > 48:
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


def test_rows_far_from_where_they_start_are_found_from_rest() -> None:
    """Tendons pulled by up to 5 mm bend an arm by more than one step may go; few rows are left to a search of their own."""
    arm, random, n = sr.load_model(sr.TendonArm(elastic_sections=1)), np.random.default_rng(2), 40
    motors = arm.relaxed_motors - random.uniform(-2e-3, 5e-3, (n, arm.n_motors))
    states = States.at(arm, motors, np.tile(arm.rest, (n, 1)), {})
    found = balanced_rows(arm, states, 1e-12)
    assert np.mean(found) > 0.9
    assert np.median(np.linalg.norm(states.q_springs - arm.rest, axis=1)) > LARGEST_STEP
    for row in np.flatnonzero(found):
        one = sr.solve_equilibrium(arm, motors[row], tolerance=1e-12)
        np.testing.assert_allclose(states.q_springs[row], one.q_springs, rtol=0, atol=1e-9)


def test_an_unstable_equilibrium_is_left() -> None:
    """A straight link pressed along its axis beyond its buckling load balances, but does not stay."""
    arm = model("arm")
    for force, stays in ((-1e4, False), (-1.0, True)):
        loads = {arm.tip: np.array([[force, 0.0, 0.0, 0.0, 0.0, 0.0]])}
        states = States.at(arm, np.zeros((1, arm.n_motors)), np.zeros((1, arm.n_springs)), loads)
        assert balanced_rows(arm, states, 1e-12)[0] == stays


@pytest.mark.parametrize("robot", [sr.InflatableArm(), sr.TendonArm(elastic_sections=1, bending_friction=1e-3)])
def test_moments_and_friction_are_left_to_each_row(robot: object) -> None:
    arm = sr.load_model(robot)
    loads = {arm.tip: np.array([[0.0, 0.0, 0.0, 0.0, 1e-3, 0.0]])}
    states = States.at(arm, arm.relaxed_motors[None], arm.rest[None].copy(), loads)
    assert not balanced_rows(arm, states, 1e-12)[0]
    np.testing.assert_array_equal(states.q_springs[0], arm.rest)


@pytest.mark.parametrize("gravity", [None, GRAVITY])
@pytest.mark.parametrize("friction", [3e-4, 3e-3, [1e-3, 1e-2]])
def test_rows_that_follow_one_another_are_those_of_a_trajectory(
    friction: object, gravity: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There and back and across, from rest: sections slip, turn round, and stick, and tendons go slack."""
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.07), offset=0.4, elastic_sections=1, bending_friction=friction))
    random, ramp = np.random.default_rng(3), np.r_[0.1:1.0:6j, 0.9:0.0:6j]
    pulls = np.concatenate([np.outer(ramp, pull) for pull in random.uniform(-2e-3, 6e-3, (5, 6))])
    motors, loads = arm.relaxed_motors - pulls, {} if gravity is None else {"": np.tile(GRAVITY, (len(pulls), 1))}
    states, now = States.at(arm, motors, np.tile(arm.rest, (len(motors), 1)), loads), None
    monkeypatch.setattr(row_equilibria, "balanced_state", lambda *_, **__: None)  # none is found by itself
    sliders, lost = balanced_course(arm, states, None, 1e-12)
    assert not lost
    for row, q in enumerate(motors):
        now = sr.solve_equilibrium(arm, q, gravity=gravity, previous=now, tolerance=1e-12)
        # the rounding of the moments of friction over the softest direction, which sliders carry on from row to row
        np.testing.assert_allclose(states.q_springs[row], now.q_springs, rtol=0, atol=1e-8)
        np.testing.assert_allclose(sliders[row], memory_of(now.model).bending, rtol=0, atol=1e-8)
        np.testing.assert_allclose(states.actuator_loads[row], now.motor_torques, rtol=0, atol=1e-6)
        scale = 1.0 / np.sqrt(arm.stiffness)
        stiffness = (scale[:, None] * one * scale for one in (states.tangent[row], now.tangent_stiffness))
        np.testing.assert_allclose(*stiffness, rtol=1e-5, atol=1e-5)  # of slip: over its length, down to a stick


def test_rows_that_cannot_be_solved_together_are_found_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.07), elastic_sections=1, bending_friction=3e-3))
    motors = arm.relaxed_motors - np.outer(np.r_[0.0:1.0:5j, 0.8:0.0:5j], [3e-3, -1e-3, 0.0, 1e-3, 4e-3, -2e-3])
    together, alone = (States.at(arm, motors, np.tile(arm.rest, (10, 1)), {}) for _ in range(2))
    sliders, lost = balanced_course(arm, together, None, 1e-12)

    def singular(*_: object) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(row_equilibria, "_steps", singular)
    others, more = balanced_course(arm, alone, None, 1e-12)
    assert [lost, more] == [[], []]
    # the rounding of the moments of friction over the softest direction, as above
    np.testing.assert_allclose(together.q_springs, alone.q_springs, rtol=0, atol=1e-8)
    np.testing.assert_allclose(sliders, others, rtol=0, atol=1e-8)
