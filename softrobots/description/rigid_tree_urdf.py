"""Conversion between URDF text and `RigidTree`, for exporters and for readers of other formats."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from softrobots.core.checks import LARGEST, FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import parse_xml
from softrobots.description.rigid_tree import SOLIDS, Body, Joint, Placement, RigidTree, Shape, number_text
from softrobots.description.urdf_tags import NAMESPACE, CapsuleTag, SpringTag

_SHAPES = (*SOLIDS, "mesh")
_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")  # of the inertia, row by row


def read_rigid_tree(urdf: str, source: str = "the URDF") -> RigidTree:
    """Read bodies and joints from URDF text that Pinocchio accepts; springs are in `SoftModel.spring_table`.

    Raises:
        DescriptionError: If the text is no URDF, has no single root, or has a malformed number.
    """
    root = parse_xml(urdf, source)
    try:
        colours = {element.get("name", ""): element.find("color") for element in root.iter("material") if len(element)}
        bodies = {element.get("name", ""): _body(element, colours) for element in root.findall("link")}
        joints = [_joint(element) for element in root.findall("joint")]
        capsules = tuple(_capsule(element) for element in root.findall(f"{{{NAMESPACE}}}capsule"))
    except (ValueError, IndexError) as error:
        raise DescriptionError(f"{source} cannot be read: {error}") from error
    carried = {joint.child for joint in joints}
    roots = [name for name in bodies if name not in carried]
    if root.tag != "robot" or len(roots) != 1:
        raise DescriptionError(f"{source} has the root links {', '.join(roots) or '(none)'}; one is required")
    order, ordered = [roots[0]], []
    for name in order:
        below = [joint for joint in joints if joint.parent == name]
        ordered += below
        order += [joint.child for joint in below]
    if len(order) != len(bodies) or any(name not in bodies for name in order):
        raise DescriptionError(f"{source} is no tree: {len(order)} of its {len(bodies)} links are connected to {roots[0]}")
    return RigidTree(root.get("name", ""), tuple(bodies[name] for name in order), tuple(ordered), {}, capsules=capsules)


def write_rigid_tree(tree: RigidTree) -> str:
    """Return a tree as URDF text, springs as tags of this package, all numbers with full precision.

    The text has the hints that keep links and springs in MuJoCo and Gazebo's parser. A revolute joint without finite limits
    becomes continuous.
    """
    ElementTree.register_namespace("softrobots", NAMESPACE)
    robot = Element("robot", {"name": tree.name or "robot"})
    SubElement(SubElement(robot, "mujoco"), "compiler", {"discardvisual": "false", "fusestatic": "false"})
    for body in tree.bodies:
        link = SubElement(robot, "link", {"name": body.name})
        if body.mass > 0.0:
            inertial = SubElement(link, "inertial")
            _write_placement(inertial, body.centre)
            SubElement(inertial, "mass", {"value": repr(float(body.mass))})
            entries = zip(_ENTRIES, body.inertia[np.triu_indices(3)].tolist(), strict=True)
            SubElement(inertial, "inertia", {name: repr(value) for name, value in entries})
        for kind, shapes in (("visual", body.visuals), ("collision", body.collisions)):
            for shape in shapes:
                _write_shape(SubElement(link, kind), shape)
    for joint in tree.joints:
        _write_joint(SubElement(robot, "joint", {"name": joint.name}), joint, tree.springs.get(joint.name))
    for name, spring in tree.springs.items():
        _write_hints(robot, name, springStiffness=repr(float(spring.stiffness)), springReference=repr(float(spring.rest)))
    for joint in tree.joints:
        if joint.child == (tree.tip or "tip") and joint.kind == "fixed":
            _write_hints(robot, joint.name, preserveFixedJoint="true")
    for tag in tree.capsules:
        numbers = {"start": number_text(tag.start), "end": number_text(tag.end), "radius": repr(tag.radius)}
        SubElement(robot, f"{{{NAMESPACE}}}capsule", {"link": tag.link} | numbers)
    if tree.tip is not None:
        SubElement(robot, f"{{{NAMESPACE}}}tip", {"link": tree.tip})
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode") + "\n"


def _numbers(element: Element | None, attribute: str, default: str) -> FloatArray:
    """Numbers of an attribute, as many as the default has."""
    text = default if element is None else element.get(attribute, default)
    numbers = [float(part) for part in text.split()]
    if len(numbers) != len(default.split()):
        raise ValueError(f"{attribute} = {text!r}; {len(default.split())} numbers are required")
    return np.array(numbers)


def _placement(element: Element) -> Placement:
    origin = element.find("origin")
    rpy = _numbers(origin, "rpy", "0 0 0")
    return Placement(read_only(_numbers(origin, "xyz", "0 0 0")), read_only(np.asarray(pin.rpy.rpyToMatrix(*rpy))))


_Colours = Mapping[str, Element | None]  # by name of the material


def _body(link: Element, colours: _Colours) -> Body:
    name, inertial = link.get("name", ""), link.find("inertial")
    try:
        shapes = [tuple(_shape(element, colours) for element in link.findall(kind)) for kind in ("visual", "collision")]
    except ValueError as error:
        raise ValueError(f"link {name} has {error}") from error
    if inertial is None:
        return Body(name, 0.0, Placement(), np.zeros((3, 3)), *shapes)
    xx, xy, xz, yy, yz, zz = (_numbers(inertial.find("inertia"), entry, "0")[0] for entry in _ENTRIES)
    inertia = read_only(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    mass = float(_numbers(inertial.find("mass"), "value", "0")[0])
    return Body(name, mass, _placement(inertial), inertia, *shapes)


def _shape(element: Element, colours: _Colours) -> Shape:
    geometry = element.find("geometry")
    solid = next(iter(geometry)) if geometry is not None and len(geometry) else None
    if solid is None or solid.tag not in _SHAPES:
        raise ValueError(f"a shape {solid.tag if solid is not None else '(none)'}; one of {', '.join(_SHAPES)} is required")
    if solid.tag == "mesh":
        size = _numbers(solid, "scale", "1 1 1")
    else:
        size = np.concatenate([_numbers(solid, name, "1 1 1" if name == "size" else "1") for name in SOLIDS[solid.tag]])
    material, colour = element.find("material"), element.find("material/color")
    if material is not None and colour is None:
        colour = colours.get(material.get("name", ""))
    rgba = None if colour is None else tuple(_numbers(colour, "rgba", "1 1 1 1").tolist())
    return Shape(solid.tag, tuple(size.tolist()), _placement(element), rgba, solid.get("filename", ""), element.get("name", ""))


def _joint(element: Element) -> Joint:
    axis = _numbers(element.find("axis"), "xyz", "1 0 0")
    length = float(np.linalg.norm(axis))
    kind, limit, dynamics = element.get("type", ""), element.find("limit"), element.find("dynamics")
    bounded = kind in ("revolute", "prismatic")
    low, high = (
        float(_numbers(limit, name, "0")[0]) if bounded else sign * np.inf for name, sign in (("lower", -1.0), ("upper", 1.0))
    )
    low, high = (-np.inf if low <= -LARGEST else low), (np.inf if high >= LARGEST else high)
    return Joint(
        element.get("name", ""),
        kind,
        link_at(element, "parent"),
        link_at(element, "child"),
        _placement(element),
        read_only(axis / length if length > 0.0 else axis),
        (low, high),
        float(_numbers(limit, "effort", "inf")[0]),
        float(_numbers(limit, "velocity", "inf")[0]),
        float(_numbers(dynamics, "damping", "0")[0]),
        float(_numbers(dynamics, "friction", "0")[0]),
        float(_numbers(element.find(f"{{{NAMESPACE}}}rotor"), "inertia", "0")[0]),
    )


def _capsule(element: Element) -> CapsuleTag:
    link, sizes = element.get("link", ""), (("start", "0 0 0"), ("end", "0 0 0"), ("radius", "0"))
    x, y, z, u, v, w, radius = np.concatenate([_numbers(element, *size) for size in sizes]).tolist()
    if not all(abs(number) <= LARGEST for number in (x, y, z, u, v, w, radius)):
        raise ValueError(f"a capsule of link {link} has a number that is not finite or above {LARGEST:g} in size")
    return CapsuleTag(link, (x, y, z), (u, v, w), radius)


def link_at(joint: Element, end: str) -> str:
    """Return the name of the "parent" or "child" link of a URDF joint; empty if it has none."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _write_placement(element: Element, placement: Placement) -> None:
    SubElement(element, "origin", {"xyz": number_text(placement.position), "rpy": number_text(placement.rpy)})


def _write_shape(element: Element, shape: Shape) -> None:
    _write_placement(element, shape.placement)
    solid = SubElement(SubElement(element, "geometry"), shape.kind)
    if shape.kind == "mesh":
        solid.set("filename", shape.filename)
        solid.set("scale", number_text(shape.size))
    elif shape.kind == "box":
        solid.set("size", number_text(shape.size))
    else:
        for name, value in zip(("radius", "length"), shape.size, strict=False):  # also of capsules, for PyBullet
            solid.set(name, repr(float(value)))
    if shape.rgba is not None:
        name = "colour_" + "_".join(f"{value:.6g}" for value in shape.rgba)
        material = SubElement(element, "material", {"name": name})
        SubElement(material, "color", {"rgba": number_text(shape.rgba)})


def _write_hints(robot: Element, joint: str, **hints: str) -> None:
    """Write a `<gazebo>` tag of a joint for Gazebo's parser."""
    element = SubElement(robot, "gazebo", {"reference": joint})
    for name, value in hints.items():
        SubElement(element, name).text = value


def _write_joint(element: Element, joint: Joint, spring: SpringTag | None) -> None:
    bounded = bool(np.any(np.isfinite(joint.limits)))  # a bound on one side only: the other is `LARGEST`
    element.set("type", "continuous" if joint.kind == "revolute" and not bounded else joint.kind)
    _write_placement(element, joint.placement)
    SubElement(element, "parent", {"link": joint.parent})
    SubElement(element, "child", {"link": joint.child})
    if not joint.movable:
        return
    SubElement(element, "axis", {"xyz": number_text(joint.axis)})
    limit = {"effort": repr(min(joint.effort, LARGEST)), "velocity": repr(min(joint.velocity, LARGEST))}
    if bounded or joint.kind == "prismatic":  # URDF has no prismatic joint without limits
        low, high = np.clip(joint.limits, -LARGEST, LARGEST)
        limit |= {"lower": repr(float(low)), "upper": repr(float(high))}
    SubElement(element, "limit", limit)
    SubElement(element, "dynamics", {"damping": repr(float(joint.damping)), "friction": repr(float(joint.friction))})
    SubElement(element, f"{{{NAMESPACE}}}role", {"value": "spring" if spring else "motor"})
    if joint.rotor_inertia > 0.0:
        SubElement(element, f"{{{NAMESPACE}}}rotor", {"inertia": repr(float(joint.rotor_inertia))})
    if spring:
        numbers = {"stiffness": repr(float(spring.stiffness)), "rest": repr(float(spring.rest))}
        SubElement(element, f"{{{NAMESPACE}}}spring", numbers)
