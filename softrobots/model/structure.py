"""Motors, springs, sections and muscles of a robot, ordered from base to tip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import STRAINS, in_range, with_stretch
from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import ActuatorTag, LineTag, RobotTags, SpringTag
from softrobots.model.actuator_laws import ActuatorLaws
from softrobots.model.dry_friction import DryFriction
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.muscle_paths import MusclePaths
from softrobots.model.sections import SectionRow
from softrobots.model.springs import Springs


@dataclass(frozen=True, eq=False)
class Structure:
    """The parts of a robot, base to tip.

    *Strains* are the coordinates of spring joints and then of sections of constant strain, four each, or three
    without stretch, before muscles with given lengths constrain them.
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
    muscles: tuple[ActuatorTag, ...]
    """Muscles."""
    muscle_paths: MusclePaths
    """The muscle lengths as functions of the strains."""
    muscle_lengths: MuscleLengths | None
    """The constraint of given muscle lengths; None if there is none."""
    actuator_laws: ActuatorLaws | None
    """The laws of muscles of other kinds; None if there are none."""
    friction: DryFriction | None
    """Dry friction of sections and guides; None if there is none."""
    lines: tuple[LineTag, ...]
    """Lines along the segments, for pictures only."""
    elastic_limits: FloatArray
    """Limits of the joints that springs and sections move, in the order of Pinocchio's velocities, shape (nv, 2)."""

    @property
    def guided(self) -> bool:
        """Whether actuators rub in their guides."""
        return self.friction is not None and self.friction.guided

    @property
    def muscle_input(self) -> str:
        """See `SoftModel.muscle_input`."""
        return "lengths" if self.actuator_laws is None else "forces"

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
        """By muscle, the derivative of its length by strain where all are zero [m/rad or -]; zeros are left out."""
        names, paths = self.strain_springs.names, self.muscle_paths
        return {
            tag.name: {name: arm for name, arm in zip(names, row, strict=True) if arm != 0.0}
            for tag, row in zip(self.muscles, paths.at(np.zeros(paths.count)).arms.tolist(), strict=True)
        }

    def strains(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the strains at given actuators and elastic coordinates, shape (n_strains,)."""
        return elastic if self.muscle_lengths is None else self.muscle_lengths.strains(motors, elastic)

    def section_coordinates(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Return the section coordinates, lumped or not, shape (n_sections, 4) [rad, rad, rad, m]."""
        strains = self.strains(motors, elastic)
        if self.constant_strain:
            return with_stretch(strains[len(self.spring_joints) :].reshape(len(self.section_table), -1))
        coordinates = np.array([section.origin for section in self.section_table]).reshape(-1, 4)
        for row, section in enumerate(self.section_table):
            for name, place in section.places.items():
                coordinates[row, STRAINS.index(name)] += strains[place]
        return coordinates

    def at_range_end(self, motors: FloatArray, elastic: FloatArray) -> tuple[str, ...]:
        """Return the names of the sections of constant strain that 5 % more strain takes out of range, or their muscles."""
        if not self.constant_strain:
            return ()
        rows = zip(self.section_table, self.section_coordinates(motors, elastic), strict=True)
        folded = self.muscle_paths.at(1.05 * self.strains(motors, elastic)).folded
        return tuple(row.name for row, z in rows if row.name in folded or not in_range(1.05 * z, row.bends))
