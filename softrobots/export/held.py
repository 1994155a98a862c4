r"""What an exporter needs of a robot whose actuators are held: motor positions, and joint springs that carry the muscles.

A tension `t` of the muscles adds the energy :math:`t^T A z` (see `softrobots.model.muscles`). On joint springs, where `z` are
the coordinates of joints, that only moves the reference of each spring:

.. math:: \tfrac12 k (z - r)^2 + t^T A z = \tfrac12 k (z - r + A^T t / k)^2 + \text{constant}

so a lumped chain under tensions is exactly a chain of springs. Muscles of given length tie the joints of a segment together,
and the six joints of a section of constant strain follow four coordinates; neither is a joint spring, and both are refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from softrobots.core.errors import ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_tags import SpringTag
from softrobots.model.soft_model import SoftModel, check_model

ACTUATORS = ("driven", "welded")
"""What becomes of motor joints: they stay joints that are driven to their positions, or become fixed there."""


@dataclass(frozen=True)
class HeldRobot:
    """A robot as joints that are held and joints with linear springs; every movable joint is in one of the three."""

    motors: Mapping[str, float]
    """Position by motor joint, base to tip [rad or m]."""
    springs: Mapping[str, SpringTag]
    """Spring by joint, base to tip; the reference carries the muscles."""
    locked: tuple[str, ...]
    """Joints that are locked at zero."""
    tensions: Mapping[str, float]
    """Tension by muscle [N]."""


def check_linear(model: Any) -> SoftModel:
    """Return `model` if a simulator can have its joints and springs.

    Raises:
        ParameterError: If it is no `SoftModel`, has sections of constant strain, or springs that are not linear.
    """
    checked = check_model(model)
    if checked.structure.constant_strain:
        raise ParameterError(
            "model",
            checked.pinocchio.name,
            'a chain of joint springs, as chain="lumped" makes it (pcc_arm_lumped, helix_tube_lumped): the six joints of a '
            "section of constant strain follow four coordinates by a map that is not linear, which no simulator holds",
        )
    if not checked.springs.linear:
        raise ParameterError(
            "model",
            checked.pinocchio.name,
            "a robot with linear springs, without max_moment: simulators know no other law of a joint "
            "spring, and a file with linear ones would be another robot",
        )
    return checked


def check_joint_springs(model: Any) -> SoftModel:
    """Return `model` if linear joint springs alone are its elasticity, so that a simulator can have it.

    Raises:
        ParameterError: If it is no `SoftModel`, has sections of constant strain, springs that are not linear, or muscles of
            given length.
    """
    checked = check_linear(model)
    if checked.muscles and checked.muscle_input != "forces":
        raise ParameterError(
            "model",
            checked.pinocchio.name,
            'a robot whose muscles have given tensions, load_model(..., muscles="forces") with the muscle_forces of an '
            "equilibrium: muscles of given length tie the joints of a segment together, which is no joint spring",
        )
    return checked


def hold(model: Any, q_motors: Any = None) -> HeldRobot:
    """Hold the actuators of a robot: motors at positions, muscles at tensions.

    Args:
        model: The robot.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N]; by default `relaxed_motors`.

    Returns:
        The robot as held joints and springs; the muscles have moved the references.

    Raises:
        ParameterError: If the model is none, has sections of constant strain or muscles of given length, or `q_motors` is not
            what the robot takes.
    """
    checked = check_joint_springs(model)
    structure = checked.structure
    values = checked.relaxed_motors if q_motors is None else checked.checked_motors(q_motors)
    count = len(structure.motor_joints)
    rest = structure.strain_springs.rest - values[count:] @ structure.muscle_matrix / structure.strain_springs.stiffness
    springs = {
        name: SpringTag(stiffness, reference)
        for name, stiffness, reference in zip(
            structure.spring_joints, structure.strain_springs.stiffness.tolist(), rest.tolist(), strict=True
        )
    }
    motors = dict(zip(structure.motor_joints, values[:count].tolist(), strict=True))
    tensions = dict(zip((muscle.name for muscle in checked.muscles), values[count:].tolist(), strict=True))
    return HeldRobot(MappingProxyType(motors), MappingProxyType(springs), locked_joints(checked), MappingProxyType(tensions))


def locked_joints(model: SoftModel) -> tuple[str, ...]:
    """Movable joints of the description that the model holds at zero, base to tip."""
    moving = set(model.pinocchio.names)
    joints = read_rigid_tree(model.urdf).joints
    return tuple(joint.name for joint in joints if joint.movable and joint.name not in moving)


def weld(tree: RigidTree, positions: Mapping[str, float]) -> RigidTree:
    """Make joints fixed where they are.

    Args:
        tree: The robot.
        positions: Position by joint [rad or m].

    Returns:
        The robot with those joints fixed; every body is where it was.
    """
    joints = (
        replace(joint, kind="fixed", placement=joint.placement_at(positions[joint.name])) if joint.name in positions else joint
        for joint in tree.joints
    )
    return replace(tree, joints=tuple(joints))
