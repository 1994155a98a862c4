"""Measured motor torques, and the searches for the tip forces that explain them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.pressed_gaps import motor_slopes, pressed_gaps
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, elastic_state, largest_residual
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import tip_motion
from softrobots.statics.tip_force.force_search import HIDDEN, OBSERVABLE, Directions, search_force, sphere, torque_tolerance
from softrobots.statics.tip_force.load_errors import FIVE, MeasurementErrors

_INNER = 1e-12  # tolerance of the equilibria during the search
_STARTS = 8  # directions of forces from which a search that has failed begins again
_STEPS = (1.0, -1.0, 2.0, -2.0, 3.0, -3.0)  # from a force that was found to where another is looked for, in elastic forces
_SAME = 1e-4  # relative difference of forces that count as one


class Explanation(NamedTuple):
    """A force, and the robot under it."""

    force: FloatArray
    """The force, shape (3,) [N]."""
    state: ElasticState
    """The robot."""
    iterations: int
    """Steps of the search."""
    directions: Directions
    """Decomposition of the derivative of its motor torques with respect to the force."""
    errors: Mapping[str, FloatArray]
    """Errors of measurement as torques, by source, see `MeasurementErrors.as_torques`."""

    @property
    def scatter(self) -> float:
        """Norm of the torques that errors of measurement may leave unexplained [N m]; 0 if none are known."""
        return FIVE * float(np.sqrt(sum(float(np.sum(part**2)) for part in self.errors.values())))


@dataclass(frozen=True, eq=False)
class MeasuredTorques:
    """Measured torques and the known part of the load; a `force_search.Measurement`."""

    model: SoftModel
    """The robot."""
    motors: FloatArray
    """Motor coordinates, shape (n_motors,)."""
    torques: FloatArray
    """Torques, shape (n_motors,) [N m]."""
    base: Load
    """The load without the force."""
    frame: str
    """Where the force acts."""
    errors: MeasurementErrors
    """Errors of measurement."""
    span: FloatArray
    """Orthonormal directions that the force may have, shape (k, 3)."""
    start: FloatArray
    """Springs where the search begins, shape (n_springs,)."""

    @cached_property
    def tolerance(self) -> float:
        """Norm of the torques that may stay unexplained without errors [N m]."""
        return torque_tolerance(self.torques)

    def load(self, force: FloatArray) -> Load:
        """Return the load with a force."""
        return self.base.plus(self.frame, np.concatenate([force, np.zeros(3)]))

    def equilibrium(self, force: FloatArray, near: ElasticState) -> ElasticState | None:
        """Solve for the equilibrium under a force, from a nearby state; None if it does not converge."""
        return balanced_state(self.model, self.motors, self.load(force), near.q_springs, tolerance=_INNER)

    def unexplained(self, state: ElasticState) -> FloatArray:
        """Return the measured torques minus those of a state; zero for actuators that feel no load."""
        return np.where(self.model.actuators.feels, self.torques - state.load.motors, 0.0)

    def residual(self, state: ElasticState) -> float:
        """Return the norm of the torques that a state does not explain [N m]."""
        return float(np.linalg.norm(self.unexplained(state)))

    def directions(self, state: ElasticState) -> Directions:
        """Decompose the derivative of the torques with respect to the force."""
        motors, springs = state.point.columns(frame_jacobian(self.model, state.q, self.frame)[:3])
        felt = state.load.coupling
        if self.model.structure.actuator_laws is not None:  # a tension by law is not conjugate to its input
            felt = motor_slopes(state, self.base)[1].T
        moved, _ = tip_motion(self.model, motors, springs, state.tangent, felt, pressed_gaps(state))
        return Directions.of(moved.T, self.model.reach, self.span)

    def explanation(self, force: FloatArray, state: ElasticState, iterations: int) -> Explanation:
        """Return a force with the robot under it and what tells how well it explains the torques.

        Raises:
            NeutralEquilibrium: If the tangent stiffness is singular.
        """
        errors = self.errors.as_torques(self.model, self.load(force), state)
        return Explanation(force, state, iterations, self.directions(state), errors)

    def explained(self, found: Explanation) -> bool:
        """Whether the unexplained torques are rounding, errors of measurement, or from unobservable directions.

        Where every direction is observable only rounding or errors may be left; in a singular pose also `HIDDEN` of the torques
        and `OBSERVABLE` of the stiffest spring. With more than three motors the residual of the least-squares fit may have any
        size if the noise is unknown.
        """
        left, values, _, keep = found.directions
        missing, scatter = left.T @ self.unexplained(found.state), found.scatter
        hidden = HIDDEN * float(np.linalg.norm(self.torques)) + OBSERVABLE * self.model.stiffest
        seen, surplus = missing[: len(values)], missing[len(values) :]
        allowed = max(self.tolerance, scatter) if keep.all() else hidden + scatter
        known = self.errors.torque_std is not None
        return bool(np.linalg.norm(seen) <= allowed and (not known or np.linalg.norm(surplus) <= max(allowed, scatter)))

    def fitted(self, found: Explanation) -> bool:
        """Whether a force leaves no more than rounding or errors of measurement, by directions that the motors all feel."""
        felt = len(found.directions.values) == len(self.span) and bool(found.directions.observable.all())
        return felt and self.residual(found.state) <= max(self.tolerance, found.scatter)

    @property
    def elastic_force(self) -> float:
        """Force across the robot's reach that bends it by about a radian [N]; that of the torques if no spring turns."""
        soft = float(np.sum(1.0 / self.model.stiffness[self.model.springs.turning]))
        return 2.0 / (soft * self.model.reach) if soft > 0.0 else float(np.linalg.norm(self.torques)) / self.model.reach


def newton(problem: MeasuredTorques, most: int, *, restart: bool) -> list[Explanation]:
    """Damped Newton from no force, see `softrobots.statics.tip_force.force_search`, and again from other forces.

    A search that leaves torques unexplained is repeated from forces all around, until one is explained; the least residual
    is kept. Other explanations are looked for along the direction that the motors feel least.

    Args:
        problem: The measurement.
        most: Most steps of one search.
        restart: Whether to search again.

    Returns:
        The explanation that is kept, then others that explain the torques as well, smallest force first.
    """
    model = problem.model
    no_force = np.zeros(3)
    before = elastic_state(model, problem.motors, problem.start, problem.load(no_force))
    start = problem.equilibrium(no_force, before) or before
    best = _without_hidden(problem, _search(problem, no_force, start, most), most)
    if not restart:
        return [best]
    size, others = problem.elastic_force, list[Explanation]()
    felt = best.directions.observable.all()
    if not problem.explained(best) or (felt and problem.residual(best.state) > problem.tolerance):
        for direction in sphere(_STARTS) @ problem.span.T @ problem.span:
            again = _search_from(problem, 2.0 * size * direction, start, most)
            if again is not None and problem.residual(again.state) < problem.residual(best.state):
                best = again
                if problem.fitted(best):
                    break
    if problem.fitted(best):
        along = best.directions.right[-1]
        for step in _STEPS:
            other = _search_from(problem, best.force + step * size * along, best.state, most)
            if other is not None and problem.fitted(other) and not any(_same(other, one) for one in (best, *others)):
                others.append(other)
    return [best, *sorted(others, key=lambda one: float(np.linalg.norm(one.force)))]


def alternation(problem: MeasuredTorques, most: int, *, restart: bool) -> list[Explanation]:
    """Recursion of [Troise 2021] Figure 5, until springs and motors are in equilibrium; it has no other start."""
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
            return [problem.explanation(force, state, iteration)]
        force, state = estimate, trial
        balanced = state.error <= largest_residual(model, state.scale, TOLERANCE)
        if balanced and problem.residual(state) <= problem.tolerance:
            return [problem.explanation(force, state, iteration)]
    return [problem.explanation(force, state, most)]


SOLVERS: dict[str, Callable[..., list[Explanation]]] = {"newton": newton, "alternation": alternation}
"""The searches by name."""


def _search(problem: MeasuredTorques, force: FloatArray, state: ElasticState, most: int) -> Explanation:
    found = search_force(problem, state, most, reach=problem.model.reach, tolerance=problem.tolerance, start=force)
    return problem.explanation(*found)


def _without_hidden(problem: MeasuredTorques, found: Explanation, most: int) -> Explanation:
    """Take off what no motor feels of a force on a robot that leans on an obstacle, which passes on to the obstacle.

    The search may come to the obstacle with a force that the motors felt before.
    """
    right, keep = found.directions.right, found.directions.observable
    if problem.base.environment is None or not found.state.touch.forces.any() or keep.all():  # type: ignore[union-attr]
        return found
    hidden = np.concatenate([right[: len(keep)][~keep], right[len(keep) :]])
    other = _search_from(problem, found.force - hidden.T @ (hidden @ found.force), found.state, most)
    return other if other is not None and problem.residual(other.state) <= problem.tolerance else found


def _search_from(problem: MeasuredTorques, force: FloatArray, near: ElasticState, most: int) -> Explanation | None:
    """Search from the equilibrium under a force; None if there is none, or the search meets a neutral one."""
    start = problem.equilibrium(force, near)
    if start is None:
        return None
    try:
        return _search(problem, force, start, most)
    except NeutralEquilibrium:
        return None


def _same(one: Explanation, other: Explanation) -> bool:
    distance, size = (float(np.linalg.norm(force)) for force in (one.force - other.force, other.force))
    return distance <= _SAME * max(size, 1.0)
