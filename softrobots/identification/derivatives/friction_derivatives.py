r"""How the sliders of dry friction carry changes of parameters from row to row, in equilibria that follow one another.

The friction of a section that bends has the torque :math:`\tau = L\,x/\max(|x|, s)` at the displacement `x = y - c` of its
bending `y` from the slider `c`, of limit `L` and stick `s` (`softrobots.model.dry_friction`), with the stiffness `H`. The
residual changes with a parameter by :math:`\tau/L\,dL - H\,dc` more than without memory. A slider that slips follows:

.. math:: dc' = dy - G\,(dy - dc), \qquad G = \frac{s}{|x|}\Bigl(1 - \frac{x x^T}{|x|^2}\Bigr)

and one that sticks stays, `G = 1`. It starts at the bending of the relaxed robot.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.identification.derivatives.rows_and_states import Outputs
from softrobots.identification.model_change import ModelChange
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.model.dry_friction import BENDING_STICK, DryFriction

_STEP = 1e-6  # of differences of a course, relative


def friction_loads(
    at: EquilibriumDerivatives, sliders: FloatArray, change: ModelChange, along: Callable[[AdjointRows], FloatArray]
) -> FloatArray:
    """Change of the load of friction on the strains by parameters at fixed strains, shape (N, n_strains, P).

    Args:
        at: Equilibria that follow one another.
        sliders: The sliders before each, shape (N, n_sections, 2) [rad].
        change: Derivatives of the numbers of the model by the parameters.
        along: Derivatives of outputs by the parameters where the sliders and the limits of friction stay.
    """
    friction: Any = at.model.structure.friction
    places, (n, count) = friction.places, at.strains.shape
    flat, nothing = places.ravel(), np.zeros((count, change.n_parameters))
    rows = np.broadcast_to(np.eye(count)[flat], (n, len(flat), count))
    loads = SliderStates(friction, at.strains, sliders).loads(
        along(AdjointRows(at, Outputs(strains=rows))).reshape(n, *places.shape, -1),
        at.compliance[:, flat[:, None], flat],
        change.by_number.get("bending_friction", nothing[: len(places)]),
        change.by_number.get("rest", nothing)[places],
    )
    found: FloatArray = np.zeros((n, count, change.n_parameters))
    found[:, flat] = loads.reshape(n, len(flat), -1)
    return found


def slopes_of_course(
    differences: Callable[[FloatArray], Mapping[str, FloatArray]], parameters: ParameterSet, values: FloatArray
) -> dict[str, FloatArray]:
    """Derivatives of rows that follow one another by all parameters, (n, k, P) by quantity, as differences of the whole course.

    Args:
        differences: Measured minus predicted by quantity, shape (n, k), for given values.
        parameters: The parameters.
        values: Their values, shape (P,).
    """
    slopes = {key: np.zeros((*one.shape, len(values))) for key, one in differences(values).items()}
    for number, one in enumerate(parameters.parameters):
        step = _STEP * (abs(values[number]) or 1.0)
        ends = np.clip(values[number] + np.array([-step, step]), one.lower, one.upper)
        low, high = (np.where(np.arange(len(values)) == number, end, values) for end in ends)
        below, above = differences(low), differences(high)
        for key, slope in slopes.items():
            slope[..., number] = (above[key] - below[key]) / (ends[1] - ends[0])
    return slopes


class SliderStates:
    """The sliders before each of N equilibria that follow one another, and what they make of changes."""

    def __init__(self, friction: DryFriction, strains: FloatArray, sliders: FloatArray) -> None:
        """Take strains, shape (N, count), and the sliders before each, shape (N, n_sections, 2) [rad]."""
        self.places = friction.places
        """Places of the bending of the sections among the strains, shape (n_sections, 2)."""
        apart = strains[:, friction.places] - sliders
        size = np.linalg.norm(apart, axis=-1)[..., None]
        reach = np.maximum(size, BENDING_STICK)
        along = apart / reach * (size > BENDING_STICK)
        across = np.eye(2) - along[..., :, None] * along[..., None, :]
        self.torque = apart / reach
        """Moment of friction over its limit, shape (N, n_sections, 2)."""
        self.stiffness = across * (friction.limit[:, None] / reach)[..., None]
        """Derivative of the moment by the bending, shape (N, n_sections, 2, 2) [N m/rad]."""
        self._stays = across * (BENDING_STICK / reach)[..., None]

    def loads(self, direct: FloatArray, compliance: FloatArray, limits: FloatArray, start: FloatArray) -> FloatArray:
        """Return the change of the load on the bending of the sections by parameters, shape (N, n_sections, 2, P).

        Args:
            direct: Change of the bending without friction of its own, shape (N, n_sections, 2, P).
            compliance: Of the bending, shape (N, 2 n_sections, 2 n_sections).
            limits: Change of the limits, shape (n_sections, P) [N m].
            start: Change of the sliders before the first equilibrium, shape (n_sections, 2, P).
        """
        loads: FloatArray = -self.torque[..., None] * limits[:, None]
        sliders = start
        for row, load in enumerate(loads):
            load += self.stiffness[row] @ sliders
            bending = direct[row] + (compliance[row] @ load.reshape(len(compliance[row]), -1)).reshape(load.shape)
            sliders = bending - self._stays[row] @ (bending - sliders)
        return loads
