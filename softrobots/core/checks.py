"""Checks of what callers pass in: numbers, vectors and choices.

Each returns the checked value in its final type, or raises before any work is done.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.errors import ParameterError

FloatArray = NDArray[np.float64]

_NOT_NUMBERS = (bool, np.bool_, str, bytes, np.datetime64, np.timedelta64)  # although float() may take them

_SHORT = 1000  # numbers of an array that is checked as a list

LARGEST = 1e30
"""Numbers beyond this in size are refused, and positive ones below its inverse: their squares and cubes would overflow."""


def finite_array(name: str, value: Any, shape: tuple[int | None, ...] | None, unit: str = "") -> FloatArray:
    """Return `value` as a new float array of the given shape.

    Args:
        name: Name of the parameter, for the error.
        value: Anything that NumPy can turn into numbers.
        shape: Required shape, where None stands for any length; None alone for any shape.
        unit: Unit for the error, e.g. "N".

    Returns:
        A copy, float64.

    Raises:
        ParameterError: If the shape differs or a number is not finite.
    """
    try:
        given = np.asarray(value)
        mask = getattr(value, "mask", None)  # of a NumPy array with gaps
        array = _as_floats(given) if given.dtype.kind in "fiu" and not (isinstance(mask, np.ndarray) and mask.any()) else None
    except Exception as error:  # an object of the caller may raise anything
        raise ParameterError(name, value, _array_text(shape, unit)) from error
    if array is None:  # text, truth values, complex numbers, objects, gaps
        raise ParameterError(name, value, _array_text(shape, unit))
    if shape is not None and array.shape != shape and not _fits(array.shape, shape):
        raise ParameterError(name, value, f"{_array_text(shape, unit)} (it has shape {array.shape})")
    if array.size > _SHORT:
        refused = not np.abs(array).max() <= LARGEST  # a list of a large one would take five times its memory
    else:
        # A comparison refuses NaN too, and on a short list it is several times faster than NumPy's reductions.
        refused = not all(-LARGEST <= number <= LARGEST for number in array.ravel().tolist())
    if refused:
        raise ParameterError(name, value, _array_text(shape, unit) + _too_large(bool(np.all(np.isfinite(array)))))
    return array


def positive_array(name: str, value: Any, unit: str) -> FloatArray:
    """Return `value` as an array of positive numbers, any shape.

    Raises:
        ParameterError: If a number is not finite or not positive.
    """
    array = finite_array(name, value, None, unit)
    if np.any(array < 1.0 / LARGEST):
        raise ParameterError(name, value, f"positive [{unit}]" + _too_small(bool(np.any(array <= 0.0))))
    return array


def non_negative_array(name: str, value: Any, unit: str) -> FloatArray:
    """Return `value` as an array of numbers, zero or above, any shape.

    Raises:
        ParameterError: If a number is not finite or below zero.
    """
    array = finite_array(name, value, None, unit)
    if np.any(array < 0.0):
        raise ParameterError(name, value, f"zero or positive [{unit}]")
    return array


def common_shape(name: str, *shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape that arrays of these shapes broadcast to.

    Raises:
        ParameterError: If there is none.
    """
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise ParameterError(name, shapes, "of a shape that broadcasts with the others (these are the shapes)") from error


def finite_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float.

    Raises:
        ParameterError: If it is not one.
    """
    requirement = "a finite number" + _unit_text(unit)
    if isinstance(value, _NOT_NUMBERS):
        raise ParameterError(name, value, requirement)
    try:
        number = float(value)
    except Exception as error:  # an object of the caller may raise anything
        raise ParameterError(name, value, requirement) from error
    if not abs(number) <= LARGEST:  # NaN too
        raise ParameterError(name, value, requirement + _too_large(math.isfinite(number)))
    return number


def positive_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float above zero.

    Raises:
        ParameterError: If it is not one.
    """
    number = finite_number(name, value, unit)
    if number < 1.0 / LARGEST:
        raise ParameterError(name, value, "positive" + _unit_text(unit) + _too_small(number <= 0.0))
    return number


def non_negative_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float, zero or above.

    Raises:
        ParameterError: If it is not one.
    """
    number = finite_number(name, value, unit)
    if number < 0.0:
        raise ParameterError(name, value, "zero or positive" + _unit_text(unit))
    return number


def positive_integer(name: str, value: Any, most: int | None = None) -> int:
    """Return `value` as an integer above zero, and not above `most` if that is given.

    Raises:
        ParameterError: If it is not one.
    """
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | np.integer) or value <= 0:
        raise ParameterError(name, value, "a positive integer")
    if most is not None and value > most:
        raise ParameterError(name, value, f"a positive integer, at most {most}")
    return int(value)


def unit_vector(name: str, value: Any) -> FloatArray:
    """Return the direction of `value`, shape (3,), as a vector of length 1.

    Raises:
        ParameterError: If the shape differs, a number is not finite, or all are zero.
    """
    vector = finite_array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise ParameterError(name, value, "different from zero")
    return np.asarray(vector / length)


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """Return `value` if it is one of `options`.

    Raises:
        ParameterError: If it is not.
    """
    if not isinstance(value, str) or value not in options:
        raise ParameterError(name, value, "one of " + ", ".join(map(repr, options)))
    return str(value)


def listed(name: str, value: Any, count: int, requirement: str) -> list[Any]:
    """Return a tuple, a list or an array of `count` things as a list.

    Raises:
        ParameterError: If it is something else.
    """
    if not isinstance(value, tuple | list | np.ndarray) or not np.iterable(value) or len(value) != count:
        raise ParameterError(name, value, requirement)
    return list(value)


def read_only(array: FloatArray) -> FloatArray:
    """Mark an array as read-only and return it."""
    array.setflags(write=False)
    return array


def increasing(name: str, values: FloatArray, unit: str) -> FloatArray:
    """Return `values`, shape (n,), if they increase.

    Raises:
        ParameterError: If they do not.
    """
    if np.any(np.diff(values) <= 0.0):
        raise ParameterError(name, values, f"increasing [{unit}]")
    return values


def _as_floats(given: NDArray[Any]) -> FloatArray:
    """A copy of an array of numbers; infinite where a longer float has a number that this one has not."""
    if given.dtype.itemsize <= 8:
        return given.astype(np.float64)
    with np.errstate(over="ignore"):
        return given.astype(np.float64)


def _fits(shape: tuple[int, ...], required: tuple[int | None, ...]) -> bool:
    return len(shape) == len(required) and all(n is None or n == m for n, m in zip(required, shape, strict=True))


def _array_text(shape: tuple[int | None, ...] | None, unit: str) -> str:
    return f"an array of {_shape_text(shape)}finite numbers" + _unit_text(unit)


def _unit_text(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _too_large(finite: bool) -> str:
    """Addition to a requirement of finite numbers for those that are finite and yet refused."""
    return f", at most {LARGEST:g} in size" if finite else ""


def _too_small(zero_or_negative: bool) -> str:
    """Addition to a requirement of positive numbers for those that are positive and yet refused."""
    return "" if zero_or_negative else f", at least {1.0 / LARGEST:g}"


def _shape_text(shape: tuple[int | None, ...] | None) -> str:
    if shape is None:
        return ""
    inside = ", ".join("n" if n is None else str(n) for n in shape)
    return f"shape ({inside}{',' if len(shape) == 1 else ''}) of "
