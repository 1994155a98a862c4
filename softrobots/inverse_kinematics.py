r"""Elastostatic inverse kinematics: motor coordinates that put the loaded, deformed tip at a target.

At every step the springs are in equilibrium; the step uses the exact derivative of the loaded tip,
:math:`dx/dq_m = J_m + J_k K_t^{-1} d(J_k^T w - g_k)/dq_m`. With no load this is ordinary rigid inverse kinematics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

import numpy as np

from softrobots.checks import FloatArray, choice, finite_array, positive_integer, positive_number, read_only
from softrobots.elastostatics import METHODS, ElasticState, settle, settled
from softrobots.equilibrium import Equilibrium, equilibrium_from_state
from softrobots.errors import EquilibriumNotFound, NeutralEquilibrium, ParameterError, TargetUnreachable
from softrobots.kinematics import frame_jacobian, frame_placement
from softrobots.loads import Load
from softrobots.model import SoftModel, check_model
from softrobots.sensitivity import tip_motion

POSITION_TOLERANCE = 1e-9
"""Default distance of the tip from its target [m]."""

ELBOWS = ("up", "down")
"""Choices of `solve_ik(elbow=...)`."""

_FIRST_DAMPING = 0.03  # of the first step, relative to the reach
_LAST_DAMPING = 1e-8
_LARGEST_STEP = 0.5  # [rad], norm of one motor step
_STATIONARY = 1e-8  # slope of the distance [m/rad per m of reach] that counts as no slope: nothing nearer is near
_SAME = 1e-6  # [rad], solutions closer than this are one
_SEED = 20210312  # of the random starts: the day the paper appeared


@dataclass(frozen=True, eq=False)
class IkSolution:
    """Motor coordinates for a target; can be saved with `softrobots.save_result`."""

    target: FloatArray
    """The target, shape (3,) [m]."""
    equilibrium: Equilibrium
    """The loaded robot at these motor coordinates."""
    error: float
    """Distance of the tip from the target [m]."""
    iterations: int
    """Steps from the start that led here."""
    alternatives: tuple[FloatArray, ...]
    """Motor coordinates of the other solutions found, each shape (n_motors,), by their distance from the start; whole turns
    of a motor do not make another solution."""

    @property
    def q_motors(self) -> FloatArray:
        """Motor coordinates, shape (n_motors,) [rad or m]."""
        return self.equilibrium.q_motors


class LocalSolution(NamedTuple):
    """Where a local search ended."""

    q_motors: FloatArray
    """Motor coordinates, shape (n_motors,)."""
    state: ElasticState
    """The springs there."""
    error: float
    """Distance of the tip from the target [m]."""
    iterations: int
    """Steps."""
    unsettled: int
    """Motor coordinates tried at which the springs did not settle."""


def solve_ik(
    model: SoftModel,
    target: Any,
    force: Any = None,
    *,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    q_motors0: Any = None,
    elbow: str | None = None,
    method: str = "newton",
    tolerance: float = POSITION_TOLERANCE,
    starts: int = 24,
) -> IkSolution:
    """Find motor coordinates that put the loaded tip at a target position.

    Searches from `q_motors0` and from random motor coordinates within the limits (always the same ones), and returns, of the
    solutions found, the one that changes `q_motors0` least. An arm with more motors than three moves as little as it can.

    Args:
        model: The robot, with at least one motor.
        target: Target of the tip, shape (3,) [m], world axes.
        force: Force at `frame`, shape (3,) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], or `{frame: (6,)}` for several.
        frame: Frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        q_motors0: Where to start, shape (n_motors,) [rad or m]; zero by default.
        elbow: "up" or "down": only solutions whose last motor joint lies above or below the line from the first motor joint
            to the tip; None: any.
        method: How the springs settle, "newton" or "fixed_point".
        tolerance: Largest distance of the tip from the target [m].
        starts: Number of searches, the one from `q_motors0` included.

    Returns:
        The solution.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has no motors.
        NameNotFound: If a frame does not exist.
        TargetUnreachable: If no search arrives; the error says how near the best one came and carries it.
        EquilibriumNotFound: If the springs settle at none of the starts.
    """
    check_model(model)
    goal = finite_array("target", target, (3,), "m")
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity)
    choice("method", method, METHODS)
    if elbow is not None:
        choice("elbow", elbow, ELBOWS)
    positive_number("tolerance", tolerance, "m")
    first = start_motors(model, q_motors0)
    if elbow is not None and not _has_elbow(model):
        raise ParameterError("elbow", elbow, "None for this robot: its last motor joint is where its first one is")
    ended: list[LocalSolution] = []
    for start in _starts(model, first, positive_integer("starts", starts, 10_000)):
        local = search(model, goal, load, start, model.rest, home=first, method=method, tolerance=tolerance)
        if local is not None:
            ended.append(local)
    if not ended:
        _raise_unsettled(model, first, load, method, starts)
    allowed = [local for local in ended if elbow is None or elbow_side(model, local.state.q) == elbow]
    found: list[LocalSolution] = []
    for local in sorted(allowed, key=lambda local: float(np.linalg.norm(local.q_motors - first))):
        if local.error <= tolerance and not any(_same_pose(model, local, other) for other in found):
            found.append(local)
    best = found[0] if found else min(allowed or ended, key=lambda local: local.error)
    solution = IkSolution(
        target=read_only(goal),
        equilibrium=equilibrium_from_state(model, best.q_motors, load, best.state, method=method, iterations=best.iterations),
        error=best.error,
        iterations=best.iterations,
        alternatives=tuple(read_only(other.q_motors) for other in found[1:]),
    )
    if not found:
        side = f" with the elbow {elbow}" if elbow else ""
        unsettled = sum(local.unsettled for local in ended)
        raise TargetUnreachable(
            f"the tip cannot reach {goal.tolist()} m{side}: the nearest of {starts} starts (seed {_SEED}) comes within "
            f"{best.error:.6g} m, at motors {best.q_motors.round(6).tolist()}"
            + ("" if allowed else ", with the elbow on the other side")
            + (f"; the springs did not settle by {method!r} at {unsettled} of the motor angles tried" if unsettled else ""),
            best=solution,
            residual=best.error,
            iterations=best.iterations,
        )
    return solution


def start_motors(model: SoftModel, q_motors0: Any) -> FloatArray:
    """Check where a search starts: zero, or as near to it as the limits allow, if nothing is said.

    Raises:
        ParameterError: If the robot has no motors, or the start has the wrong shape, is not finite or beyond the limits.
    """
    if model.n_motors == 0:
        raise ParameterError("model", model, "a robot with at least one motor")
    low, high = model.motor_limits.T
    if q_motors0 is None:
        return np.asarray(np.clip(np.zeros(model.n_motors), low, high))
    motors = finite_array("q_motors0", q_motors0, (model.n_motors,), "rad")
    if np.any((motors < low) | (motors > high)):
        raise ParameterError("q_motors0", q_motors0, f"within the motor limits {model.motor_limits.tolist()} rad")
    return motors


def search(
    model: SoftModel,
    target: FloatArray,
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
    """Search from one start by Levenberg-Marquardt within the motor limits.

    Args:
        model: The robot.
        target: Target, shape (3,) [m].
        load: The load.
        q_motors: Start of the motors, shape (n_motors,), within the limits.
        q_springs: Start of the springs, shape (n_springs,).
        home: Motor coordinates to stay near to where there is freedom (more than three motors); None: `q_motors`.
        method: How the springs settle.
        tolerance: Distance at which the search ends [m].
        damping: Damping of the first step, relative to the reach; small for starts near the solution.
        max_iterations: Most steps.

    Returns:
        Where the search ended, at the target or not; None if the start itself has no equilibrium.
    """
    here = _settle_at(model, q_motors, load, q_springs, method, target)
    if here is None:
        return None
    mu, redundant, unsettled = damping * model.reach, model.n_motors > 3, 0
    home = q_motors if home is None else home
    for iteration in range(1, max_iterations + 1):
        missing = target - frame_placement(model, here.state.q, model.tip).translation
        jacobian = frame_jacobian(model, here.state.q, model.tip)[:3]
        try:
            slope, follow = tip_motion(model, jacobian, here.state.tangent, here.state.joints.derivative)
        except NeutralEquilibrium:
            break
        free = _free(model, here.q_motors, slope.T @ missing)
        slope = slope * free
        drift = _drift(slope, home - here.q_motors) * free if redundant else np.zeros(model.n_motors)
        arrived = here.error <= tolerance
        if arrived and float(np.abs(drift).max()) <= _SAME:
            return here._replace(iterations=iteration - 1, unsettled=unsettled)
        if not arrived and float(np.linalg.norm(slope.T @ missing)) <= _STATIONARY * model.reach * here.error:
            break
        step = _damped_step(slope, missing, mu, 1e-12 * model.reach) + drift
        step *= min(1.0, _LARGEST_STEP / max(float(np.linalg.norm(step)), 1e-300))
        moved = np.clip(here.q_motors + step, *model.motor_limits.T)
        guess = here.state.q_springs + follow @ (moved - here.q_motors)
        there = _settle_at(model, moved, load, guess, method, target)
        unsettled += there is None
        if there is not None and (there.error < here.error or (redundant and there.error <= max(10.0 * tolerance, here.error))):
            here, mu = there, 0.1 * mu if mu > _LAST_DAMPING * model.reach else 0.0
        else:
            mu = max(10.0 * mu, 10.0 * _LAST_DAMPING * model.reach)
            if mu > 1e6 * model.reach:
                break
    return here._replace(iterations=iteration, unsettled=unsettled)


def elbow_side(model: SoftModel, q: FloatArray) -> str:
    """Whether the last motor joint lies above or below the line from the first motor joint to the tip: "up" or "down".

    Args:
        model: The robot, with at least one motor.
        q: Pinocchio's configuration, shape (nq,).
    """
    first, last, tip = (frame_placement(model, q, name).translation for name in (*_ends(model), model.tip))
    along = tip - first
    length = float(along @ along)
    offset = last - first - (along * float(along @ (last - first)) / length if length > 0.0 else 0.0)
    return "up" if offset[2] >= 0.0 else "down"


def _ends(model: SoftModel) -> tuple[str, str]:
    return model.motor_joints[0], model.motor_joints[-1]


def _has_elbow(model: SoftModel) -> bool:
    """Whether the last motor joint is away from the first one."""
    q = model.assemble(np.zeros(model.n_motors), model.rest)
    first, last = (frame_placement(model, q, name).translation for name in _ends(model))
    return float(np.linalg.norm(last - first)) > _SAME * model.reach


def _same_pose(model: SoftModel, one: LocalSolution, other: LocalSolution) -> bool:
    """Whether two solutions are one, up to whole turns of a motor."""
    apart = one.q_motors - other.q_motors
    apart = np.where(model.turning_motors, apart - 2.0 * np.pi * np.rint(apart / (2.0 * np.pi)), apart)
    return float(np.abs(apart).max()) <= _SAME


def _raise_unsettled(model: SoftModel, motors: FloatArray, load: Load, method: str, starts: int) -> NoReturn:
    state, spent = settle(model, motors, load, model.rest, method=method)
    best = equilibrium_from_state(model, motors, load, state, method=method, iterations=spent)
    hint = "; method='newton' settles larger loads" if method == "fixed_point" else ""
    raise EquilibriumNotFound(
        f"the springs do not settle under this load by {method!r} at any of {starts} starts{hint}",
        best=best,
        residual=best.residual,
        iterations=spent,
    )


def _settle_at(
    model: SoftModel, q_motors: FloatArray, load: Load, start: FloatArray, method: str, target: FloatArray
) -> LocalSolution | None:
    """Springs in equilibrium and the distance of the tip; None if they do not settle."""
    state = settled(model, q_motors, load, start, method=method)
    if state is None:
        return None
    error = float(np.linalg.norm(target - frame_placement(model, state.q, model.tip).translation))
    return LocalSolution(q_motors, state, error, 0, 0)


def _free(model: SoftModel, motors: FloatArray, pull: FloatArray) -> FloatArray:
    """1 for motors that may follow the pull, 0 for those that it presses against a limit."""
    low, high = model.motor_limits.T
    return np.where((motors <= low) & (pull < 0.0) | (motors >= high) & (pull > 0.0), 0.0, 1.0)


def _damped_step(slope: FloatArray, missing: FloatArray, damping: float, negligible: float) -> FloatArray:
    """Levenberg-Marquardt step; directions that do not move the tip at all are left alone."""
    left, values, right = np.linalg.svd(slope, full_matrices=False)
    gains = np.where(values > negligible, values, 0.0) / np.maximum(values**2 + damping**2, negligible**2)
    return np.asarray(right.T @ (gains * (left.T @ missing)))


def _drift(slope: FloatArray, homeward: FloatArray) -> FloatArray:
    """Part of the way home that does not move the tip."""
    return np.asarray(homeward - np.linalg.pinv(slope, rcond=1e-9) @ (slope @ homeward))


def _starts(model: SoftModel, first: FloatArray, count: int) -> list[FloatArray]:
    low, high = model.motor_limits.T
    low, high = np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)
    random = np.random.default_rng(_SEED)
    return [first, *(random.uniform(low, high) for _ in range(count - 1))]
