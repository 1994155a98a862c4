"""Figure of the grasp force of a helix over pressure and deflection: after [Blumenschein 2018] Figure 9."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots import helix
from softrobots.core.checks import finite_array, instance_of, positive_number
from softrobots.core.errors import ParameterError
from softrobots.view.figures.canvas import COLOURS, MARKERS, WIDTH, grid_and_legend, new_figure

_STYLES = ("-", "--", "-.")
_THIN_STYLE = (0, (1.0, 1.6))


def grasp(test: helix.GraspTest = helix.PAPER_CYLINDER, pressure: float = 10e3) -> Any:
    """Grasp force of our model against pressure and deflection, with its two bounds: after [Blumenschein 2018] Figure 9.

    Args:
        test: What is grasped, and by what helix.
        pressure: Largest gauge pressure, positive [Pa].

    Returns:
        The figure.

    Raises:
        ParameterError: If an argument is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    instance_of("test", test, helix.GraspTest, "a GraspTest")
    most = positive_number("pressure", pressure, "Pa")
    depths = finite_array("deflections", test.deflections, (None,), "m")
    if not 0 < len(depths) <= len(COLOURS):
        raise ParameterError("deflections", test.deflections, f"from one to {len(COLOURS)} numbers")
    test.force(most, depths)  # raises if out of range
    most_deflected = min(0.5 * test.diameter - test.gap / np.pi, test.object_radius)
    deepest = min(most_deflected, max(1.5 * float(depths.max()), 0.1 * test.diameter))
    pressures, range_of = np.linspace(0.0, most, 9), np.linspace(0.0, deepest, 300)
    figure = new_figure((WIDTH, 8.2))
    upper, lower = figure.subplots(2, 1, sharey=True)
    for number, depth in enumerate(depths):
        bounds, colour = test.force(pressures, depth), COLOURS[number]
        style = {"color": colour, "marker": MARKERS[number], "ms": 7, "clip_on": False}
        upper.plot(pressures / 1e3, bounds.contact, ls=_THIN_STYLE, lw=1.6, mfc="white", markevery=(2 + number, 3), **style)
        label = f"force, deflected by {1e3 * depth:.3g} mm"
        wide = 4.5 if number == 1 else 2.2  # lines may lie upon each other, and all but the first on their bound
        upper.plot(
            pressures / 1e3, bounds.force, lw=wide, ls=_STYLES[number // 2 % 3], markevery=(number, 3), label=label, **style
        )
        lower.plot([1e3 * depth], [bounds.force[-1]], ls="none", zorder=4, **style)
    bounds = test.force(most, range_of)
    lower.plot(1e3 * range_of, bounds.force, color="0.75", lw=6.0, label="force, the smaller bound", zorder=1)
    lower.plot(1e3 * range_of, bounds.unwrapping, color="black", lw=1.2, label="bound (a): the tube unwraps")
    lower.plot(1e3 * range_of, bounds.contact, color="black", lw=1.2, ls=_THIN_STYLE, label="bound (b): the wall flattens")
    undeflected = test.force(pressures, 0.0)
    upper.plot(pressures / 1e3, undeflected.unwrapping, color="black", lw=6.5, zorder=1, label="bound (a): the tube unwraps")
    upper.plot([], [], color="black", lw=1.2, ls=_THIN_STYLE, label="bound (b), open marks: the wall flattens")
    upper.set(xlabel="gauge pressure [kPa]", ylabel="grasp force [N]", xlim=(0.0, most / 1e3))
    lower.set(
        xlabel=f"deflection of the inner radius at {most / 1e3:.3g} kPa [mm]",
        ylabel="grasp force [N]",
        xlim=(0.0, 1e3 * deepest),
    )
    for axes in (upper, lower):
        axes.set_ylim(bottom=0.0)
        grid_and_legend(axes, loc="upper left" if axes is upper else "lower right")
    halves = f" in halves {1e3 * test.gap:.3g} mm apart" if test.gap else ""
    case = f"object {200 * test.object_radius:.3g} cm thick{halves}, tube {100 * test.diameter:.3g} cm, {test.turns:.3g} turns"
    figure.suptitle(
        f"Grasp force: our model, not data of the paper\n({case}, {100 * test.turn_height:.3g} cm rise per turn)", fontsize=10
    )
    return figure
