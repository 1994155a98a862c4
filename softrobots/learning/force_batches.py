"""Forces on the tips of many looped chains from the loads on their actuators, side by side.

The search of `softrobots.statics.tip_force.force_search` for all cases at once, with batches of compiled equilibria from rest
and of compiled derivatives. Cases that it does not explain are searched for one by one, each from the state before.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.core.errors import LoadNotFound, ParameterError
from softrobots.learning.chain_responses import ChainResponses
from softrobots.statics.tip_force.force_search import FIRST_DAMPING, LAST_DAMPING, OBSERVABLE, torque_tolerance

_STEPS = 20  # of the search side by side; most cases take six


class FoundForces(NamedTuple):
    """Results of N cases."""

    springs: FloatArray
    """Elastic coordinates, shape (N, n_springs) [rad or m]."""
    tips: FloatArray
    """Tips, shape (N, 3) [m]."""
    forces: FloatArray
    """Forces on them, shape (N, 3) [N]."""
    errors: FloatArray
    """Norms of the loads that are not explained, shape (N,) [N m or N]."""
    statuses: Any
    """`Status` of each, shape (N,)."""


class _Looked(NamedTuple):
    """Cases at forces that are tried."""

    springs: FloatArray
    tips: FloatArray
    left: FloatArray
    """Measured loads minus those there, shape (N, n_motors)."""
    slope: FloatArray
    """Derivative of the loads by the force, shape (N, n_motors, 3); of actuators that feel none zero."""
    certified: Any


class ForceBatches:
    """The search for the forces on a robot."""

    def __init__(self, compiled: CompiledModel, chain: ChainResponses, gravity: FloatArray | None, threads: int) -> None:
        """Take the batch solvers of a robot, their derivatives, gravity, shape (3,) [m/s^2], and the number of threads."""
        self._compiled, self._chain, self._gravity, self._threads = compiled, chain, gravity, threads

    def find(self, motors: FloatArray, torques: FloatArray) -> FoundForces:
        """Find the forces of N cases, shapes (N, n_motors)."""
        count, reach = len(motors), self._compiled.model.reach
        forces, damping = np.zeros((count, 3)), np.full(count, FIRST_DAMPING * reach)
        tolerance = np.array([torque_tolerance(one) for one in torques])
        found = self._look(motors, torques, forces)
        explained, left = np.zeros(count, dtype=bool), np.flatnonzero(found.certified)
        for _ in range(_STEPS):
            across, values, along = np.linalg.svd(found.slope[left], full_matrices=False)
            seen = values > OBSERVABLE * reach
            missing = np.where(seen, _products(found.left[left], across), 0.0)
            size = np.linalg.norm(missing, axis=1)
            explained[left] = (size <= tolerance[left]) & seen.all(axis=1) & (values.shape[1] == 3)
            going = size > tolerance[left]
            left, across, values, along, seen, missing, size = (
                one[going] for one in (left, across, values, along, seen, missing, size)
            )
            if not len(left):
                break
            scaled = missing * values / (values**2 + damping[left, None] ** 2)
            tried = forces[left] + _products(scaled, along)
            looked = self._look(motors[left], torques[left], tried)
            over = np.linalg.norm(np.where(seen, _products(looked.left, across), 0.0), axis=1)
            better = looked.certified & (over < size)
            for array, new in zip((forces, *found), (tried, *looked), strict=True):
                array[left[better]] = new[better]
            softer = np.where(damping[left] > LAST_DAMPING * reach, 0.1 * damping[left], 0.0)
            damping[left] = np.where(better, softer, np.maximum(10.0 * damping[left], 10.0 * LAST_DAMPING * reach))
        statuses = np.full(count, Status.CERTIFIED)
        results = FoundForces(found.springs, found.tips, forces, np.linalg.norm(found.left, axis=1), statuses)
        for row in np.flatnonzero(~explained).tolist():
            self._search(results, row, motors[row], torques[row])
        return results

    def _look(self, motors: FloatArray, torques: FloatArray, forces: FloatArray) -> _Looked:
        """Solve for the equilibria under forces, and differentiate the loads."""
        feels = self._compiled.model.actuators.feels
        batch = self._compiled.equilibria(motors, forces, gravity=self._gravity, threads=self._threads)
        at = self._chain.at(motors, forces, batch.q_springs, self._gravity)
        loads, slope = self._chain.feel(at, self._threads)
        good = batch.certified & np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(loads).all(axis=1)
        slope = np.where(good[:, None, None] & feels[:, None], slope, 0.0)
        left = np.where(good[:, None] & feels, torques - loads, 0.0)
        return _Looked(np.array(batch.q_springs), np.array(batch.tip_positions), left, slope, good)

    def _search(self, results: FoundForces, row: int, motors: FloatArray, torques: FloatArray) -> None:
        """Search for the force of one case."""
        status = Status.CERTIFIED
        try:
            found = self._compiled.estimate_load(motors, torques, gravity=self._gravity)
        except LoadNotFound as error:
            found, status = error.best, error.best.status
        except ParameterError:
            results.statuses[row], results.errors[row] = Status.NOT_A_NUMBER, np.inf
            return
        parts = found.q_springs, found.tip_position, found.force, found.unexplained, status
        for array, part in zip(results, parts, strict=True):
            array[row] = part


def _products(rows: FloatArray, matrices: FloatArray) -> FloatArray:
    """Products of rows, shape (N, k), and matrices, shape (N, k, l)."""
    return np.asarray((rows[:, None] @ matrices)[:, 0])
