"""Tables of helices with their realisability, and the test grid of the paper.

[Blumenschein 2018] builds helices of a tube of 3.31 cm at actuator angles of 2.5, 5 and 10 degrees and contractions from 0.5 to
0.9 (section III-B and Figure 7; the steps of 0.1 are ours), and one at 5 degrees and 0.66 a second time, 2.5 times as large.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import read_only
from softrobots.core.files import csv_text, write_text
from softrobots.helix.contact import self_contact
from softrobots.helix.shapes import Actuator, checked_actuator, forward

PAPER_ANGLES = tuple(float(np.radians(degrees)) for degrees in (2.5, 5.0, 10.0))
"""Actuator angles of the paper's tests [rad]."""

PAPER_CONTRACTIONS = (0.5, 0.6, 0.7, 0.8, 0.9)
"""Contractions that cover the range of the paper's tests [-]."""

PAPER_DIAMETER = 0.0331
"""Diameter of the tube in the paper's tests [m]."""

PAPER_SCALED = Actuator(
    *(read_only(np.array(values)) for values in (0.66, PAPER_ANGLES[1], (PAPER_DIAMETER, 2.5 * PAPER_DIAMETER)))
)
"""The helix that the paper builds in two sizes."""


@dataclass(frozen=True)
class ShapeRow:
    """Row of a table: one helix."""

    angle: float
    """Angle `theta` of the actuator to the axis of the tube [rad]."""
    contraction: float
    """Contracted over original length of the actuator `lambda` [-]."""
    diameter: float
    """Diameter `D` of the tube [m]."""
    outer_radius: float
    """Radius `Ro` of the path opposite the actuator [m]."""
    inner_radius: float
    """Radius `Ri` of the actuator's path [m]; negative beyond the axis of the helix."""
    pitch: float
    """Normalised pitch `b` [m/rad]."""
    turn_distance: float | None
    """Distance of the centre lines of neighbouring turns [m]; None for a helix so steep that it has none."""
    realisable: bool
    """Whether an endless tube is free of self-contact; exact."""
    realisable_by_simple_rule: bool
    """Whether a turn rises by at least a diameter, `2 pi b >= D`."""


@dataclass(frozen=True)
class ShapeTable:
    """Table of helices, one per row."""

    rows: tuple[ShapeRow, ...]
    """The rows, in the order of the arguments."""

    def as_rows(self) -> list[dict[str, float | bool | None]]:
        """Return one dictionary per helix, from column to value, in SI units."""
        return [{name: getattr(row, name) for name in _COLUMNS} for row in self.rows]

    def write_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the table as CSV in full precision: the fields of `ShapeRow` with units, `true` or `false`, empty for None.

        Args:
            path: File to write.
            overwrite: Replace an existing file.

        Returns:
            The path of the file.

        Raises:
            ParameterError: If `path` is not a path.
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If the file cannot be written.
        """
        names = [f"{name} [{unit}]" if unit else name for name, unit in _COLUMNS.items()]
        rows = (["" if value is None else repr(value).lower() for value in row.values()] for row in self.as_rows())
        return write_text(path, csv_text(names, rows), overwrite=overwrite)


_UNITS = ("rad", "-", "m", "m", "m", "m/rad", "m", "", "")
_COLUMNS = {field.name: unit for field, unit in zip(fields(ShapeRow), _UNITS, strict=True)}


def shape_table(contraction: Any, angle: Any, diameter: Any) -> ShapeTable:
    """Return the helices of actuators with their realisability.

    Args:
        contraction: Contracted over original length of the actuator `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].

    Returns:
        One row for each element of the broadcast arguments, the last axis fastest.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
        StraightTube: At contraction 1 and angle 0, where no helix exists.
    """
    contractions, angles, diameters = np.broadcast_arrays(*checked_actuator(contraction, angle, diameter))
    shape = forward(contractions, angles, diameters)
    contact = self_contact(shape)
    turn_distance = contact.turn_distance.astype(object)
    turn_distance[~contact.has_neighbours] = None
    radii, by_rule = (shape.outer_radius, shape.inner_radius), shape.turn_height >= diameters
    columns = (angles, contractions, diameters, *radii, shape.pitch, turn_distance, ~contact.touches, by_rule)
    return ShapeTable(tuple(ShapeRow(*values) for values in zip(*(column.ravel().tolist() for column in columns), strict=True)))


def paper_grid() -> ShapeTable:
    """Return the helices of the paper: three angles by five contractions, then one helix in two sizes, `PAPER_SCALED`."""
    grid = shape_table(PAPER_CONTRACTIONS, np.array(PAPER_ANGLES)[:, None], PAPER_DIAMETER)
    return ShapeTable(grid.rows + shape_table(*PAPER_SCALED).rows)
