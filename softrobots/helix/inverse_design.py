r"""Inverse design of a helix: from an object to grasp, or an antenna to hold, to the actuator and the length of the tube.

A grasp requires the inner path on the object, an antenna the centre line on a cylinder; both require a rise per turn. Diameter
of the tube and turns are given. [Blumenschein 2018] (6, 7, 11) then give contraction and angle of the actuator. If such a tube
would run into itself, the caller chooses: an error, a warning, or the nearest realisable helix (ours). The distance of a helix
from the required one is

.. math:: m = \sqrt{\ln^2\frac{R}{R_w} + \ln^2\frac{h}{h_w}}, \qquad h = 2\pi b

with `R` the radius of the required path: the relative change while it is small, and the same for twice as for half; a helix
without radius or rise is infinitely far. The realisable helices form a set in the plane of `Rc` and `b`. The one nearest to a
requirement outside lies on its border, which consists of these curves, each in closed form:

- turns touch where their distance has its minimum, at the turn angle `s` from 4.493 (where `tan s = s`) to `2 pi`:
  :math:`R_c = D/\sqrt{2(1 - \cos s) - s\sin s}`, :math:`b = R_c\sqrt{-\sin(s)/s}`;
- the ends of a tube of less than a turn, `s` apart, touch: :math:`4 R_c^2\sin^2(s/2) + b^2 s^2 = D^2`;
- the tube folds: :math:`R_c^2 + b^2 = R_c D/2`.

Each curve is sampled, points that are not realisable are left out, and the best ones are refined.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, choice, non_negative_number, positive_number
from softrobots.core.errors import ParameterError, SelfIntersection
from softrobots.helix.contact import BoolArray, self_contact
from softrobots.helix.design import DesignWarning, HelixDesign, Wish, distance
from softrobots.helix.shapes import HelixShape, inverse

ON_UNREALISABLE = ("error", "nearest", "warn")
"""What a design function does about a requirement that cannot be met."""

_EXTREME = 1e6  # times the diameter, up or down: a radius or rise beyond is lost in rounding
_ROUNDING = 1e-12  # of a point on the border
_FIRST_MINIMUM = 4.493409457909064  # first root of tan s = s above pi
_FINEST = 1e-9  # smallest step of a graded parameter, as a share of its range
_SAMPLES = 2001
_REFINED = 3  # minima on a curve that are refined
_ZOOMS = 16  # each ten times nearer: past the last digit

_Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray]]  # from a parameter in [0, 1] to centre radius and pitch


def design_grasp(
    object_radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    squeeze: float = 0.0,
    handedness: str = "right",
    on_unrealisable: str = "error",
) -> HelixDesign:
    """Design actuator and tube that wrap around an object: the inner path lies on it.

    Args:
        object_radius: Radius of the object, positive [m].
        turn_height: Rise of a turn along the object, positive [m].
        diameter: Diameter of the tube, positive [m].
        turns: Turns around the object, positive [-].
        squeeze: Radius of the object minus the natural inner radius of the helix, from 0 to below the radius of the object [m].
            A squeezed object is held (`grasp_force`), one that is just wrapped is not.
        handedness: "right" or "left".
        on_unrealisable: What to do if the tube would run into itself: one of `ON_UNREALISABLE`. "error" to raise, "nearest" to
            take the nearest realisable helix (see the module), "warn" to return the required helix with its `contact`, and
            issue a `DesignWarning`.

    Returns:
        The design.

    Raises:
        ParameterError: If an argument is out of range.
        SelfIntersection: If the tube would run into itself and `on_unrealisable` is "error".
        StraightTube: If the helix is straight within rounding.
    """
    radius = positive_number("object_radius", object_radius, "m")
    squeeze_depth = non_negative_number("squeeze", squeeze, "m")
    if squeeze_depth >= radius:
        raise ParameterError("squeeze", squeeze, f"less than the radius of the object, {radius} m")
    required = Wish("grasp", "inner", radius - squeeze_depth, positive_number("turn_height", turn_height, "m"), squeeze_depth)
    return _design(required, diameter, turns, handedness, on_unrealisable)


def design_antenna(
    radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    handedness: str = "right",
    on_unrealisable: str = "error",
) -> HelixDesign:
    """Design actuator and tube of a helical antenna: the centre line of the tube has the required radius.

    Args:
        radius: Radius of the centre line, positive [m].
        turn_height: Rise of a turn, positive [m].
        diameter: Diameter of the tube, positive [m].
        turns: Turns, positive [-].
        handedness: "right" or "left".
        on_unrealisable: As in `design_grasp`.

    Returns:
        The design.

    Raises:
        ParameterError: As in `design_grasp`.
        SelfIntersection: As in `design_grasp`.
        StraightTube: As in `design_grasp`.
    """
    rise = positive_number("turn_height", turn_height, "m")
    required = Wish("antenna", "centre", positive_number("radius", radius, "m"), rise)
    return _design(required, diameter, turns, handedness, on_unrealisable)


def _design(required: Wish, diameter: float, turns: float, handedness: str, on_unrealisable: str) -> HelixDesign:
    """The design of the required helix, or of the realisable one nearest to it."""
    choice("on_unrealisable", on_unrealisable, ON_UNREALISABLE)
    tube, count = positive_number("diameter", diameter, "m"), positive_number("turns", turns, "-")
    for name, length in (("radius", required.radius), ("turn_height", required.turn_height)):
        if not tube / _EXTREME <= length <= tube * _EXTREME:
            raise ParameterError(name, length, f"within a factor of {_EXTREME:g} of the diameter {tube} m")
    outwards = tube if required.path == "inner" else 0.5 * tube  # from the required path to the outer one
    required_shape = _helix(required.radius + outwards - 0.5 * tube, required.turn_height / (2.0 * math.pi), tube)

    def design_of(shape: HelixShape) -> HelixDesign:
        contraction, angle, _ = (float(value) for value in inverse(shape))
        return HelixDesign(contraction, angle, tube, count, handedness, required)

    design = design_of(required_shape)
    if design.realisable:
        return design
    if on_unrealisable == "nearest":
        return design_of(_NearestHelix(required, tube, count).nearest())
    contact, advice = str(design.contact), "on_unrealisable='nearest' gives the nearest helix that can be made"
    if on_unrealisable == "warn":
        warnings.warn(DesignWarning(contact, design=design), stacklevel=3)
        return design
    raise SelfIntersection(f"{contact}; {advice}", contact=design.contact)


class _NearestHelix(NamedTuple):
    """Search for the realisable helix nearest to a required one, for a diameter and turns."""

    required: Wish
    diameter: float
    turns: float

    def nearest(self) -> HelixShape:
        """Return the nearest helix that is free of contact; turns may just touch."""
        best = (math.inf, 0.0, 0.0)
        for curve in self._border():

            def cost(parameter: FloatArray, curve: _Curve = curve) -> FloatArray:
                radius, pitch = curve(parameter)
                usable = self._realisable(radius, pitch)
                values = np.full(parameter.shape, math.inf)
                ratio = self._path_radius(radius[usable]) / self.required.radius
                values[usable] = distance(ratio, 2.0 * math.pi * pitch[usable] / self.required.turn_height)
                return values

            for parameter, value in _minima(cost):
                if value < best[0]:
                    radius, pitch = curve(np.array([parameter]))
                    best = (value, float(radius[0]), float(pitch[0]))
        return _helix(best[1], best[2], self.diameter)

    def _path_radius(self, centre_radius: FloatArray) -> FloatArray:
        """Radius of the required path [m]."""
        return np.asarray(centre_radius - (0.5 * self.diameter if self.required.path == "inner" else 0.0))

    def _realisable(self, radius: FloatArray, pitch: FloatArray) -> BoolArray:
        """Whether helices exist, are free of contact, and leave room for the object."""
        size, path = self.diameter, self._path_radius(radius)
        usable = (path > _ROUNDING * size) & (pitch > _ROUNDING * size) & (np.hypot(radius, pitch) < size / _ROUNDING)
        shape = _helix(np.where(usable, radius, size), np.where(usable, pitch, size), size)
        contact = self_contact(shape, self.turns)
        usable &= (contact.fold_margin >= -_ROUNDING) & ~(contact.has_neighbours & (contact.turn_clearance < -_ROUNDING * size))
        return np.asarray(usable)

    def _border(self) -> list[_Curve]:
        """The curves that bound the realisable helices."""
        size, between_ends = self.diameter, 2.0 * math.pi * self.turns

        def touching(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
            short = (2.0 * math.pi - _FIRST_MINIMUM) * _graded(parameter)
            angle = 2.0 * math.pi - short
            radius = size / np.sqrt(4.0 * np.sin(0.5 * short) ** 2 + angle * np.sin(short) + 1e-300)
            return radius, radius * np.sqrt(np.sin(short) / angle)

        def ends(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
            turned = 0.5 * math.pi * parameter
            return 0.5 * size * np.cos(turned) / abs(math.sin(0.5 * between_ends)), size * np.sin(turned) / between_ends

        def folding(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
            turned = math.pi * parameter
            return 0.25 * size * (1.0 + np.cos(turned)), 0.25 * size * np.sin(turned)

        return [touching, folding, *([ends] if 0.5 < self.turns < 1.0 else [])]


def _helix(radius: FloatArray | float, pitch: FloatArray | float, diameter: float) -> HelixShape:
    """Helix from the radius of its centre line."""
    return HelixShape(np.asarray(radius + 0.5 * diameter), np.asarray(radius - 0.5 * diameter), np.asarray(pitch))


def _graded(parameter: FloatArray) -> FloatArray:
    """Map [0, 1] to itself with ever finer steps towards 0, where the nearly straight tubes are."""
    return np.where(parameter > 0.0, _FINEST ** (1.0 - parameter), 0.0)


def _minima(cost: Callable[[FloatArray], FloatArray]) -> list[tuple[float, float]]:
    """Arguments and values of the lowest local minima of a function on [0, 1], which may be infinite on parts of it."""
    parameter = np.linspace(0.0, 1.0, _SAMPLES)
    values = cost(parameter)
    padded = np.concatenate([[math.inf], values, [math.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))
    minima = []
    for index in lowest[np.argsort(values[lowest])][:_REFINED]:
        minimum, value, step = float(parameter[index]), float(values[index]), 1.0 / (_SAMPLES - 1)
        for _ in range(_ZOOMS):
            candidates = np.clip(minimum + step * np.linspace(-1.0, 1.0, 21), 0.0, 1.0)
            values_near = cost(candidates)
            best = int(np.argmin(values_near))
            if values_near[best] <= value:
                minimum, value = float(candidates[best]), float(values_near[best])
            step *= 0.1
        minima.append((minimum, value))
    return minima
