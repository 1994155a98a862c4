"""Equilibria of robots whose actuators rub in their guides; kernel language, see `equilibrium_drivers`.

The energy has its minimum for given friction of the guides, which follows the tensions there until it stays the same
(`softrobots.model.dry_friction`). In batches the cases are solved one by one.
"""

from __future__ import annotations

from typing import Any

from softrobots.compiled.drivers.equilibrium_drivers import descend, go_to_start, is_usable
from softrobots.compiled.drivers.generated_names import *
from softrobots.compiled.drivers.intrinsics import Array, fabs, sqrt, zeros
from softrobots.compiled.drivers.lane_drivers import Places, Rows, load_case, store_case
from softrobots.compiled.settings import *


def turn_at(w: Array, place: int, guide: int, row: int) -> float:
    """Return a component of the turn of the body (0 to 2), of the tangent (3 to 5), or of the piece (6 to 8) at a guide.

    The strains are from `place` on; the piece is in axes of which the last is along it.
    """
    at = 45 * guide + 5 * row
    total = GUIDE_TURN[at]
    for i in range(4):
        total += GUIDE_TURN[at + 1 + i] * w[place + GUIDE_STRAIN[4 * guide + i]]
    return total


def angle_at(w: Array, place: int, guide: int) -> float:
    """Return the angle by which an actuator turns in a guide, at strains from `place` on [rad]."""
    x = turn_at(w, place, guide, 0)
    y = turn_at(w, place, guide, 1)
    z = turn_at(w, place, guide, 2)
    a = turn_at(w, place, guide, 3)
    b = turn_at(w, place, guide, 4)
    c = turn_at(w, place, guide, 5)
    u = y * c - z * b
    v = z * a - x * c
    t = x * b - y * a
    return sqrt((u * u + v * v + t * t) / (a * a + b * b + c * c))


def mean_decay(along: float) -> float:
    """Return the mean of `exp(-x)` for x from 0 to a number: a series for its 64th part, doubled."""
    part = along / 64.0
    mean = 1.0
    for i in range(12):
        mean = 1.0 - mean * part / (13.0 - i)
    for _ in range(6):
        mean *= 1.0 - 0.5 * part * mean
        part *= 2.0
    return mean


def grip(w: Array, rounds: int) -> float:
    """Write the friction of each guide for the next round; return how far that of this one is off.

    The difference is relative to the largest tension. From the second round on it is the secant through the last two, see
    `softrobots.model.friction_coordinates.GuideFriction`.
    """
    change = 0.0
    largest = 1e-300
    bent = 1e-300
    back = 0.0
    for m in range(N_RUBBING):
        before = fabs(w[PULLED + m])
        if before > largest:
            largest = before
        for guide in range(FIRST_GUIDE[m], FIRST_GUIDE[m + 1]):
            exponent = GUIDE_COEFFICIENT[guide] * angle_at(w, UNKNOWN, guide)
            along = exponent * w[GUIDE_AT[guide] + 4]
            mean = mean_decay(along)
            off = before * exponent * mean - w[GRIPS + guide]
            before *= 1.0 - along * mean
            if not fabs(off) <= change:
                change = fabs(off)
            turned = off - w[GRIPS + 2 * N_GUIDES + guide]
            bent += turned * turned
            back += turned * off
            w[GRIPS + 2 * N_GUIDES + guide] = off
    share = 0.0
    if rounds > 0:
        share = back / bent
    for guide in range(N_GUIDES):
        before = w[GRIPS + guide]
        friction = before + w[GRIPS + 2 * N_GUIDES + guide]
        w[GRIPS + guide] = friction - share * (friction - w[GRIPS + N_GUIDES + guide])
        if w[GRIPS + guide] < 0.0:
            w[GRIPS + guide] = 0.0
        if w[GRIPS + guide] > before + largest:
            w[GRIPS + guide] = before + largest
        w[GRIPS + N_GUIDES + guide] = friction
    return change / largest


def descend_rubbing(w: Array) -> int:
    """Descend from the unknowns until the friction of the guides stays the same; return the status."""
    for guide in range(N_GUIDES):
        w[GRIPS + guide] = 0.0
    evaluate(w)
    grip(w, 0)  # of the start, which holds the robot near to it
    status = UNSETTLED
    steps = 0.0
    for rounds in range(GUIDE_ROUNDS):
        status = descend(w)
        steps += w[ITERATIONS]
        w[ITERATIONS] = steps
        if w[RANGE_MARGIN] < 0.0:
            return status
        change = grip(w, rounds)
        if change <= SAME_GRIP:
            return status
        if not change <= GRIP_RUNAWAY:
            break
    if status == NOT_A_NUMBER:
        return status
    return UNSETTLED


def settle_from(w: Array) -> int:
    """Find the equilibrium by descent from the unknowns in the workspace; return the status."""
    if not is_usable(w):
        return NOT_A_NUMBER
    prepare(w)
    return descend_rubbing(w)


def settle(w: Array) -> int:
    """Find the equilibrium from rest; return the status."""
    go_to_start(w)
    return settle_from(w)


def settle_batch(
    inputs: Rows, places: Places, outputs: Rows, result_places: Places, statuses: Any, first: int, last: int
) -> None:
    """Find equilibria from the unknowns given; see `lane_drivers`."""
    case = zeros(WORKSPACE_SIZE)
    for row in range(first, last):
        load_case(case, inputs, places, row)
        statuses[row] = settle_from(case)
        store_case(case, outputs, result_places, row)
