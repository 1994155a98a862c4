"""Mesh files of an exported robot that the simulator can read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from softrobots.description.mesh_files import find_mesh
from softrobots.description.rigid_tree import Shape

_STL_HEAD, _STL_FACE, _STL_MOST = 84, 50, 200_000  # bytes, bytes, largest number of faces in MuJoCo


class MeshFiles:
    """Finds mesh files, and counts those left out."""

    def __init__(self) -> None:
        self.left_out = 0
        """Meshes that were not found or that the simulator cannot read."""

    def split(self, shapes: Sequence[Shape], readable: Callable[[Path], bool]) -> list[tuple[Shape, Path | None]]:
        """Return the shapes that can be written, each with its mesh file, or None if it is not a mesh.

        Meshes that are missing or not readable for a simulator are left out and counted.
        """
        pairs: list[tuple[Shape, Path | None]] = []
        for shape in shapes:
            file = find_mesh(shape.filename) if shape.kind == "mesh" else None
            if shape.kind == "mesh" and (file is None or not readable(file)):
                self.left_out += 1
            else:
                pairs.append((shape, file))
        return pairs

    def remark(self, why: str) -> tuple[str, ...]:
        """Return the remark on meshes for the head of a file; empty if none is left out."""
        return (f"Meshes left out: {self.left_out} (not found, or {why}).",) if self.left_out else ()


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
