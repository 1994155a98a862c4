"""Solutions of inverse kinematics as answers of a command for a machine."""

from __future__ import annotations

from typing import Any

from softrobots.cli.reports.answers import Fact, answer_of, attributes
from softrobots.cli.reports.equilibrium_report import equilibrium_answer, model_answer
from softrobots.model.actuators import joined_units, load_units
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.trajectory import Trajectory


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
