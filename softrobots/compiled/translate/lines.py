"""Comments and lines of C that are not too long."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable

INDENT = "    "
"""Indentation of a block."""
WIDTH = 116
"""Characters of a line, where it can be helped."""


def comment(lines: Iterable[str]) -> str:
    """Return a comment in C, with spaces in whatever would end it or start another."""
    wrapped_lines = []
    for line in lines:
        plain = line.encode("ascii", "backslashreplace").decode().replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
        indent = " " * (len(plain) - len(plain.lstrip()))
        wrapped_lines += textwrap.wrap(plain, WIDTH - 3, subsequent_indent=indent, break_on_hyphens=False) or [""]
    if len(wrapped_lines) == 1:
        return f"/* {wrapped_lines[0]} */"
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in wrapped_lines), " */"])


def wrapped(line: str) -> list[str]:
    """Return a line of C cut at spaces into lines that are not too long; no line begins with the `*` of a pointer."""
    indent = line[: len(line) - len(line.lstrip())]
    lines = textwrap.wrap(
        line.replace("double *", "double\0*"),
        WIDTH - 3,  # declarations stand in comments, too
        subsequent_indent=indent + 2 * INDENT,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [one.replace("\0", " ") for one in lines] or [line]
