"""Motors, springs, sections and muscles of a robot, ordered from base to tip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS, in_range
from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import LineTag, MuscleTag, RobotTags, SpringTag
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.springs import Springs


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
    hinge: float
    """Rest length of the piece from its start to its joints [m]; 0 if it is not lumped."""
    joint_names: tuple[str, ...]
    """Its joints."""
    rest_joints: FloatArray
    """Joint positions that the joint origins carry, shape (6,); zeros if lumped."""
    rest: FloatArray
    """Section coordinates where every joint is at zero, shape (4,) [rad, rad, rad, m]."""
    places: Mapping[str, int]
    """Place among the strains of each section coordinate that can change."""

    @property
    def to_joints(self) -> FloatArray:
        """Section coordinates at rest of the piece from its start to its joints, shape (4,)."""
        return self.rest * (self.hinge / self.length)


@dataclass(frozen=True, eq=False)
class Structure:
    """The parts of a robot, base to tip.

    *Strains* are the coordinates of spring joints and then of sections of constant strain, four each, before muscles with given
    lengths constrain them.
    """

    tags: RobotTags
    """What the file says: its springs, inflated links and sections."""
    motor_joints: tuple[str, ...]
    """Motor joints, without muscles."""
    spring_joints: tuple[str, ...]
    """Joints with a spring."""
    locked_joints: tuple[str, ...]
    """Movable joints of the file that are locked at zero."""
    motor_indices: Any
    """Places of the motor joints in Pinocchio's velocity vector."""
    spring_indices: Any
    """Places of the spring joints there."""
    constant_strain: bool
    """Whether the robot has sections of constant strain, and `section_table` holds those rather than lumped ones."""
    section_table: tuple[SectionRow, ...]
    """Every section."""
    strain_springs: Springs
    """Springs of the strains, without the plateaus of inflated links."""
    muscles: tuple[MuscleTag, ...]
    """Muscles."""
    muscle_input: str
    """What `q_motors` holds of the muscles, "lengths" or "forces"."""
    muscle_matrix: FloatArray
    """Derivative of the muscle lengths with respect to the strains, shape (n_muscles, n_strains)."""
    muscle_lengths: MuscleLengths | None
    """The constraint of given muscle lengths; None if forces are given or there are no muscles."""
    lines: tuple[LineTag, ...]
    """Lines along the segments, for pictures only."""
    elastic_limits: FloatArray
    """Limits of the joints that springs and sections move, in the order of Pinocchio's velocities, shape (nv, 2)."""

    @property
    def muscle_rest(self) -> FloatArray:
        """Muscle lengths where all strains are zero, shape (n_muscles,) [m]."""
        return np.array([tag.rest_length for tag in self.muscles])

    @property
    def section_joints(self) -> tuple[str, ...]:
        """Joints of the sections of constant strain."""
        return tuple(joint for row in self.section_table for joint in row.joint_names) if self.constant_strain else ()

    @property
    def joint_roles(self) -> dict[str, str]:
        """See `SoftModel.joint_roles`."""
        springs, of_file = self.strain_springs, self.tags.springs
        pairs = zip(self.spring_joints, springs.stiffness.tolist(), springs.rest.tolist(), strict=False)
        given = {name for name, *pair in pairs if of_file.get(name) != SpringTag(*pair)}
        roles = dict.fromkeys(self.motor_joints, "motor")
        roles |= {name: "given spring" if name in given else "spring" for name in self.spring_joints}
        return roles | dict.fromkeys(self.section_joints, "section") | dict.fromkeys(self.locked_joints, "locked")

    @property
    def section_of(self) -> dict[str, SectionRow]:
        """The section by each of its coordinates and joints."""
        by_coordinate = {f"{row.name}_{strain}": row for row in self.section_table for strain in STRAINS}
        return by_coordinate | {joint: row for row in self.section_table for joint in row.joint_names}

    @property
    def moment_arms(self) -> dict[str, dict[str, float]]:
        """By muscle, the derivative of its length by spring joint or section coordinate [m/rad or -]; zeros are left out."""
        names = self.strain_springs.names
        return {
            tag.name: {name: arm for name, arm in zip(names, row, strict=True) if arm != 0.0}
            for tag, row in zip(self.muscles, self.muscle_matrix.tolist(), strict=True)
        }

    def strains(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the strains at given actuators and elastic coordinates, shape (n_strains,)."""
        return elastic if self.muscle_lengths is None else self.muscle_lengths.strains(motors, elastic)

    def section_coordinates(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the section coordinates, lumped or not, shape (n_sections, 4) [rad, rad, rad, m]."""
        strains = self.strains(motors, elastic)
        if self.constant_strain:
            return strains[len(self.spring_joints) :].reshape(-1, 4)
        coordinates = np.array([section.rest for section in self.section_table]).reshape(-1, 4)
        for row, section in enumerate(self.section_table):
            for name, place in section.places.items():
                coordinates[row, STRAINS.index(name)] += strains[place]
        return coordinates

    def at_range_end(self, motors: FloatArray, elastic: FloatArray) -> tuple[str, ...]:
        """Return the names of the sections of constant strain that reach the end of their range with 5 % more strain."""
        if not self.constant_strain:
            return ()
        rows = zip(self.section_table, self.section_coordinates(motors, elastic), strict=True)
        return tuple(row.name for row, z in rows if not in_range(1.05 * z, row.length))
