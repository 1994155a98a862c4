"""Steps of time of many cases side by side, in blocks of lanes; see `softrobots.compiled.drivers.lane_drivers`.

A lane whose corrections do not converge is left behind, and its case is done alone from the beginning, with halved steps. So
are all cases of a robot whose lanes do not fit in a cache (`ALONE`).
"""

from __future__ import annotations

from typing import Any

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, where, zeros
from softrobots.compiled.drivers.lane_drivers import Places, Rows, load_block, load_case
from softrobots.compiled.drivers.motion_drivers import motion_run
from softrobots.compiled.motion_settings import *


def fill_lanes(w: Array, place: int, value: float) -> None:
    """Write a number into all lanes."""
    for lane in range(LANES):
        w[place * LANES + lane] = value


def lanes_to_settle(w: Array) -> float:
    """Return the number of lanes whose corrections have not converged, without those that have failed before."""
    judge_corrections_lanes(w)
    count = 0.0
    for lane in range(LANES):
        count += (1.0 - w[SETTLED * LANES + lane]) * (1.0 - w[FAILED * LANES + lane])
    return count


def slow_lanes(w: Array) -> float:
    """Return the number of the lanes to settle whose corrections shrink slowly; their change becomes the last one."""
    count = 0.0
    for lane in range(LANES):
        left = (1.0 - w[SETTLED * LANES + lane]) * (1.0 - w[FAILED * LANES + lane])
        count += where(w[CHANGE * LANES + lane] > RENEW_SHARE * w[LAST_CHANGE * LANES + lane], left, 0.0)
        w[LAST_CHANGE * LANES + lane] = w[CHANGE * LANES + lane]
    return count


def settle_middle_lanes(w: Array, n_history: int) -> None:
    """Find the accelerations of a step; mark the lanes that fail."""
    choose_order_lanes(w)
    for i in range(N):
        guess_unknown_lanes(w, i)
    coasting = 0.0
    for lane in range(LANES):
        coasting += w[COASTS * LANES + lane]
    if coasting > 0.5:
        motion_coast_lanes(w)
        for i in range(N):
            apply_correction_lanes(w, i)
    first = 1
    if coasting > 0.5 or n_history == 0:
        first = 0
    fill_lanes(w, LAST_CHANGE, 1e300)
    slow = 0.0
    for step in range(MOTION_CORRECTIONS):
        if slow > 0.5:
            fill_lanes(w, COUPLED, 1.0)
        if step == first or slow > 0.5:
            motion_factor_lanes(w)
        else:
            motion_correct_lanes(w)
        fill_lanes(w, CHANGE, 0.0)
        for i in range(N):
            apply_correction_lanes(w, i)
        if lanes_to_settle(w) < 0.5:
            break
        slow = slow_lanes(w)
    for lane in range(LANES):
        w[FAILED * LANES + lane] = where(w[SETTLED * LANES + lane] < 0.5, 1.0, w[FAILED * LANES + lane])


def motion_step_lanes(w: Array, length: float, n_history: int) -> None:
    """Take a step; `n_history` is the number of earlier steps of the same length."""
    fill_lanes(w, TIME_STEP, length)
    fill_lanes(w, WHOLE_STEP, length)
    fill_lanes(w, SHARE, 0.5)
    fill_lanes(w, N_HISTORY, n_history)
    for i in range(N):
        for lane in range(LANES):
            w[(BEGIN_POSITION + i) * LANES + lane] = w[(POSITION + i) * LANES + lane]
            w[(BEGIN_VELOCITY + i) * LANES + lane] = w[(VELOCITY + i) * LANES + lane]
    for i in range(N_MOTORS):
        place_motor_lanes(w, i)
    motion_prepare_lanes(w)
    settle_middle_lanes(w, n_history)
    for i in range(N):
        finish_unknown_lanes(w, i)


def load_path(w: Array, place: int, path: Any, row: int, first: int, last: int) -> None:
    """Write one row of the path of each case into the lanes; a path of one row stands still."""
    end = min(last, path.shape[0]) - 1
    row = min(row, path.shape[1] - 1)
    for j in range(path.shape[2]):
        for lane in range(LANES):
            w[(place + j) * LANES + lane] = path[min(first + lane, end), row, j]


def store_row(w: Array, out: Any, row: int, first: int, last: int) -> None:
    """Read unknowns, rates and tip of the cases from `first` on out of the lanes."""
    for lane in range(min(LANES, last - first)):
        for i in range(N):
            out[first + lane, row, i] = w[(UNKNOWN + i) * LANES + lane]
            out[first + lane, row, N + i] = w[(RATE + i) * LANES + lane]
        for i in range(3):
            out[first + lane, row, 2 * N + i] = w[(TIP + i) * LANES + lane]


def move_alone(
    case: Array, inputs: Rows, places: Places, motors: Any, forces: Any, grid: Any, times: Any, out: Any, one: int
) -> int:
    """Do a case by itself in a workspace; return the status."""
    for i in range(WORKSPACE_SIZE):
        case[i] = 0.0
    load_case(case, inputs, places, one)
    path = motors[min(one, motors.shape[0] - 1)].reshape(-1)
    pushes = forces[min(one, forces.shape[0] - 1)].reshape(-1)
    rows = out[one].reshape(-1)
    return motion_run(case, path, motors.shape[1], pushes, forces.shape[1], grid, len(grid) - 1, times, len(times), rows)


def motion_batch(
    inputs: Rows,
    places: Places,
    motors: Any,
    forces: Any,
    grid: Any,
    times: Any,
    out: Any,
    statuses: Any,
    first: int,
    last: int,
) -> None:
    """Take the steps of `motion_run` for the cases from `first` on.

    `motors`, shape (n or 1, 2 n_steps + 1 or 1, N_MOTORS); `forces`, shape (n or 1, n_steps or 1, 3); `out`, shape
    (n, n_times, 2 N + 3).
    """
    case = zeros(WORKSPACE_SIZE)
    if ALONE:
        for one in range(first, last):
            statuses[one] = move_alone(case, inputs, places, motors, forces, grid, times, out, one)
        return
    lanes = zeros(LANE_SIZE * LANES)
    for begin in range(first, last, LANES):
        for i in range(LANE_SIZE * LANES):
            lanes[i] = 0.0
        load_block(lanes, inputs, places, begin, last)
        row = 0
        n_history = 0
        for step in range(len(grid) - 1):
            load_path(lanes, MOTORS_BEGIN, motors, 2 * step, begin, last)
            load_path(lanes, MOTORS_MIDDLE, motors, 2 * step + 1, begin, last)
            load_path(lanes, MOTORS_END, motors, 2 * step + 2, begin, last)
            load_path(lanes, FORCE, forces, step, begin, last)
            length = grid[step + 1] - grid[step]
            if step > 0 and fabs(length - (grid[step] - grid[step - 1])) > 1e-9 * length:
                n_history = 0
            motion_step_lanes(lanes, length, n_history)
            n_history += 1
            while row < len(times) and (times[row] <= grid[step + 1] or step == len(grid) - 2):
                share = (times[row] - grid[step]) / length
                if share > 1.0 - 1e-9:
                    share = 1.0
                fill_lanes(lanes, SHARE, share)
                for i in range(N):
                    interpolate_unknown_lanes(lanes, i)
                for i in range(N_MOTORS):
                    place_motor_lanes(lanes, i)
                motion_tip_lanes(lanes)
                store_row(lanes, out, row, begin, last)
                row += 1
        for lane in range(min(LANES, last - begin)):
            one = begin + lane
            statuses[one] = CERTIFIED
            if lanes[FAILED * LANES + lane] > 0.5:
                statuses[one] = move_alone(case, inputs, places, motors, forces, grid, times, out, one)
