"""The cases on which simulators must agree with Pinocchio: three robots in five poses each, gravity off and on, a tip force.

Loads stay within wrinkling. A pose of the inflatable arm is a set of motor angles; of the arm of muscles, a set of muscle
lengths, given to simulators as the tensions of the equilibrium; the helical tube has no motors, so its five poses are five
tubes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from softrobots.core.checks import choice
from softrobots.core.errors import ParameterError
from softrobots.model.loader import load_model
from softrobots.model.muscles import MUSCLE_INPUTS
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube, InflatableArm, PccArm
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY

TOLERANCE = 1e-13
"""Relative residual of Pinocchio's equilibria, far below the compared differences."""

FORCES: Mapping[str, tuple[float, float, float]] = {
    "inflatable_arm": (0.0, 8.0, -6.0),
    "pcc_arm_lumped": (1.0, 1.5, -1.0),
    "helix_tube_lumped": (0.06, -0.04, 0.05),
}
"""Force on the tip of each robot, world axes [N]."""

ARM_POSES: Mapping[str, tuple[float, float, float]] = {
    "up": (0.4, 0.5 * math.pi, 0.0),
    "horizontal": (0.3, 0.0, 0.0),
    "bent": (0.3, 0.6, -0.8),
    "folded": (-1.0, 1.2, -2.0),
    "hanging": (1.2, -1.0, 0.5),
}
"""Motor angles of the inflatable arm [rad]."""

MUSCLE_POSES: Mapping[str, tuple[float, ...]] = {
    "straight": (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "bent": (-0.02, 0.01, 0.01, -0.01, 0.02, -0.01),
    "twice bent": (-0.03, 0.01, 0.02, 0.03, -0.01, -0.02),
    "stretched": (0.02, 0.03, 0.04, 0.02, 0.03, 0.01),
    "leaning": (0.0, 0.03, -0.03, 0.0, 0.02, -0.02),
}
"""Muscle lengths of the arm of muscles beyond their rest lengths [m]."""

TUBES: Mapping[str, Mapping[str, float | str]] = {
    "right-handed": {},
    "left-handed": {"handedness": "left"},
    "on its axis": {"upright": "axis"},
    "wide": {"contraction": 0.8},
    "steep": {"angle": math.radians(10.0)},
}
"""Differences from the default helical tube."""

WELDED = "welded"
"""Option of the exporters: motor joints are fixed."""


@dataclass(frozen=True, eq=False)
class EquilibriumCase:
    """A robot, its motors and its load, with Pinocchio's answer."""

    robot: str
    """Name of the robot and its URDF file."""
    pose: str
    """Name of the pose."""
    expected: Equilibrium
    """Pinocchio's equilibrium; its model has muscles as tensions."""

    @property
    def name(self) -> str:
        """Robot, pose and gravity in words."""
        return f"{self.robot}, {self.pose}, {'weightless' if self.gravity is None else 'gravity'}"

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.expected.model

    @property
    def force(self) -> tuple[float, float, float]:
        """Force on the tip, world axes [N]."""
        return FORCES[self.robot]

    @property
    def gravity(self) -> tuple[float, float, float] | None:
        """Gravity, world axes [m/s^2]; None: weightless."""
        return self.expected.load.gravity

    @property
    def joints(self) -> dict[str, float]:
        """Pinocchio's coordinate of each spring joint [rad or m]."""
        rows = self.model.pinocchio.joints
        places = {name: rows[self.model.pinocchio.getJointId(name)].idx_q for name in self.model.spring_table}
        return {name: float(self.expected.q[place]) for name, place in places.items()}

    def difference(self, joints: Mapping[str, float]) -> float:
        """Return the largest difference of joint coordinates from Pinocchio's [rad or m].

        Args:
            joints: Coordinate by name of every spring joint and of no other.

        Raises:
            ParameterError: If the joints are others.
        """
        ours = self.joints
        if ours.keys() != joints.keys():
            raise ParameterError("joints", sorted(joints), f"the spring joints of the robot, {', '.join(ours)}")
        return max((abs(joints[name] - ours[name]) for name in ours), default=0.0)


def equilibrium_cases(robots: Sequence[str] | None = None, poses: int | None = None) -> Iterator[EquilibriumCase]:
    """Yield the cases, each pose weightless and under gravity.

    Args:
        robots: Names of the robots; all by default.
        poses: How many poses of each robot; all five by default.

    Raises:
        ParameterError: If there is no such robot.
    """
    for robot in [choice("robots", robot, list(_MADE)) for robot in (_MADE if robots is None else robots)]:
        for pose in list(_POSES[robot])[:poses]:
            for gravity in (None, EARTH_GRAVITY):
                yield EquilibriumCase(robot, pose, _MADE[robot](pose, gravity))


Gravity = tuple[float, float, float] | None


def _arm(pose: str, gravity: Gravity) -> Equilibrium:
    return _solved("inflatable_arm", _model(InflatableArm()), np.array(ARM_POSES[pose]), gravity)


def _pcc_arm(pose: str, gravity: Gravity) -> Equilibrium:
    held, pulled = (_model(PccArm(chain="lumped"), muscles) for muscles in MUSCLE_INPUTS)
    lengths = held.relaxed_motors + np.array(MUSCLE_POSES[pose])
    tensions = _solved("pcc_arm_lumped", held, lengths, gravity).muscle_forces
    return _solved("pcc_arm_lumped", pulled, tensions, gravity)


def _tube(pose: str, gravity: Gravity) -> Equilibrium:
    tube = HelixTube(chain="lumped", **TUBES[pose])  # type: ignore[arg-type]  # fields of several types
    return _solved("helix_tube_lumped", _model(tube), np.zeros(0), gravity)


def _solved(robot: str, model: SoftModel, motors: np.ndarray, gravity: Gravity) -> Equilibrium:
    return solve_equilibrium(model, motors, FORCES[robot], gravity=gravity, tolerance=TOLERANCE)


@lru_cache(maxsize=16)
def _model(robot: InflatableArm | PccArm | HelixTube, muscles: str = "lengths") -> SoftModel:
    return load_model(robot, muscles=muscles)


_MADE: Mapping[str, Callable[[str, Gravity], Equilibrium]] = {
    "inflatable_arm": _arm,
    "pcc_arm_lumped": _pcc_arm,
    "helix_tube_lumped": _tube,
}
_POSES: Mapping[str, Mapping[str, object]] = {
    "inflatable_arm": ARM_POSES,
    "pcc_arm_lumped": MUSCLE_POSES,
    "helix_tube_lumped": TUBES,
}
