"""Facts with units, told once for a person and for a machine: lines with names and units, or JSON with a list of the units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.cli.reports.answers import aligned, plain


class Fact(NamedTuple):
    """One fact of an answer."""

    name: str
    """Its name in the library and in JSON."""
    value: Any
    """A number, a truth, a text, None, or an array of numbers."""
    unit: str
    """Its unit; "-" for a pure number, empty for what is no number."""
    told: str
    """What it is, in words."""


def answer_of(facts: Sequence[Fact]) -> dict[str, Any]:
    """The facts by name, and under `units` the unit of each that is a number."""
    return {fact.name: plain(fact.value) for fact in facts} | {"units": {fact.name: fact.unit for fact in facts if fact.unit}}


def lines_of(facts: Sequence[Fact]) -> list[str]:
    """The facts for a person, one a line: what it is, its value and its unit."""
    return aligned((fact.told, " ".join(part for part in (spoken(fact.value), fact.unit.strip("-")) if part)) for fact in facts)


def spoken(value: Any) -> str:
    """A value with six digits, or in words."""
    value = plain(value)
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    return "  ".join(f"{number:.6g}" for number in np.ravel(value) + 0.0)
