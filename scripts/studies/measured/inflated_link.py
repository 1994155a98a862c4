"""The bending tests of [Troise 2021], Table 3: stiffness and largest moment of one inflated link at six pressures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.inflated_beam import TABLE_3, moment_limits, stiffness_from_young_modulus, young_modulus_from_stiffness
from softrobots.robots import InflatableArm
from softrobots.view.figures import canvas
from studies.measured.comparison import Comparison, Overview, errors_of, in_percent, rms, table_of

LIMITS = {
    "first slack fibre": "slack",
    "half of the wall slack, (3)": "wrinkling",
    "collapse": "collapse",
}
"""Moments that need no material: by their name, the field of `MomentLimits`."""


def run() -> dict[str, Any]:
    """Predict the moments from pressure and radius, and the stiffness from that at the first pressure."""
    arm = InflatableArm()
    length, radius, wall = arm.link_lengths[0], np.ravel(arm.radius)[0], np.ravel(arm.wall_thickness)[0]
    shape = {"length": length, "radius": float(radius), "wall_thickness": float(wall)}
    modulus = float(young_modulus_from_stiffness(TABLE_3[0].stiffness, pressure=TABLE_3[0].pressure, **shape))
    rows: list[dict[str, Any]] = []
    for row in TABLE_3:
        limits = moment_limits(row.pressure, radius)
        rows.append(
            {
                "pressure_Pa": row.pressure,
                "stiffness": row.stiffness,
                "stiffness_std": row.stiffness_std,
                "stiffness_found": float(stiffness_from_young_modulus(modulus, pressure=row.pressure, **shape)),
                "largest_moment": row.max_moment,
                **{field: float(getattr(limits, field)) for field in LIMITS.values()},
            }
        )
    told = [row for row in rows if row["largest_moment"] is not None]
    largest = [row["largest_moment"] for row in told]
    stiff = np.array([row["stiffness_found"] - row["stiffness"] for row in rows[1:]])
    return {
        "rows": rows,
        "moments": {field: errors_of([row[field] for row in told], largest) for field in LIMITS.values()},
        "stiffness": {
            "modulus_Pa": modulus,
            "rms": rms(stiff),
            "rms_relative": rms(stiff / [row["stiffness"] for row in rows[1:]]),
            "largest": float(np.abs(stiff).max()),
            "in_stds": rms(stiff / [row["stiffness_std"] for row in rows[1:]]),
        },
    }


def table(record: Mapping[str, Any]) -> str:
    """The numbers as Markdown."""
    heads = ["p [kPa]", "largest moment, measured [N m]", *(f"{name} [N m]" for name in LIMITS)]
    heads += ["measured over collapse", "k, measured [N m/rad]", "k, found [N m/rad]"]
    rows = [
        (
            f"{row['pressure_Pa'] / 1e3:.0f}",
            "-" if row["largest_moment"] is None else f"{row['largest_moment']:.2f}",
            *(f"{row[field]:.2f}" for field in LIMITS.values()),
            "-" if row["largest_moment"] is None else f"{row['largest_moment'] / row['collapse']:.2f}",
            f"{row['stiffness']:.1f} ± {row['stiffness_std']:.1f}",
            f"{row['stiffness_found']:.1f}",
        )
        for row in record["rows"]
    ]
    errors = [(name, *in_percent(record["moments"][field])) for name, field in LIMITS.items()]
    stiff = record["stiffness"]
    words = (
        f"Stiffness: with the modulus of the first row, {stiff['modulus_Pa'] / 1e6:.1f} MPa, the other five are predicted to "
        f"{stiff['rms']:.1f} N m/rad ({100.0 * stiff['rms_relative']:.1f} %), which is {stiff['in_stds']:.1f} of the printed "
        f"standard deviations; the worst by {stiff['largest']:.1f} N m/rad."
    )
    second = table_of(["prediction of the largest moment", "least", "most", "root mean square"], errors, words=1)
    return f"{table_of(heads, rows)}\n\n{second}\n\n{words}"


def overview(record: Mapping[str, Any]) -> Overview:
    """The row of the table over all comparisons."""
    collapse = record["moments"]["collapse"]
    return Overview(
        "[inflated link of 0.6 m](#the-inflated-link), bent at 10 to 60 kPa",
        "[Troise 2021](references.md#the-three-papers), Table 3",
        "CC BY 4.0",
        "largest moment, as the collapse of a membrane tube",
        f"{100.0 * collapse['rms']:.0f} %, always too high",
        "nothing",
        "`python scripts/measured.py inflated_link`",
    )


def picture(record: Mapping[str, Any]) -> Any:
    """Moments and stiffness over pressure."""
    figure = canvas.new_figure((4.8, 6.6))
    upper, lower = figure.subplots(2, 1, sharex=True)
    pressures = np.array([row["pressure_Pa"] for row in record["rows"]]) / 1e3
    for number, (name, field) in enumerate(LIMITS.items()):
        style = canvas.line_style(number)
        upper.plot(pressures, [row[field] for row in record["rows"]], color=style["color"], ls=style["ls"], label=name)
    told = [row for row in record["rows"] if row["largest_moment"] is not None]
    measured = [row["largest_moment"] for row in told]
    upper.plot([row["pressure_Pa"] / 1e3 for row in told], measured, "ks", ms=5, label="largest, measured")
    upper.set(ylabel="moment [N m]", ylim=(0.0, None))
    canvas.grid_and_legend(upper)
    found = [row["stiffness_found"] for row in record["rows"]]
    lower.plot(pressures, found, color=canvas.COLOURS[2], label="from the first row")
    values, stds = ([row[key] for row in record["rows"]] for key in ("stiffness", "stiffness_std"))
    lower.errorbar(pressures, values, stds, fmt="ks", ms=5, capsize=3, label="measured")
    lower.set(xlabel="pressure [kPa]", ylabel="stiffness [N m/rad]", ylim=(0.0, 220.0))
    canvas.grid_and_legend(lower, loc="lower left")
    return figure


INFLATED_LINK = Comparison(run, table, picture, overview)
"""The comparison."""
