r"""Elastostatics: settling the elastic coordinates under a load, and telling whether they are stable.

The elastic coordinates `y` (springs, sections) are in equilibrium when the residual `r(y) = tau_spring(y) - J_k^T w + g_k`
vanishes; actuators are held exactly. Where joints follow sections, `J_k` is Pinocchio's Jacobian times `dm/dz`
(`softrobots.model.coordinates`). The tangent stiffness `K_t = dr/dy` tells stability: positive definite means stable
([Troise 2021] (5-7) give the weightless, first-order form of this).

Two methods:

- "newton": Newton on the potential energy with the exact tangent, made positive definite where it is not, and halving of
  steps that do not lower the energy. It ends in a stable equilibrium. With a world-fixed moment in the load there is no
  energy; then plain Newton from the start, or from the relaxed springs under a load that grows in steps, or from that
  without the moments while these grow.
- "fixed_point": the recursion of [Troise 2021] Figure 6, `y <- rest + (J_k^T w - g_k) / k`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from eigenpy import LDLT, ComputationInfo

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.model.coordinates import Point, ReducedLoad
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.loads import AppliedLoad, Load

METHODS = ("newton", "fixed_point")
"""The solvers of `solve_equilibrium`."""

TOLERANCE = 1e-10
"""Default residual tolerance, relative to the scale of the load."""

MOMENT_FLOOR = 1e-3
"""Least scale of the residual, for vanishing loads [N m]."""

LARGEST_STEP = 0.5
"""Norm of the largest Newton step [rad]; the linear model of a revolute chain says little beyond."""

ARMIJO = 1e-4
"""Share of the predicted decrease of the energy that a step must reach."""

ENERGY_ROUNDING = 1e-14
"""Energies this close, relative to their terms, cannot be told apart."""

_SHORTEST = 1e-12  # share of a Newton step below which it is not halved again


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
    spring_torques: FloatArray
    """Load that the springs carry, shape (n_springs,) [N m or N]."""
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
) -> tuple[ElasticState, int, bool]:
    """Solve for the springs with arguments that are known to be right; the core of every solver here.

    Returns:
        The last state, whether or not it meets the tolerance (see `largest_residual`); the evaluations spent; and whether that
        state is stable (see `is_stable`).
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
    state, _, _ = settle(model, q_motors, load, start, method=method, tolerance=tolerance, max_iterations=most)
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
    with one_blas_thread(model.n_springs):
        return _Case(model, q_motors, load).state(q_springs)


def _nowhere(model: SoftModel, q_springs: FloatArray, q: FloatArray, point: Point) -> ElasticState:
    """A state that no solver accepts: a section beyond its range."""
    n, m = model.n_springs, model.n_motors
    load = ReducedLoad(np.zeros(m), np.zeros(n), np.zeros((n, n)), np.zeros((n, m)), 0.0, 0.0)
    _, torques, _ = model.springs.at(q_springs)
    return ElasticState(q_springs, q, point, load, torques, 0.0, np.zeros(n), np.zeros((n, n)), math.inf, math.inf)


def largest_residual(model: SoftModel, scale: float, tolerance: float) -> float:
    """Largest residual that counts as equilibrium: `tolerance * max(|f| reach + |moment| + |g|, 1e-3 N m)` [N m].

    Never below the rounding of the spring torques, which matters for stiff springs with rest angles only.

    Args:
        model: The robot.
        scale: Size of the load, `ElasticState.scale` [N m].
        tolerance: Relative tolerance.
    """
    return max(tolerance * max(scale, MOMENT_FLOOR), model.rounding)


class _Case:
    """What stays the same while one equilibrium is sought."""

    def __init__(self, model: SoftModel, q_motors: FloatArray, load: Load, tolerance: float = TOLERANCE) -> None:
        self.model, self.q_motors, self.load, self.tolerance = model, q_motors, load, tolerance
        self._coordinates, self._springs, self._reach = model.coordinates, model.springs, model.reach
        self._applied = AppliedLoad(model, load)

    def state(self, q_springs: FloatArray) -> ElasticState:
        """Evaluate residual, tangent stiffness and energy."""
        point = self._coordinates.at(self.q_motors, q_springs)
        q = self.model.embed(point.joints)
        if not point.valid:
            return _nowhere(self.model, q_springs, q, point)
        joints = self._applied.at(q)
        reduced = point.reduce(joints)
        stored, torques, stiffness = self._springs.at(q_springs)
        residual = torques - reduced.elastic
        tangent = stiffness - reduced.derivative
        energy = stored + joints.potential + reduced.potential
        scale = joints.scale + reduced.scale * self._reach
        return ElasticState(q_springs, q, point, reduced, torques, scale, residual, tangent, energy, norm(residual))

    def settled(self, state: ElasticState) -> bool:
        return state.error <= largest_residual(self.model, state.scale, self.tolerance)

    def stable(self, state: ElasticState, factors: Any = None) -> bool:
        return is_stable(self.model, state.tangent, symmetric=self.load.conservative, factors=factors)

    def too_high(self, trial: ElasticState, state: ElasticState, change: float) -> bool:
        """Whether the energy of a trial is above that of a state by more than a change and rounding."""
        highest = state.energy + change
        return trial.energy > highest and trial.energy > highest + self.rounding(state)

    def rounding(self, state: ElasticState) -> float:
        """Rounding of the energy [J]: its terms are as large as this even where they cancel (a tip folded back to the base).

        The energy itself counts, too: where weight loads no spring (an upright robot), it is still mass times height.
        """
        elastic = float(self.model.stiffness.dot(state.q_springs * state.q_springs))
        return ENERGY_ROUNDING * (state.scale + elastic + abs(state.energy))


def is_stable(model: SoftModel, tangent: FloatArray, *, symmetric: bool, factors: Any = None) -> bool:
    """Whether every eigenvalue of a tangent stiffness has a real part above rounding.

    Taken in coordinates scaled by the springs' own stiffness, in which no unit and no stiff spring beside a soft one matters;
    rounding is 1e-9 there. The pivots of the symmetric part are the certificate (real parts of eigenvalues are at least its
    smallest one); where a tangent that is not symmetric lacks it, its eigenvalues decide.

    The factorisation `L D L^T` is Eigen's: for four rows it takes a ninth of the time of NumPy's Cholesky, and one thread.

    Args:
        model: The robot.
        tangent: Tangent stiffness, shape (n_springs, n_springs); one that is not finite is not stable.
        symmetric: Whether it is symmetric.
        factors: An `eigenpy.LDLT` of its size to work in, which saves making one.
    """
    part = tangent if symmetric else 0.5 * (tangent + tangent.T)
    if not math.isfinite(np.vdot(part, part)):  # Eigen takes a NaN for positive
        return False
    factors = LDLT(len(part)) if factors is None else factors
    if positive(factors, part - model.springs.least_tangent):
        return True
    if symmetric:
        return False
    with one_blas_thread(len(tangent)):
        return bool(np.all(np.linalg.eigvals(scaled(tangent, model.stiffness)).real > POSITIVE))


def positive(factors: Any, matrix: FloatArray) -> bool:
    """Factorise a symmetric matrix; whether no pivot is negative.

    Eigen calls a matrix positive, too, whose diagonal vanishes before it is done, but then it tells of a numerical issue.
    """
    return bool(factors.compute(matrix).isPositive() and factors.info() == ComputationInfo.Success)


def norm(vector: FloatArray) -> float:
    """Euclidean norm."""
    return math.hypot(*vector.tolist())


def scaled(tangent: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Tangent stiffness in coordinates scaled by the springs' own stiffness: 1 on the diagonal without load."""
    softness = 1.0 / np.sqrt(stiffness)
    return np.asarray(softness[:, None] * tangent * softness)


def _fixed_point(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Repeat `y <- rest + (J_k^T w - g_k) / k`, [Troise 2021] Figure 6; return the best iterate."""
    model = case.model
    state = best = case.state(start)
    for iteration in range(most):
        if case.settled(state):
            return state, iteration, case.stable(state)
        state = case.state(model.rest + state.load.elastic / model.stiffness)
        best = state if state.error < best.error else best
    return best, most, case.stable(best)


def _descend(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Newton descent on the energy, out of unstable equilibria too."""
    stiffness, factors = case.model.stiffness, LDLT(len(start))
    state, spent, stalled = case.state(start), 0, False
    while spent < most:
        settled = case.settled(state)
        if settled and case.stable(state, factors):
            return state, spent, True
        step = _escape(state, stiffness) if settled or stalled else _newton_step(state, stiffness, factors)
        if step is None:  # neutral equilibrium: balanced, neither stable nor unstable
            break
        slope = float(state.residual.dot(step))
        scale = 1.0
        trial = case.state(state.q_springs + step)
        spent += 1
        while case.too_high(trial, state, ARMIJO * scale * slope) and scale > _SHORTEST:
            if spent >= most:  # within a step: the last state is the best
                return state, spent, case.stable(state)
            scale *= 0.5
            trial = case.state(state.q_springs + scale * step)
            spent += 1
        if not math.isfinite(trial.energy):  # a section is at the end of its range, and the load presses it on
            break
        # Below rounding the energy says nothing; there the residual must shrink.
        if not settled and not stalled and trial.error >= state.error and -slope < case.rounding(state):
            if not case.stable(state, factors):
                stalled = True  # beside a saddle, where Newton's step leads away from the balance: leave it downhill
                continue
            trial = case.state(state.q_springs + _stiff_step(state, stiffness))
            spent += 1
            if trial.error >= state.error:
                break
        state, stalled = trial, False
    return state, spent, case.stable(state)


def _newton_step(state: ElasticState, stiffness: FloatArray, factors: Any) -> FloatArray:
    """Newton step on the energy; where the tangent is not positive definite, with its eigenvalues made positive.

    The eigenvalues are those in coordinates scaled by the springs' own stiffness, so that a soft spring beside a stiff one
    keeps its share.
    """
    length = 0.0
    if positive(factors, state.tangent):
        step = factors.solve(-state.residual).ravel()  # Eigen answers one row with a matrix
        length = norm(step)
    if length == 0.0:  # also where a pivot is zero, and the residual in its direction
        softness = 1.0 / np.sqrt(stiffness)
        values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
        values = np.maximum(np.abs(values), 1e-3)
        step = -softness * (vectors @ ((vectors.T @ (softness * state.residual)) / values))
        length = norm(step)
    return np.asarray(step if length <= LARGEST_STEP else step * (LARGEST_STEP / length))


def _stiff_step(state: ElasticState, stiffness: FloatArray) -> FloatArray:
    """The part of a Newton step that moves against stiffness: at the bottom of a curved valley the rest leads out of it."""
    softness = 1.0 / np.sqrt(stiffness)
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    pull = vectors.T @ (softness * state.residual)
    return np.asarray(-softness * (vectors @ np.where(values > 1e-3, pull / np.maximum(values, 1e-3), 0.0)))


def _escape(state: ElasticState, stiffness: FloatArray) -> FloatArray | None:
    """Step out of an unstable equilibrium along its softest direction; None at a neutral one.

    Both signs lower the energy; the one with the positive largest component is taken, so that answers repeat.
    """
    values, vectors = np.linalg.eigh(scaled(state.tangent, stiffness))
    if values[0] > -POSITIVE:
        return None
    direction = vectors[:, 0] / np.sqrt(stiffness)
    direction = direction / norm(direction)
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    return np.asarray(sign * 0.1 * direction)


def _grow_load(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """For loads without a potential: plain Newton from the start, else from the relaxed springs under a growing load.

    Where the path of that turns back, the moments alone grow, from the equilibrium that descent finds under all the rest.
    """
    model, motors, whole = case.model, case.q_motors, case.load
    found, spent = newton(model, motors, whole, start, tolerance=case.tolerance, max_iterations=min(20, most))
    if found is None:
        found, furthest, used = _grown(case, whole.scaled, np.asarray(model.rest), (most - spent) * 2 // 3)
        spent += used
    if found is None:
        calm = _Case(model, motors, whole.with_moments(0.0), case.tolerance)
        state, used, stable = _descend(calm, start, most - spent)
        spent += used
        if stable and calm.settled(state):
            found, _, used = _grown(case, whole.with_moments, state.q_springs, most - spent)
            spent += used
    last = case.state(furthest) if found is None else found
    return last, spent, case.stable(last)


def _grown(case: _Case, part: Callable[[float], Load], y: FloatArray, most: int) -> tuple[ElasticState | None, FloatArray, int]:
    """Newton under a load that grows from its part 0, where the springs are at `y`, to 1.

    Returns:
        The equilibrium, or None where the path turns back; the springs as far as it went; and the evaluations spent.
    """
    reached, step, spent = 0.0, 0.25, 0
    while spent < most and step > 1e-6:
        aim = min(1.0, reached + step)
        load, steps = case.load if aim == 1.0 else part(aim), min(20, most - spent)
        found, used = newton(case.model, case.q_motors, load, y, tolerance=case.tolerance, max_iterations=steps)
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
    largest_step: float = LARGEST_STEP,
) -> tuple[ElasticState | None, int]:
    """Undamped Newton; gives up at a singular tangent or a step too long to trust. It goes to unstable equilibria too.

    Returns:
        The equilibrium, or None, and the evaluations spent.
    """
    case = _Case(model, q_motors, load, tolerance)
    state = case.state(start)
    for iteration in range(1, max_iterations + 1):
        if case.settled(state):
            return state, iteration
        try:
            step = np.linalg.solve(state.tangent, -state.residual)
        except np.linalg.LinAlgError:
            return None, iteration
        if float(step @ step) > largest_step**2:
            return None, iteration
        state = case.state(state.q_springs + step)
    return None, max_iterations
