"""Robots on obstacles: a wall, a ball, an edge, a rim, a corner and pegs. Nothing touches at rest; the load presses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from softrobots.model.loader import load_model
from softrobots.model.soft_model import SoftModel
from softrobots.robots import InflatableArm, PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.equilibrium_result import Equilibrium
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import EARTH_GRAVITY

MOTORS = (0.3, 0.6, -0.8)
"""Of the inflatable arm [rad]: its last link is 0.2 rad below the horizontal."""
FOLDED = (0.3, 0.5, -2.9)
"""Of the same arm: its last link lies below the first, along which a force on the tip presses it [rad]."""
TENSIONS = (5.0,) * 6
"""Of the muscles of the lumped arm [N]: it stands straight up."""
_UP = (0.0, 0.0, 30.0)
_DOWN, _ASIDE, _ON_PEGS = (0.0, 0.0, -20.0), (0.0, 15.0, 0.0), (-6.0, 1.0, 0.0)
_WALL = np.array([0.1, -1.0, 0.05]) / math.sqrt(1.0125)
_ALONG_Y = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))  # turns z to y


@dataclass(frozen=True, eq=False)
class ContactCase:
    """A robot with obstacles, and a load that presses it on them."""

    model: SoftModel
    """The robot."""
    q_motors: tuple[float, ...]
    """Its motors [rad or N]."""
    force: tuple[float, float, float]
    """Force on the tip, world axes [N]."""
    environment: Environment
    """The obstacles."""
    gravity: tuple[float, float, float] = EARTH_GRAVITY
    """Gravity, world axes [m/s^2]."""

    def solve(self) -> Equilibrium:
        """Return our equilibrium."""
        return solve_equilibrium(self.model, self.q_motors, self.force, gravity=self.gravity, environment=self.environment)

    def tip(self, joints: Mapping[str, float]) -> FloatArray:
        """Position of the tip with spring joints at given coordinates, by name, shape (3,) [m]."""
        springs = np.array([joints[name] for name in self.model.spring_joints])
        place = frame_placement(self.model, self.model.configuration(self.q_motors, springs), self.model.tip)
        return np.asarray(place.translation)


@lru_cache(maxsize=1)
def arm() -> SoftModel:
    """The inflatable arm."""
    return load_model(InflatableArm())


@lru_cache(maxsize=1)
def lumped_arm() -> SoftModel:
    """The arm of muscles, six pairs of hinges a segment, tensions given."""
    return load_model(PccArm(chain="lumped", hinges=6), muscles="forces")


def _on(force: tuple[float, float, float], make: Callable[[FloatArray], Obstacle]) -> ContactCase:
    """The arm on an obstacle made for the middle of its last link, unloaded, shape (3,) [m]."""
    at = frame_placement(arm(), arm().configuration(MOTORS, np.zeros(4)), "link_2").act(np.array([0.3, 0.0, 0.0]))
    return ContactCase(arm(), MOTORS, force, Environment([make(at)]))


def _turned(angle: float) -> FloatArray:
    """A block on an edge, about the vertical by an angle from the direction of y."""
    about_y = np.array([[1.0, 0.0, 1.0], [0.0, math.sqrt(2.0), 0.0], [-1.0, 0.0, 1.0]]) / math.sqrt(2.0)
    about_z = np.array([[math.cos(angle), -math.sin(angle), 0.0], [math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y)


def _under(at: FloatArray, depth: float) -> FloatArray:
    """A place below the tube at `at`, with a gap of a centimetre to an obstacle that reaches `depth` above it [m]."""
    return np.asarray(at - np.array([0.0, 0.0, 0.055 + 0.01 + depth]))


def _pegs() -> ContactCase:
    """An arm that a force bends around a peg and, below it, onto another, with a wall that it does not reach."""
    pegs = [
        Cylinder(0.03, 0.4, (x, 0.0, z), _ALONG_Y, name=name) for name, x, z in (("left", -0.085, 0.6), ("right", 0.083, 0.3))
    ]
    return ContactCase(lumped_arm(), TENSIONS, _ON_PEGS, Environment([*pegs, HalfSpace((1.0, 0.0, 0.0), -0.3)]))


_PYRAMID = ((0.15, 0.03, 0.0), (-0.05, 0.12, 0.0), (-0.1, -0.12, 0.0), (0.01, -0.02, 0.1))

CASES: Mapping[str, Callable[[], ContactCase]] = {
    "arm on a wall": lambda: _on(_ASIDE, lambda at: HalfSpace(_WALL, float(at @ _WALL) - 0.14)),
    "arm on a ball": lambda: _on(_DOWN, lambda at: Sphere(0.1, _under(at, 0.1) + (0.0, 0.03, 0.0))),
    "arm on the edge of a box": lambda: _on(
        _DOWN, lambda at: Box((0.2, 0.3, 0.2), _under(at, 0.1 * math.sqrt(2.0)), _turned(0.2))
    ),
    "arm on the rim of a cylinder": lambda: _on(_DOWN, lambda at: Cylinder(0.05, 0.2, _under(at, 0.12))),
    "arm on a capsule": lambda: _on(_DOWN, lambda at: Capsule(0.05, 0.2, _under(at, 0.05), _ALONG_Y)),
    "arm on the corner of a mesh": lambda: _on(_DOWN, lambda at: Mesh(_PYRAMID, _under(at, 0.1))),
    "arm folded on itself": lambda: ContactCase(arm(), FOLDED, _UP, Environment(self_contact=True)),
    "arm of muscles between pegs": _pegs,
}
"""The cases by name."""
