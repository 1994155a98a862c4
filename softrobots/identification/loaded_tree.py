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
from softrobots.model.soft_model import SoftModel

_SKEW = np.array([[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], dtype=np.float64)


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of vectors of shapes (..., 3) that broadcast."""
    return np.asarray(((a @ _SKEW).reshape(*a.shape, 3) @ b[..., None])[..., 0])


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
    slides: FloatArray
    """Which joints slide, shape (n,)."""


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
    return Topology(tuple(jumps), parents, beyond, axes, np.linalg.norm(axes[:, :3], axis=1) > 0.5)


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
        self.rotation, self.position = _placed(tree, numbers["placements"], joints)
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

    def work_slopes(self, rates: FloatArray) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Derivatives of the virtual work by twists of what is from each joint on, and by numbers and loads.

        Args:
            rates: Virtual rates of the joints, shape (N, L, n).

        Returns:
            By twists, shape (N, L, n, 6), and by `masses`, `frames` (twists at their joint, for each loaded frame by name),
            wrenches by name of the frame with "wrench " before it, and `gravity`, each shape (N, L, ...).
        """
        tree, moving = self.topology, rates[..., None] * self.axes[:, None]
        twists = tree.beyond.T @ moving
        before, force, moment = twists - moving, self._force[:, None], self._moment[:, None]
        carried, others = np.zeros((*twists.shape[:-1], 3)), {}
        if self._gravity is not None:
            pull, spin = self._gravity[:, None, None], twists[..., 3:]
            shifts = self._mass * twists[..., :3] + cross(spin, self._first[:, None])
            carried += cross(shifts, pull)
            others["gravity"] = shifts.sum(axis=-2)
            slopes = (cross(pull, spin)[..., None, :] @ self.rotation[:, None])[..., 0, :]
            heights = ((twists[..., :3] + cross(spin, self.position[:, None])) * pull).sum(-1, keepdims=True)
            others["masses"] = np.concatenate([heights, slopes], axis=-1)
        for frame, body, local, point, wrench in self._wrenches:
            twist = twists[:, :, body] if body >= 0 else np.zeros((*rates.shape[:2], 6))
            spin, speed = twist[..., 3:], twist[..., :3] + cross(twist[..., 3:], point[:, None])
            others[f"wrench {frame}"] = np.concatenate([speed, spin], axis=-1)
            if body >= 0:
                carried[:, :, body] += cross(speed, wrench[:, None, :3]) + cross(spin, wrench[:, None, 3:])
                shift = cross(np.broadcast_to(wrench[:, None, :3], spin.shape), spin) @ self.rotation[:, body]
                others[f"frame {frame}"] = np.concatenate([shift, cross(local, shift)], axis=-1)
        by_twist = np.zeros_like(twists)
        by_twist[..., :3] = cross(force, before[..., 3:])
        by_twist[..., 3:] = tree.beyond @ carried - cross(before[..., :3], force) - cross(before[..., 3:], moment)
        return by_twist, others

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


def _placed(tree: Topology, placements: FloatArray, joints: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation, shape (N, n, 3, 3), and position, shape (N, n, 3), of each joint in the world."""
    turns = np.where(tree.slides, 0.0, joints)[..., None, None]
    skewed = (tree.axes[:, 3:] @ _SKEW).reshape(-1, 3, 3)
    local = np.eye(3) + np.sin(turns) * skewed + (1.0 - np.cos(turns)) * (skewed @ skewed)
    rotation, shifts = placements[:, :, :3] @ local, placements[:, :, :3] @ tree.axes[:, :3, None]
    position = placements[:, :, 3] + shifts[..., 0] * joints[..., None]
    for moving, ancestors in tree.jumps:
        carrier = rotation[:, ancestors]
        position[:, moving] = (carrier @ position[:, moving][..., None])[..., 0] + position[:, ancestors]
        rotation[:, moving] = carrier @ rotation[:, moving]
    return rotation, position
