"""The cores of a robot's capsules, and where they are in a configuration."""

from __future__ import annotations

import threading
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.vectors import skew
from softrobots.environment.capsules import RobotCapsule, robot_capsules
from softrobots.model.joint_loads import JointLoad
from softrobots.model.soft_model import SoftModel, check_model

SAME_POINT = 1e-9
"""Distance, relative to the reach, within which points are one."""


class CorePlaces:
    """Cores in a configuration, world axes."""

    def __init__(self, cores: Cores, q: FloatArray, jacobian: FloatArray, points: list[Any]) -> None:
        """Take the cores, Pinocchio's configuration, and what is known there."""
        self._cores, self._q = cores, q
        self.jacobian = jacobian
        """Velocity of the point of a body at the world's origin, then angular, per joint rate, shape (6, nv)."""
        self.points = points
        """The different ends in plain numbers [m]."""

    @cached_property
    def single_ends(self) -> FloatArray:
        """The different ends, shape (k, 3) [m]."""
        return np.array(self.points).reshape(-1, 3)

    @cached_property
    def ends(self) -> FloatArray:
        """Start and end of each core, shape (n, 2, 3) [m]."""
        return self.single_ends.take(self._cores.end_numbers, 0)

    @cached_property
    def placements(self) -> FloatArray:
        """Transforms of the joints that carry capsules to the world, shape (k, 4, 4)."""
        return self._cores.placements(self._q)

    def span(self, capsule: int) -> Any:
        """From start to end of a core in plain numbers [m]."""
        start, end = (self.points[number] for number in self._cores.plain[capsule][0])
        return end[0] - start[0], end[1] - start[1], end[2] - start[2]

    @property
    def spans(self) -> FloatArray:
        """From start to end of each core, shape (n, 3) [m]."""
        return np.asarray(self.ends[:, 1] - self.ends[:, 0])


class Cores:
    """The capsules of a robot that its joints move; belongs to the thread that created it."""

    def __init__(self, model: SoftModel, capsules: tuple[RobotCapsule, ...]) -> None:
        """Take the capsules; those that never move are left out, because no equilibrium changes what they touch."""
        self.capsules = tuple(one for one in capsules if one.joint > 0)
        self.count = len(self.capsules)
        self.plain_radii = [one.radius for one in self.capsules]
        self.radii = np.array(self.plain_radii)
        self.joints = np.array([one.joint for one in self.capsules], dtype=np.intp)
        self.lengths = np.array([float(np.linalg.norm(one.end - one.start)) for one in self.capsules])
        self.ways = 2.0 * self.radii + self.lengths
        """Sum of the distances of both ends from what touches a capsule, at most, shape (n,) [m]."""
        self._model, self._data = model.workspace(None)
        moved, self.carrier = np.unique(self.joints, return_inverse=True)
        self._joints = [self._data.oMi[number] for number in moved.tolist()]  # references, which follow the robot
        carriers = zip(self.carrier.tolist(), self.capsules, strict=True)
        self._ends = [(self._joints[place], end) for place, one in carriers for end in (one.start, one.end)]
        nothing = read_only(np.zeros((0, self._model.nv)))
        self.no_load = JointLoad(read_only(np.zeros(self._model.nv)), nothing, nothing, None, None, 0.0, 0.0)
        """No load on the joints."""
        self.moves = self._motion()
        """1 where a joint coordinate moves a capsule, else 0, shape (n, nv)."""
        self.end_numbers = np.arange(2 * self.count).reshape(-1, 2)
        self.single_ends, numbers, moving = self._single_ends(model)
        """The different ones of all ends (start and end of the first core, of the second, ...): neighbours share joints."""
        self.end_capsules, self.end_features = self.single_ends // 2, self.single_ends % 2
        """Capsule of each of them, and whether it is the start (0) or the end (1) of its core."""
        self._ends = [self._ends[number] for number in self.single_ends.tolist()]
        self.end_numbers = numbers.reshape(-1, 2)
        """Place of start and end of each core among the different ends, shape (n, 2)."""
        self.counted = self.single_ends.take(self.end_numbers) == np.arange(2 * self.count).reshape(-1, 2)
        """Whether each end is the first of those that are the same, shape (n, 2)."""
        self.at_base, self.bases = self._at_base(moving[self.single_ends])
        """Different ends at the base, with an end within their radius that no joint moves, and that end, both of shape (k,)."""
        self.base_radii = self.radii[self.end_capsules[self.bases]][:, None]
        """Radii of the latter, shape (k, 1) [m]."""
        bases = zip(self.bases.tolist(), self.base_radii[:, 0].tolist(), strict=True)
        self.base_of = dict(zip(self.at_base.tolist(), bases, strict=True))
        """The same by number: that end, and its radius."""
        lists = (self.end_numbers.tolist(), self.counted.tolist(), self.radii.tolist(), self.lengths.tolist())
        self.plain = list(zip(*lists, strict=True))
        """Ends, whether each is counted, radius and length [m] of each core, in plain numbers."""
        ends = self.end_capsules, self.end_features, self.radii.take(self.end_capsules)
        self.plain_ends = list(zip(*(column.tolist() for column in ends), strict=True))
        """Capsule, feature and radius [m] of each different end, in plain numbers."""
        self.fixed = np.flatnonzero(~moving[self.single_ends])
        """Different ends that no joint moves, shape (j,); none on a body beside the chain."""
        self.fixed_points = self.at(pin.neutral(self._model)).single_ends[self.fixed]
        """Where they are, shape (j, 3) [m]."""

    def at(self, q: FloatArray) -> CorePlaces:
        """Return the cores at Pinocchio's configuration, shape (nq,)."""
        jacobian = pin.computeJointJacobians(self._model, self._data, q).reshape(6, self._model.nv)  # a copy
        return CorePlaces(self, q, jacobian, [joint.act(end).tolist() for joint, end in self._ends])

    def placements(self, q: FloatArray) -> FloatArray:
        """Return the transforms of the joints that carry capsules to the world, shape (k, 4, 4)."""
        pin.forwardKinematics(self._model, self._data, q)
        return np.array([joint.homogeneous for joint in self._joints]).reshape(-1, 4, 4)

    def _motion(self) -> FloatArray:
        joints = self._model.joints
        moves = np.zeros((self.count, self._model.nv))
        for row, joint in zip(moves, self.joints.tolist(), strict=True):
            for number in list(self._model.supports[joint])[1:]:
                row[joints[number].idx_v : joints[number].idx_v + joints[number].nv] = 1.0
        return moves

    def _single_ends(self, model: SoftModel) -> tuple[Any, Any, Any]:
        """Ends of equal radius that are one material point: at one place, and of one velocity, in two configurations.

        Then the number of each end among them, and whether an end has a velocity in one of the configurations.
        """
        random = np.random.default_rng(0)
        same: Any = True
        moving = np.zeros(2 * self.count, dtype=bool)
        for _ in range(2):
            q = pin.integrate(self._model, pin.neutral(self._model), random.uniform(-0.5, 0.5, self._model.nv))
            places = self.at(q)
            points = places.ends.reshape(-1, 3)
            moves = np.repeat(self.moves, 2, axis=0)
            speeds = (places.jacobian[:3] - skew(points) @ places.jacobian[3:]) * moves[:, None, :]
            moving |= np.abs(speeds).max(axis=(1, 2), initial=0.0) > SAME_POINT * max(model.reach, 1.0)
            apart = np.linalg.norm(points[:, None] - points, axis=2)
            same = same & (apart <= SAME_POINT * model.reach)
            for i, j in np.argwhere(np.triu(same, 1)).tolist():
                change = places.jacobian * (moves[i] - moves[j])
                speed = change[:3] + np.cross(change[3:], points[i], axisa=0, axisc=0)
                same[i, j] = same[j, i] = bool(np.abs(speed).max(initial=0.0) <= SAME_POINT * max(model.reach, 1.0))
        radii = np.repeat(self.radii, 2)
        same = same & (radii[:, None] == radii)
        first = same.argmax(axis=1) if self.count else np.zeros(0, dtype=np.intp)
        return *np.unique(first, return_inverse=True), moving

    def _at_base(self, moving: Any) -> tuple[Any, Any]:
        points = self.at(pin.neutral(self._model)).single_ends
        still = np.flatnonzero(~moving)
        if not len(still):  # of a body beside the chain: the end beside the first joint, which nearly stays
            beside = np.linalg.norm(points - self._model.jointPlacements[1].translation, axis=1)
            still = np.flatnonzero(
                (beside <= (1.0 + SAME_POINT) * self.radii[self.end_capsules]) & (beside == beside.min(initial=np.inf))
            )
        if not len(still):
            return still, still
        apart = np.linalg.norm(points[:, None] - points[still], axis=2)
        near = np.flatnonzero(apart.min(axis=1) <= self.radii[self.end_capsules])
        return near, still[apart[near].argmin(axis=1)]


class Known(threading.local):
    """What the calling thread has made for the models that it has used."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.by_model: WeakKeyDictionary[SoftModel, Any] = WeakKeyDictionary()


_KNOWN = Known()


def cores_of(model: SoftModel) -> Cores:
    """Return the cores of a robot, made on first use in each thread.

    Raises:
        ParameterError: If `model` is not a `SoftModel`.
        DescriptionError: If the robot has no capsules, and no collision shapes that are spheres or cylinders.
    """
    if check_model(model) not in _KNOWN.by_model:
        _KNOWN.by_model[model] = Cores(model, robot_capsules(model))
    return _KNOWN.by_model[model]  # type: ignore[no-any-return]
