"""What the frames of an animation show: waypoints of a trajectory, evenly spaced poses, a growing tube."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_number, non_negative_number, positive_number
from softrobots.core.errors import ParameterError
from softrobots.robots import HelixTube
from softrobots.robots.growth import SHORTEST, grown_coordinates
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.trajectory import Trajectory

FRAME_RATE = 30
"""Frames a second."""

_MOST_BODIES = 90  # shapes of a continuous body that an animation goes through
_MOST_FRAMES = 2**31 - 1  # of any animation; numbers of frames are integers of a browser


class Frame(NamedTuple):
    """What a frame of an animation shows."""

    number: int
    """Number of the frame, from 0."""
    q_motors: FloatArray
    """Actuator coordinates."""
    q_springs: FloatArray
    """Elastic coordinates."""
    equilibrium: Equilibrium | None
    """The nearest waypoint; None without load."""
    grown: float = 1.0
    """Share of the tube that has come out."""


def waypoint_frames(trajectory: Trajectory, seconds: float) -> list[Frame]:
    """The waypoints, each at the frame nearest to its time."""
    span = float(trajectory.times[-1] - trajectory.times[0])
    share = (trajectory.times - trajectory.times[0]) / (span or 1.0)
    numbers = np.rint(share * seconds * FRAME_RATE).astype(int).tolist()
    last = dict(zip(numbers, trajectory.equilibria, strict=True))
    return [Frame(number, e.q_motors, e.q_springs, e) for number, e in last.items()]


def even_frames(trajectory: Trajectory, seconds: float) -> list[Frame]:
    """Frames evenly over the time, between waypoints by linear interpolation: a bent body is drawn anew for each."""
    numbers, total = _spread(seconds)
    times = trajectory.times[0] + (trajectory.times[-1] - trajectory.times[0]) * numbers / total
    made = []
    for number, moment in zip(numbers.tolist(), times, strict=True):
        after = int(np.clip(np.searchsorted(trajectory.times, moment), 1, max(len(trajectory.times) - 1, 1)))
        before, after = after - 1, min(after, len(trajectory.times) - 1)
        interval = float(trajectory.times[after] - trajectory.times[before])
        share = float(moment - trajectory.times[before]) / interval if interval > 0.0 else 0.0
        motors, springs = (
            (1.0 - share) * rows[before] + share * rows[after] for rows in (trajectory.q_motors, trajectory.q_springs)
        )
        made.append(Frame(number, motors, springs, trajectory.equilibria[after if share > 0.5 else before]))
    return made


def growth_frames(tube: HelixTube, seconds: float, front: float, hold: float) -> list[Frame]:
    """A tube that grows at constant speed, then the whole tube; see `softrobots.robots.growth.grown_coordinates`.

    Args:
        tube: The tube.
        seconds: Time of the animation [s].
        front: Length behind the tip over which the helix forms [m]; while the whole tube is shown it forms to the end, as
            fast as the tube grew, or faster to be done in the last frame.
        hold: Share of the time, at the end, for the whole tube, in [0, 1).

    Returns:
        The frames.

    Raises:
        ParameterError: If an argument is out of range.
    """
    if not 0.0 <= finite_number("hold", hold) < 1.0:
        raise ParameterError("hold", hold, "in [0, 1)")
    front = non_negative_number("front", front, "m")
    numbers, total = _spread(positive_number("duration", seconds, "s"))
    shares = np.clip(numbers / total / (1.0 - hold), 0.0, 1.0)
    # When the tube is whole, the last stretch is formed too, over as much time as the tip took along it, or as there is.
    speed = max(tube.length / (1.0 - hold), front / hold if hold > 0.0 else 0.0)
    formed = np.clip((numbers / total - (1.0 - hold)) * speed, 0.0, front)
    formed[-1] = front if hold > 0.0 else 0.0
    motors: FloatArray = np.zeros(0)
    return [
        Frame(number, motors, grown_coordinates(tube, max(share, SHORTEST) * tube.length, front - done).ravel(), None, share)
        for number, share, done in zip(numbers.tolist(), shares.tolist(), formed.tolist(), strict=True)
    ]


def _spread(seconds: float) -> tuple[FloatArray, int]:
    """Numbers of frames evenly over a time, and that of the last one."""
    total = max(round(min(seconds * FRAME_RATE, _MOST_FRAMES)), 1)
    return np.unique(np.rint(np.linspace(0, total, min(_MOST_BODIES, total + 1))).astype(int)), total
