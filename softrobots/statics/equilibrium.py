"""Find the static equilibrium of a robot with joint springs; `softrobots.statics.elastostatics` solves."""

from __future__ import annotations

import math
from typing import Any

from softrobots.core.checks import FloatArray, choice, finite_array, positive_integer, positive_number, read_only
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.environment.environment import Environment
from softrobots.model.friction_coordinates import after_step, grip_of, memory_of, remembering, untouched
from softrobots.model.link_limits import near_largest_moment
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.contact.certificate import active_contacts
from softrobots.statics.contact.contact import contacts_of
from softrobots.statics.contact.touch import TOUCHING, deepest_penetration
from softrobots.statics.elastic_state import TOLERANCE, ElasticState, largest_residual, rubbing_state
from softrobots.statics.elastostatics import METHODS, solve_springs
from softrobots.statics.equilibrium_result import Equilibrium, check_same_model
from softrobots.statics.loads import Load
from softrobots.statics.stability import is_stable

__all__ = ["Equilibrium", "check_same_model", "equilibrium_from_state", "solve_equilibrium"]


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
    environment: Environment | None = None,
) -> Equilibrium:
    """Find the static equilibrium of the springs at given motor coordinates.

    It is the one reached by energy descent from the relaxed springs, or from `q_springs0`. With a world-fixed moment there is
    no energy. Tried in turn are then Newton's method from the start, a load that grows from zero, and moments that grow from
    the equilibrium without them. A descent ends in a stable equilibrium, or in a neutral one (a round robot that has buckled
    can turn its bow about its axis); `Equilibrium.stability` tells which.

    Args:
        model: The robot.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa], in the order of `model.actuator_names`; or by name,
            `{"motor_1": 0.3, ...}`, here and wherever a function takes `q_motors`.
        force: Force at `frame`, shape (3,) [N], world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], world axes, force first; or `{frame: (6,)}` for several.
        frame: Name of the frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes, e.g. `softrobots.EARTH_GRAVITY`; None: weightless.
        method: "newton", or "fixed_point" ([Troise 2021], converges for small loads only).
        q_springs0: Start of the solver, shape (n_springs,) [rad or m]; the relaxed springs by default.
        previous: Where the robot comes from: what dry friction remembers, and the start unless `q_springs0` is given.
        tolerance: Largest residual, relative to `max(|f| reach + |moment| + |g|, 1e-3 N m)`.
        max_iterations: Limit of evaluations; 200 for "newton", 1000 for "fixed_point" by default, ten times that where
            actuators rub in their guides.
        environment: Obstacles that the robot touches without friction; only with "newton", and without moments.

    Returns:
        The equilibrium with its certificate.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        NameNotFound: If a frame does not exist.
        EquilibriumNotFound: If the residual stays above the tolerance; carries the best iterate.
    """
    choice("method", method, METHODS)
    motors = check_model(model).checked_motors(q_motors)
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity, environment=environment)
    model, before = from_before(model, previous)
    start = before if q_springs0 is None else finite_array("q_springs0", q_springs0, (model.n_springs,), "rad")
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
            f"{result.tolerance:.3g} N m" + advice(result, state),
            best=result,
            residual=result.residual,
            iterations=iterations,
        )
    return result


def from_before(model: SoftModel, previous: Equilibrium | None) -> tuple[SoftModel, FloatArray]:
    """Return the robot with what dry friction remembers of the state before, and its springs there; None: of rest.

    Raises:
        ParameterError: If `previous` is no equilibrium of the robot.
    """
    if previous is None:
        return untouched(model), model.rest
    check_same_model(model, previous, "previous")
    return after_step(previous.model, previous.q_motors, previous.q_springs), previous.q_springs


def advice(best: Equilibrium, state: ElasticState) -> str:
    """Return what the error of a state that is no equilibrium says of the cause and of a cure, after a semicolon."""
    if state.touch is not None and state.touch.penetration > TOUCHING * best.model.reach:
        return f"; {deepest_penetration(state.touch, state.point)}"
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
    if best.environment is not None:
        names = ", ".join(map(repr, best.environment.names))
        return f"; among {names} no step lowers the energy; follow_contact goes by small steps from an equilibrium"
    if best.model.structure.guided and math.isinf(state.error):
        return "; the friction in the guides does not settle with the tensions: smaller steps from `previous` may get there"
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
    if model.structure.friction is not None:  # from the friction of guides that the state has: others may balance it, too
        settled = remembering(model, memory_of(model), grip_of(state.model))
        model, state = rubbing_state(settled, q_motors, state.q_springs, load)
    allowed = largest_residual(model, state.scale, tolerance)
    contacts: dict[str, Any] = {}
    if state.touch is not None:
        active = active_contacts(state.touch, model.reach, allowed)
        contacts = {
            "contacts": contacts_of(state.touch, active),
            "contact_gradients": read_only(state.touch.rows[active.pressed]),
        }
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
        tolerance=allowed,
        iterations=iterations,
        stable=is_stable(model, load, state, tolerance) if stable is None else stable,
        **contacts,
    )
