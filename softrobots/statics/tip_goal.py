"""Task of the tip (position, direction, orientation): error and Jacobian on a loaded robot in Pinocchio, for `tip_search`."""

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
    """Target position of the tip, and optionally its orientation or direction."""

    position: FloatArray
    """Position, shape (3,) [m], world axes."""
    rotation: FloatArray | None = None
    """Orientation of the tip, shape (3, 3), or the direction of its z axis, shape (3,), of length 1; None: any."""

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, 2 more for a direction, 3 more for an orientation."""
        return 3 if self.rotation is None else 5 if self.rotation.ndim == 1 else 6

    def missing(self, model: SoftModel, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return translation [m] and rotation vector [rad] from the tip to the goal, shape (3,) each, world axes."""
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
        return np.zeros(3) if cosine > 0.0 else np.pi * rotation[:, 0]  # opposite: any axis

    def jacobian(self, model: SoftModel, q: FloatArray) -> FloatArray:
        """Return the tip Jacobian in the components of the goal, shape (3 or 6, nv), rotations times the lever [m/rad]."""
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
    """A robot under a load, and the goal of its tip; a `tip_search.SoughtTip`."""

    model: SoftModel
    """The robot."""
    goal: Goal
    """The goal."""
    load: Load
    """The load."""
    method: str = "newton"
    """Solver of the springs, one of `elastostatics.METHODS`."""

    @property
    def rows(self) -> int:
        """Number of conditions of the goal."""
        return self.goal.rows

    def towards(self, position: FloatArray) -> LoadedTip:
        """Return a copy with another target position, shape (3,) [m], and no orientation target."""
        return replace(self, goal=Goal(position))

    def solve(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[ElasticState] | None:
        """Solve for the elastic coordinates from a start, shape (n_springs,); None if they do not converge."""
        if not self.model.actuators.admit(q_motors):
            return None
        state = balanced_state(self.model, q_motors, self.load, start, method=self.method)
        if state is None:
            return None
        translation, turn = self.goal.missing(self.model, state.q)
        return LocalSolution(q_motors, state, float(np.linalg.norm(translation)), float(np.linalg.norm(turn)))

    def missing(self, state: ElasticState) -> FloatArray:
        """Return the difference from the tip to the goal, shape (3 or 6,), rotations times the lever [m]."""
        translation, turn = self.goal.missing(self.model, state.q)
        if self.goal.rotation is None:
            return translation
        return np.concatenate([translation, LEVER * self.model.reach * turn])

    def motion(self, state: ElasticState) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of tip and elastic coordinates by the actuators; see `sensitivity.tip_motion`."""
        motors, springs = state.point.columns(self.goal.jacobian(self.model, state.q))
        return tip_motion(motors, springs, state.tangent, state.load.coupling)
