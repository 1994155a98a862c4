"""Fits of parameters as answers of a command: for a person, for a machine, and measured beside predicted numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.identification.cross_validation import CrossValidation
from softrobots.identification.identification import UNITS, Comparison, Identification


def identification_answer(found: Identification, compared: CrossValidation | None, causes: Sequence[str]) -> dict[str, Any]:
    """A fit by names of the library, with a comparison of sets of parameters, if there is one, and what may be wrong."""
    blocks = found.block_intervals
    rows = found.fitted.measurements
    return {
        "message": found.message,
        "steps": len(found.history.cost),
        "loss": found.loss,
        "parameters": {
            one.name: {
                "unit": one.unit,
                "start": one.value,
                "value": found.values[one.name],
                "interval": found.intervals[one.name],
                "block_interval": blocks.get(one.name),
                "prior": found.priors.get(one.name),
            }
            for one in found.parameters
        },
        "covariance": found.covariance,
        "block_covariance": found.block_covariance,
        "fitted": _errors(found.fitted),
        "validation": None if found.validation is None else _errors(found.validation),
        "outliers": [rows.where(row) for row in found.outliers],
        "unidentifiable": found.unidentifiable,
        "held": found.held,
        "hints": causes,
        "springs": _springs(found),
        "cross_validation": None if compared is None else _compared(compared),
    }


def identification_lines(found: Identification, compared: CrossValidation | None, causes: Sequence[str]) -> list[str]:
    """The same for a person."""
    lines = found.summary(None).split("\n")
    for title, one in (("fitted", found.fitted), ("kept aside", found.validation)):
        for key, error in ({} if one is None else _about_mean(one)).items():
            distances = np.linalg.norm(one.residuals[key], axis=1)  # type: ignore[union-attr]
            lines.append(f"{key}, without the mean of {title} rows: {error:.4g} m")
            lines.append(f"{key}, median of {title} rows: {np.nanmedian(distances):.4g} m")
    lines += [f"hint: {text}" for text in causes]
    if found.robot is None:
        words = (f"--spring {joint}={stiffness:.6g},{rest:.6g}" for joint, (stiffness, rest) in _springs(found).items())
        lines += ["", f"its springs, as options of other commands: {' '.join(words)}"]
    return [*lines, "", *compared.summary(None).split("\n")] if compared is not None else lines


def prediction_table(found: Identification) -> tuple[list[str], Iterator[list[Any]]]:
    """Names of columns, and rows, of measured, predicted and remaining numbers in SI units; of rotations only what remains."""
    parts = [("fitted", found.fitted), *([("validation", found.validation)] if found.validation is not None else [])]
    names = ["set", "row", "label"]
    for key, left in found.fitted.residuals.items():
        kind, axes = key.partition(".")[0], _axes(key, left)
        shown = axes[:3] if kind == "poses" else axes
        unit = UNITS.get(kind, "m")
        names += [f"{what} {key} {axis} [{unit}]" for what in ("measured", "predicted") for axis in shown]
        names += [f"residual {key} {axis} [{'rad' if axis.startswith('r') else unit}]" for axis in axes]

    def rows() -> Iterator[list[Any]]:
        for name, one in parts:
            parts_of = ((one.measurements.measured[key], one.predicted[key], left) for key, left in one.residuals.items())
            flat = [values[:, :3, 3] if values.ndim == 3 else values for three in parts_of for values in three]
            for row, cells in enumerate(np.hstack(flat).tolist()):
                label = one.measurements.labels[row] if one.measurements.labels is not None else ""
                yield [name, one.measurements.where(row), label, *("" if cell != cell else cell for cell in cells)]

    return names, rows()


def _axes(key: str, values: FloatArray) -> list[str]:
    """What the columns of residuals are called."""
    if key.startswith(("positions.", "poses.")):
        return ["x", "y", "z", "rx", "ry", "rz"][: values.shape[1]]
    return [str(place + 1) for place in range(values.shape[1])]


def _errors(one: Comparison) -> dict[str, Any]:
    errors = {key: {"root_mean_square": error, "unit": unit} for key, (error, unit) in one.errors.items()}
    return {"rows": len(one.measurements), "errors": errors, "without_mean": _about_mean(one)}


def _about_mean(one: Comparison) -> dict[str, float]:
    """Root mean square of differences of positions after their mean is subtracted [m]: a shift of the frame does not count."""
    positions = {key: values for key, values in one.residuals.items() if key.startswith("positions.")}
    variances = {key: np.ma.masked_invalid(values).var(axis=0).filled(0.0) for key, values in positions.items()}
    return {key: float(np.sqrt(np.sum(each))) for key, each in variances.items()}


def _springs(found: Identification) -> dict[str, tuple[float, float]]:
    """Stiffness and rest of the joint springs of a robot that is no dataclass."""
    return {} if found.robot is not None else dict(found.model.spring_table)


def _compared(one: CrossValidation) -> dict[str, Any]:
    names = ("sets", "families", "errors", "unit", "means", "standard_errors", "least", "best")
    return {name: getattr(one, name) for name in names}
