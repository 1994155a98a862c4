"""One block of a sweep: some targets with all loads.

The numbers of a block depend on its case and targets only, not on the worker or on the order of blocks.

For each target and branch of postures (a *lane*) the load grows level by level; each search starts from the pose of the level
before. A lane that fails at a load after it was solved is not searched at larger loads.

A lane carries a load if its tip is at the target and no link lacks pressure. Between the last level that is carried and the
next one its payload is found by regula falsi (Illinois) on the missing pressure, or by bisection where the arm does not reach
the target at the larger load.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.compiled.sweeps.arm_solver import ArmSolver, SweepCase, solver
from softrobots.compiled.sweeps.postures import starts
from softrobots.core.checks import FloatArray
from softrobots.statics.workspace_map import CLOSE, BoolArray

ROUNDS = 10
"""Searches between two levels; bisection alone narrows a step down to a thousandth."""


class BlockResult(NamedTuple):
    """Results of a block of n targets; the best posture for each load."""

    reached: BoolArray
    """Whether the loaded tip reaches the target, shape (n, n_loads)."""
    required_pressure: FloatArray
    """Smallest pressure at which no link wrinkles there, shape (n, n_loads) [Pa]; infinite where it is not reached."""
    payload: FloatArray
    """Largest load that is carried without wrinkling, shape (n,) [N]."""
    q_motors: FloatArray
    """Motor angles of the posture that needs the least pressure, shape (n, n_loads, n_motors) [rad]; 0 where not reached."""
    q_springs: FloatArray
    """Springs there, shape (n, n_loads, n_springs) [rad]; 0 where not reached."""

    @staticmethod
    def arrays(case: SweepCase, count: int) -> dict[str, tuple[type, tuple[int, ...]]]:
        """Return data type and shape of each array, for a number of targets."""
        cases = (count, len(case.loads))
        return {
            "reached": (np.bool_, cases),
            "required_pressure": (np.float64, cases),
            "payload": (np.float64, (count,)),
            "q_motors": (np.float64, (*cases, len(case.motors))),
            "q_springs": (np.float64, (*cases, len(case.springs))),
        }


def solve_block(case: SweepCase, targets: FloatArray) -> BlockResult:
    """Solve some targets, shape (n, 3) [m], for all loads; errors are those of `ArmSolver`."""
    arm = solver(case)
    levels, n_motors, n_branches = np.array(case.loads), arm.model.n_motors, len(arm.branches)
    near = np.flatnonzero(np.linalg.norm(targets, axis=1) <= arm.model.reach)
    goals = np.tile(targets[near], (n_branches, 1))  # of each lane
    here = starts(arm.model, arm.branches, targets[near])
    rows, count = len(goals), len(levels)
    reached = np.zeros((rows, count), dtype=bool)
    required, excess = np.full((rows, count), np.inf), np.full((rows, count), np.inf)
    poses = np.zeros((rows, count, here.shape[1]))
    alive, ever_solved = np.ones(rows, dtype=bool), np.zeros(rows, dtype=bool)
    for level, load in enumerate(levels):
        lanes = np.flatnonzero(alive)
        found = arm.search(goals[lanes], np.full(len(lanes), load), here[lanes])
        here[lanes] = found.pose
        alive[lanes] = found.solved | ~ever_solved[lanes]
        ever_solved[lanes] |= found.solved
        reached[lanes, level], required[lanes, level] = found.reached, found.required_pressure
        excess[lanes, level] = found.excess
        poses[lanes, level] = np.where(found.reached[:, None], found.pose, 0.0)
    carried = _payloads(arm, goals, levels, excess, poses)
    best = required.reshape(n_branches, len(near), count).argmin(axis=0)
    chosen = best * len(near) + np.arange(len(near))[:, None], np.arange(count)  # lane and level
    result = BlockResult(
        **{name: np.zeros(shape, kind) for name, (kind, shape) in BlockResult.arrays(case, len(targets)).items()}
    )
    result.required_pressure.fill(np.inf)
    result.reached[near], result.required_pressure[near] = reached[chosen], required[chosen]
    result.payload[near] = carried.reshape(n_branches, len(near)).max(axis=0)
    result.q_motors[near], result.q_springs[near] = poses[chosen][..., :n_motors], poses[chosen][..., n_motors:]
    return result


def _payloads(arm: ArmSolver, targets: FloatArray, levels: FloatArray, excess: FloatArray, poses: FloatArray) -> FloatArray:
    """Find the payload of each lane.

    Args:
        arm: Searches for poses.
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
        found = arm.search(targets[lanes[rows]], middle, starts[rows])
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
