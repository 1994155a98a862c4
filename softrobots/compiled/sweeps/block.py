"""One block of a sweep: some targets with all loads.

The numbers of a block depend on its case and targets only, not on the worker or on the order of blocks.

For each target and branch of postures (a *lane*) the load grows level by level; each search starts from the pose of the level
before. A lane that fails at a load after it was solved is not searched at larger loads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.compiled.sweeps.arm_solver import solver
from softrobots.compiled.sweeps.load_case import SweepCase
from softrobots.compiled.sweeps.payload import payloads
from softrobots.compiled.sweeps.postures import starts
from softrobots.core.checks import FloatArray
from softrobots.statics.workspace_map import BoolArray


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
    """Solve some targets for all loads.

    Args:
        case: Robot and loads.
        targets: Targets of the tip, shape (n, 3) [m].

    Returns:
        The results.

    Raises:
        ParameterError: If the case was made by another version of softrobots.
        MissingDependency: If the back end of the case is not installed.
    """
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
    carried = payloads(arm.search, goals, levels, excess, poses)
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
