"""Equilibria and load estimates of every robot without dry friction, row by row; see `general_solver`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.core.errors import LoadNotFound, NeutralEquilibrium, ParameterError
from softrobots.learning.chain_responses import ChainResponses
from softrobots.learning.force_batches import ForceBatches
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import TOLERANCE, largest_residual
from softrobots.statics.elastostatics import solve_springs
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.load_estimation import estimate_load
from softrobots.statics.loads import Load
from softrobots.statics.stability import NEUTRAL, stability

_FINE = 1e-12  # tolerance of equilibria, relative to their load


class RowSolver:
    """Solvers of a robot, from rest."""

    def __init__(self, model: SoftModel, weight: bool, compiled: CompiledModel | None, chain: ChainResponses | None) -> None:
        """Take the robot, whether it has weight, and its compiled solvers and derivatives, if there are any."""
        self._model, self._weight, self._compiled, self._chain = model, weight, compiled, chain

    def equilibria(
        self, motors: FloatArray, force: FloatArray, gravity: FloatArray, numbers: FloatArray, threads: int, count: int
    ) -> list[Any]:
        """Find equilibria from rest."""
        model = self._model
        if self._compiled is not None:
            rows = (np.broadcast_to(one, (count, one.shape[1])) for one in (motors, force))
            batch = self._compiled.equilibria(*rows, gravity=gravity if self._weight else None, threads=threads)
            return [np.array(batch.q_springs), np.array(batch.tip_positions), np.array(batch.residual), batch.status]
        springs, tips, errors, statuses = self._room(count)
        for row, (at, push) in enumerate(_rows(count, motors, force)):
            try:
                checked = model.actuators.checked(at)
            except ParameterError:
                statuses[row] = Status.NOT_A_NUMBER
                continue
            load = Load({model.tip: np.pad(push, (0, 3))}, tuple(gravity.tolist()) if self._weight else None)
            state, _, stable = solve_springs(model, checked, load, model.rest, tolerance=_FINE)
            springs[row], tips[row], errors[row] = (
                state.q_springs,
                frame_placement(model, state.q, model.tip).translation,
                state.error,
            )
            if not state.error <= largest_residual(model, state.scale, TOLERANCE):
                statuses[row] = Status.UNSETTLED
            elif not stable:
                kind = stability(model, state.point, state.q, state.tangent).kind
                statuses[row] = Status.NEUTRAL if kind == NEUTRAL else Status.UNSTABLE
        return [springs, tips, errors, statuses]

    def estimates(
        self, motors: FloatArray, torques: FloatArray, gravity: FloatArray, numbers: FloatArray, threads: int, count: int
    ) -> list[Any]:
        """Find forces on the tip from the loads on the motors."""
        if self._compiled is not None and self._chain is not None:
            rows = [np.broadcast_to(one, (count, one.shape[1])) for one in (motors, torques)]
            search = ForceBatches(self._compiled, self._chain, gravity if self._weight else None, threads)
            return list(search.find(*rows))
        springs, tips, errors, statuses = self._room(count)
        forces = np.zeros((count, 3))
        for row, (at, felt) in enumerate(_rows(count, motors, torques)):
            try:
                found = estimate_load(self._model, at, felt, gravity=gravity if self._weight else None)
            except ParameterError:
                statuses[row] = Status.NOT_A_NUMBER
                continue
            except (LoadNotFound, NeutralEquilibrium):
                statuses[row] = Status.NOT_REACHED
                continue
            springs[row], tips[row], forces[row] = found.equilibrium.q_springs, found.equilibrium.tip_position, found.force
            errors[row] = found.residual
            if len(found.unobservable_directions):
                statuses[row] = Status.UNOBSERVABLE
            elif not found.equilibrium.stable:
                statuses[row] = Status.UNSTABLE
        return [springs, tips, forces, errors, statuses]

    def _room(self, count: int) -> tuple[FloatArray, FloatArray, FloatArray, Any]:
        """Arrays for elastic coordinates, tips, errors and statuses."""
        springs, tips, errors = np.zeros((count, self._model.n_springs)), np.zeros((count, 3)), np.full(count, np.inf)
        return springs, tips, errors, np.full(count, Status.CERTIFIED)


def _rows(count: int, *arrays: FloatArray) -> Iterator[tuple[FloatArray, ...]]:
    """Yield the rows of arrays of `count` rows, or of one for all."""
    return zip(*(np.broadcast_to(one, (count, one.shape[1])) for one in arrays), strict=True)
