r"""Small motion of a robot about an equilibrium: the matrices of its linearised equations.

The coordinates are those of the actuators that have a place (motor joints, muscles of given length), then the elastic ones,
:math:`x = (u, y)`. With the changes of what the actuators exert, :math:`\delta\tau`, and of the force at the tip,
:math:`\delta f`,

.. math:: M \ddot x + D \dot x + K \, \delta x = \begin{pmatrix} \delta\tau \\ 0 \end{pmatrix} + J^T \delta f

`K` is exact: springs, and the geometric stiffness of load and gravity. Coriolis and centrifugal terms are of second order about
rest. Under a world-fixed moment `K` is not symmetric.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, non_negative_array
from softrobots.core.errors import ParameterError
from softrobots.dynamics.damping import damping_matrix
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import AppliedLoad


class SmallMotion(NamedTuple):
    """Matrices over the placed actuators, then the elastic coordinates: `n = n_placed + n_springs`."""

    n_placed: int
    """Number of actuators that have a place: all but muscles of given tension."""
    mass: FloatArray
    """Mass matrix, rotor inertia included, shape (n, n) [kg m^2, kg m, kg]."""
    damping: FloatArray
    """Damping, shape (n, n) [N m s/rad, N s, N s/m]."""
    stiffness: FloatArray
    """Stiffness, shape (n, n) [N m/rad, N, N/m]."""
    by_tension: FloatArray
    """Load on the coordinates by given tensions of muscles, shape (n, n_tensions) [m/rad or -]."""
    tip: FloatArray
    """Geometric Jacobian of the tip, world axes, linear rows first, shape (6, n)."""
    momentum: FloatArray
    """Momentum, and angular momentum about the world's origin, by rates of the coordinates, shape (6, n) [kg m, kg m^2]."""


def small_motion(
    model: SoftModel, equilibrium: Equilibrium, *, damping_time: Any, mass_damping: Any, rotor_inertia: Any
) -> SmallMotion:
    """Return the matrices of an equilibrium of the model.

    Args:
        model: The robot.
        equilibrium: An equilibrium of it.
        damping_time: See `damping_matrix`.
        mass_damping: See `damping_matrix`; it multiplies the mass matrix of the elastic coordinates in the equilibrium.
        rotor_inertia: Inertia of the rotor of each placed actuator, or one for all [kg m^2 or kg]; None: of the file.

    Raises:
        ParameterError: If a number is negative or not finite, or a shape differs.
        DescriptionError: If the robot has more joints than Pinocchio supports.
    """
    n_tensions = len(model.muscles) if model.muscle_input == "forces" else 0
    placed = model.n_motors - n_tensions
    kept = np.r_[:placed, model.n_motors : model.n_motors + model.n_springs]
    drives = model.actuators.drives
    given = drives.rotor_inertia[:placed] if rotor_inertia is None else rotor_inertia
    rotors = one_each("rotor_inertia", given, placed, "kg m^2 or kg")
    q, point = equilibrium.q, model.coordinates.at(equilibrium.q_motors, equilibrium.q_springs)

    def columns(by_joint: FloatArray) -> FloatArray:
        return np.asarray(np.concatenate(point.columns(np.ascontiguousarray(by_joint)), axis=1)[:, kept])

    mass = columns(columns(model.data.mass_matrix(q)).T)
    mass = 0.5 * (mass + mass.T)
    mass[:placed, :placed] += np.diag(rotors)
    by_motors, by_elastic = point.motor_derivatives(AppliedLoad(model, equilibrium.load).at(q))
    rows = np.hstack([by_motors[:placed, :placed], by_elastic[:placed]])
    stiffness = np.vstack([-rows, np.hstack([-equilibrium.coupling[:, :placed], equilibrium.tangent_stiffness])])
    damping = np.zeros_like(mass)
    damping[:placed, :placed] = np.diag(drives.damping[:placed])
    damping[placed:, placed:] = damping_matrix(model, damping_time, mass_damping, mass[placed:, placed:])
    by_tension = np.concatenate([np.zeros((placed, n_tensions)), equilibrium.coupling[:, placed:]])
    return SmallMotion(
        placed, mass, damping, stiffness, by_tension, columns(frame_jacobian(model, q, model.tip)), columns(_momentum(model, q))
    )


def one_each(name: str, value: Any, count: int, unit: str) -> FloatArray:
    """Return one number for all or one for each of `count`, zero or positive, as an array, or raise ParameterError."""
    given = non_negative_array(name, value, unit)
    if given.shape not in ((), (count,)):
        raise ParameterError(name, value, f"one number, or of shape ({count},) [{unit}] (it has shape {given.shape})")
    return np.array(np.broadcast_to(given, (count,)))


def _momentum(model: SoftModel, q: FloatArray) -> FloatArray:
    """Momentum and angular momentum about the world's origin by joint velocities, shape (6, nv)."""
    pin_model, data = model.workspace(None)
    centroidal = np.array(pin.computeCentroidalMap(pin_model, data, q)).reshape(6, -1)
    linear = centroidal[:3]
    return np.concatenate([linear, centroidal[3:] + pin.skew(data.com[0]) @ linear])
