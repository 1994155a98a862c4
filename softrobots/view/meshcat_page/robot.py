"""A robot on a meshcat page: its chain, body, forces, path and target, still or animated. It is drawn from scenes alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.view.animation_frames import FRAME_RATE
from softrobots.view.meshcat_page.arrows import ArrowDrawing
from softrobots.view.meshcat_page.body import BodyDrawing
from softrobots.view.meshcat_page.chain import ChainDrawing
from softrobots.view.meshcat_page.shapes import FORCE_COLOUR, PATH_COLOUR, RIGID_COLOUR, wrinkling_rows
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.scene import Scene

LegendEntry = tuple[tuple[float, ...] | int, str]
"""Colour and meaning of something that is drawn."""

_CROSS = (0.16, 0.006)  # length and width of the mark of a target, of the size of the robot


class RobotDrawing:
    """One robot under one node of a meshcat page, or of a `ViserTree`, which takes the same calls."""

    def __init__(self, root: Any, robot: RobotShapes, scene: Scene, size: float, unit_force: float | None = None) -> None:
        """Draw the robot.

        Args:
            root: The node.
            robot: Its shapes.
            scene: Its first state.
            size: Scale of arrows and marks [m].
            unit_force: Force whose arrow is `ARROW_LENGTH` long [N]; the largest of each load by default.
        """
        self._root, self._shapes, self._size = root, robot.shapes, size
        self._arrows = ArrowDrawing(root["load"], size, unit_force)
        self._chain = ChainDrawing(root, robot.shapes)
        self._body = BodyDrawing(root["body"])
        self._traced = self._marked = False
        self.show(scene)

    def show(self, scene: Scene) -> None:
        """Show another state of the robot."""
        self._scene = scene
        self._chain.draw(scene)
        self._body.draw(scene)
        self._arrows.draw(scene.arrows)

    def trace(self, positions: FloatArray) -> None:
        """Draw a path, shape (n, 3) [m], as dots."""
        import meshcat.geometry as geometry

        rgb = np.array([PATH_COLOUR >> 16 & 255, PATH_COLOUR >> 8 & 255, PATH_COLOUR & 255]) / 255.0
        colours = np.tile(rgb[:, None], (1, len(positions)))
        cloud = geometry.PointCloud(positions.T.astype(np.float32), colours.astype(np.float32), size=0.012)
        self._root["path"].set_object(cloud)
        self._traced = True

    def mark(self, target: FloatArray | None) -> None:
        """Draw a cross at a target, shape (3,) [m], in place of the last one; None: no cross."""
        import meshcat.geometry as geometry

        node = self._root["target"]
        if target is None:
            node.delete()
            self._marked = False
            return
        if not self._marked:
            length, width = (share * self._size for share in _CROSS)
            dark = geometry.MeshBasicMaterial(color=PATH_COLOUR)
            for axis in range(3):
                sides = [width] * 3
                sides[axis] = length
                node[f"bar_{axis}"].set_object(geometry.Box(sides), dark)
        pose = np.eye(4)
        pose[:3, 3] = target
        node.set_transform(pose)
        self._marked = True

    def animate(self, scenes: Mapping[int, Scene]) -> Any:
        """Return a meshcat animation of scenes by number of frame, in growing order."""
        import meshcat.animation

        animation = meshcat.animation.Animation(default_framerate=FRAME_RATE)
        numbers = list(scenes)
        for (number, scene), following in zip(scenes.items(), (*numbers[1:], numbers[-1]), strict=True):
            self._add_frame(animation, number, scene)
            # A body changes in steps, and so must the chain inside; that of a growing tube is hidden.
            if scene.segments and scene.grown is None and following > number + 1:
                self._add_frame(animation, following - 1, scene)
        if any(scene.segments for scene in scenes.values()):
            self._body.animate(animation, scenes)
        return animation

    def legend(self) -> list[LegendEntry]:
        """Return colour and meaning of what is drawn."""
        scene, shapes = self._scene, self._shapes
        entries: list[LegendEntry] = [(RIGID_COLOUR, scene.reference)] * any(shape.elastic for shape in shapes)
        if all(shape.inflated_link is None for shape in shapes):
            entries += [(shape.colour, "equivalent rigid chain") for shape in shapes if shape.of_section][:1]
        entries += [(colour, meaning) for meaning, colour in self._body.entries.items()]
        entries += [(PATH_COLOUR, "path of the tip")] * self._traced + [(PATH_COLOUR, "target (cross)")] * self._marked
        entries += [(FORCE_COLOUR, "force")] * bool(self._arrows.names)
        return entries + (wrinkling_rows() if scene.wrinkling else [])

    def _add_frame(self, animation: Any, number: int, scene: Scene) -> None:
        self._chain.add_frame(animation, number, scene)
        self._arrows.add_frame(animation, number, scene.arrows)
