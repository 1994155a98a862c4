"""What a robot touches, as it is drawn: obstacles as solids, and its contacts with them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.description.rigid_tree import capsule_shape
from softrobots.environment.capsules import capsule_tags
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Sphere
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact import Contact
from softrobots.statics.equilibrium import Equilibrium
from softrobots.view.mesh_triangles import Triangles

_SHEET = 0.01  # thickness of the sheet that stands for a half-space, of its side
_ROUND = (16, 32)  # rings and corners of the ends of a capsule


class DrawnObstacle(NamedTuple):
    """An obstacle, or a capsule of the robot."""

    geometry: Any
    """A `coal` shape, or the `softrobots.view.mesh_triangles.Triangles` of others."""
    pose: FloatArray
    """Pose of the axes of the geometry in the world, shape (4, 4) [m]."""


def drawn_obstacles(
    environment: Environment | None, centre: FloatArray, size: float, ground: float = -np.inf
) -> tuple[DrawnObstacle, ...]:
    """Return the obstacles of an environment as solids.

    A half-space is drawn as a square sheet whose face towards the free side lies in its plane.

    Args:
        environment: An environment whose obstacles stand still, or None.
        centre: Point whose projection is the middle of a sheet, shape (3,) [m].
        size: Side of a sheet [m].
        ground: Height on which upright sheets stand if they would reach below [m].

    Returns:
        One for each obstacle, in their order.
    """
    if environment is None:
        return ()
    return tuple(DrawnObstacle(*_solid(one, centre, size, ground)) for one in environment)


def drawn_contacts(equilibrium: Equilibrium) -> dict[str, Contact]:
    """Return the contacts of an equilibrium, by link, obstacle and a number where they touch in several places."""
    found: dict[str, Contact] = {}
    for contact in equilibrium.contacts:
        place = f"{contact.link}/{contact.obstacle}"
        number = sum(name.startswith(f"{place}/") for name in found)
        found[f"{place}/{number}"] = contact
    return found


def drawn_capsules(model: SoftModel, q: FloatArray) -> tuple[DrawnObstacle, ...]:
    """Return the capsules of a robot of links at a configuration, shape (nq,); none of sections, whose body shows them."""
    if model.structure.section_table:
        return ()
    pin_model, data = model.workspace(None)
    pin.framesForwardKinematics(pin_model, data, q)
    drawn = []
    for tag in capsule_tags(model):
        shape = capsule_shape(tag)
        placement = data.oMf[model.frame_id(tag.link)] * pin.SE3(shape.placement.rotation, shape.placement.position)
        drawn.append(DrawnObstacle(_capsule(*shape.size), placement.homogeneous))
    return tuple(drawn)


@lru_cache(maxsize=256)
def _capsule(radius: float, length: float = 0.0) -> Triangles:
    """Triangles of a capsule along z, or of a sphere."""
    from trimesh.creation import capsule

    solid = capsule(height=length, radius=radius, count=_ROUND)
    return Triangles(np.array(solid.vertices), np.array(solid.faces))


def _solid(obstacle: Any, centre: FloatArray, size: float, ground: float) -> tuple[Any, FloatArray]:
    """Geometry of an obstacle and its pose."""
    if isinstance(obstacle, HalfSpace):
        return _sheet(obstacle, centre, size, ground)
    pose = obstacle.transform_to_world
    match obstacle:
        case Sphere():
            return coal.Sphere(obstacle.radius), pose
        case Box():
            return coal.Box(*obstacle.size), pose
        case Cylinder():
            return coal.Cylinder(obstacle.radius, obstacle.length), pose
        case Capsule():
            return _capsule(obstacle.radius, obstacle.length), pose
    return Triangles(np.array(obstacle.vertices), np.array(obstacle.triangles)), pose


def _sheet(wall: HalfSpace, centre: FloatArray, size: float, ground: float) -> tuple[Any, FloatArray]:
    """A flat box behind the plane of a half-space, an edge of it level."""
    normal, origin = wall.transform_to_world[:3, 2], wall.transform_to_world[:3, 3]
    level = np.cross((0.0, 0.0, 1.0), normal)
    lying = np.linalg.norm(level) < 0.5
    level = np.array((1.0, 0.0, 0.0)) if np.linalg.norm(level) < 1e-9 else level / np.linalg.norm(level)
    up = np.cross(normal, level)
    middle = centre - (centre - origin) @ normal * normal
    if not lying:
        middle = middle + max(ground + 0.5 * size * up[2] - middle[2], 0.0) / up[2] * up
    pose, thick = np.eye(4), _SHEET * size
    pose[:3, :3] = np.column_stack([level, up, normal])
    pose[:3, 3] = middle - 0.5 * thick * normal
    return coal.Box(size, size, thick), pose
