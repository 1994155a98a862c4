r"""Many states of one tree of joints under dead loads, and derivatives of virtual work by where its joints are.

Virtual rates `lambda` of the joints give body `k` the twist :math:`V_k = \sum_{j \le k} \lambda_j S_j` (world axes, at the
origin, linear part first) and dead wrenches `(f, mu)` at points `x` beyond joint `i` the work :math:`W(\lambda)`. When
everything from joint `i` on moves by the twist :math:`\xi = (d, a)`,

.. math:: \frac{\partial W}{\partial d} = F_i \times \omega, \qquad
   \frac{\partial W}{\partial a} = \sum (\dot x \times f + \omega_k \times \mu) - v \times F_i - \omega \times N_i

with the twist `(v, omega)` of the body before joint `i`, the force `F_i` and moment `N_i` about the origin of all loads beyond,
and the velocities :math:`\dot x` of their points under `lambda`: the rate of the carried wrench. Weight is a force at each
centre of mass. A motion of joint `i` is the twist `S_i`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross, skew
from softrobots.model.soft_model import SoftModel

_IDENTITY = np.eye(4)


class Topology(NamedTuple):
    """What two models of one structure have in common."""

    jumps: tuple[tuple[Any, Any], ...]
    """Joints, and ancestors that double in distance from step to step until all reach the base."""
    parents: Any
    """Joint before each joint, shape (n,); -1 at the base."""
    beyond: FloatArray
    """1 where the joint of the column is the joint of the row or beyond it, else 0, shape (n, n)."""
    axes: FloatArray
    """Twist of each joint in its own frame, shape (n, 6)."""
    motions: FloatArray
    """Factors of sin(q), 1 - cos(q) and q in the motion of each joint beyond the identity, shape (3, n, 4, 4)."""


@lru_cache(maxsize=64)
def topology(model: SoftModel) -> Topology:
    """Return the order of the joints of a robot and their axes."""
    rigid, data = model.workspace(None)
    parents = np.array(list(rigid.parents)[1:], dtype=np.intp) - 1
    n, jumps, ancestors = len(parents), [], parents.copy()
    while np.any(ancestors >= 0):
        moving = np.flatnonzero(ancestors >= 0)
        jumps.append((moving, ancestors[moving]))
        ancestors = np.where(ancestors >= 0, ancestors[ancestors], -1)
    beyond = np.zeros((n, n))
    for joint, supports in enumerate(list(rigid.supports)[1:]):
        beyond[np.array(list(supports)[1:]) - 1, joint] = 1.0
    columns = pin.computeJointJacobians(rigid, data, pin.neutral(rigid)) if n else np.zeros((6, 0))
    columns = np.asarray(columns).reshape(6, n)
    axes = np.array([data.oMi[i + 1].actInv(pin.Motion(columns[:, i])).vector for i in range(n)]).reshape(n, 6)
    motions = np.zeros((3, n, 4, 4))
    motions[0, :, :3, :3] = skew(axes[:, 3:])
    motions[1] = motions[0] @ motions[0]
    motions[2, :, :3, 3] = axes[:, :3]  # a joint turns or slides
    return Topology(tuple(jumps), parents, beyond, axes, motions)


class LoadedTree:
    """N states of a robot's joints under wrenches and gravity."""

    def __init__(
        self, model: SoftModel, numbers: Mapping[str, FloatArray], joints: FloatArray, loads: Mapping[str, FloatArray]
    ) -> None:
        """Place the joints, and carry the loads to the base.

        Args:
            model: The robot.
            numbers: Its numbers.
            joints: Joint positions, shape (N, n) [rad or m].
            loads: Wrench by frame, shape (N, 6), and gravity, by the name "", shape (N, 3), world axes.
        """
        self.topology = tree = topology(model)
        self._model, self._numbers = model, numbers
        placed = _placed(tree, numbers["placements"], joints)
        self.rotation, self.position = placed[..., :3], placed[..., 3]
        self.axes = np.zeros((*joints.shape, 6))
        """World twist of each joint, at the origin, shape (N, n, 6)."""
        self.axes[..., 3:] = (self.rotation @ tree.axes[:, 3:, None])[..., 0]
        self.axes[..., :3] = (self.rotation @ tree.axes[:, :3, None])[..., 0] + cross(self.position, self.axes[..., 3:])
        self._gravity = loads.get("")
        force, moment = np.zeros((2, *self.position.shape))
        if self._gravity is not None:
            mass, first = numbers["masses"][:, :1], numbers["masses"][:, 1:]
            self._mass, self._first = mass, mass * self.position + (self.rotation @ first[..., None])[..., 0]
            force += mass * self._gravity[:, None]
            moment += cross(self._first, self._gravity[:, None])
        self._wrenches = []
        for frame, wrench in loads.items():
            if frame:
                body, local, point = self.frame(frame)
                self._wrenches.append((frame, body, local, point, wrench))
                if body >= 0:
                    force[:, body] += wrench[:, :3]
                    moment[:, body] += wrench[:, 3:] + cross(point, wrench[:, :3])
        self._force, self._moment = tree.beyond @ force, tree.beyond @ moment
        self.torque = (self.axes[..., :3] * self._force).sum(-1) + (self.axes[..., 3:] * self._moment).sum(-1)
        """Torque of the loads on each joint, shape (N, n) [N m or N]."""

    def frame(self, name: str) -> tuple[int, FloatArray, FloatArray]:
        """Joint that carries a frame (-1: the base), the frame's position in it, shape (3,), and in the world, (N, 3) [m]."""
        number = self._model.frame_id(name)
        body, local = int(self._model.pinocchio.frames[number].parentJoint) - 1, self._numbers["frames"][number, :, 3]
        if body < 0:
            return body, local, np.broadcast_to(local, (len(self.rotation), 3))
        return body, local, self.position[:, body] + self.rotation[:, body] @ local

    def pose_slopes(self, name: str, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of weighted components of the pose of a frame.

        Args:
            name: Name of the frame.
            weights: Weights of position and rotation, world axes, shape (N, L, 6).

        Returns:
            By the twist of what is from each joint on, shape (N, L, n, 6), and by that of the frame in its joint, (N, L, 6).
        """
        body, local, point = self.frame(name)
        pull, turn = weights[..., :3], weights[..., 3:]
        slopes = np.zeros((*weights.shape[:2], len(self.topology.parents), 6))
        if body >= 0:
            wrench = np.concatenate([pull, turn + cross(point[:, None], pull)], axis=-1)
            slopes += wrench[:, :, None] * self.topology.beyond[:, body, None]
            pull, turn = pull @ self.rotation[:, body], turn @ self.rotation[:, body]
        return slopes, np.concatenate([pull, turn + cross(local, pull)], axis=-1)

    def twists(self, rates: FloatArray) -> FloatArray:
        """Twists of the bodies, at the origin, shape (N, L, n, 6), at rates of the joints, shape (N, L, n)."""
        return np.asarray(self.topology.beyond.T @ (rates[..., None] * self.axes[:, None]))

    def work_slopes(self, rates: FloatArray, twists: FloatArray) -> FloatArray:
        """Derivatives of the virtual work by the twist of what is from each joint on, shape (N, L, n, 6)."""
        carried = np.zeros((*twists.shape[:-1], 3))
        if self._gravity is not None:
            carried += cross(self._shifts(twists), self._gravity[:, None, None])
        for _, body, _, point, wrench in self._wrenches:
            if body >= 0:
                speed = self._speed(twists, body, point)
                carried[:, :, body] += cross(speed[..., :3], wrench[:, None, :3]) + cross(speed[..., 3:], wrench[:, None, 3:])
        before, force = twists - rates[..., None] * self.axes[:, None], self._force[:, None]
        by_twist = np.zeros_like(twists)
        by_twist[..., :3] = cross(force, before[..., 3:])
        by_twist[..., 3:] = self.topology.beyond @ carried - cross(before[..., :3], force)
        by_twist[..., 3:] -= cross(before[..., 3:], self._moment[:, None])
        return by_twist

    def by_loads(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by the wrench at each frame, (N, L, 6), and by gravity, "", (N, L, 3)."""
        found = {frame: self._speed(twists, body, point) for frame, body, _, point, _ in self._wrenches}
        return found if self._gravity is None else found | {"": self._shifts(twists).sum(axis=-2)}

    def by_masses(self, twists: FloatArray) -> FloatArray | None:
        """Derivatives of the virtual work by mass and first moment of each body, shape (N, L, n, 4); None if weightless."""
        if self._gravity is None:
            return None
        pull = self._gravity[:, None, None]
        aside = cross(pull, twists[..., 3:])
        heights = (twists[..., :3] * pull + aside * self.position[:, None]).sum(-1, keepdims=True)
        return np.concatenate([heights, (aside[..., None, :] @ self.rotation[:, None])[..., 0, :]], axis=-1)

    def by_frames(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by twists of the loaded frames in their joints, shape (N, L, 6)."""
        found = {}
        for frame, body, local, _, wrench in self._wrenches:
            if body >= 0:
                spin = twists[:, :, body, 3:]
                shift = cross(np.broadcast_to(wrench[:, None, :3], spin.shape), spin) @ self.rotation[:, body]
                found[frame] = np.concatenate([shift, cross(local, shift)], axis=-1)
        return found

    def _shifts(self, twists: FloatArray) -> FloatArray:
        """Mass of each body times the velocity of its centre, shape (N, L, n, 3)."""
        return np.asarray(self._mass * twists[..., :3] + cross(twists[..., 3:], self._first[:, None]))

    def _speed(self, twists: FloatArray, body: int, point: FloatArray) -> FloatArray:
        """Velocity of a point of a body, and its rate of rotation, shape (N, L, 6)."""
        if body < 0:
            return np.zeros((*twists.shape[:2], 6))
        speed = twists[:, :, body].copy()
        speed[..., :3] += cross(speed[..., 3:], point[:, None])
        return speed

    def at_joints(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by joint positions from those by twists, shape (N, L, n)."""
        return np.asarray((by_twist * self.axes[:, None]).sum(-1))

    def at_placements(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by twists of the placements of joints in the frames before them, shape (N, L, n, 6), from the same."""
        parents = self.topology.parents
        base = parents < 0
        rotation, position = self.rotation[:, parents], self.position[:, parents]
        rotation[:, base], position[:, base] = np.eye(3), 0.0
        linear = by_twist[..., :3]
        local = np.stack([linear, by_twist[..., 3:] + cross(linear, position[:, None])], axis=-2) @ rotation[:, None]
        return local.reshape(by_twist.shape)


def _placed(tree: Topology, placements: FloatArray, joints: FloatArray) -> FloatArray:
    """Placement of each joint in the world, shape (N, n, 3, 4)."""
    sine, rest, way = (one[..., None, None] for one in (np.sin(joints), 1.0 - np.cos(joints), joints))
    moved = _IDENTITY + sine * tree.motions[0] + rest * tree.motions[1] + way * tree.motions[2]
    placed = placements @ moved
    for moving, ancestors in tree.jumps:
        carrier, carried = placed[:, ancestors], placed[:, moving]
        carried = carrier[..., :3] @ carried
        carried[..., 3] += carrier[..., 3]
        placed[:, moving] = carried
    return np.asarray(placed)
