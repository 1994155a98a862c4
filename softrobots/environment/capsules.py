"""The body of a robot as capsules, which touch obstacles: those of its description, else its round collision shapes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import DescriptionError
from softrobots.description.rigid_tree_urdf import read_rigid_tree
from softrobots.description.urdf_tags import CapsuleTag
from softrobots.model.soft_model import SoftModel, check_model


@dataclass(frozen=True, eq=False)
class RobotCapsule:
    """A capsule of a robot: all points within a radius of a segment, its core, which moves with a joint."""

    link: str
    """Name of the link that carries it."""
    joint: int
    """Number of the joint that moves it in Pinocchio's model; 0, the world, for one that never moves."""
    start: FloatArray
    """Start of its core in the axes of the joint, shape (3,) [m]."""
    end: FloatArray
    """End of its core there, shape (3,) [m]; a sphere has both at one point."""
    radius: float
    """Radius [m]."""


def robot_capsules(model: SoftModel) -> tuple[RobotCapsule, ...]:
    """Return the capsules of a robot (`capsule_tags`), on its joints.

    Args:
        model: The robot.

    Returns:
        The capsules in the order of the description; also those before the first joint, which never move.

    Raises:
        ParameterError: If `model` is not a `SoftModel`.
        DescriptionError: If the description has neither capsules nor collision shapes that are spheres or cylinders.
    """
    capsules = []
    for tag in capsule_tags(model):
        frame = model.pinocchio.frames[model.frame_id(tag.link)]
        start, end = (read_only(np.asarray(frame.placement.act(np.array(point)))) for point in (tag.start, tag.end))
        capsules.append(RobotCapsule(tag.link, frame.parentJoint, start, end, tag.radius))
    return tuple(capsules)


def capsule_tags(model: SoftModel) -> tuple[CapsuleTag, ...]:
    """Return the capsules of a robot on its links.

    They are the tags `<softrobots:capsule>` of its description. In a file without any, spheres and cylinders of its
    `<collision>` tags count, cylinders as capsules of the same axis and radius, which are a cap longer at both ends; boxes and
    meshes beside them do not count.

    Raises:
        ParameterError: If `model` is not a `SoftModel`.
        DescriptionError: If the description has neither capsules nor collision shapes that are spheres or cylinders.
    """
    return check_model(model).structure.tags.capsules or _of_collisions(model)


def _of_collisions(model: SoftModel) -> tuple[CapsuleTag, ...]:
    bodies = read_rigid_tree(model.urdf).bodies
    tags = tuple(tag for body in bodies for tag in body.capsules)
    if not tags:
        shapes = [f"a {shape.kind} of link {body.name}" for body in bodies for shape in body.collisions]
        raise DescriptionError(
            f"{model.pinocchio.name} has no capsules to touch obstacles with; required: <softrobots:capsule link= start= end= "
            f"radius=/> in <robot>, or spheres or cylinders as <collision>; its collision shapes: "
            f"{', '.join(dict.fromkeys(shapes)) or 'none'}"
        )
    return tags
