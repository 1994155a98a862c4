"""The characterisation bench of [Troise 2021] section 3 in simulation: a UR5 pushes a clamped inflated link with a probe.

One model holds both robots; `studies.ur5.bench_run` pushes. The inverse kinematics of the UR5 follows the wanted displacement;
the displacement that it really imposes is that of its forward kinematics, and the force on the probe follows from the statics
of the link. Needs example-robot-data (extra `robots`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray, finite_array, finite_number, positive_number
from softrobots.core.errors import ParameterError
from softrobots.description.composition import mount
from softrobots.description.expansion import expand
from softrobots.description.third_party import UR5, robot_file
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm

UR5_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
"""Joints of the UR5, base to tool."""

PROBE = "probe_tip"
"""Frame of the bench's model: the centre of the probe's ball."""

TOUCH = "mark_touch"
"""Frame of the bench's model: on the link, where the centre of the ball is when it first touches."""

_STAND_MASS = 5.0  # [kg]
_MARK = (0.004, 1.004)  # width [m], radius over that of the link
_MARK_MASS = 1e-3  # [kg]


@dataclass(frozen=True, kw_only=True)
class UR5Bench:
    """A UR5 with a probe on its flange, and an inflated link clamped beside it.

    The UR5 stands at the origin of the world. The link lies along the world's y and the probe pushes along x, horizontally:
    without gravity, as the paper's model. The motors of the link are locked.

    Raises:
        ParameterError: If the link is not one link, is bent at rest, or a number is out of range.
    """

    link: InflatableArm
    """The link: an arm with one link."""
    probe_distance: float = 0.5
    """Distance `h` of the probe's line from the clamp [m]. Troise 2021, section 4."""
    probe_length: float = 0.12
    """Distance of the ball's centre from the flange [m]. Chosen."""
    ball_radius: float = 0.01
    """Radius of the ball at the end of the probe [m]. Chosen."""
    touch_position: tuple[float, float, float] = (0.5, 0.15, 0.35)
    """Where the ball's centre is when it first touches the link, world axes [m]. Chosen."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        if not isinstance(self.link, InflatableArm) or self.link.n_links != 1:
            raise ParameterError("link", self.link, "an InflatableArm with one link")
        if any(np.ravel(self.link.rest_side)) or any(np.ravel(self.link.rest_up)):
            raise ParameterError("link", self.link, "straight at rest: the probe pushes orthogonally to the axis of the link")
        for name in ("probe_length", "ball_radius"):
            positive_number(name, getattr(self, name), "m")
        if positive_number("probe_distance", self.probe_distance, "m") >= self.length:
            raise ParameterError("probe_distance", self.probe_distance, f"below the length of the link, {self.length} m")
        x, y, z = finite_array("touch_position", self.touch_position, (3,), "m").tolist()
        object.__setattr__(self, "touch_position", (x, y, z))
        if z <= 3.0 * self.radius:
            raise ParameterError("touch_position", self.touch_position, f"above {3.0 * self.radius} m, where the stand ends")
        _ = self.test

    @property
    def length(self) -> float:
        """Length of the link [m]."""
        return float(self.link.link_lengths[0])

    @property
    def radius(self) -> float:
        """Radius of the link [m]."""
        return float(np.ravel(self.link.radius)[0])

    @property
    def hinge_offset(self) -> float:
        """Distance of the hinge from the clamp [m]."""
        return float(np.ravel(self.link.hinge_offset)[0])

    @property
    def pressure(self) -> float:
        """Gauge pressure in the link [Pa]."""
        return float(np.ravel(self.link.pressure)[0])

    @cached_property
    def test(self) -> inflated_beam.BendingTest:
        """The geometry of the test, for its evaluation."""
        return inflated_beam.BendingTest(
            probe_distance=self.probe_distance, hinge_offset=self.hinge_offset, offset=self.radius + self.ball_radius
        )

    @property
    def largest_angle(self) -> float:
        """Hinge angle at which the ball comes to the end of the link [rad]."""
        inside, outside = 0.0, 0.5 * np.pi - 1e-9
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            on_link = float(self.test.contact(middle)) < self.length - self.hinge_offset
            inside, outside = (middle, outside) if on_link else (inside, middle)
        return inside

    def push_end(self, beyond: float = 1.6) -> float:
        """Displacement at which a push ends: beyond the knee of the link.

        Args:
            beyond: Hinge angle at the end over that of the knee, `M_max / k`, above 1. A link without a largest moment is
                pushed to 95 % of its wrinkling moment instead: its springs say nothing of what comes after.

        Returns:
            The displacement [m].

        Raises:
            ParameterError: If `beyond` is not above 1, or so large that the ball leaves the end of the link.
        """
        if not finite_number("beyond", beyond) > 1.0:
            raise ParameterError("beyond", beyond, "above 1")
        stiffness = self.link.spring_stiffness[0]
        if self.link.max_moment is None:
            angle = 0.95 * inflated_beam.wrinkling_moment(self.pressure, self.radius) / stiffness
        else:
            angle = beyond * float(np.ravel(self.link.max_moment)[0]) / stiffness
        if angle >= self.largest_angle:
            knee = self.largest_angle * beyond / angle
            raise ParameterError("beyond", beyond, f"below {knee:.4g}, where the ball leaves the end of the link")
        return float(self.test.displacement(angle))

    @property
    def camera(self) -> tuple[FloatArray, FloatArray]:
        """Where a picture is taken from, and what it looks at, for `Viewer.look_from`, each shape (3,) [m]."""
        centre = np.array(self.touch_position) * (0.8, 0.0, 0.8)
        return centre + np.array([0.30, -0.62, 0.72]), centre

    def urdf(self) -> str:
        """The whole bench as URDF text.

        Raises:
            MissingDependency: If example-robot-data is not installed.
        """
        x, y, z = self.touch_position
        beside = self.test.offset
        clamp = (x + beside, y - self.probe_distance, z)
        probe = _part("probe", length=self.probe_length, radius=self.ball_radius)
        stand = _part("stand", length=z - 3.0 * self.radius, radius=1.3 * self.radius, mass=_STAND_MASS)
        mark = _part("mark", length=_MARK[0], radius=_MARK[1] * self.radius, offset=beside, mass=_MARK_MASS)
        whole = mount(robot_file(UR5), "tool0", probe, prefix="probe_")
        whole = mount(whole, "world", stand, prefix="stand_", xyz=(clamp[0], clamp[1], 0.0))
        whole = mount(whole, "world", self.link, prefix="soft_", xyz=clamp, rpy=(0.0, 0.0, 0.5 * np.pi))
        on_link = (self.test.arm, beside, 0.0)
        return mount(whole, "soft_link_1", mark, prefix="mark_", xyz=on_link, name="ur5_bench")

    @cached_property
    def model(self) -> SoftModel:
        """Both robots as one model; its motors are the UR5's joints, its tip is the probe.

        Raises:
            MissingDependency: If example-robot-data is not installed.
        """
        return load_model(self.urdf(), motors=UR5_JOINTS, tip=PROBE)


def _part(part: str, **numbers: float) -> str:
    """URDF text of a part of the bench."""
    file = Path(__file__).with_name("bench_part.urdf.xacro")
    return expand(file, {"part": part, **{name: repr(n) for name, n in numbers.items()}})
