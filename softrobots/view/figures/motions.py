"""Figures of motions: tip and energies over time, and the robot at several times in one picture.

They need matplotlib (extra `plot`). The functions return a `matplotlib.figure.Figure`; save it with `figure.savefig(path)`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, instance_of, positive_integer
from softrobots.core.errors import ParameterError
from softrobots.dynamics.motion import Motion
from softrobots.view.body import robot_line
from softrobots.view.figures.canvas import COLOURS, LINES, new_figure, new_plot, plain_words

_STILL = 1e-9  # of the reach: a coordinate of the tip that moves less is not drawn


def tip_over_time(motions: Motion | Mapping[str, Motion]) -> Any:
    """Coordinates of the tip over time, each in a plot of its own, one line a motion.

    Args:
        motions: A motion, or several by the label of their line. Coordinates that no motion changes are left out.

    Returns:
        The figure.

    Raises:
        ParameterError: If there is no motion, or something else among them.
        MissingDependency: If matplotlib is not installed.
    """
    named = dict(motions) if isinstance(motions, Mapping) else {"": motions}
    if not named:
        raise ParameterError("motions", motions, "a Motion, or at least one by its label")
    for motion in named.values():
        instance_of("motions", motion, Motion, "a Motion, or a mapping of labels to motions")
    paths = [motion.tip_position for motion in named.values()]
    spans = np.ptp(np.vstack(paths), axis=0)
    reach = max(motion.model.reach for motion in named.values())
    shown = [axis for axis in range(3) if spans[axis] > _STILL * reach] or [2]
    figure = new_figure((6.4, 1.3 + 1.5 * len(shown)))
    plots = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True))
    for axes, axis in zip(plots, shown, strict=True):
        for number, ((label, motion), path) in enumerate(zip(named.items(), paths, strict=True)):
            style = {"color": COLOURS[number % len(COLOURS)], "ls": LINES[number % len(LINES)]}
            axes.plot(motion.time, 1e3 * path[:, axis], lw=1.8, label=plain_words(label), **style)
        axes.set_ylabel(f"tip {'xyz'[axis]} [mm]")
        axes.grid(alpha=0.3)
        axes.margins(x=0.0)
    plots[-1].set_xlabel("time [s]")
    if len(named) > 1:
        figure.legend(*plots[0].get_legend_handles_labels(), fontsize=10, loc="outside lower center", ncols=min(len(named), 3))
    return figure


def energies(motion: Motion) -> Any:
    """Energies over time, and below their balance, which is zero but for the error of the time stepping.

    Args:
        motion: The motion. An energy or work that stays zero is left out.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no motion.
        MissingDependency: If matplotlib is not installed.
    """
    energy = instance_of("motion", motion, Motion, "a Motion").energy
    lines = {
        "kinetic": energy.kinetic,
        "elastic": energy.elastic,
        "gravity": energy.potential - energy.potential[0],
        "dissipated": energy.dissipated,
        "work of loads": energy.load_work,
        "work of motors": energy.motor_work,
    }
    figure = new_figure((6.4, 5.6))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    for number, (label, line) in enumerate(lines.items()):
        if np.any(line != 0.0):
            upper.plot(motion.time, line, lw=1.8, label=label, color=COLOURS[number], ls=LINES[number])
    upper.set(ylabel="energy [J]")
    upper.grid(alpha=0.3)
    lower.plot(motion.time, 1e3 * energy.balance, color="#303030", lw=1.5)
    lower.set(xlabel="time [s]", ylabel="balance [mJ]")
    lower.grid(alpha=0.3)
    for axes in (upper, lower):
        axes.margins(x=0.0)
    if upper.lines:
        figure.legend(fontsize=10, loc="outside lower center", ncols=3)
    return figure


def strobe(motion: Motion, *, shown: int = 8, between: tuple[float, float] | None = None) -> Any:
    """The robot at several times in one picture, later ones darker, with the path of the tip and the largest force on it.

    It is seen along the axis of the world across which the tip moves most; both axes have the same scale.

    Args:
        motion: The motion.
        shown: How many times, evenly spaced.
        between: First and last of them [s]; those of the motion by default.

    Returns:
        The figure.

    Raises:
        ParameterError: If it is no motion, `shown` is not positive, or `between` is not within the motion.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("motion", motion, Motion, "a Motion")
    ends = motion.time[[0, -1]] if between is None else finite_array("between", between, (2,), "s")
    if not motion.time[0] <= ends[0] <= ends[1] <= motion.time[-1]:
        raise ParameterError("between", between, f"from {motion.time[0]:g} to {motion.time[-1]:g} s, increasing")
    rows = np.searchsorted(motion.time, np.linspace(ends[0], ends[1], positive_integer("shown", shown, 1000)) - 1e-12)
    chosen = np.unique(rows).tolist()
    first, last = chosen[0], chosen[-1]
    backbones = [robot_line(motion.model, motion.q_motors[row], motion.q_springs[row], 4) for row in chosen]
    path = motion.tip_position[first : last + 1]
    sizes = np.linalg.norm(motion.forces[first : last + 1], axis=1)
    strongest = int(np.argmax(sizes))
    arrow = 0.2 * motion.model.reach * motion.forces[first + strongest] / (sizes[strongest] or 1.0)
    everything = np.vstack([*backbones, path, path[strongest] + arrow])
    right, up = _axes_of(path, everything)
    wide, high = np.ptp(everything[:, [right, up]], axis=0)
    size = (6.0, float(np.clip(1.5 + 5.2 * high / wide, 3.2, 6.4)) if wide > 0.0 else 6.4)
    figure, axes = new_plot(size, xlabel=f"{'xyz'[right]} [m]", ylabel=f"{'xyz'[up]} [m]")
    for count, (row, points) in enumerate(zip(chosen, backbones, strict=True)):
        shade = 0.82 - 0.74 * count / max(len(chosen) - 1, 1)
        label = f"at {motion.time[row]:.3g} s" if row in (chosen[0], chosen[-1]) else None
        axes.plot(points[:, right], points[:, up], color=(shade, shade, shade), lw=2.5, label=label)
    axes.plot(path[:, right], path[:, up], color=COLOURS[1], lw=1.5, label="path of the tip")
    if sizes[strongest] > 0.0:
        label = f"force, {sizes[strongest]:.3g} N at {motion.time[first + strongest]:.3g} s"
        style = {"arrowstyle": "-|>", "color": COLOURS[2], "lw": 2.0, "mutation_scale": 16.0, "shrinkA": 0.0, "shrinkB": 0.0}
        span = {"xy": (path[strongest] + arrow)[[right, up]], "xytext": path[strongest][[right, up]]}
        axes.annotate("", **span, arrowprops=style)
        axes.plot(*span["xy"], alpha=0.0)  # axes grow with lines, not with annotations
        axes.plot([], [], color=COLOURS[2], lw=2.0, label=label)
    axes.set_aspect("equal", adjustable="datalim")
    figure.legend(fontsize=10, loc="outside lower center", ncols=2)
    return figure


def _axes_of(path: FloatArray, points: FloatArray) -> tuple[int, int]:
    """The two axes of the world that show most of a path of the tip, and of the robot: right and up in a picture."""
    spans = np.ptp(path, axis=0) + 0.5 * np.ptp(points, axis=0)
    pairs = ((0, 2), (1, 2), (0, 1))
    return max(pairs, key=lambda pair: float(np.hypot(*spans[list(pair)])))
