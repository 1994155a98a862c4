r"""Fabrication plan: where to pinch, tape or stop a tube so that it becomes a helix.

[Blumenschein 2018] section III-A makes the contraction in steps along the actuator line: narrow pieces of the wall are folded
away and held by tape, or the gaps between stoppers on a pull string close. The plan here is ours. The actuator line of the
uninflated tube, of length :math:`L_a = L_t/\cos\theta`, is divided into periods of length `d`. From the middle of each period a
length :math:`p = (1 - \lambda) d` is taken away (the pinch, or the gap); :math:`\lambda d` remains (the piece between, or the
stopper). The unrolled tube is a sheet, seen from outside; the point at arc length `a` of the line lies on it at

.. math:: x = a\cos\theta, \qquad y = \left(\tfrac{D}{2}\varphi_0 + \sigma a\sin\theta\right) \bmod \pi D

with `x` along the tube to the right, `y` around it, downwards on the drawing, and `sigma` +1 for a right-handed helix, -1 for a
left-handed one. A whole number of periods seldom fits: the remainder is left plain at the tip, or divided between both ends, or
the spacing is changed so that nothing remains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, choice, finite_array, finite_number, listed, positive_number, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Summarised
from softrobots.helix.design import HelixDesign
from softrobots.helix.shapes import HANDEDNESS, HelixShape, checked_actuator, forward, turning_sign
from softrobots.helix.tube import turns

METHODS = ("pinch", "tape", "stoppers")
"""Fold the wall away; fold it and hold it by a piece of tape; or string stoppers with gaps that close."""

REMAINDERS = ("end", "both", "respace")
"""Use of the length in which no whole period fits: plain at the tip, plain at both ends, or spread by another spacing."""

_MOST_PERIODS = 20_000
_ROUNDING = 1e-9  # of a period or of the line
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
    def resulting_contraction(self) -> float:
        """Contraction of the whole line, above `contraction` if there are plain ends [-]."""
        return 1.0 - self.count * self.pinch_length / self.line_length

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
        """Turns of the smooth helix over the periods, without the plain ends [-]."""
        return float(turns(self.shape, self.angle, self.count * self.spacing * math.cos(self.angle)))

    @property
    def stoppers(self) -> FloatArray:
        """Start and end arc length of the remaining pieces, from the base to the tip, shape (n + 1, 2) [m].

        These are the stoppers, or the wall between the pinches. The first and the last are half as long as the others and
        contain the plain ends.
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
        return _sheet_points(arcs, self.angle, self.diameter, self.handedness, self.start_azimuth)


def checked_pattern(pattern: Any) -> Pattern:
    """Return `pattern` if it is a `Pattern`, or raise ParameterError."""
    if not isinstance(pattern, Pattern):
        raise ParameterError("pattern", pattern, "a Pattern; helix.pinch_pattern(design, spacing) makes one of a HelixDesign")
    return pattern


def pinch_pattern(
    actuator: HelixDesign | tuple[float, float, float, float],
    spacing: float,
    method: str = "pinch",
    *,
    handedness: str | None = None,
    remainder: str = "end",
    start_azimuth: float = 0.0,
    tape_length: float | None = None,
    tape_width: float | None = None,
) -> Pattern:
    """Plan the pinches, tapes or stoppers and gaps along the actuator line; see the module.

    Args:
        actuator: A design, or contraction in (0, 1) [-], angle up to 89 degrees [rad], diameter and length of the tube [m].
        spacing: Period `d` along the actuator line [m]. The errors of radius and rise fall with its square (`shape_error`). One
            period may turn the tube by a quarter turn at most.
        method: One of `METHODS`.
        handedness: "right" or "left"; None for that of the design, or "right".
        remainder: One of `REMAINDERS`: where a whole number of periods does not fit, "end" leaves the remainder plain at the
            tip, "both" half of it at each end, and "respace" takes the nearest spacing that fits.
        start_azimuth: Azimuth of the start of the line, from the fold at `y = 0`, any number [rad].
        tape_length: Length of a piece of tape on the closed pinch, at most `lambda d`; None for half of that [m].
        tape_width: Width of a piece of tape, at most half the circumference; None for a quarter of the diameter [m].

    Returns:
        The plan.

    Raises:
        ParameterError: If an argument is out of range, the contraction is 1 (no pinches), the spacing is too wide for the tube
            or so narrow that there are more than 20000 pinches, or tape is given for another method.
    """
    contraction, angle, diameter, length, hand = _checked(actuator, handedness)
    period = positive_number("spacing", spacing, "m")
    azimuth = finite_number("start_azimuth", start_azimuth, "rad") % (2.0 * math.pi)
    choice("method", method, METHODS)
    choice("remainder", remainder, REMAINDERS)
    line = length / math.cos(angle)
    widest = 0.5 * math.pi * diameter / (1.0 - contraction + 2.0 * contraction * math.sin(angle))
    whole = line / period
    if whole > _MOST_PERIODS:
        raise ParameterError(
            "spacing", spacing, f"at least {line / _MOST_PERIODS:.3g} m, so that there are at most {_MOST_PERIODS} pinches"
        )
    count = max(round(whole), 1) if remainder == "respace" else math.floor(whole + _ROUNDING)
    if remainder == "respace":
        period = line / count
    if period > widest:
        raise ParameterError(
            "spacing", spacing, f"at most {widest:.4g} m, with which a period turns the tube by a quarter turn"
        )
    if count < 1:
        raise ParameterError("spacing", spacing, f"at most the length {line:.4g} m of the actuator line")
    rest = line - count * period
    rest = 0.0 if rest < _ROUNDING * period else rest
    plain = 0.5 * rest if remainder == "both" else 0.0
    pinch = (1.0 - contraction) * period
    tape = _checked_tape(method, tape_length, tape_width, contraction * period, diameter)
    middles = plain + period * (np.arange(count) + 0.5)
    starts, ends = (
        _sheet_points(np.asarray(middles + 0.5 * side * pinch), angle, diameter, hand, azimuth) for side in (-1.0, 1.0)
    )
    return Pattern(
        contraction, angle, diameter, length, period, method, hand, remainder, azimuth, plain, rest - plain, *tape, starts, ends
    )


def _sheet_points(arc: FloatArray, angle: float, diameter: float, handedness: str, azimuth: float) -> SheetPoints:
    """Points at arc lengths along an actuator line that starts at an azimuth, on the unrolled tube."""
    around = math.pi * diameter
    unrolled = 0.5 * diameter * azimuth + turning_sign(handedness) * math.sin(angle) * arc
    wrap = np.floor(unrolled / around)
    y = unrolled - wrap * around
    wrap = np.where(y >= around, wrap + 1.0, wrap)
    y = np.where((y >= around) | (y < 0.0), 0.0, y)  # rounding at the seam
    x = math.cos(angle) * arc
    arc, x, y = (read_only(np.array(values)) for values in (arc, x, y))
    wraps = wrap.astype(np.int64)
    wraps.setflags(write=False)
    return SheetPoints(arc, x, y, wraps)


def _checked(actuator: Any, handedness: str | None) -> tuple[float, float, float, float, str]:
    """Contraction, angle, diameter, tube length and handedness."""
    if isinstance(actuator, HelixDesign):
        numbers: Any = (actuator.contraction, actuator.angle, actuator.diameter, actuator.tube_length)
        default = actuator.handedness
    else:
        default = "right"
        numbers = listed("actuator", actuator, 4, "a HelixDesign, or (contraction, angle, diameter, length of the tube)")
    contraction, angle = finite_number("contraction", numbers[0], "-"), finite_number("angle", numbers[1], "rad")
    diameter, length = finite_number("diameter", numbers[2], "m"), finite_number("length", numbers[3], "m")
    checked_actuator(contraction, angle, diameter)
    if contraction >= 1.0:
        raise ParameterError("contraction", contraction, "below 1: at 1 there is nothing to pinch")
    if angle > _STEEPEST:
        raise ParameterError("angle", angle, f"at most {_STEEPEST:.4f} rad (89 degrees) for a sheet that can be drawn")
    positive_number("length", length, "m")
    return contraction, angle, diameter, length, choice("handedness", default if handedness is None else handedness, HANDEDNESS)


def _checked_tape(
    method: str, length: float | None, width: float | None, remaining: float, diameter: float
) -> tuple[float | None, float | None]:
    """Length and width of the pieces of tape, both None for the other methods."""
    if method != "tape":
        for name, value in (("tape_length", length), ("tape_width", width)):
            if value is not None:
                raise ParameterError(name, value, f"None where the method is {method!r}; only 'tape' uses it")
        return None, None
    long = positive_number("tape_length", 0.5 * remaining if length is None else length, "m")
    wide = positive_number("tape_width", 0.25 * diameter if width is None else width, "m")
    if long > remaining:
        raise ParameterError("tape_length", length, f"at most {remaining:.4g} m, the remaining length of a period")
    if wide > 0.5 * math.pi * diameter:
        raise ParameterError("tape_width", width, f"at most half the circumference, {0.5 * math.pi * diameter:.4g} m")
    return long, wide
