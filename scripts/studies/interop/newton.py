"""Newton's method on the generalised forces that another tool computes, with a tangent by central differences.

It knows nothing of robots: it finds the zero of a function.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged

STEP = 1e-6
"""Step of the central differences [rad or m]: truncation and rounding about 1e-10 of the stiffness."""
SMALLEST = 1e-12
"""The iteration ends with a step below this [rad or m]."""
LARGEST_STEP = 0.5
"""Longer steps are shortened to this [rad or m]."""


def balance_point(balance: Callable[[FloatArray], FloatArray], start: FloatArray, most: int = 50) -> tuple[FloatArray, int]:
    """Find where generalised forces are in balance.

    Args:
        balance: Sum of the generalised forces at coordinates, shape (n,) [N m or N].
        start: Coordinates to start from, shape (n,) [rad or m].
        most: Most iterations.

    Returns:
        Coordinates, shape (n,), after a step of at most `SMALLEST`; and the iterations.

    Raises:
        NotConverged: If the steps do not become that small; `best` is the last iterate, shape (n,).
    """
    q, iteration = start.copy(), 0
    for iteration in range(1, most + 1):
        force = balance(q)
        tangent = np.zeros((q.size, q.size))
        for column in range(q.size):
            ahead, behind = q.copy(), q.copy()
            ahead[column] += STEP
            behind[column] -= STEP
            tangent[:, column] = (balance(ahead) - balance(behind)) / (2.0 * STEP)
        if not (np.isfinite(force).all() and np.isfinite(tangent).all()):
            break
        try:
            step = np.linalg.solve(tangent, -force)
        except np.linalg.LinAlgError:
            break
        largest = float(np.abs(step).max(initial=0.0))
        q = q + step * min(1.0, LARGEST_STEP / max(largest, LARGEST_STEP))
        if largest <= SMALLEST:
            return q, iteration
    left = float(np.linalg.norm(balance(q)))
    residual = left if np.isfinite(left) else np.inf
    raise NotConverged(
        f"no balance in {iteration} iterations: {residual:.3g} N m are left", best=q, residual=residual, iterations=iteration
    )
