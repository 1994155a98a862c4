"""Spherical wrists: last motors whose axes meet in one point; angles for an orientation in closed form, and singular poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_search import search

SINGULAR = 1e-3
"""Angle between the first and the last axis of a wrist below which it counts as singular [rad]."""

NEAR_SINGULAR = 0.3
"""Angle below which a wrist may have to turn too fast for a path [rad]."""

_ROUNDING = 1e-9  # of axes that meet and are perpendicular, relative to the reach
_LEEWAY = 0.2  # by which a start may be beyond a limit before it is moved there: load moves the solution [rad]
_SAME_ARM = 0.01  # motors of the arm closer than this belong to the same posture [rad]


@dataclass(frozen=True, eq=False)
class SphericalWrist:
    """The last three motors of a robot: their axes meet, each is perpendicular to the next, no spring is beyond the first."""

    model: SoftModel
    """The robot."""
    joints: tuple[str, str, str]
    """The motors, base to tip."""
    centre: FloatArray
    """Where their axes meet, in the axes of the tip, from its origin, shape (3,) [m]; the same in every pose."""

    def axes(self, q: FloatArray) -> FloatArray:
        """Return the axes of the motors in the world, one a row, shape (3, 3), at a configuration of Pinocchio."""
        return _columns(self.model, q, self.joints)[3:].T

    def singularity(self, q: FloatArray, within: float = SINGULAR) -> str | None:
        """Tell that first and last axis are parallel within an angle [rad]; None where they are not."""
        first, _, last = self.axes(q)
        angle = float(np.arcsin(min(1.0, float(np.linalg.norm(np.cross(first, last))))))
        if angle >= within:
            return None
        names, nearly = f"{self.joints[0]} and {self.joints[2]}", "" if angle < SINGULAR else "nearly "
        return f"the wrist is {nearly}singular: the axes of {names} are parallel to {angle:.2g} rad"

    def angles(self, q: FloatArray, rotation: FloatArray) -> tuple[FloatArray, FloatArray]:
        r"""Return changes of the motors that turn the tip to an orientation, shape (3, 3), while the robot before them is held.

        With the axes :math:`w_i` in the pose and the last axis :math:`w_3'` in the orientation, :math:`e^{w_1 d_1} e^{w_2 d_2}
        w_3 = w_3'`, so that :math:`w_1 \cdot w_3 \cos d_2 + w_1 \cdot (w_2 \times w_3) \sin d_2 = w_1 \cdot w_3'`: the part
        of the wrist in the decoupling of D. L. Pieper, The kinematics of manipulators under computer control, 1968.

        Returns:
            The two solutions, shape (3,) each [rad].
        """
        one, two, three = self.axes(q)
        turn = rotation @ frame_placement(self.model, q, self.model.tip).rotation.T
        wanted = turn @ three
        middle = float(np.arctan2(one @ np.cross(two, three), one @ three))
        span = float(np.arccos(np.clip(one @ wanted, -1.0, 1.0)))
        solutions = []
        for second in (middle - span, middle + span):
            tilted = pin.exp3(second * two) @ three
            first = float(np.arctan2(one @ np.cross(tilted, wanted), tilted @ wanted - (one @ tilted) * (one @ wanted)))
            rest = (pin.exp3(first * one) @ pin.exp3(second * two)).T @ turn
            solutions.append(np.array([first, second, float(pin.log3(rest) @ three)]))
        return solutions[0], solutions[1]

    def starts(self, tip: LoadedTip, starts: Sequence[FloatArray]) -> list[FloatArray]:
        """Return starts that hold the arm where it puts the centre of the wrist in place, and the wrist in the orientation.

        Args:
            tip: The loaded robot and its goal, a pose.
            starts: Motors to search the posture of the arm from, shape (n_motors,) each; the wrist turns as little as it can
                from the first of them.

        Returns:
            Up to two for each posture of the arm, those within the limits; none if the arm does not get there.
        """
        last = len(self.model.structure.motor_joints)  # muscles stand behind
        place = slice(last - 3, last)
        low, high = self.model.motor_limits[place].T
        home, rotation = starts[0][place], tip.goal.rotation
        if rotation is None:
            return []
        centred = replace(tip, goal=Goal(tip.goal.position + rotation @ self.centre, offset=self.centre))
        near = 1e-6 * self.model.reach
        arms: list[FloatArray] = []
        found = []
        for start in starts:
            begin = start.copy()
            begin[place] = home
            local = search(centred, begin, self.model.rest, tolerance=near, max_iterations=30)
            if local is None or not local.arrived(near):
                continue
            if any(float(np.abs(local.q_motors - arm).max()) < _SAME_ARM for arm in arms):
                continue
            arms.append(local.q_motors)
            for change in self.angles(local.state.q, rotation):
                wrist = local.q_motors[place] + change
                wrist -= 2.0 * np.pi * np.rint((wrist - home) / (2.0 * np.pi))
                wrist += 2.0 * np.pi * ((wrist < low).astype(float) - (wrist > high))
                if np.all((wrist >= low - _LEEWAY) & (wrist <= high + _LEEWAY)):
                    found.append(local.q_motors.copy())
                    found[-1][place] = np.clip(wrist, low, high)
        return found


def spherical_wrist(model: SoftModel) -> SphericalWrist | None:
    """Return the spherical wrist at the end of a robot; None if its last joints are no such motors."""
    names = model.structure.motor_joints[-3:]
    tree = model.pinocchio
    chain = list(tree.supports[tree.frames[model.frame_id(model.tip)].parentJoint])[-3:]
    if len(names) < 3 or [tree.names[joint] for joint in chain] != list(names):
        return None
    q = model.embed(model.coordinates.at(model.relaxed_motors, model.rest).joints)
    moves, axes = np.split(_columns(model, q, names), 2)
    if (
        not model.actuators.turning[: len(model.structure.motor_joints)][-3:].all()
        or max(abs(axes[:, 0] @ axes[:, 1]), abs(axes[:, 1] @ axes[:, 2])) > _ROUNDING
    ):
        return None
    # A point at `r` from the tip is on all axes if none of the motors moves it: v + w x r = 0.
    across = np.concatenate([pin.skew(axis) for axis in axes.T])
    still = -moves.T.ravel()
    centre = np.linalg.lstsq(across, still, rcond=None)[0]
    if float(np.abs(across @ centre - still).max()) > _ROUNDING * model.reach:
        return None
    rotation = frame_placement(model, q, model.tip).rotation
    return SphericalWrist(model, (names[0], names[1], names[2]), rotation.T @ centre)


def _columns(model: SoftModel, q: FloatArray, joints: Sequence[str]) -> FloatArray:
    """Columns of the Jacobian of the tip that belong to motors, world axes, shape (6, n) [m/rad; rad/rad]."""
    places = dict(zip(model.structure.motor_joints, model.structure.motor_indices, strict=True))
    return frame_jacobian(model, q, model.tip)[:, [places[name] for name in joints]]
