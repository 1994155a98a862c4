"""What a robot looks like: shapes on joints, poses of all shapes at a configuration, colours by wrinkling."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from softrobots.checks import FloatArray
from softrobots.equilibrium import Equilibrium
from softrobots.errors import ViewerError
from softrobots.model import SoftModel

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
    """One visual shape of a robot."""

    name: str
    """Unique name."""
    geometry: Any
    """A `coal` shape."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity."""
    inflated_link: int | None
    """Number of the inflated link that it is part of, for colouring by wrinkling."""


class Scene:
    """The visual shapes of a model, and where they are at a configuration."""

    def __init__(self, model: SoftModel) -> None:
        """Read the visual shapes out of the model's URDF.

        Raises:
            ViewerError: If they cannot be read, e.g. because a mesh file is missing.
        """
        self._model = model
        pin_model, _ = model.workspace(None)
        try:
            self._geometry = pin.buildGeomFromUrdfString(pin_model, model.urdf, pin.GeometryType.VISUAL)
        except (ValueError, RuntimeError) as error:
            raise ViewerError(f"the visual shapes of {pin_model.name} cannot be read: {error}") from error
        self._data = self._geometry.createData()
        links = self._inflated_links()
        names: dict[str, int] = {}
        shapes = []
        for shape, link in zip(self._geometry.geometryObjects, links, strict=True):
            names[shape.name] = names.get(shape.name, 0) + 1
            unique = shape.name if names[shape.name] == 1 else f"{shape.name}_{names[shape.name]}"
            red, green, blue, opacity = np.array(shape.meshColor).tolist()
            shapes.append(Shape(unique, shape.geometry, (red, green, blue, opacity), link))
        self.shapes = tuple(shapes)
        """Every shape."""

    def transforms(self, q: FloatArray) -> list[FloatArray]:
        """Poses of the shapes in the world at a configuration, each shape (4, 4) [m], in the order of `shapes`."""
        pin_model, data = self._model.workspace(None)
        pin.updateGeometryPlacements(pin_model, data, self._geometry, self._data, q)
        return [np.array(pose.homogeneous) for pose in self._data.oMg]

    def _inflated_links(self) -> list[int | None]:
        """Inflated link of every shape: what hangs on its last spring, and the tube of its radius just before its first."""
        pin_model, objects = self._model.pinocchio, self._geometry.geometryObjects
        links: list[int | None] = [None] * len(objects)
        sections = self._model.structure.section_of
        for number, group in enumerate(self._model.spring_groups):
            names = [self._model.spring_joints[place] for place in group.springs]
            if all(name in sections for name in names):  # the pieces of its sections
                joints = {pin_model.getJointId(joint) for name in names for joint in sections[name].joint_names}
                for place, shape in enumerate(objects):
                    if shape.parentJoint in joints:
                        links[place] = number
                continue
            first, last = (pin_model.getJointId(names[place]) for place in (0, -1))
            for place, shape in enumerate(objects):
                tube = isinstance(shape.geometry, coal.Cylinder) and math.isclose(shape.geometry.radius, group.radius)
                before = tube and shape.parentJoint == pin_model.parents[first]
                if shape.parentJoint == last or before:
                    links[place] = number
        return links


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
    if moment >= limit:
        return len(WRINKLING_COLOURS) - 1
    return next(level for level, (least, _) in enumerate(WRINKLING_COLOURS) if 1.0 - moment / limit >= least)
