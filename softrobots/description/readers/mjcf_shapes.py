"""Shapes of a MuJoCo model: the visible ones as far as URDF has them, and all that collide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.description.mesh_files import DRAWN_FILES, unfit_file
from softrobots.description.rigid_tree import SOLIDS, Placement, Shape

_SHOWN = 3  # MuJoCo's viewers show the geom groups below
_DEFAULT_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # of a geom without colour; its material's applies then


def visible_shapes(mujoco: Any, model: Any, text: str, path: Path | None) -> list[tuple[Shape, ...]]:
    """Return the visible shapes of every body of a compiled model, by number of the body; capsules as cylinders.

    Planes, ellipsoids, height fields, and meshes without a file or with a reference pose are omitted. Names of mesh files are
    in the MJCF document alone, and relative to its file, if it has one.
    """
    drawn = [geom for geom in range(model.ngeom) if model.geom_group[geom] < _SHOWN and _colour(model, geom)[3] > 0.0]
    shapes = _shapes(mujoco, model, text, path, drawn)
    return [
        tuple(
            replace(shape, kind="cylinder") if shape.kind == "capsule" else shape
            for shape in of_body
            if shape.kind in (*SOLIDS, "capsule") or shape.filename
        )
        for of_body in shapes
    ]


def collision_shapes(mujoco: Any, model: Any, text: str, path: Path | None) -> list[tuple[Shape, ...]]:
    """Return the shapes of every body that collide with others; those that are not read are there by their kind alone."""
    collide = [geom for geom in range(model.ngeom) if model.geom_contype[geom] or model.geom_conaffinity[geom]]
    return _shapes(mujoco, model, text, path, collide)


def _shapes(mujoco: Any, model: Any, text: str, path: Path | None, geoms: Sequence[int]) -> list[tuple[Shape, ...]]:
    files = _mesh_files(mujoco, model, text, path) if model.nmesh else {}
    shapes: list[list[Shape]] = [[] for _ in range(model.nbody)]
    for geom in geoms:
        shapes[model.geom_bodyid[geom]].append(_shape(mujoco, model, geom, files))
    return [tuple(of_body) for of_body in shapes]


def _shape(mujoco: Any, model: Any, geom: int, files: dict[int, str]) -> Shape:
    place, colour = Placement.turned(model.geom_pos[geom], model.geom_quat[geom]), _colour(model, geom)
    kind = mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_").lower()
    name, (x, y, z) = str(model.geom(geom).name), (2.0 * model.geom_size[geom]).tolist()
    mesh = int(model.geom_dataid[geom])
    if kind != "mesh" or mesh not in files:
        sizes = {"box": (x, y, z), "sphere": (0.5 * x,), "cylinder": (0.5 * x, y), "capsule": (0.5 * x, y)}
        return Shape(kind, sizes.get(kind, ()), place, colour, name=name)
    moved = Placement.turned(model.mesh_pos[mesh], model.mesh_quat[mesh])  # MuJoCo moves meshes to their principal axes
    return Shape("mesh", tuple(model.mesh_scale[mesh].tolist()), place @ moved.inverse, colour, files[mesh], name)


def _mesh_files(mujoco: Any, model: Any, text: str, path: Path | None) -> dict[int, str]:
    """Files of meshes without a reference pose, by number of the mesh."""
    spec = mujoco.MjSpec.from_string(text) if path is None else mujoco.MjSpec.from_file(str(path))
    folder, files = (Path() if path is None else path.parent) / spec.meshdir, {}
    for mesh in spec.meshes:
        file = folder / mesh.file
        moved = np.any(mesh.refpos) or not np.array_equal(mesh.refquat, [1.0, 0.0, 0.0, 0.0])
        if not moved and file.suffix.lower() in DRAWN_FILES and unfit_file(file) == "":
            files[int(model.mesh(mesh.name or file.stem).id)] = str(file.resolve())
    return files


def _colour(model: Any, geom: int) -> tuple[float, ...]:
    rgba, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material >= 0 and np.array_equal(rgba, _DEFAULT_COLOUR):
        rgba = model.mat_rgba[material]
    return tuple(np.clip(rgba.astype(np.float64).round(6), 0.0, 1.0).tolist())
