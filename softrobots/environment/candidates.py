"""Candidates of contact: material points of a robot's cores that may touch an obstacle."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import Field, HalfSpaces
from softrobots.environment.nearest_points import core_points
from softrobots.environment.self_contact import different_contacts, near_pairs, own_capsules
from softrobots.environment.single_bodies import Seen
from softrobots.environment.single_pairs import single_pair

_NOBODY = np.zeros(0, dtype=np.intp)
_FEW = 40  # ends times bodies up to which plain numbers take less time than NumPy
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


NOTHING = Candidates([], _NOBODY, _NOBODY, _NOBODY, np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
"""No candidate."""


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
    found: list[Candidates] = []
    for field, numbers in fields:
        if len(ends) * len(numbers) <= _FEW and field.single(0) is not None:
            found += _few(field, numbers, cores, ends.tolist(), margin, merged)
            continue
        distances, limits = field.at_least(ends), margin + cores.radii
        standing = _standing(field, cores, ends, distances) if len(cores.at_base) else None
        if isinstance(field, HalfSpaces):  # bounds are distances, and they are least at ends
            touching = distances <= limits.take(cores.end_capsules)[:, None]
            if standing is not None:
                touching &= ~standing
            near, which = touching.nonzero()
            values = distances.take(near * len(numbers) + which)
            capsules, features = cores.end_capsules.take(near), cores.end_features.take(near)
            normals = field.normals.take(which, 0)
            new = Candidates([(field, which)], capsules, which, features, ends.take(near, 0), values, normals)
        else:
            # the distance changes by at most the length of the way: what is far at both ends is far between them
            near, which = (
                np.add.reduce(distances.take(cores.end_numbers, 0), 1) <= (2.0 * margin + cores.ways)[:, None]
            ).nonzero()
            if not len(near):
                continue
            counted = cores.counted.take(near, 0)
            if standing is not None:
                counted &= ~standing[cores.end_numbers[near], which[:, None]]
            new = _near(field, places, near, which, counted, limits, merged)
        if len(new.capsules):
            found.append(Candidates(new.parts, new.capsules, numbers.take(new.obstacles), *new[3:]))
    if pairs is not None:
        found.append(_own(cores, places, pairs, margin, merged, sum(len(numbers) for _, numbers in fields)))
    if len(found) == 1:
        return found[0]
    if not found:
        return NOTHING
    parts = [part for one in found for part in one.parts]
    return Candidates(parts, *(np.concatenate(column) for column in zip(*(one[1:] for one in found), strict=True)))


def _standing(field: Field, cores: Cores, ends: FloatArray, distances: FloatArray) -> Any:
    """Where an end is `at_base`, and the end there is inside of a body, truth values, shape (ends, bodies); None if nowhere.

    There the robot stands on the body, with a flat end: its capsules have caps, which are no contact.
    """
    rows, which = (distances.take(cores.bases, 0) < cores.base_radii).nonzero()
    if not len(rows):  # `distances` are lower bounds
        return None
    inside = field.at(ends[cores.bases[rows]], which)[0] < cores.base_radii[rows, 0]
    standing = np.zeros(distances.shape, dtype=bool)
    standing[cores.at_base[rows[inside]], which[inside]] = True
    return standing


def _few(field: Field, numbers: Any, cores: Cores, ends: Any, margin: float, merged: float) -> list[Candidates]:
    """The same for few ends, a list of points, and the bodies of a field, with their numbers, in plain numbers; or nothing."""
    keys: list[tuple[int, int, int]] = []
    rows: list[tuple[float, ...]] = []
    for which in range(len(numbers)):
        body: Any = field.single(which)
        bounds = [math.dist(end, body.centre) - body.around for end in ends]
        seen: dict[int, Seen] = {}
        for capsule, (both, counted, radius, length) in enumerate(cores.plain):
            limit, (first, last) = margin + radius, both
            if bounds[first] + bounds[last] > 2.0 * limit + length:
                continue
            for number in both:
                if number not in seen:
                    seen[number] = body.seen(ends[number])
            start, end = seen[first], seen[last]
            if start.distance + end.distance > 2.0 * limit + length:
                continue
            for feature, share, distance, normal in single_pair(body, start, end, length, limit, merged):
                if feature >= INSIDE:
                    (x, y, z), (u, v, w) = ends[first], ends[last]
                    point = x + share * (u - x), y + share * (v - y), z + share * (w - z)
                elif distance <= limit and counted[feature]:
                    point = ends[both[feature]]
                    base = cores.base_of.get(both[feature])
                    if base is not None and body.seen(ends[base[0]]).distance < base[1]:  # it stands there
                        continue
                else:
                    continue
                keys.append((capsule, which, feature))
                rows.append((*point, distance, *body.out(normal)))
    if not rows:
        return []
    (capsules, others, features), found = np.array(keys).T, np.array(rows)
    columns = numbers.take(others), features, found[:, :3], found[:, 3], found[:, 4:]
    return [Candidates([(field, others)], capsules, *columns)]


def _near(
    field: Field, places: CorePlaces, one: Any, other: Any, counted: Any, limits: FloatArray, merged: float
) -> Candidates:
    """Candidates of pairs of core and body: ends where `counted`, shape (m, 2), truth values, and what is between them."""
    most, ends = limits.take(one), places.ends.take(one, 0)
    values, normals = field.at(ends.reshape(-1, 3), other.repeat(2))
    known = values.reshape(-1, 2), normals.reshape(-1, 2, 3)
    chosen = ((known[0] <= most[:, None]) & counted).ravel().nonzero()[0]
    pair, points = chosen >> 1, ends.reshape(-1, 3).take(chosen, 0)
    which = other.take(pair)
    at_ends = one.take(pair), which, chosen & 1, points, values.take(chosen), normals.take(chosen, 0)
    inner = core_points(field, other, ends[:, 0], places.spans.take(one, 0), most, merged, known)
    if not len(inner.pairs):
        return Candidates([(field, which)], *at_ends)
    which = other.take(inner.pairs)
    new = (one.take(inner.pairs), which, INSIDE + inner.features, inner.points, inner.distances, inner.normals)
    columns = [np.concatenate(pair) for pair in zip(at_ends, new, strict=True)] if len(chosen) else new
    return Candidates([(field, columns[1])], *columns)


def _own(cores: Cores, places: CorePlaces, pairs: Any, margin: float, merged: float, count: int) -> Candidates:
    """Candidates between the robot's own capsules, which are obstacles after the `count` of the environment."""
    field = own_capsules(cores, places)
    near = near_pairs(cores, places, pairs, margin)
    found = _near(field, places, near[:, 0], near[:, 1], np.True_, margin + cores.radii, merged)
    ends = (found.features < INSIDE).nonzero()[0]
    numbers = cores.end_numbers[found.capsules[ends], found.features[ends]]
    found.capsules[ends], found.features[ends] = cores.end_capsules[numbers], cores.end_features[numbers]
    different = different_contacts(cores, field, found.capsules, found.features, found.obstacles, found.points)
    capsules, which, *others = (column[different] for column in found[1:])
    return Candidates([(field, which)], capsules, count + which, *others)
