"""Results of a benchmark: a row a comparison, the curves of the pictures, the machine; as JSON and as a table."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from softrobots.core.checks import LARGEST
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.json_text import read_json

AT_LEAST, AT_MOST = "at least", "at most"
_LARGEST_FILE = 1_000_000  # bytes


@dataclass(frozen=True)
class Row:
    """One comparison. Numbers are medians over the rounds; what could not be measured is None, and `skipped` says why."""

    job: str
    """What is done."""
    ours: str
    """By what of ours."""
    baseline: str
    """Against what; empty if against nothing."""
    unit: str
    """What `value` counts: "times cheaper", "times as costly", "s", "bytes"."""
    value: float | None
    """The figure, the median of the ratios of the rounds."""
    low: float | None
    """Its smallest value in a round."""
    high: float | None
    """Its largest."""
    bound: str
    """`AT_LEAST` or `AT_MOST`, where there is a target."""
    target: float | None
    """The target; None: reported only."""
    our_seconds: float | None
    """Our cost of a case [s]."""
    baseline_seconds: float | None
    """The cost of the baseline [s]."""
    clock: str = "CPU"
    """"CPU" or "wall"."""
    skipped: str = ""
    """Why it was not measured; empty if it was."""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None if there is none, or no measurement."""
        if self.target is None or self.value is None:
            return None
        return self.value >= self.target if self.bound == AT_LEAST else self.value <= self.target


@dataclass(frozen=True)
class Curve:
    """Cost over a size."""

    picture: str
    """"sizes" or "batches"."""
    label: str
    """What it is the cost of."""
    sizes: tuple[int, ...]
    """Number of sections, or of cases in a batch."""
    seconds: tuple[float, ...]
    """Cost of a case, medians [s]."""


@dataclass(frozen=True)
class Results:
    """Everything that was measured."""

    machine: dict[str, str]
    """Machine and versions."""
    settings: dict[str, Any]
    """How it was measured."""
    rows: tuple[Row, ...]
    """The comparisons."""
    curves: tuple[Curve, ...] = ()
    """The curves."""
    notes: tuple[str, ...] = ()
    """What was found on the way: the settings of a simulator, where time goes."""


def as_json(results: Results) -> str:
    """The results as JSON text."""
    result = dataclasses.asdict(results)
    for row, written in zip(results.rows, result["rows"], strict=True):
        written["met"] = row.met
    return json.dumps(result, indent=1, allow_nan=False) + "\n"


def read_results(path: Path) -> Results:
    """Read what `as_json` wrote.

    Raises:
        FileFormatError: If the file cannot be read or holds something else.
    """
    read = read_json(path, _LARGEST_FILE)
    try:
        rows = tuple(Row(**{name: value for name, value in row.items() if name != "met"}) for row in read["rows"])
        curves = tuple(Curve(c["picture"], c["label"], tuple(c["sizes"]), tuple(c["seconds"])) for c in read["curves"])
        results = Results(dict(read["machine"]), dict(read["settings"]), rows, curves, tuple(map(str, read["notes"])))
        _check(results)
        return results
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise FileFormatError(f"{path} holds no results of this benchmark") from error


def _check(results: Results) -> None:
    """Refuse what tables and pictures cannot be made of.

    Raises:
        KeyError: If the machine or the number of rounds is not told.
        TypeError: If a figure is no number, or a text is none or has several lines.
        ValueError: If a figure is not finite or beyond `LARGEST`, or a curve has not a cost for every size.
    """
    texts = [results.machine["processor"], results.machine["system"], *results.machine.values()]
    figures = [results.settings["rounds"]]
    for row in results.rows:
        texts += [row.job, row.ours, row.baseline, row.unit, row.bound, row.clock, row.skipped]
        summary = (row.value, row.low, row.high, row.target, row.our_seconds, row.baseline_seconds)
        figures += [number for number in summary if number is not None]
    for curve in results.curves:
        texts += [curve.picture, curve.label]
        figures += [*curve.sizes, *curve.seconds]
        if len(curve.sizes) != len(curve.seconds):
            raise ValueError("a curve has a cost for every size")
    if not all(isinstance(text, str) and text.isprintable() for text in texts):
        raise TypeError("names are texts of one line")
    if not all(abs(figure) <= LARGEST for figure in figures):
        raise ValueError("figures are finite")


def table(rows: Sequence[Row]) -> str:
    """The rows as Markdown: what is compared, both costs, the figure and its target."""
    lines = [f"| {' | '.join(HEAD)}|", "|---|---|---|---:|---:|---:|---:|---|"]
    lines += ["| " + " | ".join(map(_plain, cells(row))) + " |" for row in rows]
    return "\n".join(lines)


HEAD = ("job", "ours", "against", "ours costs", "it costs", "figure", "target", "")
"""What the cells of a row are."""


def cells(row: Row) -> tuple[str, ...]:
    """A row in words: what is compared, both costs, the figure, its target, and whether that is met or why nothing is told."""
    verdict = "" if row.met is None else "met" if row.met else "**missed**"
    costs = (_cost(row.our_seconds), _cost(row.baseline_seconds))
    last = f"skipped: {row.skipped}" if row.skipped else verdict
    return (row.job, row.ours, row.baseline or "-", *costs, _figure(row), _target(row), last)


def _plain(cell: str) -> str:
    """A text that neither ends a cell nor begins an element of HTML."""
    return cell.replace("|", "/").replace("<", "&lt;")


def machine_text(results: Results) -> str:
    """What was measured on: processor, system, versions, in a sentence."""
    named = {name: value for name, value in results.machine.items() if name not in ("processor", "system")}
    text = ", ".join([results.machine["processor"], results.machine["system"], *map(" ".join, named.items())])
    return f"Medians of {results.settings['rounds']} rounds on: {text}."


def require_whole(results: Results, jobs: Sequence[str]) -> None:
    """Refuse results of a part, for what is shown to everybody.

    Raises:
        ParameterError: If jobs were left out, sizes were small, or rows were skipped.
    """
    lacking = [name for name in jobs if name not in results.settings.get("jobs", ())]
    lacking += [f"{row.job} against {row.baseline}" for row in results.rows if row.skipped]
    if lacking or results.settings.get("quick", True):
        text = ", ".join(lacking) or "--quick"
        raise ParameterError("--docs", text, "given for results of the whole benchmark, with every extra installed")


def _cost(seconds: float | None) -> str:
    """A time with three digits and a unit that fits."""
    if seconds is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{_three(seconds / size)} {unit}"
    return f"{_three(seconds / 1e-9)} ns"


def _figure(row: Row) -> str:
    if row.value is None:
        return "-"
    if row.unit == "s":
        return _cost(row.value)
    return f"{_three(row.value)} B" if row.unit == "bytes" else f"{_three(row.value)} {row.unit}"


def _target(row: Row) -> str:
    if row.target is None:
        return ""
    size, unit = 1.0, {"s": " s", "bytes": " B"}.get(row.unit, "x")
    if row.unit == "s" and row.target < 1.0:
        size, unit = (1e-3, " ms") if row.target >= 1e-3 else (1e-6, " us")
    return f"{row.bound} {row.target / size:g}{unit}"


def _three(value: float) -> str:
    """Three significant digits, without exponent."""
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{digits}f}"
