"""Contact in SDF: obstacles as a model that stands still, and how stiff contact is in Drake.

Drake's point contact is a spring of `STIFFNESS` in each of two bodies, one behind the other: a normal force `f` presses them
into each other by `2 f / STIFFNESS`. That holds for its default approximation, "lagged", and for "similar"; "sap" makes contact
softer at large time steps. A pair of shapes has one contact. Gazebo does not read the stiffness, only the friction.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from softrobots.core.errors import ParameterError
from softrobots.environment.convex_mesh import Mesh
from softrobots.export.contact_shapes import ContactShapes
from softrobots.export.meshes import MeshFolder, obj_of
from softrobots.export.sdf_parts import DRAKE, write_colour, write_geometry, write_number, write_pose

STIFFNESS = 1e8
"""Stiffness of each body in Drake's point contact [N/m]."""

SURROUNDINGS = "surroundings"
"""Name of the model of the obstacles."""

_DISSIPATION = 1.0  # [s/m], of Hunt and Crossley's law

HARDNESS = f"Contact in Drake is a spring of {0.5 * STIFFNESS:g} N/m, with the dissipation {2.0 * _DISSIPATION:g} s/m."
"""How stiff contact is, for the head of the file."""


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
