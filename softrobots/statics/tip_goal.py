"""Where the tip must be, and the robot on Pinocchio that is searched for it by `softrobots.statics.tip_search`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticState
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import tip_motion
from softrobots.statics.tip_search import LEVER, LocalSolution


class Goal(NamedTuple):
    """Where the tip must be, and perhaps how it must stand there."""

    position: FloatArray
    """Position, shape (3,) [m], world axes."""
    rotation: FloatArray | None = None
    """Orientation of the tip, shape (3, 3), or the direction of its z axis, shape (3,), of length 1; None: any."""

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, 2 more for a direction, 3 more for an orientation."""
        return 3 if self.rotation is None else 5 if self.rotation.ndim == 1 else 6

    def missing(self, model: SoftModel, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Way from the tip to the goal: translation, shape (3,) [m], and rotation vector, shape (3,) [rad], world axes."""
        pose = frame_placement(model, q, model.tip)
        return self.position - pose.translation, self._turn(pose.rotation)

    def _turn(self, rotation: FloatArray) -> FloatArray:
        if self.rotation is None:
            return np.zeros(3)
        if self.rotation.ndim == 2:
            return np.asarray(pin.log3(self.rotation @ rotation.T))
        pointing = rotation[:, 2]
        axis = np.cross(pointing, self.rotation)
        sine, cosine = float(np.linalg.norm(axis)), float(pointing @ self.rotation)
        if sine > 0.0:
            return np.asarray(axis * (np.arctan2(sine, cosine) / sine))
        return np.zeros(3) if cosine > 0.0 else np.pi * rotation[:, 0]  # opposite: any way round

    def jacobian(self, model: SoftModel, q: FloatArray) -> FloatArray:
        """Derivative of what `missing` is measured by, per joint, shape (3 or 6, nv), turns times the lever [m/rad]."""
        columns = frame_jacobian(model, q, model.tip)
        if self.rotation is None:
            return columns[:3]
        turning = columns[3:]
        if self.rotation.ndim == 1:
            pointing = frame_placement(model, q, model.tip).rotation[:, 2]
            turning = turning - np.outer(pointing, pointing @ turning)
        return np.concatenate([columns[:3], LEVER * model.reach * turning])


@dataclass(frozen=True, eq=False)
class LoadedTip:
    """A robot under a load, and the goal of its tip."""

    model: SoftModel
    """The robot."""
    goal: Goal
    """The goal."""
    load: Load
    """The load."""
    method: str = "newton"
    """How the springs settle."""

    @property
    def rows(self) -> int:
        """Number of conditions."""
        return self.goal.rows

    def towards(self, position: FloatArray) -> LoadedTip:
        """The same robot with the tip to go to another position, shape (3,) [m], anyhow."""
        return replace(self, goal=Goal(position))

    def settle(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[ElasticState] | None:
        """Elastic coordinates in equilibrium and the distance of the tip; None if they do not settle."""
        if not self.model.actuators.admit(q_motors):
            return None
        state = balanced_state(self.model, q_motors, self.load, start, method=self.method)
        if state is None:
            return None
        translation, turn = self.goal.missing(self.model, state.q)
        return LocalSolution(q_motors, state, float(np.linalg.norm(translation)), float(np.linalg.norm(turn)))

    def missing(self, state: ElasticState) -> FloatArray:
        """Way from the tip to the goal, shape (3 or 6,), turns times the lever [m]."""
        translation, turn = self.goal.missing(self.model, state.q)
        if self.goal.rotation is None:
            return translation
        return np.concatenate([translation, LEVER * self.model.reach * turn])

    def motion(self, state: ElasticState) -> tuple[FloatArray, FloatArray]:
        """How tip and elastic coordinates follow the actuators; see `softrobots.statics.sensitivity.tip_motion`."""
        motors, springs = state.point.columns(self.goal.jacobian(self.model, state.q))
        return tip_motion(motors, springs, state.tangent, state.load.coupling)
