"""Summary of a motion: ranges of tip, motors and springs, then energies, steps and the error.

And of vibration modes: the slowest ones, where they move the tip, and the mass that shakes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.summary import Part, Table, facts, formatted
from softrobots.model.actuators import load_units
from softrobots.statics.equilibrium_summary import loaded_robot
from softrobots.statics.loads import Load


def motion_parts(motion: Any) -> list[Part]:
    """Return the parts of the summary of a `Motion`: ranges of tip, motors and springs, then energies, steps and the error."""
    model, energy = motion.model, motion.energy
    motors, springs = model.actuators.units, model.springs.units
    parts: list[Part] = [
        _ranges("tip", "xyz", motion.tip_position, "mmm"),
        _ranges("motor", model.motor_joints, motion.q_motors, motors, motion.motor_torques, load_units(motors)),
        _ranges("spring", model.spring_joints, motion.q_springs, springs),
    ]
    lengths = np.diff(motion.steps)
    steps = f"{len(lengths)}" + (f", of {lengths.min():.3g} to {lengths.max():.3g} s" if len(lengths) else "")
    damping = "of the file" if motion.damping_time is None else f"{motion.damping_time:g} s times stiffness"
    if motion.mass_damping:
        damping += f", and {motion.mass_damping:g} /s times mass"
    rows = [
        ("time", f"{motion.time[-1]:g} s{', INTERRUPTED' if motion.interrupted else ''}, {len(motion.time)} rows"),
        ("steps", steps),
        ("tip error", _error(motion)),
        ("damping", damping),
        *([("wrinkled", _wrinkled(motion))] if model.spring_groups else []),
        ("kinetic energy", f"at most {energy.kinetic.max():.4g} J"),
        ("dissipated", f"{energy.dissipated[-1]:.4g} J"),
        ("work", f"of loads {energy.load_work[-1]:.4g} J, of motors {energy.motor_work[-1]:.4g} J"),
        ("energy balance", f"within {np.abs(energy.balance).max():.2g} J"),
    ]
    push = f"up to {np.linalg.norm(motion.forces, axis=1).max():.6g} N"
    around = [("force on tip", push) if row[0] == "load" else row for row in loaded_robot(model, Load({}, motion.gravity)).rows]
    return [facts(around), *parts, facts(rows)]


def _wrinkled(motion: Any) -> str:
    if not motion.wrinkled.any():
        return "no"
    share, first = motion.wrinkled.mean(), motion.time[np.argmax(motion.wrinkled)]
    return f"YES: {100.0 * share:.0f} % of the time, first at {first:.3g} s; linear springs no longer hold"


def _error(motion: Any) -> str:
    if motion.tolerance is None:
        return "not measured, with fixed steps"
    if motion.tip_error is None:
        return f"not measured before the end ({motion.tolerance:.2g} m allowed)"
    return f"{motion.tip_error:.2g} m ({motion.tolerance:.2g} m allowed)"


def _ranges(
    what: str,
    names: Sequence[str],
    values: FloatArray,
    units: Sequence[str],
    loads: FloatArray | None = None,
    units_of_loads: Sequence[str] = (),
) -> Part:
    """A table of the first, last, least and largest value of each column, and of the largest load in size."""
    if not len(names):
        return ""
    rows: list[tuple[str, ...]] = [
        (what, "first", "last", "least", "largest", "", *(["largest load", ""] * (loads is not None)))
    ]
    for place, (name, column, unit) in enumerate(zip(names, values.T, units, strict=True)):
        ends = (f"{value:.6f}" for value in (column[0], column[-1], column.min(), column.max()))
        load = () if loads is None else (formatted(np.abs(loads[:, place]).max()), units_of_loads[place])
        rows.append((name, *ends, unit, *load))
    return Table(rows, right=(1, 2, 3, 4, 6))


def modes_parts(modes: Any, count: int = 6) -> list[Part]:
    """Return the parts of the summary of `VibrationModes`: a table of the slowest, and the mass that shakes with the base."""
    shown = min(count, len(modes.frequencies))
    rows = [("mode", "frequency [Hz]", "damping ratio", "tip moves along", "effective mass x, y, z [kg]")]
    for place in range(shown):
        masses = "  ".join(f"{mass:.4f}" for mass in modes.effective_masses[place, :3])
        numbers = f"{modes.frequencies[place]:.6g}", f"{modes.damping_ratios[place]:.4g}"
        rows.append((str(place + 1), *numbers, _direction(modes.tip_shapes[:, place], modes.model.reach), masses))
    left = len(modes.frequencies) - shown
    more = f"and {left} faster ones, up to {modes.frequencies[-1]:.6g} Hz\n" if left else ""
    shaken = "  ".join(f"{mass:.4f}" for mass in modes.effective_masses.sum(axis=0)[:3])
    return [Table(rows), f"{more}mass that shakes with the base along x, y, z, in all modes: {shaken} kg"]


def _direction(moved: FloatArray, reach: float) -> str:
    """Where the tip goes in a mode, as a unit vector, or that it turns only."""
    size = float(np.linalg.norm(moved[:3]))
    if size <= 1e-6 * reach * float(np.linalg.norm(moved[3:])):
        return "nowhere: it turns"
    return "  ".join(f"{part:6.3f}" for part in moved[:3].round(9) / size + 0.0)
