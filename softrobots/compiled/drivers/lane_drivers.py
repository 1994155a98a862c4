"""Batches: many cases side by side, in blocks of lanes, for a compiler that makes vector instructions of them.

The passes of `softrobots.compiled.drivers.equilibrium_drivers` are done for all lanes of a block together; cases that they do
not settle go through the descent one by one. Besides the kernel language, these functions use arrays with rows (one a case).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from softrobots.compiled.drivers.equilibrium_drivers import go_to_start, settle_from
from softrobots.compiled.drivers.intrinsics import Array, sqrt, zeros
from softrobots.compiled.drivers.motor_drivers import estimate, estimated, reach, within_limits
from softrobots.compiled.settings import FORCE_PASSES, PASSES

# Made for each robot.
CERTIFIED: int
FORCE: int
GRAVITY: int
PULL: int
START: int
UNKNOWN: int
ERROR: int
MODE: int
MISSING: int
UNEXPLAINED: int
OBSERVED: int
TIP: int
TORQUES: int
TARGET: int
TOLERATED: int
N: int
N_MOTORS: int
LANES: int
LANE_SIZE: int
WORKSPACE_SIZE: int
first_pass_lanes: Callable[[Array], None]
newton_pass_lanes: Callable[[Array], None]
first_force_pass_lanes: Callable[[Array], None]
force_pass_lanes: Callable[[Array], None]
target_pass_lanes: Callable[[Array], None]


def running(w: Array) -> bool:
    """Tell whether any lane has yet to go on."""
    count = 0.0
    for lane in range(LANES):
        if w[MODE * LANES + lane] < 0.5:
            count += 1.0
    return count > 0.5


def settle_batch(
    motors: Any,
    forces: Any,
    gravity: Any,
    pulls: Any,
    starts: Any,
    unknowns: Any,
    residuals: Any,
    tips: Any,
    statuses: Any,
    first: int,
    last: int,
) -> None:
    """Settle the cases from `first` up to `last`, each from rest; `pulls` and `starts` may be empty."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        for lane in range(LANES):
            row = min(begin + lane, last - 1)
            for j in range(N_MOTORS):
                lanes[j * LANES + lane] = motors[row, j]
            for j in range(3):
                lanes[(FORCE + j) * LANES + lane] = forces[row, j]
                lanes[(GRAVITY + j) * LANES + lane] = gravity[j]
            if pulls.shape[0] > 0:
                for j in range(N):
                    lanes[(PULL + j) * LANES + lane] = pulls[row, j]
            if starts.shape[0] > 0:
                for j in range(N):
                    lanes[(START + j) * LANES + lane] = starts[row, j]
                    lanes[(UNKNOWN + j) * LANES + lane] = starts[row, j]
        first_pass_lanes(lanes)
        for _ in range(PASSES):
            if not running(lanes):
                break
            newton_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            mode = lanes[MODE * LANES + lane]
            if mode > 0.5 and mode < 1.5:
                for j in range(N):
                    unknowns[row, j] = lanes[(UNKNOWN + j) * LANES + lane]
                for j in range(3):
                    tips[row, j] = lanes[(TIP + j) * LANES + lane]
                residuals[row] = sqrt(lanes[ERROR * LANES + lane])
                statuses[row] = CERTIFIED
            else:
                for j in range(UNKNOWN):
                    case[j] = lanes[j * LANES + lane]
                go_to_start(case)
                statuses[row] = settle_from(case)
                for j in range(N):
                    unknowns[row, j] = case[UNKNOWN + j]
                for j in range(3):
                    tips[row, j] = case[TIP + j]
                residuals[row] = sqrt(case[ERROR])


def estimate_batch(
    motors: Any,
    torques: Any,
    gravity: Any,
    forces: Any,
    unknowns: Any,
    residuals: Any,
    unexplained: Any,
    observed: Any,
    statuses: Any,
    first: int,
    last: int,
) -> None:
    """Estimate the forces of the cases from `first` up to `last`."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        for lane in range(LANES):
            row = min(begin + lane, last - 1)
            for j in range(N_MOTORS):
                lanes[j * LANES + lane] = motors[row, j]
                lanes[(TORQUES + j) * LANES + lane] = torques[row, j]
            for j in range(3):
                lanes[(GRAVITY + j) * LANES + lane] = gravity[j]
        first_force_pass_lanes(lanes)
        for _ in range(FORCE_PASSES):
            if not running(lanes):
                break
            force_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            mode = lanes[MODE * LANES + lane]
            for j in range(LANE_SIZE):
                case[j] = lanes[j * LANES + lane]
            if mode > 0.5 and mode < 1.5:
                statuses[row] = estimated(case)
            else:
                statuses[row] = estimate(case)
            for j in range(N):
                unknowns[row, j] = case[UNKNOWN + j]
            for j in range(3):
                forces[row, j] = case[FORCE + j]
            residuals[row] = sqrt(case[ERROR])
            unexplained[row] = sqrt(case[UNEXPLAINED])
            observed[row] = sqrt(case[OBSERVED])


def reach_batch(
    targets: Any,
    forces: Any,
    gravity: Any,
    motors: Any,
    unknowns: Any,
    residuals: Any,
    errors: Any,
    statuses: Any,
    tolerance: float,
    first: int,
    last: int,
) -> None:
    """Put the tips of the cases from `first` up to `last` at their targets, from the motors and unknowns that come in."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        for lane in range(LANES):
            row = min(begin + lane, last - 1)
            for j in range(N_MOTORS):
                lanes[j * LANES + lane] = motors[row, j]
            for j in range(N):
                lanes[(UNKNOWN + j) * LANES + lane] = unknowns[row, j]
            for j in range(3):
                lanes[(FORCE + j) * LANES + lane] = forces[row, j]
                lanes[(GRAVITY + j) * LANES + lane] = gravity[j]
                lanes[(TARGET + j) * LANES + lane] = targets[row, j]
            lanes[TOLERATED * LANES + lane] = tolerance
            lanes[MODE * LANES + lane] = 0.0
        for _ in range(PASSES):
            if not running(lanes):
                break
            target_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            mode = lanes[MODE * LANES + lane]
            for j in range(LANE_SIZE):
                case[j] = lanes[j * LANES + lane]
            statuses[row] = CERTIFIED
            if mode < 0.5 or mode > 1.5 or within_limits(case, 0) != CERTIFIED:
                for j in range(N_MOTORS):
                    case[j] = motors[row, j]
                for j in range(N):
                    case[UNKNOWN + j] = unknowns[row, j]
                statuses[row] = reach(case)
            for j in range(N_MOTORS):
                motors[row, j] = case[j]
            for j in range(N):
                unknowns[row, j] = case[UNKNOWN + j]
            residuals[row] = sqrt(case[ERROR])
            errors[row] = sqrt(case[MISSING])


FUNCTIONS: tuple[Callable[..., object], ...] = (running, settle_batch)
"""Equilibria, each behind those that it uses."""

MOTOR_FUNCTIONS: tuple[Callable[..., object], ...] = (estimate_batch, reach_batch)
"""Load estimation and inverse kinematics."""
