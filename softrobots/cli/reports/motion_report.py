"""Motions as answers of a command for a machine."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from softrobots.cli.reports.answers import Fact, attributes
from softrobots.cli.reports.equilibrium_report import model_answer
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.model.actuators import joined_units, load_units
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
