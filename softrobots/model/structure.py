"""How a robot is put together: which of its joints are motors, springs and sections, and where its muscles run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS, in_range
from softrobots.core.checks import LARGEST, FloatArray, read_only
from softrobots.description.urdf_tags import LineTag, LumpedSectionTag, MuscleTag, SectionTag, SpringTag
from softrobots.model.actuators import Actuators
from softrobots.model.coordinates import Coordinates, DirectCoordinates, SectionCoordinates, Sections, rest_coordinates
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.muscles import ElasticLaw, MuscleForces, Segments, muscle_matrix


@dataclass(frozen=True)
class Parts:
    """What the description and the caller say of a robot beyond its rigid bodies and joints."""

    springs: Mapping[str, SpringTag]
    """Springs by joint name."""
    motors: Sequence[str]
    """Motor joints."""
    sections: Sequence[SectionTag] = ()
    """Sections of constant strain."""
    lumped_sections: Sequence[LumpedSectionTag] = ()
    """Sections lumped into springs."""
    muscles: Sequence[MuscleTag] = field(default_factory=tuple)
    """Muscles."""
    lines: Sequence[LineTag] = field(default_factory=tuple)
    """Lines that are drawn."""
    muscle_input: str = "lengths"
    """What is given of the muscles, "lengths" or "forces"."""


class SectionRow(NamedTuple):
    """A section, of constant strain or lumped."""

    name: str
    """Name of the section."""
    segment: int
    """Number of its segment, from 1."""
    length: float
    """Rest length [m]."""
    radius: float
    """Radius of the body, for pictures [m]."""
    to_joints: FloatArray
    """Section coordinates at rest of the piece from its start to its joints, shape (4,); zeros if it is not lumped."""
    hinge: float
    """Length of that piece [m]."""
    joint_names: tuple[str, ...]
    """Its joints."""
    rest_joints: FloatArray
    """Joint positions that the joint origins carry, shape (6,); zeros if lumped."""


class Structure:
    """The parts of a robot in order, base to tip, with its coordinates."""

    def __init__(self, pinocchio_model: Any, parts: Parts) -> None:
        """Order the parts and lay the muscles over them.

        Args:
            pinocchio_model: The rigid bodies.
            parts: What is said of them; every joint exists.

        Raises:
            DescriptionError: If the muscles of a segment do not fix its shape.
        """
        self._pin = pinocchio_model
        number = pinocchio_model.getJointId
        self.parts = parts
        """What was said."""
        self.motor_joints = tuple(sorted(parts.motors, key=number))
        """Motor joints."""
        self.spring_joints = tuple(sorted(parts.springs, key=number))
        """Joints with a spring."""
        tags = sorted(parts.sections, key=lambda tag: number(tag.joints[0]))
        self.lumped_sections = tuple(sorted(parts.lumped_sections, key=lambda tag: number(tag.joints["bend_x"])))
        """Sections lumped into springs."""
        self.muscles = tuple(parts.muscles)
        """Muscles."""
        self.motor_indices, self.spring_indices = self.indices(self.motor_joints), self.indices(self.spring_joints)
        """Places of motors and springs in Pinocchio's velocity vector."""
        self.sections = Sections(tags, np.array([self.indices(tag.joints) for tag in tags])) if tags else None
        """Sections of constant strain; None without."""
        self.section_table = self._section_table(tags)
        """Every section, base to tip."""
        self.strain_law = self._strain_law()
        """Springs and section coordinates, all free."""
        self.segments = self._segments()
        """Places of the section coordinates of each segment among them."""
        self.muscle_matrix = read_only(muscle_matrix(self.muscles, self.segments, len(self.strain_law.names)))
        """Derivative of the muscle lengths with respect to them, shape (n_muscles, n_strains)."""
        self.muscle_rest = read_only(np.array([tag.rest_length for tag in self.muscles]))
        """Muscle lengths where they are all zero, shape (n_muscles,) [m]."""
        self.held: MuscleLengths | None = None
        """The muscles as lengths; None if forces are given or there are none."""
        self.law = self.strain_law
        """Stiffness of the elastic coordinates: what the actuators leave free."""
        self.coordinates: Coordinates = self._inner()
        """The map from actuators and elastic coordinates to joint positions."""
        if self.muscles and parts.muscle_input == "forces":
            self.coordinates = MuscleForces(self.coordinates, self.muscle_matrix)
        elif self.muscles:
            largest = np.pi / 2 if self.sections is None else None
            each = {row.segment: row.length for row in self.section_table}
            self.held = MuscleLengths(self.coordinates, self.muscles, self.segments, self.strain_law, each, largest)
            self.coordinates, self.law = self.held, self.held.law
        self.elastic_limits = self._elastic_limits()
        """Limits of the joints that springs and sections move, in the order of Pinocchio's velocities, shape (nv, 2)."""
        self.actuators = self._actuators()
        """Motors and muscles."""

    @property
    def section_of(self) -> dict[str, SectionRow]:
        """The section by each of its coordinates and joints."""
        made = {f"{row.name}_{strain}": row for row in self.section_table for strain in STRAINS}
        return made | {joint: row for row in self.section_table for joint in row.joint_names}

    @property
    def moment_arms(self) -> dict[str, dict[str, float]]:
        """By muscle, the derivative of its length by spring joint or section coordinate [m/rad or -]; zeros are left out."""
        names, made = self.strain_law.names, {}
        for tag, row in zip(self.muscles, self.muscle_matrix.tolist(), strict=True):
            made[tag.name] = {name: arm for name, arm in zip(names, row, strict=True) if arm != 0.0}
        return made

    def indices(self, names: Sequence[str]) -> Any:
        """Places of joints in Pinocchio's velocity vector."""
        made = np.array([self._pin.joints[self._pin.getJointId(name)].idx_v for name in names], dtype=np.intp)
        made.setflags(write=False)
        return made

    def joint_limits(self, names: Sequence[str]) -> FloatArray:
        """Lower and upper limits of joints, shape (n, 2) [rad or m]; infinite for continuous ones and beyond `LARGEST`."""
        limits = np.zeros((len(names), 2))
        for row, name in enumerate(names):
            joint = self._pin.joints[self._pin.getJointId(name)]
            limits[row] = (
                (-np.inf, np.inf)
                if joint.nq == 2
                else (self._pin.lowerPositionLimit[joint.idx_q], self._pin.upperPositionLimit[joint.idx_q])
            )
        limits[limits <= -LARGEST], limits[limits >= LARGEST] = -np.inf, np.inf  # URDF has no slide without limits
        return read_only(limits)

    def strains(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Springs and section coordinates at given actuators and elastic coordinates, shape (n_strains,)."""
        return elastic if self.held is None else self.held.strains(motors, elastic)

    def section_coordinates(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Section coordinates, lumped or not, base to tip, shape (n_sections, 4) [rad, rad, rad, m]."""
        strains = self.strains(motors, elastic)
        if self.sections is not None:
            return strains[len(self.spring_joints) :].reshape(-1, 4)
        made = rest_coordinates(self.lumped_sections) if self.lumped_sections else np.zeros((0, 4))
        for row, section in enumerate(self.lumped_sections):
            for name, joint in section.joints.items():
                made[row, STRAINS.index(name)] += strains[self.spring_joints.index(joint)]
        return made

    def _section_table(self, tags: Sequence[SectionTag]) -> tuple[SectionRow, ...]:
        if self.sections is not None:
            return tuple(
                SectionRow(tag.name, tag.segment, tag.length, tag.radius, np.zeros(4), 0.0, tag.joints, joints)
                for tag, joints in zip(tags, self.sections.rest_joints, strict=True)
            )
        return tuple(
            SectionRow(
                tag.name,
                tag.segment,
                tag.length,
                tag.radius,
                rest_coordinates([tag])[0] * (tag.hinge / tag.length),
                tag.hinge,
                tuple(tag.joints.values()),
                np.zeros(6),
            )
            for tag in self.lumped_sections
        )

    def _elastic_limits(self) -> FloatArray:
        limits = np.tile([-np.inf, np.inf], (self._pin.nv, 1))
        limits[self.spring_indices] = self.joint_limits(self.spring_joints)
        for tag in self.parts.sections:
            limits[self.indices(tag.joints)] = self.joint_limits(tag.joints)
        return read_only(limits)

    def at_range_end(self, motors: FloatArray, elastic: FloatArray) -> tuple[str, ...]:
        """Names of the sections of constant strain that reach the end of their range with a twentieth more strain."""
        if self.sections is None:
            return ()
        rows = zip(self.section_table, self.section_coordinates(motors, elastic), strict=True)
        return tuple(row.name for row, z in rows if not in_range(1.05 * z, row.length))

    def _inner(self) -> Coordinates:
        if self.sections is None:
            return DirectCoordinates(self.motor_indices, self.spring_indices, self._pin.nv)
        return SectionCoordinates(self.motor_indices, self.spring_indices, self.sections, self._pin.nv)

    def _strain_law(self) -> ElasticLaw:
        tags = [self.parts.springs[name] for name in self.spring_joints]
        names, stiffness = self.spring_joints, np.array([tag.stiffness for tag in tags], dtype=np.float64)
        rest = np.array([tag.rest for tag in tags], dtype=np.float64)
        joints = [self._pin.joints[self._pin.getJointId(name)] for name in self.spring_joints]
        turning = [not joint.shortname().startswith("JointModelP") for joint in joints]
        if self.sections is not None:
            names += self.sections.coordinate_names
            stiffness = np.concatenate([stiffness, self.sections.stiffness.ravel()])
            rest = np.concatenate([rest, self.sections.rest.ravel()])
            turning += [name != "stretch" for name in STRAINS] * len(self.sections.names)
        return ElasticLaw(names, stiffness, rest, np.array(turning, dtype=bool))

    def _segments(self) -> Segments:
        made: dict[int, dict[str, list[int]]] = {}
        if self.sections is not None:
            first = len(self.spring_joints)
            for row, segment in enumerate(self.sections.segments.tolist()):
                for place, name in enumerate(STRAINS):
                    made.setdefault(segment, {}).setdefault(name, []).append(first + 4 * row + place)
        for section in self.lumped_sections:
            for name, joint in section.joints.items():
                made.setdefault(section.segment, {}).setdefault(name, []).append(self.spring_joints.index(joint))
        return made

    def _actuators(self) -> Actuators:
        joints = [self._pin.joints[self._pin.getJointId(name)] for name in self.motor_joints]
        softness = [
            float((1.0 / self.strain_law.stiffness[list(self.segments[tag.segment]["bend_x"])]).sum()) for tag in self.muscles
        ]
        return Actuators(
            self.motor_joints,
            self.joint_limits(self.motor_joints),
            [joint.shortname().startswith("JointModelR") for joint in joints],
            self.muscles,
            self.muscle_rest,
            np.array(softness),
            self.held,
        )
