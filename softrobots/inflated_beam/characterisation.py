"""Moment-angle law of an inflated link, the table that the paper measured, and raw data of a bending test from a CSV file."""

from __future__ import annotations

import math
import os
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import LARGEST, FloatArray, common_shape, finite_array, positive_array
from softrobots.core.csv_table import Table, read_table
from softrobots.core.errors import FileFormatError
from softrobots.core.files import as_path
from softrobots.core.units import UNITS as SI_UNITS
from softrobots.inflated_beam.beam import required_pressure
from softrobots.inflated_beam.bending_test import BendingTest

_FEWEST = 3  # points of a bending test


class CharacterisationRow(NamedTuple):
    """One row of [Troise 2021], Table 3 (measured on the prototype link)."""

    pressure: float
    """Gauge pressure [Pa]."""
    stiffness: float
    """Fitted stiffness `k` [N m/rad]."""
    stiffness_std: float
    """Its standard deviation [N m/rad]."""
    max_moment: float | None
    """Mean moment beyond wrinkling [N m]; None where the paper prints N/A."""


TABLE_3 = (
    CharacterisationRow(10e3, 182.56, 3.37, 4.99),
    CharacterisationRow(20e3, 187.30, 1.48, 9.45),
    CharacterisationRow(30e3, 155.89, 2.66, 14.99),
    CharacterisationRow(40e3, 174.42, 6.22, 18.77),
    CharacterisationRow(50e3, 169.44, 5.51, 21.76),
    CharacterisationRow(60e3, 166.66, 4.99, None),
)
"""Characterisation of the prototype link, [Troise 2021] Table 3."""

MEAN_STIFFNESS = 172.71
"""Mean stiffness of the prototype link [N m/rad], as printed in [Troise 2021]; the six rows average 172.7117."""


def required_tabulated_pressure(moment: Any, radius: Any) -> Any:
    """Return the smallest pressure of [Troise 2021] Table 3 whose wrinkling moment is at least `moment`.

    Args:
        moment: Bending moment [N m], zero or positive, a number or an array.
        radius: Tube radius [m], positive, a number or an array that broadcasts with it.

    Returns:
        The pressure [Pa], the common shape. Where the moment exceeds the highest row, infinity; None for a single number.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    exact = required_pressure(moment, radius)
    pressures = np.append([row.pressure for row in TABLE_3], np.inf)
    found = pressures[np.searchsorted(pressures, exact)]
    return found if np.ndim(found) else float(found) if np.isfinite(found) else None


def moment(angle: Any, *, stiffness: Any, max_moment: Any) -> Any:
    """Return the moment of a link bent by an angle: `tau = sign(theta) min(k |theta|, M_max)`, [Troise 2021] section 4.

    Args:
        angle: Hinge angle [rad], a number or an array.
        stiffness: Stiffness `k` [N m/rad], positive, a number or an array that broadcasts.
        max_moment: Saturation moment `M_max` [N m], positive, a number or an array that broadcasts.

    Returns:
        Moment [N m], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    theta = finite_array("angle", angle, None, "rad")
    k, most = positive_array("stiffness", stiffness, "N m/rad"), positive_array("max_moment", max_moment, "N m")
    common_shape("max_moment", common_shape("stiffness", theta.shape, k.shape), most.shape)
    return np.clip(k * theta, -most, most)


UNITS = {
    quantity: {unit: SI_UNITS[kind][unit] for unit in units}
    for quantity, kind, units in (
        ("angle", "angle", ("rad", "mrad", "deg")),
        ("moment", "torque", ("N m", "N mm")),
        ("displacement", "length", ("m", "mm")),
        ("force", "force", ("N",)),
    )
}
"""Quantities of a bending test, with the units that a file may have and what they are in radians, newtons and metres."""

COLUMNS = {
    f"{quantity}{before}{unit.replace(' ', joint)}{after}": (quantity, factor)
    for quantity, units in UNITS.items()
    for unit, factor in units.items()
    for before, joint, after in ((" [", " ", "]"), ("_", "", ""))
}
"""Names of columns with their quantity and factor: "angle [deg]" or "angle_deg", "moment [N m]" or "moment_Nm"."""


class BendingData(NamedTuple):
    """Measured points of a bending test, the arguments of `fit_characterisation`."""

    angle: FloatArray
    """Hinge angles, shape (n,) [rad]."""
    moment: FloatArray
    """Moments at the hinge, shape (n,) [N m]."""


def read_characterisation(path: str | os.PathLike[str], test: BendingTest | None = None) -> BendingData:
    """Read the raw data of a bending test from a CSV file.

    The first line names the columns with their units, of `COLUMNS`: an angle in rad, mrad or deg and a moment in N m or N mm;
    or a displacement of the probe in m or mm and a force in N, from which the geometry of the test gives the angle and the
    moment at the hinge. If all four are there, angle and moment count. Other columns and empty lines are ignored.

    Args:
        path: The file.
        test: Geometry of the test, for displacement and force; that of [Troise 2021] by default, `BendingTest()`.

    Returns:
        The points, in the order of the file.

    Raises:
        ParameterError: If `path` is not a path.
        FileFormatError: If the file cannot be read, lacks a column, has a quantity twice or fewer than three rows of numbers,
            or (naming the line) has a cell that is not a finite number, more or fewer cells than the first line, or an angle
            beyond a right angle.
    """
    file = as_path("path", path)
    table = read_table(file, (), tuple(COLUMNS))
    found = [COLUMNS[name][0] for name in table.columns]
    pair = next((pair for pair in (("angle", "moment"), ("displacement", "force")) if set(pair) <= set(found)), None)
    if pair is None or len(found) > len(set(found)):
        raise FileFormatError(
            f"{file}, line 1: it names {', '.join(table.columns) or 'nothing'} of a bending test; 'angle' and 'moment', or "
            f"'displacement' and 'force' are required, each once and with its unit: {', '.join(COLUMNS)}"
        )
    if len(table.lines) < _FEWEST:
        raise FileFormatError(f"{file} has {len(table.lines)} rows of numbers; at least {_FEWEST} are required")
    first, second = (_column(file, table, quantity) for quantity in pair)
    if pair[0] == "displacement":
        rig = BendingTest() if test is None else test
        first, second = np.asarray(rig.angle(first)), np.asarray(rig.moment(first, second))
    beyond = np.flatnonzero(np.abs(first) >= 0.5 * math.pi)
    if beyond.size:
        place = int(beyond[0])
        raise FileFormatError(
            f"{file}, line {table.lines[place]}: the link is bent by {first[place]:.6g} rad; less than a right angle is "
            "required, in the unit that the first line names"
        )
    return BendingData(first, second)


def _column(file: os.PathLike[str], table: Table, quantity: str) -> FloatArray:
    """Numbers of a quantity in SI units."""
    place = next(place for place, name in enumerate(table.columns) if COLUMNS[name][0] == quantity)
    numbers = table.numbers[:, place] * COLUMNS[table.columns[place]][1]
    large = np.flatnonzero(np.abs(numbers) > LARGEST)
    if large.size:
        line = table.lines[int(large[0])]
        raise FileFormatError(f"{file}, line {line}: {table.columns[place]} must be at most {LARGEST:g} in size")
    return np.asarray(numbers)
