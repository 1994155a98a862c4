r"""Inverse design of a helix: from an object to grasp, or an antenna to hold, to the actuator and the length of the tube.

A grasp requires the inner path on the object, an antenna the centre line on a cylinder; both require a rise per turn. Diameter
of the tube and turns are given. [Blumenschein 2018] (6, 7, 11) then give contraction and angle of the actuator. If such a tube
would run into itself, or the actuator is outside its limits, the caller chooses: an error, a warning, or the nearest realisable
helix (ours). The distance of a helix from the required one is

.. math:: m = \sqrt{\ln^2\frac{R}{R_w} + \ln^2\frac{h}{h_w}}, \qquad h = 2\pi b

with `R` the radius of the required path: the relative change while it is small, and the same for twice as for half; a helix
without radius or rise is infinitely far. The realisable helices form a set in the plane of `Rc` and `b`. The one nearest to a
requirement outside lies on its border, which consists of these curves, each in closed form:

- turns touch where their distance has its minimum, at the turn angle `s` from 4.493 (where `tan s = s`) to `2 pi`:
  :math:`R_c = D/\sqrt{2(1 - \cos s) - s\sin s}`, :math:`b = R_c\sqrt{-\sin(s)/s}`;
- the ends of a tube of less than a turn, `s` apart, touch: :math:`4 R_c^2\sin^2(s/2) + b^2 s^2 = D^2`;
- the tube folds: :math:`R_c^2 + b^2 = R_c D/2`;
- a limit of the contraction or of the angle is reached.

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
from softrobots.helix.design import LIMIT_ROUNDING, DesignWarning, HelixDesign, Limits, Wish, checked_limits, distance, within
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
    contraction_limits: Limits | None = None,
    angle_limits: Limits | None = None,
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
        on_unrealisable: What to do if the tube would run into itself or a limit is passed: one of `ON_UNREALISABLE`. "error" to
            raise, "nearest" to take the nearest realisable helix (see the module), "warn" to return the required helix with its
            `faults` and `contact`, and issue a `DesignWarning`.
        contraction_limits: Smallest and largest contraction of the actuator, within (0, 1]; None for no limit [-].
        angle_limits: Smallest and largest angle of the actuator, within [0, pi/2); None for no limit [rad].

    Returns:
        The design.

    Raises:
        ParameterError: If an argument is out of range; if a limit is passed and `on_unrealisable` is "error"; or if no helix
            within the limits is realisable.
        SelfIntersection: If the tube would run into itself and `on_unrealisable` is "error".
        StraightTube: If the helix is straight within rounding.
    """
    radius = positive_number("object_radius", object_radius, "m")
    squeeze_depth = non_negative_number("squeeze", squeeze, "m")
    if squeeze_depth >= radius:
        raise ParameterError("squeeze", squeeze, f"less than the radius of the object, {radius} m")
    required = Wish("grasp", "inner", radius - squeeze_depth, positive_number("turn_height", turn_height, "m"), squeeze_depth)
    return _design(required, diameter, turns, handedness, on_unrealisable, contraction_limits, angle_limits)


def design_antenna(
    radius: float,
    turn_height: float,
    *,
    diameter: float,
    turns: float,
    handedness: str = "right",
    on_unrealisable: str = "error",
    contraction_limits: Limits | None = None,
    angle_limits: Limits | None = None,
) -> HelixDesign:
    """Design actuator and tube of a helical antenna: the centre line of the tube has the required radius.

    Args:
        radius: Radius of the centre line, positive [m].
        turn_height: Rise of a turn, positive [m].
        diameter: Diameter of the tube, positive [m].
        turns: Turns, positive [-].
        handedness: "right" or "left".
        on_unrealisable: As in `design_grasp`.
        contraction_limits: As in `design_grasp` [-].
        angle_limits: As in `design_grasp` [rad].

    Returns:
        The design.

    Raises:
        ParameterError: As in `design_grasp`.
        SelfIntersection: As in `design_grasp`.
        StraightTube: As in `design_grasp`.
    """
    rise = positive_number("turn_height", turn_height, "m")
    required = Wish("antenna", "centre", positive_number("radius", radius, "m"), rise)
    return _design(required, diameter, turns, handedness, on_unrealisable, contraction_limits, angle_limits)


def _design(
    required: Wish,
    diameter: float,
    turns: float,
    handedness: str,
    on_unrealisable: str,
    contraction_limits: Limits | None,
    angle_limits: Limits | None,
) -> HelixDesign:
    """The design of the required helix, or of the realisable one nearest to it."""
    choice("on_unrealisable", on_unrealisable, ON_UNREALISABLE)
    contraction_range = checked_limits("contraction_limits", contraction_limits, "-")
    angle_range = checked_limits("angle_limits", angle_limits, "rad")
    tube, count = positive_number("diameter", diameter, "m"), positive_number("turns", turns, "-")
    for name, length in (("radius", required.radius), ("turn_height", required.turn_height)):
        if not tube / _EXTREME <= length <= tube * _EXTREME:
            raise ParameterError(name, length, f"within a factor of {_EXTREME:g} of the diameter {tube} m")
    outwards = tube if required.path == "inner" else 0.5 * tube  # from the required path to the outer one
    required_shape = _helix(required.radius + outwards - 0.5 * tube, required.turn_height / (2.0 * math.pi), tube)

    def design_of(shape: HelixShape, *, clipped: bool) -> HelixDesign:
        contraction, angle, _ = (float(value) for value in inverse(shape))
        if clipped:
            contraction = float(np.clip(contraction, *(contraction_range or (contraction, contraction))))
            angle = float(np.clip(angle, *(angle_range or (angle, angle))))
        return HelixDesign(contraction, angle, tube, count, handedness, required, contraction_range, angle_range)

    design = design_of(required_shape, clipped=False)
    if design.realisable:
        return design
    if on_unrealisable == "nearest":
        search = _NearestHelix(required, tube, count, contraction_range, angle_range)
        return design_of(search.nearest(), clipped=True)
    faults, advice = "; ".join(design.faults), "on_unrealisable='nearest' gives the nearest helix that can be made"
    if on_unrealisable == "warn":
        warnings.warn(DesignWarning(faults, design=design), stacklevel=3)
        return design
    if bool(design.contact.touches):
        raise SelfIntersection(f"{faults}; {advice}", contact=design.contact)
    reached = within(np.asarray(design.contraction), contraction_range, LIMIT_ROUNDING)
    name = "angle_limits" if reached else "contraction_limits"
    raise ParameterError(name, getattr(design, name), f"wide enough for the required helix ({faults}); {advice}")


class _NearestHelix(NamedTuple):
    """Search for the realisable helix nearest to a required one, for a diameter, turns and limits of the actuator."""

    required: Wish
    diameter: float
    turns: float
    contraction_limits: Limits | None
    angle_limits: Limits | None

    def nearest(self) -> HelixShape:
        """Return the nearest helix that is free of contact (turns may just touch) and within the limits, if there is one."""
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
        if math.isinf(best[0]):
            name = "angle_limits" if self.contraction_limits is None else "contraction_limits"
            limits = f"{self.contraction_limits}" + (f" and angles in {self.angle_limits}" if self.angle_limits else "")
            room = " and has room for the object inside" if self.required.path == "inner" else ""
            raise ParameterError(name, limits, "such that some helix within the limits is free of contact" + room)
        return _helix(best[1], best[2], self.diameter)

    def _path_radius(self, centre_radius: FloatArray) -> FloatArray:
        """Radius of the required path [m]."""
        return np.asarray(centre_radius - (0.5 * self.diameter if self.required.path == "inner" else 0.0))

    def _realisable(self, radius: FloatArray, pitch: FloatArray) -> BoolArray:
        """Whether helices exist, are free of contact, within the limits, and leave room for the object."""
        size, path = self.diameter, self._path_radius(radius)
        usable = (path > _ROUNDING * size) & (pitch > _ROUNDING * size) & (np.hypot(radius, pitch) < size / _ROUNDING)
        shape = _helix(np.where(usable, radius, size), np.where(usable, pitch, size), size)
        actuator, contact = inverse(shape), self_contact(shape, self.turns)
        usable &= (contact.fold_margin >= -_ROUNDING) & ~(contact.has_neighbours & (contact.turn_clearance < -_ROUNDING * size))
        usable &= within(actuator.contraction, self.contraction_limits, _ROUNDING)
        return np.asarray(usable & within(actuator.angle, self.angle_limits, _ROUNDING))

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

        def of_actuator(shrink: FloatArray | float, angle: FloatArray | float) -> tuple[FloatArray, FloatArray]:
            contraction = 1.0 - np.asarray(shrink)
            square = np.asarray(shrink) ** 2 + 4.0 * contraction * np.sin(angle) ** 2 + 1e-300  # |1 - zeta|^2
            radius = 0.5 * size * shrink * (1.0 + contraction) / square
            return radius, size * contraction * np.sin(2.0 * np.asarray(angle)) / square

        contractions, angles = self.contraction_limits or (0.0, 1.0), self.angle_limits or (0.0, 0.5 * math.pi)

        def at_contraction(contraction: float) -> _Curve:
            return lambda p: of_actuator(1.0 - contraction, angles[0] + (angles[1] - angles[0]) * _graded(p))

        def at_angle(angle: float) -> _Curve:
            return lambda p: of_actuator(1.0 - contractions[1] + (contractions[1] - contractions[0]) * _graded(p), angle)

        curves: list[_Curve] = [touching, folding]
        curves += [ends] if 0.5 < self.turns < 1.0 else []
        curves += [at_contraction(contraction) for contraction in self.contraction_limits or ()]
        curves += [at_angle(angle) for angle in self.angle_limits or ()]
        return curves


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
