"""Visible shapes of a MuJoCo model, as far as URDF has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from softrobots.description.mesh_files import DRAWN_FILES, unfit_file
from softrobots.description.rigid_tree import Placement, Shape

_SHOWN = 3  # MuJoCo's viewers show the geom groups below
_DEFAULT_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # of a geom without colour; its material's applies then


def visible_shapes(mujoco: Any, model: Any, text: str, path: Path | None) -> list[tuple[Shape, ...]]:
    """Return the visible shapes of every body of a compiled model, by number of the body.

    Planes, ellipsoids, height fields, and meshes without a file or with a reference pose are omitted. Names of mesh files are
    in the MJCF document alone, and relative to its file, if it has one.
    """
    files = _mesh_files(mujoco, model, text, path) if model.nmesh else {}
    shapes: list[list[Shape]] = [[] for _ in range(model.nbody)]
    for geom in range(model.ngeom):
        colour = _colour(model, geom)
        if model.geom_group[geom] >= _SHOWN or colour[3] == 0.0:
            continue
        place = Placement.turned(model.geom_pos[geom], model.geom_quat[geom])
        shape = _shape(mujoco, model, geom, place, colour, files)
        if shape is not None:
            shapes[model.geom_bodyid[geom]].append(shape)
    return [tuple(of_body) for of_body in shapes]


def _shape(
    mujoco: Any, model: Any, geom: int, place: Placement, colour: tuple[float, ...], files: dict[int, str]
) -> Shape | None:
    kind, size, kinds = int(model.geom_type[geom]), model.geom_size[geom].tolist(), mujoco.mjtGeom
    if kind == int(kinds.mjGEOM_BOX):
        return Shape("box", (2.0 * size[0], 2.0 * size[1], 2.0 * size[2]), place, colour)
    if kind == int(kinds.mjGEOM_SPHERE):
        return Shape("sphere", (size[0],), place, colour)
    if kind in (int(kinds.mjGEOM_CYLINDER), int(kinds.mjGEOM_CAPSULE)):
        return Shape("cylinder", (size[0], 2.0 * size[1]), place, colour)
    mesh = int(model.geom_dataid[geom])
    if kind != int(kinds.mjGEOM_MESH) or mesh not in files:
        return None
    moved = Placement.turned(model.mesh_pos[mesh], model.mesh_quat[mesh])  # MuJoCo moves meshes to their principal axes
    return Shape("mesh", tuple(model.mesh_scale[mesh].tolist()), place @ moved.inverse, colour, files[mesh])


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
