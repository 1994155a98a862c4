"""SDF text as Drake gets it: without what the statics does not need, and without names of files that Drake would look for.

Drake reads meshes where they collide, fetches packages of its own from the network, and fails as a whole at shapes that it does
not like, e.g. a plane without a direction. None of that bears on a loaded robot at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.dom import minidom

from softrobots.description.mesh_files import DRAWN_FILES, find_mesh
from softrobots.description.third_party import package_folders

_LEFT_OUT = (
    "visual", "collision", "sensor", "light", "plugin", "audio_source", "audio_sink", "particle_emitter", "projector",
    "battery", "drake:controller_gains",
)  # fmt: skip
_DRAWN = ("box", "cylinder", "sphere", "capsule", "mesh")
_SAID_OF_COLOUR = ("ambient", "diffuse", "specular", "emissive")


def without_drawings(text: str) -> str:
    """Leave out shapes, sensors, lights and plugins.

    Args:
        text: An SDF document.
    """
    document = minidom.parseString(text.encode("utf-8"))
    _remove(document, lambda element: element.tagName in _LEFT_OUT)
    return str(document.toxml())


def with_found_meshes(text: str, folder: Path | None) -> str:
    """Leave out all but what is drawn: visible boxes, cylinders, spheres, capsules, and meshes whose files are there.

    Args:
        text: An SDF document.
        folder: The folder of its file, if it is one: where names of meshes start.

    Returns:
        The text; meshes are named by the addresses of their files, and of their look only the colours are left.
    """
    document = minidom.parseString(text.encode("utf-8"))
    _remove(document, lambda e: not _drawn(e, folder) if e.tagName == "visual" else e.tagName in _LEFT_OUT)
    for visual in document.getElementsByTagName("visual"):
        for node in _elements(visual):
            if node.tagName == "material":
                for look in [inner for inner in _elements(node) if inner.tagName not in _SAID_OF_COLOUR]:
                    node.removeChild(look)
            elif node.tagName not in ("pose", "geometry", "transparency"):
                visual.removeChild(node)
    return str(document.toxml())


def _drawn(visual: minidom.Element, folder: Path | None) -> bool:
    shapes = [node for geometry in visual.getElementsByTagName("geometry") for node in _elements(geometry)]
    return len(shapes) == 1 and shapes[0].tagName in _DRAWN and _found(shapes[0], folder)


def _found(shape: minidom.Element, folder: Path | None) -> bool:
    """Whether a shape can be drawn; a mesh gets the address of its file."""
    if shape.tagName != "mesh":
        return True
    names = shape.getElementsByTagName("uri")
    if len(names) != 1 or not names[0].firstChild or names[0].firstChild.nodeType != minidom.Node.TEXT_NODE:
        return False
    name = names[0].firstChild.data.strip()
    if "://" not in name:
        name = str((folder or Path()) / name)
    file = find_mesh(name, package_folders())
    if file is None or file.suffix.lower() not in DRAWN_FILES:
        return False
    names[0].firstChild.data = file.as_uri()
    return True


def _elements(node: minidom.Node) -> list[minidom.Element]:
    return [inner for inner in node.childNodes if isinstance(inner, minidom.Element)]


def _remove(document: minidom.Document, unwanted: Callable[[minidom.Element], bool]) -> None:
    """Take elements out, but the root, those of a parent at once: one by one takes time with their number squared."""
    parents: list[Any] = [document.documentElement]
    for parent in parents:
        parent.childNodes[:] = [
            node for node in parent.childNodes if not isinstance(node, minidom.Element) or not unwanted(node)
        ]
        parents += _elements(parent)
