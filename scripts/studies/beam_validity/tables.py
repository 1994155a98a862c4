"""The results as Markdown tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.inflated_beam import TABLE_3
from studies.beam_validity.arm import RIGID
from studies.beam_validity.link import LIMITS, SHOWN
from studies.shared.markdown import line


def table(result: Mapping[str, Any]) -> str:
    """Format the results as Markdown."""
    return "\n\n".join([*link_tables(result["link"]), *arm_tables(result["arm"])])


def link_tables(link: Mapping[str, Any]) -> list[str]:
    """The tables of one link."""
    loads, measured = link["loads_N"], {row.pressure: row.stiffness for row in TABLE_3}
    rows = [row for row in link["rows"] if row["pressure_Pa"] in measured]
    names = list(rows[0]["percent"])
    first = [line(["pressure [kPa]", "k measured", "k by (1) [N m/rad]", "wrinkles at [N]", "tip there [mm]", *names])]
    first.append("|---" * (5 + len(names)) + "|")
    for row in rows:
        force, by = row["wrinkles_at_N"], row["percent"]
        cells = [
            f"{row['pressure_Pa'] / 1e3:g}",
            f"{measured[row['pressure_Pa']]:.1f}",
            f"{row['stiffness_by_1_Nm']:.1f}",
            f"{force:.1f}",
        ]
        cells.append(f"{1e3 * at(force, loads, row['deflection_m']):.1f}")
        first.append(line([*cells, *(" / ".join(signed(at(force, loads, by[name][i])) for i in (0, 1)) for name in names)]))
    second = [
        line(["", *(f"{word} {limit:g} %" for word in ("deflection", "rotation") for limit in LIMITS)]),
        "|---" * 5 + "|",
    ]
    for name, both in row_at(link, SHOWN)["leaves_at_N"].items():
        second.append(
            line([name, *(f"> {loads[-1]:g}" if f is None else f"{f:.0f}" if f else "at once" for one in both for f in one)])
        )
    forces = np.array([[f or 0.0 for both in row["leaves_at_N"].values() for one in both for f in one] for row in link["rows"]])
    apart = float(np.abs(forces - forces[link["rows"].index(row_at(link, SHOWN))]).max())
    text = (
        "One link at the force at which it wrinkles (moment at $l_1$): difference of tip deflection / rotation from the exact "
        f"beam [%]. Modulus of the wall: {link['modulus_Pa'] / 1e6:.1f} MPa."
    )
    return [
        text,
        "\n".join(first),
        f"Force [N] at which a model leaves the exact beam, at {SHOWN / 1e3:g} kPa (at other pressures within {apart:.1f} N):",
        "\n".join(second),
    ]


def signed(number: float) -> str:
    """A number with its sign and one digit; zero has none."""
    text = f"{number:+.1f}"
    return text if float(text) else "0"


def row_at(link: Mapping[str, Any], pressure: float) -> Mapping[str, Any]:
    """The row of a pressure."""
    (found,) = [row for row in link["rows"] if row["pressure_Pa"] == pressure]
    return dict(found)


def at(force: float, loads: Sequence[float], values: Sequence[float]) -> float:
    """A value at a force between those of the map."""
    return float(np.interp(force, loads, values))


def arm_tables(arm: Mapping[str, Any]) -> list[str]:
    """The tables of the arm."""
    text = f"The arm at {arm['pressure_Pa'] / 1e3:g} kPa in {arm['cases']} random postures under random forces below wrinkling"
    parts = []
    for kind, rows in arm["beams"].items():
        lines = [
            line(
                [
                    "against beams that " + kind,
                    "hinges of a link [mm]",
                    "k [N m/rad]",
                    "tip [mm]",
                    "of the deflection [%]",
                    "angle [degrees]",
                ]
            )
        ]
        lines.append("|---" * 6 + "|")
        for name, row in rows.items():
            hinges = arm["hinges"].get(name)
            places = " and ".join(f"{1e3 * place:.0f}" for place in hinges["places_m"]) if hinges else ""
            twist = f", twist {hinges['twist_Nm']:.1f}" if hinges and hinges["twist_Nm"] else ""
            cells = [name, places, f"{hinges['stiffness_Nm']:.1f}{twist}" if hinges else ""]
            for key, unit, digits in (("error_m", 1e3, 1), ("share", 1e2, 1), ("error_rad", 180.0 / math.pi, 2)):
                cells.append(
                    "" if name == RIGID and key == "share" else " / ".join(f"{unit * value:.{digits}f}" for value in row[key])
                )
            lines.append(line(cells))
        parts.append("\n".join(lines))
    return [f"{text}: error of the tip, median / 95 % / largest:", *parts]
