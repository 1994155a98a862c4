"""Read columns of numbers from a CSV file by the names in its first line."""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from array import array
from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from softrobots.core.bounded_reading import opened
from softrobots.core.checks import FloatArray
from softrobots.core.errors import FileFormatError

LARGEST_FILE = 100_000_000
"""Maximum number of characters of a file."""

MOST_ROWS = 1_000_000
"""Maximum number of rows of numbers."""

_LONGEST_LINE = 1_000_000  # characters
_OTHER_SIGNS = {";": "semicolons", "\t": "tabs"}
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


class Table(NamedTuple):
    """Columns of a file."""

    columns: tuple[str, ...]
    """Names of the columns."""
    numbers: FloatArray
    """Values, finite or missing (not a number), shape (n_rows, n_columns)."""
    lines: Sequence[int]
    """Line number of the end of each row, from 1."""
    words: dict[str, list[str]]
    """Columns of words by name."""


def read_table(
    path: Path,
    required: Sequence[str],
    optional: Sequence[str] = (),
    *,
    gaps: Container[str] = (),
    words: Sequence[str] = (),
    comments: bool = False,
) -> Table:
    """Read columns of a CSV file by name.

    Other columns and empty lines are ignored. Every other line must have as many cells as the first: one with more or fewer is
    damaged, or has decimal commas.

    Args:
        path: The file, in UTF-8.
        required: Columns that the file must have, each once.
        optional: Columns that the file may have, at most once.
        gaps: Which of these may have cells that are empty or `nan`.
        words: Columns of words that the file must have, each once.
        comments: Ignore lines that begin with `#`, too.

    Returns:
        The columns present, those of `optional` first.

    Raises:
        FileFormatError: If the file cannot be read or is too large, has other signs than commas between cells, lacks a column
            or has it twice, or (naming the line) has a cell that is not a finite number, or more or fewer cells than the first.
    """
    numbers, lines = array("d"), array("q")
    with opened(path) as file, io.TextIOWrapper(file, encoding="utf-8-sig", newline="") as text:
        reader = csv.reader(_lines(path, text, comments), skipinitialspace=True)
        try:
            names = [name.strip() for name in next((cells for cells in reader if cells or not comments), [])]
            columns = _columns(f"{path}, line {max(reader.line_num, 1)}", names, (*required, *words), optional)
            columns = columns[: len(columns) - len(words)]
            places = [(names.index(name), name in gaps) for name in columns]
            texts = {name: (names.index(name), list[str]()) for name in words}
            for cells in reader:
                if not any(cell.strip() for cell in cells):
                    continue
                where = f"{path}, line {reader.line_num}"
                if len(cells) != len(names):
                    commas = " (a decimal comma makes two of one number)" if len(cells) > len(names) else ""
                    raise FileFormatError(f"{where}: {len(cells)} cells; {len(names)} are required{commas}")
                if len(lines) == MOST_ROWS:
                    raise FileFormatError(f"{where}: more than {MOST_ROWS} rows; at most {MOST_ROWS} are read")
                numbers.extend(_number(f"{where}: {names[place]}", cells[place], gap) for place, gap in places)
                for place, column in texts.values():
                    column.append(sys.intern(cells[place].strip()))
                lines.append(reader.line_num)
        except csv.Error as error:
            raise FileFormatError(f"{path}, line {reader.line_num}: {error}") from error
    table = np.array(numbers, dtype=np.float64).reshape(len(lines), len(columns))
    return Table(columns, table, lines, {name: column for name, (_, column) in texts.items()})


def _lines(path: Path, file: io.TextIOWrapper, comments: bool) -> Iterator[str]:
    """Yield the lines of a text with their ends, comments as empty lines, up to the limits of a line and of the file."""
    size = 0
    while line := file.readline(_LONGEST_LINE + 1):
        size += len(line)
        if len(line) > _LONGEST_LINE:
            raise FileFormatError(f"{path} has a line of more than {_LONGEST_LINE} characters, the most that is read")
        if size > LARGEST_FILE:
            raise FileFormatError(f"{path} has more than {LARGEST_FILE} characters, the most that is read")
        if "\0" in line:
            raise FileFormatError(f"{path} is not text in UTF-8: it contains a NUL character")
        yield "\n" if comments and line.startswith("#") else line


def _columns(where: str, names: Sequence[str], required: Sequence[str], optional: Sequence[str]) -> tuple[str, ...]:
    """Names of the columns present, checked to occur as often as they must."""
    for sign, word in _OTHER_SIGNS.items():
        parted = {name.strip(' "') for name in ",".join(names).split(sign)}
        if any(name in parted and name not in names for name in (*required, *optional)):
            raise FileFormatError(f"{where}: its cells are parted by {word}; commas are required, and points in numbers")
    if any(names.count(name) != 1 for name in required) or any(names.count(name) > 1 for name in optional):
        named = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
        allowed = [f"{', '.join(required)} are required, each once"] if required else []
        allowed += [f"{', '.join(optional)} at most once"] if optional else []
        missing = ", ".join(name for name in required if name not in names)
        lacks = f"; missing: {missing}" if missing else ""
        raise FileFormatError(f"{where}: it names {named[:500] or 'nothing'}; {', and '.join(allowed)}{lacks}")
    return (*(name for name in optional if name in names), *required)


def _number(what: str, cell: str, gap: bool) -> float:
    """Return a cell as a number; unlike `float`, without `1_000` and other scripts' digits; NaN for a gap."""
    if gap and cell.strip().lower() in ("", "nan"):
        return math.nan
    try:
        value = float(cell) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        start = cell if len(cell) <= 60 else f"{cell[:57]}..."
        comma = " with a point, not a comma" if _DECIMAL_COMMA.fullmatch(cell.strip()) else ""
        raise FileFormatError(f"{what} = {start!r}; a finite number is required{comma}")
    return value
