r"""Screw motion (exponential map of SE(3)) along a section of constant strain, with first and second derivatives.

A section has the *section coordinates* `z = h (kx, ky, tau, stretch - 1)`: the rotation over its length about x, y (bending)
and z (twist) [rad], and its elongation [m], at rest length `h`. The pose of its end in the frame of its start is

.. math:: \exp\left(\begin{bmatrix} [\omega] & \ell e_z \\ 0 & 0 \end{bmatrix}\right) = (R, p), \qquad
   \omega = z_{0..2}, \quad \ell = h + z_3

    R = 1 + c_1 [w] + c_2 [w]^2,    p = l d,    d = c_1 e_z + c_2 w x e_z + c_3 w_z w

with the Stumpff functions `c_k` of `|w|^2`, for which `dc_k = d_k w . dw` and `d_k = k c_{k+2} - c_{k+1}`. All functions are
smooth at the straight configuration and vectorised over leading axes; twists have the linear part first.
"""

from __future__ import annotations

import numpy as np

from softrobots.constant_curvature.stumpff import stumpff
from softrobots.core.checks import FloatArray
from softrobots.core.vectors import skew

_UNITS = np.eye(3)
_AXIS = _UNITS[2]
_CROSS_AXIS = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # columns e_j x e_z


class Screw:
    """Pose of the end of a section in the frame of its start, with derivatives with respect to the section coordinates."""

    def __init__(self, z: FloatArray, rest_length: FloatArray | float) -> None:
        """Evaluate the motion at section coordinates `z`, shape (..., 4), and rest length `h`, shape (...) [m]."""
        self._omega = omega = z[..., :3]
        self._length = np.asarray(rest_length + z[..., 3])[..., None]
        self._c = c = stumpff(np.asarray((omega * omega).sum(axis=-1)), 7)[..., None]
        self._turn = turn = skew(omega)
        self._turn_twice = turn @ turn
        self.rotation: FloatArray = _UNITS + c[1, ..., None] * turn + c[2, ..., None] * self._turn_twice
        """Rotation of the end in the frame of the start, shape (..., 3, 3)."""
        self._across = omega @ _CROSS_AXIS.T  # w x e_z
        self._direction = c[1] * _AXIS + c[2] * self._across + c[3] * omega[..., 2:] * omega
        self.position: FloatArray = self._length * self._direction
        """Position of the end in the frame of the start, shape (..., 3) [m]."""

    def pose(self) -> FloatArray:
        """Return rotation and position as a matrix, shape (..., 4, 4)."""
        pose = np.zeros((*self.position.shape[:-1], 4, 4))
        pose[..., :3, :3], pose[..., :3, 3], pose[..., 3, 3] = self.rotation, self.position, 1.0
        return pose

    def twists(self) -> FloatArray:
        r"""Return the twist of the end per section coordinate, in the axes of the end, linear part first, shape (..., 6, 4).

        The columns of :math:`h\,T(h\xi)B`: angular `1 - c_2 [w] + c_3 [w]^2`, linear `R^T dp/dz`.
        """
        omega, c = self._omega, self._c
        d = _slopes(c, 3)
        along = d[1] * _AXIS + d[2] * self._across + d[3] * omega[..., 2:] * omega
        slope = along[..., :, None] * omega[..., None, :] + c[2, ..., None] * _CROSS_AXIS
        slope += c[3, ..., None] * (omega[..., :, None] * _AXIS + omega[..., 2, None, None] * _UNITS)
        # dp/dz, in the axes of the start
        position_slope = np.concatenate([self._length[..., None] * slope, self._direction[..., None]], axis=-1)
        twists = np.zeros((*omega.shape[:-1], 6, 4))
        twists[..., :3, :] = np.swapaxes(self.rotation, -1, -2) @ position_slope
        twists[..., 3:, :3] = _UNITS - c[2, ..., None] * self._turn + c[3, ..., None] * self._turn_twice
        return twists

    def curvature(self, twists: FloatArray, covector: FloatArray) -> FloatArray:
        r"""Return the derivative of `covector . twists` with respect to the section coordinates at constant covector.

        Element `[a, b]` is :math:`\lambda \cdot \partial S_a / \partial z_b`, shape (..., 4, 4), not symmetric. The
        covector is a wrench in the axes of the end, linear part first, shape (..., 6); `twists` comes from the method `twists`.
        """
        force, moment = covector[..., :3], covector[..., 3:]
        result = np.zeros((*covector.shape[:-1], 4, 4))
        # Linear part R^T p': the Hessian of g . p at constant g = R f, and the rotation of the axes
        hessian, slope = self._position_hessian((self.rotation @ force[..., None])[..., 0])
        result[..., :3, :3] = hessian + self._angular_slope(moment)
        result[..., 3, :3] = result[..., :3, 3] = slope
        result[..., :3] -= np.swapaxes(twists[..., :3, :], -1, -2) @ (skew(force) @ twists[..., 3:, :3])
        return result

    def twist_product(self, rates: FloatArray) -> FloatArray:
        r"""Rate of the twist of the end while the section coordinates change at constant rates, shape (..., 4), shape (..., 6).

        It is :math:`\sum \partial S_a / \partial z_b\, \dot z_a \dot z_b`, in the axes of the end, linear part first: angular
        the derivative of `T wd`, linear :math:`R^T \ddot p - (T \dot w) \times R^T \dot p`.
        """
        omega, turning, c = self._omega, rates[..., :3], self._c
        d = _slopes(c, 5)
        rate = (omega * turning).sum(axis=-1, keepdims=True)
        size = (turning * turning).sum(axis=-1, keepdims=True)
        first = [rate * d[k] for k in range(4)]
        second = [None, *((k * d[k + 2] - d[k + 1]) * rate * rate + d[k] * size for k in (1, 2, 3))]
        across = (self._turn @ turning[..., None])[..., 0]
        twice = (self._turn @ across[..., None])[..., 0]
        angular = turning - c[2] * across + c[3] * twice
        bent = (skew(turning) @ across[..., None])[..., 0]
        angular_rate = c[3] * bent - first[2] * across + first[3] * twice
        aside, outer = turning @ _CROSS_AXIS.T, turning[..., 2:] * omega + omega[..., 2:] * turning
        along = omega[..., 2:] * omega
        slope = first[1] * _AXIS + first[2] * self._across + c[2] * aside + first[3] * along + c[3] * outer
        bend = second[1] * _AXIS + second[2] * self._across + second[3] * along
        bend += 2.0 * (first[2] * aside + first[3] * outer + c[3] * turning[..., 2:] * turning)
        stretching, back = rates[..., 3:], np.swapaxes(self.rotation, -1, -2)
        linear = back @ (stretching * self._direction + self._length * slope)[..., None]
        linear_rate = back @ (2.0 * stretching * slope + self._length * bend)[..., None] - skew(angular) @ linear
        return np.concatenate([linear_rate[..., 0], angular_rate], axis=-1)

    def _position_hessian(self, pull: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Second derivatives of `pull . p` with respect to `w`, and to `w` and the length, shapes (..., 3, 3) and (..., 3)."""
        omega, c = self._omega, self._c
        d = _slopes(c, 5)
        e = [None, *(k * d[k + 2] - d[k + 1] for k in (1, 2, 3))]
        aside = pull @ _CROSS_AXIS  # pull . (w x e_z) = aside . w
        across, along = (aside * omega).sum(-1, keepdims=True), (pull * omega).sum(-1, keepdims=True)
        values = (pull[..., 2:], across, omega[..., 2:] * along)  # pull . v of the three terms c_k v
        turning = along * _AXIS + omega[..., 2:] * pull  # slope of the last one
        first, second = (sum(f[k] * v for k, v in zip((1, 2, 3), values, strict=True)) for f in (d, e))
        mixed = 0.5 * second * omega + d[2] * aside + d[3] * turning
        outer = mixed[..., :, None] * omega[..., None, :] + c[3, ..., None] * pull[..., :, None] * _AXIS
        hessian = first[..., None] * _UNITS + outer + np.swapaxes(outer, -1, -2)
        return self._length[..., None] * hessian, first * omega + c[2] * aside + c[3] * turning

    def _angular_slope(self, moment: FloatArray) -> FloatArray:
        """Derivative of `moment . T` with `T = 1 - c_2 [w] + c_3 [w]^2`, shape (..., 3, 3)."""
        omega, c = self._omega, self._c
        d = _slopes(c, 3)
        turned = (self._turn @ moment[..., None])[..., 0]
        turned_twice = (self._turn_twice @ moment[..., None])[..., 0]
        along = (omega * moment).sum(-1)[..., None, None]
        slope = (d[2] * turned + d[3] * turned_twice)[..., :, None] * omega[..., None, :] - c[2, ..., None] * skew(moment)
        outer = omega[..., :, None] * moment[..., None, :]
        slope += c[3, ..., None] * (along * _UNITS + outer - 2.0 * np.swapaxes(outer, -1, -2))
        return np.asarray(slope)


def _slopes(c: FloatArray, highest: int) -> FloatArray:
    """`d_k` with `dc_k = d_k w . dw`, up to `highest`, shape (highest + 1, ...)."""
    orders = np.arange(highest + 1).reshape(-1, *(1,) * (c.ndim - 1))
    return np.asarray(orders * c[2 : highest + 3] - c[1 : highest + 2])
