"""Mesh files of an exported robot: found where the description says, or copied in a format that the simulator reads."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.checks import FloatArray
from softrobots.core.errors import FileFormatError
from softrobots.core.files import as_path, write_bytes
from softrobots.description.collada_check import collada_problem
from softrobots.description.mesh_files import DRAWN_FILES, find_mesh
from softrobots.description.rigid_tree import Shape, number_text
from softrobots.environment.convex_mesh import read_triangles

_STL_HEAD, _STL_FACE, _STL_MOST = 84, 50, 200_000  # bytes, bytes, largest number of faces in MuJoCo


class MeshFolder(NamedTuple):
    """A folder for copies of mesh files."""

    place: Path
    """Where it is, an absolute path."""
    name: Path
    """How the exported file names it: absolute, or relative to the folder of that file."""

    @staticmethod
    def of(folder: Any) -> MeshFolder | None:
        """Return a folder given by its path, which the exported file names by its absolute path; None for None.

        Raises:
            ParameterError: If it is no path.
        """
        if folder is None or isinstance(folder, MeshFolder):
            return folder
        place = as_path("mesh_folder", folder).absolute()
        return MeshFolder(place, place)

    def keep(self, stem: str, suffix: str, content: bytes) -> Path:
        """Write a file, named by its content, unless it is there already; return how the exported file names it.

        Raises:
            OutputError: If it cannot be written.
        """
        name = f"{stem}_{hashlib.sha256(content).hexdigest()[:16]}{suffix}"
        if not (self.place / name).is_file():
            write_bytes(self.place / name, content, overwrite=False)
        return self.name / name


class MeshFiles:
    """Finds mesh files, copies them if there is a folder for that, and counts those left out."""

    def __init__(self, folder: MeshFolder | None = None) -> None:
        self._folder = folder
        self.left_out = 0
        """Meshes that were not found or that the simulator cannot read."""

    def split(self, shapes: Sequence[Shape], readable: Callable[[Path], bool]) -> list[tuple[Shape, Path | None]]:
        """Return the shapes that can be written, each with its mesh file, or None if it is not a mesh.

        Meshes that are missing or not readable for a simulator are left out and counted.
        """
        files = [self.find(shape.filename, readable) if shape.kind == "mesh" else None for shape in shapes]
        return [(shape, file) for shape, file in zip(shapes, files, strict=True) if shape.kind != "mesh" or file is not None]

    def find(self, name: str, readable: Callable[[Path], bool]) -> Path | None:
        """Return how the exported file names a mesh; None, and counted, if it is missing or not readable for the simulator.

        With a folder it is a copy, which is converted to OBJ if the simulator does not read the format of the original. Only
        files that are called `DRAWN_FILES` are copied, because a description may name any file.

        Raises:
            OutputError: If a copy cannot be written.
        """
        file = find_mesh(name)
        if file is not None and self._folder is not None:
            kind = file.suffix.lower() if readable(file) else ".obj"
            content = None if file.suffix.lower() not in DRAWN_FILES else file.read_bytes() if readable(file) else _as_obj(file)
            if content is not None:
                return self._folder.keep(file.stem, kind, content)
        elif file is not None and readable(file):
            return file
        self.left_out += 1
        return None

    def remark(self, why: str) -> tuple[str, ...]:
        """Return the remark on meshes for the head of a file; empty if none is left out."""
        cure = "" if self._folder is not None else "; a folder for meshes gets copies that are converted"
        return (f"Meshes left out: {self.left_out} (not found, or {why}{cure}).",) if self.left_out else ()


def obj_of(corners: FloatArray, triangles: Any) -> bytes:
    """Return a surface as an OBJ file with all digits.

    Args:
        corners: Shape (n, 3) [m].
        triangles: Corners of each triangle, counted from 0, shape (m, 3), integers.
    """
    lines = [f"v {number_text(corner)}" for corner in corners]
    return ("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist())]) + "\n").encode("ascii")


def _as_obj(file: Path) -> bytes | None:
    """A mesh file as OBJ without its colours; None if it cannot be read."""
    if file.suffix.lower() == ".dae" and collada_problem(file):
        return None
    try:
        return obj_of(*read_triangles(str(file)))
    except FileFormatError:
        return None


def mujoco_reads(file: Path) -> bool:
    """Return whether MuJoCo reads a mesh file: OBJ, or binary STL of at most 200000 faces."""
    if file.suffix.lower() != ".stl":
        return file.suffix.lower() == ".obj"
    with file.open("rb") as stream:
        faces = int.from_bytes(stream.read(_STL_HEAD)[-4:], "little")
    return faces <= _STL_MOST and file.stat().st_size == _STL_HEAD + _STL_FACE * faces


def drawn_anywhere(file: Path) -> bool:
    """Return whether a mesh file may be a visual: simulators that read SDF ignore visuals that they cannot draw."""
    return bool(file.suffix)


def drake_collides(file: Path) -> bool:
    """Return whether Drake reads a mesh file for collisions; it refuses a robot with any other."""
    return file.suffix.lower() in (".obj", ".gltf", ".vtk")
