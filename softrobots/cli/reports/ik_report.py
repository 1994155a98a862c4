"""Solutions of inverse kinematics as answers of a command, for a person and for a machine."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.cli.reports.answers import Fact, aligned, answer_of, attributes, formatted
from softrobots.cli.reports.equilibrium_report import (
    equilibrium_answer,
    equilibrium_lines,
    head_lines,
    joined_units,
    known_margins,
    model_answer,
    slack_words,
)
from softrobots.core.checks import FloatArray
from softrobots.model.actuators import load_units
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.statics.trajectory import Trajectory


def solution_answer(solution: IkSolution) -> dict[str, Any]:
    """A solution by the names of its attributes, with `units`."""
    motors = joined_units(solution.equilibrium.model.actuators.units)
    units = {"q_motors": motors, "target": "m", "orientation": "-", "error": "m", "orientation_error": "rad", "iterations": "-"}
    facts = attributes(solution, **units, alternatives=motors, wrist_singularity="")
    return {**answer_of(facts), "equilibrium": equilibrium_answer(solution.equilibrium)}


def solution_lines(solution: IkSolution) -> list[str]:
    """The same for a person."""
    rows = [("target", f"{formatted(solution.target)} m")]
    turned = f", {solution.orientation_error:.2g} rad" if solution.orientation is not None else ""
    rows.append(("tip error", f"{solution.error:.2g} m{turned}, {solution.iterations} steps"))
    rows.append(("motors", f"{formatted(solution.q_motors)} {joined_units(solution.equilibrium.model.actuators.units)}"))
    rows += [("another solution", formatted(other)) for other in solution.alternatives]
    rows += [("NOTE", solution.wrist_singularity)] if solution.wrist_singularity else []
    return [*equilibrium_lines(solution.equilibrium), "", *aligned(rows)]


def trajectory_answer(trajectory: Trajectory) -> dict[str, Any]:
    """A trajectory by the names of its attributes, one row a waypoint, with `units`."""
    model, equilibria = trajectory.model, trajectory.equilibria
    facts = [
        *attributes(trajectory, times="s", targets="m", tip_positions="m", tip_error="m"),
        *attributes(trajectory, orientations="-", orientation_error="rad", q_motors=joined_units(model.actuators.units)),
        Fact("motor_torques", _motor_torques(trajectory), joined_units(load_units(model.actuators.units))),
        Fact("q_springs", trajectory.q_springs, joined_units(model.springs.units)),
        Fact("link_moments", trajectory.link_moments, "N m"),
        Fact("wrinkling_moments", [equilibrium.link_limits.wrinkling_moments for equilibrium in equilibria], "N m"),
        Fact("slack_margin", _margin(trajectory, "slack_margins"), "-"),
        Fact("wrinkling_margin", _margin(trajectory, "wrinkling_margins"), "-"),
        Fact("required_pressure", trajectory.required_pressure, "Pa"),
        Fact("wrinkled", [equilibrium.wrinkled for equilibrium in equilibria]),
        Fact("stable", [equilibrium.stable for equilibrium in equilibria]),
        Fact("within_limits", [equilibrium.within_limits for equilibrium in equilibria]),
        *_contact_forces(trajectory),
        Fact("residual", [equilibrium.residual for equilibrium in equilibria], "N m"),
        Fact("method", trajectory.method),
    ]
    return model_answer(model, equilibria[0].load, facts)


def trajectory_lines(trajectory: Trajectory) -> list[str]:
    """The same for a person: range and largest load of each motor, and the worst of all waypoints."""
    model, equilibria = trajectory.model, trajectory.equilibria
    motors, torques = trajectory.q_motors, _motor_torques(trajectory)
    rows: list[tuple[str, ...]] = [("motor", "first", "last", "least", "largest", "", "largest load", "")]
    for place, (name, unit, load) in enumerate(
        zip(model.motor_joints, model.actuators.units, load_units(model.actuators.units), strict=True)
    ):
        column = motors[:, place]
        ends = (f"{value:.6f}" for value in (column[0], column[-1], column.min(), column.max()))
        rows.append((name, *ends, unit, f"{np.abs(torques[:, place]).max():.6f}", load))
    count, worst, turned = len(equilibria), int(np.argmax(trajectory.tip_error)), trajectory.orientation_error
    summary = [
        ("waypoints", f"{count}, {trajectory.times[-1] - trajectory.times[0]:g} s, by {trajectory.method}"),
        ("largest tip error", f"{trajectory.tip_error[worst]:.2g} m at waypoint {worst + 1}"),
        *([] if turned is None else [("largest angle", f"{turned.max():.2g} rad at waypoint {int(np.argmax(turned)) + 1}")]),
        ("stable", _everywhere([equilibrium.stable for equilibrium in equilibria])),
        ("within limits", _everywhere([equilibrium.within_limits for equilibrium in equilibria])),
    ]
    for name, force in trajectory.contact_forces.items():
        worst = int(np.argmax(force))
        summary.append((f"force on {name}", f"up to {formatted(force[worst])} N, at waypoint {worst + 1}"))
    if trajectory.link_moments is not None:
        largest = trajectory.link_moments.max(axis=0)
        margin, slack = (_margin(trajectory, name) for name in ("wrinkling_margins", "slack_margins"))
        left = "" if margin is None else f", {100.0 * margin:.1f} % of the wrinkling moment is left"
        summary += [
            ("not wrinkled", _everywhere([not equilibrium.wrinkled for equilibrium in equilibria])),
            ("largest moment", f"{formatted(largest)} N m by link{left}"),
            ("first slack fibre", "-" if slack is None else slack_words(slack)),
            ("required pressure", f"{formatted(trajectory.required_pressure)} Pa"),
        ]
    return [*head_lines(model, equilibria[0].load), "", *aligned(rows, right=(1, 2, 3, 4, 6)), "", *aligned(summary)]


def _contact_forces(trajectory: Trajectory) -> list[Fact]:
    """The normal force on each obstacle over the path; nothing in free space."""
    forces = trajectory.contact_forces
    return [Fact("contact_forces", forces, "N")] if forces else []


def _motor_torques(trajectory: Trajectory) -> FloatArray:
    """Load on each motor, shape (n, n_motors)."""
    return np.array([equilibrium.motor_torques for equilibrium in trajectory.equilibria])


def _margin(trajectory: Trajectory, name: str) -> float | None:
    """Least of the margins of this name in `LinkLimits`, at any waypoint and link; None without pressure or links."""
    if trajectory.link_moments is None or any(group.pressure == 0.0 for group in trajectory.model.spring_groups):
        return None
    return known_margins(np.array([min(getattr(one.link_limits, name).min() for one in trajectory.equilibria)]))[0]


def _everywhere(truths: list[bool]) -> str:
    wrong = [place for place, truth in enumerate(truths, start=1) if not truth]
    return f"NO: not at {len(wrong)} waypoints, first at waypoint {wrong[0]}" if wrong else "at every waypoint"
