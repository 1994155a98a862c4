"""Figures of continuum robots: their shape with muscles, and what they reach. Needs matplotlib (extra `plot`).

Every function returns a `matplotlib.figure.Figure`; save it with `figure.savefig(path)`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.workspace import Workspace
from softrobots.view.body import body, body_at
from softrobots.view.figures.plots import COLOURS, equal_box, force_arrow, new_figure

_PULL, _PUSH = COLOURS[0], COLOURS[1]


def shape(equilibrium: Equilibrium) -> Any:
    """Backbone, outline and muscles of a loaded robot with sections; dotted: its backbone without load.

    Args:
        equilibrium: The loaded robot.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no equilibrium of a robot with sections.
        MissingDependency: If matplotlib is not installed.
    """
    if not isinstance(equilibrium, Equilibrium) or not equilibrium.model.structure.section_table:
        raise ParameterError("equilibrium", equilibrium, "an Equilibrium of a robot with sections")
    figure = new_figure((7.0, 7.0))
    axes = figure.add_subplot(projection="3d")
    forces = dict(zip((muscle.name for muscle in equilibrium.model.muscles), equilibrium.muscle_forces, strict=True))
    segments, labelled = body(equilibrium), set()

    def label(text: str) -> str | None:
        return None if text in labelled else labelled.add(text) or text  # type: ignore[func-returns-value]

    model = equilibrium.model
    held = model.muscle_input == "lengths" or not model.muscles
    unloaded = body_at(model, equilibrium.q_motors, model.rest) if held else ()
    told = "without load, same muscle lengths" if model.muscles else "without load"
    for segment in unloaded:
        axes.plot(*segment.backbone.T, color="0.5", lw=1.5, ls=":", label=label(told))
    for segment in segments:
        axes.plot(*segment.backbone.T, color="0.15", lw=3.0, label=label("backbone"))
        for name, points in segment.muscles.items():
            pushes = forces[name] < 0.0
            text = "muscle that pushes" if pushes else "muscle that pulls"
            axes.plot(*points.T, color=_PUSH if pushes else _PULL, lw=1.6, ls="--" if pushes else "-", label=label(text))
        for name, points in segment.lines.items():
            axes.plot(*points.T, color=_PULL, lw=1.6, label=label(name))
        turned = float(np.arccos(np.clip(np.sum(segment.poses[1:, :3, 2] * segment.poses[:-1, :3, 2], axis=1), -1, 1)).sum())
        rings = max(6, round(turned / 0.7))
        for pose in segment.poses[:: max(1, len(segment.poses) // rings)]:
            axes.plot(*_circle(pose, segment.radius).T, color="0.7", lw=0.8)
        axes.plot(*_circle(segment.poses[-1], segment.radius).T, color="0.35", lw=1.6, label=label("end of a segment"))
    arrow = force_arrow(axes, equilibrium)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="Shape under load")
    equal_box(axes, np.concatenate([arrow, *(segment.backbone for segment in (*segments, *unloaded))]))
    axes.legend(loc="upper left", fontsize=9)
    return figure


def workspace(samples: Workspace) -> Any:
    """Reached tip positions in three views, coloured by manipulability.

    Args:
        samples: The workspace.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no workspace.
        MissingDependency: If matplotlib is not installed.
    """
    if not isinstance(samples, Workspace):
        raise ParameterError("samples", samples, "a Workspace")
    figure = new_figure((13.0, 4.4))
    tips, order = samples.tip_positions, np.argsort(samples.manipulability)
    scale = {"c": samples.manipulability[order], "cmap": "cividis", "s": 7, "rasterized": True}
    scale |= {"linewidths": 0.2, "edgecolors": "0.35"}  # or the lightest are lost on white
    all_axes = figure.subplots(1, 3)
    centre, half = 0.5 * (tips.max(0) + tips.min(0)), 0.55 * max(float(np.ptp(tips, axis=0).max()), 1e-3)
    for axes, (one, two) in zip(all_axes, ((0, 2), (1, 2), (0, 1)), strict=True):
        dots = axes.scatter(tips[order, one], tips[order, two], **scale)
        axes.plot(0.0, 0.0, marker="+", color="k", ms=10, ls="none", label="base")
        axes.set(xlabel=f"{'xyz'[one]} [m]", ylabel=f"{'xyz'[two]} [m]", aspect="equal")
        axes.set_xlim(centre[one] - half, centre[one] + half)
        axes.set_ylim(centre[two] - half, centre[two] + half)
        axes.grid(alpha=0.3)
    all_axes[0].legend(loc="lower left", fontsize=9)
    figure.colorbar(dots, ax=all_axes, label="manipulability of the tip [m³/rad³]", pad=0.01)
    force = sum((float(np.linalg.norm(wrench[:3])) for wrench in samples.load.wrenches.values()), 0.0)
    load = ([f"{force:.3g} N"] if force > 0.0 else []) + (["gravity"] if samples.load.gravity is not None else [])
    under = f" under {' and '.join(load)}" if load else ", no load"
    figure.suptitle(f"{len(tips)} tip position{'s' * (len(tips) != 1)} within the limits of the actuators{under}")
    return figure


def _circle(pose: FloatArray, radius: float) -> FloatArray:
    angle = np.linspace(0.0, 2.0 * np.pi, 41)
    flat = radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)])
    return np.asarray(pose[:3, 3] + flat @ pose[:3, :3].T)
