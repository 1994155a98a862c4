"""What all batches share: rows of numbers, cases that cannot be computed, threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from softrobots.compiled.statuses import Status
from softrobots.core.checks import LARGEST, FloatArray, finite_array, positive_integer
from softrobots.core.errors import ParameterError

_CHUNK = 8192  # cases that a thread takes at a time; small, as another program may slow one thread down


def batch_rows(**arrays: tuple[Any, int]) -> list[FloatArray]:
    """Return arrays with one row a case each; a single row goes for all.

    Args:
        **arrays: By name, the array, shape (n, columns) or (columns,), and its number of columns.

    Returns:
        The arrays, shape (n, columns), contiguous; NaN and infinity pass.

    Raises:
        ParameterError: If an array is not made of numbers, has another shape, or the rows differ in number.
    """
    made: list[FloatArray] = []
    counts: dict[str, int] = {}
    for name, (value, columns) in arrays.items():
        requirement = f"an array of numbers, shape (n, {columns}) or ({columns},)"
        try:
            given = np.asarray(value)
            if given.dtype.kind not in "fiu":
                raise TypeError
            array = np.ascontiguousarray(given, dtype=np.float64)
        except (TypeError, ValueError, OverflowError) as error:
            raise ParameterError(name, value, requirement) from error
        if array.ndim not in (1, 2) or array.shape[-1] != columns:
            raise ParameterError(name, value, f"{requirement} (it has shape {array.shape})")
        if array.ndim == 2:
            counts[name] = len(array)
        made.append(array)
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise ParameterError(next(iter(counts)), counts, f"as many rows as the others have ({told})")
    count = next(iter(counts.values()), 1)
    return [array if array.ndim == 2 else np.tile(array, (count, 1)) for array in made]


def gravity_vector(gravity: Any) -> FloatArray:
    """Return gravity, shape (3,) [m/s^2]; zero if there is none.

    Raises:
        ParameterError: If the shape differs or a number is not finite.
    """
    return np.zeros(3) if gravity is None else finite_array("gravity", gravity, (3,), "m/s^2")


def unusable(*arrays: FloatArray) -> Any:
    """Which rows hold a number that is not finite or too large to compute with, truth values."""
    made = np.zeros(len(arrays[0]), dtype=bool)
    for array in arrays:
        if array.size and not (array.min() >= -LARGEST and array.max() <= LARGEST):  # rarely; both are NaN if a number is
            made |= ~np.all(np.abs(array) <= LARGEST, axis=1)
    return made


def without(array: FloatArray, bad: Any, instead: Any = 0.0) -> FloatArray:
    """The array with other numbers in some rows; itself if there are none."""
    if not np.any(bad):
        return array
    made = array.copy()
    made[bad] = instead
    return made


def fail(statuses: Any, bad: Any, errors: Sequence[FloatArray], others: Sequence[FloatArray]) -> None:
    """Mark rows whose input was none, and take NaN out of all that failed.

    Args:
        statuses: Status of each case, changed in place.
        bad: Which rows had no input, truth values.
        errors: What is infinite where there is no answer, shape (n,) each, changed in place.
        others: What is zero there instead of no number, shape (n,) or (n, columns) each, changed in place.
    """
    statuses[bad] = Status.NOT_A_NUMBER
    failed = np.flatnonzero(statuses)
    for error in errors:
        error[bad] = np.inf
        error[failed] = np.nan_to_num(error[failed], nan=np.inf, posinf=np.inf)
    for other in others:
        other[failed] = np.nan_to_num(other[failed], posinf=0.0, neginf=0.0)


def statuses_of(values: Any) -> Any:
    """Mark statuses as read-only."""
    values.setflags(write=False)
    return values


def in_parts(work: Callable[[int, int], None], count: int, threads: int) -> None:
    """Do cases from first to last, in chunks that threads take as they become free.

    Args:
        work: Does the cases from its first argument up to its second.
        count: Number of cases.
        threads: How many threads.

    Raises:
        ParameterError: If the number of threads is not positive.
    """
    if positive_integer("threads", threads) == 1 or count <= _CHUNK:
        work(0, count)
        return
    with ThreadPoolExecutor(threads) as pool:
        parts = [pool.submit(work, first, min(first + _CHUNK, count)) for first in range(0, count, _CHUNK)]
        for part in parts:
            part.result()
