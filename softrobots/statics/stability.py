"""Buckling: the critical load, at which an equilibrium path loses its stability."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import NoCriticalLoad, ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticState, scaled
from softrobots.statics.elastostatics import balanced_state, newton
from softrobots.statics.force_path import TOLERANCE, ForcePath
from softrobots.statics.kinematics import frame_jacobian

_MOST_POINTS = 20_000  # of a path
_NEWTON_STEPS = 12
_SHORTEST_STEP = 1e-10  # of the force, relative to the force reached
_LARGEST_MOVE = 0.1  # [rad] of a spring between two points of the path
_NEARLY_ZERO = 1e-2  # an eigenvalue this small, relative to the one at zero force, may vanish in the next step
_KNEE = 1e-6  # relative distance of the springs from the beginning of a plateau that is neglected
_KNEE_STEP = 1e-4  # of the force, relative to the force reached: shorter steps may cross the beginning of a plateau
_STIFF = 1e-9  # eigenvalues above this, relative to the springs' own stiffness, count for the prediction

NEUTRAL = 1e-7
"""Eigenvalue, relative to the springs' own stiffness, up to which it counts as zero."""


class CriticalPoint(NamedTuple):
    """Point at which an equilibrium path loses its stability."""

    path: ForcePath
    """The path; its reference point is the critical one, the last that is stable."""
    crosses: bool
    """Whether an eigenvalue of the tangent stiffness crosses zero and the path continues, unstable.

    Otherwise the path turns back, or the eigenvalue jumps below zero at the plateau of a link.
    """
    origin: FloatArray
    """The springs at the beginning of the path, without the force, shape (n_springs,) [rad or m]."""


def critical_load(
    model: SoftModel,
    q_motors: Any,
    direction: Any,
    *,
    frame: str | None = None,
    gravity: Any = None,
    max_force: float | None = None,
) -> float:
    """Smallest force along a direction at which the equilibrium loses its stability.

    Follows the equilibrium from zero force, without leaving its path, until the smallest eigenvalue of the tangent
    stiffness crosses zero (a pitchfork, as of an axially pushed straight arm) or the path turns back (a limit point). A
    slightly oblique push may bend the robot smoothly where the exact one buckles it, and then has no critical load, unless a
    link with a largest moment collapses, at its plateau or beyond.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        direction: Direction of the force, shape (3,), any length but zero, world axes.
        frame: Frame that is pushed; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless. It stays constant.
        max_force: Limit of the force [N]; by default 100 times the largest stiffness over the reach.

    Returns:
        The force [N].

    Raises:
        ParameterError: If an argument is out of range, the model has no springs, or it is unstable under gravity alone.
        NameNotFound: If the frame does not exist.
        NoCriticalLoad: If the path is stable up to `max_force` (the direction pulls or bends rather than pushes), or as far
            as it could be followed.
    """
    return critical_point(model, q_motors, direction, frame=frame, gravity=gravity, max_force=max_force).path.force


def critical_point(
    model: SoftModel,
    q_motors: Any,
    direction: Any,
    *,
    frame: str | None = None,
    gravity: Any = None,
    max_force: float | None = None,
) -> CriticalPoint:
    """Find the critical point of the path under a growing force, with the arguments and errors of `critical_load`."""
    path = ForcePath.of(model, q_motors, direction, frame=frame, gravity=gravity)
    if model.n_springs == 0:
        raise ParameterError("model", model, "a robot with springs")
    reach = max(model.reach, 1e-9)
    largest = 100.0 * model.stiffest / reach if max_force is None else positive_number("max_force", max_force, "N")

    def follow(force: float, last: _Point) -> _Point | None:
        """Point of the path at a force, from a nearby point; None if Newton leaves the path."""
        guess = last.state.q_springs + (force - last.force) * last.slope
        state = _correct(path, force, guess, last.state.q_springs)
        return None if state is None else _point(path, state, force)

    def critical(last: _Point, force: float, crosses: bool) -> CriticalPoint:
        return CriticalPoint(replace(path, springs=last.state.q_springs, force=force), crosses, origin)

    with one_blas_thread(model.n_springs):
        first_state = balanced_state(model, path.motors, path.constant, model.rest)
        here = None if first_state is None else _point(path, first_state, 0.0)
        if here is None or here.min_eigenvalue <= 0.0:
            raise ParameterError("gravity", gravity, "a load under which the robot is stable before it is pushed")
        origin = here.state.q_springs
        first_step = step = float(model.stiffness.min()) / reach / 20.0
        nearly_zero = _NEARLY_ZERO * here.min_eigenvalue
        for _ in range(_MOST_POINTS):
            if here.force >= largest:
                break
            there = follow(min(here.force + step, largest), here)
            knee = step < _KNEE_STEP * max(here.force, first_step) and there is not None and _knee_between(model, here, there)
            if there is None or (
                not knee and here.min_eigenvalue > nearly_zero and there.min_eigenvalue < 0.5 * here.min_eigenvalue
            ):
                step *= 0.5  # too far to distinguish this path from a neighbour
                if step < _SHORTEST_STEP * max(here.force, first_step):
                    if here.min_eigenvalue <= 10.0 * nearly_zero or _at_knee(model, here):
                        return critical(here, here.force, crosses=False)  # the path turns back: a limit point
                    break
            elif there.min_eigenvalue <= 0.0:
                force, last = _bisect(follow, here, there.force)
                return critical(last, force, crosses=last.min_eigenvalue <= NEUTRAL)
            else:
                here, step = there, min(1.5 * step, first_step + 0.25 * there.force)
    message = f"the equilibrium stays stable up to {here.force:.6g} N along {path.unit.tolist()}"
    if here.force < largest:
        message += f"; its path could not be followed further (limit: {largest:.6g} N)"
    raise NoCriticalLoad(message, max_force=here.force)


class _Point(NamedTuple):
    """A point of the equilibrium path."""

    force: float
    state: ElasticState
    min_eigenvalue: float
    """Smallest eigenvalue of the tangent stiffness, relative to the springs' own stiffness."""
    slope: FloatArray
    """Derivative of the springs with respect to the force."""


def _point(path: ForcePath, state: ElasticState, force: float) -> _Point:
    _, springs = state.point.columns(frame_jacobian(path.model, state.q, path.frame))
    stiffness = path.model.stiffness
    softness = 1.0 / np.sqrt(stiffness)
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    pull = vectors.T @ (softness * (np.append(path.unit, np.zeros(3)) @ springs))
    slope = softness * (vectors @ (pull / np.where(np.abs(values) > _STIFF, values, np.inf)))
    return _Point(force, state, float(values[0]), slope)


def _knee_between(model: SoftModel, here: _Point, there: _Point) -> bool:
    """Whether a link reaches or leaves its plateau between two points: there the tangent jumps."""
    return model.springs.saturated(here.state.q_springs) != model.springs.saturated(there.state.q_springs)


def _at_knee(model: SoftModel, here: _Point) -> bool:
    """Whether a link is at the beginning of its plateau."""
    bent = here.state.q_springs - model.rest
    before, beyond = (model.springs.saturated(model.rest + share * bent) for share in (1.0 - _KNEE, 1.0 + _KNEE))
    return before != beyond


def _bisect(follow: Callable[[float, _Point], _Point | None], here: _Point, high: float) -> tuple[float, _Point]:
    """Bisect the zero of the smallest eigenvalue down to rounding; the force, and the point below it."""
    while True:
        middle = 0.5 * (here.force + high)
        if not here.force < middle < high:
            return middle, here
        there = follow(middle, here)
        if there is not None and there.min_eigenvalue > 0.0:
            here = there
        else:
            high = middle


def _correct(path: ForcePath, force: float, guess: FloatArray, last: FloatArray) -> ElasticState | None:
    """Newton from a prediction; None if it does not converge near the prediction and the last point."""
    model, load = path.model, path.load(force)
    state, _ = newton(model, path.motors, load, guess, tolerance=TOLERANCE, max_iterations=_NEWTON_STEPS, largest_step=0.5)
    if state is None:
        return None
    moved, missed, predicted = (
        float(np.abs(one - other).max(initial=0.0))
        for one, other in ((state.q_springs, last), (state.q_springs, guess), (guess, last))
    )
    return state if moved <= _LARGEST_MOVE and missed <= max(0.5 * predicted, 0.1 * _LARGEST_MOVE) else None
