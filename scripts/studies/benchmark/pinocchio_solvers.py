r"""Equilibria and load estimation as one writes them with Pinocchio in Python: no checks, no result objects, data made once.

Springs are in balance where `r = k (y - rest) - J_k^T f + g_k` vanishes. The fixed point repeats
`y <- rest + (J_k^T f - g_k) / k` ([Troise 2021] Figure 6). Newton's method needs the derivative of `J^T f`, which Pinocchio
gives in two ways, each a function here. All stop at `|r| <= 1e-10 |f| L`.

NumPy on seven numbers costs more than Pinocchio does, so the vectors have one entry a joint, motors too, with no stiffness and
no softness there: nothing is gathered or scattered. That makes the fixed point a third faster than with index arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import skew
from softrobots.model.soft_model import SoftModel

TOLERANCE = 1e-10
"""Largest residual, relative to force times reach."""

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
_MOST = 1000  # iterations of the fixed point; it ends, converged or not
_MOST_NEWTON = 50


class PinocchioArm:
    """A robot of motors and linear joint springs, with what its solvers keep from case to case."""

    def __init__(self, model: SoftModel, gravity: tuple[float, float, float] | None = None) -> None:
        """Prepare arrays and Pinocchio's data.

        Args:
            model: A robot of revolute and prismatic joints, without sections and muscles.
            gravity: Gravity, world axes [m/s^2]; None: weightless.
        """
        self.pin, self.data = model.workspace((0.0, 0.0, 0.0) if gravity is None else gravity)
        self.weightless = gravity is None
        self.tip, self.size, self.reach = model.frame_id(model.tip), model.pinocchio.nv, model.reach
        self.motors, self.springs = model.motor_indices, model.spring_indices
        self.joint = self.pin.frames[self.tip].parentJoint
        self.stiffness, self.softness, self.rest = (np.zeros(self.size) for _ in range(3))
        self.stiffness[self.springs], self.rest[self.springs] = model.stiffness, model.rest
        self.softness[self.springs] = 1.0 / model.stiffness
        self.block = np.ix_(self.springs, self.springs)
        self.spring_matrix = np.diag(model.stiffness)
        lever = np.array(self.pin.frames[self.tip].placement.translation)
        self.to_wrench = np.vstack([np.eye(3), skew(lever)])  # of a force at the tip, in the axes of its joint
        self.forces = pin.StdVec_Force()
        self.forces.extend([pin.Force.Zero() for _ in range(self.pin.njoints)])
        self.upper = np.triu(np.ones((self.size, self.size)))
        self.strictly_upper = np.triu(np.ones((self.size, self.size)), 1)

    def start(self, q_motors: FloatArray) -> FloatArray:
        """Configuration with relaxed springs, shape (nv,)."""
        q: FloatArray = self.rest.copy()
        q[self.motors] = q_motors
        return q

    def limit(self, force: FloatArray) -> float:
        """Largest residual [N m]."""
        return TOLERANCE * math.sqrt(float(force @ force)) * self.reach


def fixed_point(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
    """Repeat `y <- rest + (J_k^T f - g_k) / k`.

    Args:
        arm: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        force: Force on the tip, world axes, shape (3,) [N].

    Returns:
        Configuration, shape (nv,) [rad or m].
    """
    base, wrench, limit = arm.start(q_motors), np.zeros(6), arm.limit(force)
    wrench[:3] = force
    q = base
    for _ in range(_MOST):
        load = wrench @ pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)
        if not arm.weightless:
            load = load - pin.computeGeneralizedGravity(arm.pin, arm.data, q)
        new = base + arm.softness * load
        residual = arm.stiffness * (new - q)
        if math.sqrt(residual @ residual) <= limit:
            break
        q = new
    return q


def plain_fixed_point(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
    """`fixed_point`, weightless, as one writes it first: the springs' columns of the Jacobian, by index arrays."""
    q, limit = arm.start(q_motors), TOLERANCE * np.linalg.norm(force) * arm.reach
    stiffness, rest = arm.stiffness[arm.springs], arm.rest[arm.springs]
    for _ in range(_MOST):
        jacobian = pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)[:3, arm.springs]
        torque = jacobian.T @ force
        if np.linalg.norm(torque - stiffness * (q[arm.springs] - rest)) <= limit:
            break
        q[arm.springs] = rest + torque / stiffness
    return q


def newton_by_hessian(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
    r"""Newton, weightless, with Pinocchio's kinematic Hessian, :math:`d(J^T f)/dq = \sum_i f_i H_i`; as `fixed_point`."""
    q, limit = arm.start(q_motors), arm.limit(force)
    for _ in range(_MOST_NEWTON):
        pin.computeJointJacobians(arm.pin, arm.data, q)
        jacobian = pin.getFrameJacobian(arm.pin, arm.data, arm.tip, _AXES)[:3]
        residual = (arm.stiffness * (q - arm.rest) - force @ jacobian)[arm.springs]
        if math.sqrt(residual @ residual) <= limit:
            break
        slope = hessian(arm)[..., :3] @ force
        q[arm.springs] -= np.linalg.solve(arm.spring_matrix - slope[arm.block], residual)
    return q


def newton_by_torque_derivatives(arm: PinocchioArm, q_motors: FloatArray, force: FloatArray) -> FloatArray:
    """Newton, with or without gravity, on `computeStaticTorqueDerivatives`; arguments of `fixed_point`.

    Pinocchio holds the force still in the axes of the link, which is a follower load; `-J_v^T (f x) J_w` makes it a dead one.
    """
    q, limit, across = arm.start(q_motors), arm.limit(force), skew(force)
    for _ in range(_MOST_NEWTON):
        jacobian = pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)
        residual = arm.stiffness * (q - arm.rest) - force @ jacobian[:3]
        if not arm.weightless:
            residual += pin.computeGeneralizedGravity(arm.pin, arm.data, q)
        residual = residual[arm.springs]
        if math.sqrt(residual @ residual) <= limit:
            break
        arm.forces[arm.joint] = pin.Force(arm.to_wrench @ (force @ arm.data.oMi[arm.joint].rotation))
        slope = pin.computeStaticTorqueDerivatives(arm.pin, arm.data, q, arm.forces)
        slope = slope - jacobian[:3].T @ across @ jacobian[3:]
        q[arm.springs] -= np.linalg.solve(arm.spring_matrix + slope[arm.block], residual)
    return q


Solver = Callable[[PinocchioArm, FloatArray, FloatArray], FloatArray]
"""A solver of this module: robot, motor coordinates and force to configuration."""

NEWTON: dict[str, Solver] = {
    "kinematic Hessian": newton_by_hessian,
    "torque derivatives": newton_by_torque_derivatives,
}
"""Newton's methods by name."""


def hessian(arm: PinocchioArm) -> FloatArray:
    """Kinematic Hessian of the tip after `computeJointJacobians`: [i, j] is the derivative of column j by joint i, (nv, nv, 6).

    eigenpy hands the column-major array over with the strides of a row-major one of shape (6, nv, nv): the order of its axes
    is undone here.
    """
    pin.computeJointKinematicHessians(arm.pin, arm.data)
    scrambled = pin.getFrameKinematicHessian(arm.pin, arm.data, arm.tip, _AXES)
    return np.asarray(scrambled.reshape(arm.size, arm.size, 6))


def slope_by_jacobian(arm: PinocchioArm, jacobian: FloatArray, across: FloatArray) -> FloatArray:
    """Derivative of `J^T f`, shape (nv, nv), from the Jacobian, shape (6, nv), and the matrix `-f x`."""
    result = (jacobian[3:].T @ (across @ jacobian[:3])) * arm.upper
    result += (result * arm.strictly_upper).T
    return np.asarray(result)


def estimate_force(arm: PinocchioArm, q_motors: FloatArray, motor_torques: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find force and springs together, weightless, by Newton on seven equations: springs in balance, `J_m^T f = motor_torques`.

    It starts from relaxed springs and the force that explains the torques there, and fails where torques say little of the
    force. For three motors and any number of springs.

    Args:
        arm: The robot.
        q_motors: Motor coordinates, shape (3,) [rad or m].
        motor_torques: Load on each motor, shape (3,) [N m].

    Returns:
        Force, shape (3,) [N], and configuration, shape (nv,) [rad or m].
    """
    q, count = arm.start(q_motors), len(arm.springs)
    limit = TOLERANCE * math.sqrt(float(motor_torques @ motor_torques))
    jacobian = pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)
    force = np.linalg.solve(jacobian[:3, arm.motors].T, motor_torques)
    matrix, residual = np.zeros((count + 3, count + 3)), np.zeros(count + 3)
    for _ in range(_MOST_NEWTON):
        load = force @ jacobian[:3]
        residual[:count] = (arm.stiffness * (q - arm.rest) - load)[arm.springs]
        residual[count:] = load[arm.motors] - motor_torques
        if math.sqrt(residual @ residual) <= limit:
            break
        slope = slope_by_jacobian(arm, jacobian, -skew(force))[:, arm.springs]
        matrix[:count, :count] = arm.spring_matrix - slope[arm.springs]
        matrix[:count, count:] = -jacobian[:3, arm.springs].T
        matrix[count:, :count] = slope[arm.motors]
        matrix[count:, count:] = jacobian[:3, arm.motors].T
        step = np.linalg.solve(matrix, residual)
        q[arm.springs] -= step[:count]
        force = force - step[count:]
        jacobian = pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)
    return force, q


def residual_and_slope(arm: PinocchioArm, q: FloatArray, force: FloatArray) -> tuple[FloatArray, Any]:
    """Residual of the springs, shape (n,), and its derivative, shape (n, n), weightless; what SciPy's solvers are given."""
    jacobian = pin.computeFrameJacobian(arm.pin, arm.data, q, arm.tip, _AXES)
    residual = (arm.stiffness * (q - arm.rest) - force @ jacobian[:3])[arm.springs]
    return residual, arm.spring_matrix - slope_by_jacobian(arm, jacobian, -skew(force))[arm.block]
