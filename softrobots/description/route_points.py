r"""Points along the route of an actuator, at which its tangent gives its length.

A route at distance `d` and azimuth `phi` runs at the offset :math:`o = d (\cos\phi, \sin\phi)` from the backbone. With the
strains `(kx, ky, tau, nu)` of a section its tangent per rest length of the backbone has, along the radius, around the backbone
and along it, the components

.. math:: d', \quad d\,(\phi' + \tau), \quad \nu + d \sin\phi\,k_x - d \cos\phi\,k_y

(theory 4.3 is the case of constant `d` and `phi`). Along a section of constant strain a straight route has the same tangent
everywhere, and one point gives its length; the length of others is the sum over Gauss points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import RouteTag

_ROUNDING = 1e-9  # of places along a segment, relative to the length of a section
_EXACT = 1e-12  # error of a length, relative to it, where a section bends or twists by up to a radian
_COUNTS = (2, 3, 4, 6, 8, 10, 12, 14, 16)  # of Gauss points
_MANY = 24
_HALVINGS = 12


class RoutePoint(NamedTuple):
    """A point of a route, for part of a section."""

    section: int
    """Number of the section, from 0."""
    weight: float
    """Rest length that it stands for [m]."""
    distance: float
    """Distance from the backbone [m]."""
    azimuth: float
    """Azimuth [rad]."""
    widening: float
    """Derivative of the distance along the rest length [-]."""
    winding: float
    """Derivative of the azimuth along it [rad/m]."""

    def stretch(self, strains: Sequence[float]) -> float:
        """Return the length of the tangent at strains kx, ky, twist [rad/m] and stretch [-]."""
        kx, ky, twist, along = strains
        along += self.distance * (math.sin(self.azimuth) * kx - math.cos(self.azimuth) * ky)
        return math.hypot(self.widening, self.distance * (self.winding + twist), along)


def route_points(route: Sequence[RouteTag], sections: Sequence[tuple[int, float]]) -> list[RoutePoint]:
    """Return the points of a route; a straight part of a section has one.

    Args:
        route: The pieces of the route, base to tip.
        sections: Number of the segment and rest length [m] of each section of the robot, base to tip.
    """
    points: list[RoutePoint] = []
    for piece in route:
        start = 0.0
        for number, (segment, length) in enumerate(sections):
            if segment == piece.segment:
                points += _points_in_section(piece, number, start, length)
                start += length
    return points


def route_length(points: Sequence[RoutePoint], strains: Sequence[Sequence[float]]) -> float:
    """Return the length of a route at the strains of each section [m]."""
    return math.fsum(point.weight * point.stretch(strains[point.section]) for point in points)


def _points_in_section(piece: RouteTag, number: int, start: float, length: float) -> list[RoutePoint]:
    """The points of a piece in the section from `start`."""
    slack = _ROUNDING * length
    low, high = max(piece.at[0], start), min(piece.at[-1], start + length)
    low, high = (start if low - start <= slack else low), (start + length if start + length - high <= slack else high)
    if high - low <= slack:
        return []
    if piece.straight:
        weight = length if (low, high) == (start, start + length) else high - low
        return [RoutePoint(number, weight, piece.distance[0], piece.azimuth[0], 0.0, 0.0)]
    ends = [low, *(place for place in piece.at if low + slack < place < high - slack), high]
    distances, azimuths = (np.interp(ends, piece.at, table).tolist() for table in (piece.distance, piece.azimuth))
    points: list[RoutePoint] = []
    for place in range(len(ends) - 1):
        size = ends[place + 1] - ends[place]
        widening = (distances[place + 1] - distances[place]) / size
        winding = (azimuths[place + 1] - azimuths[place]) / size
        begin = RoutePoint(number, size, distances[place], azimuths[place], widening, winding)
        points += _gauss(begin, length)
    return points


def _gauss(begin: RoutePoint, length: float, halvings: int = _HALVINGS) -> Iterator[RoutePoint]:
    """The fewest points for a part of a table row; `begin` is where it begins, with the length of the part as its weight."""
    if begin.widening == 0.0 and begin.winding == 0.0:
        yield begin
        return
    farthest = max(begin.distance, begin.distance + begin.weight * begin.widening)
    bend = min(1.0, 0.5 * length / max(farthest, 1e-30)) / length
    shapes = [(bend, 0.0, 0.0, 1.0), (0.0, bend, 0.0, 1.0), (0.7 * bend, -0.7 * bend, 1.0 / length, 1.0)]

    def lengths(count: int) -> FloatArray:
        points = _spread(begin, count)
        return np.array([sum(point.weight * point.stretch(shape) for point in points) for shape in shapes])

    exact = lengths(_MANY)
    for count in _COUNTS:
        if np.all(np.abs(lengths(count) - exact) <= _EXACT * exact):
            yield from _spread(begin, count)
            return
    if halvings == 0:
        yield from _spread(begin, _MANY)
        return
    half = 0.5 * begin.weight
    yield from _gauss(begin._replace(weight=half), length, halvings - 1)
    distance, azimuth = begin.distance + half * begin.widening, begin.azimuth + half * begin.winding
    yield from _gauss(begin._replace(weight=half, distance=distance, azimuth=azimuth), length, halvings - 1)


def _spread(begin: RoutePoint, count: int) -> list[RoutePoint]:
    """Gauss points of a part."""
    return [
        begin._replace(
            weight=begin.weight * share,
            distance=begin.distance + begin.weight * place * begin.widening,
            azimuth=begin.azimuth + begin.weight * place * begin.winding,
        )
        for place, share in _nodes(count)
    ]


@cache
def _nodes(count: int) -> tuple[tuple[float, float], ...]:
    """Places and weights of Gauss and Legendre on (0, 1)."""
    places, weights = np.polynomial.legendre.leggauss(count)
    return tuple(zip((0.5 + 0.5 * places).tolist(), (0.5 * weights).tolist(), strict=True))
