"""Serialisation of vibration modes: the equilibrium and the arguments; the modes are computed again and compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import FileFormatError
from softrobots.core.result_file import KINDS, Kind
from softrobots.dynamics.vibration import VibrationModes, vibration_modes

_SAME = 1e-6  # relative difference of frequencies that rounding on another machine explains, of fast modes too


def _pack(modes: VibrationModes) -> dict[str, Any]:
    settings = {name: value for name, value in modes.settings.items() if value is not None}
    return KINDS["equilibrium"].to_arrays(modes.equilibrium) | settings | {"frequencies": modes.frequencies}


def _unpack(fields: Mapping[str, Any]) -> VibrationModes:
    equilibrium = KINDS["equilibrium"].from_arrays(fields)
    names = ("damping_time", "mass_damping", "servo_stiffness", "rotor_inertia")
    settings: dict[str, Any] = {name: finite_array(name, fields[name], None) for name in names if name in fields}
    modes = vibration_modes(equilibrium.model, equilibrium, **settings)
    claimed = finite_array("frequencies", fields["frequencies"], modes.frequencies.shape, "Hz")
    if not np.allclose(claimed, modes.frequencies, rtol=_SAME, atol=0.0):
        raise FileFormatError("its frequencies are not those of its equilibrium")
    return modes


def _table(modes: VibrationModes) -> dict[str, FloatArray]:
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


KINDS["vibration_modes"] = Kind(VibrationModes, _pack, _unpack, to_table=_table)
