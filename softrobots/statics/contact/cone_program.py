"""The largest value of a linear objective within second-order cones, bounded from both sides by linear programs."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray

CLOSE = 1e-8
"""Distance of the bounds at which the search ends."""

_EDGES = 8  # of the first polygon around a cone
_MOST_PROGRAMS = 100
_ACCURACY = {"primal_feasibility_tolerance": 0.1 * CLOSE, "dual_feasibility_tolerance": 0.1 * CLOSE}


class ConeProgram(NamedTuple):
    """Cones of friction `|rubs_0 + rubs x| <= room_0 + room x`, and sides `sides x <= limits`; `x = 0` satisfies them.

    Tangent planes stand for each cone: a polygon around it, then also planes where an answer leaves it [Kelley 1960].
    """

    rubs: FloatArray
    """Shape (k, 2, n)."""
    rubs_0: FloatArray
    """Shape (k, 2)."""
    room: FloatArray
    """Shape (k, n)."""
    room_0: FloatArray
    """Shape (k,)."""
    sides: FloatArray
    """Shape (m, n)."""
    limits: FloatArray
    """Shape (m,)."""

    def largest(
        self, objective: FloatArray, inside: Callable[[FloatArray], tuple[float, FloatArray]]
    ) -> tuple[float, FloatArray, float]:
        """Largest value of an objective that was reached, what reaches it, and an upper bound.

        Args:
            objective: Value of each unknown, shape (n,).
            inside: Brings the answer of a linear program back into the cones; its value there, and what it stands for.
        """
        from scipy.optimize import linprog

        value, best = inside(np.zeros(len(objective)))
        if not len(objective):
            return value, best, value
        angles = np.arange(_EDGES) * (2.0 * np.pi / _EDGES)
        edges = np.broadcast_to(np.column_stack([np.cos(angles), np.sin(angles)]), (len(self.room), _EDGES, 2))
        sides, limits, bound = self.sides, self.limits, np.inf
        for _ in range(_MOST_PROGRAMS):
            planes = edges @ self.rubs - self.room[:, np.newaxis]
            sides = np.vstack([sides, planes.reshape(-1, len(objective))])
            limits = np.append(limits, self.room_0[:, np.newaxis] - (edges @ self.rubs_0[..., np.newaxis])[..., 0])
            found = linprog(-objective, sides, limits, bounds=(None, None), method="highs", options=_ACCURACY)
            if found.x is None:
                break
            bound = min(bound, float(objective @ found.x))
            reached, there = inside(found.x)
            if reached > value:
                value, best = reached, there
            rub = self.rubs @ found.x + self.rubs_0
            size = np.linalg.norm(rub, axis=1)
            if bound - value <= CLOSE or np.all(size <= self.room @ found.x + self.room_0 + 0.1 * CLOSE):
                break
            edges = (rub / np.maximum(size, np.finfo(float).tiny)[:, np.newaxis])[:, np.newaxis]
        return value, best, max(bound, value)
