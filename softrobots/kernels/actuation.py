"""From actuator and elastic coordinates to what generated code works on, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.checks import FloatArray
from softrobots.kernels.unknowns import Unknowns
from softrobots.model import SoftModel


class Actuation:
    """Motors go in as they are. Muscle tensions become constant loads on the strains, muscle lengths a start that has them."""

    def __init__(self, model: SoftModel, unknowns: Unknowns) -> None:
        """Prepare the maps, all linear."""
        self._model, self._chain, self._strains = model, unknowns.chain, list(unknowns.strains)
        chain = unknowns.chain
        self._count = chain.n_motors
        self._plain = len(chain.held) == 0 and len(self._strains) == len(chain.stiffness)
        self._tensions = len(chain.muscle_rest) > 0 and chain.muscle_input == "forces"
        self._lengths = len(chain.muscle_rest) > 0 and not self._tensions
        self._relaxed = chain.free @ model.rest  # strains of relaxed elastic coordinates, muscles at rest

    def put(self, run: Any, w: Any, motors: FloatArray) -> None:
        """Write one case into a workspace, with its start."""
        layout = run.layout
        w[: self._count] = motors[: self._count]
        if self._tensions:
            w[layout.pull : layout.pull + layout.unknowns] = self._pulls(motors[None])[0]
        if self._lengths:
            w[layout.start : layout.start + layout.unknowns] = self._starts(motors[None])[0]

    def rows(self, motors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Motor joints, loads of tensions and starts of many cases; without muscles the latter have no rows."""
        nothing = np.zeros((0, len(self._strains)))
        pulls = self._pulls(motors) if self._tensions else nothing
        starts = self._starts(motors) if self._lengths else nothing
        return np.ascontiguousarray(motors[:, : self._count]), pulls, starts

    def unsuited(self, motors: FloatArray) -> Any:
        """Which rows no shape of the robot has, truth values."""
        if not self._lengths:
            return np.zeros(len(motors), dtype=bool)
        return np.array([not (np.all(np.isfinite(row)) and self._model.actuators.admit(row)) for row in motors])

    def unknowns(self, motors: FloatArray, elastic: FloatArray) -> FloatArray:
        """Unknown strains of one case from its elastic coordinates, shape (n,)."""
        return np.asarray(self._model.structure.strains(motors, elastic)[self._strains])

    def of_elastic(self, elastic: FloatArray) -> FloatArray:
        """Unknown strains of robots without muscles, shape (n, n_unknowns)."""
        return elastic if self._plain else np.asarray(elastic[:, self._strains])

    def elastic(self, unknowns: FloatArray) -> FloatArray:
        """Elastic coordinates from the unknowns, shape (..., n_springs); locked strains are at rest."""
        if self._plain:
            return unknowns
        strains = np.tile(self._chain.rest, (*unknowns.shape[:-1], 1))
        strains[..., self._strains] = unknowns
        return np.asarray(strains @ self._chain.elastic.T)

    def _pulls(self, motors: FloatArray) -> FloatArray:
        return np.ascontiguousarray(-(motors[:, self._count :] @ self._chain.muscle_matrix)[:, self._strains])

    def _starts(self, motors: FloatArray) -> FloatArray:
        change = motors[:, self._count :] - self._chain.muscle_rest
        return np.ascontiguousarray((self._relaxed + change @ self._chain.spread.T)[:, self._strains])
