"""Inverse kinematics of the rigid arm by Pink: the same arm with its springs locked. Needs Pink and daqp (extra `bench`).

Rigid inverse kinematics is the easier job: three joints, no load, no equilibrium. Pink solves a quadratic programme a step,
here with daqp, the fastest of its solvers for such small programmes; with the limits that it imposes by itself, or faster
without.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import MissingDependency, NotConverged
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel

SOLVER = "daqp"
"""Solver of the quadratic programmes."""

_MOST = 100  # steps a waypoint


class PinkArm:
    """The rigid arm with a task for its tip."""

    def __init__(self, model: SoftModel, *, limits: bool = False) -> None:
        """Lock the springs and make the task.

        Args:
            model: The robot.
            limits: Whether joint and speed limits hold.

        Raises:
            MissingDependency: If Pink or daqp is not installed.
        """
        try:
            import daqp  # noqa: F401  # Pink finds it by its name
            import pink
            from pink.tasks import FrameTask
        except ImportError as error:
            raise MissingDependency("pin-pink with daqp", "bench") from error
        self._pink = pink
        self._options: dict[str, Any] = {"solver": SOLVER} | ({} if limits else {"limits": [], "safety_break": False})
        rigid = load_model(model.urdf, springs={}, motors=list(model.motor_joints), tip=model.tip)
        self._model, self._data = rigid.workspace(None)
        self._task = FrameTask(model.tip, position_cost=1.0, orientation_cost=0.0)

    def follow(self, targets: FloatArray, q_motors: FloatArray, *, tolerance: float = 1e-9) -> FloatArray:
        """Motor angles that put the rigid tip on each target, each from the one before.

        Args:
            targets: Tip positions, shape (n, 3) [m].
            q_motors: Where to start, shape (n_motors,) [rad].
            tolerance: Largest distance of the tip from its target [m].

        Returns:
            Motor angles, shape (n, n_motors) [rad].

        Raises:
            NotConverged: If a target is not reached.
        """
        configuration: Any = self._pink.Configuration(self._model, self._data, np.array(q_motors), copy_data=False)
        aim, found = configuration.get_transform_frame_to_world(self._task.frame), []
        for target in targets:
            aim.translation = target
            self._task.set_target(aim)
            for _ in range(_MOST):
                error = configuration.get_transform_frame_to_world(self._task.frame).translation - target
                if float(error @ error) <= tolerance**2:
                    break
                velocity = self._pink.solve_ik(configuration, [self._task], 1.0, **self._options)
                configuration.integrate_inplace(velocity, 1.0)
            else:
                message = f"Pink does not reach {target.tolist()} m in {_MOST} steps"
                raise NotConverged(message, best=configuration.q, residual=float(np.linalg.norm(error)), iterations=_MOST)
            found.append(np.array(configuration.q))
        return np.array(found)
