"""Equations of [PCC paper] as printed, in the paper's own terms: radius, bending angle and azimuth of each segment.

Nothing is mended here. What the text available to us does not show for certain is said where it is compared.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray

OFFSET = np.pi / 3.0
"""Section 3: turn between the segments, 60 degrees [rad]."""


class Segment(NamedTuple):
    """A bent segment, or many: arrays of one shape."""

    radius: FloatArray
    """Radius of curvature `r` [m]."""
    bending: FloatArray
    """Bending angle `theta` [rad]."""
    azimuth: FloatArray
    """Angle `alpha` of the bending plane [rad]."""


def tip_height(segment: Segment) -> FloatArray:
    """(8): `p_z = r sin alpha` [m]."""
    return np.asarray(segment.radius * np.sin(segment.azimuth))


def tip(segment: Segment) -> FloatArray:
    """(9): the tip of a segment, shape (n, 3) [m]."""
    r, theta, alpha = segment
    return np.stack(
        [r * (1 - np.cos(theta)) * np.cos(alpha), r * (1 - np.cos(theta)) * np.sin(alpha), r * np.sin(theta)], axis=-1
    )


def about_z(angle: FloatArray) -> FloatArray:
    """(11): rotation about z, shape (n, 3, 3)."""
    zero, one, c, s = np.zeros_like(angle), np.ones_like(angle), np.cos(angle), np.sin(angle)
    return _matrix([[c, -s, zero], [s, c, zero], [zero, zero, one]])


def about_y(angle: FloatArray) -> FloatArray:
    """(12): rotation about y, shape (n, 3, 3)."""
    zero, one, c, s = np.zeros_like(angle), np.ones_like(angle), np.cos(angle), np.sin(angle)
    return _matrix([[c, zero, s], [zero, one, zero], [-s, zero, c]])


def pose(segment: Segment) -> FloatArray:
    """(14) and (15): the transform of a segment, shape (n, 4, 4)."""
    r, theta, alpha = segment
    zero, one = np.zeros_like(r), np.ones_like(r)
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return _matrix(
        [
            [ca * ct, -sa, ca * st, r * ca * (1 - ct)],
            [sa * ct, ca, sa * st, r * sa * (1 - ct)],
            [-st, zero, ct, r * st],
            [zero, zero, zero, one],
        ]
    )


def second_pose(segment: Segment) -> FloatArray:
    """(16): the transform of the second segment, shape (n, 4, 4), with `r_2 (alpha_2 + pi/3)(1 - cos alpha_2)` for its x."""
    r, _, alpha = segment
    result = pose(Segment(r, segment.bending, alpha + OFFSET))
    result[..., 0, 3] = r * (alpha + OFFSET) * (1 - np.cos(alpha))
    return result


def second_tip(first: Segment, second: Segment) -> FloatArray:
    """(17) to (19): the tip of the second segment, shape (n, 3) [m]."""
    r1, theta1, alpha1 = first
    r2, theta2, alpha2 = second
    c1, s1, c2, s2 = np.cos(theta1), np.sin(theta1), np.cos(theta2), np.sin(theta2)
    ca, sa, cb, sb = np.cos(alpha1), np.sin(alpha1), np.cos(alpha2 + OFFSET), np.sin(alpha2 + OFFSET)
    x = r2 * (ca * cb * c1 * (1 - c2)) - r2 * (sa * sb * (1 - c2) + ca * s1 * s2)
    y = r2 * (sa * cb * c1 * (1 - c2)) + r2 * (ca * sb * (1 - c2)) + r2 * (sa * s1 * s2) + r1 * sa * (1 - c1)
    z = r2 * (-cb * s1 * (1 - c2) + c1 * c2) + r1 * s1
    return np.stack([x, y, z], axis=-1)


def muscle_angles(azimuth: FloatArray) -> FloatArray:
    """Before (27): angles `alpha_i` between bending and each muscle, `alpha, alpha + 2 pi/3, alpha - 2 pi/3`, shape (n, 3)."""
    return np.stack([azimuth, azimuth + 2 * np.pi / 3, azimuth - 2 * np.pi / 3], axis=-1)


def muscle_lengths(segment: Segment, distance: float) -> FloatArray:
    """(20) and (21): `r_i = r - d cos alpha_i` and `l_i = r_i theta`, shape (n, 3) [m]."""
    radii = segment.radius[..., None] - distance * np.cos(muscle_angles(segment.azimuth))
    return np.asarray(radii * segment.bending[..., None])


def root(lengths: FloatArray) -> FloatArray:
    """The root of (32), (33), (40) and (41), `sqrt(l1^2 + l2^2 + l3^2 - l1 l2 - l2 l3 - l1 l3)` [m]."""
    one, two, three = np.moveaxis(lengths, -1, 0)
    return np.asarray(np.sqrt(one**2 + two**2 + three**2 - one * two - two * three - one * three))


def cosine(lengths: FloatArray) -> FloatArray:
    """(32): the cosine of the azimuth."""
    one, two, three = np.moveaxis(lengths, -1, 0)
    return np.asarray((two + three - 2 * one) / (2 * root(lengths)))


def sine(lengths: FloatArray) -> FloatArray:
    """(33): its sine."""
    _, two, three = np.moveaxis(lengths, -1, 0)
    return np.asarray(np.sqrt(3) * (two - three) / (2 * root(lengths)))


def tangent(lengths: FloatArray) -> FloatArray:
    """(31): its tangent, `3 (l2 - l3) / (sqrt(3) (l2 + l3 - 2 l1))`."""
    one, two, three = np.moveaxis(lengths, -1, 0)
    return np.asarray(3 * (two - three) / (np.sqrt(3) * (two + three - 2 * one)))


def azimuth(lengths: FloatArray) -> FloatArray:
    """(34): the azimuth by a plain arctangent [rad]."""
    return np.asarray(np.arctan(tangent(lengths)))


def length(lengths: FloatArray) -> FloatArray:
    """(39): the length of the backbone [m]."""
    return np.asarray(np.mean(lengths, axis=-1))


def radius(lengths: FloatArray, distance: float) -> FloatArray:
    """(38) with (32) and (39), which is (40): `r = l d cos alpha / (l - l1)` [m]."""
    return np.asarray(length(lengths) * distance * cosine(lengths) / (length(lengths) - lengths[..., 0]))


def bending(lengths: FloatArray, distance: float) -> FloatArray:
    """(41): the bending angle [rad]."""
    return np.asarray(2.0 / (3.0 * distance) * root(lengths))


def tangent_balance(lengths: FloatArray, azimuth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(30): its left and right side [m]."""
    one, two, three = np.moveaxis(lengths, -1, 0)
    left = ((one - three) - (one - two)) * 1.5 * np.cos(azimuth)
    return np.asarray(left), np.asarray(((one - three) + (one - two)) * 0.5 * np.sqrt(3) * np.sin(azimuth))


def _matrix(entries: list[list[FloatArray]]) -> FloatArray:
    """Matrices of entries, shape (n, rows, columns)."""
    return np.moveaxis(np.array(entries), (0, 1), (-2, -1))
