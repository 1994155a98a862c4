r"""A frictionless probe on a robot: where it is on its line, and what it does to the springs.

The probe moves along a straight world line of direction `n` and touches the robot

- at a *point* of it, free to move across the line: the displacement is `g = n . (p - p_0)`, the force is along `n`; or
- on a *face* of it, along which it slides: the plane through the point that is fixed in the frame, with the normal `m`.
  The probe is where its line meets the plane, :math:`g = m \cdot (p - p_0) / (m \cdot n)`, and the force is along `m`.

`p_0` is where the point is without the probe. The torques of a reaction `F` along the line are :math:`F \nabla g` both times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.statics.loads import cross_matrix

_FLAT = 1e-3  # least cosine between the probe's line and the normal of the face
_SAME = 1e-9  # numbers of two probes that differ by no more are the same [m or -]


@dataclass(frozen=True, eq=False)
class Probe:
    """A probe on a robot: where it touches, and the line that it moves along."""

    frame: str
    """Frame of the robot that is touched."""
    point: FloatArray
    """The point that is touched, in that frame, shape (3,) [m]."""
    direction: FloatArray
    """Direction of the line, shape (3,), world axes, of length 1."""
    origin: FloatArray
    """Where the line starts: the point without the probe, shape (3,) [m], world axes."""
    normal: FloatArray | None
    """Normal of the face that the probe slides on, in the frame, shape (3,), of length 1; None: it holds to the point."""

    def same_as(self, other: Probe) -> bool:
        """Whether another probe touches the same place and moves along the same line."""
        if self.frame != other.frame or (self.normal is None) != (other.normal is None):
            return False
        mine, its = (
            np.concatenate([p.point, p.direction, p.origin, np.zeros(3) if p.normal is None else p.normal])
            for p in (self, other)
        )
        return bool(np.allclose(mine, its, rtol=0.0, atol=_SAME))


class Contact(NamedTuple):
    """A probe on the robot in one pose."""

    displacement: float
    """Where the probe is on its line [m]."""
    place: FloatArray
    """The same as a point of the world, shape (3,); of a probe that holds to its point, that point."""
    wrench: FloatArray
    """Wrench on the frame for a reaction of 1 N along the line, shape (6,) [N, N m]."""
    gradient: FloatArray
    """Derivative of the displacement with respect to the elastic coordinates, shape (n,)."""
    turning: FloatArray
    """What the dead wrench leaves out of the second derivative of the displacement, shape (n, n)."""


def touch(probe: Probe, pose: Any, jacobian: FloatArray) -> Contact:
    """Bring a probe to the robot.

    Args:
        probe: The probe.
        pose: Pose of its frame, a `pinocchio.SE3`.
        jacobian: Geometric Jacobian of the frame per elastic coordinate, world axes, linear rows first, shape (6, n).

    Returns:
        The contact; its displacement is NaN where the face runs along the probe's line or has turned away from it.
    """
    linear, angular = jacobian[:3], jacobian[3:]
    lever, n = pose.rotation @ probe.point, probe.direction
    offset = pose.translation + lever - probe.origin
    if probe.normal is None:
        wrench = np.concatenate([n, cross_matrix(lever) @ n])
        lever_moved = -cross_matrix(lever) @ angular
        turning = angular.T @ (cross_matrix(n).T @ lever_moved)
        return Contact(float(n @ offset), probe.origin + offset, wrench, wrench @ jacobian, turning)
    m = pose.rotation @ probe.normal
    slope = float(m @ n)
    displacement = float(m @ offset) / slope if slope > _FLAT else math.nan
    slope = max(slope, _FLAT)
    force, arm = m / slope, lever + displacement * n - offset  # arm: from the frame to the probe
    wrench = np.concatenate([force, cross_matrix(arm) @ force])
    gradient = wrench @ jacobian
    turned = -cross_matrix(m) @ angular  # how the normal moves
    force_turned = turned / slope - np.outer(m, n @ turned) / slope**2
    arm_moved = np.outer(n, gradient) - linear
    moment_turned = cross_matrix(force).T @ arm_moved + cross_matrix(arm) @ force_turned
    return Contact(
        displacement, probe.origin + displacement * n, wrench, gradient, linear.T @ force_turned + angular.T @ moment_turned
    )


def face_normal(line: FloatArray, axis: FloatArray, along: Any) -> FloatArray:
    """Normal of the face that holds an axis and is turned most towards a line.

    Args:
        line: Direction of the line in the frame, shape (3,), of length 1.
        axis: The axis in the frame, shape (3,), of length 1.
        along: What the caller gave for it, for the error.

    Returns:
        The normal in the frame, shape (3,), of length 1.

    Raises:
        ParameterError: If the axis runs along the line.
    """
    across = line - float(line @ axis) * axis
    length = float(np.linalg.norm(across))
    if length < _FLAT:
        raise ParameterError("along", along, "an axis that does not run along the probe's line")
    return np.asarray(across / length)
