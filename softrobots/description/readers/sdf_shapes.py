"""Visible shapes of an SDF file, as far as URDF has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import read_only
from softrobots.description.mesh_files import DRAWN_FILES
from softrobots.description.readers.sdf_text import warnings_of_drake, with_found_meshes
from softrobots.description.rigid_tree import Placement, Shape


def visible_shapes(text: str, path: Path | None) -> dict[str, list[Shape]]:
    """Return the visual shapes of every link, by its scoped name `model::link`.

    Meshes whose files are missing are omitted; the result is empty if Drake cannot read one of the others. Mesh files are
    relative to the file of the document, if it has one.
    """
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.multibody.tree import BodyIndex
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()  # owns plant and scene
    plant, scene = AddMultibodyPlantSceneGraph(builder, 1e-3)
    parser = Parser(plant)
    try:
        with warnings_of_drake(shown=False):
            parser.AddModelsFromString(with_found_meshes(text, None if path is None else path.parent), "sdf")
    except (Exception, SystemExit):  # SystemExit: assertions of Drake
        return {}
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
    kind, rgba = type(shape).__name__, _colour(inspector.GetIllustrationProperties(geometry))
    if kind == "Box":
        return Shape("box", (shape.width(), shape.depth(), shape.height()), place, rgba)
    if kind == "Sphere":
        return Shape("sphere", (shape.radius(),), place, rgba)
    if kind in ("Cylinder", "Capsule"):
        return Shape("cylinder", (shape.radius(), shape.length()), place, rgba)
    if kind == "Mesh" and shape.source().is_path() and shape.extension() in DRAWN_FILES:
        return Shape("mesh", tuple(np.array(shape.scale3()).tolist()), place, rgba, str(shape.source().path()))
    return None


def _colour(properties: Any) -> tuple[float, ...] | None:
    if properties is None or not properties.HasProperty("phong", "diffuse"):
        return None
    colour = properties.GetProperty("phong", "diffuse")
    return tuple(round(float(value), 6) for value in (colour.r(), colour.g(), colour.b(), colour.a()))
