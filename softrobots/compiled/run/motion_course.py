"""What drives a compiled simulation: start, motors and force over time, as the generated code takes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.settings import LARGEST_POSITION
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.dynamics.motion import Motion, MotionState
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium


def motors_of_steps(path: MotorPath, grid: FloatArray) -> FloatArray:
    """Return motors at the beginnings, middles and ends of steps, shape (2 n_steps + 1, n_motors), or one row if they stand.

    Raises:
        ParameterError: If a position is too large to compute with.
    """
    times = np.zeros(2 * len(grid) - 1)
    times[::2], times[1::2] = grid, 0.5 * (grid[1:] + grid[:-1])
    found = path(0.0)[None] if path.constant else np.array([path(time) for time in times.tolist()])
    if found.size and np.abs(found).max() > LARGEST_POSITION:
        requirement = f"within +-{LARGEST_POSITION:g} rad or m at motor joints, for compiled solvers"
        raise ParameterError("q_motors", float(np.abs(found).max()), requirement)
    return found


def forces_at(load: TimeLoad, tip: str, times: Sequence[float]) -> FloatArray:
    """Return the force on the tip at given times, shape (n, 3) [N]."""
    none = np.zeros(6)
    if load.constant:
        return np.tile(load(0.0).get(tip, none)[:3], (len(times), 1))
    return np.array([load(time).get(tip, none)[:3] for time in times])


def forces_of_steps(load: TimeLoad, tip: str, grid: FloatArray) -> FloatArray:
    """Return the force on the tip in the middles of steps, shape (n_steps, 3), or one row if it is constant [N]."""
    return forces_at(load, tip, [0.0] if load.constant else (0.5 * (grid[1:] + grid[:-1])).tolist())


def motors_at(path: MotorPath, times: FloatArray, grid: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return motors and their rates at given times, each (n, n_motors); the rates as the steps of a grid have them."""
    if path.constant:
        motors = np.tile(path(0.0), (len(times), 1))
        return motors, np.zeros_like(motors)
    step = np.maximum(np.searchsorted(grid, times) - 1, 0)
    ends = np.array([grid[step], 0.5 * (grid[step] + grid[step + 1]), grid[step + 1]])
    u0, middle, u1 = (np.array([path(time) for time in row]) for row in ends.tolist())
    h, since = (ends[2] - ends[0])[:, None], (times - ends[1])[:, None]
    rates = (u1 - u0) / h + since * (u1 - 2.0 * middle + u0) * 4.0 / h**2
    return np.array([path(time) for time in times.tolist()]), rates


@dataclass(frozen=True)
class Course:
    """What drives one simulation."""

    path: MotorPath
    """Positions of the motors."""
    load: TimeLoad
    """Force on the tip."""
    q_springs: FloatArray
    """Elastic coordinates at the start, shape (n_springs,) [rad or m]."""
    velocities: FloatArray
    """Their rates, shape (n_springs,)."""
    tip: str
    """Name of the tip."""

    @property
    def breaks(self) -> FloatArray:
        """Times at which motors or force have a jump or a kink, shape (n,) [s]."""
        return np.concatenate([self.path.breaks, self.load.breaks])


def start_state(model: SoftModel, start: Any) -> tuple[FloatArray, FloatArray]:
    """Return elastic coordinates and rates of a start, each shape (n_springs,).

    Raises:
        ParameterError: If the start is of another kind, or of another robot.
    """
    if start is None:
        return model.rest, np.zeros(model.n_springs)
    state = start.end if isinstance(start, Motion) else start
    if not isinstance(state, Equilibrium | MotionState):
        raise ParameterError("start", start, "an Equilibrium, a Motion, a MotionState, or None (relaxed, at rest)")
    if state.model != model:
        raise ParameterError("start", state.model, f"a state of the model given, {model!r}")
    return state.q_springs, state.velocities if isinstance(state, MotionState) else np.zeros(model.n_springs)
