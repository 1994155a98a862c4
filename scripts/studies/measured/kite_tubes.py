"""Tubes of kites, a metre long, bent and twisted at the end: the empirical law of tests, and inflated links that go slack.

A tube is an `InflatableArm` of twenty short links whose motors stand still; each hinge follows the law of a wall that goes
slack. The material is taken from one tube, two numbers; pressure and radius do the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.inflated_beam import beam_stiffness, moment_limits
from softrobots.model.loader import load_model
from softrobots.robots import InflatableArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.view.figures import canvas
from studies.measured.comparison import EXAMPLES, Comparison, Overview, errors_of, in_percent, read_numbers, rms, table_of

BAR = 1e5
DIAMETERS, PRESSURES = (0.16, 0.18), (0.3, 0.4, 0.5)
"""The tubes that the source draws [m], [bar]."""
REFERENCE = (0.16, 0.3)
"""The tube whose stiffness gives the material [m], [bar]."""
LENGTH, LINKS = 1.0, 20
WALL = 1e-4
"""Thickness that the moduli are told for [m]; only their product with it counts."""
SHARES = np.concatenate([np.linspace(0.0, 0.45, 4), np.linspace(0.5, 0.96, 12)])
"""Forces of a curve over `pi p r^3 / L`."""


class Law:
    """The empirical law: 19 constants, pressures in bar, all else in SI units and radians."""

    def __init__(self) -> None:
        numbers = read_numbers(EXAMPLES / "kite_tubes" / "law.csv", ("number", "value"))
        self.c: list[float] = [math.nan, *map(float, numbers[:, 1])]

    def stiffness(self, pressure: float, radius: float) -> float:
        """Force over deflection of the end, for small ones [N/m]."""
        c = self.c
        return (c[5] * radius**5 + c[6]) * pressure + c[7] * radius + c[8]

    def force(self, pressure: float, radius: float, deflection: Any) -> Any:
        """Force at the end [N] at a deflection of it [m]."""
        c = self.c
        most = (c[1] * radius + c[2]) * pressure**2 + c[3] * radius**3 + c[4]
        return most * -np.expm1(-self.stiffness(pressure, radius) / most * np.asarray(deflection))

    def collapse(self, pressure: float, radius: float) -> float:
        """Deflection at which the tube collapses [m]."""
        c = self.c
        return (c[9] * radius**4 + c[10]) * pressure + c[11] * radius**2 + c[12]

    def twisting(self, pressure: float, radius: float) -> float:
        """Moment over angle of the twisted end, for small ones [N m/rad]."""
        c = self.c
        first = (c[13] * radius + c[14]) * pressure + c[15] * radius + c[16]
        return first * (c[17] * radius**4 * math.log(pressure) + c[18] * radius**3 + c[19])


def material(law: Law) -> tuple[float, float]:
    """Moduli of the wall by its thickness, from the small deflections and twists of one tube [Pa].

    Of the deflection only bending is taken, `3 B / L^3`: what the law tells does not separate shear from it.
    """
    diameter, pressure = REFERENCE
    radius = diameter / 2.0
    tension = pressure * BAR * radius / 2.0  # of the wall, P / (2 pi r) [N/m]
    bending = law.stiffness(pressure, radius) * LENGTH**3 / 3.0 / (math.pi * radius**3)
    twisting = law.twisting(pressure, radius) * LENGTH / (2.0 * math.pi * radius**3)
    return (bending - tension) / WALL, (twisting - tension) / WALL


def bent(pressure: float, radius: float, young_modulus: float) -> tuple[FloatArray, FloatArray]:
    """Deflections of the end [m] under rising forces [N]."""
    beam = beam_stiffness(young_modulus, pressure=pressure * BAR, radius=radius, wall_thickness=WALL)
    piece = LENGTH / LINKS
    tube = InflatableArm(
        link_lengths=(piece,) * LINKS,
        hinge_offset=piece / 2.0,
        radius=radius,
        wall_thickness=WALL,
        stiffness=float(beam.bending) / piece,
        pressure=pressure * BAR,
        moment_law="slack_wall",
    )
    model, start, found = load_model(tube), None, []
    forces = SHARES * float(moment_limits(pressure * BAR, radius).collapse) / LENGTH
    for force in forces:
        rest = solve_equilibrium(model, np.zeros(model.n_motors), (0.0, 0.0, -force), q_springs0=start)
        start = rest.q_springs
        found.append(-rest.tip_position[2])
    return np.array(found), forces


def run() -> dict[str, Any]:
    """Predict all tubes."""
    law = Law()
    young, shear = material(law)
    rows = []
    for diameter in DIAMETERS:
        for pressure in PRESSURES:
            radius, last = diameter / 2.0, law.collapse(pressure, diameter / 2.0)
            deflections, forces = bent(pressure, radius, young)
            grid = np.linspace(0.0, last, 101)[1:]
            told = law.force(pressure, radius, grid)
            found = np.interp(grid, deflections, forces)
            beam = beam_stiffness(young, pressure=pressure * BAR, radius=radius, wall_thickness=WALL, shear_modulus=shear)
            rows.append(
                {
                    "diameter_m": diameter,
                    "pressure_bar": pressure,
                    "collapse_m": last,
                    "collapse_law_N": float(told[-1]),
                    "collapse_found_N": float(found[-1]),
                    "membrane_N": float(moment_limits(pressure * BAR, radius).collapse) / LENGTH,
                    "rms_N": rms(found - told),
                    "stiffness_law": law.stiffness(pressure, radius),
                    "stiffness_found": 3.0 * float(beam.bending) / LENGTH**3,
                    "twisting_law": law.twisting(pressure, radius),
                    "twisting_found": float(beam.twisting) / LENGTH,
                    "deflections_m": deflections.tolist(),
                    "forces_N": forces.tolist(),
                }
            )
    others = [row for row in rows if (row["diameter_m"], row["pressure_bar"]) != REFERENCE]

    def apart(found: str, law: str, among: list[dict[str, Any]]) -> dict[str, float]:
        return errors_of([row[found] for row in among], [row[law] for row in among])

    return {
        "rows": rows,
        "wall": {"young_N_per_m": young * WALL, "shear_N_per_m": shear * WALL},
        "curves": rms([row["rms_N"] / row["collapse_law_N"] for row in others]),
        "collapse": apart("collapse_found_N", "collapse_law_N", others),
        "membrane": apart("membrane_N", "collapse_law_N", rows),
        "stiffness": apart("stiffness_found", "stiffness_law", others),
        "twisting": apart("twisting_found", "twisting_law", others),
    }


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    heads = ["diameter [m]", "p [bar]", "collapse at [mm]", "force there, law [N]", "found [N]", "pi p r^3 / L [N]"]
    heads += ["curve, rms [N]", "stiffness, law [N/m]", "found [N/m]", "twisting, law [N m/rad]", "found [N m/rad]"]
    rows = [
        (
            f"{row['diameter_m']:.2f}",
            f"{row['pressure_bar']:.1f}",
            f"{1e3 * row['collapse_m']:.0f}",
            *(f"{row[key]:.1f}" for key in ("collapse_law_N", "collapse_found_N", "membrane_N", "rms_N")),
            *(f"{row[key]:.0f}" for key in ("stiffness_law", "stiffness_found")),
            *(f"{row[key]:.1f}" for key in ("twisting_law", "twisting_found")),
        )
        for row in record["rows"]
    ]
    names = {
        "collapse": "force at the deflection of collapse",
        "membrane": "the same as pi p r^3 / L, nothing fitted, all six",
        "stiffness": "stiffness of small deflections",
        "twisting": "stiffness of small twists",
    }
    errors = [(name, *in_percent(record[key])) for key, name in names.items()]
    wall = record["wall"]
    words = (
        f"The wall, from the first tube: E t = {wall['young_N_per_m'] / 1e3:.0f} kN/m, G t = "
        f"{wall['shear_N_per_m'] / 1e3:.1f} kN/m. The curves of the five other tubes, up to collapse, are met to "
        f"{100.0 * record['curves']:.0f} % of the force at collapse."
    )
    second = table_of(["prediction of the other five tubes", "least", "most", "root mean square"], errors, words=1)
    return f"{table_of(heads, rows)}\n\n{second}\n\n{words}"


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    return Overview(
        "[tubes of kites, 1 m](#tubes-of-kites), bent at 0.3 to 0.5 bar until they collapse",
        "[Breukels 2011](references.md#measurements), his empirical law",
        "MIT (the code that holds it)",
        "force over deflection up to collapse, five tubes",
        f"{100.0 * record['curves']:.0f} % of the force at collapse",
        "one modulus, on a sixth tube",
        "`python scripts/measured.py kite_tubes`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Force over deflection, by diameter and pressure."""
    law, figure = Law(), canvas.new_figure((4.8, 7.4))
    for axes, diameter in zip(figure.subplots(2, 1, sharex=True, sharey=True), DIAMETERS, strict=True):
        rows = [row for row in record["rows"] if row["diameter_m"] == diameter]
        for number, row in enumerate(rows):
            colour, grid = canvas.COLOURS[number], np.linspace(0.0, row["collapse_m"], 60)
            told = law.force(row["pressure_bar"], diameter / 2.0, grid)
            axes.plot(1e3 * grid, told, color=colour, ls="-")
            axes.plot(1e3 * grid[-1], told[-1], color=colour, marker="x", ms=9, mew=2)
            found, label = 1e3 * np.array(row["deflections_m"]), f"{row['pressure_bar']} bar"
            axes.plot(found, row["forces_N"], color=colour, ls=":", marker=canvas.MARKERS[number], ms=4, label=label)
        axes.set(ylabel="force at the end [N]", title=f"diameter {100.0 * diameter:.0f} cm", xlim=(0.0, 150.0))
        canvas.grid_and_legend(axes, loc="lower right")
    figure.axes[-1].set_xlabel("deflection of the end [mm]")
    figure.suptitle("Lines: law of the tests, x where it ends\nMarkers: predicted", fontsize=10)
    return figure


KITE_TUBES = Comparison(run, table, picture, overview)
"""The comparison."""
