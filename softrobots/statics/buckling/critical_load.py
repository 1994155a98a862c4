"""Buckling: the critical load, at which an equilibrium path loses its stability."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import NoCriticalLoad, ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.buckling.force_path import ZERO_EIGENVALUE, ForcePath
from softrobots.statics.elastostatics import balanced_state

_LARGEST_STEP = 0.1  # of the springs between two points of the path [rad]
_GROWTH = 0.25  # of the force between two points


class CriticalPoint(NamedTuple):
    """Point at which an equilibrium path loses its stability."""

    path: ForcePath
    """The path; its reference point is the critical one, the last that is stable."""
    crosses: bool
    """Whether an eigenvalue of the tangent stiffness crosses zero and the path continues, unstable.

    Otherwise the path turns back, or the eigenvalue jumps below zero at the plateau of a link.
    """
    origin: FloatArray
    """The springs at the beginning of the path, without the force, shape (n_springs,) [rad or m]."""


def critical_load(
    model: SoftModel,
    q_motors: Any,
    direction: Any,
    *,
    frame: str | None = None,
    gravity: Any = None,
    max_force: float | None = None,
) -> float:
    """Smallest force along a direction at which the equilibrium loses its stability.

    Follows the equilibrium from zero force, without leaving its path, until the smallest eigenvalue of the tangent
    stiffness crosses zero (a pitchfork, as of an axially pushed straight arm) or the path turns back (a limit point). A
    slightly oblique push may bend the robot smoothly where the exact one buckles it, and then has no critical load, unless a
    link with a largest moment collapses, at its plateau or beyond.

    Args:
        model: The robot.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        direction: Direction of the force, shape (3,), any length but zero, world axes.
        frame: Frame that is pushed; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless. It stays constant.
        max_force: Limit of the force [N]; by default 100 times the largest stiffness over the reach.

    Returns:
        The force [N].

    Raises:
        ParameterError: If an argument is out of range, the model has no springs, or it is unstable under gravity alone.
        NameNotFound: If the frame does not exist.
        NoCriticalLoad: If the path is stable up to `max_force` (the direction pulls or bends rather than pushes), or as far
            as it could be followed.
    """
    path = ForcePath.of(model, q_motors, direction, frame=frame, gravity=gravity)
    return critical_point(path, gravity, max_force).path.force


def critical_point(path: ForcePath, gravity: Any = None, max_force: float | None = None) -> CriticalPoint:
    """Find the critical point of a path from zero force, with `gravity`, `max_force` and errors of `critical_load`."""
    model = path.model
    if model.n_springs == 0:
        raise ParameterError("model", model, "a robot with springs")
    largest = 100.0 * model.stiffest / model.reach if max_force is None else positive_number("max_force", max_force, "N")

    with one_blas_thread(model.n_springs):
        first_state = balanced_state(model, path.motors, path.constant, model.rest)
        if first_state is not None:
            scale = float(model.stiffness.min()) / model.reach
            path = replace(path, springs=first_state.q_springs, force=scale)
        origin = path.point(path.springs, 0.0)
        if first_state is None or path.eigenvalues(origin)[0] <= 0.0:
            raise ParameterError("gravity", gravity, "a load under which the robot is stable before it is pushed")
        followed = path.follow([origin], path.direction(origin), largest, _LARGEST_STEP, growth=_GROWTH, while_stable=True)
        if followed.ended == "unstable":
            stable, unstable = followed.points[-2:]
            last = path.before_change(stable, unstable)
            crosses = bool(followed.crossings and path.eigenvalues(last)[0] <= ZERO_EIGENVALUE)
            return CriticalPoint(replace(path, springs=last.springs, force=last.force), crosses, path.springs)
    complete = followed.ended == "largest force"
    reached = largest if complete else followed.points[-1].force
    message = f"the equilibrium stays stable up to {reached:.6g} N along {path.unit.tolist()}"
    if not complete:
        message += f"; its path could not be followed further (limit: {largest:.6g} N)"
    raise NoCriticalLoad(message, max_force=reached)
