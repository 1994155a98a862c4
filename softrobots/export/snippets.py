"""Export to self-contained Python files: a robot with its springs in PyBullet or on Pinocchio, without this package.

Neither tool reads joint springs from a URDF. The files hold the URDF, a table of the springs, and the code that applies them,
from two templates beside this module.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.core.xml_input import parse_xml
from softrobots.description.mesh_files import remove_mesh_shapes
from softrobots.description.rigid_tree import Body, RigidTree, Shape
from softrobots.description.rigid_tree_urdf import read_rigid_tree, write_rigid_tree
from softrobots.description.urdf_tags import NAMESPACE
from softrobots.environment.environment import Environment
from softrobots.export.contact_shapes import ContactShapes
from softrobots.export.damping import DampingRule, lowest_frequency, mass_matrix
from softrobots.export.held import HeldRobot, hold
from softrobots.export.prepared import checked_gravity, prepare, tip_body
from softrobots.export.python_text import assignment, block, filled, table
from softrobots.model.soft_model import SoftModel

MOST_JOINTS = 127
"""Largest number of joints of a robot in PyBullet, fixed ones included; beyond it, joint states are not available."""

HOLDING_FORCE = 1e6
"""Largest torque [N m] or force [N] with which a driven motor holds its position in PyBullet."""

_TINY_MASS, _TINY_INERTIA = 1e-9, 1e-12  # [kg], [kg m^2], of links without mass, for which PyBullet assumes 1 kg and 1 kg m^2
_FASTEST = 100.0  # [rad/s or m/s], of a motor without speed limit
_REST = 2e-5  # [rad or m], motion during the slowest decay time that counts as rest


def to_pybullet(
    model: SoftModel,
    q_motors: Any = None,
    *,
    actuators: str = "driven",
    damping: DampingRule = "file",
    damping_ratio: float | None = None,
    gravity: Any = None,
    limits: bool = True,
    environment: Environment | None = None,
    friction: float = 0.0,
) -> str:
    """Write a robot as a self-contained Python file for PyBullet: URDF, springs and the code that applies them.

    The file has `load(client)`, `drive(robot, positions)`, `apply_springs(robot)`, `step(robot, force, link)` and
    `settle(robot, force, link)`. Springs are torques by a linearly implicit rule, which is stable at PyBullet's 240 Hz for
    light links, too: the docstring of the file has the equations and the limits. Meshes are left out.

    In an environment, `load` makes a body of each obstacle (`robot.obstacles`), which touches the capsules of the robot; they
    stand in its URDF in place of the other collision shapes.

    Args:
        model: The robot.
        q_motors: Motor joints, then tensions or pressures, shape (n_motors,) [rad, m, N or Pa]; relaxed by default. Tensions
            become part of the springs.
        actuators: "driven": PyBullet's position control holds the motors, whatever the load; "welded": their joints are fixed.
        damping: Of the spring joints: "file", that of the description; a damping time [s]; a mapping {joint: N m s/rad or
            N s/m}; or "critical", which settles without swinging (`softrobots.export.damping`).
        damping_ratio: In place of it, the damping ratio of the slowest mode at rest, motors held, weightless [-].
        gravity: Gravity, shape (3,) [m/s^2], world axes, used when the file is run as a script; None: weightless.
        limits: Whether the springs have their limits; the statics reports them and goes beyond.
        environment: Obstacles around the robot, which stand still; without contact of the robot with itself.
        friction: Coefficient of friction between the robot and them.

    Returns:
        Text of the file.

    Raises:
        NameNotFound: If `damping` names a joint that has no spring.
        ParameterError: If an argument does not fit; if the robot has no springs, sections of constant strain, springs that are
            not linear, actuators that are no joint springs when they are held, or more joints than PyBullet supports; if
            obstacles move, or the robot is to touch itself.
        DescriptionError: If a moving link has no mass.
    """
    held = _held(model, q_motors)
    field = checked_gravity(gravity)
    robot = prepare(
        model,
        q_motors,
        actuators=actuators,
        damping=damping,
        damping_ratio=damping_ratio,
        environment=environment,
        friction=friction,
    )
    if robot.contact is not None and robot.contact.apart is not None:
        raise ParameterError(
            "environment", environment, "one without self_contact: PyBullet's links do not touch each other here"
        )
    joints = {joint.name: joint for joint in robot.tree.joints}
    if len(joints) > MOST_JOINTS:
        requirement = (
            f"a robot of at most {MOST_JOINTS} joints, fixed ones counted, for PyBullet; this one has {len(joints)} (a chain "
            "has fewer with fewer hinges, torsion=False or extension=False)"
        )
        raise ParameterError("model", model, requirement)
    frequency = robot.frequency or lowest_frequency(model, mass_matrix(model, robot.q_motors))
    springs = {name: (tag.stiffness, tag.rest, joints[name].damping) for name, tag in held.springs.items()}
    driven = {name: position for name, position in held.motors.items() if joints[name].movable}
    motors = {name: (position, min(joints[name].velocity, _FASTEST)) for name, position in driven.items()}
    data = [
        assignment("TIP", robot.tip),
        assignment("GRAVITY", field, "[m/s^2], of main()"),
        table("SPRINGS", springs, "joint: stiffness [N m/rad or N/m], rest [rad or m], damping [N m s/rad or N s/m]"),
        table("MOTORS", motors, "joint: position [rad or m], largest speed [rad/s or m/s]"),
        assignment("HOLDING_FORCE", HOLDING_FORCE, "[N m or N], of motors"),
        assignment("REST", _REST, "[rad or m], motion that settle() calls rest"),
        table("OBSTACLES", _obstacles(robot.contact), "shape, sizes [m], position [m], quaternion x y z w, corners of a mesh"),
        assignment("FRICTION", robot.contact.friction if robot.contact is not None else 0.0),
        assignment("QUIET_TIME", 1.0 / _slowest_decay(frequency, springs), "[s], for as long as this"),
    ]
    shapes = [shape for body in robot.tree.bodies for shape in (*body.visuals, *body.collisions)]
    return filled(
        "pybullet_template.txt",
        name=robot.tree.name,
        description=_pybullet_lines(held, actuators, robot.damping_rule, limits),
        meshes=str(sum(shape.kind == "mesh" for shape in shapes)),
        joints=str(len(joints)),
        data=block(data),
        urdf=_inside_quotes(write_rigid_tree(_for_pybullet(robot.tree, held, limits))),
    )


def to_pinocchio(model: SoftModel, q_motors: Any = None, *, gravity: Any = None) -> str:
    """Write a robot as a self-contained Python file for Pinocchio: URDF, springs and a solver for the equilibrium.

    The file has arrays `STIFFNESS` and `REST` in the order of the velocities of its Pinocchio model, `residual`, `tangent`,
    `solve(q_motors, force, gravity)` by Newton's method, under a world-fixed force at the tip, and `stable`.

    Args:
        model: The robot.
        q_motors: Motor joints, then tensions or pressures, shape (n_motors,) [rad, m, N or Pa]; relaxed by default; with
            pressures as tensions, they are the default in the file.
        gravity: Gravity, shape (3,) [m/s^2], world axes, used when the file is run as a script; None: weightless.

    Returns:
        Text of the file.

    Raises:
        ParameterError: If an argument does not fit; if the robot has no springs, sections of constant strain, springs that are
            not linear, or actuators that are no joint springs when they are held.
    """
    held = _held(model, q_motors)
    data = [
        assignment("ZERO", (0.0, 0.0, 0.0)),
        assignment("TIP", tip_body(read_rigid_tree(model.urdf), model.tip)),
        assignment("GRAVITY", checked_gravity(gravity), "[m/s^2], of main()"),
        table("SPRINGS", model.spring_table, "joint: stiffness [N m/rad or N/m], rest [rad or m]"),
        assignment("MOTORS", list(held.motors), "joints"),
        table("MUSCLES", model.structure.moment_arms, "muscle: derivative of its length by joint, all at zero [m/rad or -]"),
        table("TWISTS", _twists(model), "muscle: second derivative of its length by joint, all others are zero [m/rad^2]"),
        assignment("Q_MOTORS", [*held.motors.values(), *held.tensions.values()], "of motors, then muscles [rad, m or N]"),
        assignment("LOCKED", list(held.locked), "joints"),
    ]
    return filled(
        "pinocchio_template.txt",
        name=model.pinocchio.name,
        description=_pinocchio_lines(held),
        data=block(data),
        urdf=_inside_quotes(_without_meshes(model.urdf)),
    )


def _held(model: SoftModel, q_motors: Any) -> HeldRobot:
    held = hold(model, q_motors)
    if not held.springs:
        raise ParameterError("model", model, "a robot with springs; a rigid robot needs no export beyond its URDF")
    return held


def _twists(model: SoftModel) -> dict[str, dict[str, float]]:
    """By muscle, the second derivative of its length by joint, `d^2 / h` for twist; zeros are left out."""
    names, paths = model.structure.strain_springs.names, model.structure.muscle_paths
    straight, units = paths.at(np.zeros(paths.count)), np.eye(len(paths.rest))
    rows = [np.diag(straight.curvature(unit)).tolist() for unit in units]
    return {
        tag.name: {name: value for name, value in zip(names, row, strict=True) if value != 0.0}
        for tag, row in zip(model.muscles, rows, strict=True)
    }


def _obstacles(contact: ContactShapes | None) -> dict[str, tuple[Any, ...]]:
    """By name, shape, sizes, place and corners of the obstacles."""
    rows = {}
    for name, shape in contact.obstacles.items() if contact is not None else ():
        w, x, y, z = shape.placement.quaternion.tolist()
        corners = [tuple(row) for row in contact.meshes[name].vertices.tolist()] if contact and name in contact.meshes else []
        rows[name] = (shape.kind, shape.size, tuple(shape.placement.position.tolist()), (x, y, z, w), corners)
    return rows


def _inside_quotes(text: str) -> str:
    """Return XML without three quotes in a row; in attributes they are escaped already."""
    return text.replace('"""', "&quot;&quot;&quot;")


def _without_meshes(urdf: str) -> str:
    """Return the document without comments and mesh shapes."""
    root = parse_xml(urdf, "the URDF")
    remove_mesh_shapes(root)
    ElementTree.register_namespace("softrobots", NAMESPACE)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _slowest_decay(frequency: float, springs: Mapping[str, tuple[float, float, float]]) -> float:
    """Return the decay rate of the slowest motion [1/s]; joints without damping do not count."""
    return min([0.5 * frequency, *(stiffness / damping for stiffness, _, damping in springs.values() if damping > 0.0)])


def _for_pybullet(tree: RigidTree, held: HeldRobot, limits: bool) -> RigidTree:
    """Return the tree for PyBullet: no damping at springs, no meshes, mass in every body but the root."""
    bodies = []
    for body in tree.bodies:
        solid = replace(body, visuals=_solids(body.visuals), collisions=_solids(body.collisions))
        bodies.append(solid if body.name == tree.root else _with_mass(solid))
    joints = []
    for joint in tree.joints:
        spring = joint.name in held.springs
        bounds = joint.limits if limits or not spring else (-np.inf, np.inf)
        joints.append(replace(joint, damping=0.0, limits=bounds) if spring else joint)
    return replace(tree, bodies=tuple(bodies), joints=tuple(joints), springs=held.springs)


def _solids(shapes: Iterable[Shape]) -> tuple[Shape, ...]:
    return tuple(shape for shape in shapes if shape.kind != "mesh")


def _with_mass(body: Body) -> Body:
    return body if body.mass > 0.0 else replace(body, mass=_TINY_MASS, inertia=_TINY_INERTIA * np.eye(3))


def _pybullet_lines(held: HeldRobot, actuators: str, damping_rule: str, limits: bool) -> list[str]:
    lines = []
    if actuators == "welded" and held.motors:
        at = ", ".join(f"{name} {position!r}" for name, position in held.motors.items())
        lines.append(f"Motors are welded: their joints are fixed at [rad or m]: {at}.")
    elif held.motors:
        lines.append("Motors are driven: position control holds them at the positions of the table MOTORS.")
    if held.tensions:
        pulls = ", ".join(f"{name} {tension!r}" for name, tension in held.tensions.items())
        lines.append(f"Muscles pull with [N]: {pulls}. That stands in the springs, exactly.")
    lines.append(damping_rule)
    if not limits:
        lines.append("The springs have no limits.")
    if held.locked:
        lines.append(f"Locked at zero: {', '.join(held.locked)}.")
    return lines


def _pinocchio_lines(held: HeldRobot) -> list[str]:
    lines = []
    given = [f"positions of {', '.join(held.motors)} [rad or m]"] if held.motors else []
    if held.tensions:
        given.append(f"tensions of {', '.join(held.tensions)} [N]")
    lines.append(f"q_motors holds the {', then the '.join(given)}." if given else "q_motors is empty: nothing is driven.")
    if held.locked:
        lines.append(f"Locked at zero: {', '.join(held.locked)}.")
    return lines
