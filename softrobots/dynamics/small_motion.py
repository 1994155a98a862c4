r"""Small motion of a robot about an equilibrium: the matrices of its linearised equations.

The coordinates are those of the actuators that have a place (motor joints, muscles of given length), then the elastic ones,
:math:`x = (u, y)`. With the changes of what the actuators exert, :math:`\delta\tau`, and of the force at the tip,
:math:`\delta f`,

.. math:: M \ddot x + D \dot x + K \, \delta x = \begin{pmatrix} \delta\tau \\ 0 \end{pmatrix} + J^T \delta f

`K` is exact: springs, and the geometric stiffness of load, gravity and contact forces. Coriolis and centrifugal terms are of
second order about rest. Under a world-fixed moment `K` is not symmetric.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, one_each
from softrobots.core.errors import DescriptionError, NeutralEquilibrium, ParameterError
from softrobots.dynamics.damping import damping_matrix
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.held import held_stiffness
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.kinematics import frame_jacobian

_DEPENDENT = 1e-9  # least part of a gradient across those before it, over the largest
_FORCED = 1e-6  # motion of the springs against what contacts hold, relative to gradients
_UNSYMMETRIC = 1e-3  # largest unsymmetric part of a stiffness with modes, over the least stiffness


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
    pressed: FloatArray | None = None
    """Derivatives of what contacts hold by the coordinates, `PressedGaps`, shape (k, n); None if nothing is pressed."""


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
        ParameterError: If a number is negative or not finite, a shape differs, or a contact slips.
        DescriptionError: If the robot has more joints than Pinocchio supports.
    """
    check_frictionless(model, "small vibrations, in which what sticks would be stuck")
    m, placed, drives = model.n_motors, model.actuators.n_placed, model.actuators.drives
    if rotor_inertia is not None:
        given = one_each("rotor_inertia", rotor_inertia, placed, "kg m^2 or kg")
        drives = drives._replace(rotor_inertia=np.pad(given, (0, m - placed)))
    load, x = equilibrium.load, np.concatenate([equilibrium.q_motors, equilibrium.q_springs])
    equations = EquationsOfMotion(model, load.gravity, drives=drives)
    point, whole = equations.point(x), equations.mass_matrix(x)
    pressed = None
    if load.environment is None:
        stiffness = equations.stiffness(x, load.wrenches)
    else:
        stiffness, pressed = held_stiffness(equilibrium, "a vibration")
    damping = equations.damping.copy()
    damping[m:, m:] = damping_matrix(model, damping_time, mass_damping, whole[m:, m:])
    kept = np.r_[:placed, m : len(x)]

    def columns(by_joint: FloatArray) -> FloatArray:
        return np.asarray(np.concatenate(point.columns(by_joint), axis=1)[:, kept])

    return SmallMotion(
        n_placed=placed,
        mass=0.5 * (whole + whole.T)[np.ix_(kept, kept)],
        damping=damping[np.ix_(kept, kept)],
        stiffness=stiffness[np.ix_(kept, kept)],
        by_tension=-stiffness[kept, placed:m],
        tip=columns(frame_jacobian(model, equilibrium.q, model.tip)),
        momentum=columns(_momentum(model, equilibrium.q)),
        pressed=None if pressed is None else np.concatenate([pressed.by_motors, pressed.by_springs], axis=1)[:, kept],
    )


def independent_motion(model: SoftModel, small: SmallMotion) -> tuple[SmallMotion, Any]:
    r"""Return small motion in coordinates that contacts leave: actuators, and springs that the others follow.

    With :math:`G \,\delta x = 0` for what contacts hold, :math:`\delta x = T \xi` with independent coordinates :math:`\xi` out
    of `x` (Wehage and Haug, J. Mechanical Design 104, 1982, 247), and the matrices become :math:`T^T M T`, :math:`T^T D T`,
    :math:`T^T K T`: contact forces do no work along `T`. The springs that follow are those that contacts load most.

    Args:
        model: The robot.
        small: Its small motion.

    Returns:
        The small motion over `xi`, with nothing pressed, and the places of the springs in it, integers.

    Raises:
        ParameterError: If the springs cannot follow the actuators along the contacts.
    """
    if small.pressed is None:
        return small, np.arange(model.n_springs)
    from scipy.linalg import qr

    m, held = small.n_placed, small.pressed
    upper, order = qr(held[:, m:] / np.sqrt(model.stiffness), mode="r", pivoting=True)
    sizes = np.abs(np.diagonal(upper))
    rank = int(np.sum(sizes > _DEPENDENT * sizes.max(initial=0.0)))
    free = np.sort(order[rank:])
    kept, following = np.concatenate([np.arange(m), m + free]), m + order[:rank]
    moves = np.zeros((held.shape[1], len(kept)))
    moves[kept] = np.eye(len(kept))
    moves[following] = -np.linalg.lstsq(held[:, following], held[:, kept])[0]
    if np.abs(held @ moves).max(initial=0.0) > _FORCED * np.abs(held).max(initial=0.0):
        raise ParameterError(
            "equilibrium", "contacts that the actuators move", "one whose springs can follow along its contacts"
        )
    mass, damping, stiffness = (moves.T @ matrix @ moves for matrix in (small.mass, small.damping, small.stiffness))
    by_tension, tip, momentum = moves.T @ small.by_tension, small.tip @ moves, small.momentum @ moves
    return SmallMotion(m, mass, damping, stiffness, by_tension, tip, momentum), free


def mass_factor(model: SoftModel, mass: FloatArray) -> FloatArray:
    """Return the lower Cholesky factor of the mass matrix of coordinates of the model, shape (n, n).

    Raises:
        DescriptionError: If one of the coordinates moves no mass.
    """
    try:
        return np.asarray(np.linalg.cholesky(mass))
    except np.linalg.LinAlgError:
        raise DescriptionError(f"a coordinate of {model.pinocchio.name} moves no mass; give its links mass") from None


def check_vibrates(relative: FloatArray) -> None:
    """Check that a stiffness has modes, in coordinates in which springs and servos have stiffness 1.

    Raises:
        ParameterError: If its symmetric part is not positive, or the rest is more than 1e-3 of the least stiffness.
        NeutralEquilibrium: If it is singular.
    """
    softest = float(np.linalg.eigvalsh(0.5 * (relative + relative.T)).min(initial=1.0))
    if softest <= -POSITIVE:
        required = "positive, relative to springs and servos: about an unstable one nothing vibrates (linearize takes it)"
        raise ParameterError("least stiffness of the equilibrium", float(f"{softest:.3g}"), required)
    if softest <= POSITIVE:
        raise NeutralEquilibrium("the tangent stiffness is singular: a neutral equilibrium has a mode without frequency")
    rest = 0.5 * float(np.linalg.norm(relative - relative.T)) / softest
    if rest > _UNSYMMETRIC:
        required = f"at most {_UNSYMMETRIC:g}: where contacts roll and spin under much friction modes are not orthogonal"
        raise ParameterError("unsymmetric part of the stiffness over the least", float(f"{rest:.3g}"), required)


def _momentum(model: SoftModel, q: FloatArray) -> FloatArray:
    """Momentum and angular momentum about the world's origin by joint velocities, shape (6, nv)."""
    pin_model, data = model.workspace(None)
    centroidal = np.array(pin.computeCentroidalMap(pin_model, data, q)).reshape(6, -1)
    linear = centroidal[:3]
    return np.concatenate([linear, centroidal[3:] + pin.skew(data.com[0]) @ linear])
