r"""Gaps between a robot and its surroundings, with first and second derivatives by the joints.

A capsule of the robot is a core, the segment :math:`x(s) = p + s\,t`, and a radius `r`. A candidate of contact is a material
point of the core with gap :math:`g = \phi(x) - r`, where `phi` is the signed distance from the obstacle; with velocity `u` of
that point and :math:`n = \nabla \phi`, `H` the Hessian of `phi`,

.. math:: \delta g = n^T u, \qquad
    \delta^2 g = n^T \delta^2 x + u^T H u - \frac{(u^T H t + n^T \delta t)^2}{t^T H t}

the last term where the point is the nearest of the core and moves along it (the envelope theorem); not at ends and borders.
Each pair has several candidates: ends, the minimum between them, and points where the core crosses borders between features of
the obstacle (edges, rims), which hold a core that lies flat, where the nearest point is not unique. `theory.md`, "Contact".
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross, skew
from softrobots.environment.candidates import INSIDE, Candidates, find_candidates
from softrobots.environment.cores import SAME_POINT, CorePlaces, Cores, cores_of
from softrobots.environment.environment import Environment, check_environment
from softrobots.environment.obstacle_fields import obstacle_fields, obstacle_transforms
from softrobots.environment.self_contact import relative_curvature, self_contact_pairs
from softrobots.environment.single_bodies import Triple, inner, times
from softrobots.model.joint_loads import JointLoad
from softrobots.model.soft_model import SoftModel

_KEPT = 8  # configurations whose candidates are kept: other loads and other forces start at the same one
_TURNS = tuple(np.eye(3, 6, 3).ravel().tolist())  # rows of the angular velocity


class MaterialPoints(NamedTuple):
    """Points of the two surfaces at candidates, each in the axes of what it moves with; friction follows them."""

    capsules: Any
    """Capsule of each, shape (m,), integers."""
    obstacles: Any
    """Obstacle of each, shape (m,), integers."""
    on_robot: FloatArray
    """Point of the robot in the axes of its joint, shape (m, 3) [m]."""
    on_obstacle: FloatArray
    """Point of the obstacle in its own axes, shape (m, 3) [m]."""


class Gaps(Candidates):
    """Candidates of contact at one configuration; rows are candidates, in no order of size."""

    def __init__(
        self, cores: Cores, places: CorePlaces, found: Candidates, transforms: FloatArray, reach: float, own: bool
    ) -> None:
        """Take candidates, transforms of obstacles to the world, shape (n, 4, 4), reach [m]; may the robot touch itself?"""
        super().__init__(found.parts, *found.given)
        self._cores, self.places, self.reach = cores, places, reach
        self.transforms, self.capsule_radii = transforms, cores.radii
        """Transforms of the obstacles to the world, shape (n, 4, 4); and radii of all capsules, shape (k,) [m]."""
        self.with_itself = own
        """Whether the robot may touch itself."""
        self.keys = self.keys_of_all()
        """Capsule, obstacle and feature of each candidate: what stays the same from one configuration to the next. Numbers of
        obstacles beyond the last are capsules of the robot itself: the number less that of obstacles."""
        _, points, distances, normals = found.given
        if self.few:
            capsules, radii = [key[0] for key in self.keys], cores.plain_radii
            values = np.array([one - radii[capsule] for one, capsule in zip(distances, capsules, strict=True)])
            wrenches = np.array([(*n, *times(p, n)) for p, n in zip(points, normals, strict=True)]).reshape(-1, 6)
        else:
            capsules, values = self.capsules, distances - self.radii
            wrenches = np.concatenate([normals, cross(points, normals)], axis=1)
        self.values: FloatArray = values
        """Signed gaps, shape (m,) [m]; negative where the surfaces penetrate."""
        self.moves: FloatArray = cores.moves.take(capsules, 0)
        """1 where a joint coordinate moves the capsule of a candidate, else 0, shape (m, nv).

        Where the robot touches itself, less that of the other capsule."""
        if own:
            rows = (self.obstacles >= len(transforms)).nonzero()[0]
            self.moves[rows] -= cores.moves[self.obstacles[rows] - len(transforms)]
        self.jacobian: FloatArray = wrenches.dot(places.jacobian) * self.moves
        """Derivatives of the gaps by the joint coordinates, `n^T J` at the points of the cores, shape (m, nv)."""

    def __len__(self) -> int:
        """Number of candidates."""
        return len(self.values)

    @property
    def radii(self) -> FloatArray:
        """Radii of the capsules, shape (m,) [m]."""
        return np.asarray(self._cores.radii.take(self.capsules))

    @property
    def points(self) -> FloatArray:
        """Nearest points on the robot's surface, shape (m, 3) [m]."""
        return np.asarray(self.core_points - self.radii[:, None] * self.normals)

    @property
    def obstacle_points(self) -> FloatArray:
        """Nearest points on the obstacles, shape (m, 3) [m]."""
        return np.asarray(self.core_points - self.distances[:, None] * self.normals)

    def point_jacobian(self, rows: Any, points: FloatArray) -> FloatArray:
        """Velocity of material points of the robot per joint rate; where it touches itself, relative to the other capsule.

        Args:
            rows: Candidates whose capsules carry the points, shape (k,), integers.
            points: The points, world axes, shape (k, 3) [m]: `core_points`, or `points` of the surface.

        Returns:
            Shape (k, 3, nv).
        """
        linear, angular = self.places.jacobian[:3], self.places.jacobian[3:]
        return np.asarray((linear - skew(points) @ angular) * self.moves.take(rows, 0)[:, None, :])

    def load(self, forces: FloatArray) -> JointLoad:
        r"""Return forces on the robot: normal forces, which turn and move as the robot does, or dead ones at material points.

        Args:
            forces: Normal forces at the points of the cores, shape (m,) [N]; or forces of any direction, world axes, at the
                points of the surface, shape (m, 3) [N].

        Returns:
            The load on the joints, without a potential. The derivative of normal forces is :math:`\sum f_i\, d^2 g_i`.
        """
        normal = forces.ndim == 1
        rows = (forces if normal else np.abs(forces).max(axis=1, initial=0.0)).nonzero()[0]
        if not len(rows):
            return self._cores.no_load
        count, values, surface = len(self.transforms), forces.tolist(), None if normal else self.points.tolist()
        loads: list[Any] = []
        angular: list[float] = []  # rows of six, joined
        by_force: list[float] = []
        owners: list[int] = []
        own: list[int] = []
        for row in rows.tolist():
            (capsule, other, _), at = self.keys[row], self.row(row)
            point, _, (a, b, c) = at
            if surface is None:
                force = values[row] * a, values[row] * b, values[row] * c
            else:
                point, force = surface[row], values[row]
            loads.append((capsule, force, point))
            if other >= count:  # the other capsule takes the opposite force
                depth = float(self._cores.radii[other - count]) if normal else 0.0
                point = self.core_points[row] - (self.distances[row] + depth) * self.normals[row]
                loads.append((other - count, [-one for one in force], point.tolist()))
                own.append(row)
            elif normal:
                for wrench, weight in self._curved(row, values[row], at):
                    by_force += wrench
                    angular += [weight * one for one in wrench]
                    owners.append(capsule)
        size = 0.0
        for capsule, v, p in loads:
            (x, y, z), (a, b, c), work = v, p, inner(v, p)
            by_force += (0.0, z, -y, a * x - work, a * y, a * z)  # three rows of -v x (u - p x w)
            by_force += (-z, 0.0, x, b * x, b * y - work, b * z)
            by_force += (y, -x, 0.0, c * x, c * y, c * z - work)
            angular += _TURNS
            owners += (capsule, capsule, capsule)
            size += math.hypot(x, y, z)
        jacobian, moves = self.places.jacobian, self._cores.moves
        products = np.array(angular + by_force).reshape(-1, 6).dot(jacobian)
        factors = products.reshape(2, len(owners), -1) * moves.take(owners, 0)
        if normal:
            torque = forces.dot(self.jacobian)
        else:
            wrenches = np.array([(*v, *times(p, v)) for _, v, p in loads]).dot(jacobian)
            torque = np.add.reduce(wrenches * moves.take([capsule for capsule, _, _ in loads], 0))
        if normal and own:
            factors = np.concatenate([factors, self._curved_by_itself(own, forces)], axis=1)
        return JointLoad(torque, factors[0], factors[1], None, None, 0.0, self.reach * size)

    def _curved(self, row: int, force: float, at: tuple[Triple, float, Triple]) -> list[tuple[Any, float]]:
        r"""What the derivative of a normal force [N] of an obstacle has beside that of a dead one.

        Returns:
            Wrenches, force first, and weights `w` [N/m]: it is :math:`\sum w\,a^T a` with the torques `a` of the wrenches.
        """
        bends = self.bends(row, at)
        if not bends:
            return []
        point, _, normal = at
        found: list[tuple[Any, float]] = [((*way, *times(point, way)), force * weight) for way, weight in bends]
        capsule, _, feature = self.keys[row]
        if feature == INSIDE:
            span = self.places.span(capsule)
            shares = [weight * inner(way, span) for way, weight in bends]
            x, y, z = (sum(share * way[k] for share, (way, _) in zip(shares, bends, strict=True)) for k in range(3))  # H t
            bend = inner((x, y, z), span)
            if bend > 0.0:
                (a, b, c), (d, e, f) = times(point, (x, y, z)), times(span, normal)
                found.append(((x, y, z, a + d, b + e, c + f), -force / bend))
        return found

    def _curved_by_itself(self, rows: Any, forces: FloatArray) -> FloatArray:
        """The same of candidates of the robot with itself, as factors of a derivative, shape (2, k, nv)."""
        found: list[FloatArray] = []
        weights: list[float] = []
        for row in rows:
            capsule, other, feature = self.keys[row]
            pair = capsule, other - len(self.transforms)
            distance = float(self.distances[row] + self._cores.radii[pair[1]])
            point, normal = self.core_points[row], self.normals[row]
            new, each = relative_curvature(self._cores, self.places, pair, point, normal, distance, feature == INSIDE)
            found += new
            weights += [float(forces[row]) * weight for weight in each]
        return np.array([(np.array(found).T * weights).T, found])

    def material(self, rows: Any) -> MaterialPoints:
        """Return the nearest points of the two surfaces at some candidates as points of their materials.

        Args:
            rows: Candidates, shape (k,), integers.

        Returns:
            The points; `places_of` says where they are in another configuration.
        """
        capsules, obstacles = self.capsules[rows], self.obstacles[rows]
        joints = self.places.placements[self._cores.carrier[capsules]]
        on_robot = ((self.points[rows] - joints[:, :3, 3])[:, None, :] @ joints[:, :3, :3])[:, 0]
        others = self._frames(obstacles)
        on_obstacle = ((self.obstacle_points[rows] - others[:, :3, 3])[:, None, :] @ others[:, :3, :3])[:, 0]
        return MaterialPoints(capsules, obstacles, on_robot, on_obstacle)

    def places_of(self, points: MaterialPoints) -> tuple[FloatArray, FloatArray]:
        """Where material points of robot and obstacles are in this configuration, world axes.

        Args:
            points: What `material` returned, here or in another configuration, also with obstacles elsewhere.

        Returns:
            Points of the robot and of the obstacles, shapes (k, 3) [m]. What the one moved relative to the other since then is
            the slip.
        """
        joints, others = self.places.placements[self._cores.carrier[points.capsules]], self._frames(points.obstacles)
        on_robot = (joints[:, :3, :3] @ points.on_robot[:, :, None])[:, :, 0] + joints[:, :3, 3]
        return on_robot, (others[:, :3, :3] @ points.on_obstacle[:, :, None])[:, :, 0] + others[:, :3, 3]

    def _frames(self, obstacles: Any) -> FloatArray:
        """Transforms of obstacles to the world; of capsules of the robot, their joints'."""
        joints = self.places.placements[self._cores.carrier]
        return np.asarray(np.concatenate([self.transforms, joints])[obstacles])


class Surroundings:
    """A robot among obstacles; belongs to the thread that created it."""

    def __init__(self, model: SoftModel, environment: Environment) -> None:
        """Take a robot and fixed obstacles.

        Raises:
            ParameterError: If an obstacle moves (`Environment.at` fixes it), or an argument is of another kind.
            DescriptionError: If the robot has no capsules, and no collision shapes that are spheres or cylinders.
        """
        check_environment(environment)
        self._cores, self._itself = cores_of(model), environment.self_contact
        self._pairs = self_contact_pairs(model, self._cores) if environment.self_contact else None
        self._fields, self._transforms = obstacle_fields(environment), obstacle_transforms(environment)
        self._reach, self._kept = model.reach, lru_cache(maxsize=_KEPT)(self._at)
        self._links = tuple(one.link for one in self._cores.capsules)
        self._names = (*environment.names, *self._links)  # of obstacles, and of capsules, which the robot itself may touch

    def pair(self, gaps: Gaps, place: int) -> tuple[str, str, bool]:
        """Link of a candidate; its obstacle, or other link; and whether that is a link."""
        capsule, other, _ = gaps.keys[place]
        return self.link(capsule), self._names[other], other >= len(self._transforms)

    def link(self, capsule: int) -> str:
        """Link of a capsule."""
        return self._links[capsule]

    def at(self, q: FloatArray, margin: float) -> Gaps:
        """Return the candidates of contact.

        Args:
            q: Pinocchio's configuration, shape (nq,).
            margin: Largest gap of a candidate [m].

        Returns:
            The candidates with their derivatives.
        """
        return self._kept(q.tobytes(), margin)

    def _at(self, configuration: bytes, margin: float) -> Gaps:
        places = self._cores.at(np.frombuffer(configuration))
        found = find_candidates(self._cores, places, self._fields, self._pairs, margin, SAME_POINT * self._reach)
        return Gaps(self._cores, places, found, self._transforms, self._reach, self._itself)
