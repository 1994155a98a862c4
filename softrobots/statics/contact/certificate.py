r"""Which contacts of an equilibrium are pressed, and whether it is stable: second-order conditions of contact.

With the pressed gradients `G` (forces clear of rounding) an equilibrium is a strict minimum of the energy if the Hessian of the
Lagrangian is positive on all motions `p` with :math:`G p = 0`, and :math:`a_i p \ge 0` for the gradients :math:`a_i` of gaps
that touch without a force (Nocedal and Wright, Numerical Optimization, 2006, theorem 12.6). Without such touches that is a
positive definite matrix on a null space; with them a matrix that is positive on a cone.
"""

from __future__ import annotations

import math
from itertools import chain, combinations
from typing import Any, NamedTuple

import numpy as np
from eigenpy import LDLT

from softrobots.core.checks import FloatArray
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.touch import TOUCHING, Touch
from softrobots.statics.elastic_state import positive

_MOST_WEAK = 8  # touches without force beyond which the cone is not examined
_INDEPENDENT = 1e-9  # least singular value of gradients over the largest


class ActiveContacts(NamedTuple):
    """The contacts of a state, by what holds them."""

    touching: Any
    """Places of the candidates that touch, pressed ones too, integers."""
    pressed: Any
    """Places of those whose force is clear of rounding, integers."""
    weak: Any
    """Places of the other ones, integers."""


def active_contacts(touch: Touch, reach: float, rounding: float) -> ActiveContacts:
    """Sort the candidates.

    Args:
        touch: The candidates with their forces.
        reach: Reach of the robot [m].
        rounding: Residual that counts as none [N m]; a force that loads the springs by less is none.
    """
    touching = (touch.gaps.values <= TOUCHING * reach) | (touch.forces > 0.0)
    pressed = touch.forces * np.sqrt(np.vecdot(touch.rows, touch.rows)) > rounding
    return ActiveContacts(touching.nonzero()[0], pressed.nonzero()[0], (touching & ~pressed).nonzero()[0])


def null_space(rows: FloatArray) -> FloatArray:
    """Orthonormal basis of the motions that keep all of some gradients at zero, shape (n, n - rank)."""
    _, sizes, right = np.linalg.svd(rows)
    rank = int(np.sum(sizes > _INDEPENDENT * sizes.max(initial=0.0)))
    return np.asarray(right[rank:].T)


def softest_motion(
    tangent: FloatArray, stiffness: FloatArray, touch: Touch, reach: float, rounding: float
) -> tuple[float, FloatArray]:
    r"""Least curvature of the energy over the motions that the contacts leave, and the motion.

    On a cone :math:`W z \ge 0` a quadratic form is least at an eigenvector of the form on one of the cone's faces, where some
    rows of `W` vanish and the others are positive (for the orthant: Kaplan, Linear Algebra Appl. 313, 2000, 203).

    Args:
        tangent: Hessian of the Lagrangian, shape (n, n).
        stiffness: Stiffness of the springs, shape (n,).
        touch: The candidates with their forces.
        reach: Reach of the robot [m].
        rounding: Residual that counts as none [N m].

    Returns:
        The curvature relative to the springs, infinite where it is positive for all motions; and the motion, shape (n,), of
        unit length in coordinates in which the springs have stiffness 1. Of more than 8 touches without force, or where a
        curvature of zero or less is that of several motions, the touches are left out: the answer is a lower bound.
    """
    if not math.isfinite(float(tangent.sum())):
        return -np.inf, np.zeros(len(stiffness))
    if len(stiffness) and positive(LDLT(len(stiffness)), tangent - np.diag(2.0 * POSITIVE * stiffness)):  # on all motions
        return np.inf, np.zeros(len(stiffness))
    soft = 1.0 / np.sqrt(stiffness)
    relative = soft[:, None] * tangent * soft
    active = active_contacts(touch, reach, rounding)
    pressed, weak = touch.rows[active.pressed], touch.rows[active.weak]
    beside = null_space(pressed * soft) if len(pressed) else np.eye(len(soft))
    form, cone = beside.T @ relative @ beside, (weak * soft) @ beside
    if not len(form) or positive(LDLT(len(form)), form - 2.0 * POSITIVE * np.eye(len(form))):
        return np.inf, np.zeros(len(soft))
    value, motion = _least(form, np.eye(len(form)))
    if value <= POSITIVE and 0 < len(cone) <= _MOST_WEAK:
        value, motion = _least_on_cone(form, cone)
    return value, soft * (beside @ motion)


def _least(form: FloatArray, basis: FloatArray) -> tuple[float, FloatArray]:
    """Least eigenvalue of a form on a basis, and its vector."""
    if basis.shape[1] == 0:
        return np.inf, np.zeros(len(form))
    values, vectors = np.linalg.eigh(basis.T @ form @ basis)
    return float(values[0]), basis @ vectors[:, 0]


def _least_on_cone(form: FloatArray, cone: FloatArray) -> tuple[float, FloatArray]:
    """Least curvature on a cone, as far as it is zero or less; else the least of a positive form."""
    best: tuple[float, FloatArray] = (np.inf, np.zeros(len(form)))
    sizes = np.maximum(np.linalg.norm(cone, axis=1), 1e-300)
    rows = cone / sizes[:, None]
    for held in chain.from_iterable(combinations(range(len(rows)), count) for count in range(len(rows) + 1)):
        basis = null_space(rows[list(held)]) if held else np.eye(len(form))
        if basis.shape[1] == 0:
            continue
        values, vectors = np.linalg.eigh(basis.T @ form @ basis)
        low = np.flatnonzero(values <= POSITIVE)
        if len(low) > 1 and np.diff(values[low]).min() <= POSITIVE:  # a plane of motions: any of them may be in the cone
            return _least(form, basis)
        for place in low.tolist():
            motion = basis @ vectors[:, place]
            opened = rows @ motion
            for sign in (1.0, -1.0):
                if values[place] < best[0] and float((sign * opened).min()) >= -_INDEPENDENT:
                    best = float(values[place]), sign * motion
    return best
