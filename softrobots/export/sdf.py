"""Export to SDF 1.9, the format of Gazebo and Drake, with the springs and damping of joints."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import LARGEST
from softrobots.core.errors import DescriptionError, ParameterError
from softrobots.description.rigid_tree import Body, Joint, Placement, RigidTree, Shape, number_text
from softrobots.environment.environment import Environment
from softrobots.export.damping import DampingRule
from softrobots.export.meshes import MeshFiles, MeshFolder, drake_collides, drawn_anywhere
from softrobots.export.prepared import PreparedRobot, neighbours, prepare, weld_groups
from softrobots.export.sdf_parts import (
    DRAKE,
    HARDNESS,
    WORLD,
    write_colour,
    write_geometry,
    write_hardness,
    write_number,
    write_obstacles,
    write_pose,
)
from softrobots.export.xml_text import document
from softrobots.model.soft_model import SoftModel

_WORLD_SHAPES = "world_shapes"  # the world of SDF cannot have shapes
_STAND_IN = (1e-3, 1e-6)  # [kg], [kg m^2], without effect: for massless bodies fixed to the world


def to_sdf(
    model: SoftModel,
    q_motors: Any = None,
    *,
    actuators: str = "driven",
    damping: DampingRule = "file",
    damping_ratio: float | None = None,
    limits: bool = True,
    environment: Environment | None = None,
    friction: float = 0.0,
    mesh_folder: str | os.PathLike[str] | None = None,
) -> str:
    """Write a robot as a model of SDF 1.9.

    Links and joints keep their names of the URDF, fixed joints stay, the base is fixed to the world; rotations are
    quaternions, numbers have all digits. Springs are `spring_stiffness` and `spring_reference`. A moving link without
    mass becomes a frame, because SDF has no such links; its shapes are moved to a link that it is fixed to. Meshes are named by
    absolute path, and collision meshes are left out unless Drake reads them; with `mesh_folder` they are copied there, and
    those that Drake does not read are converted to OBJ.

    Driven motor joints are free joints with their torque limits: SDF has no actuators, the user adds a controller, and Drake
    creates an actuator for each. Spring joints have effort 0, so that Drake creates none for them. SDF has no muscles: use
    actuators="welded".

    Collisions of neighbours along the chain (`prepared.neighbours`) are excluded for Drake. Gazebo has no such exclusions, but
    ignores collisions within a model unless `self_collide` is set. In SDF, gravity belongs to the world, not to the model.

    In an environment, the file is a world of two models, the robot and its surroundings, a link with the name of each obstacle.
    The capsules of the robot touch them, in place of the collision shapes of the URDF (`softrobots.export.contact_shapes`);
    `softrobots.export.sdf_parts` says how stiff.

    Args:
        model: The robot.
        q_motors: Motor joints, then tensions or pressures, shape (n_motors,) [rad, m, N or Pa]; relaxed by default. For driven
            motors, they only affect the frequency that sets the damping.
        actuators: "driven", or "welded": motor joints become fixed, tensions become part of the springs.
        damping: Of the spring joints: "file", that of the description; a damping time [s]; a mapping {joint: N m s/rad or
            N s/m}; or "critical", which settles without swinging (`softrobots.export.damping`).
        damping_ratio: In place of it, the damping ratio of the slowest mode at rest, motors held, weightless [-].
        limits: Whether the springs have their limits; the statics reports them and goes beyond.
        environment: Obstacles around the robot, which stand still.
        friction: Coefficient of friction between the robot and them.
        mesh_folder: Folder for copies of mesh files, named by their content. Obstacles that are meshes need one; for them
            `export_model` takes that of the SDF file.

    Returns:
        SDF text.

    Raises:
        NameNotFound: If `damping` names a joint that has no spring.
        ParameterError: If an argument does not fit, muscles are to be driven, or the robot has sections of constant strain,
            springs that are not linear, or muscles that are no joint springs when they are welded. If obstacles move or are
            meshes without a folder, or friction is given without any.
        DescriptionError: If the robot has moving links without mass, a link and a joint of one name or of a name that SDF
            reserves, or more joints than Pinocchio supports.
        OutputError: If the file of a mesh cannot be written.
    """
    folder = MeshFolder.of(mesh_folder)
    robot = prepare(
        model,
        q_motors,
        actuators=actuators,
        damping=damping,
        damping_ratio=damping_ratio,
        environment=environment,
        friction=friction,
    )
    if model.muscles and actuators == "driven":
        raise ParameterError("actuators", actuators, '"welded" (--welded) for a robot with muscles or tendons, which SDF lacks')
    tree = robot.tree
    names = [body.name for body in tree.bodies] + [joint.name for joint in tree.joints]
    obstacles = robot.contact.obstacles if robot.contact is not None else ()
    reserved = [name for name in (*(body.name for body in tree.bodies[1:]), *obstacles) if name == WORLD]
    reserved += [name for name in (*names, *obstacles) if "::" in name or (name.startswith("__") and name.endswith("__"))]
    if reserved:
        message = f"{tree.name} has links, joints or obstacles named {', '.join(reserved)}; SDF reserves these names"
        raise DescriptionError(message)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise DescriptionError(f"{tree.name} has a link and a joint named {', '.join(twice)}; SDF requires different names")
    ElementTree.register_namespace("drake", DRAKE)
    root = ElementTree.Element("sdf", {"version": "1.9"})
    name, parent = tree.name or "robot", root
    if robot.contact is not None:
        parent = ElementTree.SubElement(root, "world", {"name": f"{name}_with_surroundings"})
        write_obstacles(parent, robot.contact, folder)
    writer = _Model(ElementTree.SubElement(parent, "model", {"name": name}), robot, limits, MeshFiles(folder))
    writer.write()
    return document(root, _head(robot, writer.meshes, limits))


class _Model:
    """Writes links, frames and joints into a model, and records the meshes left out."""

    def __init__(self, element: ElementTree.Element, robot: PreparedRobot, limits: bool, meshes: MeshFiles) -> None:
        self._element, self._robot, self._limits = element, robot, limits
        self._anchor = _anchors(robot.tree)
        self._names = {body.name for body in robot.tree.bodies} | {joint.name for joint in robot.tree.joints}
        self._world_shapes = self._free_name(_WORLD_SHAPES)
        self.meshes = meshes

    def _free_name(self, wanted: str) -> str:
        while wanted in self._names:
            wanted += "_"
        return wanted

    def write(self) -> None:
        """Write everything."""
        tree = self._robot.tree
        places: dict[str, tuple[Placement, str]] = {joint.child: (joint.placement, joint.parent) for joint in tree.joints}
        links: dict[str, ElementTree.Element] = {}
        for body in tree.bodies:
            placement, parent = places.get(body.name, (Placement(), WORLD))
            if body.name == WORLD:
                if body.visuals or body.collisions:
                    links[WORLD] = self._link(replace(body, name=self._world_shapes), placement, parent)
            elif body.name in self._anchor:
                attributes = {"name": body.name, "attached_to": self._anchor[body.name]}
                write_pose(ElementTree.SubElement(self._element, "frame", attributes), placement, parent)
            else:
                links[body.name] = self._link(body, placement, parent)
        for body in tree.bodies:
            carrier = self._anchor.get(body.name, body.name)
            if carrier in links:
                self._shapes(links[carrier], body, body.visuals, "visual", drawn_anywhere)
                self._shapes(links[carrier], body, body.collisions, "collision", drake_collides)
        if tree.root != WORLD or WORLD in links:
            child = tree.root if tree.root != WORLD else self._world_shapes
            self._joint(self._free_name(f"{child}_to_world"), "fixed", WORLD, child)
        for joint in tree.joints:
            if joint.movable:
                self._moving(joint)
            elif joint.child not in self._anchor and joint.child not in self._anchor.values():
                self._joint(joint.name, "fixed", joint.parent, joint.child)
        self._filters()

    def _link(self, body: Body, placement: Placement, parent: str) -> ElementTree.Element:
        link = ElementTree.SubElement(self._element, "link", {"name": body.name})
        write_pose(link, placement, parent)
        mass, moments = body.mass, body.inertia_in_body
        if mass <= 0.0:
            mass, moments = _STAND_IN[0], _STAND_IN[1] * np.eye(3)
        inertial = ElementTree.SubElement(link, "inertial")
        write_pose(inertial, Placement(body.centre.position))
        write_number(inertial, "mass", mass)
        entries = ElementTree.SubElement(inertial, "inertia")
        for first, second in ("xx", "xy", "xz", "yy", "yz", "zz"):
            write_number(entries, f"i{first}{second}", moments["xyz".index(first), "xyz".index(second)])
        return link

    def _shapes(
        self, link: ElementTree.Element, body: Body, shapes: Sequence[Shape], kind: str, readable: Callable[[Path], bool]
    ) -> None:
        for shape, file in self.meshes.split(shapes, readable):
            number = len(link.findall(kind)) + 1
            element = ElementTree.SubElement(link, kind, {"name": f"{kind}_{number}"})
            write_pose(element, shape.placement, body.name if body.name in self._anchor else "")
            write_geometry(element, shape, file)
            if kind == "visual" and shape.rgba is not None:
                write_colour(element, shape.rgba)
            if kind == "collision" and self._robot.contact is not None:
                write_hardness(element, self._robot.contact.friction)

    def _joint(self, name: str, kind: str, parent: str, child: str) -> ElementTree.Element:
        element = ElementTree.SubElement(self._element, "joint", {"name": name, "type": kind})
        ElementTree.SubElement(element, "parent").text = parent
        ElementTree.SubElement(element, "child").text = child
        return element

    def _moving(self, joint: Joint) -> None:
        spring = self._robot.tree.springs.get(joint.name)
        bounded = bool(np.all(np.isfinite(joint.limits))) and (self._limits or spring is None)
        kind = joint.kind if joint.kind == "prismatic" else "revolute" if bounded else "continuous"
        element = self._joint(joint.name, kind, joint.parent, joint.child)
        axis = ElementTree.SubElement(element, "axis")
        ElementTree.SubElement(axis, "xyz").text = number_text(joint.axis)
        dynamics = ElementTree.SubElement(axis, "dynamics")
        write_number(dynamics, "damping", joint.damping)
        if joint.friction > 0.0 and spring is None:
            write_number(dynamics, "friction", joint.friction)
        if joint.rotor_inertia > 0.0 and spring is None:
            write_number(element, f"{{{DRAKE}}}rotor_inertia", joint.rotor_inertia)
        if spring is not None:
            write_number(dynamics, "spring_stiffness", spring.stiffness)
            write_number(dynamics, "spring_reference", spring.rest)
        limit = ElementTree.SubElement(axis, "limit")
        if bounded:
            write_number(limit, "lower", joint.limits[0])
            write_number(limit, "upper", joint.limits[1])
        for name, value in (("effort", joint.effort if spring is None else 0.0), ("velocity", joint.velocity)):
            if value < LARGEST:
                write_number(limit, name, value)

    def _filters(self) -> None:
        """Exclude collisions in Drake, of neighbours or, in surroundings, of all; a group ignores itself."""
        tree, contact = self._robot.tree, self._robot.contact
        groups: Sequence[tuple[str, ...]] = neighbours(tree)
        if contact is not None and contact.apart is not None:
            groups = contact.apart
        elif contact is not None:
            groups = [tuple(body.name for body in tree.bodies if body.collisions)]
        carriers = [tuple(dict.fromkeys(self._anchor.get(member, member) for member in group)) for group in groups]
        for number, members in enumerate(dict.fromkeys(carriers), 1):
            name = f"no_collision_{number}"
            group = ElementTree.SubElement(self._element, f"{{{DRAKE}}}collision_filter_group", {"name": name})
            for member in members:
                ElementTree.SubElement(group, f"{{{DRAKE}}}member").text = member if member != WORLD else self._world_shapes
            ElementTree.SubElement(group, f"{{{DRAKE}}}ignored_collision_filter_group").text = name


def _anchors(tree: RigidTree) -> dict[str, str]:
    """Return by name of each moving body without mass the first body with mass that it is fixed to."""
    group = weld_groups(tree)
    heavy: dict[str, str] = {}
    for body in tree.bodies:
        if body.mass > 0.0:
            heavy.setdefault(group[body.name], body.name)
    static = group[tree.root]
    return {body.name: heavy[group[body.name]] for body in tree.bodies if body.mass <= 0.0 and group[body.name] != static}


def _head(robot: PreparedRobot, meshes: MeshFiles, limits: bool) -> list[str]:
    lines = [f"{robot.tree.name}, SDF 1.9 for Drake and Gazebo; written by softrobots from its URDF. SI units and radians."]
    lines += [*robot.remarks, robot.damping_rule, "Gravity is not in this file: it is the world's."]
    if robot.contact is not None:
        lines += [robot.contact.remark, HARDNESS]
    if not limits:
        lines.append("The springs have no limits here.")
    return [*lines, *meshes.remark("to collide and not OBJ, glTF or VTK, which alone Drake reads")]
