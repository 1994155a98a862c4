"""Three touches: an arm that leans on a wall, a helix that grips a rod, a rod that snakes between pegs."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import brentq

import softrobots as sr
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.progress import with_progress

LEANING = (0.0, 0.9, -0.4)
"""Motor angles of the arm beside the wall [rad]: up and forward."""
WALL = sr.Environment([sr.HalfSpace((-1.0, 0.0, 0.0), offset=-1.0, name="wall")])
"""A wall in front of the arm, 1 m from its base."""
SQUEEZE = 1e-3
"""Radius of the rod in the helix beyond the inner one of the helix [m]."""
DEPTH = 0.24
"""How far the rod is pushed into the helix [m], which is 0.31 m high."""
PEGS = (0.1, 0.2, 0.3)
"""Heights of the pegs [m]."""
PEG, CLEARANCE = 0.015, 0.002
"""Radius of a peg, and its distance from the rod before it moves [m]."""
STROKE = 0.03
"""How far the pegs move [m]."""
PULL = (0.0, 0.0, 3.0)
"""Force that keeps the rod between the pegs taut [N]."""


def arm() -> sr.SoftModel:
    """Return the inflatable arm."""
    return sr.load_model(sr.InflatableArm())


def largest_weight(environment: sr.Environment | None) -> float:
    """Return the weight on the tip of the leaning arm at which a link begins to wrinkle [N]."""
    model = arm()

    def left(weight: float) -> float:
        held = sr.solve_equilibrium(model, LEANING, (0.0, 0.0, -weight), environment=environment)
        return float(held.link_limits.wrinkling_margins.min())

    return float(brentq(left, 0.0, 80.0, xtol=1e-9))


def free_arm(weights: FloatArray) -> list[sr.Equilibrium]:
    """Return the same arm without a wall, under weights on its tip, shape (n,) [N]."""
    model = arm()
    return [sr.solve_equilibrium(model, LEANING, (0.0, 0.0, -weight)) for weight in weights.tolist()]


def brace(weights: FloatArray, friction: float = 0.0) -> sr.ContactPath:
    """Let the weight on the tip of an arm grow, shape (n,) [N]: it sags against the wall and leans on it."""
    return _followed(arm(), LEANING, np.outer(weights, (0.0, 0.0, -1.0)), WALL, weights, friction, "brace")


def helix() -> sr.HelixTube:
    """Return the helix: 1.8 turns about the world's z axis."""
    return sr.HelixTube(length=1.0, upright="axis", elastic_sections=30)


def grip(depths: FloatArray, friction: float = 0.0) -> sr.ContactPath:
    """Push a rod with a round end along the axis of a helix, by depths from where it is free, shape (n,) [m]."""
    tube = helix()
    radius, top = float(sr.helix.forward(tube.contraction, tube.angle, tube.diameter).inner_radius) + SQUEEZE, 0.33
    rod = sr.Capsule(radius, 0.2, (0.0, 0.0, top + 0.1 + radius), name="rod", pose=partial(moved, (0.0, 0.0, -1.0)))
    return _followed(sr.load_model(tube), (), np.zeros((len(depths), 3)), sr.Environment([rod]), depths, friction, "grip")


def snake(strokes: FloatArray, friction: float = 0.0) -> sr.ContactPath:
    """Move pegs from both sides against a rod that is kept taut, by strokes from where they are free, shape (n,) [m]."""
    rod = sr.TendonArm(segment_lengths=(0.4,), elastic_sections=24, tendon_azimuths=())
    across = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    pegs = []
    for number, height in enumerate(PEGS):
        side = 1.0 if number % 2 else -1.0
        place = (side * (PEG + 0.006 + CLEARANCE), 0.0, height)
        pegs.append(sr.Cylinder(PEG, 0.06, place, across, name=f"peg_{number + 1}", pose=partial(moved, (-side, 0.0, 0.0))))
    pull = np.tile(PULL, (len(strokes), 1))
    return _followed(sr.load_model(rod), (), pull, sr.Environment(pegs), strokes, friction, "pegs")


def _followed(
    model: sr.SoftModel,
    motors: Any,
    forces: FloatArray,
    environment: sr.Environment,
    parameters: FloatArray,
    friction: float,
    label: str,
) -> sr.ContactPath:
    """Follow a robot in contact; without friction by one equilibrium after the other, whose changes are not located between."""
    if friction > 0.0:
        given: dict[str, Any] = {"environment": environment, "friction": friction, "parameters": parameters, "progress": label}
        return sr.follow_contact(model, motors, forces, **given)
    states: list[sr.Equilibrium] = []
    rows = list(zip(parameters.tolist(), forces, strict=True))
    for parameter, force in with_progress(rows, True, label=label, unit="step"):
        last = states[-1] if states else None
        states.append(sr.solve_equilibrium(model, motors, force, environment=environment.at(parameter), previous=last))
    return sr.ContactPath(read_only(parameters.copy()), tuple(states), 0.0, read_only(np.zeros(len(states))), (), ())


def moved(direction: tuple[float, float, float], way: float) -> FloatArray:
    """Return a motion along a direction, shape (4, 4), by a way [m]."""
    pose = np.eye(4)
    pose[:3, 3] = way * np.array(direction)
    return pose
