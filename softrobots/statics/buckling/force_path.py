r"""Paths of equilibria under a force of variable size: points, Newton with constraints, and pseudo-arclength continuation.

Springs `y` and force `F` are the unknowns of :math:`r(y) - F J^T d = 0`, so that a path can be followed where the force falls.
Places on it are relative to a reference point, `(y - y_c, F / F_c - 1)`: a change of the force by `F_c` counts as a radian.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, unit_vector
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.knees import knees_between
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticState, elastic_state, largest_residual, scaled
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import Load

TOLERANCE = 1e-12
"""Largest residual of a point, relative to the scale of the load."""

ZERO_EIGENVALUE = 1e-7
"""Eigenvalue, relative to the springs' own stiffness, up to which it counts as zero."""

_NEWTON_STEPS = 15
_GAP = 1e-12  # tolerance of a constraint [rad]
_LONGEST = 1.0  # Newton step [rad]
_SHORTEST = 1e-5  # step along a path [rad]
_SHORTEST_STABLE = 1e-10  # step on the way to the loss of stability, or where a wall goes slack [rad]
_OVER = 2.0 * _SHORTEST  # distance that leads over a knee, so that a path does not turn back before it [rad]
_BEHIND = 1e-3  # first step along a path behind a knee [rad]
_TURN = 0.95  # least cosine between the directions of two steps
_MOST_POINTS = 2000
_NEARLY_ZERO = 1e-2  # an eigenvalue this small, relative to the first, may vanish in the next step


class PathPoint(NamedTuple):
    """A point of a path."""

    state: ElasticState
    """The robot there."""
    force: float
    """The force [N]."""
    push: FloatArray
    """Derivative of the elastic loads with respect to it, shape (n_springs,) [m]."""
    across: float = 0.0
    """Torque that keeps the robot in a direction, if one is given [N m]."""

    @property
    def springs(self) -> FloatArray:
        """Elastic coordinates, shape (n_springs,) [rad or m]."""
        return self.state.q_springs


class Crossing(NamedTuple):
    """Two points of a path between which another path crosses it, and how many eigenvalues change their sign there."""

    before: PathPoint
    after: PathPoint
    modes: int


class FollowedPath(NamedTuple):
    """A part of a path."""

    points: list[PathPoint]
    """Its points, in order."""
    crossings: list[Crossing]
    """Where other paths cross it, or its stability jumps at a plateau."""
    ended: str
    """Why it ends, as of `EquilibriumBranch`, or "unstable"."""


@dataclass(frozen=True, eq=False)
class ForcePath:
    """The path of a robot under one direction of the force."""

    model: SoftModel
    """The robot."""
    motors: FloatArray
    """Actuator coordinates, shape (n_motors,)."""
    constant: Load
    """The load without the force."""
    frame: str
    """Frame at which the force acts."""
    unit: FloatArray
    """Its direction, shape (3,)."""
    springs: FloatArray
    """Springs of the reference point, shape (n_springs,) [rad or m]."""
    force: float
    """Force of the reference point, above zero [N]."""

    @classmethod
    def of(cls, model: SoftModel, q_motors: Any, direction: Any, *, frame: str | None, gravity: Any) -> ForcePath:
        """Check the arguments of `critical_load`; the reference point is the relaxed robot and 1 N."""
        check_frictionless(model, "branches and critical loads")
        motors, unit = model.checked_motors(q_motors), unit_vector("direction", direction)
        constant = Load.of(model, frame=frame, gravity=gravity)
        return cls(model, motors, constant, model.tip if frame is None else frame, unit, model.rest, 1.0)

    def load(self, force: float) -> Load:
        """Return the load with a force [N]."""
        return self.constant.plus(self.frame, np.concatenate([force * self.unit, np.zeros(3)]))

    def point(self, springs: FloatArray, force: float) -> PathPoint:
        """Evaluate at springs, shape (n_springs,), and a force [N]."""
        state = elastic_state(self.model, self.motors, springs, self.load(force))
        if not math.isfinite(state.error):
            return PathPoint(state, force, np.zeros(len(springs)))
        columns = state.point.columns(frame_jacobian(self.model, state.q, self.frame)[:3])[1]
        return PathPoint(state, force, self.unit @ columns)

    def place(self, point: PathPoint) -> FloatArray:
        """Return the place of a point relative to the reference point, shape (n_springs + 1,)."""
        return np.append(point.springs - self.springs, point.force / self.force - 1.0)

    def at(self, place: FloatArray) -> PathPoint:
        """Evaluate the robot at a place, in equilibrium or not."""
        return self.point(self.springs + place[:-1], self.force * (1.0 + float(place[-1])))

    def direction(self, point: PathPoint, along: FloatArray | None = None) -> FloatArray:
        """Return the unit direction at a point, shape (n_springs + 1,), in the sense of another one, by default growing force.

        Where the path is singular, that sense itself.
        """
        force = np.eye(len(self.springs) + 1)[-1]
        sense = force if along is None else along
        matrix = np.vstack([np.column_stack([point.state.tangent, -self.force * point.push]), sense])
        try:
            way = np.linalg.solve(matrix, force)
        except np.linalg.LinAlgError:
            return sense
        return np.asarray(way / np.linalg.norm(way))

    def newton(
        self, start: FloatArray, rows: FloatArray, aims: FloatArray, across: FloatArray | None = None
    ) -> PathPoint | None:
        """Newton for springs and force, and for torques along `across`.

        Args:
            start: Place to start from, shape (n_springs + 1,).
            rows: Constraints on the place, shape (1 + m, n_springs + 1).
            aims: Required value of rows times place, shape (1 + m,).
            across: Directions in which torques keep the robot, shape (m, n_springs); none by default.

        Returns:
            The point; None if Newton does not converge.
        """
        n, guides = len(self.springs), np.zeros((0, len(self.springs))) if across is None else across
        here, torques = self.at(start), np.zeros(len(guides))
        for _ in range(_NEWTON_STEPS):
            if not math.isfinite(here.state.error):
                return None
            residual, gap = here.state.residual + torques @ guides, aims - rows @ self.place(here)
            balanced = np.linalg.norm(residual) <= largest_residual(self.model, here.state.scale, TOLERANCE)
            if balanced and np.abs(gap).max() <= _GAP * max(1.0, here.force / self.force):
                return here._replace(across=float(torques[0]) if len(torques) else 0.0)
            equilibrium = [here.state.tangent, -self.force * here.push[:, None], guides.T]
            matrix = np.block([equilibrium, [rows, np.zeros((len(rows), len(guides)))]])
            try:
                step = np.linalg.solve(matrix, np.concatenate([-residual, gap]))
            except np.linalg.LinAlgError:
                return None
            if not float(np.linalg.norm(step[: n + 1])) <= _LONGEST:
                return None
            torques = torques + step[n + 1 :]
            here = self.at(self.place(here) + step[: n + 1])
        return None

    def eigenvalues(self, point: PathPoint) -> FloatArray:
        """Return the eigenvalues of the tangent stiffness, relative to the springs' own stiffness, ascending."""
        return np.asarray(np.linalg.eigvalsh(scaled(point.state.tangent, self.model.stiffness)))

    def follow(
        self,
        first: list[PathPoint],
        way: FloatArray,
        largest_force: float,
        largest_step: float,
        *,
        growth: float = 0.0,
        while_stable: bool = False,
    ) -> FollowedPath:
        """Follow the path from its first points.

        Between two points of one regular path the number of negative eigenvalues changes by one where the force turns, and
        nowhere else. Steps are halved until that holds, so that they do not jump to another path nearby; where it does not
        hold between the nearest points, paths cross.

        Args:
            first: One point, or more.
            way: Direction of the path at the last of them, shape (n_springs + 1,).
            largest_force: Force at which the path ends [N].
            largest_step: Largest distance between two points [rad].
            growth: Force that a step may add, relative to the force reached, beyond `largest_step`.
            while_stable: End at the first point with a negative eigenvalue.
        """
        points, step, way = list(first), largest_step, way / np.linalg.norm(way)
        crossings: list[Crossing] = []
        shortest = _SHORTEST_STABLE if while_stable or any(one.slack_wall for one in self.model.spring_groups) else _SHORTEST
        n_stable, knee, over = len(points), 0, 0.0 * way  # numbers of points at the last stable one and knee; a way over that
        before = 0.0  # the step before it was halved at a crossing
        values, tangent = self.eigenvalues(points[-1]), way
        nearly_zero = _NEARLY_ZERO * abs(values[0])
        while len(points) < _MOST_POINTS:
            last = points[-1]
            here, least = self.place(last) + (knee == len(points)) * over, shortest * max(1.0, last.force / self.force)
            with np.errstate(divide="ignore", invalid="ignore"):
                longest = np.divide((largest_step, growth * last.force / self.force), (np.linalg.norm(way[:-1]), abs(way[-1])))
            step = min(step, max(largest_step, float(longest.min())))
            there = self.newton(here + step * way, way[None], np.array([way @ here + step]))
            moved = np.zeros_like(way) if there is None else self.place(there) - here
            if there is None or not way @ moved >= _TURN * np.linalg.norm(moved):
                step *= 0.5
                if step < least:
                    turned = None if knee == len(points) else self._behind_knee(points[-2:], way)
                    if turned is not None:
                        knee, over, way, step = len(points), _OVER * way, turned, _BEHIND
                        continue
                    ends = self.model.structure.at_range_end(self.motors, last.springs)
                    return FollowedPath(points, crossings, "end of range" if ends else "lost")
                continue
            secant, new_values = moved / np.linalg.norm(moved), self.eigenvalues(there)
            new_tangent = secant if np.abs(new_values).min() <= ZERO_EIGENVALUE else self.direction(there, secant)
            changed = abs(int((new_values < -ZERO_EIGENVALUE).sum() - (values < -ZERO_EIGENVALUE).sum()))
            regular = knee == len(points) or changed == (new_tangent[-1] * tangent[-1] < 0.0)
            falls = while_stable and knee < len(points) and nearly_zero < values[0] and new_values[0] < 0.5 * values[0]
            if step > least and (falls or not regular):
                before, step = max(before, step), 0.5 * step
                continue
            if not 0.0 <= there.force <= largest_force:
                limit, ended = (largest_force, "largest force") if there.force > largest_force else (0.0, "zero force")
                return FollowedPath([*points, *self._at_force(limit, here, moved)], crossings, ended)
            if not regular:
                crossings.append(Crossing(last, there, changed))
                step, before = max(before, step), 0.0
            points.append(there)
            values, tangent = new_values, new_tangent
            way, step = tangent if regular else secant, 1.5 * step
            n_stable = len(points) if values[0] > 0.0 else n_stable
            if while_stable and values[0] < -ZERO_EIGENVALUE:
                return FollowedPath([*points[:n_stable], there], crossings, "unstable")
        return FollowedPath(points, crossings, "points")

    def before_change(self, here: PathPoint, there: PathPoint, level: float = 0.0) -> PathPoint:
        """Bisect, down to rounding, the last point between two that has as many eigenvalues up to a level as the first."""
        start, below = self.place(here), int((self.eigenvalues(here) <= level).sum())
        way = self.place(there) - start
        low, high, found = 0.0, 1.0, here
        while low < 0.5 * (low + high) < high:
            middle = 0.5 * (low + high)
            point = self.newton(start + middle * way, way[None], np.array([way @ start + middle * (way @ way)]))
            # Where it is stable, the force rises along a path.
            rises = point is not None and (below > 0 or point.force >= found.force)
            if point is not None and rises and (self.eigenvalues(point) <= level).sum() == below:
                low, found = middle, point
            else:
                high = middle
        return found

    def passes(self, points: list[PathPoint], other: PathPoint) -> bool:
        """Whether the path goes through another point between some of its points, in order."""
        if len(points) < 2:
            return False
        places, aim = np.array([self.place(point) for point in points]), self.place(other)
        ways = np.diff(places, axis=0)
        shares = ((aim - places[:-1]) * ways).sum(axis=1) / (ways**2).sum(axis=1)
        nearest = places[:-1] + np.clip(shares, 0.0, 1.0)[:, None] * ways
        k = int(np.argmin(np.linalg.norm(nearest - aim, axis=1)))
        way = ways[k] / np.linalg.norm(ways[k])
        if not -0.1 < shares[k] < 1.1 or not abs(self.direction(other, way) @ way) >= _TURN:
            return False  # beyond its ends (points lie on arcs, not on their chords), or on a path that crosses it
        there = self.newton(nearest[k], way[None], np.array([way @ aim]))
        return there is not None and bool(np.linalg.norm(self.place(there) - aim) <= _SHORTEST)

    def _at_force(self, force: float, here: FloatArray, moved: FloatArray) -> list[PathPoint]:
        """The point of a force between a place and the next one; none if Newton does not converge."""
        aim = force / self.force - 1.0
        point = self.newton(here + (aim - here[-1]) / moved[-1] * moved, np.eye(len(here))[-1:], np.array([aim]))
        return [] if point is None else [point]

    def _behind_knee(self, last: list[PathPoint], way: FloatArray) -> FloatArray | None:
        """Direction of the path behind the knee of a link or a tendon (`softrobots.model.knees`); None if there is no knee.

        The tangent stiffness jumps there. The direction is in the null space behind the knee, with the link or the tendon
        going on as before.
        """
        here = last[-1]
        beyond = here.springs + _OVER * way[:-1]
        rows = knees_between(self.model, self.motors, last[0].springs, beyond)
        ahead = self.point(beyond, here.force)
        if not len(rows) or not math.isfinite(ahead.state.error):
            return None
        turned = np.linalg.svd(np.column_stack([ahead.state.tangent, -self.force * ahead.push]))[2][-1]
        return np.asarray(math.copysign(1.0, (rows @ way[:-1]) @ (rows @ turned[:-1])) * turned)
