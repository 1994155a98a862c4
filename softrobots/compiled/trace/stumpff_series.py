"""Stumpff functions of a traced argument; defined in `softrobots.constant_curvature.stumpff`."""

from __future__ import annotations

import math

from softrobots.compiled.trace.expressions import Scalar

LARGEST = 20.0
"""Largest squared angle [rad^2] of the series; a section that is bent and twisted by half a turn has 19.7."""

_TERMS = 14  # the first omitted one is below 1e-18 of the sum at the largest argument


def stumpff(x: Scalar, highest: int) -> list[Scalar]:
    """Evaluate `c_0` to `c_highest` at a squared angle up to `LARGEST`.

    The two highest come from their series, the others from `c_k = 1/k! - x c_(k+2)`.
    """
    values: list[Scalar] = [0.0] * (highest + 1)
    for k in (highest, highest - 1):
        total: Scalar = 0.0
        for j in reversed(range(_TERMS)):
            total = total * x + (-1.0) ** j / math.factorial(2 * j + k)
        values[k] = total
    for k in reversed(range(highest - 1)):
        values[k] = 1.0 / math.factorial(k) - x * values[k + 2]
    return values
