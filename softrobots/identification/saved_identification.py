"""Serialisation of measurements and fits.

A file of measurements holds their table and the mapping that reads it. One of a fit holds the fitted robot, the measurements
and what was found; residuals are computed again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import astuple, fields, is_dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import FileFormatError
from softrobots.core.json_text import parse_json
from softrobots.core.result_file import KINDS, Kind, counts, label, text
from softrobots.identification.identification import Comparison, History, Identification
from softrobots.identification.measurement_checks import difference, with_gaps
from softrobots.identification.measurement_table import arguments_of_table, table_of
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameter_names import Parameter, Place
from softrobots.identification.uncertainty import Uncertainty
from softrobots.robots import HelixTube, InflatableArm, PccArm, TendonArm
from softrobots.statics.loads import Load
from softrobots.statics.saved_results import pack_model, unpack_model

_ROBOTS = {kind.__name__: kind for kind in (HelixTube, InflatableArm, PccArm, TendonArm)}


def _pack_measurements(measurements: Measurements) -> dict[str, Any]:
    table, mapping = table_of(measurements.arguments())
    label = table.pop("label", None)
    numbers = np.column_stack([np.asarray(column, dtype=float) for column in table.values()])
    own = {"columns": json.dumps(mapping), "names": list(table), "numbers": numbers, "lines": measurements.lines}
    return own | {"labels": None if label is None else list(label)}


def _unpack_measurements(fields: Mapping[str, Any]) -> Measurements:
    columns = parse_json(text(fields, "columns"))
    table = dict(zip(fields["names"].tolist(), with_gaps("numbers", fields["numbers"], (None, None), "").T, strict=True))
    if "labels" in fields:
        table["label"] = fields["labels"].tolist()
    return Measurements(**arguments_of_table(table, columns), lines=fields.get("lines"))


KINDS["measurements"] = Kind(
    Measurements,
    _pack_measurements,
    _unpack_measurements,
    many=True,
    to_table=lambda measurements: table_of(measurements.arguments())[0],
    reading=lambda measurements: table_of(measurements.arguments())[1],
)


def _pack(found: Identification) -> dict[str, Any]:
    robot = found.robot if type(found.robot) in _ROBOTS.values() else None
    arrays = pack_model(found.model, Load({}, None)) | {
        "robot": "" if robot is None else json.dumps({type(robot).__name__: _plain(robot)}),
        "parameters": json.dumps([_finite(astuple(one)) for one in found.parameters]),
        "solution": found.solution,
        "cost": found.history.cost,
        "values": found.history.values,
        "outliers": np.array(found.outliers, dtype=np.int64),
        "unidentifiable": json.dumps(found.unidentifiable),
        "held": found.held,
        "priors": json.dumps(found.priors),
        "loss": found.loss,
        "message": found.message,
    }
    for name, one in (("rows", found.by_rows), ("blocks", found.by_blocks)):
        if one is not None:
            freedoms = one.freedoms if math.isfinite(one.freedoms) else 0.0
            arrays |= {f"{name}_covariance": one.covariance, f"{name}_freedoms": freedoms, f"{name}_determined": one.determined}
    for name, rows in (("fitted", found.fitted), ("validation", found.validation)):
        if rows is not None:
            arrays |= {f"{name}_rows_{key}": value for key, value in KINDS["measurements"].to_arrays(rows.measurements).items()}
            for number, key in enumerate(rows.predicted):
                arrays[f"{name}_predicted_{number}"] = rows.predicted[key]
                arrays[f"{name}_counted_{number}"] = np.isfinite(rows.residuals[key])
    return arrays


def _unpack(arrays: Mapping[str, Any]) -> Identification:
    model, _ = unpack_model(arrays)
    if text(arrays, "robot"):
        ((name, values),) = parse_json(text(arrays, "robot")).items()
        robot = _ROBOTS[name](**values)
        if robot.urdf() != model.urdf:
            raise FileFormatError("its robot is not that of its model")
        model = replace(model, robot=robot)
    parameters = tuple(_parameter(*one) for one in parse_json(text(arrays, "parameters")))
    count = len(parameters)
    if count == 0 or len({one.name for one in parameters}) < count:
        raise FileFormatError("its parameters must be at least one, each named once")
    history = History(finite_array("cost", arrays["cost"], (None,)), finite_array("values", arrays["values"], (None, count)))
    rows = _rows("fitted", arrays)
    outliers = counts(arrays, "outliers")
    if rows is None or len(history.cost) != len(history.values) or max(outliers, default=0) >= len(rows.measurements):
        raise FileFormatError("its rows, outliers and history do not fit")
    priors = {str(key): (float(mean), float(std)) for key, (mean, std) in parse_json(text(arrays, "priors")).items()}
    by_rows = _uncertainty("rows", arrays, count)
    if by_rows is None or not priors.keys() <= {one.name for one in parameters}:
        raise FileFormatError("its covariance or priors are not those of its parameters")
    return Identification(
        model=model,
        parameters=parameters,
        solution=finite_array("solution", arrays["solution"], (count,)),
        by_rows=by_rows,
        by_blocks=_uncertainty("blocks", arrays, count),
        fitted=rows,
        validation=_rows("validation", arrays),
        outliers=tuple(outliers),
        unidentifiable=tuple(map(str, parse_json(text(arrays, "unidentifiable")))),
        held=counts(arrays, "held")[0],
        history=history,
        priors=priors,
        loss=label(arrays, "loss"),
        message=label(arrays, "message"),
    )


def _parameter(name: Any, unit: Any, value: Any, lower: Any, upper: Any, logarithmic: Any, place: Any) -> Parameter:
    kind, names, parts, row = place
    ends = [float(limit if end is None else end) for end, limit in ((lower, -math.inf), (upper, math.inf))]
    numbers = tuple(map(int, parts)), tuple(map(float, row))
    return Parameter(
        str(name), str(unit), float(value), ends[0], ends[1], bool(logarithmic), Place(kind, tuple(map(str, names)), *numbers)
    )


def _rows(name: str, arrays: Mapping[str, Any]) -> Comparison | None:
    """Measurements and their predictions, whose residuals are computed again."""
    head = f"{name}_rows_"
    own = {key.removeprefix(head): value for key, value in arrays.items() if key.startswith(head)}
    if not own:
        return None
    measurements, predicted, residuals = KINDS["measurements"].from_arrays(own), {}, {}
    for number, (key, measured) in enumerate(measurements.measured.items()):
        predicted[key] = with_gaps(key, arrays[f"{name}_predicted_{number}"], measured.shape, "")
        found, counted = difference(measured, predicted[key]), arrays[f"{name}_counted_{number}"]
        if counted.dtype != bool or counted.shape != found.shape:
            raise FileFormatError(f"its {name} counted {key} is no array of truth values of shape {found.shape}")
        residuals[key] = np.where(counted, found, np.nan)
    return Comparison(measurements, predicted, residuals)


def _uncertainty(name: str, arrays: Mapping[str, Any], count: int) -> Uncertainty | None:
    if f"{name}_covariance" not in arrays:
        return None
    covariance: FloatArray = finite_array(name, arrays[f"{name}_covariance"], (count, count))
    determined, freedoms = arrays[f"{name}_determined"], float(finite_array(name, arrays[f"{name}_freedoms"], ()))
    if determined.dtype != bool or determined.shape != (count,) or freedoms < 0.0 or np.diag(covariance).min() < 0.0:
        raise FileFormatError(f"its covariance by {name} is none of {count} parameters")
    return Uncertainty(covariance, freedoms or math.inf, determined)


def _plain(value: Any) -> Any:
    """Fields of a dataclass, and of those in it, as JSON holds them."""
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _finite(values: Any) -> Any:
    """The same with None for what is infinite, as JSON has no such number."""
    return (
        [_finite(one) for one in values] if isinstance(values, tuple) else None if values in (math.inf, -math.inf) else values
    )


KINDS["identification"] = Kind(Identification, _pack, _unpack, many=True)
