"""One least-squares fit: rows in standard deviations, their Jacobian by the fitted coordinates, and the search.

The fitted coordinates are the parameters, and the logarithms of positive ones. Rows are what was measured minus what is
predicted; then what is known before, priors; then the combinations that change no prediction, which keep their start.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.identification.prediction import Prediction, Predictor
from softrobots.identification.uncertainty import UNDETERMINED, scaled_directions

INTERRUPTED = "interrupted: the best values up to then"
"""Message of a fit that Ctrl-C has ended."""

_ROUNDS = 6  # most searches, each with derivatives of the model's numbers of where the last one ended
_FARTHEST = 100.0  # factor by which a search changes a positive parameter at most; the next one goes on
_NEAR = 0.01  # change of the parameters, relative, up to which those derivatives are good enough on the way
_SAME = 1e-8  # share of the cost that a further step may gain at the end: 0.005 standard errors with 1000 rows
_SAME_RUBBING = 1e-5  # the same of a robot with dry friction: where rows begin to slip, the cost has kinks
_ROUNDING = 1e-22  # share of the first cost that is rounding
_LEAST = 1e-9  # of an unknown standard deviation, relative to the differences at the start


def rho(loss: str, z: FloatArray) -> FloatArray:
    """Return a loss of squared residuals, one of SciPy's `least_squares`, and its two derivatives, shape (3, rows)."""
    one = np.ones_like(z)
    if loss == "soft_l1":
        return np.array([2.0 * (np.sqrt(1.0 + z) - 1.0), (1.0 + z) ** -0.5, -0.5 * (1.0 + z) ** -1.5])
    if loss == "huber":
        far = np.maximum(z, 1.0)
        return np.where(z <= 1.0, [z, one, 0.0 * z], [2.0 * far**0.5 - 1.0, far**-0.5, -0.5 * far**-1.5])
    if loss == "cauchy":
        return np.array([np.log1p(z), 1.0 / (1.0 + z), -1.0 / (1.0 + z) ** 2])
    if loss == "arctan":
        return np.array([np.arctan(z), 1.0 / (1.0 + z**2), -2.0 * z / (1.0 + z**2) ** 2])
    return np.array([z, one, 0.0 * z])


@dataclass(frozen=True)
class Weights:
    """Standard deviations of what was measured, and what counts."""

    std: Mapping[str, FloatArray]
    """By quantity, shape (n, k)."""
    counted: Mapping[str, Any]
    """Which numbers are there, in rows that count, shape (n, k), truth values."""
    given: frozenset[str]
    """Quantities whose standard deviations are known."""

    @classmethod
    def of(cls, given: Mapping[str, FloatArray], differences: Mapping[str, FloatArray], rows: Any) -> Weights:
        """Take them as given by quantity; for others the root mean square of measured minus predicted at the start.

        Args:
            given: Standard deviations that are known.
            differences: Measured minus predicted at the start, by quantity, shape (n, k).
            rows: Rows that count, shape (n,).
        """
        counted = {key: np.isfinite(values) & rows[:, None] for key, values in differences.items()}
        start = cls(
            {key: given.get(key, np.ones_like(values)) for key, values in differences.items()}, counted, frozenset(given)
        )
        return start._rescaled(differences, lambda numbers: float(np.sqrt(np.mean(numbers**2))) or 1.0)

    def every(self, step: int) -> Weights:
        """Return those of every row whose number is a multiple of a step."""
        std, counted = ({key: one[::step] for key, one in part.items()} for part in (self.std, self.counted))
        return Weights(std, counted, self.given)

    def estimated(self, differences: Mapping[str, FloatArray]) -> Weights:
        """Return weights in which the robust spread of residuals is the standard deviation that is not known."""
        return self._rescaled(differences, lambda numbers: max(1.4826 * float(np.median(np.abs(numbers))), _LEAST))

    def _rescaled(self, differences: Mapping[str, FloatArray], spread: Any) -> Weights:
        std = {key: np.array(values) for key, values in self.std.items()}
        for key in std.keys() - self.given:
            for columns in [slice(0, 3), slice(3, 6)] if key.startswith("poses.") else [slice(None)]:
                numbers = (differences[key] / std[key])[:, columns][self.counted[key][:, columns]]
                std[key][:, columns] *= spread(numbers) if numbers.size else 1.0
        return Weights(std, self.counted, self.given)

    @property
    def known(self) -> bool:
        """Whether all standard deviations are known."""
        return self.given >= self.std.keys()

    def flat(self, by_quantity: Mapping[str, FloatArray]) -> FloatArray:
        """Return what counts of differences (n, k), or of their derivatives (n, k, P), in standard deviations, rows first."""
        parts = []
        for key, values in by_quantity.items():
            std = self.std[key] if values.ndim == 2 else self.std[key][..., None]
            parts.append((values / std)[self.counted[key]])
        return np.concatenate(parts)

    def rows(self) -> Any:
        """Return the measured row of each of those numbers, shape (rows,)."""
        return np.concatenate([np.nonzero(counted)[0] for counted in self.counted.values()])


class Prior(NamedTuple):
    """What is known of parameters before."""

    places: Any
    """Numbers of the parameters, from 0, shape (k,)."""
    mean: FloatArray
    """Means, shape (k,)."""
    std: FloatArray
    """Standard deviations, shape (k,)."""


class Fit:
    """A search from one start; `message`, `course` and `values` tell how it ended."""

    def __init__(self, predictor: Predictor, weights: Weights, prior: Prior, loss: str, steps: Iterator[Any]) -> None:
        """Take predictions, weights, prior, loss, and an iterator that is advanced at every step."""
        self.predictor, self.weights, self.prior, self.loss, self._steps = predictor, weights, prior, loss, steps
        self._logarithmic = predictor.parameters.logarithmic
        self._same = _SAME if predictor.parameters.present.structure.friction is None else _SAME_RUBBING
        self._held = np.zeros((0, len(self._logarithmic)))
        self._count = self._linear = 0
        self._known: tuple[Any, FloatArray, FloatArray] | None = None
        self.course: list[tuple[float, FloatArray]] = []
        """Cost and values at every step."""
        self.message = ""
        """How the search ended."""

    @property
    def cost(self) -> float:
        """Half the sum of the losses at the end."""
        return self.course[-1][0]

    @property
    def values(self) -> FloatArray:
        """Values of the parameters at the end, shape (P,)."""
        return self.course[-1][1]

    def run(self, start: FloatArray, most: int) -> None:
        """Search from given values, shape (P,), in at most so many steps; with none, stay there.

        Raises:
            SoftRobotsError: If the robot refuses these values, or rows have no equilibrium there; names them.
        """
        from scipy.optimize import least_squares

        x = self._coordinates(start)
        self._anchor = self._middle = x
        self._refresh(x)
        self._held = self._null(x)
        limits = self.predictor.parameters
        with np.errstate(divide="ignore"):
            bounds = [self._coordinates(np.maximum(ends, np.where(self._logarithmic, 0.0, -np.inf)))
                      for ends in (limits.lower, limits.upper)]  # fmt: skip
        try:
            for _ in range(_ROUNDS if most else 0):
                left, self._middle = max(1, most - len(self.course)), x
                found = least_squares(
                    self._rows, x, self._jacobian, bounds, x_scale="jac", loss=self._loss, ftol=self._same, xtol=1e-9,
                    gtol=1e-12, max_nfev=left,
                )  # fmt: skip
                x, self.message = found.x, "converged" if found.status > 0 else f"not converged in {most} steps"
                if self._exact_at is not x:
                    self._refresh(x)
                held = self._null(x)
                if found.status == 0 or (len(held) == len(self._held) and self._is_lowest(x)):
                    break
                self._held = held
            self._record(x)
        except KeyboardInterrupt:
            self.message = INTERRUPTED
            self.course = self.course or [(np.inf, start)]
            self._refresh(self._coordinates(self.values))

    def at_end(self) -> tuple[Prediction, FloatArray, FloatArray]:
        """Return the prediction at the end, the residuals of what counts, (rows,), and their Jacobian, (rows, P)."""
        x = self._coordinates(self.values)
        prediction = self._at(x)
        return prediction, self.weights.flat(prediction.differences()), self._slopes(x)

    def loss_slopes(self, residuals: FloatArray) -> FloatArray:
        """Return how much less than its square each residual counts, shape (rows,)."""
        return np.asarray(rho(self.loss, residuals**2)[1])

    @property
    def held(self) -> int:
        """Number of combinations of parameters that kept their start."""
        return len(self._held)

    @property
    def information(self) -> FloatArray:
        """One over the square of the standard deviations of the priors, in the fitted coordinates, shape (P,)."""
        found: FloatArray = np.zeros(len(self._logarithmic))
        found[self.prior.places] = (self._rates(self._coordinates(self.values))[self.prior.places] / self.prior.std) ** 2
        return found

    def _coordinates(self, values: FloatArray) -> FloatArray:
        return np.where(self._logarithmic, np.log(np.where(self._logarithmic, values, 1.0)), values)

    def _values(self, x: FloatArray) -> FloatArray:
        with np.errstate(over="ignore"):  # the robot refuses what is infinite
            return np.where(self._logarithmic, np.exp(np.where(self._logarithmic, x, 0.0)), x)

    def _rates(self, x: FloatArray) -> FloatArray:
        """Derivative of the parameters by their coordinates."""
        return np.where(self._logarithmic, self._values(x), 1.0)

    def _at(self, x: FloatArray) -> Prediction:
        return self.predictor.at(self._values(x))

    def _slopes(self, x: FloatArray) -> FloatArray:
        if self._known is None or self._known[0] is not self.predictor.change or not np.array_equal(self._known[1], x):
            slopes = self.weights.flat(self._at(x).slopes()) * self._rates(x)
            self._known = self.predictor.change, x, np.asarray(slopes)
        return self._known[2]

    def _rows(self, x: FloatArray) -> FloatArray:
        """All rows; infinite where the robot refuses the values or has no equilibrium, so that the step is refused."""
        if np.any(self._logarithmic & (np.abs(x - self._middle) > np.log(_FARTHEST))):
            return np.full(self._count, np.inf)
        try:
            prediction = self._at(x)
        except (SoftRobotsError, ArithmeticError):
            return np.full(self._count, np.inf)
        data = self.weights.flat(prediction.differences())
        known = (self.prior.mean - prediction.values[self.prior.places]) / self.prior.std
        self._count, self._linear = len(data) + len(known) + len(self._held), len(data)
        return np.concatenate([data, known, self._held @ (x - self._anchor)])

    def _jacobian(self, x: FloatArray) -> FloatArray:
        if self._moved(x) > _NEAR:
            self._refresh(x)
        self._record(x)
        next(self._steps)
        return self._all_slopes(x)

    def _all_slopes(self, x: FloatArray) -> FloatArray:
        places = self.prior.places
        known = np.zeros((len(places), len(x)))
        known[np.arange(len(places)), places] = -self._rates(x)[places] / self.prior.std
        return np.concatenate([self._slopes(x), known, self._held])

    def _record(self, x: FloatArray) -> None:
        self.course.append((0.5 * float(self._loss(self._rows(x) ** 2)[0].sum()), self._values(x)))

    def _is_lowest(self, x: FloatArray) -> bool:
        """Whether a step of Gauss and Newton with exact derivatives would lower the cost by no more than rounding does."""
        rows, slopes = self._rows(x), self._all_slopes(x)
        size = np.sqrt(self._loss(rows**2)[1])
        left = np.linalg.qr(slopes * size[:, None])[0]
        gain, cost = float(np.sum((left.T @ (rows * size)) ** 2)), float(np.sum((rows * size) ** 2))
        if self._same == _SAME_RUBBING and cost > 1e-6 * self.course[0][0]:
            return True  # kinks leave such steps a gain that they do not have
        return gain <= self._same * cost or cost <= _ROUNDING * self.course[0][0]

    def _loss(self, z: FloatArray) -> FloatArray:
        """The loss of what was measured; priors and held combinations are squared."""
        return np.concatenate([rho(self.loss, z[: self._linear]), rho("linear", z[self._linear :])], axis=1)

    def _moved(self, x: FloatArray) -> float:
        """Largest change of a parameter of the model since the numbers of the model were differentiated."""
        change = np.abs(x - self._exact_at) / np.where(self._logarithmic, 1.0, np.maximum(np.abs(x), 1.0))
        return float(np.max(change * self.predictor.parameters.of_model))

    def _refresh(self, x: FloatArray) -> None:
        self._exact_at = x
        self._at(x)
        self.predictor.refresh(self._values(x))

    def _null(self, x: FloatArray) -> FloatArray:
        """Rows that hold the combinations that neither measurements nor priors tell, shape (k, P)."""
        slopes, information = self._slopes(x), np.zeros(len(x))
        information[self.prior.places] = (self._rates(x)[self.prior.places] / self.prior.std) ** 2
        scale, singular, right = scaled_directions(slopes, information)
        lost = right[singular <= UNDETERMINED * singular.max(initial=0.0)] * np.where(scale > 0.0, scale, 1.0)
        return np.asarray(np.linalg.qr(lost.T)[0].T * max(float(np.linalg.norm(slopes)), 1.0))
