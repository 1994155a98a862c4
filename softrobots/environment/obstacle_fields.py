"""Obstacles of one kind as one field of distances, so that all of them are evaluated at once."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.convex_mesh import Mesh, hull_of
from softrobots.environment.distance_fields import Cylinders, Field, HalfSpaces, RoundedBoxes
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere


def obstacle_fields(environment: Environment) -> list[tuple[Field, Any]]:
    """Return fields of distances, each with the numbers of its obstacles in the environment.

    Raises:
        ParameterError: If an obstacle moves: `Environment.at` fixes it.
    """
    transforms = obstacle_transforms(environment)
    fields: list[tuple[Field, Any]] = []
    for kinds, make in ((HalfSpace, _half_spaces), ((Box, Sphere, Capsule), _rounded_boxes), (Cylinder, _cylinders)):
        numbers = np.array([i for i, one in enumerate(environment.obstacles) if isinstance(one, kinds)], dtype=np.intp)
        if len(numbers):
            fields.append((make([environment.obstacles[i] for i in numbers.tolist()], transforms[numbers]), numbers))
    numbers = np.array([i for i, one in enumerate(environment.obstacles) if isinstance(one, Mesh)], dtype=np.intp)
    if len(numbers):
        from softrobots.environment.polyhedra import Polyhedra  # SciPy

        hulls = [hull_of(environment.obstacles[i].vertices.tobytes()) for i in numbers.tolist()]
        fields.append((Polyhedra(transforms[numbers, :3, :3], transforms[numbers, :3, 3], hulls), numbers))
    return fields


def obstacle_transforms(environment: Environment) -> FloatArray:
    """Return the transforms of the obstacles to the world, shape (n, 4, 4)."""
    return np.array([one.transform_to_world for one in environment.obstacles], dtype=np.float64).reshape(-1, 4, 4)


def _half_spaces(obstacles: list[Any], transforms: FloatArray) -> HalfSpaces:
    normals = np.ascontiguousarray(transforms[:, :3, 2])
    return HalfSpaces(normals, (normals * transforms[:, :3, 3]).sum(axis=1))


def _rounded_boxes(obstacles: list[Any], transforms: FloatArray) -> RoundedBoxes:
    halves = [_half(one) for one in obstacles]
    radii = np.array([getattr(one, "radius", 0.0) for one in obstacles])
    return RoundedBoxes(transforms[:, :3, :3], transforms[:, :3, 3], np.array(halves), radii)


def _half(obstacle: Obstacle) -> FloatArray:
    if isinstance(obstacle, Box):
        return np.asarray(0.5 * obstacle.size)
    return np.array([0.0, 0.0, 0.5 * obstacle.length if isinstance(obstacle, Capsule) else 0.0])


def _cylinders(obstacles: list[Any], transforms: FloatArray) -> Cylinders:
    halves = np.array([0.5 * one.length for one in obstacles])
    return Cylinders(transforms[:, :3, :3], transforms[:, :3, 3], halves, np.array([one.radius for one in obstacles]))
