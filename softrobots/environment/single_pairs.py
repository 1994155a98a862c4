"""Candidates of contact of a core and a body in plain numbers, with the equations of `nearest_points`."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from softrobots.environment.nearest_points import MAX_ITERATIONS, NARROW, PARALLEL, ROUND, SLOPE
from softrobots.environment.single_bodies import Body, Seen, Triple


class Found(NamedTuple):
    """A candidate on a core."""

    feature: int
    """0 for its start, 1 for its end, 2 for the minimum between them, 3 + place of the border for a crossing."""
    share: float
    """Share of the way from start to end."""
    distance: float
    """Distance of the point from the body [m]."""
    normal: Triple
    """Normal in the axes of the body."""


def single_pair(body: Body, start: Seen, end: Seen, length: float, limit: float, merged: float) -> list[Found]:
    """Find the candidates of a core between two points; the other arguments as of `nearest_points.core_points`.

    Start and end are first, whatever their distance; the others are within `limit`.
    """
    ((a, b, c), first, n), (point, last, m) = start, end
    u, v, w = span = point[0] - a, point[1] - b, point[2] - c
    low, high = n[0] * u + n[1] * v + n[2] * w, m[0] * u + m[1] * v + m[2] * w  # slopes over shares
    between, found = low < 0.0 < high, [Found(0, 0.0, first, n), Found(1, 1.0, last, m)]
    kept: list[Found] = []
    before, after = (0.0, first, low, 0), (1.0, last, high, 1)  # the neighbours of the minimum
    for place, share in enumerate(body.borders(start.point, span)):
        if not 0.0 < share < 1.0:
            continue
        if not between and max(first + share * low, last + (share - 1.0) * high) > limit:
            continue  # the tangents at both ends are below the distance
        distance, n = body.at((a + share * u, b + share * v, c + share * w))
        slope, feature = n[0] * u + n[1] * v + n[2] * w, 3 + place
        if slope < 0.0:
            before = max(before, (share, distance, slope, feature))
        else:
            after = min(after, (share, distance, slope, feature))
        if distance <= limit and merged < share * length < length - merged:
            kept.append(Found(feature, share, distance, n))
    hidden: tuple[int, ...] = ()
    if between:
        least, bend = _minimum(body, start.point, span, length, before, after)
        way, round_here = least.share * length, bend * (max(least.distance, 0.0) + (body.rounded))
        if merged < way < length - merged and (round_here > PARALLEL or least.distance <= merged):
            near = [abs(beside[0] - least.share) * length for beside in (before, after)]
            stands = max(merged, 0.5 * least.distance if round_here > ROUND else merged)
            hidden = tuple(beside[3] for beside, apart in zip((before, after), near, strict=True) if apart <= stands)
            if least.distance <= limit:
                found.append(least)
    return found + [one for one in kept if one.feature not in hidden]


def _minimum(
    body: Body,
    start: Triple,
    span: Triple,
    length: float,
    before: tuple[float, float, float, int],
    after: tuple[float, float, float, int],
) -> tuple[Found, float]:
    """Minimum between two points of the core, each with share, distance and slope, and curvature there; as `nearest_points`."""
    (a, b, c), (u, v, w), rounded = start, span, body.rounded
    (lower, low, fall, _), (upper, high, climb, _) = before, after
    if climb * (high + rounded) > fall * (low + rounded):  # linear along the core where it is round
        fall, climb = fall * (low + rounded), climb * (high + rounded)
    share = lower - (upper - lower) * fall / (climb - fall)
    for _ in range(MAX_ITERATIONS):
        distance, n = body.at((a + share * u, b + share * v, c + share * w))
        bend, slope = body.bend(distance, n, span), n[0] * u + n[1] * v + n[2] * w
        if abs(slope) <= SLOPE * length:
            break
        lower, upper = (share, upper) if slope < 0.0 else (lower, share)
        if upper - lower <= NARROW:
            break
        trial = share - slope / bend if bend > 0.0 else inf
        share = trial if lower < trial < upper else 0.5 * (lower + upper)
    return Found(2, share, distance, n), bend / (length * length)
