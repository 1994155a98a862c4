r"""Where to pinch, tape or stop a tube so that it becomes a helix: positions on the tube before it is inflated.

[Blumenschein 2018] section III-A makes the contraction in steps along the actuator line: narrow pieces of the wall are folded
away and held by tape, or the gaps between stoppers on a pull string close. The plan here is ours. The actuator line, of length
:math:`L_a = L_t/\cos\theta`, is divided into periods of length `d`. In the middle of each, :math:`p = (1 - \lambda) d` is taken
away (the pinch, or the gap); :math:`\lambda d` stays (the piece between, or the stopper). The unrolled tube is a sheet, seen from
outside; the point at the arc length `a` of the line lies on it at

.. math:: x = a\cos\theta, \qquad y = \left(\tfrac{D}{2}\varphi_0 + \sigma a\sin\theta\right) \bmod \pi D

with `x` along the tube to the right, `y` around it, downwards on the drawing, and `sigma` +1 for a right-handed helix, -1 for a
left-handed one. A whole number of periods seldom fits: the rest is left plain at the tip, or divided between both ends, or the
spacing is changed so that none is left.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.checks import (
    FloatArray,
    choice,
    common_shape,
    finite_array,
    finite_number,
    positive_array,
    positive_number,
    read_only,
)
from softrobots.errors import ParameterError
from softrobots.files import as_path, new_file, write_atomically
from softrobots.helix.design import HelixDesign
from softrobots.helix.shapes import HANDEDNESS, HelixShape, checked_actuator, forward, turning_sign
from softrobots.helix.template import Window, csv_text, svg_text
from softrobots.helix.tube import turns

METHODS = ("pinch", "tape", "stoppers")
"""Fold the wall away; fold it and hold it by a piece of tape; or string stoppers with gaps that close."""

REMAINDERS = ("end", "both", "respace")
"""What becomes of the length where no whole period fits: plain at the tip, plain at both ends, or spread by another spacing."""

MOST_PERIODS = 20_000
"""Patterns with more pinches are refused."""

_ROUNDING = 1e-9  # of a period: a rest shorter than this is none
_MOST_PAGES = 500
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
    stoppers, gaps = positive_array("stopper", stopper, "m"), finite_array("gap", gap, None, "m")
    if np.any(gaps < 0.0):
        raise ParameterError("gap", gap, "zero or positive [m]")
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
    shares, stoppers = checked_actuator(contraction, 0.0, 1.0).contraction, positive_array("stopper", stopper, "m")
    common_shape("stopper", shares.shape, stoppers.shape)
    return np.asarray(stoppers * (1.0 - shares) / shares)


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
            arc: Arc lengths along the line, any shape [m]; beyond the ends it is continued.

        Returns:
            The points, of that shape.

        Raises:
            ParameterError: If a number is not finite.
        """
        return _located(finite_array("arc", arc, None, "m"), self.angle, self.diameter, self.handedness, self.start_azimuth)

    def write_svg(self, path: str | os.PathLike[str], overwrite: bool = False) -> Path:
        """Draw the unrolled tube to scale, on one sheet: see `softrobots.helix.template`.

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
            ParameterError: If the path is none, a length is out of range, or there would be more than 500 pages.
            OutputExists: If one of the files exists and `overwrite` is false; then none is written.
            OutputError: If a file cannot be written.
        """
        page, common = 1e3 * positive_number("page_length", page_length, "m"), 1e3 * positive_number("overlap", overlap, "m")
        length = 1e3 * self.tube_length
        if common > 0.5 * page:
            raise ParameterError("overlap", overlap, f"at most half the page length {page_length} m")
        step, base = page - common, as_path("path", path)
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
    period, azimuth = positive_number("spacing", spacing, "m"), finite_number("start_azimuth", start_azimuth, "rad")
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
    starts, ends = (_located(np.asarray(middles + 0.5 * side * pinch), angle, diameter, hand, azimuth) for side in (-1.0, 1.0))
    return Pattern(
        contraction, angle, diameter, length, period, method, hand, remainder, azimuth, plain, rest - plain, *tape, starts, ends
    )


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


def _checked(actuator: Any, handedness: str | None) -> tuple[float, float, float, float, str]:
    """Contraction, angle, diameter, tube length and handedness."""
    if isinstance(actuator, HelixDesign):
        numbers: Any = (actuator.contraction, actuator.angle, actuator.diameter, actuator.tube_length)
        default = actuator.handedness
    else:
        numbers, default = actuator, "right"
        if not isinstance(actuator, tuple | list | np.ndarray) or len(actuator) != 4:
            raise ParameterError("actuator", actuator, "a HelixDesign, or (contraction, angle, diameter, length of the tube)")
    contraction, angle, diameter, length = (
        finite_number(name, value) for name, value in zip(("contraction", "angle", "diameter", "length"), numbers, strict=True)
    )
    checked_actuator(contraction, angle, diameter)
    if contraction >= 1.0:
        raise ParameterError("contraction", contraction, "below 1: at 1 there is nothing to pinch")
    if angle > _STEEPEST:
        raise ParameterError("angle", angle, f"at most {_STEEPEST:.4f} rad (89 degrees) for a sheet that can be drawn")
    positive_number("length", length, "m")
    return contraction, angle, diameter, length, choice("handedness", handedness or default, HANDEDNESS)


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


def _located(arc: FloatArray, angle: float, diameter: float, handedness: str, azimuth: float) -> SheetPoints:
    """Points of the actuator line on the unrolled tube."""
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
