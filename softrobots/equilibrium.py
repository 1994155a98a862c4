r"""Static equilibrium of a robot with joint springs, with a certificate.

The springs `y` are in equilibrium when the residual `r(y) = tau_spring(y) - J_k^T w + g_k` vanishes; motors are held exactly.
The tangent stiffness `K_t = dr/dy` tells stability: positive definite means stable ([Troise 2021] (5-7) give the
weightless, first-order form of this).

Two methods:

- "newton": Newton on the potential energy with the exact tangent, made positive definite where it is not, and halving of
  steps that do not lower the energy. It ends in a stable equilibrium. With a world-fixed moment in the load there is no
  energy; then the load grows in steps, with plain Newton at each.
- "fixed_point": the recursion of [Troise 2021] Figure 6, `y <- rest + (J_k^T w - g_k) / k`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.checks import FloatArray, choice, finite_array, positive_integer, positive_number, read_only
from softrobots.errors import EquilibriumNotFound
from softrobots.loads import GeneralisedLoad, Load, generalised_load
from softrobots.model import SoftModel

METHODS = ("newton", "fixed_point")
"""The solvers of `solve_equilibrium`."""

TOLERANCE = 1e-10
"""Default residual tolerance, relative to the scale of the load."""

_MOMENT_FLOOR = 1e-3  # [N m], scale of the residual for vanishing loads
_LARGEST_STEP = 0.5  # [rad], norm of one Newton step; the linear model of a revolute chain says little beyond
_STABLE = 1e-9  # smallest eigenvalue that counts as positive, relative to the largest stiffness
_DESCENT = 1e-4  # share of the predicted decrease that a step must reach (Armijo)
_ROUNDING = 1e-14  # energies this close, relative to their terms, cannot be told apart


class ElasticState(NamedTuple):
    """A configuration of the springs, in equilibrium or not, and everything statics needs there."""

    q_springs: FloatArray
    """Spring coordinates, shape (n_springs,) [rad or m]."""
    q: FloatArray
    """Pinocchio's configuration, shape (nq,)."""
    joints: GeneralisedLoad
    """The load in all joint coordinates."""
    residual: FloatArray
    """Out-of-balance torque of the springs, shape (n_springs,) [N m or N]."""
    tangent: FloatArray
    """Tangent stiffness, shape (n_springs, n_springs)."""
    energy: float
    """Elastic energy plus potential of the load [J]."""
    error: float
    """Norm of the residual."""


@dataclass(frozen=True)
class Equilibrium:
    """A solved static equilibrium; knows its model, load and motors, and can be saved with `softrobots.save`.

    Torques are loads carried, minus what spring or motor exerts.
    """

    model: SoftModel
    """The robot."""
    load: Load
    """The load."""
    method: str
    """The solver that found it."""
    q_motors: FloatArray
    """Motor coordinates, shape (n_motors,) [rad or m]."""
    q_springs: FloatArray
    """Spring coordinates, shape (n_springs,) [rad or m]."""
    q: FloatArray
    """Pinocchio's configuration, shape (nq,)."""
    spring_torques: FloatArray
    """Torque of each spring, `k (q - rest)`, shape (n_springs,) [N m or N]."""
    motor_torques: FloatArray
    """Load on each motor, `J_m^T w - g_m`, shape (n_motors,) [N m or N]."""
    tangent_stiffness: FloatArray
    """Derivative of the residual, shape (n_springs, n_springs)."""
    joint_derivative: FloatArray
    """Derivative of the load in all joint coordinates, shape (nv, nv)."""
    residual: float
    """Norm of the out-of-balance torque [N m]."""
    tolerance: float
    """What the residual had to stay below [N m]."""
    iterations: int
    """Evaluations of the residual after the first."""
    stable: bool
    """Certified: every eigenvalue of the tangent stiffness has a positive real part."""

    @property
    def conservative(self) -> bool:
        """Whether the load has a potential (no world-fixed moment), so that the tangent stiffness is symmetric."""
        return self.load.conservative

    @property
    def converged(self) -> bool:
        """Whether the residual meets the tolerance."""
        return self.residual <= self.tolerance

    @cached_property
    def transform_tip_to_world(self) -> Any:
        """Pose of the tip, a `pinocchio.SE3` [m]."""
        return frame_placement(self.model, self.q, self.model.tip)

    @property
    def tip_position(self) -> FloatArray:
        """Position of the tip in the world, shape (3,) [m]."""
        return np.array(self.transform_tip_to_world.translation)

    @cached_property
    def link_moments(self) -> FloatArray:
        """Moment at each inflated link, both springs combined (Euclidean norm), shape (n_links,) [N m].

        Empty if the model names no inflated links.
        """
        return read_only(np.array([np.linalg.norm(self.spring_torques[list(group.springs)]) for group in self.model.spring_groups]))

    @property
    def wrinkled(self) -> bool:
        """Whether a link carries its wrinkling moment or more, so that linear springs no longer hold."""
        return any(m >= group.wrinkling_moment for m, group in zip(self.link_moments, self.model.spring_groups, strict=True))

    @property
    def within_limits(self) -> bool:
        """Whether every motor and spring is within its joint limits; statics does not clip."""
        return _within(self.q_motors, self.model.motor_limits) and _within(self.q_springs, self.model.spring_limits)

    @cached_property
    def eigenvalues(self) -> FloatArray:
        """Real parts of the eigenvalues of the tangent stiffness, ascending, shape (n_springs,) [N m/rad]."""
        solver = np.linalg.eigvalsh if self.conservative else np.linalg.eigvals
        return read_only(np.sort(solver(self.tangent_stiffness).real))


def solve_equilibrium(
    model: SoftModel,
    q_motors: Any,
    force: Any = None,
    *,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    method: str = "newton",
    q_springs0: Any = None,
    tolerance: float = TOLERANCE,
    max_iterations: int | None = None,
) -> Equilibrium:
    """Find the static equilibrium of the springs at given motor coordinates.

    It is the one reached by energy descent from the relaxed springs, or from `q_springs0`.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        force: Force at `frame`, shape (3,) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], world axes, force first; or `{frame: (6,)}` for several.
        frame: Name of the frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes, e.g. `softrobots.EARTH_GRAVITY`; None: weightless.
        method: "newton", or "fixed_point" (the paper's, converges for small loads only).
        q_springs0: Where to start, shape (n_springs,) [rad or m]; the relaxed springs by default.
        tolerance: Largest residual, relative to `max(|f| reach + |moment| + |g|, 1e-3 N m)`.
        max_iterations: Most evaluations; 200 for "newton", 1000 for "fixed_point" by default.

    Returns:
        The equilibrium with its certificate.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        NameNotFound: If a frame does not exist.
        EquilibriumNotFound: If the residual stays above the tolerance; carries the best iterate.
    """
    choice("method", method, METHODS)
    motors = finite_array("q_motors", q_motors, (model.n_motors,), "rad")
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity)
    start = model.rest if q_springs0 is None else finite_array("q_springs0", q_springs0, (model.n_springs,), "rad")
    positive_number("tolerance", tolerance)
    most = (200 if method == "newton" else 1000) if max_iterations is None else positive_integer("max_iterations", max_iterations)
    state, iterations = settle(model, motors, load, start, method=method, tolerance=tolerance, max_iterations=most)
    result = equilibrium_from_state(model, motors, load, state, method=method, iterations=iterations, tolerance=tolerance)
    if not result.converged:
        raise EquilibriumNotFound(
            f"no equilibrium by {method!r} in {iterations} iterations: residual {result.residual:.3g} N m, required "
            f"{result.tolerance:.3g} N m" + ("; method='newton' converges for larger loads" if method == "fixed_point" else ""),
            best=result,
            residual=result.residual,
            iterations=iterations,
        )
    return result


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
    if method == "fixed_point":
        return _fixed_point(case, start, max_iterations)
    return (_descend if load.conservative else _grow_load)(case, start, max_iterations)


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
    q = model.assemble(q_motors, q_springs)
    joints = generalised_load(model, q, load)
    springs, law = model.spring_indices, model.springs
    residual = law.torque(q_springs) - joints.torque[springs]
    tangent = -joints.derivative[springs[:, None], springs]
    tangent.flat[:: tangent.shape[0] + 1] += law.tangent(q_springs)
    energy = law.energy(q_springs) + joints.potential
    return ElasticState(q_springs, q, joints, residual, tangent, energy, math.sqrt(float(residual @ residual)))


def largest_residual(joints: GeneralisedLoad, tolerance: float) -> float:
    """Largest residual that counts as equilibrium: `tolerance * max(|f| reach + |moment| + |g|, 1e-3 N m)` [N m]."""
    return tolerance * max(joints.scale, _MOMENT_FLOOR)


def equilibrium_from_state(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    state: ElasticState,
    *,
    method: str,
    iterations: int,
    tolerance: float = TOLERANCE,
) -> Equilibrium:
    """Make the result object of a state."""
    return Equilibrium(
        model=model,
        load=load,
        method=method,
        q_motors=read_only(q_motors),
        q_springs=read_only(state.q_springs),
        q=read_only(state.q),
        spring_torques=read_only(model.springs.torque(state.q_springs)),
        motor_torques=read_only(state.joints.torque[model.motor_indices]),
        tangent_stiffness=read_only(state.tangent),
        joint_derivative=read_only(state.joints.derivative),
        residual=state.error,
        tolerance=largest_residual(state.joints, tolerance),
        iterations=iterations,
        stable=is_stable(model, state.tangent, symmetric=load.conservative),
    )


def frame_placement(model: SoftModel, q: FloatArray, frame: str) -> Any:
    """Pose of a frame in the world, a `pinocchio.SE3` [m]."""
    pin_model, data = model.workspace(None)
    pin.forwardKinematics(pin_model, data, q)
    return pin.SE3(pin.updateFramePlacement(pin_model, data, model.frame_id(frame)))


class _Case(NamedTuple):
    """What stays the same while one equilibrium is sought."""

    model: SoftModel
    q_motors: FloatArray
    load: Load
    tolerance: float

    def state(self, q_springs: FloatArray) -> ElasticState:
        return elastic_state(self.model, self.q_motors, q_springs, self.load)

    def settled(self, state: ElasticState) -> bool:
        return state.error <= largest_residual(state.joints, self.tolerance)

    def stable(self, state: ElasticState) -> bool:
        return is_stable(self.model, state.tangent, symmetric=self.load.conservative)


def is_stable(model: SoftModel, tangent: FloatArray, *, symmetric: bool) -> bool:
    """Whether every eigenvalue of a tangent stiffness has a real part above rounding, 1e-9 of the stiffest spring.

    For a symmetric tangent a Cholesky factorisation is the certificate.

    Args:
        model: The robot.
        tangent: Tangent stiffness, shape (n_springs, n_springs).
        symmetric: Whether it is symmetric.
    """
    margin = _STABLE * model.stiffest
    if not symmetric:
        return bool(np.all(np.linalg.eigvals(tangent).real > margin))
    shifted = tangent.copy()
    shifted.flat[:: len(tangent) + 1] -= margin
    try:
        np.linalg.cholesky(shifted)
    except np.linalg.LinAlgError:
        return False
    return True


def _within(values: FloatArray, limits: FloatArray) -> bool:
    return bool(np.all((values >= limits[:, 0]) & (values <= limits[:, 1])))


def _fixed_point(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """Repeat `y <- rest + (J_k^T w - g_k) / k`, [Troise 2021] Figure 6; return the best iterate."""
    model = case.model
    state = best = case.state(start)
    for iteration in range(most):
        if case.settled(state):
            return state, iteration
        state = case.state(model.rest + state.joints.torque[model.spring_indices] / model.stiffness)
        best = state if state.error < best.error else best
    return best, most


def _descend(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """Newton descent on the energy, out of unstable equilibria too."""
    stiffness = case.model.stiffest
    state, spent = case.state(start), 0
    while spent < most:
        settled = case.settled(state)
        if settled and case.stable(state):
            break
        step = _escape(state, stiffness) if settled else _newton_step(state, stiffness)
        if step is None:  # neutral equilibrium: balanced, neither stable nor unstable
            break
        slope = float(state.residual @ step)
        terms = abs(state.energy) + abs(state.joints.potential) + stiffness * float(state.q_springs @ state.q_springs)
        rounding = _ROUNDING * terms
        scale = 1.0
        trial = case.state(state.q_springs + step)
        spent += 1
        while trial.energy > state.energy + _DESCENT * scale * slope + rounding and spent < most:
            scale *= 0.5
            trial = case.state(state.q_springs + scale * step)
            spent += 1
        # Below rounding the energy says nothing; there the residual must shrink.
        if not settled and -slope < rounding and trial.error >= state.error:
            break
        state = trial
    return state, spent


def _newton_step(state: ElasticState, stiffness: float) -> FloatArray:
    """Newton step on the energy; where the tangent is not positive definite, with its eigenvalues made positive."""
    try:
        np.linalg.cholesky(state.tangent)
        step = np.linalg.solve(state.tangent, -state.residual)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(state.tangent)
        values = np.maximum(np.abs(values), 1e-3 * stiffness)
        step = -vectors @ ((vectors.T @ state.residual) / values)
    length = math.sqrt(float(step @ step))
    return np.asarray(step if length <= _LARGEST_STEP else step * (_LARGEST_STEP / length))


def _escape(state: ElasticState, stiffness: float) -> FloatArray | None:
    """Step out of an unstable equilibrium along its softest direction; None at a neutral one.

    Both signs lower the energy; the one with the positive largest component is taken, so that answers repeat.
    """
    values, vectors = np.linalg.eigh(state.tangent)
    if values[0] > -_STABLE * stiffness:
        return None
    direction = vectors[:, 0]
    sign = 1.0 if direction[np.argmax(np.abs(direction))] > 0.0 else -1.0
    return np.asarray(sign * 0.1 * direction)


def _grow_load(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int]:
    """Plain Newton under a load that grows from zero in steps: for loads without a potential."""
    reached, step, spent, y = 0.0, 0.25, 0, start
    while spent < most and step > 1e-6:
        aim = min(1.0, reached + step)
        part = case if aim == 1.0 else case._replace(load=case.load.scaled(aim))
        state, used, arrived = _newton(part, y, min(20, most - spent))
        spent += used
        if arrived and aim == 1.0:
            return state, spent
        if arrived:
            reached, y, step = aim, state.q_springs, 2.0 * step
        else:
            step *= 0.5
    return case.state(y), spent


def _newton(case: _Case, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Undamped Newton; gives up at a singular tangent or a step too long to trust."""
    state = case.state(start)
    for iteration in range(1, most + 1):
        if case.settled(state):
            return state, iteration, True
        try:
            step = np.linalg.solve(state.tangent, -state.residual)
        except np.linalg.LinAlgError:
            return state, iteration, False
        if float(step @ step) > _LARGEST_STEP**2:
            return state, iteration, False
        state = case.state(state.q_springs + step)
    return state, most, case.settled(state)
