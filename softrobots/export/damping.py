r"""Damping of exported joints: critical in the slowest mode, so that a simulation settles.

With the mass matrix `M` and the stiffness `K` of the elastic joints at
rest, motors held, its modes have the frequencies `w` of `K v = w^2 M v`. The stiffness-proportional damping

.. math:: D = \frac{2}{w_1} K

with the lowest of them, `w_1`, keeps `D` diagonal and leaves the modes as they are. A mode of frequency `w` then follows
`x'' + 2 (w^2 / w_1) x' + w^2 x = 0`, whose damping ratio is `w / w_1 >= 1`: the slowest mode is critically damped and decays
like `e^{-w_1 t}`, no mode oscillates, and each decays at the rate `(w^2 - w \sqrt{w^2 - w_1^2}) / w_1 > w_1 / 2` or more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import DescriptionError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.urdf_tags import SpringTag
from softrobots.model.soft_model import SoftModel

DAMPING = ("critical", "file")
"""Sources of the damping of spring joints: the rule of this module, or the description."""


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


def rule_text(frequency: float) -> str:
    """Return the rule as text for the head of a file, with the lowest frequency `w_1` [rad/s]."""
    return (
        f"Damping of the springs is 2 k / w1, with the lowest frequency at rest w1 = {frequency!r} rad/s (motors held, "
        "weightless): the slowest mode is critically damped, no mode oscillates."
    )


def damped(tree: RigidTree, springs: Mapping[str, SpringTag], frequency: float | None) -> RigidTree:
    """Return the robot with the damping `2 k / w_1` at its spring joints; a frequency of None leaves the damping as it is."""
    if frequency is None:
        return tree
    joints = (
        replace(joint, damping=2.0 * springs[joint.name].stiffness / frequency) if joint.name in springs else joint
        for joint in tree.joints
    )
    return replace(tree, joints=tuple(joints))
