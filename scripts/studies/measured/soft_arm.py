"""A hanging silicone arm that six chambers bend by their pressures: nothing fitted.

The arm is a `PccArm` of short tapered segments with three chambers each, whose stiffness follows from the section and the
shear modulus that the source quotes for the silicone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.loader import load_model
from softrobots.robots import PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.figures import canvas
from studies.measured.comparison import EXAMPLES, Comparison, Overview, read_numbers, rms, table_of

HEADS = ("timestamp", "x", "y", "z", *(f"q_{n}" for n in range(4)), *(f"p_{n}" for n in range(6)))
DIAMETERS = (0.035, 0.028, 0.0198)
"""Of the half discs that the chambers are, at the base, between the segments and at the tip [m]."""
SEGMENT, CONNECTOR = 0.125, 0.02
"""Length of a segment and of the stiff piece at its end [m]."""
MASSES = ((0.160, 0.020), (0.082, 0.023))
"""Of each segment and the piece at its end [kg]."""
WALL = 0.002
"""Of the chambers [m]."""
SHEAR_MODULUS = 85e3
"""Of the silicone, as the source quotes it from the literature [Pa]."""
PUSHES = (0.0, -2.0 * math.pi / 3.0, 2.0 * math.pi / 3.0)
"""Azimuths towards which the chambers of a segment push the tip, from the directions of the records [rad]."""
SEGMENTS = ("upper", "lower")


class Section(NamedTuple):
    """Of one chamber, its area and the distance of its centroid from the axis; of the silicone, its area and second moment."""

    chamber: float
    distance: float
    silicone: float
    second_moment: float


def section(radius: float) -> Section:
    """A triangle with a half disc on each side, each with a chamber `WALL` thick all around [m, m^2, m^4].

    Args:
        radius: Of the half discs, half a side of the triangle [m].
    """
    inner, height = radius - WALL, radius / math.sqrt(3.0)  # height: of the side over the axis
    whole, hollow = math.pi * radius**2 / 2.0, math.pi * inner**2 / 2.0 - 2.0 * inner * WALL
    first = 2.0 * inner**3 / 3.0 - inner * WALL**2
    polar = math.pi * radius**4 / 4.0 + 4.0 * height * radius**3 / 3.0 + height**2 * whole
    own = math.pi * inner**4 / 4.0 - 2.0 * inner * WALL * (inner**2 + WALL**2) / 3.0
    polar -= own + 2.0 * height * first + height**2 * hollow
    triangle = math.sqrt(3.0) * radius**2
    return Section(
        hollow, height + first / hollow, triangle + 3.0 * (whole - hollow), radius**4 / math.sqrt(12.0) + 1.5 * polar
    )


def arm(shear_modulus: float = SHEAR_MODULUS, *, pieces: int = 4) -> PccArm:
    """The arm along z.

    Bending stiffness is `4 G I`, as the source has it: rubber that does not change its volume and that fibres hold around.

    Args:
        shear_modulus: Of the silicone [Pa].
        pieces: Of a segment; a fifth one is the stiff piece at its end.
    """
    lengths, areas, distances, stiffness, densities = [], [], [], [], []
    for (mass, end), wide, narrow in zip(MASSES, DIAMETERS, DIAMETERS[1:], strict=False):
        shares = (np.arange(pieces) + 0.5) / pieces
        sections = [section((wide + (narrow - wide) * share) / 2.0) for share in shares]
        volume = sum(one.silicone for one in sections)
        lengths += [SEGMENT / pieces] * pieces + [CONNECTOR]
        areas += [one.chamber for one in sections] + [1e-9]
        distances += [one.distance for one in sections] + [0.01]
        stiffness += [4.0 * shear_modulus * one.second_moment for one in sections] + [100.0]
        densities += [mass * one.silicone / volume * pieces / SEGMENT for one in sections] + [end / CONNECTOR]
    return PccArm(
        segment_lengths=lengths,
        offset=0.0,
        muscle_azimuths=[math.pi + azimuth for azimuth in PUSHES],
        muscle_distance=distances,
        muscle_area=areas,
        kind="pressure",
        bending_stiffness=stiffness,
        torsional_stiffness=[0.7 * value for value in stiffness],  # nothing here twists it
        axial_stiffness=1e5,  # the lengths are those of the arm under pressure
        linear_density=densities,
        chain="lumped",
        hinges=1,
    )


def poses(pressures: FloatArray, shear_modulus: float = SHEAR_MODULUS, *, pieces: int = 4) -> FloatArray:
    """Bend of both segments [rad] and place of the tip, z down [m], under pressures, shape (n, 5).

    Args:
        pressures: Of the three chambers of the upper and of the lower segment, shape (n, 6) [Pa].
        shear_modulus: Of the silicone [Pa].
        pieces: As for `arm`.
    """
    model, found = load_model(arm(shear_modulus, pieces=pieces)), []
    frames = [
        model.pinocchio.getFrameId(f"segment_{number}") for number in (pieces, pieces + 1, 2 * pieces + 1, 2 * pieces + 2)
    ]
    data, down = model.pinocchio.createData(), (0.0, 0.0, -EARTH_GRAVITY[2])  # it hangs
    for upper, lower in np.reshape(pressures, (-1, 2, 3)):
        given = [*np.tile(upper, pieces), *np.zeros(3), *np.tile(lower, pieces), *np.zeros(3)]
        solved = solve_equilibrium(model, given, gravity=down)
        pin.framesForwardKinematics(model.pinocchio, data, solved.q)
        axes = [np.array([0.0, 0.0, 1.0]), *(data.oMf[frame].rotation[:, 2] for frame in frames)]
        bends = [math.acos(min(1.0, float(axes[end] @ axes[end - 1]))) for end in (1, 3)]
        found.append([*bends, *data.oMf[frames[-1]].translation])
    return np.array(found)


def measurements() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Times [s], shape (n,), pressures [Pa], (n, 6), and what `poses` gives, as measured, (n, 5)."""
    rows = read_numbers(EXAMPLES / "soft_arm" / "records.csv", HEADS)
    bends = np.hypot(rows[:, 4:8:2], rows[:, 5:8:2])
    return rows[:, 0], 100.0 * rows[:, 8:], np.hstack([bends, rows[:, 1:4] * [1.0, 1.0, -1.0]])


def run() -> dict[str, Any]:
    """Predict every record, and find the modulus that would fit all bends best."""
    from scipy.optimize import minimize_scalar

    times, pressures, measured = measurements()
    found = poses(pressures)

    def misses(log_modulus: float) -> float:
        return rms((poses(pressures, math.exp(log_modulus)) - measured)[:, :2])

    fit = minimize_scalar(misses, bracket=(math.log(80e3), math.log(90e3)), options={"xtol": 1e-4})
    return {
        "times_s": times.tolist(),
        "pressures_Pa": pressures.tolist(),
        "measured": measured.tolist(),
        "found": found.tolist(),
        "bends_rad": [rms((found - measured)[:, number]) for number in (0, 1)],
        "tip_m": rms(np.linalg.norm((found - measured)[:, 2:], axis=1)),
        "best_modulus_Pa": math.exp(fit.x),
        "best_rad": float(fit.fun),
    }


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    heads = ["time [s]", "chambers, upper [mbar]", "chambers, lower [mbar]"]
    for name in ("upper bend [rad]", "lower bend [rad]", "tip aside [mm]", "its azimuth [deg]", "tip down [mm]"):
        heads += [f"{name}, measured", "found"]
    rows = []
    for time, pressures, *pair in list(
        zip(*(record[key] for key in ("times_s", "pressures_Pa", "measured", "found")), strict=True)
    )[::3]:
        bars = [f"{value / 100.0:.0f}" for value in pressures]
        cells = [[f"{p[0]:.2f}", f"{p[1]:.2f}", f"{1e3 * math.hypot(p[2], p[3]):.0f}"] for p in pair]
        for cell, p in zip(cells, pair, strict=True):
            cell += [f"{math.degrees(math.atan2(p[3], p[2])):.0f}", f"{1e3 * p[4]:.0f}"]
        both = [value for values in zip(*cells, strict=True) for value in values]
        rows.append((f"{time:.0f}", ", ".join(bars[:3]), ", ".join(bars[3:]), *both))
    upper, lower = record["bends_rad"]
    return (
        f"Every third of the {len(record['found'])} records:\n\n{table_of(heads, rows, words=3)}\n\n"
        f"Root mean square of all: upper bend {upper:.2f} rad, lower bend {lower:.2f} rad, tip {1e3 * record['tip_m']:.0f} mm. "
        f"A shear modulus fitted to all bends would be {1e-3 * record['best_modulus_Pa']:.0f} kPa, and leave "
        f"{record['best_rad']:.2f} rad."
    )


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    (upper, lower), most = record["bends_rad"], np.max(np.array(record["measured"])[:, :2], axis=0)
    return Overview(
        "[silicone arm of two segments, 0.29 m](#a-silicone-arm-under-pressure), bent by the pressures of six chambers",
        f"[3d-soft-trunk](references.md#measurements), {len(record['found'])} records",
        "none stated; numbers quoted",
        "bends of both segments, place of the tip",
        f"{upper:.2f} of up to {most[0]:.2f} rad, {lower:.2f} of up to {most[1]:.2f} rad; "
        f"at the tip {1e3 * record['tip_m']:.0f} mm",
        "nothing; where chambers push is read from the records",
        "`python scripts/measured.py soft_arm`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Bends over time, and the way of the tip in the horizontal plane."""
    figure = canvas.new_figure((4.8, 6.4))
    bends, way = figure.subplots(2, 1, height_ratios=(4, 3))
    times, measured, found = (np.array(record[key]) for key in ("times_s", "measured", "found"))
    for number, name in enumerate(SEGMENTS):
        style = canvas.line_style(number)
        bends.plot(times, found[:, number], color=style["color"], ls=style["ls"])
        bends.plot(times, measured[:, number], color=style["color"], marker=style["marker"], ls="", label=f"{name} segment")
    bends.set(xlabel="time [s]", ylabel="bend [rad]", ylim=(0.0, None))
    canvas.grid_and_legend(bends)
    way.plot(*(1e3 * found[:, 2:4].T), color=canvas.COLOURS[2], label="tip, found")
    way.plot(*(1e3 * measured[:, 2:4].T), "ks", ms=4, label="tip, measured")
    way.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    canvas.grid_and_legend(way, loc="lower center")
    figure.suptitle("Markers: measured\nLines: found from the pressures, nothing fitted", fontsize=10)
    return figure


SOFT_ARM = Comparison(run, table, picture, overview)
"""The comparison."""
