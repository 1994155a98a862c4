"""Figures of the guides: a growing load up to buckling, and a probe that pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, positive_number, unit_vector
from softrobots.core.errors import ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement
from softrobots.view.figures.canvas import WIDTH, grid_and_legend, line_style, new_figure, new_plot


def growing_load(branches: Mapping[str, Sequence[Equilibrium]], direction: Any, *, critical: float | None = None) -> Any:
    """Displacement of the tip and least stiffness over the tip force along a direction, one line for each branch.

    Args:
        branches: Equilibria in the order of growing force, by label; displacements are relative to the first.
        direction: Direction of the force, shape (3,), any length but zero, world axes.
        critical: Force at which the robot buckles [N], to be marked; see `softrobots.critical_load`.

    Returns:
        The figure.

    Raises:
        ParameterError: If a branch is empty or holds something else, or an equilibrium has no springs.
        MissingDependency: If matplotlib is not installed.
    """
    unit = unit_vector("direction", direction)
    _check(branches, Equilibrium)
    figure = new_figure((WIDTH, 7.6))
    upper, lower = figure.subplots(2, 1)
    for number, (label, branch) in enumerate(branches.items()):
        if branch[0].model.n_springs == 0:
            raise ParameterError("branches", branch[0].model, "of a robot with springs")
        forces = [_force(equilibrium) @ unit for equilibrium in branch]
        ways = [1e3 * float(np.linalg.norm(one.tip_position - branch[0].tip_position)) for one in branch]
        style = {"label": label, "markevery": max(len(branch) // 10, 1)} | line_style(number)
        upper.plot(forces, ways, **style)
        lower.plot(forces, [one.eigenvalues[0] for one in branch], **style)
    for axes in (upper, lower):
        if critical is not None:
            force = positive_number("critical", critical, "N")
            axes.axvline(force, color="black", lw=1.0, label=f"buckling load, {force:.2f} N")
        axes.set_xlabel("force at the tip [N]")
        grid_and_legend(axes)
    upper.set(ylabel="way of the tip [mm]", title="Where the tip goes")
    lower.set(ylabel="smallest eigenvalue [N m/rad]", title="What is left of the tangent stiffness")
    return figure


def reaction(runs: Mapping[str, Sequence[ImposedDisplacement]]) -> Any:
    """Force on a probe over its displacement of a robot, one line for each run.

    Markers are filled where the robot is stable under the same force as a dead load, empty where only the probe stabilises it.

    Args:
        runs: Solutions in the order of growing displacement, by label.

    Returns:
        The figure.

    Raises:
        ParameterError: If a run is empty or holds something else.
        MissingDependency: If matplotlib is not installed.
    """
    _check(runs, ImposedDisplacement)
    labels = {"xlabel": "displacement of the probe [mm]", "ylabel": "force on the robot [N]"}
    figure, axes = new_plot((WIDTH, 4.4), title="Imposed displacement", **labels)
    for number, (label, run) in enumerate(runs.items()):
        ways = 1e3 * np.array([state.displacement for state in run])
        forces = np.array([state.reaction for state in run])
        style = line_style(number)
        colour, marker = style["color"], style["marker"]
        axes.plot(ways, forces, color=colour, ls=style["ls"], label=label)
        dead = np.array([state.equilibrium.stable for state in run])
        axes.plot(ways[dead], forces[dead], ls="", marker=marker, ms=5, color=colour)
        axes.plot(ways[~dead], forces[~dead], ls="", marker=marker, ms=5, color=colour, mfc="white")
    for face, label in (("black", "stable under the force alone, too"), ("white", "held by the probe only")):
        axes.plot([], [], ls="", marker="o", ms=5, color="black", mfc=face, label=label)
    axes.legend(fontsize=9)
    return figure


def _check(lines: Any, kind: type) -> None:
    if not isinstance(lines, Mapping) or not lines:
        raise ParameterError("lines", lines, f"a mapping from labels to sequences of {kind.__name__}")
    for label, line in lines.items():
        if not isinstance(line, Sequence) or not line or not all(isinstance(one, kind) for one in line):
            raise ParameterError(f"lines[{label!r}]", line, f"at least one {kind.__name__}")


def _force(equilibrium: Equilibrium) -> FloatArray:
    return np.asarray(equilibrium.load.wrenches.get(equilibrium.model.tip, np.zeros(6))[:3])
