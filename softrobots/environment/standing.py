"""Whether a robot can be among obstacles at all: none of them holds its base deeper than it can stand on them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.environment.cores import SAME_POINT, cores_of
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Surroundings
from softrobots.environment.obstacle_fields import obstacle_fields
from softrobots.environment.obstacles import Box, Cylinder
from softrobots.model.soft_model import SoftModel


def standing_among(model: SoftModel, environment: Environment) -> Surroundings:
    """Return the surroundings of a robot that is to be in equilibrium there.

    Raises:
        ParameterError: As `check_base` does, or if an obstacle moves.
        DescriptionError: If the robot has no capsules, and no collision shapes that are spheres or cylinders.
    """
    check_base(model, [environment])
    return Surroundings(model, environment)


def check_base(model: SoftModel, environments: Sequence[Environment]) -> None:
    """Check that obstacles, of all environments at once, hold no end of a core that never moves too deep.

    From an end deeper than its radius the robot reaches out of the obstacle only through the surface, farther from its base
    than where it may stand. Of an obstacle with edges it crosses a border between features on its way out, which is a contact
    inside of it, from any depth; boxes and cylinders have such borders around every face.

    Raises:
        ParameterError: If one does; it names link, obstacle and depth.
        DescriptionError: If the robot has no capsules, and no collision shapes that are spheres or cylinders.
    """
    cores = cores_of(model)
    if not len(cores.fixed):
        return
    obstacles = [(environment, one) for environment in environments for one in environment]
    radii = cores.radii.take(cores.end_capsules.take(cores.fixed))
    for field, numbers in obstacle_fields(one for _, one in obstacles):
        depths = -field.at(cores.fixed_points.repeat(len(numbers), 0), np.tile(np.arange(len(numbers)), len(radii)))[0]
        round_ones = np.array([not isinstance(obstacles[number][1], Box | Cylinder) for number in numbers.tolist()])
        beyond = depths.reshape(len(radii), -1) - radii[:, None] * round_ones
        end, which = np.unravel_index(beyond.argmax(), beyond.shape)
        if beyond[end, which] <= SAME_POINT * model.reach:
            continue
        environment, obstacle = obstacles[numbers[which]]
        link = cores.capsules[cores.end_capsules[cores.fixed[end]]].link
        depth = depths.reshape(beyond.shape)[end, which]
        required = f"at most its radius of {radii[end]:.3g} m" if round_ones[which] else "on the surface or outside"
        raise ParameterError(
            "environment",
            environment,
            f"one that the robot can stand on: its base, where {link!r} starts, is {depth:.3g} m inside of "
            f"{obstacle.name!r}, where nothing moves it; required: {required}",
        )
