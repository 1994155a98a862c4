r"""Muscles: actuators along a segment whose length or tension is given.

A muscle at distance `d` and azimuth `phi` of a segment has the length ([PCC paper] (20-22), summed over the sections)

.. math:: l = l_0 + \sum_i (e_i + d \sin\phi\,a_i - d \cos\phi\,b_i) = l_0 + A z

with the bending `a` about x and `b` about y [rad] and the elongation `e` [m] of each section `i`: linear in the section
coordinates. (Twist lengthens a muscle too, in second order: by `(d t)^2 / (2 l)` for a segment twisted by `t`. That is
neglected: 1 mm in 0.524 m for 0.8 rad at 0.04 m.)

- *Lengths given* (`softrobots.model.muscle_lengths`): they fix the sums of bending and elongation over a segment. Free are the
  differences between its sections, and twist: `z = z_u + N y` with `A N = 0`. The part `z_u` distributes the sums in inverse
  proportion to stiffness, so that `N^T K z_u = 0` and the stiffness of `y` is diagonal.
- *Forces given*: all section coordinates are free, and a tension `t` adds the energy `t A z`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import MuscleTag
from softrobots.model.coordinates import Coordinates, Point, ReducedLoad
from softrobots.model.joint_loads import JointLoad

MUSCLE_INPUTS = ("lengths", "forces")
"""What `q_motors` can hold of the muscles."""

MUSCLE_STRAINS = ("bend_x", "bend_y", "stretch")
"""The section coordinates whose sums over a segment give the muscle lengths."""


Segments = Mapping[int, Mapping[str, Sequence[int]]]
"""By segment and section coordinate (`strain_chain.STRAINS`), the places of that coordinate among the elastic coordinates."""


def muscle_matrix(tags: Sequence[MuscleTag], segments: Segments, count: int) -> FloatArray:
    """Derivative `A` of the muscle lengths with respect to `count` elastic coordinates, shape (n_muscles, count)."""
    matrix = np.zeros((len(tags), count))
    for row, tag in enumerate(tags):
        row_arms = muscle_arms([tag])[0]
        for coordinate, arm in zip(MUSCLE_STRAINS, row_arms, strict=True):
            matrix[row, list(segments[tag.segment].get(coordinate, ()))] = arm
    return matrix


def muscle_arms(tags: Sequence[MuscleTag]) -> FloatArray:
    """Derivative of the lengths with respect to the sums of bending and elongation, shape (n, 3) [m/rad, m/rad, -]."""
    return np.array([(tag.distance * np.sin(tag.azimuth), -tag.distance * np.cos(tag.azimuth), 1.0) for tag in tags])


class MuscleForces:
    """Coordinates of a robot whose muscles exert given tensions: motors, then tensions, are given; all strains are free."""

    def __init__(self, inner: Coordinates, matrix: FloatArray) -> None:
        """Add muscles whose lengths have the derivative `matrix`, shape (n_muscles, n_elastic), to a robot without them."""
        self._inner, self._matrix = inner, matrix

    def at(self, motors: FloatArray, elastic: FloatArray) -> MuscleForcePoint:
        """Return the robot at given coordinates."""
        count = len(motors) - len(self._matrix)
        return MuscleForcePoint(self._inner.at(motors[:count], elastic), self._matrix, motors[count:], elastic)


@dataclass(frozen=True, eq=False)
class MusclePoint:
    """A robot with muscles, whose joints are those of the robot without them."""

    inner: Point
    """The robot without muscles."""

    @property
    def joints(self) -> FloatArray:
        """Joint positions."""
        return self.inner.joints

    @property
    def valid(self) -> bool:
        """Whether every section is within its range."""
        return self.inner.valid


@dataclass(frozen=True, eq=False)
class MuscleForcePoint(MusclePoint):
    """A robot under given muscle tensions."""

    matrix: FloatArray
    """Length derivative of the muscles."""
    tensions: FloatArray
    """Tension of each muscle [N]."""
    elastic: FloatArray
    """Elastic coordinates."""

    def reduce(self, joints: JointLoad) -> ReducedLoad:
        """Add the tensions to the load; the load on a muscle is its tension."""
        load = self.inner.reduce(joints)
        return ReducedLoad(
            np.concatenate([load.motors, self.tensions]),
            load.elastic - self.tensions @ self.matrix,
            load.derivative,
            np.concatenate([load.coupling, -self.matrix.T], axis=1),
            load.potential + float(self.tensions @ (self.matrix @ self.elastic)),
            load.scale + float(np.abs(self.tensions).sum()),
        )

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns of the tensions are zero: at fixed elastic coordinates they move no joint."""
        motors, elastic = self.inner.columns(jacobian)
        return np.concatenate([motors, np.zeros((len(jacobian), len(self.tensions)))], axis=1), elastic
