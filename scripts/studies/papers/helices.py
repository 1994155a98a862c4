"""Figures of helical actuation, after Figures 5 and 7 of [Blumenschein 2018].

Lines differ in style or marker too,
to be distinguished in grey.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots import helix
from softrobots.core.checks import FloatArray, finite_array, positive_number
from softrobots.core.errors import ParameterError
from softrobots.view.figures.canvas import COLOURS, SMALL, WIDTH, new_figure
from studies.papers.helix_sheet import draw, sheet

MOST_HELICES = 60
"""Helices that `grid` draws at most."""

MOST_DIAMETERS = 100.0
"""Length over diameter of a tube that `grid` draws, at most."""

_STYLES = ("-", "--", "-.")
_THIN_STYLE = (0, (1.0, 1.6))


def grid(contractions: Any, angles: Any, diameter: float, length: float, handedness: str = "right") -> Any:
    """Helices of tubes of one length, contraction by angle, all to one scale: after [Blumenschein 2018] Figure 5.

    Each is seen from 25 degrees above, axis up. A tube that runs into itself has another colour and a caption that says so.

    Args:
        contractions: Contractions `lambda`, one a column, each in (0, 1], shape (n,) [-].
        angles: Angles `theta` of the actuator to the axis of the tube, one a row, each in [0, pi/2), shape (m,) [rad].
        diameter: Diameter of the tubes, positive [m].
        length: Length of the uninflated tubes, positive and at most `MOST_DIAMETERS` times the diameter [m].
        handedness: "right" or "left".

    Returns:
        The figure.

    Raises:
        ParameterError: If an argument is out of range, there are more than `MOST_HELICES` helices, or one has more
            windings than can be drawn (tubes of 100 diameters beyond 80 degrees).
        StraightTube: At contraction 1 and angle 0, where no helix exists.
        MissingDependency: If matplotlib is not installed.
    """
    shares, tilts = _row("contractions", contractions, "-"), _row("angles", angles, "rad")
    size, span = positive_number("diameter", diameter, "m"), positive_number("length", length, "m")
    if len(shares) * len(tilts) > MOST_HELICES:
        raise ParameterError("contractions", len(shares) * len(tilts), f"at most {MOST_HELICES} helices with the angles")
    if span > MOST_DIAMETERS * size:
        raise ParameterError("length", length, f"at most {MOST_DIAMETERS:g} diameters, {MOST_DIAMETERS * size:g} m")
    helix.forward(shares, tilts[:, None], size)  # raises before anything is drawn
    drawn = [[draw(share, tilt, size, span, handedness) for share in shares] for tilt in tilts]
    sizes, one = f"{100 * size:.3g} cm thick, {span:.3g} m long before", len(shares) * len(tilts) == 1
    return sheet(drawn, shares, tilts, f"A tube {sizes} it contracts" if one else f"Tubes {sizes} they contract, to one scale")


def radius_and_pitch(angles: Any, diameter: float) -> Any:
    """Outer radius and pitch against contraction, with the limit of self-contact: after [Blumenschein 2018] Figure 7.

    Args:
        angles: Angles `theta` of the actuator to the axis of the tube, up to three, each above 0 and at most pi/4 (beyond that
            folds come before turns that touch), shape (m,) [rad].
        diameter: Diameter of the tube, positive [m].

    Returns:
        The figure.

    Raises:
        ParameterError: If an argument is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    tilts, size = _row("angles", angles, "rad"), positive_number("diameter", diameter, "m")
    if len(tilts) > len(_STYLES) or np.any(tilts <= 0.0) or np.any(tilts > 0.25 * np.pi):
        raise ParameterError("angles", angles, f"up to {len(_STYLES)} angles above 0 and at most pi/4 rad")
    figure = new_figure((WIDTH, 8.6))
    radius, pitch, close = figure.subplot_mosaic([["radius", "pitch"], ["close", "close"]]).values()
    below = 100 * size / (2.0 * np.pi)
    for axes in (pitch, close):
        axes.axhline(below, color="0.35", lw=1.0)
    for number, tilt in enumerate(tilts):
        _against_contraction((radius, pitch, close), float(tilt), size, number)
    limits = helix.contraction_limit(tilts)
    for axes, name, title in (
        (radius, "outer radius $R_o$ [cm]", "Outer radius"),
        (pitch, "normalised pitch $b$ [cm/rad]", "Pitch"),
        (close, "$b$ [cm/rad]", "Pitch near self-contact"),
    ):
        axes.set(xlabel=r"contraction $\lambda$ [-]", ylabel=name, xlim=(0.0, 1.0))
        axes.set_title(title)
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    close.set(xlim=(max(0.0, limits.min() - 0.1), min(1.0, limits.max() + 0.1)), ylim=(0.0, 3.0 * below))
    close.locator_params(axis="x", nbins=6)
    _name_lines(figure, pitch)
    figure.suptitle(f"Shape of a tube {100 * size:.3g} cm thick against the contraction of its actuator")
    return figure


def _against_contraction(all_axes: tuple[Any, Any, Any], tilt: float, diameter: float, number: int) -> None:
    """Lines of one angle: outer radius on the first axes, pitch on the others."""
    limit, rule = float(helix.contraction_limit(tilt)), float(helix.simple_contraction_limit(tilt))
    free, beyond = np.linspace(limit, 1.0, 600), np.linspace(1e-6, limit, 400)
    colour = COLOURS[number]
    for axes, name in zip(all_axes, ("outer_radius", "pitch", "pitch"), strict=True):

        def at(contraction: Any, name: str = name) -> Any:
            return 100 * np.atleast_1d(getattr(helix.forward(contraction, tilt, diameter), name))

        label = rf"$\theta$ = {np.degrees(tilt):.4g}°: turns touch below $\lambda$ = {limit:.4f} (simple rule: {rule:.4f})"
        axes.plot(free, at(free), color=colour, ls=_STYLES[number], lw=2.2, label=label)
        axes.plot(beyond, at(beyond), color=colour, ls=_THIN_STYLE, lw=1.2)
        ends = {"color": colour, "marker": "o", "ms": 7, "ls": "none", "clip_on": axes is all_axes[2]}
        axes.plot([1.0, 0.0], [at(1.0)[0], at(1e-30)[0]], zorder=4, **ends)
        marks = {"color": colour, "ls": "none", "zorder": 5}
        axes.plot([limit], at(limit), marker="D", mfc="white", ms=7, **marks)
        if axes is not all_axes[0]:
            axes.plot([rule], at(rule), marker="x", ms=6, mew=1.5, **marks)


def _name_lines(figure: Any, axes: Any) -> None:
    """Legend of the angles, and of the lines and marks that all angles share."""
    from matplotlib.lines import Line2D

    angles, names = axes.get_legend_handles_labels()
    styles: dict[str, dict[str, Any]] = {
        r"start, $\lambda$ = 1, and end, $\lambda$ = 0": {"marker": "o", "ms": 7, "ls": "none"},
        "the tube would run into itself": {"ls": _THIN_STYLE, "lw": 1.2},
        r"a turn rises by a diameter, $2\pi b = D$": {"lw": 1.0, "color": "0.35"},
        "neighbouring turns just touch, exact": {"marker": "D", "mfc": "white", "ms": 7, "ls": "none"},
        r"limit by the simple rule, $2\pi b \geq D$": {"marker": "x", "ms": 6, "mew": 1.5, "ls": "none"},
    }
    black: dict[str, Any] = {"color": "black"}
    lines = [Line2D([], [], **(black | style)) for style in styles.values()]
    figure.legend(angles + lines, names + list(styles), loc="outside lower center", fontsize=SMALL)


def _row(name: str, values: Any, unit: str) -> FloatArray:
    """Numbers in a row, at least one."""
    row = finite_array(name, values, (None,), unit)
    if len(row) == 0:
        raise ParameterError(name, values, "at least one number")
    return row
