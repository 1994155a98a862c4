"""Inputs of many compiled simulations at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.batches import batch_rows, unusable, without
from softrobots.compiled.run.motion_course import SpringKicks, forces_of_steps, motors_of_steps
from softrobots.compiled.run.results import EquilibriumBatch, MotionBatch
from softrobots.core.checks import FloatArray
from softrobots.dynamics.time_grid import SAME_TIME, merged_times
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel
from softrobots.statics.trajectory import Trajectory


class MotionCases:
    """Motors, forces and starts of many cases; each has one row a case, or one for all."""

    def __init__(self, model: SoftModel, actuation: Actuation, end: float, q_motors: Any, forces: Any, starts: Any) -> None:
        """Check the inputs of `CompiledDynamics.simulations`.

        Raises:
            ParameterError: If a shape differs, the numbers of cases differ, or a path or a table is wrong.
        """
        if isinstance(starts, MotionBatch):
            starts = starts.q_springs[:, -1], starts.velocities[:, -1]
        springs, rates = starts if isinstance(starts, tuple) and len(starts) == 2 else (starts, None)
        springs = springs.q_springs if isinstance(springs, EquilibriumBatch) else springs
        self._end, self._apart = end, SAME_TIME * end
        self._paths = [MotorPath(model, one, end) for one in _moving(q_motors)]
        self._loads = [TimeLoad(model, one, None, end) for one in _moving(forces)]
        motors = model.relaxed_motors if self._paths else model.actuators.in_order(q_motors, "q_motors")
        arrays = {
            "q_motors": (motors, model.n_motors),
            "forces": (np.zeros(3) if self._loads or forces is None else forces, 3),
            "starts": (model.rest if springs is None else springs, model.n_springs),
            "velocities": (np.zeros(model.n_springs) if rates is None else rates, model.n_springs),
        }
        for name, moving in (("q_motors", self._paths), ("forces", self._loads)):
            if len(moving) > 1:
                arrays[name] = np.tile(arrays[name][0], (len(moving), 1)), arrays[name][1]
        motors, pushes, springs, rates = batch_rows(**arrays)
        self.count = len(motors)
        """Number of cases."""
        self.bad = unusable(motors, pushes, springs, rates) | actuation.unsuited(motors)
        """Mask of the cases with numbers that cannot be computed with, shape (n,)."""
        self._motors, self._forces = without(motors, self.bad, model.relaxed_motors), without(pushes, self.bad)
        self.state = without(springs, self.bad, model.rest), without(rates, self.bad)
        """Elastic coordinates and rates at the start, each shape (n, n_springs)."""

    @property
    def breaks(self) -> list[FloatArray]:
        """Times at which velocities of motors jump, and then jumps and kinks of motors and of forces, each shape (n,) [s]."""
        return [self.kicks, *(one.breaks for one in self._paths), *(one.breaks for one in self._loads)]

    @property
    def stand_still(self) -> bool:
        """Whether neither motors nor forces change."""
        return not self._paths and not self._loads

    @property
    def kicks(self) -> FloatArray:
        """Times at which velocities of motors of any case jump, shape (n,) [s]."""
        return merged_times(self._apart, self._end, *(path.kick_times for path in self._paths))[1:-1]

    def kick(self, spring_kicks: SpringKicks, time: float, rows: slice, unknowns: FloatArray, rates: FloatArray) -> None:
        """Let the rates of some cases, shape (n, N), jump where velocities of their motors do."""
        for place, case in enumerate(range(self.count)[rows] if self._paths else ()):
            path = self._paths[min(case, len(self._paths) - 1)]
            changes = [change for at, change in path.kicks.items() if abs(at - time) <= self._apart]
            if changes and np.all(np.isfinite(unknowns[place])):
                rates[place] += spring_kicks.at(path(time), unknowns[place], changes[0])

    def motors(self, grid: FloatArray, rows: slice) -> FloatArray:
        """Return the motors of some cases, shape (n or 1, 2 n_steps + 1 or 1, n_motors); see `motors_of_steps`."""
        return _stacked([motors_of_steps(path, grid) for path in _some(self._paths, rows)], self._motors[rows])

    def forces(self, grid: FloatArray, rows: slice) -> FloatArray:
        """Return the forces of some cases, shape (n or 1, n_steps or 1, 3) [N]; see `forces_of_steps`."""
        return _stacked([forces_of_steps(load, grid) for load in _some(self._loads, rows)], self._forces[rows])


def _moving(given: Any) -> list[Any]:
    """Return what changes over time: one for all cases, or a list of one a case; none if it is an array."""
    if _changes(given):
        return [given]
    return given if isinstance(given, list) and any(map(_changes, given)) else []


def _changes(given: Any) -> bool:
    """Tell whether it is a function of time, a trajectory, or a table `(times, values)`."""
    table = isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 1
    return table or callable(given) or isinstance(given, Trajectory)


def _some(moving: list[Any], rows: slice) -> list[Any]:
    return moving if len(moving) == 1 else moving[rows]


def _stacked(paths: list[FloatArray], still: FloatArray) -> FloatArray:
    if not paths:
        return np.ascontiguousarray(still[:, None])
    longest = max(map(len, paths))
    return np.stack([np.broadcast_to(one, (longest, one.shape[1])) for one in paths])
