"""Where the core of a capsule comes nearest to a convex body, and where it crosses between features of the body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.distance_fields import Field

MAX_ITERATIONS = 60
"""Most steps to a minimum."""
SLOPE = 1e-13
"""Slope of the distance along the core at which the minimum is found; the distance is then exact to rounding."""
PARALLEL = 1e-12
"""Curvature along the core, times distance from the feature, below which the nearest point is not unique: ends and borders hold
the gap then."""
ROUND = 0.1
"""The same, above which a minimum stands for a border of its feature that is nearer than half the distance."""
NARROW = 1e-15
"""Difference of shares that is none."""
_TINY = 1e-300
_BOTH, _ENDS = np.array([0, 1]), np.array([[0.0, 1.0]])


class CorePoints(NamedTuple):
    """Candidates of contact inside of cores."""

    pairs: Any
    """The pair of each, shape (m,), integers."""
    features: Any
    """0 for the minimum, 1 + place of the border in `Field.borders` for a crossing, shape (m,), integers."""
    points: FloatArray
    """Points of the cores, shape (m, 3) [m]."""
    distances: FloatArray
    """Their distances from the bodies, shape (m,) [m]."""
    normals: FloatArray
    """Normals, shape (m, 3)."""


_NOBODY = np.zeros(0, dtype=np.intp)
NO_POINTS = CorePoints(_NOBODY, _NOBODY, np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))


def core_points(
    field: Field,
    which: Any,
    starts: FloatArray,
    spans: FloatArray,
    limits: FloatArray,
    merged: float,
    at_ends: tuple[FloatArray, FloatArray] | None = None,
) -> CorePoints:
    r"""Minima of the distance inside of straight cores, and crossings of borders between features.

    The distance is convex along a core, so its slope :math:`n \cdot t` grows: the minimum lies between the neighbouring ones of
    ends and borders where it changes sign, and Newton steps within that interval find it.

    Args:
        field: Distances from the bodies.
        which: Body of each pair, shape (m,).
        starts: Starts of the cores, shape (m, 3) [m].
        spans: From start to end of the cores, shape (m, 3) [m].
        limits: Distance of interest of each pair, shape (m,) [m].
        merged: Distance from an end of the core within which a candidate is that end [m].
        at_ends: Distances, shape (m, 2) [m], and normals, shape (m, 2, 3), of the two ends, where they are known.

    Returns:
        The candidates.
    """
    if at_ends is None:
        both = field.at(np.stack([starts, starts + spans], axis=1).reshape(-1, 3), which.repeat(2))
        at_ends = both[0].reshape(-1, 2), both[1].reshape(-1, 2, 3)
    length = np.maximum(np.sqrt(np.vecdot(spans, spans)), _TINY)
    along = spans / length[:, None]
    distances, slopes, shares = at_ends[0], np.matvec(at_ends[1], along), _ENDS
    borders, between = field.borders(starts, spans, which), (slopes[:, 0] < 0.0) & (slopes[:, 1] > 0.0)
    crossed = (borders > 0.0) & (borders < 1.0)
    if crossed.any():  # the tangents at both ends are below the distance
        borders = np.where(crossed, borders, 1.0)
        ways = borders * length[:, None]
        least = np.maximum(ways * slopes[:, :1] + distances[:, :1], (ways - length[:, None]) * slopes[:, 1:] + distances[:, 1:])
        crossed &= (least <= limits[:, None]) | between[:, None]
    rows, used = between.nonzero()[0], np.logical_or.reduce(crossed, 0).nonzero()[0]
    if len(used):
        borders = borders.take(used, 1)
        order = borders.argsort(axis=1)
        borders = np.sort(borders, axis=1)
        points = starts[:, None] + borders[:, :, None] * spans[:, None]
        flat = field.at(points.reshape(-1, 3), which.repeat(len(used)))
        inner, normals = flat[0].reshape(borders.shape), flat[1].reshape(points.shape)
        ways = borders * length[:, None]
        keep = (ways > merged) & (ways < length[:, None] - merged) & (inner <= limits[:, None])
        distances, slopes = _between(distances, inner), _between(slopes, np.matvec(normals, along))
        shares = _between(np.broadcast_to(_ENDS, (len(which), 2)), borders)

    found = NO_POINTS
    if len(rows):
        bodies, begins, ways, lengths = which.take(rows), starts.take(rows, 0), spans.take(rows, 0), length.take(rows)
        place = (slopes.take(rows, 0) < 0.0).sum(axis=1) - 1
        entries = (rows * slopes.shape[1] + place)[:, None] + _BOTH
        bracket = shares.take(entries if len(used) else _BOTH[None].repeat(len(rows), 0))
        tables = bracket, slopes.take(entries), distances.take(entries)
        share, points_there, distance, normal, bend = _minimum(field, bodies, begins, ways, lengths, *tables)
        round_here = bend * (np.maximum(distance, 0.0) + field.radii.take(bodies))
        way = share * lengths
        unique = (way > merged) & (way < lengths - merged) & ((round_here > PARALLEL) | (distance <= merged))
        for border in (place - 1, place) if len(used) else ():  # before and after the minimum
            at = np.minimum(np.maximum(border, 0), len(used) - 1)
            apart = np.abs(shares[rows, at + 1] - share) * lengths
            stands = unique & ((apart <= merged) | ((apart <= 0.5 * distance) & (round_here > ROUND)))
            keep[rows, at] &= ~stands
        good = (unique & (distance <= limits.take(rows))).nonzero()[0]
        zeros = np.zeros(len(good), dtype=np.intp)
        found = CorePoints(rows.take(good), zeros, points_there.take(good, 0), distance.take(good), normal.take(good, 0))
    pairs, columns = keep.nonzero() if len(used) else (_NOBODY, _NOBODY)
    if not len(pairs):
        return found
    features = 1 + used[order[pairs, columns]]
    crossings = CorePoints(pairs, features, points[pairs, columns], inner[pairs, columns], normals[pairs, columns])
    return CorePoints(*(np.concatenate(both) for both in zip(found, crossings, strict=True))) if len(found.pairs) else crossings


def _between(ends: FloatArray, inner: FloatArray) -> FloatArray:
    """Values at both ends, shape (m, 2), with others between them, shape (m, k)."""
    return np.concatenate([ends[:, :1], inner, ends[:, 1:]], axis=1)


def _minimum(
    field: Field,
    which: Any,
    starts: FloatArray,
    spans: FloatArray,
    length: FloatArray,
    shares: FloatArray,
    slopes: FloatArray,
    distances: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Find the minimum along each core by Newton steps within a bracket of its share, by bisection where they leave it.

    Args:
        field: Distances from the bodies.
        which: Body of each core, shape (m,).
        starts: Starts of the cores, shape (m, 3) [m].
        spans: From start to end of the cores, shape (m, 3) [m].
        length: Their lengths, shape (m,) [m].
        shares: Shares of the core between which the slope changes sign, shape (m, 2).
        slopes: Slopes there, shape (m, 2).
        distances: Distances there, shape (m, 2) [m].

    Returns:
        Share, point [m], distance [m], normal and curvature of the distance along the core [1/m] at the minimum.
    """
    along, lower, upper = spans / length[:, None], shares[:, 0], shares[:, 1]
    # slope times distance from a corner or a straight edge is linear along the core
    guess = slopes * (distances + field.radii.take(which)[:, None])
    rise = guess[:, 1] - guess[:, 0]
    if not (rise > 0.0).all():
        guess, rise = slopes, slopes[:, 1] - slopes[:, 0]
    share = lower - (upper - lower) * guess[:, 0] / rise
    for _ in range(MAX_ITERATIONS):
        points = starts + share[:, None] * spans
        distance, normal, bend = field.along(points, which, along)
        slope = np.vecdot(normal, along)
        waiting = np.abs(slope) > SLOPE
        if not waiting.any():
            break
        lower, upper = np.where(slope < 0.0, share, lower), np.where(slope > 0.0, share, upper)
        waiting &= upper - lower > NARROW
        if not waiting.any():
            break
        trial = share - slope / (np.where(bend > 0.0, bend, np.inf) * length)
        trial = np.where((bend > 0.0) & (trial > lower) & (trial < upper), trial, 0.5 * (lower + upper))
        share = np.where(waiting, trial, share)
    return share, points, distance, normal, bend
