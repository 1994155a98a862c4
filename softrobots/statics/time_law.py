"""Trajectory generation: straight lines with a quintic time law, and waypoints from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, increasing, positive_integer, positive_number, read_only
from softrobots.core.csv_table import read_table
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import as_path

_INTERVAL = 0.05  # [s], between waypoints without times
_MOST_STEPS = 1_000_000


@dataclass(frozen=True, eq=False)
class Path3D:
    """Target positions over time."""

    times: FloatArray
    """Time of each waypoint, increasing, shape (n,) [s]."""
    positions: FloatArray
    """Target positions, shape (n, 3) [m], world axes."""


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

    Args:
        start: First position, shape (3,) [m].
        end: Last position, shape (3,) [m].
        duration: Time from start to end [s], positive.
        steps: Number of intervals, at most a million; there are `steps + 1` waypoints.

    Returns:
        The path.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or not positive, or there are too many steps.
    """
    a, b = finite_array("start", start, (3,), "m"), finite_array("end", end, (3,), "m")
    duration, steps = positive_number("duration", duration, "s"), positive_integer("steps", steps, _MOST_STEPS)
    s = np.linspace(0.0, 1.0, steps + 1)
    return Path3D(read_only(s * duration), read_only(a + quintic(s)[:, None] * (b - a)))


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

    Other columns and empty lines are ignored. Without a column `t` the waypoints are 0.05 s apart.

    Args:
        path: The file.

    Returns:
        The path.

    Raises:
        ParameterError: If the path is not one.
        FileFormatError: If the file cannot be read or is too large, lacks a column, has fewer than two waypoints, times that do
            not increase, or (naming the line) a cell that is not a finite number, or more or fewer cells than the first line.
    """
    path = as_path("path", path)
    table = read_table(path, ("x", "y", "z"), ("t",))
    times = table.numbers[:, 0] if table.columns[0] == "t" else _INTERVAL * np.arange(len(table.numbers))
    try:
        return waypoints(table.numbers[:, -3:], times)
    except ParameterError as error:
        raise FileFormatError(f"{path}: {error}") from error
