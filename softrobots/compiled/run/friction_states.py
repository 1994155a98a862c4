"""States before the steps of robots with dry friction, from results of either engine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.results import CompiledEquilibrium, EquilibriumBatch
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.friction_coordinates import after_step, memory_of
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium_result import check_same_model


class StatesBefore(NamedTuple):
    """States before a step, one row each."""

    springs: FloatArray
    """Elastic coordinates, from which the search starts, shape (n, n_springs) [rad or m]."""
    sliders: FloatArray
    """The sliders of dry friction at the places of the unknowns, shape (n, n_unknowns) [rad]."""
    status: Any
    """`Status` of each row, shape (n,)."""

    @property
    def lost(self) -> Any:
        """Mask of the rows that are no equilibria, shape (n,)."""
        return ~np.isin(self.status, (Status.CERTIFIED, Status.NEUTRAL))


def states_before(actuation: Actuation, previous: Any) -> StatesBefore:
    """Return the states of a result, of a sequence of single results, or for None of a robot that nothing has moved yet.

    Raises:
        ParameterError: If it is something else, or the result of another robot.
    """
    model = actuation.model
    if isinstance(previous, EquilibriumBatch):
        found, rest = previous.friction_bending, actuation.rest_bending
        if found is None or (previous.q_springs.shape[1], found.shape[1:]) != (model.n_springs, rest.shape):
            raise ParameterError("previous", previous, f"equilibria of the model given, {model!r}")
        return StatesBefore(previous.q_springs, actuation.sliders(found), previous.status)
    springs, bending = model.rest[None], actuation.rest_bending[None]
    if previous is not None:
        states = previous if isinstance(previous, Sequence) else [previous]
        if not states:
            raise ParameterError("previous", previous, "at least one state")
        springs, bending = (np.array(part) for part in zip(*(_state(model, one) for one in states), strict=True))
    return StatesBefore(springs, actuation.sliders(bending), np.full(len(springs), Status.CERTIFIED))


def _state(model: SoftModel, state: Any) -> tuple[FloatArray, FloatArray]:
    """Elastic coordinates of a single result, and the bending that friction remembers."""
    if isinstance(state, CompiledEquilibrium):
        if state.friction_bending is None or state.model != model:
            raise ParameterError("previous", state, f"an equilibrium of the model given, {model!r}")
        return state.q_springs, state.friction_bending
    check_same_model(model, state, "previous")
    return state.q_springs, memory_of(after_step(state.model, state.q_motors, state.q_springs)).bending
