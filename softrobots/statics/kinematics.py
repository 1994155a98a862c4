"""Forward kinematics and geometric Jacobians of the frames of a robot."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def frame_placement(model: SoftModel, q: FloatArray, frame: str) -> Any:
    """Pose of a frame in the world, a new `pinocchio.SE3` [m], at Pinocchio's configuration, shape (nq,).

    Raises:
        NameNotFound: If there is no such frame.
    """
    pin_model, data = model.workspace(None)
    pin.forwardKinematics(pin_model, data, q)
    return pin.SE3(pin.updateFramePlacement(pin_model, data, model.frame_id(frame)))


def frame_jacobian(model: SoftModel, q: FloatArray, frame: str) -> FloatArray:
    """Geometric Jacobian of a frame in world axes, [Troise 2021] (4), shape (6, nv), linear rows first [m/rad; rad/rad].

    Raises:
        NameNotFound: If there is no such frame.
    """
    pin_model, data = model.workspace(None)
    if pin_model.nv == 0:
        model.frame_id(frame)
        return np.zeros((6, 0))
    jacobian = pin.computeFrameJacobian(pin_model, data, q, model.frame_id(frame), _AXES)
    return np.asarray(jacobian).reshape(6, pin_model.nv)


def backbone(model: SoftModel, q: FloatArray) -> FloatArray:
    """Origins of the joints from base to tip at a configuration, shape (n, 3) [m]; repeated points are dropped."""
    pin_model, data = model.workspace(None)
    pin.forwardKinematics(pin_model, data, q)
    frame = model.frame_id(model.tip)
    points = [np.array(pin.updateFramePlacement(pin_model, data, frame).translation)]
    for joint in list(pin_model.supports[pin_model.frames[frame].parentJoint])[:0:-1]:
        point = np.array(data.oMi[joint].translation)
        if float(np.linalg.norm(point - points[-1])) > 1e-12:
            points.append(point)
    return np.array(points[::-1])
