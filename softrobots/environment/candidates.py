"""Candidates of contact: material points of a robot's cores that may touch an obstacle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import Field, HalfSpaces
from softrobots.environment.nearest_points import core_points

INSIDE = 2
"""Feature of the minimum between the ends of a core; 0 and 1 are start and end, larger numbers crossed borders."""


class Candidates(NamedTuple):
    """Candidates, sorted by field."""

    parts: list[tuple[Field, Any]]
    """Fields, with the body of each of their candidates there."""
    capsules: Any
    """Capsule of each candidate, shape (m,), integers."""
    obstacles: Any
    """Obstacle of each, shape (m,), integers."""
    features: Any
    """Feature of each, shape (m,), integers: see `INSIDE`."""
    points: FloatArray
    """Material points of the cores, shape (m, 3) [m]."""
    distances: FloatArray
    """Their distances from the obstacles, shape (m,) [m]."""
    normals: FloatArray
    """Normals from obstacle to robot, shape (m, 3)."""


def find_candidates(
    cores: Cores, places: CorePlaces, fields: list[tuple[Field, Any]], margin: float, merged: float
) -> Candidates:
    """Find the candidates with gaps of at most a margin.

    Args:
        cores: The cores of the robot.
        places: Where they are.
        fields: Distances from the obstacles, with the number of each.
        margin: Largest gap [m].
        merged: Distance within which candidates are one [m].

    Returns:
        The candidates.
    """
    ends = places.ends.reshape(-1, 3).take(cores.single_ends, 0)
    limits = margin + cores.radii
    end_limits = limits.take(cores.end_capsules)[:, None]
    parts: list[tuple[Field, Any]] = []
    found: list[tuple[Any, ...]] = []
    for field, numbers in fields:
        distances = field.distance(ends)
        near, which = (distances <= end_limits).nonzero()
        capsules, features, points = cores.end_capsules.take(near), cores.end_features.take(near), ends.take(near, 0)
        values, normals = field.at(points, which)
        close = (values <= limits.take(capsules)).nonzero()[0]
        if len(close) < len(values):  # `distance` was a lower bound
            which, capsules, features, points = (column.take(close, 0) for column in (which, capsules, features, points))
            values, normals = values.take(close), normals.take(close, 0)
        if not isinstance(field, HalfSpaces):
            # the distance changes by at most the length of the way: what is far at both ends is far between them
            least = 0.5 * (distances[cores.end_numbers].sum(axis=1) - cores.lengths[:, None])
            one, other = np.nonzero((least <= limits[:, None]) & (cores.lengths > 0.0)[:, None])
            if len(one):
                inner = core_points(field, other, places.ends[one, 0], places.spans[one], limits[one], merged)
                which = np.concatenate([which, other[inner.pairs]])
                capsules = np.concatenate([capsules, one[inner.pairs]])
                features = np.concatenate([features, INSIDE + inner.features])
                points = np.concatenate([points, inner.points])
                values, normals = np.concatenate([values, inner.distances]), np.concatenate([normals, inner.normals])
        parts.append((field, which))
        found.append((capsules, numbers.take(which), features, points, values, normals))
    if not found:
        nobody = np.zeros(0, dtype=np.intp)
        return Candidates([], nobody, nobody, nobody, np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
    columns = found[0] if len(found) == 1 else [np.concatenate(column) for column in zip(*found, strict=True)]
    return Candidates(parts, *columns)
