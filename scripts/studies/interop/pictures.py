"""The results as a figure: every difference against its tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from softrobots.view.figures import canvas
from studies.interop.measurement import ROBOTS, Results
from studies.interop.simulators import SIMULATORS

SMALLEST = 1e-18
"""Where the picture puts a difference of zero."""


def figure(results: Results) -> Any:
    """Draw every difference against its tolerance."""
    figure = canvas.new_figure((canvas.WIDTH, 9.0))
    upper, lower = figure.subplots(2, 1, height_ratios=(1.2, 1.0))
    _draw_equilibria(upper, results["equilibrium"])
    _draw_kinematics(lower, results["kinematics"])
    return figure


def _draw_equilibria(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    pairs = list(dict.fromkeys((row["tool"], row["robot"]) for row in rows))
    for height, (tool, robot) in enumerate(pairs):
        chosen = [row for row in rows if (row["tool"], row["robot"]) == (tool, robot)]
        for key, shift, marker, colour in (("static", -0.16, "o", 0), ("simulated", 0.16, "^", 1)):
            found = [row[f"{key}_difference"] for row in chosen]
            values = [max(value, SMALLEST) for value in found if value is not None]
            if values:
                style = {"s": 26, "marker": marker, "facecolors": "none", "edgecolors": canvas.COLOURS[colour], "lw": 1.0}
                axes.scatter(values, [height + shift] * len(values), **style)
                allowed = getattr(SIMULATORS[tool], f"{key}_tolerance")
                axes.plot([allowed] * 2, [height + shift - 0.14, height + shift + 0.14], color=canvas.COLOURS[colour], lw=2.2)
    for label, marker, colour in (("forces balance", "o", 0), ("simulated", "^", 1)):
        axes.scatter([], [], marker=marker, facecolors="none", edgecolors=canvas.COLOURS[colour], label=label)
    axes.plot([], [], color="0.3", lw=2.2, label="allowed")
    _finish(axes, [f"{tool}, {ROBOTS[robot]}" for tool, robot in pairs], "largest difference of a joint [rad or m]")
    axes.set_title("Equilibrium against Pinocchio, a mark a case")


def _draw_kinematics(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    for height, tool in enumerate(tools):
        chosen = [row for row in rows if row["tool"] == tool and not row["problem"]]
        for key, shift, marker, colour in (("position_error", -0.12, "s", 2), ("rotation_error", 0.12, "D", 3)):
            values = [max(row[key], SMALLEST) for row in chosen]
            style = {"s": 24, "marker": marker, "facecolors": "none", "edgecolors": canvas.COLOURS[colour], "lw": 1.0}
            axes.scatter(values, [height + shift] * len(values), **style)
        if chosen:
            axes.plot([chosen[0]["precision"]] * 2, [height - 0.26, height + 0.26], color="0.3", lw=2.2)
    for label, marker, colour in (("position [m]", "s", 2), ("rotation [rad]", "D", 3)):
        axes.scatter([], [], marker=marker, facecolors="none", edgecolors=canvas.COLOURS[colour], label=label)
    axes.plot([], [], color="0.3", lw=2.2, label="allowed")
    _finish(axes, tools, "largest error of a link")
    axes.set_title("Links against Pinocchio, a mark a file")


def _finish(axes: Any, labels: Sequence[str], quantity: str) -> None:
    axes.set_xscale("log")
    axes.set_xlim(0.3 * SMALLEST, 1.0)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.set_xlabel(f"{quantity}; 0 is drawn at {SMALLEST:.0e}")
    axes.grid(alpha=0.3, axis="x")
    axes.legend(fontsize=canvas.SMALL)
