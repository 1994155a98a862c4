"""Result files: NPZ without pickle or JSON, CSV tables, and the table of the kinds of results that can be saved.

A module with result classes adds them to `KINDS`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softrobots.core import npz_file
from softrobots.core.errors import FileFormatError, MissingDependency, ParameterError
from softrobots.core.files import as_path, csv_text, new_file, write_atomically, write_text
from softrobots.core.json_text import arrays_of_json, json_of_arrays
from softrobots.core.npz_file import check_size, read_arrays

FORMAT = 1
"""Number of the format, in every file."""

LARGEST_OF_ONE = 2**26
"""Limit of the arrays of a result with one configuration [bytes]; most of it is for the URDF text."""

_LONGEST_LABEL = 80  # characters


class Kind(NamedTuple):
    """How one kind of results is saved."""

    cls: type
    """Class of the results."""
    to_arrays: Callable[[Any], dict[str, Any]]
    """Return the named arrays of a result; None for one that it does not have."""
    from_arrays: Callable[[Mapping[str, Any]], Any]
    """Return the result of named arrays; any exception means that they do not fit."""
    many: bool = False
    """Whether a result has any number of configurations, so that only `npz_file.LARGEST` limits it."""
    items: type | None = None
    """Class of the items where `cls` is `tuple`."""
    to_table: Callable[[Any], Mapping[str, Any]] | None = None
    """Return the columns of a result over its rows, by their names, each with n numbers or words; None: it is no table."""
    reading: Callable[[Any], dict[str, Any]] | None = None
    """Return how the columns are read again, plain data; None: the names say it."""

    def holds(self, result: Any) -> bool:
        """Return whether a result is of this kind."""
        if self.items is None or not issubclass(type(result), self.cls):
            return isinstance(result, self.cls)
        return bool(result) and all(isinstance(one, self.items) for one in result)

    def __str__(self) -> str:
        """Return the name of the class."""
        return self.cls.__name__ if self.items is None else f"{self.cls.__name__} of {self.items.__name__}"

    @property
    def largest(self) -> int:
        """Limit of the arrays of a result [bytes]."""
        return npz_file.LARGEST if self.many else LARGEST_OF_ONE


KINDS: dict[str, Kind] = {}
"""Kinds of results by their name in the file."""

TABLES: dict[type, Callable[[Any], Mapping[str, Any]]] = {}
"""Columns of results that are tables, and are not saved otherwise, by their class."""

OWN_COLUMNS = "# columns: "
"""Beginning of the first line of a CSV file that says how its columns are read, as JSON."""


def named_columns(names: Sequence[str], units: Sequence[str], values: Any, words: str = "") -> dict[str, Any]:
    """Return the columns of an array, shape (n, m), by m names and units, e.g. "motor_1 load [N m]"."""
    return {f"{name}{words} [{unit}]": column for name, unit, column in zip(names, units, values.T, strict=True)}


def vector_columns(what: str, unit: str, values: Any) -> dict[str, Any]:
    """Return the columns of vectors, shape (n, 3), e.g. "tip x [m]"."""
    return named_columns([f"{what} {axis}" for axis in "xyz"], [unit] * 3, values)


class Table(NamedTuple):
    """A result as a table."""

    columns: Mapping[str, Any]
    """Numbers or words by the name of the column."""
    reading: dict[str, Any] | None
    """How they are read again, if the names do not say it."""


def to_dataframe(result: Any) -> Any:
    """Return a result as a `pandas.DataFrame`, with the rows and columns that `save_csv` writes.

    How `Measurements.from_dataframe` reads a table of measurements again stands in its `attrs["columns"]`.

    Args:
        result: The result.

    Raises:
        ParameterError: If it is no table.
        MissingDependency: If pandas is not installed (extra `pandas`).
    """
    columns, reading = table_of(result)
    with MissingDependency.of_imports("pandas", "pandas"):
        from pandas import DataFrame
    frame = DataFrame(dict(columns))
    if reading is not None:
        frame.attrs["columns"] = reading
    return frame


def table_of(result: Any) -> Table:
    """Return a result as a table.

    Raises:
        ParameterError: If it is none.
    """
    for cls, to_table in TABLES.items():
        if isinstance(result, cls):
            return Table(to_table(result), None)
    kind = next((kind for kind in KINDS.values() if kind.holds(result)), None)
    if kind is None or kind.to_table is None:
        tables = [str(kind) for kind in KINDS.values() if kind.to_table is not None]
        raise ParameterError("result", result, f"one of {', '.join([*tables, *(cls.__name__ for cls in TABLES)])}")
    return Table(kind.to_table(result), None if kind.reading is None else kind.reading(result))


def save_result(result: Any, path: str | Path, *, overwrite: bool = False) -> Path:
    """Save a result as an NPZ file, without pickle, or as JSON if the name of the file ends in `.json`.

    The file appears complete or not at all: it is written under another name and renamed. Both formats keep every number to the
    last bit; JSON takes two to four times the space and is read without NumPy, too.

    Args:
        result: A characterisation, equilibrium, imposed displacement, load estimate, IK solution, trajectory, contact path,
            motion, batch of compiled motions, vibration modes, linear model, workspace, workspace map, measurements,
            identification, cross-validation, helix design, or the branches that `post_buckling_branches` returns.
        path: File to write; `.npz` is added if it has no suffix.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If the result is something else, has more arrays than `load_result` reads or, for JSON, a number that is
            not finite, or the path is not one or that of a CSV table.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    name = next((name for name, kind in KINDS.items() if kind.holds(result)), None)
    if name is None:
        raise ParameterError("result", result, f"one of {', '.join(map(str, KINDS.values()))}")
    path = as_path("path", path)
    if path.suffix.lower() == ".csv":
        raise ParameterError("path", str(path), "a name that ends in .npz or .json; save_csv writes tables")
    target = new_file(path if path.suffix or path.is_dir() else path.with_suffix(".npz"), overwrite=overwrite)
    fields = {"format": np.array(FORMAT), "kind": np.array(name), **KINDS[name].to_arrays(result)}
    arrays = {name: array for name, array in fields.items() if array is not None}
    check_size(arrays, KINDS[name].largest)
    if _is_json(target):
        return write_text(target, json_of_arrays(arrays), overwrite=overwrite)
    write_atomically(target, lambda file: np.savez_compressed(file, **arrays), overwrite=overwrite)
    return target


def save_csv(result: Any, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Save a result as a CSV table in full precision.

    An equilibrium, IK solution, load estimate or imposed displacement is one row; a trajectory, contact path, motion, branches,
    vibration modes, workspace, workspace map, measurements and the batches of a compiled model have many. Columns have their
    unit in their name, but for those of a trajectory: `t` [s], `x, y, z` (target, so that the file can be read as waypoints)
    [m], `tip_x, tip_y, tip_z` [m], `tip_error` [m], of poses `roll, pitch, yaw` (target) and `orientation_error` [rad], one for
    each motor and spring [rad] (`joint_x` where a joint is called `x`), `moment_<i>` [N m] for each inflated link, and the
    normal force on each obstacle that is touched. `to_dataframe` gives the same columns.

    Args:
        result: The result.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If the result is none of them, or the path is not one.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    columns, reading = table_of(result)
    cells = (column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values())
    rows = ([("" if cell != cell else cell) for cell in row] for row in zip(*cells, strict=True))
    head = "" if reading is None else f"{OWN_COLUMNS}{json.dumps(reading)}\n"
    return write_text(path, head + csv_text(columns, rows), overwrite=overwrite)


def load_result(path: str | Path) -> Any:
    """Load a result saved by `save_result`.

    The file may be untrusted: nothing in it is executed, no other file is opened, and it is not unpacked unless its arrays have
    the size that its directory states, at most 1 GiB (64 MiB for a result of a single configuration).

    Args:
        path: The NPZ file, or a JSON file whose name ends in `.json`.

    Returns:
        The result, with its model.

    Raises:
        ParameterError: If the path is not one.
        FileFormatError: If the file cannot be read, is not a result file, or its numbers are not the result that it claims.
    """
    path = as_path("path", path)
    try:
        content = arrays_of_json(path) if _is_json(path) else None
        head = read_arrays(path, only=("kind", "format")) if content is None else content
        name = str(head["kind"])
        if int(head["format"]) != FORMAT or name not in KINDS:
            raise FileFormatError(
                f"it holds {name[:60]!r} in format {head['format']}; known: {', '.join(KINDS)} in format {FORMAT}"
            )
        return KINDS[name].from_arrays(read_arrays(path, largest=KINDS[name].largest) if content is None else content)
    except Exception as error:  # arrays of another type or shape raise various errors of NumPy
        reason = f"it has no {error}" if isinstance(error, KeyError) else error
        raise FileFormatError(f"cannot read a result from {path}: {reason}") from error


def _is_json(path: Path) -> bool:
    return path.suffix.lower() == ".json"


def text(arrays: Mapping[str, Any], name: str) -> str:
    """Return an array that holds a single text, or raise FileFormatError."""
    if arrays[name].shape != () or arrays[name].dtype.kind != "U":
        raise FileFormatError(f"its {name} is not a text")
    return str(arrays[name])


def label(arrays: Mapping[str, Any], name: str) -> str:
    """Return an array that holds a printable label of one line, or raise FileFormatError."""
    word = text(arrays, name)
    if not 0 < len(word) <= _LONGEST_LABEL or not word.isprintable():
        raise FileFormatError(f"its {name} must be 1 to {_LONGEST_LABEL} printable characters")
    return word


def counts(arrays: Mapping[str, Any], name: str) -> list[int]:
    """Return an array of non-negative integers as a list, of one for a single number, or raise FileFormatError."""
    array = np.atleast_1d(arrays[name])
    if array.dtype.kind not in "iu" or array.ndim != 1 or array.min(initial=0) < 0:
        raise FileFormatError(f"its {name} must be an array of non-negative integers")
    return [int(number) for number in array]
