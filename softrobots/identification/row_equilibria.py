r"""Equilibria of many rows at once, by Newton's method from starts that are near.

A row whose residual `r` each step does not halve at least, or that does not end in a stable equilibrium, is left to the search
for a single one. Steps from afar are shortened, as there, and go on where the tangent stiffness is positive definite.

Rows that follow one another with dry friction are solved together. With the bending `b` of a section, its slider `c` before
the row and the moment of friction :math:`\tau` within the disc of the limit `L` (`softrobots.model.dry_friction`; `s` is the
stick, `P` the projection to the disc, any :math:`\rho > 0`), row `i` has

.. math:: r(y_i) + \tau_i = 0, \qquad \tau_i = P(\tau_i + \rho\,(b_i - s \tau_i / L - c_i)), \qquad
          c_{i+1} = b_i - s \tau_i / L

whose derivatives tell at once what sticks and what slips (a primal-dual active set: Hintermueller, Ito and Kunisch 2002). A
row depends on those before through its slider only, so that a step substitutes forwards.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.friction_derivatives import SliderStates
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.measured_robot import load_cases
from softrobots.identification.residual_derivatives import EquilibriumDerivatives
from softrobots.model.dry_friction import BENDING_STICK
from softrobots.model.friction_coordinates import after_step, memory_of, remembering, untouched
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.elastic_state import MOMENT_FLOOR
from softrobots.statics.elastostatics import CLEARLY, LARGEST_STEP, balanced_state

_MOST = 48  # elastic coordinates; beyond, a search for each row is as fast
_MOST_STEPS = 12
_SHRINKS = 0.5  # share of the residual that a step leaves at most
_MOST_TOGETHER = 60  # steps of rows that follow one another
_FEWER = 0.9  # share of the rows that is left by a step that gains
_WAITING, _FEW = 4, 32  # steps that gain nothing, and how many rows are searched one by one then


def balanced_rows(model: SoftModel, whole: States, tolerance: float) -> Any:
    """Search for equilibria; none are found of robots of many coordinates, with memory or given lengths, or under moments.

    Args:
        model: The robot.
        whole: States of N rows with the elastic coordinates to start from, which are changed to those that are found.
        tolerance: Residual that counts as none, relative to the torques of the springs.

    Returns:
        Which of them are stable equilibria, shape (N,).
    """
    n = len(whole.q_springs)
    found, rows, last = np.zeros(n, dtype=bool), np.arange(n), np.full(n, np.inf)
    for _ in range(_MOST_STEPS if model.structure.friction is None and _is_solvable(model, whole.loads) else 0):
        evaluated = _evaluated(model, whole, rows, tolerance)
        if evaluated is None:
            break
        states, residual, allowed = evaluated
        size = np.linalg.norm(residual, axis=1)
        done = size <= allowed
        _put(whole, rows[done], states, done)
        found[rows[done]] = _is_stable(model, states.tangent[done])
        try:
            steps = np.linalg.solve(states.tangent, -residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            break
        shorter = np.minimum(1.0, LARGEST_STEP / np.maximum(np.linalg.norm(steps, axis=1), 1e-300))
        goes_on, cut = ~done & (size <= last), np.flatnonzero(shorter < 1.0)
        goes_on[cut] &= _is_stable(model, states.tangent[cut])
        rows, last = rows[goes_on], (size * np.where(shorter < 1.0, 1.0, _SHRINKS))[goes_on]
        if not len(rows):
            break
        whole.q_springs[rows] += (steps * shorter[:, None])[goes_on]
    return found


def balanced_course(
    model: SoftModel, whole: States, sliders: FloatArray | None, tolerance: float
) -> tuple[FloatArray, list[int]]:
    """Find equilibria that follow one another, together where only sections rub, where that fails one by one.

    Args:
        model: The robot, with dry friction.
        whole: States of N rows with the elastic coordinates to start from, which are changed to those that are found.
        sliders: Sliders before each of these, shape (N, n_sections, 2) [rad]; None: nothing rubs there.
        tolerance: Residual that counts as none, relative to the torques of the springs.

    Returns:
        The sliders before each row, shape (N, n_sections, 2) [rad], and the rows without an equilibrium.
    """
    starts = whole.q_springs.copy()
    friction, y, n, first = cast(Any, model.structure.friction), whole.q_springs, len(starts), 0
    waiting, least = 0, n
    places, limit, flexible = friction.places, friction.limit[:, None], BENDING_STICK / friction.limit[:, None]
    before = np.zeros((n, *places.shape))
    before[0] = friction.untouched.bending
    tau = np.zeros(before.shape) if sliders is None else SliderStates(friction, y, sliders).torque * limit
    for _ in range(_MOST_TOGETHER if not friction.guided and _is_solvable(model, whole.loads) else 0):
        evaluated = None if first == n else _evaluated(model, whole, np.arange(first, n), tolerance)
        if evaluated is None:
            break
        states, residual, allowed = evaluated
        after = y[:, places] - flexible * tau
        before[first + 1 :] = after[first:-1]
        rubbing = SliderStates(friction, y[first:], before[first:])
        tangent, unbalanced, left = states.tangent.copy(), residual.copy(), residual
        states.tangent[:, places[:, :, None], places[:, None]] += rubbing.stiffness
        unbalanced[:, places] += tau[first:]
        left[:, places] += rubbing.torque * limit
        done = np.maximum(np.linalg.norm(left, axis=1), np.linalg.norm(unbalanced, axis=1)) <= allowed
        ready = int(np.argmin([*done, False]))
        ready = int(np.argmin([*_is_stable(model, states.tangent[:ready]), False]))
        _put(whole, np.arange(first, first + ready), states, np.arange(ready))
        if first + ready == n:
            return before, []
        wrong, off, first = int(np.count_nonzero(~done)), (after - before)[first:], first + ready
        try:
            steps, turns = _steps(tangent, unbalanced, tau[first - ready :], off, friction)
        except np.linalg.LinAlgError:
            break
        waiting, least = 0 if wrong < _FEWER * least else waiting + 1, min(wrong, least)
        y[first:], tau[first:] = y[first:] + steps[ready:], tau[first:] + turns[ready:]
        if waiting == _WAITING:
            some, waiting = slice(first, first + _FEW), 0
            if not searched_rows(model, whole, range(n)[some], starts, tolerance, before):
                tau[some] = limit * SliderStates(friction, y[some], before[some]).torque
                first = min(first + _FEW, n)
                before[first : first + 1] = y[first - 1, places] - flexible * tau[first - 1]
    return before, searched_rows(model, whole, range(first, n), starts, tolerance, before)


def searched_rows(
    model: SoftModel,
    whole: States,
    rows: Sequence[int],
    starts: FloatArray,
    tolerance: float,
    sliders: FloatArray | None = None,
) -> list[int]:
    """Search some rows one by one for their states, from starts, then from rest or the row before; return those without any.

    With memory, the sliders before the first of them are given, and those before the others filled in.
    """
    now, before, lost = model, np.asarray(model.rest), []
    if sliders is not None and len(rows):
        now = remembering(model, memory_of(untouched(model))._replace(bending=sliders[rows[0]]))
        before = whole.q_springs[rows[0] - 1] if rows[0] else before
    for row, case in zip(rows, load_cases({name: load[rows] for name, load in whole.loads.items()}, len(rows)), strict=True):
        state, start = None, starts[row]
        if sliders is not None:  # as far from the row before as it was: what stuck still sticks
            sliders[row], start = memory_of(now).bending, before + start - starts[max(row - 1, 0)]
        for one in (start, before):
            state = state or balanced_state(now, whole.q_motors[row], case, one, tolerance=tolerance)
        if state is None:
            lost.append(row)
            continue
        whole.q_springs[row], whole.tangent[row] = state.q_springs, state.tangent
        whole.actuator_loads[row], whole.coupling[row] = state.load.motors, state.load.coupling
        if sliders is not None:
            now, before = after_step(now, whole.q_motors[row], state.q_springs), state.q_springs
    return lost


def _steps(
    tangent: FloatArray, unbalanced: FloatArray, tau: FloatArray, off: FloatArray, friction: Any
) -> tuple[FloatArray, FloatArray]:
    """Steps of elastic coordinates, shape (N, n_springs), and of moments of friction, (N, n_sections, 2); see the module."""
    (n, pairs, _), flat, limit = tau.shape, friction.places.ravel(), friction.limit[:, None]
    compliance, same = np.linalg.inv(tangent), np.eye(2 * pairs)
    free = -compliance @ unbalanced[..., None]
    bends = compliance[:, flat[:, None], flat] + np.diag(np.repeat(BENDING_STICK / friction.limit, 2))
    stiff = 1.0 / np.maximum(np.trace(bends, axis1=1, axis2=2) / len(flat), 1e-12)[:, None, None]
    aim = tau + stiff * off
    size = np.maximum(np.linalg.norm(aim, axis=-1, keepdims=True), 1e-300)
    share = np.minimum(1.0, limit / size)
    along = aim / size * (share < 1.0)
    across = share[..., None] * (np.eye(2) - along[..., None] * along[..., None, :])
    within = np.einsum("kl,nkij->nkilj", np.eye(pairs), across).reshape(n, len(flat), len(flat))
    known = (aim * share - tau).reshape(n, -1, 1) + stiff * within @ free[:, flat]
    found = np.linalg.solve(same - within @ (same - stiff * bends), np.concatenate([known, stiff * within], axis=2))
    moved, carried = free[:, flat] - bends @ found[..., :1], bends @ found[..., 1:]
    sliders = np.zeros(moved.shape)
    for row in range(n - 1):
        sliders[row + 1] = moved[row] + carried[row] @ sliders[row]
    turns = found[..., :1] - found[..., 1:] @ sliders
    steps = (free - compliance[:, :, flat] @ turns)[..., 0]
    shorter = np.minimum(1.0, LARGEST_STEP / np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-300))
    return steps * shorter, turns.reshape(tau.shape) * shorter[..., None]


def _is_solvable(model: SoftModel, loads: Mapping[str, FloatArray]) -> bool:
    moments = any(np.any(wrench[:, 3:]) for frame, wrench in loads.items() if frame)
    return model.structure.muscle_lengths is None and 0 < model.n_springs <= _MOST and not moments


def _is_stable(model: SoftModel, tangent: FloatArray) -> Any:
    softness = 1.0 / np.sqrt(model.stiffness)
    return np.linalg.eigvalsh(softness[:, None] * tangent * softness)[:, 0] > CLEARLY * POSITIVE


def _put(whole: States, rows: Any, states: States, some: Any) -> None:
    for array, part in zip(whole[3:6], states[3:6], strict=True):
        array[rows] = part[some]


def _evaluated(model: SoftModel, whole: States, rows: Any, tolerance: float) -> tuple[States, FloatArray, FloatArray] | None:
    """States of some rows, the residual, shape (N, n_springs), and the size that counts as none, (N,); None: out of range."""
    some = {name: load[rows] for name, load in whole.loads.items()}
    at = EquilibriumDerivatives(model, States.at(model, whole.q_motors[rows], whole.q_springs[rows], some))
    if not at.valid:
        return None
    (n, count), n_joints = at.strains.shape, at.n_joint_motors
    rates, springs = np.broadcast_to(np.eye(count), (n, count, count)), model.springs.torques(at.strains)
    residual, tangent, coupling = springs.copy(), at.springs.tangent(rates), np.zeros((n, count, model.n_motors))
    actuator_loads = np.zeros((n, model.n_motors))
    if at.states.loads:
        joints = at.joint_rates(np.zeros((n, count, n_joints)), rates)
        coupling[..., :n_joints], strains = at.by_coordinates(joints @ at.tree.stiffness(), rates)
        residual -= (joints @ at.tree.torque[..., None])[..., 0]
        tangent -= strains
        actuator_loads[:, :n_joints] = at.tree.torque[:, model.structure.motor_indices]
    if at.actuators is not None:
        arms, stiffness = at.actuators.stiffness()
        tangent += stiffness
        actuator_loads[:, n_joints:] = at.actuators.pulls
        residual += (at.actuators.pulls[:, None] @ arms)[:, 0]
        coupling[..., n_joints:] = -arms.swapaxes(1, 2) * at.actuators.by_input[:, None]
    states = at.states._replace(actuator_loads=actuator_loads, tangent=tangent, coupling=coupling)
    allowed = np.maximum(tolerance * np.maximum(np.linalg.norm(springs, axis=1), MOMENT_FLOOR), model.rounding)
    return states, residual, allowed
