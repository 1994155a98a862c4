"""Contacts that open: how a robot follows its actuators once it leaves an obstacle.

While contacts stay pressed the tip moves along the obstacle only. To leave it, the actuators first take over the force of the
contact: without it the springs would be elsewhere by `-P G^T lambda`, with `P` the inverse of the stiffness beside the contacts
that stay. From there the robot follows as without the contact. The linear model is that of a complementarity problem on the
branch on which those contacts are open; it holds where its step opens them.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NeutralEquilibrium
from softrobots.statics.contact.pressed_gaps import PressedGaps
from softrobots.statics.elastic_state import ElasticState
from softrobots.statics.sensitivity import inverse_in_contact
from softrobots.statics.tip_steps import TipModel

_MOST = 4  # pressed contacts beyond which each opens alone, or all of them


def released(
    state: ElasticState, pressed: PressedGaps, motors: FloatArray, springs: FloatArray, held: TipModel, damping: float
) -> list[TipModel]:
    """Return the models of the tip in which some of the pressed contacts open.

    Args:
        state: The robot in equilibrium.
        pressed: Its pressed contacts.
        motors: Rows of the tip Jacobian, columns per actuator, shape (rows, n_motors).
        springs: The same rows, columns per elastic coordinate, shape (rows, n_springs).
        held: The model in which all stay pressed.
        damping: Damping of the step that must open them [m].

    Returns:
        The models, those that their own step contradicts left out.
    """
    count, models = len(pressed.forces), list[TipModel]()
    sizes = range(1, count + 1) if count <= _MOST else (1, count)
    for opened in (list(some) for size in sizes for some in combinations(range(count), size)):
        kept = np.setdiff1d(np.arange(count), opened)
        try:
            inverse = inverse_in_contact(state.model, state.tangent, pressed.by_springs[kept])
        except NeutralEquilibrium:  # these contacts keep the robot from buckling
            continue
        follow = inverse.springs_by_load @ state.load.coupling - inverse.springs_by_gap @ pressed.by_motors[kept]
        shift = -inverse.springs_by_load @ (pressed.forces[opened] @ pressed.by_springs[opened])
        model = TipModel(held.missing - springs @ shift, motors + springs @ follow, follow, shift)
        step = model.step(state.model.actuators.basis, damping)
        gaps = pressed.by_springs[opened] @ (shift + follow @ step) + pressed.by_motors[opened] @ step
        if gaps.min() > 0.0:
            models.append(model)
    return models
