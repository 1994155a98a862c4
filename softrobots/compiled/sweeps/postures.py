"""Start postures of inverse kinematics: the unloaded arm at a table of motor angles, by elbow and by side.

The same point is reached with the elbow up or down, and forwards or over the back. A search that starts on one of these
branches stays there as a rule, so every branch has starts of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel

if TYPE_CHECKING:
    from softrobots.compiled.run.compiled_model import CompiledModel

_SHOULDER, _ELBOW = 64, 48  # angles in the table: starts are within a few hundredths of the reach from their targets
_FREE = 1e6  # [rad], instead of no limit
_ROUND_OFF = 1e-9  # [rad], by which a motor may end beyond its limit


class Branch(NamedTuple):
    """Postures of one kind at zero angle of motor 1, and the tip positions."""

    q_motors: FloatArray
    """Motor angles, shape (n, 3) [rad]."""
    radius: FloatArray
    """Distance of the tip from the axis of motor 1, shape (n,) [m]."""
    height: FloatArray
    """Height of the tip, shape (n,) [m]."""
    azimuth: FloatArray
    """Angle of the tip about the axis of motor 1, shape (n,) [rad]."""

    def starts(self, targets: FloatArray) -> FloatArray:
        """Return the posture whose tip is nearest to each target, turned towards it, shape (n_targets, 3) [rad].

        Motor 1 may be beyond its limits.
        """
        radius, height = np.hypot(targets[:, 0], targets[:, 1]), targets[:, 2]
        apart = (radius[:, None] - self.radius) ** 2 + (height[:, None] - self.height) ** 2
        nearest = apart.argmin(axis=1)
        postures = self.q_motors[nearest]
        postures[:, 0] = np.arctan2(targets[:, 1], targets[:, 0]) - self.azimuth[nearest]
        return np.asarray(postures)


def check_arm(model: SoftModel) -> None:
    """Require an arm of inflated links with three motors.

    Raises:
        ParameterError: If the robot does not have three turning motors, the first about the vertical through the base, or a
            spring belongs to no inflated link.
        DescriptionError: If it is not a serial chain.
    """
    springs = {place for group in model.spring_groups for place in (*group.springs, group.twist)} - {None}
    if model.n_motors != 3 or model.muscles or not springs or springs != set(range(model.n_springs)):
        raise ParameterError("model", model, "an arm with three motors whose springs are those of inflated links")
    first, turning = model.chain().elements[0], model.actuators.turning
    upright = np.abs(first.rotation[:, 2] - (0.0, 0.0, 1.0)).max() < 1e-12 and np.abs(first.translation[:2]).max() < 1e-12
    if getattr(first, "motor", None) != 0 or not upright or not all(turning):
        raise ParameterError("model", model, "an arm whose motors turn, the first about the vertical through the base")


def branches(model: SoftModel, compiled: CompiledModel) -> tuple[Branch, ...]:
    """Tables of postures within the motor limits: elbow bent up or down, tip before or behind the axis of motor 1.

    An arm whose motors turn all round and whose springs rest at zero is over its back in the same postures as forwards, so it
    has two branches instead of four. Branches without postures are left out.
    """
    limits = np.clip(model.motor_limits, -np.pi, np.pi)
    same_behind = not model.rest.any() and bool(np.all(limits[:, 0] <= -np.pi) and np.all(limits[:, 1] >= np.pi))
    shoulder, elbow = _between(limits[1], _SHOULDER), _between(limits[2], _ELBOW)
    motors = np.stack(np.meshgrid([0.0], shoulder, elbow, indexing="ij"), axis=-1).reshape(-1, 3)
    tips = compiled.equilibria(motors, np.zeros((len(motors), 3))).tip_positions
    radius, azimuth = np.hypot(tips[:, 0], tips[:, 1]), np.arctan2(tips[:, 1], tips[:, 0])
    before = np.abs(azimuth) <= 0.5 * np.pi
    tables = []
    for side in (before,) if same_behind else (before, ~before):
        for bent in (motors[:, 2] < 0.0, motors[:, 2] >= 0.0):
            kept = side & bent
            if kept.any():
                tables.append(Branch(motors[kept], radius[kept], tips[kept, 2], azimuth[kept]))
    return tuple(tables)


def starts(model: SoftModel, tables: Sequence[Branch], targets: FloatArray) -> FloatArray:
    """Return start poses for targets, shape (n, 3) [m]: the relaxed arm, for each branch and target, within the motor limits.

    Returns:
        Motor angles and then springs, branch by branch, shape (n_branches * n, n_motors + n_springs) [rad].
    """
    motors = np.concatenate([branch.starts(targets) for branch in tables])
    return np.hstack([within_turns(model, motors)[0], np.tile(model.rest, (len(motors), 1))])


def within_turns(model: SoftModel, q_motors: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Turn motors, shape (n, n_motors) [rad], by whole turns towards their limits; return also which rows are within them."""
    low, high = np.clip(model.motor_limits, -_FREE, _FREE).T
    turns = np.rint((q_motors - 0.5 * (low + high)) / (2.0 * np.pi))
    turned = np.where((q_motors < low) | (q_motors > high), q_motors - 2.0 * np.pi * turns, q_motors)
    return turned, ((turned >= low - _ROUND_OFF) & (turned <= high + _ROUND_OFF)).all(axis=1)


def _between(limits: FloatArray, count: int) -> FloatArray:
    """Return the centres of `count` equal intervals between two limits."""
    return np.asarray(limits[0] + (np.arange(count) + 0.5) * ((limits[1] - limits[0]) / count))
