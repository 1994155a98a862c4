"""Figure of what input shapers leave of a vibration."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import positive_number
from softrobots.dynamics.input_shaping import SHAPERS, input_shaper, residual_vibration
from softrobots.view.figures.canvas import line_style, new_plot


def sensitivity(frequency: float, damping_ratio: float = 0.0, *, tolerance: float = 0.05) -> Any:
    """Vibration that each shaper leaves, over the true frequency of the robot, after [Singhose et al. 1994].

    Args:
        frequency: Frequency that the shapers are designed for [Hz].
        damping_ratio: Its damping ratio, from 0 to below 1; the robot has it too [-].
        tolerance: Share of the vibration that the shaper "ei" leaves at the frequency [-].

    Returns:
        The figure.

    Raises:
        ParameterError: If an argument is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    designed = [input_shaper(frequency, damping_ratio, shaper=kind, tolerance=tolerance) for kind in SHAPERS]
    real = positive_number("frequency", frequency, "Hz") * np.linspace(0.5, 1.5, 401)
    title = f"Shapers for {frequency:.4g} Hz, damping ratio {damping_ratio:.2g}"
    figure, axes = new_plot((6.4, 4.8), xlabel="frequency of the robot [Hz]", ylabel="vibration that is left [%]", title=title)
    for number, (kind, shaper) in enumerate(zip(SHAPERS, designed, strict=True)):
        style = line_style(number) | {"marker": None}
        label = f"{kind.upper()}, {shaper.duration:.3g} s longer"
        axes.plot(real, 100.0 * residual_vibration(shaper, real, damping_ratio), lw=2.0, label=label, **style)
    axes.axhline(100.0 * tolerance, color="0.45", lw=0.8)
    axes.annotate(f"{100.0 * tolerance:g} %", (real[0], 100.0 * tolerance), (4, 4), textcoords="offset points", fontsize=10)
    axes.axvline(frequency, color="0.45", lw=0.8, ls=":")
    axes.set(xlim=(real[0], real[-1]), ylim=(0.0, None))
    figure.legend(fontsize=10, loc="outside lower center", ncols=2)
    return figure
