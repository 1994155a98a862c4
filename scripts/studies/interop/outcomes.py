"""What a simulator is asked and what it answers, in the same form for all of them."""

from __future__ import annotations

from typing import NamedTuple

from studies.interop.cases import Gravity

SECONDS = 60.0
"""How long a simulation lasts [s]."""


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
    """Where a simulator says that the robot comes to rest."""

    joints: dict[str, float]
    """Coordinate of every joint that moves [rad or m]."""
    speed: float
    """Largest speed of a joint there [rad/s or m/s]; 0 if it was not simulated."""
    contacts: int
    """Most contacts that were seen."""
    steps: int
    """Iterations of Newton's method, or time steps."""
    wall_time: float
    """How long the computation took, without loading the file [s]."""
