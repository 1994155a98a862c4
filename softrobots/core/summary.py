"""Summaries of results: lines and tables of names, values and units, as text and as HTML."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from softrobots.core.errors import short
from softrobots.core.field_help import FieldHelp, field_unit, with_field_help

Class = TypeVar("Class", bound=type)

PICTURES: dict[type, Callable[[Any], str]] = {}
"""What draws a result of a class as an HTML element for a notebook; a module that can adds it."""

MOST_ROWS = 20
"""Rows of a table that a summary shows; of a longer one the first and the last."""

_SHOWN = 6  # numbers of an array that are shown; of a longer one its shape and its range


class Table(NamedTuple):
    """A table: columns with their names in the first row, or facts, a name and what it is."""

    rows: Sequence[tuple[str, ...]]
    """Cells of each row."""
    right: Collection[int] = ()
    """Numbers of the columns that are aligned at their right end, from 0."""
    head: bool = True
    """Whether the first row names the columns; else each row is a fact."""
    title: str = ""
    """A line above it."""

    def text(self) -> str:
        """Return the table as text."""
        return "\n".join([*([self.title] if self.title else []), *aligned(self.rows, right=self.right)])

    def shortened(self, most: int | None) -> Table:
        """Return the table with at most so many rows below its head; None: all."""
        first, rows = self.rows[: self.head], self.rows[self.head :]
        if most is None or len(rows) <= most:
            return self
        half = most // 2
        left_out = (f"... {len(rows) - 2 * half} more ...",)
        return self._replace(rows=[*first, *rows[:half], left_out, *rows[len(rows) - half :]])

    def html(self) -> str:
        """Return the table as HTML."""
        from html import escape  # a millisecond, which only notebooks need

        lines = []
        for number, row in enumerate(self.rows):
            cells = []
            for column, cell in enumerate(row):
                name = "th" if (number == 0 and self.head) or column == 0 else "td"
                side = "right" if column in self.right else "left"
                cells.append(f'<{name} style="text-align:{side}">{escape(cell)}</{name}>')
            lines.append(f"<tr>{''.join(cells)}</tr>")
        title = f"<caption>{escape(self.title)}</caption>" if self.title else ""
        return f"<table>{title}{''.join(lines)}</table>"


Part = str | Table
"""Lines of text, or a table."""


def facts(rows: Iterable[tuple[str, ...]]) -> Table:
    """Return a table of facts, each a name and what it is."""
    return Table(list(rows), head=False)


def aligned(rows: Iterable[tuple[str, ...]], *, indent: str = "", right: Collection[int] = ()) -> list[str]:
    """Return the lines of a table with aligned columns.

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


def text_of(parts: Iterable[Part], rows: int | None = MOST_ROWS) -> str:
    """Return parts as text, an empty line between them; of each table at most so many rows (None: all)."""
    texts = (part if isinstance(part, str) else part.shortened(rows).text() for part in parts)
    return "\n\n".join(text for text in texts if text)


def html_of(parts: Iterable[Part], picture: str = "") -> str:
    """Return a picture, an HTML element, and parts as HTML for a notebook, without scripts, and with names escaped."""
    from html import escape

    blocks = [
        f"<p>{escape(part).replace(chr(10), '<br>')}</p>" if isinstance(part, str) else part.shortened(MOST_ROWS).html()
        for part in parts
        if part and not (isinstance(part, Table) and not part.rows)
    ]
    return f"<div>{picture}{''.join(blocks)}</div>"


def force_text(force: Any) -> str:
    """Return a force [N] with six digits and its unit; less than a nanonewton is rounding, and zero."""
    return f"{formatted(np.round(force, 9))} N"


def formatted(value: Any) -> str:
    """Return numbers with six digits, truth values as yes or no, None and infinity as none, text as it is."""
    value = value.item() if isinstance(value, np.ndarray | np.generic) and value.ndim == 0 else value
    if value is None or (isinstance(value, float) and math.isinf(value)):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    return "  ".join(f"{number:.6g}" for number in np.ravel(value) + 0.0)


def described(value: Any) -> str | None:
    """Return a number, a text, a truth value, names or an array in a few words; None for anything else."""
    if isinstance(value, tuple) and value and all(isinstance(one, float) for one in value):
        value = np.array(value)
    if isinstance(value, Mapping) or (isinstance(value, tuple | list) and all(isinstance(one, str) for one in value)):
        shown = [*map(str, value)]
        return ", ".join([*shown[:_SHOWN], *([f"{len(shown) - _SHOWN} more"] if len(shown) > _SHOWN else [])]) or "none"
    if (
        value is None
        or isinstance(value, str | float)
        or (np.ndim(value) == 0 and isinstance(value, int | np.generic | np.ndarray))
    ):
        return formatted(value)
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiub":
        return None
    shape = " x ".join(map(str, value.shape))
    if value.dtype.kind == "b":
        return f"{np.count_nonzero(value)} of {shape}"
    if value.ndim == 1 and 0 < value.size <= _SHOWN and np.isfinite(value).all():
        return formatted(value)
    numbers = value[np.isfinite(value)]
    ends = list(dict.fromkeys(f"{end:.4g}" for end in (numbers.min(), numbers.max()))) if numbers.size else []
    return f"{shape} numbers" + (f", {' to '.join(ends)}" if ends else "")


def field_facts(result: Any, *names: str) -> list[tuple[str, str]]:
    """Return attributes of these names (by default all fields) as facts, with the units that the texts of fields state."""
    rows = []
    for name in names or _field_names(result):
        value, unit = getattr(result, name), field_unit(type(result), name)
        inner = value if isinstance(value, Mapping) and any(isinstance(one, np.ndarray) for one in value.values()) else None
        for key, one in {name: value}.items() if inner is None else inner.items():
            words, unit = described(getattr(one, "name", one)), unit if inner is None else ""
            if words is not None:
                label = name if inner is None else f"{name} {key}"
                rows.append((label.replace("_", " "), words if words == "none" else f"{words} {unit.strip('-')}".strip()))
    return rows


class Summarised(FieldHelp):
    """Base of results that tell what they hold: as text, as HTML in a notebook, and in a line."""

    __slots__ = ()

    def summary_parts(self) -> Sequence[Part]:
        """Return lines and tables of the summary, most important first; by default the fields."""
        return [facts(field_facts(self))]

    def summary(self, rows: int | None = MOST_ROWS) -> str:
        """Return what the result holds, with units, for a person; `print` shows the same.

        Args:
            rows: Largest number of rows of a table, of which the first and the last are shown; None: all.
        """
        return text_of(self.summary_parts(), rows)

    def _repr_html_(self) -> str:
        """Show the summary in a notebook, of a robot in a pose below a small picture."""
        draw = next((draw for kind, draw in PICTURES.items() if isinstance(self, kind)), None)
        return html_of(self.summary_parts(), "" if draw is None else draw(self))

    def __str__(self) -> str:
        """Return the summary."""
        return self.summary()

    def __repr__(self) -> str:
        """The class with its names and single numbers in a line; no arrays."""
        return brief(self)


def summarised(cls: Class) -> Class:
    """Give a named tuple, which has no other base, the methods of `Summarised`, and return it."""
    for name in ("summary_parts", "summary", "_repr_html_", "__str__", "__repr__"):
        setattr(cls, name, vars(Summarised)[name])
    return with_field_help(cls)


def brief(result: Any) -> str:
    """Return the class of a result with its names, truth values and single numbers in a line, and how many of others it has."""
    words = []
    for name in _field_names(result):
        value = getattr(result, name)
        value = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
        called = getattr(value, "name", None)
        if type(value) is tuple and value and not isinstance(value[0], float):
            words.append(f"{len(value)} {name}")
        elif isinstance(value, bool | int | str | float):
            words.append(f"{name}={value:.6g}" if isinstance(value, float) else f"{name}={short(value)}")
        elif isinstance(called, str):
            words.append(f"{name}={short(called)}")
    arrays = {name: getattr(result, name) for name in _field_names(result)} if not words else {}
    words += [f"{name} {value.shape}" for name, value in arrays.items() if isinstance(value, np.ndarray)][:_SHOWN]
    return f"{type(result).__name__}({', '.join(words)})"


def _field_names(result: Any) -> Sequence[str]:
    """The fields of a dataclass or of a named tuple."""
    return tuple(getattr(result, "__dataclass_fields__", ())) or getattr(result, "_fields", ())
