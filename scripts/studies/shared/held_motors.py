"""Motors that stand: a URDF in which they are fixed joints at given angles."""

from __future__ import annotations

from collections.abc import Mapping
from xml.dom import minidom

from softrobots.description.rigid_tree import number_text
from softrobots.description.rigid_tree_urdf import read_rigid_tree


def with_motors_held(urdf: str, angles: Mapping[str, float]) -> str:
    """Return a URDF in which motors are fixed with their links at angles, by joint name [rad]."""
    document, tree = minidom.parseString(urdf.encode("utf-8")), read_rigid_tree(urdf)
    for joint in tree.joints:
        if joint.name not in angles:
            continue
        (element,) = (one for one in document.getElementsByTagName("joint") if one.getAttribute("name") == joint.name)
        element.setAttribute("type", "fixed")
        for inner in [one for one in element.childNodes if one.nodeName not in ("parent", "child")]:
            element.removeChild(inner)
        placed = joint.placement_at(angles[joint.name])
        origin = element.appendChild(document.createElement("origin"))
        origin.setAttribute("xyz", number_text(placed.position))
        origin.setAttribute("rpy", number_text(placed.rpy))
    return str(document.toxml())
