"""Strict JSON: finite numbers, no duplicate names in an object, limited nesting; and named arrays as JSON."""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.bounded_reading import read_text
from softrobots.core.errors import FileFormatError, ParameterError

DEEPEST = 40
"""Maximum nesting depth of arrays and objects."""

LARGEST_ARRAYS = 2**28
"""Maximum size of a file of named arrays [bytes]."""

_TYPES = {"b": "boolean", "i": "integer", "u": "integer", "f": "number", "U": "text"}
_ENTRIES: dict[Any, tuple[type, tuple[type, ...]]] = {
    "boolean": (bool, (bool,)),
    "integer": (int, (int,)),
    "number": (float, (float, int)),
    "text": (str, (str,)),
}


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


def json_of_arrays(arrays: Mapping[str, Any]) -> str:
    """Return named arrays of numbers, booleans or text as JSON: of each its type, its shape and its entries in one row.

    Raises:
        ParameterError: If a number is not finite, or the text is longer than `LARGEST_ARRAYS`.
    """
    rows = {}
    for key, value in arrays.items():
        array = np.asarray(value)
        rows[key] = {"type": _TYPES[array.dtype.kind], "shape": array.shape, "values": array.ravel().tolist()}
    try:
        text = json.dumps(rows, allow_nan=False, separators=(",", ":")) + "\n"
    except ValueError as error:
        raise ParameterError("result", "a number that is not finite", "finite to be JSON; NPZ holds such numbers") from error
    if len(text) > LARGEST_ARRAYS:
        most = f"of at most {LARGEST_ARRAYS} bytes, the most that is read again"
        raise ParameterError("result", f"{len(text)} bytes of JSON", most)
    return text


def arrays_of_json(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file that holds the text of `json_of_arrays`.

    Raises:
        FileFormatError: If the file cannot be read, is larger than `LARGEST_ARRAYS`, or holds something else.
    """
    found = read_json(path, LARGEST_ARRAYS)
    if not isinstance(found, dict):
        raise FileFormatError("it is no object of arrays")
    return {str(name): _array(str(name)[:60], row) for name, row in found.items()}


def _array(name: str, row: Any) -> NDArray[Any]:
    """The array of one row of `json_of_arrays`."""
    if not isinstance(row, dict) or row.keys() != {"type", "shape", "values"} or row["type"] not in _ENTRIES:
        raise FileFormatError(f"its {name!r} is no array, which has type, shape and values")
    shape, values, (dtype, kinds) = row["shape"], row["values"], _ENTRIES[row["type"]]
    if not isinstance(values, list) or any(type(value) not in kinds for value in values):
        raise FileFormatError(f"its {name!r} has entries that are no {row['type']}")
    if not isinstance(shape, list) or any(type(n) is not int or n < 0 for n in shape) or math.prod(shape) != len(values):
        raise FileFormatError(f"its {name!r} has {len(values)} entries, which is not its shape {str(shape)[:60]}")
    return np.array(values, dtype=dtype).reshape(shape)


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
