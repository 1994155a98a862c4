r"""Dry friction of the bending of an element, traced: the law of `softrobots.model.dry_friction` in a step from given sliders.

With the displacement `x` of the bending from the slider, :math:`\rho = \max(|x|, s)`, and the limit `L`

.. math:: V = \tfrac{L}{2} (x^2 / \rho + \rho - s), \quad \tau = L x / \rho, \quad
    K = \tfrac{L}{\rho} (1 - x x^T / \rho^2 \text{ where } |x| > s)

and after the step the slider is at :math:`(1 - s / \rho) x` from where it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import constants, outer, vector
from softrobots.compiled.trace.expressions import Scalar, if_less, larger, square_root
from softrobots.model.dry_friction import BENDING_STICK


class FrictionPoint(NamedTuple):
    """Dry friction of an element at given coordinates."""

    energy: Scalar
    """What the step dissipates, and the energy of the stick [J]."""
    torque: Any
    """Load that friction adds to each unknown coordinate, shape (k,) [N m]."""
    stiffness: Any
    """Derivative of that, shape (k, k)."""
    sliders: list[Scalar]
    """The sliders after the step [rad]."""


class Rubbing(NamedTuple):
    """Dry friction of the bending of an element."""

    limit: Scalar
    """Moment of the friction [N m]."""
    places: tuple[int, ...]
    """Places of the bending among the unknown coordinates of the element."""
    sliders: Sequence[Scalar] = ()
    """Bending of the slider, for each of the places [rad]."""

    @classmethod
    def of(cls, friction: Sequence[tuple[int, int, float]], moving: Sequence[int]) -> Rubbing | None:
        """Return that of the element with these unknown strains, without sliders; None if it has none."""
        pairs = ((limit, tuple(moving.index(one) for one in bending if one in moving)) for *bending, limit in friction)
        return next((cls(limit, places) for limit, places in pairs if places), None)

    def at(self, unknown: Sequence[Scalar]) -> FrictionPoint:
        """Evaluate the friction at the unknown coordinates of the element (k)."""
        places, k = list(self.places), len(unknown)
        x = vector([unknown[place] - slider for place, slider in zip(places, self.sliders, strict=True)])
        square, least = x @ x, BENDING_STICK**2
        reach = square_root(larger(square, least))
        back = 1.0 / reach
        torque, stiffness = constants(np.zeros(k)), constants(np.zeros((k, k)))
        slope, along = back * self.limit, x * back
        torque[places] = along * self.limit
        bent = constants(np.eye(len(x))) - outer(along, along) * if_less(least, square, 1.0, 0.0)
        stiffness[np.ix_(places, places)] = bent * slope
        energy = (square * back + reach - BENDING_STICK) * (self.limit * 0.5)
        left = 1.0 - back * BENDING_STICK
        return FrictionPoint(
            energy, torque, stiffness, [slider + one * left for slider, one in zip(self.sliders, x.tolist(), strict=True)]
        )
