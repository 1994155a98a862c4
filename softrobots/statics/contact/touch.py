r"""Surfaces near the robot in its elastic coordinates: gaps, their gradients, and the load of the contact forces.

With gaps :math:`g_i(y)` and normal forces :math:`\lambda_i`, the contacts load the elastic coordinates by
:math:`G^T \lambda` with :math:`G = dg/dy`, and soften the tangent stiffness by :math:`\sum_i \lambda_i\, d^2 g_i/dy^2`
(Wriggers, Computational Contact Mechanics, 2006, chapter 6).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import Known
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.environment.standing import standing_among
from softrobots.model.coordinates import Point
from softrobots.model.joint_loads import JointLoad
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.quadratic_programme import solve_programme

TOUCHING = 1e-9
"""Largest gap of surfaces that touch, and largest penetration of an equilibrium, relative to the reach."""

NEAR = 0.2
"""Gaps below this share of the reach are seen, where nothing is known of how far the robot will move."""

_DEPENDENT = 1e-9  # least singular value of independent gradients over the largest


class Touch(NamedTuple):
    """Candidates of contact near a robot, and the forces that are assumed on them."""

    gaps: Gaps
    """The candidates."""
    rows: FloatArray
    """Derivatives of the gaps by the elastic coordinates, shape (m, n_springs)."""
    motor_rows: FloatArray
    """Derivatives of the gaps by the actuators, shape (m, n_motors)."""
    forces: FloatArray
    """Normal forces, shape (m,) [N]."""
    load: JointLoad
    """Load of the forces on the joints."""
    surroundings: Surroundings
    """The robot among the obstacles."""
    penetration: float
    """Depth of the deepest penetration, zero without one [m]."""


class ForceTable(NamedTuple):
    """Normal forces by candidate, to carry them from one evaluation to the next."""

    keys: tuple[tuple[int, int, int], ...]
    """Capsule, obstacle and feature of each candidate."""
    forces: FloatArray
    """Their forces, shape (m,) [N]."""

    @classmethod
    def of(cls, gaps: Gaps, forces: FloatArray) -> ForceTable:
        """Take the forces on candidates, shape (m,) [N]."""
        return cls(gaps.keys, forces)

    def at(self, gaps: Gaps) -> FloatArray:
        """Forces on other candidates, shape (m,) [N]; zero on new ones.

        The force on a candidate that is no longer there passes to the nearest other one of the same pair of bodies.
        """
        if gaps.keys == self.keys:
            return self.forces
        forces, places = np.zeros(len(gaps)), dict(zip(gaps.keys, range(len(gaps)), strict=True))
        for key, force in zip(self.keys, self.forces.tolist(), strict=True):
            if force == 0.0:
                continue
            same = places.get(key)
            if same is not None:
                forces[same] += force
                continue
            pair = ((gaps.capsules == key[0]) & (gaps.obstacles == key[1])).nonzero()[0]
            if len(pair):
                forces[pair[gaps.values[pair].argmin()]] += force
        return forces


NO_FORCES = ForceTable((), np.zeros(0))
"""No contact force yet."""


_KNOWN = Known()


def surfaces_of(model: SoftModel, environment: Environment) -> Surroundings:
    """Return the surfaces around a robot; each thread keeps those of its last environment."""
    known = _KNOWN.by_model.get(model)
    if known is None or known[0] is not environment:
        known = _KNOWN.by_model[model] = environment, standing_among(model, environment)
    return known[1]


def touch_at(surroundings: Surroundings, q: FloatArray, point: Point, forces: ForceTable, margin: float) -> Touch:
    """Evaluate gaps up to a margin [m] and contact load at Pinocchio's configuration, shape (nq,), and the point there."""
    gaps = surroundings.at(q, margin)
    on_motors, on_springs = point.columns(gaps.jacobian)
    each = forces.at(gaps)
    deepest = max(0.0, -min(gaps.values.tolist(), default=0.0))
    return Touch(gaps, on_springs, on_motors, each, gaps.load(each), surroundings, deepest)


def joined(applied: JointLoad, contact: JointLoad) -> JointLoad:
    """Return a load with the load of contacts."""
    if not len(contact.angular):
        return applied
    moments = applied.by_moment
    if moments is not None:
        moments = np.concatenate([moments, np.zeros_like(contact.angular)])
    torque, angular, by_force, _, gravity_derivative, potential, scale = applied
    angular, by_force = np.concatenate([angular, contact.angular]), np.concatenate([by_force, contact.by_force])
    return JointLoad(torque + contact.torque, angular, by_force, moments, gravity_derivative, potential, scale + contact.scale)


def resting_forces(touch: Touch, out_of_balance: FloatArray, reach: float) -> FloatArray:
    r"""Normal forces on touching candidates that balance best: :math:`\min \|r - G^T \lambda\|`, then of least norm.

    Args:
        touch: The candidates.
        out_of_balance: Residual without contact forces, shape (n_springs,) [N m or N].
        reach: Reach of the robot [m].

    Returns:
        Forces, zero or more, shape (m,) [N]. Where gradients depend on each other the forces are not unique.
    """
    forces = np.zeros(len(touch.rows))
    near = np.flatnonzero(touch.gaps.values <= TOUCHING * reach)
    if not len(near):
        return forces
    gradients = touch.rows[near].T
    least = np.linalg.lstsq(gradients, out_of_balance, rcond=_DEPENDENT)[0]
    forces[near] = least if least.min() >= 0.0 else _nonnegative(gradients, out_of_balance)
    return forces


def _nonnegative(gradients: FloatArray, load: FloatArray) -> FloatArray:
    """Least squares with coefficients zero or more (Lawson and Hanson, 1974), and of those the ones of least norm."""
    from scipy.optimize import nnls

    sizes = np.maximum(np.linalg.norm(gradients, axis=0), 1e-300)
    best: FloatArray = np.asarray(nnls(gradients / sizes, load, maxiter=100 * len(sizes))[0]) / sizes
    _, values, right = np.linalg.svd(gradients)
    rank = int(np.sum(values > _DEPENDENT * values.max(initial=0.0)))
    if rank == len(best):
        return best
    rows = np.concatenate([right[:rank], np.eye(len(best))])  # the same load, and no pull
    bounds = np.concatenate([right[:rank] @ best, np.zeros(len(best))])
    found = solve_programme(np.eye(len(best)), np.zeros(len(best)), rows, bounds, equal=np.arange(len(rows)) < rank)
    return best if found is None else np.maximum(found[0], 0.0)


def unmoved(touch: Touch, point: Point) -> Any:
    """Whether no elastic coordinate moves the capsule of each candidate, shape (m,), bool.

    That is more than a gradient of zero, which a stretched arm has that stands against a wall: it gives way by bending.
    """
    return np.asarray(~(touch.rows.any(axis=1) | point.columns(touch.gaps.moves)[1].any(axis=1)))


def deepest_penetration(touch: Touch, point: Point) -> str:
    """Return what penetrates most, in words; rather what no spring moves."""
    depths = np.where(touch.gaps.values < -TOUCHING * touch.gaps.reach, -touch.gaps.values, 0.0)
    fixed = depths * unmoved(touch, point)
    place = int((fixed if fixed.any() else depths).argmax())
    link, other, _ = touch.surroundings.pair(touch.gaps, place)
    advice = ", wherever the springs are: move the motors or the obstacle" if fixed.any() else ""
    return f"{link!r} is {depths[place]:.3g} m inside of {other!r}{advice}"
