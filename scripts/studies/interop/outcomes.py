"""Input and output of a simulator, in the same form for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from softrobots.core.checks import FloatArray
from studies.interop.cases import Gravity

SECONDS = 60.0
"""Duration of a simulation [s]."""

ITSELF = "itself"
"""Name of the robot among what touches it."""


class Question(NamedTuple):
    """A robot in a file, and its load."""

    text: str
    """The file."""
    tip: str
    """Body at whose origin the force acts."""
    force: tuple[float, float, float]
    """The force, world axes [N]; it does not follow the robot."""
    gravity: Gravity
    """Gravity, world axes [m/s^2]; None: weightless."""


class Outcome(NamedTuple):
    """Equilibrium of a simulator."""

    joints: dict[str, float]
    """Coordinate of every movable joint [rad or m]."""
    speed: float
    """Largest speed of a joint there [rad/s or m/s]; 0 if it was not simulated."""
    contacts: int
    """Largest number of contacts."""
    steps: int
    """Iterations of Newton's method, or time steps."""
    wall_time: float
    """Time of the computation, without loading the file [s]."""
    forces: Mapping[str, FloatArray] = MappingProxyType({})
    """Force of each obstacle that touches on the robot, by its name, world axes, shape (3,) [N]; sum of the normal forces of
    contacts of the robot with itself, by `ITSELF`, shape (1,) [N]."""
