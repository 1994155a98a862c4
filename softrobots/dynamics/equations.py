r"""Equations of motion of a robot in actuator and elastic coordinates `x = (u, y)`.

With joint positions `q(x)` and :math:`Q = \partial q / \partial x` the joints move with

.. math:: \dot q = Q \dot x, \qquad \ddot q = Q \ddot x + \dot Q \dot x

and the power of any motion gives (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 3.2)

.. math:: r(x, \dot x, \ddot x) = Q^T \bigl(\mathrm{ID}(q, \dot q, \ddot q) - J^T w\bigr) + \partial V / \partial x
          + D \dot x + A \ddot x

with the inverse dynamics `ID` of the rigid bodies and their weight, the elastic energy `V`, a constant damping `D` and the
inertia `A` of rotors. `r` is what has to act on each coordinate from outside: zero on an elastic coordinate, the force of the
actuator on an actuator. A muscle whose length is free has what it is given as its coordinate, which moves nothing by itself;
the energy of an elastic tendon is part of `V`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.dynamics.friction_steps import StepFriction
from softrobots.model.actuators import Drives
from softrobots.model.coordinates import Point
from softrobots.model.dry_friction import FrictionMemory
from softrobots.model.muscle_length_point import MuscleLengthPoint
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import AppliedLoad, Load


class EquationsOfMotion:
    """Equations of motion of one robot; belongs to the thread that created it."""

    def __init__(
        self,
        model: SoftModel,
        gravity: tuple[float, float, float] | None = None,
        damping: FloatArray | None = None,
        drives: Drives | None = None,
    ) -> None:
        """Take the robot and what acts on all of it.

        Args:
            model: The robot.
            gravity: Gravity, world axes [m/s^2]; None: weightless.
            damping: `D` of the elastic coordinates, shape (n_springs, n_springs); None: none.
            drives: Rotors, `A`, and viscous friction of the actuators, where they move by their force; None: neither acts.
        """
        self.model, self.gravity = model, gravity
        self.friction = None if model.structure.friction is None else StepFriction(model)
        """Dry friction in the step that is being taken; None if there is none."""
        self._coordinates = model.coordinates if self.friction is None else self.friction.coordinates
        self.n_motors, self.n = model.n_motors, model.n_motors + model.n_springs
        weightless = 0.0, 0.0, 0.0  # for the workspace; Pinocchio's own model has gravity
        self._pinocchio, self._data = model.workspace(weightless if gravity is None else gravity)
        self.damping: FloatArray = np.zeros((self.n, self.n))
        """`D` of all coordinates, shape (n, n)."""
        if damping is not None:
            self.damping[self.n_motors :, self.n_motors :] = damping
        self.rotor_inertia: FloatArray = np.zeros(self.n)
        """Diagonal of `A` of all coordinates, shape (n,)."""
        if drives is not None:
            self.rotor_inertia[: self.n_motors] = drives.rotor_inertia
            self.damping[: self.n_motors, : self.n_motors] += np.diag(drives.damping)
        self._undamped, self._rotorless = not self.damping.any(), not self.rotor_inertia.any()
        self._laws = model.structure.actuator_laws
        kinds = () if self._laws is None else self._laws.kinds
        self._springy = np.array([kind == "elastic" for kind in kinds], dtype=bool)
        self.has_slack_tendons = "elastic" in kinds or "mckibben" in kinds
        """Whether tensions depend on the lengths and may be slack."""
        self._pushing = model.actuators.n_placed + np.flatnonzero(~self._springy)
        self._applied: tuple[Any, AppliedLoad] | None = None
        self._last: tuple[bytes, Point] | None = None
        self._motors_move = drives is not None

    def point(self, x: FloatArray) -> Point:
        """The robot at coordinates, shape (n,); the last one is kept."""
        key = x.tobytes()
        if self._last is None or self._last[0] != key:
            kept = x.copy()
            self._last = key, self._coordinates.at(kept[: self.n_motors], kept[self.n_motors :])
        return self._last[1]

    def begin_step(self, memory: FrictionMemory | None, x: FloatArray, rates: FloatArray, length: float) -> None:
        """Begin a step of a length [s] from coordinates and rates, each shape (n,), with what dry friction remembers there."""
        if self.friction is not None and memory is not None:
            self.friction.begin(memory, self.strains(x), self.strain_rates(x, rates), length)
            self._last = None

    def grip(self, x: FloatArray, forces: FloatArray) -> bool:
        """Let the friction of guides follow what acts on the actuators in the middle of a step, shape (n,); False without."""
        if self.friction is None or not self.friction.guided:
            return False
        self.friction.grip(self.strains(x), forces[len(self.model.structure.motor_joints) : self.n_motors])
        self._last = None
        return True

    def end_step(self, middle: FloatArray, rates: FloatArray, end: FloatArray) -> tuple[FrictionMemory | None, float]:
        """Return what dry friction remembers after a step, and the power that it takes [W].

        Args:
            middle: Coordinates in the middle, shape (n,).
            rates: Their rates, shape (n,).
            end: Coordinates at the end, shape (n,).
        """
        if self.friction is None:
            return None, 0.0
        strains = self.strains(middle)
        power = float(self.friction.torque(strains) @ self.strain_rates(middle, rates))
        return self.friction.end(strains, self.strains(end)), power

    def strains(self, x: FloatArray) -> FloatArray:
        """Strains at coordinates, shape (n_strains,)."""
        return self.model.structure.strains(x[: self.n_motors], x[self.n_motors :])

    def strain_rates(self, x: FloatArray, rates: FloatArray) -> FloatArray:
        """Rates of the strains at coordinates and rates, each shape (n,); shape (n_strains,)."""
        m, point = self.n_motors, self.point(x)
        if not isinstance(point, MuscleLengthPoint):
            return rates[m:]
        by_lengths, by_free = point.strain_slopes
        return np.asarray(by_lengths @ rates[m - by_lengths.shape[1] : m] + by_free @ rates[m:])

    def balance(self, x: FloatArray, rates: FloatArray, accelerations: FloatArray, wrenches: Mapping[str, FloatArray]) -> Any:
        """What has to act on each coordinate from outside; see the module.

        Args:
            x: Actuators, then elastic coordinates, shape (n,) [rad, m or N].
            rates: Their rates, shape (n,).
            accelerations: Their accelerations, shape (n,).
            wrenches: Dead wrench by frame, shape (6,) [N, N m], world axes.

        Returns:
            Forces, shape (n,) [N m or N]; NaN where a section is out of range.
        """
        m, point = self.n_motors, self.point(x)
        if not point.valid:
            return np.full(self.n, np.nan)
        joint_rates = point.velocity(rates[:m], rates[m:])
        joint_accelerations = point.velocity(accelerations[:m], accelerations[m:])
        joint_accelerations += point.velocity_product(rates[:m], rates[m:])
        q = self.model.embed(point.joints)
        inertia = pin.rnea(self._pinocchio, self._data, q, joint_rates, joint_accelerations)
        forces: FloatArray = np.concatenate(point.loads(self._joint_load(q, wrenches) - inertia))
        np.negative(forces, out=forces)
        forces[m:] += self.model.springs.at(x[m:])[1]
        if not self._undamped:
            forces += self.damping.dot(rates)
        if not self._rotorless:
            forces += self.rotor_inertia * accelerations
        return forces

    def load(self, x: FloatArray, wrenches: Mapping[str, FloatArray]) -> FloatArray:
        """Wrenches on each coordinate, `Q^T J^T w`, shape (n,) [N m or N]: their power is that times the rates."""
        point = self.point(x)
        torque = self._joint_load(self.model.embed(point.joints), wrenches)
        return np.asarray(np.concatenate(point.columns(torque[None]), axis=1)[0])

    def mass_matrix(self, x: FloatArray) -> FloatArray:
        r"""Mass matrix :math:`Q^T M_q Q + A`, shape (n, n)."""
        point = self.point(x)
        rows = np.concatenate(point.columns(self.model.data.mass_matrix(self.model.embed(point.joints))), axis=1)
        mass: FloatArray = np.concatenate(point.columns(np.ascontiguousarray(rows.T)), axis=1)
        return mass if self._rotorless else mass + np.diag(self.rotor_inertia)

    def stiffness(self, x: FloatArray, wrenches: Mapping[str, FloatArray]) -> FloatArray:
        """Derivative of `balance` at rest with respect to the coordinates, shape (n, n); rows of prescribed motors are zero."""
        m, point = self.n_motors, self.point(x)
        load = self._load_of(wrenches).at(self.model.embed(point.joints))
        reduced = point.reduce(load)
        stiffness: FloatArray = np.zeros((self.n, self.n))
        stiffness[m:, m:] = self.model.springs.at(x[m:])[2] - reduced.derivative
        stiffness[m:, :m] = -reduced.coupling
        if self._motors_move:
            stiffness[:m] = -np.concatenate(point.motor_derivatives(load), axis=1)
        return stiffness

    def energies(self, x: FloatArray, rates: FloatArray) -> tuple[float, float, float]:
        """Kinetic energy, elastic energy, and potential energy of the weight [J]."""
        m, point = self.n_motors, self.point(x)
        q = self.model.embed(point.joints)
        moving = pin.computeKineticEnergy(self._pinocchio, self._data, q, point.velocity(rates[:m], rates[m:]))
        potential = 0.0 if self.gravity is None else pin.computePotentialEnergy(self._pinocchio, self._data, q)
        kinetic = float(moving) + 0.5 * float(self.rotor_inertia.dot(rates * rates))
        springs, structure = self.model.springs, self.model.structure
        elastic = springs.at(x[m:])[0]
        if structure.muscle_lengths is not None:  # the sums that the lengths fix store energy, too
            stretch = x[m:] - springs.rest
            strains = structure.strain_springs.at(structure.strains(x[:m], x[m:]))[0]
            elastic += strains - 0.5 * float(springs.stiffness.dot(stretch * stretch))
        if self._laws is not None and self._springy.any():
            elongation, inputs = structure.muscle_paths.at(x[m:]).elongation, x[self.model.actuators.n_placed : m]
            elastic += float(self._laws.at(elongation, inputs).energy[self._springy].sum())
        return kinetic, elastic, float(potential)

    def actuator_rates(self, x: FloatArray, rates: FloatArray) -> FloatArray:
        """Rates with which actuators move, shape (n_motors,) [rad/s, m/s].

        They are those of the lengths where tensions or pressures are given, and those of the motors of elastic tendons.
        """
        moving = np.array(rates[: self.n_motors])
        if len(self._pushing):
            lengths = self.model.structure.muscle_paths.at(x[self.n_motors :]).arms @ rates[self.n_motors :]
            moving[self._pushing] = lengths[~self._springy]
        return moving

    def _joint_load(self, q: FloatArray, wrenches: Mapping[str, FloatArray]) -> FloatArray:
        """Wrenches on each joint, `J^T w`, shape (nv,) [N m or N]."""
        torque: FloatArray = np.zeros(self._pinocchio.nv)
        for frame, wrench in wrenches.items():
            torque += wrench.dot(frame_jacobian(self.model, q, frame))
        return torque

    def _load_of(self, wrenches: Mapping[str, FloatArray]) -> AppliedLoad:
        """The load of wrenches, kept while they stay the same object."""
        if self._applied is None or self._applied[0] is not wrenches:
            self._applied = wrenches, AppliedLoad(self.model, Load(wrenches, self.gravity))
        return self._applied[1]
