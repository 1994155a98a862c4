r"""Dry friction in steps of time: what sticks stays, what slips loses the work of its friction.

A step of length `h` with the midpoint rule is the minimum over the strains `z` of the same energy as in statics, with what
friction dissipates on the way (`softrobots.model.dry_friction`), and of the inertia of the step. Friction acts by the rates
:math:`\dot z_1` at the end of the step: with those in the middle, a strain that comes to rest would turn round at each step.
The displacement from the slider :math:`\xi` follows from its value before as

.. math:: \xi_1 = \xi_0 + h \dot z_1 = 4 z_m - 3 z_0 - h \dot z_0 - c_0

with the strains in the middle, :math:`z_m`, and the slider `c_0` before, as far as the stick; beyond it the slider follows. At
rest the strains have the friction that statics remembers. While parts slip in one direction steps keep their second order; the
error is of first order where the direction turns, or a part turns round or comes to rest within a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.dry_friction import DryFriction, FrictionMemory
from softrobots.model.friction_coordinates import with_given_friction
from softrobots.model.soft_model import SoftModel

OVERSHOT = 0.9
"""Slope of the energy uphill at the end of a change of a step over that downhill at its start, above which it is cut."""


class StepFriction:
    """Dry friction of a robot in the step that is being taken."""

    def __init__(self, model: SoftModel) -> None:
        """Take the robot, which has friction."""
        friction: Any = model.structure.friction
        self._friction: DryFriction = friction
        self._memory, self._grip = friction.untouched, np.zeros(friction.n_guides)
        self._base: FloatArray = 3.0 * model.structure.strain_springs.rest
        self.coordinates = with_given_friction(model, self._law).coordinates
        """The coordinates of the robot with the friction of the step, as a function of the strains in the middle."""
        self.guided = self._friction.guided
        """Whether actuators rub in their guides, by their tensions."""

    def begin(self, memory: FrictionMemory, strains: FloatArray, rates: FloatArray, length: float) -> None:
        """Begin a step of a length [s] with what friction remembers, at strains and their rates, each shape (count,)."""
        self._memory, self._base = memory, 3.0 * strains + length * rates

    def grip(self, middle: FloatArray, tensions: FloatArray) -> None:
        """Take the friction of guides at strains in the middle, shape (count,), and tensions, shape (n_muscles,) [N]."""
        with np.errstate(over="ignore", invalid="ignore"):
            self._grip = self._friction.grip(4.0 * middle - self._base, tensions, self._memory)

    def torque(self, middle: FloatArray) -> FloatArray:
        """Return the torque of friction against the strains, shape (count,), at strains in the middle."""
        return self._law(middle)[1]

    def end(self, middle: FloatArray, strains: FloatArray) -> FrictionMemory:
        """Return what friction remembers after the step, of strains in its middle and at its end, each shape (count,)."""
        return self._friction.after(4.0 * middle - self._base, self._memory, strains)

    def _law(self, middle: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        energy, torque, stiffness = self._friction.at(4.0 * middle - self._base, self._memory, self._grip)
        return energy, torque, 4.0 * stiffness


class LineSearch:
    """Search along a change of Newton's method for the least energy of a step, by slopes; they rise steeply where parts stick.

    A whole change that ends beyond the minimum, as steeply uphill as it began downhill, is cut by the Illinois method, until
    half the slope is left. (Without it Newton's method jumps from slip one way to slip the other way and back.)
    """

    def __init__(self, start: FloatArray, change: FloatArray, residual: FloatArray) -> None:
        """Take the accelerations, by how much they shall decrease, and the residual there, each shape (n,)."""
        self._start, self._change, self._first = start, change, float(residual.dot(change))
        self._low, self._high = (0.0, self._first), (1.0, 0.0)
        self._share, self._last, self._cut = 1.0, 0.0, False

    def nearer(self, residual: FloatArray) -> FloatArray | None:
        """Return accelerations nearer to the minimum than the last, whose residual is given; None if they are near enough."""
        slope = float(residual.dot(self._change))
        enough = abs(slope) <= 0.5 * abs(self._first) if self._cut else slope >= -OVERSHOT * self._first
        if enough or self._first <= 0.0:
            return None
        self._cut = True
        if slope > 0.0:
            self._high = self._high[0], 0.5 * self._high[1] if self._last > 0.0 else self._high[1]
            self._low = self._share, slope
        else:
            self._low = self._low[0], 0.5 * self._low[1] if self._last < 0.0 else self._low[1]
            self._high = self._share, slope
        self._last = slope
        (low, downhill), (high, uphill) = self._low, self._high
        self._share = low + (high - low) * downhill / (downhill - uphill)
        return self._start - self._share * self._change
