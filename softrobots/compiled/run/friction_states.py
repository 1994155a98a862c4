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
from softrobots.model.dry_friction import FrictionMemory
from softrobots.model.friction_coordinates import after_step, memory_of, remembering, slipping
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium_result import check_same_model


class StatesBefore(NamedTuple):
    """States before a step, one row each."""

    springs: FloatArray
    """Elastic coordinates, from which the search starts, shape (n, n_springs) [rad or m]."""
    sliders: FloatArray
    """The sliders of dry friction at the places of the unknowns, shape (n, n_unknowns) [rad]."""
    anchors: FloatArray
    """Length beyond each guide at which its slider stands, beyond that at rest, shape (n, n_guides) [m]."""
    status: Any
    """`Status` of each row, shape (n,)."""

    @property
    def lost(self) -> Any:
        """Mask of the rows that are no equilibria, shape (n,)."""
        return ~np.isin(self.status, (Status.CERTIFIED, Status.NEUTRAL))

    @property
    def rows(self) -> dict[str, tuple[FloatArray, int]]:
        """What `batch_rows` counts: nothing of one state for all cases."""
        return {"previous": (self.springs, self.springs.shape[1])} if len(self.springs) != 1 else {}

    def row(self, number: int) -> StatesBefore:
        """Return the state of a case; the only one of all cases."""
        return StatesBefore(*(part[number : number + 1] if len(part) > 1 else part for part in self))


def states_before(actuation: Actuation, previous: Any) -> StatesBefore:
    """Return the states of a result, of a sequence of single results, or for None of a robot that nothing has moved yet.

    Raises:
        ParameterError: If it is something else, or the result of another robot.
    """
    model = actuation.model
    if isinstance(previous, EquilibriumBatch):
        found, rest = previous.friction_bending, actuation.rest_bending
        if (
            found is None
            or previous.friction_slip is None
            or (previous.q_springs.shape[1], found.shape[1:]) != (model.n_springs, rest.shape)
        ):
            raise ParameterError("previous", previous, f"equilibria of the model given, {model!r}")
        return StatesBefore(previous.q_springs, actuation.sliders(found), previous.friction_slip, previous.status)
    springs, bending, anchors = model.rest[None], actuation.rest_bending[None], np.zeros((1, actuation.n_guides))
    if previous is not None:
        states = previous if isinstance(previous, Sequence) else [previous]
        if not states:
            raise ParameterError("previous", previous, "at least one state")
        parts = zip(*(_state(model, one) for one in states), strict=True)
        springs, bending, anchors = (np.array(part) for part in parts)
    return StatesBefore(springs, actuation.sliders(bending), anchors, np.full(len(springs), Status.CERTIFIED))


def state_after(actuation: Actuation, layout: Any, w: Any) -> StatesBefore | None:
    """Return the state that a workspace holds after a step, as the one before the next; None without dry friction."""
    if not layout.rubbing:
        return None
    n, guides = layout.unknowns, layout.guides
    parts = (w[place : place + count] for place, count in ((layout.unknown, n), (layout.slid, n), (layout.anchored, guides)))
    springs, sliders, anchors = (np.array(part, dtype=np.float64)[None] for part in parts)
    return StatesBefore(actuation.elastic(springs), sliders, anchors, np.array([Status.CERTIFIED]))


def remembered(actuation: Actuation, before: StatesBefore) -> SoftModel:
    """Return the robot of the general solver with what its friction remembers of the first of some states."""
    friction: Any = actuation.model.structure.friction
    bending, pieces = actuation.bending(before.sliders[:1])[0], friction.untouched.pieces
    return remembering(actuation.model, FrictionMemory(bending, before.anchors[0], pieces))


def apart(actuation: Actuation, sliders: FloatArray | None) -> list[Any]:
    """Return anchors of guides, shape (n, n_guides), and sliders of segments, (n, n_unknowns), that a run ends with."""
    return [None, None] if sliders is None else np.split(np.nan_to_num(sliders), [actuation.n_guides], axis=1)


def with_sliders(actuation: Actuation, sliders: FloatArray | None) -> SoftModel:
    """Return the robot of the general solver with what a run ends with, of one case; as it is without friction."""
    if sliders is None:
        return actuation.model
    anchors, own = apart(actuation, sliders)
    return remembered(actuation, StatesBefore(own, own, anchors, None))


def gripping(model: SoftModel, layout: Any, w: Any) -> SoftModel:
    """Return such a robot with the friction of a state that was found, as a search leaves it: see `slipping`."""
    if not layout.rubbing:
        return model
    grips = np.array(w[layout.grips : layout.grips + layout.guides], dtype=np.float64)
    return slipping(remembering(model, memory_of(model), grips))


def _state(model: SoftModel, state: Any) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Elastic coordinates of a single result, and what friction remembers of bending and of slip in guides."""
    if isinstance(state, CompiledEquilibrium):
        if state.friction_bending is None or state.friction_slip is None or state.model != model:
            raise ParameterError("previous", state, f"an equilibrium of the model given, {model!r}")
        return state.q_springs, state.friction_bending, state.friction_slip
    check_same_model(model, state, "previous")
    memory, friction = memory_of(after_step(state.model, state.q_motors, state.q_springs)), model.structure.friction
    return state.q_springs, memory.bending, np.zeros(0) if friction is None else friction.anchors(memory)
