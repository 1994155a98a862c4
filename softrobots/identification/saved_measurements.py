"""Serialisation of measurements: their table and the mapping that reads it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from softrobots.core.json_text import parse_json
from softrobots.core.result_file import KINDS, Kind, text
from softrobots.identification.measurement_checks import with_gaps
from softrobots.identification.measurement_table import arguments_of_table, table_of
from softrobots.identification.measurements import Measurements


def _pack(measurements: Measurements) -> dict[str, Any]:
    table, mapping = table_of(measurements.arguments())
    label = table.pop("label", None)
    numbers = np.column_stack([np.asarray(column, dtype=float) for column in table.values()])
    own = {"columns": json.dumps(mapping), "names": list(table), "numbers": numbers, "lines": measurements.lines}
    return own | {"labels": None if label is None else list(label)}


def _unpack(fields: Mapping[str, Any]) -> Measurements:
    columns = parse_json(text(fields, "columns"))
    table = dict(zip(fields["names"].tolist(), with_gaps("numbers", fields["numbers"], (None, None), "").T, strict=True))
    if "labels" in fields:
        table["label"] = fields["labels"].tolist()
    return Measurements(**arguments_of_table(table, columns), lines=fields.get("lines"))


KINDS["measurements"] = Kind(
    Measurements,
    _pack,
    _unpack,
    many=True,
    to_table=lambda measurements: table_of(measurements.arguments())[0],
    reading=lambda measurements: table_of(measurements.arguments())[1],
)
