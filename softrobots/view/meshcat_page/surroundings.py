"""The surroundings of a robot on a meshcat page: obstacles, and the points where it touches them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.view import appearance
from softrobots.view.meshcat_page.shapes import material, meshcat_geometry
from softrobots.view.scene import Scene
from softrobots.view.surroundings import DrawnObstacle


class SurroundingsDrawing:
    """Obstacles and contact points under two nodes of a page."""

    def __init__(self, root: Any, size: float) -> None:
        """Draw under `root` for a robot of a size [m]."""
        self._obstacles, self._points, self._size = root["obstacles"], root["contacts"], size
        self._drawn: Sequence[DrawnObstacle] = ()
        self._named: tuple[str, ...] = ()

    def draw(self, scenes: Sequence[Scene]) -> None:
        """Draw the obstacles of the first of some scenes, and the points of all, of which those of the first are visible."""
        import meshcat.geometry as geometry

        first = scenes[0]
        if first.obstacles is not self._drawn:
            self._obstacles.delete()
            for number, one in enumerate(first.obstacles):
                solid, turn = meshcat_geometry(one.geometry)
                node = self._obstacles[str(number)]
                node["body"].set_object(solid, material(appearance.OBSTACLE_COLOUR))
                node["body"].set_transform(turn)
                node.set_transform(one.pose)
            self._drawn = first.obstacles
        if self._named:
            self._points.delete()
        self._named = tuple(dict.fromkeys(name for scene in scenes for name in scene.contacts))
        for name in self._named:
            ball = geometry.Sphere(appearance.CONTACT_SIZE * self._size)
            self._points[name].set_object(ball, geometry.MeshLambertMaterial(color=appearance.CONTACT_COLOUR))
            self._points[name].set_property("visible", name in first.contacts)
            if name in first.contacts:
                self._points[name].set_transform(_placed(first.contacts[name].point))

    def add_frame(self, animation: Any, number: int, scene: Scene) -> None:
        """Move obstacles and points to their places at a frame of an animation of scenes that are drawn."""
        for place, obstacle in enumerate(scene.obstacles):
            animation.at_frame(self._obstacles[str(place)], number).set_transform(obstacle.pose)
        for name in self._named:
            at_frame = animation.at_frame(self._points[name], number)
            at_frame.set_property("visible", "boolean", name in scene.contacts)
            if name in scene.contacts:
                at_frame.set_transform(_placed(scene.contacts[name].point))


def _placed(point: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = point
    return pose
