"""The rigid bodies and joints of a description as plain data: what exporters read out of URDF, and what readers write as URDF.

Pinocchio merges bodies behind fixed joints and knows no shapes of its own; other formats want every link as it was written.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from softrobots.checks import LARGEST, FloatArray, read_only
from softrobots.description import parse_xml
from softrobots.errors import DescriptionError
from softrobots.urdf_tags import NAMESPACE, SpringTag

MOVABLE = ("revolute", "continuous", "prismatic")
"""The kinds of joints that move, as URDF calls them."""

_NO_ROTATION = read_only(np.eye(3))
_ORIGIN = read_only(np.zeros(3))
_SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("filename",)}


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a frame is in another one."""

    position: FloatArray = field(default_factory=lambda: _ORIGIN)
    """Its origin, shape (3,) [m]."""
    rotation: FloatArray = field(default_factory=lambda: _NO_ROTATION)
    """Its axes as columns, shape (3, 3)."""

    @staticmethod
    def turned(position: FloatArray, quaternion: FloatArray) -> Placement:
        """Placement from a position, shape (3,) [m], and a quaternion w, x, y, z, shape (4,)."""
        w, x, y, z = (float(value) for value in quaternion)
        rotation = np.asarray(pin.Quaternion(w, x, y, z).normalized().toRotationMatrix())
        return Placement(read_only(np.array(position, dtype=np.float64)), read_only(rotation))

    @property
    def inverse(self) -> Placement:
        """Placement of the other frame in this one."""
        return Placement(read_only(-self.rotation.T @ self.position), read_only(self.rotation.T.copy()))

    @property
    def rpy(self) -> FloatArray:
        """Roll, pitch, yaw as URDF counts them, shape (3,) [rad]."""
        return np.asarray(pin.rpy.matrixToRpy(self.rotation))

    @property
    def quaternion(self) -> FloatArray:
        """The rotation as a unit quaternion w, x, y, z, shape (4,)."""
        x, y, z, w = pin.Quaternion(self.rotation).coeffs()
        return np.array([w, x, y, z])

    def __matmul__(self, inner: Placement) -> Placement:
        """Placement of a frame that is placed at `inner` in this one."""
        return Placement(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)


@dataclass(frozen=True, eq=False)
class Shape:
    """A geometric shape of a body."""

    kind: str
    """"box", "cylinder" (along z), "sphere" or "mesh"."""
    size: tuple[float, ...]
    """Edges of a box, radius and length of a cylinder, radius of a sphere [m]; scale of a mesh along x, y, z."""
    placement: Placement
    """Where its centre is in the body."""
    rgba: tuple[float, ...] | None = None
    """Red, green, blue, opacity in [0, 1]; None if not said."""
    filename: str = ""
    """File of a mesh, as the description spells it."""


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body: a link."""

    name: str
    """Name."""
    mass: float
    """Mass [kg]; 0 if the description gives none."""
    centre: Placement
    """Centre of mass, and the axes in which `inertia` is written."""
    inertia: FloatArray
    """Inertia about the centre of mass in those axes, shape (3, 3) [kg m^2]."""
    visuals: tuple[Shape, ...] = ()
    """What is drawn."""
    collisions: tuple[Shape, ...] = ()
    """What collides."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint, movable or fixed."""

    name: str
    """Name."""
    kind: str
    """"revolute", "continuous", "prismatic" or "fixed"; others as the description spells them."""
    parent: str
    """Body that it hangs on."""
    child: str
    """Body that it carries; its frame is that of the joint."""
    placement: Placement
    """Where the child is in the parent while the joint is at zero."""
    axis: FloatArray
    """Unit axis in the child, shape (3,)."""
    limits: tuple[float, float]
    """Lowest and highest coordinate [rad or m]; infinite where there is none."""
    effort: float
    """Largest torque or force [N m or N]."""
    velocity: float
    """Largest speed [rad/s or m/s]."""
    damping: float
    """Viscous damping [N m s/rad or N s/m]."""

    @property
    def movable(self) -> bool:
        """Whether it moves."""
        return self.kind != "fixed"


@dataclass(frozen=True, eq=False)
class RigidTree:
    """Bodies and joints of one robot."""

    name: str
    """Name of the robot."""
    bodies: tuple[Body, ...]
    """Bodies, each before its children."""
    joints: tuple[Joint, ...]
    """Joints, each before those that its child carries."""
    springs: Mapping[str, SpringTag]
    """Joint springs by joint name."""
    tip: str | None = None
    """Body that is the tip unless the caller says another; None if that is not told."""

    @property
    def root(self) -> str:
        """Name of the body that no joint carries."""
        return self.bodies[0].name

    def body(self, name: str) -> Body:
        """Body of that name."""
        return next(body for body in self.bodies if body.name == name)

    def joints_of(self, body: str) -> tuple[Joint, ...]:
        """Joints that hang on a body."""
        return tuple(joint for joint in self.joints if joint.parent == body)


def read_rigid_tree(urdf: str, source: str = "the URDF") -> RigidTree:
    """Read bodies and joints out of URDF text that Pinocchio accepts.

    Springs are not read: `SoftModel.spring_table` has them, also those that the caller said.

    Args:
        urdf: The whole document.
        source: Where it comes from, for errors.

    Returns:
        The tree, every parent before its children.

    Raises:
        DescriptionError: If the text is no URDF, has no single root, or a number is none.
    """
    root = parse_xml(urdf, source)
    try:
        colours = {element.get("name", ""): element.find("color") for element in root.iter("material") if len(element)}
        bodies = {element.get("name", ""): _body(element, colours) for element in root.findall("link")}
        joints = [_joint(element) for element in root.findall("joint")]
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
        raise DescriptionError(f"{source} is no tree: {len(order)} of its {len(bodies)} links hang on {roots[0]}")
    return RigidTree(root.get("name", ""), tuple(bodies[name] for name in order), tuple(ordered), {})


def write_rigid_tree(tree: RigidTree) -> str:
    """Write a tree as URDF text, springs as tags of ours, all numbers with full precision.

    Args:
        tree: Bodies, joints and springs.

    Returns:
        URDF text, with the hints that keep links and springs in MuJoCo and Gazebo's parser. A joint without finite limits
        becomes continuous if it turns.
    """
    ElementTree.register_namespace("softrobots", NAMESPACE)
    robot = ElementTree.Element("robot", {"name": tree.name or "robot"})
    ElementTree.SubElement(
        ElementTree.SubElement(robot, "mujoco"), "compiler", {"discardvisual": "false", "fusestatic": "false"}
    )
    for body in tree.bodies:
        link = ElementTree.SubElement(robot, "link", {"name": body.name})
        if body.mass > 0.0:
            inertial = ElementTree.SubElement(link, "inertial")
            _write_placement(inertial, body.centre)
            ElementTree.SubElement(inertial, "mass", {"value": repr(float(body.mass))})
            entries = {
                f"i{a}{b}": body.inertia["xyz".index(a), "xyz".index(b)] for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
            }
            ElementTree.SubElement(inertial, "inertia", {name: repr(float(value)) for name, value in entries.items()})
        for kind, shapes in (("visual", body.visuals), ("collision", body.collisions)):
            for shape in shapes:
                _write_shape(ElementTree.SubElement(link, kind), shape)
    for joint in tree.joints:
        _write_joint(ElementTree.SubElement(robot, "joint", {"name": joint.name}), joint, tree.springs.get(joint.name))
    for name, spring in tree.springs.items():
        _write_hints(robot, name, springStiffness=repr(float(spring.stiffness)), springReference=repr(float(spring.rest)))
    for joint in tree.joints:
        if joint.child == (tree.tip or "tip") and joint.kind == "fixed":
            _write_hints(robot, joint.name, preserveFixedJoint="true")
    if tree.tip is not None:
        ElementTree.SubElement(robot, f"{{{NAMESPACE}}}tip", {"link": tree.tip})
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode") + "\n"


def _numbers(element: ElementTree.Element | None, attribute: str, default: str) -> FloatArray:
    """Numbers of an attribute, as many as the default has."""
    text = default if element is None else element.get(attribute, default)
    numbers = [float(part) for part in text.split()]
    if len(numbers) != len(default.split()):
        raise ValueError(f"{attribute} = {text!r}; {len(default.split())} numbers are required")
    return np.array(numbers)


def _placement(element: ElementTree.Element) -> Placement:
    origin = element.find("origin")
    rpy = _numbers(origin, "rpy", "0 0 0")
    return Placement(read_only(_numbers(origin, "xyz", "0 0 0")), read_only(np.asarray(pin.rpy.rpyToMatrix(*rpy))))


_Colours = Mapping[str, ElementTree.Element | None]  # by name of the material


def _body(link: ElementTree.Element, colours: _Colours) -> Body:
    inertial = link.find("inertial")
    shapes = {kind: tuple(_shape(element, colours) for element in link.findall(kind)) for kind in ("visual", "collision")}
    name = link.get("name", "")
    if inertial is None:
        return Body(name, 0.0, Placement(), np.zeros((3, 3)), shapes["visual"], shapes["collision"])
    moments = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (_numbers(moments, f"i{axes}", "0")[0] for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    inertia = read_only(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    mass = float(_numbers(inertial.find("mass"), "value", "0")[0])
    return Body(name, mass, _placement(inertial), inertia, shapes["visual"], shapes["collision"])


def _shape(element: ElementTree.Element, colours: _Colours) -> Shape:
    geometry = element.find("geometry")
    found = next(iter(geometry)) if geometry is not None and len(geometry) else None
    if found is None or found.tag not in _SIZES:
        raise ValueError(f"a shape {found.tag if found is not None else '(none)'}; one of {', '.join(_SIZES)} is required")
    if found.tag == "mesh":
        size = _numbers(found, "scale", "1 1 1")
    else:
        size = np.concatenate([_numbers(found, name, "1 1 1" if name == "size" else "1") for name in _SIZES[found.tag]])
    material, colour = element.find("material"), element.find("material/color")
    if material is not None and colour is None:
        colour = colours.get(material.get("name", ""))
    rgba = None if colour is None else tuple(_numbers(colour, "rgba", "1 1 1 1").tolist())
    return Shape(found.tag, tuple(size.tolist()), _placement(element), rgba, found.get("filename", ""))


def _joint(element: ElementTree.Element) -> Joint:
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
        _link_of(element, "parent"),
        _link_of(element, "child"),
        _placement(element),
        read_only(axis / length if length > 0.0 else axis),
        (low, high),
        float(_numbers(limit, "effort", "inf")[0]),
        float(_numbers(limit, "velocity", "inf")[0]),
        float(_numbers(dynamics, "damping", "0")[0]),
    )


def _link_of(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def number_text(values: Iterable[float]) -> str:
    """Numbers separated by spaces, so that reading them gives the same numbers back."""
    return " ".join(repr(float(value) + 0.0) for value in values)  # without -0.0


def _write_placement(element: ElementTree.Element, placement: Placement) -> None:
    ElementTree.SubElement(element, "origin", {"xyz": number_text(placement.position), "rpy": number_text(placement.rpy)})


def _write_shape(element: ElementTree.Element, shape: Shape) -> None:
    _write_placement(element, shape.placement)
    made = ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape.kind)
    if shape.kind == "mesh":
        made.set("filename", shape.filename)
        made.set("scale", number_text(shape.size))
    elif shape.kind == "box":
        made.set("size", number_text(shape.size))
    else:
        for name, value in zip(_SIZES[shape.kind], shape.size, strict=True):
            made.set(name, repr(float(value)))
    if shape.rgba is not None:
        name = "colour_" + "_".join(f"{value:.6g}" for value in shape.rgba)
        material = ElementTree.SubElement(element, "material", {"name": name})
        ElementTree.SubElement(material, "color", {"rgba": number_text(shape.rgba)})


def _write_hints(robot: ElementTree.Element, joint: str, **hints: str) -> None:
    """Tell Gazebo's parser about a joint."""
    element = ElementTree.SubElement(robot, "gazebo", {"reference": joint})
    for name, value in hints.items():
        ElementTree.SubElement(element, name).text = value


def _write_joint(element: ElementTree.Element, joint: Joint, spring: SpringTag | None) -> None:
    bounded = bool(np.any(np.isfinite(joint.limits)))  # one without a bound on one side gets a very large one
    element.set("type", "continuous" if joint.kind == "revolute" and not bounded else joint.kind)
    _write_placement(element, joint.placement)
    ElementTree.SubElement(element, "parent", {"link": joint.parent})
    ElementTree.SubElement(element, "child", {"link": joint.child})
    if not joint.movable:
        return
    ElementTree.SubElement(element, "axis", {"xyz": number_text(joint.axis)})
    limit = {"effort": repr(min(joint.effort, LARGEST)), "velocity": repr(min(joint.velocity, LARGEST))}
    if bounded or joint.kind == "prismatic":  # URDF has no prismatic joint without limits
        low, high = np.clip(joint.limits, -LARGEST, LARGEST)
        limit |= {"lower": repr(float(low)), "upper": repr(float(high))}
    ElementTree.SubElement(element, "limit", limit)
    ElementTree.SubElement(element, "dynamics", {"damping": repr(float(joint.damping)), "friction": "0.0"})
    ElementTree.SubElement(element, f"{{{NAMESPACE}}}role", {"value": "spring" if spring else "motor"})
    if spring:
        numbers = {"stiffness": repr(float(spring.stiffness)), "rest": repr(float(spring.rest))}
        ElementTree.SubElement(element, f"{{{NAMESPACE}}}spring", numbers)
