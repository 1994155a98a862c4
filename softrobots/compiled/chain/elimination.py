r"""Newton steps in linear time: elimination of the coordinates from the tip to the base.

The tangent stiffness couples a coordinate `j` with every coordinate `i` nearer to the base by :math:`-\omega_i \cdot c_j`
(`softrobots.compiled.chain.elements`), three numbers: a matrix whose off-diagonal blocks have rank three. Elimination
of the coordinates from the tip on keeps that form. With the sums `P` (3 x 3) and `s` (3) of the coordinates already eliminated,
the next element has

.. math:: C = c + P \Omega, \quad D = K - \Omega^T P \Omega, \quad g' = g + \Omega^T s

and hands on :math:`P + C D^{-1} C^T` and :math:`s + C D^{-1} g'`. In the step pass
:math:`x = D^{-1} (C^T \varphi - g')` with the turn :math:`\varphi = \sum \Omega x` of all elements nearer to the base.
`D = L D' L^T` has the pivots: if all are positive, the tangent stiffness is positive definite.

Given muscle lengths constrain sums of coordinates. Their multipliers are further components of the turn, until they are
eliminated at the base of their segment, with a pivot that must be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import constants, vector
from softrobots.compiled.settings import POSITIVE_PIVOT
from softrobots.compiled.trace.complex_numbers import real_part
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger, smaller


@dataclass
class Outboard:
    """Sums of the outboard elements; `n` is three plus the number of multipliers of the segment."""

    matrix: Any
    """`P`, shape (n, n), symmetric."""
    columns: list[Any]
    """`s` of each right-hand side, shape (n,)."""
    min_pivot: Scalar
    """Smallest pivot in size, relative to the springs' own stiffness."""
    n_negative_pivots: Scalar
    """Number of pivots that are negative, by more than rounding."""

    def resized(self, n: int) -> Outboard:
        """Return the sums with the first `n` components, new ones zero."""
        rows = np.array([resized(row, n) for row in self.matrix], dtype=object)
        matrix = np.array([resized(column, n) for column in rows.T], dtype=object).T
        return Outboard(matrix, [resized(one, n) for one in self.columns], self.min_pivot, self.n_negative_pivots)

    @classmethod
    def tip(cls, right_hand_sides: int) -> Outboard:
        """Return the sums at the tip: no elements."""
        return cls(constants(np.zeros((3, 3))), [constants(np.zeros(3)) for _ in range(right_hand_sides)], 1.0, 0.0)


@dataclass
class RouteSums:
    """What actuators on routes add to an element of `k` coordinates; see `softrobots.compiled.routes.terms`."""

    load: Any
    """Derivative of their energy by the coordinates, shape (k,)."""
    curvature: Any
    """Tensions times second derivatives of the lengths, shape (k, k)."""
    push: Any
    """`P` between the turn and the lengths times the slopes of these, shape (3, k)."""
    own: Any
    """Slopes times `P` between the lengths times slopes, shape (k, k)."""
    sides: list[Any]
    """Slopes times `s` of the lengths for each right-hand side, shape (k,)."""


@dataclass
class Eliminated:
    """Factors of an element after elimination, for its own step."""

    lower: Any
    """`L`, unit lower triangular, shape (k, k)."""
    inverse_pivots: list[Scalar]
    """`1 / D'` (k)."""
    coupling: Any
    """`L^-1 C^T`, shape (k, n)."""
    columns: list[list[Scalar]]
    """`L^-1 g'` of each right-hand side (k)."""

    def steps(self, column: int, turn: Any, before: Any = None) -> Any:
        """Return the steps for one right-hand side, shape (k,), from the turn of all elements nearer to the base.

        `before`, shape (k,), is what the coupling by lengths adds to that by the turn.
        """
        added = [0.0] * len(self.inverse_pivots) if before is None else before
        rows = zip(self.coupling, added, self.columns[column], strict=True)
        return self.solved([(row @ turn) + more - one for row, more, one in rows])

    def solved(self, reduced: Sequence[Scalar]) -> Any:
        """Return `D^-1 g'` from `L^-1 g'`, shape (k,)."""
        return self.raised([value * inverse for value, inverse in zip(reduced, self.inverse_pivots, strict=True)])

    def raised(self, scaled: Sequence[Scalar]) -> Any:
        """Return the same from `D'^-1 L^-1 g'`, shape (k,): backwards through `L^T`."""
        steps = list(scaled)
        for j in reversed(range(len(steps))):
            for i in range(j + 1, len(steps)):
                steps[j] = steps[j] - self.lower[i, j] * steps[i]
        return vector(steps)

    def reduced(self, gradient: Sequence[Scalar]) -> list[Scalar]:
        """Return another right-hand side `L^-1 g'` from `g'`."""
        values = list(gradient)
        for j in range(len(values)):
            for i in range(j + 1, len(values)):
                values[i] = values[i] - self.lower[i, j] * values[j]
        return values


def eliminate(
    beyond: Outboard,
    twists: Any,
    bends: Any,
    stiffness: Any,
    right_hand_sides: Sequence[Sequence[Scalar]],
    scales: Sequence[Scalar],
    *,
    pivot_shift: Scalar = 0.0,
    multipliers: bool = False,
    routes: RouteSums | None = None,
) -> tuple[Eliminated, Outboard]:
    """Eliminate the coordinates of one element.

    Args:
        beyond: Sums of the outboard elements.
        twists: Turn per coordinate, with zeros for multipliers, shape (n, k).
        bends: `c`, with minus one where a multiplier constrains the coordinate, shape (n, k).
        stiffness: Second derivatives of the energy within the element, shape (k, k).
        right_hand_sides: Gradient of each right-hand side (k).
        scales: The coordinates' own stiffness (k), to compare pivots with.
        pivot_shift: If positive, pivots are replaced by their size, and at least by this times the spring's own stiffness.
        multipliers: Whether the coordinates are multipliers, whose pivots are negative and never shifted.
        routes: What lengths of actuators, as further components of the turn, add; their own sums are left to the caller.

    Returns:
        The factors of the element, and the sums including it.
    """
    k = len(scales)
    pushed = beyond.matrix @ twists
    if routes is not None:
        stiffness, pushed = stiffness - routes.push.T @ twists - routes.own, pushed + routes.push
    coupling = (bends + pushed).T.copy()
    block = stiffness - twists.T @ pushed
    columns = [
        [value + twists[:, j] @ column for j, value in enumerate(values)]
        for values, column in zip(right_hand_sides, beyond.columns, strict=True)
    ]
    if routes is not None:
        columns = [[*(vector(values) + more)] for values, more in zip(columns, routes.sides, strict=True)]
    lower = constants(np.eye(k))
    inverse: list[Scalar] = []
    min_pivot, n_negative_pivots = beyond.min_pivot, beyond.n_negative_pivots
    for j in range(k):
        pivot = block[j, j]
        relative = real_part(pivot) / scales[j]
        min_pivot = smaller(absolute(relative), min_pivot)
        n_negative_pivots = n_negative_pivots + if_less(relative, -POSITIVE_PIVOT, 1.0, 0.0)
        if not multipliers and not (isinstance(pivot_shift, float) and pivot_shift == 0.0):
            pivot = if_less(0.0, pivot_shift, larger(absolute(pivot), pivot_shift * scales[j]), pivot)
        inverse.append(1.0 / pivot)
        for i in range(j + 1, k):
            lower[i, j] = block[j, i] * inverse[j]
            for m in range(j + 1, i + 1):
                block[m, i] = block[m, i] - lower[i, j] * block[j, m]
            coupling[i] = coupling[i] - coupling[j] * lower[i, j]
            for values in columns:
                values[i] = values[i] - lower[i, j] * values[j]
    matrix = beyond.matrix
    sums = list(beyond.columns)
    for j in range(k):
        scaled = coupling[j] * inverse[j]
        matrix = matrix + _symmetric_outer(coupling[j], scaled)
        sums = [one + scaled * values[j] for one, values in zip(sums, columns, strict=True)]
    return Eliminated(lower, inverse, coupling, columns), Outboard(matrix, sums, min_pivot, n_negative_pivots)


def resized(values: Any, n: int) -> Any:
    """Return the first `n` components of a vector, new ones zero."""
    return np.concatenate([values[:n], constants(np.zeros(max(n - len(values), 0)))])


def _symmetric_outer(one: Any, scaled: Any) -> Any:
    """Return the outer product of a vector with a multiple of itself; computed once above the diagonal."""
    n = len(one)
    product = constants(np.zeros((n, n)))
    for i in range(n):
        for j in range(i, n):
            product[i, j] = product[j, i] = one[i] * scaled[j]
    return product


def eliminate_multipliers(
    beyond: Outboard, gaps: Sequence[Scalar], scales: Sequence[Scalar], *others: Sequence[Scalar]
) -> tuple[Eliminated, Outboard]:
    """Eliminate the multipliers, the last components, at the base of their segment.

    Args:
        beyond: Sums of the outboard elements.
        gaps: Difference of each constrained sum from its given value; the first step closes them.
        scales: Compliance of the sums, to compare pivots with.
        *others: Gaps of further right-hand sides; by default zero.

    Returns:
        The factors of the multipliers, and the sums without them.
    """
    count = len(gaps)
    n = len(beyond.matrix) - count
    unit = constants(np.concatenate([np.zeros((n, count)), np.eye(count)]))
    zeros = constants(np.zeros((n + count, count)))
    values: list[Sequence[Scalar]] = [gaps, *(others or [[0.0] * count for _ in beyond.columns[1:]])]
    eliminated, rest = eliminate(beyond, unit, zeros, constants(np.zeros((count, count))), values, scales, multipliers=True)
    return replace(eliminated, coupling=eliminated.coupling[:, :n]), rest.resized(n)
