"""Units of actuator and elastic coordinates, which may be angles, lengths and tensions side by side."""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.model.soft_model import SoftModel

LOAD_UNITS = {"rad": "N m", "m": "N", "N": "N"}
"""Unit of the load on a coordinate, by the unit of the coordinate; the load on a given tension is the tension."""


def spring_units(model: SoftModel) -> tuple[str, ...]:
    """Unit of each elastic coordinate, rad or m."""
    return tuple("rad" if turns else "m" for turns in model.springs.turning.tolist())


def load_units(units: Sequence[str]) -> tuple[str, ...]:
    """Units of the loads on coordinates of these units."""
    return tuple(LOAD_UNITS[unit] for unit in units)


def joined_units(units: Sequence[str]) -> str:
    """The units of a row of numbers as one text: one unit if all have it, else one for each."""
    return units[0] if len(set(units)) == 1 else ", ".join(units)
