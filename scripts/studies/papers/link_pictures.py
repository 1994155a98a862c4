"""Figures of the inflated link of [Troise 2021]: its bent shape, its laws by pressure, and what pressure does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import finite_number, instance_of, positive_number
from softrobots.core.errors import ParameterError
from softrobots.inflated_beam import CharacterisationRow
from softrobots.view.figures.canvas import COLOURS, LINES, MARKERS, WIDTH, grid_and_legend, line_style, new_figure, new_plot

_FAINT = "#7f7f7f"


def deflection(
    force: float,
    *,
    stiffness: float,
    hinge_offset: float,
    length: float,
    radius: float,
    wall_thickness: float,
    pressure: float,
    poisson_ratio: float = 0.3,
) -> Any:
    """Deflection along a link under a transverse tip force: the beam of [Troise 2021] (1) beside its pseudo-rigid body.

    The modulus of the beam is the one that the hinge stiffness implies (`inflated_beam.young_modulus_from_stiffness`). The
    figure also has the beam without shear, and (1) with the sign of its cubic term as printed.

    Args:
        force: Transverse tip force [N].
        stiffness: Stiffness of the hinge of the pseudo-rigid body [N m/rad].
        hinge_offset: Distance of that hinge from the clamp [m].
        length: Length of the link [m].
        radius: Radius of the link [m].
        wall_thickness: Wall thickness [m].
        pressure: Gauge pressure [Pa].
        poisson_ratio: Poisson ratio of the wall [-].

    Returns:
        The figure.

    Raises:
        ParameterError: If an argument is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    offset = positive_number("hinge_offset", hinge_offset, "m")
    if offset >= positive_number("length", length, "m"):
        raise ParameterError("hinge_offset", hinge_offset, f"below the length of the link, {length} m")
    tube = {"length": length, "radius": radius, "wall_thickness": wall_thickness, "poisson_ratio": poisson_ratio}
    tube["pressure"] = pressure
    modulus = inflated_beam.young_modulus_from_stiffness(stiffness, **tube)
    x = np.linspace(0.0, length, 121)
    beam = inflated_beam.deflection(x, finite_number("force", force, "N"), young_modulus=modulus, **tube)
    sizes = {"pressure": pressure, "radius": radius, "wall_thickness": wall_thickness}
    curvature = force / inflated_beam.beam_stiffness(modulus, **sizes).bending
    bending = curvature * (length * x**2 / 2.0 - x**3 / 6.0)
    printed = beam + curvature * x**3 / 3.0
    rigid = force * (length - offset) / stiffness * np.maximum(x - offset, 0.0)
    title = f"An inflated link under {force:g} N at its end, {pressure / 1e3:g} kPa"
    figure, axes = new_plot((WIDTH, 4.4), xlabel="distance from the clamp [mm]", ylabel="deflection [mm]", title=title)
    lines = (
        (beam, "beam (1), sign corrected"),
        (bending, "the same without shear"),
        (rigid, f"pseudo-rigid body, hinge at {1e3 * offset:g} mm"),
        (printed, "(1) as printed"),
    )
    for number, (line, label) in enumerate(lines):
        axes.plot(1e3 * x, 1e3 * line, markevery=20, label=label, **line_style(number))
    axes.legend(fontsize=9)
    return figure


def moment_angle_laws(rows: Sequence[CharacterisationRow], radius: float) -> Any:
    """The laws `min(k angle, M_max)` of characterised links with their wrinkling moments, one line a pressure.

    Args:
        rows: What was measured, e.g. `inflated_beam.TABLE_3`; one without a largest moment is drawn up to its wrinkling moment.
        radius: Radius of the link [m].

    Returns:
        The figure.

    Raises:
        ParameterError: If there are no rows, or a number is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    _check_rows(rows)
    limits = [inflated_beam.wrinkling_moment(row.pressure, radius) for row in rows]
    tops = [limit if row.max_moment is None else row.max_moment for row, limit in zip(rows, limits, strict=True)]
    last = 1.25 * max(top / row.stiffness for row, top in zip(rows, tops, strict=True))
    title = "Moment-angle law of a link by gauge pressure"
    figure, axes = new_plot((WIDTH, 5.0), xlabel="hinge angle [rad]", ylabel="moment at the hinge [N m]", title=title)
    for number, (row, limit, top) in enumerate(zip(rows, limits, tops, strict=True)):
        angles = np.linspace(0.0, last if row.max_moment is not None else limit / row.stiffness, 101)
        moments = inflated_beam.moment(angles, stiffness=row.stiffness, max_moment=top)
        name = f"{row.pressure / 1e3:g} kPa"
        style = line_style(number)
        marker = {"marker": style.pop("marker"), "ms": 7, "color": style["color"], "mec": "black", "ls": ""}
        del style["ms"]
        label = name if row.max_moment is not None else f"{name}, no plateau measured"
        axes.plot(angles, moments, lw=1.8, label=label, **style)
        axes.plot(limit / row.stiffness, limit, **marker)
        axes.annotate(name, (angles[-1], moments[-1]), (-4, 5), textcoords="offset points", ha="right", fontsize=9)
    axes.plot([], [], color="0.6", marker="o", mec="black", ms=7, ls="", label="wrinkling moment (3)")
    axes.set(xlim=(0.0, 1.02 * last), ylim=(0.0, 1.1 * max(tops)))
    axes.legend(fontsize=9, loc="upper left")
    return figure


def pressure_effects(
    rows: Sequence[CharacterisationRow],
    *,
    young_modulus: float,
    length: float,
    radius: float,
    wall_thickness: float,
    poisson_ratio: float = 0.3,
) -> Any:
    """Stiffness and largest moment over pressure: what was measured beside [Troise 2021] (1) and (3).

    The upper bound of the moment is that of a wall that carries no compression at all, `pi p r^3`: the cap force at the lever
    of the radius.

    Args:
        rows: What was measured, e.g. `inflated_beam.TABLE_3`.
        young_modulus: Modulus of the wall, for (1) [Pa].
        length: Length of the link [m].
        radius: Radius of the link [m].
        wall_thickness: Wall thickness [m].
        poisson_ratio: Poisson ratio of the wall [-].

    Returns:
        The figure.

    Raises:
        ParameterError: If there are no rows, or a number is out of range.
        MissingDependency: If matplotlib is not installed.
    """
    _check_rows(rows)
    pressures = np.linspace(0.0, 1.1 * max(row.pressure for row in rows), 56)
    tube = {"length": length, "radius": radius, "wall_thickness": wall_thickness, "poisson_ratio": poisson_ratio}
    stiffness = inflated_beam.stiffness_from_young_modulus(young_modulus, pressure=pressures, **tube)
    limits = inflated_beam.moment_limits(pressures, radius)
    figure = new_figure((WIDTH, 7.6))
    upper, lower = figure.subplots(2, 1)
    measured = np.array([(row.pressure, row.stiffness, row.stiffness_std) for row in rows])
    style = {"ls": "", "marker": MARKERS[0], "color": COLOURS[0], "ms": 6}
    upper.errorbar(1e-3 * measured[:, 0], measured[:, 1], measured[:, 2], capsize=4, label="measured, +- one sigma", **style)
    upper.plot(1e-3 * pressures, stiffness, color=COLOURS[1], label=f"beam (1), E = {young_modulus / 1e6:.4g} MPa")
    mean = float(measured[:, 1].mean())
    upper.axhline(mean, color=_FAINT, ls="--", lw=1.0, label=f"mean, {mean:.2f} N m/rad")
    upper.set(xlabel="gauge pressure [kPa]", ylabel="stiffness [N m/rad]", title="Stiffness hardly depends on pressure")
    upper.set_ylim(0.0, 1.08 * float((measured[:, 1] + measured[:, 2]).max()))
    plateaus = np.array([(row.pressure, row.max_moment) for row in rows if row.max_moment is not None]).reshape(-1, 2)
    lower.plot(1e-3 * pressures, limits.collapse, color=COLOURS[2], ls=LINES[1], label="upper bound, pi p r^3")
    lower.plot(1e-3 * plateaus[:, 0], plateaus[:, 1], label="largest moment, measured", **style)
    lower.plot(1e-3 * pressures, limits.wrinkling, color=COLOURS[1], label="wrinkling moment (3)")
    lower.set(xlabel="gauge pressure [kPa]", ylabel="moment [N m]", title="What a link can carry does")
    for axes in (upper, lower):
        axes.set_xlim(0.0, None)
        grid_and_legend(axes, loc="lower right")
    return figure


def _check_rows(rows: Any) -> None:
    if isinstance(rows, str) or not isinstance(rows, Sequence) or not rows:
        raise ParameterError("rows", rows, "at least one CharacterisationRow")
    for row in rows:
        instance_of("rows", row, CharacterisationRow, "a sequence of CharacterisationRow")
        positive_number("rows: pressure", row.pressure, "Pa")
        positive_number("rows: stiffness", row.stiffness, "N m/rad")
