"""The model that all statics works on: a Pinocchio model with its motors, springs and tip.

`load_model` is the only place that builds a `pinocchio.Model`.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots import inflated_beam
from softrobots.checks import FloatArray, finite_array, finite_number, positive_number, read_only
from softrobots.description import InflatedLinkTag, RobotTags, SpringTag, read_tags
from softrobots.errors import DescriptionError, NameNotFound, ParameterError
from softrobots.robots import InflatableArm
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

    Made by `load_model`. Arrays are ordered base to tip. Safe to share between threads: each thread gets its own Pinocchio
    workspace. Nothing of it can be changed; do not change `pinocchio` either.
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
            SpringGroup(tuple(by_place.index(name) for name in link.springs), link.radius, link.pressure) for link in inflated_links
        )
        self._motor_v = self._indices(self._motor_joints, "idx_v")
        self._spring_v = self._indices(self._spring_joints, "idx_v")
        self._motor_q = self._indices(self._motor_joints, "idx_q")
        self._spring_q = self._indices(self._spring_joints, "idx_q")
        self._circles = {
            self._pin.joints[i].idx_v: self._pin.joints[i].idx_q for i in range(1, self._pin.njoints) if self._pin.joints[i].nq == 2
        }
        self._motor_limits = self._limits(self._motor_joints)
        self._spring_limits = self._limits(self._spring_joints)
        self._stiffest = float(self.stiffness.max(initial=0.0))
        self._reach = self._chain_length()
        self._local = threading.local()

    def __repr__(self) -> str:
        """Name, motors, springs and tip in one line."""
        return (
            f"SoftModel({self._pin.name!r}, motors={list(self._motor_joints)}, springs={list(self._spring_joints)}, "
            f"tip={self._tip!r})"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as the URDF and what was said about it; Pinocchio workspaces are not carried along."""
        return _rebuild, (self._urdf, self.spring_table, self._motor_joints, self._tip)

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
        """Sum of the link lengths from base to tip [m], the scale of residuals."""
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
        number = self._frame_ids.get(name) if isinstance(name, str) else None
        if number is None:
            links = [frame.name for frame in self._pin.frames if frame.type == pin.FrameType.BODY]
            raise NameNotFound("frame", str(name), links)
        return number

    def workspace(self, gravity: tuple[float, float, float] | None) -> tuple[Any, Any]:
        """Pinocchio model and data of the calling thread for a gravity vector (world axes, [m/s^2]; None: weightless).

        Creating Pinocchio data is expensive, so both are kept: the weightless pair always, others up to a small number.
        """
        pairs: dict[Any, tuple[Any, Any]] | None = getattr(self._local, "pairs", None)
        if pairs is None:
            pairs = self._local.pairs = {}
        pair = pairs.get(gravity)
        if pair is None:
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
        return np.array([getattr(joint, attribute) for joint in joints], dtype=np.intp)

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
            joint = self._pin.parents[joint]
        return length


def load_model(
    source: InflatableArm | Path | str,
    *,
    springs: Mapping[str, float | tuple[float, float]] | None = None,
    motors: Sequence[str] | None = None,
    tip: str | None = None,
) -> SoftModel:
    """Load a robot: ours, or anybody's URDF with springs said by the caller.

    Args:
        source: A robot of this package, a path (`Path` or text), or URDF text (starting with `<`).
        springs: For files without springs of their own: `{joint: stiffness}` or `{joint: (stiffness, rest)}`
            [N m/rad or N/m; rad or m]. Given, it replaces the springs in the file. `{}` says that the robot is rigid.
        motors: Names of the motor joints; movable joints that are neither motor nor spring are then locked at zero.
            By default every movable joint without a spring is a motor.
        tip: Name of the tip frame; by default `tip`, or the only link at the end of the tree.

    Returns:
        The model.

    Raises:
        DescriptionError: If the file cannot be read or is no URDF, has no springs and none are given, has joints other than
            revolute, continuous and prismatic, has no single end, or has more than `MAX_DOF` coordinates.
        NameNotFound: If a named joint or frame does not exist.
        ParameterError: If a stiffness is not positive, a rest coordinate is not finite, or a joint is named twice.
    """
    urdf, label = _read_source(source)
    tags = read_tags(urdf, label)
    try:
        model = pin.buildModelFromXML(urdf)
    except (ValueError, RuntimeError) as error:
        raise DescriptionError(f"Pinocchio refuses {label}: {error} (its parser prints the reason on stderr)") from error
    movable = [name for name in model.names if name != "universe"]
    spring_tags = _springs_said(springs, movable) if springs is not None else dict(tags.springs)
    if springs is None and not spring_tags:
        raise DescriptionError(
            f"{label} has no joint springs; give springs={{joint: stiffness}} for its movable joints "
            f"({', '.join(movable) or 'none'}), or springs={{}} for a rigid robot"
        )
    motor_names = _motors_said(motors, movable, spring_tags, tags)
    locked = [name for name in movable if name not in spring_tags and name not in motor_names]
    if locked:
        model = pin.buildReducedModel(model, [model.getJointId(name) for name in locked], pin.neutral(model))
    _check_joints(model, label)
    groups = [link for link in tags.inflated_links if all(name in spring_tags for name in link.springs)]
    return SoftModel(
        pinocchio_model=model,
        urdf=urdf,
        springs=spring_tags,
        motors=motor_names,
        inflated_links=groups,
        tip=_tip(model, tip, label),
    )


def _rebuild(urdf: str, springs: dict[str, tuple[float, float]], motors: tuple[str, ...], tip: str) -> SoftModel:
    return load_model(urdf, springs=springs, motors=motors, tip=tip)


def _read_source(source: Any) -> tuple[str, str]:
    """Return URDF text and a label for errors."""
    if hasattr(source, "urdf") and callable(source.urdf):
        return str(source.urdf()), type(source).__name__
    if isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<"):
        return source.lstrip("\ufeff \t\r\n"), "the URDF text"
    if not isinstance(source, str | Path):
        raise ParameterError("source", source, "a robot, a path, or URDF text")
    try:
        return Path(source).read_text(encoding="utf-8-sig"), str(source)
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise DescriptionError(f"cannot read {str(source)[:200]!r}: {error}; a path of a URDF file or its text is required") from error


def _springs_said(springs: Any, movable: Sequence[str]) -> dict[str, SpringTag]:
    if not isinstance(springs, Mapping):
        raise ParameterError("springs", springs, "a mapping {joint: stiffness} or {joint: (stiffness, rest)}")
    said = {}
    for name, value in springs.items():
        if name not in movable:
            raise NameNotFound("movable joint", str(name), movable)
        stiffness, rest = value if isinstance(value, tuple | list) and len(value) == 2 else (value, 0.0)
        field = f"springs[{name!r}]"
        said[name] = SpringTag(positive_number(field, stiffness, "N m/rad or N/m"), finite_number(field, rest, "rad or m"))
    return said


def _motors_said(motors: Any, movable: Sequence[str], springs: Mapping[str, SpringTag], tags: RobotTags) -> list[str]:
    if motors is None:
        return [name for name in movable if name not in springs and tags.roles.get(name, "motor") != "locked"]
    if isinstance(motors, str) or not isinstance(motors, Sequence):
        raise ParameterError("motors", motors, "a list of joint names")
    for name in motors:
        if name not in movable:
            raise NameNotFound("movable joint", str(name), movable)
        if name in springs:
            raise ParameterError("motors", name, "a joint without a spring")
    if len(set(motors)) != len(motors):
        raise ParameterError("motors", motors, "names without repetition")
    return list(motors)


def _check_joints(model: Any, label: str) -> None:
    for name, joint in zip(model.names, model.joints, strict=True):
        if name != "universe" and (joint.nv != 1 or joint.nq not in (1, 2)):
            raise DescriptionError(
                f"joint {name} of {label} is a {joint.shortname()}; revolute, continuous and prismatic joints are supported"
            )
    if model.nv > MAX_DOF:
        raise DescriptionError(f"{label} has {model.nv} coordinates; at most {MAX_DOF} are supported")


def _tip(model: Any, tip: str | None, label: str) -> str:
    bodies = [frame.name for frame in model.frames if frame.type == pin.FrameType.BODY]
    if tip is not None:
        if not model.existFrame(tip):
            raise NameNotFound("frame", str(tip), bodies)
        return tip
    if "tip" in bodies:
        return "tip"
    parents = {frame.parentFrame for frame in model.frames}
    leaves = [frame.name for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY and i not in parents]
    if len(leaves) != 1:
        raise DescriptionError(f"{label} has {len(leaves)} ends ({', '.join(leaves)}); say which frame is the tip: tip=...")
    return leaves[0]
