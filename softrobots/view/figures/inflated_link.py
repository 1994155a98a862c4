"""Figure of the bending test of an inflated link. Needs matplotlib (extra `plot`)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots import inflated_beam
from softrobots.inflated_beam import BendingData, Characterisation
from softrobots.inflated_beam.characterisation_fit import CONFIDENCE
from softrobots.inflated_beam.fitted_line import FittedLine, student_quantile
from softrobots.view.figures.canvas import COLOURS, LINES, WIDTH, new_plot

_FAINT = "#7f7f7f"


def characterisation(data: BendingData, fit: Characterisation, *, pressure: float, radius: float) -> Any:
    """Measured moments over the hinge angle, the fitted law, and the limits of the moment.

    Points in the fit of the slope are filled. The band is the 95 % confidence of the line: narrowest at
    the mean angle of those points if the zero was fitted, at the zero if it was given.

    Args:
        data: The measured points.
        fit: The law that `inflated_beam.fit_characterisation` finds in them.
        pressure: Gauge pressure of the test [Pa].
        radius: Radius of the link [m].

    Returns:
        The figure.

    Raises:
        ParameterError: If pressure or radius are out of range.
        MissingDependency: If matplotlib is not installed.
    """
    limits = inflated_beam.moment_limits(pressure, radius)
    title = f"Bending test of a link at {pressure / 1e3:g} kPa"
    figure, axes = new_plot((WIDTH, 5.0), xlabel="measured hinge angle [rad]", ylabel="moment at the hinge [N m]", title=title)
    sides = np.where(data.angle < fit.angle_offset, -1.0, 1.0)
    bent, moments = sides * (data.angle - fit.angle_offset), sides * data.moment
    knee = math.inf if fit.max_moment is None else fit.max_moment
    used = np.argsort(np.argsort(bent)) < fit.n_linear
    for chosen, face, label in ((used, COLOURS[0], "measured, on the slope"), (~used, "white", "measured, beyond")):
        if chosen.any():
            style = {"color": COLOURS[0], "mfc": face, "ms": 5}
            axes.plot(fit.angle_offset + bent[chosen], moments[chosen], "o", label=label, **style)
    angles = np.linspace(0.0, 1.03 * float(bent.max()), 301)
    line = FittedLine.of((sides * bent)[used], data.moment[used], fit.angle_offset_std > 0.0)
    if line is not None:
        half = student_quantile(0.5 + 0.5 * CONFIDENCE, line.freedoms) * np.sqrt([line.variance(one) for one in angles])
        low, high = (np.minimum(fit.stiffness * angles + sign * half, knee) for sign in (-1.0, 1.0))
        label = f"{100 * CONFIDENCE:g} % band of the line"
        axes.fill_between(fit.angle_offset + angles, low, high, color=COLOURS[1], alpha=0.2, lw=0, label=label)
    low_k, high_k = fit.stiffness_interval
    label = f"k = {fit.stiffness:.1f} ({low_k:.1f} to {high_k:.1f}) N m/rad"
    label += "" if fit.max_moment is None else f", $M_{{max}}$ = {fit.max_moment:.2f} N m"
    axes.plot(fit.angle_offset + angles, np.minimum(fit.stiffness * angles, knee), color=COLOURS[1], lw=1.8, label=label)
    top = max(1.12 * float(moments.max()), 1.05 * limits.wrinkling)
    named = (limits.slack, "first slack fibre"), (limits.wrinkling, "wrinkling (3)"), (limits.collapse, "collapse")
    for number, (limit, name) in enumerate(named):
        if limit < top:
            axes.axhline(limit, color=_FAINT, ls=LINES[number + 1], lw=1.2, label=f"{name}, {limit:.2f} N m")
    axes.set(xlim=(min(0.0, fit.angle_offset), None), ylim=(min(0.0, float(moments.min())), top))
    axes.legend(fontsize=9, loc="lower right")
    return figure
