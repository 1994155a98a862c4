"""Controllers of the arm on the path that stands for that of [Troise 2021]: what the tip does."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

import softrobots as sr
from studies.papers.arm_path import DURATION, END, FORCE, START

ROTOR = 0.05
"""Rotor inertia of each motor at its joint, ours [kg m^2]."""
KP, KD = 400.0, 30.0
"""Gains of the motors, ours [N m/rad, N m s/rad]."""
HEAVIER = 1.2
"""Load on the tip over the load that the controllers assume."""
SAMPLE, STEP, AFTER = 1e-3, 2e-3, 2.0
"""Sampling time of the closed loop, step of time of the others, and time after the end of the path [s]."""


class Followed(NamedTuple):
    """A path followed by a controller."""

    name: str
    """Name of the controller."""
    load: float
    """Load on the tip over that of the paper, which the controllers assume."""
    motion: sr.Motion
    """The motion."""
    targets: Any
    """Target of the tip in each row, shape (n, 3) [m]."""

    @property
    def error(self) -> Any:
        """Distance of the tip from its target, shape (n,) [m]."""
        return np.linalg.norm(self.motion.tip_position - self.targets, axis=1)

    def row(self) -> dict[str, Any]:
        """The numbers of the table."""
        after, tip = self.motion.time >= DURATION - 1e-9, self.motion.tip_position
        onwards = np.subtract(END, START) / np.linalg.norm(np.subtract(END, START))
        return {
            "controller": self.name,
            "load": self.load,
            "largest_m": float(self.error[~after].max()),
            "rms_m": float(np.sqrt(np.mean(self.error[~after] ** 2))),
            "overshoot_m": float(((tip[after] - tip[-1]) @ onwards).max()),
            "vibration_m": float(np.linalg.norm(tip[after] - tip[-1], axis=1).max()),
            "end_m": float(self.error[-1]),
        }


def study(rows: slice = slice(None)) -> list[Followed]:
    """Follow the path with each controller, and with two of them under a larger load than they assume.

    Args:
        rows: Which of these; all by default.
    """
    model = sr.load_model(sr.InflatableArm(rotor_inertia=ROTOR))
    path = sr.straight_line(START, END, DURATION, steps=100)
    loaded, rigid = (
        sr.follow_trajectory(model, path.positions, force, times=path.times, elbow="up") for force in (FORCE, None)
    )
    start = loaded.equilibria[0]
    controllers: dict[str, tuple[Any, dict[str, Any]]] = {
        "PD, angles of the rigid arm": (sr.PD(model, rigid, KP, KD), {"time_step": STEP}),
        "PD, angles of `solve_ik`": (sr.PD(model, loaded, KP, KD), {"time_step": STEP}),
        "PD, with feed-forward": (sr.PD(model, loaded, KP, KD, feed_forward=loaded), {"time_step": STEP}),
        "closed loop": (
            sr.ClosedLoop(model, path, KP, KD, start=start),
            {"time_step": SAMPLE, "sample_time": SAMPLE},
        ),
    }
    followed = []
    every = [*((name, 1.0) for name in controllers), *((name, HEAVIER) for name in list(controllers)[2:])]
    for name, load in every[rows]:
        torque, options = controllers[name]
        moved = sr.simulate(
            model,
            DURATION + AFTER,
            None,
            start=sr.solve_equilibrium(model, start.q_motors, load * np.array(FORCE)),
            force=load * np.array(FORCE),
            motors="torque",
            torque=torque,
            output_step=0.01,
            **options,
        )
        targets = np.column_stack([np.interp(moved.time, path.times, column) for column in path.positions.T])
        followed.append(Followed(name, load, moved, targets))
    return followed
