r"""Displacement control: a probe displaces the robot by a given way, and the force follows.

A dead moment cannot hold a link on the plateau of its moment, and a dead force only where the link has turned out of its way; a
probe can. With the reaction `F` along the probe's line and the springs `y` as unknowns the conditions are
:math:`r(y) - F \nabla g = 0` and `g(y) = v`, where `g` is the displacement of `softrobots.probes`. Newton solves

.. math:: \begin{pmatrix} K_t & -a \\ a^T & 0 \end{pmatrix} \begin{pmatrix} dy \\ dF \end{pmatrix}
          = \begin{pmatrix} -r + F a \\ v - g \end{pmatrix}

with :math:`a = \nabla g` and `K_t` the tangent stiffness of springs, load and :math:`-F \nabla^2 g`. The equilibrium is stable
under the imposed displacement when `K_t` is positive definite on the motions that `a` leaves free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.blas_threads import one_blas_thread
from softrobots.checks import FloatArray, finite_array, finite_number, positive_integer, read_only, unit_vector
from softrobots.elastostatics import TOLERANCE, ElasticState, elastic_state, largest_residual, scaled
from softrobots.equilibrium import Equilibrium, equilibrium_from_state, solve_equilibrium
from softrobots.errors import EquilibriumNotFound, ParameterError
from softrobots.kinematics import frame_jacobian, frame_placement
from softrobots.loads import Load
from softrobots.model import SoftModel, check_model
from softrobots.probes import Contact, Probe, face_normal, touch

_GAP = 1e-12  # largest distance of the probe from where it is meant to be, relative to the reach
_LARGEST_STEP = 0.5  # [rad], norm of one Newton step
_NEWTON_STEPS = 20
_SHORTEST = 1e-6  # share of the way that is not halved again
_SMALL_MOVE = 0.01  # [rad or m] of a spring: so near that no other path is meant
_STABLE = 1e-9  # smallest eigenvalue that counts as positive, relative to the springs' own stiffness


@dataclass(frozen=True, eq=False)
class ImposedDisplacement:
    """A robot that a probe holds displaced; can be saved with `softrobots.save_result`."""

    probe: Probe
    """The probe."""
    displacement: float
    """How far along its line the probe is [m]."""
    reaction: float
    """Force on the robot along that line [N], what a load cell behind the probe reads; negative: it would have to pull."""
    load: Load
    """The load without the probe."""
    equilibrium: Equilibrium
    """The robot with the reaction as a wrench at the probe's frame. *Its* certificate is about that wrench as a dead load;
    under the imposed displacement `stable` counts."""
    force: FloatArray
    """Force on the robot at `contact`, shape (3,) [N], world axes; a frictionless probe has no moment there."""
    contact: FloatArray
    """Where the probe is, shape (3,) [m], world axes."""
    tangent_stiffness: FloatArray
    """Derivative of the out-of-balance torque at constant reaction, which turns with a face, shape (n_springs, n_springs)."""
    gradient: FloatArray
    """Derivative of the displacement with respect to the springs, shape (n_springs,) [m/rad or m/m]."""
    gap: float
    """Distance of the probe from where it is meant to be [m]."""
    stable: bool
    """Certified: the tangent stiffness is positive definite on the motions of the springs that do not move the probe."""

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.equilibrium.model

    @property
    def q_springs(self) -> FloatArray:
        """Spring coordinates, shape (n_springs,) [rad or m]."""
        return self.equilibrium.q_springs

    @property
    def residual(self) -> float:
        """Norm of the out-of-balance torque [N m]."""
        return self.equilibrium.residual

    @property
    def q(self) -> FloatArray:
        """Pinocchio's configuration, shape (nq,)."""
        return self.equilibrium.q


def solve_imposed_displacement(
    model: SoftModel,
    q_motors: Any,
    displacement: float,
    *,
    direction: Any,
    frame: str | None = None,
    point: Any = (0.0, 0.0, 0.0),
    along: Any = None,
    gravity: Any = None,
    start: ImposedDisplacement | None = None,
    tolerance: float = TOLERANCE,
    max_iterations: int = 400,
) -> ImposedDisplacement:
    """Find the springs and the force of a frictionless probe that displaces a point of the robot by a given way.

    The displacement is counted from the equilibrium without the probe. It is imposed at once, or in steps where Newton does not
    follow: the answer is on the path from there, or from `start`.

    Args:
        model: The robot, with at least one spring.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        displacement: How far the probe has moved along its line [m].
        direction: Direction of that line, shape (3,), any length but zero, world axes.
        frame: Frame that is touched; the tip by default.
        point: The point that is touched, in the axes of the frame, shape (3,) [m]; the origin of the frame by default.
        along: Axis of the frame, shape (3,), any length but zero, along which the probe slides on the robot: on the face that
            holds this axis and, without the probe, is turned most towards the line. None: the probe holds to its point,
            which is free to move across the line.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        start: A solution with the same model, motors, probe and load to start from, e.g. the last one of a sequence.
        tolerance: Largest residual, relative to `max(|f| reach + |g|, 1e-3 N m)`.
        max_iterations: Most evaluations.

    Returns:
        The displaced robot with its certificate.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, the springs cannot move the point
            along the line, or `start` is of another probe, load or robot.
        NameNotFound: If the frame does not exist.
        EquilibriumNotFound: If the displacement cannot be reached; carries the farthest `ImposedDisplacement` on the way.
    """
    check_model(model)
    motors = model.checked_motors(q_motors)
    wanted = finite_number("displacement", displacement, "m")
    if model.n_springs == 0:
        raise ParameterError("model", model, "a robot with springs")
    line = unit_vector("direction", direction)
    touched = finite_array("point", point, (3,), "m")
    axis = None if along is None else unit_vector("along", along)
    most = positive_integer("max_iterations", max_iterations)
    free = solve_equilibrium(model, motors, frame=frame, gravity=gravity, tolerance=tolerance)
    at = model.tip if frame is None else frame
    pose = frame_placement(model, free.q, at)
    origin = pose.translation + pose.rotation @ touched
    normal = None if axis is None else read_only(face_normal(pose.rotation.T @ line, axis, along))
    probe = Probe(at, read_only(touched), read_only(line), read_only(origin), normal)
    problem = _Problem(model, motors, free.load, probe, tolerance)
    here = problem.at(free.q_springs, 0.0)
    if not np.linalg.norm(here.contact.gradient) > _GAP * model.reach:
        raise ParameterError(
            "direction", direction, f"one in which the springs can move the point; it is at {origin.tolist()} m"
        )
    if start is not None:
        _check_start(problem, start)
        here = problem.at(start.q_springs, start.reaction)
    here, spent = _follow(problem, here, wanted, most)
    reached = here.contact.displacement
    if abs(reached - wanted) <= problem.largest_gap:
        return _result(problem, here, wanted, spent)
    best = _result(problem, here, reached, spent)
    raise EquilibriumNotFound(
        f"a displacement of {wanted:g} m was not reached in {spent} evaluations: the path was followed to {reached:.6g} m, "
        f"where the reaction is {best.reaction:.6g} N",
        best=best,
        residual=best.equilibrium.residual,
        iterations=spent,
    )


class _Held(NamedTuple):
    """The robot and the probe at given springs and reaction."""

    state: ElasticState
    """The robot under load and reaction."""
    contact: Contact
    reaction: float
    tangent: FloatArray
    """With the force turning as the robot does."""

    def step(self, torque: FloatArray, way: float) -> FloatArray | None:
        """Change of springs and reaction that takes up a torque, shape (n,) [N m or N], and moves the probe by a way [m].

        Shape (n + 1,); None where the path turns back.
        """
        n = len(torque)
        matrix: FloatArray = np.zeros((n + 1, n + 1))
        matrix[:n, :n], matrix[:n, n], matrix[n, :n] = self.tangent, -self.contact.gradient, self.contact.gradient
        try:
            return np.asarray(np.linalg.solve(matrix, np.append(torque, way)))
        except np.linalg.LinAlgError:
            return None


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same while one displacement is sought."""

    model: SoftModel
    motors: FloatArray
    load: Load
    probe: Probe
    tolerance: float

    @property
    def largest_gap(self) -> float:
        return _GAP * self.model.reach

    def at(self, q_springs: FloatArray, reaction: float) -> _Held:
        """Evaluate at springs, shape (n_springs,), and a reaction [N]."""
        point = self.model.coordinates.at(self.motors, q_springs)
        q = self.model.embed(point.joints)
        jacobian = point.columns(frame_jacobian(self.model, q, self.probe.frame))[1]
        contact = touch(self.probe, frame_placement(self.model, q, self.probe.frame), jacobian)
        state = elastic_state(self.model, self.motors, q_springs, self.load.plus(self.probe.frame, reaction * contact.wrench))
        return _Held(state, contact, reaction, state.tangent - reaction * contact.turning)

    def newton(self, here: _Held, wanted: float, most: int) -> tuple[_Held | None, int]:
        """Newton to a displacement from nearby, and the evaluations spent; None where it does not converge in `most`."""
        n = self.model.n_springs
        for iteration in range(1, most + 1):
            gap = wanted - here.contact.displacement
            if not math.isfinite(here.state.error) or not math.isfinite(gap):
                return None, iteration
            settled = here.state.error <= largest_residual(self.model, here.state.scale, self.tolerance)
            if settled and abs(gap) <= self.largest_gap:
                return here, iteration
            step = here.step(-here.state.residual, gap)
            if step is None or not np.linalg.norm(step[:n]) <= _LARGEST_STEP:
                return None, iteration
            here = self.at(here.state.q_springs + step[:n], here.reaction + float(step[n]))
        return None, most


def _follow(problem: _Problem, here: _Held, wanted: float, most: int) -> tuple[_Held, int]:
    """Go to a displacement along the path, in one step if possible; returns the farthest point and the evaluations spent."""
    origin = here.contact.displacement
    reached, step, spent = 0.0, 1.0, 0
    with one_blas_thread(problem.model.n_springs):
        while reached < 1.0 and step > _SHORTEST and spent < most:
            aim = min(1.0, reached + step)
            part = wanted if aim == 1.0 else origin + aim * (wanted - origin)
            there, used = problem.newton(here, part, min(_NEWTON_STEPS, most - spent))
            spent += used
            if there is None or not _same_path(problem, here, there):
                step *= 0.5
            else:
                here, reached, step = there, aim, 2.0 * step
    return here, spent


def _same_path(problem: _Problem, here: _Held, there: _Held) -> bool:
    """Whether a step is sure to have stayed on the path: a short one, or one that went about where the path points.

    A long one that ends unstable where it began stable is not: beyond the knee of a link, Newton finds the path on which a
    second one goes limp, too, as easily as the one on which that unloads.
    """
    moved = there.state.q_springs - here.state.q_springs
    if np.abs(moved).max() <= _SMALL_MOVE:
        return True
    model = problem.model
    stable = [_stable_while_held(model, held.tangent, held.contact.gradient) for held in (here, there)]
    if stable[0] and not stable[1]:
        return False
    predicted = here.step(np.zeros(len(moved)), there.contact.displacement - here.contact.displacement)
    if predicted is None:
        return False
    missed, expected = np.abs(moved - predicted[:-1]).max(), np.abs(predicted[:-1]).max()
    return bool(missed <= max(0.5 * expected, _SMALL_MOVE))


def _result(problem: _Problem, held: _Held, wanted: float, iterations: int) -> ImposedDisplacement:
    """Make the result object."""
    model, probe, contact = problem.model, problem.probe, held.contact
    pressed = problem.load.plus(probe.frame, held.reaction * contact.wrench)
    equilibrium = equilibrium_from_state(
        model, problem.motors, pressed, held.state, method="newton", iterations=iterations, tolerance=problem.tolerance
    )
    return ImposedDisplacement(
        probe=probe,
        displacement=wanted,
        reaction=held.reaction,
        load=problem.load,
        equilibrium=equilibrium,
        force=read_only(held.reaction * contact.wrench[:3]),
        contact=read_only(contact.place),
        tangent_stiffness=read_only(held.tangent),
        gradient=read_only(contact.gradient),
        gap=abs(contact.displacement - wanted),
        stable=_stable_while_held(model, held.tangent, contact.gradient),
    )


def _stable_while_held(model: SoftModel, tangent: FloatArray, gradient: FloatArray) -> bool:
    """Whether a symmetric tangent stiffness is positive definite on the motions that a constraint leaves free."""
    softness = 1.0 / np.sqrt(model.stiffness)
    free = np.linalg.qr((softness * gradient)[:, None], mode="complete")[0][:, 1:]
    on_free = free.T @ scaled(tangent, model.stiffness) @ free
    return bool(np.linalg.eigvalsh(on_free).min(initial=math.inf) > _STABLE)


def imposed_at(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    probe: Probe,
    *,
    q_springs: FloatArray,
    reaction: float,
    displacement: float,
    iterations: int,
) -> ImposedDisplacement:
    """Make a result anew from its unknowns; what a saved one is loaded with.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        load: The load without the probe.
        probe: The probe.
        q_springs: Spring coordinates, shape (n_springs,) [rad or m].
        reaction: Force along the probe's line [N].
        displacement: Where the probe is meant to be [m].
        iterations: Evaluations that were spent.

    Returns:
        The result, whether or not it is in balance.
    """
    problem = _Problem(model, q_motors, load, probe, TOLERANCE)
    return _result(problem, problem.at(q_springs, reaction), displacement, iterations)


def _check_start(problem: _Problem, start: Any) -> None:
    if not isinstance(start, ImposedDisplacement):
        raise ParameterError("start", start, "an ImposedDisplacement")
    same = start.probe.same_as(problem.probe) and start.load.same_as(problem.load)
    if not (same and start.model == problem.model):
        raise ParameterError("start", start.probe, "a solution with the same model, probe and load")
