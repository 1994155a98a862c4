"""How a simulation begins, and the times of its steps and rows; the same for both engines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import ParameterError
from softrobots.dynamics.midpoint import State
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.time_inputs import MotorPath
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium

TIP_TOLERANCE = 5e-4
"""Default of the largest error of the tip, relative to the reach of the robot."""

_ROWS = 200  # of a motion, if no output step is given
_MOST_ROWS = 10_000_000  # steps or rows of a motion, for which memory suffices
_APART = 1e-6  # largest distance of motors from where the start has them [rad or m]


def first_state(model: SoftModel, start: Any, path: MotorPath, free: int = 0) -> State:
    """Return the state at time zero; the first `free` actuators are where `start` has them, the others where the path begins.

    Raises:
        ParameterError: If `start` is of another kind or robot, or has the actuators elsewhere.
    """
    motors, springs, rates = path(0.0), model.rest, np.zeros(model.n_motors + model.n_springs)
    if start is not None:
        if isinstance(start, Motion):
            start = start.end
        if not isinstance(start, Equilibrium | MotionState):
            raise ParameterError("start", start, "an Equilibrium, a Motion, a MotionState, or None (relaxed, at rest)")
        if start.model != model:
            raise ParameterError("start", start.model, f"a state of the model given, {model!r}")
        apart = np.abs(motors - start.q_motors)[free : model.actuators.n_placed].max(initial=0.0)
        if apart > _APART:
            text = f"at {start.q_motors.tolist()} at t = 0, where `start` has the actuators (it is {apart:.3g} rad or m away)"
            raise ParameterError("q_motors", motors, text)
        springs, motors = start.q_springs, np.concatenate([start.q_motors[:free], motors[free:]])
        if isinstance(start, MotionState):
            rates[: model.n_motors] = start.motor_velocities
            rates[model.n_motors :] = start.velocities
    return State(0.0, np.concatenate([motors, springs]), rates)


def first_kick(path: MotorPath, rates: FloatArray) -> FloatArray | None:
    """Return the jump of the velocities of prescribed motors at time zero, shape (n_motors,), or None if there is none.

    Args:
        path: The motors over time.
        rates: Their velocities before, shape (n_motors,).
    """
    change: FloatArray = path.kicks.get(0.0, np.zeros(len(rates))) - rates
    slight = _APART * float(np.abs(rates).max(initial=_APART))
    return change if np.abs(change).max(initial=0.0) > slight else None


def time_grid(end: float, step: float) -> FloatArray:
    """Return times from zero to the end, `step` apart, the last one nearer if need be, shape (n,) [s]."""
    return np.append(step * np.arange(math.ceil(end / step - 1e-9)), end)


def grid_with_kicks(end: float, step: float, kicks: FloatArray) -> FloatArray:
    """Return such times with those at which velocities of motors jump among them, shape (n,) [s]."""
    grid, inside = time_grid(end, step), kicks[(kicks > 0.0) & (kicks < end - 1e-6 * step)]
    if len(inside):
        replaced = np.abs(grid[:, None] - inside).min(axis=1) <= 1e-6 * step
        grid = np.unique(np.concatenate([grid[~replaced], inside]))
    return grid


def steps_and_rows(
    end: float, reach: float, time_step: Any, output_step: Any, tolerance: Any
) -> tuple[float | None, float, FloatArray]:
    """Return the length of given steps or None, the tolerance of the tip [m], and the times of the rows [s].

    Raises:
        ParameterError: If a number is not positive, there are too many steps or rows, or a tolerance goes with given steps.
    """
    h = None if time_step is None else positive_number("time_step", time_step, "s")
    if h is not None and tolerance is not None:
        raise ParameterError("tolerance", tolerance, "None with a given time_step, whose error is not measured")
    largest = TIP_TOLERANCE * reach if tolerance is None else positive_number("tolerance", tolerance, "m")
    between = end / _ROWS if h is None else h * math.ceil(end / h / _ROWS - 1e-9)
    between = between if output_step is None else positive_number("output_step", output_step, "s")
    for name, length in (("time_step", h), ("output_step", between)):
        if length is not None and end / length > _MOST_ROWS:
            raise ParameterError(name, length, f"at least {end / _MOST_ROWS:.3g} s, {_MOST_ROWS} of which make the duration")
    return h, largest, time_grid(end, between)
