"""The plan of a pinched tube: what is taken away where along the actuator line.

Made by `softrobots.helix.pinch_pattern`, whose module tells how the line is divided and where it lies on the unrolled tube.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import ParameterError
from softrobots.helix.shapes import HelixShape, forward, turning_sign
from softrobots.helix.tube import turns

_ROUNDING = 1e-9  # of the line


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
    """A plan for making a helix: made by `pinch_pattern`, drawn by `write_template`, listed by `write_template_table`."""

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


def checked_pattern(pattern: Any) -> Pattern:
    """Return `pattern` if it is a `Pattern`.

    Raises:
        ParameterError: If it is something else.
    """
    if not isinstance(pattern, Pattern):
        raise ParameterError("pattern", pattern, "a Pattern (made by helix.pinch_pattern)")
    return pattern


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
