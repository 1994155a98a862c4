"""The model that all statics works on: a Pinocchio model with its actuators, elastic coordinates and tip.

`softrobots.model.loader` is the only place that builds one.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots import inflated_beam
from softrobots.core.checks import LARGEST, FloatArray, finite_array, read_only
from softrobots.core.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.description.urdf_tags import InflatedLinkTag, MuscleTag
from softrobots.model.actuators import Actuators
from softrobots.model.chain_reader import read_chain
from softrobots.model.coordinates import Coordinates
from softrobots.model.serial_chain import SerialChain
from softrobots.model.springs import LinearSprings, SpringLaw, spring_law
from softrobots.model.structure import Parts, Structure

MAX_DOF = 300
"""Largest number of coordinates: Pinocchio's workspace takes seconds and 0.9 GB there, eight times that at twice as many."""

_KEPT_GRAVITIES = 8  # copies of Pinocchio's model in each thread


@dataclass(frozen=True)
class SpringGroup:
    """The springs that stand for one inflated link."""

    springs: tuple[int, ...]
    """Their places in `SoftModel.spring_joints`."""
    radius: float
    """Tube radius [m]."""
    pressure: float
    """Gauge pressure [Pa]."""
    segment: int | None = None
    """Number of the segment, if the group is one of its sections."""
    max_moment: float | None = None
    """Largest moment, beyond wrinkling [N m]; None: the springs are linear."""

    @property
    def wrinkling_moment(self) -> float:
        """Moment of the first wrinkle [N m], [Troise 2021] (3)."""
        return inflated_beam.wrinkling_moment(self.pressure, self.radius)


class SoftModel:
    """A robot with actuators (prescribed) and elastic coordinates (free), ready for statics.

    Actuators are motor joints, then muscles; `q_motors` everywhere holds joint coordinates, then muscle lengths (or tensions).
    Elastic coordinates, `q_springs`, are joint springs and what the actuators leave free of the sections of constant strain.

    Made by `softrobots.load_model`. Arrays are ordered base to tip. Nothing of it can be changed; do not change `pinocchio`
    either.

    Safe to share between threads, which get the same bytes as one alone: each thread has its own Pinocchio workspaces, made
    when it first asks (0.2 ms for an arm, seconds near `MAX_DOF`) and freed when it ends. It pickles as its URDF text and what
    was said about it; processes that load it anew get the same bytes, too. After `os.fork` in a program with threads nothing is
    promised: start processes by "spawn".
    """

    def __init__(
        self, *, pinocchio_model: Any, urdf: str, parts: Parts, inflated_links: Sequence[InflatedLinkTag], tip: str
    ) -> None:
        """Order the joints and prepare index arrays; call `load_model` instead."""
        self._pin = pinocchio_model
        self._urdf = urdf
        self._structure = Structure(pinocchio_model, parts)
        names, stiffness, rest, turning = self._structure.law
        linear = LinearSprings(read_only(stiffness), read_only(rest))
        self._springs = spring_law(linear, names, self._structure.spring_joints, inflated_links)
        frames = [(frame.name, number) for number, frame in enumerate(pinocchio_model.frames)]
        bodies = [(name, number) for name, number in frames if pinocchio_model.frames[number].type == pin.FrameType.BODY]
        self._frame_ids = dict(frames) | dict(bodies)  # a link goes before a joint of the same name
        self._tip = tip
        sections = self._structure.section_of
        self._groups = tuple(
            SpringGroup(
                tuple(names.index(name) for name in link.springs),
                link.radius,
                link.pressure,
                sections[link.springs[0]].segment if link.springs[0] in sections else None,
                link.max_moment,
            )
            for link in inflated_links
            if all(name in names for name in link.springs)
        )
        self._circles = {
            self._pin.joints[i].idx_v: self._pin.joints[i].idx_q
            for i in range(1, self._pin.njoints)
            if self._pin.joints[i].nq == 2
        }
        self._plain = not self._circles
        self._q_indices = np.array([self._pin.joints[i].idx_q for i in range(1, self._pin.njoints)], dtype=np.intp)
        self._stiffest = float((stiffness[turning] if turning.any() else stiffness).max(initial=0.0))
        self._rounding = 8.0 * float(np.finfo(np.float64).eps) * float(np.linalg.norm(self.stiffness * self.rest))
        self._reach = self._chain_length()
        self._identity = (urdf, tuple(self.spring_table.items()), self.motor_joints, tip, parts.muscle_input)
        self._chain: SerialChain | None = None
        self._local = threading.local()

    def __repr__(self) -> str:
        """Name, motors, springs and tip in one line."""
        return (
            f"SoftModel({self._pin.name!r}, motors={list(self.motor_joints)}, springs={list(self.spring_joints)}, "
            f"tip={self._tip!r})"
        )

    def __eq__(self, other: object) -> bool:
        """Whether two models are the same robot: same description, springs, motors and tip."""
        return isinstance(other, SoftModel) and self._identity == other._identity

    def __hash__(self) -> int:
        """Hash that fits `==`."""
        return hash(self._identity)

    @property
    def pinocchio(self) -> Any:
        """The `pinocchio.Model` (gravity as Pinocchio sets it; the statics does not use that)."""
        return self._pin

    @property
    def urdf(self) -> str:
        """The URDF text that the model was loaded from."""
        return self._urdf

    @property
    def structure(self) -> Structure:
        """The parts that the robot is put together from."""
        return self._structure

    @property
    def actuators(self) -> Actuators:
        """Motors and muscles, with their limits."""
        return self._structure.actuators

    @property
    def coordinates(self) -> Coordinates:
        """The map from actuators and elastic coordinates to joint positions."""
        return self._structure.coordinates

    @property
    def motor_joints(self) -> tuple[str, ...]:
        """Names of the actuators: motor joints, then muscles."""
        return self.actuators.names

    @property
    def muscles(self) -> tuple[MuscleTag, ...]:
        """The muscles; the last actuators."""
        return self._structure.muscles

    @property
    def muscle_input(self) -> str:
        """What `q_motors` holds of the muscles: "lengths" or "forces"."""
        return self._structure.parts.muscle_input

    @property
    def spring_joints(self) -> tuple[str, ...]:
        """Names of the elastic coordinates: spring joints by their names, then what is free of sections.

        `section_<segment>_<i>_bend_x` is a section coordinate; `segment_<i>_bend_x_mode_<j>` a difference between the sections
        of a segment whose muscle lengths are given.
        """
        return self._structure.law.names

    @property
    def springs(self) -> SpringLaw:
        """The spring law: `LinearSprings`, or `SaturatingSprings` if a link has a largest moment."""
        return self._springs

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the elastic coordinates near rest, shape (n_springs,) [N m/rad or N/m], read-only."""
        return self._springs.stiffness

    @property
    def stiffest(self) -> float:
        """Largest stiffness of an elastic angle [N m/rad] (of a distance [N/m] if there are only those); 0 without springs."""
        return self._stiffest

    @property
    def rounding(self) -> float:
        """Rounding of the spring torques [N m]: `k (y - rest)` of a stiff spring with a rest coordinate is no more exact."""
        return self._rounding

    @property
    def rest(self) -> FloatArray:
        """Relaxed elastic coordinates, shape (n_springs,) [rad or m], read-only."""
        return self._springs.rest

    @property
    def spring_table(self) -> dict[str, tuple[float, float]]:
        """Stiffness and rest coordinate by name of spring joint, in the form that `load_model(springs=...)` takes."""
        tags = self._structure.parts.springs
        return {name: (tags[name].stiffness, tags[name].rest) for name in self._structure.spring_joints}

    @property
    def spring_groups(self) -> tuple[SpringGroup, ...]:
        """Springs of one inflated link each, with radius and pressure; empty if the file names no inflated link."""
        return self._groups

    @property
    def tip(self) -> str:
        """Name of the tip frame."""
        return self._tip

    @property
    def reach(self) -> float:
        """Sum of the link lengths from base to tip, and of the travel of sliding joints [m], the scale of residuals.

        A slide without limits counts as 1 m.
        """
        return self._reach

    @property
    def n_motors(self) -> int:
        """Number of actuators: motor joints and muscles."""
        return len(self.actuators.names)

    @property
    def n_springs(self) -> int:
        """Number of elastic coordinates."""
        return len(self._structure.law.names)

    @property
    def motor_limits(self) -> FloatArray:
        """Lower and upper limit of each actuator, shape (n_motors, 2) [rad, m or N], read-only; infinite if continuous."""
        return self.actuators.limits

    @property
    def motor_scale(self) -> FloatArray:
        """Change of each actuator that moves the robot about as much as a radian, shape (n_motors,), read-only."""
        return self.actuators.scale

    @property
    def relaxed_motors(self) -> FloatArray:
        """Motor joints at zero, muscles at rest or without tension, shape (n_motors,) [rad, m or N], read-only.

        Or as near to that as the limits allow.
        """
        return self.actuators.relaxed

    @property
    def spring_limits(self) -> FloatArray:
        """Lower and upper limit of each spring joint, shape (n, 2) [rad or m], read-only; sections have none of their own."""
        return self._structure.joint_limits(self._structure.spring_joints)

    @property
    def motor_indices(self) -> Any:
        """Places of the motor joints in Pinocchio's velocity vector."""
        return self._structure.motor_indices

    @property
    def spring_indices(self) -> Any:
        """Places of the spring joints in Pinocchio's velocity vector."""
        return self._structure.spring_indices

    def checked_motors(self, q_motors: Any, field: str = "q_motors") -> FloatArray:
        """Return actuator coordinates that the robot can take, as a new array.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N].
            field: Name of the parameter, for the error.

        Raises:
            ParameterError: If the shape differs, a number is not finite, or no shape of the robot has such muscle lengths.
        """
        return self.actuators.checked(q_motors, field)

    def configuration(self, q_motors: Any, q_springs: Any | None = None) -> FloatArray:
        """Pinocchio's configuration vector from actuator and elastic coordinates.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N].
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
        if self._plain:
            return joints
        q: FloatArray = np.zeros(self._pin.nq)
        q[self._q_indices] = joints
        for index_v, index_q in self._circles.items():
            q[index_q], q[index_q + 1] = np.cos(joints[index_v]), np.sin(joints[index_v])
        return q

    def frame_id(self, name: str) -> int:
        """Pinocchio's number of a frame (link or joint).

        Args:
            name: Name of the frame.

        Returns:
            Its number. Pinocchio itself answers an unknown name with a number out of range.

        Raises:
            NameNotFound: If there is no such frame; the error lists the links.
        """
        number: int | None = self._frame_ids.get(name) if isinstance(name, str) else None
        if number is None:
            links = [frame.name for frame in self._pin.frames if frame.type == pin.FrameType.BODY]
            raise NameNotFound("frame", str(name), links)
        return number

    def workspace(self, gravity: tuple[float, float, float] | None) -> tuple[Any, Any]:
        """Pinocchio model and data of the calling thread for a gravity vector (world axes, [m/s^2]; None: weightless).

        Pinocchio data is expensive to make and large (0.2 ms and little for an arm, seconds and 0.9 GB at `MAX_DOF`), so a
        thread makes it once, for all gravities: no function that is called here finds anything in it from the call before.
        Pinocchio keeps gravity in its model; of that a few copies are kept.

        Raises:
            DescriptionError: If the robot has more than `MAX_DOF` coordinates.
        """
        pairs: dict[Any, tuple[Any, Any]] | None = getattr(self._local, "pairs", None)
        if pairs is None:
            if self._pin.nv > MAX_DOF:
                raise DescriptionError(
                    f"{self._pin.name} has {self._pin.nv} coordinates; Pinocchio's workspace is made for at most {MAX_DOF} "
                    f"(for longer chains softrobots.compile makes a compiled solver)"
                )
            pairs = self._local.pairs = {None: (self._pin, self._pin.createData())}
        pair = pairs.get(gravity)
        if pair is None:
            model = self._pin.copy()
            model.gravity.linear = np.array(gravity)
            kept = [key for key in pairs if key is not None]
            if len(kept) >= _KEPT_GRAVITIES:
                del pairs[kept[0]]
            pair = pairs[gravity] = (model, pairs[None][1])
        return pair

    def chain(self) -> SerialChain:
        """The robot as a serial chain from base to tip, for compiled solvers; made on first use, without Pinocchio's workspace.

        Raises:
            DescriptionError: If a joint is not between base and tip, or neither turns nor slides, or if a link has a largest
                moment.
        """
        if self._chain is None:
            self._chain = read_chain(self._pin, self._structure, self._springs, self.frame_id(self._tip), self._reach)
        return self._chain

    def _chain_length(self) -> float:
        names = [name for section in self._structure.section_table for name in section.joint_names]
        strained = set(self._structure.indices(names).tolist())  # their travel is strain
        frame = self._pin.frames[self.frame_id(self._tip)]
        length = float(np.linalg.norm(frame.placement.translation))
        joint = frame.parentJoint
        while joint > 0:
            length += float(np.linalg.norm(self._pin.jointPlacements[joint].translation))
            kind = self._pin.joints[joint]
            if kind.shortname().startswith("JointModelP") and kind.idx_v not in strained:
                travel = float(self._pin.upperPositionLimit[kind.idx_q] - self._pin.lowerPositionLimit[kind.idx_q])
                length += travel if travel < LARGEST else 1.0
            joint = self._pin.parents[joint]
        return max(length, 1e-6)


def check_model(model: Any) -> SoftModel:
    """Return `model` if it is a `SoftModel`.

    Raises:
        ParameterError: If it is something else, e.g. a robot that has not been loaded.
    """
    if not isinstance(model, SoftModel):
        raise ParameterError("model", model, "a SoftModel (made by softrobots.load_model)")
    return model
