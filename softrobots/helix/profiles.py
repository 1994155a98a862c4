"""Contraction or angle as a function of the position on the tube: a number, a function, or a table with jumps."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import LARGEST, FloatArray, finite_array, finite_number
from softrobots.core.errors import ParameterError
from softrobots.helix.shapes import ANGLE_RANGE, CONTRACTION_RANGE

_RANGES = {
    "contraction": (1.0 / LARGEST, 1.0, CONTRACTION_RANGE, "-"),
    "angle": (0.0, math.nextafter(0.5 * math.pi, 0.0), ANGLE_RANGE, "rad"),
}
_ROUNDING = 1e-12  # of the length: how much too early a table may end


@dataclass(frozen=True, eq=False)
class Profile:
    """Contraction or angle along the tube, as returned by `checked_profile`."""

    name: str
    """"contraction" or "angle"."""
    length: float
    """Length of the tube, from 0 [m]."""
    function: Callable[[float], Any] | None
    """Function of the position; None for a table."""
    positions: FloatArray
    """Positions of the table, not decreasing; a repeated position is a jump [m]. Empty for a function."""
    values: FloatArray
    """Values of the table."""

    @property
    def knots(self) -> list[float]:
        """Positions inside the tube between which the profile is smooth, as far as known [m]."""
        return [knot for knot in self.positions.tolist() if 0.0 < knot < self.length]

    def on_piece(self, start: float, end: float) -> Callable[[float], float]:
        """Return the profile between two neighbouring knots, that of a table at both ends with the limits from inside.

        The function of the position [m] that is returned raises ParameterError where the value is invalid.
        """
        if self.function is not None:
            return self._call
        place = min(int(np.searchsorted(self.positions, start, side="right")), len(self.positions) - 1)
        left, right = self.positions[place - 1 : place + 1].tolist()
        value, after = self.values[place - 1 : place + 1].tolist()
        low, high, rate = min(value, after), max(value, after), (after - value) / (right - left)
        return lambda position: min(max(value + rate * (position - left), low), high)

    def _call(self, position: float) -> float:
        """Value of the function, checked."""
        low, high, requirement, _ = _RANGES[self.name]
        where = f" at the position {position!r} m"
        try:
            value = self.function(position) if self.function is not None else None
        except Exception as error:  # the caller's function may raise anything
            raise ParameterError(self.name, self.function, f"a function with a value{where}, which raised {error!r}") from error
        if not isinstance(value, float):
            given = np.asarray(value)
            if given.shape != () or given.dtype.kind not in "fiu":
                raise ParameterError(self.name, value, f"one number{where}")
            value = float(given)
        if not low <= value <= high:  # NaN too
            raise ParameterError(self.name, value, requirement + where)
        return value


def checked_profile(name: str, given: Any, length: float) -> Profile:
    """Return "contraction" or "angle" along a tube, from a number, a function of the position [m], or (positions, values).

    Raises:
        ParameterError: If it is none of these, a value is out of range, or the positions do not extend from 0 to the length,
            decrease, or occur more than twice, or twice at an end.
    """
    low, high, requirement, unit = _RANGES[name]
    if callable(given):
        return Profile(name, length, given, np.zeros(0), np.zeros(0))
    if isinstance(given, tuple | list) or (isinstance(given, np.ndarray) and given.ndim > 0):
        if len(given) != 2:
            raise ParameterError(name, given, "a number, a function of the position, or a pair (positions, values)")
        positions = finite_array(f"{name} positions", given[0], (None,), "m")
        values = finite_array(name, given[1], positions.shape, unit)
        if len(positions) < 2 or positions[0] > 0.0 or positions[-1] < length * (1.0 - _ROUNDING):
            raise ParameterError(f"{name} positions", given[0], f"a table of the whole tube, 0 to {length!r} m")
        steps = np.diff(positions)
        twice = steps == 0.0
        if np.any(steps < 0.0) or twice[0] or twice[-1] or np.any(twice[1:] & twice[:-1]):
            raise ParameterError(f"{name} positions", given[0], "increasing; a position repeated inside the tube is a jump")
        if np.any((steps < 1.0 / LARGEST) & ~twice):
            raise ParameterError(f"{name} positions", given[0], f"different by at least {1.0 / LARGEST:g} m, or equal")
    else:
        number = finite_number(name, given, unit)
        positions, values = np.array([0.0, length]), np.array([number, number])
    wrong = np.flatnonzero((values < low) | (values > high))
    if wrong.size:
        where = f" at the position {float(positions[wrong[0]])!r} m"
        raise ParameterError(name, float(values[wrong[0]]), requirement + where)
    return Profile(name, length, None, positions, values)
