"""Mesh files that a description names: where they are, and a description without those that are not there.

A URDF names a mesh as `package://<package>/<path>`, as `file://<path>`, or as a path, relative to the file that names it.
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

_MESH = re.compile(r"""(<mesh\b[^<>]*?\bfilename\s*=\s*)(?:"([^"]*)"|'([^']*)')""")


LARGEST_MESH = 100_000_000
"""Bytes that a mesh file, or another file that a description names, may have."""
DRAWN_FILES = (".obj", ".stl", ".dae")
"""Mesh files that are read. Assimp, by which Pinocchio does that, knows more kinds, and ends the process at one in six
damaged PLY files."""


class MissingMeshWarning(UserWarning):
    """Meshes that cannot be drawn, because their files are not found or cannot be read.

    Attributes:
        meshes: Their names, as the description spells them.
    """

    def __init__(self, robot: str, meshes: Sequence[str]) -> None:
        """Say which they are, and what may help."""
        hint = " (package:// is looked up in the folders of ROS_PACKAGE_PATH, of AMENT_PREFIX_PATH and of example-robot-data)"
        told = ", ".join(meshes[:5]) + (", ..." if len(meshes) > 5 else "")
        other = any(Path(name).suffix.lower() not in DRAWN_FILES for name in meshes)
        super().__init__(
            f"{robot} is drawn without {len(meshes)} mesh files that are not found or cannot be read: {told}"
            + (f" ({', '.join(DRAWN_FILES)} files are read)" if other else "")
            + (hint if any(name.startswith("package://") for name in meshes) else "")
        )
        self.meshes = tuple(meshes)


def with_absolute_paths(urdf: str, folder: Path) -> str:
    """Write out the relative paths of meshes, so that the text means the same away from its folder.

    Args:
        urdf: URDF text of a file.
        folder: The folder of that file.

    Returns:
        The text; nothing else of it changes, and nothing at all where every mesh has an absolute path or a scheme.
    """

    def absolute(match: re.Match[str]) -> str:
        name = html.unescape(match[2] if match[2] is not None else match[3])
        if not name.strip() or "://" in name or Path(name).is_absolute():
            return match[0]
        try:
            path = (folder / name).resolve()
        except (OSError, RuntimeError, ValueError):  # links in a circle, a name that is none
            return match[0]
        return f'{match[1]}"{html.escape(str(path))}"'

    return _MESH.sub(absolute, urdf)


def find_mesh(name: str, folders: Sequence[str]) -> Path | None:
    """Find a mesh file.

    Args:
        name: Its name, as the description spells it.
        folders: Folders that hold packages; those of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH come after them.

    Returns:
        The path of the file, or None if there is none, or none of at most `LARGEST_MESH` bytes.
    """
    scheme, separator, path = name.partition("://")
    if not separator:
        found = [Path(name)]
    elif scheme == "package":
        ros = [Path(folder) for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if folder]
        ament = [Path(folder) / "share" for folder in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if folder]
        found = [folder / path for folder in (*map(Path, folders), *ros, *ament)]
    else:
        found = [Path(path)] if scheme == "file" else []
    return next((file.resolve() for file in found if unfit_file(file) == ""), None)


def unfit_file(file: Path) -> str | None:
    """Tell why a file that a description names cannot be read.

    Args:
        file: Its path.

    Returns:
        The reason, e.g. that it is a pipe, for which a library would wait; empty if there is none; None if there is no such
        file.
    """
    try:
        status = file.stat()
    except (OSError, ValueError):  # not there, links in a circle, a name that is too long or has a NUL
        return None
    if not stat.S_ISREG(status.st_mode):
        return "is a folder, a device or a pipe"
    return "" if status.st_size <= LARGEST_MESH else f"has {status.st_size} bytes; at most {LARGEST_MESH} are read"


def _ends_reader(file: Path) -> bool:
    """Whether a file is one that Assimp may not survive, or fill the memory with."""
    kind = file.suffix.lower()
    return kind not in DRAWN_FILES or (kind == ".dae" and collada_problem(file) != "")


def remove_mesh_shapes(robot: ElementTree.Element) -> None:
    """Take the shapes from mesh files, visual and collision, out of a description, in place.

    Args:
        robot: Its root element.
    """
    for link in robot.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            if shape.find("geometry/mesh") is not None:
                link.remove(shape)


def only_found(
    urdf: str, folders: Sequence[str], readable: Callable[[Path], bool] | None = None
) -> tuple[str, tuple[str, ...]]:
    """Leave out the visual shapes whose mesh files are missing, and name the others by their whole path.

    Args:
        urdf: URDF text.
        folders: Folders that hold packages, as for `find_mesh`.
        readable: Tells of a file that is there whether it can be read; by default every file can.

    Returns:
        The text for drawing, and the names of the meshes that are left out. A text without meshes comes back as it is.
    """
    if "<mesh" not in urdf:
        return urdf, ()
    root = parse_xml(urdf, "the URDF")
    missing: dict[str, None] = {}
    for link in root.iter("link"):
        for visual in link.findall("visual"):
            for mesh in visual.findall("geometry/mesh"):
                name = mesh.get("filename", "")
                file = find_mesh(name, folders)
                if file is None or _ends_reader(file) or (readable is not None and not readable(file)):
                    missing[name] = None
                    link.remove(visual)
                    break
                mesh.set("filename", str(file))
    return ElementTree.tostring(root, encoding="unicode"), tuple(missing)
