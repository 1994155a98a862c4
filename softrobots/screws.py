r"""The screw motion along a section of constant strain, with first and second derivative.

A section has the *section coordinates* `z = h (kx, ky, tau, stretch - 1)`: the rotation over its length about x, y (bending)
and z (twist) [rad], and its elongation [m], at rest length `h`. Its end stands in the frame of its start at

.. math:: \exp\left(\begin{bmatrix} [\omega] & \ell e_z \\ 0 & 0 \end{bmatrix}\right) = (R, p), \qquad
   \omega = z_{0..2}, \quad \ell = h + z_3

    R = 1 + c_1 [w] + c_2 [w]^2,    p = l (c_1 e_z + c_2 w x e_z + c_3 w_z w)

with the Stumpff functions `c_k` of `|w|^2`. Everything is smooth through straight. All functions are vectorised over leading
axes; twists are linear part first.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.checks import FloatArray
from softrobots.stumpff import stumpff

_UNITS = np.eye(3)
_AXIS = _UNITS[2]


def skew(vectors: FloatArray) -> FloatArray:
    """Matrices `[v]` with `[v] u = v x u`, shape (..., 3, 3), of vectors of shape (..., 3)."""
    made = np.zeros((*vectors.shape, 3))
    made[..., 2, 1], made[..., 0, 2], made[..., 1, 0] = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    made[..., 1, 2], made[..., 2, 0], made[..., 0, 1] = -vectors[..., 0], -vectors[..., 1], -vectors[..., 2]
    return made


_UNIT_SKEWS = skew(_UNITS)
# c_k-free products that the derivatives need: [e_i] e_z, shape (3, 3).
_UNIT_CROSS_AXIS = _UNIT_SKEWS @ _AXIS


class Screw(NamedTuple):
    """End of a section in the frame of its start."""

    rotation: FloatArray
    """Shape (..., 3, 3)."""
    position: FloatArray
    """Shape (..., 3) [m]."""


def screw(z: FloatArray, rest_length: FloatArray | float) -> Screw:
    """Pose of the end of a section in the frame of its start.

    Args:
        z: Section coordinates, shape (..., 4) [rad, rad, rad, m].
        rest_length: Rest length `h`, shape (...) [m].

    Returns:
        Rotation and position.
    """
    omega = z[..., :3]
    c = stumpff(_square(omega), 3)
    return Screw(_rotation(omega, c), _stretched(z, rest_length)[..., None] * _direction(omega, c))


class ScrewDerivatives(NamedTuple):
    """A section with its first and second derivative with respect to its coordinates."""

    screw: Screw
    """The end itself."""
    twists: FloatArray
    """Twist of the end per coordinate, in the axes of the end, linear part first, shape (..., 6, 4)."""
    twist_derivatives: FloatArray
    """Derivative of `twists` with respect to the last index, shape (..., 6, 4, 4)."""


def screw_derivatives(z: FloatArray, rest_length: FloatArray | float) -> ScrewDerivatives:
    r"""Pose of the end of a section with its twists per coordinate and their derivatives.

    The twists are :math:`h\,T(h\xi)B` of the exponential, in the axes of the end: angular
    `1 - c_2 [w] + c_3 [w]^2`, linear `R^T dp/dz`. With `dc_k/dw = (k c_{k+2} - c_{k+1}) w` all is in closed form.

    Args:
        z: Section coordinates, shape (..., 4) [rad, rad, rad, m].
        rest_length: Rest length `h`, shape (...) [m].

    Returns:
        Pose, twists and their derivatives.
    """
    omega, length = z[..., :3], _stretched(z, rest_length)
    c = stumpff(_square(omega), 7)
    rotation, direction = _rotation(omega, c), _direction(omega, c)
    slope, curvature = _direction_derivatives(omega, c)
    moved = np.zeros((*z.shape[:-1], 3, 4))  # dp/dz, in the axes of the start
    moved[..., :3] = length[..., None, None] * slope
    moved[..., 3] = direction
    moved_twice = np.zeros((*z.shape[:-1], 3, 4, 4))
    moved_twice[..., :3, :3] = length[..., None, None, None] * curvature
    moved_twice[..., :3, 3] = moved_twice[..., 3, :3] = slope
    angular, angular_derivative = _angular(omega, c)
    back = np.swapaxes(rotation, -1, -2)
    twists = np.zeros((*z.shape[:-1], 6, 4))
    twists[..., :3, :] = back @ moved
    twists[..., 3:, :3] = angular
    derivatives = np.zeros((*z.shape[:-1], 6, 4, 4))
    # d(R^T) = -[w_j] R^T dz_j with the angular twist w_j of coordinate j.
    turned = _cross_columns(angular, twists[..., :3, :])
    derivatives[..., :3, :, :] = np.einsum("...ki,...kab->...iab", rotation, moved_twice)
    derivatives[..., :3, :, :3] -= turned
    derivatives[..., 3:, :3, :3] = angular_derivative
    return ScrewDerivatives(Screw(rotation, length[..., None] * direction), twists, derivatives)


def _square(omega: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("...i,...i->...", omega, omega))


def _stretched(z: FloatArray, rest_length: FloatArray | float) -> FloatArray:
    return np.asarray(rest_length + z[..., 3])


def _rotation(omega: FloatArray, c: FloatArray) -> FloatArray:
    matrix = skew(omega)
    return np.asarray(_UNITS + c[1][..., None, None] * matrix + c[2][..., None, None] * (matrix @ matrix))


def _direction(omega: FloatArray, c: FloatArray) -> FloatArray:
    """Position of the end over the stretched length, in the axes of the start, shape (..., 3)."""
    return np.asarray(
        c[1][..., None] * _AXIS + c[2][..., None] * (omega @ _UNIT_CROSS_AXIS) + (c[3] * omega[..., 2])[..., None] * omega
    )


def _slopes(c: FloatArray, highest: int) -> FloatArray:
    """`d_k` with `dc_k/dw = d_k w`, from `c` up to `highest`."""
    return np.array([k * c[k + 2] - c[k + 1] for k in range(highest + 1)])


def _direction_derivatives(omega: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and second derivative of `_direction` with respect to `omega`, shapes (..., 3, 3) and (..., 3, 3, 3)."""
    d = _slopes(c, 5)
    e = np.array([np.zeros_like(c[0]), *(k * d[k + 2] - d[k + 1] for k in (1, 2, 3))])
    parts = (
        # (index k, vector v, its derivative, its second derivative): the direction is the sum of c_k v
        (1, np.broadcast_to(_AXIS, omega.shape), None, None),
        (2, omega @ _UNIT_CROSS_AXIS, _UNIT_CROSS_AXIS.T, None),
        (3, omega[..., 2:] * omega, omega[..., 2, None, None] * _UNITS + omega[..., :, None] * _AXIS, _TWIST_SQUARE),
    )
    outer = omega[..., :, None] * omega[..., None, :]
    slope: FloatArray = np.zeros((*omega.shape, 3))
    curvature: FloatArray = np.zeros((*omega.shape, 3, 3))
    for k, vector, first, second in parts:
        slope += (d[k][..., None] * vector)[..., :, None] * omega[..., None, :]
        bend = d[k][..., None, None] * _UNITS + e[k][..., None, None] * outer
        curvature += vector[..., :, None, None] * bend[..., None, :, :]
        if first is not None:
            slope += c[k][..., None, None] * first
            mixed = (d[k][..., None, None] * first)[..., :, :, None] * omega[..., None, None, :]
            curvature += mixed + np.swapaxes(mixed, -1, -2)
        if second is not None:
            curvature += c[k][..., None, None, None] * second
    return slope, curvature


# Second derivative of w_z w, shape (3, 3, 3).
_TWIST_SQUARE = _UNITS[:, :, None] * _AXIS + _UNITS[:, None, :] * _AXIS[:, None]


def _angular(omega: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Angular twists `1 - c_2 [w] + c_3 [w]^2`, shape (..., 3, 3), and their derivative, shape (..., 3, 3, 3)."""
    matrix = skew(omega)
    square = matrix @ matrix
    twists = _UNITS - c[2][..., None, None] * matrix + c[3][..., None, None] * square
    d = _slopes(c, 3)
    weights = d[3][..., None, None] * square - d[2][..., None, None] * matrix
    derivative = weights[..., :, :, None] * omega[..., None, None, :]
    for axis in range(3):
        unit = _UNIT_SKEWS[axis]
        derivative[..., axis] += c[3][..., None, None] * (unit @ matrix + matrix @ unit) - c[2][..., None, None] * unit
    return twists, derivative


def _cross_columns(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross products `first_j x second_a` of all columns, shape (..., 3, a, j)."""
    return np.asarray(np.einsum("...ikj,...ka->...iaj", np.moveaxis(skew(np.swapaxes(first, -1, -2)), -3, -1), second))
