"""Mesh files of a description: how they are found, and the description without those that are missing.

A URDF names a mesh as `package://<package>/<path>`, as `file://<path>`, or as a path relative to the URDF file.
"""

from __future__ import annotations

import html
import os
import re
import stat
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from pathlib import Path

from softrobots.core.xml_input import parse_xml
from softrobots.description.collada_check import collada_problem
from softrobots.description.third_party import package_folders

_MESH = re.compile(r"""(<mesh\b[^<>]*?\bfilename\s*=\s*)(?:"([^"]*)"|'([^']*)')""")

LARGEST_MESH = 100_000_000
"""Largest size of a mesh file, or another file that a description names [bytes]."""
DRAWN_FILES = (".obj", ".stl", ".dae")
"""Suffixes of mesh files that are read. Assimp, Pinocchio's reader, knows more formats, but crashes on one in six damaged PLY
files."""


class MissingMeshWarning(UserWarning):
    """Meshes are not drawn, because their files are not found or cannot be read.

    Attributes:
        meshes: Their names in the description.
    """

    def __init__(self, robot: str, meshes: Sequence[str]) -> None:
        """Name the robot and up to five meshes, with hints."""
        hint = " (package:// is looked up in the folders of ROS_PACKAGE_PATH, of AMENT_PREFIX_PATH and of example-robot-data)"
        listed = ", ".join(meshes[:5]) + (", ..." if len(meshes) > 5 else "")
        other = any(Path(name).suffix.lower() not in DRAWN_FILES for name in meshes)
        super().__init__(
            f"{robot} is drawn without {len(meshes)} mesh files that are not found or cannot be read: {listed}"
            + (f" ({', '.join(DRAWN_FILES)} files are read)" if other else "")
            + (hint if any(name.startswith("package://") for name in meshes) else "")
        )
        self.meshes = tuple(meshes)


def with_absolute_paths(urdf: str, folder: Path) -> str:
    """Return the text of a URDF file in a folder, with relative paths of meshes made absolute; nothing else changes."""

    def absolute(match: re.Match[str]) -> str:
        name = html.unescape(match[2] if match[2] is not None else match[3])
        if not name.strip() or "://" in name or Path(name).is_absolute():
            return match[0]
        try:
            path = (folder / name).resolve()
        except (OSError, RuntimeError, ValueError):  # a loop of links, an invalid name
            return match[0]
        return f'{match[1]}"{html.escape(str(path))}"'

    return _MESH.sub(absolute, urdf)


def find_mesh(name: str) -> Path | None:
    """Return the path of a mesh file by its name in a description; None if it does not exist or is above `LARGEST_MESH`.

    Packages are searched in example-robot-data, then in the folders of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
    """
    scheme, separator, path = name.partition("://")
    if not separator:
        candidates = [Path(name)]
    elif scheme == "package":
        ros = [Path(folder) for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if folder]
        ament = [Path(folder) / "share" for folder in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if folder]
        candidates = [folder / path for folder in (*map(Path, package_folders()), *ros, *ament)]
    else:
        candidates = [Path(path)] if scheme == "file" else []
    return next((file.resolve() for file in candidates if unfit_file(file) == ""), None)


def unfit_file(file: Path) -> str | None:
    """Return why a file that a description names cannot be read, e.g. that it is a pipe, for which a library would wait.

    Empty if it can be read; None if it does not exist.
    """
    try:
        status = file.stat()
    except (OSError, ValueError):  # missing, a loop of links, a name that is too long or has a NUL
        return None
    if not stat.S_ISREG(status.st_mode):
        return "is a folder, a device or a pipe"
    return "" if status.st_size <= LARGEST_MESH else f"has {status.st_size} bytes; at most {LARGEST_MESH} are read"


def _ends_reader(file: Path) -> bool:
    """Whether Assimp may crash on the file or exhaust the memory."""
    kind = file.suffix.lower()
    return kind not in DRAWN_FILES or (kind == ".dae" and collada_problem(file) != "")


def remove_mesh_shapes(robot: ElementTree.Element) -> None:
    """Remove visual and collision shapes from mesh files from the root element of a description, in place."""
    for link in robot.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)


def only_found(urdf: str, readable: Callable[[Path], bool] | None = None) -> tuple[str, tuple[str, ...]]:
    """Remove visual shapes whose mesh files are missing, and name the others by absolute paths.

    Args:
        urdf: URDF text.
        readable: Whether an existing file can be read; by default every file can.

    Returns:
        The text for drawing, and the names of the removed meshes.
    """
    if "<mesh" not in urdf:
        return urdf, ()
    root = parse_xml(urdf, "the URDF")
    missing: dict[str, None] = {}
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            for mesh in visual.findall("geometry/mesh"):
                name = mesh.get("filename", "")
                file = find_mesh(name)
                if file is None or _ends_reader(file) or (readable is not None and not readable(file)):
                    missing[name] = None
                    link.remove(visual)
                    break
                mesh.set("filename", str(file))
    return ElementTree.tostring(root, encoding="unicode"), tuple(missing)
