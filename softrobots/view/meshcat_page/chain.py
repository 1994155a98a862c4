"""The rigid links of a robot on a meshcat page: deformed and opaque, with relaxed springs and translucent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from softrobots.core.checks import FloatArray
from softrobots.view.appearance import RIGID_COLOUR
from softrobots.view.meshcat_page.shapes import material, meshcat_geometry
from softrobots.view.robot_shapes import Shape
from softrobots.view.scene import WRINKLING_COLOURS, Scene


class ChainDrawing:
    """The links under one node of a page: all of them as `deformed`, those that springs move a second time as `rigid`."""

    def __init__(self, root: Any, shapes: Sequence[Shape]) -> None:
        """Draw every shape under `root`, inflated links once in each colour of wrinkling."""
        self._root, self._shapes = root, shapes
        self._levels: dict[int, int] = {}
        self._sections_shown = True
        for shape in shapes:
            solid, turn = meshcat_geometry(shape.geometry)
            if shape.elastic:
                root[f"rigid/{shape.name}/body"].set_object(solid, material(RIGID_COLOUR))
                root[f"rigid/{shape.name}/body"].set_transform(turn)
            node = root[f"deformed/{shape.name}"]
            if shape.inflated_link is None:
                node["body"].set_object(solid, material(shape.colour))
                node["body"].set_transform(turn)
                continue
            # One copy for each colour, of which one is visible: an animation can switch visibility, but no colour.
            for level, (_, rgb) in enumerate(WRINKLING_COLOURS):
                node[f"level_{level}"].set_object(solid, material((*rgb, shape.colour[3])))
                node[f"level_{level}"].set_transform(turn)
                node[f"level_{level}"].set_property("visible", level == 0)
            self._levels[shape.inflated_link] = 0

    def draw(self, scene: Scene) -> None:
        """Move both chains, and colour the inflated links."""
        sections_shown = scene.grown is None  # sections that have not everted yet would stick out of the tip
        if sections_shown != self._sections_shown:
            self._sections_shown = sections_shown
            for shape in self._shapes:
                if shape.of_section:
                    self._root[f"deformed/{shape.name}"].set_property("visible", sections_shown)
        for name, pose in self._poses(scene):
            self._root[name].set_transform(pose)
        levels = {link: scene.wrinkling[link] if scene.wrinkling else 0 for link in self._levels}
        for shape in self._shapes:
            link = shape.inflated_link
            if link is not None and levels[link] != self._levels[link]:
                node = self._root[f"deformed/{shape.name}"]
                node[f"level_{self._levels[link]}"].set_property("visible", False)
                node[f"level_{levels[link]}"].set_property("visible", True)
        self._levels = levels

    def add_frame(self, animation: Any, number: int, scene: Scene) -> None:
        """Move both chains at a frame of an animation, and colour the inflated links of a loaded robot."""
        for name, pose in self._poses(scene):
            animation.at_frame(self._root[name], number).set_transform(pose)
        for shape in self._shapes:
            if shape.inflated_link is None or scene.wrinkling is None:
                continue
            for level in range(len(WRINKLING_COLOURS)):
                node = self._root[f"deformed/{shape.name}/level_{level}"]
                visible = level == scene.wrinkling[shape.inflated_link]
                animation.at_frame(node, number).set_property("visible", "boolean", visible)

    def _poses(self, scene: Scene) -> Iterator[tuple[str, FloatArray]]:
        """Node and pose of every shape of both chains."""
        for shape, pose in zip(self._shapes, scene.deformed, strict=True):
            yield f"deformed/{shape.name}", pose
        for shape, pose in zip(self._shapes, scene.rigid, strict=True):
            if shape.elastic:
                yield f"rigid/{shape.name}", pose
