"""Batches: many cases side by side, in blocks of lanes, for a compiler that makes vector instructions of them.

The passes of `softrobots.compiled.drivers.equilibrium_drivers` are done for all lanes of a block together; cases that need more
than those are solved one by one. Besides the kernel language, these functions use tuples of arrays with one row a case.

All batch functions take the same arguments: `inputs`, arrays of shape (n, columns), or (1, columns) for a row that goes for all
cases; `places`, where the columns of each stand in the workspace; `outputs` and `result_places`, the same for the results; the
`statuses` to write, shape (n,); the `first` case and the one behind the `last`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from softrobots.compiled.drivers.equilibrium_drivers import go_to_start, settle_from
from softrobots.compiled.drivers.intrinsics import Array, zeros
from softrobots.compiled.drivers.motor_drivers import estimate, estimated, reach, within_limits
from softrobots.compiled.settings import FORCE_PASSES, PASSES

Rows: TypeAlias = "tuple[Any, ...]"
"""Arrays of floats with one row a case."""
Places: TypeAlias = "tuple[int, ...]"
"""Places in the workspace."""

# Declared in the generated module.
CERTIFIED: int
MODE: int
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


def load_block(w: Array, inputs: Rows, places: Places, first: int, last: int) -> None:
    """Write the cases from `first` on into the lanes; behind the last case it is repeated."""
    for k in range(len(places)):
        values = inputs[k]
        for lane in range(LANES):
            row = min(first + lane, last - 1, values.shape[0] - 1)
            for j in range(values.shape[1]):
                w[(places[k] + j) * LANES + lane] = values[row, j]


def load_case(w: Array, inputs: Rows, places: Places, case: int) -> None:
    """Write one case into a workspace."""
    for k in range(len(places)):
        values = inputs[k]
        row = min(case, values.shape[0] - 1)
        for j in range(values.shape[1]):
            w[places[k] + j] = values[row, j]


def copy_lane(w: Array, lanes: Array, lane: int) -> None:
    """Copy a lane into the workspace of a single case."""
    for j in range(LANE_SIZE):
        w[j] = lanes[j * LANES + lane]


def store_results(w: Array, stride: int, lane: int, outputs: Rows, places: Places, row: int) -> None:
    """Read the results of a case out of a lane, or with `stride` 1 and `lane` 0 out of a workspace of its own."""
    for k in range(len(places)):
        values = outputs[k]
        for j in range(values.shape[1]):
            values[row, j] = w[(places[k] + j) * stride + lane]


def is_solved(w: Array, lane: int) -> bool:
    """Tell whether the passes ended in a stable equilibrium."""
    return w[MODE * LANES + lane] > 0.5 and w[MODE * LANES + lane] < 1.5


def settle_batch(
    inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
) -> None:
    """Find equilibria, each from rest."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        load_block(lanes, inputs, places, begin, last)
        first_pass_lanes(lanes)
        for _ in range(PASSES):
            if not running(lanes):
                break
            newton_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            if is_solved(lanes, lane):
                statuses[row] = CERTIFIED
                store_results(lanes, LANES, lane, outputs, result_places, row)
            else:
                load_case(case, inputs, places, row)
                go_to_start(case)
                statuses[row] = settle_from(case)
                store_results(case, 1, 0, outputs, result_places, row)


def estimate_batch(
    inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
) -> None:
    """Estimate forces."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        load_block(lanes, inputs, places, begin, last)
        first_force_pass_lanes(lanes)
        for _ in range(FORCE_PASSES):
            if not running(lanes):
                break
            force_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            copy_lane(case, lanes, lane)
            if is_solved(lanes, lane):
                statuses[row] = estimated(case)
            else:
                statuses[row] = estimate(case)
            store_results(case, 1, 0, outputs, result_places, row)


def reach_batch(
    inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
) -> None:
    """Put the tips at their targets, from given motors and unknowns."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        load_block(lanes, inputs, places, begin, last)
        for lane in range(LANES):
            lanes[MODE * LANES + lane] = 0.0
        for _ in range(PASSES):
            if not running(lanes):
                break
            target_pass_lanes(lanes)
        for lane in range(min(LANES, last - begin)):
            row = begin + lane
            copy_lane(case, lanes, lane)
            statuses[row] = CERTIFIED
            if not is_solved(lanes, lane) or within_limits(case, 0) != CERTIFIED:
                load_case(case, inputs, places, row)
                statuses[row] = reach(case)
            store_results(case, 1, 0, outputs, result_places, row)


FUNCTIONS: tuple[Callable[..., object], ...] = (running, load_block, load_case, store_results, is_solved, settle_batch)
"""Equilibria, each behind those that it uses."""

MOTOR_FUNCTIONS: tuple[Callable[..., object], ...] = (copy_lane, estimate_batch, reach_batch)
"""Load estimation and inverse kinematics."""
