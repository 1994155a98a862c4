"""Candidates of contact: material points of a robot's cores that may touch an obstacle."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import Field, HalfSpaces
from softrobots.environment.nearest_points import core_points
from softrobots.environment.self_contact import different_contacts, near_pairs, own_capsules
from softrobots.environment.single_bodies import Bends, Seen, Triple
from softrobots.environment.single_pairs import single_pair

_FEW = 40  # ends times bodies up to which plain numbers take less time than NumPy
INSIDE = 2
"""Feature of the minimum between the ends of a core; 0 and 1 are start and end, larger numbers crossed borders."""


class Candidates:
    """Candidates, sorted by field; few are in plain numbers, many in arrays, and each is read in both ways."""

    def __init__(self, parts: list[tuple[Field, Any]], numbers: Any, points: Any, distances: Any, normals: Any) -> None:
        """Take fields, with the body of each of their candidates there, and all candidates, in lists or in arrays.

        `numbers` are capsule, obstacle and feature of each: a list of triples, or three arrays of integers.
        """
        self.parts, self.given, self.few = parts, (numbers, points, distances, normals), isinstance(numbers, list)

    def keys_of_all(self) -> tuple[tuple[int, int, int], ...]:
        """Capsule, obstacle and feature of each candidate in plain numbers."""
        numbers = self.given[0]
        return tuple(numbers if self.few else zip(*(column.tolist() for column in numbers), strict=True))

    def row(self, place: int) -> tuple[Triple, float, Triple]:
        """Point, distance and normal of one candidate in plain numbers."""
        _, points, distances, normals = self.given
        if self.few:
            return points[place], distances[place], normals[place]
        return points[place].tolist(), float(distances[place]), normals[place].tolist()

    def bends(self, row: int, at: tuple[Triple, float, Triple]) -> Bends:
        """Second derivative of the distance of a candidate, which is at what `row` returns, from its obstacle."""
        place, parts = row, iter(self.parts)
        field, which = next(parts)
        while place >= len(which):
            place -= len(which)
            field, which = next(parts)
        return field.bends(int(which[place]), *at)

    @cached_property
    def numbers(self) -> Any:
        """Capsule, obstacle and feature of the candidates, three arrays of shape (m,), integers."""
        return np.array(self.given[0], dtype=np.intp).reshape(-1, 3).T if self.few else self.given[0]

    @property
    def capsules(self) -> Any:
        """Capsule of each candidate, shape (m,), integers."""
        return self.numbers[0]

    @property
    def obstacles(self) -> Any:
        """Obstacle of each, shape (m,), integers."""
        return self.numbers[1]

    @property
    def features(self) -> Any:
        """Feature of each, shape (m,), integers: see `INSIDE`."""
        return self.numbers[2]

    @cached_property
    def core_points(self) -> FloatArray:
        """Material points of the cores, shape (m, 3) [m]."""
        return np.asarray(self.given[1], dtype=np.float64).reshape(-1, 3)

    @cached_property
    def distances(self) -> FloatArray:
        """Their distances from the obstacles, shape (m,) [m]."""
        return np.asarray(self.given[2], dtype=np.float64)

    @cached_property
    def normals(self) -> FloatArray:
        """Normals from obstacle to robot, shape (m, 3)."""
        return np.asarray(self.given[3], dtype=np.float64).reshape(-1, 3)


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
    found: list[Candidates] = []
    for field, numbers in fields:
        plain = len(places.points) * len(numbers) <= _FEW
        if plain and isinstance(field, HalfSpaces):
            found.append(_few_planes(field, numbers, cores, places.points, margin))
        elif plain and field.single(0) is not None:
            found.append(_few(field, numbers, cores, places.points, margin, merged))
        else:
            found.append(_many(field, numbers, cores, places, margin, merged))
    if pairs is not None:
        found.append(_own(cores, places, pairs, margin, merged, sum(len(numbers) for _, numbers in fields)))
    if len(found) == 1:
        return found[0]
    parts = [part for one in found for part in one.parts]
    if not found or not any(len(which) for _, which in parts):
        return _nothing()
    numbers = tuple(np.concatenate(rows) for rows in zip(*(one.numbers for one in found), strict=True))
    columns = zip(*((one.core_points, one.distances, one.normals) for one in found), strict=True)
    return Candidates(parts, numbers, *(np.concatenate(rows) for rows in columns))


def _nothing() -> Candidates:
    return Candidates([], [], [], [], [])


def _many(field: Field, numbers: Any, cores: Cores, places: CorePlaces, margin: float, merged: float) -> Candidates:
    """The candidates of the bodies of a field, with their numbers, by NumPy."""
    ends = places.single_ends
    distances, limits = field.at_least(ends), margin + cores.radii
    standing = _standing(field, cores, ends, distances) if len(cores.at_base) else None
    if isinstance(field, HalfSpaces):  # bounds are distances, and they are least at ends
        touching = distances <= limits.take(cores.end_capsules)[:, None]
        if standing is not None:
            touching &= ~standing
        near, which = touching.nonzero()
        values = distances.take(near * len(numbers) + which)
        ones = cores.end_capsules.take(near), numbers.take(which), cores.end_features.take(near)
        return Candidates([(field, which)], ones, ends.take(near, 0), values, field.normals.take(which, 0))
    # the distance changes by at most the length of the way: what is far at both ends is far between them
    near, which = (np.add.reduce(distances.take(cores.end_numbers, 0), 1) <= (2.0 * margin + cores.ways)[:, None]).nonzero()
    if not len(near):
        return _nothing()
    counted = cores.counted.take(near, 0)
    if standing is not None:
        counted &= ~standing[cores.end_numbers[near], which[:, None]]
    capsules, which, features, *others = _near(field, places, near, which, counted, limits, merged)
    return Candidates([(field, which)], (capsules, numbers.take(which), features), *others)


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


def _few_planes(field: HalfSpaces, numbers: Any, cores: Cores, ends: Any, margin: float) -> Candidates:
    """The same for few ends, a list of points, and half-spaces in plain numbers."""
    bodies, keys, points, found, normals = list[int](), list[tuple[int, int, int]](), list[Any](), list[float](), list[Any]()
    largest = max(cores.plain_radii, default=0.0)
    planes = zip(numbers.tolist(), field.normals.tolist(), field.offsets.tolist(), strict=True)
    for which, (obstacle, normal, offset) in enumerate(planes):
        a, b, c = normal
        distances = [x * a + y * b + z * c - offset for x, y, z in ends]
        for number, distance in enumerate(distances):
            if distance > margin + largest:
                continue
            capsule, feature, radius = cores.plain_ends[number]
            if distance > margin + radius:
                continue
            base = cores.base_of.get(number)
            if base is None or distances[base[0]] >= base[1]:  # else it stands there
                bodies.append(which)
                keys.append((capsule, obstacle, feature))
                points.append(ends[number])
                found.append(distance)
                normals.append(normal)
    return Candidates([(field, bodies)], keys, points, found, normals)


def _few(field: Field, numbers: Any, cores: Cores, ends: Any, margin: float, merged: float) -> Candidates:
    """The same for few ends, a list of points, and the bodies of a field, with their numbers, in plain numbers."""
    bodies, keys, points, found, normals = list[int](), list[tuple[int, int, int]](), list[Any](), list[float](), list[Any]()
    for which, obstacle in enumerate(numbers.tolist()):
        body: Any = field.single(which)
        bounds = [math.dist(end, body.centre) - body.around for end in ends]
        seen: dict[int, Seen] = {}
        for capsule, (both, counted, radius, length) in enumerate(cores.plain):
            first, last = both
            limit = margin + radius
            most = 2.0 * limit + length
            if bounds[first] + bounds[last] > most:
                continue
            for number in both:
                if number not in seen:
                    seen[number] = body.seen(ends[number])
            start, end = seen[first], seen[last]
            if start.distance + end.distance > most:
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
                bodies.append(which)
                keys.append((capsule, obstacle, feature))
                points.append(point)
                found.append(distance)
                normals.append(body.out(normal))
    return Candidates([(field, bodies)], keys, points, found, normals)


def _near(field: Field, places: CorePlaces, one: Any, other: Any, counted: Any, limits: FloatArray, merged: float) -> Any:
    """Columns of candidates of cores and bodies: ends where `counted`, shape (m, 2), truth values, and what is between them."""
    most, ends = limits.take(one), places.ends.take(one, 0)
    values, normals = field.at(ends.reshape(-1, 3), other.repeat(2))
    known = values.reshape(-1, 2), normals.reshape(-1, 2, 3)
    chosen = ((known[0] <= most[:, None]) & counted).ravel().nonzero()[0]
    pair, points = chosen >> 1, ends.reshape(-1, 3).take(chosen, 0)
    which = other.take(pair)
    at_ends = one.take(pair), which, chosen & 1, points, values.take(chosen), normals.take(chosen, 0)
    inner = core_points(field, other, ends[:, 0], places.spans.take(one, 0), most, merged, known)
    if not len(inner.pairs):
        return at_ends
    which = other.take(inner.pairs)
    new = (one.take(inner.pairs), which, INSIDE + inner.features, inner.points, inner.distances, inner.normals)
    return tuple(np.concatenate(pair) for pair in zip(at_ends, new, strict=True)) if len(chosen) else new


def _own(cores: Cores, places: CorePlaces, pairs: Any, margin: float, merged: float, count: int) -> Candidates:
    """Candidates between the robot's own capsules, which are obstacles after the `count` of the environment."""
    field = own_capsules(cores, places)
    near = near_pairs(cores, places, pairs, margin)
    found = _near(field, places, near[:, 0], near[:, 1], np.True_, margin + cores.radii, merged)
    capsules, which, features, points = found[:4]
    ends = (features < INSIDE).nonzero()[0]
    numbers = cores.end_numbers[capsules[ends], features[ends]]
    capsules[ends], features[ends] = cores.end_capsules[numbers], cores.end_features[numbers]
    different = different_contacts(cores, field, capsules, features, which, points)
    capsules, which, features, *others = (column[different] for column in found)
    return Candidates([(field, which)], (capsules, count + which, features), *others)
