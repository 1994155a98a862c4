r"""The step of time: the implicit midpoint rule for free coordinates next to prescribed ones.

With the unknown acceleration `a` in the middle of a step of length `h`

.. math:: y_m = y_0 + \tfrac h2 v_0 + \tfrac{h^2}4 a, \quad v_m = v_0 + \tfrac h2 a, \quad r(y_m, v_m, a, t_m) = 0, \quad
          y_1 = y_0 + h v_0 + \tfrac{h^2}2 a, \quad v_1 = v_0 + h a

It is of second order, symmetric in time, and keeps every quadratic energy exactly: it damps nothing that is not damped (Hairer,
Lubich and Wanner, Geometric Numerical Integration, 2006, sections II.1.3 and IV.2.1). Prescribed coordinates `u(t)` enter with

.. math:: u_m = u(t_m), \quad \dot u_m = (u_1 - u_0) / h, \quad \ddot u_m = 4 (u_1 - 2 u_m + u_0) / h^2

`a` is found by Newton's method with the matrix :math:`M + \tfrac h2 D + \tfrac{h^2}4 K`, factorised once in a step; what it
leaves out (the derivatives of centrifugal and inertial forces) is small with the step, so that each iteration gains digits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.friction_steps import LineSearch
from softrobots.dynamics.motor_torque import MotorTorque
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad
from softrobots.model.dry_friction import FrictionMemory

CHANGE = 1e-13
"""Change of the coordinates at the middle, relative to max(1, |y|), below which an iteration ends a step."""
ROUNDED = 1e-11
"""The same, below which an iteration that no longer shrinks has reached rounding."""
LEFT = 1e-9
"""The same by the last iteration of a step, below which the step is taken."""
ITERATIONS = 30
"""Most iterations of a step."""
RUBBING_ITERATIONS = 100
"""The same of a robot with dry friction, with the attempts along a change."""
RENEWED = 8
"""Iteration after which the matrix is computed again."""
SLOW = 0.1
"""Share of the last change, above which the matrix is computed again where forces have knees: of motors, of slack tendons."""

Wrenches = Mapping[str, FloatArray]
"""Dead wrench by frame, shape (6,) [N, N m], world axes."""


class State(NamedTuple):
    """A robot in motion."""

    time: float
    """Time [s]."""
    x: FloatArray
    """Actuators, then elastic coordinates, shape (n,) [rad, m or N]."""
    rates: FloatArray
    """Their rates, shape (n,)."""
    memory: FrictionMemory | None = None
    """What dry friction of the body remembers; None if it has none."""


class Stage(NamedTuple):
    """A robot at a stage of a step."""

    state: State
    """Its state."""
    forces: FloatArray
    """What acts on each coordinate from outside, shape (n,) [N m or N]."""


class Step(NamedTuple):
    """One step of time."""

    start: State
    """State at its start."""
    end: State
    """State at its end."""
    middle: State
    """State in the middle."""
    accelerations: FloatArray
    """Accelerations of all coordinates in the middle, shape (n,)."""
    actuator_forces: FloatArray
    """What actuators exert in the middle, shape (n_motors,) [N m or N]."""
    wrenches: Wrenches
    """Load in the middle."""
    friction_power: float = 0.0
    """Power that dry friction takes in the middle [W]."""
    stages: tuple[Stage, ...] = ()
    """Stages of equal weight, of a method that has more than that in the middle."""

    @property
    def length(self) -> float:
        """Length of the step [s]."""
        return self.end.time - self.start.time

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Coordinates and rates within the step, each shape (n,): the cubic through both ends and its slope."""
        h = self.length
        s = (time - self.start.time) / h
        change, first, last = self.end.x - self.start.x, h * self.start.rates, h * self.end.rates
        second, third = 3.0 * change - 2.0 * first - last, first + last - 2.0 * change
        x = self.start.x + s * (first + s * (second + s * third))
        return x, (first + s * (2.0 * second + 3.0 * s * third)) / h


class MidpointRule:
    """Steps of time of one robot under given inputs; keeps what the next step can use."""

    order = 2
    """Order of the error in the length of the steps."""

    def __init__(
        self,
        equations: EquationsOfMotion,
        path: MotorPath,
        load: TimeLoad,
        torque: MotorTorque | None = None,
    ) -> None:
        """Take the equations of motion and what drives them.

        Args:
            equations: Equations of motion.
            path: Actuators over time; the entries of free ones are not used.
            load: Load over time.
            torque: What acts on the motor joints, which are free then; None: they are prescribed.
        """
        self.equations, self.path, self.load, self.torque = equations, path, load, torque
        n, m = equations.n, equations.n_motors
        self.free = np.concatenate([np.arange(torque.count if torque else 0), np.arange(m, n)])
        """Places of the free coordinates."""
        self.prescribed = np.setdiff1d(np.arange(m), self.free)
        """Places of the prescribed coordinates."""
        self._at = self.free if torque else slice(m, n)  # the same, quickly
        self._block: Any = np.ix_(self.free, self.free) if torque else (self._at, self._at)
        self._damping = equations.damping[self._block]
        self._has_knees = torque is not None or equations.has_slack_tendons or equations.friction is not None
        self._past: list[tuple[float, FloatArray]] = []

    def kicked(self, state: State, change: FloatArray) -> State:
        r"""State after the velocities of prescribed coordinates jump by `change`, shape (n_motors,).

        The impulse of the motors is shared as by a blow on the mechanism, :math:`M_{yy} \Delta v = -M_{yu} \Delta \dot u`.
        """
        mass, free, fixed = self.equations.mass_matrix(state.x), self.free, self.prescribed
        rates = state.rates.copy()
        rates[fixed] += change[fixed]
        if len(free):
            rates[free] -= np.linalg.solve(mass[self._block], mass[np.ix_(free, fixed)] @ change[fixed])
        return state._replace(rates=rates)

    def forget(self) -> bool:
        """Forget the last steps, from which the next is guessed; tell whether there were any."""
        known = bool(self._past)
        self._past.clear()
        return known

    def step(self, start: State, end_time: float) -> Step | None:
        """Return the step from a state to a time; None if its equations could not be solved."""
        equations, free = self.equations, self._at
        m, n = equations.n_motors, equations.n
        h, middle_time = end_time - start.time, 0.5 * (start.time + end_time)
        wrenches = self.load(middle_time)
        before, middle, after = (self.path(time) for time in (start.time, middle_time, end_time))
        x, rates, accelerations = np.zeros(n), np.zeros(n), np.zeros(n)
        x[:m], rates[:m], accelerations[:m] = middle, (after - before) / h, (after - 2.0 * middle + before) * (4.0 / (h * h))
        y0, v0 = start.x[free], start.rates[free]
        torque = self.torque
        if torque is not None:
            torque.begin(start.time, start.x, start.rates)
        equations.begin_step(start.memory, start.x, start.rates, h)
        a, size = self._predicted(middle_time, len(y0)), max(1.0, math.sqrt(y0.dot(y0)))

        def move_middle(a: FloatArray) -> None:
            """Set the free coordinates of the middle state, which has these accelerations, shape (n_free,)."""
            x[free], rates[free], accelerations[free] = y0 + 0.5 * h * v0 + 0.25 * h * h * a, v0 + 0.5 * h * a, a

        solve, last, shrinking, line = None, np.inf, 0.0, None
        searched = equations.friction is not None and not (torque is not None and torque.has_friction)
        for iteration in range(1, (ITERATIONS if equations.friction is None else RUBBING_ITERATIONS) + 1):
            move_middle(a)
            forces = equations.balance(x, rates, accelerations, wrenches)
            residual = self._unbalanced(forces, middle_time, x, rates)
            if not math.isfinite(residual.dot(residual)):
                return None
            if line is not None and (nearer := line.nearer(residual)) is not None:
                a = nearer
                continue
            if equations.grip(x, forces):
                forces = equations.balance(x, rates, accelerations, wrenches)
                residual = self._unbalanced(forces, middle_time, x, rates)
            if solve is None or iteration == RENEWED or (self._has_knees and shrinking > SLOW):
                solve = self._factorised(middle_time, x, rates, wrenches, h)
            change = solve(residual)
            if torque is not None and torque.has_friction:
                change = torque.with_friction(solve, change, (v0 + h * a)[: torque.count], h)
            line = LineSearch(a, change, residual) if searched else None
            a = a - change
            moved = 0.25 * h * h * math.sqrt(change.dot(change)) / size
            if moved <= CHANGE or (moved >= 0.5 * last and last <= ROUNDED):
                break
            if not moved < 1e3 * last:
                return None
            shrinking, last = moved / last, moved
        if not moved <= LEFT:
            return None
        move_middle(a)
        ends, end_rates = np.zeros(n), np.zeros(n)
        ends[:m], end_rates[:m] = after, rates[:m] + 0.5 * h * accelerations[:m]
        ends[free], end_rates[free] = y0 + h * v0 + 0.5 * h * h * a, v0 + h * a
        self._past = [*self._past[-1:], (middle_time, a)]
        middle_state = State(middle_time, x, rates)
        memory, lost = equations.end_step(x, rates, ends)
        if torque is not None:
            forces[: torque.count] = torque.exerted(middle_time, x, rates)
            lost += float(torque.resistance @ rates[: torque.count])
        return Step(start, State(end_time, ends, end_rates, memory), middle_state, accelerations, forces[:m], wrenches, lost)

    def _unbalanced(self, forces: FloatArray, time: float, x: FloatArray, rates: FloatArray) -> FloatArray:
        """What acts on the free coordinates less what has to, shape (n_free,)."""
        residual = forces[self._at]
        if self.torque is not None:
            residual[: self.torque.count] -= self.torque.exerted(time, x, rates)
        return residual

    def _predicted(self, time: float, count: int) -> FloatArray:
        """Acceleration extrapolated from the last two steps."""
        if len(self._past) < 2:
            return self._past[-1][1] if self._past else np.zeros(count)
        (t0, a0), (t1, a1) = self._past
        return a1 + (a1 - a0) * min((time - t1) / (t1 - t0), 1.5)

    def _factorised(
        self, time: float, x: FloatArray, rates: FloatArray, wrenches: Wrenches, h: float
    ) -> Callable[[FloatArray], FloatArray]:
        """Solver of the equations with the matrix of Newton's method."""
        from scipy.linalg.lapack import dgetrf, dgetrs

        matrix = np.array(self.equations.mass_matrix(x)[self._block])
        matrix += 0.5 * h * self._damping + 0.25 * h * h * self.equations.stiffness(x, wrenches)[self._block]
        if self.torque is not None:
            by_x, by_rates = self.torque.slopes(time, x, rates)
            matrix[: len(by_x), : len(by_x)] -= 0.25 * h * h * by_x + 0.5 * h * by_rates
        if len(matrix) == 0:
            return lambda residual: residual
        factors, pivots, _ = dgetrf(matrix, overwrite_a=True)
        return lambda residual: np.asarray(dgetrs(factors, pivots, residual)[0])
