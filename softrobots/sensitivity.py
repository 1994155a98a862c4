"""First derivatives of a loaded equilibrium: how the tip follows the motors, and how it gives way to a load."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from softrobots.checks import FloatArray
from softrobots.equilibrium import Equilibrium
from softrobots.errors import ParameterError
from softrobots.loads import GeneralisedLoad
from softrobots.model import SoftModel

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def elastostatic_jacobian(model: SoftModel, equilibrium: Equilibrium) -> FloatArray:
    r"""Derivative of the loaded tip position with respect to the motors, at constant load.

    .. math:: dx/dq_m = J_m + J_k K_t^{-1} \, d(J_k^T w - g_k)/dq_m

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.

    Returns:
        Shape (3, n_motors) [m/rad or m/m], world axes.

    Raises:
        ParameterError: If the equilibrium belongs to another model or is neutral (singular tangent stiffness).
    """
    _same_model(model, equilibrium)
    jacobian = frame_jacobian(model, equilibrium.q, model.tip)[:3]
    return tip_motion(model, jacobian, equilibrium.tangent_stiffness, equilibrium.joint_derivative)[0]


def compliance(model: SoftModel, equilibrium: Equilibrium) -> FloatArray:
    """Motion of the tip per wrench added at the tip, motors held: `J_k K_t^-1 J_k^T`.

    Motion is translation, then rotation vector; the wrench is force, then moment; world axes. Symmetric if the load has a
    potential (Maxwell-Betti).

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.

    Returns:
        Shape (6, 6) [m/N, m/(N m); rad/N, rad/(N m)].

    Raises:
        ParameterError: If the equilibrium belongs to another model or is neutral (singular tangent stiffness).
    """
    _same_model(model, equilibrium)
    springs = frame_jacobian(model, equilibrium.q, model.tip)[:, model.spring_indices]
    return np.asarray(springs @ _solve(equilibrium.tangent_stiffness, springs.T))


def frame_jacobian(model: SoftModel, q: FloatArray, frame: str) -> FloatArray:
    """Geometric Jacobian of a frame in world axes, [Troise 2021] (4), shape (6, nv), linear rows first [m/rad; rad/rad].

    Args:
        model: The robot.
        q: Pinocchio's configuration, shape (nq,).
        frame: Name of the frame.

    Raises:
        NameNotFound: If there is no such frame.
    """
    pin_model, data = model.workspace(None)
    jacobian = pin.computeFrameJacobian(pin_model, data, q, model.frame_id(frame), _AXES)
    return np.asarray(jacobian).reshape(6, pin_model.nv)


def tip_motion(
    model: SoftModel, jacobian: FloatArray, tangent: FloatArray, derivative: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """How tip and springs follow the motors at constant load, from matrices at an equilibrium.

    Args:
        model: The robot.
        jacobian: Rows of the tip Jacobian, shape (m, nv).
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        derivative: Derivative of the generalised load, shape (nv, nv).

    Returns:
        `dx/dq_m`, shape (m, n_motors), and `dy/dq_m`, shape (n_springs, n_motors).

    Raises:
        ParameterError: If the tangent stiffness is singular.
    """
    motors, springs = model.motor_indices, model.spring_indices
    follow = _solve(tangent, derivative[springs[:, None], motors])
    return jacobian[:, motors] + jacobian[:, springs] @ follow, follow


def motor_torque_slope(model: SoftModel, jacobian: FloatArray, tangent: FloatArray, joints: GeneralisedLoad) -> FloatArray:
    r"""Derivative of the motor torques with respect to a tip force, springs following.

    .. math:: d\tau_m/df = J_m^T + d(J_m^T w - g_m)/dy \, K_t^{-1} J_k^T

    The transpose of the elastostatic Jacobian when the load has a potential.

    Args:
        model: The robot.
        jacobian: Linear rows of the tip Jacobian, shape (3, nv).
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        joints: The load in joint coordinates.

    Returns:
        Shape (n_motors, 3) [m].

    Raises:
        ParameterError: If the tangent stiffness is singular.
    """
    motors, springs = model.motor_indices, model.spring_indices
    follow = _solve(tangent, jacobian[:, springs].T)
    return np.asarray(jacobian[:, motors].T + joints.derivative[motors[:, None], springs] @ follow)


def _solve(tangent: FloatArray, right: FloatArray) -> FloatArray:
    try:
        return np.asarray(np.linalg.solve(tangent, right))
    except np.linalg.LinAlgError as error:
        raise ParameterError(
            "equilibrium", tangent, "away from a neutral equilibrium: its tangent stiffness is singular"
        ) from error


def _same_model(model: SoftModel, equilibrium: Equilibrium) -> None:
    if not isinstance(equilibrium, Equilibrium):
        raise ParameterError("equilibrium", equilibrium, "an Equilibrium of the model")
    if equilibrium.model is not model:
        raise ParameterError("equilibrium", equilibrium.model, f"an equilibrium of the model given, {model!r}")
