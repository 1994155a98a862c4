"""Argument checks: numbers, arrays and choices.

Each function returns the checked value in its final type, or raises `ParameterError`.
"""

from __future__ import annotations

import copyreg
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softrobots.core.errors import ParameterError

FloatArray = NDArray[np.float64]
Kind = TypeVar("Kind")
Key = TypeVar("Key")
Entry = TypeVar("Entry")

LARGEST = 1e30
"""Largest magnitude accepted, and inverse of the smallest positive number: squares and cubes of others would overflow."""

_NOT_NUMBERS = (bool, np.bool_, str, bytes, np.datetime64, np.timedelta64)  # although float() accepts some of them
_SHORT = 1000  # size up to which an array is checked as a list


def finite_array(name: str, value: Any, shape: tuple[int | None, ...] | None, unit: str | Sequence[str] = "") -> FloatArray:
    """Return `value` as a new float array of the given shape.

    Args:
        name: Name of the parameter, for the error.
        value: Anything that NumPy can convert to numbers.
        shape: Required shape, in which None stands for any length; None alone for any shape.
        unit: Unit for the error, e.g. "N", or what each entry of the last axis is, e.g. "motor_1 [rad]".

    Returns:
        A copy, float64.

    Raises:
        ParameterError: If the shape differs or a number is not finite.
    """
    try:
        given = np.asarray(value)
        mask = getattr(value, "mask", None)  # of a masked array
        array = _as_floats(given) if given.dtype.kind in "fiu" and not (isinstance(mask, np.ndarray) and mask.any()) else None
    except Exception as error:  # an object of the caller may raise anything
        raise ParameterError(name, value, _array_text(shape, unit)) from error
    if array is None:  # text, booleans, complex numbers, objects, masked elements
        raise ParameterError(name, value, _array_text(shape, unit))
    if shape is not None and array.shape != shape and not _fits(array.shape, shape):
        raise ParameterError(name, value, _array_text(shape, unit, f" (it has shape {array.shape})"))
    if array.size > _SHORT:
        accepted = np.abs(array).max() <= LARGEST  # False for NaN too; a list would take five times the memory
    else:  # on a short list the comparison is several times faster than NumPy's reductions
        accepted = all(-LARGEST <= number <= LARGEST for number in array.ravel().tolist())
    if not accepted:
        entries = () if isinstance(unit, str) else unit
        requirement = _array_text(shape, "" if entries else unit, _too_large(bool(np.all(np.isfinite(array)))))
        refuse_where(name, value, ~(np.abs(array) <= LARGEST), requirement, entries=entries)
    return array


def refuse_where(name: str, value: Any, bad: Any, requirement: str, *others: Any, entries: Sequence[str] = ()) -> None:
    """Raise ParameterError if a condition holds anywhere; for an array the error names the first such place.

    Args:
        name: Name of the parameter.
        value: Its value, a number or an array.
        bad: Truth values, of a shape to which `value` and `others` broadcast.
        requirement: What it must be, in which `{}` stands for the entries of `others` at that place.
        others: Numbers that the requirement depends on.
        entries: What each entry of the last axis is.
    """
    if not np.any(bad):
        return
    places = np.asarray(bad)
    place = tuple(map(int, np.unravel_index(int(np.argmax(places)), places.shape)))
    entry, *limits = (float(np.broadcast_to(numbers, places.shape)[place]) for numbers in (value, *others))
    named = f", {entries[place[-1]]}," if entries else ""
    where = f" (entry {place if len(place) > 1 else place[0]}{named} is {entry:.6g})" if place else ""
    raise ParameterError(name, value, (requirement.format(*limits) if limits else requirement) + where)


def positive_array(name: str, value: Any, unit: str) -> FloatArray:
    """Return `value` as an array of finite positive numbers, any shape, or raise ParameterError."""
    array = finite_array(name, value, None, unit)
    refuse_where(name, value, array < 1.0 / LARGEST, f"positive [{unit}]" + _too_small(bool(np.any(array <= 0.0))))
    return array


def non_negative_array(name: str, value: Any, unit: str) -> FloatArray:
    """Return `value` as an array of finite numbers, zero or positive, any shape, or raise ParameterError."""
    array = finite_array(name, value, None, unit)
    refuse_where(name, value, array < 0.0, f"zero or positive [{unit}]")
    return array


def one_each(name: str, value: Any, count: int, unit: str, *, positive: bool = False) -> FloatArray:
    """Return one number for all, or one for each of `count`, as shape (count,), or raise ParameterError.

    The numbers are zero or positive; if `positive` is true, zero is refused, too.
    """
    given = positive_array(name, value, unit) if positive else non_negative_array(name, value, unit)
    if given.shape not in ((), (count,)):
        raise ParameterError(name, value, f"one number, or of shape ({count},) [{unit}] (it has shape {given.shape})")
    return np.array(np.broadcast_to(given, (count,)))


def common_shape(name: str, *shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the shape to which arrays of these shapes broadcast, or raise ParameterError."""
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise ParameterError(name, shapes, "of a shape that broadcasts with the others (these are the shapes)") from error


def finite_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float, or raise ParameterError."""
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
    """Return `value` as a finite positive float, or raise ParameterError."""
    number = finite_number(name, value, unit)
    if number < 1.0 / LARGEST:
        raise ParameterError(name, value, "positive" + _unit_text(unit) + _too_small(number <= 0.0))
    return number


def non_negative_number(name: str, value: Any, unit: str = "") -> float:
    """Return `value` as a finite float, zero or positive, or raise ParameterError."""
    number = finite_number(name, value, unit)
    if number < 0.0:
        raise ParameterError(name, value, "zero or positive" + _unit_text(unit))
    return number


def positive_integer(name: str, value: Any, most: int | None = None) -> int:
    """Return `value` as a positive integer, at most `most` if that is given, or raise ParameterError."""
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | np.integer) or value <= 0:
        raise ParameterError(name, value, "a positive integer")
    if most is not None and value > most:
        raise ParameterError(name, value, f"a positive integer, at most {most}")
    return int(value)


def unit_vector(name: str, value: Any) -> FloatArray:
    """Return the unit vector in the direction of `value`, shape (3,); raise ParameterError for zero or invalid vectors.

    A vector of length 1 up to rounding is returned as it is: a unit vector that is written and read again stays the same.
    """
    vector = finite_array(name, value, (3,))
    length = float(np.linalg.norm(vector))
    if length == 0.0:
        raise ParameterError(name, value, "different from zero")
    return vector if abs(length - 1.0) <= 4.0 * np.finfo(float).eps else np.asarray(vector / length)


def choice(name: str, value: Any, options: Sequence[str]) -> str:
    """Return `value` if it is one of `options`, or raise ParameterError."""
    if not isinstance(value, str) or value not in options:
        raise ParameterError(name, value, "one of " + ", ".join(map(repr, options)))
    return str(value)


def listed(name: str, value: Any, count: int, requirement: str) -> list[Any]:
    """Return a tuple, list or array of `count` elements as a list, or raise ParameterError."""
    if not isinstance(value, tuple | list | np.ndarray) or not np.iterable(value) or len(value) != count:
        raise ParameterError(name, value, requirement)
    return list(value)


def instance_of(name: str, value: Any, kind: type[Kind], requirement: str) -> Kind:
    """Return `value` if it is a `kind`, or raise ParameterError."""
    if not isinstance(value, kind):
        raise ParameterError(name, value, requirement)
    return value


def read_only(array: FloatArray) -> FloatArray:
    """Mark an array as read-only and return it."""
    array.setflags(write=False)
    return array


def read_only_mapping(values: Mapping[Key, Entry]) -> MappingProxyType[Key, Entry]:
    """Return a copy of a mapping that cannot be written."""
    return MappingProxyType(dict(values))


# Python pickles no read-only mapping; results that hold one cross to other processes with this.
copyreg.pickle(MappingProxyType, lambda values: (read_only_mapping, (dict(values),)))


def by_column(values: Any) -> Any:
    """Return a list of rows by name as columns by name, {name: [number of each row]}; anything else as it came."""
    if not isinstance(values, list | tuple) or not values or not all(isinstance(row, Mapping) for row in values):
        return values
    return {name: [row.get(name) for row in values] for name in dict.fromkeys(name for row in values for name in row)}


def stacked_columns(field: str, columns: Mapping[str, Any], described: Mapping[str, str]) -> FloatArray:
    """Return columns of numbers side by side, shape (..., n); single numbers are repeated.

    Args:
        field: Name of the parameter, for errors.
        columns: Numbers by name.
        described: What each is, for errors, e.g. "motor_1 [rad]", by name, in the order of the result.

    Raises:
        ParameterError: If one is not made of numbers, or they have different lengths.
    """
    if not described:
        return np.zeros(0)
    for name, what in described.items():
        if np.asarray(columns[name]).dtype.kind not in "fiu":
            raise ParameterError(f"{field}[{name!r}]", columns[name], f"a number: {what}")
    try:
        return np.stack(np.broadcast_arrays(*(columns[name] for name in described)), axis=-1)
    except ValueError as error:
        raise ParameterError(field, columns, "a number for each actuator, or as many for one as for another") from error


def increasing(name: str, values: FloatArray, unit: str) -> FloatArray:
    """Return `values`, shape (n,), if they increase, or raise ParameterError."""
    if np.any(np.diff(values) <= 0.0):
        raise ParameterError(name, values, f"increasing [{unit}]")
    return values


def _as_floats(given: NDArray[Any]) -> FloatArray:
    """Return a copy in double precision; longer floats may become infinite."""
    if given.dtype.itemsize <= 8:
        return given.astype(np.float64)  # without the cost of errstate
    with np.errstate(over="ignore"):
        return given.astype(np.float64)


def _fits(shape: tuple[int, ...], required: tuple[int | None, ...]) -> bool:
    return len(shape) == len(required) and all(n is None or n == m for n, m in zip(required, shape, strict=True))


def _array_text(shape: tuple[int | None, ...] | None, unit: str | Sequence[str], detail: str = "") -> str:
    shape_text = ""
    if shape is not None:
        inside = ", ".join("n" if n is None else str(n) for n in shape)
        shape_text = f"shape ({inside}{',' if len(shape) == 1 else ''}) of "
    if isinstance(unit, str):
        return f"an array of {shape_text}finite numbers" + _unit_text(unit) + detail
    return f"an array of {shape_text}finite numbers{detail}" + (f": {', '.join(unit)}" if unit else "")


def _unit_text(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _too_large(finite: bool) -> str:
    """Addition to a requirement of finite numbers for those that are finite and yet refused."""
    return f", at most {LARGEST:g} in size" if finite else ""


def _too_small(zero_or_negative: bool) -> str:
    """Addition to a requirement of positive numbers for those that are positive and yet refused."""
    return "" if zero_or_negative else f", at least {1.0 / LARGEST:g}"
