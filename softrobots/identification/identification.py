"""The result of a fit of parameters to measurements: values with intervals, and how well they explain what was measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Part, Summarised, Table
from softrobots.identification.derivatives.rows_and_states import States
from softrobots.identification.fit import Fit
from softrobots.identification.gauges import find_gauges
from softrobots.identification.measurements import Measurements
from softrobots.identification.parameter_names import Parameter
from softrobots.identification.prediction import Predictor
from softrobots.identification.uncertainty import Uncertainty, outliers, uncertainty_from_blocks, uncertainty_from_rows
from softrobots.identification.weights import rho
from softrobots.model.soft_model import SoftModel

UNITS = {"positions": "m", "motor_torques": "N m or N", "tensions": "N", "frequencies": "Hz"}
"""Units of measured quantities; of poses m and rad; damping ratios have none."""


class Comparison(NamedTuple):
    """Measured rows beside what is predicted for them."""

    measurements: Measurements
    """The rows."""
    predicted: Mapping[str, FloatArray]
    """Predictions, by the names and in the shapes of `measurements.measured`; of vibrations NaN in rows without any."""
    residuals: Mapping[str, FloatArray]
    """Measured minus predicted by quantity, shape (n, k), of poses position and rotation vector (n, 6); NaN where missing or
    not counted."""
    states: States | None = None
    """The equilibria of the rows; None of a file."""

    @property
    def n_counted(self) -> int:
        """Number of rows that count."""
        there = [np.isfinite(values).any(axis=1) for values in self.residuals.values()]
        return int(np.any(there, axis=0).sum())

    @property
    def lost(self) -> list[int]:
        """Rows of which nothing is predicted, as they have no equilibrium."""
        return np.flatnonzero(
            [all(np.isnan(one[row]).all() for one in self.predicted.values()) for row in range(len(self.measurements))]
        ).tolist()

    @property
    def errors(self) -> dict[str, tuple[float, str]]:
        """Root mean square of the residuals by quantity, of positions of their length, and unit.

        Of a length it is the root of the sum of the mean squares of its components, each over the cells that are there.
        """
        found = {}
        for key, values in self.residuals.items():
            kind, _, name = key.partition(".")
            parts = {key: (values, UNITS.get(kind, ""))}
            if kind == "poses":
                parts = {f"position of {name}": (values[:, :3], "m"), f"rotation of {name}": (values[:, 3:], "rad")}
            for label, (numbers, unit) in parts.items():
                components = numbers.T if kind in ("positions", "poses") else numbers.reshape(1, -1)
                there = [one[np.isfinite(one)] for one in components]
                found[label] = (float(np.sqrt(sum(np.mean(one**2) for one in there if one.size))), unit)
        return found


class History(NamedTuple):
    """The steps of the last search of a fit, which has all rows and the final weights."""

    cost: FloatArray
    """Half the sum of the losses, shape (n,)."""
    values: FloatArray
    """Values of the parameters, shape (n, P)."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Identification(Summarised):
    """Fitted parameters of a robot; returned by `softrobots.identify`, saved by `softrobots.save_result`."""

    model: SoftModel
    """The robot with the fitted values."""
    parameters: tuple[Parameter, ...]
    """The parameters, each with the value from which the fit started."""
    solution: FloatArray
    """Fitted values, shape (P,)."""
    by_rows: Uncertainty
    """Uncertainty of the fitted coordinates (logarithms of positive parameters) if the errors of rows are independent."""
    by_blocks: Uncertainty | None
    """Uncertainty if only errors of different blocks are independent: of labels, or measured rows; None with fewer than two."""
    fitted: Comparison
    """The measurements that were fitted, and what is predicted."""
    validation: Comparison | None
    """What was kept aside, and what is predicted; None if nothing was."""
    outliers: tuple[int, ...]
    """Rows of `fitted.measurements` with a number too far off to be noise, the worst first."""
    unidentifiable: tuple[str, ...]
    """What the measurements cannot tell apart, in words."""
    held: int
    """Number of combinations of parameters without any effect, or that noise hides, which kept the values they started with."""
    history: History
    """Cost and values at every step."""
    priors: Mapping[str, tuple[float, float]]
    """Mean and standard deviation of what was known before, by parameter."""
    loss: str
    """The loss."""
    message: str
    """How the fit ended: "converged", or why not."""

    @property
    def robot(self) -> Any:
        """The dataclass with the fitted values, which every function and command takes; None of a file, and if not known."""
        return self.model.robot

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(one.name for one in self.parameters)

    @property
    def values(self) -> dict[str, float]:
        """Fitted values by name."""
        return dict(zip(self.names, self.solution.tolist(), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by name, from rows."""
        return self._intervals(self.by_rows)

    @property
    def block_intervals(self) -> dict[str, tuple[float, float]]:
        """95 % intervals by name, from blocks; empty without."""
        return {} if self.by_blocks is None else self._intervals(self.by_blocks)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the values, from rows, shape (P, P), in their units; of the part that is determined."""
        return self._covariance(self.by_rows)

    @property
    def block_covariance(self) -> FloatArray | None:
        """The same from blocks; None with fewer than two."""
        return None if self.by_blocks is None else self._covariance(self.by_blocks)

    @property
    def predicted(self) -> Mapping[str, FloatArray]:
        """Predictions of what was fitted, by quantity."""
        return self.fitted.predicted

    @property
    def residuals(self) -> Mapping[str, FloatArray]:
        """Measured minus predicted of what was fitted, by quantity; see `Comparison`."""
        return self.fitted.residuals

    def __repr__(self) -> str:
        """Values in one line."""
        return f"Identification({', '.join(f'{name}={value:.6g}' for name, value in self.values.items())}: {self.message})"

    def summary_parts(self) -> list[Part]:
        """Return values with their intervals, errors, and what cannot be told apart."""
        header: tuple[str, ...] = ("parameter", "unit", "start", "value", "95 % by rows", "95 % by blocks", "prior")
        rows, blocks = self.intervals, self.block_intervals
        table = [header] + [
            (
                one.name,
                one.unit,
                f"{one.value:.6g}",
                f"{value:.6g}",
                _interval(rows[one.name]),
                _interval(blocks.get(one.name)),
                "{:.6g} +- {:.3g}".format(*self.priors[one.name]) if one.name in self.priors else "",
            )
            for one, value in zip(self.parameters, self.solution.tolist(), strict=True)
        ]
        parts: list[Part] = [f"{self.message}, {len(self.history.cost)} steps, loss {self.loss}", Table(table)]
        for title, comparison in (("fitted", self.fitted), ("kept aside", self.validation)):
            if comparison is not None:
                errors = [(f"  {key}", f"{error:.4g}", unit) for key, (error, unit) in comparison.errors.items()]
                parts.append(Table(errors, head=False, title=f"root mean square errors, {comparison.n_counted} rows {title}:"))
        lines = []
        if self.outliers:
            where = self.fitted.measurements.where
            lines.append(f"outliers ({len(self.outliers)} rows): {', '.join(map(where, self.outliers[:10]))}")
        if self.validation is not None and self.validation.lost:
            where = self.validation.measurements.where
            lines.append(f"kept aside, without an equilibrium: {', '.join(map(where, self.validation.lost[:10]))}")
        if self.held:
            lines.append(f"combinations that the measurements do not tell, which kept their start: {self.held}")
        lines += [f"not told apart: {text}" for text in self.unidentifiable]
        return [*parts, "\n".join(lines)]

    def _intervals(self, uncertainty: Uncertainty) -> dict[str, tuple[float, float]]:
        ends = uncertainty.intervals(self.solution, [one.logarithmic for one in self.parameters])
        return {name: (low, high) for name, (low, high) in zip(self.names, ends.tolist(), strict=True)}

    def _covariance(self, uncertainty: Uncertainty) -> FloatArray:
        rates = np.where([one.logarithmic for one in self.parameters], self.solution, 1.0)
        return np.asarray(uncertainty.covariance * np.outer(rates, rates))


def identification_of(fit: Fit, aside: Any) -> Identification:
    """Return the result of a fit, with predictions of what was kept aside: measurements, rows of the same course, or None."""
    predictor, weights = fit.predictor, fit.weights
    (prediction, residuals, slopes, information), parameters = fit.at_end(), predictor.parameters
    less = np.sqrt(rho(fit.loss, residuals**2)[1])  # a robust loss weighs rows
    rows, labels = weights.rows(), predictor.measurements.labels
    blocks = rows if labels is None else np.unique(np.array(labels), return_inverse=True)[1][rows]
    weighted, downweighted = slopes * less[:, None], residuals * less
    named = list(zip(parameters.parameters, fit.values.tolist(), strict=True))
    try:
        by_rows = uncertainty_from_rows(weighted, downweighted, prior=information, std_known=weights.known)
    except ParameterError:  # as many parameters as numbers: nothing tells the size of the errors
        by_rows = Uncertainty(np.zeros((len(information),) * 2), np.inf, np.zeros(len(information), dtype=bool))
    several = len(set(blocks.tolist())) > 1
    by_blocks = uncertainty_from_blocks(weighted, downweighted, blocks, prior=information) if several else None
    size = 1.0 if weights.known else max(float(np.sqrt(np.sum(downweighted**2) / max(len(rows) - len(named), 1))), 1e-12)
    found = find_gauges(weighted / size, [replace(one, value=value) for one, value in named], prior=information / size**2)
    worst = outliers(slopes, residuals, prior=information)
    means = {predictor.parameters.names[i]: pair for i, *pair in zip(*map(np.ndarray.tolist, fit.prior), strict=True)}
    validation = None
    if isinstance(aside, Measurements):
        predicting = Predictor(parameters, aside, gaps=True)
        others = predicting.at(fit.values)
        for seen in others.seen.values():
            seen.values[predicting.lost] = seen.difference[predicting.lost] = np.nan
        validation = _comparison(aside, others, {key: np.ones(one.shape, bool) for key, one in others.differences().items()})
    elif aside is not None:
        residuals_aside = {key: one[aside] for key, one in prediction.differences().items()}
        predicted = {key: seen.values[aside] for key, seen in prediction.seen.items()}
        validation = Comparison(predictor.measurements[aside], predicted, residuals_aside, prediction.at.states.rows(aside))
    return Identification(
        model=prediction.model,
        parameters=parameters.parameters,
        solution=read_only(fit.values),
        by_rows=by_rows,
        by_blocks=by_blocks,
        fitted=_comparison(predictor.measurements, prediction, weights.counted),
        validation=validation,
        outliers=tuple(dict.fromkeys(rows[worst].tolist())),
        unidentifiable=tuple(one.text for one in found),
        held=fit.held,
        history=History(*(read_only(np.array(column)) for column in zip(*fit.course, strict=True))),
        priors={name: (float(mean), float(std)) for name, (mean, std) in means.items()},
        loss=fit.loss,
        message=fit.message,
    )


def _comparison(measurements: Measurements, prediction: Any, counted: Mapping[str, Any]) -> Comparison:
    """Measurements beside a prediction; residuals of what does not count are NaN."""
    residuals = {key: np.where(counted[key], values, np.nan) for key, values in prediction.differences().items()}
    predicted = {key: seen.values for key, seen in prediction.seen.items()}
    return Comparison(measurements, predicted, residuals, prediction.at.states)


def _interval(ends: tuple[float, float] | None) -> str:
    return "" if ends is None else f"{ends[0]:.5g} .. {ends[1]:.5g}" if np.isfinite(ends).all() else "not determined"
