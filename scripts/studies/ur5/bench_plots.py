"""Figures of the characterisation bench, after Figure 9 of [Troise 2021]. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots import inflated_beam
from softrobots.view.figures.canvas import COLOURS, MARKERS, WIDTH, grid_and_legend, new_figure
from studies.ur5.bench_run import BenchRun, Measurement

Push = tuple[inflated_beam.CharacterisationRow, BenchRun, Measurement]
"""A push: the row of Table 3 that the true link has, the run, and what the instruments read."""


def force_displacement(pushes: Sequence[Push]) -> Any:
    """Force on the load cell over the displacement that the UR5 imposes, one line a pressure.

    Args:
        pushes: The pushes.

    Returns:
        The figure.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    figure = new_figure((WIDTH, 4.8))
    axes = figure.add_subplot()
    for number, (row, run, measured) in enumerate(pushes):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(1e3 * run.displacement, run.force, color=colour, lw=1.2)
        axes.plot(
            1e3 * run.displacement, measured.force, color=colour, ls="", marker=MARKERS[number % len(MARKERS)], ms=4,
            label=f"{row.pressure / 1e3:g} kPa",
        )  # fmt: skip
    axes.set(
        xlabel="displacement of the probe [mm]", ylabel="force along the probe [N]", xlim=(0.0, None),
        title="Force of the link on the probe (points: load cell, lines: statics)",
    )  # fmt: skip
    axes.set_ylim(0.0, None)
    grid_and_legend(axes)
    return figure


def moment_angle(pushes: Sequence[Push]) -> Any:
    """Moment over angle with the fitted laws and the wrinkling moments: after [Troise 2021] Figure 9.

    Args:
        pushes: The pushes.

    Returns:
        The figure.

    Raises:
        MissingDependency: If matplotlib is not installed.
        ParameterError: If a law cannot be fitted.
    """
    figure = new_figure((WIDTH, 5.4))
    axes, ends = figure.add_subplot(), []
    for number, (row, run, measured) in enumerate(pushes):
        colour = COLOURS[number % len(COLOURS)]
        fit = inflated_beam.fit_characterisation(
            measured.angle, measured.moment, pressure=row.pressure, radius=run.bench.radius
        )  # fmt: skip
        axes.plot(
            measured.angle, measured.moment, color=colour, ls="", marker=MARKERS[number % len(MARKERS)], ms=4,
            label=f"{row.pressure / 1e3:g} kPa",
        )  # fmt: skip
        angles = np.linspace(0.0, max(float(measured.angle.max()), 0.0), 400)
        most = np.inf if fit.max_moment is None else fit.max_moment
        axes.plot(angles, np.minimum(fit.stiffness * (angles - fit.angle_offset), most), color=colour, lw=1.2)
        axes.axhline(fit.wrinkling_moment, color=colour, lw=1.2, ls=":")
        ends.append((fit.wrinkling_moment, colour, MARKERS[number % len(MARKERS)]))
    style = {"ms": 6, "mfc": "white", "ls": "", "transform": axes.get_yaxis_transform(), "clip_on": False, "zorder": 4}
    for moment, colour, marker in ends:  # on the right edge, where no line is
        axes.plot([1.0], [moment], color=colour, marker=marker, **style)
    axes.plot([], [], color="black", lw=1.2, label="fitted law")
    axes.plot([], [], color="black", lw=1.2, ls=":", marker="o", ms=6, mfc="white", label="wrinkling moment (3)")
    axes.set(xlabel="hinge angle [rad]", ylabel="moment at the hinge [N m]", title="Moment-angle law of the link")
    axes.set_xlim(0.0, None)
    axes.set_ylim(0.0, None)
    grid_and_legend(axes, ncols=2, loc="lower right", framealpha=1.0)
    return figure
