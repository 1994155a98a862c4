"""First derivatives of a loaded equilibrium: how the tip follows the motors, and how it gives way to a load."""

from __future__ import annotations

import numpy as np

from softrobots.checks import FloatArray
from softrobots.equilibrium import Equilibrium, check_same_model
from softrobots.errors import NeutralEquilibrium
from softrobots.kinematics import frame_jacobian
from softrobots.loads import GeneralisedLoad
from softrobots.model import SoftModel


def elastostatic_jacobian(model: SoftModel, equilibrium: Equilibrium) -> FloatArray:
    r"""Derivative of the loaded tip position with respect to the motors, at constant load.

    .. math:: dx/dq_m = J_m + J_k K_t^{-1} \, d(J_k^T w - g_k)/dq_m

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.

    Returns:
        Shape (3, n_motors) [m/rad or m/m], world axes.

    Raises:
        ParameterError: If the equilibrium belongs to another model.
        NeutralEquilibrium: If its tangent stiffness is singular.
    """
    check_same_model(model, equilibrium)
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
        ParameterError: If the equilibrium belongs to another model.
        NeutralEquilibrium: If its tangent stiffness is singular.
    """
    check_same_model(model, equilibrium)
    springs = frame_jacobian(model, equilibrium.q, model.tip)[:, model.spring_indices]
    return np.asarray(springs @ _solve(equilibrium.tangent_stiffness, springs.T))


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
        NeutralEquilibrium: If the tangent stiffness is singular.
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
        NeutralEquilibrium: If the tangent stiffness is singular.
    """
    motors, springs = model.motor_indices, model.spring_indices
    follow = _solve(tangent, jacobian[:, springs].T)
    return np.asarray(jacobian[:, motors].T + joints.derivative[motors[:, None], springs] @ follow)


def _solve(tangent: FloatArray, right: FloatArray) -> FloatArray:
    try:
        return np.asarray(np.linalg.solve(tangent, right))
    except np.linalg.LinAlgError as error:
        raise NeutralEquilibrium("the tangent stiffness is singular: a neutral equilibrium has no derivative") from error
