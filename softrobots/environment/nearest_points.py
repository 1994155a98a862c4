"""Where the core of a capsule comes nearest to a convex body, and where it crosses between features of the body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.distance_fields import Field

_MAX_ITERATIONS = 60
_SLOPE = 1e-13
"""Slope of the distance along the core at which the minimum is found; the distance is then exact to rounding."""
_PARALLEL = 1e-12
"""Curvature along the core, times distance, below which the nearest point is not unique: ends and borders hold the gap then."""
_ROUND = 0.1
"""The same, above which a minimum stands for a border of its feature that is nearer than half the distance."""


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


def core_points(
    field: Field, which: Any, starts: FloatArray, spans: FloatArray, limits: FloatArray, merged: float
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

    Returns:
        The candidates.
    """
    count = len(which)
    length = np.sqrt((spans * spans).sum(axis=1))
    borders = field.borders(starts, spans, which)
    crossed = (borders > 0.0) & (borders < 1.0)
    used = np.flatnonzero(crossed.any(axis=0))
    borders = np.where(crossed, borders, 1.0)[:, used]
    order = borders.argsort(axis=1)
    shares = np.concatenate([np.zeros((count, 1)), np.take_along_axis(borders, order, axis=1), np.ones((count, 1))], axis=1)
    points = starts[:, None] + shares[:, :, None] * spans[:, None]
    flat = field.at(points.reshape(-1, 3), np.repeat(which, shares.shape[1]))
    distances, normals = flat[0].reshape(shares.shape), flat[1].reshape(points.shape)
    slopes = (normals * spans[:, None]).sum(axis=2) / length[:, None]

    rows = np.flatnonzero((slopes[:, 0] < 0.0) & (slopes[:, -1] > 0.0))
    place = (slopes[rows] < 0.0).sum(axis=1) - 1
    ends = np.stack([place, place + 1], axis=1)
    bracket, across_ends = shares[rows[:, None], ends], slopes[rows[:, None], ends]
    reach = across_ends * (distances[rows[:, None], ends] + field.radii[which[rows], None])
    share, minimum, normal, bend = _minimum(field, which[rows], starts[rows], spans[rows], bracket, across_ends, reach)
    keep = (shares[:, 1:-1] * length[:, None] > merged) & ((1.0 - shares[:, 1:-1]) * length[:, None] > merged)
    keep &= distances[:, 1:-1] <= limits[:, None]
    standing = np.maximum(minimum, 0.0)
    for shift in (-1, 0) if len(used) else ():  # the borders before and after the minimum
        border = np.clip(place + shift, 0, len(used) - 1)
        apart = np.abs(shares[rows, border + 1] - share) * length[rows]
        represented = (apart <= merged) | ((apart <= 0.5 * standing) & (bend * standing > _ROUND))
        keep[rows[represented], border[represented]] = False
    found = (bend * standing > _PARALLEL) | (minimum <= 0.0)
    found &= (share * length[rows] > merged) & ((1.0 - share) * length[rows] > merged) & (minimum <= limits[rows])

    pairs, columns = np.nonzero(keep)
    return CorePoints(
        np.concatenate([rows[found], pairs]),
        np.concatenate([np.zeros(int(found.sum()), dtype=np.intp), 1 + used[order[pairs, columns]]]),
        np.concatenate([starts[rows[found]] + share[found, None] * spans[rows[found]], points[pairs, columns + 1]]),
        np.concatenate([minimum[found], distances[pairs, columns + 1]]),
        np.concatenate([normal[found], normals[pairs, columns + 1]]),
    )


def _minimum(
    field: Field, which: Any, starts: FloatArray, spans: FloatArray, bracket: FloatArray, slopes: FloatArray, reach: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Find the minimum along each core by Newton steps within a bracket of its share, by bisection where they leave it.

    Args:
        field: Distances from the bodies.
        which: Body of each core, shape (m,).
        starts: Starts of the cores, shape (m, 3) [m].
        spans: From start to end of the cores, shape (m, 3) [m].
        bracket: Shares of the core between which the slope changes sign, shape (m, 2).
        slopes: Slopes there, shape (m, 2).
        reach: Slopes times distances from the features there: where the feature is a point or line, linear between, (m, 2).

    Returns:
        Share, distance [m], normal and curvature of the distance along the core [1/m] at the minimum.
    """
    length = np.sqrt((spans * spans).sum(axis=1))
    along = spans / length[:, None]
    lower, upper = bracket.T.copy()
    guess = reach if np.all(reach[:, 1] > reach[:, 0]) else slopes
    share = lower - (upper - lower) * guess[:, 0] / (guess[:, 1] - guess[:, 0])
    best = share, np.zeros(len(which)), np.zeros_like(starts), np.zeros(len(which))
    for _ in range(_MAX_ITERATIONS if len(which) else 0):
        points = starts + share[:, None] * spans
        distance, normal = field.at(points, which)
        slope = (normal * along).sum(axis=1)
        directions, curvatures = field.curvature(points, which)
        bend = (curvatures * (directions @ along[:, :, None])[:, :, 0] ** 2).sum(axis=1)
        best = share, distance, normal, bend
        lower, upper = np.where(slope < 0.0, share, lower), np.where(slope > 0.0, share, upper)
        open_rows = (np.abs(slope) > _SLOPE) & (upper - lower > 1e-15)
        if not open_rows.any():
            break
        step = np.where(bend > 0.0, -slope / (np.where(bend > 0.0, bend, 1.0) * length), np.inf)
        trial = share + step
        trial = np.where((trial > lower) & (trial < upper), trial, 0.5 * (lower + upper))
        share = np.where(open_rows, trial, share)
    return best
