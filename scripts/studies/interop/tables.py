"""The results as Markdown tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from studies.interop.measurement import ROBOTS, Results
from studies.interop.simulators import SIMULATORS
from studies.interop.springs_read import FORMATS
from studies.shared.markdown import line


def springs_table(results: Results) -> str:
    """Format as Markdown which files bring springs into which simulator, and what it gets instead."""
    lines = [line(["tool", *(f"springs from {name}" for name in FORMATS), "what it gets here, and how it simulates"])]
    lines.append("|" + "---|" * (len(FORMATS) + 2))
    for tool, version in _versions(results["equilibrium"]).items():
        cells = [f"{tool} {version}", *(_springs(results, tool, name) for name in FORMATS)]
        lines.append(line([*cells, f"{SIMULATORS[tool].how}; {SIMULATORS[tool].simulated}"]))
    return "\n".join(lines)


def equilibrium_table(results: Results) -> str:
    """Format the equilibria as Markdown: a line a robot with the largest difference in each tool."""
    rows = results["equilibrium"]
    titles, keys = [], []
    for tool in _versions(rows):
        for key, text in (("static", "forces balance"), ("simulated", "simulated")):
            if any(row["tool"] == tool and row[f"{key}_difference"] is not None for row in rows):
                titles.append(f"{tool}, {text}")
                keys.append((tool, key))
    lines = [line(["", *titles]), "|---|" + "---:|" * len(titles)]
    for robot in (name for name in ROBOTS if any(row["robot"] == name for row in rows)):
        mine = [[row for row in rows if (row["tool"], row["robot"]) == (tool, robot)] for tool, _ in keys]
        cells = [
            "failed" if any(row["problem"] for row in some) else _largest(row[f"{key}_difference"] for row in some)
            for some, (_, key) in zip(mine, keys, strict=True)
        ]
        lines.append(line([ROBOTS[robot], *cells]))
    allowed = [_power(getattr(SIMULATORS[tool], f"{key}_tolerance")) for tool, key in keys]
    return "\n".join([*lines, line(["allowed", *allowed])])


def kinematics_table(results: Results) -> str:
    """Format the kinematics as Markdown: a line a tool, the largest errors of all files."""
    lines = [
        "| tool | URDF files | links found | position off by [m] | rotation off by [rad] | allowed |",
        "|---|---|---|---:|---:|---:|",
    ]
    for tool, version in _versions(results["kinematics"]).items():
        rows = [row for row in results["kinematics"] if row["tool"] == tool]
        read = [row for row in rows if not row["problem"]]
        kept, links = sum(row["links"] for row in rows), sum(row["links"] + len(row["lost_links"]) for row in rows)
        cells = [f"{tool} {version}", f"{len(read)} of {len(rows)}", "all" if kept == links else f"{kept} of {links}"]
        cells += [_largest(row[key] for row in read) for key in ("position_error", "rotation_error")]
        lines.append(line([*cells, _power(rows[0]["precision"])]))
    return "\n".join(lines)


def document(results: Results) -> str:
    """Everything that the page shows of the results."""
    cases = len({(row["robot"], row["pose"], row["gravity"]) for row in results["equilibrium"]})
    parts = []
    if results["equilibrium"]:
        parts += [
            "Joint springs that arrive in a simulator, by file format (joints are displaced, those that push back counted;\n"
            "`-`: it does not load such a file of ours):",
            springs_table(results),
            f"Largest difference of a joint from Pinocchio's equilibrium [rad or m], over {cases} cases of pose and load:",
            equilibrium_table(results),
        ]
    if results["kinematics"]:
        parts += [
            "Links against Pinocchio, over all files in `urdf/`, 20 random configurations each:",
            kinematics_table(results),
        ]
    return "\n\n".join(parts)


def _versions(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Version of each tool, in order."""
    return {row["tool"]: row["version"] for row in rows}


def _springs(results: Results, tool: str, name: str) -> str:
    rows = [row for row in results["springs"] if (row["tool"], row["format"]) == (tool, name)]
    read = [row["read"] for row in rows if row["read"] is not None]
    if not read:
        return "-"
    count, of = sum(read), sum(row["of"] for row in rows)
    return "none" if count == 0 else "all" if count == of else f"{count} of {of}"


def _largest(values: Any) -> str:
    largest = max((value for value in values if value is not None), default=None)
    return "-" if largest is None else _power(largest)


def _power(value: float) -> str:
    return f"{value:.0e}".replace("e-0", "e-") if value > 0.0 else "0"
