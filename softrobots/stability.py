"""Buckling: the load at which an equilibrium path loses its stability."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.checks import FloatArray, finite_array, positive_number
from softrobots.elastostatics import ElasticState, elastic_state, largest_residual
from softrobots.errors import NoCriticalLoad, ParameterError
from softrobots.loads import Load
from softrobots.model import SoftModel

_NEWTON_STEPS = 12
_SHORTEST_STEP = 1e-10  # relative to the load reached


def critical_load(
    model: SoftModel,
    q_motors: Any,
    direction: Any,
    *,
    frame: str | None = None,
    gravity: Any = None,
    max_force: float | None = None,
) -> float:
    """Smallest force along a direction at which the equilibrium stops being stable.

    Follows the equilibrium from zero force, without leaving its path, until the smallest eigenvalue of the tangent
    stiffness crosses zero (a pitchfork, as of an axially pushed straight arm) or the path turns back (a limit point).

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        direction: Direction of the force, shape (3,), any length but zero, world axes.
        frame: Frame that is pushed; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless. It stays constant.
        max_force: Largest force to try [N]; by default 100 times the largest stiffness over the reach.

    Returns:
        The force [N].

    Raises:
        ParameterError: If an argument is out of range, the model has no springs, or it is unstable under gravity alone.
        NameNotFound: If the frame does not exist.
        NoCriticalLoad: If the path is stable up to `max_force`: the direction pulls or bends rather than pushes.
    """
    motors = finite_array("q_motors", q_motors, (model.n_motors,), "rad")
    unit = finite_array("direction", direction, (3,))
    length = float(np.linalg.norm(unit))
    if length == 0.0:
        raise ParameterError("direction", direction, "different from zero")
    if model.n_springs == 0:
        raise ParameterError("model", model, "a robot with springs")
    if max_force is None:
        largest = 100.0 * model.stiffest / max(model.reach, 1e-9)
    else:
        largest = positive_number("max_force", max_force, "N")
    constant = Load.of(model, frame=frame, gravity=gravity)
    push = np.concatenate([unit / length, np.zeros(3)])
    at = model.tip if frame is None else frame

    def follow(magnitude: float, start: FloatArray) -> tuple[ElasticState, float] | None:
        """Equilibrium on the path near `start` and its smallest eigenvalue; None if Newton leaves the path."""
        state = _track(model, motors, constant.plus(at, magnitude * push), start)
        return None if state is None else (state, float(np.linalg.eigvalsh(state.tangent)[0]))

    here = follow(0.0, model.rest)
    if here is None or here[1] <= 0.0:
        raise ParameterError("gravity", gravity, "a load under which the robot is stable before it is pushed")
    first_step = step = float(model.stiffness.min()) / max(model.reach, 1e-9) / 20.0
    low = 0.0
    while low < largest:
        high = min(low + step, largest)
        there = follow(high, here[0].q_springs)
        if there is None:
            step *= 0.25
            if step < _SHORTEST_STEP * max(low, first_step):
                return low  # the path turns back here: a limit point
            continue
        if there[1] <= 0.0:
            return _bisect(follow, here, low, high)
        here, low, step = there, high, min(1.5 * step, first_step + 0.25 * high)
    raise NoCriticalLoad(
        f"the equilibrium stays stable up to {largest:.6g} N along {(unit / length).tolist()}", max_force=largest
    )


def _bisect(follow: Any, here: tuple[ElasticState, float], low: float, high: float) -> float:
    """Narrow the bracket of the zero of the smallest eigenvalue down to rounding."""
    while high - low > 1e-14 * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        state = follow(middle, here[0].q_springs)
        if state is not None and state[1] > 0.0:
            here, low = state, middle
        else:
            high = middle
    return 0.5 * (low + high)


def _track(model: SoftModel, motors: FloatArray, load: Load, start: FloatArray) -> ElasticState | None:
    """Plain Newton from a point of the path; None if it does not converge nearby."""
    state = elastic_state(model, motors, start, load)
    for _ in range(_NEWTON_STEPS):
        if state.error <= largest_residual(state.joints, 1e-12):
            return state if float(np.abs(state.q_springs - start).max()) < 0.2 else None
        try:
            step = np.linalg.solve(state.tangent, -state.residual)
        except np.linalg.LinAlgError:
            return None
        if float(np.abs(step).max()) > 0.2:
            return None
        state = elastic_state(model, motors, state.q_springs + step, load)
    return None
