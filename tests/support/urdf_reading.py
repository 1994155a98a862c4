"""What a URDF says, read as its specification says; rules that every tool can load; and changes of it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from softrobots.description.urdf_tags import NAMESPACE

TENSOR = ("xx", "xy", "xz", "yy", "yz", "zz")


def numbers(text: str | None) -> np.ndarray:
    return np.array((text or "0 0 0").split(), dtype=np.float64)


def link_poses(root: ElementTree.Element, values: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Forward kinematics of a URDF as its specification says: origin, then motion along the axis."""
    poses = {root.find("link").get("name"): np.eye(4)}
    waiting = root.findall("joint")
    while waiting:
        for joint in [joint for joint in waiting if joint.find("parent").get("link") in poses]:
            waiting.remove(joint)
            origin, axis, value = joint.find("origin"), joint.find("axis"), values.get(joint.get("name"), 0.0)
            step, motion = np.eye(4), np.eye(4)
            step[:3, 3] = numbers(origin.get("xyz"))
            step[:3, :3] = Rotation.from_euler("xyz", numbers(origin.get("rpy"))).as_matrix()
            if joint.get("type") == "revolute":
                motion[:3, :3] = Rotation.from_rotvec(value * numbers(axis.get("xyz"))).as_matrix()
            elif joint.get("type") == "prismatic":
                motion[:3, 3] = value * numbers(axis.get("xyz"))
            poses[joint.find("child").get("link")] = poses[joint.find("parent").get("link")] @ step @ motion
    return poses


Mass = tuple[float, np.ndarray, np.ndarray]  # mass [kg], centre [m], inertia tensor about it [kg m^2]


def together(bodies: Sequence[Mass]) -> Mass:
    mass = math.fsum(m for m, _, _ in bodies)
    centre = sum(m * c for m, c, _ in bodies) / mass
    tensor = sum(t + m * ((c - centre) @ (c - centre) * np.eye(3) - np.outer(c - centre, c - centre)) for m, c, t in bodies)
    return mass, centre, tensor


def link_masses(urdf: str, values: Mapping[str, float]) -> Mass:
    """Mass of all links but the base, from the text of the URDF."""
    root = ElementTree.fromstring(urdf)
    bodies = []
    for name, pose in link_poses(root, values).items():
        inertial = root.find(f"link[@name='{name}']/inertial")
        if name == "base_link" or inertial is None:
            continue
        xx, xy, xz, yy, yz, zz = (float(inertial.find("inertia").get(f"i{key}")) for key in TENSOR)
        place = pose @ [*numbers(inertial.find("origin").get("xyz")), 1.0]
        axes = pose[:3, :3] @ Rotation.from_euler("xyz", numbers(inertial.find("origin").get("rpy"))).as_matrix()
        tensor = axes @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ axes.T
        bodies.append((float(inertial.find("mass").get("value")), place[:3], tensor))
    return together(bodies)


def spring_numbers(root: ElementTree.Element) -> dict[str, tuple[float, float]]:
    return {
        joint.get("name"): (float(tag.get("stiffness")), float(tag.get("rest")))
        for joint in root.findall("joint")
        if (tag := joint.find(f"{{{NAMESPACE}}}spring")) is not None
    }


def gazebo_numbers(root: ElementTree.Element) -> dict[str, tuple[float, float]]:
    return {
        tag.get("reference"): (float(tag.find("springStiffness").text), float(tag.find("springReference").text))
        for tag in root.findall("gazebo")
        if tag.find("springStiffness") is not None
    }


def check_portable(urdf: str) -> set[str]:
    """Assert the rules; return the names of the movable joints."""
    root = ElementTree.fromstring(urdf)
    assert "xacro" not in root.tag + "".join(element.tag for element in root.iter())
    assert urdf.count(f'xmlns:softrobots="{NAMESPACE}"') == 1
    assert root.get("version") is None
    names = Counter(element.get("name") for element in root if element.tag in ("link", "joint"))
    assert max(names.values()) == 1
    assert all(name and name.isascii() for name in names)
    assert root.find("link").get("name") == "world"
    for body_ in root.findall("link")[1:]:
        mass = float(body_.find("inertial/mass").get("value"))
        tensor = {key: float(body_.find("inertial/inertia").get(f"i{key}")) for key in TENSOR}
        moments = sorted(np.linalg.eigvalsh([[tensor["".join(sorted(a + b))] for a in "xyz"] for b in "xyz"]))
        assert mass > 1e-6, body_.get("name")
        assert moments[0] > 1e-15
        assert moments[0] + moments[1] >= moments[2] * (1 - 1e-15)
    movable = set()
    for joint in root.findall("joint"):
        assert joint.get("type") in ("revolute", "prismatic", "fixed")
        if joint.get("type") == "fixed":
            continue
        movable.add(joint.get("name"))
        limit = {key: float(joint.find("limit").get(key)) for key in ("lower", "upper", "effort", "velocity")}
        assert np.isfinite(list(limit.values())).all()
        assert limit["lower"] < 0.0 < limit["upper"]
        assert min(limit["effort"], limit["velocity"]) > 0.0
        assert np.linalg.norm(numbers(joint.find("axis").get("xyz"))) == 1.0
        assert float(joint.find("dynamics").get("damping")) >= 0.0
        assert joint.find("dynamics").get("friction") == "0.0"
        role = joint.find(f"{{{NAMESPACE}}}role").get("value")
        assert (role == "spring") == (joint.find(f"{{{NAMESPACE}}}spring") is not None)
    colours: dict[str, str] = {}
    for material in root.iter("material"):
        rgba = material.find("color").get("rgba")
        assert colours.setdefault(material.get("name"), rgba) == rgba
    shapes = [shape for kind in ("visual", "collision") for place in root.iter(kind) for shape in place.find("geometry")]
    assert shapes
    for shape in shapes:
        assert shape.tag == "cylinder"
        assert min(float(shape.get("length")), float(shape.get("radius"))) > 0.0
    assert spring_numbers(root) == gazebo_numbers(root)
    return movable


def changed(element: str, name: str, /, **attributes: str | None) -> Callable[[ElementTree.Element], None]:
    """A change of attributes of one of our tags; None removes one."""

    def change(root: ElementTree.Element) -> None:
        tag = root.find(f"{{{NAMESPACE}}}{element}[@name='{name}']")
        for key, value in attributes.items():
            assert tag.get(key) is not None
            assert tag.get(key) != value
            if value is None:
                del tag.attrib[key]
            else:
                tag.set(key, value)

    return change


def within_joint(name: str, element: str, /, **attributes: str) -> Callable[[ElementTree.Element], None]:
    """A change inside a joint ("." is the joint itself)."""

    def change(root: ElementTree.Element) -> None:
        joint = root.find(f"joint[@name='{name}']")
        tag = joint if element == "." else joint.find(element)
        for key, value in attributes.items():
            assert tag.get(key) != value
            tag.set(key, value)

    return change


def edited(text: str, change: Callable[[ElementTree.Element], None]) -> str:
    root = ElementTree.fromstring(text)
    change(root)
    return ElementTree.tostring(root, encoding="unicode")
