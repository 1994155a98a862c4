r"""Motion of outboard elements by joints and sections, traced.

All vectors are in one set of reference axes. From the tip to the base, the elements beyond an element are represented by loads:
a force `F` (the force on the tip; the acceleration of gravity) with a lever `r` from the element's origin (position of the tip;
sum of mass times position). A coordinate `j` of the element that turns all beyond it by :math:`\omega_j` and moves the lever by
:math:`J_j` contributes

- the torque `sum J_j . F` to its own balance,
- `c_j = sum J_j x F` to the second derivative: for every coordinate `i` nearer to the base,
  :math:`\partial^2 (F \cdot r)/\partial q_i \partial q_j = \omega_i \cdot c_j`.

Joints: `omega = z, J = z x r`, [Troise 2021] (4). Sections are the screw motions of `softrobots.constant_curvature.screws`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.section_weight import weight_moment
from softrobots.compiled.trace.expressions import Scalar, cosine, sine
from softrobots.compiled.trace.stumpff_series import stumpff

Vector = Any
"""Array of objects (expressions or floats), shape (3,) or (3, n)."""


class Load(NamedTuple):
    """A dead force on the elements beyond an element."""

    force: Vector
    """The force [N]; for weight: gravity [m/s^2]."""
    lever: Vector
    """Position of the tip from the element's origin [m]; for weight: sum of mass times position [kg m]."""
    share: Scalar
    """Derivative of the lever with respect to the element's origin: 1, or the mass beyond [kg]."""


@dataclass
class Motion:
    """Derivatives of an element with `k` coordinates, for the elimination."""

    twists: Vector
    """Rotation of all beyond it per coordinate, shape (3, k)."""
    bends: Vector
    """`c_j` of each coordinate, shape (3, k)."""
    moves: Vector
    """Displacement of the tip per coordinate, shape (3, k)."""
    torque: list[Scalar]
    """Torque of all loads on each coordinate, (k) [N m or N]."""
    weight: list[Scalar]
    """Part of it due to weight."""
    curvature: Vector
    """Second derivatives of the work of the loads within the element, shape (k, k)."""


def vector(values: Sequence[Scalar]) -> Vector:
    """Return an array of expressions."""
    array = np.zeros(len(values), dtype=object)
    array[:] = list(values)
    return array


def matrix(rows: Sequence[Sequence[Scalar]]) -> Vector:
    """Return a matrix of expressions."""
    return np.array([vector(row) for row in rows], dtype=object)


def constants(values: Any) -> Vector:
    """Return an array of constants as plain floats; an array of objects as it is."""
    array = np.asarray(values)
    return array.copy() if array.dtype == object else array.astype(np.float64).astype(object)


def cross(one: Vector, other: Vector) -> Vector:
    """Return the vector product."""
    return vector(
        [
            one[1] * other[2] - one[2] * other[1],
            one[2] * other[0] - one[0] * other[2],
            one[0] * other[1] - one[1] * other[0],
        ]
    )


def outer(one: Vector, other: Vector) -> Vector:
    """Return the outer product."""
    return np.multiply.outer(one, other)


def skew(v: Vector) -> Vector:
    """Return the matrix of the vector product with a vector."""
    x, y, z = v
    return matrix([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def upper_triangle(n: int) -> list[tuple[int, int]]:
    """Return the indices of the upper triangle of a matrix, shape (n, n), by columns: those of fewer rows come first."""
    return [(row, column) for column in range(n) for row in range(column + 1)]


def symmetric(values: Sequence[Scalar], n: int) -> Vector:
    """Return a symmetric matrix, shape (n, n), from its upper triangle by columns."""
    full = constants(np.zeros((n, n)))
    for (row, column), value in zip(upper_triangle(n), values, strict=True):
        full[row, column] = full[column, row] = value
    return full


def turned(axes: Vector, angle: Scalar) -> Vector:
    """Return axes turned about their own z."""
    c, s = cosine(angle), sine(angle)
    x, y, z = axes.T
    return np.array([x * c + y * s, y * c - x * s, z], dtype=object).T


def turning_joint(axis: Vector, loads: Sequence[Load]) -> Motion:
    """Return the motion of a joint that turns about `axis`; levers of the loads from its origin."""
    moves = [cross(axis, load.lever) for load in loads]
    bend = sum((cross(move, load.force) for move, load in zip(moves, loads, strict=True)), constants(np.zeros(3)))
    torques = [load.force @ move for move, load in zip(moves, loads, strict=True)]
    return _single(axis, bend, moves[0], torques, axis @ bend)


def sliding_joint(axis: Vector, loads: Sequence[Load]) -> Motion:
    """Return the motion of a joint that slides along `axis`."""
    force = sum((load.force * load.share for load in loads), constants(np.zeros(3)))
    torques = [(load.force @ axis) * load.share for load in loads]
    return _single(constants(np.zeros(3)), cross(axis, force), axis, torques, 0.0)


def _single(twist: Vector, bend: Vector, move: Vector, torques: Sequence[Scalar], curvature: Scalar) -> Motion:
    twists, bends, moves = (np.reshape(one, (3, 1)) for one in (twist, bend, move))
    return Motion(twists, bends, moves, [sum(torques)], [sum(torques[1:])], matrix([[curvature]]))


class Screw:
    """Screw motion of a section in the axes of its start: `u = p(z) + R(z) r` for a lever `r` at its end.

    With the Stumpff functions `c_k` of `|w|^2` (see `softrobots.constant_curvature.screws`)

        R(w) r = r + c1 w x r + c2 w x (w x r),    p = l (c1 e + c2 w x e + c3 w_z w),    e = e_z
    """

    def __init__(self, z: Sequence[Scalar], length: Scalar) -> None:
        """Evaluate the motion at section coordinates `z` [rad, rad, rad, m] and rest length [m]."""
        self._w = w = vector(z[:3])
        self._length = z[3] + length
        self._z = z
        self._c = stumpff(w @ w, 7 if not is_zero(w[2]) else 6)
        c, across = self._c, vector([w[1], -w[0], 0.0])
        turn = skew(w)
        twice = outer(w, w) - constants(np.eye(3)) * (w @ w)
        self.rotation = constants(np.eye(3)) + turn * c[1] + twice * c[2]
        """Axes of the end in those of the start, shape (3, 3)."""
        self._direction = vector([0.0, 0.0, c[1]]) + across * c[2] + w * (w[2] * c[3])
        self.position = self._direction * self._length
        """The end from the start, shape (3,) [m]."""
        self._twists = constants(np.eye(3)) + turn * c[2] + twice * c[3]

    def motion(self, loads: Sequence[Load], bodies: Any, axes: Vector) -> tuple[Motion, list[Vector]]:
        """Return the motion under loads, and the levers from the start.

        Args:
            loads: Loads beyond the end; levers from the end, in reference axes.
            bodies: The section's own bodies, for the weight; see `softrobots.compiled.chain.section_weight`.
            axes: Axes of the start in the reference axes.

        Returns:
            The motion in reference axes, and the lever of each load from the start.
        """
        end_axes = axes @ self.rotation
        local = [(axes.T @ load.force, end_axes.T @ load.lever, load.share) for load in loads]
        slopes = self._slopes()
        moves, levers = [], []
        for (_, lever, share), load in zip(local, loads, strict=True):
            arm = self.rotation @ lever
            columns = [cross(self._twists[:, j], arm) + slopes[:, j] * share for j in range(3)]
            moves.append(np.array([*columns, slopes[:, 3] * share], dtype=object).T)
            levers.append(load.lever + (axes @ self.position) * share)
        curvature = self._curvature(local)
        if len(loads) > 1:
            own = weight_moment(self._z, self, bodies, local[1][0])
            moves[1] = moves[1] + own.slopes
            curvature = curvature + own.curvature
            levers[1] = levers[1] + axes @ own.moment
        bends = [
            sum((cross(move[:, j], force) for move, (force, _, _) in zip(moves, local, strict=True)), constants(np.zeros(3)))
            for j in range(4)
        ]
        torques = [[force @ move[:, j] for move, (force, _, _) in zip(moves, local, strict=True)] for j in range(4)]
        twists = np.concatenate([axes @ self._twists, constants(np.zeros((3, 1)))], axis=1)
        return (
            Motion(
                twists,
                axes @ np.array(bends, dtype=object).T,
                axes @ moves[0],
                [sum(one) for one in torques],
                [sum(one[1:]) for one in torques],
                curvature,
            ),
            levers,
        )

    def _slopes(self) -> Vector:
        """Derivative of the position, shape (3, 4)."""
        w, c, length = self._w, self._c, self._length
        d = [k * c[k + 2] - c[k + 1] for k in range(4)]
        along = vector([0.0, 0.0, d[1]]) + vector([w[1], -w[0], 0.0]) * d[2] + w * (w[2] * d[3])
        slopes = outer(along, w)
        slopes = slopes + matrix([[0.0, c[2], 0.0], [-c[2], 0.0, 0.0], [0.0, 0.0, 0.0]])
        slopes = slopes + outer(w, vector([0.0, 0.0, c[3]])) + constants(np.eye(3)) * (w[2] * c[3])
        return np.concatenate([slopes * length, self._direction.reshape(3, 1)], axis=1)

    def slopes(self) -> tuple[Vector, Vector]:
        """Return velocity and angular velocity of the end per rate of a coordinate, in the axes of the start, shapes (3, 4)."""
        return self._slopes(), np.concatenate([self._twists, constants(np.zeros((3, 1)))], axis=1)

    def accelerations(self, rates: Sequence[Scalar]) -> tuple[Vector, Vector]:
        """Return acceleration and angular acceleration of the end at constant rates, in the axes of the start, shapes (3,).

        With `s = w . v` the Stumpff functions change by `d_k s`, and that by `e_k s^2 + d_k v . v`.
        """
        w, c, v = self._w, self._c, vector(rates[:3])
        orders = range(3) if is_zero(w[2]) else range(4)
        d = [k * c[k + 2] - c[k + 1] for k in range(len(orders) + 2)]
        slopes = [d[k] * (w @ v) for k in orders]
        bends = [(k * d[k + 2] - d[k + 1]) * ((w @ v) * (w @ v)) + d[k] * (v @ v) for k in orders]
        across, across_rate = vector([w[1], -w[0], 0.0]), vector([v[1], -v[0], 0.0])
        first = vector([0.0, 0.0, slopes[1]]) + across * slopes[2] + across_rate * c[2]
        second = vector([0.0, 0.0, bends[1]]) + across * bends[2] + across_rate * (slopes[2] * 2.0)
        swing = cross(w, v)
        turning = swing * slopes[2] + cross(v, swing) * c[3]
        slope = d[3] * (w @ v)
        turning = turning + cross(w, swing) * slope
        if len(orders) == 4:
            mixed = w * v[2] + v * w[2]
            first = first + w * (w[2] * slope) + mixed * c[3]
            second = second + w * (w[2] * bends[3]) + mixed * (slope * 2.0) + v * (v[2] * c[3] * 2.0)
        return first * (rates[3] * 2.0) + second * self._length, turning

    def _curvature(self, local: Sequence[tuple[Vector, Vector, Scalar]]) -> Vector:
        r"""Second derivatives of `sum F . u` with respect to the section coordinates, shape (4, 4).

        `F . u` is `sum_k c_k G_k` with polynomials `G_k` of the rotation `w` of order `k` at most two, so that
        `sum_k G_k (d_k 1 + e_k w w^T) + d_k (w g_k^T + g_k w^T) + c_k H_k` with `dc_k = d_k w . dw`, `dd_k = e_k w . dw`.
        """
        w, c, length = self._w, self._c, self._length
        unit, axis = constants(np.eye(3)), constants([0.0, 0.0, 1.0])
        push = sum((force * share for force, _, share in local), constants(np.zeros(3)))  # on the end as a whole
        swing = vector([-push[1], push[0], 0.0])  # e x push
        turning = sum((cross(lever, force) for force, lever, _ in local), constants(np.zeros(3)))
        g1, slope1 = turning @ w + push[2] * length, turning
        g2, slope2, curve2 = (swing @ w) * length, swing * length, constants(np.zeros((3, 3)))
        for force, lever, _ in local:
            fw, rw, fr = force @ w, lever @ w, force @ lever
            g2 = g2 + fw * rw - (w @ w) * fr
            slope2 = slope2 + force * rw + lever * fw - w * (2.0 * fr)
            curve2 = curve2 + outer(force, lever) + outer(lever, force) - unit * (2.0 * fr)
        pw = push @ w
        g3, slope3 = w[2] * pw * length, (axis * pw + push * w[2]) * length
        curve3 = (outer(axis, push) + outer(push, axis)) * length
        d = [k * c[k + 2] - c[k + 1] for k in range(6 if len(c) > 7 else 5)]
        total = constants(np.zeros((3, 3)))
        for k, value, slope, curve in ((1, g1, slope1, None), (2, g2, slope2, curve2), (3, g3, slope3, curve3)):
            if k == 3 and is_zero(w[2]):  # the twist is locked, and the term is constant
                continue
            e = k * d[k + 2] - d[k + 1]
            total = total + unit * (value * d[k]) + outer(w, w) * (value * e)
            total = total + outer(w, slope * d[k]) + outer(slope * d[k], w)
            if curve is not None:
                total = total + curve * c[k]
        # The elongation moves the end along the direction `p / l`; its slope is that of `push . p / l`.
        column = self._slopes_of_direction(push)
        return np.concatenate(
            [np.concatenate([total, column.reshape(3, 1)], axis=1), np.append(column, 0.0).reshape(1, 4)], axis=0
        )

    def _slopes_of_direction(self, push: Vector) -> Vector:
        w, c = self._w, self._c
        d = [k * c[k + 2] - c[k + 1] for k in range(4)]
        swing, pw = vector([-push[1], push[0], 0.0]), push @ w
        radial = push[2] * d[1] + (swing @ w) * d[2] + (w[2] * pw) * d[3]
        return w * radial + swing * c[2] + vector([0.0, 0.0, pw * c[3]]) + push * (w[2] * c[3])


def is_zero(value: Scalar) -> bool:
    """Tell whether it is the constant zero."""
    return isinstance(value, float) and value == 0.0
