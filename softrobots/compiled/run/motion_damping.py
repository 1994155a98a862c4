"""Damping of compiled motion: the numbers that generated code takes, and the matrix of the elastic coordinates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softrobots.compiled.motion.motion_layout import MotionLayout
from softrobots.core.checks import FloatArray
from softrobots.dynamics.damping import damping_matrix, strain_damping
from softrobots.model.soft_model import SoftModel


class MotionDamping:
    """Damping of a robot by a time of its material or by its file, and by Rayleigh's factor of the mass."""

    def __init__(self, model: SoftModel, strains: Sequence[int], moving: Sequence[int]) -> None:
        """Take the robot, its strains that are not locked, and the elastic coordinates that are unknowns."""
        self._model, self._strains, self._moving = model, list(strains), np.ix_(moving, moving)
        self._kept: dict[tuple[float | None, float], FloatArray] = {}

    def matrix(self, time: float | None, mass_rate: float) -> FloatArray:
        """Return the damping of all elastic coordinates, shape (n_springs, n_springs)."""
        if (time, mass_rate) not in self._kept:
            self._kept[time, mass_rate] = damping_matrix(self._model, time, mass_rate)
        return self._kept[time, mass_rate]

    def inputs(self, layout: MotionLayout, time: float | None, mass_rate: float) -> list[tuple[int, FloatArray]]:
        """Return places in the workspace and what stands there."""
        if layout.strains is None and layout.full_damping:
            return [(layout.damping, self.matrix(time, mass_rate)[self._moving].ravel())]
        inputs = [(layout.damping, strain_damping(self._model, time)[self._strains])]
        if layout.full_damping:
            mass = self.matrix(0.0, mass_rate)[self._moving]
            inputs += [(layout.mass_damping, mass.ravel()), (layout.mass_rate, np.array([mass_rate]))]
        return inputs
