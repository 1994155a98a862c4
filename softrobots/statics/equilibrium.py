"""Static equilibrium of a robot with joint springs, as a certified result; `softrobots.statics.elastostatics` solves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, choice, finite_array, instance_of, positive_integer, positive_number, read_only
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.model.actuators import slack_tendons
from softrobots.model.friction_coordinates import after_step, untouched
from softrobots.model.link_limits import LinkLimits, link_limits, link_moments, near_largest_moment
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, largest_residual, rubbing_state
from softrobots.statics.elastostatics import METHODS, solve_springs
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.stability import Stability, is_stable, stability

_LENGTH_ROUNDING = np.array([-1e-12, 1e-12])  # [m], of muscle lengths that are computed from the shape


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A solved static equilibrium; knows its model, load and motors, and can be saved with `softrobots.save_result`.

    Torques are loads carried, minus what spring or motor exerts.
    """

    model: SoftModel
    """The robot."""
    load: Load
    """The load."""
    method: str
    """The solver."""
    q_motors: FloatArray
    """Motor coordinates, shape (n_motors,) [rad or m]."""
    q_springs: FloatArray
    """Spring coordinates, shape (n_springs,) [rad or m]."""
    q: FloatArray
    """Pinocchio's configuration, shape (nq,)."""
    spring_torques: FloatArray
    """Torque of each spring, `k (q - rest)` if it is linear, shape (n_springs,) [N m or N]."""
    motor_torques: FloatArray
    """Load on each motor, `J_m^T w - g_m`, shape (n_motors,) [N m or N]."""
    tangent_stiffness: FloatArray
    """Derivative of the residual, shape (n_springs, n_springs)."""
    coupling: FloatArray
    """Derivative of the load on the elastic coordinates with respect to the actuators, shape (n_springs, n_motors)."""
    residual: float
    """Norm of the out-of-balance torque [N m]."""
    tolerance: float
    """Largest residual that was accepted [N m]."""
    iterations: int
    """Evaluations of the residual, or steps of the search or estimation that ended here."""
    stable: bool
    """Certified: a small disturbance stays small, see `stability`."""

    @cached_property
    def stability(self) -> Stability:
        """Stable, neutral, divergent or flutter, with the eigenvalues that say so."""
        point = self.model.coordinates.at(self.q_motors, self.q_springs)
        return stability(self.model, point, self.q, self.tangent_stiffness)

    @property
    def conservative(self) -> bool:
        """Whether the load has a potential (no world-fixed moment), so that the tangent stiffness is symmetric."""
        return self.load.conservative

    @property
    def converged(self) -> bool:
        """Whether the residual meets the tolerance."""
        return self.residual <= self.tolerance

    @property
    def transform_tip_to_world(self) -> Any:
        """Pose of the tip, a `pinocchio.SE3` of the caller's own [m]."""
        return frame_placement(self.model, self.q, self.model.tip)

    @cached_property
    def tip_position(self) -> FloatArray:
        """Position of the tip in the world, shape (3,) [m]."""
        return read_only(np.array(self.transform_tip_to_world.translation))

    @cached_property
    def link_moments(self) -> FloatArray:
        """Moment at each inflated link, both springs combined (Euclidean norm), shape (n_links,) [N m].

        Of a link with two hinges it is the larger of theirs. Empty if the model names no inflated links. The springs of a
        section carry the moment at its middle; its entry is the largest along it, with the moment linear between the middles
        of the sections of a segment, and beyond them.
        """
        return read_only(np.array([moments.max() for moments in link_moments(self.model, self.spring_torques)]))

    @cached_property
    def link_limits(self) -> LinkLimits:
        """What each inflated link has left until its wall goes slack and until it wrinkles, with its axial force."""
        parts = {"q": self.q, "torques": self.spring_torques, "tensions": self.muscle_forces}
        return link_limits(self.model, self.load.wrenches, self.load.gravity, **parts)

    @cached_property
    def muscle_lengths(self) -> FloatArray:
        """Length of each muscle, shape (n_muscles,) [m]."""
        structure = self.model.structure
        strains = structure.strains(self.q_motors, self.q_springs)
        return read_only(structure.muscle_paths.rest + structure.muscle_paths.at(strains).change)

    @property
    def muscle_forces(self) -> FloatArray:
        """Tension that each muscle must exert, negative where it pushes, shape (n_muscles,) [N]."""
        return self.motor_torques[len(self.motor_torques) - len(self.model.muscles) :]

    @property
    def muscle_slack(self) -> tuple[bool, ...]:
        """Which muscles are slack: elastic tendons without tension."""
        return slack_tendons(self.model.muscles, self.muscle_forces)

    @cached_property
    def strains(self) -> FloatArray:
        """Strains of each section, base to tip, shape (n_sections, 4): kx, ky, twist [rad/m], stretch [-]."""
        structure = self.model.structure
        lengths = np.array([section.length for section in structure.section_table]).reshape(-1, 1)
        return read_only(structure.section_coordinates(self.q_motors, self.q_springs) / lengths + (0.0, 0.0, 0.0, 1.0))

    @cached_property
    def saturated(self) -> tuple[bool, ...]:
        """Which inflated links are on the plateau of their moment; none of those with linear springs."""
        beyond = self.model.springs.saturated(self.q_springs)
        return tuple(not beyond.isdisjoint(group.springs) for group in self.model.spring_groups)

    @property
    def wrinkled(self) -> bool:
        """Whether a link carries its wrinkling moment (3) or more, with its axial force, or is on its plateau.

        Linear springs are no longer valid there; a slack wall has softened from `link_limits.slack_margins` of zero on.
        """
        return bool(np.any(self.link_limits.wrinkling_margins <= 0.0)) or any(self.saturated)

    @property
    def within_limits(self) -> bool:
        """Whether every actuator and every elastic joint is within its limits; statics does not clip.

        Muscles must be within both their lengths and their tensions, whichever is given.
        """
        structure = self.model.structure
        joints = self.model.coordinates.at(self.q_motors, self.q_springs).joints
        return (
            _within(self.q_motors, self.model.motor_limits)
            and _within(joints, structure.elastic_limits)
            and _within(self.muscle_lengths, self.model.actuators.muscle_lengths + _LENGTH_ROUNDING)
            and _within(self.muscle_forces, self.model.actuators.muscle_forces)
        )

    @cached_property
    def eigenvalues(self) -> FloatArray:
        """Real parts of the eigenvalues of the tangent stiffness, ascending, shape (n_springs,) [N m/rad]."""
        solver = np.linalg.eigvalsh if self.conservative else np.linalg.eigvals
        with one_blas_thread(len(self.tangent_stiffness)):
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
    previous: Equilibrium | None = None,
    tolerance: float = TOLERANCE,
    max_iterations: int | None = None,
) -> Equilibrium:
    """Find the static equilibrium of the springs at given motor coordinates.

    It is the one reached by energy descent from the relaxed springs, or from `q_springs0`; with a world-fixed moment, which
    has no energy, the one reached by Newton from there, or while the load grows from zero, or while the moments grow from the
    equilibrium without them. A descent ends in a stable equilibrium, or in a neutral one (a round robot that has buckled can
    turn its bow about its axis); `Equilibrium.stability` tells which.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        force: Force at `frame`, shape (3,) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], world axes, force first; or `{frame: (6,)}` for several.
        frame: Name of the frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes, e.g. `softrobots.EARTH_GRAVITY`; None: weightless.
        method: "newton", or "fixed_point" ([Troise 2021], converges for small loads only).
        q_springs0: Start of the solver, shape (n_springs,) [rad or m]; the relaxed springs by default.
        previous: Where the robot comes from: what dry friction remembers, and the start unless `q_springs0` is given.
        tolerance: Largest residual, relative to `max(|f| reach + |moment| + |g|, 1e-3 N m)`.
        max_iterations: Limit of evaluations; 200 for "newton", 1000 for "fixed_point" by default.

    Returns:
        The equilibrium with its certificate.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        NameNotFound: If a frame does not exist.
        EquilibriumNotFound: If the residual stays above the tolerance; carries the best iterate.
    """
    choice("method", method, METHODS)
    model = untouched(check_model(model))
    motors = model.checked_motors(q_motors)
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity)
    relaxed = model.rest
    if previous is not None:
        check_same_model(model, previous, "previous")
        model, relaxed = after_step(previous.model, previous.q_motors, previous.q_springs), previous.q_springs
    start = relaxed if q_springs0 is None else finite_array("q_springs0", q_springs0, (model.n_springs,), "rad")
    if q_springs0 is not None and not model.coordinates.at(motors, start).valid:
        raise ParameterError("q_springs0", start, "within the range of every section (see strain_chain.in_range)")
    positive_number("tolerance", tolerance)
    most = None if max_iterations is None else positive_integer("max_iterations", max_iterations)
    state, iterations, stable = solve_springs(
        model, motors, load, start, method=method, tolerance=tolerance, max_iterations=most
    )
    result = equilibrium_from_state(
        model, motors, load, state, method=method, iterations=iterations, tolerance=tolerance, stable=stable
    )
    if not result.converged:
        raise EquilibriumNotFound(
            f"no equilibrium by {method!r} in {iterations} iterations: residual {result.residual:.3g} N m, required "
            f"{result.tolerance:.3g} N m" + _hint(result),
            best=result,
            residual=result.residual,
            iterations=iterations,
        )
    return result


def _hint(best: Equilibrium) -> str:
    """Advice for the error message."""
    ends = best.model.structure.at_range_end(best.q_motors, best.q_springs)
    if ends:
        return (
            f"; the load presses {', '.join(ends)} to the end of its range (see strain_chain.in_range): more sections may help"
        )
    if best.method == "fixed_point":
        return "; method='newton' converges for larger loads"
    overloaded = near_largest_moment(best.model, best.link_moments)
    if overloaded:
        return f"; {overloaded}; solve_imposed_displacement finds equilibria there for a given displacement"
    return (
        "" if best.conservative else "; under a world-fixed moment the load grows, then the moments alone, to a turning point"
    )


def equilibrium_from_state(
    model: SoftModel,
    q_motors: FloatArray,
    load: Load,
    state: ElasticState,
    *,
    method: str,
    iterations: int,
    tolerance: float = TOLERANCE,
    stable: bool | None = None,
) -> Equilibrium:
    """Result of a state; `stable` if it is already known."""
    if model.structure.friction is not None:
        model, state = rubbing_state(model, q_motors, state.q_springs, load)
    return Equilibrium(
        model=model,
        load=load,
        method=method,
        q_motors=read_only(q_motors),
        q_springs=read_only(state.q_springs),
        q=read_only(state.q),
        spring_torques=read_only(state.spring_torques),
        motor_torques=read_only(state.load.motors),
        tangent_stiffness=read_only(state.tangent),
        coupling=read_only(state.load.coupling),
        residual=state.error,
        tolerance=largest_residual(model, state.scale, tolerance),
        iterations=iterations,
        stable=is_stable(model, load, state) if stable is None else stable,
    )


def check_same_model(model: SoftModel, equilibrium: Any, name: str = "equilibrium") -> None:
    """Check that an argument of a name is an equilibrium of a model.

    Raises:
        ParameterError: If it is something else.
    """
    check_model(model)
    instance_of(name, equilibrium, Equilibrium, "an Equilibrium of the model")
    if equilibrium.model != model:
        raise ParameterError(name, equilibrium.model, f"an equilibrium of the model given, {model!r}")


def _within(values: FloatArray, limits: FloatArray) -> bool:
    return bool(np.all((values >= limits[:, 0]) & (values <= limits[:, 1])))
