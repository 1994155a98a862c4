r"""Actuators along the body; their lengths `l` are in `softrobots.model.muscle_paths`.

- *Lengths given* (`softrobots.model.muscle_lengths`): they hold some directions of the strains, along straight routes the sums
  of bending and elongation over a segment. The others are free.
- All others leave the strains `z` free, and add the energy of their law (`softrobots.model.actuator_laws`): with the tension
  `T(l, u)` at the input `u` the residual has :math:`T\,\partial l/\partial z` more, the tangent
  :math:`T\,\partial^2 l + T_l\,\partial l\,\partial l^T`. The map of the actuators is the transpose of the Jacobian of the
  lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.actuator_laws import ActuatorLaws, Tensions
from softrobots.model.coordinates import Coordinates, Point, ReducedLoad
from softrobots.model.joint_loads import JointLoad
from softrobots.model.muscle_paths import MusclePaths, MusclePathsAt

MUSCLE_INPUTS = ("lengths", "forces")
"""What `q_motors` can hold of the muscles."""


class MuscleForces:
    """Coordinates of a robot whose actuators pull by their laws: motors, then inputs, are given; all strains are free."""

    def __init__(self, inner: Coordinates, paths: MusclePaths, laws: ActuatorLaws) -> None:
        """Add actuators on their paths to a robot without them."""
        self.inner = inner
        """The robot without them."""
        self._paths, self._laws = paths, laws

    def at(self, motors: FloatArray, elastic: FloatArray) -> MuscleForcePoint:
        """Return the robot at given coordinates."""
        count = len(motors) - len(self._paths.rest)
        return MuscleForcePoint(self.inner.at(motors[:count], elastic), self._paths.at(elastic), self._laws, motors[count:])


@dataclass(frozen=True, eq=False)
class MusclePoint:
    """A robot with muscles, whose joints are those of the robot without them."""

    inner: Point
    """The robot without muscles."""
    paths: MusclePathsAt
    """Its muscles."""

    @property
    def joints(self) -> FloatArray:
        """Joint positions."""
        return self.inner.joints

    @property
    def valid(self) -> bool:
        """Whether every section and every muscle is within its range."""
        return self.inner.valid and self.paths.valid


@dataclass(frozen=True, eq=False)
class MuscleForcePoint(MusclePoint):
    """A robot whose actuators pull by their laws."""

    laws: ActuatorLaws
    """Their laws."""
    inputs: FloatArray
    """Their inputs, shape (n_muscles,) [m, N or Pa]."""

    @cached_property
    def pull(self) -> Tensions:
        """Tensions, their derivatives and energies."""
        return self.laws.at(self.paths.elongation, self.inputs)

    def reduce(self, joints: JointLoad) -> ReducedLoad:
        """Add the tensions to the load; the load on an actuator is its tension."""
        load, arms, pull = self.inner.reduce(joints), self.paths.arms, self.pull
        stiffening = self.paths.curvature(pull.tension)
        if pull.by_length.any():
            stiffening += arms.T @ (pull.by_length[:, None] * arms)
        return ReducedLoad(
            np.concatenate([load.motors, pull.tension]),
            load.elastic - pull.tension @ arms,
            load.derivative - stiffening,
            np.concatenate([load.coupling, -arms.T * pull.by_input], axis=1),
            load.potential + float(pull.energy.sum()),
            load.scale + float(np.abs(pull.tension).sum()),
        )

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns of the inputs are zero: at fixed elastic coordinates they move no joint."""
        motors, elastic = self.inner.columns(jacobian)
        return np.concatenate([motors, np.zeros((len(jacobian), len(self.inputs)))], axis=1), elastic

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Those of the robot without muscles, and of the tensions by inputs and lengths; zero for given tensions."""
        by_motors, by_elastic = self.inner.motor_derivatives(load)
        count, pull = len(self.inputs), self.pull
        by_motors = np.pad(by_motors, (0, count))
        by_motors[-count:, -count:] = np.diag(np.where(self.laws.given, 0.0, pull.by_input))
        return by_motors, np.concatenate([by_elastic, pull.by_length[:, None] * self.paths.arms])

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add the tensions to the loads; the load on an actuator is its tension."""
        motors, elastic = self.inner.loads(torque)
        return np.concatenate([motors, self.pull.tension]), elastic - self.pull.tension @ self.paths.arms

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint rates; those of the inputs move no joint."""
        return self.inner.velocity(motors[: len(motors) - len(self.inputs)], elastic)

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint accelerations of the robot without muscles."""
        return self.inner.velocity_product(motors[: len(motors) - len(self.inputs)], elastic)
