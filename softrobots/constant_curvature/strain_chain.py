r"""Section of constant strain as an equivalent chain of rigid joints: universal, prismatic, spherical.

The chain `Rx(u1) Ry(u2) Tz(c) Rx(r1) Ry(r2) Rz(r3)` reproduces the pose of the end of a section exactly (see
`softrobots.constant_curvature.screws`), with or without twist, and smoothly at the straight configuration: the prismatic joint
spans the chord. Its joint positions are a map `m(z)` of the four section coordinates `z = h (kx, ky, tau, stretch - 1)`. With
the pose `(R, p)` of the end of the section

    c = |p|,  u1 = atan2(-p_y, p_z),  u2 = atan2(p_x, hypot(p_y, p_z)),  Q = (Rx(u1) Ry(u2))^T R,
    r1 = atan2(-Q_12, Q_22),  r2 = atan2(Q_02, hypot(Q_12, Q_22)),  r3 = atan2(-Q_01, Q_00)

and with the body Jacobian `J_b` of the chain and the twists `S` of the section, `dm/dz = J_b^-1 S`.

(Chains that rotate into the bending plane first, `Rz(alpha) Ry(theta/2) Tz Ry(theta/2) Rz(-alpha)`, are exact too, but
undetermined when straight.) `|det J_b| = c^2 |cos u2 cos r2|` vanishes only where the chord lies along x of its base, which
`in_range` excludes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from softrobots.constant_curvature.screws import Screw
from softrobots.core.checks import FloatArray
from softrobots.core.vectors import skew

JOINTS = ("u1", "u2", "c", "r1", "r2", "r3")
"""Joints of a section, base to tip: two of the universal joint, the chord, three of the spherical joint."""

STRAINS = ("bend_x", "bend_y", "twist", "stretch")
"""Section coordinates: rotation over the section about x, y and z [rad], elongation [m]."""

LARGEST_BENDING = np.deg2rad(170.0)
"""Largest bending of a section by muscle lengths [rad]. The chain is singular at 180 degrees; above 120 use more sections."""

_LARGEST_TURN = 0.999 * 4.0 * np.pi**2  # squared rotation of a section; at a whole turn it has no chord
_WELL_WITHIN = 0.25 * np.pi**2  # squared rotation, a quarter of a turn, that is always in range
_UPPER = np.triu(np.ones((6, 6)), 1)  # pairs of joints, the first closer to the base


class SectionChain:
    """Joint positions of sections at given section coordinates, with derivatives."""

    def __init__(self, z: FloatArray, rest_length: FloatArray | float) -> None:
        """Evaluate the map at section coordinates `z` [rad, rad, rad, m], and rest lengths, shape (...) [m].

        The coordinates have the shape (..., n): four, or the first three of sections that do not stretch.
        """
        self._n, self._z, self._rest_length = z.shape[-1], with_stretch(z), np.asarray(rest_length)

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the sections, shape (...) [m]."""
        return np.asarray(self._rest_length + self._z[..., 3])

    @cached_property
    def _screw(self) -> Screw:
        return Screw(self._z, self._rest_length)

    @cached_property
    def positions(self) -> FloatArray:
        """Joint positions `m`, shape (..., 6), in the order of `JOINTS` [rad, rad, m, rad, rad, rad]."""
        return _positions(self._screw.rotation, self._screw.position)

    @cached_property
    def valid(self) -> bool:
        """Whether all sections are in range, see `in_range`; otherwise the other attributes have no meaning."""
        z, length = self._z, self._rest_length
        if not np.all(length + z[..., 3] > 1e-3 * length):  # also for NaN
            return False
        turn = (z[..., :3] * z[..., :3]).sum(axis=-1)
        return bool(np.all(turn < _WELL_WITHIN)) or _in_range(z, turn, self._screw, self.positions)

    @cached_property
    def first(self) -> FloatArray:
        """First derivative of the joint positions, `J_b^-1 S`, shape (..., 6, n)."""
        return np.asarray(self._inverse @ self._twists[..., : self._n])

    def curvature(self, torque: FloatArray) -> FloatArray:
        r"""Return the weighted sum of the second derivatives of the joint positions, `sum_j torque_j d^2 m_j`.

        With columns `J_i` of the body Jacobian, :math:`\partial J_i / \partial m_j = [J_i, J_j]` for `i < j` and 0 otherwise,
        so `J_b m'' = S' - \sum_{i<j} m'_i m'_j [J_i, J_j]`; everything is contracted with `J_b^-T torque` first. The weights
        of the joints have the shape (..., 6), the symmetric result (..., n, n).
        """
        covector = (torque[..., None, :] @ self._inverse)[..., 0, :]
        linear, angular = self._jacobian[..., :3, :], self._jacobian[..., 3:, :]
        half = np.swapaxes(angular, -1, -2) @ (skew(covector[..., :3]) @ linear)
        brackets = np.swapaxes(half, -1, -2) - half
        brackets -= np.swapaxes(angular, -1, -2) @ (skew(covector[..., 3:]) @ angular)
        first = self.first
        screw_part = self._screw.curvature(self._twists, covector)[..., : self._n, : self._n]
        return np.asarray(screw_part - np.swapaxes(first, -1, -2) @ ((brackets * _UPPER) @ first))

    def velocity_product(self, rates: FloatArray) -> FloatArray:
        r"""Return the joint accelerations, shape (..., 6), at constant rates of the section coordinates, shape (..., n).

        :math:`J_b^{-1} (S'(\dot z) \dot z - \sum_{i<j} [J_i \dot m_i, J_j \dot m_j])`, see `curvature`.
        """
        moving = self._jacobian * (self.first @ rates[..., None])[..., 0][..., None, :]  # twist of the end by each joint
        nearer = np.cumsum(moving, axis=-1) - moving
        ends = np.swapaxes(moving, -1, -2)
        linear = nearer[..., :3, :] @ ends[..., 3:] + nearer[..., 3:, :] @ ends[..., :3]
        brackets = np.concatenate([_axial(linear), _axial(nearer[..., 3:, :] @ ends[..., 3:])], axis=-1)
        return np.asarray((self._inverse @ (self._screw.twist_product(with_stretch(rates)) - brackets)[..., None])[..., 0])

    @cached_property
    def _twists(self) -> FloatArray:
        return self._screw.twists()

    @cached_property
    def _jacobian(self) -> FloatArray:
        return _body_jacobian(self.positions)

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._jacobian))


def with_stretch(z: FloatArray) -> FloatArray:
    """Return section coordinates, or their rates, with zero for stretch where it is missing, shape (..., 3 or 4), (..., 4)."""
    return z if z.shape[-1] == len(STRAINS) else np.concatenate([z, np.zeros((*z.shape[:-1], 1))], axis=-1)


def joint_positions(z: FloatArray, rest_length: FloatArray | float) -> FloatArray:
    """Return the joint positions of sections, shape (..., 6), at section coordinates within range; see `SectionChain`."""
    return SectionChain(z, rest_length).positions


def in_range(z: FloatArray, rest_length: FloatArray | float) -> bool:
    """Return whether the chain can represent all sections at these section coordinates; see `SectionChain`.

    Required of each: positive length; total rotation below a whole turn; a chord that points forwards at both ends (without
    twist: bending below 180 degrees); and less than half a turn about the axis of its end, in the twist and in the joint r3,
    which rotates a little further than the twist.
    """
    return SectionChain(z, rest_length).valid


def _in_range(z: FloatArray, turn: FloatArray, end: Screw, positions: FloatArray) -> bool:
    if not (np.all(turn < _LARGEST_TURN) and np.all(np.abs(z[..., 2]) < np.pi)):
        return False  # also for NaN
    if not np.all(np.abs(positions[..., 5] - z[..., 2]) < np.pi):  # r3 has gone past half a turn to the other side
        return False
    # As the strain is constant, the chord has the same angle to the axes of both ends.
    return bool(np.all(end.position[..., 2] > 1e-3 * np.sqrt((end.position * end.position).sum(axis=-1))))


def _axial(products: FloatArray) -> FloatArray:
    """Sum of cross products `a x b` from that of the products `a b^T`, shape (..., 3, 3), shape (..., 3)."""
    other = products - np.swapaxes(products, -1, -2)
    return np.stack([other[..., 1, 2], other[..., 2, 0], other[..., 0, 1]], axis=-1)


def _positions(rotation: FloatArray, position: FloatArray) -> FloatArray:
    x, y, z = np.moveaxis(position, -1, 0)
    across = np.hypot(y, z)
    joints = np.zeros((*position.shape[:-1], 6))
    joints[..., 0] = np.arctan2(-y, z)
    joints[..., 1] = np.arctan2(x, across)
    joints[..., 2] = np.hypot(x, across)
    turn = np.swapaxes(universal(joints[..., 0], joints[..., 1]), -1, -2) @ rotation
    joints[..., 3] = np.arctan2(-turn[..., 1, 2], turn[..., 2, 2])
    joints[..., 4] = np.arctan2(turn[..., 0, 2], np.hypot(turn[..., 1, 2], turn[..., 2, 2]))
    joints[..., 5] = np.arctan2(-turn[..., 0, 1], turn[..., 0, 0])
    return joints


def universal(about_x: FloatArray, about_y: FloatArray) -> FloatArray:
    """Return `Rx(about_x) Ry(about_y)`, the axes of the chord in those of the start of a section, shape (..., 3, 3)."""
    sx, cx, sy, cy = np.sin(about_x), np.cos(about_x), np.sin(about_y), np.cos(about_y)
    rotation = np.zeros((*np.shape(about_x), 3, 3))
    rotation[..., 0, 0], rotation[..., 0, 2] = cy, sy
    rotation[..., 1, 0], rotation[..., 1, 1], rotation[..., 1, 2] = sx * sy, cx, -sx * cy
    rotation[..., 2, 0], rotation[..., 2, 1], rotation[..., 2, 2] = -cx * sy, sx, cx * cy
    return rotation


def _body_jacobian(joints: FloatArray) -> FloatArray:
    """Twist of the end of the chain per joint, in the axes of the end, linear part first, shape (..., 6, 6)."""
    _, u2, c, r1, r2, r3 = np.moveaxis(joints, -1, 0)
    s3, c3 = np.sin(r3), np.cos(r3)
    about_z = np.zeros((*c.shape, 3, 3))
    about_z[..., 0, 0], about_z[..., 0, 1], about_z[..., 1, 0], about_z[..., 1, 1] = c3, -s3, s3, c3
    about_z[..., 2, 2] = 1.0
    spherical = universal(r1, r2) @ about_z
    jacobian = np.zeros((*c.shape, 6, 6))
    # Rows of `spherical` are the axes before the spherical joint, in the axes of the end
    x, y, z = (spherical[..., axis, :] for axis in range(3))
    su, cu = np.sin(u2)[..., None], np.cos(u2)[..., None]
    jacobian[..., 3:, 0] = cu * x + su * z
    jacobian[..., :3, 0] = -c[..., None] * cu * y
    jacobian[..., 3:, 1] = y
    jacobian[..., :3, 1] = c[..., None] * x
    jacobian[..., :3, 2] = z
    jacobian[..., 3:, 3] = x
    jacobian[..., 3:, 4] = about_z[..., 1, :]
    jacobian[..., 5, 5] = 1.0
    return jacobian
