"""The pressed contacts of a state: what holds while springs and actuators move a little."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.statics.contact.certificate import active_contacts
from softrobots.statics.contact.contact import SLIPS, STICKS
from softrobots.statics.contact.touch import joined
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, largest_residual
from softrobots.statics.loads import AppliedLoad, Load

if TYPE_CHECKING:
    from softrobots.statics.equilibrium_result import Equilibrium


class PressedGaps(NamedTuple):
    """Gaps that stay zero, in the order of `Equilibrium.contacts`; after them both ways of sliding of each one that sticks."""

    by_springs: FloatArray
    """Their derivatives by the springs, shape (k, n_springs)."""
    by_motors: FloatArray
    """Their derivatives by the actuators, shape (k, n_motors)."""
    forces: FloatArray
    """Their forces, shape (k,) [N]."""


def pressed_gaps(state: ElasticState) -> PressedGaps | None:
    """Return the pressed gaps of a state in equilibrium; None if no contact is pressed."""
    touch = state.touch
    if touch is None or not touch.forces.any():
        return None
    rounding = largest_residual(state.model, state.scale, TOLERANCE)
    pressed = active_contacts(touch, state.model.reach, rounding).pressed
    if not len(pressed):
        return None
    return PressedGaps(touch.rows[pressed], touch.motor_rows[pressed], touch.forces[pressed])


def check_no_rubbing(equilibrium: Equilibrium, what: str) -> None:
    """Check that no contact of an equilibrium has friction; `what` cannot take it, in words.

    Raises:
        ParameterError: If a contact sticks or slips.
    """
    rubbing = [contact.obstacle for contact in equilibrium.contacts if contact.status in (STICKS, SLIPS)]
    if rubbing:
        raise ParameterError("equilibrium", rubbing, f"one whose contacts have no friction: {what} takes none")


def motor_slopes(state: ElasticState, load: Load) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the load on each actuator by actuators and by elastic coordinates, at constant contact forces.

    Shapes (n_motors, n_motors) and (n_motors, n_springs); see `Point.motor_derivatives`.
    """
    applied = AppliedLoad(state.model, load).at(state.q)
    return state.point.motor_derivatives(applied if state.touch is None else joined(applied, state.touch.load))


def whole_stiffness(state: ElasticState, load: Load) -> FloatArray:
    """Hessian of the Lagrangian over actuators, then elastic coordinates, shape (n, n), with their contact forces."""
    upper = -np.concatenate(motor_slopes(state, load), axis=1)
    lower: Any = np.concatenate([-state.load.coupling, state.tangent], axis=1)
    return np.concatenate([upper, lower])
