r"""Stumpff functions: sine and cosine divided by powers of their angle, smooth at zero.

.. math:: c_k(x) = \sum_{j \ge 0} \frac{(-x)^j}{(2j + k)!}, \qquad x = \theta^2

so that `c_0 = cos(theta)`, `c_1 = sin(theta)/theta`, `c_2 = (1 - cos(theta))/theta^2`, `c_3 = (theta - sin(theta))/theta^3`.
Arcs and screws are sums of them, and so are all derivatives: `dc_k/dx = (k c_{k+2} - c_{k+1}) / 2`. There is no division by an
angle, so that the straight configuration is no special case.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from softrobots.core.checks import FloatArray, read_only

_SERIES_UP_TO = 40.0  # largest x for the series; its terms decrease from the first on
_TERMS = ((1.0, 9), (8.0, 14), (_SERIES_UP_TO, 24))  # (largest x, number of terms)


def stumpff(x: FloatArray, highest: int) -> FloatArray:
    """Evaluate `c_0` to `c_highest` at squares of the angle [rad^2], not negative: shape (highest + 1, *x.shape).

    Up to an angle of 2 pi the two highest functions come from their alternating series, the others from the downward recursion
    `c_k = 1/k! - x c_{k+2}`; beyond, all come from sine and cosine by upward recursion. Both are accurate to rounding.
    """
    values = np.zeros((highest + 1, *x.shape))
    small = np.minimum(x, _SERIES_UP_TO)
    largest = float(small.max(initial=0.0))
    terms = next((count for bound, count in _TERMS if largest <= bound), _TERMS[-1][1])
    total = np.ones((2, small.size))
    for ratio in small.ravel() / _divisors(highest, terms):
        total = 1.0 - ratio * total
    for one, k in zip(total, (highest, highest - 1), strict=True):
        values[k] = one.reshape(small.shape) / math.factorial(k)
    for k in range(highest - 2, -1, -1):
        values[k] = 1.0 / math.factorial(k) - small * values[k + 2]
    large = x > _SERIES_UP_TO
    if np.any(large):
        angle = np.sqrt(x[large])
        upwards = [np.cos(angle), np.sin(angle) / angle]
        for k in range(highest - 1):
            upwards.append((1.0 / math.factorial(k) - upwards[k]) / x[large])
        values[:, large] = upwards
    return values


@lru_cache(maxsize=64)
def _divisors(highest: int, terms: int) -> FloatArray:
    """Of each term of the series of the two highest functions by the term before it, last term first, shape (terms, 2, 1)."""
    rows = [[[(2 * j + k) * (2 * j + k - 1)] for k in (highest, highest - 1)] for j in range(terms, 0, -1)]
    return read_only(np.array(rows, dtype=np.float64))
