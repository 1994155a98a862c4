"""Distance of one point from one body in plain numbers, which take a tenth of the time of NumPy's calls for one point.

Equations, borders and tolerances are those of `softrobots.environment.distance_fields`.
"""

from __future__ import annotations

from math import copysign, hypot, inf, sqrt
from typing import NamedTuple

ON_BORDER = 1e-9
"""Distance beyond a face, over that from the body, below which a point belongs to the face; exact at crossed borders."""
_TINY = 1e-300
Triple = tuple[float, float, float]
"""A point or a vector."""
Bends = list[tuple[Triple, float]]
r"""Principal directions `a`, world axes, and curvatures `c` [1/m]: the second derivative of a distance is
:math:`\sum c\,a a^T`."""


def times(a: Triple, b: Triple) -> Triple:
    """Return the cross product."""
    (x, y, z), (u, v, w) = a, b
    return y * w - z * v, z * u - x * w, x * v - y * u


def inner(a: Triple, b: Triple) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


class Seen(NamedTuple):
    """A point in the axes of a body."""

    point: Triple
    """The point [m]."""
    distance: float
    """Its distance from the body [m]."""
    normal: Triple
    """Normal there."""


class Body(NamedTuple):
    """A rounded box (a box, a sphere, a capsule) or a cylinder, placed in the world."""

    rotation: tuple[Triple, Triple, Triple]
    """Rows of the matrix of its axes."""
    centre: Triple
    """Centre [m]."""
    halves: Triple
    """Half the edges of the box [m]; of a cylinder its radius twice, and half its length."""
    radius: float
    """Distance of the surface from the box, or zero [m]."""
    round: bool
    """Whether it is a cylinder."""
    around: float
    """Radius of a ball around it [m]."""

    @property
    def rounded(self) -> float:
        """Distance of the surface from the features within [m]."""
        return self.halves[0] if self.round else self.radius

    def into(self, vector: Triple) -> Triple:
        """A vector in its own axes."""
        (a, b, c), (d, e, f), (g, h, i) = self.rotation
        x, y, z = vector
        return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z

    def out(self, vector: Triple) -> Triple:
        """A vector of its own axes in the world's."""
        (a, b, c), (d, e, f), (g, h, i) = self.rotation
        x, y, z = vector
        return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z

    def seen(self, point: Triple) -> Seen:
        """Distance and normal at a point in world axes."""
        (x, y, z), (a, b, c) = point, self.centre
        local = self.into((x - a, y - b, z - c))
        return Seen(local, *self.at(local))

    def at(self, point: Triple) -> tuple[float, Triple]:
        """Distance [m] and normal at a point, in its own axes; `RoundedBoxes.at`, `Cylinders.at`."""
        x, y, z = point
        if self.round:
            from_axis = sqrt(x * x + y * y)
            side, end = from_axis - self.halves[0], abs(z) - self.halves[2]
            outward, upward = side if side > 0.0 else 0.0, end if end > 0.0 else 0.0
            distance = size = sqrt(outward * outward + upward * upward)
            if distance < _TINY:
                distance, size, (outward, upward) = max(side, end), 1.0, (1.0, 0.0) if side >= end else (0.0, 1.0)
            upward = copysign(upward / size, z)
            if from_axis < _TINY:
                return distance, (outward / size, 0.0, upward)
            slope = outward / (size * from_axis)
            return distance, (x * slope, y * slope, upward)
        a, b, c = self.halves
        i, j, k = abs(x) - a, abs(y) - b, abs(z) - c
        u, v, w = i if i > 0.0 else 0.0, j if j > 0.0 else 0.0, k if k > 0.0 else 0.0
        distance = sqrt(u * u + v * v + w * w)
        if distance < _TINY:
            distance = max(i, j, k)
            u, v, w = (1.0, 0.0, 0.0) if i == distance else (0.0, 1.0, 0.0) if j == distance else (0.0, 0.0, 1.0)
            return distance - self.radius, (copysign(u, x), copysign(v, y), copysign(w, z))
        return distance - self.radius, (copysign(u / distance, x), copysign(v / distance, y), copysign(w / distance, z))

    def bends(self, distance: float, normal: Triple) -> Bends:
        """Principal curvatures of the distance at a point with that distance and normal, world axes.

        Of a box one over the distance from it, in the two directions across the normal beyond a corner, across the edge beyond
        an edge; of a cylinder the curvature around the axis at side and rim, and one over the distance across the rim; nothing
        at faces.
        """
        (x, y, z), distance = self.into(normal), distance + self.radius
        if distance <= _TINY:
            return []
        if self.round:
            radial = hypot(x, y)
            if radial < _TINY:
                return []
            around = self.out((-y / radial, x / radial, 0.0))
            bends = [(around, radial / (self.halves[0] + distance * radial))]
            if radial > ON_BORDER and abs(z) > ON_BORDER:
                bends.append((times(normal, around), 1.0 / distance))
            return bends
        flat = [row for row, (half, n) in enumerate(zip(self.halves, (x, y, z), strict=True)) if half and abs(n) <= ON_BORDER]
        if len(flat) > 1:
            return []
        if flat:
            edge = self.out((float(flat[0] == 0), float(flat[0] == 1), float(flat[0] == 2)))
            return [(times(normal, edge), 1.0 / distance)]
        x, y, z = normal
        size = hypot(x, y)
        across = (-y / size, x / size, 0.0) if size > 0.5 else (0.0, -z / hypot(y, z), y / hypot(y, z))
        return [(across, 1.0 / distance), (times(normal, across), 1.0 / distance)]

    def bend(self, distance: float, normal: Triple, way: Triple) -> float:
        """Second derivative of the distance along a direction, in its own axes; `RoundedBoxes.along`, `Cylinders.along`."""
        (x, y, z), (u, v, w), distance = normal, way, distance + self.radius
        if distance <= _TINY:
            return 0.0
        slope = x * u + y * v + z * w
        if self.round:
            radial = hypot(x, y)
            if radial < _TINY:
                return 0.0
            along, around = (x * u + y * v) / radial, (x * v - y * u) / radial
            bend = radial * around * around / (self.halves[0] + distance * radial)
            rim = radial > ON_BORDER and abs(z) > ON_BORDER
            return bend + (along * along + w * w - slope * slope) / distance if rim else bend
        a, b, c = self.halves
        i, j, k = abs(x) > ON_BORDER or a == 0.0, abs(y) > ON_BORDER or b == 0.0, abs(z) > ON_BORDER or c == 0.0
        return (i * u * u + j * v * v + k * w * w - slope * slope) / distance if i + j + k > 1 else 0.0

    def borders(self, start: Triple, span: Triple) -> list[float]:
        """Shares of a way at which it passes between features, any number where it does not; as `Field.borders`."""
        if not self.round:
            if self.halves == (0.0, 0.0, 0.0):
                return []
            sides = [
                (half, x, way if half > 0.0 and abs(way) > _TINY else inf)
                for half, x, way in zip(self.halves, start, span, strict=True)
            ]
            return [(half - x) / way for half, x, way in sides] + [(-half - x) / way for half, x, way in sides]
        (x, y, z), (u, v, w), (radius, _, half) = start, span, self.halves
        first, second = ((half - z) / w, (-half - z) / w) if abs(w) > _TINY else (inf, inf)
        square, turn = u * u + v * v, x * u + y * v
        root = turn * turn - square * (x * x + y * y - radius * radius)
        if not (root > 0.0 and square > _TINY):
            return [first, second, inf, inf]
        return [first, second, (-turn - sqrt(root)) / square, (-turn + sqrt(root)) / square]
