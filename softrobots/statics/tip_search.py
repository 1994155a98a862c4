r"""Local search for actuator coordinates that bring the loaded tip to a goal.

At every step the elastic coordinates are in equilibrium; the step uses the exact derivative of the loaded tip,
:math:`dx/dq_m = J_m + J_k K_t^{-1} d(J_k^T w - g_k)/dq_m`. With no load this is ordinary rigid inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.soft_model import SoftModel

POSITION_TOLERANCE = 1e-9
"""Default distance of the tip from its target [m]."""

ANGLE_TOLERANCE = 1e-9
"""Angle between the tip and a wanted orientation [rad]."""

SAME = 1e-6
"""Actuator coordinates closer than this, over their scale, are one [rad]."""

LEVER = 0.2
"""Distance that a radian of orientation counts for, relative to the reach."""

_FIRST_DAMPING = 0.03  # of the first step, relative to the reach
_LAST_DAMPING = 1e-8
_WARM_DAMPING = 1e-6  # of the first step of a search that starts from a prediction
_HALVINGS = 6  # of the way between two waypoints
_LARGEST_STEP = 0.5  # [rad], norm of one step over the scale of the actuators
_STATIONARY = 1e-8  # slope of the distance [m/rad per m of reach] that counts as no slope: nothing nearer is near
_NEAR = 0.02  # distance from the goal, relative to the reach, that the way home may cost for a step


class Settled(Protocol):
    """A robot in equilibrium."""

    @property
    def q_springs(self) -> FloatArray:
        """Elastic coordinates, shape (n_springs,) [rad or m]."""


State = TypeVar("State", bound=Settled)


@dataclass(frozen=True, eq=False)
class LocalSolution(Generic[State]):
    """Where a local search ended."""

    q_motors: FloatArray
    """Actuator coordinates, shape (n_motors,)."""
    state: State
    """The robot there."""
    error: float
    """Distance of the tip from the target [m]."""
    angle: float = 0.0
    """Angle between the tip and the wanted orientation [rad]; 0 if none is wanted."""
    iterations: int = 0
    """Steps."""
    unsettled: int = 0
    """Actuator coordinates tried at which the robot did not settle."""

    def arrived(self, tolerance: float) -> bool:
        """Whether the tip is within `tolerance` [m] of the target, and stands as wanted."""
        return self.error <= tolerance and self.angle <= ANGLE_TOLERANCE

    def miss(self, model: SoftModel) -> float:
        """Distance and angle as one distance [m]."""
        return float(np.hypot(self.error, LEVER * model.reach * self.angle))


class SoughtTip(Protocol[State]):
    """A robot under a load and the goal of its tip, whoever settles the springs."""

    @property
    def model(self) -> SoftModel:
        """The robot."""

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, up to 6 with an orientation."""

    def towards(self, position: FloatArray) -> SoughtTip[State]:
        """The same robot with the tip to go to another position, shape (3,) [m]."""

    def settle(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[State] | None:
        """Let the elastic coordinates settle from a start, shape (n_springs,); None if they do not."""

    def missing(self, state: State) -> FloatArray:
        """Way from the tip to the goal, shape (rows,) [m]."""

    def motion(self, state: State) -> tuple[FloatArray, FloatArray]:
        """How tip and elastic coordinates follow the actuators, shapes (rows, n_motors) and (n_springs, n_motors).

        Raises:
            NeutralEquilibrium: If they do not: the robot is about to buckle.
        """


def search(
    tip: SoughtTip[State],
    q_motors: FloatArray,
    q_springs: FloatArray,
    *,
    home: FloatArray | None = None,
    tolerance: float = POSITION_TOLERANCE,
    damping: float = _FIRST_DAMPING,
    max_iterations: int = 100,
) -> LocalSolution[State] | None:
    """Search from one start by Levenberg-Marquardt within the actuator limits.

    Args:
        tip: The robot and its goal.
        q_motors: Start of the actuators, shape (n_motors,), within the limits.
        q_springs: Start of the elastic coordinates, shape (n_springs,).
        home: Actuator coordinates to stay near to where there is freedom (more actuators than conditions); None: `q_motors`.
        tolerance: Distance at which the search ends [m].
        damping: Damping of the first step, relative to the reach; small for starts near the solution.
        max_iterations: Most steps.

    Returns:
        Where the search ended, at the goal or not; None if the start itself has no equilibrium.
    """
    here = tip.settle(q_motors, q_springs)
    if here is None:
        return None
    model, basis = tip.model, tip.model.actuators.basis
    inverse = np.linalg.pinv(basis)
    mu, redundant, unsettled, pace = damping * model.reach, basis.shape[1] > tip.rows, 0, 1.0
    home = q_motors if home is None else home
    last: tuple[FloatArray, FloatArray] | None = None  # step and drift that led here
    reached: LocalSolution[State] | None = None  # the last place on the way home that is at the goal
    for iteration in range(1, max_iterations + 1):
        missing = tip.missing(here.state)
        try:
            slope, follow = tip.motion(here.state)
        except NeutralEquilibrium:
            break
        slope = slope @ basis
        arrived = here.arrived(tolerance)
        reached = here if arrived else reached
        going_home = redundant and reached is not None
        homeward = inverse @ (home - here.q_motors) if going_home else np.zeros(basis.shape[1])
        towards, drift, free = _step(model, here.q_motors, slope, missing, mu, homeward)
        if arrived and float(np.abs(drift).max()) <= SAME:
            return replace(here, iterations=iteration - 1, unsettled=unsettled)
        pace = pace if last is None else _pace(*last, drift)
        miss, last = here.miss(model), None
        if not arrived and float(np.linalg.norm(free @ (slope.T @ missing))) <= _STATIONARY * model.reach * miss:
            break
        step = towards + pace * drift
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        moved = model.actuators.go(here.q_motors, basis @ step)
        guess = here.state.q_springs + follow @ (moved - here.q_motors)
        there = tip.settle(moved, guess)
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
    return replace(ended, iterations=iteration, unsettled=unsettled)


def advance(
    tip: SoughtTip[State],
    last: FloatArray,
    target: FloatArray,
    here: LocalSolution[State],
    tolerance: float = POSITION_TOLERANCE,
    halvings: int = _HALVINGS,
) -> LocalSolution[State] | None:
    """Go from one waypoint to the next by its linear prediction and a search, over waypoints between if need be.

    Args:
        tip: The robot; its goal does not matter.
        last: The waypoint before, shape (3,) [m].
        target: The waypoint, shape (3,) [m].
        here: The robot at the waypoint before.
        tolerance: Distance at which a search ends [m].
        halvings: How often the way may be halved.

    Returns:
        The robot at the waypoint; None if no continuous motion leads there.
    """
    there = tip.towards(target)
    try:
        slope, follow = there.motion(here.state)
    except NeutralEquilibrium:  # about to buckle: no linear prediction leads on
        return None
    actuators = tip.model.actuators
    step = np.linalg.pinv(slope @ actuators.basis, rcond=1e-6) @ there.missing(here.state)
    if float(np.linalg.norm(step)) <= 0.5:
        motors = actuators.go(here.q_motors, actuators.basis @ step)
        springs = here.state.q_springs + follow @ (motors - here.q_motors)
        found = search(there, motors, springs, home=here.q_motors, tolerance=tolerance, damping=_WARM_DAMPING)
        if found is not None and found.error <= tolerance and _apart(tip.model, found.q_motors, here.q_motors) <= 1.0:
            return found
    if halvings == 0:
        return None
    middle = 0.5 * (last + target)
    half = advance(tip, last, middle, here, tolerance, halvings - 1)
    return None if half is None else advance(tip, middle, target, half, tolerance, halvings - 1)


def _apart(model: SoftModel, one: FloatArray, other: FloatArray) -> float:
    """Largest change of an actuator over its scale [rad]."""
    return float(np.abs((one - other) / model.motor_scale).max())


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
        rows, free, open_slope, whole = normals[held], np.eye(basis.shape[1]), slope, slope
        if len(rows):
            free -= np.linalg.pinv(rows) @ rows
            open_slope = slope @ free
            # Going along a curved limit costs what the pull against it times its curvature gives: rows of their own.
            curved = np.sqrt(np.maximum(pull[held], 0.0))[:, None] * bends[held] @ free
            whole = np.concatenate([open_slope, curved[curved.any(axis=1)]])
        towards = free @ _damped_step(
            whole, np.concatenate([missing, np.zeros(len(whole) - len(missing))]), damping, 1e-12 * model.reach
        )
        drift = homeward
        if homeward.any():
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
