"""Obstacles of one kind as one field of distances, so that all of them are evaluated at once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.environment.convex_mesh import Mesh, hull_of
from softrobots.environment.distance_fields import Cylinders, Field, HalfSpaces, RoundedBoxes
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere


def obstacle_fields(obstacles: Iterable[Obstacle]) -> list[tuple[Field, Any]]:
    """Return fields of distances, each with the numbers of its obstacles among those given: an environment, or several.

    Raises:
        ParameterError: If an obstacle moves: `Environment.at` fixes it.
    """
    given = tuple(obstacles)
    transforms = obstacle_transforms(given)
    fields: list[tuple[Field, Any]] = []
    boxes = (Box, Sphere, Capsule), _rounded_boxes
    for kinds, make in ((HalfSpace, _half_spaces), boxes, (Cylinder, _cylinders), (Mesh, _polyhedra)):
        numbers = np.array([i for i, one in enumerate(given) if isinstance(one, kinds)], dtype=np.intp)
        if len(numbers):
            fields.append((make([given[i] for i in numbers.tolist()], transforms[numbers]), numbers))
    return fields


def obstacle_transforms(obstacles: Iterable[Obstacle]) -> FloatArray:
    """Return the transforms of the obstacles to the world, shape (n, 4, 4)."""
    return np.array([one.transform_to_world for one in obstacles], dtype=np.float64).reshape(-1, 4, 4)


def _half_spaces(obstacles: list[Any], transforms: FloatArray) -> HalfSpaces:
    normals = np.ascontiguousarray(transforms[:, :3, 2])
    return HalfSpaces(normals, (normals * transforms[:, :3, 3]).sum(axis=1))


def _rounded_boxes(obstacles: list[Any], transforms: FloatArray) -> RoundedBoxes:
    sizes = [one.size if isinstance(one, Box) else (0.0, 0.0, getattr(one, "length", 0.0)) for one in obstacles]
    radii = np.array([getattr(one, "radius", 0.0) for one in obstacles])
    return RoundedBoxes(transforms[:, :3, :3], transforms[:, :3, 3], 0.5 * np.array(sizes), radii)


def _cylinders(obstacles: list[Any], transforms: FloatArray) -> Cylinders:
    halves = np.array([0.5 * one.length for one in obstacles])
    return Cylinders(transforms[:, :3, :3], transforms[:, :3, 3], halves, np.array([one.radius for one in obstacles]))


def _polyhedra(obstacles: list[Any], transforms: FloatArray) -> Field:
    from softrobots.environment.polyhedra import Polyhedra  # SciPy

    hulls = [hull_of(one.vertices.tobytes()) for one in obstacles]
    return Polyhedra(transforms[:, :3, :3], transforms[:, :3, 3], hulls)
