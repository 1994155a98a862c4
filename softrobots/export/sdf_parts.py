"""Parts of SDF: poses, numbers, geometries, colours; obstacles as a model that stands still, and how stiff contact is in Drake.

Drake's point contact is a spring of `STIFFNESS` in each of two bodies, one behind the other: a normal force `f` presses them
into each other by `2 f / STIFFNESS`. That holds for its default approximation, "lagged", and for "similar"; "sap" makes contact
softer at large time steps. A pair of shapes has one contact. Gazebo does not read the stiffness, only the friction.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from urllib.parse import quote

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.description.rigid_tree import Placement, Shape, number_text
from softrobots.environment.convex_mesh import Mesh
from softrobots.export.contact_shapes import ContactShapes
from softrobots.export.meshes import MeshFolder, obj_of

DRAKE = "http://drake.mit.edu"
"""XML namespace of Drake's tags."""

WORLD = "world"
"""Name of the world in SDF."""

STIFFNESS = 1e8
"""Stiffness of each body in Drake's point contact [N/m]."""

SURROUNDINGS = "surroundings"
"""Name of the model of the obstacles."""

_DISSIPATION = 1.0  # [s/m], of Hunt and Crossley's law

HARDNESS = f"Contact in Drake is a spring of {0.5 * STIFFNESS:g} N/m, with the dissipation {2.0 * _DISSIPATION:g} s/m."
"""How stiff contact is, for the head of the file."""


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


def write_obstacles(world: ElementTree.Element, contact: ContactShapes, mesh_folder: MeshFolder | None) -> None:
    """Write a static model of the obstacles, a link for each, and files of meshes into a folder.

    Raises:
        ParameterError: If there are meshes, and no folder.
        OutputError: If a file cannot be written.
    """
    model = ElementTree.SubElement(world, "model", {"name": SURROUNDINGS})
    ElementTree.SubElement(model, "static").text = "true"
    for name, shape in contact.obstacles.items():
        file = _mesh_file(contact.meshes[name], name, mesh_folder) if name in contact.meshes else None
        link = ElementTree.SubElement(model, "link", {"name": name})
        write_pose(link, shape.placement)
        for kind in ("visual", "collision"):
            element = ElementTree.SubElement(link, kind, {"name": kind})
            write_geometry(element, shape, file, convex=True)
            if kind == "visual" and shape.rgba is not None:
                write_colour(element, shape.rgba)
            if kind == "collision":
                write_hardness(element, contact.friction)


def _mesh_file(mesh: Mesh, name: str, folder: MeshFolder | None) -> Path:
    """Write a mesh as OBJ, and return how SDF names the file."""
    if folder is None:
        raise ParameterError("mesh_folder", folder, f"a folder for the file of {name}: SDF has no meshes without files")
    return folder.keep("mesh", ".obj", obj_of(mesh.vertices, mesh.triangles))


def write_hardness(collision: ElementTree.Element, friction: float) -> None:
    """Write friction, for all tools, and Drake's stiffness and dissipation of a collision shape."""
    surface = ElementTree.SubElement(ElementTree.SubElement(collision, "surface"), "friction")
    coefficients = ElementTree.SubElement(surface, "ode")
    for name in ("mu", "mu2"):
        write_number(coefficients, name, friction)
    properties = ElementTree.SubElement(collision, f"{{{DRAKE}}}proximity_properties")
    write_number(properties, f"{{{DRAKE}}}point_contact_stiffness", STIFFNESS)
    write_number(properties, f"{{{DRAKE}}}hunt_crossley_dissipation", _DISSIPATION)
