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
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.elastic_state import ElasticState, elastic_state, largest_residual
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import Load

TOLERANCE = 1e-12
"""Largest residual of a point, relative to the scale of the load."""

_NEWTON_STEPS = 15
_GAP = 1e-12  # tolerance of a constraint [rad]
_LONGEST = 1.0  # Newton step [rad]
_SHORTEST = 1e-5  # step along a path [rad]
_BEHIND = 1e-3  # first step along a path behind a knee [rad]
_TURN = 0.95  # least cosine between the directions of two steps
_MOST_POINTS = 2000


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
        check_model(model)
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

    def tangent(self, point: PathPoint) -> FloatArray:
        """Return the direction of the path under growing force at a point of regular tangent stiffness."""
        return np.append(self.force * np.linalg.solve(point.state.tangent, point.push), 1.0)

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
            if balanced and np.abs(gap).max() <= _GAP:
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

    def follow(
        self, first: list[PathPoint], way: FloatArray, largest_force: float, largest_step: float
    ) -> tuple[list[PathPoint], str]:
        """Follow the path from its first points.

        Args:
            first: One point, or more.
            way: Direction of the path at the last of them, shape (n_springs + 1,).
            largest_force: Force at which the path ends [N].
            largest_step: Largest distance between two points [rad].

        Returns:
            All points; and why the path ends: "largest force", "zero force", "end of range", "points" or "lost".
        """
        points, step, way = list(first), largest_step, way / np.linalg.norm(way)
        knee = 0  # number of points at the last knee
        while len(points) < _MOST_POINTS:
            here = self.place(points[-1])
            there = self.newton(here + step * way, way[None], np.array([way @ here + step]))
            moved = np.zeros_like(way) if there is None else self.place(there) - here
            if there is None or not way @ moved >= _TURN * np.linalg.norm(moved):
                step *= 0.5
                if step < _SHORTEST:
                    turned = None if knee == len(points) else self._behind_knee(points[-2:], way)
                    if turned is not None:
                        knee, way, step = len(points), turned, _BEHIND
                        continue
                    ends = self.model.structure.at_range_end(self.motors, points[-1].springs)
                    return points, "end of range" if ends else "lost"
                continue
            if not 0.0 <= there.force <= largest_force:
                limit, ended = (largest_force, "largest force") if there.force > largest_force else (0.0, "zero force")
                aim = limit / self.force - 1.0
                share = (aim - here[-1]) / moved[-1]
                last = self.newton(here + share * moved, np.eye(len(way))[-1:], np.array([aim]))
                return points if last is None else [*points, last], ended
            points.append(there)
            way, step = moved / np.linalg.norm(moved), min(1.5 * step, largest_step)
        return points, "points"

    def _behind_knee(self, last: list[PathPoint], way: FloatArray) -> FloatArray | None:
        """Direction of the path behind the knee of a link, at either end of its plateau; None if there is no knee.

        The tangent stiffness jumps there. The direction is in the null space behind the knee, with the link bending on as
        before.
        """
        here, law = last[-1], self.model.springs
        beyond = here.springs + 10.0 * _SHORTEST * way[:-1]
        places = sorted(law.saturated(last[0].springs) ^ law.saturated(beyond))
        ahead = self.point(beyond, here.force)
        if not places or not math.isfinite(ahead.state.error):
            return None
        turned = np.linalg.svd(np.column_stack([ahead.state.tangent, -self.force * ahead.push]))[2][-1]
        bend = (here.springs - law.rest)[places]
        same = float(bend @ way[places]) * float(bend @ turned[places])
        return np.asarray(math.copysign(1.0, same) * turned)
