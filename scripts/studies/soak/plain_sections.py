"""A section of constant strain, written plainly: the exponential of its strain, and its joints from that pose.

Works on complex numbers, too, so that derivatives are complex steps, exact to rounding.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray

_COMPLEX_STEP = 1e-30  # [rad or m]
_SMALL = 1e-3  # squared angle below which a series is exact to rounding


def section_joints(z: Any, lengths: FloatArray) -> Any:
    """Joints `u1, u2, c, r1, r2, r3` of sections, shape (..., 6), of section coordinates, shape (..., 4), complex or not."""
    x, y, t = z[..., 0], z[..., 1], z[..., 2]
    along = lengths + z[..., 3]
    square = x * x + y * y + t * t
    first, second, third = _series(square)
    zero = np.zeros_like(x)
    spin = _stacked([[zero, -t, y], [t, zero, -x], [-y, x, zero]])
    twice = spin @ spin
    identity = np.eye(3)
    rotation = identity + first[..., None, None] * spin + second[..., None, None] * twice
    way = identity + second[..., None, None] * spin + third[..., None, None] * twice
    px, py, pz = (way[..., row, 2] * along for row in range(3))
    u1 = _angle(-py, pz)
    across = np.sqrt(py * py + pz * pz)
    u2 = _angle(px, across)
    chord = np.sqrt(px * px + py * py + pz * pz)
    s1, c1, s2, c2 = np.sin(u1), np.cos(u1), np.sin(u2), np.cos(u2)
    universal = _stacked([[c2, zero, s2], [s1 * s2, c1, -s1 * c2], [-c1 * s2, s1, c1 * c2]])
    left = np.swapaxes(universal, -1, -2) @ rotation
    r1 = _angle(-left[..., 1, 2], left[..., 2, 2])
    r2 = _angle(left[..., 0, 2], np.sqrt(left[..., 1, 2] ** 2 + left[..., 2, 2] ** 2))
    r3 = _angle(-left[..., 0, 1], left[..., 0, 0])
    return np.stack([u1, u2, chord, r1, r2, r3], axis=-1)


def section_slopes(z: FloatArray, lengths: FloatArray) -> FloatArray:
    """Derivative of `section_joints` by complex steps, shape (..., 6, 4)."""
    columns = [section_joints(z + 1j * _COMPLEX_STEP * unit, lengths).imag / _COMPLEX_STEP for unit in np.eye(4)]
    return np.stack(columns, axis=-1)


def _series(square: Any) -> tuple[Any, Any, Any]:
    """`sin a / a`, `(1 - cos a) / a^2` and `(a - sin a) / a^3` of a squared angle, complex or not."""
    near = np.abs(square) < _SMALL
    angle = np.sqrt(np.where(near, 1.0, square))
    sums = []
    for lowest in (1, 2, 3):  # sum of (-square)^k / (2 k + lowest)!
        sums.append(sum((-square) ** k / math.factorial(2 * k + lowest) for k in range(6)))
    exact = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3)
    first, second, third = (np.where(near, one, other) for one, other in zip(sums, exact, strict=True))
    return first, second, third


def _angle(y: Any, x: Any) -> Any:
    """`atan2`, whose imaginary part is its derivative."""
    if not np.iscomplexobj(y):
        return np.arctan2(y, x)
    return np.arctan2(y.real, x.real) + 1j * (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)


def _stacked(rows: Any) -> Any:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
