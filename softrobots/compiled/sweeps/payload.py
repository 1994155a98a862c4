"""The largest load that is carried without wrinkling, between the levels of a sweep.

A lane (one target, one branch of postures) carries a load if its tip is at the target and no link lacks pressure. Between the
last level that is carried and the next one the payload is found by regula falsi (Illinois) on the missing pressure, or by
bisection where the arm does not reach the target at the larger load.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from softrobots.compiled.sweeps.arm_solver import SearchResult
from softrobots.core.checks import FloatArray
from softrobots.statics.workspace_map import CLOSE

ROUNDS = 10
"""Searches between two levels; bisection alone narrows a step down to a thousandth."""

Search = Callable[[FloatArray, FloatArray, FloatArray], SearchResult]
"""Search for poses at targets (n, 3) under loads (n,) from starts (n, n_motors + n_springs)."""


def payloads(search: Search, targets: FloatArray, levels: FloatArray, excess: FloatArray, poses: FloatArray) -> FloatArray:
    """Find the payload of each lane.

    Args:
        search: Search for poses.
        targets: Targets, shape (n, 3) [m].
        levels: Loads of the sweep, shape (n_loads,), increasing [N].
        excess: Missing pressure at each level, shape (n, n_loads) [Pa]; infinite where the target is not reached.
        poses: Motor angles and springs at each level, shape (n, n_loads, n_motors + n_springs) [rad].

    Returns:
        Payloads, shape (n,) [N]: 0 where the first level is not carried, the last level where all are.
    """
    carried = np.cumprod(excess <= CLOSE, axis=1).sum(axis=1)  # number of levels, from the first on
    answer = np.where(carried > 0, levels[np.maximum(carried - 1, 0)], 0.0)
    lanes = np.flatnonzero((carried > 0) & (carried < len(levels)))
    last = carried[lanes] - 1
    low, high, starts = levels[last], levels[last + 1], poses[lanes, last]
    missing = excess[lanes, last]  # at the lower end
    pull = np.stack([missing, excess[lanes, last + 1]])  # at both ends; halved where the other end has moved twice in a row
    moved = np.full(len(lanes), -1)  # which end moved last
    for _ in range(ROUNDS):
        rows = np.flatnonzero(missing < -CLOSE)
        if len(rows) == 0:
            break
        known = np.isfinite(pull[1, rows])
        share = np.where(known, pull[0, rows] / (pull[0, rows] - np.where(known, pull[1, rows], 0.0)), 0.5)
        middle = low[rows] + share * (high[rows] - low[rows])
        found = search(targets[lanes[rows]], middle, starts[rows])
        carries = found.excess <= CLOSE
        up, down = rows[carries], rows[~carries]
        low[up], missing[up], starts[up] = middle[carries], found.excess[carries], found.pose[carries]
        high[down] = middle[~carries]
        pull[0, up], pull[1, down] = found.excess[carries], found.excess[~carries]
        pull[1, up[moved[up] == 0]] *= 0.5
        pull[0, down[moved[down] == 1]] *= 0.5
        moved[up], moved[down] = 0, 1
    answer[lanes] = low
    return answer
