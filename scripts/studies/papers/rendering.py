"""The comparison as text for a terminal, Markdown, CSV and JSON."""

from __future__ import annotations

import dataclasses
import json
import textwrap
from collections.abc import Mapping, Sequence

from softrobots.core.files import csv_text
from studies.papers.reproduction import PAPERS
from studies.papers.rows import ERRATUM, FITTED, KINDS, Row

Rows = Mapping[str, Sequence[Row]]
"""Rows by the name of their paper, as `reproduce` gives them."""

COLUMNS = ("place", "quantity", "paper", "ours", "difference", "verdict")
"""Columns of the tables, before the note."""

_LINE = 118  # width of a note on the terminal


def text(found: Rows) -> str:
    """The comparison for a terminal: a table a paper, notes below their rows, what the verdicts mean, and the count."""
    parts = []
    for name, rows in found.items():
        cells = [COLUMNS, *(_cells(row) for row in rows)]
        widths = [max(len(line[place]) for line in cells) for place in range(len(COLUMNS))]
        lines = [PAPERS[name].title, "", _line(COLUMNS, widths), "  ".join("-" * width for width in widths)]
        for row, note in zip(rows, _notes(rows, ""), strict=True):
            lines.append(_line(_cells(row), widths))
            lines += textwrap.wrap(note, _LINE, initial_indent="      ", subsequent_indent="      ")
        parts.append("\n".join(lines))
    return "\n\n".join([*parts, legend(), summary(found)])


def markdown(found: Rows) -> str:
    """The comparison as Markdown: a heading and a table a paper, what the verdicts mean, and the count."""
    parts = [summary(found), "\n".join(f"- *{kind}*: {told}" for kind, told in KINDS.items())]
    for name, rows in found.items():
        lines = [f"| {' | '.join((*COLUMNS, 'note'))} |", "|---|---|---:|---:|---:|---|---|"]
        for row, note in zip(rows, _notes(rows, "as above"), strict=True):
            cells = (*_cells(row), note)
            lines.append(f"| {' | '.join(_escaped(cell) for cell in cells)} |")
        parts += [f"### {PAPERS[name].title}", "\n".join(lines)]
    return "\n\n".join(parts)


def csv(found: Rows) -> str:
    """The comparison as CSV, full precision: the paper, the fields of `Row`, and its verdict."""
    names = [field.name for field in dataclasses.fields(Row)]
    lines = [
        [name, *("" if getattr(row, field) is None else getattr(row, field) for field in names), row.verdict]
        for name, rows in found.items()
        for row in rows
    ]
    return csv_text(["paper", *names, "verdict"], lines)


def as_json(found: Rows) -> str:
    """The comparison as JSON: the count by verdict, and the rows of each paper with whether they hold."""
    result = {
        "failed": len(failed(found)),
        "count": count(found),
        "papers": {
            name: [dataclasses.asdict(row) | {"holds": row.holds, "verdict": row.verdict} for row in rows]
            for name, rows in found.items()
        },
    }
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def failed(found: Rows) -> list[Row]:
    """The rows whose claim does not hold."""
    return [row for rows in found.values() for row in rows if not row.holds]


def count(found: Rows) -> dict[str, int]:
    """How many rows there are of each verdict that occurs; of those that were fitted, how many sets of assumptions."""
    rows = [row for rows in found.values() for row in rows]
    verdicts = [row.verdict for row in rows]
    order = dict.fromkeys((*KINDS, *verdicts))
    counted = {verdict: verdicts.count(verdict) for verdict in order if verdict in verdicts}
    sets = {row.assumptions for row in rows if row.verdict == FITTED}
    return counted | ({FITTED: len(sets)} if sets else {})


def legend() -> str:
    """What the verdicts mean, one a line."""
    width = max(map(len, KINDS))
    return "\n".join(f"{kind:<{width}}  {note}" for kind, note in KINDS.items())


def summary(found: Rows) -> str:
    """The count by verdict, in a sentence."""
    total = sum(map(len, found.values()))
    wrong = len(failed(found))
    counted = count(found)
    rows = sum(row.verdict == FITTED for part in found.values() for row in part)
    several = {FITTED: f" ({rows} rows)"} if rows != counted.get(FITTED, rows) else {}
    note = "; ".join(f"{verdict} {number}{several.get(verdict, '')}" for verdict, number in counted.items())
    return f"{total} rows: {note}. " + ("Every claim holds." if wrong == 0 else f"{wrong} DO NOT HOLD.")


def _notes(rows: Sequence[Row], again: str) -> list[str]:
    """The notes of rows; a note that repeats the one before is replaced."""
    before = ["", *(row.note for row in rows)]
    return [again if row.note and row.note == last else row.note for row, last in zip(rows, before, strict=False)]


def _escaped(cell: str) -> str:
    """A cell as Markdown shows it literally."""
    for sign in "|*[":
        cell = cell.replace(sign, f"\\{sign}")
    return cell


def _cells(row: Row) -> tuple[str, ...]:
    """The cells of a row but for its note."""
    unit = f" {row.unit}" if row.unit else ""
    printed = row.printed + (unit if row.printed and row.printed != "equation" and row.printed[0] in "-0123456789>" else "")
    ours = "" if row.ours is None else _number(row.ours, _decimals(row)) + unit
    if row.printed == "equation" and row.kind != ERRATUM:
        ours = "the same" if row.holds else "not the same"
    return row.place, row.quantity, printed, ours, _difference(row), row.verdict


def _difference(row: Row) -> str:
    """The difference; of an equation that holds only its bound, as the rest is rounding and differs between machines."""
    if row.difference is None:
        return ""
    unit = f" {row.unit}" if row.unit else ""
    if row.printed == "equation":
        return f"below {row.tolerance:.0e}{unit}" if row.holds else f"{row.difference:.1e}{unit}"
    decimals = _decimals(row)
    if decimals is None:
        return f"{row.difference:+.3g}{unit}"
    shown = round(row.difference, decimals) + 0.0
    return f"{shown:+.{decimals}f}{unit}" if shown else f"0{unit}"


def _decimals(row: Row) -> int | None:
    """Decimals to show: those of the print where ours is the same, two more otherwise."""
    exact = row.decimals is not None and row.difference is not None and abs(row.difference) < 1e-9
    return row.decimals - 2 if exact and row.decimals is not None else row.decimals


def _number(value: float, decimals: int | None) -> str:
    return f"{value:.5g}" if decimals is None else f"{value:.{decimals}f}"


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Cells side by side, numbers to the right."""
    sides = ("<", "<", ">", ">", ">", "<")
    return "  ".join(f"{cell:{side}{width}}" for cell, side, width in zip(cells, sides, widths, strict=True)).rstrip()
