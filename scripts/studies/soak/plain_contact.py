"""Distances of robots and obstacles, written plainly, to check equilibria in contact.

The distance of a point from a convex body is written by its definition, the nearest point of a capsule's core is found by
golden sections (the distance along a segment is convex), and normals are differences of the distance. Nothing of the solvers
is used.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.description.tag_reader import read_tags
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from studies.soak.plain_statics import PlainStatics

_SECTIONS = 45  # golden sections: the nearest point to 4e-10 of the core, so its distance to 1e-16
_SHRINK = (math.sqrt(5.0) - 1.0) / 2.0


def distance(obstacle: Obstacle, points: FloatArray) -> FloatArray:
    """Signed distance of points, shape (..., 3) [m], from an obstacle that does not move; shape (...) [m]."""
    if isinstance(obstacle, HalfSpace):
        normal = np.asarray(obstacle.normal) / np.linalg.norm(obstacle.normal)
        return np.asarray(points @ normal - obstacle.offset)
    if isinstance(obstacle, Sphere):
        return np.asarray(np.linalg.norm(points - np.asarray(obstacle.position), axis=-1) - obstacle.radius)
    if not isinstance(obstacle, Box | Cylinder | Capsule):
        raise TypeError(type(obstacle).__name__)
    own = (points - np.asarray(obstacle.position)) @ np.asarray(obstacle.rotation)  # transposed: to the obstacle's axes
    if isinstance(obstacle, Box):
        return _outside(np.abs(own) - 0.5 * np.asarray(obstacle.size))
    across, along = np.hypot(own[..., 0], own[..., 1]), np.abs(own[..., 2]) - 0.5 * obstacle.length
    if isinstance(obstacle, Cylinder):
        return _outside(np.stack([across - obstacle.radius, along], axis=-1))
    return np.asarray(np.hypot(across, np.maximum(along, 0.0)) - obstacle.radius)


def _outside(beyond: FloatArray) -> FloatArray:
    """Distance from how far a point is beyond each pair of sides."""
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0.0), axis=-1) + np.minimum(beyond.max(axis=-1), 0.0))


def slope(obstacle: Obstacle, point: FloatArray, step: float) -> FloatArray:
    """Gradient of the distance at a point, shape (3,), by central differences."""
    steps = step * np.eye(3)
    return np.asarray(distance(obstacle, point + steps) - distance(obstacle, point - steps)) / (2.0 * step)


class Nearest(NamedTuple):
    """The points of a robot's capsules that are nearest to the obstacles."""

    gap: FloatArray
    """Distance of the surfaces, shape (n_capsules, n_obstacles) [m]."""
    core: FloatArray
    """Nearest point of each core, shape (n_capsules, n_obstacles, 3) [m]."""


class PlainBody:
    """The capsules of a robot as its description tells them."""

    def __init__(self, statics: PlainStatics) -> None:
        """Take the capsules."""
        rigid, self.statics = statics.model.pinocchio, statics
        self.links: list[str] = []
        """Link of each capsule."""
        self.bodies: dict[str, int] = {}
        """Number of the body by the name of each link."""
        ends = []
        tags = read_tags(statics.model.urdf).capsules
        for tag in tags:
            frame = rigid.frames[statics.model.frame_id(tag.link)]
            turn, point = np.array(frame.placement.rotation), np.array(frame.placement.translation)
            ends.append([turn @ tag.start + point, turn @ tag.end + point])
            self.links.append(tag.link)
            self.bodies[tag.link] = int(frame.parentJoint)
        self._ends, self.radii = np.array(ends), np.array([tag.radius for tag in tags])

    def cores(self, motors: FloatArray, springs: FloatArray) -> FloatArray:
        """Ends of the cores in the world, shape (n, n_capsules, 2, 3) [m], for n rows of coordinates."""
        turns, points = self.statics.frames(motors, springs)
        parts = [
            np.einsum("nij,ej->nei", turns[body], ends) + points[body][:, None]
            for body, ends in zip((self.bodies[link] for link in self.links), self._ends, strict=True)
        ]
        return np.stack(parts, axis=1)

    def nearest(self, environment: Environment, cores: FloatArray) -> Nearest:
        """Nearest points of cores, shape (n_capsules, 2, 3) [m]."""
        gaps, points = [], []
        for obstacle in environment.obstacles:
            place = _lowest(obstacle, cores)
            points.append(place)
            gaps.append(distance(obstacle, place) - self.radii)
        return Nearest(np.stack(gaps, axis=1), np.stack(points, axis=1))


def _lowest(obstacle: Obstacle, cores: FloatArray) -> Any:
    """Where the distance along each segment is least, shape (n, 3)."""
    start, along = cores[:, 0], cores[:, 1] - cores[:, 0]
    low, high = np.zeros(len(cores)), np.ones(len(cores))
    for _ in range(_SECTIONS):
        left, right = high - _SHRINK * (high - low), low + _SHRINK * (high - low)
        rises = distance(obstacle, start + left[:, None] * along) <= distance(obstacle, start + right[:, None] * along)
        low, high = np.where(rises, low, left), np.where(rises, right, high)
    places = np.stack([np.zeros(len(cores)), 0.5 * (low + high), np.ones(len(cores))], axis=1)
    points = start[:, None] + places[..., None] * along[:, None]
    best = distance(obstacle, points).argmin(axis=1)
    return points[np.arange(len(cores)), best]
