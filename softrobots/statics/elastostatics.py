"""Newton and fixed-point solvers for the static equilibrium of a robot (equations: `softrobots.statics.elastic_state`).

- "newton": Newton on the potential energy with the exact tangent, made positive definite where it is not, and halving of
  steps that do not lower the energy. It ends in a stable equilibrium. A world-fixed moment in the load has no energy: then
  plain Newton from the start, or from the relaxed springs under a load that grows in steps, or from the equilibrium without
  the moments while these grow.
- "fixed_point": the recursion of [Troise 2021] Figure 6, `y <- rest + (J_k^T w - g_k) / k`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from eigenpy import LDLT

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.friction_coordinates import MOST_ROUNDS, SAME_FRICTION, GuideFriction
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.solver import settle
from softrobots.statics.contact.touch import TOUCHING
from softrobots.statics.elastic_state import (
    TOLERANCE,
    ElasticProblem,
    ElasticState,
    largest_residual,
    norm,
    positive,
    scaled,
)
from softrobots.statics.loads import Load
from softrobots.statics.stability import is_positive, is_stable

METHODS = ("newton", "fixed_point")
"""The solvers of `solve_equilibrium`."""

MOST_ITERATIONS = {"newton": 200, "fixed_point": 1000}
"""Default limit of evaluations of each solver."""

LARGEST_STEP = 0.5
"""Norm of the largest Newton step [rad]; the linear model of a revolute chain is inaccurate beyond."""

ARMIJO = 1e-4
"""Share of the predicted decrease of the energy that a step must reach."""

CLEARLY = 1e3
"""Times `POSITIVE`: the sign of an eigenvalue beyond does not depend on the residual that is left."""

_GUIDED = 10  # times the evaluations, of robots whose actuators rub in their guides
_FINER = 1e-2  # of the tolerance, in each round of these: what is left moves the friction of the next
_SHORTEST = 1e-12  # share of a Newton step below which it is not halved again


def solve_springs(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    method: str = "newton",
    tolerance: float = TOLERANCE,
    max_iterations: int | None = None,
) -> tuple[ElasticState, int, bool]:
    """Solve for the elastic coordinates; arguments are not checked, and `MOST_ITERATIONS` is the default limit of evaluations.

    Returns:
        The last state, whether or not it meets the tolerance (see `largest_residual`); the evaluations spent; and whether that
        state is stable (see `softrobots.statics.stability`).

    Raises:
        ParameterError: If the load has an environment and a moment, or the method is not "newton" there.
    """
    usual = MOST_ITERATIONS[method] * (_GUIDED if model.structure.guided else 1)
    most = usual if max_iterations is None else max_iterations
    solve = _fixed_point if method == "fixed_point" else _descend if load.conservative else _grow_load
    if load.environment is not None:
        if method != "newton":
            raise ParameterError("method", method, "'newton' in contact with an environment")
        if not load.conservative:
            raise ParameterError(
                "wrench", load.wrenches, "forces only in contact: follow_contact takes moments, which have no energy"
            )
        solve = settle
    tolerance = tolerance * (_FINER if model.structure.guided else 1.0)
    with one_blas_thread(model.n_springs):
        if model.structure.guided:  # begins as at the start, whose friction holds the robot near to it
            model, _ = GuideFriction().after(
                model, q_motors, start, ElasticProblem(model, q_motors, load, tolerance).state(start).load.motors
            )
        state, spent, stable = solve(ElasticProblem(model, q_motors, load, tolerance), start, most)
        rounds, left = GuideFriction(), MOST_ROUNDS
        while model.structure.guided:  # the friction of guides follows the tensions
            model, off = rounds.after(model, q_motors, state.q_springs, state.load.motors)
            if off <= SAME_FRICTION:
                break
            left -= 1
            if spent >= most or left == 0 or math.isinf(off):
                return state._replace(error=math.inf), spent, False
            state, used, stable = solve(ElasticProblem(model, q_motors, load, tolerance), state.q_springs, most - spent)
            spent += used
    return state, spent, stable


def balanced_state(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    method: str = "newton",
    tolerance: float = TOLERANCE,
) -> ElasticState | None:
    """Solve for the elastic coordinates; None where the residual stays above `TOLERANCE`, or a gap is not what it must be."""
    state, _, _ = solve_springs(model, q_motors, load, start, method=method, tolerance=tolerance)
    if state.touch is not None:
        values, pressed = state.touch.gaps.values, state.touch.forces > 0.0
        if np.where(pressed, np.abs(values), -values).max(initial=0.0) > TOUCHING * model.reach:
            return None
    return state if state.error <= largest_residual(model, state.scale, max(tolerance, TOLERANCE)) else None


def _fixed_point(problem: ElasticProblem, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Recursion `y <- rest + (J_k^T w - g_k) / k`, [Troise 2021] Figure 6; the best iterate."""
    model = problem.model
    state = best = problem.state(start)
    for iteration in range(most):
        if problem.balanced(state):
            return state, iteration, is_stable(problem.model, problem.load, state)
        state = problem.state(model.rest + state.load.elastic / model.stiffness)
        best = state if state.error < best.error else best
    return best, most, is_stable(problem.model, problem.load, best)


def _descend(problem: ElasticProblem, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Newton descent on the energy; it leaves unstable equilibria."""
    model, stiffness, factors = problem.model, problem.model.stiffness, LDLT(len(start))
    state, spent, stalled = problem.state(start), 0, False
    while spent < most:
        balanced = problem.balanced(state)
        if balanced and is_positive(model, state.tangent, factors, times=CLEARLY):
            return state, spent, True
        if balanced and state.error > 0.0 and is_positive(model, state.tangent, factors, times=-CLEARLY):
            # Nearly neutral: the least eigenvalue is as far from its value as the residual from zero.
            finer = problem.state(state.q_springs + _stiff_step(state, stiffness))
            spent += 1
            if finer.error < 0.5 * state.error:
                state = finer
                continue
        if balanced and is_positive(model, state.tangent, factors):
            return state, spent, True
        step = _escape(state, stiffness) if balanced or stalled else _newton_step(state, stiffness, factors)
        if step is None:  # neutral equilibrium: neither stable nor unstable
            break
        slope = float(state.residual.dot(step))
        scale = 1.0
        trial = problem.state(state.q_springs + step)
        spent += 1
        while problem.too_high(trial, state, ARMIJO * scale * slope) and scale > _SHORTEST:
            if spent >= most:  # within a step: the last state is the best
                return state, spent, is_positive(model, state.tangent)
            scale *= 0.5
            trial = problem.state(state.q_springs + scale * step)
            spent += 1
        if not math.isfinite(trial.energy):  # a section is at the end of its range, and the load presses it on
            break
        # Below rounding the energy says nothing; there the residual must shrink.
        if not balanced and not stalled and trial.error >= state.error and -slope < problem.rounding(state):
            if not is_positive(model, state.tangent, factors):
                stalled = True  # beside a saddle, where Newton's step leads away from equilibrium: leave it downhill
                continue
            trial = problem.state(state.q_springs + _stiff_step(state, stiffness))
            spent += 1
            if trial.error >= state.error:
                break
        state, stalled = trial, False
    return state, spent, is_positive(model, state.tangent)


def _newton_step(state: ElasticState, stiffness: FloatArray, factors: Any) -> FloatArray:
    """Newton step on the energy; where the tangent is not positive definite, with its eigenvalues made positive.

    The eigenvalues are those in coordinates scaled by the springs' own stiffness, so that a soft spring beside a stiff one
    keeps its share.
    """
    length = 0.0
    if positive(factors, state.tangent):
        step = factors.solve(-state.residual).ravel()  # Eigen returns one row as a matrix
        length = norm(step)
    if length == 0.0:  # also where a pivot is zero, and the residual in its direction
        softness = 1.0 / np.sqrt(stiffness)
        values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
        values = np.maximum(np.abs(values), 1e-3)
        step = -softness * (vectors @ ((vectors.T @ (softness * state.residual)) / values))
        length = norm(step)
    return np.asarray(step if length <= LARGEST_STEP else step * (LARGEST_STEP / length))


def _stiff_step(state: ElasticState, stiffness: FloatArray) -> FloatArray:
    """The part of a Newton step along stiff directions; at the bottom of a curved valley the rest leads out of it."""
    softness = 1.0 / np.sqrt(stiffness)
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    pull = vectors.T @ (softness * state.residual)
    return np.asarray(-softness * (vectors @ np.where(values > 1e-3, pull / np.maximum(values, 1e-3), 0.0)))


def _escape(state: ElasticState, stiffness: FloatArray) -> FloatArray | None:
    """Step out of an unstable equilibrium along its softest direction; None at a neutral one.

    Both signs lower the energy; the one with the positive largest component is taken, so that results repeat.
    """
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    if values[0] > -POSITIVE:
        return None
    direction = vectors[:, 0] / np.sqrt(stiffness)
    direction = direction / norm(direction)
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    return np.asarray(sign * 0.1 * direction)


def _grow_load(problem: ElasticProblem, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """For loads without a potential: plain Newton from the start, else from the relaxed springs under a growing load.

    Where that path turns back, the moments alone grow, from the stable equilibrium under forces and gravity.
    """
    model, motors, whole = problem.model, problem.q_motors, problem.load
    found, spent = newton(model, motors, whole, start, tolerance=problem.tolerance, max_iterations=min(20, most))
    if found is None:
        found, furthest, used = _grown(problem, whole.scaled, np.asarray(model.rest), (most - spent) * 2 // 3)
        spent += used
    if found is None:
        calm = ElasticProblem(model, motors, whole.with_moments(0.0), problem.tolerance)
        state, used, stable = _descend(calm, start, most - spent)
        spent += used
        if stable and calm.balanced(state):
            found, _, used = _grown(problem, whole.with_moments, state.q_springs, most - spent)
            spent += used
    last = problem.state(furthest) if found is None else found
    return last, spent, is_stable(problem.model, problem.load, last)


def _grown(
    problem: ElasticProblem, part: Callable[[float], Load], y: FloatArray, most: int
) -> tuple[ElasticState | None, FloatArray, int]:
    """Newton under a load that grows from its part 0, where the springs are at `y`, to 1.

    Returns:
        The equilibrium, or None where the path turns back; the springs as far as it went; and the evaluations spent.
    """
    reached, step, spent = 0.0, 0.25, 0
    while spent < most and step > 1e-6:
        aim = min(1.0, reached + step)
        load, steps = problem.load if aim == 1.0 else part(aim), min(20, most - spent)
        found, used = newton(problem.model, problem.q_motors, load, y, tolerance=problem.tolerance, max_iterations=steps)
        spent += used
        if found is None:
            step *= 0.5
            continue
        if aim == 1.0:
            return found, y, spent
        reached, y, step = aim, found.q_springs, 2.0 * step
    return None, y, spent


def newton(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    tolerance: float = TOLERANCE,
    max_iterations: int = 20,
) -> tuple[ElasticState | None, int]:
    """Undamped Newton, also to unstable equilibria; gives up at a singular tangent or a step above `LARGEST_STEP`.

    Returns:
        The equilibrium, or None, and the evaluations spent.
    """
    problem = ElasticProblem(model, q_motors, load, tolerance)
    state = problem.state(start)
    for iteration in range(1, max_iterations + 1):
        if problem.balanced(state):
            return state, iteration
        try:
            step = np.linalg.solve(state.tangent, -state.residual)
        except np.linalg.LinAlgError:
            return None, iteration
        if float(step @ step) > LARGEST_STEP**2:
            return None, iteration
        state = problem.state(state.q_springs + step)
    return None, max_iterations
