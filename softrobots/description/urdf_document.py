"""A URDF file as its rules look at it: links and joints by name, the way to the root, and what is not ours in it."""

from __future__ import annotations

import io
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import parse_xml
from softrobots.description.rigid_tree_urdf import link_at
from softrobots.description.urdf_tags import NAMESPACE

Problems = Iterator[tuple[str, str]]
"""What breaks a rule: the link or joint (empty: the whole file), and what is wrong with it."""


class UrdfDocument:
    """A parsed URDF file.

    Args:
        urdf: The whole document.
        source: Where it comes from, for errors.

    Raises:
        DescriptionError: If the text is not XML, or its root tag is not `<robot>`.
    """

    def __init__(self, urdf: str, source: str = "the URDF") -> None:
        self.text = urdf
        """The whole document."""
        self.root = parse_xml(urdf, source)
        """Its root element."""
        if self.root.tag != "robot":
            raise DescriptionError(f"{source} has the root tag <{self.root.tag}>; <robot> is required")
        self.links = {name_of(link): link for link in self.root.findall("link")}
        """Links by name."""
        self.joints = {name_of(joint): joint for joint in self.root.findall("joint")}
        """Joints by name."""
        self.moving = {name: joint for name, joint in self.joints.items() if joint.get("type") != "fixed"}
        """Joints that are not fixed, by name."""
        self.carrier = {link_at(joint, "child"): joint for joint in self.joints.values()}
        """The joint that carries a link, by the name of the link."""
        self.has_tags = any(str(element.tag).startswith(f"{{{NAMESPACE}}}") for element in self.root.iter())
        """Whether any tag of this package is in it."""

    def way_to_root(self, link: str) -> list[str]:
        """Names of the joints on the way from a link to the root, the nearest first."""
        path: list[str] = []
        while link in self.carrier and len(path) <= len(self.carrier):
            path.append(name_of(self.carrier[link]))
            link = link_at(self.carrier[link], "parent")
        return path

    def foreign(self) -> frozenset[str]:
        """Names of links and joints of another robot, on which one of this package is mounted.

        They are those that stand before the first joint with a role of ours, in a file where joints without a role move there.
        """
        with_role = {name for name, joint in self.moving.items() if tag_of(joint, "role") is not None}
        ways = {name: [name, *self.way_to_root(link_at(joint, "parent"))] for name, joint in self.joints.items()}
        before = {name for name, way in ways.items() if with_role.isdisjoint(way)}
        if not with_role or before.isdisjoint(self.moving):
            return frozenset()
        links = (link for link in self.links if link not in self.carrier or name_of(self.carrier[link]) in before)
        return frozenset([*before, *links])

    def declares_namespaces_inside(self) -> bool:
        """Whether a namespace is declared below the root element."""
        inside = False
        for event, _ in ElementTree.iterparse(io.StringIO(self.text), events=("start", "start-ns")):
            if event == "start-ns" and inside:
                return True
            inside = inside or event == "start"
        return False


def name_of(element: ElementTree.Element) -> str:
    """The name of an element; empty if it has none."""
    return element.get("name", "")


def tag_of(element: ElementTree.Element, name: str) -> ElementTree.Element | None:
    """The first tag of this package of that name inside an element, or None."""
    return element.find(f"{{{NAMESPACE}}}{name}")


def numbers_of(element: ElementTree.Element | None, *attributes: str) -> list[float]:
    """Numbers of attributes, one after the other; none if one is missing or holds something else."""
    try:
        texts: Sequence[str] = [] if element is None else [element.attrib[name] for name in attributes]
        return [float(part) for text in texts for part in text.split()]
    except (KeyError, ValueError):
        return []


def number_of(element: ElementTree.Element | None, attribute: str) -> float:
    """The number of an attribute; nan if there is none."""
    values = numbers_of(element, attribute)
    return values[0] if len(values) == 1 else math.nan
