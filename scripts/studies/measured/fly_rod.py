"""A tapered fly rod of glued bamboo that weights bend by a quarter of its length: one modulus, from the lightest weight.

The rod is a `PccArm` of short segments without muscles, whose stiffness follows from the measured hexagonal section.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.loader import load_model
from softrobots.robots import PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.figures import canvas
from studies.measured.comparison import EXAMPLES, Comparison, Overview, read_numbers, rms, table_of

INCH = 0.0254
STATIONS = (0, 10, 20, 30, 40)
"""Where deflections are read, from the tip along the rod [in]."""
LENGTH = 6.167 * 12.0 * INCH
"""Free length, from the handle to the tip [m]."""
DENSITY = 60.0 * 16.018463
"""The source's, as the rod just floats [kg/m^3]."""
AREA, SECOND_MOMENT = math.sqrt(3.0) / 2.0, 5.0 * math.sqrt(3.0) / 144.0
"""Of a hexagon, times the second and the fourth power of its size from flat to flat."""


def measurements() -> tuple[FloatArray, FloatArray]:
    """Weights [kg], shape (5,), and deflections [m] by series, weight and station, shape (4, 5, 5)."""
    heads = ["Series", "Weight (g)", *(f"{station} in" for station in STATIONS)]
    rows = read_numbers(EXAMPLES / "fly_rod" / "deflections.csv", heads)
    return 1e-3 * rows[:5, 1], -INCH * rows[:, 2:].reshape(-1, 5, 5)


def sizes(from_tip: FloatArray) -> FloatArray:
    """Size of the section from flat to flat [m] at distances from the tip [m]."""
    heads = ("Distance from the tip (in)", "Flat to flat (in)")
    places, flats = read_numbers(EXAMPLES / "fly_rod" / "taper.csv", heads).T * INCH
    return np.asarray(np.interp(from_tip, places, flats), dtype=float)


def deflections(young: float, weights: FloatArray, *, pieces: int = 37) -> FloatArray:
    """How far the stations come down under the rod's weight and others at the tip, shape (weights, stations) [m].

    Args:
        young: Modulus of the bamboo [Pa].
        weights: At the tip [kg].
        pieces: Segments, each with one pair of hinges.
    """
    ends = np.linspace(0.0, LENGTH, pieces + 1)
    flats = sizes(LENGTH - (ends[1:] + ends[:-1]) / 2.0)
    rod = PccArm(
        segment_lengths=(LENGTH / pieces,) * pieces,
        offset=0.0,
        muscle_azimuths=(),
        bending_stiffness=tuple(young * SECOND_MOMENT * flats**4),
        axial_stiffness=1e7,
        linear_density=tuple(DENSITY * AREA * flats**2),
        chain="lumped",
        hinges=1,
    )
    model, down = load_model(rod), (EARTH_GRAVITY[2], 0.0, 0.0)  # the rod lies along z
    frames = [model.pinocchio.getFrameId(f"segment_{number + 1}") for number in range(pieces)]
    data, found = model.pinocchio.createData(), []
    for weight in weights:
        solved = solve_equilibrium(model, (), (weight * EARTH_GRAVITY[2], 0.0, 0.0), gravity=down)
        pin.framesForwardKinematics(model.pinocchio, data, solved.q)
        down_by = [0.0, *(-float(data.oMf[frame].translation[0]) for frame in frames)]
        found.append(np.interp(LENGTH - INCH * np.array(STATIONS), ends, down_by))
    return np.array(found)


def run() -> dict[str, Any]:
    """Fit the modulus to the tip under the lightest weight, and predict the rest."""
    from scipy.optimize import root_scalar

    weights, series = measurements()
    by_weight = series[:, 1:] - series[:, :1]  # beyond the rod under its own weight
    measured = by_weight.mean(axis=0)

    def miss(log_young: float) -> float:
        tips = deflections(math.exp(log_young), weights[:2])[:, 0]
        return float(tips[1] - tips[0] - measured[0, 0])

    young = math.exp(root_scalar(miss, x0=math.log(45e9), x1=math.log(50e9), xtol=1e-6).root)
    found = deflections(young, weights)
    moved = found[1:] - found[0]
    errors = moved - measured
    proportional = measured[0, 0] * weights[1:] / weights[1]
    return {
        "young_Pa": young,
        "weights_kg": weights.tolist(),
        "unloaded": {"measured_m": series[:, 0].mean(axis=0).tolist(), "found_m": found[0].tolist()},
        "unloaded_scatter_m": rms(series[:, 0] - series[:, 0].mean(axis=0)),
        "measured_m": measured.tolist(),
        "found_m": moved.tolist(),
        "scatter_m": rms(by_weight - measured),
        "predicted_m": rms(np.delete(errors.ravel(), 0)),
        "largest_m": float(np.abs(errors).max()),
        "tips_m": rms(errors[1:, 0]),
        "proportional_m": proportional.tolist(),
    }


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    heads = ["weight [g]"]
    for station in STATIONS:
        heads += [f"{'tip' if station == 0 else f'{station} in'}, measured", "found"]
    rows: list[tuple[str, ...]] = []
    pairs = [record["unloaded"].values(), *zip(record["measured_m"], record["found_m"], strict=True)]
    for weight, (measured, found) in zip(record["weights_kg"], pairs, strict=True):
        cells = [f"{1e3 * value:.0f}" for pair in zip(measured, found, strict=True) for value in pair]
        last = "-" if weight == 0.0 else f"{1e3 * record['proportional_m'][len(rows) - 1]:.0f}"
        rows.append((f"{1e3 * weight:g}", *cells, last))
    numbers = table_of([*heads, "tip, in proportion"], rows)
    lightest, scatter = 1e3 * record["weights_kg"][1], 1e3 * record["scatter_m"]
    return (
        "Deflections [mm], in the first row by the rod's own weight, below beyond that; mean of four series:\n\n"
        f"{numbers}\n\n"
        f"The modulus, from the tip under {lightest:g} g: {1e-9 * record['young_Pa']:.1f} GPa. The other 19 deflections by the "
        f"weights are predicted to {1e3 * record['predicted_m']:.1f} mm root mean square, {1e3 * record['largest_m']:.1f} mm "
        f"at worst; the tip under the three other weights to {1e3 * record['tips_m']:.1f} mm. The series scatter by "
        f"{scatter:.1f} mm about their mean, those of the unloaded rod by {1e3 * record['unloaded_scatter_m']:.1f} mm."
    )


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    furthest = record["measured_m"][-1][0]
    return Overview(
        "[fly rod of bamboo, 1.9 m](#a-fly-rod-of-bamboo), bent by weights at its tip",
        "[RHex](references.md#measurements), four series",
        "GPL 3 (the code beside it); numbers quoted",
        "deflection by the weights, at five places",
        f"{1e3 * record['predicted_m']:.1f} mm of up to {1e3 * furthest:.0f} mm",
        "one modulus, on one deflection",
        "`python scripts/measured.py fly_rod`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Deflection over weight, by station."""
    figure = canvas.new_figure((4.8, 4.6))
    axes = figure.subplots()
    weights = 1e3 * np.array(record["weights_kg"])
    for number, station in enumerate(STATIONS):
        style = canvas.line_style(number)
        found, measured = (1e3 * np.array([0.0, *np.array(record[key])[:, number]]) for key in ("found_m", "measured_m"))
        name = "tip" if station == 0 else f"{25.4 * station:.0f} mm from it"
        axes.plot(weights, found, color=style["color"], ls=style["ls"])
        axes.plot(weights, measured, color=style["color"], marker=style["marker"], ls="", label=name)
    axes.plot(
        weights, [0.0, *(1e3 * value for value in record["proportional_m"])], color="0.5", lw=1, label="tip, in proportion"
    )
    axes.set(xlabel="weight at the tip [g]", ylabel="deflection by the weight [mm]")
    canvas.grid_and_legend(axes)
    figure.suptitle("Markers: measured\nLines: a tapered rod, one modulus", fontsize=10)
    return figure


FLY_ROD = Comparison(run, table, picture, overview)
"""The comparison."""
