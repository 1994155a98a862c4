"""The model that all statics works on: a Pinocchio model with its motors, springs and tip.

`softrobots.loader` is the only place that builds one.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots import inflated_beam
from softrobots.checks import FloatArray, finite_array, read_only
from softrobots.description import InflatedLinkTag, SpringTag
from softrobots.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.springs import LinearSprings

MAX_DOF = 300
"""Largest number of coordinates: Pinocchio's workspace needs 8 s and 1.8 GB there, 57 s and 14 GB at twice as many."""

_KEPT_GRAVITIES = 8  # Pinocchio keeps gravity in its model; so many copies are kept per thread


@dataclass(frozen=True)
class SpringGroup:
    """The springs that stand for one inflated link."""

    springs: tuple[int, ...]
    """Their places in `SoftModel.spring_joints`."""
    radius: float
    """Tube radius [m]."""
    pressure: float
    """Gauge pressure [Pa]."""

    @property
    def wrinkling_moment(self) -> float:
        """Moment of the first wrinkle [N m], [Troise 2021] (3)."""
        return inflated_beam.wrinkling_moment(self.pressure, self.radius)


class SoftModel:
    """A robot with motors (prescribed) and springs (elastic), ready for statics.

    Made by `softrobots.load_model`. Arrays are ordered base to tip. Safe to share between threads: each thread gets
    its own Pinocchio workspace. Nothing of it can be changed; do not change `pinocchio` either.
    """

    def __init__(
        self,
        *,
        pinocchio_model: Any,
        urdf: str,
        springs: Mapping[str, SpringTag],
        motors: Sequence[str],
        inflated_links: Sequence[InflatedLinkTag],
        tip: str,
    ) -> None:
        """Order the joints and prepare index arrays; call `load_model` instead."""
        self._pin = pinocchio_model
        self._urdf = urdf
        by_place = sorted(springs, key=pinocchio_model.getJointId)
        self._spring_joints = tuple(by_place)
        self._motor_joints = tuple(sorted(motors, key=pinocchio_model.getJointId))
        self._springs = LinearSprings(
            read_only(np.array([springs[name].stiffness for name in by_place], dtype=np.float64)),
            read_only(np.array([springs[name].rest for name in by_place], dtype=np.float64)),
        )
        frames = [(frame.name, number) for number, frame in enumerate(pinocchio_model.frames)]
        bodies = [(name, number) for name, number in frames if pinocchio_model.frames[number].type == pin.FrameType.BODY]
        self._frame_ids = dict(frames) | dict(bodies)  # a link goes before a joint of the same name
        self._tip = tip
        self._groups = tuple(
            SpringGroup(tuple(by_place.index(name) for name in link.springs), link.radius, link.pressure)
            for link in inflated_links
        )
        self._motor_v = self._indices(self._motor_joints, "idx_v")
        self._spring_v = self._indices(self._spring_joints, "idx_v")
        self._motor_q = self._indices(self._motor_joints, "idx_q")
        self._spring_q = self._indices(self._spring_joints, "idx_q")
        self._circles = {
            self._pin.joints[i].idx_v: self._pin.joints[i].idx_q
            for i in range(1, self._pin.njoints)
            if self._pin.joints[i].nq == 2
        }
        self._motor_limits = self._limits(self._motor_joints)
        self._spring_limits = self._limits(self._spring_joints)
        self._stiffest = float(self.stiffness.max(initial=0.0))
        self._rounding = 8.0 * float(np.finfo(np.float64).eps) * float(np.linalg.norm(self.stiffness * self.rest))
        self._reach = self._chain_length()
        self._identity = (urdf, tuple(self.spring_table.items()), self._motor_joints, tip)
        self._local = threading.local()

    def __repr__(self) -> str:
        """Name, motors, springs and tip in one line."""
        return (
            f"SoftModel({self._pin.name!r}, motors={list(self._motor_joints)}, springs={list(self._spring_joints)}, "
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
    def motor_joints(self) -> tuple[str, ...]:
        """Names of the motor joints."""
        return self._motor_joints

    @property
    def spring_joints(self) -> tuple[str, ...]:
        """Names of the spring joints."""
        return self._spring_joints

    @property
    def springs(self) -> LinearSprings:
        """The spring law."""
        return self._springs

    @property
    def stiffness(self) -> FloatArray:
        """Stiffness of the springs, shape (n_springs,) [N m/rad or N/m], read-only."""
        return self._springs.stiffness

    @property
    def stiffest(self) -> float:
        """Largest spring stiffness [N m/rad or N/m], the scale of the tangent stiffness; 0 without springs."""
        return self._stiffest

    @property
    def rounding(self) -> float:
        """Rounding of the spring torques [N m]: `k (y - rest)` of a stiff spring with a rest coordinate is no more exact."""
        return self._rounding

    @property
    def rest(self) -> FloatArray:
        """Relaxed spring coordinates, shape (n_springs,) [rad or m], read-only."""
        return self._springs.rest

    @property
    def spring_table(self) -> dict[str, tuple[float, float]]:
        """Stiffness and rest coordinate by joint name, in the form that `load_model(springs=...)` takes."""
        rows = zip(self._spring_joints, self.stiffness.tolist(), self.rest.tolist(), strict=True)
        return {name: (stiffness, rest) for name, stiffness, rest in rows}

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
        """Sum of the link lengths from base to tip, and of the travel of sliding joints [m], the scale of residuals."""
        return self._reach

    @property
    def n_motors(self) -> int:
        """Number of motors."""
        return len(self._motor_joints)

    @property
    def n_springs(self) -> int:
        """Number of springs."""
        return len(self._spring_joints)

    @property
    def motor_limits(self) -> FloatArray:
        """Lower and upper limit of each motor, shape (n_motors, 2) [rad or m], read-only; infinite for continuous joints."""
        return self._motor_limits

    @property
    def spring_limits(self) -> FloatArray:
        """Lower and upper limit of each spring, shape (n_springs, 2) [rad or m], read-only."""
        return self._spring_limits

    @property
    def motor_indices(self) -> Any:
        """Places of the motors in Pinocchio's velocity vector, shape (n_motors,)."""
        return self._motor_v

    @property
    def spring_indices(self) -> Any:
        """Places of the springs in Pinocchio's velocity vector, shape (n_springs,)."""
        return self._spring_v

    @property
    def turning_motors(self) -> Any:
        """Which motors turn rather than slide, shape (n_motors,), truth values."""
        joints = [self._pin.joints[self._pin.getJointId(name)] for name in self._motor_joints]
        return np.array([joint.shortname().startswith("JointModelR") for joint in joints], dtype=bool)

    def configuration(self, q_motors: Any, q_springs: Any | None = None) -> FloatArray:
        """Pinocchio's configuration vector from motor and spring coordinates.

        Args:
            q_motors: Motor coordinates, shape (n_motors,) [rad or m].
            q_springs: Spring coordinates, shape (n_springs,) [rad or m]; relaxed by default.

        Returns:
            Configuration, shape (nq,); a continuous joint takes its cosine and sine.

        Raises:
            ParameterError: If a shape differs or a number is not finite.
        """
        motors = finite_array("q_motors", q_motors, (self.n_motors,), "rad")
        springs = self.rest if q_springs is None else finite_array("q_springs", q_springs, (self.n_springs,), "rad")
        return self.assemble(motors, springs)

    def assemble(self, q_motors: FloatArray, q_springs: FloatArray) -> FloatArray:
        """`configuration` without checks, for arrays that are known to be right."""
        q = np.zeros(self._pin.nq)
        q[self._motor_q] = q_motors
        q[self._spring_q] = q_springs
        for index_q in self._circles.values():
            angle = q[index_q]
            q[index_q], q[index_q + 1] = np.cos(angle), np.sin(angle)
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

        Creating Pinocchio data is expensive, so both are kept: the weightless pair always, others up to a small number.

        Raises:
            DescriptionError: If the robot has more than `MAX_DOF` coordinates.
        """
        pairs: dict[Any, tuple[Any, Any]] | None = getattr(self._local, "pairs", None)
        if pairs is None:
            pairs = self._local.pairs = {}
        pair = pairs.get(gravity)
        if pair is None:
            if self._pin.nv > MAX_DOF:
                raise DescriptionError(
                    f"{self._pin.name} has {self._pin.nv} coordinates; Pinocchio's workspace is made for at most {MAX_DOF} "
                    f"(longer chains need a compiled solver, which this version does not have)"
                )
            if gravity is None:
                model = self._pin
            else:
                model = self._pin.copy()
                model.gravity.linear = np.array(gravity)
                kept = [key for key in pairs if key is not None]
                if len(kept) >= _KEPT_GRAVITIES:
                    del pairs[kept[0]]
            pair = pairs[gravity] = (model, model.createData())
        return pair

    def _indices(self, names: Sequence[str], attribute: str) -> Any:
        joints = [self._pin.joints[self._pin.getJointId(name)] for name in names]
        indices = np.array([getattr(joint, attribute) for joint in joints], dtype=np.intp)
        indices.setflags(write=False)
        return indices

    def _limits(self, names: Sequence[str]) -> FloatArray:
        limits = np.zeros((len(names), 2))
        for row, name in enumerate(names):
            joint = self._pin.joints[self._pin.getJointId(name)]
            limits[row] = (
                (-np.inf, np.inf)
                if joint.nq == 2
                else (self._pin.lowerPositionLimit[joint.idx_q], self._pin.upperPositionLimit[joint.idx_q])
            )
        return read_only(limits)

    def _chain_length(self) -> float:
        frame = self._pin.frames[self.frame_id(self._tip)]
        length = float(np.linalg.norm(frame.placement.translation))
        joint = frame.parentJoint
        while joint > 0:
            length += float(np.linalg.norm(self._pin.jointPlacements[joint].translation))
            kind = self._pin.joints[joint]
            if kind.shortname().startswith("JointModelP"):
                length += float(self._pin.upperPositionLimit[kind.idx_q] - self._pin.lowerPositionLimit[kind.idx_q])
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
