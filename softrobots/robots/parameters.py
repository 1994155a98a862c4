"""Checks of robot parameters: one number for all parts of a robot or one for each; and their way into xacro."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from softrobots.core.checks import finite_array, finite_number
from softrobots.core.errors import ParameterError
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder

MOST_PARTS = 1000
"""Links or segments of a robot: xacro spends minutes on so many."""

PerPart = float | Sequence[float]
"""One number for all links or segments, or one for each, base to tip."""


@lru_cache(maxsize=64)
def expanded(xacro_name: str, arguments: tuple[tuple[str, str], ...]) -> str:
    """URDF text of a file in xacro/ with arguments, text by name; kept for the next call."""
    return expand(xacro_folder() / xacro_name, dict(arguments))


def numbers(name: str, value: Any, count: int | None, unit: str, part: str = "links") -> tuple[float, ...]:
    """Return `value` as a tuple of `count` floats, a single number repeated.

    Raises:
        ParameterError: If it is something else.
    """
    if isinstance(value, str | bytes):
        raise ParameterError(name, value, f"a number or a list of numbers [{unit}]")
    if count is not None and not isinstance(value, Sequence) and getattr(value, "ndim", 0) == 0:
        return (finite_number(name, value, unit),) * count
    values = tuple(finite_array(name, value, (None,), unit).tolist())
    if count is not None and len(values) != count:
        raise ParameterError(name, value, f"one number, or one for each of the {count} {part} [{unit}]")
    return values


def at_least(name: str, values: tuple[float, ...], low: float, strict: bool, unit: str) -> None:
    """Refuse values below `low`, or at it if `strict`.

    Raises:
        ParameterError: If there is one.
    """
    if min(values) < low or (strict and min(values) == low):
        raise ParameterError(
            name, values if len(values) > 1 else values[0], f"{'above' if strict else 'at least'} {low} [{unit}]"
        )


Bounds = Mapping[str, tuple[str, float, bool]]
"""By field: its unit, its lowest value, and whether that value itself is refused."""


def check_lengths(robot: Any, name: str, part: str) -> int:
    """Check the lengths of the parts of a robot, store them as a tuple, and return how many there are.

    Raises:
        ParameterError: If there are none, or more than `MOST_PARTS`, or one is not positive.
    """
    given = getattr(robot, name)
    lengths = numbers(name, given, None, "m")
    if not 0 < len(lengths) <= MOST_PARTS:
        raise ParameterError(name, given, f"at least one {part} length [m], at most {MOST_PARTS}")
    at_least(name, lengths, 0.0, True, "m")
    object.__setattr__(robot, name, lengths)
    return len(lengths)


def check_fields(robot: Any, per_part: Bounds, single: Bounds, count: int, part: str) -> None:
    """Check the numbers of a robot and store them: a tuple with one number a part, or a number.

    Args:
        robot: A frozen dataclass.
        per_part: Fields with one number for all parts or one for each.
        single: Fields with one number.
        count: Number of parts.
        part: What a part is called, in the plural, for the errors.

    Raises:
        ParameterError: If a value is out of bounds or a list has the wrong length; the message names the field.
    """
    for name, (unit, low, strict) in per_part.items():
        values = numbers(name, getattr(robot, name), count, unit, part)
        at_least(name, values, low, strict, unit)
        object.__setattr__(robot, name, values)
    for name, (unit, low, strict) in single.items():
        value = finite_number(name, getattr(robot, name), unit)
        at_least(name, (value,), low, strict, unit)
        object.__setattr__(robot, name, value)


def colours(value: Any, count: int, part: str = "links") -> tuple[tuple[float, ...], ...]:
    """Return `value` as `count` colours, a single one repeated.

    Raises:
        ParameterError: If it is something else.
    """
    requirement = f"red, green, blue, opacity in [0, 1]: one colour, or one for each of the {count} {part}"
    try:
        single = np.ndim(value) == 1
        checked = finite_array("rgba", np.tile(value, (count, 1)) if single else value, (count, 4))
    except (ParameterError, ValueError) as error:
        raise ParameterError("rgba", value, requirement) from error
    if checked.min() < 0.0 or checked.max() > 1.0:
        raise ParameterError("rgba", value, requirement)
    return tuple(tuple(colour) for colour in checked.tolist())


def xacro_arguments(robot: Any) -> dict[str, str]:
    """The fields of a robot, one of them `rgba`, as arguments of its xacro file: text by name, full precision."""
    arguments = {field.name: argument_text(getattr(robot, field.name)) for field in dataclasses.fields(robot)}
    shades = [" ".join(map(repr, colour)) for colour in robot.rgba]
    return arguments | {"rgba": ",".join(shades)}


def argument_text(value: Any) -> str:
    """A value as the text of a xacro argument, full precision; None is empty."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return "[" + ",".join(map(repr, value)) + "]" if isinstance(value, tuple) else repr(value)
