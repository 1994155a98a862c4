"""Answers of a command: facts with units, as lines for a person or, with `--json`, as one object for a machine."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.summary import aligned, formatted


class Fact(NamedTuple):
    """One value of an answer."""

    name: str
    """Its name in the library and in JSON."""
    value: Any
    """A number, a truth value, a text, None, or an array of numbers."""
    unit: str = ""
    """Its unit; "-" for a pure number, empty for what is no number."""
    label: str = ""
    """What it is, for a person."""


def attributes(result: Any, **units: str) -> list[Fact]:
    """Return facts with the names and values of attributes of a result, which have these units."""
    return [Fact(name, getattr(result, name), unit) for name, unit in units.items()]


def answer_of(facts: Sequence[Fact]) -> dict[str, Any]:
    """Return the values by name, and under `units` the units of those that have one."""
    return {fact.name: plain(fact.value) for fact in facts} | {"units": {fact.name: fact.unit for fact in facts if fact.unit}}


def lines_of(facts: Sequence[Fact]) -> list[str]:
    """Return one line for each fact: label, value, and unit unless the value is None."""
    units = ["" if fact.value is None else fact.unit.strip("-") for fact in facts]
    return aligned((fact.label, f"{formatted(fact.value)} {unit}".strip()) for fact, unit in zip(facts, units, strict=True))


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add `--json`; see `print_answer`."""
    help_text = "print one JSON object instead of text: names as in the library, SI units and radians; what is infinite is null"
    parser.add_argument("--json", action="store_true", help=help_text)


def print_answer(
    arguments: argparse.Namespace, answer: Mapping[str, Any], lines: str | Iterable[str], files: Sequence[Path] | None = None
) -> None:
    """Print an answer: as JSON if `--json` is given, else as lines.

    Args:
        arguments: Arguments of a parser with `add_json`.
        answer: The answer for a machine; see `plain` for what it may hold.
        lines: The same for a person, or a text of several lines.
        files: The files that were written, for a command that writes some: both forms end with them.
    """
    lines = lines.split("\n") if isinstance(lines, str) else lines
    if files is not None:
        answer, lines = {**answer, "files": files}, [*lines, *written_lines(files)]
    if arguments.json:
        sys.stdout.write(json.dumps(plain(answer), indent=2, allow_nan=False) + "\n")
    else:
        text = "".join(f"{line}\n" for line in lines)
        encoding = sys.stdout.encoding or "utf-8"
        sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding))  # a file name may be any bytes
    sys.stdout.flush()


def plain(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays as nested lists, paths as text, mappings and sequences item by item.

    Infinity becomes None: JSON has no such number.
    """
    if isinstance(value, Mapping):
        return {str(name): plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and math.isinf(value):
        return None
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    return value


def written_lines(files: Sequence[Path]) -> list[str]:
    """Return the last lines of an answer: the files that were written, after an empty line; nothing without files."""
    return ["", *(f"{file}: written" for file in files)] if files else []
