"""Distance of a robot from the obstacles around it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import summarised
from softrobots.environment.environment import Environment, fixed_environment
from softrobots.environment.gaps import Surroundings
from softrobots.model.soft_model import SoftModel


@summarised
class Clearance(NamedTuple):
    """The smallest gap between a robot and obstacles, and where it is; points in world axes."""

    distance: float
    """Distance of the surfaces, negative where they penetrate [m]."""
    link: str
    """Link of the robot."""
    obstacle: str
    """Name of the obstacle; of the other link, where the robot comes nearest to itself."""
    point: FloatArray
    """Point on the robot's surface, shape (3,) [m]."""
    obstacle_point: FloatArray
    """Point on the obstacle's surface, shape (3,) [m]."""


def clearance(model: SoftModel, q: FloatArray, environment: Environment) -> Clearance:
    """Find the smallest gap at Pinocchio's configuration, shape (nq,), between the capsules of a robot and obstacles at rest.

    Raises:
        ParameterError: If `environment` is none, an obstacle moves, or there is nothing that the robot could touch.
        DescriptionError: If the robot has no shapes that can touch.
    """
    surroundings = Surroundings(model, fixed_environment(environment))
    gaps = surroundings.at(q, np.inf)
    if not len(gaps):
        raise ParameterError("environment", environment, "one with an obstacle that the robot can touch")
    place = int(gaps.values.argmin())
    link, obstacle, _ = surroundings.pair(gaps, place)
    points = read_only(gaps.points[place]), read_only(gaps.obstacle_points[place])
    return Clearance(float(gaps.values[place]), link, obstacle, *points)
