"""The model that all statics works on: a Pinocchio model with its actuators, elastic coordinates and tip.

`softrobots.model.assembly` builds it for `softrobots.load_model`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, finite_array, instance_of, read_only
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import ROUNDING
from softrobots.model.actuators import Actuators
from softrobots.model.chain_reader import read_chain
from softrobots.model.coordinates import Coordinates
from softrobots.model.pinocchio_data import PinocchioData
from softrobots.model.robot_summary import SummarisedRobot
from softrobots.model.serial_chain import SerialChain
from softrobots.model.springs import SpringGroup, Springs
from softrobots.model.structure import Structure


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SoftModel(SummarisedRobot):
    """A robot with actuators (prescribed) and elastic coordinates (free), ready for statics.

    Actuators are motor joints, then muscles; `q_motors` everywhere holds joint coordinates, then the inputs of muscles, or is
    a mapping of them by name.
    Elastic coordinates, `q_springs`, are joint springs and the free coordinates of the sections of constant strain.

    Returned by `softrobots.load_model`. Arrays are ordered base to tip. A model is immutable; do not change `pinocchio` either.

    Threads may share a model and get the same bytes as one alone: each thread has its own Pinocchio workspaces, allocated on
    first use (0.2 ms for an arm, seconds near `MAX_DOF`) and freed when the thread ends. A model pickles as its URDF text and
    the arguments of `load_model`; processes that load it again get the same bytes, too. Do not use `os.fork` in a program with
    threads: start processes by "spawn".
    """

    pinocchio: Any
    """The `pinocchio.Model` (gravity as Pinocchio sets it; the statics does not use that)."""
    urdf: str
    """The URDF text that the model was loaded from."""
    tip: str
    """Name of the tip frame."""
    structure: Structure
    """Motors, springs, sections and muscles in order."""
    actuators: Actuators
    """Motors and muscles, with their limits."""
    coordinates: Coordinates
    """The map from actuators and elastic coordinates to joint positions."""
    springs: Springs
    """The springs of the elastic coordinates, with the plateaus of inflated links that have a largest moment."""
    data: PinocchioData
    """Pinocchio's working memory."""
    reach: float
    """Sum of the link lengths from base to tip, and of the travel of sliding joints [m], the scale of residuals.

    A slide without limits counts as 1 m.
    """
    robot: Any = None
    """The dataclass of parameters that the model was loaded from; None for a file or text, and for what `load_result` loads."""

    def __eq__(self, other: object) -> bool:
        """Whether two models are the same robot: same description, springs, motors and tip."""
        return isinstance(other, SoftModel) and self._identity == other._identity

    def __hash__(self) -> int:
        """Hash that fits `==`."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(self._identity)

    @cached_property
    def _identity(self) -> tuple[Any, ...]:
        return self.urdf, tuple(self.spring_table.items()), self.motor_joints, self.tip, self.muscle_input

    @property
    def motor_joints(self) -> tuple[str, ...]:
        """Names of the actuators: motor joints, then muscles."""
        return self.actuators.names

    @property
    def actuator_names(self) -> tuple[str, ...]:
        """Names of the actuators in the order of `q_motors`; the same as `motor_joints`."""
        return self.actuators.names

    @property
    def actuator_units(self) -> tuple[str, ...]:
        """Unit of each of them: "rad", "m", "N" or "Pa"."""
        return self.actuators.units

    @property
    def muscles(self) -> tuple[ActuatorTag, ...]:
        """The muscles; the last actuators."""
        return self.structure.muscles

    @property
    def muscle_input(self) -> str:
        """Whether `q_motors` holds the "lengths" that muscles are given, or what they pull with, "forces": see their kinds."""
        return self.structure.muscle_input

    @property
    def spring_joints(self) -> tuple[str, ...]:
        """Names of the elastic coordinates: spring joints, then the free coordinates of sections.

        `section_<segment>_<i>_bend_x` is a section coordinate; `segment_<i>_bend_x_mode_<j>` a difference between the sections
        of a segment whose muscle lengths are given.
        """
        return self.springs.names

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the elastic coordinates near rest, shape (n_springs,) [N m/rad or N/m], read-only."""
        return self.springs.stiffness

    @cached_property
    def stiffest(self) -> float:
        """Largest stiffness of an elastic angle [N m/rad] (of a distance [N/m] if there are only those); 0 without springs."""
        turning = self.springs.turning
        return float((self.stiffness[turning] if turning.any() else self.stiffness).max(initial=0.0))

    @cached_property
    def rounding(self) -> float:
        """Rounding of the torques [N m]: `k (y - rest)` of a stiff spring with a rest, or a stiff tendon, is no more exact."""
        of_muscles = self.structure.actuator_laws or self.structure.muscle_lengths
        others = [one.rounding for one in (of_muscles, self.structure.friction) if one is not None]
        return ROUNDING * float(np.linalg.norm(self.stiffness * self.rest)) + sum(others)

    @property
    def rest(self) -> FloatArray:
        """Relaxed elastic coordinates, shape (n_springs,) [rad or m], read-only."""
        return self.springs.rest

    @property
    def spring_table(self) -> dict[str, tuple[float, float]]:
        """Stiffness and rest coordinate by name of spring joint, in the form that `load_model(springs=...)` takes."""
        springs = self.structure.strain_springs
        pairs = zip(springs.stiffness.tolist(), springs.rest.tolist(), strict=True)
        return dict(zip(self.structure.spring_joints, pairs, strict=False))  # coordinates of sections follow

    @property
    def joint_roles(self) -> dict[str, str]:
        """By movable joint of the file: "motor", "spring" of the file, "given spring" of the caller, "section" or "locked".

        An inflated link that lost a spring is none of `spring_groups` any more: it has no moment of its own, and no limits.
        """
        return self.structure.joint_roles

    @property
    def spring_groups(self) -> tuple[SpringGroup, ...]:
        """Springs of one inflated link each, with radius and pressure; empty if the file names no inflated link."""
        return self.springs.groups

    @property
    def n_motors(self) -> int:
        """Number of actuators: motor joints and muscles."""
        return len(self.actuators.names)

    @property
    def n_springs(self) -> int:
        """Number of elastic coordinates."""
        return len(self.springs.names)

    @property
    def motor_limits(self) -> FloatArray:
        """Lower and upper limit of each actuator, shape (n_motors, 2) [rad, m, N or Pa], read-only; infinite if continuous."""
        return self.actuators.limits

    @property
    def motor_scale(self) -> FloatArray:
        """Change of each actuator equivalent to about a radian of motion, shape (n_motors,), read-only."""
        return self.actuators.scale

    @property
    def relaxed_motors(self) -> FloatArray:
        """Motor joints at zero, muscles at rest or without input, shape (n_motors,) [rad, m, N or Pa], read-only.

        Or as near to that as the limits allow.
        """
        return self.actuators.relaxed

    @property
    def spring_limits(self) -> FloatArray:
        """Lower and upper limit of each spring joint, shape (n, 2) [rad or m], read-only; sections have none of their own."""
        return read_only(self.structure.elastic_limits[self.structure.spring_indices])

    @property
    def motor_indices(self) -> Any:
        """Places of the motor joints in Pinocchio's velocity vector."""
        return self.structure.motor_indices

    @property
    def spring_indices(self) -> Any:
        """Places of the spring joints in Pinocchio's velocity vector."""
        return self.structure.spring_indices

    def checked_motors(self, q_motors: Any, field: str = "q_motors") -> FloatArray:
        """Return actuator coordinates that the robot can have, as a new array.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa], or by name, `{"motor_1": 0.3, ...}`.
            field: Name of the parameter, for the error.

        Raises:
            ParameterError: If the shape differs, a name is missing, a number is not finite, or the robot cannot have such
                muscle lengths. This error and the next list the actuators with units and limits.
            NameNotFound: If there is no actuator of a name.
        """
        return self.actuators.questioned(self.actuators.checked(q_motors, field))

    def configuration(self, q_motors: Any, q_springs: Any | None = None) -> FloatArray:
        """Pinocchio's configuration vector from actuator and elastic coordinates.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa].
            q_springs: Elastic coordinates, shape (n_springs,) [rad or m]; relaxed by default.

        Returns:
            Configuration, shape (nq,); a continuous joint takes its cosine and sine.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or a section is bent or twisted beyond its range.
        """
        motors = self.checked_motors(q_motors)
        springs = self.rest if q_springs is None else finite_array("q_springs", q_springs, (self.n_springs,), "rad")
        point = self.coordinates.at(motors, springs)
        if not point.valid:
            raise ParameterError("q_springs", springs, "within the range of every section (see strain_chain.in_range)")
        return self.embed(point.joints)

    def embed(self, joints: FloatArray) -> FloatArray:
        """Pinocchio's configuration, shape (nq,), of joint positions in the order of its velocities, shape (nv,)."""
        if not self.data.circles:
            return joints
        q: FloatArray = np.zeros(self.pinocchio.nq)
        q[self.data.q_indices] = joints
        for index_v, index_q in self.data.circles:
            q[index_q], q[index_q + 1] = np.cos(joints[index_v]), np.sin(joints[index_v])
        return q

    def frame_id(self, name: str) -> int:
        """Pinocchio's number of a frame (link or joint).

        Args:
            name: Name of the frame.

        Returns:
            Its number. (Pinocchio itself returns a number out of range for an unknown name.)

        Raises:
            NameNotFound: If there is no such frame; the error lists the links.
        """
        number: int | None = self.data.frame_ids.get(name) if isinstance(name, str) else None
        if number is None:
            links = [frame.name for frame in self.pinocchio.frames if frame.type == pin.FrameType.BODY]
            raise NameNotFound("frame", str(name), links)
        return number

    def workspace(self, gravity: tuple[float, float, float] | None) -> tuple[Any, Any]:
        """Pinocchio model and data of the calling thread for a gravity vector (world axes, [m/s^2]; None: weightless).

        Allocated on first use in each thread (0.2 ms for an arm, seconds and 0.9 GB at `MAX_DOF`).

        Raises:
            DescriptionError: If the robot has more than `MAX_DOF` coordinates.
        """
        return self.data.at(gravity)

    def chain(self) -> SerialChain:
        """The robot as a serial chain from base to tip, for compiled solvers; read on first use, without Pinocchio's workspace.

        Raises:
            DescriptionError: If a joint is not between base and tip, or neither turns nor slides, if an inflated link has a
                plateau, or a slack wall with other springs than two that turn, one behind the other, or if the joints of a
                lumped section that has dry friction, or along which an actuator winds, are apart.
        """
        return self._chain

    @cached_property
    def _chain(self) -> SerialChain:
        tip = self.frame_id(self.tip)
        return read_chain(
            self.pinocchio, self.structure, tip, limits=self.motor_limits, reach=self.reach, groups=self.spring_groups
        )


def check_model(model: Any) -> SoftModel:
    """Return `model` if it is a `SoftModel`, or raise ParameterError, e.g. for a robot that has not been loaded."""
    return instance_of("model", model, SoftModel, "a SoftModel (made by softrobots.load_model)")
