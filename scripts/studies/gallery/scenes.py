"""The scenes of the documentation: a viewer for each, of which scripts make pictures and pages."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from softrobots import inflated_beam
from softrobots.core.checks import FloatArray, read_only
from softrobots.description.composition import mount
from softrobots.description.third_party import UR5, robot_file
from softrobots.dynamics.motion import Motion
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube, InflatableArm, PccArm, Route, TendonArm
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.statics.trajectory import Trajectory, follow_trajectory
from softrobots.view.viewer import Viewer, view
from studies.contact import examples as contact
from studies.gallery.your_robot import measured_poses
from studies.motion.examples import gust, release
from studies.shared.held_motors import with_motors_held
from studies.ur5.bench import UR5Bench
from studies.ur5.bench_run import push_link


class Exhibit(NamedTuple):
    """A scene of the documentation."""

    make: Callable[[], Viewer]
    """Opens the viewer; close it, or use it in a `with` statement."""
    title: str
    """Title of its page."""
    share: float = 0.0
    """Share of its animation at which its picture is taken, from 0 to 1."""


def circle(steps: int = 120) -> FloatArray:
    """Targets on a slanted ellipse in front of the inflatable arm, the first one again at the end, shape (steps + 1, 3) [m]."""
    angle = 2.0 * np.pi * np.arange(steps + 1) / steps
    return np.column_stack([0.7 + 0.25 * np.cos(angle), 0.25 * np.sin(angle), 0.35 + 0.25 * np.sin(angle)])


def circling_arm(force: float, duration: float = 6.0) -> Viewer:
    """The inflatable arm moves a weight along `circle`, with its sag compensated.

    Args:
        force: Weight on the tip [N].
        duration: Time of a turn [s].

    Returns:
        The viewer.

    Raises:
        ViewerError: If its server does not start.
    """
    model, targets = load_model(InflatableArm()), circle()
    times = np.linspace(0.0, duration, len(targets))
    viewer = view(model, follow_trajectory(model, targets, (0.0, 0.0, -force), times=times, elbow="up", progress="path"))
    viewer.look_from((0.36, -0.98, 0.48), (0.15, 0.0, 0.2))
    return viewer


def pointing_wrist(duration: float = 6.0, steps: int = 90) -> Viewer:
    """The inflatable arm with a wrist under its weight and a force: the tip goes round, and the hand points at the middle.

    Poses of the tip on a circle whose middle is beyond it, so that the hand leans inwards; sag and tilt are compensated.

    Args:
        duration: Time of a turn [s].
        steps: Intervals between the waypoints.

    Returns:
        The viewer.

    Raises:
        ViewerError: If its server does not start.
    """
    middle = np.array([1.15, 0.0, 0.25])
    poses = np.tile(np.eye(4), (steps + 1, 1, 1))
    for pose, angle in zip(poses, 2.0 * np.pi * np.arange(steps + 1) / steps, strict=True):
        pose[:3, 3] = (0.85, 0.3 * np.cos(angle), 0.25 + 0.3 * np.sin(angle))
        forward = (middle - pose[:3, 3]) / np.linalg.norm(middle - pose[:3, 3])
        left = np.cross((0.0, 0.0, 1.0), forward)
        left /= np.linalg.norm(left)
        pose[:3, :3] = np.column_stack([forward, left, np.cross(forward, left)])
    model, times = load_model(InflatableArm(wrist=(0.08, 0.12))), np.linspace(0.0, duration, steps + 1)
    push = (0.0, 0.0, -5.0)
    path = follow_trajectory(model, poses, push, gravity=EARTH_GRAVITY, times=times, elbow="up", progress="poses")
    viewer = view(model, path)
    viewer.look_from((0.95, -0.75, 0.62), (0.55, 0.0, 0.22))
    return viewer


def _round(azimuths: Sequence[float], frames: int) -> FloatArray:
    """How much each actuator of a segment is on the side of a direction that goes around once, shape (frames + 1, n) [-]."""
    turns = 2.0 * np.pi * np.arange(frames + 1)[:, None] / frames
    return np.asarray(np.cos(np.array(azimuths) - turns))


def _led(model: SoftModel, motors: FloatArray, duration: float, force: Sequence[float] | None = None) -> Viewer:
    """Show a robot under its weight and a force on the tip [N] that is led through actuators, one row an equilibrium."""
    states: list[Equilibrium] = []
    for row in motors:
        start = states[-1].q_springs if states else None
        states.append(solve_equilibrium(model, row, force, gravity=EARTH_GRAVITY, q_springs0=start))
    tips = np.array([state.tip_position for state in states])
    times = np.linspace(0.0, duration, len(states))
    return view(model, Trajectory(read_only(times), read_only(tips), tuple(states), "newton"))


def moving_pcc_arm(duration: float = 6.0, frames: int = 90) -> Viewer:
    """The arm of pneumatic muscles under its weight and a force, led through muscle lengths that bend it all around.

    Args:
        duration: Time until the lengths are what they were at first [s].
        frames: How many equilibria, evenly spaced.

    Returns:
        The viewer.

    Raises:
        ViewerError: If its server does not start.
    """
    robot = PccArm()
    aside = _round(robot.muscle_azimuths, frames)
    # The azimuths of the second segment are in axes turned by its offset.
    motors = np.concatenate([0.515 - 0.02 * aside, 0.515 - 0.03 * aside], axis=1)
    viewer = _led(load_model(robot), motors, duration, force=(3.0, 2.0, -3.0))
    viewer.look_from((0.5, -1.0, 0.8), (0.05, 0.0, 0.42))
    return viewer


def bent_tendon_arm() -> Viewer:
    """The arm driven by tendons under its weight and a force: motors pulled or let go by millimetres, one tendon slack."""
    model = load_model(TendonArm())
    pulled = 1e-3 * np.array((-3, 1, 0, -6, 4, 0, -8, 4, 4))
    viewer = view(model, solve_equilibrium(model, model.relaxed_motors + pulled, (0.0, 0.0, -0.1), gravity=EARTH_GRAVITY))
    viewer.look_from((0.09, -0.155, 0.11), (0.035, 0.0, 0.09))
    return viewer


def moving_tendon_arm(duration: float = 6.0, frames: int = 90) -> Viewer:
    """The same arm under its weight, led around: its tendons are pulled and let go in turn, and some are slack at times.

    Args:
        duration: Time until the motors are where they were at first [s].
        frames: How many equilibria, evenly spaced.

    Returns:
        The viewer.

    Raises:
        ViewerError: If its server does not start.
    """
    robot = TendonArm(elastic_sections=2)  # a smaller page
    model, aside = load_model(robot), _round(robot.tendon_azimuths, frames)
    pulled = np.concatenate([way * aside for way in (0.002, 0.004, 0.009)], axis=1)
    viewer = _led(model, model.relaxed_motors - pulled, duration)
    viewer.look_from((0.10, -0.21, 0.17), (0.0, 0.0, 0.075))
    return viewer


def helical_tendons() -> Viewer:
    """An arm of one segment with three tendons that wind around it by three quarters of a turn, one pulled hard."""
    azimuths = 2.0 * np.pi * np.arange(3) / 3.0
    routes = [Route(at=(0.0, 0.2), azimuth=(a, a + 1.5 * np.pi), distance=0.0045) for a in azimuths.tolist()]
    model = load_model(TendonArm(segment_lengths=(0.2,), elastic_sections=12, routing=routes, kind="tension"))
    viewer = view(model, solve_equilibrium(model, (8.0, 2.0, 0.5)))
    viewer.look_from((0.155, -0.07, 0.14), (0.0, 0.04, 0.102))
    return viewer


def sagging_helix_tube() -> Viewer:
    """A helical tube of three and a half turns that hangs out sideways under its own weight, near wrinkling at its base."""
    model = load_model(HelixTube(length=2.0, elastic_sections=32, pressure=6e3))
    return view(model, solve_equilibrium(model, (), gravity=EARTH_GRAVITY))


def growing_helix_tube() -> Viewer:
    """The same tube with the axis of the helix upright, as it grows."""
    tube = HelixTube(length=2.0, elastic_sections=32, upright="axis")
    viewer = view(load_model(tube))
    viewer.animate_growth(tube)
    return viewer


def actuated_helix_tube() -> Viewer:
    """A tube that is straight at rest, under 10 kPa, which its actuator bends into a helix."""
    tube = HelixTube(actuator="elastic", length=0.75, elastic_sections=12, bending_stiffness=1e-3)
    model = load_model(tube)
    viewer = view(model, solve_equilibrium(model, tube.q_motors))
    viewer.look_from((0.7, -0.02, 0.53), (0.05, 0.08, 0.34))
    return viewer


def characterisation_bench() -> Viewer:
    """A UR5 pushes an inflated link through wrinkling (needs example-robot-data)."""
    row = inflated_beam.TABLE_3[2]
    link = InflatableArm(link_lengths=(0.6,), stiffness=row.stiffness, pressure=row.pressure, max_moment=row.max_moment)
    bench = UR5Bench(link=link)
    viewer = view(bench.model, push_link(bench, np.linspace(0.0, bench.push_end(), 41), progress=True).trajectory())
    viewer.look_from(*bench.camera)
    return viewer


def ur5_with_soft_arm() -> Viewer:
    """A UR5 carries the inflatable arm with 1 kg at its tip (needs example-robot-data)."""
    arm = with_motors_held(InflatableArm().urdf(), {"motor_1": 0.0, "motor_2": math.pi / 2, "motor_3": 0.0})
    model = load_model(mount(robot_file(UR5), "tool0", arm, xyz=(0.0, 0.0, 0.165)))
    pose, payload = (0.0, -2.1, 1.9, 0.2, math.pi / 2, 0.0), (0.0, 0.0, -9.81)
    return view(model, solve_equilibrium(model, pose, payload, gravity=EARTH_GRAVITY))


def leaning_arm() -> Viewer:
    """The arm of docs/contact.md: the weight on its tip grows to 41 N, and it leans on a wall."""
    viewer = view(load_model(InflatableArm()), contact.brace(np.linspace(0.0, 41.0, 25)))
    viewer.look_from((0.75, -1.45, 0.85), (0.52, 0.0, 0.38))
    return viewer


def gripping_helix() -> Viewer:
    """The helix of docs/contact.md, into which a rod is pushed."""
    path = contact.grip(np.linspace(0.0, contact.DEPTH, 49))
    viewer = Viewer(path.model)
    viewer.animate(path, duration=1.6)  # a smaller page
    viewer.look_from((0.27, -0.33, 0.33), (0.0, 0.0, 0.2))
    return viewer


def rod_between_pegs() -> Viewer:
    """The rod of docs/contact.md, against which pegs move from both sides."""
    path = contact.snake(np.linspace(0.0, contact.STROKE, 41))
    viewer = Viewer(path.model)
    viewer.animate(path, duration=2.0)
    viewer.look_from((0.13, -0.32, 0.27), (0.0, 0.0, 0.2))
    return viewer


def in_slow_motion(motion: Motion, speed: float) -> Viewer:
    """A motion, played at a speed relative to real time."""
    viewer = Viewer(motion.model)
    viewer.animate(motion, speed=speed)
    return viewer


EXHIBITS = {
    "inflatable_arm": Exhibit(lambda: circling_arm(18.0), "Inflatable arm, 18 N on the tip, sag compensated", 0.04),
    "wrinkling_arm": Exhibit(
        lambda: circling_arm(24.0), "Inflatable arm, 24 N on the tip: stretched out, link 1 wrinkles", 0.04
    ),
    "wrist": Exhibit(
        pointing_wrist, "Inflatable arm with a wrist: poses of the hand under weight and 5 N, tilt compensated", 0.3
    ),
    "pcc_arm": Exhibit(moving_pcc_arm, "PCC arm led through muscle lengths, own weight and 4.7 N on the tip", 0.8),
    "tendon_arm": Exhibit(bent_tendon_arm, "Arm driven by tendons, own weight and 0.1 N on the tip"),
    "moving_tendon_arm": Exhibit(moving_tendon_arm, "Arm driven by tendons, led around under its weight"),
    "helical_tendons": Exhibit(helical_tendons, "Tendons that wind around an arm"),
    "helix_tube": Exhibit(sagging_helix_tube, "Helical tube under its own weight"),
    "helix_growth": Exhibit(growing_helix_tube, "Growth of the helical tube", 0.45),
    "helix_actuator": Exhibit(actuated_helix_tube, "A tube under 10 kPa, bent by its actuator"),
    "ur5_bench": Exhibit(characterisation_bench, "UR5 pushes an inflated link at 30 kPa", 0.8),
    "released_arm": Exhibit(lambda: in_slow_motion(release(), 0.5), "The sagging arm is let go, at half speed", 0.06),
    "helix_in_a_gust": Exhibit(lambda: in_slow_motion(gust(), 0.5), "A helical tube in a gust, at half speed", 0.1),
    "your_robot": Exhibit(measured_poses, "A fitted arm in its measured poses (synthetic)", 25.5 / 60),
    "contact_arm": Exhibit(leaning_arm, "The inflatable arm leans on a wall and carries twice the load", 1.0),
    "contact_helix": Exhibit(gripping_helix, "A helix grips the rod that is pushed into it", 1.0),
    "contact_pegs": Exhibit(rod_between_pegs, "A rod snakes between pegs", 1.0),
    "ur5_with_soft_arm": Exhibit(ur5_with_soft_arm, "UR5 with a soft arm, 1 kg at its tip"),
}
"""The scenes by name."""
