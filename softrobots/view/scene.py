"""What a robot looks like: shapes on joints, poses of all shapes at a configuration, colours by wrinkling."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.description.mesh_files import MissingMeshWarning, only_found
from softrobots.description.third_party import package_folders
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.view.mesh_triangles import ColouredPart, coloured_parts, has_finite_corners, readable

WRINKLING_COLOURS = (
    (0.8, (1.00, 0.96, 0.66)),
    (0.6, (1.00, 0.80, 0.36)),
    (0.4, (0.99, 0.58, 0.25)),
    (0.2, (0.94, 0.30, 0.15)),
    (0.0, (0.72, 0.00, 0.15)),
    (-np.inf, (0.33, 0.00, 0.45)),
)
"""Colours of an inflated link by the share of its wrinkling moment that is left, at least; the last one is wrinkled.
Ordered in lightness too, so that they can be told apart in grey and by colour-blind people."""


class Shape(NamedTuple):
    """One visual shape of a robot; a mesh of several colours is several shapes."""

    name: str
    """Unique name."""
    geometry: Any
    """A `coal` shape, or the `softrobots.view.mesh_triangles.Triangles` of a mesh."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity."""
    inflated_link: int | None
    """Number of the inflated link that it is part of, for colouring by wrinkling."""
    elastic: bool
    """Whether springs or sections move it, so that the loaded robot has it elsewhere than the rigid one."""
    place: int
    """Number of the visual shape in the description."""


class Scene:
    """The visual shapes of a model, and where they are at a configuration."""

    def __init__(self, model: SoftModel) -> None:
        """Read the visual shapes out of the model's URDF.

        Meshes `package://..` are looked up in the folders of ROS_PACKAGE_PATH, AMENT_PREFIX_PATH and of example-robot-data. The
        robot is drawn without those whose files are missing or cannot be read, with a `MissingMeshWarning`.

        Raises:
            ViewerError: If the shapes cannot be read for another reason.
        """
        self._model = model
        pin_model, _ = model.workspace(None)
        folders = package_folders()
        drawn, missing = only_found(model.urdf, folders)
        try:
            try:
                self._geometry = pin.buildGeomFromUrdfString(pin_model, drawn, pin.GeometryType.VISUAL)
                whole = all(has_finite_corners(shape.geometry) for shape in self._geometry.geometryObjects)
            except (ValueError, RuntimeError):
                whole = False
            if not whole:
                drawn, missing = only_found(model.urdf, folders, readable)  # takes longer: reads every file
                self._geometry = pin.buildGeomFromUrdfString(pin_model, drawn, pin.GeometryType.VISUAL)
        except (ValueError, RuntimeError) as error:
            raise ViewerError(f"the visual shapes of {pin_model.name} cannot be read: {error}") from error
        if missing:
            warnings.warn(MissingMeshWarning(pin_model.name, missing), stacklevel=2)
        self._data = self._geometry.createData()
        links, elastic = self._inflated_links(), self._elastic_joints()
        names: dict[str, int] = {}
        shapes = []
        for place, shape in enumerate(self._geometry.geometryObjects):
            for geometry, colour in _parts(shape):
                names[shape.name] = names.get(shape.name, 0) + 1
                unique = shape.name if names[shape.name] == 1 else f"{shape.name}_{names[shape.name]}"
                shapes.append(Shape(unique, geometry, colour, links[place], shape.parentJoint in elastic, place))
        self.shapes = tuple(shapes)
        """Every shape."""

    def transforms(self, q: FloatArray) -> list[FloatArray]:
        """Poses of the shapes in the world at a configuration, each shape (4, 4) [m], in the order of `shapes`."""
        pin_model, data = self._model.workspace(None)
        pin.updateGeometryPlacements(pin_model, data, self._geometry, self._data, q)
        poses = [np.array(pose.homogeneous) for pose in self._data.oMg]
        return [poses[shape.place] for shape in self.shapes]

    def ground(self) -> float | None:
        """Height of the lowest point of what is fixed to the world [m]; None if no shape is."""
        heights = []
        for shape in self._geometry.geometryObjects:
            if shape.parentJoint == 0:
                shape.geometry.computeLocalAABB()
                box = shape.geometry.aabb_local
                middle, half = 0.5 * (np.array(box.max_) + np.array(box.min_)), 0.5 * (np.array(box.max_) - np.array(box.min_))
                turned = np.abs(np.array(shape.placement.rotation)[2]) @ half
                heights.append(float(shape.placement.act(middle)[2] - turned))
        return min(heights, default=None)

    def _elastic_joints(self) -> set[int]:
        """Numbers of the joints that have a spring, are part of a section, or come after such a joint."""
        pin_model, structure = self._model.pinocchio, self._model.structure
        names = [*structure.spring_joints, *(name for tag in structure.parts.sections for name in tag.joints)]
        elastic = {pin_model.getJointId(name) for name in names}
        for joint in range(1, pin_model.njoints):  # parents have lower numbers
            if pin_model.parents[joint] in elastic:
                elastic.add(joint)
        return elastic

    def _inflated_links(self) -> list[int | None]:
        """Inflated link of every shape: the link on its last spring, and the tube of its radius just before its first.

        What is mounted on that link is no part of it.
        """
        pin_model, objects = self._model.pinocchio, self._geometry.geometryObjects
        links: list[int | None] = [None] * len(objects)
        sections = self._model.structure.section_of
        frames = pin_model.frames
        moved = [frames[frames[shape.parentFrame].parentFrame].type == pin.FrameType.JOINT for shape in objects]
        ends = {pin_model.getJointId(self._model.spring_joints[group.springs[-1]]) for group in self._model.spring_groups}
        for number, group in enumerate(self._model.spring_groups):
            names = [self._model.spring_joints[place] for place in group.springs]
            if all(name in sections for name in names):  # the pieces of its sections
                joints = {pin_model.getJointId(joint) for name in names for joint in sections[name].joint_names}
                for place, shape in enumerate(objects):
                    if shape.parentJoint in joints and moved[place]:
                        links[place] = number
                continue
            first, last = (pin_model.getJointId(names[place]) for place in (0, -1))
            for place, shape in enumerate(objects):
                tube = isinstance(shape.geometry, coal.Cylinder) and math.isclose(shape.geometry.radius, group.radius)
                of_another = moved[place] and shape.parentJoint in ends
                before = tube and shape.parentJoint == pin_model.parents[first] and not of_another
                if (shape.parentJoint == last and moved[place]) or before:
                    links[place] = number
        return links


def _parts(shape: Any) -> list[tuple[Any, tuple[float, float, float, float]]]:
    """Geometry and colour of each part of a visual shape; a colour in the description goes before those of a mesh file."""
    red, green, blue, opacity = np.array(shape.meshColor).tolist()
    said = (red, green, blue, opacity)
    if not isinstance(shape.geometry, coal.BVHModelBase):
        return [(shape.geometry, said)]
    parts: tuple[ColouredPart, ...] = coloured_parts(shape.geometry, Path(shape.meshPath), np.array(shape.meshScale).ravel())
    return [(part.surface, said if shape.overrideMaterial or part.rgba is None else part.rgba) for part in parts]


def wrinkling_level(equilibrium: Equilibrium, link: int) -> int:
    """Place in `WRINKLING_COLOURS` of an inflated link at an equilibrium.

    Args:
        equilibrium: The loaded robot.
        link: Number of the inflated link, from 0.

    Returns:
        The place; the last one means wrinkled.
    """
    limit = equilibrium.model.spring_groups[link].wrinkling_moment
    moment = float(equilibrium.link_moments[link])
    if moment >= limit or equilibrium.saturated[link]:
        return len(WRINKLING_COLOURS) - 1
    return next(level for level, (least, _) in enumerate(WRINKLING_COLOURS) if 1.0 - moment / limit >= least)
