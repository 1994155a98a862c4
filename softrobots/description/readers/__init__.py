"""Translation of MJCF and SDF, recognised by their root tag, to URDF text with the tags of this package.

MJCF is compiled by MuJoCo and SDF parsed by Drake, so that defaults, classes, units and frames are those of the format. Round
collision shapes become capsules (`<softrobots:capsule>`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import parse_xml
from softrobots.description.readers.mjcf import read_mjcf
from softrobots.description.readers.sdf import read_sdf
from softrobots.description.rigid_tree import RigidTree, capsule_shape
from softrobots.description.rigid_tree_urdf import read_rigid_tree, write_rigid_tree
from softrobots.description.urdf_structure import check_link_count, check_structure

KINDS: Mapping[str, str] = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF"}
"""Formats by root tag."""

_READERS: Mapping[str, Callable[[str, str, Path | None], RigidTree]] = {"mujoco": read_mjcf, "sdf": read_sdf}


def to_urdf(text: str, source: str, path: Path | None = None) -> str:
    """Translate a description to URDF text; URDF is returned unchanged.

    Args:
        text: The description.
        source: Its origin, for errors.
        path: Its file, if any, to which included files and meshes are relative.

    Raises:
        MissingDependency: If MuJoCo (for MJCF) or Drake (for SDF) is not installed (extra `interop`).
        DescriptionError: If it is of another format or has too many links, if MuJoCo or Drake refuses it, or if it has features
            that affect the statics and are not supported; all of them are listed.
    """
    root = parse_xml(text, source)
    tag = str(root.tag)
    if tag not in KINDS:
        known = ", ".join(f"<{name}> ({kind})" for name, kind in KINDS.items())
        raise DescriptionError(f"{source} has the root tag <{tag}>; one of {known} is required")
    if tag == "robot":
        check_link_count(root, source)
        return text
    tree = _READERS[tag](text, source, path)
    bodies = tuple(replace(body, collisions=()) for body in tree.bodies)
    return write_rigid_tree(replace(tree, bodies=bodies, capsules=tuple(tag for body in tree.bodies for tag in body.capsules)))


def read_world(text: str, source: str, path: Path | None = None) -> RigidTree:
    """Read a description with its collision shapes; arguments and errors are those of `to_urdf`.

    Capsules in the tags of this package are among the collision shapes.
    """
    root = parse_xml(text, source)
    if root.tag in _READERS:
        return _READERS[str(root.tag)](text, source, path)
    to_urdf(text, source)  # refuses other formats
    check_structure(root, source)
    tree = read_rigid_tree(text, source)
    owned = {body.name: tuple(capsule_shape(tag) for tag in tree.capsules if tag.link == body.name) for body in tree.bodies}
    astray = sorted({tag.link for tag in tree.capsules} - owned.keys())
    if astray:
        raise DescriptionError(f"{source} has a capsule of a link {', '.join(astray)!r}; available: {', '.join(owned)}")
    bodies = tuple(replace(body, collisions=body.collisions + owned[body.name]) for body in tree.bodies)
    return replace(tree, bodies=bodies)
