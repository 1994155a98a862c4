"""What every comparison tells: its row in the table over all of them, its tables and its picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import FileFormatError
from studies.shared.checkout import CHECKOUT
from studies.shared.markdown import line

EXAMPLES = CHECKOUT / "docs" / "examples"
"""Folders of measurements, each with its source and licence."""


class Overview(NamedTuple):
    """A row of the table over all comparisons."""

    robot: str
    source: str
    licence: str
    predicted: str
    error: str
    fitted: str
    command: str


class Comparison(NamedTuple):
    """A comparison with one set of measurements."""

    run: Callable[[], dict[str, Any]]
    """Predict all of it; the numbers, as JSON has them."""
    table: Callable[[Mapping[str, Any]], str]
    """Those numbers as Markdown."""
    picture: Callable[[Mapping[str, Any]], Any]
    """Those numbers as a figure."""
    overview: Callable[[Mapping[str, Any]], Overview]
    """Those numbers in a row."""


def overview_table(rows: Iterable[Overview]) -> str:
    """The table over all comparisons, as Markdown."""
    heads = ["robot", "source", "licence", "predicted", "error, root mean square", "fitted", "command"]
    return "\n".join([line(heads), "|---" * len(heads) + "|", *(line(row) for row in rows)])


def table_of(heads: Sequence[str], rows: Iterable[Sequence[object]], *, words: int = 0) -> str:
    """A table in Markdown whose first columns hold words, the others numbers."""
    rule = "|---" * words + "|---:" * (len(heads) - words) + "|"
    return "\n".join([line(heads), rule, *(line(row) for row in rows)])


def read_numbers(path: Path, heads: Sequence[str]) -> FloatArray:
    """The numbers of a CSV file with one line of heads, shape (rows, columns).

    Raises:
        FileFormatError: If it cannot be read, has other heads, or cells that are no finite numbers.
    """
    try:
        first, *lines = path.read_text(encoding="utf-8").splitlines()
        numbers = np.array([[float(cell) for cell in row.split(",")] for row in lines])
    except (OSError, ValueError) as error:
        raise FileFormatError(f"cannot read {path}: {error}") from error
    if first.split(",") != list(heads) or numbers.shape[1:] != (len(heads),) or not np.isfinite(numbers).all():
        raise FileFormatError(f"{path} must have finite numbers below the heads {', '.join(heads)}")
    return numbers


def errors_of(found: Iterable[float], measured: Iterable[float]) -> dict[str, float]:
    """Relative errors of predictions: the least, the most, and the root mean square."""
    errors = [one / other - 1.0 for one, other in zip(found, measured, strict=True)]
    return {"least": min(errors), "most": max(errors), "rms": rms(errors)}


def in_percent(errors: Mapping[str, float]) -> tuple[str, str, str]:
    """Those errors as cells of a table."""
    least, most = (f"{round(100.0 * errors[key]):+d} %" for key in ("least", "most"))
    return least, most, f"{100.0 * errors['rms']:.0f} %"


def rms(values: Any) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(values))))
