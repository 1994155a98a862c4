r"""Steps of inverse kinematics towards the goal, and, of more actuators than conditions, beside it, within all limits.

Beside it the actuators go home (`step_home`), or, where muscles cannot both pull and push, limits of tensions and of the
lengths of given tensions are constraints, and redundant muscles get the least tension (`step_within`). With the tensions `T`
and their derivatives by the actuators, springs in equilibrium, a step is

1. towards the goal: the least squares of what is missing, damped, within all limits;
2. beside it, without moving the tip: the least :math:`|T - T_0|^2` within all limits,

with the least tension that is wanted, `T_0`: the pretension of elastic tendons, zero or what the limits allow of others.
Both are least squares with linear inequalities, which become nonnegative least squares (Lawson and Hanson 1974, chapter 23).
Where the steps end, the conditions of Karush, Kuhn and Tucker of the least tension at the goal hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticState

_SHARES = (1.0, 0.5, 0.25, 0.1, 0.0)  # of a violated limit that a step may take back
_LEAST_DAMPING = 1e-7  # of a step, relative to the largest slope
_ROUNDING = 1e-12  # of limits, in units of scaled actuators
_INSIDE = 1e-9  # of a limited length, relative to that at rest, so that the one found is within
_IDLE = 20  # steps of a drift that do not lessen tensions, after which it ends
_SAME_SIZE = 1e-6  # of the sum of squares of tensions, relative to it


class TipModel(NamedTuple):
    """How tip and elastic coordinates follow the actuators near a state, if its contacts are as assumed."""

    missing: FloatArray
    """Difference from the tip to the goal, shape (rows,) [m]."""
    slope: FloatArray
    """Derivative of the tip by the actuators, shape (rows, n_motors)."""
    follow: FloatArray
    """Derivative of the elastic coordinates by the actuators, shape (n_springs, n_motors)."""
    shift: FloatArray
    """Change of the elastic coordinates when contacts open, shape (n_springs,)."""

    def step(self, basis: FloatArray, damping: float) -> FloatArray:
        """Damped step of the actuators towards the goal, shape (n_motors,)."""
        slope = self.slope @ basis
        turned = slope @ slope.T + damping**2 * np.eye(len(slope))
        return np.asarray(basis @ (slope.T @ np.linalg.solve(turned, self.missing)))


class Pull(NamedTuple):
    """Muscles of a robot in equilibrium: tensions, relative to `Actuators.tension_scale`, and how far limits are."""

    beyond: FloatArray
    """Tension beyond the least that is wanted, shape (n_muscles,) [-]."""
    slope: FloatArray
    """Its derivative by the actuators at constant load, shape (n_muscles, n_motors)."""
    room: FloatArray
    """Room to the limits, shape (2, m) [-]; see `muscle_room`."""
    limited: FloatArray
    """Derivative of what they limit by the actuators, shape (m, n_motors)."""

    @property
    def excess(self) -> float:
        """Largest of them beyond its limits [-]; 0 within them."""
        return max(0.0, -float(self.room.min()))


@lru_cache(maxsize=64)
def given_tensions(model: SoftModel) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the muscles of given tension, whose lengths no input keeps within limits, and these at rest, shape (n,) [m]."""
    rows = np.flatnonzero([muscle.kind == "tension" for muscle in model.muscles])
    return rows, np.array([muscle.rest_length for muscle in model.muscles])[rows]


def keeps_muscles(model: SoftModel) -> bool:
    """Return whether limits of muscles are kept beside those of what is given: they only pull, or tensions are given."""
    return bool(model.actuators.least_tension or len(given_tensions(model)[0]))


def muscle_room(model: SoftModel, tensions: FloatArray, elongations: FloatArray) -> FloatArray:
    """Return the room to the limits of muscles, from the least to the value and on to the largest, negative beyond them.

    Args:
        model: The robot.
        tensions: Their tensions, shape (n_muscles,) [N].
        elongations: Their lengths beyond those at rest, shape (n_muscles,) [m].

    Returns:
        Of tensions, relative to `Actuators.tension_scale`, then of lengths of given tensions, to those at rest, shape (2, m).
    """
    (low, high), scale = model.actuators.sought_tensions.T, model.actuators.tension_scale
    rows, rests = given_tensions(model)
    least, longest = model.actuators.muscle_lengths[rows].T / rests - 1.0
    stretch = elongations[rows] / rests
    tension = np.array([tensions - low, high - tensions]) / scale
    return np.concatenate([tension, np.array([stretch - least, longest - stretch]) - _INSIDE], axis=1)


def taken_up(model: SoftModel, q_motors: FloatArray, state: ElasticState) -> tuple[FloatArray, float]:
    """Return actuators with the slack of tendons taken up, and how far a muscle is beyond its limits; 0 without such.

    Args:
        model: The robot.
        q_motors: Its actuators, shape (n_motors,).
        state: The robot in equilibrium there.
    """
    actuators, structure = model.actuators, model.structure
    if not keeps_muscles(model):
        return q_motors, 0.0
    elongations = structure.muscle_paths.at(structure.strains(q_motors, state.q_springs)).elongation
    room = muscle_room(model, state.load.motors[len(q_motors) - len(elongations) :], elongations)
    return actuators.taken_up(q_motors, elongations), max(0.0, -float(room.min()))


def step_within(
    model: SoftModel, motors: FloatArray, slope: FloatArray, missing: FloatArray, damping: float, pulled: Pull, arrived: bool
) -> tuple[FloatArray, FloatArray]:
    """Step towards the goal within the limits, and the step to the least tension that does not move the tip.

    Args:
        model: The robot.
        motors: Its actuators, shape (n_motors,).
        slope: Derivative of the tip by the basis of the actuators, shape (rows, n) [m].
        missing: What is missing to the goal, shape (rows,) [m].
        damping: Damping of the step towards the goal [m].
        pulled: The tensions.
        arrived: Whether the goal has been reached, from where on the tensions are lessened.

    Returns:
        Both steps by the basis, shape (n,).
    """
    basis = model.actuators.basis
    count = basis.shape[1]
    felt, within = pulled.slope @ basis, pulled.limited @ basis
    low, high = model.motor_limits.T
    units = basis / model.motor_scale[:, None]
    ranges, _ = model.actuators.active_limits(motors)
    ends = np.concatenate([-within, within, -units, units, ranges @ basis])
    room = np.concatenate(
        [*pulled.room, (motors - low) / model.motor_scale, (high - motors) / model.motor_scale, np.zeros(len(ranges))]
    )
    kept = np.isfinite(room) & (np.abs(ends).max(axis=1) > _ROUNDING)
    ends, room = ends[kept], room[kept]
    least = max(damping, _LEAST_DAMPING * float(np.linalg.norm(slope)))
    damped, wanted = np.concatenate([slope, least * np.eye(count)]), np.concatenate([missing, np.zeros(count)])
    for share in _SHARES:
        allowed = np.where(room < 0.0, share * room, room)
        towards = least_squares(damped, wanted, ends, allowed)
        if towards is not None:
            break
    else:
        return np.zeros(count), np.zeros(count)
    still = np.zeros(count)
    if not arrived or count <= len(missing):
        return towards, still
    _, values, right = np.linalg.svd(slope)
    null = right[int(np.sum(values > 1e-9 * values[0])) :].T
    relative = felt @ null
    lessened = np.concatenate([relative, _LEAST_DAMPING * max(float(np.linalg.norm(relative)), 1.0) * np.eye(null.shape[1])])
    goal = np.concatenate([-(pulled.beyond + felt @ towards), np.zeros(null.shape[1])])
    turn = least_squares(lessened, goal, ends @ null, np.maximum(allowed - ends @ towards, 0.0))
    return towards, still if turn is None else null @ turn


@dataclass
class LeastTension:
    """Drift of a robot with dry friction to its least tensions: at the kinks of friction it can turn for ever."""

    best: Any
    """Solution at the goal with the least tensions so far."""
    _size: float = np.inf
    _idle: int = 0

    def turns(self, arrived: Any, pulled: Pull) -> bool:
        """Return whether many steps have not lessened the tensions; `arrived` is a solution at the goal, or None."""
        size = float(pulled.beyond @ pulled.beyond)
        self._idle += 1
        if arrived is not None and size < self._size:
            self.best, self._size, self._idle = arrived, size * (1.0 - _SAME_SIZE), 0
        return self._idle > _IDLE


def pace_of(step: FloatArray, last_drift: FloatArray, drift: FloatArray) -> float:
    """Return the length of a drift: the step of Barzilai and Borwein, which converges in narrow valleys, too."""
    bent = float(step @ (last_drift - drift))
    return float(np.clip(float(step @ step) / bent, 0.1, 100.0)) if bent > 0.0 else 100.0 if step.any() else 1.0


def step_home(
    model: SoftModel, motors: FloatArray, slope: FloatArray, missing: FloatArray, damping: float, homeward: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Step towards the goal, and the part of the step home that does not move the tip, within the limits.

    Reached limits that the step would violate are constrained, one set after the other.

    Returns:
        Both parts, shape (n,), and the projector on the unconstrained steps, shape (n, n).
    """
    basis = model.actuators.basis
    normals, bends = (rows @ basis for rows in model.actuators.active_limits(motors))
    pull = normals @ (slope.T @ missing) / np.maximum((normals * normals).sum(axis=1), 1e-300)
    constrained = np.zeros(len(normals), dtype=bool)
    while True:
        rows, free, open_slope, whole = normals[constrained], np.eye(basis.shape[1]), slope, slope
        if len(rows):
            free -= np.linalg.pinv(rows) @ rows
            open_slope = slope @ free
            # A step along a curved limit costs the pull against it times its curvature: additional rows.
            curved = np.sqrt(np.maximum(pull[constrained], 0.0))[:, None] * bends[constrained] @ free
            whole = np.concatenate([open_slope, curved[curved.any(axis=1)]])
        towards = free @ _damped_step(
            whole, np.concatenate([missing, np.zeros(len(whole) - len(missing))]), damping, 1e-12 * model.reach
        )
        drift = homeward
        if homeward.any():
            drift = free @ (homeward - np.linalg.pinv(open_slope, rcond=1e-9) @ (open_slope @ homeward))
        pressed = ~constrained & (normals @ (towards + drift) > 1e-12)
        if not pressed.any():
            return towards, drift, free
        constrained |= pressed


def _damped_step(slope: FloatArray, missing: FloatArray, damping: float, negligible: float) -> FloatArray:
    """Levenberg-Marquardt step; directions that do not move the tip are zero."""
    left, values, right = np.linalg.svd(slope, full_matrices=False)
    gains = np.where(values > negligible, values, 0.0) / np.maximum(values**2 + damping**2, negligible**2)
    return np.asarray(right.T @ (gains * (left.T @ missing)))


def least_squares(matrix: FloatArray, wanted: FloatArray, ends: FloatArray, room: FloatArray) -> FloatArray | None:
    """Return the least squares of `matrix @ x - wanted` with `ends @ x <= room`; None if the limits contradict each other.

    Shapes (m, n) of full rank n, (m,), (k, n), (k,); the result has shape (n,).
    """
    from scipy.optimize import nnls

    orthogonal, upper = np.linalg.qr(matrix)
    free = np.linalg.solve(upper, orthogonal.T @ wanted)
    left = room - ends @ free
    if len(left) == 0 or left.min() >= -_ROUNDING:
        return np.asarray(free)
    normals = np.linalg.solve(upper.T, ends.T)  # least |z| with normals^T z <= left
    size = np.maximum(np.linalg.norm(normals, axis=0), 1e-300)
    normals, left = normals / size, left / size
    scale = float(np.abs(left).max())
    bounds = np.concatenate([-normals, -left[None] / scale])
    try:
        multipliers, _ = nnls(bounds, np.concatenate([np.zeros(len(upper)), [1.0]]))
    except RuntimeError:  # too many steps
        return None
    remains = bounds @ multipliers - np.concatenate([np.zeros(len(upper)), [1.0]])
    if -remains[-1] <= 1e-12:
        return None
    nearest = -scale * remains[:-1] / remains[-1]
    return np.asarray(free + np.linalg.solve(upper, nearest))
