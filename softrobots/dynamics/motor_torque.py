r"""Motors that move by their torque: a controller's, within the effort of the file, less the friction of the joint.

A motor joint then is a free coordinate, with its rotor in the mass matrix and its viscous friction in the damping:

.. math:: \tau = \mathrm{clip}(\tau_c(t, u, \dot u), -\tau_{max}, \tau_{max}) - f\, \mathrm{clip}(\dot u / v_f, -1, 1)

with the dry friction `f` and `v_f` = `CREEP`: a joint that sticks creeps, in proportion to what it carries. Dry friction acts
by the velocity at the end of a step, so that a joint that comes to rest stays there: by that in the middle, it would turn round
at each step. It is found together with the accelerations, by an active set of the joints that stick. A continuous controller is
evaluated in the middle of each step, so that the scheme keeps its order; a sampled one at its instants, at which steps end, and
its torque is held until the next (zero-order hold).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_number
from softrobots.core.errors import ParameterError
from softrobots.dynamics.time_grid import refuse_too_short, time_grid
from softrobots.model.soft_model import SoftModel

MOTORS = ("prescribed", "torque")
"""What drives motors: a given motion, or torques."""

CREEP = 1e-4
"""Speed at which a joint begins to slide; it creeps by half of it under half of its dry friction [rad/s or m/s]."""

_DIFFERENCE = 1e-6  # of the derivatives of a controller, in its arguments
_ON_TIME = 1e-9  # of a sampling interval
_ATTEMPTS, _WHOLE = 60, 20  # to find which joints stick, and those whose change is not halved
_SETTLED = 1e-13  # change of the friction, over itself, that ends them

Torque = Callable[[float, FloatArray, FloatArray], Any]
"""A controller: torques of the motor joints, shape (n,) [N m or N], from time [s], positions, velocities, each shape (n,)."""


class MotorTorque:
    """What acts on the motor joints of a robot, the first of its coordinates."""

    def __init__(self, model: SoftModel, torque: Torque | Any, sample_time: Any = None) -> None:
        """Take a controller.

        Args:
            model: The robot, with at least one motor joint.
            torque: Function of time, positions and velocities of the motor joints, or constant torques, shape (n,) [N m or N].
            sample_time: Time between two evaluations [s]; None: continuous.

        Raises:
            ParameterError: If the robot has no motor joint, or an argument is of another kind or out of range.
        """
        self.count = len(model.structure.motor_joints)
        """Number of motor joints."""
        if self.count == 0:
            raise ParameterError("motors", "torque", f"'prescribed' for a robot without motor joints, {model!r}")
        if not callable(torque):
            constant = finite_array("torque", torque, (self.count,), "N m")
            torque = lambda *_: constant  # noqa: E731
        self._torque: Torque = torque
        self.sample_time = None if sample_time is None else positive_number("sample_time", sample_time, "s")
        """Time between two evaluations [s]; None: continuous."""
        drives = model.actuators.drives
        self._effort, self._friction = drives.effort[: self.count], drives.friction[: self.count]
        self._held, self._sample = np.zeros(self.count), -1
        self.resistance: FloatArray = np.zeros(self.count)
        """Dry friction against the motion in the last step, shape (n,) [N m or N]."""

    def with_samples(self, grid: FloatArray) -> FloatArray:
        """Return the times of steps with the instants at which a sampled controller is evaluated, shape (n,) [s].

        Raises:
            ParameterError: If there are too many of them.
        """
        if self.sample_time is None:
            return grid
        end = float(grid[-1])
        refuse_too_short("sample_time", self.sample_time, end)
        every = np.unique(np.concatenate([grid, time_grid(end, self.sample_time)]))
        return np.asarray(every[np.append(np.diff(every) > _ON_TIME * self.sample_time, True)])

    def begin(self, time: float, x: FloatArray, rates: FloatArray) -> None:
        """Start a step at a time and state, each shape (n,): a sampled controller is evaluated if its time has come."""
        if self.sample_time is None:
            return
        sample = math.floor(time / self.sample_time + _ON_TIME)
        if sample != self._sample:
            self._held, self._sample = self._evaluated(time, x, rates), sample

    def exerted(self, time: float, x: FloatArray, rates: FloatArray) -> FloatArray:
        """Torque of the motors, shape (n,) of the motor joints [N m or N]."""
        return self._evaluated(time, x, rates) if self.sample_time is None else self._held

    @property
    def has_friction(self) -> bool:
        """Whether there is dry friction."""
        return bool(self._friction.any())

    def with_friction(
        self, solve: Callable[[FloatArray], FloatArray], change: FloatArray, rates: FloatArray, step: float
    ) -> FloatArray:
        """Return the change of the accelerations with dry friction, shape (n,), and keep the friction as `resistance`.

        Args:
            solve: Solver of the linear equations of a step.
            change: Decrease of the accelerations without friction, shape (n,).
            rates: Velocities of the motor joints at the end of the step before the change, shape (m,).
            step: Length of the step [s].
        """
        m = self.count
        columns = np.column_stack([solve(unit) for unit in np.eye(m, len(change))])  # all at once, threads of BLAS take longer
        free, gain = rates - step * change[:m], step * columns[:m]
        most = self._friction
        friction, places = self.resistance, np.flatnonzero(most)
        yielding = gain[np.ix_(places, places)] + np.diag(CREEP / most[places])
        free, most, held = free[places], most[places], friction[places]
        diagonal = np.diag(yielding)
        for attempt in range(_ATTEMPTS):
            trial = held + (free - yielding @ held) / diagonal
            sticks = np.abs(trial) <= most
            found = np.where(sticks, 0.0, np.copysign(most, trial))
            found[sticks] = np.linalg.solve(yielding[np.ix_(sticks, sticks)], (free - yielding @ found)[sticks])
            settled = np.abs(found - held).max() <= _SETTLED * most.max()
            held = found if attempt < _WHOLE else np.clip(0.5 * (held + found), -most, most)
            if settled:
                break
        friction[places] = held
        return np.asarray(change + columns @ friction)

    def slopes(self, time: float, x: FloatArray, rates: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Derivatives of the torque by the positions and velocities of the motor joints, each shape (n, n)."""
        m = self.count
        by_x, by_rates = np.zeros((m, m)), np.zeros((m, m))
        if self.sample_time is None:
            here = self._evaluated(time, x, rates)
            for which, matrix in enumerate((by_x, by_rates)):
                for joint in range(m):
                    state = [x.copy(), rates.copy()]
                    step = _DIFFERENCE * max(1.0, abs(state[which][joint]))
                    state[which][joint] += step
                    matrix[:, joint] = (self._evaluated(time, *state) - here) / step
        return by_x, by_rates

    def _evaluated(self, time: float, x: FloatArray, rates: FloatArray) -> FloatArray:
        value = self._torque(time, x[: self.count].copy(), rates[: self.count].copy())
        torque = finite_array(f"torque(t={time:.6g}, ...)", value, (self.count,), "N m")
        return np.clip(torque, -self._effort, self._effort)
