"""A robot prepared for a simulator: fixed and driven joints, springs, damping and servos.

Statics holds motors exactly. In a simulator a motor is a joint with an actuator ("driven"), or a fixed joint at the given
coordinate ("welded"); then muscle tensions are part of the springs (`softrobots.export.held`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array
from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.export.damping import checked_damping, damped, lowest_frequency, mass_matrix, rule_text
from softrobots.export.held import ACTUATORS, check_linear, hold, pulled_springs, weld
from softrobots.export.servos import Motor, Muscle, motors_of, muscles_of
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
    muscles: tuple[Muscle, ...]
    """Driven muscles; none if welded."""
    home: Mapping[str, float]
    """Position of every movable joint with the springs relaxed [rad or m]."""
    frequency: float | None
    """Lowest frequency at rest [rad/s], if it sets the damping; else None."""
    remarks: tuple[str, ...]
    """Remarks on motors and muscles for the head of the file."""
    damping_rule: str
    """Where the damping of the springs comes from, in words, for the head of the file."""


def prepare(model: Any, q_motors: Any = None, *, actuators: str = "driven", damping: str | float = "file") -> PreparedRobot:
    """Fix or drive the actuators, put muscle tensions into the springs, choose damping and servos.

    Args:
        model: The robot.
        q_motors: Motor joints, then muscles, shape (n_motors,) [rad, m or N]; relaxed by default.
        actuators: "driven" or "welded".
        damping: "file", "critical" or a damping time [s], see `softrobots.export.damping`.

    Raises:
        ParameterError: If `check_linear` refuses the model; a choice is unknown; `q_motors` does not fit the robot or, driven,
            is beyond the limits of the actuators; or muscles of given length are to be welded.
        DescriptionError: If the robot has moving bodies without mass, or more joints than Pinocchio supports.
    """
    checked = check_linear(model)
    choice("actuators", actuators, ACTUATORS)
    rule = checked_damping(damping)
    values = checked.relaxed_motors if q_motors is None else checked.checked_motors(q_motors)
    structure, tree = checked.structure, read_rigid_tree(checked.urdf)
    positions = dict(zip(structure.motor_joints, values.tolist(), strict=False))
    fixed = dict.fromkeys(structure.locked_joints, 0.0)
    welded = actuators == "welded"
    if welded:
        springs, fixed = hold(checked, values).springs, fixed | positions
    else:
        _check_limits(checked, values)
        springs = pulled_springs(checked, _tensions(checked, values), by_tendons=True)
    tree = weld(tree, fixed)
    _refuse_massless(tree)
    mass = mass_matrix(checked, values)
    frequency = lowest_frequency(checked, mass) if rule == "critical" and springs else None
    time = rule if isinstance(rule, float) else None if frequency is None else 2.0 / frequency
    return PreparedRobot(
        tree=replace(damped(tree, springs, time), springs=springs),
        tip=tip_body(tree, checked.tip),
        motors=() if welded else motors_of(checked, tree.joints, positions, mass),
        muscles=() if welded else muscles_of(checked, values[len(positions) :], mass),
        home=_home(checked, tree, values),
        frequency=frequency,
        remarks=_remarks(checked, values, welded),
        damping_rule=rule_text(rule, frequency),
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


def _tensions(model: SoftModel, values: FloatArray) -> FloatArray:
    """Tension of each muscle at home, without load, shape (n_muscles,) [N]."""
    structure = model.structure
    if structure.muscle_lengths is None:
        return values[len(structure.motor_joints) :]
    springs = structure.strain_springs
    carried = springs.stiffness * (structure.strains(values, model.rest) - springs.rest)
    return np.asarray(-carried @ structure.muscle_lengths.spread)


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
        remarks.append("Muscles are welded: their tensions are in the springs, which is exact.")
    elif model.muscles:
        remarks.append(f"Muscles are driven; given are their {'tensions' if model.muscle_input == 'forces' else 'lengths'}.")
        remarks.append("Twist does not lengthen them here; the springs of twist have the stiffness of their tensions at home.")
    if model.n_motors:
        at = ", ".join(f"{name} {value!r}" for name, value in zip(model.motor_joints, motors.tolist(), strict=True))
        remarks.append(f"{'Held' if welded else 'Home'} at [rad, m or N]: {at}.")
    if model.spring_groups:
        remarks.append("Inflated links wrinkle beyond a moment; the springs here do not.")
    return tuple(remarks)
