"""Measurements as tables of numbers and words, in CSV files and in memory."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from softrobots.core.bounded_reading import opened
from softrobots.core.checks import FloatArray
from softrobots.core.csv_table import read_table
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError, SoftRobotsError
from softrobots.core.files import as_path
from softrobots.core.result_file import OWN_COLUMNS, save_csv
from softrobots.core.yaml_text import parse_yaml
from softrobots.identification.measurement_columns import QUANTITIES, read_columns
from softrobots.robots.parameter_file import LARGEST_FILE

Made = TypeVar("Made", bound="MeasurementTables")


class MeasurementTables:
    """Measurements from tables and to tables: CSV files, pandas, mappings of columns."""

    def __init__(self, q_motors: Any, **others: Any) -> None:
        """Make them of arrays; see `Measurements`."""
        raise NotImplementedError

    @classmethod
    def from_csv(cls: type[Made], path: str | os.PathLike[str], columns: Any = None) -> Made:
        """Read measurements from a CSV file.

        Its first line names the columns; empty lines and lines that begin with `#` are passed over, empty cells of what was
        measured are missing.

        Args:
            path: The file, in UTF-8.
            columns: Mapping of columns and units, or the path of a YAML or JSON file with it (`measurement_columns` tells its
                form); None for files of `to_csv`, which tell their own.

        Raises:
            ParameterError: If `path` is no path, or the mapping is of another form or has another unit.
            NameNotFound: If the mapping has an unknown entry.
            FileFormatError: If a file cannot be read or is too large, lacks a column, or (naming the line) has a number that
                is refused.
        """
        file = as_path("path", path)
        arguments = read_rows(file, columns)
        try:
            return cls(**arguments)
        except ParameterError as error:
            raise FileFormatError(f"{file}: {error}") from error

    @classmethod
    def from_dataframe(cls: type[Made], table: Any, columns: Any = None) -> Made:
        """Take measurements from a pandas table, or any mapping of names to columns.

        Args:
            table: The table.
            columns: Mapping of columns and units, or the path of its file, as for `from_csv`; None for tables of
                `to_dataframe`, which tell their own.

        Raises:
            ParameterError: If the mapping or a number is refused.
            NameNotFound: If the table has no such column, or the mapping has an unknown entry.
            FileFormatError: If the file of the mapping cannot be read.
        """
        return cls(**arguments_of_table(table, columns))

    def to_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write a CSV file in SI units that `from_csv` reads to the last bit; its first line is a comment with the mapping.

        The same as `softrobots.save_csv`, with its errors.
        """
        return save_csv(self, path, overwrite=overwrite)


def read_rows(path: Path, columns: Any = None) -> dict[str, Any]:
    """Read the arguments of `Measurements`, and the line of each row, from a CSV file; see `Measurements.from_csv`."""
    layout = read_columns(_own_columns(path) if columns is None else columns)
    words = () if layout.labels is None else (layout.labels[0],)
    table = read_table(path, layout.numbers, gaps=layout.gaps, words=words, comments=True)
    if not len(table.lines):
        raise FileFormatError(f"{path} has no rows of numbers")
    places = {name: place for place, name in enumerate(table.columns)}
    try:
        found = layout.arguments(lambda name: table.numbers[:, places[name]], table.words.__getitem__)
    except SoftRobotsError as error:
        raise FileFormatError(f"{path}: {error}") from error
    return found | {"lines": np.array(table.lines)}


def arguments_of_table(table: Any, columns: Any = None) -> dict[str, Any]:
    """Return the arguments of `Measurements` from a pandas table, or any mapping of names to columns."""
    if columns is None:
        columns = getattr(table, "attrs", {}).get("columns")
        if columns is None:
            raise ParameterError("columns", None, "a mapping, because the table is not one that to_dataframe made")

    def column(name: str) -> Any:
        try:
            return table[name]
        except (KeyError, IndexError) as error:
            raise NameNotFound("column", name, map(str, table)) from error

    def numbers(name: str) -> FloatArray:
        values = column(name)
        try:
            known = values.to_numpy(dtype=float, na_value=np.nan) if hasattr(values, "to_numpy") else values
            return np.asarray(known, dtype=np.float64).reshape(len(values))
        except (TypeError, ValueError) as error:
            raise ParameterError(name, values, "a column of numbers") from error

    return read_columns(columns).arguments(numbers, lambda name: [str(word) for word in column(name)])


def table_of(arguments: Mapping[str, Any]) -> tuple[dict[str, Sequence[Any]], dict[str, Any]]:
    """Return columns of numbers and words in SI units, and the mapping that reads them again to the last bit.

    Args:
        arguments: Arguments of `Measurements`, arrays with a row for each measurement.
    """
    table: dict[str, Sequence[Any]] = {}
    mapping: dict[str, Any] = {}

    def add(key: str, values: FloatArray) -> list[str]:
        rows = values.reshape(len(values), -1)
        names = [f"{key}.{place + 1}" for place in range(rows.shape[1])]
        table.update(zip(names, rows.T, strict=True))
        return names

    for quantity in QUANTITIES:
        given = arguments.get("q_motors" if quantity == "actuators" else quantity)
        for name, values in given.items() if isinstance(given, dict) else (("", given),):
            if values is None:
                continue
            key = f"{quantity}.{name}".removesuffix(".")
            entry: dict[str, Any] = {"unit": "SI"}
            if quantity == "poses":
                entry |= {"columns": add(key, values[:, :3, 3]), "matrix": add(f"{key}.matrix", values[:, :3, :3])}
            else:
                entry["columns"] = add(key, values)
            std = arguments["std"].get(key)
            if std is not None:
                entry["std"] = std[0].tolist() if np.all(std == std[0]) else add(f"std.{key}", std)
            mapping.setdefault(quantity, {}).update({name: entry} if name else entry)
    mapping["actuators"]["relative"] = arguments["relative"]
    if arguments["actuators"] is not None:
        mapping["actuators"]["names"] = list(arguments["actuators"])
    if arguments["labels"] is not None:
        table["label"], mapping["labels"] = arguments["labels"], "label"
    if not arguments["mask"].all():
        table["mask"], mapping["mask"] = arguments["mask"].astype(int).tolist(), "mask"
    return table, mapping | {"markers": arguments["markers"]}


_EXAMPLE = "{actuators: {columns: [q1, q2], unit: deg}, positions: {tip: {columns: [x, y, z], unit: mm}}}"


def _own_columns(path: Path) -> Any:
    with opened(path) as file:
        line = file.readline(LARGEST_FILE).decode("utf-8", "replace").removeprefix("\ufeff")
    if not line.startswith(OWN_COLUMNS):
        raise FileFormatError(
            f"{path} does not tell which of its columns are what, as files of Measurements.to_csv do: it begins with "
            f"{line.strip()[:200]!r}; give a mapping (columns=, or --columns FILE) such as {_EXAMPLE}"
        )
    try:
        return parse_yaml(line.removeprefix(OWN_COLUMNS))
    except FileFormatError as error:
        raise FileFormatError(f"cannot read {path}, line 1: {error}") from error
