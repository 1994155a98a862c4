"""Vibrations about the equilibria of measured rows, and their derivatives by parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError, SoftRobotsError
from softrobots.dynamics.vibration import VibrationModes, vibration_modes
from softrobots.identification.derivatives.frequency_derivatives import mode_matrices, mode_slopes, moved
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.measurements import Measurements
from softrobots.identification.model_change import differences
from softrobots.identification.parameters import OF_MODEL, ParameterSet
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticProblem
from softrobots.statics.equilibrium import equilibrium_from_state
from softrobots.statics.loads import Load

VIBRATION = ("frequencies", "damping_ratios")
"""Measured quantities of vibrations: attributes of `VibrationModes`."""


class RowVibration:
    """Modes about some of the rows, at one set of values."""

    def __init__(self, model: SoftModel, states: States, loads: Sequence[Load], measurements: Measurements) -> None:
        """Find the modes of the rows in which frequencies or damping ratios were measured.

        Raises:
            ParameterError: If a row, which is named, has none: its equilibrium is unstable, or its load has a moment.
        """
        self.modes, self._model, self._count = {}, model, len(loads)
        measured = [measurements.measured[name] for name in VIBRATION if name in measurements.measured]
        for row in np.flatnonzero(np.any([np.isfinite(one).any(axis=1) for one in measured], axis=0)).tolist():
            motors, load = states.q_motors[row], loads[row]
            state = ElasticProblem(model, motors, load).state(states.q_springs[row])
            found = equilibrium_from_state(model, motors, load, state, method="newton", iterations=0)
            try:
                self.modes[row] = vibration_modes(model, found)
            except SoftRobotsError as error:
                requirement = f"a stable equilibrium that vibrates; {error}"
                raise ParameterError(f"measurements ({measurements.where(row)})", states.q_motors[row], requirement) from error

    def values(self, name: str, count: int) -> FloatArray:
        """Return the slowest frequencies or their damping ratios, shape (n, count), NaN in rows without modes."""
        found = np.full((self._count, count), np.nan)
        for row, modes in self.modes.items():
            found[row] = getattr(modes, name)[:count]
        return found

    def slopes(
        self,
        parameters: ParameterSet,
        values: FloatArray,
        strains: FloatArray,
        strain_slopes: FloatArray,
        actuator_slopes: FloatArray,
        turning: FloatArray,
    ) -> dict[str, FloatArray]:
        """Return their derivatives by P parameters, by name, shape (n, n_springs, P).

        Args:
            parameters: The parameters.
            values: Their values, shape (P,).
            strains: Strains of the rows, shape (n, n_strains).
            strain_slopes: Their derivatives, shape (n, n_strains, P).
            actuator_slopes: Derivatives of the actuators, shape (n_motors, P).
            turning: Turn of the base in its own axes by its rotation vector, shape (3, 3).
        """
        found = {name: np.zeros((self._count, self._model.n_springs, len(values))) for name in VIBRATION}
        base = {row: mode_matrices(modes, modes.equilibrium) for row, modes in self.modes.items()}
        for place, one in enumerate(parameters.parameters):
            turns = one.place.kind == "base" and one.place.names[0] == "rotation"
            if not turns and one.place.kind not in (*OF_MODEL, "offset"):
                continue
            spin = turning[:, one.place.parts[0]] if turns else np.zeros(3)
            model_at = cache(partial(_model_with, parameters, values, place)) if parameters.of_model[place] else self._same
            for row, modes in self.modes.items():
                tangent = strain_slopes[row, :, place], actuator_slopes[:, place], spin
                near = partial(_matrices_near, modes, model_at, float(values[place]), strains[row], tangent)
                change = differences(one, float(values[place]), base[row], near, fourth_order=True)
                for name, slope in mode_slopes(modes, change).items():
                    found[name][row, :, place] = slope
        return found

    def _same(self, value: float) -> SoftModel:
        return self._model


def _model_with(parameters: ParameterSet, values: FloatArray, place: int, value: float) -> SoftModel:
    """The robot with another value of one parameter."""
    return parameters.model(np.where(np.arange(len(values)) == place, value, values))


def _matrices_near(
    modes: VibrationModes,
    model_at: Callable[[float], SoftModel],
    start: float,
    strains: FloatArray,
    tangent: tuple[FloatArray, FloatArray, FloatArray],
    value: float,
) -> dict[str, FloatArray]:
    """`mode_matrices` at another value of a parameter, along the tangent of strains, actuators and turn of the base."""
    at, shift, (by_strains, by_motors, spin) = modes.equilibrium, value - start, tangent
    load = at.load.turned(pin.exp3(-shift * spin)) if np.any(spin) else at.load
    return mode_matrices(modes, moved(at, model_at(value), load, at.q_motors + shift * by_motors, strains + shift * by_strains))
