"""Figures of choices around a fit: which set of parameters, and which poses to measure. Needs matplotlib (extra `plot`).

Each function returns a `matplotlib.figure.Figure`. Errors are ParameterError for another result, MissingDependency without
matplotlib.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import instance_of
from softrobots.identification.cross_validation import CrossValidation
from softrobots.identification.informative_poses import InformativePoses
from softrobots.view.figures.canvas import COLOURS, WIDTH, line_style, new_plot, plain_words


def cross_validation(result: CrossValidation) -> Any:
    """Mean error of each set of parameters on families that its fits have not seen, with standard errors, a dot a family."""
    instance_of("result", result, CrossValidation, "a CrossValidation")
    scale, unit = (1e3, "mm") if result.unit == "m" else (1.0, result.unit)
    figure, axes = new_plot((WIDTH, 1.7 + 0.55 * len(result.sets)), xlabel=f"error on the family left out [{unit}]")
    for place, (name, means, spread, errors) in enumerate(
        zip(result.sets, scale * result.means, scale * result.standard_errors, scale * result.errors, strict=True)
    ):
        axes.barh(place, means, height=0.6, color=COLOURS[2] if name == result.best else "0.8")
        axes.errorbar(means, place, xerr=spread, color="0.1", lw=2.0, capsize=5)
        axes.plot(errors, np.full(len(errors), place), ls="", marker="o", ms=5, mfc="white", color=COLOURS[1])
    names = [f"{plain_words(name)} ({len(parameters)})" for name, parameters in result.sets.items()]
    axes.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5), xlim=(0.0, None))
    handles = [
        axes.barh(0, 0, color=COLOURS[2], label="mean, best within one standard error"),
        axes.errorbar([], [], xerr=[], color="0.1", lw=2.0, capsize=5, label="standard error"),
        axes.plot([], [], ls="", marker="o", ms=5, mfc="white", color=COLOURS[1], label="one family")[0],
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=10)
    return figure


def informative(result: InformativePoses) -> Any:
    """Expected intervals with other poses, relative to those with the chosen ones; a line a parameter."""
    instance_of("result", result, InformativePoses, "InformativePoses")
    label = "width of the interval, relative to that with the chosen poses [-]"
    figure, axes = new_plot((WIDTH, 1.7 + 0.36 * len(result.names)), xlabel=label, xscale="log")
    for number, (name, widths) in enumerate(result.margins.items()):
        label = f"{name} ({len(result.indices)})" if name == "chosen" else name
        style = line_style(number) | {"ls": "", "ms": 7}
        axes.plot(widths / result.margins["chosen"], range(len(widths)), label=label, **style)
    names = [plain_words(name) for name in result.names]
    axes.set(yticks=range(len(names)), yticklabels=names, ylim=(len(names) - 0.5, -0.5))
    ticks = [
        tick
        for tick in (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
        if axes.get_xlim()[0] <= tick <= axes.get_xlim()[1]
    ]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    figure.legend(loc="outside lower center", ncols=4, fontsize=10)
    return figure
