"""Trajectory generation: straight lines with a quintic time law, and waypoints from a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, finite_array, increasing, positive_integer, positive_number, read_only
from softrobots.core.csv_table import read_table
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import as_path
from softrobots.core.summary import Summarised
from softrobots.statics.tip_goal import Goal

_ANGLES = ("roll", "pitch", "yaw")
_INTERVAL = 0.05  # [s], between waypoints without times
_MOST_STEPS = 1_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Path3D(Summarised):
    """Target positions over time."""

    times: FloatArray
    """Time of each waypoint, increasing, shape (n,) [s]."""
    positions: FloatArray
    """Target positions, shape (n, 3) [m], world axes."""
    orientations: FloatArray | None = None
    """Target orientations, shape (n, 3, 3); None: any."""

    @property
    def targets(self) -> FloatArray:
        """Positions, shape (n, 3), or with orientations poses, shape (n, 4, 4), for `follow_trajectory` [m]."""
        if self.orientations is None:
            return self.positions
        poses = np.tile(np.eye(4), (len(self.positions), 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = self.orientations, self.positions
        return read_only(poses)


def quintic(share: Any) -> FloatArray:
    """Share of the way covered after a share of the time: `10 s^3 - 15 s^4 + 6 s^5`.

    Starts and ends at rest, without acceleration: first and second derivative vanish at both ends.

    Args:
        share: Share of the time, any shape, within [0, 1].

    Returns:
        Share of the way, same shape.

    Raises:
        ParameterError: If a share is outside [0, 1].
    """
    s = finite_array("share", share, None)
    if np.any((s < 0.0) | (s > 1.0)):
        raise ParameterError("share", share, "within [0, 1]")
    return np.asarray(s**3 * (10.0 - 15.0 * s + 6.0 * s**2))


def straight_line(start: Any, end: Any, duration: float, steps: int = 200) -> Path3D:
    """Point-to-point motion on a straight line with the quintic time law.

    Between two poses the tip also turns, about one axis, by the same law.

    Args:
        start: First position, shape (3,) [m], or pose, `pinocchio.SE3` or shape (4, 4).
        end: Last position or pose, of the same kind.
        duration: Time from start to end [s], positive.
        steps: Number of intervals, at most a million; there are `steps + 1` waypoints.

    Returns:
        The path.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or not positive, or there are too many steps.
    """
    a, b = Goal.of(start, name="start"), Goal.of(end, name="end")
    if a.rows != b.rows:
        raise ParameterError("end", end, "of the same kind as start: two positions, or two poses")
    duration, steps = positive_number("duration", duration, "s"), positive_integer("steps", steps, _MOST_STEPS)
    s = np.linspace(0.0, 1.0, steps + 1)
    times, share = read_only(s * duration), quintic(s)
    positions = read_only(a.position + share[:, None] * (b.position - a.position))
    if a.rotation is None or b.rotation is None:
        return Path3D(times, positions)
    turn = pin.log3(a.rotation.T @ b.rotation)
    return Path3D(times, positions, read_only(np.array([a.rotation @ pin.exp3(one * turn) for one in share])))


def waypoints(positions: Any, times: Any) -> Path3D:
    """Path through given positions at given times.

    Args:
        positions: Target positions, shape (n, 3) [m], n >= 2.
        times: Increasing times, shape (n,) [s].

    Returns:
        The path.

    Raises:
        ParameterError: If shapes do not fit, there are fewer than two waypoints, or times do not increase.
    """
    points = finite_array("positions", positions, (None, 3), "m")
    moments = finite_array("times", times, (len(points),), "s")
    if len(points) < 2:
        raise ParameterError("positions", positions, "at least two waypoints")
    return Path3D(read_only(increasing("times", moments, "s")), read_only(points))


def read_waypoints(path: str | Path) -> Path3D:
    """Read waypoints from a CSV file with a header line that names the columns `t, x, y, z` [s, m, m, m].

    With columns `roll, pitch, yaw` as in URDF [rad] they are poses. Other columns and empty lines are ignored. Without a column
    `t` the waypoints are 0.05 s apart.

    Args:
        path: The file.

    Returns:
        The path.

    Raises:
        ParameterError: If the path is not one.
        FileFormatError: If the file cannot be read or is too large, lacks a column, has some of the angles only, fewer than two
            waypoints, times that do not increase, or (naming the line) a cell that is not a finite number, or more or fewer
            cells than the first line.
    """
    path = as_path("path", path)
    table = read_table(path, ("x", "y", "z"), ("t", *_ANGLES))
    times = table.numbers[:, 0] if table.columns[0] == "t" else _INTERVAL * np.arange(len(table.numbers))
    turned = [name for name in _ANGLES if name in table.columns]
    if turned and len(turned) < 3:
        raise FileFormatError(f"{path}: of roll, pitch and yaw it has {', '.join(turned)}; all three or none are required")
    try:
        found = waypoints(table.numbers[:, -3:], times)
    except ParameterError as error:
        raise FileFormatError(f"{path}: {error}") from error
    rotations = [pin.rpy.rpyToMatrix(*angles) for angles in table.numbers[:, -6:-3]] if turned else []
    return replace(found, orientations=read_only(np.array(rotations))) if turned else found
