r"""Many states of one tree of joints under dead loads, and derivatives of virtual work by where its joints are.

Virtual rates `lambda` of the joints give body `k` the twist :math:`V_k = \sum_{j \le k} \lambda_j S_j` (world axes, at the
origin, linear part first) and dead wrenches `(f, mu)` at points `x` beyond joint `i` the work :math:`W(\lambda)`. When
everything from joint `i` on moves by the twist :math:`\xi = (d, a)`,

.. math:: \frac{\partial W}{\partial d} = F_i \times \omega, \qquad
   \frac{\partial W}{\partial a} = \sum (\dot x \times f + \omega_k \times \mu) - v \times F_i - \omega \times N_i

with the twist `(v, omega)` of the body before joint `i`, the force `F_i` and moment `N_i` about the origin of all loads beyond,
and the velocities :math:`\dot x` of their points under `lambda`: the rate of the carried wrench. Weight is a force at each
centre of mass. A motion of joint `i` is the twist `S_i`. All this is linear in the twists: matrices, one a joint.
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

_BASE = np.eye(4)
_CARRY = np.zeros((6, 6, 6))
"""Matrices by the force F and moment N beyond: twists (v, omega), times their sum, are (F x omega, F x v + N x omega)."""
_CARRY[:3, :3, 3:] = _CARRY[:3, 3:, :3] = _CARRY[3:, 3:, 3:] = -skew(np.eye(3))


class Topology(NamedTuple):
    """The order and the joints of a robot; the base stands at the end of what has a row for each joint and one for it."""

    jumps: tuple[Any, ...]
    """Ancestors of the joints and of the base that double in distance from step to step until all reach the base."""
    parents: Any
    """Joint before each joint, shape (n,); -1 at the base."""
    beyond: FloatArray
    """1 where the joint of the column is the joint of the row or beyond it, else 0, shape (n, n)."""
    axes: FloatArray
    """Twist of each joint in its own frame, shape (n, 6)."""
    motions: FloatArray
    """Factors of 1, sin(q), 1 - cos(q) and q in the placement of each joint in the one before, shape (n, 4, 16)."""


@lru_cache(maxsize=64)
def topology(model: SoftModel) -> Topology:
    """Return the order of the joints of a robot and their axes."""
    rigid, data = model.workspace(None)
    parents = np.array(list(rigid.parents)[1:], dtype=np.intp) - 1
    n, jumps, ancestors = len(parents), [], np.append(parents, -1)
    while np.any(ancestors >= 0):
        jumps.append(ancestors)
        ancestors = ancestors[ancestors]
    beyond = np.zeros((n, n))
    for joint, supports in enumerate(list(rigid.supports)[1:]):
        beyond[np.array(list(supports)[1:]) - 1, joint] = 1.0
    columns = pin.computeJointJacobians(rigid, data, pin.neutral(rigid)) if n else np.zeros((6, 0))
    columns = np.asarray(columns).reshape(6, n)
    axes = np.array([data.oMi[i + 1].actInv(pin.Motion(columns[:, i])).vector for i in range(n)]).reshape(n, 6)
    motions = np.zeros((n, 4, 4, 4))
    motions[:, 0] = np.eye(4)
    motions[:, 1, :3, :3] = skew(axes[:, 3:])
    motions[:, 2] = motions[:, 1] @ motions[:, 1]
    motions[:, 3, :3, 3] = axes[:, :3]  # a joint turns or slides
    placements = np.array([one.homogeneous for one in list(rigid.jointPlacements)[1:]]).reshape(n, 1, 4, 4)
    return Topology(tuple(jumps), parents, beyond, axes, (placements @ motions).reshape(n, 4, 16))


class _Loaded(NamedTuple):
    """A frame with a wrench."""

    name: str
    body: int
    """Joint that carries it; -1: the base."""
    arm: FloatArray
    """Cross-product matrix of its position, shape (N, 3, 3) [m]."""
    force: FloatArray
    """That of the force, the same shape [N]."""


class LoadedTree:
    """N states of a robot's joints under wrenches and gravity. Of L rows of outputs, twists have the shape (N, n, L, 6)."""

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
        placed = _placed(tree, joints)
        self.rotation, self.position = placed[..., :3, :3], placed[..., :3, 3]
        """Rotation, shape (N, n + 1, 3, 3), and position, (N, n + 1, 3) [m], of the joints, then of the base."""
        self._to_world = np.zeros((*placed.shape[:2], 6, 6))  # of twists in joints
        self._to_world[..., :3, :3] = self._to_world[..., 3:, 3:] = self.rotation
        self._to_world[..., :3, 3:] = skew(self.position) @ self.rotation
        self.axes = (self._to_world[:, :-1] @ tree.axes[..., None])[..., 0]
        """World twist of each joint, at the origin, shape (N, n, 6)."""
        wrenches: FloatArray = np.zeros(self.axes.shape)
        self._gravity, self._turned = loads.get(""), np.zeros((*joints.shape, 3, 6))
        if self._gravity is not None:
            masses, pull = numbers["masses"], -skew(self._gravity)[:, None]
            self._weights = np.zeros((*joints.shape, 6, 4))  # wrenches of gravity by masses and first moments
            self._weights[..., :3, 0] = self._gravity[:, None]
            moments = pull @ placed[:, :-1, :3]
            self._weights[..., 3:, 0], self._weights[..., 3:, 1:] = moments[..., 3], moments[..., :3]
            wrenches = (self._weights @ masses[..., None])[..., 0]
            self._first = (placed[:, :-1, :3] @ masses.take((1, 2, 3, 0), -1)[..., None])[..., 0]
            self._turned[..., 3:] = -pull @ skew(self._first)
        self._loaded = []
        for frame, wrench in loads.items():
            if frame:
                body, _, point = self.frame(frame)
                arm, force, moment = skew(np.array([point, wrench[:, :3], wrench[:, 3:]]))
                self._loaded.append(_Loaded(frame, body, arm, force))
                if body >= 0:
                    wrenches[:, body] += wrench
                    wrenches[:, body, 3:] += (arm @ wrench[:, :3, None])[..., 0]
                    self._turned[:, body, :, 3:] += force @ arm - moment
        self._turned[..., :3] = -skew(wrenches[..., :3])
        self._beyond = tree.beyond @ wrenches
        self._carry = (self._beyond @ _CARRY.reshape(6, 36)).reshape(*joints.shape, 6, 6)

    @property
    def torque(self) -> FloatArray:
        """Torque of the loads on each joint, shape (N, n) [N m or N]."""
        return np.asarray((self.axes * self._beyond).sum(-1))

    def frame(self, name: str) -> tuple[int, FloatArray, FloatArray]:
        """Joint that carries a frame (-1: the base), the frame's position in it, shape (3,), and in the world, (N, 3) [m]."""
        number = self._model.frame_id(name)
        body, local = int(self._model.pinocchio.frames[number].parentJoint) - 1, self._numbers["frames"][number, :, 3]
        return body, local, self.position[:, body] + self.rotation[:, body] @ local

    def pose_slopes(self, name: str, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of weighted components of the pose of a frame.

        Args:
            name: Name of the frame.
            weights: Weights of position and rotation, world axes, shape (N, L, 6).

        Returns:
            By the twist of what is from each joint on, shape (N, n, L, 6), and by that of the frame in its joint, (N, L, 6).
        """
        body, _, point = self.frame(name)
        wrench = weights.copy()
        wrench[..., 3:] += _products(skew(point), weights[..., :3])
        beyond = self.topology.beyond[:, body] if body >= 0 else np.zeros(len(self.topology.parents))
        return wrench[:, None] * beyond[:, None, None], wrench @ self._to_world[:, body]

    def twists(self, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Twists, at the origin, of the bodies, and of the joints in the bodies before, at rates of shape (N, L, n)."""
        each = np.swapaxes(rates, 1, 2)[..., None] * self.axes[:, :, None]
        return (self.topology.beyond.T @ each.reshape(*each.shape[:2], -1)).reshape(each.shape), each

    def work_slopes(self, twists: FloatArray, each: FloatArray) -> FloatArray:
        """Derivatives of the virtual work by the twist of what is from each joint on, shape (N, n, L, 6), from `twists`."""
        by_twist = (twists - each) @ self._carry
        carried = twists @ np.swapaxes(self._turned, -1, -2)
        by_twist[..., 3:] += (self.topology.beyond @ carried.reshape(*carried.shape[:2], -1)).reshape(carried.shape)
        return np.asarray(by_twist)

    def by_loads(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by the wrench at each frame, (N, L, 6), and by gravity, "", (N, L, 3)."""
        found = {}
        for one in self._loaded:
            speed = twists[:, one.body].copy() if one.body >= 0 else np.zeros((len(twists), *twists.shape[2:]))
            speed[..., :3] -= _products(one.arm, speed[..., 3:])
            found[one.name] = speed
        if self._gravity is not None:
            shifts = self._numbers["masses"][:, :1, None] * twists[..., :3] + cross(twists[..., 3:], self._first[:, :, None])
            found[""] = shifts.sum(axis=1)
        return found

    def by_masses(self, twists: FloatArray) -> FloatArray | None:
        """Derivatives of the virtual work by mass and first moment of each body, shape (N, n, L, 4); None if weightless."""
        return None if self._gravity is None else np.asarray(twists @ self._weights)

    def by_frames(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by twists of the loaded frames in their joints, shape (N, L, 6)."""
        found = {}
        for one in self._loaded:
            if one.body >= 0:
                force = _products(one.force, twists[:, one.body, :, 3:])
                wrench = np.concatenate([force, _products(one.arm, force)], axis=-1)
                found[one.name] = wrench @ self._to_world[:, one.body]
        return found

    def at_joints(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by joint positions from those by twists, shape (N, L, n)."""
        return np.swapaxes((by_twist @ self.axes[..., None])[..., 0], 1, 2)

    def at_placements(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by twists of the placements of joints in the frames before them, shape (N, n, L, 6), from the same."""
        return np.asarray(by_twist @ self._to_world[:, self.topology.parents])


def _products(matrices: FloatArray, vectors: FloatArray) -> FloatArray:
    """Products of matrices, shape (N, 3, 3), with L vectors each, (N, L, 3)."""
    return np.asarray(vectors @ np.swapaxes(matrices, -1, -2))


def _placed(tree: Topology, joints: FloatArray) -> FloatArray:
    """Placement of each joint, and of the base, in the world, shape (N, n + 1, 4, 4)."""
    count, n = joints.shape
    motion = np.ones((count, n, 1, 4))
    motion[..., 0, 1], motion[..., 0, 2], motion[..., 0, 3] = np.sin(joints), 1.0 - np.cos(joints), joints
    placed = np.zeros((count, n + 1, 4, 4))
    placed[:, :n], placed[:, n] = (motion @ tree.motions).reshape(count, n, 4, 4), _BASE
    for ancestors in tree.jumps:
        placed = placed[:, ancestors] @ placed
    return placed
