"""Inputs of many compiled simulations at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.batches import batch_rows, unusable, without, without_dust
from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.run.motion_course import SpringKicks, forces_of_steps, motors_of_steps
from softrobots.compiled.run.results import EquilibriumBatch
from softrobots.core.checks import FloatArray
from softrobots.dynamics.starting import check_start
from softrobots.dynamics.time_grid import SAME_TIME, merged_times
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.friction_coordinates import after_step, memory_of
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.trajectory import Trajectory


class MotionCases:
    """Motors, forces and starts of many cases; each has one row a case, or one for all."""

    def __init__(self, model: SoftModel, actuation: Actuation, end: float, q_motors: Any, forces: Any, starts: Any) -> None:
        """Check the inputs of `CompiledDynamics.simulations`.

        Raises:
            ParameterError: If a shape differs, the numbers of cases differ, or a path or a table is wrong.
        """
        held, bending = starts if isinstance(starts, Equilibrium) else None, actuation.rest_bending
        anchors: Any = np.zeros(actuation.n_guides)
        if isinstance(starts, EquilibriumBatch | MotionBatch) and starts.friction_bending is not None:
            bending, anchors = starts.friction_bending, starts.friction_slip
        if held is not None:
            if (friction := model.structure.friction) is not None:
                memory = memory_of(after_step(held.model, held.q_motors, held.q_springs))
                bending, anchors = memory.bending, friction.anchors(memory)
            starts = held.q_springs
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
            "friction_bending": (np.reshape(bending, (*np.shape(bending)[:-2], -1)), actuation.rest_bending.size),
            "friction_slip": (anchors, actuation.n_guides),
        }
        for name, moving in (("q_motors", self._paths), ("forces", self._loads)):
            if len(moving) > 1:
                arrays[name] = np.tile(arrays[name][0], (len(moving), 1)), arrays[name][1]
        motors, pushes, springs, rates, bending, anchors = batch_rows(**arrays)
        if held is not None:
            check_start(model, held, np.array([path(0.0) for path in self._paths]) if self._paths else motors)
        self.count = len(motors)
        """Number of cases."""
        self.bad = unusable(motors, pushes, springs, rates, bending, anchors) | actuation.unsuited(motors)
        """Mask of the cases with numbers that cannot be computed with, shape (n,)."""
        self.failures: dict[int, tuple[float, Exception]] = {}
        """Time [s] before which a function of a case has failed, and its error, by case."""
        self._motors, self._forces = without(motors, self.bad, model.relaxed_motors), without(pushes, self.bad)
        self._bending, self._anchors = without(bending, self.bad), without(anchors, self.bad)
        self.state = without_dust(without(springs, self.bad, model.rest)), without_dust(without(rates, self.bad))
        """Elastic coordinates and rates at the start, each shape (n, n_springs)."""

    def carried(self, kicks: SpringKicks, unknowns: FloatArray, rates: FloatArray) -> FloatArray:
        """Return what code with dry friction carries, shape (n, G + 3 N), from unknowns and rates after a first kick."""
        bending, carried = self._bending.reshape(self.count, -1, 2), []
        for case in range(self.count):
            path = self._paths[min(case, len(self._paths) - 1)] if self._paths else None
            motors = self._motors[case] if path is None else path(0.0)
            speeds = 0.0 * motors if path is None else path.kicks.get(0.0, 0.0 * motors)
            carried.append(kicks.carried(bending[case], self._anchors[case], motors, unknowns[case], speeds, rates[case]))
        return np.array(carried)

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

    def kick(
        self, kicks: SpringKicks, time: float, rows: slice, unknowns: FloatArray, rates: FloatArray, carried: Any = None
    ) -> None:
        """Let the rates of some cases, shape (n, N), and of their strains where friction carries them, jump as their motors."""
        for place, case in enumerate(range(self.count)[rows] if self._paths else ()):
            path = self._paths[min(case, len(self._paths) - 1)]
            changes = [change for at, change in path.kicks.items() if abs(at - time) <= self._apart]
            if changes and np.all(np.isfinite(unknowns[place])):
                motors, jump = path(time), kicks.at(path(time), unknowns[place], changes[0])
                rates[place] += jump
                if carried is not None:
                    speeds = kicks.strain_rates(motors, unknowns[place], changes[0], jump)
                    carried[place, -len(speeds) :] += speeds

    def motors(self, grid: FloatArray, rows: slice) -> FloatArray:
        """Return the motors of some cases, shape (n or 1, 2 n_steps + 1 or 1, n_motors); see `motors_of_steps`."""
        return self._sampled(motors_of_steps, self._paths, grid, rows, self._motors, 2 * len(grid) - 1)

    def forces(self, grid: FloatArray, rows: slice) -> FloatArray:
        """Return the forces of some cases, shape (n or 1, n_steps or 1, 3) [N]; see `forces_of_steps`."""
        return self._sampled(forces_of_steps, self._loads, grid, rows, self._forces, len(grid) - 1)

    def _sampled(
        self,
        sample: Callable[[Any, FloatArray], FloatArray],
        moving: list[Any],
        grid: FloatArray,
        rows: slice,
        still: FloatArray,
        count: int,
    ) -> FloatArray:
        """What drives some cases: `count` samples of what moves, NaN from where a function fails, or what stands still."""
        found, shared = [], len(moving) == 1
        for case, one in enumerate(moving if shared else moving[rows], 0 if shared else rows.start):
            values, valid, beyond, tried = np.zeros((0, still.shape[1])), 0, len(grid) + 1, len(grid)
            while beyond - valid > 1:
                try:
                    values, valid = sample(one, grid[:tried]), tried
                except Exception as error:  # of a function of the caller: anything
                    beyond, failure = tried, (float(grid[max(tried - 2, 0)]), error)
                tried = (valid + beyond) // 2
            if valid < len(grid):
                self.failures.setdefault(case, failure)
                self.bad[slice(None) if shared else case] = True
                values = np.pad(values, ((0, count - len(values)), (0, 0)), constant_values=np.nan)
            found.append(values)
        if not found:
            return np.ascontiguousarray(still[rows][:, None])
        longest = max(map(len, found))
        return np.stack([np.broadcast_to(one, (longest, one.shape[1])) for one in found])


def _moving(given: Any) -> list[Any]:
    """Return what changes over time: one for all cases, or a list of one a case; none if it is an array."""
    if _changes(given):
        return [given]
    return given if isinstance(given, list) and any(map(_changes, given)) else []


def _changes(given: Any) -> bool:
    """Tell whether it is a function of time, a trajectory, or a table `(times, values)`."""
    table = isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 1
    return table or callable(given) or isinstance(given, Trajectory)
