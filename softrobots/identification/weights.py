"""What counts in a fit, and how much: standard deviations of what was measured, and what is known of parameters before."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray

_LEAST = 1e-9  # of an unknown standard deviation, relative to the differences at the start
_ROUNDING = 1e-9  # least such differences, in the unit of the quantity: a start that is exact says nothing of the errors


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
        return start._rescaled(differences, lambda numbers: max(float(np.sqrt(np.mean(numbers**2))), _ROUNDING))

    def of_more(self, given: Mapping[str, FloatArray], differences: Mapping[str, FloatArray], rows: Any) -> Weights:
        """Return those of more rows, with arguments as of `of`; standard deviations that are not known stay as they are."""
        std = {key: np.broadcast_to(self.std[key][0], values.shape) for key, values in differences.items()}
        counted = {key: np.isfinite(values) & rows[:, None] for key, values in differences.items()}
        return Weights(std | dict(given), counted, self.given)

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


def rho(loss: str, z: FloatArray) -> FloatArray:
    """Return a loss of squared residuals, one of SciPy's `least_squares`, and its two derivatives, shape (3, rows)."""
    one, none, near = np.ones_like(z), np.zeros_like(z), np.minimum(z, 1e60)  # whose powers do not overflow
    if loss == "soft_l1":
        return np.array([2.0 * (np.sqrt(1.0 + z) - 1.0), (1.0 + z) ** -0.5, -0.5 * (1.0 + z) ** -1.5])
    if loss == "huber":
        far = np.maximum(z, 1.0)
        return np.where(z <= 1.0, [z, one, none], [2.0 * far**0.5 - 1.0, far**-0.5, -0.5 * far**-1.5])
    if loss == "cauchy":
        return np.array([np.log1p(z), 1.0 / (1.0 + near), -1.0 / (1.0 + near) ** 2])
    if loss == "arctan":
        return np.array([np.arctan(z), 1.0 / (1.0 + near**2), -2.0 * near / (1.0 + near**2) ** 2])
    return np.array([z, one, none])
