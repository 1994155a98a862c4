r"""Muscles whose tension or length is given; their paths are in `softrobots.model.muscle_paths`.

- *Forces given*: all strains are free, and a tension `t` adds the energy `t l`.
- *Lengths given* (`softrobots.model.muscle_lengths`): they fix the sums of bending and elongation over a segment. Free are the
  differences between its sections, and twist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.coordinates import Coordinates, Point, ReducedLoad
from softrobots.model.joint_loads import JointLoad
from softrobots.model.muscle_paths import MusclePaths, MusclePathsAt

MUSCLE_INPUTS = ("lengths", "forces")
"""What `q_motors` can hold of the muscles."""


class MuscleForces:
    """Coordinates of a robot whose muscles exert given tensions: motors, then tensions, are given; all strains are free."""

    def __init__(self, inner: Coordinates, paths: MusclePaths) -> None:
        """Add muscles on their paths to a robot without them."""
        self._inner, self._paths = inner, paths

    def at(self, motors: FloatArray, elastic: FloatArray) -> MuscleForcePoint:
        """Return the robot at given coordinates."""
        count = len(motors) - len(self._paths.rest)
        return MuscleForcePoint(self._inner.at(motors[:count], elastic), self._paths.at(elastic), motors[count:])


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
    """A robot under given muscle tensions."""

    tensions: FloatArray
    """Tension of each muscle [N]."""

    def reduce(self, joints: JointLoad) -> ReducedLoad:
        """Add the tensions to the load; the load on a muscle is its tension."""
        load, arms = self.inner.reduce(joints), self.paths.arms
        return ReducedLoad(
            *self.loads(joints.torque),
            load.derivative - self.paths.curvature(self.tensions),
            np.concatenate([load.coupling, -arms.T], axis=1),
            load.potential + float(self.tensions @ self.paths.change),
            load.scale + float(np.abs(self.tensions).sum()),
        )

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns of the tensions are zero: at fixed elastic coordinates they move no joint."""
        motors, elastic = self.inner.columns(jacobian)
        return np.concatenate([motors, np.zeros((len(jacobian), len(self.tensions)))], axis=1), elastic

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Those of the robot without muscles; zero for the tensions, which nothing changes."""
        by_motors, by_elastic = self.inner.motor_derivatives(load)
        count = len(self.tensions)
        return np.pad(by_motors, (0, count)), np.pad(by_elastic, ((0, count), (0, 0)))

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add the tensions to the loads; the load on a muscle is its tension."""
        motors, elastic = self.inner.loads(torque)
        return np.concatenate([motors, self.tensions]), elastic - self.tensions @ self.paths.arms

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint rates; those of the tensions move no joint."""
        return self.inner.velocity(motors[: len(motors) - len(self.tensions)], elastic)

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint accelerations of the robot without muscles."""
        return self.inner.velocity_product(motors[: len(motors) - len(self.tensions)], elastic)
