"""Obstacles of triangles: convex bodies from files or corners."""

from __future__ import annotations

import os
import warnings
from dataclasses import InitVar, dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_array
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.description.mesh_files import LARGEST_MESH, find_mesh
from softrobots.environment.obstacles import NO_TURN, Obstacle

_CONVEX = 1e-6
"""Volume and depth, relative to those of the hull, by which a mesh may fall short of it: files have seven digits."""
_FLAT = 1e-10
"""Cross product of normals below which neighbouring triangles are one face."""
_MOST_CORNERS = 10_000


class Hull(NamedTuple):
    """Faces and edges of a convex polyhedron."""

    corners: FloatArray
    """Corners, shape (n, 3) [m]."""
    triangles: Any
    """Corners of the triangles of its surface, counterclockwise from outside, shape (f, 3), integers."""
    normals: FloatArray
    """Normals of the triangles, shape (f, 3)."""
    offsets: FloatArray
    """Offsets of their planes: inside, `normals @ x <= offsets`; shape (f,) [m]."""
    edges: Any
    """Corners at the ends of each edge between different faces, shape (e, 2), integers."""
    along: FloatArray
    """Direction of each edge, shape (e, 3)."""
    lengths: FloatArray
    """Length of each edge, shape (e,) [m]."""
    outward: FloatArray
    """In each of the two faces at an edge, the direction out of the face across the edge, shape (2, e, 3)."""
    sides: Any
    """Triangles at the edge, shape (2, e), integers."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Obstacle):
    """A convex body, given by a file of triangles or by its corners."""

    vertices: Any
    """Corners in its own axes, shape (n, 3) [m]. Given as a file (STL, OBJ and what else trimesh reads; also `package://`) or
    as points; only the corners of the convex body are kept."""
    position: Any = (0.0, 0.0, 0.0)
    """Where its own origin is, world axes, shape (3,) [m]."""
    rotation: Any = NO_TURN
    """Its own axes as columns, shape (3, 3)."""
    scale: InitVar[Any] = 1.0
    """What the numbers of file or points are multiplied by: 0.001 for millimetres; one number, or shape (3,)."""
    hull: InitVar[bool] = False
    """Whether a body that is not convex is replaced by its convex hull; else it is refused."""

    kind: ClassVar[str] = "mesh"

    def __post_init__(self, scale: Any, hull: bool) -> None:
        """Read the file, and check that the body is convex.

        Raises:
            ParameterError: If the body is flat or not convex, or a value is invalid.
            FileFormatError: If the file does not exist, is too large or cannot be read.
        """
        factors = positive_array("scale", scale, "-")
        if factors.shape not in ((), (3,)):
            raise ParameterError("scale", scale, "one number, or of shape (3,)")
        if isinstance(self.vertices, str | os.PathLike):
            points, triangles = read_triangles(os.fspath(self.vertices))
        else:
            points, triangles = finite_array("vertices", self.vertices, (None, 3), "m"), None
        points = points * factors
        found = hull_of(points.tobytes())
        if not hull:
            _check_convex(self.vertices, points, triangles, found)
        self._set("vertices", np.array(found.corners))
        super().__post_init__()

    @property
    def triangles(self) -> Any:
        """Corners of the triangles of its surface, counterclockwise from outside, shape (m, 3), integers; for pictures."""
        return hull_of(self.vertices.tobytes()).triangles


@lru_cache(maxsize=64)
def hull_of(points: bytes) -> Hull:
    """Return faces and edges of the convex hull of points, given as the bytes of an array, shape (n, 3).

    Raises:
        ParameterError: If the points are in one plane, or too many.
    """
    from scipy.spatial import ConvexHull, QhullError

    given = np.frombuffer(points).reshape(-1, 3)
    try:
        first = ConvexHull(given)
    except (QhullError, ValueError) as error:
        raise ParameterError("vertices", given, "four points or more that are not in one plane") from error
    corners = given[np.sort(first.vertices)]
    if len(corners) > _MOST_CORNERS:
        raise ParameterError("vertices", given, f"a convex body of at most {_MOST_CORNERS} corners (it has {len(corners)})")
    whole = ConvexHull(corners)
    normals, triangles = whole.equations[:, :3].copy(), whole.simplices.astype(np.intp)
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    turned = (np.cross(b - a, c - a) * normals).sum(axis=1) < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    one = np.repeat(np.arange(len(triangles)), 3)
    other, opposite = whole.neighbors.ravel(), whole.simplices.ravel()  # a neighbour is opposite to the corner in its place
    bent = (one < other) & (np.linalg.norm(np.cross(normals[one], normals[other]), axis=1) > _FLAT)
    one, other, opposite = one[bent], other[bent], opposite[bent]
    edges = np.array([[i for i in triangles[f] if i != left] for f, left in zip(one, opposite, strict=True)]).reshape(-1, 2)
    along = corners[edges[:, 1]] - corners[edges[:, 0]]
    lengths = np.linalg.norm(along, axis=1)
    along /= lengths[:, None]
    outward = np.stack([np.cross(along, normals[one]), -np.cross(along, normals[other])])
    inwards = ((corners[opposite] - corners[edges[:, 0]]) * outward[0]).sum(axis=1) > 0.0
    outward[:, inwards] *= -1.0
    hull = Hull(corners, triangles, normals, -whole.equations[:, 3], edges, along, lengths, outward, np.stack([one, other]))
    for array in hull:
        array.setflags(write=False)
    return hull


def read_triangles(name: str) -> tuple[FloatArray, Any]:
    """Return corners and triangles of a mesh file, shapes (n, 3), in the unit of the file, and (m, 3), integers.

    Raises:
        FileFormatError: If the file does not exist, is too large or cannot be read.
    """
    import trimesh

    path = find_mesh(name)
    if path is None:
        raise FileFormatError(f"{name} is not found, is no regular file or has more than {LARGEST_MESH} bytes (a mesh file)")
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            mesh: Any = trimesh.load(str(path), force="mesh", process=True)
        points, triangles = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3), np.array(mesh.faces).reshape(-1, 3)
    except Exception as error:  # each format has a reader of its own
        raise FileFormatError(f"{name} cannot be read as a mesh: {error}") from error
    if not len(points) or not len(triangles):
        raise FileFormatError(f"{name} has no triangles")
    return finite_array("vertices", points, (None, 3), "m"), triangles


def _check_convex(source: Any, points: FloatArray, triangles: Any, hull: Hull) -> None:
    """Refuse points inside of their hull, and triangles that enclose less than the hull of their corners."""
    inside = (points @ hull.normals.T - hull.offsets).max(axis=1)
    size = float(np.ptp(hull.corners, axis=0).max())
    needed = "a convex body (hull=True takes its convex hull)"
    if triangles is None:
        if inside.min() < -_CONVEX * size:
            raise ParameterError("vertices", source, f"{needed}; a point is {-inside.min():.3g} m inside of the others' hull")
        return
    own, whole = (_volume(*body) for body in ((points, triangles), (hull.corners, hull.triangles)))
    if abs(own - whole) > _CONVEX * whole:
        raise ParameterError("vertices", source, f"{needed}; its triangles enclose {own:.6g} m^3, their hull {whole:.6g} m^3")


def _volume(points: FloatArray, triangles: Any) -> float:
    a, b, c = (points[triangles[:, i]] - points.mean(axis=0) for i in range(3))
    return abs(float((a * np.cross(b, c)).sum())) / 6.0
