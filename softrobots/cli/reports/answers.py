"""How a command answers: lines for a person, or with `--json` one object for a machine."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def add_json(parser: argparse.ArgumentParser) -> None:
    """Give a parser `--json`; see `tell`."""
    told = "print one JSON object instead of text: names as in the library, SI units and radians; what is infinite is null"
    parser.add_argument("--json", action="store_true", help=told)


def tell(arguments: argparse.Namespace, answer: Mapping[str, Any], lines: Iterable[str]) -> None:
    """Print an answer: as JSON if `--json` is given, else as lines.

    Args:
        arguments: Arguments of a parser that `add_json` has seen.
        answer: The answer for a machine: numbers, texts, truths, None, arrays, paths, and mappings and sequences of them.
        lines: The same for a person.
    """
    if arguments.json:
        sys.stdout.write(json.dumps(plain(answer), indent=2, allow_nan=False) + "\n")
    else:
        text = "".join(f"{line}\n" for line in lines)
        encoding = sys.stdout.encoding or "utf-8"
        sys.stdout.write(text.encode(encoding, "backslashreplace").decode(encoding))  # a file name may be any bytes
    sys.stdout.flush()


def plain(value: Any) -> Any:
    """What JSON can hold of a value: arrays become nested lists, paths texts, mappings and sequences item by item.

    What is infinite becomes None: JSON has no such number.
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
    """What is said at the end of the files that were written; nothing without files."""
    return ["", *(f"{file}: written" for file in files)] if files else []


def aligned(rows: Iterable[tuple[str, ...]], *, indent: str = "", right: Collection[int] = ()) -> list[str]:
    """Lines of a table with aligned columns.

    Args:
        rows: Cells of each row.
        indent: What stands before each line.
        right: Numbers of the columns that are aligned at their right end, from 0.
    """
    kept = list(rows)
    widths = [max(len(row[i]) for row in kept if i < len(row)) for i in range(max(map(len, kept), default=0))]
    columns = [f"{'>' if i in right else '<'}{width}" for i, width in enumerate(widths)]
    return [
        (indent + "  ".join(f"{cell:{column}}" for cell, column in zip(row, columns, strict=False))).rstrip() for row in kept
    ]
