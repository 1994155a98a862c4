"""States of a robot, and rows of outputs that are differentiated there, as arrays with a row for each state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium


class States(NamedTuple):
    """Equilibria of one robot, arrays with a row each."""

    q_motors: FloatArray
    """Actuators, shape (N, n_motors)."""
    q_springs: FloatArray
    """Elastic coordinates, shape (N, n_springs)."""
    loads: Mapping[str, FloatArray]
    """Wrench by frame, shape (N, 6), and gravity, by the name "", shape (N, 3), world axes."""
    actuator_loads: FloatArray
    """Load on each actuator, shape (N, n_motors)."""
    tangent: FloatArray
    """Tangent stiffness, shape (N, n_springs, n_springs)."""
    coupling: FloatArray
    """Derivative of the load on the elastic coordinates by the actuators, shape (N, n_springs, n_motors)."""
    strains: FloatArray | None = None
    """Strains, shape (N, n_strains), where they are known; tangent and coupling are not used where rows are."""

    @classmethod
    def at(cls, model: SoftModel, motors: FloatArray, springs: FloatArray, loads: Mapping[str, FloatArray]) -> States:
        """States of a robot of which no more than the coordinates and the loads are known; the rest is zero."""
        (n, count), n_motors = springs.shape, model.n_motors
        rest = (np.zeros((n, *shape)) for shape in ((n_motors,), (count, count), (count, n_motors)))
        return cls(motors, springs, loads, *rest)

    def rows(self, some: Any) -> States:
        """Return some of the states, by indices or truth values."""
        parts = {name: one[some] for name, one in self._asdict().items() if name != "loads" and one is not None}
        return self._replace(loads={name: load[some] for name, load in self.loads.items()}, **parts)

    @classmethod
    def of(cls, equilibria: Sequence[Equilibrium]) -> States:
        """Stack equilibria of one robot."""
        names = dict.fromkeys(name for one in equilibria for name in one.load.wrenches)
        nothing: FloatArray = np.zeros(6)
        loads = {name: np.array([one.load.wrenches.get(name, nothing) for one in equilibria]) for name in names}
        if any(one.load.gravity is not None for one in equilibria):
            loads[""] = np.array([one.load.gravity or (0.0, 0.0, 0.0) for one in equilibria])
        fields = ("q_motors", "q_springs", "motor_torques", "tangent_stiffness", "coupling")
        each = [[getattr(one, name) for one in equilibria] for name in fields]
        motors, springs, torques, tangent, coupling = (one[0][None] if len(one) == 1 else np.array(one) for one in each)
        return cls(motors, springs, loads, torques, tangent, coupling)


class Outputs(NamedTuple):
    """Rows of outputs of each state; None where they do not depend on it."""

    frame: str = ""
    """Frame of which they are components of the pose."""
    pose: FloatArray | None = None
    """Weights of its position and rotation (world axes), shape (N, L, 6)."""
    loads: FloatArray | None = None
    """Weights of the loads on the actuators, shape (N, L, n_motors)."""
    strains: FloatArray | None = None
    """Weights of the strains, shape (N, L, n_strains): of the elastic coordinates, unless lengths of actuators are given."""
    forces: FloatArray | None = None
    """Weights of the normal forces of an equilibrium in contact, shape (1, L, k)."""
