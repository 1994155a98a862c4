"""One least-squares fit: rows in standard deviations, their Jacobian by the fitted coordinates, and the search.

The fitted coordinates are the parameters, and the logarithms of positive ones. Rows are what was measured minus what is
predicted; then what is known before, priors; then the combinations that keep their start: those that change no prediction,
and those that noise hides, where a search runs off along them without a gain that is more than noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.identification.prediction import Prediction, Predictor
from softrobots.identification.uncertainty import UNDETERMINED, scaled_directions
from softrobots.identification.weights import Prior, Weights, rho

INTERRUPTED = "interrupted: the best values up to then"
"""Message of a fit that Ctrl-C has ended."""

_ROUNDS = 6  # most searches, each with derivatives of the model's numbers of where the last one ended
_FARTHEST = 100.0  # factor by which a search changes a positive parameter at most; the next one goes on
_RUN_OFF = np.log(10.0)  # change along a combination with a standard deviation above 100 % beyond which a search runs off
_GAIN = 2.0  # of the cost, in variances, that makes up for that: two standard deviations
_NEAR, _NEARLY = 0.01, 0.1  # change of the parameters, relative, up to which those are good enough on the way, and at first
_ROUGH = 1e-3  # share of the cost that a further step may gain where a first search ends
_SAME = 1e-8  # share of the cost that a further step may gain at the end: 0.005 standard errors with 1000 rows
_SAME_RUBBING = 1e-5  # the same of a robot with dry friction: where rows begin to slip, the cost has kinks
_ROUNDING = 1e-22  # share of the first cost that is rounding
_WITHOUT_NOISE = 1e-12  # share of the first cost below which the rows have no noise: then all digits are looked for
_KEPT = 1e-6  # change along a combination, of logarithms or in units, that is none
_AT_BOUND = 1e-9  # distance from a bound that is none
_PATIENCE = 10  # steps of a search before full steps are tried
_GAINED = 1e-4  # share of the cost that such a round of steps gains, or is idle
_IDLE = 2  # idle rounds in a row after which a search ends
_LEAPS = 6  # full steps in a row
_SHORT = 1e-3  # share of a full step that is short
_MOST_LOST = 0.9  # share of a positive parameter, or of its inverse, that such a step takes

Stage = Literal["first", "last", "whole"]
"""Of a search: the first, of few rows, which ends early; the last, which begins near, with full steps; or the only one."""


class Fit:
    """A search from one start; `message`, `course` and `values` tell how it ended."""

    def __init__(
        self, predictor: Predictor, weights: Weights, prior: Prior, loss: str, steps: Iterator[Any], stage: Stage = "whole"
    ) -> None:
        """Take predictions, weights, prior, loss, an iterator that is advanced at every step, and the stage of the search."""
        self.predictor, self.weights, self.prior, self.loss, self._steps = predictor, weights, prior, loss, steps
        self._stage, chosen = stage, predictor.parameters
        self._logarithmic, self._coordinates, self._values = chosen.logarithmic, chosen.coordinates, chosen.at_coordinates
        self._same = _SAME if chosen.present.structure.friction is None else _SAME_RUBBING
        self._held = self._weak = np.zeros((0, len(self._logarithmic)))
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
        x = self._coordinates(start)
        self._anchor = self._weak_anchor = self._middle = x
        self._refresh(x)
        self._held = self._null(x)
        try:
            x = self._search(x, most)
            weak, least = self._run_off(x), self._cost(x)
            if len(weak):
                far, self._weak = x, weak
                x = self._search(x - weak.T @ (weak @ (x - self._anchor)), most)
                if self._cost(x) > least + _GAIN * self._variance(far):
                    self._weak_anchor = far
                    x = self._search(far, most)
            self._record(x)
        except KeyboardInterrupt:
            self.message = INTERRUPTED
            self.course = self.course or [(np.inf, start)]
            self._refresh(self._coordinates(self.values))

    def _search(self, x: FloatArray, most: int) -> FloatArray:
        """Search from given coordinates until a step gains nothing, or runs off; return where it ends, shape (P,)."""
        from scipy.optimize import least_squares

        bounds = self.predictor.parameters.coordinate_bounds
        x, rounds, spent, settled = np.clip(x, *bounds), 0, 0, False
        leaps, idle, best = self._stage == "last", 0, (np.inf, x, self._held)
        while rounds < _ROUNDS and spent < most:
            left, self._middle = min(most - spent, _PATIENCE), x
            if leaps:
                self._record(x)
            else:
                found = least_squares(
                    self._rows, x, self._jacobian, bounds, x_scale="jac", loss=self._loss, xtol=1e-9, gtol=1e-12, max_nfev=left,
                    ftol=_ROUGH if self._stage == "first" else self._same,
                )  # fmt: skip
                x, spent, settled = found.x, spent + found.nfev, found.status > 0
            if settled and self._stage == "first":
                break
            rounds, leaps = rounds + (settled or leaps), False
            if self._exact_at is not x:
                self._refresh(x)
            lowest = self._is_lowest(x, *bounds)
            if not lowest or self._cost(x) <= _WITHOUT_NOISE * self.course[0][0]:
                x = self._leap(x, *bounds)
                lowest = self._is_lowest(x, *bounds)
            self.message = "converged" if settled or lowest else f"not converged in {most} steps"
            held, cost = self._null(x), self._cost(x)
            if (lowest and len(held) == len(self._held)) or (not len(self._weak) and len(self._run_off(x))):
                break
            idle = 0 if cost < (1.0 - _GAINED) * best[0] else idle + 1
            best = min(best, (cost, x, self._held), key=lambda one: one[0])
            if idle == _IDLE:
                x, self._held = best[1:]
                if not settled:
                    kink = self._is_kinked(x, *bounds)
                    self.message = "converged" if kink else f"not converged: the last of {spent} steps gained nothing"
                break
            self._held = held
        return x

    def _leap(self, x: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
        """Take full steps of Gauss and Newton, the first of which may lose; return the best coordinates, shape (P,).

        In a narrow valley that bends, where steps of which each gains are short, a full step leaves it and the next one finds
        it again farther on. Without noise they also find all digits that rounding leaves.
        """
        best, costs = x, [self._cost(x)]
        while len(costs) <= _LEAPS and (len(costs) < 3 or costs[-1] < costs[-2] * (1.0 - self._same)):
            tried = list[tuple[float, FloatArray]]()
            for end in self._full_steps(x, lower, upper):
                tried.append((self._cost(end), end))
                if tried[-1][0] < costs[-1]:
                    break
            cost, x = min(tried, key=lambda one: one[0])
            if not np.isfinite(cost):
                break
            self._refresh(x)
            costs.append(self._cost(x))
            best = x if costs[-1] < min(costs[:-1]) else best
        if best is not x:
            self._refresh(best)
        return best

    def _full_steps(self, x: FloatArray, lower: FloatArray, upper: FloatArray) -> Iterator[FloatArray]:
        """Yield where full steps within the bounds end, shape (P,): along the parameters, the coordinates, inverse parameters.

        A valley that bends in logarithms is straight in the parameters where these add up (masses), or in their inverses
        (compliances); along it positive ones lose no more than nine tenths.
        """
        from scipy.optimize import lsq_linear

        rows, slopes = self._weighed(x)
        norms = np.linalg.norm(slopes, axis=0)
        norms[norms == 0.0] = 1.0
        small: FloatArray = np.linalg.qr(np.column_stack([slopes / norms, rows]), mode="r")  # type: ignore[assignment]
        for power in (1, 0, -1):
            most = np.where(self._logarithmic, _MOST_LOST, np.inf)
            low = np.maximum(lower - x, -most if power > 0 else -np.inf)
            high = np.minimum(upper - x, most if power < 0 else np.inf)
            step = lsq_linear(small[:, :-1], -small[:, -1], (low * norms, high * norms), method="bvls").x / norms
            if power:
                step[self._logarithmic] = power * np.log1p(power * step[self._logarithmic])
            yield np.clip(x + step, lower, upper)

    def at_end(self) -> tuple[Prediction, FloatArray, FloatArray, FloatArray]:
        """Return the prediction, residuals of what counts, (rows,), their Jacobian, (rows, P), and the priors' information."""
        x = self._coordinates(self.values)
        prediction = self.predictor.at(self._values(x))
        return prediction, self.weights.flat(prediction.differences()), self._slopes(x), self._information(x)

    @property
    def held(self) -> int:
        """Number of combinations that change no prediction, or that noise hides, which kept the robot's values.

        Others have moved: where a search gained by running off, or began elsewhere (a mounted base, another start).
        """
        moved = self._coordinates(self.values) - self._coordinates(self.predictor.parameters.values)
        rows = np.concatenate([self._held, self._weak])
        change = np.abs(rows @ moved) / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
        return int(np.count_nonzero(change <= _KEPT))

    def _information(self, x: FloatArray) -> FloatArray:
        """One over the squares of the standard deviations of the priors, in the fitted coordinates."""
        found: FloatArray = np.zeros(len(x))
        found[self.prior.places] = (self._rates(x)[self.prior.places] / self.prior.std) ** 2
        return found

    def _rates(self, x: FloatArray) -> FloatArray:
        """Derivative of the parameters by their coordinates."""
        return np.where(self._logarithmic, self._values(x), 1.0)

    def _slopes(self, x: FloatArray) -> FloatArray:
        if self._known is None or self._known[0] is not self.predictor.change or not np.array_equal(self._known[1], x):
            slopes = self.weights.flat(self.predictor.at(self._values(x)).slopes()) * self._rates(x)
            self._known = self.predictor.change, x, np.asarray(slopes)
        return self._known[2]

    def _rows(self, x: FloatArray) -> FloatArray:
        """All rows; infinite where the robot refuses the values or has no equilibrium, so that the step is refused."""
        if np.any(self._logarithmic & (np.abs(x - self._middle) > np.log(_FARTHEST))):
            return np.full(self._count, np.inf)
        try:
            prediction = self.predictor.at(self._values(x))
        except (SoftRobotsError, ArithmeticError):
            return np.full(self._count, np.inf)
        data = self.weights.flat(prediction.differences())
        known = (self.prior.mean - prediction.values[self.prior.places]) / self.prior.std
        self._count, self._linear = len(data) + len(known) + len(self._held) + len(self._weak), len(data)
        return np.concatenate([data, known, self._held @ (x - self._anchor), self._weak @ (x - self._weak_anchor)])

    def _jacobian(self, x: FloatArray) -> FloatArray:
        change = np.abs(x - self._exact_at) / np.where(self._logarithmic, 1.0, np.maximum(np.abs(x), 1.0))
        if np.max(change * self.predictor.parameters.of_model) > (_NEARLY if self._stage == "first" else _NEAR):
            self._refresh(x)
        self._record(x)
        next(self._steps)
        return self._all_slopes(x)

    def _all_slopes(self, x: FloatArray) -> FloatArray:
        known = -np.diag(self._rates(x))[self.prior.places] / self.prior.std[:, None]
        return np.concatenate([self._slopes(x), known, self._held, self._weak])

    def _record(self, x: FloatArray) -> None:
        self.course.append((self._cost(x), self._values(x)))

    def _cost(self, x: FloatArray) -> float:
        return 0.5 * float(self._loss(self._rows(x) ** 2)[0].sum())

    def _variance(self, x: FloatArray) -> float:
        """Variance of rows: 1 where standard deviations are known, else from the cost."""
        return 1.0 if self.weights.known else 2.0 * self._cost(x) / max(self._linear - len(x), 1)

    def _run_off(self, x: FloatArray) -> FloatArray:
        """Combinations that noise hides along which a search has gone far, in rows of norm 1, shape (k, P)."""
        stacked = np.vstack([self._slopes(x), np.diag(np.sqrt(self._information(x)))])
        _, singular, right = np.linalg.svd(stacked * self._logarithmic, full_matrices=False)
        hidden = right[singular < np.sqrt(self._variance(x))]
        return np.asarray(hidden[np.abs(hidden @ ((x - self._anchor) * self._logarithmic)) > _RUN_OFF])

    def _is_lowest(self, x: FloatArray, lower: FloatArray, upper: FloatArray) -> bool:
        """Whether a step of Gauss and Newton with exact derivatives, along bounds, lowers the cost by no more than rounding."""
        rows, slopes = self._weighed(x)
        downhill = -(slopes.T @ rows)
        stopped = ((x - lower < _AT_BOUND) & (downhill < 0.0)) | ((upper - x < _AT_BOUND) & (downhill > 0.0))
        gain, cost = float(np.sum((np.linalg.qr(slopes[:, ~stopped])[0].T @ rows) ** 2)), float(rows @ rows)
        if self._same == _SAME_RUBBING and cost > 1e-6 * self.course[0][0]:
            return True  # kinks leave such steps a gain that they do not have
        return gain <= self._same * cost or cost <= _ROUNDING * self.course[0][0]

    def _is_kinked(self, x: FloatArray, lower: FloatArray, upper: FloatArray) -> bool:
        """Whether a short step gains less than half of what derivatives promise, as at a kink, where a tendon goes slack."""
        rows, slopes = self._weighed(x)
        step = _SHORT * (list(self._full_steps(x, lower, upper))[1] - x)
        return self._cost(x) - self._cost(x + step) < -0.5 * float(rows @ (slopes @ step))

    def _weighed(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """All rows and their derivatives, times the square root of how much the square of each counts."""
        rows = self._rows(x)
        size = np.sqrt(self._loss(rows**2)[1])
        return rows * size, self._all_slopes(x) * size[:, None]

    def _loss(self, z: FloatArray) -> FloatArray:
        """The loss of what was measured; priors and held combinations are squared."""
        return np.concatenate([rho(self.loss, z[: self._linear]), rho("linear", z[self._linear :])], axis=1)

    def _refresh(self, x: FloatArray) -> None:
        self._exact_at = x
        self.predictor.at(self._values(x))
        self.predictor.refresh(self._values(x))

    def _null(self, x: FloatArray) -> FloatArray:
        """Rows that hold the combinations that neither measurements nor priors tell, shape (k, P)."""
        slopes = self._slopes(x)
        scale, singular, right = scaled_directions(slopes, self._information(x))
        lost = right[singular <= UNDETERMINED * singular.max(initial=0.0)] * np.where(scale > 0.0, scale, 1.0)
        return np.asarray(np.linalg.qr(lost.T)[0].T * max(float(np.linalg.norm(slopes)), 1.0))
