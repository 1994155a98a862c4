"""Checks of what callers pass in: numbers, vectors and choices.

Each returns the checked value in its final type, or raises before any work is done.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.errors import ParameterError

FloatArray = NDArray[np.float64]


def finite_array(name: str, value: Any, shape: tuple[int | None, ...], unit: str = "") -> FloatArray:
    """Return `value` as a new float array of the given shape.

    Args:
        name: Name of the parameter, for the error.
        value: Anything that NumPy can turn into numbers.
        shape: Required shape; None stands for any length.
        unit: Unit for the error, e.g. "N".

    Returns:
        A copy, float64.

    Raises:
        ParameterError: If the shape differs or a number is not finite.
    """
    wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
    requirement = f"an array of shape {wanted} of finite numbers" + (f" [{unit}]" if unit else "")
    try:
        given = np.asarray(value)
        if given.dtype.kind not in "fiu":  # not text, not truth values, not complex numbers, not objects
            raise ParameterError(name, value, requirement)
        array = given.astype(np.float64)  # always a copy
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(name, value, requirement) from error
    if array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True)):
        raise ParameterError(name, value, f"{requirement} (it has shape {array.shape})")
    # math.isfinite on a short list is several times faster than numpy.isfinite(...).all().
    if not all(map(math.isfinite, array.ravel().tolist())):
        raise ParameterError(name, value, requirement)
    return array


def finite_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float.

    Raises:
        ParameterError: If it is not one.
    """
    requirement = "a finite number" + (f" [{unit}]" if unit else "")
    if isinstance(value, bool | np.bool_ | str | bytes):
        raise ParameterError(name, value, requirement)
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ParameterError(name, value, requirement) from error
    if not math.isfinite(number):
        raise ParameterError(name, value, requirement)
    return number


def positive_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float above zero.

    Raises:
        ParameterError: If it is not one.
    """
    number = finite_number(name, value, unit)
    if number <= 0.0:
        raise ParameterError(name, value, "positive" + (f" [{unit}]" if unit else ""))
    return number


def non_negative_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float, zero or above.

    Raises:
        ParameterError: If it is not one.
    """
    number = finite_number(name, value, unit)
    if number < 0.0:
        raise ParameterError(name, value, "zero or positive" + (f" [{unit}]" if unit else ""))
    return number


def positive_integer(name: str, value: Any) -> int:
    """Return `value` as an integer above zero.

    Raises:
        ParameterError: If it is not one.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value <= 0:
        raise ParameterError(name, value, "a positive integer")
    return int(value)


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """Return `value` if it is one of `options`.

    Raises:
        ParameterError: If it is not.
    """
    if value not in options:
        raise ParameterError(name, value, "one of " + ", ".join(map(repr, options)))
    return str(value)


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
