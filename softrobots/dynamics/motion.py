"""A robot in motion: what `simulate` returns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.summary import Part, Summarised
from softrobots.dynamics.motion_summary import motion_parts
from softrobots.model.link_limits import LinkLimits, link_limits
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement


@dataclass(frozen=True, eq=False, repr=False)
class MotionEnergy(Summarised):
    """Energies of a robot in motion, and what went in and out since the start, each shape (n,) [J]."""

    kinetic: FloatArray
    """Kinetic energy, of rotors too."""
    elastic: FloatArray
    """Energy of the springs and sections."""
    potential: FloatArray
    """Potential energy of the weight."""
    dissipated: FloatArray
    """What dampers and dry friction have taken."""
    load_work: FloatArray
    """Work of forces and wrenches."""
    motor_work: FloatArray
    """Work of motors and muscles."""

    @cached_property
    def balance(self) -> FloatArray:
        """Energy that the scheme has made, minus its first value: zero to the order of the scheme, shape (n,) [J]."""
        stored = self.kinetic + self.elastic + self.potential
        total = stored + self.dissipated - self.load_work - self.motor_work
        return read_only(total - total[0])


@dataclass(frozen=True, eq=False, repr=False)
class MotionState(Summarised):
    """State of a robot in motion, from which `simulate` can start."""

    model: SoftModel
    """The robot, with what its dry friction remembers."""
    time: float
    """Time in the motion that it is taken from [s]."""
    q_motors: FloatArray
    """Actuators, shape (n_motors,) [rad, m or N]."""
    motor_velocities: FloatArray
    """Their rates, shape (n_motors,)."""
    q_springs: FloatArray
    """Elastic coordinates, shape (n_springs,) [rad or m]."""
    velocities: FloatArray
    """Their rates, shape (n_springs,) [rad/s or m/s]."""


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Summarised):
    """A simulated motion, a row for each time."""

    model: SoftModel
    """The robot."""
    time: FloatArray
    """Times of the rows, shape (n,) [s]."""
    q_motors: FloatArray
    """Actuators, shape (n, n_motors) [rad, m or N]."""
    motor_velocities: FloatArray
    """Their rates, shape (n, n_motors) [rad/s, m/s or N/s]."""
    q_springs: FloatArray
    """Elastic coordinates, shape (n, n_springs) [rad or m]."""
    velocities: FloatArray
    """Their rates, shape (n, n_springs) [rad/s or m/s]."""
    motor_torques: FloatArray
    """Load that each actuator carries, with that of the accelerated masses, shape (n, n_motors) [N m or N].

    Of a motor that moves by its torque: minus that torque."""
    forces: FloatArray
    """Force on the tip, shape (n, 3) [N]."""
    gravity: tuple[float, float, float] | None
    """Gravity [m/s^2]; None: weightless."""
    damping_time: float | None
    """Damping over stiffness [s]; None: the damping of the description."""
    energy: MotionEnergy
    """Energies and their balance."""
    steps: FloatArray
    """Times at the ends of all steps that were taken, the first included, shape (m,) [s]."""
    tip_error: float | None = None
    """Measured error of the tip position, the largest of all steps, with a safety factor of 1.2 [m] (see
    `softrobots.dynamics.step_control`); None for fixed steps, where it is not measured."""
    tolerance: float | None = None
    """Largest `tip_error` that was asked for [m]; None for fixed steps."""
    mass_damping: float = 0.0
    """Damping over mass [1/s]."""
    interrupted: bool = False
    """Whether Ctrl-C ended it early; the rows end before the duration then, or their steps miss the tolerance."""

    def __repr__(self) -> str:
        """Robot, rows, steps and error in a line, instead of all numbers."""
        return (
            f"Motion({self.model.pinocchio.name}, {len(self.time)} rows until {self.time[-1]:.6g} s, "
            f"{len(self.steps) - 1} steps, tip_error={self.tip_error}, interrupted={self.interrupted})"
        )

    def summary_parts(self) -> list[Part]:
        """Return ranges of tip, motors and springs, then energies, steps and the error."""
        return motion_parts(self)

    def configuration(self, row: int) -> FloatArray:
        """Pinocchio's configuration in a row, shape (nq,)."""
        point = self.model.coordinates.at(self.q_motors[row], self.q_springs[row])
        return self.model.embed(point.joints)

    def transforms(self, frame: str | None = None) -> FloatArray:
        """Pose of a frame in the world in each row, shape (n, 4, 4) [m]; by default that of the tip.

        Raises:
            NameNotFound: If there is no such frame.
        """
        name = self.model.tip if frame is None else frame
        configurations = map(self.configuration, range(len(self.time)))
        return np.array([frame_placement(self.model, q, name).homogeneous for q in configurations])

    @cached_property
    def tip_position(self) -> FloatArray:
        """Position of the tip in the world, shape (n, 3) [m]."""
        return read_only(np.ascontiguousarray(self.transforms()[:, :3, 3]))

    def link_limits(self, row: int) -> LinkLimits:
        """What inflated links carry in a row, and the limits of their walls, as `Equilibrium.link_limits`.

        Moments are those of the springs. Axial forces are those of the weight and of the force on the tip; those of accelerated
        masses, and of wrenches at other frames, are left out.
        """
        parts = {"q": self.configuration(row), "torques": self.model.springs.at(self.q_springs[row])[1]}
        tensions = self.motor_torques[row, self.model.n_motors - len(self.model.muscles) :]
        load = {self.model.tip: np.append(self.forces[row], np.zeros(3))}
        return link_limits(self.model, load, self.gravity, **parts, tensions=tensions)

    @cached_property
    def wrinkled(self) -> NDArray[np.bool_]:
        """Whether a link carries its wrinkling moment (3) of [Troise 2021] or more, or is on its plateau, shape (n,).

        Linear springs are no longer valid there.
        """
        wrinkled = np.zeros(len(self.time), dtype=bool)
        groups = self.model.spring_groups
        for row in range(len(self.time) if groups else 0):
            beyond = self.model.springs.saturated(self.q_springs[row])
            flat = any(not beyond.isdisjoint(group.springs) for group in groups)
            wrinkled[row] = flat or bool(np.any(self.link_limits(row).wrinkling_margins <= 0.0))
        wrinkled.setflags(write=False)
        return wrinkled

    @property
    def end(self) -> MotionState:
        """The last state; `simulate(start=...)` takes it, and the motion itself."""
        return MotionState(
            self.model,
            float(self.time[-1]),
            self.q_motors[-1],
            self.motor_velocities[-1],
            self.q_springs[-1],
            self.velocities[-1],
        )
