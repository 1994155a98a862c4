"""Text of generated Python files: literals, tables and templates."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template
from typing import Any

from softrobots.version import __version__

_WIDTH = 88


def literal(value: Any) -> str:
    """Return a value as Python source in ASCII: text in double quotes, numbers with all digits."""
    if isinstance(value, str):
        quoted = ascii(value)
        return quoted if '"' in quoted else f'"{quoted[1:-1]}"'
    if isinstance(value, tuple | list):
        inside = ", ".join(map(literal, value)) + ("," if isinstance(value, tuple) and len(value) == 1 else "")
        return f"({inside})" if isinstance(value, tuple) else f"[{inside}]"
    return repr(value)


def assignment(name: str, value: Any, comment: str = "") -> str:
    """Return a line that assigns a value."""
    return f"{name} = {literal(value)}" + (f"  # {comment}" if comment else "")


def table(name: str, rows: Mapping[str, Any], comment: str) -> str:
    """Return an assignment of a nested dictionary, with a comment above and one entry per line."""
    if not rows:
        return assignment(name, {}, comment)
    return "\n".join([f"# {comment}", f"{name} = {{", *_entries(rows, "    "), "}"])


def block(lines: Iterable[str]) -> str:
    """Return lines that formatters leave unchanged, as names can be long."""
    return "\n".join(["# fmt: off", *lines, "# fmt: on"])


def filled(template: str, *, name: str, description: Iterable[str], **fields: str) -> str:
    """Return a template of this folder with the name and description of a robot, and other fields, inserted unchanged."""
    text = Template(Path(__file__).with_name(template).read_text(encoding="utf-8"))
    paragraphs = "\n\n".join(textwrap.fill(part, _WIDTH, break_long_words=False) for part in description)
    return text.substitute(name=_in_docstring(name), description=_in_docstring(paragraphs), version=__version__, **fields)


def _entries(rows: Mapping[str, Any], indent: str) -> list[str]:
    lines = []
    for key, value in rows.items():
        if isinstance(value, Mapping):
            lines += [f"{indent}{literal(key)}: {{", *_entries(value, indent + "    "), f"{indent}}},"]
        else:
            lines.append(f"{indent}{literal(key)}: {literal(value)},")
    return lines


def _in_docstring(text: str) -> str:
    """Return text that is safe inside a docstring: ASCII, without quotes and backslashes."""
    return ascii(text)[1:-1].replace("\\n", "\n").replace("\\", "/").replace('"', "'")
