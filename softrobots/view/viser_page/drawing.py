"""A robot on a page of viser: its links, body and forces, drawn from scenes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.view import appearance
from softrobots.view.appearance import Colour, body_parts, rgb
from softrobots.view.mesh_triangles import revolved, triangles
from softrobots.view.robot_shapes import Shape
from softrobots.view.scene import WRINKLING_COLOURS, Extent, Scene

_AMBIENT, _SUN = 2.2, 2.0  # strength of the light from everywhere and from above


class Mesh(NamedTuple):
    """Triangles of one colour. Of meshes of one name only corners, pose, red, green and blue change."""

    corners: FloatArray
    """Points, shape (n, 3) [m]."""
    faces: Any
    """Corners of each triangle, shape (m, 3), integers."""
    pose: FloatArray
    """Pose of their axes, shape (4, 4) [m]."""
    colour: Colour
    """Colour of the triangles."""
    flat: bool = False
    """Whether triangles are flat; others look round."""


class ViserDrawing:
    """One robot on a page; for one thread at a time."""

    def __init__(self, server: Any, shapes: Sequence[Shape], extent: Extent, unit_force: float) -> None:
        """Draw the floor, and prepare the shapes of the robot.

        Args:
            server: The `viser.ViserServer`.
            shapes: The shapes of the robot.
            extent: Size and place of the robot at rest.
            unit_force: Force whose arrow is `ARROW_LENGTH` long [N].

        Raises:
            ViewerError: If a shape cannot be drawn.
        """
        self._server, self._extent, self._unit_force = server, extent, unit_force
        self._shapes = [(shape, *triangles(shape.geometry)) for shape in shapes]
        self.handles: dict[str, Any] = {}
        """Viser's handle of each mesh that is shown, by name."""
        # Viser's default light is a photograph; under even light colours look like those of the legend.
        scene = server.scene
        scene.configure_environment_map(None)
        scene.configure_default_lights(False)
        scene.add_light_ambient("/light/ambient", intensity=_AMBIENT)
        scene.add_light_directional("/light/sun", intensity=_SUN, position=(-0.3, -0.6, 1.0))
        floor = extent.floor().reshape(-1, 2, 3)
        scene.add_line_segments("/floor", floor, rgb(appearance.FLOOR_COLOUR), thickness=1.0, thickness_units="screen")

    def look_at(self, tip: FloatArray, points: FloatArray) -> None:
        """Place the camera of browsers that connect later; the arguments are those of `Extent.camera`."""
        self._server.initial_camera.position, self._server.initial_camera.look_at = self._extent.camera(tip, points)

    def show(self, scene: Scene) -> None:
        """Show a state, in one message."""
        meshes = dict(self._meshes(scene))
        with self._server.atomic():
            for name in [name for name in self.handles if name not in meshes]:
                self.handles.pop(name).remove()
            for name, mesh in meshes.items():
                self._show_mesh(name, mesh)

    def _meshes(self, scene: Scene) -> Iterator[tuple[str, Mesh]]:
        """Name and triangles of everything that is shown."""
        for (shape, corners, faces, flat), pose, relaxed in zip(self._shapes, scene.deformed, scene.rigid, strict=True):
            colour: Colour = shape.colour
            if shape.inflated_link is not None:
                level = scene.wrinkling[shape.inflated_link] if scene.wrinkling else 0
                colour = (*WRINKLING_COLOURS[level][1], shape.colour[3])
            yield f"deformed/{shape.name}", Mesh(corners, faces, pose, colour, flat)
            if shape.elastic:
                yield f"rigid/{shape.name}", Mesh(corners, faces, relaxed, appearance.RIGID_COLOUR, flat)
        for part in body_parts(scene):
            yield f"body/{part.path}", Mesh(*part.surface(), np.eye(4), part.colour)
        width = appearance.ARROW_WIDTH * self._extent.size
        radii = width * np.array([1.0, 1.0, 1.0, 1.0, 2.5, 2.5, 0.0, 0.0])
        for name, arrow in scene.arrows.items():
            end = appearance.ARROW_LENGTH * self._extent.size * arrow.force / self._unit_force
            heights = np.array([0.0, 0.0, end, end, end, end, end + 7.0 * width, end + 7.0 * width])
            along_z = arrow.pose[:, [2, 0, 1, 3]]
            if arrow.of_contact:
                yield f"load/{name}", Mesh(*revolved(heights - heights[-1], radii), along_z, appearance.CONTACT_COLOUR)
            else:
                yield f"load/{name}", Mesh(*revolved(heights, radii), along_z, appearance.FORCE_COLOUR)
        looks = {"obstacles": appearance.OBSTACLE_COLOUR, "capsules": appearance.CAPSULE_COLOUR}
        for (kind, colour), solids in zip(looks.items(), (scene.obstacles, scene.capsules), strict=True):
            for number, solid in enumerate(solids):
                corners, faces, flat = triangles(solid.geometry)
                yield f"{kind}/{number}", Mesh(corners, faces, solid.pose, colour, flat)
        ball = triangles(coal.Sphere(appearance.CONTACT_SIZE * self._extent.size))[:2]
        for name, contact in scene.contacts.items():
            placed = np.eye(4)
            placed[:3, 3] = contact.point
            yield f"contacts/{name}", Mesh(*ball, placed, appearance.CONTACT_COLOUR)

    def _show_mesh(self, name: str, mesh: Mesh) -> None:
        x, y, z, w = pin.Quaternion(mesh.pose[:3, :3]).coeffs().tolist()
        place, colour = {"wxyz": np.array([w, x, y, z]), "position": mesh.pose[:3, 3]}, rgb(mesh.colour)
        if name in self.handles:  # viser sends what differs
            for key, value in {**place, "vertices": mesh.corners, "color": colour}.items():
                setattr(self.handles[name], key, value)
            return
        opacity = None if isinstance(mesh.colour, int) or mesh.colour[3] >= 1.0 else mesh.colour[3]
        look = {"opacity": opacity, "flat_shading": mesh.flat, "side": "double", "cast_shadow": False, "receive_shadow": False}
        self.handles[name] = self._server.scene.add_mesh_simple(
            f"/{name}", mesh.corners, mesh.faces, color=colour, **look, **place
        )
