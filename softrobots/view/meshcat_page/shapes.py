"""Geometries and materials of meshcat, and the colours of a page."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.view.mesh_triangles import Triangles
from softrobots.view.scene import WRINKLING_COLOURS

RIGID_COLOUR = (0.40, 0.50, 0.62, 0.20)
"""Red, green, blue, opacity of the rigid arm."""
PATH_COLOUR = 0x1A1A1A
"""Near black of the path: none of the colours of wrinkling and muscles."""
FORCE_COLOUR = 0x009E73
"""Green of the forces."""


def meshcat_geometry(shape: Any) -> tuple[Any, FloatArray]:
    """Return meshcat's geometry of a shape, and the rotation from its axes to coal's (meshcat's cylinders stand along y).

    Raises:
        ViewerError: If the shape is no box, cylinder, sphere or mesh.
    """
    import coal
    import meshcat.geometry as geometry

    upright = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    if isinstance(shape, coal.Cylinder):
        return geometry.Cylinder(2.0 * shape.halfLength, shape.radius), upright
    if isinstance(shape, coal.Sphere):
        return geometry.Sphere(shape.radius), np.eye(4)
    if isinstance(shape, coal.Box):
        return geometry.Box((2.0 * shape.halfSide).tolist()), np.eye(4)
    if isinstance(shape, Triangles):
        return geometry.TriangularMeshGeometry(shape.corners, shape.faces), np.eye(4)
    raise ViewerError(f"a {type(shape).__name__} cannot be drawn; boxes, cylinders, spheres and meshes can")


def material(rgba: tuple[float, ...]) -> Any:
    """Return meshcat's material of a colour: red, green, blue, opacity."""
    import meshcat.geometry as geometry

    red, green, blue = (round(255 * value) for value in rgba[:3])
    clear = rgba[3] < 1.0
    return geometry.MeshPhongMaterial(
        color=red << 16 | green << 8 | blue, opacity=rgba[3], transparent=clear, shininess=25, depthWrite=not clear
    )


def floor_lines(reach: float, height: float) -> FloatArray:
    """Return the ends of floor lines along x at a height [m], a sixth of the reach apart, shape (2 n, 3) [m]."""
    offsets = np.linspace(-1.0, 1.0, 13) * reach
    ends = [(x, y, height) for y in offsets for x in (-reach, reach)]
    return np.array(ends)


def wrinkling_rows() -> list[tuple[tuple[float, ...] | int, str]]:
    """Return colour and meaning of each level of wrinkling, for the legend of a page."""
    rows: list[tuple[tuple[float, ...] | int, str]] = []
    above = 1.0
    for least, rgb in WRINKLING_COLOURS:
        text = f"{100 * above:.0f} - {100 * least:.0f} % of the wrinkling moment left" if least > -np.inf else "wrinkled"
        rows.append((rgb, text))
        above = least
    return rows
