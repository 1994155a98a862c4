"""Distances of one point, with normal and curvature, and candidates of contact; `softrobots.environment` has the equations.

A row of an obstacle holds its kind, axes (9 numbers, row by row), centre, half sizes and radius: of a rounded box (a box, a
sphere, a capsule) half its edges and its radius; of a cylinder half its length first, and its radius.
"""

from __future__ import annotations

from math import copysign, fabs, sqrt
from typing import Any

HALF_SPACE, ROUNDED_BOX, CYLINDER = 0.0, 1.0, 2.0
CENTRE, HALF, RADIUS, ROW = 10, 13, 16, 17
LOCAL, NORMAL, BEND, FOUND = 13, 16, 19, 28
TINY, ON_BORDER = 1e-300, 1e-9
SLOPE, NARROW, PARALLEL, ROUND = 1e-13, 1e-15, 1e-12, 0.1
MAX_ITERATIONS, INSIDE, BORDERS = 60, 2, 6


def to_body(body: Any, x: Any, local: Any) -> None:
    """Write a vector in the axes of a body to the first three of `local`."""
    for j in range(3):
        local[j] = body[1 + j] * x[0] + body[4 + j] * x[1] + body[7 + j] * x[2]


def surface(body: Any, x: Any, curved: Any, found: Any) -> None:
    """Write the distance of a point, the normal, and, if `curved` is not 0, the Hessian by rows to the first 13 of `found`."""
    found[LOCAL] = x[0] - body[CENTRE]
    found[LOCAL + 1] = x[1] - body[CENTRE + 1]
    found[LOCAL + 2] = x[2] - body[CENTRE + 2]
    for i in range(4, 13):
        found[i] = 0.0
    if body[0] == HALF_SPACE:
        found[0] = body[3] * found[LOCAL] + body[6] * found[LOCAL + 1] + body[9] * found[LOCAL + 2]
        found[1], found[2], found[3] = body[3], body[6], body[9]
        return
    to_body(body, found[LOCAL : LOCAL + 3], found[NORMAL : NORMAL + 3])
    local, normal, bend = found[NORMAL : NORMAL + 3], found[LOCAL : LOCAL + 3], found[BEND : BEND + 9]
    for i in range(9):
        bend[i] = 0.0
    if body[0] == ROUNDED_BOX:
        beside_box(body, local, normal, bend, found)
    else:
        beside_cylinder(body, local, normal, bend, found)
    for i in range(3):
        found[1 + i] = body[1 + 3 * i] * normal[0] + body[2 + 3 * i] * normal[1] + body[3 + 3 * i] * normal[2]
    if curved == 0.0:
        return
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += body[1 + 3 * i + k] * bend[3 * k + m] * body[1 + 3 * j + m]
            found[4 + 3 * i + j] = total


def beside_box(body: Any, local: Any, normal: Any, bend: Any, found: Any) -> None:
    """The same of a rounded box in its own axes; `RoundedBoxes`."""
    square, deepest, place = 0.0, -1e300, 0
    for i in range(3):
        beyond = fabs(local[i]) - body[HALF + i]
        if beyond > deepest:
            deepest, place = beyond, i
        square += max(beyond, 0.0) ** 2
    distance = sqrt(square)
    if distance < TINY:
        found[0] = deepest - body[RADIUS]
        for i in range(3):
            normal[i] = 0.0
        normal[place] = copysign(1.0, local[place])
        return
    found[0] = distance - body[RADIUS]
    count = 0
    for i in range(3):
        beyond = fabs(local[i]) - body[HALF + i]
        normal[i] = copysign(max(beyond, 0.0) / distance, local[i])
        if beyond > ON_BORDER * distance or body[HALF + i] == 0.0:
            bend[4 * i] = 1.0 / distance
            count += 1
    for i in range(3):
        for j in range(3):
            bend[3 * i + j] = bend[3 * i + j] - normal[i] * normal[j] / distance if count > 1 else 0.0


def beside_cylinder(body: Any, local: Any, normal: Any, bend: Any, found: Any) -> None:
    """The same of a cylinder in its own axes; `Cylinders`."""
    from_axis = sqrt(local[0] ** 2 + local[1] ** 2)
    side, end = from_axis - body[RADIUS], fabs(local[2]) - body[HALF]
    distance = sqrt(max(side, 0.0) ** 2 + max(end, 0.0) ** 2)
    out_x, out_y = 1.0, 0.0
    if from_axis >= TINY:
        out_x, out_y = local[0] / from_axis, local[1] / from_axis
    by_side, by_end = 1.0, 0.0
    if distance >= TINY:
        found[0], by_side, by_end = distance, max(side, 0.0) / distance, max(end, 0.0) / distance
    else:
        found[0] = max(side, end)
        if end > side:
            by_side, by_end = 0.0, 1.0
    normal[0], normal[1], normal[2] = by_side * out_x, by_side * out_y, copysign(by_end, local[2])
    if distance < TINY:
        return
    around = by_side / max(from_axis, TINY)
    bend[0], bend[1] = around * out_y * out_y, -around * out_x * out_y
    bend[3], bend[4] = bend[1], around * out_x * out_x
    if side > ON_BORDER * distance and end > ON_BORDER * distance:  # the rim
        bend[0] += out_x * out_x / distance
        bend[1] += out_x * out_y / distance
        bend[3] += out_x * out_y / distance
        bend[4] += out_y * out_y / distance
        bend[8] += 1.0 / distance
        for i in range(3):
            for j in range(3):
                bend[3 * i + j] -= normal[i] * normal[j] / distance


def bent_along(found: Any, way: Any) -> Any:
    """Second derivative of the distance along a direction."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += way[i] * found[4 + 3 * i + j] * way[j]
    return total


def borders_of(body: Any, start: Any, span: Any, shares: Any, work: Any) -> None:
    """Write the shares of the way at which it passes between features, 2 where it does not."""
    for i in range(BORDERS):
        shares[i] = 2.0
    local, along = work[:3], work[3:6]
    to_body(body, span, along)
    work[6], work[7], work[8] = start[0] - body[CENTRE], start[1] - body[CENTRE + 1], start[2] - body[CENTRE + 2]
    to_body(body, work[6:9], local)
    if body[0] == ROUNDED_BOX:
        for i in range(3):
            if body[HALF + i] > 0.0 and fabs(along[i]) > TINY:
                shares[i] = (body[HALF + i] - local[i]) / along[i]
                shares[3 + i] = (-body[HALF + i] - local[i]) / along[i]
        return
    if fabs(along[2]) > TINY:
        shares[0], shares[1] = (body[HALF] - local[2]) / along[2], (-body[HALF] - local[2]) / along[2]
    square, turn = along[0] ** 2 + along[1] ** 2, local[0] * along[0] + local[1] * along[1]
    root = turn * turn - square * (local[0] ** 2 + local[1] ** 2 - body[RADIUS] ** 2)
    if root > 0.0 and square > TINY:
        shares[2], shares[3] = (-turn - sqrt(root)) / square, (-turn + sqrt(root)) / square


def core_candidates(
    body: Any, start: Any, span: Any, length: Any, first: Any, last: Any, limit: Any, merged: Any, hits: Any, found: Any,
    work: Any,
) -> Any:  # fmt: skip
    """Find the minimum inside of a core and crossed borders; `softrobots.environment.nearest_points.core_points`.

    Writes feature, point, distance and normal of each to a row of `hits`; `first` and `last` are distance and normal at the
    ends. Returns how many.
    """
    shares, way, x, table = work[9:15], work[15:18], work[18:21], work[21:45].reshape(8, 3)
    for i in range(3):
        way[i] = span[i] / length
    borders_of(body, start, span, shares, work)
    count = 1  # rows of the table: share, distance, slope; hits of borders stand one below their row
    table[0, 0], table[0, 1] = 0.0, first[0]
    table[0, 2] = first[1] * way[0] + first[2] * way[1] + first[3] * way[2]
    while count < 7:  # in ascending order
        best, place = 1.0, -1
        for i in range(BORDERS):
            if 0.0 < shares[i] < best:
                best, place = shares[i], i
        if place < 0:
            break
        shares[place] = 2.0
        for i in range(3):
            x[i] = start[i] + best * span[i]
        surface(body, x, 0.0, found)
        table[count, 0], table[count, 1] = best, found[0]
        table[count, 2] = found[1] * way[0] + found[2] * way[1] + found[3] * way[2]
        near = merged < best * length < length - merged and found[0] <= limit
        hits[count - 1, 0] = INSIDE + 1 + place if near else -1.0
        for i in range(3):
            hits[count - 1, 1 + i], hits[count - 1, 5 + i] = x[i], found[1 + i]
        hits[count - 1, 4] = found[0]
        count += 1
    hit = count - 1
    table[count, 0], table[count, 1] = 1.0, last[0]
    table[count, 2] = last[1] * way[0] + last[2] * way[1] + last[3] * way[2]
    if not (table[0, 2] < 0.0 < table[count, 2]):
        return hit
    place = 0
    while table[place + 1, 2] < 0.0:
        place += 1
    lower, upper = table[place, 0], table[place + 1, 0]
    low, high = table[place, 2], table[place + 1, 2]
    rounded = body[RADIUS]
    if high * (table[place + 1, 1] + rounded) > low * (table[place, 1] + rounded):
        low, high = low * (table[place, 1] + rounded), high * (table[place + 1, 1] + rounded)
    share, bend = lower - (upper - lower) * low / (high - low), 0.0
    for _ in range(MAX_ITERATIONS):
        for i in range(3):
            x[i] = start[i] + share * span[i]
        surface(body, x, 1.0, found)
        bend = bent_along(found, way)
        slope = found[1] * way[0] + found[2] * way[1] + found[3] * way[2]
        if fabs(slope) <= SLOPE:
            break
        if slope < 0.0:
            lower = share
        else:
            upper = share
        if upper - lower <= NARROW:
            break
        trial = share - slope / (bend * length) if bend > 0.0 else 2.0
        share = trial if lower < trial < upper else 0.5 * (lower + upper)
    at, distance = share * length, found[0]
    round_here = bend * (max(distance, 0.0) + rounded)
    if not (merged < at < length - merged and (round_here > PARALLEL or distance <= merged)):
        return hit
    for row in (place - 1, place):
        if 0 <= row < count - 1:
            apart = fabs(table[row + 1, 0] - share) * length
            if apart <= merged or (apart <= 0.5 * distance and round_here > ROUND):
                hits[row, 0] = -1.0
    if distance <= limit:
        hits[hit, 0] = INSIDE
        for i in range(3):
            hits[hit, 1 + i], hits[hit, 5 + i] = x[i], found[1 + i]
        hits[hit, 4] = distance
        hit += 1
    return hit
