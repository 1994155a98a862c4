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
from softrobots.model.pinocchio_data import PinocchioData
from softrobots.model.soft_model import SoftModel

_FIRST_THEN_MASS, _MASS_THEN_FIRST = np.array([1, 2, 3, 0]), np.array([3, 0, 1, 2])
_BLOCKS: FloatArray = np.zeros((6, 6, 6))  # matrices of forces and moments of 1
_BLOCKS[:3, 3:, :3] = _BLOCKS[:3, :3, 3:] = _BLOCKS[3:, 3:, 3:] = -skew(np.eye(3))
_TURNING = _BLOCKS.reshape(6, 36)


class Topology(NamedTuple):
    """The order and the joints of a robot; the base stands at the end of what has a row for each joint and one for it."""

    parents: Any
    """Joint before each joint, shape (n,); -1 at the base."""
    beyond: FloatArray
    """1 where the joint of the column is the joint of the row or beyond it, else 0, shape (n, n)."""
    axes: FloatArray
    """Twist of each joint in its own frame, shape (n, 6)."""
    motions: FloatArray
    """Factors of 1, sin(q), 1 - cos(q) and q in the placement of each joint in the one before, shape (n, 4, 16)."""


@lru_cache(maxsize=64)
def topology(workspace: PinocchioData) -> Topology:
    """Return the order of the joints of a robot and their axes."""
    rigid, data = workspace.at(None)
    parents = np.array(list(rigid.parents)[1:], dtype=np.intp) - 1
    n = len(parents)
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
    return Topology(parents, beyond, axes, (placements @ motions).reshape(n, 4, 16))


@lru_cache(maxsize=64)
def section_joints(model: SoftModel) -> Any:
    """Places of the joints of each section of constant strain in Pinocchio's velocity vector; None without such sections."""
    if not model.structure.constant_strain:
        return None
    rigid = model.pinocchio
    return np.array(
        [[rigid.joints[rigid.getJointId(name)].idx_v for name in row.joint_names] for row in model.structure.section_table]
    )


class _Loaded(NamedTuple):
    """A frame with a wrench."""

    name: str
    body: int
    """Joint that carries it; -1: the base."""
    point: FloatArray
    """Its position, shape (N, 3) [m]."""
    wrench: FloatArray
    """Force on it, then moment, shape (N, 6) [N, N m]."""


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
        self.topology = tree = topology(model.data)
        self._model, self._numbers, self._frames = model, numbers, dict[str, tuple[int, FloatArray, FloatArray, FloatArray]]()
        placed = _placed(tree, joints) if len(joints) > 1 else _placed_alone(model, joints[0])
        self.rotation, self.position = placed[..., :3, :3], placed[..., :3, 3]
        """Rotation, shape (N, n + 1, 3, 3), and position, (N, n + 1, 3) [m], of the joints, then of the base."""
        self._to_world: FloatArray = np.zeros((*self.position.shape[:2], 6, 6))  # of twists in the joints
        self._to_world[..., :3, :3] = self._to_world[..., 3:, 3:] = self.rotation
        self._to_world[..., :3, 3:] = skew(self.position) @ self.rotation
        self.axes = (self._to_world[:, :-1] @ tree.axes[..., None])[..., 0]
        """World twist of each joint, at the origin, shape (N, n, 6)."""
        wrenches, turned = np.zeros(self.axes.shape), np.zeros((*self.axes.shape[:2], 3, 3))
        gravity, self._weight = loads.get(""), None
        if gravity is not None:
            bodies, pull = numbers["masses"].take(_FIRST_THEN_MASS, -1)[..., None], skew(gravity)[:, None]
            self._weight = np.zeros((*self.axes.shape, 4))  # on a body, of first moment and mass of 1
            self._weight[..., :3, 3], self._weight[..., 3:, :] = gravity[:, None], -(pull @ placed[:, :-1, :3])
            wrenches = (self._weight @ bodies)[..., 0]
            self._first = skew((placed[:, :-1, :3] @ bodies)[..., 0])
            turned = pull @ self._first
        self._loaded = []
        for frame, wrench in loads.items():
            if frame:
                body, _, point, arm = self.frame(frame)
                self._loaded.append(_Loaded(frame, body, point, wrench))
                if body >= 0:
                    wrenches[:, body] += wrench
                    wrenches[:, body, 3:] -= (wrench[:, None, :3] @ arm)[:, 0]
                    turned[:, body] += skew(wrench[:, :3]) @ arm
        carried = skew(wrenches.reshape(*wrenches.shape[:2], 2, 3))
        carried[:, :, 1] += turned
        self._turned, self._carried, self._beyond = turned, carried.reshape(*wrenches.shape, 3), tree.beyond @ wrenches

    @property
    def torque(self) -> FloatArray:
        """Torque of the loads on each joint, shape (N, n) [N m or N]."""
        return np.asarray((self.axes * self._beyond).sum(-1))

    def stiffness(self) -> FloatArray:
        """Derivatives of the torques of forces and gravity by joint positions, shape (N, n, n); what has moments has others.

        Beyond two joints everything moves with both: the later one turns and shifts what the turn of the first one carries.
        """
        later, n = self.topology.beyond, self.axes.shape[1]
        turned = (later @ self._turned.reshape(len(self.axes), n, 9)).reshape(-1, n, 3, 3)
        felt = cross(self.axes[..., :3], self._beyond[..., :3]) + (turned @ self.axes[..., 3:, None])[..., 0]
        found = later * (self.axes[..., 3:] @ felt.swapaxes(1, 2))
        return np.asarray(found + (found * (1.0 - np.eye(n))).swapaxes(1, 2))

    def frame(self, name: str) -> tuple[int, FloatArray, FloatArray, FloatArray]:
        """Joint that carries a frame (-1: the base), its position there, (3,), in the world, (N, 3) [m], and `skew` of that."""
        if name not in self._frames:
            number = self._model.frame_id(name)
            body, local = int(self._model.pinocchio.frames[number].parentJoint) - 1, self._numbers["frames"][number, :, 3]
            point = self.position[:, body] + self.rotation[:, body] @ local
            self._frames[name] = body, local, point, skew(point)
        return self._frames[name]

    def pose_slopes(self, name: str, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of weighted components of the pose of a frame.

        Args:
            name: Name of the frame.
            weights: Weights of position and rotation, world axes, shape (N, L, 6).

        Returns:
            By the twist of what is from each joint on, shape (N, n, L, 6), and by that of the frame in its joint, (N, L, 6).
        """
        body, _, _, arm = self.frame(name)
        wrench = weights.copy()
        wrench[..., 3:] -= weights[..., :3] @ arm
        beyond = self.topology.beyond[:, body] if body >= 0 else np.zeros(len(self.topology.parents))
        return wrench[:, None] * beyond[:, None, None], self._in_joint(body, wrench)

    def twists(self, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Twists, at the origin, of the bodies, and of the joints in the bodies before, at rates of shape (N, L, n)."""
        each = np.swapaxes(rates, 1, 2)[..., None] * self.axes[:, :, None]
        return (self.topology.beyond.T @ each.reshape(*each.shape[:2], -1)).reshape(each.shape), each

    def motion(self, joints: FloatArray, placements: FloatArray | None) -> FloatArray:
        """Twists of the bodies, shape (N, n, 1, 6), at rates of the joints, (N, n), and twists of their placements.

        The latter are in the joints before, shape (N or 1, n, 6); None: they stay.
        """
        each = self.axes * joints[..., None]
        if placements is not None:
            moved = np.flatnonzero(np.any(placements, axis=(0, 2)))
            each[:, moved] += (self._to_world[:, self.topology.parents[moved]] @ placements[:, moved, :, None])[..., 0]
        return np.asarray(self.topology.beyond.T @ each)[:, :, None]

    def point_speed(self, name: str, twists: FloatArray | None, frames: FloatArray | None) -> FloatArray:
        """Velocity of a frame, shape (N, 3), at twists of bodies, see `motion`, and of frames in them, (N or 1, k, 6)."""
        body, local, point, _ = self.frame(name)
        speed: FloatArray = np.zeros(point.shape)
        if twists is not None and body >= 0:
            speed += twists[:, body, 0, :3] + cross(twists[:, body, 0, 3:], point)
        if frames is not None:
            moving = frames[:, self._model.frame_id(name)]
            there = moving[:, :3] + cross(moving[:, 3:], np.broadcast_to(local, (len(moving), 3)))
            speed += (self.rotation[:, body] @ there[..., None])[..., 0]
        return speed

    def load_rates(self, forces: Mapping[str, FloatArray], masses: FloatArray | None, frames: FloatArray | None) -> FloatArray:
        """Rates of `torque`, shape (N, n), while the joints stand still; None of what stays.

        Args:
            forces: Rates of the forces on frames, shape (N or 1, 3) [N].
            masses: Rates of mass and first moment of each body, shape (N or 1, n, 4).
            frames: Twists of the frames in their joints, shape (N or 1, k, 6).
        """
        wrenches: FloatArray = np.zeros(self.axes.shape)
        if masses is not None and self._weight is not None:
            wrenches = (self._weight @ masses.take(_FIRST_THEN_MASS, -1)[..., None])[..., 0]
        for one in self._loaded:
            if one.body >= 0 and one.name in forces:
                wrenches[:, one.body, :3] += forces[one.name]
                wrenches[:, one.body, 3:] += cross(one.point, forces[one.name])
            if one.body >= 0 and frames is not None:
                wrenches[:, one.body, 3:] += cross(self.point_speed(one.name, None, frames), one.wrench[:, :3])
        return np.asarray((self.axes * (self.topology.beyond @ wrenches)).sum(-1))

    def work_slopes(self, twists: FloatArray, each: FloatArray) -> FloatArray:
        """Derivatives of the virtual work by the twist of what is from each joint on, shape (N, n, L, 6), from `twists`."""
        carried = twists @ self._carried
        found: FloatArray = (twists - each) @ _turning(self._beyond)
        found[..., 3:] += (self.topology.beyond @ carried.reshape(*carried.shape[:2], -1)).reshape(carried.shape)
        return found

    def by_loads(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by the wrench at each frame, (N, L, 6), and by gravity, "", (N, L, 3)."""
        found = {one.name: self._speed(one, twists) for one in self._loaded}
        if self._weight is not None:
            masses = self._numbers["masses"][:, :1, None]
            found[""] = (masses * twists[..., :3] + twists[..., 3:] @ self._first).sum(axis=1)
        return found

    def by_masses(self, twists: FloatArray) -> FloatArray | None:
        """Derivatives of the virtual work by mass and first moment of each body, shape (N, n, L, 4); None if weightless."""
        return None if self._weight is None else (twists @ self._weight).take(_MASS_THEN_FIRST, -1)

    def by_frames(self, twists: FloatArray) -> dict[str, FloatArray]:
        """Derivatives of the virtual work by twists of the loaded frames in their joints, shape (N, L, 6)."""
        found = {}
        for one in self._loaded:
            if one.body >= 0:
                force = -twists[:, one.body, :, 3:] @ skew(one.wrench[:, :3])
                found[one.name] = self._in_joint(one.body, np.concatenate([force, -force @ self.frame(one.name)[3]], axis=-1))
        return found

    def at_joints(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by joint positions from those by twists, shape (N, L, n)."""
        return np.swapaxes((by_twist @ self.axes[..., None])[..., 0], 1, 2)

    def at_placements(self, by_twist: FloatArray) -> FloatArray:
        """Derivatives by twists of the placements of joints in the frames before them, shape (N, n, L, 6), from the same."""
        return self._in_joint(self.topology.parents, by_twist)

    def _in_joint(self, joints: Any, wrenches: FloatArray) -> FloatArray:
        """Wrenches at the origin, shape (N, ..., L, 6), seen from joints, shape (...)."""
        return np.asarray(wrenches @ self._to_world.take(joints, 1))

    def _speed(self, one: _Loaded, twists: FloatArray) -> FloatArray:
        """Velocity and turn of a loaded frame, shape (N, L, 6)."""
        speed: FloatArray = twists[:, one.body].copy() if one.body >= 0 else np.zeros((len(twists), *twists.shape[2:]))
        speed[..., :3] += speed[..., 3:] @ self.frame(one.name)[3]
        return speed


def _turning(wrenches: FloatArray) -> FloatArray:
    r"""Matrices, shape (..., 6, 6), from the right: twists to the derivatives of the work of the wrenches `(F, N)` by `(d, a)`.

    They take `(v, omega)` to :math:`(F \times \omega, F \times v + N \times \omega)`.
    """
    return np.asarray(wrenches.reshape(-1, 6).dot(_TURNING).reshape(*wrenches.shape, 6))


def _placed(tree: Topology, joints: FloatArray) -> FloatArray:
    """Placement of each joint, and of the base, in the world, shape (N, n + 1, 4, 4)."""
    q = joints.T
    motion: FloatArray = np.ones((*q.shape, 4))
    motion[..., 1], motion[..., 3] = np.sin(q), q
    motion[..., 2] -= np.cos(q)
    own = (motion @ tree.motions).reshape(*q.shape, 4, 4)
    placed = np.zeros((len(q) + 1, q.shape[1], 4, 4))
    placed[-1] = np.eye(4)
    for joint, before in enumerate(tree.parents):
        np.matmul(placed[before], own[joint], out=placed[joint])
    return placed.swapaxes(0, 1)


def _placed_alone(model: SoftModel, joints: FloatArray) -> FloatArray:
    """The same of a single state, by Pinocchio: several times faster than joint by joint in NumPy."""
    rigid, data = model.workspace(None)
    pin.forwardKinematics(rigid, data, model.embed(joints))
    base, *others = data.oMi.tolist()
    return np.array([[one.homogeneous for one in (*others, base)]])
