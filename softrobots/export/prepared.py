"""A robot made ready for a simulator: what is held becomes fixed, and every number that a file needs is chosen.

Statics holds motors exactly. A simulator either gets a motor joint with an actuator ("driven"), or no joint at all ("welded"):
the body stands at the given coordinate, and tensions of muscles stand in the springs (`softrobots.export.held`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from softrobots.core.checks import FloatArray, choice, finite_array
from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_tags import SpringTag
from softrobots.export.damping import DAMPING, damped, lowest_frequency, mass_matrix, rule_told
from softrobots.export.held import ACTUATORS, check_linear, hold, locked_joints, weld
from softrobots.export.servos import Motor, Muscle, motors_of, muscles_of
from softrobots.model.soft_model import SoftModel

_LIGHTEST = 1e-15  # [kg]; MuJoCo refuses moving bodies below


@dataclass(frozen=True, eq=False)
class PreparedRobot:
    """Bodies, joints and springs as an exporter writes them."""

    tree: RigidTree
    """Every body and joint; what is held is a fixed joint; damping and springs are those to be written."""
    tip: str
    """Body at the tip."""
    motors: tuple[Motor, ...]
    """Motors whose joints still move, base to tip; none if welded."""
    muscles: tuple[Muscle, ...]
    """Muscles that still pull; none if welded."""
    home: Mapping[str, float]
    """Position of every movable joint with the springs relaxed [rad or m]."""
    frequency: float | None
    """Lowest frequency at rest that set the damping [rad/s]; None if the description set it."""
    remarks: tuple[str, ...]
    """What was done, a sentence or two each, for the head of the file."""


def prepare(model: Any, q_motors: Any = None, *, actuators: str = "driven", damping: str = "critical") -> PreparedRobot:
    """Hold what is held, shift springs, choose damping and servos.

    Args:
        model: The robot.
        q_motors: Motor joints, then muscles, shape (n_motors,) [rad, m or N]; relaxed by default.
        actuators: "driven" or "welded".
        damping: "critical" or "file", see `softrobots.export.damping`.

    Returns:
        The robot to write.

    Raises:
        ParameterError: If the model is none, has sections of constant strain or springs that are not linear; a choice is
            unknown; `q_motors` does not fit the robot or, driven, is beyond the limits of the actuators; or muscles that are
            given as lengths were to be welded.
        DescriptionError: If the robot has moving bodies without mass, or more joints than Pinocchio's workspace is made for.
    """
    checked = check_linear(model)
    choice("actuators", actuators, ACTUATORS)
    choice("damping", damping, DAMPING)
    values = checked.relaxed_motors if q_motors is None else checked.checked_motors(q_motors)
    structure, tree = checked.structure, read_rigid_tree(checked.urdf)
    positions = dict(zip(structure.motor_joints, values.tolist(), strict=False))
    fixed = dict.fromkeys(locked_joints(checked), 0.0)
    springs: Mapping[str, SpringTag] = {name: SpringTag(*spring) for name, spring in checked.spring_table.items()}
    welded = actuators == "welded"
    if welded:
        springs, fixed = hold(checked, values).springs, fixed | positions
    else:
        _check_limits(checked, values)
    tree = weld(tree, fixed)
    _refuse_massless(tree)
    mass = mass_matrix(checked, values)
    frequency = lowest_frequency(checked, mass) if damping == "critical" and springs else None
    return PreparedRobot(
        tree=replace(damped(tree, springs, frequency), springs=springs),
        tip=_tip(tree, checked.tip),
        motors=() if welded else motors_of(checked, tree.joints, positions, mass),
        muscles=() if welded else muscles_of(checked, values[len(positions) :], mass),
        home=_home(checked, tree, values),
        frequency=frequency,
        remarks=_remarks(checked, values, welded, frequency),
    )


def checked_gravity(gravity: Any) -> tuple[float, ...]:
    """Gravity, shape (3,) [m/s^2]; zeros for None.

    Raises:
        ParameterError: If the shape differs or a number is not finite.
    """
    return (0.0, 0.0, 0.0) if gravity is None else tuple(finite_array("gravity", gravity, (3,), "m/s^2").tolist())


def weld_groups(tree: RigidTree) -> dict[str, str]:
    """The lowest body (towards the root) that each body is fixed to, by body name; itself if a movable joint carries it."""
    group = {tree.root: tree.root}
    for joint in tree.joints:
        group[joint.child] = joint.child if joint.movable else group[joint.parent]
    return group


def neighbours(tree: RigidTree) -> tuple[tuple[str, str], ...]:
    """Pairs of bodies that are not to collide, because they are neighbours along the chain.

    Simulators let the two bodies of a joint overlap. Our chains have tiny bodies without shapes between those that can collide.
    So the rule is: each body with a collision shape, and the nearest one below it (towards the root) that has one; bodies that
    are fixed to each other count as one.

    Args:
        tree: The robot.

    Returns:
        Pairs of body names, the lower body first.
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
            f"{tree.name} has moving links without mass ({', '.join(light)}), which no simulator can move; give them <inertial>"
        )


def _tip(tree: RigidTree, name: str) -> str:
    """The body at a frame, which is a link or the joint that carries it."""
    links = (body.name for body in tree.bodies if body.name == name)
    return next(links, next((joint.child for joint in tree.joints if joint.name == name), name))


def _home(model: SoftModel, tree: RigidTree, motors: FloatArray) -> dict[str, float]:
    joints = model.coordinates.at(motors, model.rest).joints.tolist()
    of = model.pinocchio
    return {joint.name: joints[of.joints[of.getJointId(joint.name)].idx_v] for joint in tree.joints if joint.movable}


def _remarks(model: SoftModel, motors: FloatArray, welded: bool, frequency: float | None) -> tuple[str, ...]:
    made = []
    if model.structure.motor_joints:
        made.append("Motors are welded: their joints are fixed." if welded else "Motors are driven: their joints move.")
    if model.muscles and welded:
        made.append("Muscles are welded: their tensions are in the references of the springs, r - A^T t / k, which is exact.")
    elif model.muscles:
        made.append(f"Muscles are driven; given are their {'tensions' if model.muscle_input == 'forces' else 'lengths'}.")
    if model.n_motors:
        at = ", ".join(f"{name} {value!r}" for name, value in zip(model.motor_joints, motors.tolist(), strict=True))
        made.append(f"{'Held' if welded else 'Home'} at [rad, m or N]: {at}.")
    made.append("Damping of the joints is that of the description." if frequency is None else rule_told(frequency))
    if model.spring_groups:
        made.append("Inflated links wrinkle beyond a moment; the springs here do not.")
    return tuple(made)
