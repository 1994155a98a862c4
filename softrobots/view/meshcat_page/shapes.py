"""Geometries and materials of meshcat."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.view.appearance import rgb
from softrobots.view.mesh_triangles import Triangles


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

    red, green, blue = rgb(rgba)
    clear = rgba[3] < 1.0
    return geometry.MeshPhongMaterial(
        color=red << 16 | green << 8 | blue, opacity=rgba[3], transparent=clear, shininess=25, depthWrite=not clear
    )
