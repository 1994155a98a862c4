"""Three motions: an arm that is let go, a fast turn with and without shaping, a helix in a gust."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from softrobots.core.checks import FloatArray

MOTORS = (0.3, 0.6, -0.8)
"""Motor angles of the arm [rad]; the turn ends there."""
LOAD = (0.0, 6.0, -8.0)
"""Load that is taken away, under which no link wrinkles [N]."""
TURN, TURN_TIME = 0.8, 0.5
"""How far the base of the arm turns [rad], and in which time [s]."""
LIGHT_DAMPING = 0.002
"""Damping time of the turning arm [s]: three times less than the file's, for a swing that lasts."""
GUST, GUST_TIME = 0.15, 0.3
"""Largest force of the gust along x, half a sine [N], and how long it blows [s]."""
HELIX_DAMPING = 0.005
"""Damping time of the helix [s]: ten times less than the file's, under which it hardly swings."""


class Path(NamedTuple):
    """A path of motors, for `softrobots.shape_input`."""

    times: FloatArray
    """Times, shape (n,) [s]."""
    q_motors: FloatArray
    """Motor angles, shape (n, n_motors) [rad]."""


def point_to_point(begin: Any, end: Any, duration: float, rows: int) -> Path:
    """A path of motors from rest to rest in so many rows; angles of shape (n_motors,) [rad], duration [s]."""
    share = np.linspace(0.0, 1.0, rows)
    return Path(duration * share, np.add(begin, sr.quintic(share)[:, None] * np.subtract(end, begin)))


def release(duration: float = 2.0) -> sr.Motion:
    """The inflatable arm that hangs under its weight and a load, which is taken away."""
    arm = sr.load_model(sr.InflatableArm())
    held = sr.solve_equilibrium(arm, MOTORS, LOAD, gravity=sr.EARTH_GRAVITY)
    return sr.simulate(arm, duration, MOTORS, start=held, gravity=sr.EARTH_GRAVITY, progress="release")


def turns(duration: float = 2.0) -> dict[str, sr.Motion]:
    """The arm turns its base in half a second: unshaped, and shaped for its modes where the turn ends; by name."""
    arm, begin = sr.load_model(sr.InflatableArm()), np.subtract(MOTORS, (TURN, 0.0, 0.0))
    path = point_to_point(begin, MOTORS, TURN_TIME, 51)
    first, last = (sr.solve_equilibrium(arm, motors, gravity=sr.EARTH_GRAVITY) for motors in (begin, MOTORS))
    modes = sr.vibration_modes(arm, last, damping_time=LIGHT_DAMPING)
    bare = sr.shape_input(path, modes, numbers=())  # the same path as a function of time
    paths = {
        "unshaped": bare,
        "shaped, ZV": sr.shape_input(path, modes, shaper="zv"),
        "shaped, EI": sr.shape_input(path, modes, shaper="ei"),
    }
    options: dict[str, Any] = {"start": first, "gravity": sr.EARTH_GRAVITY, "damping_time": LIGHT_DAMPING}
    return {name: sr.simulate(arm, duration, one, progress=f"turn {name}", **options) for name, one in paths.items()}


def swing(motion: sr.Motion) -> float:
    """Largest distance of the tip from where it rests in the end, once the motors stand still [m]."""
    moving = np.flatnonzero(np.abs(np.diff(motion.q_motors, axis=0)).max(axis=1) > 1e-9)
    begin = int(moving[-1]) + 1 if len(moving) else 0
    rest = sr.solve_equilibrium(motion.model, motion.q_motors[-1], gravity=motion.gravity).tip_position
    return float(np.linalg.norm(motion.tip_position[begin:] - rest, axis=1).max())


def gust(duration: float = 1.5) -> sr.Motion:
    """The helical tube under its weight, blown aside by a gust."""
    tube = sr.load_model(sr.HelixTube())
    sagging = sr.solve_equilibrium(tube, (), gravity=sr.EARTH_GRAVITY)
    options: dict[str, Any] = {"start": sagging, "gravity": sr.EARTH_GRAVITY, "damping_time": HELIX_DAMPING}
    return sr.simulate(tube, duration, (), force=gust_force, **options, progress="gust")


def gust_force(time: float) -> tuple[float, float, float]:
    """Force of the gust on the tip [N]."""
    return (GUST * float(np.sin(np.pi * time / GUST_TIME)) if time < GUST_TIME else 0.0, 0.0, 0.0)
