"""Preparation of SDF text for Drake: parts without effect on the statics and unresolved file names are removed.

Drake otherwise reads collision meshes, fetches packages from the network, and refuses a file for one invalid shape, e.g. a
plane without a direction.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.dom import minidom

from softrobots.description.mesh_files import DRAWN_FILES, find_mesh

_LEFT_OUT = (
    "visual", "collision", "sensor", "light", "plugin", "audio_source", "audio_sink", "particle_emitter", "projector",
    "battery", "drake:controller_gains",
)  # fmt: skip
_DRAWN = ("box", "cylinder", "sphere", "capsule", "mesh")
_COLOURS = ("ambient", "diffuse", "specular", "emissive")


def without_drawings(text: str) -> str:
    """Return an SDF document without shapes, sensors, lights and plugins."""
    document = minidom.parseString(text.encode("utf-8"))
    _remove(document, lambda element: element.tagName in _LEFT_OUT)
    return str(document.toxml())


def with_found_meshes(text: str, folder: Path | None) -> str:
    """Return an SDF document with visible boxes, cylinders, spheres, capsules and existing meshes as its only shapes.

    Mesh files, relative to a folder if there is one, are named by URIs, and of materials only the colours are kept.
    """
    document = minidom.parseString(text.encode("utf-8"))
    _remove(document, lambda e: not _drawn(e, folder) if e.tagName == "visual" else e.tagName in _LEFT_OUT)
    for visual in document.getElementsByTagName("visual"):
        for node in _elements(visual):
            if node.tagName == "material":
                for look in [inner for inner in _elements(node) if inner.tagName not in _COLOURS]:
                    node.removeChild(look)
            elif node.tagName not in ("pose", "geometry", "transparency"):
                visual.removeChild(node)
    return str(document.toxml())


def collisions_as_visuals(
    text: str, folder: Path | None, read: Sequence[str] = (*_DRAWN, "plane")
) -> tuple[str, list[tuple[str, str, str]]]:
    """Return an SDF document whose collision shapes of the kinds `read` are its visuals, and the others.

    Visuals may be of more kinds and files than Drake collides.

    Returns:
        The document; and link, by its scoped name `model::link`, name and kind of each other collision shape.
    """
    document, others = minidom.parseString(text.encode("utf-8")), []
    _remove(document, lambda e: e.tagName in _LEFT_OUT and e.tagName != "collision")
    for collision in document.getElementsByTagName("collision"):
        shapes = [node for node in _elements(collision) if node.tagName == "geometry" for node in _elements(node)]
        kind = shapes[0].tagName if len(shapes) == 1 else "shape"
        link: Any = collision.parentNode
        if kind not in read or not _found(shapes[0], folder):
            scope, model = [link.getAttribute("name")], link.parentNode
            while isinstance(model, minidom.Element) and model.tagName == "model":
                scope, model = [model.getAttribute("name"), *scope], model.parentNode
            if kind != "empty":
                others.append(("::".join(scope), collision.getAttribute("name"), kind))
            continue
        visual = document.createElement("visual")
        for name, value in collision.attributes.items():
            visual.setAttribute(name, value)
        for node in [node for node in _elements(collision) if node.tagName in ("pose", "geometry")]:
            visual.appendChild(node)
        link.appendChild(visual)
    _remove(document, lambda e: e.tagName == "collision")
    return str(document.toxml()), others


@contextmanager
def warnings_of_drake(*, shown: bool) -> Iterator[list[str]]:
    """Collect the lines of Drake's warnings; if `shown`, they are logged, too."""
    lines: list[str] = []

    def collect(record: logging.LogRecord) -> bool:
        lines.append(" ".join(record.getMessage().split()))
        return shown

    logger = logging.getLogger("drake")
    logger.addFilter(collect)
    try:
        yield lines
    finally:
        logger.removeFilter(collect)


def _drawn(visual: minidom.Element, folder: Path | None) -> bool:
    shapes = [node for geometry in visual.getElementsByTagName("geometry") for node in _elements(geometry)]
    return len(shapes) == 1 and shapes[0].tagName in _DRAWN and _found(shapes[0], folder)


def _found(shape: minidom.Element, folder: Path | None) -> bool:
    """Whether a shape can be drawn; a mesh gets the URI of its file."""
    if shape.tagName != "mesh":
        return True
    names = shape.getElementsByTagName("uri")
    if len(names) != 1 or not names[0].firstChild or names[0].firstChild.nodeType != minidom.Node.TEXT_NODE:
        return False
    name = names[0].firstChild.data.strip()
    if "://" not in name:
        name = str((folder or Path()) / name)
    file = find_mesh(name)
    if file is None or file.suffix.lower() not in DRAWN_FILES:
        return False
    names[0].firstChild.data = file.as_uri()
    return True


def _elements(node: minidom.Node) -> list[minidom.Element]:
    return [inner for inner in node.childNodes if isinstance(inner, minidom.Element)]


def _remove(document: minidom.Document, unwanted: Callable[[minidom.Element], bool]) -> None:
    """Remove elements below the root, all of a parent at once, because one by one takes quadratic time."""
    parents: list[Any] = [document.documentElement]
    for parent in parents:
        parent.childNodes[:] = [
            node for node in parent.childNodes if not isinstance(node, minidom.Element) or not unwanted(node)
        ]
        parents += _elements(parent)
