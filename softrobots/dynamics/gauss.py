r"""The method of Gauss with two stages: steps of time of fourth order, while motors and loads stand still.

With the accelerations :math:`a_i` at the stages :math:`c_i = \tfrac12 \mp \tfrac{\sqrt3}{6}` of a step of length `h`

.. math:: y_i = y_0 + c_i h v_0 + h^2 \textstyle\sum_j (A^2)_{ij} a_j, \quad v_i = v_0 + h \sum_j A_{ij} a_j, \quad
          r(y_i, v_i, a_i) = 0, \quad y_1 = y_0 + h v_0 + \tfrac{h^2}2 \textstyle\sum_i (1 - c_i) a_i, \quad
          v_1 = v_0 + \tfrac h2 \sum_i a_i

It is symmetric in time, symplectic and A-stable as the midpoint rule, which is that of one stage, and turns a vibration of
angular frequency :math:`\omega` too slowly by the share :math:`(\omega h)^4 / 720` instead of :math:`(\omega h)^2 / 12`
(Hairer, Lubich and Wanner, Geometric Numerical Integration, 2006, sections II.1.3 and VI.4). A composition of midpoint steps
would need steps back in time, which damping makes unstable.

Newton's method solves both stages with one complex matrix of the size of the robot (Hairer and Wanner, Solving Ordinary
Differential Equations II, 1996, section IV.8): `A` has the eigenvalues :math:`\lambda, \bar\lambda` with
:math:`\lambda = \tfrac14 + \tfrac{\sqrt3}{12} i`, and for residuals :math:`r_1, r_2`

.. math:: (M + h \lambda D + h^2 \lambda^2 K)\, d = r_1 + (2 - \sqrt3)\, i\, r_2, \quad
          \Delta a_1 = -\operatorname{Re} d, \quad \Delta a_2 = -(2 + \sqrt3) \operatorname{Im} d

That takes `M` and `K` of the second stage for both. Where forces have knees, or corrections shrink slowly, each has its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.dynamics.midpoint import (
    CHANGE,
    ITERATIONS,
    LEFT,
    RENEWED,
    ROUNDED,
    SLOW,
    MidpointRule,
    Stage,
    State,
    Step,
    Wrenches,
)

_ROOT = math.sqrt(3.0)

STAGES = 0.5 - _ROOT / 6.0, 0.5 + _ROOT / 6.0
"""Times of the stages, over the step."""
WEIGHTS = (0.25, 0.25 - _ROOT / 6.0), (0.25 + _ROOT / 6.0, 0.25)
"""`A`, by which accelerations at the stages change the rates there."""
SQUARES = (1.0 / 24.0, 0.125 - _ROOT / 12.0), (0.125 + _ROOT / 12.0, 1.0 / 24.0)
"""Its square, by which they change the coordinates there."""
FROM_SQUARES = (6.0, 12.0 * _ROOT - 18.0), (-12.0 * _ROOT - 18.0, 6.0)
"""The inverse of that."""
EIGENVALUE = complex(0.25, _ROOT / 12.0)
"""One of the eigenvalues of `A`."""
SECOND = 2.0 - _ROOT
"""Factor of the second residual in the complex one; the second correction has its inverse."""


class GaussRule(MidpointRule):
    """Steps of time of fourth order of one robot whose motors and loads stand still."""

    order = 4

    def step(self, start: State, end_time: float) -> Step | None:
        """Return the step from a state to a time; None if its equations could not be solved."""
        equations, m = self.equations, self.equations.n_motors
        h, wrenches, shares = end_time - start.time, self.load(start.time), np.array(STAGES)
        y0, v0, weights, squares = start.x[m:], start.rates[m:], np.array(WEIGHTS), np.array(SQUARES)
        coasting, size = y0 + h * np.multiply.outer(shares, v0), max(1.0, math.sqrt(y0.dot(y0)))
        a, last, solve, shrinking = self._guess(h, coasting), np.inf, None, 0.0
        for iteration in range(1, ITERATIONS + 1):
            y, v = coasting + h * h * (squares @ a), v0 + h * (weights @ a)
            stages = tuple(self._stage(start, h * share, *place) for share, *place in zip(STAGES, y, v, a, strict=True))
            residual = np.array([stage.forces[m:] for stage in stages])
            if not math.isfinite(float(np.vdot(residual, residual))):
                return None
            if solve is None or iteration == RENEWED or (self._has_knees and shrinking > SLOW):
                solve = self._solver(h, stages if self._has_knees or iteration > 1 else stages[1:], wrenches)
            change = solve(residual)
            a = a - change
            moved = h * h * float(np.linalg.norm(squares @ change)) / size
            if moved <= CHANGE or (moved >= 0.5 * last and last <= ROUNDED):
                break
            if not moved < 1e3 * last:
                return None
            shrinking, last = moved / last, moved
        if not moved <= LEFT:
            return None
        self._past = [(h, coasting + h * h * (squares @ a)), *self._past[:2]]
        x, rates, accelerations = start.x.copy(), start.rates.copy(), np.zeros(equations.n)
        x[m:], rates[m:] = y0 + h * v0 + 0.5 * h * h * ((1.0 - shares) @ a), v0 + 0.5 * h * a.sum(axis=0)
        one, other = (stage.state for stage in stages)
        middle = State(start.time + 0.5 * h, 0.5 * (one.x + other.x), 0.5 * (one.rates + other.rates))
        forces = 0.5 * (stages[0].forces + stages[1].forces)[:m]
        return Step(start, State(end_time, x, rates), middle, accelerations, forces, wrenches, stages=stages)

    def exerted(self, x: FloatArray, rates: FloatArray) -> FloatArray:
        """What actuators exert in a state of motion, shape (n_motors,) [N m or N]."""
        equations, m, wrenches = self.equations, self.equations.n_motors, self.load(0.0)
        accelerations = np.zeros(equations.n)
        residual = equations.balance(x, rates, accelerations, wrenches)[m:]
        accelerations[m:] = -np.linalg.solve(equations.mass_matrix(x)[m:, m:], residual)
        return np.asarray(equations.balance(x, rates, accelerations, wrenches)[:m])

    def _guess(self, h: float, coasting: FloatArray) -> FloatArray:
        """Accelerations with which the stages continue those of the last equal steps, shape (2, n)."""
        earlier = [y for length, y in self._past if abs(length - h) <= 1e-9 * h]
        extrapolation = ((), (1.0,), (2.0, -1.0), (3.0, -3.0, 1.0))[len(earlier)]
        beyond = sum((one * (y - coasting) for one, y in zip(extrapolation, earlier, strict=True)), np.zeros_like(coasting))
        return np.asarray(np.array(FROM_SQUARES) @ beyond / (h * h))

    def _solver(self, h: float, stages: Sequence[Stage], wrenches: Wrenches) -> Callable[[FloatArray], FloatArray]:
        """Solver for the changes of the accelerations at both stages, shape (2, n), by both matrices, or that of the second."""
        from scipy.linalg import lu_factor, lu_solve

        equations, m = self.equations, self.equations.n_motors
        masses = [equations.mass_matrix(stage.state.x)[m:, m:] for stage in stages]
        stiff = [equations.stiffness(stage.state.x, wrenches)[m:, m:] for stage in stages]
        damping = equations.damping[m:, m:]
        if len(stages) == 1:
            scale = h * EIGENVALUE
            factors = lu_factor(masses[0] + scale * damping + scale * scale * stiff[0], check_finite=False)

            def by_one(residual: FloatArray) -> FloatArray:
                both = lu_solve(factors, residual[0] + 1j * SECOND * residual[1], check_finite=False)
                return np.stack([both.real, both.imag / SECOND])

            return by_one
        blocks = [
            [(i == j) * masses[i] + h * WEIGHTS[i][j] * damping + h * h * SQUARES[i][j] * stiff[i] for j in range(2)]
            for i in range(2)
        ]
        own = lu_factor(np.block(blocks), check_finite=False)
        return lambda residual: np.asarray(lu_solve(own, residual.ravel(), check_finite=False)).reshape(2, -1)

    def _stage(self, start: State, after: float, y: FloatArray, v: FloatArray, a: FloatArray) -> Stage:
        """The robot at a stage, some time after the start of the step [s]."""
        m, still = self.equations.n_motors, np.zeros(self.equations.n_motors)
        state = State(start.time + after, np.concatenate([start.x[:m], y]), np.concatenate([still, v]))
        forces = self.equations.balance(state.x, state.rates, np.concatenate([still, a]), self.load(start.time))
        return Stage(state, forces)
