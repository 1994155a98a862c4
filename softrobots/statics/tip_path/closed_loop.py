"""Closed-loop inverse kinematics of [Troise 2021] along a path of positions."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import EquilibriumNotFound
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import TOLERANCE, largest_residual
from softrobots.statics.elastostatics import solve_springs
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load


def paper_steps(
    model: SoftModel, points: FloatArray, times: FloatArray, load: Load, first: Equilibrium, gain: float
) -> Iterable[Equilibrium]:
    """Integrate `dq_m/dt = [J^#]_m (v_d + K e)`, [Troise 2021] (8, 9), with the three position rows of the Jacobian.

    By explicit Euler, with the springs by the fixed point at every step.

    Args:
        model: The robot.
        points: Waypoints, shape (n, 3) [m].
        times: Their times, shape (n,) [s].
        load: The load.
        first: The robot at the first waypoint.
        gain: The gain `K` [1/s].

    Yields:
        The robot at each of the other waypoints.

    Raises:
        EquilibriumNotFound: If the fixed point does not converge.
    """
    motors, springs, q = np.array(first.q_motors), np.array(first.q_springs), first.q
    for number in range(1, len(points)):
        interval = times[number] - times[number - 1]
        velocity = (points[number] - points[number - 1]) / interval
        parts = max(1, int(np.ceil(2.0 * gain * interval - 1e-9)))  # explicit Euler is unstable at gain times step > 2
        spent = 0
        for part in range(parts):
            wanted = points[number - 1] + (part / parts) * (points[number] - points[number - 1])
            error = wanted - frame_placement(model, q, model.tip).translation
            point = model.coordinates.at(motors, springs)
            by_motors, by_springs = point.columns(frame_jacobian(model, q, model.tip)[:3])
            inverse = np.linalg.pinv(np.concatenate([by_motors, by_springs], axis=1))
            motors = motors + interval / parts * (inverse[: model.n_motors] @ (velocity + gain * error))
            motors = np.clip(motors, *model.motor_limits.T)
            state, used, _ = solve_springs(model, motors, load, springs, method="fixed_point", max_iterations=1000)
            spent += used
            if state.error > largest_residual(model, state.scale, TOLERANCE):
                best = equilibrium_from_state(model, motors, load, state, method="fixed_point", iterations=spent)
                raise EquilibriumNotFound(
                    f"waypoint {number + 1} of {len(points)}: the fixed point of method='paper' does not converge in {used} "
                    f"steps (residual {best.residual:.3g} N m)",
                    best=best,
                    residual=best.residual,
                    iterations=spent,
                )
            springs, q = np.array(state.q_springs), state.q
        yield equilibrium_from_state(model, motors, load, state, method="fixed_point", iterations=spent)
