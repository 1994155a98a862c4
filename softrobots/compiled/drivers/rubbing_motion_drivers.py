"""Steps of time of robots with dry friction, instead of those of `motion_drivers`; kernel language.

A step is the minimum of `softrobots.dynamics.friction_steps`, found as there. In batches the cases are done one by one.
"""

from __future__ import annotations

from typing import Any

from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, zeros
from softrobots.compiled.drivers.lane_drivers import Places, Rows, store_case
from softrobots.compiled.drivers.motion_lane_drivers import move_alone
from softrobots.compiled.motion_settings import *


def downhill(w: Array) -> float:
    """Return how steeply the energy of the step falls along the last whole correction."""
    slope = 0.0
    for i in range(N_STRAINS):
        slope -= w[TORQUES + i] * w[LINE_STRAIN + i]
    return slope


def move_along(w: Array, share: float) -> None:
    """Move by a share of that correction, and evaluate the robot there."""
    for i in range(N):
        w[CORRECTION + i] = share * w[LINE + i]
        apply_correction(w, i)
    motion_factor(w)


def search_back(w: Array, first: float, left: float) -> float:
    """Go back along the last correction, if it ends far beyond the minimum; return how many evaluations are left."""
    low = 0.0
    fall = first
    high = 1.0
    rise = 0.0
    share = 1.0
    last = 0.0
    slope = downhill(w)
    if first <= 0.0 or slope >= -OVERSHOT * first:
        return left
    while fabs(slope) > 0.5 * first and left > 0.0:
        if slope > 0.0:
            if last > 0.0:
                rise *= 0.5
            low = share
            fall = slope
        else:
            if last < 0.0:
                fall *= 0.5
            high = share
            rise = slope
        last = slope
        nearer = low + (high - low) * fall / (fall - rise)
        move_along(w, nearer - share)
        share = nearer
        slope = downhill(w)
        left -= 1.0
    return left


def settle_middle(w: Array) -> bool:
    """Find the accelerations of a step; tell whether the corrections converge."""
    for i in range(N_STRAINS):
        w[BEYOND + i] = 3.0 * w[STRAIN_BEGIN + i] + w[TIME_STEP] * w[RATE_BEGIN + i] + w[SLIDERS + i]
    choose_order(w)
    for i in range(N):
        guess_unknown(w, i)
    motion_factor(w)
    last = 1e300
    left = RUBBING_CORRECTIONS
    while left > 0.0:
        left -= 1.0
        for i in range(N):
            w[LINE + i] = w[CORRECTION + i]
        for i in range(N_STRAINS):
            w[LINE_STRAIN + i] = w[STRAIN_CORRECTION + i]
        first = downhill(w)
        w[CHANGE] = 0.0
        move_along(w, 1.0)
        change = w[CHANGE]
        if change <= MOTION_TOLERANCE or (change >= 0.5 * last and last <= MOTION_ROUNDING):
            return True
        if change >= 1e300 or change > 1e3 * last:
            return False
        last = change
        left = search_back(w, first, left)
    return last <= MOTION_LEFT


def finish_step(w: Array) -> None:
    """Go to the end of a step, and let the sliders follow."""
    for i in range(N):
        finish_unknown(w, i)
    w[SHARE] += 0.5 * w[TIME_STEP] / w[WHOLE_STEP]
    for i in range(N_MOTORS):
        place_motor(w, i)
    end_strains(w)
    for i in range(N_STRAINS):
        w[SLIDERS + i] = w[STRAIN_BEGIN + i] - w[LAG + i]


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
    """Take the steps of `motion_run` for the cases from `first` on; the third of `inputs` is what friction remembers."""
    case = zeros(WORKSPACE_SIZE)
    for one in range(first, last):
        statuses[one] = move_alone(case, inputs, places, motors, forces, grid, times, out, one)
        store_case(case, inputs[2:3], places[2:3], one)
