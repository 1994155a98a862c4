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

    def __init__(self, at: EquilibriumPoints, measured: FloatArray, *, parameters: bool) -> None:
        """Differentiate the condition.

        Args:
            at: The robot under the forces that were found.
            measured: Measured loads on the actuators, shape (N, n_motors).
            parameters: Whether derivatives by the parameters are needed.
        """
        feels = at.robot.model.actuators.feels
        loads, by_force = at.feel()
        self._at, self._parameters, self._curved = at, parameters, None
        self._combined = np.tile(np.eye(len(feels))[feels], (len(loads), 1, 1))
        self._slope = by_force[:, feels]
        if feels.sum() > 3:
            self._combined = np.where(feels, np.swapaxes(by_force, 1, 2), 0.0)
            self._slope = self._combined @ by_force
            left = np.where(feels, measured - loads, 0.0)
            if np.any(np.linalg.norm(left, axis=1) > TOLERANCE * np.linalg.norm(measured, axis=1)):
                self._curved = self._differences(left)
                self._slope = self._slope - self._curved.by_force

    def _differences(self, left: FloatArray) -> Slopes:
        """Derivatives along each direction of the force of those of loads with given weights, shape (N, n_motors)."""
        at, found = self._at, []
        nothing = np.zeros((1, left.shape[1])), np.zeros((1, len(at.robot.values)))
        for direction in np.eye(3):
            moved = at.rates(nothing[0], direction[None], nothing[1])[0]
            size = _STEP / np.maximum(np.abs(moved).max(axis=1, initial=0.0), 1e-300)[:, None]
            ends = (
                at.near(at.force + step * direction, at.springs + step * moved).loads(
                    left[:, None], parameters=self._parameters
                )
                for step in (size, -size)
            )
            found.append([(ahead - behind) / (2.0 * size[:, None]) for ahead, behind in zip(*ends, strict=True)])
        return Slopes(*(np.concatenate(parts, axis=1) for parts in zip(*found, strict=True)))

    def push(self, motors: FloatArray, loads: FloatArray, parameters: FloatArray) -> FloatArray:
        """Return the rates of the force, shape (N, 3), from those of actuators, measured loads, parameters, (N or 1, k)."""
        known = self._at.loads(self._combined, parameters=self._parameters)
        if self._curved is not None:
            known = Slopes(*(one - other for one, other in zip(known, self._curved, strict=True)))
        missing = self._combined @ loads[..., None] - known.by_motors @ motors[..., None]
        if self._parameters:
            missing = missing - known.by_parameters @ parameters[..., None]
        return np.asarray(np.linalg.solve(self._slope, missing)[..., 0])

    def pull(self, force: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the weights of actuators, measured loads and parameters, (N, ...), from those of the force, shape (N, 3)."""
        weights = np.swapaxes(np.linalg.solve(np.swapaxes(self._slope, 1, 2), force[..., None]), 1, 2)
        explained = weights @ self._combined
        found = self._at.loads(explained, parameters=self._parameters)
        if self._curved is not None:
            found = Slopes(*(one - weights @ other for one, other in zip(found, self._curved, strict=True)))
        return -found.by_motors[:, 0], explained[:, 0], -found.by_parameters[:, 0]
