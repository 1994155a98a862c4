"""Assembly of a `SoftModel` from rigid bodies and the tags of a description: springs, coordinates and actuators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.constant_curvature.strain_chain import joint_positions
from softrobots.core.checks import LARGEST, FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.urdf_tags import ActuatorTag, LumpedSectionTag, RobotTags, SectionTag, SpringTag
from softrobots.model.actuator_laws import ActuatorLaws
from softrobots.model.actuators import Actuators
from softrobots.model.chain_reader import chain_length
from softrobots.model.coordinates import Coordinates, DirectCoordinates, SectionCoordinates, rest_coordinates
from softrobots.model.dry_friction import DryFriction
from softrobots.model.friction_coordinates import FrictionCoordinates, grip_of, memory_of, remembering
from softrobots.model.muscle_lengths import MuscleLengths
from softrobots.model.muscle_paths import MusclePaths
from softrobots.model.muscles import MuscleForces
from softrobots.model.pinocchio_data import PinocchioData
from softrobots.model.sections import SectionRow
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import Springs, spring_groups
from softrobots.model.structure import Structure


def assemble(
    rigid: Any,
    urdf: str,
    tags: RobotTags,
    *,
    springs: Mapping[str, SpringTag],
    motors: Sequence[str],
    tip: str,
    muscle_input: str | None = None,
    locked: Sequence[str] = (),
    like: SoftModel | None = None,
    robot: Any = None,
) -> SoftModel:
    """Build the model of a robot; `softrobots.load_model` has checked the arguments.

    Args:
        rigid: The rigid bodies, a `pinocchio.Model`.
        urdf: URDF text of the robot.
        tags: Sections, muscles, lines and inflated links; lumped sections have a spring on every joint.
        springs: Springs by joint name.
        motors: Names of the motor joints.
        tip: Name of the tip frame.
        muscle_input: Whether actuators of given length or tension become "lengths" or "forces"; None: as their tags say.
        locked: Names of the movable joints of the text that are fixed in `rigid`.
        like: A model that differs in its springs alone, for what it can share.
        robot: The dataclass of parameters behind the text, if there is one.

    Returns:
        The model.

    Raises:
        DescriptionError: If some muscles have given lengths and others not, or the springs of an inflated link cannot have a
            largest moment.
    """
    motor_joints, spring_joints = (tuple(sorted(names, key=rigid.getJointId)) for names in (motors, springs))
    motor_indices, spring_indices = velocity_indices(rigid, motor_joints), velocity_indices(rigid, spring_joints)
    rows, strain_springs = elastic_parts(rigid, tags, springs, spring_joints)
    sections = rows if tags.sections else []
    muscles = actuators_of(tags.muscles, muscle_input)
    paths = MusclePaths(muscles, rows, len(strain_springs.names))

    coordinates: Coordinates = DirectCoordinates(motor_indices, spring_indices, rigid.nv)
    elastic_limits: FloatArray = np.tile([-np.inf, np.inf], (rigid.nv, 1))
    elastic_limits[spring_indices] = _joint_limits(rigid, spring_joints)
    if sections:
        names = [name for row in sections for name in row.joint_names]
        indices = velocity_indices(rigid, names).reshape(len(sections), -1)
        elastic_limits[indices] = _joint_limits(rigid, names).reshape(*indices.shape, 2)
        lengths, rest_joints = (np.array([getattr(row, name) for row in sections]) for name in ("bends", "rest_joints"))
        each = len(rows[0].places)
        coordinates = SectionCoordinates(motor_indices, spring_indices, indices, lengths, rest_joints, rigid.nv, each)
    friction = None
    if any(tag.bending > 0.0 or (tag.guides > 0.0 and muscles) for tag in tags.friction):
        friction = DryFriction(tags.friction, rows, muscles, paths, strain_springs.rest)
        coordinates = FrictionCoordinates(coordinates, friction, friction.untouched, np.zeros(friction.n_guides))
    given_lengths, laws, elastic = None, None, strain_springs
    if any(tag.kind == "length" for tag in muscles):
        given_lengths = MuscleLengths(coordinates, muscles, rows, strain_springs, paths)
        coordinates, elastic = given_lengths, given_lengths.springs
    elif muscles:
        laws = ActuatorLaws(muscles)
        coordinates = MuscleForces(coordinates, paths, laws)

    structure = Structure(
        tags=tags,
        motor_joints=motor_joints,
        spring_joints=spring_joints,
        locked_joints=tuple(locked),
        motor_indices=motor_indices,
        spring_indices=spring_indices,
        constant_strain=bool(sections),
        section_table=tuple(rows),
        strain_springs=strain_springs,
        muscles=muscles,
        muscle_paths=paths,
        muscle_lengths=given_lengths,
        actuator_laws=laws,
        friction=friction,
        lines=tags.lines,
        elastic_limits=read_only(elastic_limits),
    )
    actuators = Actuators(
        motor_joints,
        _joint_limits(rigid, motor_joints),
        [_kind(rigid, name).startswith("JointModelR") for name in motor_joints],
        muscles,
        _worth(muscles, rows, paths, strain_springs),
        given_lengths,
        laws,
        _drives(rigid, motor_joints, tags.rotors),
    )
    data = PinocchioData(rigid) if like is None else like.data
    inside = {joint for row in rows for joint in row.joint_names}
    return SoftModel(
        pinocchio=rigid,
        urdf=urdf,
        tip=tip,
        structure=structure,
        actuators=actuators,
        coordinates=coordinates,
        springs=_grouped(elastic, structure),
        data=data,
        reach=chain_length(rigid, data.frame_ids[tip], inside) if like is None else like.reach,
        robot=robot,
    )


def elastic_parts(
    rigid: Any, tags: RobotTags, springs: Mapping[str, SpringTag], spring_joints: tuple[str, ...]
) -> tuple[list[SectionRow], Springs]:
    """Return the sections, base to tip, and the springs of all strains; joints are found in the rigid bodies."""
    section_tags = sorted(tags.sections, key=lambda tag: rigid.getJointId(tag.joints[0]))
    lumped_tags = sorted(tags.lumped_sections, key=lambda tag: rigid.getJointId(tag.joints["bend_x"]))
    rows = _section_rows(section_tags, len(spring_joints)) or [_lumped_row(tag, spring_joints) for tag in lumped_tags]
    return rows, _strain_springs(rigid, [springs[name] for name in spring_joints], spring_joints, section_tags)


def actuators_of(tags: Sequence[ActuatorTag], muscle_input: str | None) -> tuple[ActuatorTag, ...]:
    """Return the actuators of a description with given lengths made given tensions, or the reverse.

    Raises:
        DescriptionError: If some then have given lengths and others not.
    """
    swapped = {"lengths": {"tension": "length"}, "forces": {"length": "tension"}}.get(muscle_input or "", {})
    actuators = tuple(replace(tag, kind=swapped.get(tag.kind, tag.kind)) for tag in tags)
    held, others = ([tag.name for tag in actuators if (tag.kind == "length") is given] for given in (True, False))
    if held and others:
        raise DescriptionError(
            f"the lengths of {', '.join(held)} are given, and not those of {', '.join(others)}; required: given lengths for "
            "all or none (kind elastic with a high stiffness is nearly a given length)"
        )
    return actuators


def _worth(tags: Sequence[ActuatorTag], rows: Sequence[SectionRow], paths: MusclePaths, springs: Springs) -> FloatArray:
    """Change of length of each actuator per angle of bending [m/rad], and bending per tension [rad/N], shape (n, 2).

    Of one that bends nothing, as along the backbone, elongation by its length is worth a radian.
    """
    bends = np.array([[row.places[key] for key in ("bend_x", "bend_y")] for row in rows], dtype=np.intp).reshape(-1, 2)
    arms = paths.matrix[:, bends]
    compliant = arms / springs.stiffness[bends]
    bend, reeled = np.linalg.norm(compliant, axis=2).sum(axis=1), (arms * compliant).sum(axis=(1, 2))
    lengths = np.array([tag.rest_length for tag in tags])
    straight = reeled <= 1e-9 * lengths * bend
    pulled = (paths.matrix**2 / springs.stiffness).sum(axis=1)
    reeled = np.where(straight, np.where(pulled > 0.0, pulled, 1.0), reeled)
    bend = np.where(straight, reeled / lengths, bend)
    return np.stack([reeled / bend, bend], axis=1)


def with_given_forces(model: SoftModel) -> SoftModel:
    """Return a robot of which the muscles of given lengths are given the tensions, with what dry friction remembers."""
    springs = {name: SpringTag(*pair) for name, pair in model.spring_table.items()}
    pulled = reassemble(model, springs, muscle_input="forces")
    return pulled if model.structure.friction is None else remembering(pulled, memory_of(model), grip_of(model))


def reassemble(model: SoftModel, springs: Mapping[str, SpringTag], muscle_input: str | None = None) -> SoftModel:
    """Build a model again with another spring at each of its spring joints.

    Pinocchio's model and workspace are shared. Only muscles need more than the springs: the free coordinates of given lengths
    and the scale of other inputs depend on the stiffness.

    Args:
        model: The model.
        springs: Springs by joint name.
        muscle_input: As for `assemble`; None: as it is.

    Raises:
        DescriptionError: If the springs of an inflated link cannot have a largest moment.
    """
    structure = model.structure
    if structure.muscles:
        return assemble(
            model.pinocchio,
            model.urdf,
            structure.tags,
            springs=springs,
            motors=structure.motor_joints,
            tip=model.tip,
            muscle_input=muscle_input or model.muscle_input,
            locked=structure.locked_joints,
            like=model,
            robot=model.robot,
        )
    stiffness, rest = structure.strain_springs.stiffness.copy(), structure.strain_springs.rest.copy()
    for place, name in enumerate(structure.spring_joints):
        stiffness[place], rest[place] = springs[name].stiffness, springs[name].rest
    elastic = replace(structure.strain_springs, stiffness=read_only(stiffness), rest=read_only(rest))
    structure = replace(structure, strain_springs=elastic)
    return replace(model, structure=structure, springs=_grouped(elastic, structure))


def _grouped(elastic: Springs, structure: Structure) -> Springs:
    """The springs of the elastic coordinates with the groups of the inflated links."""
    links = structure.tags.inflated_links
    segment_of = {name: row.segment for name, row in structure.section_of.items()} if links else {}
    return replace(elastic, groups=spring_groups(links, elastic, structure.spring_joints, segment_of))


def velocity_indices(rigid: Any, names: Sequence[str]) -> Any:
    """Return the places of joints in Pinocchio's velocity vector, read-only."""
    joints = rigid.joints
    indices = np.array([joints[rigid.getJointId(name)].idx_v for name in names], dtype=np.intp)
    indices.setflags(write=False)
    return indices


def _kind(rigid: Any, name: str) -> str:
    return str(rigid.joints[rigid.getJointId(name)].shortname())


def _joint_limits(rigid: Any, names: Sequence[str]) -> FloatArray:
    """Lower and upper limits of joints, shape (n, 2) [rad or m]; infinite for continuous ones and beyond `LARGEST`."""
    limits = np.zeros((len(names), 2))
    joints, lower, upper = rigid.joints, rigid.lowerPositionLimit, rigid.upperPositionLimit
    for row, name in enumerate(names):
        joint = joints[rigid.getJointId(name)]
        place = joint.idx_q
        limits[row] = (-np.inf, np.inf) if joint.nq == 2 else (lower[place], upper[place])
    limits[limits <= -LARGEST], limits[limits >= LARGEST] = -np.inf, np.inf  # URDF has no slide without limits
    return read_only(limits)


def _drives(rigid: Any, names: Sequence[str], rotors: Mapping[str, float]) -> FloatArray:
    """Rotor inertia, viscous and dry friction, and largest torque of motor joints, shape (4, n); no torque stated: infinite."""
    places = velocity_indices(rigid, names)
    effort = np.array(rigid.upperEffortLimit)[places]
    effort[(effort <= 0.0) | (effort >= LARGEST)] = np.inf
    inertia = [rotors.get(name, 0.0) for name in names]
    return np.array([inertia, rigid.damping[places], rigid.upperDryFrictionLimit[places], effort])


def _section_rows(tags: Sequence[SectionTag], first: int) -> list[SectionRow]:
    """Sections of constant strain, whose coordinates begin at place `first` among the strains."""
    if not tags:
        return []
    rest = rest_coordinates(tags)
    joints = joint_positions(rest, np.array([tag.bends for tag in tags]))
    strains = tags[0].strains
    by_name = [{name: first + len(strains) * row + k for k, name in enumerate(strains)} for row in range(len(tags))]
    return [
        SectionRow(t.name, t.segment, t.length, t.radius, t.hinge, t.bends, t.joints, at, z, place, t.middle)
        for t, at, z, place in zip(tags, joints, rest, by_name, strict=True)
    ]


def _lumped_row(tag: LumpedSectionTag, spring_joints: tuple[str, ...]) -> SectionRow:
    places = {name: spring_joints.index(joint) for name, joint in tag.joints.items()}
    joints = tuple(tag.joints.values())
    rest = rest_coordinates([tag])[0]
    return SectionRow(tag.name, tag.segment, tag.length, tag.radius, tag.hinge, 0.0, joints, np.zeros(6), rest, places)


def _strain_springs(rigid: Any, tags: Sequence[SpringTag], joints: tuple[str, ...], sections: Sequence[SectionTag]) -> Springs:
    """Springs of the joints, then of the coordinates of the sections: `(EI, EI, GJ, EA) / length`; of EA, if it is finite."""
    stiffness, rest = (np.array([getattr(tag, name) for tag in tags], dtype=np.float64) for name in ("stiffness", "rest"))
    turning = [not _kind(rigid, name).startswith("JointModelP") for name in joints]
    strains = sections[0].strains if sections else ()
    if sections:
        moduli = [(t.bending_stiffness, t.bending_stiffness, t.torsional_stiffness, t.axial_stiffness) for t in sections]
        by_section = np.array(moduli)[:, : len(strains)] / np.array([[tag.length] for tag in sections])
        stiffness = np.concatenate([stiffness, by_section.ravel()])
        rest = np.concatenate([rest, rest_coordinates(sections, strains="relaxed")[:, : len(strains)].ravel()])
        turning += [name != "stretch" for name in strains] * len(sections)
    names = (*joints, *(f"{tag.name}_{strain}" for tag in sections for strain in strains))
    return Springs(names, read_only(stiffness), read_only(rest), np.array(turning, dtype=bool))
