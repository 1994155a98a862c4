r"""A robot with held actuators: motor positions, and joint springs that include the tensions of actuators.

A given tension `t`, or that of a given pressure, adds the energy `t l`. On a straight route along lumped sections
(`softrobots.model.muscle_paths`) that is linear in bending and elongation, with the arms `A`, and quadratic in twist, with the
stiffness :math:`\kappa = \sum t d^2 / h`, so that it changes the reference and the stiffness of each spring:

.. math:: \tfrac12 k (z - r)^2 + t^T A z + \tfrac12 \kappa z^2
          = \tfrac12 (k + \kappa) \Bigl(z - \frac{k r - A^T t}{k + \kappa}\Bigr)^2 + \text{constant}

so a lumped chain under tensions is exactly a chain of springs. All else is refused: actuators of given length, tensions that
follow the length, and winding routes couple the joints of a segment, and a section of constant strain couples its six.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, read_only_mapping
from softrobots.core.errors import ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.urdf_tags import ActuatorTag, SpringTag
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel

ACTUATORS = ("driven", "welded")
"""Motor joints in the export: driven joints, or fixed at their positions."""


@dataclass(frozen=True)
class HeldRobot:
    """A robot with held joints and linear joint springs; every movable joint is a motor, has a spring, or is locked."""

    motors: Mapping[str, float]
    """Position by motor joint, base to tip [rad or m]."""
    springs: Mapping[str, SpringTag]
    """Spring by joint, base to tip; they include the muscle tensions."""
    locked: tuple[str, ...]
    """Joints locked at zero."""
    tensions: Mapping[str, float]
    """Tension by actuator that is held, negative where it pushes [N]."""


def check_linear(model: Any) -> SoftModel:
    """Return `model` if simulators can represent its joints and springs.

    Raises:
        ParameterError: If it is not a `SoftModel`, has sections of constant strain, or springs that are not linear.
    """
    checked = check_frictionless(model, "exports")
    if checked.structure.constant_strain:
        requirement = (
            'a chain of joint springs, chain="lumped" (pcc_arm_lumped, tendon_arm_lumped, ...): the six joints of a section of '
            "constant strain follow its coordinates by a nonlinear map, which simulators cannot represent"
        )
        raise ParameterError("model", checked.pinocchio.name, requirement)
    if not checked.springs.linear:
        requirement = (
            "a robot with linear springs, without max_moment and without moment_law slack_wall: the moment of such a link "
            "depends on the angles of both its joints together, and the springs of simulators are each of one joint"
        )
        raise ParameterError("model", checked.pinocchio.name, requirement)
    return checked


def hold(model: Any, q_motors: Any = None, *, apart: Sequence[str] = ()) -> HeldRobot:
    """Hold the actuators of a robot: motors at positions, tensions and pressures in the springs; by default `relaxed_motors`.

    Args:
        model: The robot.
        q_motors: Motor joints, then inputs of actuators, shape (n_motors,) [rad, m, N or Pa].
        apart: Kinds of actuators that are left out, because the file has them by themselves.

    Raises:
        ParameterError: If `check_linear` refuses the model, it has actuators that are no joint springs, `q_motors` does not fit
            it, or the actuators push so hard that a spring has no stiffness left.
    """
    checked = check_linear(model)
    _refuse_coupled([tag for tag in checked.muscles if tag.kind not in apart], checked.pinocchio.name)
    structure = checked.structure
    values = checked.relaxed_motors if q_motors is None else checked.checked_motors(q_motors)
    count = len(structure.motor_joints)
    factors = [{"tension": 1.0, "pressure": -tag.area}.get(tag.kind, 0.0) for tag in checked.muscles]
    pulls = np.array(factors) * values[count:]
    motors = dict(zip(structure.motor_joints, values[:count].tolist(), strict=True))
    pairs = zip(checked.muscles, pulls.tolist(), strict=True)
    tensions = {tag.name: tension for tag, tension in pairs if tag.kind not in apart}
    springs = _pulled_springs(checked, pulls)
    held = read_only_mapping(motors), read_only_mapping(springs)
    return HeldRobot(*held, structure.locked_joints, read_only_mapping(tensions))


def _refuse_coupled(tags: Sequence[ActuatorTag], robot: str) -> None:
    """Refuse actuators that are no joint springs when they are held."""
    reasons = {
        'a robot with given tensions, load_model(..., muscles="forces") with the muscle_forces of an equilibrium: actuators of '
        "given length couple the joints of a segment": [tag.name for tag in tags if tag.kind == "length"],
        'kind="tension" with the muscle_forces of an equilibrium, or MuJoCo, which has such actuators (to_mjcf): a tension '
        "that follows the length couples joints": [tag.name for tag in tags if tag.kind in ("elastic", "mckibben")],
        "straight routes, or MuJoCo with driven actuators (to_mjcf): tension along a winding route couples joints": [
            tag.name for tag in tags if not tag.straight
        ],
    }
    for requirement, names in reasons.items():
        if names:
            raise ParameterError("model", f"{robot} with {', '.join(names)}", requirement)


def _pulled_springs(model: SoftModel, tensions: FloatArray) -> dict[str, SpringTag]:
    """Return the joint springs of a lumped chain with tensions of its actuators, shape (n_muscles,) [N], in them.

    Raises:
        ParameterError: If the actuators push so hard that a spring has no stiffness left: it buckles in torsion.
    """
    springs, paths = model.structure.strain_springs, model.structure.muscle_paths
    straight = paths.at(np.zeros(paths.count))
    stiffness = springs.stiffness + np.diag(straight.curvature(tensions))
    soft = [name for name, value in zip(springs.names, stiffness, strict=True) if value <= 0.0]
    if soft:
        raise ParameterError("q_motors", tensions, f"tensions that leave {', '.join(soft)} a stiffness: such a push buckles it")
    pull = tensions @ straight.arms
    rest = (springs.stiffness * springs.rest - pull) / stiffness
    rest = np.where(stiffness == springs.stiffness, springs.rest - pull / stiffness, rest)  # no rounding without tension
    tags = map(SpringTag, stiffness.tolist(), rest.tolist())
    return dict(zip(model.structure.spring_joints, tags, strict=True))


def weld(tree: RigidTree, positions: Mapping[str, float]) -> RigidTree:
    """Return a robot with some joints fixed at given positions [rad or m]."""
    joints = (
        replace(joint, kind="fixed", placement=joint.placement_at(positions[joint.name])) if joint.name in positions else joint
        for joint in tree.joints
    )
    return replace(tree, joints=tuple(joints))
