r"""What a robot with given parameters would have been measured as, row by row, and the derivatives of that.

The base stands at `t`, turned by `R`, in the frame of the measurements: what is at `x` of the robot is seen at `R x + t`, and
a load or gravity `f` told there is `R^T f` to the robot. A marker at `o` in its frame is at `x + R_f o`. Actuators are at what
was commanded plus an offset. Each search for an equilibrium starts from that of the values before.

A robot with dry friction remembers: each row comes from the row before, the first from rest, and derivatives go through all
that it remembers. They are in closed form, too (`derivatives.friction_derivatives`), but with friction of guides
or given lengths, where they are differences of the whole course.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.core.vectors import cross
from softrobots.identification.derivatives.friction_derivatives import friction_loads, slopes_of_course
from softrobots.identification.derivatives.row_vibration import VIBRATION, RowVibration
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.measured_robot import frame_of, load_cases, loads_on
from softrobots.identification.measurement_checks import difference
from softrobots.identification.measurements import Measurements
from softrobots.identification.model_change import ModelChange, model_change
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.identification.row_equilibria import balanced_course, balanced_rows, searched_rows
from softrobots.model.numbers import LAW
from softrobots.model.soft_model import SoftModel

_TOLERANCE = 1e-12  # of residuals, relative to the load: derivatives are taken there
_KEPT = 4, 24, 200_000  # least and most values whose equilibria are kept (from other starts there may be none), and rows of all


class Seen(NamedTuple):
    """What is predicted of a measured quantity."""

    values: FloatArray
    """As measured, rows first."""
    difference: FloatArray
    """Measured minus predicted, shape (n, k); of poses position, then rotation vector; NaN where missing."""
    slopes: Callable[[], FloatArray]
    """Returns the derivative of the difference by the parameters, shape (n, k, P)."""


class Prediction:
    """All rows at one set of values."""

    def __init__(
        self, predictor: Predictor, values: FloatArray, model: SoftModel, states: States, sliders: FloatArray | None
    ) -> None:
        """Take the equilibria of the rows, and the sliders of dry friction before each."""
        self._sliders = sliders
        self.predictor, self.values, self.model = predictor, values, model
        self.at = EquilibriumDerivatives(model, states)
        """The equilibria, for derivatives."""
        self._position, turn = predictor.parameters.base(values)
        self._rotation, self._turning = np.asarray(pin.exp3(turn)), np.asarray(pin.Jexp3(turn))
        measured = predictor.measurements.measured
        self.seen = {key: QUANTITIES[key.partition(".")[0]](self, key, values) for key, values in measured.items()}
        """What is predicted, by the name of the quantity."""

    def differences(self) -> dict[str, FloatArray]:
        """Measured minus predicted by quantity, shape (n, k); NaN where missing."""
        return {key: one.difference for key, one in self.seen.items()}

    def slopes(self) -> dict[str, FloatArray]:
        """Derivatives of the differences by the parameters, shape (n, k, P)."""
        if self.predictor.by_differences:
            parameters = self.predictor.parameters
            return slopes_of_course(lambda values: self.predictor.course(values).differences(), parameters, self.values)
        return {key: one.slopes() for key, one in self.seen.items()}

    def frame(self, name: str) -> tuple[FloatArray, FloatArray]:
        """Position, shape (n, 3) [m], and rotation, (n, 3, 3), of a frame or marker, in the frame of the measurements."""
        rotation = self._turned(name)
        position = self.at.tree.frame(self._frame(name))[2] + rotation @ self._offset(name)
        return position @ self._rotation.T + self._position, self._rotation @ rotation

    def frame_slopes(self, name: str, *, turned: bool = True) -> FloatArray:
        """Derivatives of that, shape (n, 6, P), measured axes, position, then rotation; (n, 3, P) if not `turned`."""
        parameters, marked = self.predictor.parameters, self.predictor.parameters.places("marker")
        count = 6 if turned or np.any(self._offset(name)) else 3
        pose = np.tile(np.eye(6)[:count], (len(self.predictor.measurements), 1, 1))
        slopes = self.along(AdjointRows(self.at, Outputs(pose=pose, frame=self._frame(name))))
        rotation, offset = self._turned(name), self._offset(name)
        if count > 3:
            slopes[:, :3] += cross(np.swapaxes(slopes[:, 3:], 1, 2), (rotation @ offset)[:, None]).swapaxes(1, 2)
        for number, one in marked:
            if one.place.names[0] == name:
                slopes[:, :3, number] += rotation[..., one.place.parts[0]]
        slopes = np.concatenate([self._rotation @ slopes[:, i : i + 3] for i in range(0, count, 3)], axis=1)
        seen, turning = self.frame(name)[0] - self._position, self._rotation @ self._turning
        if "base" in parameters.direct_slopes:
            moved, spin = np.split(parameters.direct_slopes["base"], 2)
            spin = turning @ spin
            slopes[:, :3] += moved + cross(spin.T, seen[:, None]).swapaxes(1, 2)
            slopes[:, 3:] += spin[: count - 3]
        return slopes if turned else slopes[:, :3]

    def along(self, rows: AdjointRows) -> FloatArray:
        """Derivatives of outputs of the robot, in its own axes, by all parameters, shape (n, L, P)."""
        direct = self._without_memory(rows)
        return direct if self._sliders is None else direct + rows.virtual @ self._friction

    @cached_property
    def _friction(self) -> FloatArray:
        """Change by the parameters of the load of friction on the strains at fixed strains, shape (n, n_strains, P)."""
        return friction_loads(self.at, self._sliders, self.predictor.change, self._without_memory)  # type: ignore[arg-type]

    def _without_memory(self, rows: AdjointRows) -> FloatArray:
        """The same where the sliders of friction stay, and its moments."""
        predictor = self.predictor
        slopes = rows.by_numbers(predictor.change) + rows.by_actuators @ predictor.actuator_slopes
        turned = predictor.parameters.places("base")
        for name, by_load in rows.by_loads().items():
            load = self.at.states.loads[name].reshape(len(slopes), -1, 3)
            for number, one in turned:
                if one.place.names[0] == "rotation":
                    change = np.cross(load, self._turning[:, one.place.parts[0]]).reshape(len(slopes), -1, 1)
                    slopes[..., number] += (by_load @ change)[..., 0]
        return slopes

    @cached_property
    def vibration(self) -> RowVibration:
        """Modes about the rows in which something of them was measured."""
        states = self.at.states
        return RowVibration(self.model, states, load_cases(states.loads, len(states.q_motors)), self.predictor.measurements)

    @cached_property
    def vibration_slopes(self) -> dict[str, FloatArray]:
        """Derivatives of those by the parameters, by quantity, shape (n, n_springs, P)."""
        predictor, count = self.predictor, self.at.strains.shape
        slopes = self.along(AdjointRows(self.at, Outputs(strains=np.tile(np.eye(count[1]), (count[0], 1, 1)))))
        known = predictor.parameters, self.values, self.at.strains, slopes
        return self.vibration.slopes(*known, predictor.actuator_slopes, self._turning)

    def _frame(self, name: str) -> str:
        return frame_of(self.model, name, self.predictor.measurements.markers)

    def _offset(self, name: str) -> FloatArray:
        return self.predictor.parameters.marker_offset(self.values, name)

    def _turned(self, name: str) -> FloatArray:
        """Rotation of a frame in the robot, shape (n, 3, 3)."""
        tree, number = self.at.tree, self.model.frame_id(self._frame(name))
        body, own = tree.frame(self._frame(name))[0], self.at.numbers["frames"][number, :, :3]
        return np.asarray(tree.rotation[:, body] @ own)


class Predictor:
    """Predictions of measured rows for values of parameters."""

    def __init__(self, parameters: ParameterSet, measurements: Measurements, *, gaps: bool = False, near: Any = None) -> None:
        """Check the measurements; `gaps`: whether rows may lack an equilibrium; `near`: strains to search from, if known.

        Raises:
            ParameterError: If they are not, see `Measurements.check`.
            NameNotFound: If the robot has no such frame.
        """
        measurements.check(parameters.present)
        self.parameters, self.measurements = parameters, measurements
        self.in_order = parameters.present.structure.friction is not None
        """Whether the robot has dry friction, so that each row comes from the row before."""
        structure = parameters.present.structure
        self.by_differences = self.in_order and (structure.guided or structure.muscle_lengths is not None)
        """Whether derivatives are differences of the whole course."""
        self.change = ModelChange(len(parameters.names), {})
        """Derivatives of the model's numbers, as `refresh` left them."""
        self.actuator_slopes = parameters.offset_slopes
        """Derivatives of the actuators by the parameters, shape (n_motors, P)."""
        self._springs: FloatArray | None = near
        self._sliders: FloatArray | None = None
        self.gaps, self.lost = gaps, list[int]()
        self._last: Prediction | None = None
        self._solved: dict[bytes, tuple[States, FloatArray | None]] = {}

    def refresh(self, values: FloatArray) -> None:
        """Differentiate the model's numbers at given values.

        Raises:
            ParameterError: If the structure of the robot changes with a parameter there.
        """
        if self.by_differences:
            return
        self.change = model_change(self.parameters, values)
        self.actuator_slopes = self.parameters.offset_slopes
        if self.measurements.relative and "laws" in self.change.by_number:
            laws = self.change.by_number["laws"].reshape(-1, len(LAW), len(values))
            self.actuator_slopes = self.actuator_slopes + laws[:, LAW.index("rest_length")]

    def at(self, values: FloatArray) -> Prediction:
        """Return the rows at given values, shape (P,).

        Raises:
            SoftRobotsError: If the robot refuses the values.
            ParameterError: If rows have no equilibrium; names them.
        """
        if self._last is None or not np.array_equal(self._last.values, values):
            model, key = self.parameters.model(values), values.tobytes()
            found = self._solved.pop(key, None) or self._solve(model, values)
            if len(self._solved) >= max(_KEPT[0], min(_KEPT[1], _KEPT[2] // len(self.measurements))):
                del self._solved[next(iter(self._solved))]
            self._solved[key], self._springs, self._sliders = found, found[0].q_springs, found[1]
            self._last = Prediction(self, np.array(values), model, *found)
        return self._last

    def course(self, values: FloatArray) -> Prediction:
        """Return the same, solved anew."""
        model = self.parameters.model(values)
        return Prediction(self, np.array(values), model, *self._solve(model, values))

    def _solve(self, model: SoftModel, values: FloatArray) -> tuple[States, FloatArray | None]:
        measurements, (_, turn) = self.measurements, self.parameters.base(values)
        motors = measurements.motor_coordinates(model) + self.parameters.motor_offsets(values)
        loads = loads_on(model, measurements.loads, np.asarray(pin.exp3(turn)))
        starts = np.tile(model.rest, (len(motors), 1)) if self._springs is None else self._springs
        states, sliders = States.at(model, motors, starts.copy(), loads), None
        if self.in_order:
            sliders, self.lost = balanced_course(model, states, self._sliders, _TOLERANCE)
        else:
            rest = np.flatnonzero(~balanced_rows(model, states, _TOLERANCE)).tolist()
            self.lost = searched_rows(model, states, rest, starts, _TOLERANCE)
        if self.lost and not self.gaps:
            words = ", ".join(map(measurements.where, self.lost[:10])) + (", ..." if len(self.lost) > 10 else "")
            requirement = f"rows with an equilibrium at the starting values (not {words}): start elsewhere, or leave these out"
            requirement += f"{'' if self.in_order else ' by the mask'}; are order, sign and unit of actuators and loads right?"
            raise ParameterError("measurements", measurements, requirement)
        states.q_springs[self.lost] = model.rest
        self._springs, self._sliders = states.q_springs, sliders
        return states, sliders


def _position(prediction: Prediction, key: str, measured: FloatArray) -> Seen:
    name = key.partition(".")[2]
    values = prediction.frame(name)[0]
    return Seen(values, difference(measured, values), lambda: -prediction.frame_slopes(name, turned=False))


def _pose(prediction: Prediction, key: str, measured: FloatArray) -> Seen:
    name = key.partition(".")[2]
    values = np.tile(np.eye(4), (len(measured), 1, 1))
    values[:, :3, 3], values[:, :3, :3] = prediction.frame(name)
    found = difference(measured, values)

    def slopes() -> FloatArray:
        moved = -prediction.frame_slopes(name)
        inverse = [pin.Jlog3(pin.exp3(angle)) if np.isfinite(angle).all() else np.eye(3) for angle in found[:, 3:]]
        return np.concatenate([moved[:, :3], np.array(inverse) @ moved[:, 3:]], axis=1)

    return Seen(values, found, slopes)


def _load(prediction: Prediction, key: str, measured: FloatArray) -> Seen:
    """Loads on the actuators, of which the last are tensions."""
    at, count = prediction.at, measured.shape[1]
    values = at.states.actuator_loads[:, -count:]
    weights = np.tile(np.eye(at.states.actuator_loads.shape[1])[-count:], (len(values), 1, 1))
    return Seen(values, difference(measured, values), lambda: -prediction.along(AdjointRows(at, Outputs(loads=weights))))


def _vibration(prediction: Prediction, key: str, measured: FloatArray) -> Seen:
    values = prediction.vibration.values(key, measured.shape[1])
    return Seen(values, difference(measured, values), lambda: -prediction.vibration_slopes[key][:, : measured.shape[1]])


QUANTITIES: dict[str, Callable[[Prediction, str, FloatArray], Seen]] = {
    "positions": _position,
    "poses": _pose,
    "motor_torques": _load,
    "tensions": _load,
    **dict.fromkeys(VIBRATION, _vibration),
}
"""What can be measured: by the first word of its name, what is predicted of it."""
