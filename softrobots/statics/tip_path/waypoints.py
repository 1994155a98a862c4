"""Exact steps along a path of targets: the loaded tip at every waypoint, each searched from the last one."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError, TargetUnreachable
from softrobots.environment.swept import may_pass
from softrobots.model.friction_coordinates import after_step
from softrobots.statics.elastic_state import ElasticState, elastic_state
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik
from softrobots.statics.spherical_wrist import NEAR_SINGULAR, spherical_wrist
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_search import LocalSolution, advance

_HALVINGS = 12  # of the way between two waypoints beside an obstacle


class _Blocked(SoftRobotsError):
    """No continuous motion leads to a waypoint; the text says what is in the way, after a semicolon, or nothing."""


def named(error: TargetUnreachable, number: int, total: int) -> TargetUnreachable:
    """Return the error with the number of its waypoint, counted from 1."""
    message = f"waypoint {number} of {total}: {error}"
    return TargetUnreachable(message, best=error.best, residual=error.residual, iterations=error.iterations)


def exact_steps(
    tip: LoadedTip, goals: list[Goal], first: Equilibrium, tolerance: float, allow_jumps: bool
) -> Iterable[Equilibrium]:
    """Move from waypoint to waypoint.

    Args:
        tip: The robot under its load; its goal is ignored.
        goals: The waypoints.
        first: The robot at the first one.
        tolerance: Largest distance of the tip from a waypoint [m].
        allow_jumps: Whether to go on from the nearest other solution where no continuous motion leads to a waypoint.

    Yields:
        The robot at each of the others.

    Raises:
        TargetUnreachable: If a waypoint cannot be reached, or not without a jump.
        EquilibriumNotFound: If a waypoint has no equilibrium.
    """
    model, load, method = tip.model, tip.load, tip.method
    here = LocalSolution(first.q_motors, elastic_state(first.model, first.q_motors, first.q_springs, load), 0.0)
    tip = replace(tip, model=after_step(first.model, first.q_motors, first.q_springs))
    for number, (last, target) in enumerate(pairwise(goals), start=2):
        try:
            reached = _reach(tip, last, target, here, tolerance)
        except _Blocked as blocked:
            try:
                reached = _jump(tip, target, here.q_motors, tolerance)
            except TargetUnreachable as error:
                raise named(error, number, len(goals)) from error
            if not allow_jumps and model.structure.friction is None:  # friction holds the tip while motors move
                apart = reached.q_motors - here.q_motors
                wrist = spherical_wrist(model) if target.rotation is not None else None
                singular = None if wrist is None else wrist.singularity(here.state.q, NEAR_SINGULAR)
                solution = equilibrium_from_state(model, reached.q_motors, load, reached.state, method=method, iterations=0)
                units = ", ".join(dict.fromkeys(model.actuators.units))
                raise TargetUnreachable(
                    f"waypoint {number} of {len(goals)}: no continuous motion reaches it from the previous one; the nearest "
                    f"solution is a jump of the motors by {apart.round(4).tolist()} {units} (allow_jumps=True takes it)"
                    + (f"; {singular}" if singular else "")
                    + str(blocked),
                    best=IkSolution(
                        target.position, target.rotation, solution, reached.error, reached.angle, reached.iterations, ()
                    ),
                    residual=reached.error,
                    iterations=reached.iterations,
                ) from None
        here = reached
        found = equilibrium_from_state(tip.model, here.q_motors, load, here.state, method=method, iterations=here.iterations)
        tip = replace(tip, model=after_step(found.model, found.q_motors, found.q_springs))
        yield found


def _reach(
    tip: LoadedTip, last: Goal, target: Goal, here: LocalSolution[ElasticState], tolerance: float, halvings: int = _HALVINGS
) -> LocalSolution[ElasticState]:
    """Move from one waypoint to the next in steps that pass through nothing; `_Blocked` if there are none."""
    reached, before, around = advance(tip, last, target, here, tolerance), here.state.touch, tip.load.environment
    if reached is None:
        raise _Blocked
    if around is None or before is None or reached.state.touch is None:
        return reached
    surroundings, q = before.surroundings, here.state.q
    passed = may_pass(before.gaps, reached.state.touch.gaps, around, lambda margin: surroundings.at(q, margin))
    if passed is None:
        return reached
    if halvings == 0:
        names = (*around.names, "the robot itself")
        raise _Blocked(f"; {surroundings.link(passed[0])!r} would pass through {names[passed[1]]!r}")
    middle = last.between(target, 0.5)
    half = _reach(tip, last, middle, here, tolerance, halvings - 1)
    return _reach(tip, middle, target, half, tolerance, halvings - 1)


def _jump(tip: LoadedTip, target: Goal, start: FloatArray, tolerance: float) -> LocalSolution[ElasticState]:
    """Solution for a waypoint from any start, where the path from the previous one is blocked."""
    model, load = tip.model, tip.load
    options: dict[str, Any] = {"wrench": dict(load.wrenches), "gravity": load.gravity, "tolerance": tolerance}
    options |= {"environment": load.environment}
    ik = solve_ik(model, target.position, orientation=target.rotation, q_motors0=start, method=tip.method, **options)
    state = elastic_state(model, ik.q_motors, ik.equilibrium.q_springs, load)
    return LocalSolution(ik.q_motors, state, ik.error, ik.orientation_error, ik.iterations)
