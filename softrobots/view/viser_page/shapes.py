"""Meshcat objects as viser draws them: triangles, points and lines, of one colour each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.view.body import tube

_SIDES = 32  # corners of the cross-section of what is round
_LINE = 1.0  # width of lines [px]
_ALONG_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # axes of a cross-section of meshcat's cylinders


@dataclass(frozen=True, eq=False)
class Drawn:
    """An object that viser can draw."""

    kind: str
    """"triangles", "points" or "lines"."""
    corners: FloatArray
    """Points, shape (n, 3) [m]; of lines both ends of each, shape (n, 2, 3) [m]."""
    faces: Any
    """Corners of each triangle, shape (m, 3), integers; None of points and lines."""
    colour: tuple[int, int, int]
    """Red, green, blue, each up to 255."""
    opacity: float | None = None
    """Opacity of transparent triangles, else None."""
    flat: bool = False
    """Whether triangles are flat; others look round."""
    size: float = 0.0
    """Size of points [m]."""

    def becomes(self, other: Drawn) -> bool:
        """Whether the other object differs in corners and colour only, so that a handle can be changed to it."""
        same = (self.kind, self.opacity, self.flat, self.size) == (other.kind, other.opacity, other.flat, other.size)
        return same and (self.faces is other.faces or np.array_equal(self.faces, other.faces))

    def add(self, scene: Any, name: str, **place: Any) -> Any:
        """Add the object to viser's scene.

        Args:
            scene: The `viser.SceneApi`.
            name: Name there.
            **place: `wxyz` and `position`.

        Returns:
            Viser's handle.
        """
        if self.kind == "points":
            return scene.add_point_cloud(
                name, self.corners, self.colour, point_size=self.size, point_shape="circle", precision="float32", **place
            )
        if self.kind == "lines":
            return scene.add_line_segments(name, self.corners, self.colour, thickness=_LINE, thickness_units="screen", **place)
        return scene.add_mesh_simple(
            name,
            self.corners,
            self.faces,
            color=self.colour,
            opacity=self.opacity,
            flat_shading=self.flat,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            **place,
        )

    def change(self, handle: Any) -> None:
        """Change a handle to this object; see `becomes`."""
        if self.kind == "triangles":
            handle.vertices, handle.color = self.corners, self.colour
        else:
            handle.points, handle.colors = self.corners, np.array(self.colour, dtype=np.uint8)


def drawn_of(meshcat_object: Any, material: Any = None) -> Drawn:
    """Translate an object of meshcat.

    Args:
        meshcat_object: A box, sphere, cylinder or triangles of `meshcat.geometry`, or its points or lines with a material.
        material: Material of a geometry.

    Returns:
        The object for viser.

    Raises:
        ViewerError: If it is something else.
    """
    import meshcat.geometry as known

    if isinstance(meshcat_object, known.Object) and isinstance(meshcat_object.geometry, known.PointsGeometry):
        points, colours = np.asarray(meshcat_object.geometry.position).T, meshcat_object.geometry.color
        if isinstance(meshcat_object, known.LineSegments):
            return Drawn("lines", points.reshape(-1, 2, 3), None, _rgb(meshcat_object.material.color))
        if isinstance(meshcat_object, known.Points) and colours is not None and len(points):
            red, green, blue = (round(255 * share) for share in np.asarray(colours)[:, 0].tolist())
            return Drawn("points", points, None, (red, green, blue), size=meshcat_object.material.size)
    elif isinstance(meshcat_object, known.Geometry) and material is not None:
        corners, faces, flat = _triangles(meshcat_object)
        return Drawn(
            "triangles", corners, faces, _rgb(material.color), material.opacity if material.transparent else None, flat
        )
    raise ViewerError(f"a {type(meshcat_object).__name__} without a material cannot be drawn on a page with sliders")


def _rgb(colour: int) -> tuple[int, int, int]:
    return colour >> 16 & 255, colour >> 8 & 255, colour & 255


def _triangles(geometry: Any) -> tuple[FloatArray, Any, bool]:
    """Corners, triangles, and whether they are flat, of a geometry of meshcat (where cylinders stand along y)."""
    import meshcat.geometry as known

    if isinstance(geometry, known.TriangularMeshGeometry):
        return np.asarray(geometry.vertices), np.asarray(geometry.faces), False
    if isinstance(geometry, known.Cylinder):
        # Each rim twice: corners that only one of two surfaces uses keep the edge between them sharp.
        half, (low, high) = 0.5 * geometry.height, (geometry.radiusBottom, geometry.radiusTop)
        return *_turned([-half, -half, half, half], [low, low, high, high]), False
    if isinstance(geometry, known.Sphere) and not isinstance(geometry, known.Ellipsoid):
        angles = np.linspace(0.0, np.pi, _SIDES // 2 + 1)
        return *_turned(-geometry.radius * np.cos(angles), geometry.radius * np.sin(angles)), False
    if isinstance(geometry, known.Box):
        square = np.array([[-0.5, -0.5, -0.5], [0.5, -0.5, -0.5], [0.5, 0.5, -0.5], [-0.5, 0.5, -0.5]])
        corners = np.concatenate([square, square * (1.0, 1.0, -1.0)]) * np.asarray(geometry.lengths)
        sides = [(3, 2, 1, 0), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
        return corners, np.array([three for a, b, c, d in sides for three in ((a, b, c), (a, c, d))]), True
    raise ViewerError(f"a {type(geometry).__name__} cannot be drawn on a page with sliders")


def _turned(heights: Any, radii: Any) -> tuple[FloatArray, Any]:
    """Corners and triangles of a body of revolution about y."""
    centres = np.zeros((len(heights), 3))
    centres[:, 1] = heights
    return tube(np.tile(_ALONG_Y, (len(heights), 1, 1)), centres, np.asarray(radii), _SIDES)
