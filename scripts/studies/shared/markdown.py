"""Markdown: lines of tables, and generated parts of a page between two marks."""

from __future__ import annotations

from collections.abc import Iterable

from softrobots.core.errors import FileFormatError


def line(cells: Iterable[object]) -> str:
    """Return a line of a table."""
    return f"| {' | '.join(map(str, cells))} |"


def marked(text: str, name: str, begin: str, end: str, inside: str) -> str:
    """Replace the text between two marks.

    Args:
        text: The page.
        name: Its name, for the error.
        begin: The line before the generated part.
        end: The line after it.
        inside: The new generated part.

    Raises:
        FileFormatError: If the page does not have each mark once, in order.
    """
    before, opened, rest = text.partition(f"{begin}\n")
    _, closed, after = rest.partition(f"{end}\n")
    if not opened or not closed or text.count(begin) + text.count(end) != 2:
        raise FileFormatError(f"{name} must have the lines {begin} and {end} once each")
    return f"{before}{begin}\n\n{inside}\n\n{end}\n{after}"
