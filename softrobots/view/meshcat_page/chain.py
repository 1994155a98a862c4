"""The rigid chain of a robot in the browser view: deformed and opaque, rigid and translucent, in meshcat's terms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.view.meshcat_page.shapes import RIGID_COLOUR, material, meshcat_geometry
from softrobots.view.scene import WRINKLING_COLOURS, Scene


class ChainDrawing:
    """The links of a robot under one node of a meshcat page: `deformed`, and a second time `rigid` where springs move them."""

    def __init__(self, root: Any, model: SoftModel, scene: Scene) -> None:
        """Draw every shape under `root`, inflated links once in each colour of wrinkling."""
        self._root, self._scene = root, scene
        self._levels: dict[int, int] = {}
        self._sections_shown = True
        names = tuple(section.name for section in model.structure.section_table)
        self._section_shapes = [shape for shape in scene.shapes if shape.name.startswith(names)]
        for shape in scene.shapes:
            drawn, turn = meshcat_geometry(shape.geometry)
            if shape.elastic:
                root[f"rigid/{shape.name}/body"].set_object(drawn, material(RIGID_COLOUR))
                root[f"rigid/{shape.name}/body"].set_transform(turn)
            node = root[f"deformed/{shape.name}"]
            if shape.inflated_link is None:
                node["body"].set_object(drawn, material(shape.colour))
                node["body"].set_transform(turn)
                continue
            # One copy a colour, one of them visible: an animation can switch visibility, and nothing else of a material.
            for level, (_, rgb) in enumerate(WRINKLING_COLOURS):
                node[f"level_{level}"].set_object(drawn, material((*rgb, shape.colour[3])))
                node[f"level_{level}"].set_transform(turn)
                node[f"level_{level}"].set_property("visible", level == 0)
            self._levels[shape.inflated_link] = 0

    @property
    def has_rigid(self) -> bool:
        """Whether the rigid chain is drawn: whether springs move anything that can be seen."""
        return any(shape.elastic for shape in self._scene.shapes)

    @property
    def section_colours(self) -> list[tuple[float, ...]]:
        """Colours of the links that sections move."""
        return [shape.colour for shape in self._section_shapes]

    def place(self, deformed: FloatArray, rigid: FloatArray) -> None:
        """Put both chains where they are at configurations of Pinocchio, each shape (nq,)."""
        for name, transform in self._transforms(deformed, rigid):
            self._root[name].set_transform(transform)

    def colour(self, levels: Sequence[int]) -> None:
        """Colour the inflated links, each by its place in `WRINKLING_COLOURS`."""
        for shape in self._scene.shapes:
            link = shape.inflated_link
            if link is not None and levels[link] != self._levels[link]:
                node = self._root[f"deformed/{shape.name}"]
                node[f"level_{self._levels[link]}"].set_property("visible", False)
                node[f"level_{levels[link]}"].set_property("visible", True)
        self._levels |= dict(enumerate(levels))

    def show_sections(self, shown: bool) -> None:
        """Show or hide the deformed links that sections move."""
        if shown == self._sections_shown:
            return
        for shape in self._section_shapes:
            self._root[f"deformed/{shape.name}"].set_property("visible", shown)
        self._sections_shown = shown

    def add_frame(
        self, animation: Any, number: int, deformed: FloatArray, rigid: FloatArray, levels: Sequence[int] | None
    ) -> None:
        """Put both chains at configurations, and colour inflated links if levels are given, at a frame of an animation."""
        for name, transform in self._transforms(deformed, rigid):
            animation.at_frame(self._root[name], number).set_transform(transform)
        if levels is None:
            return
        for shape in self._scene.shapes:
            if shape.inflated_link is None:
                continue
            for level in range(len(WRINKLING_COLOURS)):
                node = self._root[f"deformed/{shape.name}/level_{level}"]
                shown = level == levels[shape.inflated_link]
                animation.at_frame(node, number).set_property("visible", "boolean", shown)

    def _transforms(self, deformed: FloatArray, rigid: FloatArray) -> list[tuple[str, FloatArray]]:
        """Name of the node and pose of every shape of both chains."""
        return [
            (f"{group}/{shape.name}", transform)
            for group, q in (("deformed", deformed), ("rigid", rigid))
            for shape, transform in zip(self._scene.shapes, self._scene.transforms(q), strict=True)
            if shape.elastic or group == "deformed"
        ]
