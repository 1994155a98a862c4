r"""The force that explains measured loads on actuators, as an implicit function of these, of actuators and parameters.

Three felt loads `tau(f, x)` are equal to the measured ones. More are met in the sense of least squares, with what is left,
:math:`\rho = \tau_m - \tau`, at right angles to what a force changes, :math:`E = \partial\tau/\partial f`:

.. math:: C\,(\tau_m - \tau(f, x)) = 0, \quad C = 1 \ \text{or}\ E^T; \qquad
          (C E - D_f)\,\dot f = C\,\dot\tau_m - (C\,\tau_x - D_x)\,\dot x

with :math:`D = \partial_f (\rho^T \partial \tau)` at constant `rho`: the order of derivatives is exchanged, so that `D` are
differences along the force of derivatives of :math:`\rho^T\tau`. Where nothing is left, `D` is zero.
"""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.learning.equilibrium_points import EquilibriumPoints, Slopes
from softrobots.statics.elastic_state import TOLERANCE

_STEP = 1e-5  # largest change of an elastic coordinate in a step of a difference [rad or m]; its error is the square


class ForceCondition:
    """The condition at N load estimates."""

    def __init__(self, at: EquilibriumPoints, measured: FloatArray) -> None:
        """Take the robot under the forces that were found, and the measured loads on the actuators, shape (N, n_motors)."""
        feels = at.robot.model.actuators.feels
        loads, by_force = at.feel()
        self._at, self._left = at, np.where(feels, measured - loads, 0.0)
        self._combined, self._explained = np.tile(np.eye(len(feels))[feels], (len(loads), 1, 1)), True
        if feels.sum() > 3:
            self._combined = np.where(feels, np.swapaxes(by_force, 1, 2), 0.0)
            sizes = (np.linalg.norm(one, axis=1) for one in (self._left, TOLERANCE * measured))
            self._explained = bool(np.all(np.less_equal(*sizes)))
        self._slope = self._combined @ by_force

    def push(self, motors: FloatArray, loads: FloatArray, parameters: FloatArray) -> FloatArray:
        """Return the rates of the force, shape (N, 3), from those of actuators, measured loads, parameters, (N or 1, k)."""
        changes = bool(np.any(parameters))
        known, slope = self._at.loads(self._combined, parameters=changes), self._slope
        if not self._explained:
            each = [self._along(direction[None], parameters=changes) for direction in np.eye(3)]
            along = Slopes(*(np.concatenate(parts, axis=1) for parts in zip(*each, strict=True)))
            known, slope = Slopes(*(a - b for a, b in zip(known, along, strict=True))), slope - along.by_force
        missing = self._combined @ loads[..., None] - known.by_motors @ motors[..., None]
        if changes:
            missing = missing - known.by_parameters @ parameters[..., None]
        return np.asarray(np.linalg.solve(slope, missing)[..., 0])

    def pull(self, force: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the weights of actuators, measured loads and parameters, (N, ...), from those of the force, shape (N, 3)."""
        slope = self._slope
        if not self._explained:
            each = [self._along(direction[None], parameters=False).by_force for direction in np.eye(3)]
            slope = slope - np.concatenate(each, axis=1)
        weights = np.asarray(np.linalg.solve(np.swapaxes(slope, 1, 2), force[..., None]), dtype=np.float64)[..., 0]
        explained = (weights[:, None] @ self._combined)[:, 0]
        found = self._at.loads(explained[:, None])
        if not self._explained:
            found = Slopes(*(a - b for a, b in zip(found, self._along(weights), strict=True)))
        return -found.by_motors[:, 0], explained, -found.by_parameters[:, 0]

    def _along(self, direction: FloatArray, *, parameters: bool = True) -> Slopes:
        """Differentiate the derivatives of what is left, at constant weights, along a direction of the force, (N or 1, 3)."""
        at, left = self._at, self._left
        moved = at.rates(np.zeros((1, left.shape[1])), direction, np.zeros((1, len(at.robot.values))))[0]
        size = _STEP / np.maximum(np.abs(moved).max(axis=1, initial=0.0), 1e-300)[:, None]
        ahead, behind = (
            at.near(at.force + step * direction, at.springs + step * moved).loads(left[:, None], parameters=parameters)
            for step in (size, -size)
        )
        return Slopes(*((a - b) / (2.0 * size[:, None]) for a, b in zip(ahead, behind, strict=True)))
