"""Candidates of contact: material points of a robot's cores that may touch an obstacle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import Field, HalfSpaces
from softrobots.environment.nearest_points import core_points
from softrobots.environment.self_contact import different_contacts, near_pairs, own_capsules

_NOBODY = np.zeros(0, dtype=np.intp)
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
    found: list[Candidates] = []
    for field, numbers in fields:
        distances = field.at_least(ends)
        touching = distances <= end_limits
        if len(cores.at_base):
            _leave_out_base(touching, field, cores, ends, distances)
        if isinstance(field, HalfSpaces):  # bounds are distances, and they are least at ends
            near, which = touching.nonzero()
            values = distances.take(near * len(numbers) + which)
            new = _ends(field, cores, ends, near, which, values, field.normals.take(which, 0))
        else:
            # the distance changes by at most the length of the way: what is far at both ends is far between them
            far = distances.take(cores.end_numbers, 0).sum(axis=1) > (2.0 * limits + cores.long_ways)[:, None]
            new = _near(field, cores, places, ends, touching, (~far).nonzero(), limits, merged)
        if len(new.capsules):
            found.append(Candidates(new.parts, new.capsules, numbers.take(new.obstacles), *new[3:]))
    if pairs is not None:
        found.append(_own(cores, places, pairs, ends, limits, margin, merged, sum(len(numbers) for _, numbers in fields)))
    if len(found) == 1:
        return found[0]
    if not found:
        return Candidates([], _NOBODY, _NOBODY, _NOBODY, np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
    parts = [part for one in found for part in one.parts]
    return Candidates(parts, *(np.concatenate(column) for column in zip(*(one[1:] for one in found), strict=True)))


def _leave_out_base(touching: Any, field: Field, cores: Cores, ends: FloatArray, distances: FloatArray) -> None:
    """Clear `touching`, shape (ends, bodies), where an end is `at_base`, and the end there is inside of the body.

    There the robot stands on the body, with a flat end: its capsules have caps, which are no contact.
    """
    rows, which = (distances.take(cores.bases, 0) < cores.base_radii).nonzero()
    if len(rows):  # `distances` are lower bounds
        inside = field.at(ends[cores.bases[rows]], which)[0] < cores.base_radii[rows, 0]
        touching[cores.at_base[rows[inside]], which[inside]] = False


def _ends(
    field: Field, cores: Cores, ends: FloatArray, near: Any, which: Any, values: FloatArray, normals: FloatArray
) -> Candidates:
    """Ends `near` with their distances from the bodies `which`, and normals."""
    capsules, features = cores.end_capsules.take(near), cores.end_features.take(near)
    return Candidates([(field, which)], capsules, which, features, ends.take(near, 0), values, normals)


def _near(
    field: Field,
    cores: Cores,
    places: CorePlaces,
    ends: FloatArray,
    touching: Any,
    pairs: Any,
    limits: FloatArray,
    merged: float,
) -> Candidates:
    """Candidates at ends where `touching`, shape (ends, bodies), and inside of cores for `pairs` of core and body."""
    (one, other), needed = pairs, touching
    both = cores.end_numbers.take(one, 0), other[:, None]
    if len(one):
        needed = touching.copy()
        needed[both] = True
    near, which = needed.nonzero()
    values, normals = field.at(ends.take(near, 0), which)
    close = touching[near, which] & (values <= limits.take(cores.end_capsules.take(near)))
    chosen = close.nonzero()[0]
    at_ends = near.take(chosen), which.take(chosen), values.take(chosen), normals.take(chosen, 0)
    found = _ends(field, cores, ends, *at_ends)
    if not len(one):
        return found
    place = np.zeros(needed.shape, dtype=np.intp)
    place[near, which] = np.arange(len(near))
    known = values.take(place[both]), normals.take(place[both], 0)
    starts, spans = places.ends[:, 0].take(one, 0), places.spans.take(one, 0)
    inner = core_points(field, other, starts, spans, limits.take(one), merged, known)
    if not len(inner.pairs):
        return found
    which = other.take(inner.pairs)
    new = (one.take(inner.pairs), which, INSIDE + inner.features, inner.points, inner.distances, inner.normals)
    columns = [np.concatenate(pair) for pair in zip(found[1:], new, strict=True)] if len(chosen) else new
    return Candidates([(field, columns[1])], *columns)


def _own(
    cores: Cores, places: CorePlaces, pairs: Any, ends: FloatArray, limits: FloatArray, margin: float, merged: float, count: int
) -> Candidates:
    """Candidates between the robot's own capsules, which are obstacles after the `count` of the environment."""
    field = own_capsules(cores, places)
    near = near_pairs(cores, places, pairs, margin)
    touching = np.zeros((len(ends), cores.count), dtype=bool)
    touching[cores.end_numbers[near[:, 0]], near[:, 1:]] = True
    long = near[cores.lengths[near[:, 0]] > 0.0]
    found = _near(field, cores, places, ends, touching, (long[:, 0], long[:, 1]), limits, merged)
    different = different_contacts(cores, field, found.capsules, found.features, found.obstacles, found.points)
    capsules, which, *others = (column[different] for column in found[1:])
    return Candidates([(field, which)], capsules, count + which, *others)
