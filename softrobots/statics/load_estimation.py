"""Estimation of the force at the tip, and of the shape of the robot, from motor torques.

Given motor coordinates and motor torques `tau_m = J_m^T f - g_m` with no moment at the tip, find the force `f` and the
springs `y` together. A force is unobservable along a direction in which the motors hardly move the tip (elbow straight, tip on
the axis of the first motor); the result names such directions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, choice, finite_array, instance_of, positive_integer, read_only, read_only_mapping
from softrobots.core.errors import LoadNotFound, ParameterError
from softrobots.core.result_file import text
from softrobots.core.summary import Part, Summarised
from softrobots.environment.environment import Environment
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state, from_before
from softrobots.statics.equilibrium_summary import load_parts
from softrobots.statics.loads import Load
from softrobots.statics.tip_force.force_search import ANY
from softrobots.statics.tip_force.friction_range import friction_range
from softrobots.statics.tip_force.load_errors import MeasurementErrors
from softrobots.statics.tip_force.measured_torques import SOLVERS, Explanation, MeasuredTorques

METHODS = tuple(SOLVERS)
"""The solvers of `estimate_load`; "alternation" is that of [Troise 2021]."""


@dataclass(frozen=True, eq=False, repr=False)
class LoadEstimate(Summarised):
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
    stiffness_std: FloatArray | None
    """Standard deviation of the stiffness of each spring, as a share of it, shape (n_springs,) [-]; None if none was given."""
    motor_angle_std: FloatArray | None
    """Standard deviation of the motor coordinates, shape (n_motors,) [rad or m]; None if none was given."""
    method: str
    """The solver."""
    singular_values: FloatArray
    """Singular values of the derivative of the motor torques with respect to the force, descending, shape (3,) [m]; (k,) for
    a force along k given directions."""
    unobservable_directions: FloatArray
    """Unit directions whose singular value is below `OBSERVABLE` times the reach, shape (k, 3); k may be 0."""
    covariance: FloatArray | None
    """Covariance of the force for the given errors of measurement, the sum of `covariance_parts`, shape (3, 3) [N^2], over the
    observable directions; None without any."""
    covariance_parts: Mapping[str, FloatArray]
    """Its parts by the source of the error, "torques", "stiffness" and "motor_angles", for those that were given."""
    residual: float
    """Norm of the motor torques that the force does not explain [N m]: rounding, unless a direction is unobservable or more
    than three motors are fitted."""
    iterations: int
    """Steps of the solver."""
    friction_range: FloatArray | None = None
    """Least and largest value of each component of the force if nothing is known of dry friction but its limits, to first
    order, shape (3, 2) [N]; None without friction. The force itself takes friction from the state before."""
    directions: FloatArray | None = None
    """Orthonormal directions that the force may have, shape (k, 3); None: any."""
    alternatives: tuple[LoadEstimate, ...] = ()
    """Other forces that were found to explain the torques as well, smallest first."""

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value of the elastostatic Jacobian transposed [-]; may be infinite."""
        smallest = float(self.singular_values[-1])
        return float(self.singular_values[0]) / smallest if smallest > 0.0 else math.inf

    @property
    def unobservable_direction(self) -> FloatArray | None:
        """The first unobservable direction, shape (3,), or None."""
        return self.unobservable_directions[0] if len(self.unobservable_directions) else None

    @property
    def force_std(self) -> FloatArray | None:
        """Standard deviation of each component of the force, over the observable directions, shape (3,) [N]; or None."""
        return None if self.covariance is None else np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    def summary_parts(self) -> list[Part]:
        """Return the equilibrium, then the force with its errors, and what the motors do not feel."""
        return load_parts(self)


def estimate_load(
    model: SoftModel,
    q_motors: Any,
    motor_torques: Any,
    *,
    method: str = "newton",
    frame: str | None = None,
    directions: Any = None,
    gravity: Any = None,
    previous: Equilibrium | None = None,
    torque_std: Any = None,
    stiffness_std: Any = None,
    motor_angle_std: Any = None,
    restart: bool = True,
    max_iterations: int | None = None,
    environment: Environment | None = None,
) -> LoadEstimate:
    r"""Find the force at the tip from motor coordinates and torques.

    "newton" solves `tau_m(f) = motor_torques` with the springs in equilibrium at every step, by damped Newton with the exact
    derivative :math:`d\tau_m/df = J_m^T + d(J_m^T f - g_m)/dy K_t^{-1} J_k^T`. "alternation" is [Troise 2021] Figure 5:
    `f = (J_m,lin^T)^-1 (tau_m + g_m)` and `y = rest + (J_k^T f - g_k)/k` in turn; it fails in a few per cent of cases at 18 N.
    Muscles of given length, elastic tendons and McKibben muscles feel a load by their tensions; given tensions and pressures
    feel none, and their numbers are not used. A slack tendon feels none, either.

    With more than three motors the fit is least squares; with fewer the force is the one that the damped search finds from
    zero, close to the smallest.

    Several forces may give the same torques: a large one that bends the arm far, or one with a link on its plateau. "newton"
    starts from no force; where that leaves torques unexplained it starts again from eight forces around the robot and keeps
    the least residual. From there it looks for others along the direction that the motors feel least: `alternatives`. Those are
    not all: of 21 that thousands of starts find in 150 postures of the arm of the paper under 20 N it finds 17, and misses
    forces of 180 to 300 N; more than three motors leave one force.

    With dry friction the force is the one under which the robot steps from `previous` to the measured torques, to the least
    energy with what friction dissipates. What sticks may carry anything within its limits, which the motors hardly feel: then
    the force is only as good as `previous`, and `friction_range` says how far it may be off whatever came before. Derivatives
    (singular values, covariance) are those of small steps on from there, at constant friction of guides.

    Args:
        model: The robot, with at least one motor.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        motor_torques: Load on each motor, shape (n_motors,) [N m or N], with the sign of `Equilibrium.motor_torques`:
            minus what the motor exerts; of a muscle its tension.
        method: "newton" or "alternation".
        frame: Frame at which the force acts; the tip by default. `softrobots.with_points` makes frames at points of links,
            where something touches the robot.
        directions: Directions that the force may have, shape (3,) or (k, 3), world axes, any length: the normal of a contact
            without friction. None: any. Not for "alternation".
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        previous: Where the robot comes from: what dry friction remembers, and the start of the springs. None: from rest.
        torque_std: Standard deviation of the torque noise, one number or shape (n_motors,) [N m], for the covariance; five
            times it may then stay unexplained.
        stiffness_std: Standard deviation of the stiffness of the springs, as a share of it, one number or shape (n_springs,)
            [-], for the covariance; the springs that bend one link have one error. [Troise 2021] Table 3: 0.008 to 0.036.
        motor_angle_std: Standard deviation of the motor coordinates, one number or shape (n_motors,) [rad or m], for the
            covariance; of muscles their lengths, or what else is given.
        restart: Whether "newton" starts again from other forces; it takes some ten times as long.
        max_iterations: Most steps of a search; 100 for "newton", 1000 for "alternation" by default.
        environment: Obstacles that the robot leans on without friction, whose forces the motors feel, too: they are in
            `equilibrium.contacts` of the result, and the force is what acts beside them. Not for "alternation".

    Returns:
        The force with conditioning, unobservable directions, covariance and alternatives.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, a tendon that only pulls pushes, the
            robot has no motors, none of them feels a load, or it has muscles and `stiffness_std` is given.
        NameNotFound: If the frame does not exist.
        LoadNotFound: If no force explains the torques; carries the best estimate.
        NeutralEquilibrium: If the search meets a load at which the tangent stiffness is singular.
    """
    choice("method", method, METHODS if environment is None else METHODS[:1])
    if method == "alternation":
        check_frictionless(model, "an estimate by 'alternation' ('newton' takes it)")
    instance_of("restart", restart, bool, "True or False")
    check_feels(model)
    motors = model.checked_motors(q_motors)
    errors = MeasurementErrors.of(model, torque_std, stiffness_std, motor_angle_std)
    torques = model.actuators.checked_loads(motor_torques, "motor_torques", errors.torque_std)
    at = model.tip if frame is None else frame
    span = _span(directions)
    if method == "alternation" and directions is not None:
        raise ParameterError("directions", directions, "None for 'alternation', which finds forces of any direction")
    base = Load.of(model, frame=at, gravity=gravity, environment=environment)
    usual = 100 if method == "newton" else 1000
    most = positive_integer("max_iterations", usual if max_iterations is None else max_iterations)
    model, start = from_before(model, previous)
    problem = MeasuredTorques(model, motors, torques, base, at, errors, span, start)
    best, *others = SOLVERS[method](problem, most, restart=restart)
    result = _estimate(problem, best, method, others)
    if not (problem.explained(best) and result.equilibrium.converged):
        raise LoadNotFound(
            f"no force explains the motor torques {torques.tolist()} by {method!r} in {result.iterations} iterations: "
            f"{result.residual:.3g} {model.actuators.load_unit} remain",
            best=result,
            residual=result.residual,
            iterations=result.iterations,
        )
    return result


def check_feels(model: SoftModel) -> None:
    """Refuse robots whose actuators feel no load.

    Raises:
        ParameterError: If there are none, or all of them are given tensions or pressures.
    """
    if check_model(model).n_motors == 0:
        raise ParameterError("model", model, "a robot with at least one motor")
    if not model.actuators.feels.any():
        kinds = "muscles of given length, elastic tendons or McKibben muscles"
        raise ParameterError("model", model, f"a robot with {kinds}: given forces feel no load")


def _span(directions: Any) -> FloatArray:
    """Orthonormal directions of the given ones, shape (k, 3); `ANY` for None.

    Raises:
        ParameterError: If they are not one to three finite rows that are independent.
    """
    if directions is None:
        return ANY
    rows = np.atleast_2d(finite_array("directions", directions, None, "-"))
    if rows.ndim == 2 and rows.shape[1] == 3 and 0 < len(rows) <= 3:
        rows = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300)
        _, sizes, span = np.linalg.svd(rows, full_matrices=False)
        if sizes[-1] > 1e-9:
            return read_only(span)
    raise ParameterError("directions", directions, "one to three independent directions, shape (3,) or (k, 3)")


def _estimate(problem: MeasuredTorques, found: Explanation, method: str, others: list[Explanation]) -> LoadEstimate:
    force, state, iterations, (left, values, right, keep), errors = found
    observable = right[: len(values)][keep]
    singular_values = np.zeros(len(right))
    singular_values[: len(values)] = values
    inverse = observable.T @ ((left[:, : len(values)].T[keep]) / values[keep][:, None])
    load = problem.load(force)
    off = friction_range(state, problem.motors, load, problem.frame, problem.span)
    parts = {name: read_only(moved @ moved.T) for name, moved in ((name, inverse @ error) for name, error in errors.items())}
    unobservable = np.concatenate([right[: len(values)][~keep], right[len(values) :]])
    return LoadEstimate(
        force=read_only(force),
        equilibrium=equilibrium_from_state(problem.model, problem.motors, load, state, method=method, iterations=iterations),
        frame=problem.frame,
        measured_torques=read_only(problem.torques),
        method=method,
        singular_values=read_only(singular_values),
        unobservable_directions=read_only(unobservable),
        covariance=read_only(np.sum(list(parts.values()), axis=0)) if parts else None,
        covariance_parts=read_only_mapping(parts),
        residual=problem.residual(state),
        iterations=iterations,
        friction_range=None if off is None else read_only(force[:, None] + off),
        directions=None if problem.span is ANY else problem.span,
        alternatives=tuple(_estimate(problem, other, method, []) for other in others),
        **problem.errors._asdict(),
    )


def packed_estimate(estimate: LoadEstimate) -> dict[str, Any]:
    """Return the named arrays of an estimate for a result file, without its equilibrium."""
    names = ("force", "frame", "directions", "measured_torques", *MeasurementErrors._fields)
    others = [(other.force, other.equilibrium.q_springs) for other in estimate.alternatives]
    forces, springs = zip(*others, strict=True) if others else (None, None)
    fields = {name: getattr(estimate, name) for name in names}
    return fields | {"estimation": estimate.method, "other_forces": forces, "other_springs": springs}


def estimate_at(equilibrium: Equilibrium, fields: Mapping[str, Any]) -> LoadEstimate:
    """Compute a load estimate from the equilibrium under the force and the named arrays of `packed_estimate`.

    Raises:
        ParameterError: If an array is not as it must be, the force is not that of the equilibrium's load, or another force does
            not explain the torques.
        FileFormatError: If a name is not a text.
    """
    model, motors, frame = equilibrium.model, equilibrium.q_motors, text(fields, "frame")
    torques = finite_array("measured_torques", fields["measured_torques"], (model.n_motors,), "N m")
    force = finite_array("force", fields["force"], (3,), "N")
    wrench = equilibrium.load.wrenches.get(frame, np.zeros(6))
    if not np.allclose(wrench[:3], force, rtol=1e-12, atol=0.0):
        raise ParameterError("force", force, f"that of the load, {wrench[:3].tolist()} N")
    others = finite_array("other_forces", fields.get("other_forces", np.zeros((0, 3))), (None, 3), "N")
    given_springs = fields.get("other_springs", np.zeros((0, model.n_springs)))
    other_springs = finite_array("other_springs", given_springs, (len(others), model.n_springs), "rad")
    base = equilibrium.load.plus(frame, np.concatenate([-force, np.zeros(3)]))
    errors = MeasurementErrors.of(model, *(fields.get(name) for name in MeasurementErrors._fields))
    span = _span(fields.get("directions"))
    problem = MeasuredTorques(model, motors, torques, base, frame, errors, span, equilibrium.q_springs)
    best, *rest = (
        problem.explanation(one, elastic_state(model, motors, springs, problem.load(one)), equilibrium.iterations)
        for one, springs in ((force, equilibrium.q_springs), *zip(others, other_springs, strict=True))
    )
    result = _estimate(problem, best, choice("estimation", text(fields, "estimation"), METHODS), rest)
    for one, other in zip(rest, result.alternatives, strict=True):
        if not (problem.fitted(one) and other.equilibrium.converged):
            raise ParameterError("other_forces", one.force, "one that explains the torques")
    return result
