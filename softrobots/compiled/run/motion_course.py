"""What drives a compiled simulation: start, motors and force over time, as the generated code takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.batches import without_dust
from softrobots.compiled.settings import LARGEST_POSITION
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.midpoint import State
from softrobots.dynamics.starting import first_kick, first_state
from softrobots.dynamics.step_control import halved
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel


def motors_of_steps(path: MotorPath, grid: FloatArray) -> FloatArray:
    """Return motors at the beginnings, middles and ends of steps, shape (2 n_steps + 1, n_motors), or one row if they stand.

    Raises:
        ParameterError: If a position is too large to compute with.
    """
    found = path(0.0)[None] if path.constant else path.at(halved(grid))
    if found.size and np.abs(found).max() > LARGEST_POSITION:
        requirement = f"within +-{LARGEST_POSITION:g} rad or m at motor joints, for compiled solvers"
        raise ParameterError("q_motors", float(np.abs(found).max()), requirement)
    return found


def forces_of_steps(load: TimeLoad, grid: FloatArray) -> FloatArray:
    """Return the force on the tip in the middles of steps, shape (n_steps, 3), or one row if it is constant [N]."""
    return load.tip_forces(grid[:1] if load.constant else 0.5 * (grid[1:] + grid[:-1]))


def motors_at(path: MotorPath, times: FloatArray, grid: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return motors and their rates at given times, each (n, n_motors); the rates as the steps of a grid have them."""
    if path.constant:
        motors = path(0.0)
        return np.full((len(times), len(motors)), motors), np.zeros((len(times), len(motors)))
    step = np.maximum(np.searchsorted(grid, times) - 1, 0)
    ends = np.array([grid[step], 0.5 * (grid[step] + grid[step + 1]), grid[step + 1]])
    u0, middle, u1 = (path.at(row) for row in ends)
    h, since = (ends[2] - ends[0])[:, None], (times - ends[1])[:, None]
    rates = (u1 - u0) / h + since * (u1 - 2.0 * middle + u0) * 4.0 / h**2
    return path.at(times), rates


class SpringKicks:
    """What springs do when velocities of motors jump; see `MidpointRule.kicked`."""

    def __init__(self, model: SoftModel, moving: Sequence[int], strains: Sequence[int], actuation: Actuation) -> None:
        """Take the robot, which elastic coordinates can move, its strains that are not locked, and its maps."""
        self._model, self._strains, self._actuation = model, list(strains), actuation
        self.moving = list(moving)
        """The elastic coordinates that can move."""
        self._equations: EquationsOfMotion | None = None

    def at(self, motors: FloatArray, unknowns: FloatArray, change: FloatArray) -> FloatArray:
        """Return the jump of the velocities of the unknowns, shape (n,).

        Args:
            motors: Where the motors are, shape (n_motors,) [rad or m].
            unknowns: The unknowns there, shape (n,) [rad or m].
            change: Jump of the velocities of the motors, shape (n_motors,).
        """
        x, free = self._all(motors, unknowns, self._model.rest), self._model.n_motors + np.array(self.moving, dtype=np.intp)
        mass = self._of_robot.mass_matrix(x)
        return np.asarray(-np.linalg.solve(mass[np.ix_(free, free)], mass[free, : len(change)] @ change))

    def carried(
        self, bending: FloatArray, anchors: FloatArray, motors: FloatArray, unknowns: FloatArray, *rates: FloatArray
    ) -> FloatArray:
        """Return what code with dry friction carries, anchors, sliders, strains and rates (G + 3 N), from what it remembers."""
        strains = self._of_robot.strains(self._all(motors, unknowns, self._model.rest))[self._strains]
        sliders, speeds = self._actuation.sliders(bending[None])[0], self.strain_rates(motors, unknowns, *rates)
        return np.concatenate([anchors, sliders, strains, speeds])

    def strain_rates(self, motors: FloatArray, unknowns: FloatArray, motor_rates: FloatArray, rates: FloatArray) -> FloatArray:
        """Return the rates of the strains, shape (N,), from places and rates of motors and unknowns."""
        x, velocities = self._all(motors, unknowns, self._model.rest), self._all(motor_rates, rates, 0.0 * self._model.rest)
        return np.asarray(self._of_robot.strain_rates(x, velocities)[self._strains])

    @property
    def _of_robot(self) -> EquationsOfMotion:
        if self._equations is None:
            self._equations = EquationsOfMotion(self._model)
        return self._equations

    def _all(self, motors: FloatArray, unknowns: FloatArray, others: FloatArray) -> FloatArray:
        """Return motors and all elastic coordinates, or their rates."""
        springs = np.array(others)
        springs[self.moving] = unknowns
        return np.concatenate([motors, springs])


@dataclass(frozen=True)
class Course:
    """What drives one simulation."""

    path: MotorPath
    """Positions of the motors."""
    load: TimeLoad
    """Force on the tip."""
    spring_kicks: SpringKicks
    """What springs do when velocities of motors jump."""

    @property
    def breaks(self) -> tuple[FloatArray, ...]:
        """Times at which velocities of motors jump, then jumps and kinks of motors and of the force, each shape (n,) [s]."""
        return self.path.kick_times, self.path.breaks, self.load.breaks

    def first_state(self, model: SoftModel, start: Any) -> State:
        """Return the state at time zero, after the motors have begun to move, see `softrobots.dynamics.starting`."""
        first, m = first_state(model, start, self.path), model.n_motors
        first.x[m:], first.rates[m:] = without_dust(first.x[m:]), without_dust(first.rates[m:])
        places = m + np.array(self.spring_kicks.moving, dtype=np.intp)
        locked = np.setdiff1d(np.arange(m, len(first.x)), places)
        first.x[locked], first.rates[locked] = model.rest[locked - m], 0.0
        change = first_kick(self.path, first.rates[:m])
        if change is not None:
            first.rates[places] += self.spring_kicks.at(first.x[:m], first.x[places], change)
            first.rates[:m] += change
        return first

    def inputs_at(self, time: FloatArray, grid: FloatArray) -> dict[str, Any]:
        """Return the fields of a `Motion` with rows at given times, shape (n,) [s], that the steps of a grid do not compute."""
        motors, rates = motors_at(self.path, time, grid)
        known = {"time": time, "q_motors": motors, "motor_velocities": rates, "forces": self.load.tip_forces(time)}
        return known | {"steps": grid[grid <= time[-1]]}
