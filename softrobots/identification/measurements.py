"""What was measured of a robot, a row for each time that it was at rest: actuators, loads and what instruments told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray, finite_array, instance_of, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Part, Summarised, facts, field_facts
from softrobots.identification.measured_robot import check_coordinates, frame_of, wrenches_on
from softrobots.identification.measurement_checks import (
    TIP,
    by_name,
    check_modes,
    check_rows,
    columns_of,
    deviations_of,
    each_row_of,
    labelled,
    with_gaps,
    words_of,
)
from softrobots.identification.measurement_table import MeasurementTables
from softrobots.model.soft_model import SoftModel, check_model


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Measurements(MeasurementTables, Summarised):
    """Measured rows of a robot at rest, in the order in which they were recorded; can be saved with `softrobots.save_result`.

    Arrays have a row for each measurement and are read-only. `measurements[rows]` selects rows, `+` joins two of the same form.
    Positions, poses, loads and gravity are told in the frame of measurement, which need not be that of the base.
    """

    q_motors: FloatArray
    """Commanded actuator coordinates, or pulls, shape (n, m) [rad, m, N or Pa]."""
    loads: Mapping[str, FloatArray]
    """What acted, by name: "force" (n, 3) [N], "wrench.FRAME" (n, 6) [N, N m], "mass" (n,) [kg], "gravity" (n, 3) [m/s^2]."""
    measured: Mapping[str, FloatArray]
    """What was measured, by name, NaN where missing: "positions.NAME" (n, 3) [m], "poses.NAME" (n, 4, 4), "motor_torques"
    (n, m) [N m or N], "tensions" (n, muscles) [N], "frequencies" (n, k) [Hz], "damping_ratios" (n, k)."""
    std: Mapping[str, FloatArray]
    """Standard deviations of those of which they are known, shape (n, k); of a pose (n, 6) [m, rad]."""
    labels: tuple[str, ...] | None
    """Label of each row; rows of one label are a block."""
    mask: NDArray[np.bool_]
    """Rows that count, shape (n,)."""
    markers: Mapping[str, str]
    """Frame on which each marker sits."""
    relative: bool
    """Whether `q_motors` holds pulls: the true coordinate is the relaxed length minus the pull."""
    lines: NDArray[np.int64] | None
    """Line of each row in the file it was read from, shape (n,)."""
    actuators: tuple[str, ...] | None
    """Name of each column of `q_motors` and motor torques; None: those of the robot, in its order."""

    def __init__(
        self,
        q_motors: Any,
        *,
        force: Any = None,
        wrench: Any = None,
        mass: Any = None,
        gravity: Any = None,
        tip_position: Any = None,
        positions: Mapping[str, Any] | None = None,
        poses: Mapping[str, Any] | None = None,
        motor_torques: Any = None,
        tensions: Any = None,
        frequencies: Any = None,
        damping_ratios: Any = None,
        std: Any = None,
        labels: Any = None,
        mask: Any = None,
        markers: Mapping[str, str] | None = None,
        relative: bool = False,
        lines: Any = None,
        actuators: Any = None,
    ) -> None:
        """Check what was measured.

        Args:
            q_motors: Commanded actuator coordinates, shape (n, m), or columns by name of actuator, in any order, or a list of
                mappings, one a row [rad, m, N or Pa].
            force: Force on the tip, shape (n, 3) [N].
            wrench: Wrench on the tip, shape (n, 6), or by frame [N, N m].
            mass: Mass hung at the tip, shape (n,) [kg]; needs `gravity`.
            gravity: Gravity, shape (3,) or (n, 3) [m/s^2]; None: weightless.
            tip_position: Position of the tip, shape (n, 3) [m]; short for `positions={"tip": ...}`.
            positions: Positions by frame or marker, each shape (n, 3) [m].
            poses: Poses by frame or marker, each shape (n, 4, 4) [m]; the rotation may be missing as a whole.
            motor_torques: Load on each actuator, with the sign of `Equilibrium.motor_torques`, shape (n, m), or by name as
                `q_motors` [N m or N].
            tensions: Tension of each muscle, shape (n, muscles) [N].
            frequencies: Lowest natural frequencies, slowest first, shape (n, k) [Hz]; e.g. of `ring_down`.
            damping_ratios: Damping ratios of the slowest modes, shape (n, k).
            std: Standard deviations by name ("tip_position", "positions.NAME", "motor_torques", ...), or of the only quantity:
                one number, one for each component, or arrays of rows; of a pose two, position [m] and angle [rad], or six.
            labels: A word for each row.
            mask: Whether each row counts, shape (n,); all by default.
            markers: The frame on which each marker sits.
            relative: Whether `q_motors` holds pulls of actuators with a length, positive inwards [m].
            lines: Line of each row in a file, for errors, shape (n,).
            actuators: Names of the columns of `q_motors`, if that is an array in another order than the robot's.

        Raises:
            ParameterError: If an argument has another form, a number is not finite (unless it was measured: NaN is missing), a
                standard deviation or a frequency is not positive, or nothing was measured.
        """
        q_motors, names = columns_of("q_motors", q_motors, actuators)
        motor_torques, _ = columns_of("motor_torques", motor_torques, names or ())
        motors = finite_array("q_motors", q_motors, (None, None), "rad, m, N or Pa")
        self._set("actuators", None if names is None else words_of("actuators", names, motors.shape[1], str))
        n = len(motors)
        if not n:
            raise ParameterError("q_motors", q_motors, "at least one row")
        places = by_name("positions", positions)
        if tip_position is not None:
            if TIP in places:
                raise ParameterError("tip_position", tip_position, "left out where positions has a 'tip'")
            places[TIP] = tip_position
        wrenches = by_name("wrench", wrench if isinstance(wrench, Mapping) or wrench is None else {TIP: wrench})
        if np.shape(gravity) == (3,):
            gravity = np.tile(finite_array("gravity", gravity, (3,), "m/s^2"), (n, 1))
        if mass is not None and gravity is None:
            raise ParameterError("mass", mass, "given together with gravity")
        loads = {
            "force": (force, (n, 3), "N"),
            **{f"wrench.{name}": (one, (n, 6), "N, N m") for name, one in wrenches.items()},
            "mass": (mass, (n,), "kg"),
            "gravity": (gravity, (n, 3), "m/s^2"),
        }
        measured = {
            **{f"positions.{name}": (one, (n, 3), "m") for name, one in places.items()},
            **{f"poses.{name}": (one, (n, 4, 4), "m") for name, one in by_name("poses", poses).items()},
            "motor_torques": (motor_torques, motors.shape, "N m or N"),
            "tensions": (tensions, (n, None), "N"),
            "frequencies": (frequencies, (n, None), "Hz"),
            "damping_ratios": (damping_ratios, (n, None), "-"),
        }
        self._set("lines", None if lines is None else finite_array("lines", lines, (n,)).astype(np.int64))
        self._set("q_motors", motors)
        self._set("loads", {key: finite_array(key, *one) for key, one in loads.items() if one[0] is not None})
        self._set("measured", {key: with_gaps(key, *one) for key, one in measured.items() if one[0] is not None})
        check_rows(self.loads, self.measured, self.where)
        self._set("std", deviations_of(self.measured, std, self.where))
        self._set("labels", None if labels is None else words_of("labels", labels, n, self.where))
        counted = np.ones(n, dtype=bool) if mask is None else np.array(mask)
        if counted.shape != (n,) or counted.dtype != bool:
            raise ParameterError("mask", mask, f"an array of shape ({n},) of truth values")
        self._set("mask", counted)
        self._set("markers", by_name("markers", markers))
        words_of("markers", [*self.markers.values()], len(self.markers), str)
        self._set("relative", instance_of("relative", relative, bool, "True or False"))

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.q_motors)

    def __repr__(self) -> str:
        """Rows, actuators and what was measured in one line."""
        return f"Measurements({len(self)} rows of {self.q_motors.shape[1]} actuators: {', '.join(self.measured)})"

    def summary_parts(self) -> list[Part]:
        """What there is; the order of actuators only where it is not that of the robot."""
        return [facts([row for row in field_facts(self) if row != ("actuators", "none")])]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as the arguments that make the same again."""
        return partial(Measurements, **self.arguments()), ()

    def __getitem__(self, rows: Any) -> Measurements:
        """Return the rows of a mask, a slice, or indices; raise ParameterError if there are none such."""
        try:
            chosen = np.arange(len(self))[rows]
        except (IndexError, TypeError, ValueError) as error:
            raise ParameterError("rows", rows, f"a mask, a slice or indices of {len(self)} rows") from error
        if chosen.ndim != 1 or not chosen.size:
            raise ParameterError("rows", rows, "a mask, a slice or indices that select at least one row")
        return Measurements(**each_row_of(lambda array: np.asarray(array)[chosen], self.arguments()))

    def __add__(self, other: Measurements) -> Measurements:
        """Return the rows of both; raise ParameterError unless they have the same actuators, loads, quantities and markers."""
        if not isinstance(other, Measurements):
            return NotImplemented
        mine, others = self.arguments(), other.arguments()
        if mine["lines"] is None or others["lines"] is None:
            mine["lines"] = others["lines"] = None
        forms = [each_row_of(lambda array: np.shape(array)[1:], one) for one in (mine, others)]
        if forms[0] != forms[1]:
            raise ParameterError(
                "other", other, f"of the form of {self!r}: the same actuators, loads, quantities, std and markers"
            )
        return Measurements(**each_row_of(lambda *arrays: np.concatenate(arrays), mine, others))

    def of_labels(self, *patterns: str) -> Measurements:
        """Return the rows of some labels, which may be patterns such as `rep1_*`; raise NameNotFound if one has no row."""
        return self[labelled(self.labels or (), patterns)]

    def where(self, row: int) -> str:
        """Return what a row is called: its line in the file, or its number from 0."""
        return f"row {row}" if self.lines is None else f"line {self.lines[row]}"

    def check(self, model: SoftModel) -> None:
        """Check that the measurements can be those of a robot.

        Raises:
            ParameterError: If it has other numbers of actuators, muscles or modes, dry friction where vibrations were measured,
                pulls are given of actuators without a length, or (naming the row) it cannot have such actuator coordinates.
            NameNotFound: If it has no such frame.
        """
        if self.actuators is not None:
            return self.in_order_of(model).check(model)
        actuators = check_model(model).actuators
        named = ", ".join(f"{name} [{unit}]" for name, unit in zip(actuators.names, actuators.units, strict=True))
        if self.q_motors.shape[1] != model.n_motors:
            raise ParameterError("q_motors", self.q_motors.shape, f"of {model.n_motors} columns: {named} (this is its shape)")
        if self.relative and (len(model.muscles) < model.n_motors or set(actuators.units) != {"m"}):
            raise ParameterError("relative", True, f"False, as not all of these are muscles with a length: {named}")
        tensions = self.measured.get("tensions")
        if tensions is not None and tensions.shape[1] != len(model.muscles):
            raise ParameterError(
                "tensions", tensions.shape, f"of {len(model.muscles)} columns, one a muscle (this is its shape)"
            )
        check_modes(self.measured, model)
        wrenches_on(model, self.loads)
        for name in (*self.markers, *(key.partition(".")[2] for key in self.measured if "." in key)):
            frame_of(model, name, self.markers)
        check_coordinates(model, self.motor_coordinates(model), self.where)

    def in_order_of(self, model: SoftModel) -> Measurements:
        """Return the same with actuators in the order of a robot, if they have names.

        Raises:
            ParameterError: If an actuator is missing.
            NameNotFound: If the robot has no actuator of a name.
        """
        if self.actuators is None:
            return self
        numbers = dict(zip(self.actuators, range(len(self.actuators)), strict=True))
        order, found = check_model(model).actuators.in_order(numbers, "q_motors"), self.arguments() | {"actuators": None}
        for values in (found, found["std"]):
            values.update({key: values[key][:, order] for key in ("q_motors", "motor_torques") if key in values})
        return Measurements(**found)

    def motor_coordinates(self, model: SoftModel) -> FloatArray:
        """Return actuator coordinates of a robot, shape (n, m): those commanded, or its relaxed lengths minus the pulls."""
        return np.asarray(model.relaxed_motors - self.q_motors) if self.relative else self.q_motors

    def _set(self, name: str, value: Any) -> None:
        """Set an attribute once, arrays read-only."""
        if isinstance(value, Mapping):
            value = MappingProxyType(
                {key: read_only(one) if isinstance(one, np.ndarray) else one for key, one in value.items()}
            )
        object.__setattr__(self, name, read_only(value) if isinstance(value, np.ndarray) else value)

    def arguments(self) -> dict[str, Any]:
        """Arguments that make the same again; what has rows is an array, a list, or a dictionary of arrays."""
        found: dict[str, Any] = {"q_motors": self.q_motors, "std": dict(self.std), "mask": self.mask, "lines": self.lines}
        found |= {"labels": None if self.labels is None else np.array(self.labels, dtype=object)}
        for key, values in (*self.loads.items(), *self.measured.items()):
            quantity, _, name = key.partition(".")
            found[quantity] = {**found.get(quantity, {}), name: values} if name else values
        return found | {"markers": dict(self.markers), "relative": self.relative, "actuators": self.actuators}
