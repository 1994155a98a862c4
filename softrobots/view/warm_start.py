"""Warm-started equilibrium and inverse kinematics for interactive use."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.errors import EquilibriumNotFound, TargetUnreachable
from softrobots.model.friction_coordinates import after_step
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik

_STARTS = 6  # searches when that from the last coordinates fails: few, for a quick answer


def next_equilibrium(last: Equilibrium, q_motors: Any, force: Any = None, *, gravity: Any = None) -> Equilibrium:
    """Solve an equilibrium from another one, among its obstacles; a robot that has snapped through stays on its branch.

    Args:
        last: The equilibrium to start from.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa].
        force: Force on the tip, shape (3,) [N], world axes.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

    Returns:
        The equilibrium that `solve_equilibrium` finds from `last`, or else, without dry friction, from relaxed springs.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        EquilibriumNotFound: If there is none from there either.
    """
    model, rubs = last.model, last.model.structure.friction is not None
    motors, obstacles = model.checked_motors(q_motors), last.load.environment
    if rubs or model.coordinates.at(motors, last.q_springs).valid:
        try:
            return solve_equilibrium(model, motors, force, gravity=gravity, previous=last, environment=obstacles)
        except EquilibriumNotFound:
            if rubs:
                raise
    return solve_equilibrium(model, motors, force, gravity=gravity, environment=obstacles)


def next_solution(last: Equilibrium, target: Any, force: Any = None, *, gravity: Any = None) -> IkSolution:
    """Solve the inverse kinematics of the loaded tip starting from another equilibrium, among its obstacles.

    Args:
        last: The equilibrium to start from.
        target: Target of the tip, shape (3,) [m], world axes.
        force: Force on the tip, shape (3,) [N], world axes.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

    Returns:
        The solution of a search from the actuator coordinates of `last`, or, if it fails, the nearest solution that
        `solve_ik` finds from a few starts.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has no actuators.
        TargetUnreachable: If no search reaches the target.
        EquilibriumNotFound: If there is no equilibrium at any of the starts.
    """
    given = {"gravity": gravity, "environment": last.load.environment}
    model = after_step(last.model, last.q_motors, last.q_springs)
    low, high = model.motor_limits.T
    start = last.q_motors if np.all((last.q_motors >= low) & (last.q_motors <= high)) else None
    try:
        return solve_ik(model, target, force, q_motors0=start, starts=1, **given)
    except (TargetUnreachable, EquilibriumNotFound):
        return solve_ik(model, target, force, q_motors0=start, starts=_STARTS, **given)
