"""Full poses in the compiled solvers, against the solvers on Pinocchio."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.chain.small_systems import inverse_small, smallest_square, solve_small
from softrobots.compiled.run.compiled_model import CompiledModel

PUSH = np.array([0.0, 10.0, -15.0])


@pytest.fixture(scope="module")
def wristed() -> sr.SoftModel:
    """The arm of the paper with a wrist: ten joints."""
    return sr.load_model(sr.InflatableArm(wrist=(0.08, 0.12)))


@pytest.fixture(scope="module")
def solver(wristed: sr.SoftModel) -> CompiledModel:
    """Its code in plain Python, which starts at once."""
    return sr.compile(wristed, backend="python")


def made(model: sr.SoftModel, random: np.random.Generator, count: int, gravity: Any) -> tuple[np.ndarray, ...]:
    """Motors, forces, and the poses that they give."""
    motors = random.uniform(*model.motor_limits.T, size=(count, model.n_motors))
    forces = random.normal(size=(count, 3))
    forces *= (random.uniform(0.0, 18.0, count) / np.linalg.norm(forces, axis=1))[:, None]
    rows = zip(motors, forces, strict=True)
    poses = [sr.solve_equilibrium(model, q, f, gravity=gravity).transform_tip_to_world.homogeneous for q, f in rows]
    return motors, forces, np.array(poses)


def check_rows(model: sr.SoftModel, batch: Any, targets: np.ndarray, forces: np.ndarray, gravity: Any) -> None:
    """Every certified row by an equilibrium of the solver on Pinocchio: springs to 1e-9 rad, pose to the tolerances."""
    for row in np.flatnonzero(batch.certified):
        found = sr.solve_equilibrium(model, batch.q_motors[row], forces[row], gravity=gravity)
        here = found.transform_tip_to_world
        away = float(np.linalg.norm(here.translation - targets[row, :3, 3]))
        angle = float(np.linalg.norm(pin.log3(here.rotation.T @ targets[row, :3, :3])))
        assert np.abs(found.q_springs - batch.q_springs[row]).max() < 1e-9
        assert abs(away - batch.tip_error[row]) < 1e-10
        assert abs(angle - batch.orientation_error[row]) < 1e-10
        assert away < 1e-9 + 1e-10
        assert angle < 1e-9 + 1e-10
        assert np.all((batch.q_motors[row] >= model.motor_limits[:, 0]) & (batch.q_motors[row] <= model.motor_limits[:, 1]))


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, sr.EARTH_GRAVITY], ids=["weightless", "heavy"])
def test_poses_are_reached_as_by_solve_ik(
    wristed: sr.SoftModel, solver: CompiledModel, gravity: Any, rng: np.random.Generator
) -> None:
    """From starts nearby the solution is that of `solve_ik`: 1e-9 over the least singular value, 0.01, apart."""
    motors, forces, poses = made(wristed, rng, 6, gravity)
    begins = np.clip(motors + rng.uniform(-0.1, 0.1, motors.shape), *wristed.motor_limits.T)
    batch = solver.inverse_kinematics(poses, forces, q_motors0=begins, gravity=gravity)
    assert batch.counts() == {Status.CERTIFIED: 6}
    check_rows(wristed, batch, poses, forces, gravity)
    for row in range(2):
        one = sr.solve_ik(wristed, poses[row], forces[row], gravity=gravity, q_motors0=begins[row], starts=4)
        assert np.allclose(one.q_motors, batch.q_motors[row], atol=1e-6)


@pytest.mark.study
def test_more_starts_reach_more_poses_from_afar(wristed: sr.SoftModel, solver: CompiledModel, rng: np.random.Generator) -> None:
    _, forces, poses = made(wristed, rng, 8, None)
    few, many = (solver.inverse_kinematics(poses, forces, starts=starts) for starts in (1, 12))
    assert few.certified.sum() < many.certified.sum() >= 6
    assert np.array_equal(few.q_motors[few.certified], many.q_motors[few.certified])  # what is reached is not searched again
    check_rows(wristed, many, poses, forces, None)


def test_no_row_touches_another_and_each_failure_has_its_status(wristed: sr.SoftModel, solver: CompiledModel) -> None:
    motors = np.array([0.3, 0.6, -0.8, 0.4, 0.5, 0.6])
    pose = sr.solve_equilibrium(wristed, motors, PUSH).transform_tip_to_world.homogeneous
    far, lost = pose.copy(), pose.copy()
    far[:3, 3] = (2.0, 0.0, 0.0)
    lost[1, 1] = np.nan
    batch = solver.inverse_kinematics([pose, far, lost, pose], PUSH, q_motors0=motors + 0.05)
    assert batch.status.tolist() == [Status.CERTIFIED, Status.NOT_REACHED, Status.NOT_A_NUMBER, Status.CERTIFIED]
    assert np.array_equal(batch.q_motors[0], batch.q_motors[3])
    assert np.abs(batch.q_motors[0] - motors).max() < 1e-6
    assert batch.orientation_error[2] == np.inf
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3] @ pin.exp3(np.array([0.0, 0.0, 3.0]))  # nearly half a turn: the angle is told rightly
    there = solver.inverse_kinematics(turned, PUSH, q_motors0=motors)
    if there.certified[0]:
        check_rows(wristed, there, turned[None], PUSH[None], None)


@pytest.mark.study
def test_a_path_of_poses_is_that_of_follow_trajectory(wristed: sr.SoftModel, solver: CompiledModel) -> None:
    """Also from one end to the other at once, through orientations between: 1e-9 over the least singular value apart."""
    first = pin.SE3(pin.rpy.rpyToMatrix(0.2, 0.9, -0.4), np.array([0.7, -0.5, 0.4]))
    last = pin.SE3(pin.rpy.rpyToMatrix(-0.5, 1.3, 0.6), np.array([0.9, 0.3, 0.2]))
    gravity = sr.EARTH_GRAVITY
    path = sr.straight_line(first, last, 1.0, 6)
    exact = sr.follow_trajectory(wristed, path.targets, PUSH, gravity=gravity)
    for rows in (slice(None), slice(0, 7, 6)):
        batch = solver.follow(path.targets[rows], PUSH, gravity=gravity)
        assert np.all(batch.certified)
        assert np.abs(batch.q_motors - exact.q_motors[rows]).max() < 1e-6
        check_rows(wristed, batch, path.targets[rows], np.tile(PUSH, (len(batch.q_motors), 1)), gravity)


@pytest.mark.study
def test_robots_that_cannot_have_poses_say_so(solver: CompiledModel) -> None:
    for robot in (sr.InflatableArm(), sr.PccArm(segment_lengths=(0.4, 0.4), elastic_sections=1)):
        with pytest.raises(sr.ParameterError, match="poses need six motors and a chain that is unrolled"):
            sr.compile(sr.load_model(robot), backend="python").inverse_kinematics(np.eye(4))
    wrong = np.diag([1.0, 1.0, -1.0, 1.0])
    for targets in (wrong, [np.eye(4), wrong], 2.0 * np.eye(4)):
        with pytest.raises(sr.ParameterError, match="poses: rotation and translation"):
            solver.inverse_kinematics(targets)
    with pytest.raises(sr.ParameterError, match="starts"):
        solver.inverse_kinematics(np.eye(4), starts=0)


def test_systems_of_six_equations(rng: np.random.Generator) -> None:
    """Against NumPy: the step of least norm, and the smallest singular value from below by a factor up to the root of six."""
    for columns in (6, 7):
        matrix, right = rng.normal(size=(6, columns)), rng.normal(size=6)
        square = matrix @ matrix.T
        assert np.allclose(np.array(inverse_small(square.astype(object)), float) @ square, np.eye(6), atol=1e-9)
        assert np.allclose(
            np.array(solve_small(matrix.astype(object), right), float), np.linalg.pinv(matrix) @ right, rtol=1e-8
        )
        least = np.linalg.svd(matrix)[1][-1] ** 2
        assert least / 6.0 <= float(smallest_square(matrix.astype(object))) <= least * (1.0 + 1e-9)


@pytest.mark.study
def test_both_back_ends_reach_the_same_poses(wristed: sr.SoftModel, solver: CompiledModel, rng: np.random.Generator) -> None:
    """Five hundred poses by numba, lanes and single cases; its first call compiles for half a minute."""
    motors, forces, poses = made(wristed, rng, 500, sr.EARTH_GRAVITY)
    begins = np.clip(motors + rng.uniform(-0.1, 0.1, motors.shape), *wristed.motor_limits.T)
    fast = sr.compile(wristed, backend="numba").inverse_kinematics(poses, forces, q_motors0=begins, gravity=sr.EARTH_GRAVITY)
    assert fast.certified.mean() > 0.98
    check_rows(wristed, fast, poses, forces, sr.EARTH_GRAVITY)
    slow = solver.inverse_kinematics(poses, forces, q_motors0=begins, gravity=sr.EARTH_GRAVITY)
    assert np.array_equal(fast.status, slow.status)
    assert np.abs(fast.q_motors - slow.q_motors)[fast.certified].max() < 1e-6
