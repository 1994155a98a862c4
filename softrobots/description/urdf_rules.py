"""Rules for URDF files that all tools load alike, one function each, with the consequence of a violation.

The rules come from loading 91 variants of a file in 18 tools.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from softrobots.description.collision_shapes import overlapping_shapes
from softrobots.description.rigid_tree import SOLIDS
from softrobots.description.rigid_tree_urdf import link_at
from softrobots.description.urdf_document import Problems, UrdfDocument, name_of, number_of, numbers_of, tag_of
from softrobots.description.urdf_tags import NAMESPACE

LIGHTEST = 1e-6
"""Mass that links must exceed [kg]; at this mass Gazebo's parser drops a link and its whole subtree."""
SMALLEST_INERTIA = 1e-15
"""Moment that principal moments of inertia must exceed [kg m^2]; MuJoCo refuses smaller ones."""

_ROUNDING = 1e-12  # relative; of lengths and eigenvalues of numbers with all digits


class Finding(NamedTuple):
    """Result of a rule or another check."""

    what: str
    """Subject of the check."""
    problems: tuple[str, ...] = ()
    """Violations."""
    remarks: tuple[str, ...] = ()
    """Facts, and violations by a third-party robot that carries one of this package."""

    @property
    def ok(self) -> bool:
        """Whether there are no violations."""
        return not self.problems


def check_rules(urdf: str, source: str = "the URDF") -> tuple[Finding, ...]:
    """Return a finding for each of `RULES`.

    Where a robot of this package is mounted on another one, violations by the other robot are remarks.

    Raises:
        DescriptionError: If the text is not XML, or its root tag is not `<robot>`.
    """
    document = UrdfDocument(urdf, source)
    foreign = document.foreign()
    findings = []
    for what, rule in RULES.items():
        broken = list(rule(document))
        problems = tuple(text for subject, text in broken if subject not in foreign)
        remarks = tuple(f"{text} (third-party)" for subject, text in broken if subject in foreign)
        findings.append(Finding(what, problems, remarks))
    return tuple(findings)


def _names(document: UrdfDocument) -> Problems:
    """Undeclared prefixes, a version, duplicate names: each refused by several tools."""
    root = document.root
    if not root.get("name"):
        yield "", "<robot> has no name"
    if root.get("version") is not None:
        yield "", f'<robot> has version="{root.get("version")}"; leave it out'
    if document.declares_namespaces_inside():
        yield "", "a namespace is declared below <robot>; declare it there"
    names = Counter(name_of(element) for kind in ("link", "joint") for element in root.findall(kind))
    for name, count in names.items():
        if count > 1:
            yield name, f"the name {name!r} is used {count} times"
        if not re.fullmatch(r"[A-Za-z0-9_.-]+", name):
            yield name, f"the name {name!r} is not of ASCII letters, digits, _, - and ."


def _root_link(document: UrdfDocument) -> Problems:
    """Another root: Gazebo's parser fails, other tools warn, or the base floats."""
    roots = [name for name in document.links if name not in document.carrier]
    if roots != ["world"]:
        yield roots[0] if roots else "", f"the root is {', '.join(roots) or '(none)'}; a link world without mass is required"
        return
    if document.links["world"].find("inertial") is not None:
        yield "world", "the link world has a mass"
    below = [joint for joint in document.joints.values() if link_at(joint, "parent") == "world"]
    if len(below) != 1 or below[0].get("type") != "fixed":
        yield "world", f"world carries {', '.join(map(name_of, below)) or 'nothing'}; one fixed joint is required"


def _masses(document: UrdfDocument) -> Problems:
    """Light links: refused by MuJoCo, dropped with their subtree by Gazebo's parser, 1 kg in PyBullet."""
    for name, link in document.links.items():
        if name not in document.carrier:
            continue
        inertial = link.find("inertial")
        if inertial is None:
            yield name, f"link {name} has no mass and inertia"
            continue
        mass = number_of(inertial.find("mass"), "value")
        if not LIGHTEST < mass < math.inf:
            yield name, f"link {name} has the mass {mass} kg; more than {LIGHTEST} kg is required"
        moments = _principal_moments(inertial.find("inertia"))
        if not moments[0] > SMALLEST_INERTIA:
            yield name, f"link {name} has the moment of inertia {moments[0]} kg m^2; above {SMALLEST_INERTIA} is required"
        elif moments[0] + moments[1] < moments[2] * (1.0 - _ROUNDING):
            yield name, f"link {name} has the moments of inertia {moments} kg m^2; one is above the sum of the others"


def _joints(document: UrdfDocument) -> Problems:
    """Missing limit or effort: refused by Pinocchio and others; continuous joints have two coordinates in Pinocchio."""
    for name, joint in document.moving.items():
        if joint.get("type") not in ("revolute", "prismatic"):
            yield name, f"joint {name} is {joint.get('type') or 'of no type'}; revolute, prismatic or fixed is required"
            continue
        limit = {key: number_of(joint.find("limit"), key) for key in ("lower", "upper", "effort", "velocity")}
        absent = [key for key, value in limit.items() if not math.isfinite(value)]
        if absent:
            yield name, f"joint {name} has no finite {', '.join(absent)}"
        elif not (limit["lower"] < limit["upper"] and limit["effort"] > 0.0 and limit["velocity"] > 0.0):
            yield name, f"joint {name} has the limits {limit}; lower < upper, effort > 0 and velocity > 0 are required"
        axis = numbers_of(joint.find("axis"), "xyz")
        if len(axis) != 3 or not abs(math.hypot(*axis) - 1.0) <= _ROUNDING:
            yield name, f"joint {name} has the axis {axis}; a unit vector is required"
        dynamics = joint.find("dynamics")
        if not number_of(dynamics, "damping") >= 0.0 or number_of(dynamics, "friction") != 0.0:
            yield name, f"joint {name} has no <dynamics> with a damping of 0 or more and friction 0"


def _mimics(document: UrdfDocument) -> Problems:
    """A mimic of a mimic is misread by yourdfpy and urchin; Pinocchio refuses one of a joint off its path to the root."""
    mimics = {name: mimic for name, joint in document.moving.items() for mimic in joint.findall("mimic")}
    for name, mimic in mimics.items():
        master = mimic.get("joint", "")
        if master not in document.moving or master in mimics:
            yield name, f"joint {name} mimics {master!r}; a movable joint that mimics none is required"
        elif master not in document.way_to_root(link_at(document.joints[name], "parent")):
            yield name, f"joint {name} mimics {master}, which is not on its path to the root"


def _shapes(document: UrdfDocument) -> Problems:
    """Capsules and empty shapes are refused by many tools; no path of a mesh works in all."""
    for name, link in document.links.items():
        for element in (*link.findall("visual"), *link.findall("collision")):
            geometry = element.find("geometry")
            shapes = [] if geometry is None else list(geometry)
            if len(shapes) != 1 or shapes[0].tag not in SOLIDS:
                tags = ", ".join(str(shape.tag) for shape in shapes) or "nothing"
                yield name, f"a {element.tag} of link {name} is {tags}; one of {', '.join(SOLIDS)} is required"
                continue
            sizes = numbers_of(shapes[0], *SOLIDS[shapes[0].tag])
            if not sizes or not all(0.0 < size < math.inf for size in sizes):
                yield name, f"a {element.tag} of link {name} is a {shapes[0].tag} of the sizes {sizes}; positive is required"


def _colours(document: UrdfDocument) -> Problems:
    """A material name with two colours or none: refused by Drake."""
    seen: dict[str, str] = {}
    for link in document.links.values():
        for material in link.iter("material"):
            name, colour = name_of(material), material.find("color")
            rgba = "" if colour is None else colour.get("rgba", "")
            if not name or not rgba:
                yield name_of(link), f"a material {name!r} of link {name_of(link)}; a name and a <color> inside are required"
            elif seen.setdefault(name, rgba) != rgba:
                yield name_of(link), f"the material {name!r} has the colours {seen[name]} and {rgba}"


def _springs(document: UrdfDocument) -> Problems:
    """Roles and springs for softrobots; the copies of springs become SDF, for Drake and Gazebo."""
    if not document.has_tags:
        return
    tags = [element for element in document.root.findall("gazebo") if element.find("springStiffness") is not None]
    copies = {
        element.get("reference", ""): tuple(element.findtext(key, "") for key in ("springStiffness", "springReference"))
        for element in tags
    }
    for name, count in Counter(element.get("reference", "") for element in tags).items():
        if count > 1:
            yield name, f"joint {name} has {count} springs for Gazebo; one is required"
    for name, joint in document.moving.items():
        spring = tag_of(joint, "spring")
        if tag_of(joint, "role") is None:
            yield name, f"joint {name} has no <softrobots:role>"
        original = None if spring is None else (spring.get("stiffness", ""), spring.get("rest", ""))
        if copies.get(name) != original:
            yield name, f"joint {name} has the spring {original} and the copy {copies.get(name)} for Gazebo"
    for name in copies.keys() - document.moving.keys():
        yield name, f"a spring for Gazebo on {name}, which does not move"


def _hints(document: UrdfDocument) -> Problems:
    """Without these hints MuJoCo drops base and tip, and Gazebo's parser the tip."""
    if not document.has_tags:
        return
    compiler = document.root.find("mujoco/compiler")
    for key in ("fusestatic", "discardvisual"):
        if compiler is None or compiler.get(key) != "false":
            yield "", f'<mujoco><compiler {key}="false"/></mujoco> is missing'
    named = tag_of(document.root, "tip")
    tip = "tip" if named is None else named.get("link", "")
    carrier = document.carrier.get(tip)
    hints = document.root.findall("gazebo")
    preserved = [hint.get("reference") for hint in hints if hint.findtext("preserveFixedJoint", "").strip() == "true"]
    if carrier is None:
        yield "", f"there is no link {tip}"
    elif carrier.get("type") == "fixed" and name_of(carrier) not in preserved:
        yield tip, f'<gazebo reference="{name_of(carrier)}"> with <preserveFixedJoint>true</preserveFixedJoint> is missing'


def _order_of_hinges(document: UrdfDocument) -> Problems:
    """Two orthogonal springs twist by half the product of their angles; as many in the other order cancel that."""
    first = Counter[bool]()
    for section in document.root.findall(f"{{{NAMESPACE}}}lumped_section"):
        x, y = section.get("bend_x", ""), section.get("bend_y", "")
        if x in document.joints and y in document.joints:
            first[x in document.way_to_root(link_at(document.joints[y], "parent"))] += 1
    if abs(first[True] - first[False]) > 1:
        counts = f"{first[True]} sections bend about x first, {first[False]} about y"
        yield "", f"{counts}; both orders must be as frequent, or the chain converges at first order only"


RULES: Mapping[str, Callable[[UrdfDocument], Problems]] = {
    "names and namespaces": _names,
    "root link world, fixed base": _root_link,
    "mass and inertia of every link": _masses,
    "type, limits, axis and dynamics of every joint": _joints,
    "mimicking joints": _mimics,
    "shapes": _shapes,
    "colours": _colours,
    "collision shapes across small links": overlapping_shapes,
    "roles, springs and their copies": _springs,
    "hints for MuJoCo and Gazebo": _hints,
    "order of the hinges": _order_of_hinges,
}
"""Every rule by its subject."""


def _principal_moments(inertia: ElementTree.Element | None) -> list[float]:
    """Principal moments, smallest first; NaN if an entry is missing."""
    xx, xy, xz, yy, yz, zz = (number_of(inertia, f"i{axes}") for axes in ("xx", "xy", "xz", "yy", "yz", "zz"))
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments: list[float] = np.linalg.eigvalsh(matrix).tolist() if np.all(np.isfinite(matrix)) else [math.nan] * 3
    return moments
