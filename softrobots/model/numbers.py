"""The numbers of a model on which its statics depends, as plain arrays by name.

Two models of one structure, a robot and the same with another stiffness, differ in nothing else. Derivatives by parameters are
those of the statics by these numbers (`softrobots.identification.residual_derivatives`) times those of the numbers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.actuator_laws import pull_factors
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import SpringGroup, Springs
from softrobots.model.structure import Structure

Numbers = dict[str, FloatArray]
"""Arrays by name, see `model_numbers`."""


def model_numbers(model: SoftModel) -> Numbers:
    """Return all numbers on which the statics of a robot depends; of parts that it does not have, arrays of length zero.

    `placements` (n_joints, 3, 4) and `frames` (n_frames, 3, 4): rotation and position of joints and frames in the joint before
    them; `masses` (n_joints, 4): mass and first moment of the bodies beyond joints; `stiffness` and `rest` (n_strains,);
    `moments` (n_groups,): the moment of the law of each inflated link; `section_lengths` (n_sections,) and `section_joints`
    (n_sections, 6): of what bends of sections of constant strain; `path_*` (n_paths, ...): constants of `MusclePaths`;
    `path_rest`, `straightened` and `laws` (n_muscles, ...): of actuators, see `LAW`; `held_slopes` and `held_elastic`: of
    `MuscleLengths`; `bending_friction` and `guide_friction`: of `DryFriction`.
    """
    rigid = model.pinocchio
    bodies = [(one.mass, *(one.mass * one.lever)) for one in list(rigid.inertias)[1:]]
    return {
        "placements": np.array([one.homogeneous[:3] for one in list(rigid.jointPlacements)[1:]]).reshape(-1, 3, 4),
        "frames": np.array([one.placement.homogeneous[:3] for one in rigid.frames]),
        "masses": np.array(bodies).reshape(-1, 4),
        "moments": np.array([one.linear_up_to or 0.0 for one in strain_springs(model).groups]),
        **structure_numbers(model.structure),
    }


def structure_numbers(structure: Structure) -> Numbers:
    """Return those of `model_numbers` that are neither of rigid bodies nor moments."""
    paths, springs, friction = structure.muscle_paths, structure.strain_springs, structure.friction
    sections, held = structure.section_table if structure.constant_strain else (), structure.muscle_lengths
    laws = [(one.stiffness, one.pretension, one.area, *_pull(one), one.rest_length) for one in structure.muscles]
    return {
        "stiffness": springs.stiffness,
        "rest": springs.rest,
        "section_lengths": np.array([row.bends for row in sections]),
        "section_joints": np.array([row.rest_joints for row in sections]).reshape(-1, 6),
        "path_length": paths.length,
        "path_arms": paths.arms,
        "path_across": paths.across,
        "path_turned": paths.turned,
        "path_rest": paths.rest,
        "straightened": paths.straightened,
        "laws": np.array(laws).reshape(-1, len(LAW)),
        "held_slopes": np.zeros((0, 0)) if held is None else held.slopes,
        "held_elastic": np.zeros((0, 0)) if held is None else held.elastic,
        "bending_friction": np.zeros(0) if friction is None else friction.limit,
        "guide_friction": np.zeros(0) if friction is None else friction.coefficient,
    }


LAW = ("stiffness", "pretension", "area", "square", "least", "rest_length")
"""Numbers of the law of an actuator: of its tag, and the factors of `actuator_laws.pull_factors`."""


def _pull(tag: object) -> tuple[float, float]:
    return pull_factors(tag) if tag.kind == "mckibben" else (0.0, 0.0)  # type: ignore[attr-defined, arg-type]


def strain_springs(model: SoftModel) -> Springs:
    """Return the springs of the strains, with the inflated links: also where given lengths hold some of the strains."""
    strains, springs = model.structure.strain_springs, model.springs
    if model.structure.muscle_lengths is None:
        return springs

    def place(number: int) -> int:
        return strains.names.index(springs.names[number])

    def among_strains(group: SpringGroup) -> SpringGroup:
        return replace(group, springs=tuple(place(number) for number in group.springs), twist=None)

    nonlinear = [group for group in springs.groups if group.linear_up_to is not None]
    return replace(strains, groups=tuple(among_strains(group) for group in nonlinear))
