"""Checks of a URDF before Pinocchio reads it: a tree of named links with well-formed numbers.

Pinocchio's parser silently misreads what these checks refuse. Measured: it drops a mass of `1,5`, `nan` or an empty one, links
that carry each other in a circle, and a joint called `universe`; of a link with two parents it keeps one; it accepts negative
masses; and a chain of 4000 links ends the process.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable, Mapping

from softrobots.core.checks import LARGEST
from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import number_in, parse_xml

MOST_LINKS = 2000
"""Most links of a robot; Pinocchio's parser recurses and has about 2 kB of stack for each of so many in one chain."""

_ORIGIN = {"xyz": 3, "rpy": 3}
_OF_LINKS: Mapping[str, Mapping[str, int]] = {
    "origin": _ORIGIN,
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
}
_OF_JOINTS: Mapping[str, Mapping[str, int]] = {
    "origin": _ORIGIN,
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
}
_OF_SHAPES: Mapping[str, Mapping[str, int]] = {
    "origin": _ORIGIN,
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 0},  # of any length: some files have four numbers, which is harmless
}
_PLAIN = r"[+-]?\d{1,20}(?:\.\d{0,40})?(?:[eE](?:-\d{1,3}|\+?\d))?"  # at most 1e30 in size
_ROWS = {count: re.compile(rf"{_PLAIN}(?: {_PLAIN}){{{count - 1}}}", re.ASCII) for count in (1, 3)}
"""Nearly all rows of numbers, which need no closer look."""
_RESERVED = "universe"  # Pinocchio's name of the world


def urdf_root(urdf: str, source: str) -> ElementTree.Element:
    """Parse URDF text.

    Raises:
        DescriptionError: If the text is not XML, or its root tag is not `<robot>`.
    """
    root = parse_xml(urdf, source)
    if root.tag != "robot":
        raise DescriptionError(f"{source} has the root tag <{root.tag}>; <robot> is required")
    return root


def check_structure(root: ElementTree.Element, source: str) -> None:
    """Refuse a URDF that is no tree, or has names or numbers that parsers misread.

    Raises:
        DescriptionError: If it has no links or more than `MOST_LINKS`; if a link or joint has no name or that of another, or a
            joint is called `universe`; if a joint has not one existing parent and child; if the links are no tree; if a number
            is malformed or beyond 1e30; if a mass is negative, or the axis of a joint is zero.
    """
    check_link_count(root, source)
    links, joints = root.findall("link"), root.findall("joint")
    if not links:
        raise DescriptionError(f"{source} has no links; from 1 to {MOST_LINKS} are required")
    for kind, elements in (("link", links), ("joint", joints)):
        _check_names(kind, elements, source)
    known: dict[int, set[str]] = {0: set(), 1: set(), 3: set()}
    for link in links:
        where = f"link {link.get('name')} of {source}"
        for inertial in link.findall("inertial"):
            _check_numbers(where, inertial, _OF_LINKS, known)
        for mass in link.findall("inertial/mass"):
            if number_in(mass.get("value")) < 0.0:
                raise DescriptionError(f"{where} has the mass {mass.get('value')}; it is negative")
        for shape in (*link.findall("visual"), *link.findall("collision")):
            _check_numbers(where, shape.iter(), _OF_SHAPES, known)
    for joint in joints:
        where = f"joint {joint.get('name')} of {source}"
        _check_numbers(where, joint, _OF_JOINTS, known)
        axis = joint.find("axis")
        moves = axis is not None and joint.get("type") != "fixed" and "xyz" in axis.attrib
        if axis is not None and moves and math.hypot(*map(float, axis.get("xyz", "").split())) < 1.0 / LARGEST:
            raise DescriptionError(f"{where} has the axis {axis.get('xyz')}, which has no direction")
    _check_tree({link.get("name", "") for link in links}, joints, source)


def check_link_count(root: ElementTree.Element, source: str) -> None:
    """Refuse more links than Pinocchio's parser survives.

    Raises:
        DescriptionError: If there are more than `MOST_LINKS`.
    """
    count = sum(1 for _ in root.iter("link"))
    if count > MOST_LINKS:
        raise DescriptionError(f"{source} has {count} links; at most {MOST_LINKS} are read")


def _check_names(kind: str, elements: Iterable[ElementTree.Element], source: str) -> None:
    names = Counter(element.get("name", "") for element in elements)
    for name, count in names.items():
        if count > 1 or not name:
            raise DescriptionError(f"{source} has a {kind} without a name, or several that are called {name!r}")
    if kind == "joint" and _RESERVED in names:
        raise DescriptionError(f"{source} has a joint called {_RESERVED!r}, Pinocchio's name of the world; rename it")


def _check_numbers(
    where: str,
    elements: Iterable[ElementTree.Element],
    table: Mapping[str, Mapping[str, int]],
    known: Mapping[int, set[str]],
) -> None:
    """Check the attributes in a table; `known` are the rows found good so far, by how many numbers they have."""
    for element in elements:
        for attribute, count in table.get(element.tag, {}).items():
            text = element.get(attribute)
            if text is None or text in known[count]:
                continue
            if count and _ROWS[count].fullmatch(text):
                known[count].add(text)
                continue
            parts, most = text.split(), math.inf if element.tag == "limit" else LARGEST  # very large limits mean none
            if (count and len(parts) != count) or any(math.isnan(number_in(part, most)) for part in parts):
                numbers = "a number" if count == 1 else f"{count or 3} numbers"
                size = "" if most == math.inf else f" up to {most:g} in size"
                raise DescriptionError(
                    f"{where} has {attribute} = {text[:100]!r} in <{element.tag}>; {numbers}{size} "
                    f"{'is' if count == 1 else 'are'} required"
                )


def _check_tree(links: set[str], joints: Iterable[ElementTree.Element], source: str) -> None:
    below: dict[str, list[str]] = {name: [] for name in links}
    carried: dict[str, str] = {}
    for joint in joints:
        name = joint.get("name", "")
        ends = {end: [element.get("link", "") for element in joint.findall(end)] for end in ("parent", "child")}
        for end, named in ends.items():
            if len(named) != 1 or named[0] not in links:
                raise DescriptionError(
                    f"joint {name} of {source} has the {end} {', '.join(named) or '(none)'}; one link that exists is required"
                )
        (parent,), (child,) = ends["parent"], ends["child"]
        if child in carried:
            raise DescriptionError(f"link {child} of {source} hangs on two joints, {carried[child]} and {name}")
        carried[child] = name
        below[parent].append(child)
    roots = sorted(links - carried.keys())
    if len(roots) != 1:
        listed = ", ".join(roots[:5]) + (", ..." if len(roots) > 5 else "")
        raise DescriptionError(
            f"{source} has {len(roots)} root links ({listed or 'none'}), which are no joint's child; one is required"
        )
    order = list(roots)
    for name in order:
        order += below[name]
    if len(order) != len(links):
        lost = sorted(links - set(order))[:5]
        raise DescriptionError(f"{source} has links that carry each other in a circle: {', '.join(lost)}")
