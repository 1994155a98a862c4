r"""The realisable helix that is nearest to a wanted one, for a given tube diameter and number of turns.

How far two helices are apart is told by the ratios of radius and turn height together,

.. math:: m = \sqrt{\ln^2\frac{R}{R_w} + \ln^2\frac{h}{h_w}}, \qquad h = 2\pi b

with `R` the radius of the path that was asked for: the relative change while it is small, and the same for twice as for half; a
helix without radius or rise is infinitely far. The realisable helices form a set in the plane of `Rc` and `b`. The nearest one
to a wish outside lies on its border, which is made of these curves (ours), each in closed form:

- turns touch where their distance has its minimum, at the turn angle `s` from 4.493 (where `tan s = s`) to `2 pi`:
  :math:`R_c = D/\sqrt{2(1 - \cos s) - s\sin s}`, :math:`b = R_c\sqrt{-\sin(s)/s}`;
- the ends of a tube of less than a turn, `s` apart, touch: :math:`4 R_c^2\sin^2(s/2) + b^2 s^2 = D^2`;
- the tube folds: :math:`R_c^2 + b^2 = R_c D/2`;
- a limit of the contraction or of the angle is reached.

Each curve is sampled; what is not realisable there is left out, and the best places are refined.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.helix.contact import BoolArray, self_contact
from softrobots.helix.shapes import HelixShape, inverse

Limits = tuple[float, float]

_TURN = 2.0 * math.pi
_ROUNDING = 1e-12  # what rounding makes of a point on the border

_Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray]]  # from a parameter in [0, 1] to centre radius and pitch

_FIRST_MINIMUM = 4.493409457909064  # first root of tan s = s above pi
_FINEST = 1e-9  # smallest step of a graded parameter, as a share of its range
_SAMPLES = 2001
_REFINED = 3  # places on a curve that are refined
_ZOOMS = 16  # each ten times nearer: past the last digit


class WantedHelix(NamedTuple):
    """A wanted helix, as plain numbers."""

    path: str
    """Path whose radius is wanted: "inner" or "centre"."""
    radius: float
    """Radius of that path, positive [m]."""
    turn_height: float
    """Rise of a turn, positive [m]."""
    diameter: float
    """Diameter of the tube [m]."""
    turns: float
    """Turns of the tube [-]."""

    @property
    def shape(self) -> HelixShape:
        """The wanted helix itself."""
        outwards = self.diameter if self.path == "inner" else 0.5 * self.diameter
        return _helix(
            np.asarray(self.radius + outwards - 0.5 * self.diameter), np.asarray(self.turn_height / _TURN), self.diameter
        )

    def distance(self, centre_radius: FloatArray, pitch: FloatArray) -> FloatArray:
        """Distance `m` of helices whose radius and pitch are positive; see the module."""
        radius = centre_radius - (0.5 * self.diameter if self.path == "inner" else 0.0)
        return distance(radius / self.radius, _TURN * pitch / self.turn_height)


def nearest_realisable(wanted: WantedHelix, contraction_limits: Limits | None, angle_limits: Limits | None) -> HelixShape:
    """Realisable helix nearest to a wish that is not; see the module.

    It is free of contact (turns may just touch) and within the limits; the radius that was asked for stays positive.

    Args:
        wanted: The wish.
        contraction_limits: Smallest and largest contraction that can be made, or None [-].
        angle_limits: Smallest and largest angle of the actuator that can be made, or None [rad].

    Returns:
        The helix.

    Raises:
        ParameterError: If nothing within the limits is realisable.
    """
    best = (math.inf, 0.0, 0.0)
    for curve in _border(wanted, contraction_limits, angle_limits):

        def cost(parameter: FloatArray, curve: _Curve = curve) -> FloatArray:
            radius, pitch = curve(parameter)
            usable = _realisable(radius, pitch, wanted, contraction_limits, angle_limits)
            made = np.full(parameter.shape, math.inf)
            made[usable] = wanted.distance(radius[usable], pitch[usable])
            return made

        for parameter, value in _minima(cost):
            if value < best[0]:
                radius, pitch = curve(np.array([parameter]))
                best = (value, float(radius[0]), float(pitch[0]))
    if math.isinf(best[0]):
        name = "angle_limits" if contraction_limits is None else "contraction_limits"
        limits = f"{contraction_limits} and angles in {angle_limits}" if angle_limits else f"{contraction_limits}"
        room = " and has room for the object inside" if wanted.path == "inner" else ""
        raise ParameterError(name, limits, "such that some helix within the limits is free of contact" + room)
    return _helix(np.asarray(best[1]), np.asarray(best[2]), wanted.diameter)


def distance(radius_ratio: Any, height_ratio: Any) -> FloatArray:
    """Distance `m` of two helices from the ratios of their radii and turn heights, positive; see the module."""
    return np.asarray(np.hypot(np.log(radius_ratio), np.log(height_ratio)))


def within(value: FloatArray, limits: Limits | None, rounding: float = _ROUNDING) -> BoolArray:
    """Whether values lie within limits, up to rounding."""
    if limits is None:
        return np.ones(np.shape(value), dtype=np.bool_)
    return np.asarray((value >= limits[0] - rounding) & (value <= limits[1] + rounding))


def _helix(radius: FloatArray, pitch: FloatArray, diameter: float) -> HelixShape:
    """Helix from the radius of its centre line."""
    return HelixShape(np.asarray(radius + 0.5 * diameter), np.asarray(radius - 0.5 * diameter), pitch)


def _realisable(
    radius: FloatArray, pitch: FloatArray, wanted: WantedHelix, contraction_limits: Limits | None, angle_limits: Limits | None
) -> BoolArray:
    """Which helices exist, are free of contact, within the limits, and leave room for the object."""
    size = wanted.diameter
    inside = radius - (0.5 * size if wanted.path == "inner" else 0.0)
    usable = (inside > _ROUNDING * size) & (pitch > _ROUNDING * size) & (np.hypot(radius, pitch) < size / _ROUNDING)
    radius, pitch = np.where(usable, radius, size), np.where(usable, pitch, size)
    shape = _helix(radius, pitch, size)
    actuator = inverse(shape)
    contact = self_contact(shape, wanted.turns)
    usable &= (contact.fold_margin >= -_ROUNDING) & ~(contact.has_neighbours & (contact.turn_clearance < -_ROUNDING * size))
    return np.asarray(usable & within(actuator.contraction, contraction_limits) & within(actuator.angle, angle_limits))


def _border(wanted: WantedHelix, contraction_limits: Limits | None, angle_limits: Limits | None) -> list[_Curve]:
    """The curves that bound the realisable helices."""
    size, apart = wanted.diameter, 2.0 * math.pi * wanted.turns

    def touching(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        short = (2.0 * math.pi - _FIRST_MINIMUM) * _graded(parameter)
        angle = 2.0 * math.pi - short
        radius = size / np.sqrt(4.0 * np.sin(0.5 * short) ** 2 + angle * np.sin(short) + 1e-300)
        return radius, radius * np.sqrt(np.sin(short) / angle)

    def ends(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned = 0.5 * math.pi * parameter
        return 0.5 * size * np.cos(turned) / abs(math.sin(0.5 * apart)), size * np.sin(turned) / apart

    def folding(parameter: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned = math.pi * parameter
        return 0.25 * size * (1.0 + np.cos(turned)), 0.25 * size * np.sin(turned)

    def of_actuator(shrink: FloatArray | float, angle: FloatArray | float) -> tuple[FloatArray, FloatArray]:
        share = 1.0 - np.asarray(shrink)
        apart = np.asarray(shrink) ** 2 + 4.0 * share * np.sin(angle) ** 2 + 1e-300  # |1 - zeta|^2
        return 0.5 * size * shrink * (1.0 + share) / apart, size * share * np.sin(2.0 * np.asarray(angle)) / apart

    shares, angles = contraction_limits or (0.0, 1.0), angle_limits or (0.0, 0.5 * math.pi)

    def at_contraction(share: float) -> _Curve:
        return lambda p: of_actuator(1.0 - share, angles[0] + (angles[1] - angles[0]) * _graded(p))

    def at_angle(angle: float) -> _Curve:
        return lambda p: of_actuator(1.0 - shares[1] + (shares[1] - shares[0]) * _graded(p), angle)

    curves: list[_Curve] = [touching, folding]
    if 0.5 < wanted.turns < 1.0:
        curves.append(ends)
    curves += [at_contraction(share) for share in contraction_limits or ()]
    curves += [at_angle(angle) for angle in angle_limits or ()]
    return curves


def _graded(parameter: FloatArray) -> FloatArray:
    """From [0, 1] to [0, 1], with ever finer steps towards 0; straight tubes crowd there."""
    return np.where(parameter > 0.0, _FINEST ** (1.0 - parameter), 0.0)


def _minima(cost: Callable[[FloatArray], FloatArray]) -> list[tuple[float, float]]:
    """The lowest local minima of a function on [0, 1] that may be infinite on parts of it: places and values."""
    parameter = np.linspace(0.0, 1.0, _SAMPLES)
    values = cost(parameter)
    padded = np.concatenate([[math.inf], values, [math.inf]])
    lowest = np.flatnonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))
    found = []
    for index in lowest[np.argsort(values[lowest])][:_REFINED]:
        place, value, step = float(parameter[index]), float(values[index]), 1.0 / (_SAMPLES - 1)
        for _ in range(_ZOOMS):
            near = np.clip(place + step * np.linspace(-1.0, 1.0, 21), 0.0, 1.0)
            tried = cost(near)
            best = int(np.argmin(tried))
            if tried[best] <= value:
                place, value = float(near[best]), float(tried[best])
            step *= 0.1
        found.append((place, value))
    return found
