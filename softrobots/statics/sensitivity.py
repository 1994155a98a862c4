"""First derivatives of a loaded equilibrium: elastostatic Jacobian and compliance.

In contact they are those while every pressed contact stays pressed, and every one that sticks sticks.
"""

from __future__ import annotations

import contextlib
from typing import NamedTuple

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.held import held_contacts
from softrobots.statics.contact.pressed_gaps import PressedGaps
from softrobots.statics.elastic_state import scaled
from softrobots.statics.equilibrium import Equilibrium, check_same_model
from softrobots.statics.kinematics import frame_jacobian

_DEPENDENT = 1e-9  # least singular value of gradients over the largest that counts as independent


def elastostatic_jacobian(model: SoftModel, equilibrium: Equilibrium) -> FloatArray:
    r"""Derivative of the loaded tip position with respect to the motors, at constant load.

    .. math:: dx/dq_m = J_m + J_k K_t^{-1} \, d(J_k^T w - g_k)/dq_m

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.

    Returns:
        Shape (3, n_motors) [m/rad or m/m], world axes.

    Raises:
        ParameterError: If the equilibrium belongs to another model, or a contact slips, or must as motors move.
        NeutralEquilibrium: If its tangent stiffness is singular, see `inverse_stiffness`.
    """
    check_same_model(model, equilibrium)
    motors, springs = tip_columns(model, equilibrium.q_motors, equilibrium.q_springs)
    pressed = held_contacts(equilibrium, "a derivative by motors", moves=True) if equilibrium.contacts else None
    matrices = equilibrium.tangent_stiffness, equilibrium.coupling, pressed
    return tip_motion(model, motors[:3], springs[:3], *matrices)[0]


def compliance(model: SoftModel, equilibrium: Equilibrium) -> FloatArray:
    """Motion of the tip per wrench added at the tip, at fixed motors: `J_k K_t^-1 J_k^T`.

    Motion is translation, then rotation vector; the wrench is force, then moment; world axes. Symmetric if the load has a
    potential (Maxwell-Betti).

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.

    Returns:
        Shape (6, 6) [m/N, m/(N m); rad/N, rad/(N m)].

    Raises:
        ParameterError: If the equilibrium belongs to another model, or has a contact that slips.
        NeutralEquilibrium: If its tangent stiffness is singular, see `inverse_stiffness`.
    """
    check_same_model(model, equilibrium)
    _, springs = tip_columns(model, equilibrium.q_motors, equilibrium.q_springs)
    tangent = equilibrium.tangent_stiffness
    pressed = held_contacts(equilibrium, "a compliance") if equilibrium.contacts else None
    if pressed is None:
        inverse = inverse_stiffness(model, tangent)
    else:
        inverse = inverse_in_contact(model, tangent, pressed.by_springs).springs_by_load
    return np.asarray(springs @ inverse @ springs.T)


def tip_columns(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Geometric Jacobian of the tip per actuator and per elastic coordinate, the other fixed, world axes, linear rows first.

    Shapes (6, n_motors) and (6, n_springs).
    """
    point = model.coordinates.at(q_motors, q_springs)
    return point.columns(frame_jacobian(model, model.embed(point.joints), model.tip))


def tip_motion(
    model: SoftModel,
    motors: FloatArray,
    springs: FloatArray,
    tangent: FloatArray,
    coupling: FloatArray,
    pressed: PressedGaps | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of tip and springs by the motors at constant load, from matrices at an equilibrium.

    Args:
        model: The robot.
        motors: Rows of the tip Jacobian, columns per actuator, shape (m, n_motors).
        springs: The same rows, columns per elastic coordinate, shape (m, n_springs).
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        coupling: Derivative of the elastic load with respect to the actuators, shape (n_springs, n_motors).
        pressed: The gaps that stay zero; None without any.

    Returns:
        `dx/dq_m`, shape (m, n_motors), and `dy/dq_m`, shape (n_springs, n_motors). Of a load with a potential, the first one,
        transposed, is the derivative of the actuator loads with respect to what acts at the tip (Maxwell-Betti).

    Raises:
        NeutralEquilibrium: If the tangent stiffness is singular.
    """
    follow, _ = held_motion(model, tangent, coupling, pressed)
    return motors + springs @ follow, follow


def held_motion(
    model: SoftModel, tangent: FloatArray, coupling: FloatArray, pressed: PressedGaps | None
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the springs by the motors, and of the motor loads through springs and contact forces.

    Args:
        model: The robot.
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        coupling: Derivative of the elastic load with respect to the actuators, shape (n_springs, n_motors).
        pressed: The gaps that stay zero; None without any.

    Returns:
        `dy/dq_m`, shape (n_springs, n_motors); and, of a load with a potential, what `d tau_m/dq_m` has beside its value at
        constant springs and contact forces, shape (n_motors, n_motors).

    Raises:
        NeutralEquilibrium: If the stiffness is singular.
    """
    if pressed is None:
        follow = inverse_stiffness(model, tangent) @ coupling
        return follow, coupling.T @ follow
    inverse = inverse_in_contact(model, tangent, pressed.by_springs)
    follow = inverse.springs_by_load @ coupling - inverse.springs_by_gap @ pressed.by_motors
    forces = inverse.forces_by_load @ coupling - inverse.forces_by_gap @ pressed.by_motors
    return follow, coupling.T @ follow + pressed.by_motors.T @ forces


def inverse_stiffness(model: SoftModel, tangent: FloatArray) -> FloatArray:
    """Return the inverse of a tangent stiffness, both of shape (n_springs, n_springs).

    Raises:
        NeutralEquilibrium: If the smallest singular value, of a symmetric matrix the size of the smallest eigenvalue, is at
            most `POSITIVE` in the coordinates of `scaled`, as in `stability`.
    """
    stiffness = model.stiffness
    with contextlib.suppress(np.linalg.LinAlgError), one_blas_thread(len(tangent)):
        inverse = np.asarray(np.linalg.inv(tangent), dtype=np.float64)
        squared = float(stiffness @ (inverse * inverse) @ stiffness)  # Frobenius norm: a cheap upper bound of the other
        if squared < POSITIVE**-2 or np.linalg.norm(scaled(inverse, 1.0 / stiffness), 2) < 1.0 / POSITIVE:
            return inverse
    raise NeutralEquilibrium("the tangent stiffness is singular: a neutral equilibrium has no derivative")


class ContactInverse(NamedTuple):
    """Inverse of the equations of an equilibrium in contact, see `inverse_in_contact`."""

    springs_by_load: FloatArray
    """Springs by a load on them, `Z (Z^T K Z)^-1 Z^T`, shape (n_springs, n_springs)."""
    springs_by_gap: FloatArray
    """Springs by gaps that the springs must open, shape (n_springs, k)."""
    forces_by_load: FloatArray
    """Normal forces by a load on the springs, shape (k, n_springs)."""
    forces_by_gap: FloatArray
    """Normal forces by gaps that the springs must open, shape (k, k) [N/m]."""


def inverse_in_contact(model: SoftModel, tangent: FloatArray, gradients: FloatArray) -> ContactInverse:
    r"""Return the inverse of the equations of an equilibrium while its pressed contacts stay pressed.

    With the Hessian of the Lagrangian `K` and the gradients `G` of the pressed gaps, springs and normal forces follow a load
    :math:`b` on the springs and gaps :math:`c` that the springs must open by

    .. math:: \begin{pmatrix} K & G^T \\ G & 0 \end{pmatrix} \begin{pmatrix} \delta y \\ -\delta\lambda \end{pmatrix} =
       \begin{pmatrix} b \\ c \end{pmatrix}, \qquad \delta y = Z (Z^T K Z)^{-1} Z^T b + N c

    with an orthonormal basis `Z` of the null space of `G` (Nocedal and Wright, Numerical Optimization, 2006, section 16.2), in
    coordinates in which the springs have stiffness 1. A touch without force is left out of `G`: there derivatives are those on
    the side where it opens. Where gradients depend on each other the forces are those of least norm.

    Args:
        model: The robot.
        tangent: Hessian of the Lagrangian, shape (n_springs, n_springs).
        gradients: Derivatives of the pressed gaps by the springs, shape (k, n_springs).

    Returns:
        The inverse.

    Raises:
        NeutralEquilibrium: If the stiffness on the null space is singular, by the measure of `inverse_stiffness`.
    """
    soft = 1.0 / np.sqrt(model.stiffness)
    with one_blas_thread(len(tangent)):
        left, sizes, right = np.linalg.svd(gradients * soft)
        rank = int(np.sum(sizes > _DEPENDENT * sizes.max(initial=0.0)))
        held, free = right[:rank].T, right[rank:].T
        opens = held @ (left[:, :rank] / sizes[:rank]).T  # pseudo-inverse of the gradients
        relative = scaled(tangent, model.stiffness)
        reduced = free.T @ relative @ free
        if np.linalg.svd(reduced, compute_uv=False).min(initial=np.inf) <= POSITIVE:
            raise NeutralEquilibrium("the stiffness beside the contacts is singular: a neutral equilibrium has no derivative")
        inside = free @ np.linalg.solve(reduced, free.T)
        moved = opens - inside @ (relative @ opens)
        pressed = (opens.T @ relative) @ inside - opens.T
        by_springs = soft[:, None]
        return ContactInverse(by_springs * inside * soft, by_springs * moved, pressed * soft, opens.T @ relative @ moved)
