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
_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
_PRODUCTS = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2).reshape(3, 9)  # of the axes


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
        """Two directions across the normal, shape (m, 2, 3), and the curvature of `phi` along each, shape (m, 2) [1/m]."""

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Shares `s` of the way, shape (m, k), where `start + s span` crosses between features; any number if it does not."""


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross products of rows, shape (..., 3); several times faster than `np.cross` on few."""
    return np.asarray(a.take(_NEXT, -1) * b.take(_LAST, -1) - a.take(_LAST, -1) * b.take(_NEXT, -1))


def skew(vectors: FloatArray) -> FloatArray:
    """Matrices of the products `v x` of rows, shape (m, 3), as shape (m, 3, 3)."""
    return np.asarray(vectors.dot(_PRODUCTS)).reshape(-1, 3, 3)


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
        return np.zeros((len(points), 2, 3)), np.zeros((len(points), 2))

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
        local = ((points - self.centres[which])[..., None, :] @ self.rotations[which])[..., 0, :]
        beyond = np.abs(local) - self.halves[which]
        outside = np.maximum(beyond, 0.0)
        return local, beyond, np.sqrt((outside * outside).sum(axis=-1))

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each body."""
        _, beyond, outside = self._beyond(points[:, None, :], slice(None))
        return np.asarray(outside + np.minimum(beyond.max(axis=-1), 0.0) - self.radii)

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        local, beyond, outside = self._beyond(points, which)
        deepest = beyond.argmax(axis=1)
        rows = np.arange(len(points))
        within = outside < _TINY
        normal = np.maximum(beyond, 0.0) / np.where(within, 1.0, outside)[:, None]
        normal[rows[within], deepest[within]] = 1.0
        normal *= np.where(local < 0.0, -1.0, 1.0)
        distance = outside + np.minimum(beyond[rows, deepest], 0.0) - self.radii[which]
        return distance, (self.rotations[which] @ normal[..., None])[..., 0]

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """The same along both directions at a vertex or round end, zero along edge or axis, zero at faces."""
        local, beyond, outside = self._beyond(points, which)
        beyond = np.where(self.halves[which] > 0.0, beyond, np.inf)
        curved = beyond > ON_BORDER * outside[:, None]
        count = curved.sum(axis=1) * (outside > _TINY)
        normal = np.maximum(np.abs(local) - self.halves[which], 0.0) * np.where(local < 0.0, -1.0, 1.0)
        normal /= np.maximum(outside, _TINY)[:, None]
        straight = np.eye(3)[np.where(curved, np.abs(normal), -1.0).argmin(axis=1)]  # the edge, or the axis most across
        first = cross(straight, normal)
        first /= np.maximum(np.sqrt((first * first).sum(axis=1)), _TINY)[:, None]
        directions = np.stack([first, cross(normal, first)], axis=1)
        curvatures = (count[:, None] > [1, 2]) / np.maximum(outside, _TINY)[:, None]
        return directions @ np.swapaxes(self.rotations[which], 1, 2), np.where(count[:, None] > [1, 2], curvatures, 0.0)

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the coordinates pass the faces."""
        rotations, halves = self.rotations[which], self.halves[which]
        local = ((starts - self.centres[which])[:, None, :] @ rotations)[:, 0]
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
        local = ((points - self.centres[which])[..., None, :] @ self.rotations[which])[..., 0, :]
        from_axis = np.hypot(local[..., 0], local[..., 1])
        beyond = np.stack([from_axis - self.radii[which], np.abs(local[..., 2]) - self.halves[which]], axis=-1)
        return local, from_axis, beyond, np.hypot(*np.moveaxis(np.maximum(beyond, 0.0), -1, 0))

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance of each point from each body."""
        _, _, beyond, outside = self._beyond(points[:, None, :], slice(None))
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
        return outside + np.minimum(beyond.max(axis=1), 0.0), (self.rotations[which] @ normal[..., None])[..., 0]

    def curvature(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Around the axis, and across the rim."""
        local, from_axis, beyond, outside = self._beyond(points, which)
        slopes = self._slopes(beyond, outside)
        across = np.zeros_like(local)
        across[:, 0], across[:, 1] = -local[:, 1], local[:, 0]
        across[from_axis < _TINY, 1] = 1.0
        across /= np.maximum(from_axis, 1.0 * (from_axis < _TINY))[:, None]
        outward = cross(across, np.broadcast_to([0.0, 0.0, 1.0], across.shape))
        upward = np.where(local[:, 2] < 0.0, -1.0, 1.0)
        rim = (beyond > ON_BORDER * outside[:, None]).all(axis=1) & (outside > _TINY)
        over = -slopes[:, 1:] * outward
        over[:, 2] = slopes[:, 0] * upward
        around = np.where(outside > _TINY, slopes[:, 0] / np.maximum(from_axis, _TINY), 0.0)
        curvatures = np.stack([around, np.where(rim, 1.0 / np.maximum(outside, _TINY), 0.0)], axis=1)
        return np.stack([across, over], axis=1) @ np.swapaxes(self.rotations[which], 1, 2), curvatures

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where it passes the planes of the ends, and the side."""
        rotations, half, radius = self.rotations[which], self.halves[which], self.radii[which]
        local = ((starts - self.centres[which])[:, None, :] @ rotations)[:, 0]
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
