"""Linear equations of a step in contact with Coulomb friction: Newton's change, and how the robot follows its actuators."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.contact.contact_laws import Balance

_FIRST = 1e4  # weight of gaps over sliding, where both cannot be zero
_RANK = 1e-12  # singular values below this, relative to the largest, are none


class ByMotors(NamedTuple):
    """Derivatives by the actuators at constant elastic coordinates and contact forces, a column each."""

    load: FloatArray
    """Load on the elastic coordinates, shape (n, n_motors)."""
    gaps: FloatArray
    """Gaps, shape (m, n_motors)."""
    sliding: FloatArray
    """Sliding, shape (m, 2, n_motors)."""


def newton_change(here: Balance, coefficient: float) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Return Newton's change of coordinates, shape (n,), normal forces, shape (m,), and friction, shape (m, 2)."""
    n, m = len(here.q_springs), len(here.normal)
    found = _solved(here, coefficient, ByMotors(np.zeros((n, 0)), np.zeros((m, 0)), np.zeros((m, 2, 0))))
    return None if found is None else (found[0][:, 0], found[1][:, 0], found[2][:, :, 0])


def followed(
    here: Balance, coefficient: float, by_motors: ByMotors
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """Return Newton's change of the coordinates, shape (n,), and what follows the actuators.

    That is the derivatives of the coordinates, shape (n, n_motors), of the normal forces, shape (m, n_motors), and
    of friction, shape (m, 2, n_motors).
    """
    found = _solved(here, coefficient, by_motors)
    return None if found is None else (found[0][:, 0], found[0][:, 1:], found[1][:, 1:], found[2][:, :, 1:])


def _solved(here: Balance, coefficient: float, by_motors: ByMotors) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """Changes of coordinates, normal forces and friction: Newton's in the first column, then one for each actuator."""
    near, laws, n, root = here.contacts, here.laws, len(here.q_springs), here.laws.root
    count = 1 + by_motors.load.shape[1]
    by_normal, by_friction = np.zeros((len(here.normal), count)), np.zeros((*here.friction.shape, count))
    by_normal[:, 0], by_friction[:, :, 0] = -here.normal, -here.friction  # those that do not press lose their forces
    pressed, rubs = np.flatnonzero(laws.pressed), np.flatnonzero(laws.slips | laws.sticks)
    by_normal[pressed], by_friction[rubs] = 0.0, 0.0
    lost = by_normal[:, 0] @ near.gradients + np.tensordot(by_friction[:, :, 0], near.jacobian)
    place = n + np.arange(len(pressed))
    places = n + len(pressed) + np.arange(2 * len(rubs)).reshape(-1, 2)
    gradients = near.gradients[pressed] / root * laws.unit_normal[pressed, None]
    jacobian = near.jacobian[rubs] / root * laws.unit_friction[rubs, None, None]
    matrix = np.zeros((n + len(pressed) + 2 * len(rubs),) * 2)
    right = np.zeros((len(matrix), count))
    matrix[:n, :n], right[:n, 0] = here.tangent / root / root[:, None], (lost - here.residual) / root
    matrix[:n, place], matrix[place, :n] = -gradients.T, gradients
    right[place, 0] = -near.gaps[pressed] * laws.unit_normal[pressed]
    matrix[:n, places.ravel()] = -jacobian.reshape(-1, n).T
    right[:n, 1:] = by_motors.load / root[:, None]
    right[place, 1:] = -by_motors.gaps[pressed] * laws.unit_normal[pressed, None]
    for one, rows, moves in zip(rubs.tolist(), places, jacobian, strict=True):
        slid = -by_motors.sliding[one] * laws.unit_friction[one]
        if laws.sticks[one]:
            matrix[rows, :n] = moves
            right[rows, 0], right[rows, 1:] = -near.sliding[one] * laws.unit_friction[one], slid
            continue
        # d lambda_t = mu way d lambda_n + held (1 - way way^T) (d lambda_t - rho d s)
        way, ratio = laws.way[one], laws.unit_normal[one] / laws.unit_friction[one]
        turn = laws.held[one] * (np.eye(2) - np.outer(way, way))
        matrix[np.ix_(rows, rows)] = np.eye(2) - turn
        matrix[rows, :n] = turn @ moves
        matrix[rows, place[np.searchsorted(pressed, one)]] = -coefficient * ratio * way
        right[rows, 0], right[rows, 1:] = -laws.broken[one] / laws.unit_friction[one], turn @ slid
    matrix[place] *= _FIRST
    right[place] *= _FIRST
    try:
        change = np.linalg.lstsq(matrix, right, rcond=_RANK)[0]
    except np.linalg.LinAlgError:
        return None
    by_normal[pressed] = change[place] * laws.unit_normal[pressed, None]
    by_friction[rubs] = change[places] * laws.unit_friction[rubs, None, None]
    return change[:n] / root[:, None], by_normal, by_friction
