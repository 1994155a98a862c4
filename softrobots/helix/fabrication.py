r"""Where to pinch, tape or stop a tube so that it becomes a helix: positions on the tube before it is inflated.

[Blumenschein 2018] section III-A makes the contraction in steps along the actuator line: narrow pieces of the wall are folded
away and held by tape, or the gaps between stoppers on a pull string close. The plan here is ours. The actuator line, of length
:math:`L_a = L_t/\cos\theta`, is divided into periods of length `d`. In the middle of each, :math:`p = (1 - \lambda) d` is taken
away (the pinch, or the gap); :math:`\lambda d` stays (the piece between, or the stopper). The unrolled tube is a sheet, seen
from outside; the point at the arc length `a` of the line lies on it at

.. math:: x = a\cos\theta, \qquad y = \left(\tfrac{D}{2}\varphi_0 + \sigma a\sin\theta\right) \bmod \pi D

with `x` along the tube to the right, `y` around it, downwards on the drawing, and `sigma` +1 for a right-handed helix, -1 for a
left-handed one. A whole number of periods seldom fits: the rest is left plain at the tip, or divided between both ends, or the
spacing is changed so that none is left.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import (
    FloatArray,
    choice,
    common_shape,
    finite_number,
    listed,
    non_negative_array,
    positive_array,
    positive_number,
)
from softrobots.core.errors import ParameterError
from softrobots.helix.helix_design import HelixDesign
from softrobots.helix.pattern import Pattern, located
from softrobots.helix.shapes import HANDEDNESS, checked_actuator, checked_contraction

METHODS = ("pinch", "tape", "stoppers")
"""Fold the wall away; fold it and hold it by a piece of tape; or string stoppers with gaps that close."""

REMAINDERS = ("end", "both", "respace")
"""What becomes of the length where no whole period fits: plain at the tip, plain at both ends, or spread by another spacing."""

MOST_PERIODS = 20_000
"""Patterns with more pinches are refused."""

_ROUNDING = 1e-9  # of a period: a rest shorter than this is none
_STEEPEST = math.radians(89.0)


def contraction_from_stoppers(stopper: Any, gap: Any) -> FloatArray:
    r"""Contraction of a pull string whose gaps have closed: [Blumenschein 2018] section III-A.2.

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


def gap_for(contraction: Any, stopper: Any) -> FloatArray:
    """Gap between stoppers for a contraction: the inverse of `contraction_from_stoppers`.

    Args:
        contraction: Contracted over original length, in (0, 1] [-].
        stopper: Length of a stopper, positive [m].

    Returns:
        Gap, the common shape [m].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    shares, stoppers = checked_contraction(contraction), positive_array("stopper", stopper, "m")
    common_shape("stopper", shares.shape, stoppers.shape)
    return np.asarray(stoppers * (1.0 - shares) / shares)


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
    """Plan of the pinches, tapes or stoppers and gaps along the actuator line; see the module.

    Args:
        actuator: A design, or contraction in (0, 1) [-], angle up to 89 degrees [rad], diameter and length of the tube [m].
        spacing: Period `d` along the actuator line [m]. The errors of radius and rise fall with its square (`shape_error`). One
            period may turn the tube by a quarter turn at most.
        method: One of `METHODS`.
        handedness: "right" or "left"; None for that of the design, or "right".
        remainder: One of `REMAINDERS`: where a whole number of periods does not fit, "end" leaves the rest plain at the tip,
            "both" half of it at each end, and "respace" takes the nearest spacing that fits.
        start_azimuth: Where around the tube the line starts, from the fold at `y = 0`, any number [rad].
        tape_length: Length of a piece of tape on the closed pinch, at most what stays of a period; None for half of that [m].
        tape_width: Width of a piece of tape, at most half the circumference; None for a quarter of the diameter [m].

    Returns:
        The plan.

    Raises:
        ParameterError: If an argument is out of range, nothing is to be pinched (contraction 1), the spacing is too wide for
            the tube or so narrow that there are more than 20000 pinches, or tape is spoken of where there is none.
    """
    contraction, angle, diameter, length, hand = _checked(actuator, handedness)
    period = positive_number("spacing", spacing, "m")
    azimuth = finite_number("start_azimuth", start_azimuth, "rad") % (2.0 * math.pi)
    choice("method", method, METHODS)
    choice("remainder", remainder, REMAINDERS)
    line = length / math.cos(angle)
    widest = 0.5 * math.pi * diameter / (1.0 - contraction + 2.0 * contraction * math.sin(angle))
    whole = line / period
    if whole > MOST_PERIODS:
        raise ParameterError(
            "spacing", spacing, f"at least {line / MOST_PERIODS:.3g} m: at most {MOST_PERIODS} pinches are planned"
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
    starts, ends = (located(np.asarray(middles + 0.5 * side * pinch), angle, diameter, hand, azimuth) for side in (-1.0, 1.0))
    return Pattern(
        contraction, angle, diameter, length, period, method, hand, remainder, azimuth, plain, rest - plain, *tape, starts, ends
    )


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
    """Length and width of the pieces of tape, or twice None."""
    if method != "tape":
        for name, value in (("tape_length", length), ("tape_width", width)):
            if value is not None:
                raise ParameterError(name, value, f"None where the method is {method!r}; only 'tape' uses it")
        return None, None
    long = positive_number("tape_length", 0.5 * remaining if length is None else length, "m")
    wide = positive_number("tape_width", 0.25 * diameter if width is None else width, "m")
    if long > remaining:
        raise ParameterError("tape_length", length, f"at most {remaining:.4g} m, what stays of a period")
    if wide > 0.5 * math.pi * diameter:
        raise ParameterError("tape_width", width, f"at most half the circumference, {0.5 * math.pi * diameter:.4g} m")
    return long, wide
