"""Export to MJCF, the format of MuJoCo, with springs, damping, collision exclusions, actuators and a home position."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.errors import DescriptionError
from softrobots.description.rigid_tree import Body, Joint, Placement, RigidTree, Shape, number_text
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.environment.environment import Environment
from softrobots.export.damping import DampingRule
from softrobots.export.meshes import MeshFiles, MeshFolder, mujoco_reads
from softrobots.export.mjcf_contact import (
    SOFTNESS,
    capsule_bits,
    solid_size,
    steadying_armature,
    where,
    write_contact_defaults,
    write_obstacles,
)
from softrobots.export.mjcf_tendons import Sites, place_sites, write_drives, write_slides, write_tendons
from softrobots.export.prepared import PreparedRobot, checked_gravity, neighbours, prepare, weld_groups
from softrobots.export.servos import ANGLE_ERROR, Motor
from softrobots.export.slides import TENDON_LAG
from softrobots.export.tendons import SPRINGY, tendons_of
from softrobots.export.xml_text import document
from softrobots.model.soft_model import SoftModel

_GREY = (0.6, 0.6, 0.6, 1.0)
_DRAWN, _HIDDEN = "2", "3"  # MuJoCo's groups of shapes
_SMALLEST = 1e-15  # [kg m^2], of a moving body
_ROUNDING = 1e-12  # relative, of moments of inertia


def to_mjcf(
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
    mesh_folder: str | os.PathLike[str] | None = None,
) -> str:
    """Write a robot as MJCF that MuJoCo 3 and 4 read.

    Bodies and joints keep their names of the URDF; fixed links stay bodies; a site marks the tip; numbers have all digits.
    Springs are `stiffness` and `springref`. Neighbours along the chain do not collide (`prepared.neighbours`). Meshes in STL
    and OBJ are named by absolute path, others are left out; with `mesh_folder` they are copied there, others as OBJ.

    Driven motors are position actuators (`softrobots.export.servos`), whose joints have the damping at which the motor just
    reaches its largest speed under its largest torque, if `damping` is "critical". Actuators along the body are spatial tendons
    (`softrobots.export.tendons`) with an actuator each, whose `ctrl` is the input and whose force is the tension, that of a
    McKibben muscle at its rest length; given lengths and these muscles are driven by slide joints beside the robot
    (`softrobots.export.slides`). Welded, tensions and pressures are part of the springs, elastic actuators and McKibben muscles
    are springs of tendons (the latter in MuJoCo 4 only, whose springs have polynomials). The keyframe `home` holds the relaxed
    springs and `q_motors` as `ctrl`.

    In an environment, obstacles are geoms of the world with their names, and the capsules of the robot touch them, in place of
    the collision shapes of the URDF (`softrobots.export.contact_shapes`). `SOFTNESS` says how stiff.

    Args:
        model: The robot.
        q_motors: Motor joints, then inputs of actuators, shape (n_motors,) [rad, m, N or Pa]; relaxed by default.
        actuators: "driven", or "welded": motor joints become fixed, actuators become springs.
        damping: Of the spring joints: "file", that of the description; a damping time [s]; a mapping {joint: N m s/rad or
            N s/m}; or "critical", which settles without swinging (`softrobots.export.damping`).
        damping_ratio: In place of it, the damping ratio of the slowest mode at rest, motors held, weightless [-].
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        limits: Whether the springs have their limits; the statics reports them and goes beyond.
        environment: Obstacles around the robot, which stand still.
        friction: Coefficient of friction between the robot and them.
        mesh_folder: Folder for copies of mesh files, named by their content; None: the originals are used.

    Returns:
        MJCF text.

    Raises:
        NameNotFound: If `damping` names a joint that has no spring.
        ParameterError: If an argument does not fit, or the robot has sections of constant strain, springs that are not linear,
            or welded actuators that MuJoCo does not have: given lengths, and tensions along winding routes. If obstacles move,
            or friction is given without any.
        DescriptionError: If the robot has moving links without mass or moments of inertia, a link with impossible
            moments, a link `world` that is not its root, or more joints than Pinocchio supports.
        OutputError: If the copy of a mesh cannot be written.
    """
    field = checked_gravity(gravity)
    robot = prepare(
        model,
        q_motors,
        actuators=actuators,
        damping=damping,
        damping_ratio=damping_ratio,
        apart=SPRINGY,
        environment=environment,
        friction=friction,
    )
    _refuse(robot.tree)
    tendons = tendons_of(model, robot, welded=actuators == "welded")
    root = ElementTree.Element("mujoco", {"model": robot.tree.name or "robot"})
    compiler = {"angle": "radian", "autolimits": "true", "fusestatic": "false", "inertiafromgeom": "false"}
    ElementTree.SubElement(root, "compiler", compiler)
    option = ElementTree.SubElement(root, "option", {"gravity": number_text(field)})
    if robot.motors or tendons:
        option.set("integrator", "implicitfast")  # which treats the damping of actuators and tendons implicitly, too
    if robot.contact is not None:
        write_contact_defaults(root, option, robot.contact.friction)
    assets = ElementTree.SubElement(root, "asset")
    sites = place_sites(tendons)
    bodies = _Bodies(robot, limits, damping == "critical", assets, sites, MeshFiles(MeshFolder.of(mesh_folder)))
    world = ElementTree.SubElement(root, "worldbody")
    bodies.write(world)
    slides = write_slides(world, tendons)
    if robot.contact is not None:
        write_obstacles(world, assets, robot.contact)
    if not len(assets):
        root.remove(assets)
    pairs = neighbours(robot.tree) if robot.contact is None else robot.contact.apart or ()
    if pairs:
        contact = ElementTree.SubElement(root, "contact")
        for first, second in pairs:
            ElementTree.SubElement(contact, "exclude", {"body1": first, "body2": second})
    if tendons:
        write_tendons(root, tendons)
    key = {"name": "home", "qpos": number_text([*(robot.home[name] for name in bodies.order), *slides])}
    if actuators == "driven" and model.n_motors:
        driven = ElementTree.SubElement(root, "actuator")
        _write_motors(driven, robot.motors)
        write_drives(driven, tendons)
        key["ctrl"] = number_text(robot.q_motors)
    if bodies.order:
        ElementTree.SubElement(ElementTree.SubElement(root, "keyframe"), "key", key)
    return document(root, _head(robot, model.muscles if actuators == "driven" else (), bodies.meshes, limits))


class _Bodies:
    """Writes the nested bodies; records the order of the joints and the meshes left out."""

    def __init__(
        self,
        robot: PreparedRobot,
        limits: bool,
        limit_speed: bool,
        assets: ElementTree.Element,
        sites: Sites,
        meshes: MeshFiles,
    ) -> None:
        self._robot, self._limits, self._assets, self._sites = robot, limits, assets, sites
        self._damping = {motor.joint.name: motor.speed_damping for motor in robot.motors} if limit_speed else {}
        self._mesh_names: dict[tuple[Path, tuple[float, ...]], str] = {}
        self.order: list[str] = []
        self.meshes = meshes

    def write(self, world: ElementTree.Element) -> None:
        """Write the whole tree; a root named world is MuJoCo's world."""
        tree = self._robot.tree
        if tree.root == "world":
            self._inside(world, tree.body("world"))
        else:
            self._body(world, tree.body(tree.root), Placement(), None)

    def _body(self, parent: ElementTree.Element, body: Body, placement: Placement, joint: Joint | None) -> None:
        element = ElementTree.SubElement(parent, "body", {"name": body.name, **where(placement)})
        if joint is not None and joint.movable:
            self._joint(element, joint)
        if body.mass > 0.0:
            inertial = {"pos": number_text(body.centre.position), "mass": repr(body.mass), **_inertia(body)}
            ElementTree.SubElement(element, "inertial", inertial)
        self._inside(element, body)

    def _inside(self, element: ElementTree.Element, body: Body) -> None:
        contact = capsule_bits(self._robot.contact) if self._robot.contact is not None else {}
        drawn = self.meshes.split(body.visuals, mujoco_reads)
        touching = self.meshes.split(body.collisions, mujoco_reads)
        for shape, file in drawn:
            self._geom(element, shape, file, {"group": _DRAWN, "contype": "0", "conaffinity": "0"})
        for shape, file in touching:  # visible if no visual could be written
            self._geom(element, shape, file, {"group": _HIDDEN if drawn or not body.visuals else _DRAWN, **contact})
        if body.name == self._robot.tip:
            ElementTree.SubElement(element, "site", {"name": body.name})
        for name, place in self._sites.get(body.name, ()):
            ElementTree.SubElement(element, "site", {"name": name, "pos": number_text(place), "size": "0.001"})
        for joint in self._robot.tree.joints_of(body.name):
            self._body(element, self._robot.tree.body(joint.child), joint.placement, joint)

    def _joint(self, element: ElementTree.Element, joint: Joint) -> None:
        self.order.append(joint.name)
        attributes = {
            "name": joint.name,
            "type": "slide" if joint.kind == "prismatic" else "hinge",
            "axis": number_text(joint.axis),
        }
        spring = self._robot.tree.springs.get(joint.name)
        if np.all(np.isfinite(joint.limits)) and (self._limits or spring is None):
            attributes["range"] = number_text(joint.limits)
        if spring is not None:
            attributes |= {"stiffness": repr(spring.stiffness), "springref": repr(spring.rest)}
        damping = self._damping.get(joint.name, joint.damping)
        if damping > 0.0:
            attributes["damping"] = repr(damping)
        armature = joint.rotor_inertia
        if spring is not None and self._robot.contact is not None:
            armature += steadying_armature(damping)
        for name, value in (("frictionloss", joint.friction if spring is None else 0.0), ("armature", armature)):
            if value > 0.0:
                attributes[name] = repr(value)
        ElementTree.SubElement(element, "joint", attributes)

    def _geom(self, element: ElementTree.Element, shape: Shape, file: Path | None, options: dict[str, str]) -> None:
        measure = solid_size(shape) if file is None else {"mesh": self._mesh(file, shape.size)}
        attributes = {"type": shape.kind, **measure, **where(shape.placement), "rgba": number_text(shape.rgba or _GREY)}
        ElementTree.SubElement(element, "geom", attributes | options)

    def _mesh(self, file: Path, scale: tuple[float, ...]) -> str:
        key = (file, scale)
        if key not in self._mesh_names:
            self._mesh_names[key] = f"{file.stem}_{len(self._mesh_names) + 1}"
            attributes = {"name": self._mesh_names[key], "file": str(file), "scale": number_text(scale)}
            ElementTree.SubElement(self._assets, "mesh", attributes)
        return self._mesh_names[key]


def _refuse(tree: RigidTree) -> None:
    """Refuse what MuJoCo refuses: a link world above the root, impossible inertia, and moving bodies without inertia."""
    if any(body.name == "world" for body in tree.bodies[1:]):
        raise DescriptionError(f"{tree.name} has a link world that is not its root; MuJoCo reserves that name for the root")
    group, turning = weld_groups(tree), set()
    for body in (body for body in tree.bodies if body.mass > 0.0):
        low, middle, high = np.linalg.eigvalsh(body.inertia_in_body).tolist()
        if low < -_ROUNDING * high or low + middle < high * (1.0 - _ROUNDING):
            raise DescriptionError(
                f"link {body.name} of {tree.name} has the principal moments of inertia {low:g}, {middle:g}, {high:g} kg m^2, "
                "which MuJoCo refuses; each must be at least 0 and at most the sum of the others"
            )
        if low >= _SMALLEST:
            turning.add(group[body.name])
    points = [joint.child for joint in tree.joints if joint.movable and joint.child not in turning]
    if points:
        raise DescriptionError(
            f"{tree.name} has moving links without moments of inertia ({', '.join(points)}), which MuJoCo refuses; give them "
            f"three of at least {_SMALLEST:g} kg m^2"
        )


def _inertia(body: Body) -> dict[str, str]:
    """Return the inertia; as principal moments where rounding could violate MuJoCo's conditions (plates, rods, points)."""
    moments = body.inertia_in_body
    (low, middle, high), axes = np.linalg.eigh(moments)
    if low > _ROUNDING * high and low + middle > high * (1.0 + _ROUNDING):
        entries = (moments[pair] for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        return {"fullinertia": number_text(entries)}
    low = max(low, 0.0)
    principal = (low, middle, min(high, low + middle))
    turned = Placement(rotation=axes * np.sign(np.linalg.det(axes)))
    return {"diaginertia": number_text(principal), "quat": number_text(turned.quaternion)}


def _write_motors(element: ElementTree.Element, motors: Sequence[Motor]) -> None:
    for motor in motors:
        gain, damping, force = motor.servo
        attributes = {"name": motor.joint.name, "joint": motor.joint.name, "kp": repr(gain), "kv": repr(damping)}
        if np.isfinite(force):
            attributes["forcerange"] = number_text((-force, force))
        if np.all(np.isfinite(motor.joint.limits)):
            attributes["ctrlrange"] = number_text(motor.joint.limits)
        ElementTree.SubElement(element, "position", attributes)


def _head(robot: PreparedRobot, driven: Sequence[ActuatorTag], meshes: MeshFiles, limits: bool) -> list[str]:
    lines = [f"{robot.tree.name}, for MuJoCo; written by softrobots from its URDF. SI units and radians."]
    lines += [*robot.remarks, robot.damping_rule]
    if robot.motors:
        lines.append(
            f"Position actuators of motors give all their torque at an error of {ANGLE_ERROR} rad; statics holds exactly."
        )
    if any(tag.kind == "length" for tag in driven):
        lines.append(
            f"Actuators of given length hang on winches beside the robot; time steps up to {2 * TENDON_LAG} s are stable."
        )
    if any(tag.kind == "mckibben" for tag in driven):
        lines.append(
            "McKibben muscles drive pistons beside the robot, whose force is the tension at rest length; none goes slack."
        )
    if driven:
        lines.append("The ctrl of an actuator is its length, that of its motor [m], its tension [N] or pressure [Pa].")
    if robot.contact is not None:
        lines += [robot.contact.remark, SOFTNESS]
    if not limits:
        lines.append("The springs have no limits here.")
    return [*lines, *meshes.remark("neither OBJ nor binary STL")]
