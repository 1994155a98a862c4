"""Contraction of the actuator: of a pneumatic muscle by its pressure, from a measured table, and of a string with stoppers.

The inverse pneumatic muscle of [Blumenschein 2018] lengthens with pressure, so its contraction `lambda` (contracted over
original length) rises towards 1; a contracting muscle has a falling table. The paper says that such a mapping must be measured
and publishes none: the table, its CSV file and the interpolation are ours.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import (
    LARGEST,
    FloatArray,
    common_shape,
    finite_array,
    non_negative_array,
    positive_array,
    read_only,
)
from softrobots.core.csv_table import read_table
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import as_path
from softrobots.core.summary import Summarised
from softrobots.helix.shapes import checked_contraction

_COLUMNS = ("pressure_Pa", "contraction")


@dataclass(frozen=True, eq=False, repr=False)
class ActuatorTable(Summarised):
    """Contraction of an actuator measured at some pressures: straight between them, an error outside their range.

    Raises:
        ParameterError: If there are fewer than two rows, a number is not finite, the pressures do not increase, a contraction
            is not in (0, 1], the contractions neither rise throughout nor fall throughout.
    """

    pressure: FloatArray
    """Gauge pressures, increasing, shape (n,) [Pa]; negative ones are vacuum."""
    contraction: FloatArray
    """Contracted over original length `lambda` at each of them, in (0, 1], strictly rising or falling, shape (n,) [-]."""

    def __post_init__(self) -> None:
        """Check and freeze the columns."""
        pressures = finite_array("pressure", self.pressure, (None,), "Pa")
        if len(pressures) < 2:
            raise ParameterError("pressure", self.pressure, "at least two rows [Pa]")
        if np.any(np.diff(pressures) < 1.0 / LARGEST):
            raise ParameterError("pressure", self.pressure, f"increasing, by at least {1.0 / LARGEST:g} Pa a row")
        contractions = checked_contraction(self.contraction)
        if contractions.shape != pressures.shape:
            raise ParameterError("contraction", self.contraction, f"of the shape {pressures.shape} of the pressures")
        steps = np.diff(contractions)
        if not (np.all(steps > 0.0) or np.all(steps < 0.0)):
            raise ParameterError("contraction", self.contraction, "strictly rising or strictly falling with the pressure")
        object.__setattr__(self, "pressure", read_only(pressures))
        object.__setattr__(self, "contraction", read_only(contractions))

    @classmethod
    def read_csv(cls, path: str | os.PathLike[str]) -> ActuatorTable:
        """Read a table from a CSV file whose first line names the columns `pressure_Pa` and `contraction`.

        Other columns and empty lines are ignored.

        Args:
            path: The file.

        Returns:
            The table.

        Raises:
            ParameterError: If `path` is not a path.
            FileFormatError: If the file cannot be read, lacks a column or has it twice, has fewer than two rows, or (naming the
                line) has a cell that is not a finite number, more or fewer cells than the first line, a pressure not above the
                previous one, or a contraction outside (0, 1] or not monotone.
        """
        file = as_path("path", path)
        table = read_table(file, _COLUMNS)
        rows = table.numbers.tolist()
        for place, line in enumerate(table.lines):
            _check_row(f"{file}, line {line}", rows, place)
        if len(rows) < 2:
            raise FileFormatError(f"{file} has {len(rows)} rows of numbers; at least two are required")
        try:
            return cls(table.numbers[:, 0], table.numbers[:, 1])
        except ParameterError as error:  # numbers too large or too small, rows too close together
            raise FileFormatError(f"{file}: {error}") from error

    @property
    def pressure_limits(self) -> tuple[float, float]:
        """Lowest and highest measured pressure [Pa]."""
        return float(self.pressure[0]), float(self.pressure[-1])

    @property
    def contraction_limits(self) -> tuple[float, float]:
        """Smallest and largest measured contraction [-]."""
        return float(self.contraction.min()), float(self.contraction.max())

    def contraction_at(self, pressure: Any) -> FloatArray:
        """Return the contraction at a pressure, interpolated between the rows.

        Args:
            pressure: Gauge pressure within `pressure_limits`, shape (...) [Pa].

        Returns:
            Contraction, shape (...) [-].

        Raises:
            ParameterError: If a pressure is not finite or beyond the limits.
        """
        pressures = _within("pressure", pressure, self.pressure_limits, "Pa")
        contractions = np.interp(pressures, self.pressure, self.contraction)
        return np.asarray(np.clip(contractions, *self.contraction_limits))  # rounding must not leave the table

    def pressure_for(self, contraction: Any) -> FloatArray:
        """Return the pressure for a contraction: the inverse of `contraction_at`.

        Args:
            contraction: Contraction within `contraction_limits`, shape (...) [-].

        Returns:
            Gauge pressure, shape (...) [Pa].

        Raises:
            ParameterError: If a contraction is not finite or beyond the limits.
        """
        contractions = _within("contraction", contraction, self.contraction_limits, "-")
        rising = self.contraction[-1] > self.contraction[0]
        known = (self.pressure, self.contraction) if rising else (self.pressure[::-1], self.contraction[::-1])
        return np.asarray(np.clip(np.interp(contractions, known[1], known[0]), *self.pressure_limits))


def contraction_from_stoppers(stopper: Any, gap: Any) -> FloatArray:
    r"""Return the contraction of a pull string whose gaps have closed: [Blumenschein 2018] section III-A.2.

    .. math:: \lambda = \frac{\text{stopper}}{\text{stopper} + \text{gap}}

    Args:
        stopper: Length of a stopper, positive [m].
        gap: Length of a gap on the uninflated tube, zero or positive [m].

    Returns:
        Contraction, the common shape [-].

    Raises:
        ParameterError: If a length is out of range or the shapes do not broadcast.
    """
    stoppers, gaps = positive_array("stopper", stopper, "m"), non_negative_array("gap", gap, "m")
    common_shape("gap", stoppers.shape, gaps.shape)
    return np.asarray(stoppers / (stoppers + gaps))


def _within(name: str, value: Any, limits: tuple[float, float], unit: str) -> FloatArray:
    values = finite_array(name, value, None, unit)
    if np.any(values < limits[0]) or np.any(values > limits[1]):
        raise ParameterError(name, value, f"within the measured table, {limits[0]!r} to {limits[1]!r} [{unit}]")
    return values


def _check_row(where: str, rows: Sequence[Sequence[float]], place: int) -> None:
    """Raise FileFormatError if a row is out of range or does not continue the rows before it."""
    pressure, contraction = rows[place]
    if not 0.0 < contraction <= 1.0:
        raise FileFormatError(f"{where}: contraction = {contraction!r}; a number in (0, 1] is required")
    if place == 0:
        return
    before = rows[place - 1]
    if pressure <= before[0]:
        raise FileFormatError(f"{where}: pressure_Pa = {pressure!r}; more than {before[0]!r}, the row before, is required")
    if contraction == before[1]:
        raise FileFormatError(f"{where}: contraction = {contraction!r} as in the row before; a change is required")
    if (contraction > before[1]) != (rows[1][1] > rows[0][1]):
        raise FileFormatError(
            f"{where}: contraction = {contraction!r} turns back; rising throughout or falling throughout is required"
        )
