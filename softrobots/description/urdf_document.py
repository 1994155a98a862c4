"""A parsed URDF file for the portability rules: links and joints by name, paths to the root, and mounted robots."""

from __future__ import annotations

import io
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence

from softrobots.description.rigid_tree_urdf import link_at
from softrobots.description.urdf_structure import urdf_root
from softrobots.description.urdf_tags import NAMESPACE

Problems = Iterator[tuple[str, str]]
"""Violations of a rule: the link or joint (empty: the whole file), and the problem."""


class UrdfDocument:
    """A parsed URDF file.

    Raises:
        DescriptionError: If the text is not XML, or its root tag is not `<robot>`.
    """

    def __init__(self, urdf: str, source: str = "the URDF") -> None:
        self.text = urdf
        """The whole document."""
        self.root = urdf_root(urdf, source)
        """Its root element."""
        self.links = {name_of(link): link for link in self.root.findall("link")}
        """Links by name."""
        self.joints = {name_of(joint): joint for joint in self.root.findall("joint")}
        """Joints by name."""
        self.moving = {name: joint for name, joint in self.joints.items() if joint.get("type") != "fixed"}
        """Joints that are not fixed, by name."""
        self.carrier = {link_at(joint, "child"): joint for joint in self.joints.values()}
        """Parent joint by the name of the link."""
        self.has_tags = any(str(element.tag).startswith(f"{{{NAMESPACE}}}") for element in self.root.iter())
        """Whether it has tags of this package."""

    def way_to_root(self, link: str) -> list[str]:
        """Return the names of the joints on the path from a link to the root, the nearest first."""
        path: list[str] = []
        while link in self.carrier and len(path) <= len(self.carrier):
            path.append(name_of(self.carrier[link]))
            link = link_at(self.carrier[link], "parent")
        return path

    def foreign(self) -> frozenset[str]:
        """Return the names of links and joints of another robot that carries one of this package.

        These come before the first joint with a role tag, in a file with movable joints without a role there.
        """
        with_role = {name for name, joint in self.moving.items() if tag_of(joint, "role") is not None}
        ways = {name: [name, *self.way_to_root(link_at(joint, "parent"))] for name, joint in self.joints.items()}
        before = {name for name, way in ways.items() if with_role.isdisjoint(way)}
        if not with_role or before.isdisjoint(self.moving):
            return frozenset()
        links = (link for link in self.links if link not in self.carrier or name_of(self.carrier[link]) in before)
        return frozenset([*before, *links])

    def declares_namespaces_inside(self) -> bool:
        """Return whether a namespace is declared below the root element."""
        inside = False
        for event, _ in ElementTree.iterparse(io.StringIO(self.text), events=("start", "start-ns")):
            if event == "start-ns" and inside:
                return True
            inside = inside or event == "start"
        return False


def name_of(element: ElementTree.Element) -> str:
    """Return the name of an element; empty if it has none."""
    return element.get("name", "")


def tag_of(element: ElementTree.Element, name: str) -> ElementTree.Element | None:
    """Return the first tag of this package of that name inside an element, or None."""
    return element.find(f"{{{NAMESPACE}}}{name}")


def numbers_of(element: ElementTree.Element | None, *attributes: str) -> list[float]:
    """Return the numbers of attributes in a row; an empty list if one is missing or malformed."""
    try:
        texts: Sequence[str] = [] if element is None else [element.attrib[name] for name in attributes]
        return [float(part) for text in texts for part in text.split()]
    except (KeyError, ValueError):
        return []


def number_of(element: ElementTree.Element | None, attribute: str) -> float:
    """Return the number of an attribute; NaN if there is not exactly one."""
    values = numbers_of(element, attribute)
    return values[0] if len(values) == 1 else math.nan
