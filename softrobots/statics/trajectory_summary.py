"""Summary of a trajectory: what the motors do over the path, and the worst of all waypoints."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.summary import Part, Table, facts, formatted
from softrobots.model.actuators import load_units
from softrobots.model.link_limits import slack_words
from softrobots.statics.equilibrium_summary import loaded_robot


def trajectory_parts(trajectory: Any) -> list[Part]:
    """Return range and largest load of each motor of a `Trajectory`, and the worst of all waypoints."""
    model, equilibria = trajectory.model, trajectory.equilibria
    motors, torques = trajectory.q_motors, trajectory.motor_torques
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
    if trajectory.contact_path is not None:
        summary.append(("work of friction", f"{formatted(trajectory.contact_path.dissipation[-1])} J"))
    if trajectory.link_moments is not None:
        largest = trajectory.link_moments.max(axis=0)
        margin, slack = (trajectory.least_margin(name) for name in ("wrinkling_margins", "slack_margins"))
        left = "" if margin is None else f", {100.0 * margin:.1f} % of the wrinkling moment is left"
        summary += [
            ("not wrinkled", _everywhere([not equilibrium.wrinkled for equilibrium in equilibria])),
            ("largest moment", f"{formatted(largest)} N m by link{left}"),
            ("first slack fibre", "-" if slack is None else slack_words(slack)),
            ("required pressure", f"{formatted(trajectory.required_pressure)} Pa"),
        ]
    return [loaded_robot(model, equilibria[0].load), Table(rows, right=(1, 2, 3, 4, 6)), facts(summary)]


def _everywhere(truths: list[bool]) -> str:
    wrong = [place for place, truth in enumerate(truths, start=1) if not truth]
    return f"NO: not at {len(wrong)} waypoints, first at waypoint {wrong[0]}" if wrong else "at every waypoint"
