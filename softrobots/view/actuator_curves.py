"""The curves of actuators along their routes in the bent body, for pictures and measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import ActuatorTag, RouteTag
from softrobots.view.body import BentSections, outwards, tube

THREAD = 0.09
"""Radius of a line along the body that has no thickness of its own, relative to the radius of the body."""

_THINNEST, _THICKEST = 0.005, 0.18  # radius of a tendon: at least relative to the length of the body, at most to its radius

_SIDES = 6  # corners of the cross-section of an actuator
_COARSEST = 0.3  # turn about the backbone from point to point [rad]
_DASHES = 24  # along the whole robot, gaps between them as long
_WIDEST = 0.4  # radius of a muscle or chamber, relative to that of the body, which it would hide
_GAP = 2.3  # between the middles of actuators through the same holes, relative to their radius
_SAME = 1e-9  # of the length of a curve: points nearer to the last one are left out


@dataclass(frozen=True, eq=False)
class ActuatorCurve:
    """The curve of one actuator, from the start of its route to its end, in world axes."""

    name: str
    """Name of the actuator."""
    points: FloatArray
    """Points along it, shape (n, 3) [m]."""
    outwards: FloatArray
    """Unit vectors away from the backbone there, shape (n, 3)."""
    radius: float
    """Half its thickness [m]: that of a McKibben muscle or round chamber, if it is thin, else of a thread."""
    shown: FloatArray
    """The points as they are drawn, shape (n, 3) [m]: actuators through the same holes are shown side by side."""

    def surface(self) -> tuple[FloatArray, FloatArray]:
        """Return corners and triangles of the tube around the curve, as `softrobots.view.body.tube`."""
        return self._tube(self.shown, self.outwards)

    def dashes(self) -> list[FloatArray]:
        """Return the ends of straight dashes along the curve, each shape (2, 3) [m]; gaps are as long as dashes."""
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.shown, axis=0), axis=1))])
        places = along[-1] * np.arange(2 * _DASHES) / (2 * _DASHES - 1)  # begins and ends with a dash
        ends = np.column_stack([np.interp(places, along, axis) for axis in self.shown.T])
        return list(ends.reshape(_DASHES, 2, 3))

    def dashed_surface(self) -> tuple[FloatArray, FloatArray]:
        """Return corners and triangles of the dashes; as many whatever the shape of the robot."""
        nearest = np.rint(np.linspace(0, len(self.outwards) - 1, _DASHES)).astype(int)
        pieces = [self._tube(ends, self.outwards[[at, at]]) for ends, at in zip(self.dashes(), nearest, strict=True)]
        count = len(pieces[0][0])
        triangles = [faces + number * count for number, (_, faces) in enumerate(pieces)]
        return np.concatenate([corners for corners, _ in pieces]), np.concatenate(triangles)

    def _tube(self, points: FloatArray, across: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A tube whose cross-sections stand across the curve rather than across the body."""
        z = np.gradient(points, axis=0)
        z /= np.linalg.norm(z, axis=1)[:, None]
        y = np.cross(z, across)
        y /= np.linalg.norm(y, axis=1)[:, None]
        return tube(np.stack([np.cross(y, z), y, z], axis=-1), points, self.radius, _SIDES)


def actuator_curves(sections: BentSections, actuators: tuple[ActuatorTag, ...], points: int = 12) -> tuple[ActuatorCurve, ...]:
    """Return the curves of actuators in the bent body.

    Args:
        sections: The body at some coordinates.
        actuators: The actuators, as `softrobots.SoftModel.muscles`.
        points: Points for each section; more where a route winds.

    Returns:
        A curve for each actuator.
    """
    curves = []
    for tag, (radius, aside) in zip(actuators, thickness_and_shift(sections, actuators), strict=True):
        places = [route_places(sections, route, points) for route in tag.route]
        frames = np.concatenate([sections.frames(route.segment, at) for route, at in zip(tag.route, places, strict=True)])
        distance, azimuth = np.concatenate([offsets(route, at) for route, at in zip(tag.route, places, strict=True)], axis=1)
        away = outwards(frames, azimuth)
        curve = frames[:, :3, 3] + distance[:, None] * away
        steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
        kept = np.append(True, steps > _SAME * steps.sum())
        shown = curve + aside * np.cross(away, frames[:, :3, 2])
        curves.append(ActuatorCurve(tag.name, curve[kept], away[kept], radius, shown[kept]))
    return tuple(curves)


def thickness_and_shift(sections: BentSections, actuators: tuple[ActuatorTag, ...]) -> list[tuple[float, float]]:
    """Return the radius of each drawn actuator, and how far it is drawn beside others through the same holes [m]."""
    starts, found = [_start(tag) for tag in actuators], []
    for number, tag in enumerate(actuators):
        radius, together, before = _radius(tag, sections), starts.count(starts[number]), starts[:number].count(starts[number])
        gap = min(_GAP * radius, tag.distance / max(together - 1, 1))
        found.append((radius, (before - 0.5 * (together - 1)) * gap))
    return found


def route_places(sections: BentSections, route: RouteTag, points: int) -> FloatArray:
    """Return the places at which a route is drawn: rest lengths from the start of its segment, shape (n,) [m]."""
    bounds = sections.bounds(route.segment)
    grid = np.linspace(0.0, 1.0, points, endpoint=False) * np.diff(bounds)[:, None] + bounds[:-1, None]
    first, last = max(route.at[0], 0.0), min(route.at[-1], float(bounds[-1]))
    inside = np.concatenate([np.ravel(grid), route.at])
    corners = np.unique([first, *inside[(inside > first) & (inside < last)], last])
    turns = np.abs(np.diff(np.interp(corners, route.at, route.azimuth)))
    pieces = [
        np.linspace(begin, end, math.ceil(turn / _COARSEST) or 1, endpoint=False)
        for begin, end, turn in zip(corners[:-1], corners[1:], turns, strict=True)
    ]
    return np.concatenate([*pieces, [last]])


def offsets(route: RouteTag, at: FloatArray) -> FloatArray:
    """Return distance [m] and azimuth [rad] of a route at rest lengths from the start of its segment, shape (2, n)."""
    return np.array([np.interp(at, route.at, route.distance), np.interp(at, route.at, route.azimuth)])


def _start(tag: ActuatorTag) -> tuple[float, ...]:
    """Where an actuator begins: segment, place and offset, rounded."""
    first = tag.route[0]
    return first.segment, round(first.at[0], 9), round(tag.distance, 9), round(tag.azimuth % math.tau, 6) % round(math.tau, 6)


def _radius(tag: ActuatorTag, sections: BentSections) -> float:
    """Half the thickness of an actuator [m]."""
    radius = sections.radius(tag.route[0].segment)
    if tag.kind == "mckibben":
        return min(0.5 * tag.diameter, _WIDEST * radius)
    if tag.kind == "pressure":
        return min(math.sqrt(tag.area / math.pi), _WIDEST * radius)
    return min(max(THREAD * radius, _THINNEST * sections.length), _THICKEST * radius)
