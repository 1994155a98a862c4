r"""Damping of exported joints: the robot's own, a time of the material, or as much as lets a simulation settle.

- "file": the numbers of the description, with which the robot moves here, too (`softrobots.dynamics.damping`).
- a number: the damping time :math:`\beta` [s] of a material, :math:`D = \beta K`.
- "critical", to settle where statics is wanted: with the mass matrix `M` and the stiffness `K` of the elastic joints at rest,
  motors held, the modes have the frequencies `w` of `K v = w^2 M v`, the lowest is `w_1`, and

  .. math:: D = \frac{2}{w_1} K

  is diagonal and leaves the modes as they are. A mode of frequency `w` then follows `x'' + 2 (w^2 / w_1) x' + w^2 x = 0`, whose
  damping ratio is `w / w_1 >= 1`: the slowest mode is critically damped and decays like `e^{-w_1 t}`, no mode oscillates, and
  each decays at the rate `(w^2 - w \sqrt{w^2 - w_1^2}) / w_1 > w_1 / 2` or more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, non_negative_number
from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.urdf_tags import SpringTag
from softrobots.model.soft_model import SoftModel

DAMPING = ("file", "critical")
"""Words for the damping of spring joints; it may be a number, too."""


def checked_damping(damping: Any) -> str | float:
    """Return one of `DAMPING`, or a damping time [s]; anything else raises ParameterError."""
    if isinstance(damping, str):
        if damping in DAMPING:
            return damping
        raise ParameterError("damping", damping, f"{' or '.join(map(repr, DAMPING))}, or a damping time [s]")
    return non_negative_number("damping", damping, "s")


def mass_matrix(model: SoftModel, q_motors: FloatArray) -> FloatArray:
    """Return the mass matrix with relaxed springs, in the order of Pinocchio's velocities, shape (nv, nv) [kg m^2, kg m, kg].

    Raises:
        DescriptionError: If the robot has more joints than Pinocchio supports.
    """
    structure = model.structure
    joints = np.zeros(model.pinocchio.nv)
    joints[structure.motor_indices] = q_motors[: len(structure.motor_joints)]
    joints[structure.spring_indices] = structure.strain_springs.rest
    return model.data.mass_matrix(model.embed(joints))


def lowest_frequency(model: SoftModel, mass: FloatArray) -> float:
    """Return the lowest natural frequency `w_1` [rad/s] of the spring joints, motors held, without gravity.

    Raises:
        DescriptionError: If the springs move no mass.
    """
    springs = model.structure.spring_indices
    root = 1.0 / np.sqrt(model.structure.strain_springs.stiffness)
    slowest = np.linalg.eigvalsh(root[:, None] * mass[np.ix_(springs, springs)] * root)[-1]  # 1 / w^2
    if not slowest > 0.0:
        raise DescriptionError(
            f"the springs of {model.pinocchio.name} move no mass, so that no natural frequency exists; give its links mass"
        )
    return float(1.0 / np.sqrt(slowest))


def rule_text(damping: str | float, frequency: float | None) -> str:
    """Return the rule as text for the head of a file, with the lowest frequency `w_1` [rad/s] if it sets the damping."""
    if isinstance(damping, float):
        return f"Damping of the springs is {damping!r} s times their stiffness."
    if damping == "file" or frequency is None:
        return "Damping of the springs is that of the description."
    return (
        f"Damping of the springs is 2 k / w1, with the lowest frequency at rest w1 = {frequency!r} rad/s (motors held, "
        "weightless): the slowest mode is critically damped, no mode oscillates."
    )


def damped(tree: RigidTree, springs: Mapping[str, SpringTag], damping_time: float | None) -> RigidTree:
    """Return the robot with a damping time [s] at its spring joints; None leaves the damping as it is."""
    if damping_time is None:
        return tree
    joints = (
        replace(joint, damping=damping_time * springs[joint.name].stiffness) if joint.name in springs else joint
        for joint in tree.joints
    )
    return replace(tree, joints=tuple(joints))
