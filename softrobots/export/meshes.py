"""Which mesh files an exported robot can name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from softrobots.description.mesh_files import find_mesh
from softrobots.description.rigid_tree import Shape
from softrobots.description.third_party import package_folders

_STL_HEAD, _STL_FACE, _STL_MOST = 84, 50, 200_000  # bytes, bytes, faces that MuJoCo takes


class MeshFiles:
    """Finds mesh files, and counts those that are left out."""

    def __init__(self) -> None:
        self._folders: list[str] | None = None
        self.left_out = 0
        """Meshes that were not found or that the simulator cannot read."""

    def split(self, shapes: Sequence[Shape], readable: Callable[[Path], bool]) -> list[tuple[Shape, Path | None]]:
        """Shapes that can be written, each with its mesh file; None if it is no mesh.

        Args:
            shapes: Shapes.
            readable: Tells whether a simulator can read a file.

        Returns:
            Shapes and files; meshes that are missing or cannot be read are left out and counted.
        """
        made: list[tuple[Shape, Path | None]] = []
        for shape in shapes:
            file = self._find(shape.filename) if shape.kind == "mesh" else None
            if shape.kind == "mesh" and (file is None or not readable(file)):
                self.left_out += 1
            else:
                made.append((shape, file))
        return made

    def _find(self, name: str) -> Path | None:
        if self._folders is None:
            self._folders = package_folders()
        return find_mesh(name, self._folders)

    def remark(self, why: str) -> tuple[str, ...]:
        """What is to be said of meshes in the head of a file; nothing if none is left out."""
        return (f"Meshes left out: {self.left_out} (not found, or {why}).",) if self.left_out else ()


def mujoco_reads(file: Path) -> bool:
    """Whether MuJoCo reads a mesh file: OBJ, or binary STL of at most 200000 faces."""
    if file.suffix.lower() != ".stl":
        return file.suffix.lower() == ".obj"
    with file.open("rb") as stream:
        faces = int.from_bytes(stream.read(_STL_HEAD)[-4:], "little")
    return faces <= _STL_MOST and file.stat().st_size == _STL_HEAD + _STL_FACE * faces


def drawn_anywhere(file: Path) -> bool:
    """Whether a mesh file may be drawn: simulators that read SDF pass over what they cannot draw."""
    return bool(file.suffix)


def drake_collides(file: Path) -> bool:
    """Whether Drake reads a mesh file for collisions; it refuses the robot if it does not."""
    return file.suffix.lower() in (".obj", ".gltf", ".vtk")
