r"""Local inverse kinematics of the loaded tip: Levenberg-Marquardt within the actuator limits, and steps between waypoints.

At every step the elastic coordinates are in equilibrium; the step uses the exact derivative of the loaded tip,
:math:`dx/dq_m = J_m + J_k K_t^{-1} d(J_k^T w - g_k)/dq_m`. With no load this is ordinary rigid inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.soft_model import SoftModel
from softrobots.statics.tip_steps import LeastTension, Pull, TipModel, pace_of, step_home, step_within

POSITION_TOLERANCE = 1e-9
"""Default tolerance of the position of the tip [m]."""

ANGLE_TOLERANCE = 1e-9
"""Tolerance of the orientation of the tip [rad]."""

TENSION_TOLERANCE = 1e-10
"""Tolerance of tension limits, relative to the tension that is worth a radian [-]."""

SAME = 1e-6
"""Actuator coordinates closer than this, relative to their scale, are the same [rad]."""

LEVER = 0.2
"""Weight of a radian of orientation as a distance, relative to the reach."""

WARM_DAMPING = 1e-6
"""Damping of the first step of a search that starts from a prediction, relative to the reach."""

_FIRST_DAMPING, _LAST_DAMPING = 0.03, 1e-8  # of the first step, and the least, relative to the reach
_HALVINGS, _MOST_STEPS = 6, 30  # of the way between two waypoints, and of each search there
_LARGEST_STEP = 0.5  # [rad], norm of one step over the scale of the actuators
_STATIONARY = 1e-8  # slope of the distance [m/rad per m of reach] that counts as zero: a local minimum
_JUMP = 1.0  # change of an actuator between two waypoints, relative to its scale, that is no continuous motion
_NO_NEARER = 1e-4  # share of the way to the goal in a step that is refused, with which shorter ones lead nowhere
_NEAR = 0.02  # distance from the goal, relative to the reach, that a step home may cost


class ElasticRobot(Protocol):
    """A robot in equilibrium."""

    @property
    def q_springs(self) -> FloatArray:
        """Elastic coordinates, shape (n_springs,) [rad or m]."""


State = TypeVar("State", bound=ElasticRobot)


@dataclass(frozen=True, eq=False)
class LocalSolution(Generic[State]):
    """End of a local search."""

    q_motors: FloatArray
    """Actuator coordinates, shape (n_motors,)."""
    state: State
    """The robot there."""
    error: float
    """Distance of the tip from the target [m]."""
    angle: float = 0.0
    """Angle between the tip and its target orientation [rad]; 0 without one."""
    excess: float = 0.0
    """How far a muscle is beyond its limits, see `tip_steps.muscle_room` [-]; 0 where the search ignores them."""
    iterations: int = 0
    """Steps."""
    unsolved: int = 0
    """Number of actuator coordinates tried without an equilibrium."""

    def arrived(self, tolerance: float) -> bool:
        """Whether the tip is within `tolerance` [m] of the target, in the target orientation."""
        return self.error <= tolerance and self.angle <= ANGLE_TOLERANCE and self.excess <= TENSION_TOLERANCE

    def miss(self, model: SoftModel) -> float:
        """Return distance, angle and what is beyond limits of muscles as one distance [m]."""
        return float(np.hypot(self.error, LEVER * model.reach * np.hypot(self.angle, self.excess)))


class SoughtTip(Protocol[State]):
    """A robot under a load and the goal of its tip; independent of the solver."""

    @property
    def model(self) -> SoftModel:
        """The robot."""

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, up to 6 with an orientation."""

    def towards(self, target: Any) -> SoughtTip[State]:
        """Return a copy with another target, a `tip_goal.Goal`."""

    def solve(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[State] | None:
        """Solve for the elastic coordinates from a start, shape (n_springs,); None if they do not converge."""

    def missing(self, state: State) -> FloatArray:
        """Return the difference from the tip to the goal, shape (rows,) [m]."""

    def motion(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of tip and elastic coordinates by the actuators.

        Shapes (rows, n_motors) and (n_springs, n_motors).

        Raises:
            NeutralEquilibrium: If the tangent stiffness is singular.
        """

    def released(self, here: LocalSolution[State], held: TipModel, damping: float) -> list[TipModel]:
        """Return the models in which contacts open that `held` keeps, if a step with this damping opens them."""

    def pull(self, state: State, follow: FloatArray) -> Pull | None:
        """Return the tensions, with the derivative of the elastic coordinates by the actuators.

        None: their limits are no constraints, and the change of the actuators is the least.
        """


def search(
    tip: SoughtTip[State],
    q_motors: FloatArray,
    q_springs: FloatArray,
    *,
    home: FloatArray | None = None,
    farthest: float = np.inf,
    tolerance: float = POSITION_TOLERANCE,
    damping: float = _FIRST_DAMPING,
    max_iterations: int = 100,
) -> LocalSolution[State] | None:
    """Search from one start by Levenberg-Marquardt within the actuator limits.

    Args:
        tip: The robot and its goal.
        q_motors: Start of the actuators, shape (n_motors,), within the limits.
        q_springs: Start of the elastic coordinates, shape (n_springs,).
        home: Actuator coordinates to stay near where there are more actuators than conditions; None: `q_motors`. Robots with a
            `SoughtTip.pull` have the least tension instead.
        farthest: Largest change of an actuator from `home`, relative to its scale, once the goal is reached.
        tolerance: Distance at which the search ends [m].
        damping: Damping of the first step, relative to the reach; small for starts near the solution.
        max_iterations: Most steps.

    Returns:
        The end of the search, at the goal or not; None if the start has no equilibrium.
    """
    here = tip.solve(q_motors, q_springs)
    if here is None:
        return None
    model, basis = tip.model, tip.model.actuators.basis
    mu, redundant, unsolved, pace = damping * model.reach, basis.shape[1] > tip.rows, 0, 1.0
    inverse, home = np.linalg.pinv(basis), q_motors if home is None else home
    last: tuple[FloatArray, FloatArray] | None = None  # last step and drift
    rubs, least = model.structure.friction is not None, LeastTension(here)
    refused, ease = 0, 0.1  # models of this state whose step did not lead nearer; change of the damping after one that does
    reached: LocalSolution[State] | None = None  # the last solution at the goal
    for iteration in range(1, max_iterations + 1):
        arrived = here.arrived(tolerance)
        try:
            models = tip_models(tip, here, arrived)
        except NeutralEquilibrium:
            break
        missing, slope, follow, shift = near = models[min(refused, len(models) - 1)]
        slope = slope @ basis
        if reached is not None and _apart(model, here.q_motors, home) > farthest:
            here = reached
            break
        reached = here if arrived else reached
        going_home = redundant and reached is not None
        homeward = inverse @ (home - here.q_motors) if going_home else np.zeros(basis.shape[1])
        pulled = tip.pull(here.state, follow)
        if pulled is None:
            towards, drift, free = step_home(model, here.q_motors, slope, missing, mu, homeward)
            stationary = float(np.linalg.norm(free @ (slope.T @ missing))) <= _STATIONARY * model.reach * here.miss(model)
        else:
            towards, drift = step_within(model, here.q_motors, slope, missing, mu, pulled, reached is not None)
            nearer = float(np.linalg.norm(slope @ towards))
            stationary = nearer <= 1e-6 * float(np.linalg.norm(missing)) and pulled.excess <= TENSION_TOLERANCE
        if rubs and pulled is not None and reached is not None and least.turns(here if arrived else None, pulled):
            here = least.best
            break
        if arrived and float(np.abs(drift).max()) <= SAME:
            return replace(here, iterations=iteration - 1, unsolved=unsolved)
        # Where limits stop one of the two drifts, their difference tells nothing of the valley.
        if last is not None and (pulled is None or min(np.abs(last[1]).max(), np.abs(drift).max()) > SAME):
            pace = pace_of(*last, drift)
        miss, last = here.miss(model), None
        if not arrived and stationary:
            refused += 1
            if refused >= len(models):
                break
            continue
        step = towards + pace * drift
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        moved = model.actuators.go(here.q_motors, basis @ step)
        there = tip.solve(moved, here.state.q_springs + shift + follow @ (moved - here.q_motors))
        unsolved += there is None
        if rubs and not arrived and there is not None and there.miss(model) >= miss:  # the way of the tip is bent
            aside = near._replace(missing=tip.missing(there.state)).step(basis, max(mu, _LAST_DAMPING * model.reach))
            aside *= min(1.0, float(np.linalg.norm(basis @ step)) / max(float(np.linalg.norm(aside)), 1e-300))
            again = model.actuators.go(there.q_motors, aside)
            there = tip.solve(again, there.state.q_springs + follow @ (again - there.q_motors))
        # Drifting home costs distance in second order, which the next step corrects.
        drifted = pace * float(np.linalg.norm(drift))
        allowed = max(10.0 * tolerance, model.reach * min(4.0 * drifted**2, _NEAR)) if going_home else 0.0
        if there is not None and (there.miss(model) < miss or there.miss(model) <= allowed):
            here, mu, last = there, ease * mu if mu > _LAST_DAMPING * model.reach else 0.0, (step, drift)
            refused, ease = 0, 0.1
        elif drifted > (0.0 if pulled is not None and pace > 1.0 else float(np.linalg.norm(towards))):  # limits hold to 1
            pace *= 0.5
        elif refused + 1 < len(models):
            refused += 1
        else:
            nearer = float(np.linalg.norm(slope @ towards))
            if nearer <= max(_NO_NEARER * float(np.linalg.norm(missing)), 0.01 * tolerance):
                break
            if rubs:  # half as far, at most
                mu, refused, ease = max(3.0 * mu, nearer / float(np.linalg.norm(step))), 0, 1.0
            else:  # damping far below the least singular value (norm -2) shortens no step, far above it creeps
                mu, ease = max(3.0 * mu, 0.3 * float(np.linalg.norm(slope, -2)), _LAST_DAMPING * model.reach), 0.3
    return replace(here if reached is None or here.arrived(tolerance) else reached, iterations=iteration, unsolved=unsolved)


def advance(
    tip: SoughtTip[State],
    last: Any,
    target: Any,
    here: LocalSolution[State],
    tolerance: float = POSITION_TOLERANCE,
    halvings: int = _HALVINGS,
) -> LocalSolution[State] | None:
    """Move from one waypoint to the next by linear prediction and a search, halving the distance if necessary.

    Args:
        tip: The robot; its goal is ignored.
        last: The previous waypoint, a `tip_goal.Goal`.
        target: The waypoint.
        here: The robot at the previous waypoint.
        tolerance: Distance at which a search ends [m].
        halvings: How often the distance may be halved.

    Returns:
        The robot at the waypoint; None if no continuous motion leads there.
    """
    there = tip.towards(target)
    try:
        models = tip_models(there, here)
    except NeutralEquilibrium:  # about to buckle: there is no linear prediction
        return None
    actuators = tip.model.actuators
    for missing, slope, follow, shift in models:
        pulled, slope = tip.pull(here.state, follow), slope @ actuators.basis
        if pulled is None:
            step = np.linalg.pinv(slope, rcond=1e-6) @ missing
        else:
            damping = _LAST_DAMPING * tip.model.reach
            step, drift = step_within(tip.model, here.q_motors, slope, missing, damping, pulled, arrived=True)
            step = step + drift * min(1.0, 0.5 * _LARGEST_STEP / max(float(np.linalg.norm(drift)), 1e-300))
        if float(np.linalg.norm(step)) <= _LARGEST_STEP:
            motors = actuators.go(here.q_motors, actuators.basis @ step)
            springs = here.state.q_springs + shift + follow @ (motors - here.q_motors)
            near: dict[str, Any] = {"home": here.q_motors, "farthest": _JUMP, "max_iterations": _MOST_STEPS}
            found = search(there, motors, springs, tolerance=tolerance, damping=WARM_DAMPING, **near)
            if found is not None and found.arrived(tolerance) and _apart(tip.model, found.q_motors, here.q_motors) <= _JUMP:
                return found
    if halvings == 0:
        return None
    middle = last.between(target, 0.5)
    half = advance(tip, last, middle, here, tolerance, halvings - 1)
    return None if half is None else advance(tip, middle, target, half, tolerance, halvings - 1)


def tip_models(tip: SoughtTip[State], here: LocalSolution[State], arrived: bool = False) -> list[TipModel]:
    """Return the models about a state, that in which a damped step leaves least to the goal first.

    In free space there is one. A tip that leans on an obstacle cannot leave it by a small step: that takes as much of the
    actuators as carries the contact force.

    Raises:
        NeutralEquilibrium: If the tangent stiffness is singular.
    """
    slope, follow = tip.motion(here.state)
    held = TipModel(tip.missing(here.state), slope, follow, np.zeros(len(follow)))
    damping, basis = _FIRST_DAMPING * tip.model.reach, tip.model.actuators.basis
    others = [] if arrived else tip.released(here, held, damping)

    def left(one: TipModel) -> float:
        return float(np.linalg.norm(one.missing - one.slope @ one.step(basis, damping)))

    rubs = tip.model.structure.friction is not None  # what sticks there is let slip only where nothing else leads nearer
    return [held, *others] if rubs else sorted([held, *others], key=left)


def _apart(model: SoftModel, one: FloatArray, other: FloatArray) -> float:
    """Largest difference of an actuator relative to its scale [rad]."""
    return float(np.abs((one - other) / model.motor_scale).max())
