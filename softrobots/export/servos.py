r"""Position servos in place of motors in a simulator.

Statics holds an actuator exactly; a servo is compliant. Its gain is its largest force over a small error,

.. math:: k_p = F / \varepsilon, \qquad k_v = 2 \sqrt{k_p I}

and `k_v` damps it critically with the inertia `I` of all that turns about its axis at the home position. (A simulator that
takes `I` from the inverse of the mass matrix, as MuJoCo's `dampratio` does, finds the body next to the motor, behind which the
rest hangs on springs: a two-thousandth of it in the inflatable arm.)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import LARGEST, FloatArray
from softrobots.description.rigid_tree import Joint
from softrobots.model.soft_model import SoftModel

ANGLE_ERROR = 1e-2
"""Error at which the servo of a revolute motor reaches its full torque [rad]."""

_TRAVEL_ERROR = 1e-3  # the same for a prismatic motor, relative to its travel
_UNLIMITED = 1e3  # gain without a limit, over the stiffness of the stiffest spring


class Servo(NamedTuple):
    """A position servo: `force = gain (command - position) - damping velocity`, within its limits."""

    gain: float
    """Force per error [N m/rad or N/m]."""
    damping: float
    """Force per speed [N m s/rad or N s/m]."""
    force: float
    """Largest force [N m or N]; infinite if unlimited."""


@dataclass(frozen=True, eq=False)
class Motor:
    """A driven motor."""

    joint: Joint
    """The joint."""
    position: float
    """Position at home [rad or m]."""
    servo: Servo
    """Its servo."""

    @property
    def speed_damping(self) -> float:
        """Damping at which the largest force gives the largest speed; at least that of the description."""
        fastest, force = self.joint.velocity, self.servo.force
        return max(self.joint.damping, force / fastest if 0.0 < fastest < LARGEST and force < LARGEST else 0.0)


def motors_of(model: SoftModel, joints: Sequence[Joint], positions: Mapping[str, float], mass: FloatArray) -> tuple[Motor, ...]:
    """Return the driven motors at given positions [rad or m], with servos for the mass matrix at home, shape (nv, nv)."""
    by_name = {joint.name: joint for joint in joints}
    inertia = dict(zip(positions, np.diag(mass)[model.structure.motor_indices].tolist(), strict=True))
    return tuple(
        Motor(by_name[name], position, _motor_servo(by_name[name], model.stiffest, inertia[name]))
        for name, position in positions.items()
    )


def _motor_servo(joint: Joint, stiffest: float, inertia: float) -> Servo:
    if not 0.0 < joint.effort < LARGEST:
        gain, force = _UNLIMITED * (stiffest or 1.0), math.inf
    else:
        travel = joint.limits[1] - joint.limits[0]
        slides = joint.kind == "prismatic" and 0.0 < travel < LARGEST
        gain, force = joint.effort / (_TRAVEL_ERROR * travel if slides else ANGLE_ERROR), joint.effort
    return Servo(gain, 2.0 * math.sqrt(gain * inertia), force)
