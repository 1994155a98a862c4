r"""Fabrication plan: where to pinch, tape or stop a tube so that it becomes a helix.

[Blumenschein 2018] section III-A makes the contraction in steps along the actuator line: narrow pieces of the wall are folded
away and held by tape, or the gaps between stoppers on a pull string close. The plan here is ours. The actuator line of the
uninflated tube, of length :math:`L_a = L_t/\cos\theta`, is divided into periods of length `d`. From the middle of each period a
length :math:`p = (1 - \lambda) d` is taken away (the pinch, or the gap); :math:`\lambda d` remains (the piece between, or the
stopper). The unrolled tube is a sheet, seen from outside; the point at arc length `a` of the line lies on it at

.. math:: x = a\cos\theta, \qquad y = \left(\tfrac{D}{2}\varphi_0 + \sigma a\sin\theta\right) \bmod \pi D

with `x` along the tube to the right, `y` around it, downwards on the drawing, and `sigma` +1 for a right-handed helix, -1 for a
left-handed one. A whole number of periods seldom fits: the spacing is changed to the nearest one with which nothing remains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, choice, finite_array, instance_of, positive_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.helix.design import HelixDesign
from softrobots.helix.shapes import HelixShape, forward, turning_sign
from softrobots.helix.tube import turns

METHODS = ("pinch", "tape", "stoppers")
"""Fold the wall away; fold it and hold it by a piece of tape; or string stoppers with gaps that close."""

_MOST_PERIODS = 20_000
_ROUNDING = 1e-9  # of the line
_STEEPEST = math.radians(89.0)


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
    """Number of crossings of `y = 0` upwards minus those downwards [-]."""


@dataclass(frozen=True, eq=False, repr=False)
class Pattern(Summarised):
    """Plan of the pinches, as returned by `pinch_pattern`; `write_template` draws it, `write_template_table` lists it."""

    contraction: float
    """Contraction of the planned helix, in (0, 1) [-]: remaining length of a period over the period."""
    angle: float
    """Angle of the actuator line to the axis of the tube [rad]."""
    diameter: float
    """Diameter of the tube [m]."""
    tube_length: float
    """Length of the uninflated tube [m]."""
    spacing: float
    """Period `d` along the actuator line, of which a whole number fits [m]."""
    method: str
    """One of `METHODS`."""
    handedness: str
    """"right" or "left"."""
    starts: SheetPoints = field(repr=False)
    """Start of each pinch or gap, n points."""
    ends: SheetPoints = field(repr=False)
    """End of each pinch or gap, n points, which is brought onto its start."""

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
        """Length `lambda d` that remains of a period: between two pinches, or a stopper [m]."""
        return self.contraction * self.spacing

    @property
    def line_length(self) -> float:
        """Length of the whole actuator line on the uninflated tube [m]."""
        return self.tube_length / math.cos(self.angle)

    @property
    def tape_length(self) -> float | None:
        """Length of a piece of tape along the line when the pinch is closed, half on either side; None without tape [m]."""
        return 0.5 * self.remaining_length if self.method == "tape" else None

    @property
    def tape_width(self) -> float | None:
        """Width of a piece of tape across the line; None without tape [m]."""
        return 0.25 * self.diameter if self.method == "tape" else None

    @property
    def sheet_width(self) -> float:
        """Circumference `pi D` of the tube: the width of the unrolled sheet [m]."""
        return math.pi * self.diameter

    @property
    def shape(self) -> HelixShape:
        """The smooth helix that the pattern approximates."""
        return forward(self.contraction, self.angle, self.diameter)

    @property
    def turns(self) -> float:
        """Turns of the smooth helix [-]."""
        return float(turns(self.shape, self.angle, self.tube_length))

    @property
    def stoppers(self) -> FloatArray:
        """Start and end arc length of the remaining pieces, from the base to the tip, shape (n + 1, 2) [m].

        These are the stoppers, or the wall between the pinches. The first and the last are half as long as the others.
        """
        first, last = np.append(0.0, self.ends.arc), np.append(self.starts.arc, self.line_length)
        return read_only(np.stack([first, last], axis=-1))

    def locate(self, arc: Any) -> SheetPoints:
        """Return points of the actuator line on the unrolled tube; see the module.

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
        return _sheet_points(arcs, self.angle, self.diameter, self.handedness)


def checked_pattern(pattern: Any) -> Pattern:
    """Return `pattern` if it is a `Pattern`, or raise ParameterError."""
    return instance_of("pattern", pattern, Pattern, "a Pattern; helix.pinch_pattern(design, spacing) makes one")


def pinch_pattern(design: HelixDesign, spacing: float, method: str = "pinch") -> Pattern:
    """Plan the pinches, tapes or stoppers and gaps along the actuator line; see the module.

    Args:
        design: Actuator and tube, with a contraction below 1 and an angle up to 89 degrees.
        spacing: Period `d` along the actuator line [m]; the nearest one is taken of which a whole number fits. The errors of
            radius and rise fall with its square (`shape_error`). One period may turn the tube by a quarter turn at most.
        method: One of `METHODS`.

    Returns:
        The plan.

    Raises:
        ParameterError: If an argument is out of range, the contraction is 1 (no pinches), the spacing is too wide for the tube
            or so narrow that there are more than 20000 pinches.
    """
    instance_of("design", design, HelixDesign, "a HelixDesign")
    contraction, angle, diameter = design.contraction, design.angle, design.diameter
    if contraction >= 1.0:
        raise ParameterError("contraction", contraction, "below 1: at 1 there is nothing to pinch")
    if angle > _STEEPEST:
        raise ParameterError("angle", angle, f"at most {_STEEPEST:.4f} rad (89 degrees) for a sheet that can be drawn")
    period = positive_number("spacing", spacing, "m")
    choice("method", method, METHODS)
    line = design.tube_length / math.cos(angle)
    widest = 0.5 * math.pi * diameter / (1.0 - contraction + 2.0 * contraction * math.sin(angle))
    if line > _MOST_PERIODS * period:
        raise ParameterError(
            "spacing", spacing, f"at least {line / _MOST_PERIODS:.3g} m, so that there are at most {_MOST_PERIODS} pinches"
        )
    count = max(round(line / period), 1)
    period = line / count
    if period > widest:
        raise ParameterError(
            "spacing", spacing, f"at most {widest:.4g} m, with which a period turns the tube by a quarter turn"
        )
    middles, half = period * (np.arange(count) + 0.5), 0.5 * (1.0 - contraction) * period
    starts, ends = (_sheet_points(np.asarray(middles + side), angle, diameter, design.handedness) for side in (-half, half))
    return Pattern(contraction, angle, diameter, design.tube_length, period, method, design.handedness, starts, ends)


def _sheet_points(arc: FloatArray, angle: float, diameter: float, handedness: str) -> SheetPoints:
    """Points at arc lengths along an actuator line, on the unrolled tube."""
    around = math.pi * diameter
    unrolled = turning_sign(handedness) * math.sin(angle) * arc
    wrap = np.floor(unrolled / around)
    y = unrolled - wrap * around
    wrap = np.where(y >= around, wrap + 1.0, wrap)
    y = np.where((y >= around) | (y < 0.0), 0.0, y)  # rounding at the seam
    x = math.cos(angle) * arc
    arc, x, y = (read_only(np.array(values)) for values in (arc, x, y))
    wraps = wrap.astype(np.int64)
    wraps.setflags(write=False)
    return SheetPoints(arc, x, y, wraps)
