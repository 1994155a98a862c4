"""Motions as answers of a command, for a person and for a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from softrobots.cli.reports.answers import Fact, aligned, attributes, formatted
from softrobots.cli.reports.equilibrium_report import head_lines, joined_units, model_answer
from softrobots.core.checks import FloatArray
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.model.actuators import load_units
from softrobots.statics.loads import Load


def motion_answer(motion: Motion, load: Load) -> dict[str, Any]:
    """A motion under a load by the names of its attributes, one row for each instant, with `units`."""
    motors, springs = motion.model.actuators.units, motion.model.springs.units
    energies = {one.name: getattr(motion.energy, one.name) for one in fields(MotionEnergy)}
    facts = [
        *attributes(motion, time="s", tip_position="m", forces="N", q_motors=joined_units(motors)),
        Fact("motor_torques", motion.motor_torques, joined_units(load_units(motors))),
        Fact("q_springs", motion.q_springs, joined_units(springs)),
        Fact("velocities", motion.velocities, joined_units([f"{unit}/s" for unit in springs])),
        Fact("energy", {**energies, "balance": motion.energy.balance}, "J"),
        *attributes(motion, steps="s", tip_error="m", tolerance="m", damping_time="s", wrinkled="", interrupted=""),
    ]
    return model_answer(motion.model, load, facts)


def motion_lines(motion: Motion, load: Load) -> list[str]:
    """The same for a person: ranges of tip, motors and springs, then energies, steps and the error."""
    model, energy = motion.model, motion.energy
    motors, springs = model.actuators.units, model.springs.units
    parts = [
        _ranges("tip", "xyz", motion.tip_position, "mmm"),
        _ranges("motor", model.motor_joints, motion.q_motors, motors, motion.motor_torques, load_units(motors)),
        _ranges("spring", model.spring_joints, motion.q_springs, springs),
    ]
    lengths = np.diff(motion.steps)
    steps = f"{len(lengths)}" + (f", of {lengths.min():.3g} to {lengths.max():.3g} s" if len(lengths) else "")
    damping = "of the file" if motion.damping_time is None else f"{motion.damping_time:g} s times stiffness"
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
    tables = [line for part in parts if part for line in (*part, "")]
    return [*head_lines(model, load), "", *tables, *aligned(rows)]


def _wrinkled(motion: Motion) -> str:
    if not motion.wrinkled.any():
        return "no"
    share, first = motion.wrinkled.mean(), motion.time[np.argmax(motion.wrinkled)]
    return f"YES: {100.0 * share:.0f} % of the time, first at {first:.3g} s; linear springs no longer hold"


def _error(motion: Motion) -> str:
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
) -> list[str]:
    """A table of the first, last, least and largest value of each column, and of the largest load in size."""
    if not len(names):
        return []
    rows: list[tuple[str, ...]] = [
        (what, "first", "last", "least", "largest", "", *(["largest load", ""] * (loads is not None)))
    ]
    for place, (name, column, unit) in enumerate(zip(names, values.T, units, strict=True)):
        ends = (f"{value:.6f}" for value in (column[0], column[-1], column.min(), column.max()))
        load = () if loads is None else (formatted(np.abs(loads[:, place]).max()), units_of_loads[place])
        rows.append((name, *ends, unit, *load))
    return aligned(rows, right=(1, 2, 3, 4, 6))
