"""The characterisation bench of [Troise 2021] section 3 in simulation: a UR5 pushes a clamped inflated link with a probe.

One model holds both robots. The inverse kinematics of the UR5 follows the wanted displacement; the displacement that it really
imposes is that of its forward kinematics, and the force on the probe follows from the statics of the link. Needs
example-robot-data (extra `robots`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from softrobots import inflated_beam
from softrobots.checks import FloatArray, finite_array, finite_number, non_negative_number, positive_number, read_only
from softrobots.composition import mount
from softrobots.description import expand
from softrobots.errors import ParameterError
from softrobots.imposed_displacement import ImposedDisplacement, solve_imposed_displacement
from softrobots.inverse_kinematics import solve_ik
from softrobots.kinematics import frame_jacobian, frame_placement
from softrobots.loader import load_model
from softrobots.model import SoftModel
from softrobots.paths import xacro_folder
from softrobots.progress import with_progress
from softrobots.robots import InflatableArm
from softrobots.third_party import UR5, robot_file
from softrobots.trajectory import Trajectory

UR5_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
"""Its joints, base to tool."""

PROBE = "probe_tip"
"""Frame of the bench's model: the centre of the probe's ball."""

TOUCH = "mark_touch"
"""Frame of the bench's model: on the link, where the centre of the ball is when it first touches."""

_PUSH = read_only(np.array([1.0, 0.0, 0.0]))  # the probe moves along the world's x, the link lies along y
_TOOL = read_only(np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]))  # tool axes: z along x
_ELBOW_UP = (0.1, -1.7, 1.9, -0.2, 1.7, 1.6)  # [rad], about where the UR5 starts
_STAND_MASS = 5.0  # [kg]
_MARK = (0.004, 1.004)  # width [m], radius over that of the link
_MARK_MASS = 1e-3  # [kg]


class Measurement(NamedTuple):
    """What the instruments of a push read, evaluated by `inflated_beam.BendingTest`."""

    force: FloatArray
    """Force on the load cell, shape (n,) [N]."""
    angle: FloatArray
    """Hinge angle, shape (n,) [rad]."""
    moment: FloatArray
    """Moment at the hinge, shape (n,) [N m]."""


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
        stiffness = float(np.ravel(self.link.stiffness)[0])
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

    def push(self, displacements: Any, *, progress: bool | str = False) -> BenchRun:
        """Push the link step by step.

        Args:
            displacements: Wanted displacements of the probe from where it first touches, shape (n,) [m], zero or positive.
            progress: Show a progress bar on stderr; a text is its label.

        Returns:
            The run.

        Raises:
            ParameterError: If there are none, one is negative or not finite, or the ball would leave the end of the link.
            TargetUnreachable: If the UR5 does not reach a step.
            EquilibriumNotFound: If the link finds no equilibrium at a step.
            MissingDependency: If example-robot-data is not installed.
        """
        wanted = finite_array("displacements", displacements, (None,), "m")
        most = float(self.test.displacement(self.largest_angle))
        if len(wanted) == 0 or wanted.min() < 0.0 or wanted.max() >= most:
            raise ParameterError(
                "displacements", displacements, f"at least one, from 0 to below {most:.6g} m, where the ball leaves the link"
            )
        model, start = self.model, np.array(self.touch_position)
        motors: Any = _ELBOW_UP
        first = solve_ik(model, start, orientation=_TOOL, q_motors0=motors)
        motors, held = first.q_motors, None
        steps = []
        for way in with_progress(wanted.tolist(), progress, label="push", unit="step"):
            found = solve_ik(model, start + way * _PUSH, orientation=_TOOL, q_motors0=motors, starts=1)
            motors = found.q_motors
            probe = np.array(frame_placement(model, found.equilibrium.q, PROBE).translation)
            held = solve_imposed_displacement(
                model, motors, float(_PUSH @ (probe - start)), direction=_PUSH, frame=TOUCH, along=(1.0, 0.0, 0.0), start=held
            )
            steps.append((held, found.error, found.orientation_error))
        states, errors, turns = zip(*steps, strict=True)
        return BenchRun(self, states, read_only(np.array(errors)), read_only(np.array(turns)))


@dataclass(frozen=True, eq=False)
class BenchRun:
    """A push of the link by the UR5."""

    bench: UR5Bench
    """The bench."""
    states: tuple[ImposedDisplacement, ...]
    """The link, and the UR5 that holds it, at every step."""
    ik_error: FloatArray
    """Distance of the probe from where it was meant to be, shape (n,) [m]."""
    ik_orientation_error: FloatArray
    """Angle between the probe and its orientation at the start, shape (n,) [rad]."""

    @cached_property
    def displacement(self) -> FloatArray:
        """Displacement that the UR5 really imposes, by its forward kinematics, shape (n,) [m]."""
        return read_only(np.array([state.displacement for state in self.states]))

    @cached_property
    def force(self) -> FloatArray:
        """Force on the link along the probe's line, shape (n,) [N]: what an ideal load cell reads."""
        return read_only(np.array([state.reaction for state in self.states]))

    @cached_property
    def q_ur5(self) -> FloatArray:
        """Joint angles of the UR5, shape (n, 6) [rad]."""
        return read_only(np.array([state.equilibrium.q_motors for state in self.states]))

    @cached_property
    def ur5_torques(self) -> FloatArray:
        """Load on the joints of the UR5 by the reaction of the link alone, minus what its motors exert, shape (n, 6) [N m]."""
        model = self.bench.model
        loads = [
            -(state.force @ frame_jacobian(model, state.q, PROBE)[:3])[model.motor_indices] for state in self.states
        ]  # fmt: skip
        return read_only(np.array(loads))

    @cached_property
    def ur5_effort(self) -> FloatArray:
        """Largest torques of the UR5's motors, shape (6,) [N m]."""
        return read_only(np.array(self.bench.model.pinocchio.upperEffortLimit)[self.bench.model.motor_indices])

    @property
    def stable(self) -> bool:
        """Whether every step is certified stable under the imposed displacement."""
        return all(state.stable for state in self.states)

    def measure(self, *, force_std: float = 0.0, angle_std: float = 0.0, seed: int = 0) -> Measurement:
        """What the instruments read: force and angle with normal noise, and the moment of that force.

        Args:
            force_std: Standard deviation of the force [N].
            angle_std: Standard deviation of the angle [rad].
            seed: Seed of the noise.

        Returns:
            Force, angle and moment.

        Raises:
            ParameterError: If a standard deviation is negative or not finite, or the seed is no whole number from 0.
        """
        deviations = (non_negative_number("force_std", force_std, "N"), non_negative_number("angle_std", angle_std, "rad"))
        if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
            raise ParameterError("seed", seed, "a whole number from 0")
        random = np.random.default_rng(seed)
        noise = [deviation * random.normal(size=len(self.states)) for deviation in deviations]
        test, force = self.bench.test, self.force + noise[0]
        return Measurement(force, test.angle(self.displacement) + noise[1], test.moment(self.displacement, force))

    def trajectory(self, duration: float = 4.0) -> Trajectory:
        """The push as a trajectory of the probe, for the viewer and for files; steps without a force are left out.

        Args:
            duration: Time of the whole push [s].

        Raises:
            ParameterError: If the duration is not positive, or no step has a force.
        """
        seconds = positive_number("duration", duration, "s")
        pushed = [number for number, state in enumerate(self.states) if state.reaction > 1e-9]
        if not pushed:
            raise ParameterError("run", self.displacement, "one with a step at which the probe pushes")
        way = np.outer(self.displacement[pushed], _PUSH)
        return Trajectory(
            read_only(seconds * np.arange(1, len(pushed) + 1) / len(pushed)),
            read_only(np.array(self.bench.touch_position) + way),
            tuple(self.states[number].equilibrium for number in pushed),
            "bench",
        )


def _part(part: str, **numbers: float) -> str:
    """URDF text of a part of the bench."""
    return expand(xacro_folder() / "bench_part.urdf.xacro", {"part": part, **{name: repr(n) for name, n in numbers.items()}})
