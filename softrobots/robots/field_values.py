"""Checks of the values of a robot's fields: numbers of parts, words, colours, bounds, and what looks like another unit.

A field states its facts in its metadata (`softrobots.robots.fields.Facts`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import Field
from typing import Any

import numpy as np

from softrobots.core.checks import choice, finite_array, finite_number, instance_of, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.core.suspicion import NEXT_TO_NO_PRESSURE, question_angle, question_length, question_pressure

_FAR = 50.0  # times its default, from which on a length is hardly in m
_THIN = 1e-3  # [m] walls and wires of any thickness are as usual as thin ones
_TURNS = 4.0 * np.pi  # angle from which on it is hardly in rad


def numbers(
    name: str, value: Any, count: int | None, unit: str, parts: str = "parts", actuators: int | None = None
) -> tuple[float, ...]:
    """Return numbers as a tuple of `count`, a single one repeated, of any length without `count`; or raise ParameterError.

    A list may have as many as there are `actuators`, too.
    """
    if isinstance(value, str | bytes):
        raise ParameterError(name, value, f"a number or a list of numbers [{unit}]")
    if count is not None and not isinstance(value, Sequence) and getattr(value, "ndim", 0) == 0:
        return (finite_number(name, value, unit),) * count
    values = tuple(finite_array(name, value, (None,), unit).tolist())
    if count is not None and len(values) not in (count, actuators):
        each = "" if actuators is None else f" or of the {actuators} actuators"
        raise ParameterError(name, value, f"one number, or one for each of the {count} {parts}{each} [{unit}]")
    return values


def checked_value(field: Field[Any], value: Any, count: int, parts: str) -> Any:
    """Return the value of a field in its final type, or raise ParameterError.

    Args:
        field: The field.
        value: Its value.
        count: Number of links or segments.
        parts: What they are called, for errors.
    """
    name, facts = field.name, field.metadata["facts"]
    if facts.options:
        return choice(name, value, facts.options)
    if isinstance(field.default, bool):
        return instance_of(name, value, bool, "True or False")
    if isinstance(field.default, int):
        return positive_integer(name, value, None if facts.at_most is None else int(facts.at_most))
    if facts.form == "colour":
        return _colours(name, value, count, parts)
    each = facts.form == "per_part"
    values = numbers(name, value, count, facts.unit, parts) if each else (finite_number(name, value, facts.unit),)
    return within(field, values) if each else within(field, values)[0]


def within(field: Field[Any], values: tuple[float, ...]) -> tuple[float, ...]:
    """Return numbers that are within the bounds of a field, or raise ParameterError; ask if they look like another unit."""
    name, facts = field.name, field.metadata["facts"]
    if values and not facts.allow(values):
        raise ParameterError(name, values if len(values) > 1 else values[0], f"{facts.bounds} [{facts.unit}]")
    if questionable(field, values):
        largest = max(values, key=abs)
        if facts.unit == "m":
            question_length(name, largest, _usual(field))
        else:
            (question_angle if facts.unit == "rad" else question_pressure)(name, largest)
    return values


def questioned_angles(name: str, angles: tuple[float, ...], *, winding: bool = False) -> tuple[float, ...]:
    """Return angles [rad] as they are; ask about the largest if it looks like degrees.

    Of angles that may wind many times around only whole numbers do, as degrees are typed.
    """
    largest = max(angles, key=abs, default=0.0)
    if abs(largest) > _TURNS and (not winding or largest == round(largest)):
        question_angle(name, largest)
    return angles


def questionable(field: Field[Any], values: Sequence[float]) -> bool:
    """Return whether the largest of some numbers of a field looks as if it were in another unit."""
    largest, unit, usual = max(values, key=abs, default=0.0), field.metadata["facts"].unit, _usual(field)
    return bool(
        (unit == "m" and usual >= _THIN and largest >= _FAR * usual)
        or (unit == "rad" and abs(largest) > _TURNS)
        or (unit == "Pa" and 0.0 < abs(largest) < NEXT_TO_NO_PRESSURE)
    )


def _usual(field: Field[Any]) -> float:
    default: Any = field.default
    return 0.0 if default is None else float(np.max(default))


def _colours(name: str, value: Any, count: int, parts: str) -> tuple[tuple[float, ...], ...]:
    requirement = f"red, green, blue, opacity in [0, 1]: one colour, or one for each of the {count} {parts}"
    try:
        single = np.ndim(value) == 1
        checked = finite_array(name, np.tile(value, (count, 1)) if single else value, (count, 4))
    except (ParameterError, ValueError) as error:
        raise ParameterError(name, value, requirement) from error
    if checked.min() < 0.0 or checked.max() > 1.0:
        raise ParameterError(name, value, requirement)
    return tuple(tuple(colour) for colour in checked.tolist())
