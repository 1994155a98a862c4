"""Prefixes for all names in a robot description, so that two descriptions fit into one.

Names of links, joints, materials, sections, actuators and lines are prefixed where they are defined and referred to: in
`parent`, `child` and `mimic`, in the tags of this package, as the reference of a `gazebo` tag, and in tags outside URDF
(transmissions, plugins, collision filters), where an attribute or text that equals a name counts as that name.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.dom import minidom

from softrobots.description.urdf_tags import COORDINATES, NAMESPACE

_NAMED_BY_US = ("section", "lumped_section", "actuator", "muscle", "line")
_LISTS = ("name", "springs", "joints", "link", *COORDINATES)  # attributes of our tags that hold names, one or several
_NO_NAMES = ("type", "value", "filename")  # attributes of foreign tags that hold none


def children(element: minidom.Element | minidom.Document) -> list[minidom.Element]:
    """Return the child elements of an element, or the root of a document."""
    return [node for node in element.childNodes if node.nodeType == node.ELEMENT_NODE]


def package_tags(robot: minidom.Element, name: str = "*") -> list[minidom.Element]:
    """Return the tags of this package directly inside a description, all or those of one name."""
    tags = [element for element in children(robot) if element.namespaceURI == NAMESPACE]
    return [element for element in tags if name in ("*", element.localName)]


def used_names(robot: minidom.Element) -> dict[str, dict[str, str]]:
    """Return the names that must be unique in a description, by kind; each with its tag, or a material's colour.

    Kinds are "link or joint", "material", "section", "muscle or line", and the tags of other elements that have a name.
    """
    names: dict[str, dict[str, str]] = {"link or joint": {}, "material": {}, "section": {}, "muscle or line": {}}
    for element in children(robot):
        if element.namespaceURI == NAMESPACE or not element.hasAttribute("name"):
            continue
        kind = "link or joint" if element.tagName in ("link", "joint") else element.tagName
        names.setdefault(kind, {})[element.getAttribute("name")] = element.tagName
    for material in robot.getElementsByTagName("material"):
        inside = " ".join(child.toxml() for child in children(material))
        if material.getAttribute("name") and (inside or material.getAttribute("name") not in names["material"]):
            names["material"][material.getAttribute("name")] = " ".join(inside.split())
    for tag in _NAMED_BY_US:
        kind = "section" if tag.endswith("section") else "muscle or line"
        names[kind] |= {element.getAttribute("name"): tag for element in package_tags(robot, tag)}
    return names


def prefix_names(robot: minidom.Element, prefix: str) -> None:
    """Put a prefix before every name in the root element of a description, in place."""
    known = {name for names in used_names(robot).values() for name in names}
    known |= {element.getAttribute("name") for element in robot.getElementsByTagName("actuator")} - {""}
    for element in package_tags(robot):
        for attribute in _LISTS:
            if element.hasAttribute(attribute):
                names = (prefix + name for name in element.getAttribute(attribute).split())
                element.setAttribute(attribute, " ".join(names))
    for element in children(robot):
        if element.namespaceURI == NAMESPACE:
            continue
        if element.tagName in ("link", "joint", "material"):
            for inner in (element, *_plain(element)):
                _prefix_urdf(inner, prefix)
        else:
            for inner in (element, *_plain(element)):
                _prefix_foreign(inner, prefix, known)


def shift_segments(robot: minidom.Element, shift: int) -> None:
    """Add `shift` to the number of every segment of a description, in place."""
    for tag in (*_NAMED_BY_US, "friction"):
        for element in package_tags(robot, tag):
            for placed in package_tags(element, "route") if tag == "actuator" else [element]:
                placed.setAttribute("segment", str(int(placed.getAttribute("segment")) + shift))


def _plain(element: minidom.Element) -> Iterator[minidom.Element]:
    """Elements anywhere inside, without those of this package."""
    return (inner for inner in element.getElementsByTagName("*") if inner.namespaceURI != NAMESPACE)


def _prefix_urdf(element: minidom.Element, prefix: str) -> None:
    attribute = {"parent": "link", "child": "link", "mimic": "joint"}.get(element.tagName, "name")
    if element.tagName in ("link", "joint", "material", "visual", "collision", "parent", "child", "mimic") and (
        element.getAttribute(attribute)
    ):
        element.setAttribute(attribute, prefix + element.getAttribute(attribute))


def _prefix_foreign(element: minidom.Element, prefix: str, known: set[str]) -> None:
    for attribute, value in list(element.attributes.items()):
        if value in known and attribute not in _NO_NAMES:
            element.setAttribute(attribute, prefix + value)
    only = element.firstChild if len(element.childNodes) == 1 else None
    if only is not None and only.nodeType == only.TEXT_NODE and only.data.strip() in known:
        only.data = prefix + only.data.strip()
