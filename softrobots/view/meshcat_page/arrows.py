"""Forces on a meshcat page, as arrows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from softrobots.view.meshcat_page.shapes import FORCE_COLOUR
from softrobots.view.scene import Arrow

ARROW_LENGTH = 0.2
"""Length of the arrow of the unit force, relative to the size of the robot; other arrows are in proportion."""


class ArrowDrawing:
    """One arrow for each force, under one node of a page."""

    def __init__(self, root: Any, size: float, unit: float | None = None) -> None:
        """Draw under `root` for a robot of a size [m]; `unit` is the unit force [N], by default the largest of each load."""
        self._root, self._size, self._unit = root, size, unit
        self.names: tuple[str, ...] = ()
        """Frames whose force is drawn."""

    def draw(self, arrows: Mapping[str, Arrow]) -> None:
        """Replace the arrows."""
        import meshcat.geometry as geometry

        self._delete(name for name in self.names if name not in arrows)
        self.names = tuple(arrows)
        unit = self._unit or max((arrow.force for arrow in arrows.values()), default=1.0)
        for name, arrow in arrows.items():
            length = ARROW_LENGTH * self._size * arrow.force / unit
            width = 0.009 * self._size
            green = geometry.MeshLambertMaterial(color=FORCE_COLOUR)
            node = self._root[name]
            for part, solid, height in (
                ("shaft", geometry.Cylinder(length, width), 0.5 * length),
                ("head", geometry.Cylinder(7.0 * width, radiusTop=0.0, radiusBottom=2.5 * width), length + 3.5 * width),
            ):
                node[part].set_object(solid, green)
                raised = np.eye(4)
                raised[1, 3] = height
                node[part].set_transform(raised)
            node.set_transform(arrow.pose)

    def add_frame(self, animation: Any, number: int, arrows: Mapping[str, Arrow]) -> None:
        """Move the arrows that are drawn to their places at a frame of an animation."""
        for name in self.names:
            if name in arrows:
                animation.at_frame(self._root[name], number).set_transform(arrows[name].pose)

    def _delete(self, names: Iterable[str]) -> None:
        for name in names:
            self._root[name].delete()
