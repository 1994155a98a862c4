r"""Contact of a robot with itself: which capsules may touch, and the second derivative of the gap between two of them.

The gap between two cores `x(s)` and `y(z)` is their least distance `d`, less the radii. With the velocity `u` of the one
material point relative to the other, :math:`H = (I - n n^T) / d`, and the tangents :math:`T = (t_x, -t_y)` of those of the two
cores whose point is between its ends and slides along it (`theory.md`, "Contact"),

.. math:: \delta^2 g = n^T (\delta^2 x - \delta^2 y) + u^T H u - b^T (T^T H T)^{-1} b, \qquad b = T^T H u + \delta T^T n
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import axes_along, cross
from softrobots.environment.cores import CorePlaces, Cores
from softrobots.environment.distance_fields import RoundedBoxes
from softrobots.environment.nearest_points import core_points
from softrobots.environment.single_bodies import ON_BORDER
from softrobots.model.soft_model import SoftModel

_SINGULAR = 1e-12
_CROSSING = 1e-9  # least distance of two cores [m]: where they cross, deep inside of each other, it has no second derivative


def own_capsules(cores: Cores, places: CorePlaces) -> RoundedBoxes:
    """Return the capsules of a robot in a configuration as obstacles to each other."""
    along = places.spans / np.maximum(cores.lengths, 1e-300)[:, None]
    along[cores.lengths == 0.0] = [0.0, 0.0, 1.0]
    halves = np.zeros((cores.count, 3))
    halves[:, 2] = 0.5 * cores.lengths
    return RoundedBoxes(axes_along(along), places.ends.mean(axis=1), halves, cores.radii)


def self_contact_pairs(model: SoftModel, cores: Cores) -> Any:
    r"""Pairs of capsules of a robot that may touch each other, decided by its rest shape.

    Left out are pairs that overlap or touch at rest (motors at zero, relaxed springs), and pairs so near along the robot that
    a tube of their radii cannot bend back between them: to half a circle whose inside has no length it takes
    :math:`\pi (r_1 + r_2) / 2` of the axis. The way along the robot is the length of the cores between the two, in the order
    of the description.

    Args:
        model: The robot.
        cores: Its capsules.

    Returns:
        The later and the earlier capsule of each pair, shape (n, 2), integers.
    """
    if cores.count < 2:
        return np.zeros((0, 2), dtype=np.intp)
    later, earlier = np.tril_indices(cores.count, -1)
    passed = np.concatenate([[0.0], np.cumsum(cores.lengths)])
    radii = cores.radii[later] + cores.radii[earlier]
    apart = passed[later] - passed[earlier + 1] >= 0.5 * math.pi * radii
    later, earlier, radii = later[apart], earlier[apart], radii[apart]
    places = cores.at(model.configuration(model.relaxed_motors))
    field = own_capsules(cores, places)
    least = np.minimum(*(field.at(places.ends[later, end], earlier)[0] for end in (0, 1)))
    long = np.flatnonzero(cores.lengths[later] > 0.0)
    limits = np.full(len(long), np.inf)
    inner = core_points(field, earlier[long], places.ends[later[long], 0], places.spans[later[long]], limits, 0.0)
    np.minimum.at(least, long[inner.pairs], inner.distances)
    return np.stack([later, earlier], axis=1)[least > cores.radii[later] + 1e-9 * model.reach]


def near_pairs(cores: Cores, places: CorePlaces, pairs: Any, margin: float) -> Any:
    """Return those of the pairs whose spheres around the capsules are within a margin [m]."""
    middles, sizes = places.ends.mean(axis=1), 0.5 * cores.lengths + cores.radii
    ways = middles[pairs[:, 0]] - middles[pairs[:, 1]]
    return pairs[np.sqrt((ways * ways).sum(axis=1)) <= sizes[pairs].sum(axis=1) + margin]


def different_contacts(cores: Cores, field: RoundedBoxes, capsules: Any, features: Any, others: Any, points: FloatArray) -> Any:
    """Return the first of candidates whose two points are the same: neighbours share their ends."""
    local = (field.rotations[others, :, 2] * (points - field.centres[others])).sum(axis=1)
    end = np.where(np.abs(local) < field.halves[others, 2], -1, (local > 0.0).astype(np.intp))
    place = np.where(end < 0, 2 * cores.count + others, cores.end_numbers[others, np.maximum(end, 0)])
    own = cores.end_numbers[capsules, np.minimum(features, 1)]
    most = int(features.max(initial=0)) + 1
    own = np.where(features < 2, own, 2 * cores.count + capsules * most + features)
    return np.unique(np.stack([own, place], axis=1), axis=0, return_index=True)[1]


def relative_curvature(
    cores: Cores,
    places: CorePlaces,
    pair: tuple[int, int],
    point: FloatArray,
    normal: FloatArray,
    distance: float,
    slides: bool,
) -> tuple[list[FloatArray], list[float]]:
    """Second derivative of the gap between two capsules, beside that of dead forces.

    Args:
        cores: The cores.
        places: Where they are.
        pair: The two capsules.
        point: Material point of the first core, shape (3,) [m].
        normal: Normal from the second to the first, shape (3,).
        distance: Distance of the point from the second core [m].
        slides: Whether it is the nearest point between the ends of its core.

    Returns:
        Rows, shape (nv,) each, and their weights [1/m].
    """
    one, two = pair
    distance = max(distance, _CROSSING)
    other = point - distance * normal
    moves = cores.moves

    def row(capsule: int, force: FloatArray, at: FloatArray, couple: Any = 0.0) -> FloatArray:
        return np.asarray((np.concatenate([force, cross(at, force) + couple]) @ places.jacobian) * moves[capsule])

    def relative(force: FloatArray) -> FloatArray:
        return row(one, force, point) - row(two, force, other)

    rows, weights = [relative(direction) for direction in axes_along(normal)[:, :2].T], [1.0 / distance] * 2
    tangents, turns = [], []
    nothing = np.zeros(3)
    if slides:
        tangents.append(places.spans[one])
        turns.append(row(one, nothing, point, cross(places.spans[one], normal)))
    square = cores.lengths[two] ** 2
    along = float((other - places.ends[two, 0]) @ places.spans[two])
    if ON_BORDER * square < along < (1.0 - ON_BORDER) * square:
        tangents.append(-places.spans[two])
        turns.append(-row(two, nothing, other, cross(places.spans[two], normal)))
    flat = [tangent - (tangent @ normal) * normal for tangent in tangents]
    pulls = [relative(tangent / distance) + turn for tangent, turn in zip(flat, turns, strict=True)]
    while flat:  # the inverse of T^T H T, eliminating one tangent after the other
        tangent, pull = flat.pop(), pulls.pop()
        square = float(tangent @ tangent)
        if square <= _SINGULAR * max([float(each @ each) for each in tangents]):
            continue
        rows.append(pull)
        weights.append(-distance / square)
        shares = [float(each @ tangent) / square for each in flat]
        pulls = [each - share * pull for each, share in zip(pulls, shares, strict=True)]
        flat = [each - share * tangent for each, share in zip(flat, shares, strict=True)]
    return rows, weights
