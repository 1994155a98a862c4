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
    """Obstacles, capsules of the robot and contact points under three nodes of a page."""

    def __init__(self, root: Any, size: float) -> None:
        """Draw under `root` for a robot of a size [m]."""
        self._obstacles, self._capsules, self._points = root["obstacles"], root["capsules"], root["contacts"]
        self._size = size
        self._drawn = Scene((), (), "")
        self._named: tuple[str, ...] = ()

    def draw(self, scenes: Sequence[Scene]) -> None:
        """Draw obstacles and capsules of the first of some scenes, and the points of all, those of the first visible."""
        import meshcat.geometry as geometry

        first = scenes[0]
        _draw(self._obstacles, first.obstacles, self._drawn.obstacles, appearance.OBSTACLE_COLOUR)
        _draw(self._capsules, first.capsules, self._drawn.capsules, appearance.CAPSULE_COLOUR)
        self._drawn = first
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
        """Move what is drawn to its place at a frame of an animation."""
        for node, solids in ((self._obstacles, scene.obstacles), (self._capsules, scene.capsules)):
            for place, solid in enumerate(solids):
                animation.at_frame(node[str(place)], number).set_transform(solid.pose)
        for name in self._named:
            at_frame = animation.at_frame(self._points[name], number)
            at_frame.set_property("visible", "boolean", name in scene.contacts)
            if name in scene.contacts:
                at_frame.set_transform(_placed(scene.contacts[name].point))


def _draw(root: Any, solids: Sequence[DrawnObstacle], drawn: Sequence[DrawnObstacle], colour: tuple[float, ...]) -> None:
    """Draw solids in place of those that are drawn, which are only moved if they are the same."""
    same = len(solids) == len(drawn) and all(new.geometry is old.geometry for new, old in zip(solids, drawn, strict=True))
    if not same:
        root.delete()
    for number, solid in enumerate(solids):
        node = root[str(number)]
        if not same:
            geometry, turn = meshcat_geometry(solid.geometry)
            node["body"].set_object(geometry, material(colour))
            node["body"].set_transform(turn)
        node.set_transform(solid.pose)


def _placed(point: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = point
    return pose
