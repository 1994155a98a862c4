"""The next equilibrium and the next solution, from where a robot is: as it moves while somebody turns a knob."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import EquilibriumNotFound, TargetUnreachable
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik

_STARTS = 6  # of a search when that from the last coordinates fails: somebody waits


def next_equilibrium(last: Equilibrium, q_motors: Any, force: Any = None, *, gravity: Any = None) -> Equilibrium:
    """Find the equilibrium that a robot comes to from another one; a robot that has snapped through stays on its branch.

    Args:
        last: Where it is.
        q_motors: Actuator coordinates, shape (n_motors,) [rad, m or N].
        force: Force on the tip, shape (3,) [N], world axes.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

    Returns:
        The equilibrium found by `solve_equilibrium` from the springs of `last`, or, if there is none, from relaxed springs.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range.
        EquilibriumNotFound: If there is none from relaxed springs either.
    """
    model = last.model
    motors = model.checked_motors(q_motors)
    if model.coordinates.at(motors, last.q_springs).valid:
        try:
            return solve_equilibrium(model, motors, force, gravity=gravity, q_springs0=last.q_springs)
        except EquilibriumNotFound:
            pass
    return solve_equilibrium(model, motors, force, gravity=gravity)


def next_solution(last: Equilibrium, target: Any, force: Any = None, *, gravity: Any = None) -> IkSolution:
    """Find actuator coordinates that put the loaded tip at a target, near to those of another equilibrium.

    Args:
        last: Where the robot is.
        target: Target of the tip, shape (3,) [m], world axes.
        force: Force on the tip, shape (3,) [N], world axes.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

    Returns:
        The solution that a search from the actuator coordinates of `last` ends in, or, if it does not arrive, the nearest of
        those that `solve_ik` finds from a few starts.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has no actuators.
        TargetUnreachable: If no search arrives.
        EquilibriumNotFound: If the springs settle at none of the starts.
    """
    start = _within_limits(last.model, last.q_motors)
    try:
        return solve_ik(last.model, target, force, gravity=gravity, q_motors0=start, starts=1)
    except (TargetUnreachable, EquilibriumNotFound):
        return solve_ik(last.model, target, force, gravity=gravity, q_motors0=start, starts=_STARTS)


def _within_limits(model: SoftModel, motors: FloatArray) -> FloatArray | None:
    """Where a search may start; None, for its own start, if these coordinates are beyond the limits."""
    low, high = model.motor_limits.T
    return motors if np.all((motors >= low) & (motors <= high)) else None
