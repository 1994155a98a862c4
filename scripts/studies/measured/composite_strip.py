"""Strips of composite laminates that weights bend and twist by half of their length: nothing fitted.

A strip is a `PccArm` of short segments without muscles; its springs across the strip are those of the other bending
stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.loader import load_model, with_springs
from softrobots.robots import PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.figures import canvas
from studies.measured.comparison import EXAMPLES, Comparison, Overview, read_numbers, rms, table_of

HEADS = ("Beam", "Turn (deg)", "Direction", "Load (g)", "Displacement (m)")
LENGTH, STATION = 0.55, 0.5
"""Where the weight hangs, and where displacements are read [m]."""
DIRECTIONS = ("towards the clamp", "sideways", "down")


class Laminate(NamedTuple):
    """Stiffness of a strip, as its paper prints it [N, N m^2], and the angles of its fibres as they are called [deg]."""

    name: str
    axial: float
    torsion: float
    flat: float
    edge: float
    coupling: float


LAMINATES = {
    1: Laminate("0/90", 3.7e6, 0.183, 0.707, 276.0, 0.0),
    2: Laminate("45/0", 4.0e6, 0.368, 0.522, 298.0, 0.102),
    3: Laminate("20/70", 3.9e6, 1.18, 0.983, 290.0, 0.0),
}
"""By number; the coupling is of flat bending with twist."""


def measurements() -> FloatArray:
    """Beam, turn [rad], direction, weight [kg] and displacement [m] of each point, shape (73, 5)."""
    return read_numbers(EXAMPLES / "composite_strip" / "displacements.csv", HEADS) * [1.0, math.pi / 180.0, 1.0, 1e-3, 1.0]


def displacements(laminate: Laminate, turn: float, weights: FloatArray, *, pieces: int = 22) -> FloatArray:
    """How far the station moves towards the clamp, sideways and down, shape (weights, 3) [m].

    Where bending and twist are coupled, the flat stiffness is that of a strip that may twist, `EI - c^2 / GJ`; the twist itself
    is left out.

    Args:
        laminate: Of the strip.
        turn: About its axis at the clamp; at zero it lies flat [rad].
        weights: At its end [kg].
        pieces: Segments, each with one hinge of three springs.
    """
    flat = laminate.flat - laminate.coupling**2 / laminate.torsion
    strip = PccArm(
        segment_lengths=(LENGTH / pieces,) * pieces,
        offset=0.0,
        muscle_azimuths=(),
        bending_stiffness=flat,
        torsional_stiffness=laminate.torsion,
        axial_stiffness=laminate.axial,
        chain="lumped",
        hinges=1,
    )
    model = load_model(strip)  # its own weight is not told, and left out: no gravity below
    across = {name: k * laminate.edge / flat for name, (k, _) in model.spring_table.items() if name.endswith("_x")}
    model = with_springs(model, across)
    down = np.array([-math.cos(turn), -math.sin(turn), 0.0])  # in the axes of the strip, along z
    axes = np.stack([[0.0, 0.0, -1.0], [-math.sin(turn), math.cos(turn), 0.0], down])
    ends = np.linspace(0.0, LENGTH, pieces + 1)
    frames = [model.pinocchio.getFrameId(f"segment_{number + 1}") for number in range(pieces)]
    data, found = model.pinocchio.createData(), []
    for weight in weights:
        solved = solve_equilibrium(model, (), -weight * EARTH_GRAVITY[2] * down)
        pin.framesForwardKinematics(model.pinocchio, data, solved.q)
        places = np.array([np.zeros(3), *(data.oMf[frame].translation for frame in frames)])
        place = np.array([np.interp(STATION, ends, column) for column in places.T])
        found.append(axes @ (place - [0.0, 0.0, STATION]))
    return np.array(found)


def run() -> dict[str, Any]:
    """Predict every point."""
    points, series = measurements(), []
    for beam, turn in np.unique(points[:, :2], axis=0):
        rows = points[(points[:, :2] == (beam, turn)).all(axis=1)]
        weights = np.unique(rows[:, 3])
        moved = displacements(LAMINATES[int(beam)], float(turn), weights)
        found = moved[np.searchsorted(weights, rows[:, 3]), rows[:, 2].astype(int) - 1]
        modelled = rows[:, 2] != 2 if LAMINATES[int(beam)].coupling else np.full(len(rows), True)
        series.append(
            {
                "beam": int(beam),
                "turn_deg": round(math.degrees(turn)),
                "points": rows[:, 2:].tolist(),
                "found_m": found.tolist(),
                "rms_m": rms((found - rows[:, 4])[modelled]),
            }
        )
    errors = [
        one - point[2]
        for row in series
        for one, point in zip(row["found_m"], row["points"], strict=True)
        if not (LAMINATES[row["beam"]].coupling and point[0] == 2)
    ]
    return {"series": series, "points": len(errors), "rms_m": rms(errors), "largest_m": float(np.abs(errors).max())}


def _largest(row: Mapping[str, Any], direction: int) -> tuple[float, float]:
    """Measured and found at the heaviest weight [mm]; zeros where the source draws none."""
    pairs = [(1e3 * p[2], 1e3 * f) for p, f in zip(row["points"], row["found_m"], strict=True) if p[0] == direction]
    return pairs[-1] if pairs else (0.0, 0.0)


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    heads = ["laminate", "turned [deg]", "largest weight [g]"]
    for name in reversed(DIRECTIONS):
        heads += [f"{name}, measured [mm]", "found"]
    rows = []
    for row in record["series"]:
        laminate = LAMINATES[row["beam"]]
        cells = []
        for direction in (3, 2, 1):
            measured, found = _largest(row, direction)
            cells += [f"{measured:.0f}", "-" if direction == 2 and laminate.coupling else f"{found:.0f}"]
        heaviest = max(point[1] for point in row["points"])
        rows.append((laminate.name, f"{row['turn_deg']}", f"{1e3 * heaviest:.0f}", *cells, f"{1e3 * row['rms_m']:.1f}"))
    return (
        f"{table_of([*heads, 'error of all weights, rms [mm]'], rows)}\n\n"
        f"All {record['points']} displacements that the model has are predicted to {1e3 * record['rms_m']:.1f} mm root mean "
        f"square, {1e3 * record['largest_m']:.1f} mm at worst."
    )


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    furthest = max(point[2] for row in record["series"] for point in row["points"])
    return Overview(
        "[strips of laminate, 0.55 m](#strips-of-laminate), bent and twisted by weights",
        "[Minguet and Dugundji 1990](references.md#measurements), five strips",
        "MIT (the code that holds them)",
        "displacements in three directions by the weights",
        f"{1e3 * record['rms_m']:.1f} mm of up to {1e3 * furthest:.0f} mm",
        "nothing",
        "`python scripts/measured.py composite_strip`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Displacements over weight, a panel a strip."""
    figure = canvas.new_figure((6.4, 8.4))
    panels = figure.subplots(3, 2, sharex=True, sharey=True)
    styles = {direction: canvas.line_style(number) for number, direction in enumerate((3, 2, 1))}
    for row in record["series"]:
        laminate, points = LAMINATES[row["beam"]], np.array(row["points"])
        axes = panels[row["beam"] - 1, row["turn_deg"] // 45]
        weights = np.linspace(0.0, points[:, 1].max(), 9)
        curves = displacements(laminate, math.radians(row["turn_deg"]), weights)
        for direction, style in styles.items():
            chosen = points[points[:, 0] == direction]
            axes.plot(1e3 * chosen[:, 1], 1e3 * chosen[:, 2], color=style["color"], marker=style["marker"], ls="")
            if len(chosen) and not (laminate.coupling and direction == 2):
                axes.plot(1e3 * weights, 1e3 * curves[:, direction - 1], color=style["color"], ls=style["ls"])
        axes.set_title(f"{laminate.name}, {'flat' if row['turn_deg'] == 0 else 'turned by 45 deg'}", fontsize=10)
        axes.grid(alpha=0.3)
    for direction, style in styles.items():
        panels[1, 1].plot([], [], color=style["color"], ls=style["ls"], marker=style["marker"], label=DIRECTIONS[direction - 1])
    panels[1, 1].legend(loc="center")
    panels[1, 1].set_axis_off()
    for axes in panels[:, 0]:
        axes.set_ylabel("displacement [mm]")
    for axes in panels[2]:
        axes.set_xlabel("weight [g]")
    figure.suptitle("Markers: measured\nLines: a strip with the printed stiffness, nothing fitted", fontsize=10)
    return figure


COMPOSITE_STRIP = Comparison(run, table, picture, overview)
"""The comparison."""
