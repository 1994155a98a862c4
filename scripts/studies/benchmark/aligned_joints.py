"""The joints of a Pinocchio model, each about or along the z axis of its own frame: the least work for arrays and for C++."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel


class AlignedJoints(NamedTuple):
    """A serial chain of joints."""

    slides: tuple[bool, ...]
    """Which joints slide rather than turn."""
    rotations: FloatArray
    """Axes of each joint's frame in those of the frame before, shape (n, 3, 3)."""
    translations: FloatArray
    """Origin of each joint's frame in the frame before, shape (n, 3) [m]."""
    tip: FloatArray
    """The tip in the frame of the last joint, shape (3,) [m]."""


def aligned_joints(model: SoftModel) -> AlignedJoints:
    """Turn the frame of every joint so that its axis is z, and read the constant placements.

    Args:
        model: A robot whose joints are a chain from the base to the tip.

    Returns:
        The chain; joint coordinates are the same.

    Raises:
        ParameterError: If the robot is no such chain.
    """
    robot, slides, rotations, translations, before = model.pinocchio, [], [], [], np.eye(3)
    tip = robot.frames[model.frame_id(model.tip)]
    if list(robot.parents)[1:] != list(range(robot.njoints - 1)) or tip.parentJoint != robot.njoints - 1:
        raise ParameterError("model", model, "a chain of joints from the base to the tip, without branches")
    for joint, placement in zip(list(robot.joints)[1:], list(robot.jointPlacements)[1:], strict=True):
        subspace = np.asarray(joint.createData().S).reshape(6)
        slides.append(bool(subspace[:3].any()))
        after = _frame_about(subspace[:3] if slides[-1] else subspace[3:])
        rotations.append(before.T @ placement.rotation @ after)
        translations.append(before.T @ placement.translation)
        before = after
    return AlignedJoints(
        tuple(slides), np.array(rotations), np.array(translations), np.asarray(before.T @ tip.placement.translation)
    )


def _frame_about(axis: FloatArray) -> FloatArray:
    """A rotation matrix whose third column is a unit vector."""
    first = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = first - (first @ axis) * axis
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
