"""Signed distances from convex polyhedra: in the Voronoi region of a face, an edge or a corner that holds the nearest point."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross
from softrobots.environment.convex_mesh import Hull
from softrobots.environment.single_bodies import ON_BORDER, Bends, Triple

_ROUNDING = 1e-13  # of the size


class Polyhedra:
    """Convex polyhedra: a `softrobots.environment.distance_fields.Field`."""

    def __init__(self, rotations: FloatArray, centres: FloatArray, hulls: list[Hull]) -> None:
        """Take axes, shape (n, 3, 3), origins, shape (n, 3) [m], and the polyhedra in their own axes."""
        self.rotations, self.centres, self.hulls = rotations, centres, hulls
        self.radii = np.zeros(len(hulls))

    def at_least(self, points: FloatArray) -> FloatArray:
        """Largest distance from the planes of the faces: the distance inside and at faces, else a lower bound of it."""
        found = np.zeros((len(points), len(self.hulls)))
        for place, hull in enumerate(self.hulls):
            local = (points - self.centres[place]) @ self.rotations[place]
            found[:, place] = (local @ hull.normals.T - hull.offsets).max(axis=1)
        return found

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        return self._nearest(points, which)[:2]

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Nothing at faces, across the edge at an edge, the same in both directions across the normal at a corner."""
        near = self._nearest(np.array([point]), np.array([number]))
        n, along, bend = near.normals[0], near.along[0], float(near.bends[0])
        if bend == 0.0:
            return []
        edge = bool(along.any())
        across = cross(along if edge else np.eye(3)[int(np.abs(n).argmin())], n)
        across /= np.sqrt(across @ across)
        both: Any = [across.tolist(), cross(n, across).tolist()]
        return [(direction, bend) for direction in both[: 1 if edge else 2]]

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        near = self._nearest(points, which)
        straight = np.vecdot(near.normals, directions) ** 2 + np.vecdot(near.along, directions) ** 2
        return near.distances, near.normals, near.bends * (np.vecdot(directions, directions) - straight)

    def single(self, number: int) -> None:
        """None: its features are many."""

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the nearest point passes from a face to an edge (two columns an edge), or from an edge to a corner (two)."""
        shares = np.full((len(starts), 4 * max(len(hull.edges) for hull in self.hulls)), np.inf)
        for body, rows, local in self._by_body(starts, which):
            found = _crossings(self.hulls[body], local, spans[rows] @ self.rotations[body])
            shares[rows, : found.shape[1]] = found
        return shares

    def _nearest(self, points: FloatArray, which: Any) -> _Nearest:
        found = _Nearest(np.zeros(len(points)), np.zeros_like(points), np.zeros(len(points)), np.zeros_like(points))
        for body, rows, local in self._by_body(points, which):
            distances, normals, bends, along = _beside(self.hulls[body], local)
            found.distances[rows], found.normals[rows] = distances, normals @ self.rotations[body].T
            found.bends[rows], found.along[rows] = bends, along @ self.rotations[body].T
        return found

    def _by_body(self, points: FloatArray, which: Any) -> Iterator[tuple[int, Any, FloatArray]]:
        """Each body of some points, their places, and the points in its axes."""
        for body in set(which.tolist()):
            rows = (which == body).nonzero()[0]
            yield body, rows, (points[rows] - self.centres[body]) @ self.rotations[body]


class _Nearest(NamedTuple):
    """The points of polyhedra that are nearest to some points."""

    distances: FloatArray
    """Signed distances, shape (m,) [m]."""
    normals: FloatArray
    """Normals, shape (m, 3)."""
    bends: FloatArray
    """Curvatures of the distance: zero at faces and inside, one over the distance elsewhere, shape (m,) [1/m]."""
    along: FloatArray
    """Directions of edges, zero at faces and corners, shape (m, 3)."""


def _beside(hull: Hull, points: FloatArray) -> _Nearest:
    """The same of one polyhedron in its own axes.

    A point is over an edge if it is between its ends, and out of both faces there; else over the face whose plane is farthest
    below it, if the nearest point of that is of the body; else over a corner. Borders belong to faces, then to edges.
    """
    size, heights = float(np.abs(hull.corners).max()), points @ hull.normals.T - hull.offsets
    distances, normals = heights.max(axis=1), hull.normals[heights.argmax(axis=1)]
    none, allowed = _Nearest(distances, normals, np.zeros(len(points)), np.zeros_like(points)), _ROUNDING * size
    border = ON_BORDER * distances + allowed
    first = hull.corners[hull.edges[:, 0]]
    places = points @ hull.along.T - np.vecdot(first, hull.along)
    out = (points @ side.T - np.vecdot(first, side) for side in hull.outward)
    inside = np.minimum.reduce([places, hull.lengths - places, *out])  # of the region of each edge
    edge, over = inside.argmax(axis=1), inside.max(axis=1)
    beyond = (heights - distances[:, None] * (normals @ hull.normals.T)).max(axis=1)  # of the nearest point of the plane
    curved = ((distances > allowed) & ((over > border) | (beyond > border))).nonzero()[0]
    if not len(curved):
        return none
    some, edge, on_edge = points[curved], edge[curved], over[curved] >= -border[curved]
    apart = ((some[:, None] - hull.corners) ** 2).sum(axis=2)
    lying = first[edge] + places[curved, edge, None] * hull.along[edge]
    away = some - np.where(on_edge[:, None], lying, hull.corners[apart.argmin(axis=1)])
    none.distances[curved] = length = np.sqrt(np.vecdot(away, away))
    none.normals[curved], none.bends[curved] = away / length[:, None], 1.0 / length
    none.along[curved] = np.where(on_edge[:, None], hull.along[edge], 0.0)
    return none


def _crossings(hull: Hull, starts: FloatArray, ways: FloatArray) -> FloatArray:
    """Shares of ways at which they cross the borders of the edges of a polyhedron in its own axes, shape (m, 4 e)."""
    first = hull.corners[hull.edges[:, 0]]
    with np.errstate(divide="ignore", invalid="ignore"):
        leaving = [(np.vecdot(first, side) - starts @ side.T) / (ways @ side.T) for side in hull.outward]  # over the edge
        begins, speeds = np.vecdot(first, hull.along) - starts @ hull.along.T, ways @ hull.along.T
        shares = np.stack([*leaving, begins / speeds, (begins + hull.lengths) / speeds], axis=2)
    rows, edges, columns = ((shares > 0.0) & (shares < 1.0)).nonzero()
    points = starts[rows] + shares[rows, edges, columns, None] * ways[rows] - first[edges]
    lying, size, side = np.vecdot(points, hull.along[edges]), float(np.abs(hull.corners).max()), np.minimum(columns, 1)
    above = np.vecdot(points, hull.normals[hull.sides[side, edges]]) >= 0.0
    on_edge = (lying >= 0.0) & (lying <= hull.lengths[edges]) & above
    at_end = np.vecdot(points, hull.outward[:, edges]).min(axis=0) >= -_ROUNDING * size
    real = np.where(columns < 2, on_edge, at_end)
    found = np.full_like(shares, np.inf)
    found[rows[real], edges[real], columns[real]] = shares[rows[real], edges[real], columns[real]]
    return found.reshape(len(starts), -1)
