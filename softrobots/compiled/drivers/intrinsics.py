"""Built-in functions of the kernel language for plain Python; other back ends have their own.

Modules in the kernel language import these names for tests and type checks. Only the text of their functions goes into a
generated module, which runs with the names of its back end.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from typing import TypeAlias

Array: TypeAlias = MutableSequence[float]
"""A flat array of numbers: a list in Python, a block of rows in NumPy, `double *` in C."""


def where(condition: bool, a: float, b: float) -> float:
    """Return `a` where the condition holds, else `b`; both have been evaluated."""
    return a if condition else b


def floor(x: float) -> float:
    """Return the largest whole number that is not above `x`, as a float.

    Raises:
        OverflowError: If `x` is infinite (in plain Python only).
        ValueError: If `x` is NaN (in plain Python only).
    """
    return float(math.floor(x))


def fabs(x: float) -> float:
    """Return `x` without its sign."""
    return math.fabs(x)


def sqrt(x: float) -> float:
    """Return the square root of `x`.

    Raises:
        ValueError: If `x` is negative (in plain Python only).
    """
    return math.sqrt(x)


def zeros(count: int) -> Array:
    """Return a new array of `count` zeros."""
    return [0.0] * count
