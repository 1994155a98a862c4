"""The movement that stands for Figures 10 and 11 of [Troise 2021]: a straight line of our own under the paper's load.

The paper publishes neither start nor end. Ours are the default of `scripts/ik_trajectory.py` and the path of the benchmark,
too; the largest moment at link 1 is near the paper's, which says nothing of the paper's path.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.time_law import straight_line
from softrobots.statics.trajectory import Trajectory, follow_trajectory

FORCE = (0.0, 10.0, -15.0)
"""Load on the tip [N], [Troise 2021] section 4."""

START, END = (0.4, -0.5, 0.6), (1.0, 0.2, 0.2)
"""First and last target, ours [m]."""

DURATION, STEPS = 2.0, 200
"""Time from start to end [s], and intervals; ours."""

GAIN = 50.0
"""Gain `K` of the closed loop of [Troise 2021] (9) [1/s]; ours, the paper gives none."""


class Movement(NamedTuple):
    """The same targets, followed in several ways."""

    loaded: Trajectory
    """With the sag compensated at every waypoint, to rounding."""
    rigid: Trajectory
    """Rigid inverse kinematics: the arm without load."""
    sagging: Trajectory
    """The arm with the angles of `rigid` under the load: what sag does without compensation."""
    closed_loop: Trajectory
    """The recursion of [Troise 2021] Figure 6."""


@lru_cache(maxsize=1)
def arm() -> SoftModel:
    """The arm of the paper."""
    return load_model(InflatableArm())


@lru_cache(maxsize=1)
def movement() -> Movement:
    """Follow the line with the load, without it, and by the paper's recursion."""
    path = straight_line(START, END, DURATION, STEPS)

    def follow(force: tuple[float, float, float] | None, method: str) -> Trajectory:
        return follow_trajectory(arm(), path.positions, force, times=path.times, elbow="up", method=method, gain=GAIN)

    rigid = follow(None, "newton")
    settled = tuple(solve_equilibrium(arm(), q, FORCE) for q in rigid.q_motors)
    sagging = Trajectory(path.times, path.positions, settled, "rigid")
    return Movement(follow(FORCE, "newton"), rigid, sagging, follow(FORCE, "paper"))
