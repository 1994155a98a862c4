r"""Signed distances from convex bodies, with normal and curvature, in closed form for many points at once.

The signed distance `phi` of a convex body is a convex function: positive outside, inside minus the depth below the nearest
surface. Outside, `n = grad phi` points away from the nearest point, and the Hessian has `n` in its null space. With `d` the
distance from a curved feature: 0 at a plane, :math:`(I - n n^T) / d` at a point (vertex, centre of a sphere),
:math:`(I - n n^T - e e^T) / d` at a line along `e` (edge, axis), and both curvatures of the circle at the rim of a cylinder
(`theory.md`, "Contact").
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from softrobots.core.checks import FloatArray

ON_BORDER = 1e-9
"""Distance beyond a face, over that from the body, below which a point belongs to the face; exact at crossed borders."""
_TINY = 1e-300
_RADIAL, _AXIS = np.array([1.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


class Field(Protocol):
    """Signed distances from several bodies; `which` gives the body of each point, shape (m,)."""

    @property
    def radii(self) -> FloatArray:
        """Distance of the surface from the features within, shape (n,) [m]."""

    def at_least(self, points: FloatArray) -> FloatArray:
        """Lower bound of the distance of each point, shape (m, 3), from each body, shape (m, n) [m]; cheaper than `at`."""

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance, shape (m,) [m], and normal, shape (m, 3), at points, shape (m, 3)."""

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        r"""Directions `a`, shape (m, k, 3), and weights `c`, shape (m, k) [1/m]: :math:`H = \sum_k c_k\, a_k a_k^T`."""

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and `t^T H t` of directions `t`, shape (m, 3): shape (m,) [1/m]."""

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

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Zero: planes."""
        return np.zeros((len(points), 0, 3)), np.zeros((len(points), 0))

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance, normal and zero."""
        return *self.at(points, which), np.zeros(len(points))

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """None: one face."""
        return np.zeros((len(starts), 0))


def _turned_into(rotations: FloatArray, which: Any, vectors: FloatArray) -> FloatArray:
    """Vectors, shape (m, 3), in the axes of their bodies; of a single body as one product."""
    if len(rotations) == 1:
        return np.asarray(vectors.dot(rotations[0]))
    return np.asarray(np.vecmat(vectors, rotations.take(which, 0)))


def _turned_out(rotations: FloatArray, which: Any, vectors: FloatArray) -> FloatArray:
    """Vectors in the axes of their bodies, shape (m, 3), in world axes."""
    if len(rotations) == 1:
        return np.asarray(vectors.dot(rotations[0].T))
    return np.asarray(np.matvec(rotations.take(which, 0), vectors))


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
        self._thin, self._faces = halves == 0.0, bool(halves.any())
        rows, longest = np.arange(len(halves)), halves.argmax(axis=1)
        others = np.sort(halves, axis=1)[:, :2]
        around = radii + np.hypot(others[:, 0], others[:, 1])
        self._around = _Around(rotations[rows, :, longest], centres, halves[rows, longest], around)

    def _beyond(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Points in the axes of the bodies, how far beyond the faces, the same or zero, and the distance from the box."""
        local = _turned_into(self.rotations, which, points - self.centres.take(which, 0))
        beyond = np.abs(local) - self.halves.take(which, 0)
        outside = np.maximum(beyond, 0.0)
        return local, beyond, outside, np.sqrt(np.vecdot(outside, outside))

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance from a capsule around the body, exact for spheres and capsules."""
        return self._around.at_least(points)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        return self._at(which, *self._beyond(points, which))

    def _at(
        self, which: Any, local: FloatArray, beyond: FloatArray, outside: FloatArray, distance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Distance and normal from what `_beyond` returns."""
        within = (distance < _TINY).nonzero()[0]
        normal = outside / (np.maximum(distance, _TINY) if len(within) else distance)[:, None]
        distance = distance - self.radii.take(which)
        if len(within):
            deepest = beyond[within].argmax(axis=1)
            normal[within, deepest] = 1.0
            distance[within] += beyond[within, deepest]
        return distance, _turned_out(self.rotations, which, np.copysign(normal, local))

    def _round(self, which: Any, beyond: FloatArray, distance: FloatArray) -> tuple[Any, FloatArray]:
        """Coordinates that are beyond faces, shape (m, 3), and one over the distance, zero at faces, shape (m,) [1/m]."""
        curved = (beyond > ON_BORDER * distance[:, None]) | self._thin.take(which, 0)
        size = ((np.add.reduce(curved, 1) > 1) & (distance > _TINY)) / np.maximum(distance, _TINY)
        return curved, size

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """One over the distance, in the coordinates that are beyond faces and across the normal; zero at faces."""
        local, beyond, outside, distance = self._beyond(points, which)
        curved, size = self._round(which, beyond, distance)
        if not size.any():  # faces
            return np.zeros((len(points), 0, 3)), np.zeros((len(points), 0))
        size = size[:, None]
        normal = _turned_out(self.rotations, which, np.copysign(outside * size, local))
        directions = np.concatenate([self.rotations.take(which, 0).swapaxes(1, 2), normal[:, None]], axis=1)
        return directions, np.concatenate([curved * size, -size], axis=1)

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        found = self._beyond(points, which)
        distance, normal = self._at(which, *found)
        curved, size = self._round(which, found[1], found[3])
        turned = _turned_into(self.rotations, which, directions)
        slopes = np.vecdot(normal, directions)
        return distance, normal, size * (np.vecdot(curved * turned, turned) - slopes * slopes)

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the coordinates pass the faces."""
        if not self._faces:
            return np.zeros((len(starts), 0))
        halves = self.halves.take(which, 0)
        local = _turned_into(self.rotations, which, starts - self.centres.take(which, 0))
        along = _turned_into(self.rotations, which, spans)
        along = np.where((halves > 0.0) & (np.abs(along) > _TINY), along, np.inf)
        return np.concatenate([(halves - local) / along, (-halves - local) / along], axis=1)


class _BesideCylinder(NamedTuple):
    """Points in the axes of cylinders."""

    from_axis: FloatArray
    """Distances from the axis, shape (m,) [m]."""
    beyond: FloatArray
    """How far they are beyond side and ends, shape (m, 2) [m]."""
    outside: FloatArray
    """Distances from the cylinder, zero inside, shape (m,) [m]."""
    slopes: FloatArray
    """Derivatives of the distance by the distance from the axis and beyond the ends, shape (m, 2)."""
    outward: FloatArray
    """Directions from the axis, shape (m, 3)."""
    normal: FloatArray
    """Normals, shape (m, 3)."""

    @property
    def distance(self) -> FloatArray:
        """Signed distances, shape (m,) [m]."""
        return np.asarray(self.outside + np.minimum(self.beyond.max(axis=1), 0.0))

    @property
    def curvatures(self) -> tuple[FloatArray, FloatArray]:
        """Around the axis, and across the rim, zero elsewhere; both of shape (m,) [1/m]."""
        positive = np.maximum(self.outside, _TINY)
        across = np.where(self.outside > _TINY, self.slopes[:, 0] / np.maximum(self.from_axis, _TINY), 0.0)
        rim = (self.beyond > ON_BORDER * self.outside[:, None]).all(axis=1) & (self.outside > _TINY)
        return across, np.where(rim, 1.0 / positive, 0.0)


class Cylinders:
    """Cylinders with flat ends."""

    def __init__(self, rotations: FloatArray, centres: FloatArray, halves: FloatArray, radii: FloatArray) -> None:
        """Take axes, z along the axis, shape (n, 3, 3), centres, shape (n, 3), half the lengths, and radii, shape (n,) [m]."""
        self.rotations, self.centres, self.halves, self.radii = rotations, centres, halves, radii
        self._around = _Around(rotations[:, :, 2], centres, halves, radii)

    def _beyond(self, points: FloatArray, which: Any) -> _BesideCylinder:
        """Points in the axes of the bodies."""
        local = _turned_into(self.rotations, which, points - self.centres.take(which, 0))
        from_axis, beyond = np.hypot(local[:, 0], local[:, 1]), np.zeros((len(points), 2))
        beyond[:, 0] = from_axis - self.radii.take(which)
        beyond[:, 1] = np.abs(local[:, 2]) - self.halves.take(which)
        slopes = np.maximum(beyond, 0.0)
        outside = np.sqrt(np.vecdot(slopes, slopes))
        slopes /= np.maximum(outside, _TINY)[:, None]
        within = (outside < _TINY).nonzero()[0]
        slopes[within, beyond[within].argmax(axis=1)] = 1.0
        outward = (local * _RADIAL) / np.maximum(from_axis, _TINY)[:, None]
        outward[:, 0] += from_axis < _TINY  # on the axis: any direction across
        normal = slopes[:, :1] * outward
        normal[:, 2] = np.copysign(slopes[:, 1], local[:, 2])
        return _BesideCylinder(from_axis, beyond, outside, slopes, outward, normal)

    def at_least(self, points: FloatArray) -> FloatArray:
        """Distance from a capsule around the body."""
        return self._around.at_least(points)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        found = self._beyond(points, which)
        return found.distance, _turned_out(self.rotations, which, found.normal)

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Around the axis at side and rim, and across the rim."""
        found = self._beyond(points, which)
        outward, (across, size) = found.outward, found.curvatures
        around = np.stack([-outward[:, 1], outward[:, 0], outward[:, 2]], axis=1)
        axes = np.broadcast_to(_AXIS, outward.shape)
        directions = np.stack([around, outward, axes, found.normal], axis=1) @ self.rotations.take(which, 0).swapaxes(1, 2)
        return directions, np.stack([across, size, size, -size], axis=1)

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        found = self._beyond(points, which)
        outward, (across, size) = found.outward, found.curvatures
        turned = _turned_into(self.rotations, which, directions)
        radial, axial = np.vecdot(outward, turned), turned[:, 2]
        around = outward[:, 0] * turned[:, 1] - outward[:, 1] * turned[:, 0]
        slopes = np.vecdot(found.normal, turned)
        bend = across * around * around + size * (radial * radial + axial * axial - slopes * slopes)
        return found.distance, _turned_out(self.rotations, which, found.normal), bend

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where it passes the planes of the ends, and the side."""
        half, radius = self.halves.take(which), self.radii.take(which)
        local = _turned_into(self.rotations, which, starts - self.centres.take(which, 0))
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
