"""A robot on a meshcat page: its chain, body, forces, path and target, still or animated. It is drawn from scenes alone."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.view import appearance
from softrobots.view.animation_frames import FRAME_RATE
from softrobots.view.legend import LegendEntry, legend
from softrobots.view.meshcat_page.body import BodyDrawing
from softrobots.view.meshcat_page.shapes import material, meshcat_geometry
from softrobots.view.meshcat_page.surroundings import SurroundingsDrawing
from softrobots.view.robot_shapes import RobotShapes, Shape
from softrobots.view.scene import WRINKLING_COLOURS, Arrow, Scene

_NO_ARROW = 1e-6  # scale of an arrow without a force: a browser turns nothing that has no size
_CROSS = (0.16, 0.006)  # length and width of the mark of a target, of the size of the robot


class RobotDrawing:
    """One robot under one node of a meshcat page."""

    def __init__(self, root: Any, robot: RobotShapes, scene: Scene, size: float) -> None:
        """Draw the robot.

        Args:
            root: The node.
            robot: Its shapes.
            scene: Its first state.
            size: Scale of arrows and marks [m].
        """
        self._root, self._shapes, self._size = root, robot.shapes, size
        self._arrows = ArrowDrawing(root["load"], size)
        self._chain = ChainDrawing(root, robot.shapes)
        self._body = BodyDrawing(root["body"])
        self._surroundings = SurroundingsDrawing(root, size)
        self._traced = self._marked = False
        self._animated: tuple[Scene, ...] = ()
        self.notes: list[LegendEntry] = []
        """Further entries of the legend."""
        self.show(scene)

    def show(self, scene: Scene) -> None:
        """Show another state of the robot."""
        self._scene, self._animated = scene, ()
        self._chain.draw(scene)
        self._body.draw(scene)
        self._arrows.draw(scene.arrows)
        self._surroundings.draw([scene])

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """What is shown: one state, or those of an animation."""
        return self._animated or (self._scene,)

    def trace(self, positions: FloatArray) -> None:
        """Draw a path, shape (n, 3) [m], as dots."""
        import meshcat.geometry as geometry

        colours = np.tile(np.array(appearance.rgb(appearance.PATH_COLOUR))[:, None] / 255.0, (1, len(positions)))
        cloud = geometry.PointCloud(
            positions.T.astype(np.float32), colours.astype(np.float32), size=appearance.DOT_SIZE * self._size
        )
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
            dark = geometry.MeshBasicMaterial(color=appearance.PATH_COLOUR)
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
        self._arrows.draw_largest(scenes.values())
        self._surroundings.draw(list(scenes.values()))
        for (number, scene), following in zip(scenes.items(), (*numbers[1:], numbers[-1]), strict=True):
            self._add_frame(animation, number, scene)
            # A body changes in steps, and so must the chain inside; that of a growing tube is hidden.
            if scene.segments and scene.grown is None and following > number + 1:
                self._add_frame(animation, following - 1, scene)
        if any(scene.segments for scene in scenes.values()):
            self._body.animate(animation, scenes)
        self._animated = tuple(scenes.values())
        return animation

    def legend(self) -> list[LegendEntry]:
        """Return colour and meaning of what is drawn."""
        drawn = legend(self._shapes, self._scene, self._animated, path=self._traced, target=self._marked)
        return drawn + self.notes

    def _add_frame(self, animation: Any, number: int, scene: Scene) -> None:
        self._chain.add_frame(animation, number, scene)
        self._arrows.add_frame(animation, number, scene.arrows)
        self._surroundings.add_frame(animation, number, scene)


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
                root[f"rigid/{shape.name}/body"].set_object(solid, material(appearance.RIGID_COLOUR))
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


class ArrowDrawing:
    """One arrow for each force, under one node of a page."""

    def __init__(self, root: Any, size: float) -> None:
        """Draw under `root` for a robot of a size [m]; the unit force is the largest of each load."""
        self._root, self._size = root, size
        self._drawn: dict[str, float] = {}
        self._changing: set[str] = set()

    def draw_largest(self, scenes: Iterable[Scene]) -> None:
        """Draw for an animation of scenes the largest arrow of each frame, which is scaled where its force changes."""
        arrows = [scene.arrows for scene in scenes]
        names = dict.fromkeys(name for some in arrows for name in some)
        forces = {name: [some[name].force if name in some else 0.0 for some in arrows] for name in names}
        self.draw({name: arrows[int(np.argmax(forces[name]))][name] for name in names})
        self._changing = {name for name in names if min(forces[name]) < max(forces[name])}

    def draw(self, arrows: Mapping[str, Arrow]) -> None:
        """Replace the arrows."""
        import meshcat.geometry as geometry

        for name in self._drawn:
            if name not in arrows:
                self._root[name].delete()
        self._drawn = {name: arrow.force for name, arrow in arrows.items()}
        unit = max((arrow.force for arrow in arrows.values()), default=1.0)
        for name, arrow in arrows.items():
            length = appearance.ARROW_LENGTH * self._size * arrow.force / unit
            width = appearance.ARROW_WIDTH * self._size
            begin = -(length + 7.0 * width) if arrow.of_contact else 0.0
            colour = appearance.CONTACT_COLOUR if arrow.of_contact else appearance.FORCE_COLOUR
            look = geometry.MeshLambertMaterial(color=colour)
            node = self._root[name]
            for part, solid, height in (
                ("shaft", geometry.Cylinder(length, width), 0.5 * length),
                ("head", geometry.Cylinder(7.0 * width, radiusTop=0.0, radiusBottom=2.5 * width), length + 3.5 * width),
            ):
                node[part].set_object(solid, look)
                raised = np.eye(4)
                raised[1, 3] = begin + height
                node[part].set_transform(raised)
            node.set_transform(arrow.pose)

    def add_frame(self, animation: Any, number: int, arrows: Mapping[str, Arrow]) -> None:
        """Move the arrows that are drawn to their places at a frame of an animation, as long as their forces are there."""
        for name, force in self._drawn.items():
            at_frame = animation.at_frame(self._root[name], number)
            if name in arrows:
                at_frame.set_transform(arrows[name].pose)
            if name in self._changing:
                share = arrows[name].force / force if name in arrows else 0.0
                at_frame.set_property("scale", "vector3", [max(share, _NO_ARROW)] * 3)
