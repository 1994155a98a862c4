"""Strict JSON: finite numbers, no duplicate names in an object, limited nesting."""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

from softrobots.core.bounded_reading import read_text
from softrobots.core.errors import FileFormatError

DEEPEST = 40
"""Maximum nesting depth of arrays and objects."""


def parse_json(text: str) -> Any:
    """Parse a JSON text into dictionaries, lists, strings, finite numbers, booleans and None, nested at most `DEEPEST` deep.

    Python's own parser also accepts NaN and Infinity, reads 1e999 as infinite, and of duplicate names keeps the last.

    Raises:
        FileFormatError: If the text is not such JSON.
    """
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_constant=_refuse)
    except FileFormatError:
        raise
    except (ValueError, RecursionError) as error:
        raise FileFormatError(f"it is not JSON: {error}") from error
    _check(value)
    return value


def read_json(path: Path, largest: int) -> Any:
    """Read a JSON file in UTF-8 of at most `largest` bytes; see `parse_json`.

    Raises:
        FileFormatError: If the file cannot be read, is larger, or is not such JSON.
    """
    text = read_text(path, largest)
    try:
        return parse_json(text)
    except FileFormatError as error:
        raise FileFormatError(f"cannot read {path}: {error}") from error


def _object(members: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(members)
    if len(result) < len(members):
        twice = next(name for name, count in Counter(name for name, _ in members).items() if count > 1)
        raise FileFormatError(f"an object has two members called {twice[:60]!r}")
    return result


def _refuse(word: str) -> Any:
    raise FileFormatError(f"{word} is not a number in JSON")


def _check(value: Any) -> None:
    """Raise FileFormatError for nesting too deep or a number too large, without recursion."""
    level, depth = [value], 0
    while level:
        if depth > DEEPEST:
            raise FileFormatError(f"arrays or objects are nested more than {DEEPEST} deep")
        inner: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                inner += item.values()
            elif isinstance(item, list):
                inner += item
            elif isinstance(item, int | float) and not abs(item) <= sys.float_info.max:
                raise FileFormatError(f"a number is larger than {sys.float_info.max:g}")
        level, depth = inner, depth + 1
