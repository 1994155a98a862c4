r"""Equilibria of many rows at once, by Newton's method from starts that are near.

The residual `r` of all rows and the tangent stiffness :math:`K_t = \partial r / \partial y` come from the same arrays as the
derivatives of equilibria (`softrobots.identification.residual_derivatives`): in a virtual motion of unit rate of an elastic
coordinate the work is :math:`-r`, and its derivative :math:`-K_t`. A row whose residual each step does not halve at least, or
that does not end in a stable equilibrium, is left to the search for a single one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.elastic_state import MOMENT_FLOOR
from softrobots.statics.elastostatics import CLEARLY, LARGEST_STEP

_MOST = 24  # elastic coordinates; beyond, a search for each row is as fast
_MOST_STEPS = 8
_SHRINKS = 0.5  # share of the residual that a step leaves at most


def balanced_rows(
    model: SoftModel, motors: FloatArray, loads: Mapping[str, FloatArray], starts: FloatArray, tolerance: float
) -> tuple[States, Any]:
    """Search for equilibria; none are found of robots of many coordinates, with memory or given lengths, or under moments.

    Args:
        model: The robot.
        motors: Actuators, shape (N, n_motors).
        loads: Wrench by frame, shape (N, 6), and gravity, "", shape (N, 3).
        starts: Elastic coordinates to start from, shape (N, n_springs).
        tolerance: Residual that counts as none, relative to the torques of the springs.

    Returns:
        States of all rows, and which of them are stable equilibria, shape (N,).
    """
    (n, count), structure, n_motors = starts.shape, model.structure, model.n_motors
    arrays = (np.zeros((n, *shape)) for shape in ((n_motors,), (count, count), (count, n_motors)))
    whole, found = States(motors, starts.copy(), loads, *arrays), np.zeros(n, dtype=bool)
    free = structure.friction is None and structure.muscle_lengths is None and 0 < count <= _MOST
    if not free or any(np.any(wrench[:, 3:]) for frame, wrench in loads.items() if frame):
        return whole, found
    softness, rows, last = 1.0 / np.sqrt(model.stiffness), np.arange(n), np.full(n, np.inf)
    for _ in range(_MOST_STEPS):
        some = {name: load[rows] for name, load in loads.items()}
        at = EquilibriumDerivatives(model, whole._replace(q_motors=motors[rows], q_springs=whole.q_springs[rows], loads=some))
        if not at.valid:
            break
        states, residual, scale = _evaluated(at)
        size = np.linalg.norm(residual, axis=1)
        done = size <= np.maximum(tolerance * np.maximum(scale, MOMENT_FLOOR), model.rounding)
        for array, part in zip(whole[3:6], states[3:6], strict=True):
            array[rows[done]] = part[done]
        found[rows[done]] = np.linalg.eigvalsh(softness[:, None] * states.tangent[done] * softness)[:, 0] > CLEARLY * POSITIVE
        try:
            steps = np.linalg.solve(states.tangent, -residual[..., None])[..., 0]
        except np.linalg.LinAlgError:
            break
        goes_on = ~done & (size <= _SHRINKS * last) & (np.linalg.norm(steps, axis=1) <= LARGEST_STEP)
        rows, last = rows[goes_on], size[goes_on]
        if not len(rows):
            break
        whole.q_springs[rows] += steps[goes_on]
    return whole, found


def _evaluated(at: EquilibriumDerivatives) -> tuple[States, FloatArray, FloatArray]:
    """The states, the residual, shape (N, n_springs), and the size of the torques of the springs, shape (N,)."""
    model, (n, count) = at.model, at.strains.shape
    rates, no_motors = np.broadcast_to(np.eye(count), (n, count, count)), np.zeros((n, count, model.n_motors))
    coupling, slopes = AdjointRows(at, Outputs(strains=rates), (no_motors, rates)).by_coordinates()
    torque = at.tree.torque
    elastic = (at.joint_rates(no_motors[..., : at.n_joint_motors], rates) @ torque[..., None])[..., 0]
    actuator_loads = torque[:, model.structure.motor_indices]
    if at.actuators is not None:
        arms, tensions = at.actuators.arms(rates), at.actuators.pulls
        elastic -= (arms @ tensions[..., None])[..., 0]
        actuator_loads = np.concatenate([actuator_loads, tensions], axis=1)
        coupling = np.concatenate([coupling, -arms * at.actuators.by_input[:, None]], axis=2)
    springs = model.springs.torques(at.strains)
    states = at.states._replace(actuator_loads=actuator_loads, tangent=-slopes, coupling=coupling)
    return states, springs - elastic, np.linalg.norm(springs, axis=1)
