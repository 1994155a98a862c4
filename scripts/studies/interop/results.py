"""Results of the comparison: read and written as JSON, and put into the documentation."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import softrobots as sr
from softrobots.core.files import write_text
from softrobots.core.json_text import read_json
from softrobots.view.figures import canvas
from studies.interop.kinematics import KinematicsRow
from studies.interop.measurement import POSES, ROBOTS, Results
from studies.interop.pictures import figure
from studies.interop.simulators import SIMULATORS, EquilibriumRow
from studies.interop.tables import document
from studies.interop.tools import TOOLS
from studies.shared.markdown import marked

BEGIN, END = "<!-- interoperability:begin -->", "<!-- interoperability:end -->"
"""The lines of the page between which the tables stand."""
PAGE = "docs/other_tools.md"
LARGEST_FILE = 10_000_000
"""Bytes of a file of results."""
KEYS = {
    "springs": {"tool", "robot", "format", "read", "of"},
    "equilibrium": {"agrees", *(field.name for field in dataclasses.fields(EquilibriumRow))},
    "kinematics": {"agrees", *(field.name for field in dataclasses.fields(KinematicsRow))},
}
"""What each row of the results holds."""


def page_with(text: str, results: Results) -> str:
    """The text of the page with the tables of the results between its two marks.

    Args:
        text: The page.
        results: The results.

    Raises:
        FileFormatError: If it does not have each mark once, in order.
    """
    return marked(text, PAGE, BEGIN, END, document(results))


def read_results(path: Path) -> Results:
    """Read saved results.

    Raises:
        FileFormatError: If the file cannot be read or holds something else.
    """
    results: Results = read_json(path, LARGEST_FILE)
    parts = {part: results.get(part) for part in KEYS} if isinstance(results, dict) else {}
    rows = [(part, row) for part, some in parts.items() if isinstance(some, list) for row in some]
    lists = [some for some in parts.values() if isinstance(some, list)]
    if len(lists) != len(KEYS) or not all(isinstance(row, dict) and row.keys() >= KEYS[part] for part, row in rows):
        raise sr.FileFormatError(f"{path} holds no results of this script")
    return results


def write_docs(results: Results, checkout: Path) -> list[Path]:
    """Write results, picture and tables into a checkout; return the files."""
    tools = {row["tool"] for row in results["equilibrium"]}, {row["tool"] for row in results["kinematics"]}
    cases = {(row["robot"], row["pose"], row["gravity"]) for row in results["equilibrium"]}
    simulated = all(row["simulated_difference"] is not None for row in results["equilibrium"])
    if tools != (set(SIMULATORS), set(TOOLS)) or len(cases) != 2 * POSES * len(ROBOTS) or not simulated:
        raise sr.ParameterError("--docs", str(checkout), "given for results of all tools, robots and poses, simulated")
    try:
        page = (checkout / PAGE).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise sr.FileFormatError(f"cannot read {checkout / PAGE}: {error}") from error
    updated, drawing = page_with(page, results), figure(results)
    files = [write_text(checkout / "docs" / "interoperability.json", as_json(results), overwrite=True)]
    files.append(canvas.write_png(drawing, checkout / "docs" / "images" / "interoperability.png", overwrite=True))
    files.append(write_text(checkout / PAGE, updated, overwrite=True))
    return files


def as_json(results: Results) -> str:
    """The results as JSON text."""
    return json.dumps(results, indent=1) + "\n"
