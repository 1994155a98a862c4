"""Robots of other people in the formats of other tools, as URDF text with our tags.

The kind of a description is told by its root tag. URDF stays as it is; MJCF is compiled by MuJoCo and SDF parsed by Drake, so
that their defaults, classes, units and frames hold, and what comes out is written as URDF.
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
"""What can be read, by root tag."""

_READERS: Mapping[str, Callable[[str, str, Path | None], RigidTree]] = {"mujoco": read_mjcf, "sdf": read_sdf}


def to_urdf(text: str, source: str, path: Path | None = None) -> str:
    """Translate a description to URDF text.

    Args:
        text: The description.
        source: Where it comes from, for errors.
        path: Its file, if it is one: what it includes is found from there.

    Returns:
        URDF text; of URDF the text itself.

    Raises:
        MissingDependency: If MJCF is given without MuJoCo, or SDF without Drake (extra `interop`).
        DescriptionError: If it is of another kind or has too many links, if MuJoCo or Drake refuses it, or if it has something
            that bears on the statics and that we do not have; all of that is listed.
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
