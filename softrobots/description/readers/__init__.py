"""Translation of MJCF and SDF, recognised by their root tag, to URDF text with the tags of this package.

MJCF is compiled by MuJoCo and SDF parsed by Drake, so that defaults, classes, units and frames are those of the format.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import parse_xml
from softrobots.description.readers.mjcf import read_mjcf
from softrobots.description.readers.sdf import read_sdf
from softrobots.description.rigid_tree import RigidTree
from softrobots.description.rigid_tree_urdf import write_rigid_tree
from softrobots.description.urdf_structure import check_link_count

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
    return write_rigid_tree(_READERS[tag](text, source, path))
