"""Candidates of contact: material points of a robot's cores that may touch an obstacle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import Field, HalfSpaces
from softrobots.environment.nearest_points import core_points
from softrobots.environment.self_contact import different_contacts, near_pairs, own_capsules

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
    cores: Cores, places: CorePlaces, fields: list[tuple[Field, Any]], pairs: Any, margin: float, merged: float
) -> Candidates:
    """Find the candidates with gaps of at most a margin.

    Args:
        cores: The cores of the robot.
        places: Where they are.
        fields: Distances from the obstacles, with the number of each.
        pairs: Capsules that may touch each other, shape (n, 2), integers; None without contact of the robot with itself.
        margin: Largest gap [m].
        merged: Distance within which candidates are one [m].

    Returns:
        The candidates.
    """
    ends = places.ends.reshape(-1, 3).take(cores.single_ends, 0)
    limits = margin + cores.radii
    end_limits = limits.take(cores.end_capsules)[:, None]
    found: list[_Found] = []
    for field, numbers in fields:
        distances = field.distance(ends)
        touching = distances <= end_limits
        if len(cores.at_base):
            _leave_out_base(touching, field, cores, ends, distances)
        near, which = touching.nonzero()
        one = other = near[:0]
        if not isinstance(field, HalfSpaces):
            # the distance changes by at most the length of the way: what is far at both ends is far between them
            one, other = (
                distances.take(cores.end_numbers, 0).sum(axis=1) <= (2.0 * limits + cores.long_ways)[:, None]
            ).nonzero()
        if len(near) or len(one):
            of_ends = _ends(field, cores, ends, near, which, limits)
            found.append(_with_inner(of_ends, places, one, other, limits, merged).numbered(numbers))
    if pairs is not None:
        found.append(_own(cores, places, pairs, ends, limits, margin, merged, sum(len(numbers) for _, numbers in fields)))
    parts = [(one.field, one.which) for one in found]
    if len(found) == 1:
        return Candidates(parts, *found[0][2:])
    if not found:
        nobody = np.zeros(0, dtype=np.intp)
        return Candidates([], nobody, nobody, nobody, np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
    return Candidates(parts, *(np.concatenate(column) for column in zip(*(one[2:] for one in found), strict=True)))


class _Found(NamedTuple):
    """Candidates of one field; the rest as in `Candidates`."""

    field: Field
    which: Any
    capsules: Any
    obstacles: Any
    features: Any
    points: FloatArray
    distances: FloatArray
    normals: FloatArray

    def numbered(self, numbers: Any) -> _Found:
        return self._replace(obstacles=numbers.take(self.which))

    def rows(self, chosen: Any) -> _Found:
        return _Found(self.field, *(column.take(chosen, 0) for column in self[1:]))


def _leave_out_base(touching: Any, field: Field, cores: Cores, ends: FloatArray, distances: FloatArray) -> None:
    """Clear `touching`, shape (ends, bodies), where an end is `at_base`, and the end there is inside of the body.

    There the robot stands on the body, with a flat end: its capsules have caps, which are no contact.
    """
    rows, which = (distances.take(cores.bases, 0) < cores.base_radii).nonzero()
    if len(rows):  # `distance` was a lower bound
        inside = field.at(ends[cores.bases[rows]], which)[0] < cores.base_radii[rows, 0]
        touching[cores.at_base[rows[inside]], which[inside]] = False


def _ends(field: Field, cores: Cores, ends: FloatArray, near: Any, which: Any, limits: FloatArray) -> _Found:
    """Ends that are near bodies."""
    capsules, points = cores.end_capsules.take(near), ends.take(near, 0)
    values, normals = field.at(points, which)
    found = _Found(field, which, capsules, which, cores.end_features.take(near), points, values, normals)
    close = (values <= limits.take(capsules)).nonzero()[0]
    return found if len(close) == len(values) else found.rows(close)  # `distance` was a lower bound


def _with_inner(of_ends: _Found, places: CorePlaces, one: Any, other: Any, limits: FloatArray, merged: float) -> _Found:
    """Add candidates inside of the cores `one` near the bodies `other`."""
    if not len(one):
        return of_ends
    inner = core_points(
        of_ends.field, other, places.ends.take(one, 0)[:, 0], places.spans.take(one, 0), limits.take(one), merged
    )
    which = other.take(inner.pairs)
    new = (which, one.take(inner.pairs), which, INSIDE + inner.features, inner.points, inner.distances, inner.normals)
    return _Found(of_ends.field, *(np.concatenate(pair) for pair in zip(of_ends[1:], new, strict=True)))


def _own(
    cores: Cores, places: CorePlaces, pairs: Any, ends: FloatArray, limits: FloatArray, margin: float, merged: float, count: int
) -> _Found:
    """Candidates between the robot's own capsules, which are obstacles after the `count` of the environment."""
    field = own_capsules(cores, places)
    near = near_pairs(cores, places, pairs, margin)
    touched = np.unique(np.concatenate([cores.end_numbers[near[:, 0], end] * cores.count + near[:, 1] for end in (0, 1)]))
    found = _ends(field, cores, ends, touched // cores.count, touched % cores.count, limits)
    long = near[cores.lengths[near[:, 0]] > 0.0]
    found = _with_inner(found, places, long[:, 0], long[:, 1], limits, merged)
    found = found.rows(different_contacts(cores, field, found.capsules, found.features, found.which, found.points))
    return found._replace(obstacles=count + found.which)
