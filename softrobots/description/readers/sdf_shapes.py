"""Shapes of an SDF file: the visible ones as far as URDF has them, and all that collide."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.mesh_files import DRAWN_FILES
from softrobots.description.readers.sdf_text import collisions_as_visuals, warnings_of_drake, with_found_meshes
from softrobots.description.rigid_tree import Placement, Shape


def visible_shapes(text: str, path: Path | None) -> dict[str, list[Shape]]:
    """Return the visual shapes of every link, by its scoped name `model::link`; capsules as cylinders.

    Meshes whose files are missing are omitted; the result is empty if Drake cannot read one of the others. Mesh files are
    relative to the file of the document, if it has one.
    """
    try:
        drawn = _read(with_found_meshes(text, None if path is None else path.parent))
    except DescriptionError:
        return {}
    kinds = {"capsule": "cylinder"}
    return {
        link: [replace(shape, kind=kinds.get(shape.kind, shape.kind)) for shape in shapes if shape.kind != "plane"]
        for link, shapes in drawn.items()
    }


def collision_shapes(text: str, path: Path | None) -> dict[str, list[Shape]]:
    """Return the collision shapes of every link, likewise; those that are not read are there by their kind alone.

    If Drake refuses one of them, the first is there with the reason as its kind, and no other.
    """
    if "<collision" not in text:
        return {}
    readable, others = collisions_as_visuals(text, None if path is None else path.parent)
    try:
        shapes = _read(readable)
    except DescriptionError as error:
        link, name, kind = collisions_as_visuals(text, None, read=())[1][0]
        shapes, others = {}, [(link, name, f"{kind} or one after it, which Drake refuses ({error}),")]
    for link, name, kind in others:
        shapes.setdefault(link, []).append(Shape(kind, (), Placement(), name=name))
    return shapes


def _read(text: str) -> dict[str, list[Shape]]:
    """The visuals of a document that has only those that Drake reads, or DescriptionError if it refuses one."""
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.multibody.tree import BodyIndex
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()  # owns plant and scene
    plant, scene = AddMultibodyPlantSceneGraph(builder, 1e-3)
    parser = Parser(plant)
    try:
        with warnings_of_drake(shown=False):
            parser.AddModelsFromString(text, "sdf")
    except (Exception, SystemExit) as error:  # SystemExit: assertions of Drake
        raise DescriptionError(" ".join(str(error).split())) from error
    inspector, shapes = scene.model_inspector(), {}
    for number in range(plant.num_bodies()):
        body = plant.get_body(BodyIndex(number))
        drawn = [_shape(inspector, geometry) for geometry in plant.GetVisualGeometriesForBody(body)]
        shapes[body.scoped_name().get_full()] = [shape for shape in drawn if shape is not None]
    return shapes


def placement_of(pose: Any) -> Placement:
    """Return a `RigidTransform` of Drake as a placement."""
    return Placement(read_only(np.array(pose.translation())), read_only(np.array(pose.rotation().matrix())))


def _shape(inspector: Any, geometry: Any) -> Shape | None:
    shape, pose = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
    place = placement_of(pose)
    kind, rgba = type(shape).__name__.lower(), _colour(inspector.GetIllustrationProperties(geometry))
    name = str(inspector.GetName(geometry)).rpartition("::")[2]
    if kind == "box":
        return Shape("box", (shape.width(), shape.depth(), shape.height()), place, rgba, name=name)
    if kind == "sphere":
        return Shape("sphere", (shape.radius(),), place, rgba, name=name)
    if kind in ("cylinder", "capsule"):
        return Shape(kind, (shape.radius(), shape.length()), place, rgba, name=name)
    if kind == "halfspace":
        return Shape("plane", (), place, rgba, name=name)
    if kind == "mesh" and shape.source().is_path() and shape.extension() in DRAWN_FILES:
        return Shape("mesh", tuple(np.array(shape.scale3()).tolist()), place, rgba, str(shape.source().path()), name)
    return None


def _colour(properties: Any) -> tuple[float, ...] | None:
    if properties is None or not properties.HasProperty("phong", "diffuse"):
        return None
    colour = properties.GetProperty("phong", "diffuse")
    return tuple(round(float(value), 6) for value in (colour.r(), colour.g(), colour.b(), colour.a()))
