"""Common parts of all batches: rows of numbers, cases that cannot be computed, threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from softrobots.compiled.settings import CHUNK
from softrobots.compiled.statuses import Status
from softrobots.core.checks import LARGEST, FloatArray, finite_array, positive_integer
from softrobots.core.errors import ParameterError

_DUST = 1e-20  # rad, m, or these a second


def batch_rows(**arrays: tuple[Any, int]) -> list[FloatArray]:
    """Return arrays with one row a case each; a single row is repeated for all cases.

    Args:
        **arrays: By name, the array, shape (n, columns) or (columns,), and its number of columns.

    Returns:
        The arrays, shape (n, columns), contiguous; NaN and infinity pass.

    Raises:
        ParameterError: If an array is not made of numbers, has another shape, or the rows differ in number.
    """
    rows: list[FloatArray] = []
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
        rows.append(array)
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} {count}" for name, count in counts.items())
        name = next(iter(counts))
        raise ParameterError(name, arrays[name][0], f"of as many rows as the others have ({listed})")
    count = next(iter(counts.values()), 1)
    return [array if array.ndim == 2 else np.tile(array, (count, 1)) for array in rows]


def flat_targets(targets: Any) -> tuple[Any, bool]:
    """Return targets as rows of numbers, and whether they are poses: positions as they are, poses as position and rotation.

    Raises:
        ParameterError: If a pose, shape (4, 4), holds no rotation; names its row. NaN and infinity pass.
    """
    try:
        shape = np.shape(targets)
    except ValueError:  # rows of different length, which `batch_rows` refuses
        return targets, False
    if shape[-2:] != (4, 4):
        return targets, False
    poses = batch_rows(targets=(np.reshape(targets, (-1, 16)), 16))[0].reshape(-1, 4, 4)
    finite = np.all(np.isfinite(poses), axis=(1, 2))
    turns = np.where(finite[:, None, None], poses[:, :3, :3], np.eye(3))
    gap = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    upright = np.linalg.det(turns) > 0.0
    bad = finite & ~((gap <= 1e-9) & upright & np.all(poses[:, 3] == (0.0, 0.0, 0.0, 1.0), axis=1))
    if np.any(bad):
        row = int(np.flatnonzero(bad)[0])
        raise ParameterError("targets", poses[row], f"poses: rotation and translation above a row 0 0 0 1 (row {row} is none)")
    flat = np.concatenate([poses[:, :3, 3], poses[:, :3, :3].reshape(-1, 9)], axis=1)
    return flat[0] if len(shape) == 2 else flat, True


def gravity_vector(gravity: Any) -> FloatArray:
    """Return gravity, shape (3,) [m/s^2], zero if there is none, or raise ParameterError."""
    return np.zeros(3) if gravity is None else finite_array("gravity", gravity, (3,), "m/s^2")


def unusable(*arrays: FloatArray) -> Any:
    """Return a mask of the rows that hold a number that is not finite or too large to compute with."""
    bad = np.zeros(len(arrays[0]), dtype=bool)
    for array in arrays:
        if array.size and not (array.min() >= -LARGEST and array.max() <= LARGEST):  # rarely; both are NaN if a number is
            bad |= ~np.all(np.abs(array) <= LARGEST, axis=1)
    return bad


def without_dust(array: FloatArray) -> FloatArray:
    """Return coordinates or rates in which what Newton's method leaves of zeros is zero: steps of time would make it grow."""
    return np.where(np.abs(array) < _DUST, 0.0, array)


def without(array: FloatArray, bad: Any, instead: Any = 0.0) -> FloatArray:
    """Return the array with other numbers in some rows; itself if there are no such rows."""
    if not np.any(bad):
        return array
    changed = array.copy()
    changed[bad] = instead
    return changed


def fail(statuses: Any, bad: Any, errors: Sequence[FloatArray], others: Sequence[FloatArray]) -> None:
    """Mark rows of bad input, and replace NaN and infinity in the results of all failed cases.

    Args:
        statuses: Status of each case, changed in place.
        bad: Mask of the rows of bad input.
        errors: Results that become infinite there, shape (n,) each, changed in place.
        others: Results that become zero there, shape (n,) or (n, columns) each, changed in place.
    """
    statuses[bad] = Status.NOT_A_NUMBER
    failed = np.flatnonzero(statuses)
    if len(failed) == 0:
        return
    for error in errors:
        error[bad] = np.inf
        error[failed] = np.nan_to_num(error[failed], nan=np.inf, posinf=np.inf)
    for other in others:
        other[failed] = np.nan_to_num(other[failed], posinf=0.0, neginf=0.0)


def solve_batch(
    function: Callable[..., None],
    inputs: Sequence[tuple[int, FloatArray]],
    results: Sequence[tuple[int, int]],
    count: int,
    threads: int,
    sums: FloatArray | None = None,
) -> tuple[list[FloatArray], Any]:
    """Solve many cases with a batch function of generated code; see `softrobots.compiled.drivers.lane_drivers`.

    Args:
        function: The batch function.
        inputs: Place in the workspace and values, shape (count, columns), or (1, columns) for all cases.
        results: Place in the workspace and number of columns of each result.
        count: Number of cases.
        threads: Number of threads.
        sums: For functions of `response_drivers`, zeros to add to instead of writing statuses, a row for each chunk of cases.

    Returns:
        The results, shape (count, columns) each, and the status of each case, shape (count,), or the sums.

    Raises:
        ParameterError: If the number of threads is not positive.
    """
    arrays = [np.ascontiguousarray(values) for _, values in inputs]
    given = tuple(array if array.flags.writeable else array.copy() for array in arrays)  # all of one type for numba
    places, result_places = tuple(place for place, _ in inputs), tuple(place for place, _ in results)
    outputs, statuses = tuple(np.zeros((count, columns)) for _, columns in results), np.zeros(count, dtype=np.uint8)
    written = statuses if sums is None else sums

    def solve(first: int, last: int) -> None:
        function(given, places, outputs, result_places, written, first, last)

    if positive_integer("threads", threads) == 1 or count <= CHUNK:
        solve(0, count)
    else:
        starts = range(0, count, CHUNK)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(solve, starts, [*starts[1:], count]))
    return list(outputs), written


def root(squares: FloatArray) -> FloatArray:
    """Return the square roots of a column, shape (n,); 0 of numbers that rounding has made negative."""
    return np.asarray(np.sqrt(np.maximum(squares[:, 0], 0.0)))
