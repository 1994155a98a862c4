"""Times of the steps and rows of a motion; the same for both engines."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import ParameterError

TIP_TOLERANCE = 5e-4
"""Default of the largest error of the tip, relative to the reach of the robot."""

SAME_TIME = 1e-9
"""Share of a duration within which times are the same one: jumps are found by bisection, to a rounding."""

_COARSEST = {2: 200, 4: 100}  # steps at least, of the first of the runs that are compared, for each order
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


def first_grid(rows: FloatArray, breaks: Iterable[FloatArray], order: int) -> FloatArray:
    """Return the steps of the first of the runs that are compared, ending at breaks, or of order 4 at rows, shape (n,) [s]."""
    end = float(rows[-1])
    stops = rows if order == 4 else merged_times(SAME_TIME * end, end, *breaks)
    parts = np.ceil(np.diff(stops) / end * _COARSEST[order] - 1e-9).astype(int)
    pieces = zip(stops[:-1], stops[1:], parts, strict=True)
    return np.append(np.concatenate([np.linspace(one, other, count + 1)[:-1] for one, other, count in pieces]), end)


def grid_with_stops(end: float, step: float, *stops: FloatArray) -> FloatArray:
    """Return the times of `time_grid`, with stops in place of those a millionth of a step beside them, shape (n,) [s]."""
    return merged_times(1e-6 * step, end, *stops, time_grid(end, step))


def merged_times(apart: float, end: float, *groups: FloatArray) -> FloatArray:
    """Return zero, the end, and the times of groups between them, ascending, shape (n,) [s].

    Args:
        apart: Times no further from each other are one [s]: that of the group named first, in a group the earliest.
        end: Last time [s].
        groups: Times, each shape (k,) [s].
    """
    found = np.array([0.0, end])
    for group in groups:
        times = np.unique(group[(group > 0.0) & (group < end)])
        places = np.searchsorted(found, times)
        times = times[np.minimum(times - found[places - 1], found[places] - times) > apart]
        times = times[np.diff(times, prepend=-np.inf) > apart]
        found = np.insert(found, np.searchsorted(found, times), times)
    return found


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
