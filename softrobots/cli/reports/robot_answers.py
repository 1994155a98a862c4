"""Equilibria, solutions of inverse kinematics and motions as answers of a command for a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from softrobots.cli.reports.answers import Fact, answer_of, attributes
from softrobots.dynamics.motion import Motion, MotionEnergy
from softrobots.model.actuators import joined_units, load_units
from softrobots.model.link_limits import known_margins
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.loads import Load
from softrobots.statics.trajectory import Trajectory


def equilibrium_answer(equilibrium: Equilibrium) -> dict[str, Any]:
    """Everything about an equilibrium by the names of its attributes, with `units`."""
    model, limits = equilibrium.model, equilibrium.link_limits
    motors, springs = model.actuators.units, model.springs.units
    facts = [
        *attributes(equilibrium, q_motors=joined_units(motors), motor_torques=joined_units(load_units(motors))),
        *attributes(equilibrium, q_springs=joined_units(springs), spring_torques=joined_units(load_units(springs))),
        Fact("tip_position", equilibrium.tip_position, "m"),
        Fact("transform_tip_to_world", equilibrium.tip_pose, "m"),
        Fact("link_moments", equilibrium.link_moments, "N m"),
        *attributes(limits, axial_forces="N", slack_moments="N m"),
        Fact("slack_margins", known_margins(limits.slack_margins), "-"),
        Fact("wrinkling_moments", limits.wrinkling_moments, "N m"),
        Fact("wrinkling_margins", known_margins(limits.wrinkling_margins), "-"),
        *attributes(equilibrium, wrinkled="", saturated="", muscle_lengths="m", muscle_forces="N", muscle_slack="", stable=""),
        Fact("stability", equilibrium.stability.kind),
        Fact("growth_rate", equilibrium.stability.growth_rate, "1/s"),
        *_contacts(equilibrium),
        *attributes(equilibrium, conservative="", within_limits="", residual="N m", tolerance="N m", iterations="-", method=""),
    ]
    return model_answer(model, equilibrium.load, facts)


def solution_answer(solution: IkSolution) -> dict[str, Any]:
    """A solution by the names of its attributes, with `units`."""
    motors = joined_units(solution.equilibrium.model.actuators.units)
    units = {"q_motors": motors, "target": "m", "orientation": "-", "error": "m", "orientation_error": "rad", "iterations": "-"}
    facts = attributes(solution, **units, alternatives=motors, wrist_singularity="")
    return {**answer_of(facts), "equilibrium": equilibrium_answer(solution.equilibrium)}


def trajectory_answer(trajectory: Trajectory) -> dict[str, Any]:
    """A trajectory by the names of its attributes, one row a waypoint, with `units`."""
    model, equilibria = trajectory.model, trajectory.equilibria
    facts = [
        *attributes(trajectory, times="s", targets="m", tip_positions="m", tip_error="m"),
        *attributes(trajectory, orientations="-", orientation_error="rad", q_motors=joined_units(model.actuators.units)),
        Fact("motor_torques", trajectory.motor_torques, joined_units(load_units(model.actuators.units))),
        Fact("q_springs", trajectory.q_springs, joined_units(model.springs.units)),
        Fact("link_moments", trajectory.link_moments, "N m"),
        Fact("wrinkling_moments", [equilibrium.link_limits.wrinkling_moments for equilibrium in equilibria], "N m"),
        Fact("slack_margin", trajectory.least_margin("slack_margins"), "-"),
        Fact("wrinkling_margin", trajectory.least_margin("wrinkling_margins"), "-"),
        Fact("required_pressure", trajectory.required_pressure, "Pa"),
        Fact("wrinkled", [equilibrium.wrinkled for equilibrium in equilibria]),
        Fact("stable", [equilibrium.stable for equilibrium in equilibria]),
        Fact("within_limits", [equilibrium.within_limits for equilibrium in equilibria]),
        *([Fact("contact_forces", forces, "N")] if (forces := trajectory.contact_forces) else []),
        Fact("residual", [equilibrium.residual for equilibrium in equilibria], "N m"),
        Fact("method", trajectory.method),
    ]
    return model_answer(model, equilibria[0].load, facts)


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


def model_answer(model: SoftModel, load: Load, facts: Sequence[Fact]) -> dict[str, Any]:
    """Facts of a loaded robot after its names, its wrenches by frame [N, N m], force first, and gravity [m/s^2], if any."""
    names = {"motor_joints": model.motor_joints, "spring_joints": model.spring_joints, "tip": model.tip}
    loaded: dict[str, Any] = {"wrenches": dict(load.wrenches), "gravity": load.gravity}
    if load.environment is not None:
        loaded["environment"] = load.environment.to_dict()
    return {"robot": model.pinocchio.name, **names, "load": loaded, **answer_of(facts)}


def _contacts(equilibrium: Equilibrium) -> list[Fact]:
    """The contacts as plain data by the names of their attributes, if there are obstacles."""
    if equilibrium.environment is None:
        return []
    units = "normals and status without unit; points, gap and slip [m]; forces [N]"
    return [Fact("contacts", [vars(contact) for contact in equilibrium.contacts], units)]
