r"""Signed distances from convex bodies, with normal and curvature, in closed form for many points at once.

The signed distance `phi` of a convex body is a convex function: positive outside, inside minus the depth below the nearest
surface. Outside, `n = grad phi` points away from the nearest point, and the Hessian has `n` in its null space. With `d` the
distance from a curved feature: 0 at a plane, :math:`(I - n n^T) / d` at a point (vertex, centre of a sphere),
:math:`(I - n n^T - e e^T) / d` at a line along `e` (edge, axis), and both curvatures of the circle at the rim of a cylinder
(`theory.md`, "Contact").
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.single_bodies import ON_BORDER, Bends, Body, Triple

_TINY = 1e-300
_RADIAL = np.array([1.0, 1.0, 0.0])


class Field(Protocol):
    """Signed distances from several bodies; `which` gives the body of each point, shape (m,)."""

    @property
    def radii(self) -> FloatArray:
        """Distance of the surface from the features within, shape (n,) [m]."""

    def at_least(self, points: FloatArray) -> FloatArray:
        """Lower bound of the distance of each point, shape (m, 3), from each body, shape (m, n) [m]; cheaper than `at`."""

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance, shape (m,) [m], and normal, shape (m, 3), at points, shape (m, 3)."""

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Second derivative of the distance from a body at a point, with the distance and normal of `at`."""

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and `t^T H t` of directions `t`, shape (m, 3): shape (m,) [1/m]."""

    def single(self, number: int) -> Body | None:
        """A body in plain numbers; None if it has no closed form."""

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Shares `s` of the way, shape (m, k), where `start + s span` crosses between features; any number if it does not."""


class HalfSpaces(NamedTuple):
    """Half-spaces."""

    normals: FloatArray
    """Out of the wall, shape (n, 3)."""
    offsets: FloatArray
    """Distances of the planes from the origin, shape (n,) [m]."""

    @property
    def radii(self) -> FloatArray:
        """Zero: planes."""
        return np.zeros(len(self.offsets))

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each plane."""
        return np.asarray(points.dot(self.normals.T) - self.offsets)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        normals = self.normals.take(which, 0)
        return (points * normals).sum(axis=1) - self.offsets.take(which), normals

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Nothing: planes."""
        return []

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance, normal and zero."""
        return *self.at(points, which), np.zeros(len(points))

    def single(self, number: int) -> None:
        """None: they need none."""

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """None: one face."""
        return np.zeros((len(starts), 0))


def _of(values: Any, which: Any) -> Any:
    """Values of the body of each point; of a single body once for all points."""
    return values if len(values) == 1 else values.take(which, 0)


def _turned_into(rotations: FloatArray, which: Any, vectors: FloatArray) -> FloatArray:
    """Vectors, shape (m, 3), in the axes of their bodies; of a single body as one product."""
    if len(rotations) == 1:
        return vectors.dot(rotations[0])  # type: ignore[no-any-return]
    return np.asarray(np.vecmat(vectors, rotations.take(which, 0)))


def _turned_out(rotations: FloatArray, which: Any, vectors: FloatArray) -> FloatArray:
    """Vectors in the axes of their bodies, shape (m, 3), in world axes."""
    if len(rotations) == 1:
        return vectors.dot(rotations[0].T)  # type: ignore[no-any-return]
    return np.asarray(np.matvec(rotations.take(which, 0), vectors))


def _single(rotations: FloatArray, centres: FloatArray, number: int, halves: Triple, radius: float, is_round: bool) -> Body:
    """A body in plain numbers."""
    rows: Any = rotations[number].tolist()
    return Body(rows, centres[number].tolist(), halves, radius, is_round, math.hypot(*halves) + radius)


class _Around(NamedTuple):
    """Capsules around bodies."""

    axes: FloatArray
    """Directions of the straight parts, shape (n, 3)."""
    centres: FloatArray
    """Centres, shape (n, 3) [m]."""
    halves: FloatArray
    """Half the lengths of the straight parts, shape (n,) [m]."""
    radii: FloatArray
    """Radii, shape (n,) [m]."""

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each capsule."""
        ways = points[:, None] - self.centres
        along = np.abs(np.vecdot(ways, self.axes))
        beyond = np.maximum(along - self.halves, 0.0)
        squares = np.maximum(np.vecdot(ways, ways) - along * along, 0.0)
        return np.asarray(np.sqrt(squares + beyond * beyond) - self.radii)


class RoundedBoxes:
    """Boxes with all points within a radius of them: boxes (radius 0), spheres (no size) and capsules (a length only)."""

    def __init__(self, rotations: FloatArray, centres: FloatArray, halves: FloatArray, radii: FloatArray) -> None:
        """Take the axes, shape (n, 3, 3), centres, shape (n, 3), half the edges, shape (n, 3), and radii, shape (n,) [m]."""
        self.rotations, self.centres, self.halves, self.radii = rotations, centres, halves, radii
        self._thin, self._faces, self._singles = halves == 0.0, bool(halves.any()), dict[int, Body]()
        rows, longest = np.arange(len(halves)), halves.argmax(axis=1)
        others = np.sort(halves, axis=1)[:, :2]
        around = radii + np.hypot(others[:, 0], others[:, 1])
        self._around = _Around(rotations[rows, :, longest], centres, halves[rows, longest], around)

    def single(self, number: int) -> Body:
        """A body in plain numbers."""
        if number not in self._singles:
            halves, radius = tuple(self.halves[number].tolist()), float(self.radii[number])
            self._singles[number] = _single(self.rotations, self.centres, number, halves, radius, False)
        return self._singles[number]

    def _beyond(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Points in the axes of the bodies, how far beyond the faces, the same or zero, and the distance from the box."""
        local = _turned_into(self.rotations, which, points - _of(self.centres, which))
        beyond = np.abs(local) - _of(self.halves, which)
        outside = np.maximum(beyond, 0.0)
        return local, beyond, outside, np.sqrt(np.vecdot(outside, outside))

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance from a capsule around the body, exact for spheres and capsules."""
        return self._around.at_least(points)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        distance, normal = self._at(which, *self._beyond(points, which))
        return distance, _turned_out(self.rotations, which, normal)

    def _at(
        self, which: Any, local: FloatArray, beyond: FloatArray, outside: FloatArray, distance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Distance, and normal in the axes of the body, from what `_beyond` returns."""
        within = (distance < _TINY).nonzero()[0]
        normal = outside / (np.maximum(distance, _TINY) if len(within) else distance)[:, None]
        distance = distance - _of(self.radii, which)
        if len(within):
            deepest = beyond[within].argmax(axis=1)
            normal[within, deepest] = 1.0
            distance[within] += beyond[within, deepest]
        return distance, np.copysign(normal, local)

    def _round(self, which: Any, normals: FloatArray, distances: FloatArray) -> tuple[Any, FloatArray]:
        """Coordinates that are beyond faces, shape (m, 3), and one over the distance, zero at faces, shape (m,) [1/m].

        Of normals in the axes of the bodies, and distances from the boxes without the radius.
        """
        curved = (np.abs(normals) > ON_BORDER) | _of(self._thin, which)
        size = ((np.add.reduce(curved, 1) > 1) & (distances > _TINY)) / np.maximum(distances, _TINY)
        return curved, size

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Second derivative of the distance."""
        return self.single(number).bends(distance, normal)

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        found = self._beyond(points, which)
        distance, normal = self._at(which, *found)
        turned = _turned_into(self.rotations, which, directions)
        slopes = np.vecdot(normal, turned)
        curved, size = self._round(which, normal, found[3])
        bend = size * (np.vecdot(curved * turned, turned) - slopes * slopes)
        return distance, _turned_out(self.rotations, which, normal), bend

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the coordinates pass the faces."""
        if not self._faces:
            return np.zeros((len(starts), 0))
        halves = _of(self.halves, which)
        local = _turned_into(self.rotations, which, starts - _of(self.centres, which))
        along = _turned_into(self.rotations, which, spans)
        along = np.where((halves > 0.0) & (np.abs(along) > _TINY), along, np.inf)
        return np.concatenate([(halves - local) / along, (-halves - local) / along], axis=1)


class Cylinders:
    """Cylinders with flat ends."""

    def __init__(self, rotations: FloatArray, centres: FloatArray, halves: FloatArray, radii: FloatArray) -> None:
        """Take axes, z along the axis, shape (n, 3, 3), centres, shape (n, 3), half the lengths, and radii, shape (n,) [m]."""
        self.rotations, self.centres, self.halves, self.radii = rotations, centres, halves, radii
        self._around, self._singles = _Around(rotations[:, :, 2], centres, halves, radii), dict[int, Body]()

    def single(self, number: int) -> Body:
        """A body in plain numbers."""
        if number not in self._singles:
            radius, half = float(self.radii[number]), float(self.halves[number])
            self._singles[number] = _single(self.rotations, self.centres, number, (radius, radius, half), 0.0, True)
        return self._singles[number]

    def _at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance, and normal in the axes of the body."""
        local = _turned_into(self.rotations, which, points - _of(self.centres, which))
        from_axis, beyond = np.hypot(local[:, 0], local[:, 1]), np.zeros((len(points), 2))
        beyond[:, 0] = from_axis - _of(self.radii, which)
        beyond[:, 1] = np.abs(local[:, 2]) - _of(self.halves, which)
        slopes = np.maximum(beyond, 0.0)
        distance = np.sqrt(np.vecdot(slopes, slopes))
        slopes /= np.maximum(distance, _TINY)[:, None]
        within = (distance < _TINY).nonzero()[0]
        if len(within):
            deepest = beyond[within].argmax(axis=1)
            slopes[within, deepest] = 1.0
            distance[within] += beyond[within, deepest]
        normal = local * (slopes[:, 0] / np.maximum(from_axis, _TINY))[:, None]
        on_axis = (from_axis < _TINY).nonzero()[0]
        normal[on_axis, 0] = slopes[on_axis, 0]  # any direction across
        normal[:, 2] = np.copysign(slopes[:, 1], local[:, 2])
        return distance, normal

    def _round(self, which: Any, normals: FloatArray, distances: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Directions from the axis, curvature around it, and across the rim, zero elsewhere, from what `_at` returns."""
        radial = np.hypot(normals[:, 0], normals[:, 1])
        outside, from_axis = distances > _TINY, _of(self.radii, which) + distances * radial
        rim = outside & (radial > ON_BORDER) & (np.abs(normals[:, 2]) > ON_BORDER)
        outward = (normals * _RADIAL) / np.maximum(radial, _TINY)[:, None]
        return outward, outside * radial / np.maximum(from_axis, _TINY), rim / np.maximum(distances, _TINY)

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance from a capsule around the body."""
        return self._around.at_least(points)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        distance, normal = self._at(points, which)
        return distance, _turned_out(self.rotations, which, normal)

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Second derivative of the distance."""
        return self.single(number).bends(distance, normal)

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        distance, normal = self._at(points, which)
        outward, across, size = self._round(which, normal, distance)
        turned = _turned_into(self.rotations, which, directions)
        radial, axial = np.vecdot(outward, turned), turned[:, 2]
        around = outward[:, 0] * turned[:, 1] - outward[:, 1] * turned[:, 0]
        slopes = np.vecdot(normal, turned)
        bend = across * around * around + size * (radial * radial + axial * axial - slopes * slopes)
        return distance, _turned_out(self.rotations, which, normal), bend

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where it passes the planes of the ends, and the side."""
        half, radius = _of(self.halves, which), _of(self.radii, which)
        local = _turned_into(self.rotations, which, starts - _of(self.centres, which))
        along = _turned_into(self.rotations, which, spans)
        rise = np.where(np.abs(along[:, 2]) > _TINY, along[:, 2], np.inf)
        square = along[:, 0] ** 2 + along[:, 1] ** 2
        turn = local[:, 0] * along[:, 0] + local[:, 1] * along[:, 1]
        root = turn**2 - square * (local[:, 0] ** 2 + local[:, 1] ** 2 - radius**2)
        root = np.sqrt(np.where((root > 0.0) & (square > _TINY), root, np.inf))
        square = np.where(square > _TINY, square, 1.0)
        return np.stack(
            [(half - local[:, 2]) / rise, (-half - local[:, 2]) / rise, (-turn - root) / square, (-turn + root) / square],
            axis=1,
        )
