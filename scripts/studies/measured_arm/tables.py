"""The results as Markdown tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studies.shared.markdown import line


def table(record: Mapping[str, Any]) -> str:
    """All tables of a run of scripts/measured_arm.py."""
    parts = [models(record), equilibria(record), families(record), repeatability(record)]
    if record["sensitivity"]:
        parts.append(sensitivity(record))
    return "\n\n".join(parts)


def millimetres(value: float | None) -> str:
    """A length in millimetres; what there is none of is a dash."""
    return "-" if value is None else f"{1e3 * value:.2f}"


def models(record: Mapping[str, Any]) -> str:
    """Errors by model, train and validation apart."""
    train, val = (record["sets"][name]["rows"] for name in ("train", "val"))
    lines = [f"### Tip errors, root mean square of {train} rows of train and {val} of validation [mm]", ""]
    heads = ["model", "fitted to train for it", "train", "validation", "train, posed", "validation, posed"]
    lines += [line(heads), "|---|---" + "|---:" * 4 + "|"]
    for row in record["models"]:
        cells = [row[name][key] for key in ("offset_m", "posed_m") for name in ("train", "val")]
        lines.append(line([row["model"], row["fitted"], *map(millimetres, cells)]))
    pose = record["pose"]
    moved = ", ".join(f"{1e3 * value:.1f}" for value in pose["translation_m"])
    text = (
        f"*posed*: after the pose of the base, a turn of {pose['angle_deg']:.1f} degrees and a shift of ({moved}) mm. With the "
    )
    text += "frames of cameras and base taken for the same, and no offset subtracted, the elastic tendons have "
    raw = " and ".join(millimetres(record["models"][0][name]["raw_m"]) for name in ("train", "val"))
    return "\n".join([*lines, "", f"{text}{raw} mm."])


def equilibria(record: Mapping[str, Any]) -> str:
    """How many equilibria were found and are stable."""
    texts = []
    for name, told in (("train", "train"), ("val", "validation")):
        count = record["sets"][name]
        share = 100.0 * count["slack_tendons"] / count["tendons"]
        texts.append(
            f"{told}: {count['stable']} of {count['rows']} equilibria certified stable, {share:.0f} % of the tendons slack"
        )
    return "; ".join(texts).capitalize() + "."


def families(record: Mapping[str, Any]) -> str:
    """Errors with the pose of the base by family of movements."""
    lines = ["### By movement, elastic tendons, posed [mm]", ""]
    lines += [
        line(["movement", "set", "rows", "root mean square", "median", "95 %", "largest"]),
        "|---|---" + "|---:" * 5 + "|",
    ]
    for name, told in (("train", "train"), ("val", "validation")):
        for family, row in record["sets"][name]["families"].items():
            cells = [millimetres(row[key]) for key in ("rms_m", "median_m", "p95_m", "largest_m")]
            lines.append(line([family, told, row["rows"], *cells]))
    return "\n".join(lines)


def repeatability(record: Mapping[str, Any]) -> str:
    """The scatter of the robot itself."""
    lines = ["### The robot against itself", ""]
    heads = ["commands within [mm]", "rows that count", "train [mm]", "rows", "validation [mm]", "rows", "both [mm]", "rows"]
    lines += [line(heads), "|---:|---" + "|---:" * 6 + "|"]
    for row in record["repeatability"]:
        cells = [cell for name in ("train", "val", "both") for cell in (millimetres(row[name]["rms_m"]), row[name]["rows"])]
        lines.append(line([f"{1e3 * row['within_m']:.2f}", row["which"], *cells]))
    return "\n".join(lines)


def sensitivity(record: Mapping[str, Any]) -> str:
    """What other assumptions would do."""
    lines = [
        "### Other assumptions, train only [mm]",
        "",
        line(["changed", "to", "root mean square", "posed"]),
        "|---|---|---:|---:|",
    ]
    for row in record["sensitivity"]:
        lines.append(line([row["changed"], row["to"], millimetres(row["offset_m"]), millimetres(row["posed_m"])]))
    return "\n".join(lines)
