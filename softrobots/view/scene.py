"""The scene: everything that a viewer draws of one state of a robot, as plain data without the model."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import axes_along
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.vibration import ModeSwing
from softrobots.environment.environment import Environment
from softrobots.model.link_limits import link_limits
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube
from softrobots.statics.contact.contact import Contact
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import backbone, frame_placement
from softrobots.statics.loads import Load
from softrobots.view.actuator_curves import actuator_curves
from softrobots.view.animation_frames import (
    Frame,
    Movement,
    even_frames,
    growth_frames,
    motion_frames,
    swing_frames,
    waypoint_frames,
)
from softrobots.view.body import BentSections, SegmentBody
from softrobots.view.camera import box_corners, whole_view
from softrobots.view.mesh_triangles import bounds
from softrobots.view.robot_shapes import RobotShapes
from softrobots.view.surroundings import DrawnObstacle, drawn_capsules, drawn_contacts, drawn_obstacles
from softrobots.view.tension_scale import DrawnActuator, drawn_actuators

WRINKLING_COLOURS = (
    (0.8, (1.00, 0.96, 0.66)),
    (0.6, (1.00, 0.80, 0.36)),
    (0.4, (0.99, 0.58, 0.25)),
    (0.2, (0.94, 0.30, 0.15)),
    (0.0, (0.72, 0.00, 0.15)),
    (-np.inf, (0.33, 0.00, 0.45)),
)
"""Colours of an inflated link by the least remaining share of its wrinkling moment; the last one is wrinkled. Ordered in
lightness too, for grey prints and colour-blind readers."""

_RINGS = 16  # of a body in each frame of a motion; two a section at least
_SHEETS = 1.0  # side of the sheet that stands for a half-space, of the size of the robot
_SEEN = 60  # of the scenes of an animation, for which a camera is placed
_ARROW = 0.27  # length of the largest arrow with its head, of the size of the robot
_NO_FORCE = 1e-12  # [N], forces below have no arrow


class Arrow(NamedTuple):
    """A force on the robot."""

    pose: FloatArray
    """Pose at its point of application, y along the force, shape (4, 4) [m]."""
    force: float
    """Magnitude [N]."""
    of_contact: bool = False
    """Whether it is that of a contact: its arrow ends at the point, outside of the robot, others start there."""

    @classmethod
    def of(cls, force: FloatArray, point: FloatArray, of_contact: bool = False) -> Arrow | None:
        """The arrow of a force, shape (3,) [N], at a point, shape (3,) [m]; None if it is zero."""
        size = float(np.linalg.norm(force))
        if size <= _NO_FORCE:
            return None
        along = force / size
        pose = np.eye(4)
        pose[:3, :3] = axes_along(along)[:, [1, 2, 0]]
        pose[:3, 3] = point
        return cls(pose, size, of_contact)


@dataclass(frozen=True, eq=False)
class Scene:
    """One state of a robot, in world axes."""

    deformed: Sequence[FloatArray]
    """Pose of each shape of the robot, shape (4, 4) [m], in the order of `RobotShapes.shapes`."""
    rigid: Sequence[FloatArray]
    """The same with relaxed springs, for the translucent robot."""
    reference: str
    """What the translucent robot is, for the legend."""
    wrinkling: Sequence[int] | None = None
    """Place in `WRINKLING_COLOURS` of each inflated link; None without load."""
    segments: Sequence[SegmentBody] = ()
    """The continuous body of sections."""
    actuators: Sequence[DrawnActuator] = ()
    """Its actuators, with their tensions under load."""
    arrows: Mapping[str, Arrow] = field(default_factory=dict)
    """Forces by the frame that they act on, and those of contacts."""
    obstacles: Sequence[DrawnObstacle] = ()
    """The obstacles around it."""
    contacts: Mapping[str, Contact] = field(default_factory=dict)
    """Where it touches them."""
    capsules: Sequence[DrawnObstacle] = ()
    """What touches of a robot of links among obstacles."""
    grown: float | None = None
    """Share of a growing tube that has everted; None if the robot does not grow."""


class Extent(NamedTuple):
    """The size of a robot at rest, for camera, floor and arrows."""

    base: FloatArray
    """The world's origin, or the start of a chain that begins farther from it than it is long, shape (3,) [m]."""
    tip: FloatArray
    """Position of the tip, shape (3,) [m]."""
    size: float
    """Largest distance of the chain from its start [m]; the reach of a robot that is straight at rest."""
    ground: float
    """Height of the floor: of the lowest point that is fixed to the world, or a little below the origin [m]."""

    def camera(self, tip: FloatArray, points: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Return where a camera is that sees a robot with its tip there, and the point that it looks at, shape (3,) [m].

        Args:
            tip: Position of the tip, shape (3,) [m].
            points: Points that it sees in any case, shape (n, 3) [m]; see `SceneBuilder.corners`.
        """
        along, middle = tip - self.base, 0.5 * (self.base + tip)
        azimuth = np.arctan2(along[1], along[0]) - np.deg2rad(78.0)
        size = max(self.size, 0.95 * float(np.linalg.norm(along)))  # a robot that is bent at rest may be straight now
        away = 0.94 * size * np.array([0.92 * np.cos(azimuth), 0.92 * np.sin(azimuth), 0.39])
        return (middle + away, middle) if points is None else whole_view(points, away)

    def floor(self) -> FloatArray:
        """Return the two ends of each line of the floor, a sixth of the size apart along x and along y, shape (52, 3) [m]."""
        offsets = np.linspace(-1.0, 1.0, 13) * self.size
        along = np.array([(x, y, self.ground) for y in offsets for x in (-self.size, self.size)])
        return np.concatenate([along, along[:, [1, 0, 2]]])


class SceneBuilder:
    """Builds the scenes of one robot; the only part of a viewer that knows the model."""

    def __init__(self, model: SoftModel) -> None:
        """Read the shapes of the robot.

        Raises:
            ViewerError: If the shapes cannot be read.
        """
        self._model = model
        self.robot = RobotShapes(model)
        """The visual shapes."""
        q = model.configuration(model.relaxed_motors)
        points = backbone(model, q)
        size = max(float(np.linalg.norm(points - points[0], axis=1).max()), 0.05 * model.reach)
        base = points[0] if float(np.linalg.norm(points[0])) > size else np.zeros(3)
        ground = self.robot.ground()
        tip = np.array(frame_placement(model, q, model.tip).translation)
        self.extent = Extent(base, tip, size, -0.15 * size if ground is None else ground)
        """Size and place of the robot at rest."""
        self._drawn: dict[Environment | None, tuple[DrawnObstacle, ...]] = {}

    def relaxed(self) -> Scene:
        """Return the robot at rest, without load."""
        return self._scene(Frame(0, self._model.relaxed_motors, self._model.rest, None))

    def loaded(self, equilibrium: Equilibrium) -> Scene:
        """Return a loaded robot, its forces and the colours of its inflated links."""
        return self._scene(Frame(0, equilibrium.q_motors, equilibrium.q_springs, equilibrium))

    def state(self, q_motors: FloatArray, q_springs: FloatArray, load: Load, tensions: FloatArray) -> Scene:
        """Return a robot under a load at given coordinates, with the tension of each muscle, shape (n_muscles,) [N]."""
        return self._scene(Frame(0, q_motors, q_springs, None, load=load, tensions=tensions))

    def movement(self, movement: Movement, seconds: float) -> dict[int, Scene]:
        """Return the scenes of an animation by number of frame.

        They are waypoints; evenly spaced shapes of a body that bends; or those of a motion or a mode, see `motion_frames`.
        """
        sections = len(self._model.structure.section_table)
        if isinstance(movement, Motion | ModeSwing):
            moving = motion_frames(movement, seconds) if isinstance(movement, Motion) else swing_frames(movement, seconds)
            return {frame.number: self._scene(frame, max(_RINGS // max(sections, 1), 2)) for frame in moving}
        frames = (even_frames if sections else waypoint_frames)(movement, seconds)
        return {frame.number: self._scene(frame, 4) for frame in frames}

    def corners(self, scenes: Sequence[Scene]) -> FloatArray:
        """Return corners of boxes around what is drawn in some scenes, without obstacles larger than the robot, (n, 3) [m]."""
        boxes, size, found = self.robot.boxes, self.extent.size, [np.stack([self.extent.base, self.extent.tip])]
        for scene in (*scenes[:: max(len(scenes) // _SEEN, 1)], scenes[-1]):
            for poses in (np.reshape(scene.deformed, (-1, 4, 4)), np.reshape(scene.rigid, (-1, 4, 4))):
                found.append((boxes @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]).reshape(-1, 3))
            for body in scene.segments:
                found.append(box_corners(body.backbone.min(axis=0) - body.radius, body.backbone.max(axis=0) + body.radius))
            for arrow in scene.arrows.values():
                found.append(arrow.pose[:3, 3] + _ARROW * size * (1 - 2 * arrow.of_contact) * arrow.pose[None, :3, 1])
            for obstacle in scene.obstacles:
                placed = box_corners(*bounds(obstacle.geometry)) @ obstacle.pose[:3, :3].T + obstacle.pose[:3, 3]
                if np.ptp(placed, axis=0).max() <= 1.5 * size:
                    found.append(placed)
        return np.concatenate(found)

    def growth(self, tube: HelixTube, seconds: float) -> dict[int, Scene]:
        """Return the scenes of a growing tube by number of frame; see `growth_frames`.

        Raises:
            ParameterError: If the duration is not positive.
        """
        return {frame.number: self._scene(frame, 3) for frame in growth_frames(tube, seconds)}

    def _scene(self, frame: Frame, points: int = 12) -> Scene:
        """The scene of a frame, with a number of points of the body for each section."""
        model, equilibrium = self._model, frame.equilibrium
        q = model.embed(model.coordinates.at(frame.q_motors, frame.q_springs).joints)
        rigid = model.embed(model.coordinates.at(frame.q_motors, model.rest).joints)
        sections = BentSections(model, frame.q_motors, frame.q_springs)
        curves = actuator_curves(sections, model.muscles, points)
        scene = Scene(
            self.robot.transforms(q),
            self.robot.transforms(rigid),
            self._reference() if frame.grown is None else "the whole tube",
            segments=sections.segments(points),
            actuators=[DrawnActuator(curve) for curve in curves],
            grown=frame.grown,
        )
        if equilibrium is not None:
            load, tensions = equilibrium.load, equilibrium.muscle_forces
            contacts = drawn_contacts(equilibrium)
            levels = [wrinkling_level(equilibrium, link) for link in range(len(model.spring_groups))]
        elif frame.load is not None:
            load, tensions, contacts = frame.load, frame.tensions, {}
            levels = self._moving_levels(frame, load, q)
        else:
            return scene
        return dataclasses.replace(
            scene,
            wrinkling=levels,
            actuators=drawn_actuators(model.muscles, curves, tensions),
            arrows=_arrows(model, load, q, contacts),
            obstacles=self._obstacles(load.environment),
            contacts=contacts,
            capsules=() if load.environment is None else drawn_capsules(model, q),
        )

    def _moving_levels(self, frame: Frame, load: Load, q: FloatArray) -> list[int]:
        """Places in `WRINKLING_COLOURS` of the links of a robot in motion, whose axial forces are those without inertia."""
        springs, groups = self._model.springs, self._model.spring_groups
        torques, beyond = springs.at(frame.q_springs)[1], springs.saturated(frame.q_springs)
        limits = link_limits(self._model, load.wrenches, load.gravity, q=q, torques=torques, tensions=frame.tensions)
        flat = [not beyond.isdisjoint(group.springs) for group in groups]
        return [_level(left, one) for left, one in zip(limits.wrinkling_margins.tolist(), flat, strict=True)]

    def _obstacles(self, environment: Environment | None) -> tuple[DrawnObstacle, ...]:
        """The obstacles of an environment; the same objects for the same one."""
        if environment not in self._drawn:
            middle = 0.5 * (self.extent.base + self.extent.tip)
            ground = min(self.extent.ground, self.extent.tip[2])
            self._drawn[environment] = drawn_obstacles(environment, middle, _SHEETS * self.extent.size, ground)
        return self._drawn[environment]

    def _reference(self) -> str:
        model = self._model
        if not model.muscles:
            return "rigid arm, same motor angles" if model.n_motors else "without load"
        return "without load, same muscle lengths" if model.muscle_input == "lengths" else "straight, at rest"


def wrinkling_level(equilibrium: Equilibrium, link: int) -> int:
    """Return the place in `WRINKLING_COLOURS` of an inflated link, numbered from 0; the last one means wrinkled."""
    return _level(float(equilibrium.link_limits.wrinkling_margins[link]), equilibrium.saturated[link])


def _level(left: float, saturated: bool) -> int:
    """The place of a link with a share of its wrinkling moment left, or on its plateau."""
    if left <= 0.0 or saturated:
        return len(WRINKLING_COLOURS) - 1
    return next(level for level, (least, _) in enumerate(WRINKLING_COLOURS) if left >= least)


def _arrows(model: SoftModel, load: Load, q: FloatArray, contacts: Mapping[str, Contact]) -> dict[str, Arrow]:
    """Forces of a load by frame, at a configuration, shape (nq,), and those of contacts by their names."""
    arrows = {
        frame: Arrow.of(wrench[:3], np.array(frame_placement(model, q, frame).translation))
        for frame, wrench in load.wrenches.items()
    }
    arrows |= {f"contact/{name}": Arrow.of(one.force, one.point, True) for name, one in contacts.items()}
    return {name: arrow for name, arrow in arrows.items() if arrow is not None}
