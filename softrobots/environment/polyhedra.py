"""Signed distances from convex polyhedra: nearest points by Coal, made exact on the face, edge or corner where they are."""

from __future__ import annotations

from typing import Any, NamedTuple

import coal
import numpy as np
from scipy.optimize import nnls

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross
from softrobots.environment.convex_mesh import Hull
from softrobots.environment.single_bodies import ON_BORDER, Bends, Triple, inner

_TOLERANCE = 1e-12  # of Coal; the nearest point is then within 1e-6 of the size
_TOUCHING = 1e-7  # of the size: faces that hold the nearest point
_ROUNDING = 1e-13  # of the size
_NOWHERE = np.zeros(3)


class Polyhedra:
    """Convex polyhedra: a `softrobots.environment.distance_fields.Field`."""

    def __init__(self, rotations: FloatArray, centres: FloatArray, hulls: list[Hull]) -> None:
        """Take axes, shape (n, 3, 3), origins, shape (n, 3) [m], and the polyhedra in their own axes."""
        self.rotations, self.centres, self.hulls = rotations, centres, hulls
        self.radii = np.zeros(len(hulls))
        self._shapes = [_convex(hull) for hull in hulls]
        self._point, self._here = coal.Sphere(0.0), coal.Transform3s()
        self._request, self._there, self._result = coal.DistanceRequest(), coal.Transform3s(), coal.DistanceResult()
        self._request.gjk_tolerance = _TOLERANCE

    def at_least(self, points: FloatArray) -> FloatArray:
        """Largest distance from the planes of the faces: the distance inside and at faces, else a lower bound of it."""
        found = np.zeros((len(points), len(self.hulls)))
        for place, hull in enumerate(self.hulls):
            local = (points - self.centres[place]) @ self.rotations[place]
            found[:, place] = (local @ hull.normals.T - hull.offsets).max(axis=1)
        return found

    def at(self, points: FloatArray, which: Any) -> tuple[FloatArray, FloatArray]:
        """Distance and normal."""
        found = [self._nearest(point, body) for point, body in zip(points, which.tolist(), strict=True)]
        return np.array([one.distance for one in found]), np.array([one.normal for one in found]).reshape(-1, 3)

    def bends(self, number: int, point: Triple, distance: float, normal: Triple) -> Bends:
        """Nothing at faces, across the edge at an edge, the same in both directions across the normal at a corner."""
        near = self._nearest(np.array(point), number)
        if near.rank < 2:
            return []
        across = cross(near.along, near.normal)
        across /= np.sqrt(across @ across)
        both: Any = [across.tolist(), cross(near.normal, across).tolist()]
        return [(direction, 1.0 / near.distance) for direction in both[: near.rank - 1]]

    def along(self, points: FloatArray, which: Any, directions: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Distance and normal, and the second derivative."""
        distances, normals = self.at(points, which)
        given: Any = zip(
            which.tolist(), points.tolist(), distances.tolist(), normals.tolist(), directions.tolist(), strict=True
        )
        bends = [sum(c * inner(a, way) ** 2 for a, c in self.bends(*one)) for *one, way in given]
        return distances, normals, np.array(bends)

    def single(self, number: int) -> None:
        """None: Coal finds nearest points."""

    def borders(self, starts: FloatArray, spans: FloatArray, which: Any) -> FloatArray:
        """Where the nearest point passes from a face to an edge (two columns an edge), or from an edge to a corner (two)."""
        found = [self._borders(*one) for one in zip(starts, spans, which.tolist(), strict=True)]
        shares = np.full((len(found), max((len(one) for one in found), default=0)), np.inf)
        for row, one in zip(shares, found, strict=True):
            row[: len(one)] = one
        return shares

    def _nearest(self, point: FloatArray, body: int) -> _Nearest:
        hull, rotation = self.hulls[body], self.rotations[body]
        local = rotation.T @ (point - self.centres[body])
        heights = hull.normals @ local - hull.offsets
        highest, size = int(heights.argmax()), float(np.abs(hull.corners).max())
        if heights[highest] <= _ROUNDING * size:  # inside
            return _Nearest(float(heights[highest]), rotation @ hull.normals[highest], 1, _NOWHERE)
        nearest = self._by_coal(local, body)
        holding = hull.normals[hull.normals @ nearest - hull.offsets > -_TOUCHING * size]
        parts = nnls(holding.T, local - nearest)[0]  # the way from the nearest point is a sum of normals of the faces there
        held = parts > ON_BORDER * parts.max()
        faces = holding[held]
        away = faces.T @ np.linalg.lstsq(faces @ faces.T, faces @ (local - nearest), rcond=None)[0]
        distance = float(np.sqrt(away @ away))
        along, rank = _NOWHERE, len(faces)
        if rank == 2:
            along = cross(*faces)
            along /= np.sqrt(along @ along)
            beside = nearest + _TOUCHING * 100.0 * size * np.array([along, -along])
            if (beside @ hull.normals.T - hull.offsets).max(axis=1).min() > 1e-3 * _TOUCHING * size:
                rank = 3  # two faces that meet at a corner alone
        if rank > 2:
            along = np.eye(3)[int(np.abs(away).argmin())]
        return _Nearest(distance, rotation @ (away / distance), min(rank, 3), rotation @ along)

    def _by_coal(self, local: FloatArray, body: int) -> FloatArray:
        self._there.setTranslation(local)
        self._result.clear()
        coal.distance(self._shapes[body], self._here, self._point, self._there, self._request, self._result)
        return np.asarray(self._result.getNearestPoint1())

    def _borders(self, start: FloatArray, span: FloatArray, body: int) -> FloatArray:
        hull, rotation = self.hulls[body], self.rotations[body]
        local, way = rotation.T @ (start - self.centres[body]), rotation.T @ span
        first, last = hull.corners[hull.edges[:, 0]], hull.corners[hull.edges[:, 1]]
        along = last - first
        with np.errstate(divide="ignore", invalid="ignore"):
            leaving = ((first - local)[:, None] * hull.outward).sum(axis=2) / (hull.outward @ way)  # (e, 2): over the edge
            ending = np.stack([((end - local) * along).sum(axis=1) / (along @ way) for end in (first, last)], axis=1)
        shares = np.concatenate([leaving, ending], axis=1)
        shares = np.where((shares > 0.0) & (shares < 1.0), shares, np.inf)
        rows, columns = np.nonzero(np.isfinite(shares))
        ways = local + shares[rows, columns, None] * way - first[rows]
        over = (ways[:, None] * hull.outward[rows]).sum(axis=2)
        lying = (ways * along[rows]).sum(axis=1)
        above = (ways[:, None] * hull.normals[hull.sides[rows]]).sum(axis=2)
        side = np.minimum(columns, 1)
        size = float(np.abs(hull.corners).max())
        on_edge = (lying >= 0.0) & (lying <= (along[rows] ** 2).sum(axis=1)) & (above[np.arange(len(rows)), side] >= 0.0)
        at_end = (over >= -_ROUNDING * size).all(axis=1)
        real = np.where(columns < 2, on_edge, at_end)
        shares[rows[~real], columns[~real]] = np.inf
        return shares.ravel()


class _Nearest(NamedTuple):
    """The point of a polyhedron that is nearest to a point."""

    distance: float
    """Signed distance [m]."""
    normal: FloatArray
    """Normal."""
    rank: int
    """1 on a face, or inside; 2 on an edge; 3 at a corner."""
    along: FloatArray
    """Along the edge; at a corner any direction that is not the normal's."""


def _convex(hull: Hull) -> Any:
    """The polyhedron as Coal takes it."""
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in hull.corners:
        points.append(corner)
    for a, b, c in hull.triangles.tolist():
        triangles.append(coal.Triangle(a, b, c))
    return coal.Convex(points, triangles)
