"""Generated parts of a page, between two lines that mark them."""

from __future__ import annotations

from softrobots.core.errors import FileFormatError


def marked(text: str, name: str, begin: str, end: str, inside: str) -> str:
    """A text with something else between two marks.

    Args:
        text: The text.
        name: What it is called, for the error.
        begin: The line before.
        end: The line after.
        inside: What stands between them from now on.

    Raises:
        FileFormatError: If it does not have each mark once, in order.
    """
    before, found, rest = text.partition(f"{begin}\n")
    _, closed, after = rest.partition(f"{end}\n")
    if not found or not closed or text.count(begin) + text.count(end) != 2:
        raise FileFormatError(f"{name} must have the lines {begin} and {end} once each")
    return f"{before}{begin}\n\n{inside}\n\n{end}\n{after}"
