"""Times of the steps and rows of a motion; the same for both engines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import ParameterError

TIP_TOLERANCE = 5e-4
"""Default of the largest error of the tip, relative to the reach of the robot."""

_COARSEST = 100  # steps at least, of the first of the runs of fourth order
_ROWS = 200  # of a motion, if no output step is given
_MOST_TIMES = 10_000_000  # steps, rows or samples of a motion, for which memory suffices


def refuse_too_short(name: str, interval: float, duration: float) -> None:
    """Refuse an interval [s] that fits into a duration [s] more often than memory suffices for.

    Raises:
        ParameterError: If it does; it has the name of the parameter.
    """
    if duration / interval > _MOST_TIMES:
        requirement = f"at least {duration / _MOST_TIMES:.3g} s, {_MOST_TIMES} of which make the duration"
        raise ParameterError(name, interval, requirement)


def time_grid(end: float, step: float) -> FloatArray:
    """Return times from zero to the end, `step` apart, the last one nearer if need be, shape (n,) [s]."""
    grid: FloatArray = step * np.arange(math.ceil(end / step - 1e-9) + 1.0)
    grid[-1] = end
    return grid


def grid_of_rows(rows: FloatArray) -> FloatArray:
    """Return the times of rows, with each interval divided evenly if they are few, shape (n,) [s]."""
    parts = math.ceil(_COARSEST / (len(rows) - 1))
    return np.append((rows[:-1, None] + np.diff(rows)[:, None] * np.arange(parts) / parts).ravel(), rows[-1])


def grid_with_kicks(end: float, step: float, kicks: FloatArray) -> FloatArray:
    """Return the times of `time_grid` with those at which velocities of motors jump among them, shape (n,) [s].

    Args:
        end: Last time [s].
        step: Length of a step [s].
        kicks: Times of the jumps, shape (k,) [s]; times of the grid within a millionth of a step of one are left out.
    """
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
    for name, interval in (("time_step", h), ("output_step", between)):
        if interval is not None:
            refuse_too_short(name, interval, end)
    return h, largest, time_grid(end, between)
