"""Triangles of solids, and triangles and colours of the meshes of a robot, for pictures.

Pinocchio reads meshes through Coal (3.0), which joins the parts of a node into one list of corners but numbers the corners of
every triangle from the first part, so that a mesh of several materials is torn. Files are therefore read again by trimesh,
which also gives the colour of each part.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.view.body import tube

_SIDES = 32  # corners of the cross-section of what is round
_FARTHEST = 1e9  # [m]; sums and squares of corners must be finite in single precision


class Triangles(NamedTuple):
    """A surface."""

    corners: FloatArray
    """Shape (n, 3) [m]."""
    faces: Any
    """Corners of each triangle, shape (m, 3), integers."""


class ColouredPart(NamedTuple):
    """A part of a mesh."""

    surface: Triangles
    """Its triangles."""
    rgba: tuple[float, float, float, float] | None
    """Red, green, blue, opacity in [0, 1]; None if the file gives no colour."""


def coloured_parts(mesh: Any, file: Path, scale: FloatArray) -> tuple[ColouredPart, ...]:
    """Parts of a mesh as its file colours them.

    Args:
        mesh: The mesh as Coal has read it, scaled.
        file: Its file.
        scale: Scale along x, y, z, shape (3,).

    Returns:
        The parts; Coal's triangles as one part if trimesh is not installed, cannot read the file, or places its corners
        elsewhere (the two read the up axis and the unit of a file differently).
    """
    corners = np.array(mesh.vertices())
    parts = _parts(file, scale)
    if parts:
        everything = np.concatenate([part.surface.corners for part in parts])
        size = float(np.ptp(corners, axis=0).max())
        if all(
            np.allclose(end(everything, axis=0), end(corners, axis=0), rtol=0.0, atol=1e-4 * size) for end in (np.min, np.max)
        ):
            return parts
    triangles = (mesh.tri_indices(number) for number in range(mesh.num_tris))
    return (ColouredPart(Triangles(corners, np.array([[t[0], t[1], t[2]] for t in triangles])), None),)


def readable(file: Path) -> bool:
    """Whether Coal, and so Pinocchio, can read a mesh file, and its corners are numbers."""
    try:
        return has_finite_corners(coal.MeshLoader().load(str(file), np.ones(3)))
    except (ValueError, RuntimeError):
        return False


def has_finite_corners(geometry: Any) -> bool:
    """Whether all corners of a geometry that Coal has read are finite and within 1e9 m of its origin."""
    if not isinstance(geometry, coal.BVHModelBase):
        return True
    return bool(np.all(np.abs(np.asarray(geometry.vertices())) <= _FARTHEST))  # NaN is not


def bounds(geometry: Any) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest coordinates of a shape in its own axes, each of shape (3,) [m]."""
    if isinstance(geometry, Triangles):
        return geometry.corners.min(axis=0), geometry.corners.max(axis=0)
    geometry.computeLocalAABB()
    return np.array(geometry.aabb_local.min_), np.array(geometry.aabb_local.max_)


def triangles(geometry: Any) -> tuple[FloatArray, Any, bool]:
    """Return corners and triangles of a shape, and whether the triangles are flat.

    Raises:
        ViewerError: If the shape is no box, cylinder, sphere or mesh.
    """
    if isinstance(geometry, Triangles):
        return geometry.corners, geometry.faces, False
    if isinstance(geometry, coal.Cylinder):
        half = geometry.halfLength
        return *revolved([-half, -half, half, half], np.full(4, geometry.radius)), False
    if isinstance(geometry, coal.Sphere):
        angles = np.linspace(0.0, np.pi, _SIDES // 2 + 1)
        return *revolved(-geometry.radius * np.cos(angles), geometry.radius * np.sin(angles)), False
    if isinstance(geometry, coal.Box):
        from trimesh.creation import box

        solid = box(2.0 * np.array(geometry.halfSide).ravel())
        return np.array(solid.vertices), np.array(solid.faces), True
    raise ViewerError(f"a {type(geometry).__name__} cannot be drawn; boxes, cylinders, spheres and meshes can")


def revolved(heights: Any, radii: Any) -> tuple[FloatArray, Any]:
    """Return corners and triangles of a body of revolution about z. A rim that is given twice is a sharp edge."""
    centres = np.zeros((len(heights), 3))
    centres[:, 2] = heights
    return tube(np.tile(np.eye(3), (len(heights), 1, 1)), centres, radii, _SIDES)


def _parts(file: Path, scale: FloatArray) -> tuple[ColouredPart, ...]:
    """Parts of a mesh as trimesh reads them; none if it cannot."""
    try:
        import trimesh

        with warnings.catch_warnings(), np.errstate(all="ignore"):  # colours that are NaN
            warnings.simplefilter("ignore", DeprecationWarning)  # pycollada sets shapes as NumPy 2.5 no longer wants
            scene, parts = trimesh.Scene(trimesh.load(str(file))), []
            for node in scene.graph.nodes_geometry:
                transform, name = scene.graph[node]
                part = scene.geometry[name]
                if isinstance(part, trimesh.Trimesh) and len(part.faces):
                    corners = (np.asarray(part.vertices) @ transform[:3, :3].T + transform[:3, 3]) * scale
                    parts.append(ColouredPart(Triangles(corners, np.asarray(part.faces)), _colour(part.visual)))
            return tuple(parts)
    except Exception:  # each format has a reader of its own
        return ()


def _colour(visual: Any) -> tuple[float, float, float, float] | None:
    material = getattr(visual, "material", None)
    if material is None or not visual.defined:
        return None
    red, green, blue, opacity = (np.asarray(material.main_color, dtype=np.float64) / 255.0).tolist()
    return red, green, blue, opacity
