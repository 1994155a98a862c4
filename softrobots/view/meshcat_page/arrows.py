"""Forces in the browser view, as arrows."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import frame_placement
from softrobots.view.meshcat_page.shapes import FORCE_COLOUR

ARROW_LENGTH = 0.2
"""Length of the arrow of a certain force, relative to the size of the robot; other arrows are in proportion."""

_NO_FORCE = 1e-12  # [N], forces below have no arrow


class ArrowDrawing:
    """One arrow a force under one node of a meshcat page."""

    def __init__(self, root: Any, size: float, unit: float | None = None) -> None:
        """Draw under `root` for a robot of a size [m]. A force of `unit` [N], by default the largest, is drawn that long."""
        self._root, self._size, self._unit = root, size, unit
        self.names: set[str] = set()
        """Frames whose force is drawn."""

    def draw(self, equilibrium: Equilibrium) -> None:
        """Replace the arrows by those of a loaded robot."""
        import meshcat.geometry as geometry

        wanted = {
            name: wrench[:3] for name, wrench in equilibrium.load.wrenches.items() if np.linalg.norm(wrench[:3]) > _NO_FORCE
        }
        self.clear(self.names - wanted.keys())
        self.names = set(wanted)
        unit = self._unit or max((float(np.linalg.norm(force)) for force in wanted.values()), default=1.0)
        for name, force in wanted.items():
            length = ARROW_LENGTH * self._size * float(np.linalg.norm(force)) / unit
            width = 0.009 * self._size
            green = geometry.MeshLambertMaterial(color=FORCE_COLOUR)
            node = self._root[name]
            for part, drawn, height in (
                ("shaft", geometry.Cylinder(length, width), 0.5 * length),
                ("head", geometry.Cylinder(7.0 * width, radiusTop=0.0, radiusBottom=2.5 * width), length + 3.5 * width),
            ):
                node[part].set_object(drawn, green)
                raised = np.eye(4)
                raised[1, 3] = height
                node[part].set_transform(raised)
            node.set_transform(_pose(equilibrium, equilibrium.q, name))

    def clear(self, names: set[str] | None = None) -> None:
        """Remove the arrows at some frames, all by default."""
        for name in self.names if names is None else names:
            self._root[name].delete()
        self.names = set() if names is None else self.names - names

    def add_frame(self, animation: Any, number: int, equilibrium: Equilibrium, q: FloatArray) -> None:
        """Put the arrows of a load where they are at a configuration, shape (nq,), at a frame of an animation."""
        for name in self.names:
            pose = _pose(equilibrium, q, name)
            animation.at_frame(self._root[name], number).set_transform(pose)


def _pose(equilibrium: Equilibrium, q: FloatArray, frame: str) -> FloatArray:
    """Pose with y along the force of a load, at its frame at a configuration, (4, 4)."""
    force = equilibrium.load.wrenches[frame][:3]
    along = force / np.linalg.norm(force)
    aside = np.eye(3)[int(np.argmin(np.abs(along)))]
    first = np.cross(along, aside)
    first /= np.linalg.norm(first)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([first, along, np.cross(first, along)])
    pose[:3, 3] = frame_placement(equilibrium.model, q, frame).translation
    return pose
