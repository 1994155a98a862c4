"""Reader of MJCF, the format of MuJoCo, from the model that MuJoCo compiles.

Coordinates are MuJoCo's `qpos`, also where `ref` is not zero: the placement of a joint carries `-ref`. `stiffness` and
`springref` become springs; hinges and slides without stiffness are motors. The gravity of the file is not read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import LARGEST, read_only
from softrobots.core.errors import DescriptionError, MissingDependency
from softrobots.core.xml_input import parse_xml
from softrobots.description.mesh_files import DRAWN_FILES, unfit_file
from softrobots.description.readers.mjcf_limits import check_mjcf
from softrobots.description.readers.mjcf_refusals import driven_joint, name_in, not_carried
from softrobots.description.readers.tree_builder import TreeBuilder
from softrobots.description.rigid_tree import SOLIDS, Body, Joint, Placement, RigidTree, Shape
from softrobots.description.urdf_tags import SpringTag

_SHOWN = 3  # MuJoCo's viewers show the geom groups below
_DEFAULT_COLOUR = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # of a geom without colour; its material's applies then


def read_mjcf(text: str, source: str, path: Path | None = None) -> RigidTree:
    """Read MJCF into a tree with the root link `world`.

    Unnamed bodies and joints are called `body_<number>` and `joint_<number>`, numbered by MuJoCo. A body with several joints
    gets a link `<body>_<joint>` before each but the last, with a little of the body's mass where that does not change the
    statics (`softrobots.description.readers.shared_mass`), else without mass. A hinge away from the origin of its body gets a
    link without mass at its anchor. A named site becomes a link without mass, unless a body has that name. The tip is the body
    or site called `tip`, or the only moving body at an end of the tree. Visible boxes, cylinders, spheres and mesh files are
    read, and capsules as cylinders; of collision shapes all kinds, those that nothing here reads by their kind alone.

    Features without effect on a loaded robot at rest are ignored: contacts, damping polynomials, sensors, armature of joints
    with stiffness, actuators with zero control, and position actuators of joints without stiffness, which are motors.

    The arguments are those of `softrobots.description.readers.to_urdf`.

    Raises:
        MissingDependency: If MuJoCo is not installed (extra `interop`).
        DescriptionError: If MuJoCo refuses it, it has no bodies, a number is not finite, it has a feature listed in
            `softrobots.description.readers.mjcf_refusals`, or exceeds a limit of `softrobots.description.readers.mjcf_limits`.
    """
    with MissingDependency.of_imports("mujoco", "interop"):
        import mujoco
    check_mjcf(parse_xml(text, source), source, path)
    try:
        model = mujoco.MjModel.from_xml_string(text) if path is None else mujoco.MjModel.from_xml_path(str(path))
    except Exception as error:  # ValueError, RuntimeError, mujoco.FatalError, and others from its compiler
        reason = " ".join(str(error).split())
        raise DescriptionError(f"MuJoCo {mujoco.__version__} refuses {source}: {reason}") from error
    reasons = not_carried(mujoco, model)
    if reasons:
        raise DescriptionError(f"{source} has features that a robot of springs and motors lacks: {'; '.join(reasons)}")
    shapes, collisions = (of(mujoco, model, text, path) for of in (visible_shapes, collision_shapes))
    bodies = [name_in(model, "body", number) for number in range(model.nbody)]
    joints = [name_in(model, "joint", number) for number in range(model.njnt)]
    name = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    builder = TreeBuilder(name, source, bodies, joints, _springs(model, joints))
    for number, name in enumerate(bodies):
        body = Body(
            name,
            float(model.body_mass[number]),
            Placement.turned(model.body_ipos[number], model.body_iquat[number]),
            read_only(np.diag(model.body_inertia[number])),
            shapes[number],
            collisions[number],
        )
        if number == 0:
            builder.draw_on_world(body)
            continue
        parent = bodies[model.body_parentid[number]]
        builder.add(body, parent, *_joints(mujoco, model, number, source, parent))
    for number in range(model.nsite):
        site = model.site(number)
        if site.name:
            builder.add_frame(site.name, bodies[model.site_bodyid[number]], Placement.turned(site.pos, site.quat))
    return builder.tree()


def _joints(mujoco: Any, model: Any, body: int, source: str, parent: str) -> tuple[list[Joint], Placement]:
    """Degrees of freedom of a body, each about its anchor, and the pose of the body in the frame of the last one."""
    place = Placement.turned(model.body_pos[body], model.body_quat[body])
    joints: list[Joint] = []
    first = int(model.body_jntadr[body])
    for joint in range(first, first + int(model.body_jntnum[body])):
        slides = int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        kind = "prismatic" if slides else "revolute"
        name, child = name_in(model, "joint", joint), name_in(model, "body", body)
        axis, anchor = np.array(model.jnt_axis[joint]), np.zeros(3) if slides else np.array(model.jnt_pos[joint])
        reference = float(model.qpos0[model.jnt_qposadr[joint]])
        if not abs(reference) <= LARGEST:
            raise DescriptionError(f"{source}: the joint {name} has ref = {reference}; up to {LARGEST:g} is read")
        dof = int(model.jnt_dofadr[joint])
        joints.append(
            Joint(
                name,
                kind,
                parent,
                child,
                place @ Placement(anchor) @ Placement.moved(kind, axis, -reference),
                axis,
                tuple(model.jnt_range[joint].tolist()) if model.jnt_limited[joint] else (-np.inf, np.inf),
                _effort(mujoco, model, joint),
                np.inf,
                float(model.dof_damping[dof]),
                float(model.dof_frictionloss[dof]),
                float(model.dof_armature[dof]) if model.jnt_stiffness[joint] == 0.0 else 0.0,
            )
        )
        place = Placement(-anchor)
    return joints, place


def _springs(model: Any, names: Sequence[str]) -> dict[str, SpringTag]:
    stiffness, rest = model.jnt_stiffness.tolist(), model.qpos_spring[model.jnt_qposadr].tolist()
    return {name: SpringTag(*pair) for name, *pair in zip(names, stiffness, rest, strict=True) if pair[0] != 0.0}


def _effort(mujoco: Any, model: Any, joint: int) -> float:
    """Largest torque of the actuators of a joint; infinite without limits."""
    if model.jnt_actfrclimited[joint]:
        return float(np.abs(model.jnt_actfrcrange[joint]).max())
    limits = [
        float(np.abs(model.actuator_forcerange[number]).max() * abs(model.actuator_gear[number, 0]))
        for number in np.flatnonzero(model.actuator_forcelimited).tolist()
        if driven_joint(mujoco, model, number) == joint
    ]
    return max(limits, default=np.inf)


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
