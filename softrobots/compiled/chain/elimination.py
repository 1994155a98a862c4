r"""Newton steps in a time that grows with the length of the chain only: elimination from the tip to the base.

The tangent stiffness couples a coordinate `j` with every coordinate `i` nearer to the base by :math:`-\omega_i \cdot c_j`
(`softrobots.compiled.chain.elements`), three numbers: a matrix whose off-diagonal blocks have rank three. Eliminating the
coordinates from the tip on keeps that form. With `P` (3 x 3) and `s` (3) gathered from those already eliminated, the next
element has

.. math:: C = c + P \Omega, \quad D = K - \Omega^T P \Omega, \quad g' = g + \Omega^T s

and hands on :math:`P + C D^{-1} C^T` and :math:`s + C D^{-1} g'`. On the way back the steps are
:math:`x = D^{-1} (C^T \varphi - g')` with the turn :math:`\varphi = \sum \Omega x` of all nearer to the base.
`D = L D' L^T` gives the pivots; all positive, the tangent stiffness is positive definite.

Given muscle lengths hold sums of coordinates. Their multipliers join the turn as further components of what is nearer to the
base, until they are eliminated themselves at the base of their segment: with a pivot that must be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import constants
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger, smaller


@dataclass
class Outboard:
    """What the elements beyond hand on: `n` is three, and the multipliers of the segment."""

    matrix: Any
    """`P`, shape (n, n), symmetric."""
    columns: list[Any]
    """`s` of each right-hand side, shape (n,)."""
    min_pivot: Scalar
    """Smallest pivot in size, relative to the springs' own stiffness."""
    n_negative_pivots: Scalar
    """How many pivots are not positive."""

    @classmethod
    def tip(cls, right_hand_sides: int) -> Outboard:
        """Nothing beyond the tip."""
        return cls(constants(np.zeros((3, 3))), [constants(np.zeros(3)) for _ in range(right_hand_sides)], 1.0, 0.0)


@dataclass
class Eliminated:
    """An element after elimination: what it needs to find its own step on the way back."""

    lower: Any
    """`L`, unit lower triangular, shape (k, k)."""
    inverse_pivots: list[Scalar]
    """`1 / D'` (k)."""
    coupling: Any
    """`L^-1 C^T`, shape (k, n)."""
    columns: list[list[Scalar]]
    """`L^-1 g'` of each right-hand side (k)."""

    def steps(self, column: int, turn: Any) -> Any:
        """Steps of the element's coordinates for one right-hand side, shape (k,); `turn` is that of all nearer to the base."""
        k = len(self.inverse_pivots)
        made = [
            ((self.coupling[j] @ turn) - self.columns[column][j]) * self.inverse_pivots[j]  # backwards through L^T
            for j in range(k)
        ]
        for j in reversed(range(k)):
            for i in range(j + 1, k):
                made[j] = made[j] - self.lower[i, j] * made[i]
        out = constants(np.zeros(k))
        out[:] = made
        return out

    def reduced(self, gradient: Sequence[Scalar]) -> list[Scalar]:
        """Another right-hand side `L^-1 g'` from `g'`."""
        made = list(gradient)
        for j in range(len(made)):
            for i in range(j + 1, len(made)):
                made[i] = made[i] - self.lower[i, j] * made[j]
        return made


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
) -> tuple[Eliminated, Outboard]:
    """Eliminate the coordinates of one element.

    Args:
        beyond: What the elements beyond it hand on.
        twists: Turn per coordinate, and zeros for multipliers, shape (n, k).
        bends: `c`, and minus one where a multiplier holds the coordinate, shape (n, k).
        stiffness: Second derivatives of the energy within the element, shape (k, k).
        right_hand_sides: Gradient of each right-hand side (k).
        scales: The coordinates' own stiffness (k), to compare pivots with.
        pivot_shift: Where positive, pivots are made so, and at least this in terms of the spring's own stiffness.
        multipliers: Whether the coordinates are multipliers, whose pivots are negative and never guarded.

    Returns:
        The element, and what it hands on together with those beyond.
    """
    k = len(scales)
    pushed = beyond.matrix @ twists
    coupling = (bends + pushed).T.copy()
    block = stiffness - twists.T @ pushed
    columns = [
        [value + twists[:, j] @ column for j, value in enumerate(values)]
        for values, column in zip(right_hand_sides, beyond.columns, strict=True)
    ]
    lower = constants(np.eye(k))
    inverse: list[Scalar] = []
    min_pivot, n_negative_pivots = beyond.min_pivot, beyond.n_negative_pivots
    for j in range(k):
        pivot = block[j, j]
        relative = pivot / scales[j]
        min_pivot = smaller(absolute(relative), min_pivot)
        n_negative_pivots = n_negative_pivots + if_less(0.0, relative, 0.0, 1.0)
        if not multipliers:
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


def _symmetric_outer(one: Any, scaled: Any) -> Any:
    """Product of a vector with itself, scaled; computed once above the diagonal."""
    n = len(one)
    made = constants(np.zeros((n, n)))
    for i in range(n):
        for j in range(i, n):
            made[i, j] = made[j, i] = one[i] * scaled[j]
    return made


def eliminate_multipliers(beyond: Outboard, gaps: Sequence[Scalar], scales: Sequence[Scalar]) -> tuple[Eliminated, Outboard]:
    """Eliminate the multipliers at the base of their segment: the last components, one for each gap.

    Args:
        beyond: What the elements beyond hand on.
        gaps: How far each held sum is above where it should be; the first step closes them.
        scales: Softness of the sums, to compare pivots with.

    Returns:
        The multipliers, and what is handed on without them.
    """
    count = len(gaps)
    n = len(beyond.matrix) - count
    unit = constants(np.concatenate([np.zeros((n, count)), np.eye(count)]))
    zeros = constants(np.zeros((n + count, count)))
    values: list[Sequence[Scalar]] = [gaps, *([0.0] * count for _ in beyond.columns[1:])]
    made, rest = eliminate(beyond, unit, zeros, constants(np.zeros((count, count))), values, scales, multipliers=True)
    rest = Outboard(rest.matrix[:n, :n], [one[:n] for one in rest.columns], rest.min_pivot, rest.n_negative_pivots)
    return Eliminated(made.lower, made.inverse_pivots, made.coupling[:, :n], made.columns), rest
