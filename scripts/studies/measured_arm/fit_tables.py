"""The results of a fit as Markdown tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from studies.measured_arm.tables import millimetres
from studies.shared.markdown import line

PUBLISHED = ("the source's simulator, calibrated to train (quoted)", "6.68", "9.39", "-", "-")
NAMES = {"train": "train", "val": "validation"}


def fit_table(record: Mapping[str, Any]) -> str:
    """All tables of a run of scripts/measured_arm_fit.py."""
    return "\n\n".join([_errors(record), _families(record), _values(record)])


def compared_table(record: Mapping[str, Any]) -> str:
    """Errors on families of movements that a fit has not seen."""
    families = list(next(iter(record["sets"].values()))["errors_m"])
    lines = ["### Families of train left out in turn: error on the one left out [mm]", ""]
    lines += [line(["fitted", "parameters", *families, "all rows"]), "|---" + "|---:" * (len(families) + 2) + "|"]
    for name, row in record["sets"].items():
        cells = [millimetres(row["errors_m"][family]) for family in families]
        lines.append(line([name, row["parameters"], *cells, millimetres(row["rms_m"])]))
    return "\n".join(lines)


def _errors(record: Mapping[str, Any]) -> str:
    sets = record["sets"]
    rows = " and ".join(f"{sets[name]['rows']} rows of {told}" for name, told in NAMES.items())
    lines = [f"### Tip errors after the fit, root mean square of {rows} [mm]", ""]
    lines += [line(["model", "train", "validation", "train, posed", "validation, posed"]), "|---" + "|---:" * 4 + "|"]
    cells = [millimetres(sets[name][key]) for key in ("offset_m", "posed_m") for name in NAMES]
    lines += [line([f"fitted, {record['n_parameters']} parameters", *cells]), line(PUBLISHED)]
    seconds = f"{record['wall_s']:.0f} s ({record['cpu_s']:.0f} s of one core)"
    end = f"The fit: {record['message']}, {record['steps']} steps, {seconds}, the prediction of validation included."
    told = [f"- {text}" for text in record["unidentifiable"]]
    return "\n".join([*lines, "", end, *(["", "What the rows tell badly:", "", *told] if told else [])])


def _families(record: Mapping[str, Any]) -> str:
    lines = ["### By movement after the fit, posed [mm]", ""]
    lines += [
        line(["movement", "set", "rows", "root mean square", "median", "95 %", "largest"]),
        "|---|---" + "|---:" * 5 + "|",
    ]
    for name, told in NAMES.items():
        for family, row in record["sets"][name]["families"].items():
            cells = [millimetres(row[key]) for key in ("rms_m", "median_m", "p95_m", "largest_m")]
            lines.append(line([family, told, row["rows"], *cells]))
    return "\n".join(lines)


def _values(record: Mapping[str, Any]) -> str:
    lines = [
        "### Fitted values, with standard errors",
        "",
        line(["parameter", "value", "unit", "if rows are independent", "if blocks are"]),
    ]
    lines.append("|---|---:|---" + "|---:" * 2 + "|")
    for name, one in record["values"].items():
        cells = ["-" if one[key] is None else _error(one, one[key]) for key in ("row", "block")]
        lines.append(line([f"`{name}`", f"{one['value']:.4g}", one["unit"], *cells]))
    return "\n".join(lines)


def _error(one: Mapping[str, Any], size: float) -> str:
    if not math.isfinite(size):
        return "-"
    return f"{100.0 * size:.1f} %" if one["logarithmic"] else f"{size:.2g}"
