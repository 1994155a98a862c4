"""The visual shapes of a robot, and their poses at a configuration."""

from __future__ import annotations

import math
import warnings
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ViewerError
from softrobots.description.mesh_files import MissingMeshWarning, only_found
from softrobots.model.soft_model import SoftModel
from softrobots.view.camera import box_corners
from softrobots.view.mesh_triangles import ColouredPart, bounds, coloured_parts, has_finite_corners, readable


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
    """Whether springs or sections move it, so that it is drawn without the load, too; not the balls in the bends of a wall."""
    of_section: bool
    """Whether it is a link of the rigid chain that stands for a section."""
    place: int
    """Number of the visual shape in the description."""


class RobotShapes:
    """The visual shapes of a model, and their poses at a configuration."""

    def __init__(self, model: SoftModel) -> None:
        """Read the visual shapes from the model's URDF.

        Meshes `package://..` are looked up in the folders of ROS_PACKAGE_PATH, AMENT_PREFIX_PATH and of example-robot-data.
        Meshes whose files are missing or cannot be read are left out, with a `MissingMeshWarning`.

        Raises:
            ViewerError: If the shapes cannot be read for another reason.
        """
        self._model = model
        pin_model, _ = model.workspace(None)
        drawn, missing = only_found(model.urdf)
        try:
            try:
                self._geometry = pin.buildGeomFromUrdfString(pin_model, drawn, pin.GeometryType.VISUAL)
                whole = all(has_finite_corners(shape.geometry) for shape in self._geometry.geometryObjects)
            except (ValueError, RuntimeError):
                whole = False
            if not whole:
                drawn, missing = only_found(model.urdf, readable)  # takes longer: reads every file
                self._geometry = pin.buildGeomFromUrdfString(pin_model, drawn, pin.GeometryType.VISUAL)
        except (ValueError, RuntimeError) as error:
            raise ViewerError(f"the visual shapes of {pin_model.name} cannot be read: {error}") from error
        if missing:
            warnings.warn(MissingMeshWarning(pin_model.name, missing), stacklevel=2)
        self._data = self._geometry.createData()
        links, elastic = self._inflated_links(), self._elastic_joints()
        sections = tuple(section.name for section in model.structure.section_table)
        names: dict[str, int] = {}
        shapes = []
        for place, shape in enumerate(self._geometry.geometryObjects):
            for geometry, colour in _parts(shape):
                names[shape.name] = names.get(shape.name, 0) + 1
                unique = shape.name if names[shape.name] == 1 else f"{shape.name}_{names[shape.name]}"
                ball = isinstance(geometry, coal.Sphere) and links[place] is not None
                moved = shape.parentJoint in elastic and not ball
                shapes.append(Shape(unique, geometry, colour, links[place], moved, unique.startswith(sections), place))
        self.shapes = tuple(shapes)
        """Every shape."""
        self.joints = tuple(int(self._geometry.geometryObjects[shape.place].parentJoint) for shape in shapes)
        """Number of the joint of Pinocchio's model that moves each of them; 0: none."""

    def transforms(self, q: FloatArray) -> list[FloatArray]:
        """Return the pose of each of `shapes` in the world at a configuration, each of shape (4, 4) [m]."""
        pin_model, data = self._model.workspace(None)
        pin.updateGeometryPlacements(pin_model, data, self._geometry, self._data, q)
        poses = [np.array(pose.homogeneous) for pose in self._data.oMg]
        return [poses[shape.place] for shape in self.shapes]

    @cached_property
    def boxes(self) -> FloatArray:
        """Corners of a box around each of `shapes` in its own axes, shape (n, 8, 3) [m]."""
        return np.array([box_corners(*bounds(shape.geometry)) for shape in self.shapes]).reshape(-1, 8, 3)

    def ground(self) -> float | None:
        """Return the height of the lowest point that is fixed to the world [m]; None if no shape is fixed."""
        heights = []
        for shape in self._geometry.geometryObjects:
            if shape.parentJoint == 0:
                placed = shape.placement.rotation @ box_corners(*bounds(shape.geometry)).T
                heights.append(float(shape.placement.translation[2] + placed[2].min()))
        return min(heights, default=None)

    def _elastic_joints(self) -> set[int]:
        """Numbers of the joints that have a spring, are part of a section, or are carried by such a joint."""
        pin_model, structure = self._model.pinocchio, self._model.structure
        names = [*structure.spring_joints, *structure.section_joints]
        elastic = {pin_model.getJointId(name) for name in names}
        for joint in range(1, pin_model.njoints):  # parents have lower numbers
            if pin_model.parents[joint] in elastic:
                elastic.add(joint)
        return elastic

    def _inflated_links(self) -> list[int | None]:
        """Number of the inflated link of every shape, or None.

        An inflated link is the URDF links from its first spring to its last one and the cylinder of the same radius before its
        first spring. Other links that are fixed to it do not belong to it.
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
            supports = pin_model.supports[last].tolist()
            between = supports[supports.index(first) :] if first in supports else [last]
            for place, shape in enumerate(objects):
                tube = isinstance(shape.geometry, coal.Cylinder) and math.isclose(shape.geometry.radius, group.radius)
                of_another = moved[place] and shape.parentJoint in ends
                before = tube and shape.parentJoint == pin_model.parents[first] and not of_another
                if (shape.parentJoint in between and moved[place]) or before:
                    links[place] = number
        return links


def _parts(shape: Any) -> list[tuple[Any, tuple[float, float, float, float]]]:
    """Geometry and colour of each part of a visual shape; a colour in the description overrides those of a mesh file."""
    red, green, blue, opacity = np.array(shape.meshColor).tolist()
    described = (red, green, blue, opacity)
    if not isinstance(shape.geometry, coal.BVHModelBase):
        return [(shape.geometry, described)]
    parts: tuple[ColouredPart, ...] = coloured_parts(shape.geometry, Path(shape.meshPath), np.array(shape.meshScale).ravel())
    return [(part.surface, described if shape.overrideMaterial or part.rgba is None else part.rgba) for part in parts]
