"""Serialisation of motions, modes and linear models: named arrays for result files, and columns of CSV tables with their units.

A file of a motion holds the robot (URDF and springs), coordinates, velocities, loads and energies over time. Poses are computed
again. One of modes or of a linear model holds the equilibrium and the arguments; the rest is computed again and compared.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields as fields_of
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, increasing, non_negative_number, read_only
from softrobots.core.errors import FileFormatError
from softrobots.core.result_file import KINDS, Kind, named_columns, text, vector_columns
from softrobots.dynamics.linear_model import LinearModel, linearize
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.dynamics.vibration import VibrationModes, vibration_modes
from softrobots.model.actuators import load_units
from softrobots.model.friction_coordinates import packed_memories, with_memories
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load
from softrobots.statics.saved_results import pack_model, unpack_model
from softrobots.statics.tables.columns import joint_columns

_SAME = 1e-6  # relative difference of frequencies that rounding on another machine explains, of fast modes too
_NUMBERS = ("damping_time", "mass_damping", "tip_error", "tolerance")


def _columns(model: SoftModel) -> dict[str, int]:
    """Arrays with one row an instant, and their number of columns."""
    springs, motors = model.n_springs, model.n_motors
    widths = {"q_motors": motors, "q_springs": springs, "velocities": springs, "motor_velocities": motors}
    return widths | {"motor_torques": motors, "forces": 3}


def _pack(motion: Motion) -> dict[str, Any]:
    arrays = {name: getattr(motion, name) for name in ("time", *_columns(motion.model), "steps", *_NUMBERS, "interrupted")}
    energies = {one.name: getattr(motion.energy, one.name) for one in fields_of(MotionEnergy)}
    return pack_model(motion.model, Load({}, motion.gravity)) | arrays | energies | packed_memories([motion.model])


def _unpack(fields: Mapping[str, Any]) -> Motion:
    model, load = unpack_model(fields)
    time = finite_array("time", fields["time"], (None,), "s")
    if len(time) == 0 or fields["interrupted"].dtype != bool or fields["interrupted"].shape:
        raise FileFormatError("it must have at least one instant, and say whether it was interrupted")
    columns: dict[str, Any] = {}
    for name, width in _columns(model).items():
        columns[name] = read_only(finite_array(name, fields[name], (len(time), width)))
    names = [one.name for one in fields_of(MotionEnergy)]
    energies = {name: read_only(finite_array(name, fields[name], (len(time),), "J")) for name in names}
    for motors in columns["q_motors"]:
        model.actuators.checked(motors)
    for motors, springs in zip(columns["q_motors"], columns["q_springs"], strict=True):
        if not model.coordinates.at(motors, springs).valid:
            raise FileFormatError("a section is out of its range")
    numbers: dict[str, Any] = {name: non_negative_number(name, fields[name]) if name in fields else None for name in _NUMBERS}
    steps = finite_array("steps", fields["steps"], (None,), "s")
    return Motion(
        model=with_memories(fields, model, 1)[0],
        time=read_only(increasing("time", time, "s")),
        **columns,
        **numbers | {"mass_damping": numbers["mass_damping"] or 0.0},
        gravity=load.gravity,
        energy=MotionEnergy(**energies),
        steps=read_only(increasing("steps", steps, "s")),
        interrupted=bool(fields["interrupted"]),
    )


def _table(motion: Motion) -> dict[str, FloatArray]:
    """Columns of a CSV file of a motion, each name with its unit."""
    model = motion.model
    motors, springs = (model.actuator_names, model.actuator_units), (model.spring_joints, model.springs.units)
    table = {"time [s]": motion.time} | joint_columns(model, motion.q_motors, motion.q_springs)
    for (names, units), rates in ((motors, motion.motor_velocities), (springs, motion.velocities)):
        table |= named_columns(names, [f"{unit}/s" for unit in units], rates, " velocity")
    table |= named_columns(model.actuator_names, load_units(model.actuator_units), motion.motor_torques, " load")
    table |= vector_columns("tip", "m", motion.tip_position) | vector_columns("force", "N", motion.forces)
    energies = {one.name: getattr(motion.energy, one.name) for one in fields_of(MotionEnergy)}
    return table | {f"{name.replace('_', ' ')} [J]": values for name, values in energies.items()}


KINDS["motion"] = Kind(Motion, _pack, _unpack, many=True, to_table=_table)


def _pack_asked(result: VibrationModes | LinearModel) -> dict[str, Any]:
    settings = {name: value for name, value in result.settings.items() if value is not None}
    return KINDS["equilibrium"].to_arrays(result.equilibrium) | settings


def _unpack_asked(fields: Mapping[str, Any], *names: str) -> tuple[Equilibrium, dict[str, Any]]:
    return KINDS["equilibrium"].from_arrays(fields), {
        name: finite_array(name, fields[name], None) for name in names if name in fields
    }


def _pack_modes(modes: VibrationModes) -> dict[str, Any]:
    return _pack_asked(modes) | {"frequencies": modes.frequencies}


def _unpack_modes(fields: Mapping[str, Any]) -> VibrationModes:
    equilibrium, settings = _unpack_asked(fields, "damping_time", "mass_damping", "servo_stiffness", "rotor_inertia")
    modes = vibration_modes(equilibrium.model, equilibrium, **settings)
    claimed = finite_array("frequencies", fields["frequencies"], modes.frequencies.shape, "Hz")
    if not np.allclose(claimed, modes.frequencies, rtol=_SAME, atol=0.0):
        raise FileFormatError("its frequencies are not those of its equilibrium")
    return modes


def _table_of_modes(modes: VibrationModes) -> dict[str, FloatArray]:
    """Columns of a CSV file, a row a mode."""
    model, masses = modes.model, modes.effective_masses
    table: dict[str, FloatArray] = {
        "mode": np.arange(1.0, len(modes.frequencies) + 1.0),
        "frequency [Hz]": modes.frequencies,
        "damping ratio [-]": modes.damping_ratios,
    }
    table |= {f"effective mass {axis} [kg]": masses[:, place] for place, axis in enumerate("xyz")}
    table |= {f"effective inertia about {axis} [kg m^2]": masses[:, 3 + place] for place, axis in enumerate("xyz")}
    table |= {f"tip {axis} [1/sqrt(kg)]": modes.tip_shapes[place] for place, axis in enumerate("xyz")}
    table |= {f"tip turn {axis} [rad/(sqrt(kg) m)]": modes.tip_shapes[3 + place] for place, axis in enumerate("xyz")}
    shapes = np.concatenate([modes.motor_shapes, modes.shapes])
    turning = np.concatenate([model.actuators.turning, model.springs.turning])
    for name, turns, row in zip((*model.motor_joints, *model.spring_joints), turning, shapes, strict=True):
        table[f"{name} [{'rad/(sqrt(kg) m)' if turns else '1/sqrt(kg)'}]"] = row
    return table


KINDS["vibration_modes"] = Kind(VibrationModes, _pack_modes, _unpack_modes, to_table=_table_of_modes)


def _pack_linear(linear: LinearModel) -> dict[str, Any]:
    return _pack_asked(linear) | {"motors": linear.motors} | dict(zip("ABCD", linear, strict=True))


def _unpack_linear(fields: Mapping[str, Any]) -> LinearModel:
    equilibrium, settings = _unpack_asked(fields, "damping_time", "mass_damping", "rotor_inertia")
    linear = linearize(equilibrium.model, equilibrium, motors=text(fields, "motors"), **settings)
    for name, found in zip("ABCD", linear, strict=True):
        claimed = finite_array(name, fields[name], found.shape)
        if np.abs(claimed - found).max(initial=0.0) > _SAME * np.abs(found).max(initial=0.0):
            raise FileFormatError(f"its matrix {name} is not that of its equilibrium")
    return linear


KINDS["linear_model"] = Kind(LinearModel, _pack_linear, _unpack_linear)
