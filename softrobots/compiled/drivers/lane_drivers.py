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
from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, zeros
from softrobots.compiled.drivers.motor_drivers import estimate, estimated, reach, within_limits
from softrobots.compiled.settings import *

Rows: TypeAlias = "tuple[Any, ...]"
"""Arrays of floats with one row a case."""
Places: TypeAlias = "tuple[int, ...]"
"""Places in the workspace."""


def running(w: Array) -> bool:
    """Tell whether any lane is not finished."""
    count = 0.0
    for lane in range(LANES):
        if w[MODE * LANES + lane] < 0.5:
            count += 1.0
    return count > 0.5


def load_block(w: Array, inputs: Rows, places: Places, first: int, last: int) -> None:
    """Write the cases from `first` on into the lanes; behind the last case it is repeated."""
    for k in range(len(places)):
        values = inputs[k]
        end = min(last, values.shape[0]) - 1
        for j in range(values.shape[1]):
            for lane in range(LANES):
                w[(places[k] + j) * LANES + lane] = values[min(first + lane, end), j]


def load_case(w: Array, inputs: Rows, places: Places, case: int) -> None:
    """Write one case into a workspace."""
    for k in range(len(places)):
        values = inputs[k]
        row = min(case, values.shape[0] - 1)
        for j in range(values.shape[1]):
            w[places[k] + j] = values[row, j]


def store_block(w: Array, outputs: Rows, places: Places, first: int, last: int) -> None:
    """Read the results of the cases from `first` on out of the lanes."""
    for k in range(len(places)):
        values = outputs[k]
        for j in range(values.shape[1]):
            for lane in range(min(LANES, last - first)):
                values[first + lane, j] = w[(places[k] + j) * LANES + lane]


def store_case(w: Array, outputs: Rows, places: Places, case: int) -> None:
    """Read the results of one case out of a workspace of its own."""
    for k in range(len(places)):
        values = outputs[k]
        for j in range(values.shape[1]):
            values[case, j] = w[places[k] + j]


def is_solved(w: Array, lane: int) -> bool:
    """Tell whether the passes ended in a stable equilibrium."""
    return w[MODE * LANES + lane] > 0.5 and w[MODE * LANES + lane] < 1.5


def settle_batch(
    inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
) -> None:
    """Find equilibria, each from rest, with dry friction from the unknowns given."""
    lanes = zeros(LANE_SIZE * LANES)
    case = zeros(WORKSPACE_SIZE)
    for begin in range(first, last, LANES):
        load_block(lanes, inputs, places, begin, last)
        first_pass_lanes(lanes)
        for _ in range(PASSES):
            if not running(lanes):
                break
            newton_pass_lanes(lanes)
        store_block(lanes, outputs, result_places, begin, last)
        for lane in range(min(LANES, last - begin)):
            statuses[begin + lane] = CERTIFIED
            if not is_solved(lanes, lane):
                load_case(case, inputs, places, begin + lane)
                prepare(case)
                if N_SLIDERS == 0:
                    go_to_start(case)
                statuses[begin + lane] = settle_from(case)
                store_case(case, outputs, result_places, begin + lane)


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
        store_block(lanes, outputs, result_places, begin, last)
        for lane in range(min(LANES, last - begin)):
            case[OBSERVED] = lanes[OBSERVED * LANES + lane]
            statuses[begin + lane] = estimated(case)
            if not is_solved(lanes, lane):
                load_case(case, inputs, places, begin + lane)
                statuses[begin + lane] = estimate(case)
                store_case(case, outputs, result_places, begin + lane)


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
        store_block(lanes, outputs, result_places, begin, last)
        for lane in range(min(LANES, last - begin)):
            for j in range(N_MOTORS):
                case[j] = lanes[j * LANES + lane]
            statuses[begin + lane] = CERTIFIED
            if not is_solved(lanes, lane) or within_limits(case, 0) != CERTIFIED:
                load_case(case, inputs, places, begin + lane)
                statuses[begin + lane] = reach(case)
                store_case(case, outputs, result_places, begin + lane)


MOTOR_FUNCTIONS: tuple[Callable[..., object], ...] = (estimate_batch, reach_batch)
"""Load estimation and inverse kinematics."""
