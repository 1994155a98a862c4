"""Export to URDF: the description itself, with mesh files that every tool finds."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ElementTree

from softrobots.core.xml_input import parse_xml
from softrobots.description.urdf_tags import NAMESPACE
from softrobots.export.meshes import MeshFiles, MeshFolder, drawn_anywhere, mujoco_reads
from softrobots.export.xml_text import document
from softrobots.model.soft_model import SoftModel


def to_urdf(model: SoftModel, *, mesh_folder: str | os.PathLike[str] | None = None) -> str:
    """Write a robot as URDF whose meshes are files, where the description may have `package://` names.

    Meshes are named by absolute path; with `mesh_folder` they are copied there, and those that MuJoCo does not read (COLLADA)
    become OBJ, which has no colours. A mesh that is not found keeps its name, and the head of the file counts those. Everything
    else is that of the description, springs as tags, which other tools pass over. A tag tells MuJoCo to keep the folders.

    Args:
        model: The robot.
        mesh_folder: Folder for copies of mesh files, named by their content; None: the originals are used.

    Returns:
        URDF text.

    Raises:
        ParameterError: If the folder is no path.
        OutputError: If the copy of a mesh cannot be written.
    """
    folder = MeshFolder.of(mesh_folder)
    root, meshes = parse_xml(model.urdf, "the URDF"), MeshFiles(folder)
    shapes = list(root.iter("mesh"))
    for mesh in shapes:
        file = meshes.find(mesh.get("filename", ""), drawn_anywhere if folder is None else mujoco_reads)
        if file is not None:
            mesh.set("filename", str(file))
    if shapes:
        hints = root.find("mujoco")
        hints = ElementTree.SubElement(root, "mujoco") if hints is None else hints
        compiler = hints.find("compiler")
        compiler = ElementTree.SubElement(hints, "compiler") if compiler is None else compiler
        compiler.set("strippath", "false")
        compiler.attrib.pop("meshdir", None)
    ElementTree.register_namespace("softrobots", NAMESPACE)
    head = f"{root.get('name')}, written by softrobots with files of meshes that other tools find. SI units and radians."
    names = (f"Meshes that keep their name: {meshes.left_out} (not found, or not readable).",) if meshes.left_out else ()
    return document(root, (head, *names))
