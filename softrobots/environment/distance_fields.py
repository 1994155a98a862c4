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

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point, shape (m, 3), from each body, or a lower bound of it outside, shape (m, n) [m]."""

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance, shape (m,) [m], and normal, shape (m, 3), at points, shape (m, 3)."""

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        r"""Directions `a`, shape (m, k, 3), and weights `c`, shape (m, k) [1/m]: :math:`H = \sum_k c_k\, a_k a_k^T`."""

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

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each plane."""
        return np.asarray(points @ self.normals.T - self.offsets)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        normals = self.normals.take(which, 0)
        return (points * normals).sum(axis=1) - self.offsets.take(which), normals

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Zero: planes."""
        return np.zeros((len(points), 0, 3)), np.zeros((len(points), 0))

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """None: one face."""
        return np.zeros((len(starts), 0))


class RoundedBoxes(NamedTuple):
    """Boxes with all points within a radius of them: boxes (radius 0), spheres (no size) and capsules (a length only)."""

    rotations: FloatArray
    """Axes, shape (n, 3, 3)."""
    centres: FloatArray
    """Centres, shape (n, 3) [m]."""
    halves: FloatArray
    """Half the edges, shape (n, 3) [m]."""
    radii: FloatArray
    """Radii, shape (n,) [m]."""

    def _beyond(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Points in the axes of the bodies, how far they are beyond the faces, and the distance from the box."""
        local = ((points - self.centres.take(which, 0))[..., None, :] @ self.rotations.take(which, 0))[..., 0, :]
        beyond = np.abs(local) - self.halves.take(which, 0)
        outside = np.maximum(beyond, 0.0)
        return local, beyond, np.sqrt(np.einsum("...i,...i", outside, outside))

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each body."""
        _, beyond, outside = self._beyond(points[:, None, :], np.arange(len(self.radii)))
        return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0) - self.radii)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        local, beyond, outside = self._beyond(points, which)
        normal = np.maximum(beyond, 0.0) / np.maximum(outside, _TINY)[:, None]
        distance = outside - self.radii.take(which)
        within = (outside < _TINY).nonzero()[0]
        if len(within):
            deepest = beyond[within].argmax(axis=1)
            normal[within, deepest] = 1.0
            distance[within] += beyond[within, deepest]
        normal = np.copysign(normal, local)
        return distance, (self.rotations.take(which, 0) @ normal[..., None])[..., 0]

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """One over the distance, in the coordinates that are beyond faces and across the normal; zero at faces."""
        local, beyond, outside = self._beyond(points, which)
        curved = (beyond > ON_BORDER * outside[:, None]) | (self.halves.take(which, 0) == 0.0)
        size = np.where((curved.sum(axis=1) > 1) & (outside > _TINY), 1.0 / np.maximum(outside, _TINY), 0.0)[:, None]
        rotations = self.rotations.take(which, 0)
        normal = np.maximum(beyond, 0.0) * np.where(local < 0.0, -size, size)
        directions = np.concatenate([rotations.swapaxes(1, 2), (rotations @ normal[:, :, None]).swapaxes(1, 2)], axis=1)
        return directions, np.concatenate([curved * size, -size], axis=1)

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the coordinates pass the faces."""
        rotations, halves = self.rotations.take(which, 0), self.halves.take(which, 0)
        local = ((starts - self.centres.take(which, 0))[:, None, :] @ rotations)[:, 0]
        along = (spans[:, None, :] @ rotations)[:, 0]
        along = np.where((halves > 0.0) & (np.abs(along) > _TINY), along, np.inf)
        return np.concatenate([(halves - local) / along, (-halves - local) / along], axis=1)


class Cylinders(NamedTuple):
    """Cylinders with flat ends."""

    rotations: FloatArray
    """Axes, z along the axis, shape (n, 3, 3)."""
    centres: FloatArray
    """Centres, shape (n, 3) [m]."""
    halves: FloatArray
    """Half the lengths, shape (n,) [m]."""
    radii: FloatArray
    """Radii, shape (n,) [m]."""

    def _beyond(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Points in the axes of the bodies, distances from the axis, and how far they are beyond side and ends, (..., 2)."""
        local = ((points - self.centres.take(which, 0))[..., None, :] @ self.rotations.take(which, 0))[..., 0, :]
        from_axis = np.hypot(local[..., 0], local[..., 1])
        beyond = np.stack([from_axis - self.radii.take(which), np.abs(local[..., 2]) - self.halves.take(which)], axis=-1)
        outside = np.maximum(beyond, 0.0)
        return local, from_axis, beyond, np.sqrt(np.einsum("...i,...i", outside, outside))

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each body."""
        _, _, beyond, outside = self._beyond(points[:, None, :], np.arange(len(self.radii)))
        return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0))

    def _slopes(self, beyond: FloatArray, outside: FloatArray) -> FloatArray:
        """Derivatives of the distance by the distance from the axis and beyond the ends, shape (m, 2)."""
        inside = np.eye(2)[beyond.argmax(axis=1)]
        return np.where((outside < _TINY)[:, None], inside, np.maximum(beyond, 0.0) / np.maximum(outside, _TINY)[:, None])

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        local, from_axis, beyond, outside = self._beyond(points, which)
        slopes = self._slopes(beyond, outside)
        normal = local * (slopes[:, 0] / np.maximum(from_axis, _TINY))[:, None]
        normal[:, 0] += slopes[:, 0] * (from_axis < _TINY)  # on the axis: any direction across
        normal[:, 2] = np.where(local[:, 2] < 0.0, -slopes[:, 1], slopes[:, 1])
        return outside + np.minimum(beyond.max(axis=1), 0.0), (self.rotations.take(which, 0) @ normal[..., None])[..., 0]

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Around the axis at side and rim, and across the rim."""
        local, from_axis, beyond, outside = self._beyond(points, which)
        slopes = self._slopes(beyond, outside)
        rotations = self.rotations.take(which, 0)
        outward = (local * _RADIAL) / np.maximum(from_axis, _TINY)[:, None]
        outward[:, 0] += from_axis < _TINY
        normal = slopes[:, :1] * outward
        normal[:, 2] = np.where(local[:, 2] < 0.0, -slopes[:, 1], slopes[:, 1])
        around = np.stack([-outward[:, 1], outward[:, 0], outward[:, 2]], axis=1)
        axes = np.broadcast_to(_AXIS, outward.shape)
        across = np.where(outside > _TINY, slopes[:, 0] / np.maximum(from_axis, _TINY), 0.0)
        rim = (beyond > ON_BORDER * outside[:, None]).all(axis=1) & (outside > _TINY)
        size = np.where(rim, 1.0 / np.maximum(outside, _TINY), 0.0)
        directions = np.stack([around, outward, axes, normal], axis=1) @ rotations.swapaxes(1, 2)
        return directions, np.stack([across, size, size, -size], axis=1)

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where it passes the planes of the ends, and the side."""
        rotations, half, radius = self.rotations.take(which, 0), self.halves.take(which), self.radii.take(which)
        local = ((starts - self.centres.take(which, 0))[:, None, :] @ rotations)[:, 0]
        along = (spans[:, None, :] @ rotations)[:, 0]
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
