"""The plan of a pinched tube: what is taken away where along the actuator line, and its drawing and table.

Made by `softrobots.helix.pinch_pattern`, whose module tells how the line is divided and where it lies on the unrolled tube.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.checks import FloatArray, finite_array, positive_number, read_only
from softrobots.errors import ParameterError
from softrobots.files import as_path, new_file, write_atomically
from softrobots.helix.shapes import HelixShape, forward, turning_sign
from softrobots.helix.template import Window, csv_text, svg_text
from softrobots.helix.tube import turns

_ROUNDING = 1e-9  # of a page, or of the line
_THINNEST, _THICKEST, _LONGEST = 1e-3, 10.0, 200.0  # tubes that are drawn [m]
_MOST_PAGES = 500


@dataclass(frozen=True, eq=False)
class SheetPoints:
    """Points of the actuator line on the unrolled tube, shape (n,) each, read-only."""

    arc: FloatArray
    """Arc length along the actuator line of the uninflated tube, from the base [m]."""
    x: FloatArray
    """Along the axis of the tube, from the base [m]."""
    y: FloatArray
    """Around the tube, in [0, pi D) [m]."""
    wrap: NDArray[np.int64]
    """How often the line has passed `y = 0` upwards, less how often downwards [-]."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """A plan for making a helix: made by `pinch_pattern`, drawn by `write_svg`, listed by `write_csv`."""

    contraction: float
    """Contraction that is wanted, in (0, 1) [-]: what stays of a period over the period."""
    angle: float
    """Angle of the actuator line to the axis of the tube [rad]."""
    diameter: float
    """Diameter of the tube [m]."""
    tube_length: float
    """Length of the uninflated tube [m]."""
    spacing: float
    """Period `d` along the actuator line, after any respacing [m]."""
    method: str
    """One of `METHODS`."""
    handedness: str
    """"right" or "left"."""
    remainder: str
    """One of `REMAINDERS`."""
    start_azimuth: float
    """Where around the tube the line starts, `y = azimuth D/2` [rad]."""
    plain_start: float
    """Arc length before the first period that is left plain [m]."""
    plain_end: float
    """Arc length after the last period that is left plain [m]."""
    tape_length: float | None
    """Length of a piece of tape along the line when the pinch is closed, half of it on either side; None without tape [m]."""
    tape_width: float | None
    """Width of a piece of tape across the line; None without tape [m]."""
    starts: SheetPoints = field(repr=False)
    """Where each pinch or gap starts, n points."""
    ends: SheetPoints = field(repr=False)
    """Where each pinch or gap ends, n points: this is brought onto the start."""

    @property
    def count(self) -> int:
        """Number of pinches, or gaps."""
        return len(self.starts.arc)

    @property
    def pinch_length(self) -> float:
        """Length `p = (1 - lambda) d` that a pinch or a gap takes away [m]."""
        return (1.0 - self.contraction) * self.spacing

    @property
    def remaining_length(self) -> float:
        """Length `lambda d` that stays of a period: between two pinches, or a stopper [m]."""
        return self.contraction * self.spacing

    @property
    def line_length(self) -> float:
        """Length of the whole actuator line on the uninflated tube [m]."""
        return self.tube_length / math.cos(self.angle)

    @property
    def resulting_contraction(self) -> float:
        """Contraction of the whole line, plain ends included: above the wanted one where there are some [-]."""
        return 1.0 - self.count * self.pinch_length / self.line_length

    @property
    def sheet_width(self) -> float:
        """Circumference `pi D` of the tube: the width of the unrolled sheet [m]."""
        return math.pi * self.diameter

    @property
    def shape(self) -> HelixShape:
        """The smooth helix that is wanted."""
        return forward(self.contraction, self.angle, self.diameter)

    @property
    def turns(self) -> float:
        """Turns that the smooth helix makes over the periods, plain ends not counted [-]."""
        return float(turns(self.shape, self.angle, self.count * self.spacing * math.cos(self.angle)))

    @property
    def stoppers(self) -> FloatArray:
        """Start and end arc length of what stays, from the base to the tip, shape (n + 1, 2) [m].

        The stoppers, or the wall between the pinches. The first and the last are half as long as the others and contain the
        plain ends.
        """
        first, last = np.append(0.0, self.ends.arc), np.append(self.starts.arc, self.line_length)
        return read_only(np.stack([first, last], axis=-1))

    def locate(self, arc: Any) -> SheetPoints:
        """Where points of the actuator line lie on the unrolled tube; see the module.

        Args:
            arc: Arc lengths along the line, from 0 to `line_length`, any shape [m].

        Returns:
            The points, of that shape.

        Raises:
            ParameterError: If a number is not finite or not on the line.
        """
        arcs, rounding = finite_array("arc", arc, None, "m"), _ROUNDING * self.line_length
        if np.any(arcs < -rounding) or np.any(arcs > self.line_length + rounding):
            raise ParameterError("arc", arc, f"from 0 to the length of the line, {self.line_length} m")
        return located(arcs, self.angle, self.diameter, self.handedness, self.start_azimuth)

    def write_svg(self, path: str | os.PathLike[str], overwrite: bool = False) -> Path:
        """Draw the unrolled tube to scale, on one sheet: see `softrobots.helix.template`.

        Args:
            path: File to write.
            overwrite: Replace an existing file.

        Returns:
            The path of the file.

        Raises:
            ParameterError: If the path is none, or the tube is thinner than 1 mm, thicker than 10 m or longer than 200 m.
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If the file cannot be written.
        """
        self._check_drawable()
        return _written(path, svg_text(self, Window(0.0, 1e3 * self.tube_length)), overwrite)

    def write_svg_pages(
        self, path: str | os.PathLike[str], page_length: float = 0.25, overlap: float = 0.02, overwrite: bool = False
    ) -> tuple[Path, ...]:
        """Draw the unrolled tube to scale, on pages that are glued together; neighbours overlap and share a join line.

        Args:
            path: Name of the files, to which the page number is added: `tube.svg` gives `tube-1.svg`, `tube-2.svg`, ...
            page_length: Length of the tube on a page; 0.25 m fits A4 lying [m].
            overlap: How much of it is on the next page again, at most half [m].
            overwrite: Replace existing files.

        Returns:
            The paths of the files.

        Raises:
            ParameterError: If the path is none, a length is out of range, there would be more than 500 pages, or the tube is
                as in `write_svg`.
            OutputExists: If one of the files exists and `overwrite` is false; then none is written.
            OutputError: If a file cannot be written.
        """
        page, common = 1e3 * positive_number("page_length", page_length, "m"), 1e3 * positive_number("overlap", overlap, "m")
        self._check_drawable()
        length = 1e3 * self.tube_length
        if common > 0.5 * page:
            raise ParameterError("overlap", overlap, f"at most half the page length {page_length} m")
        step, base = page - common, as_path("path", path)
        if not base.name:
            raise ParameterError("path", path, "a file name, to which page numbers are added")
        if length > step * _MOST_PAGES:
            raise ParameterError(
                "page_length", page_length, f"such that {_MOST_PAGES} pages are enough for {self.tube_length} m"
            )
        count = max(1, math.ceil((length - common) / step - _ROUNDING))
        digits = len(str(count))
        targets = [
            new_file(base.with_name(f"{base.stem}-{n + 1:0{digits}}{base.suffix}"), overwrite=overwrite) for n in range(count)
        ]
        joins = [step * n + 0.5 * common for n in range(1, count)]  # in the middle of what two pages share
        for n, target in enumerate(targets):
            window = Window(step * n, min(step * n + page, length), n + 1, count, tuple(joins[max(n - 1, 0) : n + 1]))
            _written(target, svg_text(self, window), overwrite)
        return tuple(targets)

    def write_csv(self, path: str | os.PathLike[str], overwrite: bool = False) -> Path:
        """List what to mark along the actuator line, in millimetres.

        Columns: `number`; `kind` ("pinch", "tape", "gap" or "stopper"); `start_mm`, `end_mm`, `length_mm` along the line of the
        uninflated tube; and for start and end `x_mm` along the tube, `y_mm` around it and `wrap`, as in `SheetPoints`.

        Args:
            path: File to write.
            overwrite: Replace an existing file.

        Returns:
            The path of the file.

        Raises:
            ParameterError: If the path is none.
            OutputExists: If the file exists and `overwrite` is false.
            OutputError: If the file cannot be written.
        """
        return _written(path, csv_text(self), overwrite)

    def _check_drawable(self) -> None:
        """Refuse a tube that is no tube on a bench."""
        if not _THINNEST <= self.diameter <= _THICKEST:
            raise ParameterError("diameter", self.diameter, f"from {_THINNEST} to {_THICKEST} m for a drawing")
        if self.tube_length > _LONGEST:
            raise ParameterError("tube_length", self.tube_length, f"at most {_LONGEST} m for a drawing")


def checked_pattern(pattern: Any) -> Pattern:
    """Return `pattern` if it is a `Pattern`.

    Raises:
        ParameterError: If it is something else.
    """
    if not isinstance(pattern, Pattern):
        raise ParameterError("pattern", pattern, "a Pattern (made by helix.pinch_pattern)")
    return pattern


def _written(path: str | os.PathLike[str], text: str, overwrite: bool) -> Path:
    """Write a text file."""
    target = new_file(path, overwrite=overwrite)
    write_atomically(target, lambda file: file.write(text.encode()))
    return target


def located(arc: FloatArray, angle: float, diameter: float, handedness: str, azimuth: float) -> SheetPoints:
    """Points of an actuator line on the unrolled tube; see `softrobots.helix.fabrication`.

    Args:
        arc: Arc lengths along the line, any shape [m].
        angle: Angle of the line to the axis [rad].
        diameter: Diameter of the tube [m].
        handedness: "right" or "left".
        azimuth: Where around the tube the line starts [rad].

    Returns:
        The points, of the shape of `arc`.
    """
    around = math.pi * diameter
    unrolled = 0.5 * diameter * azimuth + turning_sign(handedness) * math.sin(angle) * arc
    wrap = np.floor(unrolled / around)
    y = unrolled - wrap * around
    wrap = np.where(y >= around, wrap + 1.0, wrap)
    y = np.where((y >= around) | (y < 0.0), 0.0, y)  # what rounding makes of the seam
    x = math.cos(angle) * arc
    arc, x, y = (read_only(np.array(values, dtype=np.float64)) for values in (arc, x, y))
    wraps = wrap.astype(np.int64)
    wraps.setflags(write=False)
    return SheetPoints(arc, x, y, wraps)
