"""A robot in the browser view: its chain, its body, its load and the path of its tip, still or in motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.trajectory import Trajectory
from softrobots.view.body import body, body_at
from softrobots.view.meshcat_page.animation_frames import FRAME_RATE, Frame, even_frames, growth_frames, waypoint_frames
from softrobots.view.meshcat_page.arrows import ArrowDrawing
from softrobots.view.meshcat_page.body import BodyDrawing
from softrobots.view.meshcat_page.chain import ChainDrawing
from softrobots.view.meshcat_page.shapes import FORCE_COLOUR, PATH_COLOUR, RIGID_COLOUR, wrinkling_rows
from softrobots.view.scene import Scene, wrinkling_level

LegendEntry = tuple[tuple[float, ...] | int, str]
"""Colour and meaning of something that is drawn."""

_CROSS = (0.16, 0.006)  # length and width of the mark of a target, of the size of the robot


class RobotDrawing:
    """One robot under one node of a meshcat page. Arguments are not checked here, see `softrobots.view.viewer.Viewer`."""

    def __init__(self, root: Any, model: SoftModel, scene: Scene, size: float, unit_force: float | None = None) -> None:
        """Draw the robot at rest.

        Args:
            root: The node.
            model: The robot.
            scene: Its shapes.
            size: Scale of arrows and marks [m].
            unit_force: Force whose arrow is `ARROW_LENGTH` long [N]; the largest of each load by default.
        """
        self._root, self._model, self._size = root, model, size
        self._arrows = ArrowDrawing(root["load"], size, unit_force)
        self._chain = ChainDrawing(root, model, scene)
        self._body = BodyDrawing(root["body"])
        self._segments = bool(model.structure.section_table)
        self._ghost = _ghost(model)
        self._loaded = self._traced = self._marked = False
        self.show_configuration(model.configuration(model.relaxed_motors))
        self._body.draw(body_at(model, model.relaxed_motors, model.rest), {})

    def show(self, equilibrium: Equilibrium) -> None:
        """Show the loaded robot."""
        self._chain.show_sections(True)
        self._chain.place(equilibrium.q, self._model.configuration(equilibrium.q_motors))
        self._chain.colour(_levels(equilibrium) or [])
        self._body.draw(body(equilibrium), _tensions(equilibrium))
        self._arrows.draw(equilibrium)
        self._ghost, self._loaded = _ghost(self._model), True

    def show_configuration(self, q: FloatArray) -> None:
        """Show the chain alone at a configuration of Pinocchio, shape (nq,), without load."""
        self._chain.show_sections(True)
        self._chain.place(q, q)
        self._chain.colour([0] * len(self._model.spring_groups))
        self._body.clear()
        self._arrows.clear()
        self._ghost, self._loaded = _ghost(self._model), False

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

    def animation(self, trajectory: Trajectory, seconds: float) -> Any:
        """Meshcat's animation of a trajectory; its first waypoint is shown, its path drawn."""
        import meshcat.animation

        self.show(trajectory.equilibria[0])
        self.trace(trajectory.tip_positions)
        made = meshcat.animation.Animation(default_framerate=FRAME_RATE)
        frames = even_frames(trajectory, seconds) if self._segments else waypoint_frames(trajectory, seconds)
        for frame, following in zip(frames, (*frames[1:], frames[-1]), strict=True):
            self._add_frame(made, frame)
            if self._segments and following.number > frame.number + 1:  # bodies move in steps, and so must the chain inside
                self._add_frame(made, frame._replace(number=following.number - 1))
        if self._segments:
            bodies = {
                frame.number: (body_at(self._model, frame.q_motors, frame.q_springs, 4), _tensions(frame.equilibrium))
                for frame in frames
            }
            self._body.animate(made, bodies)
        return made

    def growth(self, tube: HelixTube, seconds: float, front: float, hold: float) -> tuple[Any, FloatArray]:
        """Meshcat's animation of a tube that grows.

        Args:
            tube: The tube, the one that is drawn.
            seconds: Time of the animation [s].
            front: Length behind the tip over which the helix forms [m].
            hold: Share of the time at the end during which the whole tube is shown.

        Returns:
            The animation, and points along the whole tube, shape (n, 3) [m].

        Raises:
            ParameterError: If an argument is out of range.
        """
        import meshcat.animation

        frames = growth_frames(tube, seconds, front, hold)
        self.show_configuration(self._model.configuration((), self._model.rest))
        self._ghost = "the whole tube"
        self._chain.show_sections(False)  # the links of sections that have not come out would stick out of the tip
        made = meshcat.animation.Animation(default_framerate=FRAME_RATE)
        for frame in frames:
            self._add_frame(made, frame)
        bodies = {f.number: (body_at(self._model, f.q_motors, f.q_springs, 3), _tensions(None)) for f in frames}
        self._body.animate(made, bodies, everting={frame.number: frame.grown for frame in frames})
        whole = body_at(self._model, frames[-1].q_motors, self._model.rest)
        return made, np.concatenate([segment.backbone for segment in whole])

    def legend(self) -> list[LegendEntry]:
        """Colour and meaning of what is drawn."""
        entries: list[LegendEntry] = [(RIGID_COLOUR, self._ghost)] * self._chain.has_rigid
        if self._segments and not self._model.spring_groups:
            entries += [(colour, "equivalent rigid chain") for colour in self._chain.section_colours[:1]]
        entries += [(colour, text) for text, colour in self._body.entries.items()]
        entries += [(PATH_COLOUR, "path of the tip")] * self._traced + [(PATH_COLOUR, "target (cross)")] * self._marked
        entries += [(FORCE_COLOUR, "force")] * bool(self._arrows.names)
        return entries + (list(wrinkling_rows()) if self._model.spring_groups and self._loaded else [])

    def _add_frame(self, animation: Any, frame: Frame) -> None:
        deformed = self._model.embed(self._model.coordinates.at(frame.q_motors, frame.q_springs).joints)
        rigid = self._model.embed(self._model.coordinates.at(frame.q_motors, self._model.rest).joints)
        self._chain.add_frame(animation, frame.number, deformed, rigid, _levels(frame.equilibrium))
        if frame.equilibrium is not None:
            self._arrows.add_frame(animation, frame.number, frame.equilibrium, deformed)


def _ghost(model: SoftModel) -> str:
    """What the translucent robot is."""
    if not model.muscles:
        return "rigid arm, same motor angles" if model.n_motors else "without load"
    return "without load, same muscle lengths" if model.muscle_input == "lengths" else "straight, at rest"


def _tensions(equilibrium: Equilibrium | None) -> dict[str, float]:
    if equilibrium is None:
        return {}
    names = (muscle.name for muscle in equilibrium.model.muscles)
    return dict(zip(names, equilibrium.muscle_forces.tolist(), strict=True))


def _levels(equilibrium: Equilibrium | None) -> list[int] | None:
    """Level of wrinkling of each inflated link; None without load."""
    if equilibrium is None:
        return None
    return [wrinkling_level(equilibrium, link) for link in range(len(equilibrium.model.spring_groups))]
