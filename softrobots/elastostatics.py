r"""Elastostatics: settling the elastic coordinates under a load, and telling whether they are stable.

The elastic coordinates `y` (springs, sections) are in equilibrium when the residual `r(y) = tau_spring(y) - J_k^T w + g_k`
vanishes; actuators are held exactly. Where joints follow sections, `J_k` is Pinocchio's Jacobian times `dm/dz`
(`softrobots.coordinates`). The tangent stiffness `K_t = dr/dy` tells stability: positive definite means stable
([Troise 2021] (5-7) give the weightless, first-order form of this).

Two methods:

- "newton": Newton on the potential energy with the exact tangent, made positive definite where it is not, and halving of
  steps that do not lower the energy. It ends in a stable equilibrium. With a world-fixed moment in the load there is no
  energy; then plain Newton from the start, or from the relaxed springs under a load that grows in steps.
- "fixed_point": the recursion of [Troise 2021] Figure 6, `y <- rest + (J_k^T w - g_k) / k`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softrobots.blas_threads import one_blas_thread
from softrobots.checks import FloatArray
from softrobots.coordinates import Point, ReducedLoad
from softrobots.loads import Load, generalised_load
from softrobots.model import SoftModel

METHODS = ("newton", "fixed_point")
"""The solvers of `solve_equilibrium`."""

TOLERANCE = 1e-10
"""Default residual tolerance, relative to the scale of the load."""

_MOMENT_FLOOR = 1e-3  # [N m], scale of the residual for vanishing loads
_LARGEST_STEP = 0.5  # [rad], norm of one Newton step; the linear model of a revolute chain says little beyond
_STABLE = 1e-9  # smallest eigenvalue that counts as positive, relative to the springs' own stiffness
_DESCENT = 1e-4  # share of the predicted decrease that a step must reach (Armijo)
_SHORTEST = 1e-12  # share of a Newton step below which it is not halved again
_ROUNDING = 1e-14  # energies this close, relative to their terms, cannot be told apart


class ElasticState(NamedTuple):
    """Elastic coordinates, in equilibrium or not, and everything statics needs there."""

    q_springs: FloatArray
    """Elastic coordinates, shape (n_springs,) [rad or m]."""
    q: FloatArray
    """Pinocchio's configuration, shape (nq,)."""
    point: Point
    """The same robot as joint positions and their derivatives."""
    load: ReducedLoad
    """The load in actuator and elastic coordinates."""
    scale: float
    """Size of the load [N m]."""
    residual: FloatArray
    """Out-of-balance torque of the elastic coordinates, shape (n_springs,) [N m or N]."""
    tangent: FloatArray
    """Tangent stiffness, shape (n_springs, n_springs)."""
    energy: float
    """Elastic energy plus potential of the load [J]; infinite where the robot cannot be."""
    error: float
    """Norm of the residual; infinite where the robot cannot be."""


def settle(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    method: str = "newton",
    tolerance: float = TOLERANCE,
    max_iterations: int = 200,
) -> tuple[ElasticState, int]:
    """Solve for the springs with arguments that are known to be right; the core of every solver here.

    Returns:
        The last state, whether or not it meets the tolerance (see `largest_residual`), and the evaluations spent.
    """
    case = _Case(model, q_motors, load, tolerance)
    solve = _fixed_point if method == "fixed_point" else _descend if load.conservative else _grow_load
    with one_blas_thread(model.n_springs):
        return solve(case, start, max_iterations)


def settled(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    method: str = "newton",
    tolerance: float = TOLERANCE,
) -> ElasticState | None:
    """`settle`, or None where the springs do not settle to `TOLERANCE`."""
    most = 200 if method == "newton" else 1000
    state, _ = settle(model, q_motors, load, start, method=method, tolerance=tolerance, max_iterations=most)
    return state if state.error <= largest_residual(model, state.scale, max(tolerance, TOLERANCE)) else None


def elastic_state(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, load: Load) -> ElasticState:
    """Evaluate residual, tangent stiffness and energy at given coordinates.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        q_springs: Spring coordinates, shape (n_springs,) [rad or m].
        load: The load.

    Returns:
        The state.
    """
    point = model.coordinates.at(q_motors, q_springs)
    q = model.embed(point.joints)
    if not point.valid:
        return _nowhere(model, q_springs, q, point)
    joints = generalised_load(model, q, load)
    reduced = point.reduce(joints)
    law = model.springs
    residual = law.torque(q_springs) - reduced.elastic
    tangent = -reduced.derivative
    law.add_tangent(tangent, q_springs)
    energy = law.energy(q_springs) + joints.potential + reduced.potential
    scale = joints.scale + reduced.scale * model.reach
    return ElasticState(q_springs, q, point, reduced, scale, residual, tangent, energy, math.sqrt(float(residual @ residual)))


def _nowhere(model: SoftModel, q_springs: FloatArray, q: FloatArray, point: Point) -> ElasticState:
    """A state that no solver accepts: a section beyond its range."""
    n, m = model.n_springs, model.n_motors
    load = ReducedLoad(np.zeros(m), np.zeros(n), np.zeros((n, n)), np.zeros((n, m)), 0.0, 0.0)
    return ElasticState(q_springs, q, point, load, 0.0, np.zeros(n), np.zeros((n, n)), math.inf, math.inf)


def largest_residual(model: SoftModel, scale: float, tolerance: float) -> float:
    """Largest residual that counts as equilibrium: `tolerance * max(|f| reach + |moment| + |g|, 1e-3 N m)` [N m].

    Never below the rounding of the spring torques, which matters for stiff springs with rest angles only.

    Args:
        model: The robot.
        scale: Size of the load, `ElasticState.scale` [N m].
        tolerance: Relative tolerance.
    """
    return max(tolerance * max(scale, _MOMENT_FLOOR), model.rounding)


class _Case(NamedTuple):
    """What stays the same while one equilibrium is sought."""

    model: SoftModel
    q_motors: FloatArray
    load: Load
    tolerance: float

    def state(self, q_springs: FloatArray) -> ElasticState:
        return elastic_state(self.model, self.q_motors, q_springs, self.load)

    def settled(self, state: ElasticState) -> bool:
        return state.error <= largest_residual(self.model, state.scale, self.tolerance)

    def stable(self, state: ElasticState) -> bool:
        return is_stable(self.model, state.tangent, symmetric=self.load.conservative)


def is_stable(model: SoftModel, tangent: FloatArray, *, symmetric: bool) -> bool:
    """Whether every eigenvalue of a tangent stiffness has a real part above rounding.

    Taken in coordinates scaled by the springs' own stiffness, in which no unit and no stiff spring beside a soft one matters;
    rounding is 1e-9 there. A Cholesky factorisation of the symmetric part is the certificate (real parts of eigenvalues are at
    least its smallest one); where a tangent that is not symmetric lacks it, its eigenvalues decide.

    Args:
        model: The robot.
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        symmetric: Whether it is symmetric.
    """
    shifted = tangent.copy() if symmetric else 0.5 * (tangent + tangent.T)
    shifted.flat[:: len(tangent) + 1] -= _STABLE * model.stiffness
    try:
        with one_blas_thread(len(tangent)):
            np.linalg.cholesky(shifted)
    except np.linalg.LinAlgError:
        return not symmetric and bool(np.all(np.linalg.eigvals(scaled(tangent, model.stiffness)).real > _STABLE))
    return True


def scaled(tangent: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Tangent stiffness in coordinates scaled by the springs' own stiffness: 1 on the diagonal without load."""
    softness = 1.0 / np.sqrt(stiffness)
    return np.asarray(softness[:, None] * tangent * softness)


def _fixed_point(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """Repeat `y <- rest + (J_k^T w - g_k) / k`, [Troise 2021] Figure 6; return the best iterate."""
    model = case.model
    state = best = case.state(start)
    for iteration in range(most):
        if case.settled(state):
            return state, iteration
        state = case.state(model.rest + state.load.elastic / model.stiffness)
        best = state if state.error < best.error else best
    return best, most


def _descend(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """Newton descent on the energy, out of unstable equilibria too."""
    stiffness = case.model.stiffness
    state, spent = case.state(start), 0
    while spent < most:
        settled = case.settled(state)
        if settled and case.stable(state):
            break
        step = _escape(state, stiffness) if settled else _newton_step(state, stiffness)
        if step is None:  # neutral equilibrium: balanced, neither stable nor unstable
            break
        slope = float(state.residual @ step)
        # The terms of the energy are as large as this even where they cancel (a tip that is folded back to the base).
        rounding = _ROUNDING * (state.scale + float(stiffness @ (state.q_springs * state.q_springs)))
        scale = 1.0
        trial = case.state(state.q_springs + step)
        spent += 1
        while trial.energy > state.energy + _DESCENT * scale * slope + rounding and spent < most and scale > _SHORTEST:
            scale *= 0.5
            trial = case.state(state.q_springs + scale * step)
            spent += 1
        if not math.isfinite(trial.energy):  # a section is at the end of its range, and the load presses it on
            break
        # Below rounding the energy says nothing; there the residual must shrink.
        if not settled and -slope < rounding and trial.error >= state.error:
            break
        state = trial
    return state, spent


def _newton_step(state: ElasticState, stiffness: FloatArray) -> FloatArray:
    """Newton step on the energy; where the tangent is not positive definite, with its eigenvalues made positive.

    The eigenvalues are those in coordinates scaled by the springs' own stiffness, so that a soft spring beside a stiff one
    keeps its share.
    """
    try:
        np.linalg.cholesky(state.tangent)
        step = np.linalg.solve(state.tangent, -state.residual)
    except np.linalg.LinAlgError:
        softness = 1.0 / np.sqrt(stiffness)
        values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
        values = np.maximum(np.abs(values), 1e-3)
        step = -softness * (vectors @ ((vectors.T @ (softness * state.residual)) / values))
    length = math.sqrt(float(step @ step))
    return np.asarray(step if length <= _LARGEST_STEP else step * (_LARGEST_STEP / length))


def _escape(state: ElasticState, stiffness: FloatArray) -> FloatArray | None:
    """Step out of an unstable equilibrium along its softest direction; None at a neutral one.

    Both signs lower the energy; the one with the positive largest component is taken, so that answers repeat.
    """
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    if values[0] > -_STABLE:
        return None
    direction = vectors[:, 0] / np.sqrt(stiffness)
    direction = direction / math.sqrt(float(direction @ direction))
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    return np.asarray(sign * 0.1 * direction)


def _grow_load(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """For loads without a potential: plain Newton from the start, else from the relaxed springs under a growing load."""
    model, motors = case.model, case.q_motors
    found, spent = newton(model, motors, case.load, start, tolerance=case.tolerance, max_iterations=min(20, most))
    if found is not None:
        return found, spent
    reached, step, y = 0.0, 0.25, np.asarray(model.rest)
    while spent < most and step > 1e-6:
        aim = min(1.0, reached + step)
        part = case.load if aim == 1.0 else case.load.scaled(aim)
        found, used = newton(model, motors, part, y, tolerance=case.tolerance, max_iterations=min(20, most - spent))
        spent += used
        if found is not None and aim == 1.0:
            return found, spent
        if found is not None:
            reached, y, step = aim, found.q_springs, 2.0 * step
        else:
            step *= 0.5
    return case.state(y), spent


def newton(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    start: FloatArray,
    *,
    tolerance: float = TOLERANCE,
    max_iterations: int = 20,
    largest_step: float = _LARGEST_STEP,
) -> tuple[ElasticState | None, int]:
    """Undamped Newton; gives up at a singular tangent or a step too long to trust. It goes to unstable equilibria too.

    Returns:
        The equilibrium, or None, and the evaluations spent.
    """
    state = elastic_state(model, q_motors, start, load)
    for iteration in range(1, max_iterations + 1):
        if state.error <= largest_residual(model, state.scale, tolerance):
            return state, iteration
        try:
            step = np.linalg.solve(state.tangent, -state.residual)
        except np.linalg.LinAlgError:
            return None, iteration
        if float(step @ step) > largest_step**2:
            return None, iteration
        state = elastic_state(model, q_motors, state.q_springs + step, load)
    return None, max_iterations
