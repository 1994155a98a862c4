r"""Local search for actuator coordinates that bring the loaded tip to a goal.

At every step the elastic coordinates are in equilibrium; the step uses the exact derivative of the loaded tip,
:math:`dx/dq_m = J_m + J_k K_t^{-1} d(J_k^T w - g_k)/dq_m`. With no load this is ordinary rigid inverse kinematics.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.checks import FloatArray
from softrobots.elastostatics import ElasticState, settled
from softrobots.errors import NeutralEquilibrium
from softrobots.kinematics import frame_jacobian, frame_placement
from softrobots.loads import Load
from softrobots.model import SoftModel
from softrobots.sensitivity import tip_motion

POSITION_TOLERANCE = 1e-9
"""Default distance of the tip from its target [m]."""

ANGLE_TOLERANCE = 1e-9
"""Angle between the tip and a wanted orientation [rad]."""

SAME = 1e-6
"""Actuator coordinates closer than this, over their scale, are one [rad]."""

_FIRST_DAMPING = 0.03  # of the first step, relative to the reach
_LAST_DAMPING = 1e-8
_LARGEST_STEP = 0.5  # [rad], norm of one step over the scale of the actuators
_STATIONARY = 1e-8  # slope of the distance [m/rad per m of reach] that counts as no slope: nothing nearer is near
_NEAR = 0.02  # distance from the goal, relative to the reach, that the way home may cost for a step
_LEVER = 0.2  # distance that a radian of orientation counts for, relative to the reach


class Goal(NamedTuple):
    """Where the tip must be, and perhaps how it must stand there."""

    position: FloatArray
    """Position, shape (3,) [m], world axes."""
    rotation: FloatArray | None = None
    """Orientation of the tip, shape (3, 3), or the direction of its z axis, shape (3,), of length 1; None: any."""

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, 2 more for a direction, 3 more for an orientation."""
        return 3 if self.rotation is None else 5 if self.rotation.ndim == 1 else 6

    def missing(self, model: SoftModel, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Way from the tip to the goal: translation, shape (3,) [m], and rotation vector, shape (3,) [rad], world axes."""
        pose = frame_placement(model, q, model.tip)
        return self.position - pose.translation, self._turn(pose.rotation)

    def _turn(self, rotation: FloatArray) -> FloatArray:
        if self.rotation is None:
            return np.zeros(3)
        if self.rotation.ndim == 2:
            return np.asarray(pin.log3(self.rotation @ rotation.T))
        pointing = rotation[:, 2]
        axis = np.cross(pointing, self.rotation)
        sine, cosine = float(np.linalg.norm(axis)), float(pointing @ self.rotation)
        if sine > 0.0:
            return np.asarray(axis * (np.arctan2(sine, cosine) / sine))
        return np.zeros(3) if cosine > 0.0 else np.pi * rotation[:, 0]  # opposite: any way round

    def jacobian(self, model: SoftModel, q: FloatArray) -> FloatArray:
        """Derivative of what `missing` is measured by, per joint, shape (3 or 6, nv), turns times the lever [m/rad]."""
        columns = frame_jacobian(model, q, model.tip)
        if self.rotation is None:
            return columns[:3]
        turning = columns[3:]
        if self.rotation.ndim == 1:
            pointing = frame_placement(model, q, model.tip).rotation[:, 2]
            turning = turning - np.outer(pointing, pointing @ turning)
        return np.concatenate([columns[:3], _LEVER * model.reach * turning])


class LocalSolution(NamedTuple):
    """Where a local search ended."""

    q_motors: FloatArray
    """Actuator coordinates, shape (n_motors,)."""
    state: ElasticState
    """The robot there."""
    error: float
    """Distance of the tip from the target [m]."""
    angle: float
    """Angle between the tip and the wanted orientation [rad]; 0 if none is wanted."""
    iterations: int
    """Steps."""
    unsettled: int
    """Actuator coordinates tried at which the robot did not settle."""

    def arrived(self, tolerance: float) -> bool:
        """Whether the tip is within `tolerance` [m] of the target, and stands as wanted."""
        return self.error <= tolerance and self.angle <= ANGLE_TOLERANCE

    def miss(self, model: SoftModel) -> float:
        """Distance and angle as one distance [m]."""
        return float(np.hypot(self.error, _LEVER * model.reach * self.angle))


def search(
    model: SoftModel,
    goal: Goal,
    load: Load,
    q_motors: FloatArray,
    q_springs: FloatArray,
    *,
    home: FloatArray | None = None,
    method: str = "newton",
    tolerance: float = POSITION_TOLERANCE,
    damping: float = _FIRST_DAMPING,
    max_iterations: int = 100,
) -> LocalSolution | None:
    """Search from one start by Levenberg-Marquardt within the actuator limits.

    Args:
        model: The robot.
        goal: The goal.
        load: The load.
        q_motors: Start of the actuators, shape (n_motors,), within the limits.
        q_springs: Start of the elastic coordinates, shape (n_springs,).
        home: Actuator coordinates to stay near to where there is freedom (more actuators than conditions); None: `q_motors`.
        method: How the springs settle.
        tolerance: Distance at which the search ends [m].
        damping: Damping of the first step, relative to the reach; small for starts near the solution.
        max_iterations: Most steps.

    Returns:
        Where the search ended, at the goal or not; None if the start itself has no equilibrium.
    """
    here = _settle_at(model, q_motors, load, q_springs, method, goal)
    if here is None:
        return None
    basis = model.actuators.basis
    mu, redundant, unsettled, pace = damping * model.reach, basis.shape[1] > goal.rows, 0, 1.0
    home = q_motors if home is None else home
    last: tuple[FloatArray, FloatArray] | None = None  # step and drift that led here
    reached: LocalSolution | None = None  # the last place on the way home that is at the goal
    for iteration in range(1, max_iterations + 1):
        translation, turn = goal.missing(model, here.state.q)
        missing = translation if goal.rotation is None else np.concatenate([translation, _LEVER * model.reach * turn])
        motors, springs = here.state.point.columns(goal.jacobian(model, here.state.q))
        try:
            slope, follow = tip_motion(motors, springs, here.state.tangent, here.state.load.coupling)
        except NeutralEquilibrium:
            break
        slope = slope @ basis
        arrived = here.arrived(tolerance)
        reached = here if arrived else reached
        going_home = redundant and reached is not None
        homeward = np.linalg.pinv(basis) @ (home - here.q_motors) if going_home else np.zeros(basis.shape[1])
        towards, drift, free = _step(model, here.q_motors, slope, missing, mu, homeward)
        if arrived and float(np.abs(drift).max()) <= SAME:
            return here._replace(iterations=iteration - 1, unsettled=unsettled)
        pace = pace if last is None else _pace(*last, drift)
        miss, last = here.miss(model), None
        if not arrived and float(np.linalg.norm(free @ (slope.T @ missing))) <= _STATIONARY * model.reach * miss:
            break
        step = towards + pace * drift
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        moved = model.actuators.go(here.q_motors, basis @ step)
        guess = here.state.q_springs + follow @ (moved - here.q_motors)
        there = _settle_at(model, moved, load, guess, method, goal)
        unsettled += there is None
        # Drifting home costs distance in second order, which the next step makes good.
        drifted = pace * float(np.linalg.norm(drift))
        allowed = max(10.0 * tolerance, model.reach * min(4.0 * drifted**2, _NEAR)) if going_home else 0.0
        if there is not None and (there.miss(model) < miss or there.miss(model) <= allowed):
            here, mu, last = there, 0.1 * mu if mu > _LAST_DAMPING * model.reach else 0.0, (step, drift)
        elif drifted > float(np.linalg.norm(towards)):
            pace *= 0.5
        else:
            mu = max(10.0 * mu, 10.0 * _LAST_DAMPING * model.reach)
            if mu > 1e6 * model.reach:
                break
    ended = here if reached is None or here.arrived(tolerance) else reached
    return ended._replace(iterations=iteration, unsettled=unsettled)


def _settle_at(
    model: SoftModel, q_motors: FloatArray, load: Load, start: FloatArray, method: str, goal: Goal
) -> LocalSolution | None:
    """Elastic coordinates in equilibrium and the distance of the tip; None if they do not settle."""
    if not model.actuators.admit(q_motors):
        return None
    state = settled(model, q_motors, load, start, method=method)
    if state is None:
        return None
    translation, turn = goal.missing(model, state.q)
    return LocalSolution(q_motors, state, float(np.linalg.norm(translation)), float(np.linalg.norm(turn)), 0, 0)


def _pace(step: FloatArray, last_drift: FloatArray, drift: FloatArray) -> float:
    """How far to go along the drift: the step length of Barzilai and Borwein, for valleys in which a plain one creeps."""
    bent = float(step @ (last_drift - drift))
    return float(np.clip(float(step @ step) / bent, 0.1, 100.0)) if bent > 0.0 else 100.0 if step.any() else 1.0


def _step(
    model: SoftModel, motors: FloatArray, slope: FloatArray, missing: FloatArray, damping: float, homeward: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Step towards the goal, and the part of the way home that does not move the tip, without pressing against limits.

    Limits that are reached and that the step would press against are held, one set after the other.

    Returns:
        Both parts, shape (n,), and the projector on the steps that are left free, shape (n, n).
    """
    basis = model.actuators.basis
    normals, bends = (rows @ basis for rows in model.actuators.active_limits(motors))
    pull = normals @ (slope.T @ missing) / np.maximum((normals * normals).sum(axis=1), 1e-300)
    held = np.zeros(len(normals), dtype=bool)
    while True:
        rows = normals[held]
        free = np.eye(basis.shape[1]) - np.linalg.pinv(rows) @ rows
        open_slope = slope @ free
        # Going along a curved limit costs what the pull against it times its curvature gives: rows of their own.
        curved = np.sqrt(np.maximum(pull[held], 0.0))[:, None] * bends[held] @ free
        whole = np.concatenate([open_slope, curved[curved.any(axis=1)]])
        towards = free @ _damped_step(
            whole, np.concatenate([missing, np.zeros(len(whole) - len(missing))]), damping, 1e-12 * model.reach
        )
        drift = free @ (homeward - np.linalg.pinv(open_slope, rcond=1e-9) @ (open_slope @ homeward))
        pressed = ~held & (normals @ (towards + drift) > 1e-12)
        if not pressed.any():
            return towards, drift, free
        held |= pressed


def _damped_step(slope: FloatArray, missing: FloatArray, damping: float, negligible: float) -> FloatArray:
    """Levenberg-Marquardt step; directions that do not move the tip at all are left alone."""
    left, values, right = np.linalg.svd(slope, full_matrices=False)
    gains = np.where(values > negligible, values, 0.0) / np.maximum(values**2 + damping**2, negligible**2)
    return np.asarray(right.T @ (gains * (left.T @ missing)))
