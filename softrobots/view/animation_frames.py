"""Frames of an animation: waypoints of a path, evenly spaced interpolated states, a motion, a mode, a growing tube."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, positive_number
from softrobots.core.errors import ParameterError
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.vibration import ModeSwing
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube
from softrobots.robots.growth import SHORTEST, grown_coordinates
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load
from softrobots.statics.trajectory import Trajectory

Path = Trajectory | ContactPath
"""Equilibria in an order, as many as there are positions of the tip, `tip_positions`."""

Movement = Path | Motion | ModeSwing
"""What can be animated."""

FRAME_RATE = 30
"""Frames a second."""

_MOST_BODIES = 90  # shapes of a continuous body in one animation
_MOST_RIGID = 600  # frames of a motion of rigid links
_MOST_BENDING = 50  # frames of a motion whose body bends; a page has about a megabyte at most
_SWING_TIME = 2.0  # [s], of a mode: most are too fast to be seen
_CONTACT_TIME = 6.0  # [s], of a path in contact, whose parameter is no time
_FRONT = 3.0  # length of a growing tube behind its tip over which the helix forms, over its diameter
_HELD = 0.25  # share of the time at the end during which the whole tube is shown
_MOST_FRAMES = 2**31 - 1  # a browser's largest frame number


class Frame(NamedTuple):
    """The state of a robot in one frame."""

    number: int
    """Number of the frame, from 0."""
    q_motors: FloatArray
    """Actuator coordinates."""
    q_springs: FloatArray
    """Elastic coordinates."""
    equilibrium: Equilibrium | None
    """The nearest waypoint; None without load, and of a motion."""
    grown: float | None = None
    """Share of a growing tube that has everted; None if the robot does not grow."""
    load: Load | None = None
    """Gravity and the force on the tip in a motion; None otherwise."""
    tensions: FloatArray = np.zeros(0)
    """Tension of each muscle in a motion, shape (n_muscles,) [N]."""


def playing_time(model: SoftModel, movement: Movement, duration: float | None, speed: float | None) -> float:
    """Return how long an animation of a model lasts [s]; the other arguments are those of `Viewer.animate`.

    Raises:
        ParameterError: If there is nothing to play, it is of another robot, duration or speed is not positive, or both are
            given.
    """
    if not isinstance(movement, Movement):
        raise ParameterError("movement", movement, "a Trajectory, a ContactPath, a Motion or the swing of a mode")
    models = [one.model for one in movement.equilibria] if isinstance(movement, ContactPath) else [movement.model]
    if any(one != model for one in models):
        raise ParameterError("movement", movement.model, f"a movement of the model given, {model!r}")
    if duration is not None and speed is not None:
        raise ParameterError("speed", speed, "left out where a duration is given")
    if duration is not None:
        return positive_number("duration", duration, "s")
    if isinstance(movement, ModeSwing):
        return _SWING_TIME if speed is None else movement.period / positive_number("speed", speed)
    if isinstance(movement, ContactPath):
        if speed is not None:
            raise ParameterError("speed", speed, "left out for a path in contact, whose parameter is no time; give a duration")
        return _CONTACT_TIME
    times = movement.time if isinstance(movement, Motion) else movement.times
    return (float(times[-1] - times[0]) or 1.0) / (1.0 if speed is None else positive_number("speed", speed))


def waypoint_frames(path: Path, seconds: float) -> list[Frame]:
    """Return the waypoints, each at the frame nearest to its time."""
    times = _times(path)
    span = float(times[-1] - times[0])
    share = (times - times[0]) / (span or 1.0)
    numbers = np.rint(share * seconds * FRAME_RATE).astype(int).tolist()
    last = dict(zip(numbers, path.equilibria, strict=True))
    return [Frame(number, e.q_motors, e.q_springs, e) for number, e in last.items()]


def even_frames(path: Path, seconds: float) -> list[Frame]:
    """Return evenly spaced frames, interpolated linearly between waypoints; few, since a bent body is drawn anew for each."""
    numbers, total = _spread(seconds)
    rows, states = _times(path), path.equilibria
    times = rows[0] + (rows[-1] - rows[0]) * numbers / total
    frames = []
    for number, moment in zip(numbers.tolist(), times, strict=True):
        after = int(np.clip(np.searchsorted(rows, moment), 1, max(len(rows) - 1, 1)))
        before, after = after - 1, min(after, len(rows) - 1)
        interval = float(rows[after] - rows[before])
        share = float(moment - rows[before]) / interval if interval > 0.0 else 0.0
        motors = (1.0 - share) * states[before].q_motors + share * states[after].q_motors
        springs = (1.0 - share) * states[before].q_springs + share * states[after].q_springs
        frames.append(Frame(number, motors, springs, states[after if share > 0.5 else before]))
    return frames


def motion_frames(motion: Motion, seconds: float) -> list[Frame]:
    """Return evenly spaced frames of a motion, interpolated by cubics with its positions and velocities.

    There are as many as the frame rate asks for, but at most 600, or 50 of a body that bends.
    """
    from scipy.interpolate import CubicHermiteSpline

    model, rows = motion.model, motion.time
    numbers, total = _spread(seconds, _MOST_BENDING if model.structure.section_table else _MOST_RIGID)
    times = rows[0] + (rows[-1] - rows[0]) * numbers / total
    paths = ((motion.q_motors, motion.motor_velocities), (motion.q_springs, motion.velocities))
    motors, springs = (CubicHermiteSpline(rows, *path)(times) if len(rows) > 1 else path[0] for path in paths)
    tensions = motion.motor_torques[:, model.n_motors - len(model.muscles) :]
    forces, tensions = (
        np.array([np.interp(times, rows, column) for column in columns.T]).reshape(-1, len(times)).T
        for columns in (motion.forces, tensions)
    )
    frames = []
    for row, number in enumerate(numbers.tolist() if len(rows) > 1 else [0]):
        load = Load({model.tip: np.append(forces[row], np.zeros(3))}, motion.gravity)
        frames.append(Frame(number, motors[row], springs[row], None, load=load, tensions=tensions[row]))
    return frames


def swing_frames(swing: ModeSwing, seconds: float) -> list[Frame]:
    """Return evenly spaced frames of one swing in a mode, coloured as its equilibrium."""
    numbers, total = _spread(seconds, _MOST_BENDING)
    return [Frame(number, *swing.at(number / total), swing.modes.equilibrium) for number in numbers.tolist()]


def growth_frames(tube: HelixTube, seconds: float) -> list[Frame]:
    """Return frames of a tube that grows at constant speed and is then held; see `robots.growth.grown_coordinates`.

    While the tube is held the rest of the helix forms, at the speed of growth, or faster so that it ends in the last frame.

    Raises:
        ParameterError: If the duration is not positive.
    """
    front = _FRONT * tube.diameter
    numbers, total = _spread(positive_number("duration", seconds, "s"))
    shares = np.clip(numbers / total / (1.0 - _HELD), 0.0, 1.0)
    # While the tube is held, its last stretch forms in the time that the tip took for it, or in the time that is left.
    speed = max(tube.length / (1.0 - _HELD), front / _HELD)
    formed = np.clip((numbers / total - (1.0 - _HELD)) * speed, 0.0, front)
    formed[-1] = front
    motors: FloatArray = np.zeros(0)
    return [
        Frame(number, motors, grown_coordinates(tube, max(share, SHORTEST) * tube.length, front - done).ravel(), None, share)
        for number, share, done in zip(numbers.tolist(), shares.tolist(), formed.tolist(), strict=True)
    ]


def _times(path: Path) -> FloatArray:
    """When each waypoint is shown: at its time; those of a path in contact at their parameters if these grow, else evenly."""
    if isinstance(path, Trajectory):
        return path.times
    return path.parameters if np.all(np.diff(path.parameters) > 0.0) else np.arange(len(path.equilibria), dtype=float)


def _spread(seconds: float, most: int = _MOST_BODIES) -> tuple[FloatArray, int]:
    """Evenly spaced frame numbers over a duration [s], at most so many, and the last number."""
    total = max(round(min(seconds * FRAME_RATE, _MOST_FRAMES)), 1)
    return np.unique(np.rint(np.linspace(0, total, min(most, total + 1))).astype(int)), total
