"""Parts of SDF: poses, numbers, geometries and colours."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from urllib.parse import quote

import numpy as np

from softrobots.description.rigid_tree import Placement, Shape, number_text

DRAKE = "http://drake.mit.edu"
"""XML namespace of Drake's tags."""

WORLD = "world"
"""Name of the world in SDF."""


def write_geometry(element: ElementTree.Element, shape: Shape, file: Path | None, *, convex: bool = False) -> None:
    """Write a shape; `file` is that of a mesh, which Drake shall take for convex or not."""
    geometry = ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape.kind)
    if file is not None:
        ElementTree.SubElement(geometry, "uri").text = file.as_uri() if file.is_absolute() else quote(file.as_posix())
        ElementTree.SubElement(geometry, "scale").text = number_text(shape.size)
        if convex:
            ElementTree.SubElement(geometry, f"{{{DRAKE}}}declare_convex")
    elif shape.kind == "box":
        ElementTree.SubElement(geometry, "size").text = number_text(shape.size)
    elif shape.kind == "plane":
        ElementTree.SubElement(geometry, "normal").text = "0.0 0.0 1.0"
        ElementTree.SubElement(geometry, "size").text = "10.0 10.0"  # of the picture
    else:
        for name, value in zip(("radius", "length"), shape.size, strict=False):
            write_number(geometry, name, value)


def write_colour(element: ElementTree.Element, rgba: tuple[float, ...]) -> None:
    """Write red, green, blue and opacity of a visual."""
    material = ElementTree.SubElement(element, "material")
    for name in ("ambient", "diffuse"):
        ElementTree.SubElement(material, name).text = number_text(rgba)


def write_pose(element: ElementTree.Element, placement: Placement, relative_to: str = "") -> None:
    """Write a pose relative to the frame of a body, or to what surrounds the element; left out if it is none."""
    relative_to = "" if relative_to == WORLD else relative_to
    if not relative_to and not np.any(placement.position) and np.array_equal(placement.rotation, np.eye(3)):
        return
    w, x, y, z = placement.quaternion
    attributes = {"relative_to": relative_to} if relative_to else {}
    pose = ElementTree.SubElement(element, "pose", attributes | {"rotation_format": "quat_xyzw"})
    pose.text = number_text([*placement.position, x, y, z, w])


def write_number(element: ElementTree.Element, name: str, value: float) -> None:
    """Write a number with all digits."""
    ElementTree.SubElement(element, name).text = repr(float(value))
