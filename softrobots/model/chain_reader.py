"""Read a Pinocchio model as a `softrobots.model.serial_chain.SerialChain`, in which every joint axis is z.

A frame of the chain has the origin of Pinocchio's frame of the same joint, and axes `A` in it such that `A e_z` is the axis of
the joint. A placement `(R, p)` in Pinocchio's frame is `(A^T R, A^T p)` in the frame of the chain. For an axis along
x, y or z, `A` is a signed permutation, so that zeros stay exact.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.constant_curvature.strain_chain import JOINTS, STRAINS
from softrobots.core.checks import LARGEST, FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.core.vectors import axes_along
from softrobots.model.serial_chain import ChainBody, ChainJoint, ChainSection, Element, SerialChain
from softrobots.model.springs import SpringGroup
from softrobots.model.structure import Structure

_ROUNDING = 4e-16  # of sines and cosines of quarter turns, as URDF's roll, pitch and yaw give them


def read_chain(
    pinocchio_model: Any,
    structure: Structure,
    tip_frame: int,
    *,
    limits: FloatArray,
    reach: float,
    groups: Sequence[SpringGroup] = (),
) -> SerialChain:
    """Read a robot as a serial chain from base to tip.

    Pinocchio's workspace is not allocated, so the chain may have any length. `load_model` has checked that the six joints of a
    section are the chain of `strain_chain`, one behind the other with the rest shape in their origins. Limits of the actuators,
    shape (n_motors, 2) [rad, m, N or Pa], and reach [m] are copied; `groups` are the springs of the inflated links.

    Raises:
        DescriptionError: If an inflated link has a plateau, a joint is not on the way from base to tip or neither turns nor
            slides, the springs of a slack wall are not two that turn, one behind the other, or the joints
            of a lumped section that has dry friction, or along which an actuator winds, are apart.
    """
    if any(group.max_moment is not None for group in groups):
        raise DescriptionError(
            f"an inflated link of {pinocchio_model.name} has max_moment; compiled solvers need springs that are linear, or "
            "smooth, moment_law slack_wall (solve_equilibrium accepts the others, too)"
        )
    tip = pinocchio_model.frames[tip_frame]
    elements, axes = _elements(pinocchio_model, _path(pinocchio_model, tip.parentJoint, str(tip.name)), structure)
    tip_rotation, tip_translation = _placed(tip.placement, axes)
    springs, given = structure.strain_springs, structure.muscle_lengths
    count, muscles = len(springs.names), len(structure.muscles)
    chain = SerialChain(
        name=str(pinocchio_model.name),
        elements=elements,
        tip_rotation=tip_rotation,
        tip_translation=tip_translation,
        stiffness=springs.stiffness,
        rest=springs.rest,
        reach=reach,
        n_motors=len(structure.motor_joints),
        limits=limits,
        muscle_input=structure.muscle_input,
        actuators=structure.muscles,
        muscle_paths=structure.muscle_paths,
        constrained=() if given is None else given.groups,
        constrained_slope=read_only(np.zeros((0, muscles))) if given is None else given.slopes,
        elastic=read_only(np.eye(count)) if given is None else given.elastic,
        spread=read_only(np.zeros((count, muscles))) if given is None else given.spread,
        free=read_only(np.eye(count)) if given is None else given.free,
        slack_hinges=_slack_hinges(str(pinocchio_model.name), elements, groups),
        wound=_wound(str(pinocchio_model.name), elements, structure),
        friction=_friction(structure),
        guides=structure.friction if structure.guided else None,
    )
    return replace(chain, constrained=(), constrained_slope=read_only(np.zeros((0, muscles)))) if chain.routed else chain


def chain_length(pinocchio_model: Any, tip_frame: int, strained: Collection[str]) -> float:
    """Sum of the link lengths from base to tip, and of the travel of slides, at least 1e-6 m.

    A slide without limits counts as 1 m. The travel of `strained` joints, those of sections, is strain and does not count.
    """
    frame = pinocchio_model.frames[tip_frame]
    length = math.hypot(*frame.placement.translation.tolist())
    joints, placements = pinocchio_model.joints, pinocchio_model.jointPlacements
    for number in list(pinocchio_model.supports[frame.parentJoint])[:0:-1]:
        length += math.hypot(*placements[number].translation.tolist())
        joint = joints[number]
        if joint.shortname().startswith("JointModelP") and pinocchio_model.names[number] not in strained:
            low, high = pinocchio_model.lowerPositionLimit[joint.idx_q], pinocchio_model.upperPositionLimit[joint.idx_q]
            length += float(high - low) if high - low < LARGEST else 1.0
    return max(length, 1e-6)


def _slack_hinges(name: str, elements: Sequence[Element], groups: Sequence[SpringGroup]) -> tuple[tuple[int, int, float], ...]:
    """The hinges of walls that go slack, see `SerialChain.slack_hinges`."""
    turning = [element.strain if isinstance(element, ChainJoint) and not element.slides else None for element in elements]
    found = []
    for group in groups:
        for hinge in group.hinges if group.slack_wall else ():
            row = turning.index(min(hinge)) if min(hinge) in turning else -1
            if row < 0 or len(hinge) != 2 or turning[row + 1 : row + 2] != [max(hinge)]:
                raise DescriptionError(
                    f"{name} has a link with moment_law slack_wall and {len(hinge)} springs a hinge; compiled solvers need two "
                    "that turn, one behind the other"
                )
            found.append((min(hinge), max(hinge), group.slack_moment))
    return tuple(found)


def _friction(structure: Structure) -> tuple[tuple[int, int, float], ...]:
    """The sections with dry friction of bending, see `SerialChain.friction`."""
    friction = structure.friction
    rows = () if friction is None else zip(friction.places.tolist(), friction.limit.tolist(), strict=True)
    return tuple((*places, limit) for places, limit in rows)


def _wound(name: str, elements: Sequence[Element], structure: Structure) -> tuple[tuple[int, int], ...]:
    """The joints of lumped sections that are one element, see `SerialChain.wound`."""
    paths, found = structure.muscle_paths, []
    apart = paths.separable & (not structure.guided)
    joined = {one for one, straight in zip(paths.sections, apart, strict=True) if paths.lumped and not straight}
    rubbing = {place for place, *_ in _friction(structure)}
    joined |= {one.name for one in structure.section_table if one.lumped and rubbing & set(one.places.values())}
    row_of = {element.strain: row for row, element in enumerate(elements) if joined and isinstance(element, ChainJoint)}
    for section in structure.section_table:
        if section.name in joined:
            rows = sorted(row_of[place] for place in section.places.values())
            if rows[-1] - rows[0] >= len(rows) or any(np.any(elements[row].translation) for row in rows[1:]):
                raise DescriptionError(
                    f"{name} has dry friction or actuators that wind along section {section.name}, whose joints are apart; "
                    "compiled solvers need them at one point, one behind the other"
                )
            found.append((rows[0], rows[-1]))
    return tuple(found)


def _path(model: Any, last: int, tip: str) -> list[int]:
    """Numbers of the joints from base to `last`."""
    path = list(model.supports[last])[1:]
    stray = [str(model.names[number]) for number in sorted(set(range(1, model.njoints)) - set(path))]
    if stray:
        raise DescriptionError(
            f"{model.name} has joints that are not between base and tip ({tip}): {', '.join(stray)}; compiled solvers need one "
            "serial chain from base to tip (load_model(motors=...) locks the other joints)"
        )
    return path


def _elements(model: Any, path: list[int], structure: Structure) -> tuple[tuple[Element, ...], FloatArray]:
    """The elements, and the axes of the last frame of the chain in Pinocchio's of the same joint, shape (3, 3)."""
    motors = {joint: place for place, joint in enumerate(structure.motor_joints)}
    strains = {joint: place for place, joint in enumerate(structure.spring_joints)}
    sections = (
        {row.joint_names[0]: number for number, row in enumerate(structure.section_table)} if structure.constant_strain else {}
    )
    elements: list[Element] = []
    axes: FloatArray = np.eye(3)
    neutral = pin.neutral(model)
    while path:
        joint = str(model.names[path[0]])
        rotation, translation = _placed(model.jointPlacements[path[0]], axes)
        if joint in sections:
            row = structure.section_table[sections[joint]]
            numbers, path = path[: len(JOINTS)], path[len(JOINTS) :]
            back = pin.rpy.rpyToMatrix(-float(row.rest_joints[0]), 0.0, 0.0)  # the origin of the first joint carries its rest
            axes = np.eye(3)
            bodies = tuple(_body(model.inertias[number], axes) for number in numbers)
            strain, turn = row.places[STRAINS[0]], _snapped(rotation @ back)
            elements.append(ChainSection(row.name, turn, translation, row.bends, strain, len(row.places), bodies))
        else:
            number, path = path[0], path[1:]
            slides, axes = _axes(model, number, neutral)
            places = motors.get(joint), strains.get(joint)
            body = _body(model.inertias[number], axes)
            elements.append(ChainJoint(joint, _snapped(rotation @ axes), translation, slides, *places, body, read_only(axes)))
    return tuple(elements), axes


def _axes(model: Any, number: int, neutral: FloatArray) -> tuple[bool, FloatArray]:
    """Whether a joint slides, and axes whose z is its axis, shape (3, 3)."""
    joint = model.joints[number]
    data = joint.createData()  # of this joint alone
    joint.calc(data, neutral)
    motion = np.asarray(data.S, dtype=np.float64)
    slides = not np.any(motion[3:])
    if joint.nv != 1 or (np.any(motion[:3]) and not slides):
        raise DescriptionError(
            f"joint {model.names[number]} of {model.name} is a {joint.shortname()}; compiled solvers take revolute, continuous "
            "and prismatic joints"
        )
    return slides, axes_along(_snapped((motion[:3] if slides else motion[3:]).reshape(3)))


def _placed(placement: Any, axes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation and translation of a placement in Pinocchio's frame, seen from the frame of the chain with `axes` there."""
    return _snapped(axes.T @ _snapped(placement.rotation)), _snapped(axes.T @ placement.translation)


def _snapped(array: FloatArray) -> FloatArray:
    """Read-only copy; entries that differ from 0, 1 or -1 by rounding are set to that."""
    whole = np.round(array)
    near = (np.abs(array - whole) <= _ROUNDING) & (np.abs(whole) <= 1.0)
    return read_only(np.where(near, whole, array) + 0.0)  # + 0.0: no zero is negative


def _body(inertia: Any, axes: FloatArray) -> ChainBody:
    mass, centre = float(inertia.mass), np.asarray(inertia.lever)
    about_origin = np.asarray(inertia.inertia) + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return ChainBody(mass, read_only(axes.T @ (mass * centre) + 0.0), read_only(axes.T @ about_origin @ axes + 0.0))
