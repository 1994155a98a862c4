"""Timing: all workloads in turn, round after round, in one process; ratios within a round; medians of those.

A neighbour on the machine, or its clock, slows whole rounds, so numbers of one round are comparable and those of different
rounds are not.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, positive_integer
from softrobots.core.errors import ParameterError, SoftRobotsError
from softrobots.core.progress import with_progress

Clock = Callable[[], float]
"""Seconds since something: `time.process_time` for CPU time, `time.perf_counter` for wall clock."""


class Workload(NamedTuple):
    """Something to be timed."""

    cases: int
    """How many cases one run does."""
    run: Callable[[], object]
    """Does them."""


class Spread(NamedTuple):
    """A figure of several rounds."""

    median: float
    """The middle one."""
    low: float
    """The smallest."""
    high: float
    """The largest."""


def interleaved(
    workloads: Mapping[str, Workload],
    rounds: int,
    *,
    clock: Clock = time.process_time,
    shortest: float = 0.02,
    progress: bool | str = False,
) -> dict[str, FloatArray]:
    """Time workloads in turn.

    Each is run before, untimed, to warm up; a short one is repeated within its turn. Linear algebra stays on one thread, and
    the collector of garbage rests, as in `timeit`.

    Args:
        workloads: What to time, by name.
        rounds: How often.
        clock: What to time with.
        shortest: Least time of a turn [s].
        progress: Whether to show a bar on stderr, or its label.

    Returns:
        Seconds a case by name, shape (rounds,).

    Raises:
        ParameterError: If there are no rounds.
    """
    from threadpoolctl import threadpool_limits

    positive_integer("rounds", rounds)
    seconds = {name: np.zeros(rounds) for name in workloads}
    with threadpool_limits(limits=1, user_api="blas"):
        repeats = {name: _repeats(workload, shortest) for name, workload in workloads.items()}
        for number in with_progress(range(rounds), progress, label="rounds", unit="round"):
            gc.collect()
            for name, workload in workloads.items():
                gc.disable()
                began = clock()
                for _ in range(repeats[name]):
                    workload.run()
                seconds[name][number] = (clock() - began) / (repeats[name] * workload.cases)
                gc.enable()
    return seconds


def _repeats(workload: Workload, shortest: float) -> int:
    """How often a run fits into the least time of a turn; runs it twice."""
    workload.run()
    began = time.perf_counter()
    workload.run()
    return max(1, math.ceil(shortest / max(time.perf_counter() - began, 1e-7)))


def ratio(numerator: FloatArray, denominator: FloatArray) -> Spread:
    """Ratio of two costs: of each round, and then the median of those.

    Args:
        numerator: Seconds a case, shape (rounds,).
        denominator: Seconds a case of the other, shape (rounds,).

    Raises:
        ParameterError: If they are not of the same rounds, or not all positive.
    """
    if numerator.shape != denominator.shape or numerator.ndim != 1 or not len(numerator):
        raise ParameterError("denominator", denominator, f"of the same rounds as the numerator, shape {numerator.shape}")
    if not (np.all(numerator > 0.0) and np.all(denominator > 0.0)):
        raise ParameterError("denominator", denominator, "positive, and the numerator too [s]")
    return spread(numerator / denominator)


def spread(values: FloatArray) -> Spread:
    """Median, smallest and largest of some values."""
    return Spread(float(np.median(values)), float(np.min(values)), float(np.max(values)))


def require_agreement(name: str, found: FloatArray, expected: FloatArray, tolerance: float, unit: str) -> None:
    """Refuse to time what gives other answers than `solve_equilibrium` and its like.

    Args:
        name: What is to be timed.
        found: Its answers.
        expected: The right ones, the same shape.
        tolerance: Largest difference of a number.
        unit: Unit of the numbers.

    Raises:
        SoftRobotsError: If they differ.
    """
    difference = float(np.max(np.abs(found - expected), initial=0.0))
    if not difference <= tolerance:
        raise SoftRobotsError(f"{name} is off by {difference:.3g} {unit}, allowed are {tolerance:g}: it is not timed")
