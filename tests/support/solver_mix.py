"""A mix of solves of three robots as bytes, for tests that run it in threads and in other processes; light to import."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import softrobots as sr

MOTORS = np.array([0.3, 0.6, -0.8])
FORCE = np.array([0.0, 9.0, -9.0])
LENGTHS = (0.50, 0.53, 0.55, 0.54, 0.51, 0.52)


def robots() -> tuple[Any, ...]:
    """The arm, the arm of muscles and the tube, the latter two with few sections, and the arm compiled."""
    arm = sr.load_model(sr.InflatableArm())
    tube = sr.HelixTube(chain="lumped", hinges=8)
    return arm, sr.load_model(sr.PccArm(elastic_sections=1)), sr.load_model(tube), sr.compile(arm, backend="python")


def jobs(arm: sr.SoftModel, muscles: sr.SoftModel, tube: sr.SoftModel, fast: Any) -> list[Callable[[], Sequence[Any]]]:
    """Solves that each give arrays; none depends on another."""
    random = np.random.default_rng(8)

    def settle(model: sr.SoftModel, motors: Any, force: Any, gravity: Any) -> Callable[[], Sequence[Any]]:
        def run() -> Sequence[Any]:
            found = sr.solve_equilibrium(model, motors, force, gravity=gravity)
            return found.q_springs, found.motor_torques, found.tip_position, sr.compliance(model, found)

        return run

    made: list[Callable[[], Sequence[Any]]] = []
    for number in range(3):
        force = random.normal(size=3) * 5.0
        gravity = (None, sr.EARTH_GRAVITY, tuple(random.normal(size=3)))[number % 3]
        made.append(settle(arm, random.uniform(-1.0, 1.0, 3), force, gravity))
        made.append(settle(muscles, LENGTHS, force, gravity))
        made.append(settle(tube, (), 0.02 * force, gravity))

    def felt(model: sr.SoftModel, motors: Any) -> Callable[[], Sequence[Any]]:
        torques = sr.solve_equilibrium(model, motors, (2.0, 1.0, -3.0)).motor_torques
        return lambda: (sr.estimate_load(model, motors, torques).force,)

    batch = random.uniform(-1.0, 1.0, (20, 3))
    return [
        *made,
        felt(arm, MOTORS),
        felt(muscles, LENGTHS),
        lambda: (sr.solve_ik(arm, (0.9, 0.3, 0.2), (0.0, 5.0, -9.0)).q_motors,),
        lambda: (np.array(sr.critical_load(arm, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0))),),
        lambda: (fast.equilibrium(MOTORS, FORCE).q_springs,),
        lambda: (fast.equilibrium(MOTORS, FORCE, gravity=sr.EARTH_GRAVITY).q_springs,),
        lambda: (fast.equilibria(batch, FORCE).q_springs,),
        lambda: (fast.inverse_kinematics([(0.9, 0.3, 0.2)], (0.0, 5.0, -9.0), q_motors0=MOTORS).q_motors,),
    ]


def as_bytes(job: Callable[[], Sequence[Any]]) -> bytes:
    """All bytes of what a job gives."""
    return b"".join(np.asarray(array).tobytes() for array in job())
