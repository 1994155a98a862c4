"""A robot prepared for a simulator: fixed and driven joints, springs, damping and servos.

Statics holds motors exactly. In a simulator a motor is a joint with an actuator ("driven"), or a fixed joint at the given
coordinate ("welded"); then the tensions of actuators are part of the springs (`softrobots.export.held`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array
from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_tags import SpringTag
from softrobots.environment.capsules import capsule_tags
from softrobots.export.contact_shapes import ContactShapes, contact_shapes, with_capsules
from softrobots.export.damping import Damping, DampingRule, damped, lowest_frequency, mass_matrix
from softrobots.export.held import ACTUATORS, check_linear, hold, weld
from softrobots.export.servos import Motor, motors_of
from softrobots.model.soft_model import SoftModel

_LIGHTEST = 1e-15  # [kg]; MuJoCo refuses lighter moving bodies


@dataclass(frozen=True, eq=False)
class PreparedRobot:
    """Bodies, joints and springs to be exported."""

    tree: RigidTree
    """Every body and joint, with the exported damping and springs; welded and locked joints are fixed."""
    tip: str
    """Body at the tip."""
    motors: tuple[Motor, ...]
    """Driven motors, base to tip; none if welded."""
    q_motors: FloatArray
    """Positions of motors, then inputs of actuators, shape (n_motors,) [rad, m, N or Pa]."""
    home: Mapping[str, float]
    """Position of every movable joint with the springs relaxed [rad or m]."""
    damping_time: float | None
    """Damping of the springs over their stiffness [s]; None for that of the description."""
    frequency: float | None
    """Lowest frequency at rest [rad/s], if it sets the damping; else None."""
    remarks: tuple[str, ...]
    """Remarks on motors and actuators for the head of the file."""
    damping_rule: str
    """Where the damping of the springs comes from, in words, for the head of the file."""
    contact: ContactShapes | None
    """Surroundings, if any; then the collision shapes of the bodies are their capsules."""


def prepare(
    model: Any,
    q_motors: Any = None,
    *,
    actuators: str = "driven",
    damping: DampingRule = "file",
    damping_ratio: float | None = None,
    apart: Sequence[str] = (),
    environment: Any = None,
    friction: Any = 0.0,
) -> PreparedRobot:
    """Fix or drive the motors, put held tensions into the springs, choose damping and servos, and what touches.

    Args:
        model: The robot.
        q_motors: Motor joints, then inputs of actuators, shape (n_motors,) [rad, m, N or Pa]; relaxed by default.
        actuators: "driven" or "welded".
        damping: "file", "critical", a damping time [s] or numbers by joint, see `softrobots.export.damping`.
        damping_ratio: In place of it, the damping ratio of the slowest mode at rest [-].
        apart: Kinds of actuators that are no part of the springs if they are welded.
        environment: Obstacles around the robot, see `contact_shapes`.
        friction: Coefficient of friction.

    Raises:
        NameNotFound: If `damping` names a joint that has no spring.
        ParameterError: If `check_linear` refuses the model; a choice is unknown; `q_motors` does not fit the robot or, driven,
            is beyond the limits of the actuators; actuators are to be welded that are no joint springs (`hold`); or
            `contact_shapes` refuses the surroundings.
        DescriptionError: If the robot has moving bodies without mass, or more joints than Pinocchio supports.
    """
    checked = check_linear(model)
    choice("actuators", actuators, ACTUATORS)
    rule = Damping.of(checked, damping, damping_ratio)
    contact = contact_shapes(checked, environment, friction)
    values = checked.relaxed_motors if q_motors is None else checked.checked_motors(q_motors)
    structure, tree = checked.structure, read_rigid_tree(checked.urdf)
    positions = dict(zip(structure.motor_joints, values.tolist(), strict=False))
    fixed = dict.fromkeys(structure.locked_joints, 0.0)
    welded = actuators == "welded"
    if welded:
        springs, fixed = hold(checked, values, apart=apart).springs, fixed | positions
    else:
        _check_limits(checked, values)
        springs = {name: SpringTag(*pair) for name, pair in checked.spring_table.items()}
    tree = weld(tree, fixed)
    _refuse_massless(tree)
    if contact is not None:
        tree = with_capsules(tree, capsule_tags(checked))
    swings = rule.ratio is not None and bool(springs)
    mass = mass_matrix(checked, values) if swings or (positions and not welded) else np.zeros((0, 0))
    frequency = lowest_frequency(checked, mass) if swings else None
    time = rule.time if frequency is None or rule.ratio is None else 2.0 * rule.ratio / frequency
    return PreparedRobot(
        tree=replace(damped(tree, springs, time, rule.joints), springs=springs),
        tip=tip_body(tree, checked.tip),
        motors=() if welded else motors_of(checked, tree.joints, positions, mass),
        q_motors=values,
        home=_home(checked, tree, values),
        damping_time=time,
        frequency=frequency,
        remarks=_remarks(checked, values, welded),
        damping_rule=rule.text(frequency),
        contact=contact,
    )


def checked_gravity(gravity: Any) -> tuple[float, ...]:
    """Return gravity, shape (3,) [m/s^2], zeros for None, or raise ParameterError."""
    return (0.0, 0.0, 0.0) if gravity is None else tuple(finite_array("gravity", gravity, (3,), "m/s^2").tolist())


def weld_groups(tree: RigidTree) -> dict[str, str]:
    """Return by body name the body nearest to the root that it is fixed to; itself if its joint is movable."""
    group = {tree.root: tree.root}
    for joint in tree.joints:
        group[joint.child] = joint.child if joint.movable else group[joint.parent]
    return group


def neighbours(tree: RigidTree) -> tuple[tuple[str, str], ...]:
    """Return the pairs of neighbours along the chain, which must not collide.

    Simulators allow the two bodies of a joint to overlap, but these chains have small bodies without shapes between those with
    shapes. A pair is therefore a body with a collision shape and the nearest one towards the root that has one; bodies fixed
    to each other count as one. The one nearer to the root comes first.
    """
    group = weld_groups(tree)
    shaped: dict[str, list[str]] = {}
    for body in tree.bodies:
        if body.collisions:
            shaped.setdefault(group[body.name], []).append(body.name)
    below = {joint.child: group[joint.parent] for joint in tree.joints if joint.movable}
    pairs: list[tuple[str, str]] = []
    for name, bodies in shaped.items():
        lower = below.get(name)
        while lower is not None and lower not in shaped:
            lower = below.get(lower)
        pairs += [(first, second) for first in shaped.get(lower or "", ()) for second in bodies]
    return tuple(pairs)


def _check_limits(model: SoftModel, motors: FloatArray) -> None:
    low, high = model.motor_limits.T
    names = [name for name, out in zip(model.motor_joints, (motors < low) | (motors > high), strict=True) if out]
    if names:
        raise ParameterError("q_motors", motors, f'within the limits of {", ".join(names)}, or actuators="welded"')


def _refuse_massless(tree: RigidTree) -> None:
    group = weld_groups(tree)
    mass = dict.fromkeys(group, 0.0)
    for body in tree.bodies:
        mass[group[body.name]] += body.mass
    light = [joint.child for joint in tree.joints if joint.movable and not mass[joint.child] > _LIGHTEST]
    if light:
        raise DescriptionError(
            f"{tree.name} has moving links without mass ({', '.join(light)}), which no simulator can move; add <inertial>"
        )


def tip_body(tree: RigidTree, name: str) -> str:
    """Return the body at a frame, which is named by a link or by the joint of that link; a link goes before a joint."""
    links = (body.name for body in tree.bodies if body.name == name)
    return next(links, next((joint.child for joint in tree.joints if joint.name == name), name))


def _home(model: SoftModel, tree: RigidTree, motors: FloatArray) -> dict[str, float]:
    joints = model.coordinates.at(motors, model.rest).joints.tolist()
    chain = model.pinocchio
    return {joint.name: joints[chain.joints[chain.getJointId(joint.name)].idx_v] for joint in tree.joints if joint.movable}


def _remarks(model: SoftModel, motors: FloatArray, welded: bool) -> tuple[str, ...]:
    remarks = []
    if model.structure.motor_joints:
        remarks.append("Motors are welded: their joints are fixed." if welded else "Motors are driven: their joints move.")
    if model.muscles and welded:
        remarks.append("Muscles and tendons are welded: they are springs, which is exact.")
    if model.n_motors:
        at = ", ".join(f"{name} {value!r}" for name, value in zip(model.motor_joints, motors.tolist(), strict=True))
        remarks.append(f"{'Held' if welded else 'Home'} at [rad, m, N or Pa]: {at}.")
    if model.spring_groups:
        remarks.append("Inflated links wrinkle beyond a moment; the springs here do not.")
    return tuple(remarks)
