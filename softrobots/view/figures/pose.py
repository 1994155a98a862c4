"""The pose that stands for a result: its scene, the line through the robot, tip, path and target."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.dynamics.motion import Motion
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.load_estimation import LoadEstimate
from softrobots.statics.trajectory import Trajectory
from softrobots.view import appearance
from softrobots.view.animation_frames import FRAME_RATE
from softrobots.view.body import robot_line
from softrobots.view.mesh_triangles import triangles
from softrobots.view.scene import WRINKLING_COLOURS, Scene, SceneBuilder

Posed = Equilibrium | SoftModel | IkSolution | ImposedDisplacement | LoadEstimate | Trajectory | ContactPath | Motion
"""Results that a pose stands for."""

_ASIDE = np.deg2rad(62.0)  # azimuth from which a robot is seen, from the direction in which its tip is


class DrawnPose(NamedTuple):
    """A pose that is drawn."""

    name: str
    """Name of the robot."""
    builder: SceneBuilder
    """Shapes and size of the robot."""
    scene: Scene
    """Its scene."""
    line: FloatArray
    """Points along the robot, shape (n, 3) [m]."""
    tip: FloatArray
    """Position of the tip, shape (3,) [m]."""
    other: FloatArray = np.zeros((0, 3))
    """Points along the robot with relaxed springs, or at the beginning, shape (n, 3) [m]."""
    meaning: str = ""
    """What that is."""
    path: FloatArray = np.zeros((0, 3))
    """Path of the tip, shape (n, 3) [m]."""
    target: FloatArray = np.zeros((0, 3))
    """The target, shape (1, 3) [m], or none."""

    @classmethod
    def of(cls, result: Posed) -> DrawnPose:
        """Return the pose of a result: of a movement the last one.

        Raises:
            ViewerError: If a shape of the robot cannot be read.
        """
        state: Equilibrium | SoftModel | Motion
        before, path, target = None, np.zeros((0, 3)), np.zeros((0, 3))
        if isinstance(result, IkSolution | ImposedDisplacement | LoadEstimate):
            state = result.equilibrium
        elif isinstance(result, Trajectory | ContactPath):
            state, before, path = result.equilibria[-1], result.equilibria[0], result.tip_positions
        else:
            state = result
        if isinstance(result, IkSolution):
            target = result.target[None]
        model = model_of(result)
        name, builder = str(model.pinocchio.name), SceneBuilder(model)

        def line(q_motors: FloatArray, q_springs: FloatArray) -> FloatArray:
            return robot_line(model, q_motors, q_springs)

        if isinstance(state, SoftModel):
            q = model.configuration(model.relaxed_motors)
            tip = np.array(frame_placement(model, q, model.tip).translation)
            return cls(name, builder, builder.relaxed(), line(model.relaxed_motors, model.rest), tip)
        if isinstance(state, Motion):
            scene, path = list(builder.movement(state, 1.0 / FRAME_RATE).values())[-1], state.tip_position
            ends = [line(state.q_motors[row], state.q_springs[row]) for row in (0, -1)]
            meaning = f"{state.time[-1] - state.time[0]:.3g} s before"
            return cls(name, builder, scene, ends[1], path[-1], ends[0], meaning, path)
        scene, meaning, shown = builder.loaded(state), "at the beginning", line(state.q_motors, state.q_springs)
        if before is not None:
            other = line(before.q_motors, before.q_springs)
        else:
            other, meaning = line(state.q_motors, model.rest) if model.n_springs else np.zeros((0, 3)), scene.reference
        return cls(name, builder, scene, shown, state.tip_position, other, meaning, path, target)

    @property
    def eye(self) -> FloatArray:
        """Direction from which it is seen, square to the robot and a little from above, shape (3,)."""
        along = np.round((self.tip - self.builder.extent.base) / self.builder.extent.size, 3)
        azimuth = np.arctan2(along[1], along[0]) - _ASIDE
        return np.array([np.cos(azimuth), np.sin(azimuth), 0.4])

    def solids(self, inside: bool = True) -> Iterator[tuple[FloatArray, Any, FloatArray]]:
        """Yield corners, shape (n, 3) [m], triangles, shape (m, 3), and colour of each rigid shape and obstacle.

        The body of sections is not among them, nor are the links that stand for them, but for those with a colour of wrinkling
        if what is inside of the body is asked for.
        """
        scene = self.scene
        for shape, pose in zip(self.builder.robot.shapes, scene.deformed, strict=True):
            if shape.of_section and (shape.inflated_link is None or not inside):
                continue
            colour = np.clip(shape.colour, 0.0, 1.0)
            if shape.inflated_link is not None:
                colour[:3] = WRINKLING_COLOURS[scene.wrinkling[shape.inflated_link] if scene.wrinkling else 0][1]
            corners, sides, _ = triangles(shape.geometry)
            yield corners @ pose[:3, :3].T + pose[:3, 3], sides, colour
        for obstacle in scene.obstacles:
            corners, sides, _ = triangles(obstacle.geometry)
            yield corners @ obstacle.pose[:3, :3].T + obstacle.pose[:3, 3], sides, np.array(appearance.OBSTACLE_COLOUR)

    def arrows(self) -> Iterator[tuple[FloatArray, FloatArray, bool]]:
        """Yield start and way of the arrow of each force, shape (3,) [m], and whether it is that of a contact."""
        arrows = self.scene.arrows.values()
        largest = max((arrow.force for arrow in arrows), default=1.0)
        for arrow in arrows:
            along = appearance.ARROW_LENGTH * self.builder.extent.size * arrow.force / largest * arrow.pose[:3, 1]
            yield arrow.pose[:3, 3] - along * arrow.of_contact, along, arrow.of_contact


def model_of(result: Posed) -> SoftModel:
    """Return the robot of a result."""
    if isinstance(result, IkSolution | ImposedDisplacement | LoadEstimate):
        return result.equilibrium.model
    return result if isinstance(result, SoftModel) else result.model


def with_robot_loaded(result: Any) -> Any:
    """Return the model of a robot that is given as parameters; any other result as it came.

    Raises:
        DescriptionError: If the robot cannot be loaded.
    """
    return load_model(result) if callable(getattr(result, "urdf", None)) and not isinstance(result, type) else result
