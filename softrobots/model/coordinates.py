r"""Generalised coordinates of a robot: actuators and elastic coordinates, and the joint positions that follow from them.

Statics works on elastic coordinates `y` (free) at given actuator coordinates `u`. Joint positions are a map `q(u, y)`:

- a joint with a motor or a spring *is* a coordinate (`DirectCoordinates`);
- the six joints of a section of constant strain follow its four section coordinates, or three without stretch,
  `q = m(z) - m(z_rest)` (`SectionCoordinates`), so that all joints are at zero at rest.

`softrobots.model.muscles` adds muscles to either. With `M = dq/d(u, y)`, a load of torque `t(q)` and derivative `D =
dt/dq` becomes `M^T t` in these coordinates, and its derivative :math:`M^T D M + \sum_j t_j\, d^2 q_j`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from softrobots.constant_curvature.strain_chain import SectionChain
from softrobots.core.checks import FloatArray, read_only
from softrobots.description.urdf_tags import LumpedSectionTag, SectionTag
from softrobots.model.joint_loads import Entries, JointLoad


class ReducedLoad(NamedTuple):
    """A load in actuator and elastic coordinates."""

    motors: FloatArray
    """Load on each actuator, shape (n_motors,) [N m or N]."""
    elastic: FloatArray
    """Load on each elastic coordinate, shape (n_elastic,) [N m or N]."""
    derivative: FloatArray
    """Derivative of `elastic` with respect to the elastic coordinates, shape (n_elastic, n_elastic)."""
    coupling: FloatArray
    """Derivative of `elastic` with respect to the actuators, shape (n_elastic, n_motors)."""
    potential: float
    """Potential energy of actuators that pull by their laws [J]; 0 for motor joints."""
    scale: float
    """Size of the tensions [N]."""


class Point(Protocol):
    """A robot at given actuator and elastic coordinates."""

    @property
    def joints(self) -> FloatArray:
        """Joint positions in the order of Pinocchio's velocities, shape (nv,) [rad or m]."""

    @property
    def valid(self) -> bool:
        """Whether every section is within its range; joint positions are undefined otherwise."""

    def reduce(self, load: JointLoad) -> ReducedLoad:
        """Transform a joint load to these coordinates."""

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Split a matrix of columns per joint, shape (m, nv), into columns per actuator and per elastic coordinate."""

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the load on each actuator by actuators and by elastic coordinates.

        Shapes (n_motors, n_motors) and (n_motors, n_elastic); zero for given tensions, which nothing changes.
        """

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Load on each actuator and each elastic coordinate of a torque on the joints, shape (nv,); see `ReducedLoad`."""

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint rates, shape (nv,) [rad/s or m/s], at rates of actuators and elastic coordinates: `Q xd` with `Q = dq/dx`."""

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint accelerations, shape (nv,), at the same rates, while they stay constant: `Qdot xd`."""


class Coordinates(Protocol):
    """A map from actuator and elastic coordinates to joint positions."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> Point:
        """Return the robot at given coordinates, shapes (n_motors,) and (n_elastic,) [rad, m, N or Pa]."""


class DirectCoordinates:
    """Every joint is an actuator coordinate or an elastic coordinate by itself."""

    def __init__(self, motor_indices: Any, elastic_indices: Any, count: int) -> None:
        """Take the places of both in Pinocchio's velocity vector of length `count`."""
        self.motor_indices, self.elastic_indices, self._count = motor_indices, elastic_indices, count
        self.entries = Entries.of(elastic_indices, np.concatenate([motor_indices, elastic_indices]), count)
        """Rows of the elastic coordinates, columns of both, in a matrix over the joints."""
        self.motor_entries = Entries.of(motor_indices, np.concatenate([motor_indices, elastic_indices]), count)
        """Rows of the actuators, the same columns."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> DirectPoint:
        """Return the robot at given coordinates."""
        joints: FloatArray = np.zeros(self._count)
        joints[self.motor_indices] = motors
        joints[self.elastic_indices] = elastic
        return DirectPoint(joints, self)


class DirectPoint(NamedTuple):
    """A robot whose joints are its coordinates."""

    joints: FloatArray
    """Joint positions."""
    coordinates: DirectCoordinates
    """Which joint is an actuator and which is elastic."""
    valid: bool = True
    """True: direct coordinates have no range limit."""

    def reduce(self, load: JointLoad) -> ReducedLoad:
        """Select the rows and columns of the load that belong to the coordinates."""
        rows, n = load.derivative(self.coordinates.entries), len(self.coordinates.motor_indices)
        return ReducedLoad(*self.loads(load.torque), rows[:, n:], rows[:, :n], 0.0, 0.0)

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Select the rows and columns of the derivative that belong to motors, and to motors and elastic coordinates."""
        rows, n = load.derivative(self.coordinates.motor_entries), len(self.coordinates.motor_indices)
        return rows[:, :n], rows[:, n:]

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Select the columns of actuators and of elastic coordinates."""
        c = self.coordinates
        return jacobian.take(c.motor_indices, axis=1), jacobian.take(c.elastic_indices, axis=1)

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Select the torques on actuators and on elastic coordinates."""
        return torque[self.coordinates.motor_indices], torque[self.coordinates.elastic_indices]

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Put the rates to their joints."""
        return self.coordinates.at(motors, elastic).joints

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Zero: the joints are the coordinates."""
        return np.zeros_like(self.joints)


def rest_coordinates(tags: Sequence[SectionTag | LumpedSectionTag], *, strains: str = "rest") -> FloatArray:
    """Section coordinates at rest, or without load (`relaxed`), shape (n, 4) [rad, rad, rad, m]: strains times rest length."""
    values = np.array([getattr(tag, strains) for tag in tags], dtype=np.float64)
    values[:, 3] -= 1.0
    return np.asarray(values * np.array([[tag.length] for tag in tags]))


class SectionCoordinates:
    """Motors and springs are coordinates by themselves; sections have four coordinates, or three, for six joints."""

    def __init__(
        self,
        motor_indices: Any,
        spring_indices: Any,
        section_indices: Any,
        lengths: FloatArray,
        rest_joints: FloatArray,
        count: int,
        each: int,
    ) -> None:
        """Take the joints; elastic coordinates are springs, then those of the sections.

        Args:
            motor_indices: Places of the motor joints in Pinocchio's velocity vector.
            spring_indices: Places of the spring joints.
            section_indices: Places of the joints of each section, base to tip, shape (n, 6).
            lengths: Rest length of each section, shape (n,) [m].
            rest_joints: Joint positions that the joint origins of the description carry, shape (n, 6).
            count: Length of Pinocchio's velocity vector.
            each: Number of coordinates of each section (k).
        """
        self.motor_indices, self.spring_indices, self.section_indices = motor_indices, spring_indices, section_indices
        self.lengths, self.rest_joints, self.count = lengths, rest_joints, count
        self.singles = np.concatenate([motor_indices, spring_indices])
        """Joints that are coordinates by themselves."""
        order = np.concatenate([self.singles, np.repeat(section_indices[:, 0], each)])
        self.before = read_only((order[:, None] < order).astype(np.float64))
        """1 where the coordinate of the row is nearer to the base than that of the column, else 0, shape (n, n)."""
        self.places = len(self.singles) + np.arange(each * len(lengths)).reshape(-1, each)
        """Places of the coordinates of each section, motors before all, shape (n_sections, k)."""

    def at(self, motors: FloatArray, elastic: FloatArray) -> SectionPoint:
        """Return the robot at given coordinates."""
        return SectionPoint(self, motors, elastic)


class SectionPoint:
    """A robot with sections at given coordinates."""

    def __init__(self, coordinates: SectionCoordinates, motors: FloatArray, elastic: FloatArray) -> None:
        """Evaluate the map of the sections, unless they are out of range."""
        self._c = coordinates
        n = len(coordinates.spring_indices)
        self._chain = SectionChain(elastic[n:].reshape(coordinates.places.shape), coordinates.lengths)
        self._motors, self._springs = motors, elastic[:n]

    @property
    def valid(self) -> bool:
        """Whether every section is in range."""
        return self._chain.valid

    @cached_property
    def joints(self) -> FloatArray:
        """Joint positions."""
        joints: FloatArray = np.zeros(self._c.count)
        joints[self._c.motor_indices], joints[self._c.spring_indices] = self._motors, self._springs
        joints[self._c.section_indices] = self._chain.positions - self._c.rest_joints
        return joints

    def reduce(self, load: JointLoad) -> ReducedLoad:
        """Transform a joint load by the chain rule."""
        m, n = len(self._c.before), len(self._c.motor_indices)
        if load.none:
            return ReducedLoad(np.zeros(n), np.zeros(m - n), np.zeros((m - n, m - n)), np.zeros((m - n, n)), 0.0, 0.0)
        derivative = self._derivative(load)
        return ReducedLoad(*self.loads(load.torque), derivative[n:, n:], derivative[n:, :n], 0.0, 0.0)

    def loads(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Loads on motors, and on springs and section coordinates."""
        at_sections = torque[self._c.section_indices]
        by_section = (at_sections[:, None, :] @ self._chain.first).ravel()
        return torque[self._c.motor_indices], np.concatenate([torque[self._c.spring_indices], by_section])

    def velocity(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Joint rates at rates of motors, springs and section coordinates."""
        rates: FloatArray = np.zeros(self._c.count)
        n = len(self._c.spring_indices)
        rates[self._c.motor_indices], rates[self._c.spring_indices] = motors, elastic[:n]
        rates[self._c.section_indices] = (self._chain.first @ elastic[n:].reshape(*self._c.places.shape, 1))[..., 0]
        return rates

    def velocity_product(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Second derivative of the map of each section along its rates."""
        strain_rates = elastic[len(self._c.spring_indices) :].reshape(self._c.places.shape)
        accelerations: FloatArray = np.zeros(self._c.count)
        accelerations[self._c.section_indices] = self._chain.velocity_product(strain_rates)
        return accelerations

    def motor_derivatives(self, load: JointLoad) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the load on each motor, by motors and by springs and section coordinates."""
        n = len(self._c.motor_indices)
        rows = self._derivative(load)[:n]
        return rows[:, :n], rows[:, n:]

    def _derivative(self, load: JointLoad) -> FloatArray:
        """Derivative of a load on motors, springs and sections with respect to them, shape (n, n).

        Between two sections it is a product of combined columns, within one it goes joint by joint.
        """
        c, chain = self._c, self._chain
        at_sections = load.torque[c.section_indices]
        angular, by_force = self._combine(load.angular), self._combine(load.by_force)
        derivative = (angular.T @ by_force) * c.before
        derivative += derivative.T
        if load.by_moment is not None:
            derivative += (angular.T @ self._combine(load.by_moment)) * c.before.T
        singles = np.arange(len(c.singles))
        derivative[singles, singles] += np.einsum("ij,ij->j", angular[:, singles], by_force[:, singles])
        within = np.swapaxes(chain.first, -1, -2) @ (load.within(c.section_indices) @ chain.first)
        derivative[c.places[:, :, None], c.places[:, None, :]] += within + chain.curvature(at_sections)
        if load.gravity_derivative is not None:
            derivative += self._combine(self._combine(load.gravity_derivative).T).T
        return np.asarray(derivative)

    def _combine(self, matrix: FloatArray) -> FloatArray:
        """Columns per motor, spring and section coordinate of a matrix with columns per joint."""
        c = self._c
        blocks = matrix[:, c.section_indices].transpose(1, 0, 2) @ self._chain.first  # (n, m, k)
        flat = blocks.transpose(1, 0, 2).reshape(len(matrix), c.places.size)
        return np.concatenate([matrix[:, c.singles], flat], axis=1)

    def columns(self, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Columns per actuator, and per spring and section coordinate."""
        combined, n = self._combine(jacobian), len(self._c.motor_indices)
        return combined[:, :n], combined[:, n:]
