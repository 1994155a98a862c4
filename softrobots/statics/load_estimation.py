"""Estimation of the force at the tip, and of the shape of the robot, from motor torques.

Given motor coordinates and motor torques `tau_m = J_m^T f - g_m` with no moment at the tip, find the force `f` and the
springs `y` together. A force is unobservable along a direction in which the motors hardly move the tip (elbow straight, tip on
the axis of the first motor); the result names such directions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array, positive_integer, positive_number, read_only
from softrobots.core.errors import LoadNotFound, ParameterError
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, elastic_state, largest_residual
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state
from softrobots.statics.force_search import HIDDEN, OBSERVABLE, Directions, search_force, torque_tolerance
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import motor_torque_slope

METHODS = ("newton", "alternation")
"""The solvers of `estimate_load`; "alternation" is that of [Troise 2021]."""

_INNER = 1e-12  # tolerance of the equilibria during the search


@dataclass(frozen=True, eq=False)
class LoadEstimate:
    """A tip force estimated from motor torques, with its observability; can be saved with `softrobots.save_result`."""

    force: FloatArray
    """The force, shape (3,) [N], world axes. Its part along unobservable directions is small and meaningless."""
    equilibrium: Equilibrium
    """The robot under that force."""
    frame: str
    """Frame at which the force acts."""
    measured_torques: FloatArray
    """The measured motor torques, shape (n_motors,) [N m]."""
    torque_std: FloatArray | None
    """Their standard deviation, shape (n_motors,) [N m]; None if none was given."""
    method: str
    """The solver."""
    singular_values: FloatArray
    """Singular values of the derivative of the motor torques with respect to the force, descending, shape (3,) [m]."""
    unobservable_directions: FloatArray
    """Unit directions whose singular value is below `OBSERVABLE` times the reach, shape (k, 3); k may be 0."""
    covariance: FloatArray | None
    """Covariance of the force for the given torque noise, shape (3, 3) [N^2], over the observable directions; None without
    `torque_std`."""
    residual: float
    """Norm of the motor torques that the force does not explain [N m]: rounding, unless a direction is unobservable or more
    than three motors are fitted."""
    iterations: int
    """Steps of the solver."""

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value of the elastostatic Jacobian transposed [-]; may be infinite."""
        smallest = float(self.singular_values[-1])
        return float(self.singular_values[0]) / smallest if smallest > 0.0 else math.inf

    @property
    def unobservable_direction(self) -> FloatArray | None:
        """The first unobservable direction, shape (3,), or None."""
        return self.unobservable_directions[0] if len(self.unobservable_directions) else None


def estimate_load(
    model: SoftModel,
    q_motors: Any,
    motor_torques: Any,
    *,
    method: str = "newton",
    frame: str | None = None,
    gravity: Any = None,
    torque_std: Any = None,
    max_iterations: int | None = None,
) -> LoadEstimate:
    r"""Find the force at the tip from motor coordinates and torques.

    "newton" solves `tau_m(f) = motor_torques` with the springs in equilibrium at every step, by damped Newton with the exact
    derivative :math:`d\tau_m/df = J_m^T + d(J_m^T f - g_m)/dy K_t^{-1} J_k^T`. "alternation" is [Troise 2021] Figure 5:
    `f = (J_m,lin^T)^-1 (tau_m + g_m)` and `y = rest + (J_k^T f - g_k)/k` in turn; it fails in a few per cent of cases at 18 N.
    With more than three motors the fit is least squares; with fewer the force is the one that the damped search finds from
    zero, close to the smallest.

    Where a link has a largest moment, several forces may give the same torques, with the link on its plateau or not;
    "newton" returns the one that it reaches from zero, or fails at the plateau.

    Args:
        model: The robot, with at least one motor.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        motor_torques: Load on each motor, shape (n_motors,) [N m], with the sign of `Equilibrium.motor_torques`:
            minus what the motor exerts.
        method: "newton" or "alternation".
        frame: Frame at which the force acts; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        torque_std: Standard deviation of the torque noise, one number or shape (n_motors,) [N m], for the covariance; five
            times it may then stay unexplained.
        max_iterations: Most steps; 100 for "newton", 1000 for "alternation" by default.

    Returns:
        The force with conditioning, unobservable directions and covariance.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has no motors.
        NameNotFound: If the frame does not exist.
        LoadNotFound: If no force explains the torques; carries the best estimate.
        NeutralEquilibrium: If the search meets a load at which the tangent stiffness is singular.
    """
    check_model(model)
    choice("method", method, METHODS)
    check_feels(model)
    motors = model.checked_motors(q_motors)
    torques = finite_array("motor_torques", motor_torques, (model.n_motors,), "N m")
    noise = None if torque_std is None else _noise(torque_std, model.n_motors)
    at = model.tip if frame is None else frame
    base = Load.of(model, frame=at, gravity=gravity)
    solve, most = (_newton, 100) if method == "newton" else (_alternation, 1000)
    most = most if max_iterations is None else positive_integer("max_iterations", max_iterations)
    problem = _Problem(model, motors, torques, base, at)
    force, state, iterations = solve(problem, most)
    result = _estimate(problem, force, state, method, iterations, noise)
    if not (_explained(problem, state, noise) and result.equilibrium.converged):
        raise LoadNotFound(
            f"no force explains the motor torques {torques.tolist()} N m by {method!r} in {iterations} iterations: "
            f"{result.residual:.3g} N m remain",
            best=result,
            residual=result.residual,
            iterations=iterations,
        )
    return result


def check_feels(model: SoftModel) -> None:
    """Refuse robots whose actuators feel no load.

    Raises:
        ParameterError: If there are none, or muscle tensions are given.
    """
    if model.n_motors == 0:
        raise ParameterError("model", model, "a robot with at least one motor")
    if model.muscles and model.muscle_input == "forces":
        raise ParameterError("model", model, "a robot whose muscle lengths are given: given forces feel no load")


@dataclass(frozen=True, eq=False)
class _Problem:
    """Measured torques and the known part of the load; a `force_search.Measurement`."""

    model: SoftModel
    motors: FloatArray
    torques: FloatArray
    base: Load
    frame: str

    @cached_property
    def tolerance(self) -> float:
        return torque_tolerance(self.torques)

    def load(self, force: FloatArray) -> Load:
        return self.base.plus(self.frame, np.concatenate([force, np.zeros(3)]))

    def equilibrium(self, force: FloatArray, near: ElasticState) -> ElasticState | None:
        """Solve for the equilibrium under a force, from a nearby state; None if it does not converge."""
        return balanced_state(self.model, self.motors, self.load(force), near.q_springs, tolerance=_INNER)

    def unexplained(self, state: ElasticState) -> FloatArray:
        """Return the measured torques minus those of a state."""
        return np.asarray(self.torques - state.load.motors)

    def directions(self, state: ElasticState) -> Directions:
        """Decompose the derivative of the torques with respect to the force."""
        motors, springs = state.point.columns(frame_jacobian(self.model, state.q, self.frame)[:3])
        return Directions.of(motor_torque_slope(motors, springs, state.tangent, state.load.coupling), self.model.reach)


def _explained(problem: _Problem, state: ElasticState, noise: FloatArray | None) -> bool:
    """Whether the unexplained torques are rounding, noise, or from unobservable directions.

    Where every direction is observable only rounding or noise may be left; in a singular pose also `HIDDEN` of the torques and
    `OBSERVABLE` of the stiffest spring. With more than three motors the residual of the least-squares fit may have any size
    if the noise is unknown.
    """
    left, values, _, keep = problem.directions(state)
    missing = left.T @ problem.unexplained(state)
    scatter = 0.0 if noise is None else 5.0 * float(np.linalg.norm(noise))
    hidden = HIDDEN * float(np.linalg.norm(problem.torques)) + OBSERVABLE * problem.model.stiffest
    seen, surplus = missing[: len(values)], missing[len(values) :]
    allowed = max(problem.tolerance, scatter) if keep.all() else hidden + scatter
    return bool(np.linalg.norm(seen) <= allowed and (noise is None or np.linalg.norm(surplus) <= max(allowed, scatter)))


def _newton(problem: _Problem, most: int) -> tuple[FloatArray, ElasticState, int]:
    """Damped Newton, see `softrobots.statics.force_search`."""
    no_force = np.zeros(3)
    relaxed = elastic_state(problem.model, problem.motors, problem.model.rest, problem.load(no_force))
    start = problem.equilibrium(no_force, relaxed) or relaxed
    return search_force(problem, start, most, reach=problem.model.reach, tolerance=problem.tolerance)


def _alternation(problem: _Problem, most: int) -> tuple[FloatArray, ElasticState, int]:
    """Recursion of [Troise 2021] Figure 5, until springs and motors are in equilibrium."""
    model = problem.model
    force, springs = np.zeros(3), np.array(model.rest)
    state = elastic_state(model, problem.motors, springs, problem.base)
    for iteration in range(1, most + 1):
        by_motors, by_springs = state.point.columns(frame_jacobian(model, state.q, problem.frame)[:3])
        unloaded = elastic_state(model, problem.motors, springs, problem.base).load
        estimate = np.asarray(np.linalg.lstsq(by_motors.T, problem.torques - unloaded.motors, rcond=None)[0], dtype=np.float64)
        springs = model.rest + (unloaded.elastic + by_springs.T @ estimate) / model.stiffness
        trial = elastic_state(model, problem.motors, springs, problem.load(estimate))
        if not trial.point.valid:  # a section beyond its range: the recursion diverges
            return force, state, iteration
        force, state = estimate, trial
        balanced = state.error <= largest_residual(model, state.scale, TOLERANCE)
        if balanced and float(np.linalg.norm(problem.unexplained(state))) <= problem.tolerance:
            return force, state, iteration
    return force, state, most


def _estimate(
    problem: _Problem, force: FloatArray, state: ElasticState, method: str, iterations: int, noise: FloatArray | None
) -> LoadEstimate:
    left, values, right, keep = problem.directions(state)
    observable = right[: len(values)][keep]
    singular_values = np.zeros(3)
    singular_values[: len(values)] = values
    covariance = None
    if noise is not None:
        inverse = observable.T @ ((left[:, : len(values)].T[keep]) / values[keep][:, None])
        covariance = read_only(inverse @ np.diag(noise**2) @ inverse.T)
    unobservable = np.concatenate([right[: len(values)][~keep], right[len(values) :]])
    equilibrium = equilibrium_from_state(
        problem.model, problem.motors, problem.load(force), state, method=method, iterations=iterations
    )
    return LoadEstimate(
        force=read_only(force),
        equilibrium=equilibrium,
        frame=problem.frame,
        measured_torques=read_only(problem.torques),
        torque_std=None if noise is None else read_only(noise),
        method=method,
        singular_values=read_only(singular_values),
        unobservable_directions=read_only(unobservable),
        covariance=covariance,
        residual=float(np.linalg.norm(problem.unexplained(state))),
        iterations=iterations,
    )


def estimate_at(
    equilibrium: Equilibrium,
    *,
    frame: str,
    motor_torques: FloatArray,
    force: FloatArray,
    torque_std: FloatArray | None,
    method: str,
) -> LoadEstimate:
    """Compute a load estimate, as saved in a file, from the equilibrium under the force and the measured torques.

    Raises:
        ParameterError: If the force is not the one in the equilibrium's load.
    """
    wrench = equilibrium.load.wrenches.get(frame, np.zeros(6))
    if not np.allclose(wrench[:3], force, rtol=1e-12, atol=0.0):
        raise ParameterError("force", force, f"that of the load, {wrench[:3].tolist()} N")
    base = equilibrium.load.plus(frame, np.concatenate([-force, np.zeros(3)]))
    problem = _Problem(equilibrium.model, equilibrium.q_motors, motor_torques, base, frame)
    state = elastic_state(equilibrium.model, equilibrium.q_motors, equilibrium.q_springs, equilibrium.load)
    return _estimate(problem, force, state, method, equilibrium.iterations, torque_std)


def _noise(torque_std: Any, n_motors: int) -> FloatArray:
    if isinstance(torque_std, int | float | np.number):
        return np.full(n_motors, positive_number("torque_std", torque_std, "N m"))
    noise = finite_array("torque_std", torque_std, (n_motors,), "N m")
    if np.any(noise <= 0.0):
        raise ParameterError("torque_std", torque_std, "positive [N m]")
    return noise
