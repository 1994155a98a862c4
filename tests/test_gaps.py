"""Gaps between robots and obstacles: values, normals and both derivatives against independent distances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.environment.capsules import robot_capsules
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.environment.obstacles import Box, Capsule, Cylinder, HalfSpace, Obstacle, Sphere
from softrobots.model.joint_loads import Entries

POSITION, ROTATION = (0.7, 0.1, -0.25), Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
OBSTACLES: dict[str, Obstacle] = {
    "half_space": HalfSpace((0.1, -0.2, 1.0), -0.3),
    "sphere": Sphere(0.12, POSITION),
    "box": Box((0.3, 0.2, 0.15), POSITION, ROTATION),
    "cylinder": Cylinder(0.1, 0.2, POSITION, ROTATION),
    "capsule": Capsule(0.1, 0.2, POSITION, ROTATION),
}


def distance_function(obstacle: Obstacle) -> Callable[[np.ndarray], float]:
    """Distance of a point outside, by projection of the point on the body; written for this test."""
    transform = obstacle.transform_to_world

    def distance(point: np.ndarray) -> float:
        x, y, z = local = transform[:3, :3].T @ (point - transform[:3, 3])
        if isinstance(obstacle, HalfSpace):
            return float(z)
        if isinstance(obstacle, Sphere):
            return float(np.linalg.norm(local)) - obstacle.radius
        if isinstance(obstacle, Box):
            return float(np.linalg.norm(local - np.clip(local, -0.5 * obstacle.size, 0.5 * obstacle.size)))
        axial = np.clip(z, -0.5 * obstacle.length, 0.5 * obstacle.length)
        if isinstance(obstacle, Capsule):
            return float(np.linalg.norm([x, y, z - axial])) - obstacle.radius
        radial = np.hypot(x, y)
        return float(np.hypot(max(radial - obstacle.radius, 0.0), z - axial))

    return distance


def cores_at(model: sr.SoftModel, q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Start, end and radius of each capsule that moves, by Pinocchio's own placements."""
    data = model.pinocchio.createData()
    pin.forwardKinematics(model.pinocchio, data, q)
    moving = [one for one in robot_capsules(model) if one.joint > 0]
    return [(data.oMi[one.joint].act(one.start), data.oMi[one.joint].act(one.end), one.radius) for one in moving]


def configurations(model: sr.SoftModel, count: int) -> list[np.ndarray]:
    random = np.random.default_rng(1)
    return [random.uniform(-0.5, 0.5, model.pinocchio.nv) for _ in range(count)]


def second_derivative(gaps: Gaps, forces: np.ndarray) -> np.ndarray:
    nv = gaps.jacobian.shape[1]
    rows, weights = gaps.curvature(forces)
    load = gaps.load(forces)
    assert np.allclose(load.torque, forces @ gaps.jacobian, atol=1e-13 * max(1.0, float(forces.sum())))
    return load.derivative(Entries.of(np.arange(nv), np.arange(nv), nv)) + rows.T @ (weights[:, None] * rows)


@pytest.mark.parametrize("kind", OBSTACLES)
def test_least_gap_of_each_capsule_is_the_distance_by_minimisation(arm: sr.SoftModel, kind: str) -> None:
    """SciPy's minimisation along the core of a distance function of this test; its own tolerance: 1e-10 m."""
    distance, surroundings = distance_function(OBSTACLES[kind]), Surroundings(arm, Environment([OBSTACLES[kind]]))
    inside = 0
    for q in configurations(arm, 25):
        gaps = surroundings.at(q, 10.0)
        for number, (start, end, radius) in enumerate(cores_at(arm, q)):
            mine = np.flatnonzero(gaps.capsules == number)
            along = minimize_scalar(
                lambda s, a=start, b=end: distance(a + s * (b - a)),
                bounds=(0.0, 1.0),
                method="bounded",
                options={"xatol": 1e-9},
            ).fun
            found = min(float(along), distance(start), distance(end))
            if found < 1e-3:  # the core is within the obstacle or nearly so
                continue
            ends = [i for i in range(len(gaps)) if np.abs(gaps.core_points[i] - [[start], [end]]).max(axis=2).min() < 1e-12]
            least = min(gaps.values[i] for i in {*mine.tolist(), *ends} if gaps.radii[i] == radius)
            assert least == pytest.approx(found - radius, abs=1e-10)
            inside += int((gaps.features[mine] == 2).any())
        assert np.allclose(
            [distance(x) for x in gaps.core_points if distance(x) > 0], [v for v in gaps.values + gaps.radii if v > 0]
        )
        outside = gaps.values + gaps.radii > 1e-3
        assert np.allclose([distance(x) for x in gaps.obstacle_points[outside]], 0.0, atol=1e-12)
        assert np.allclose(gaps.points - gaps.obstacle_points, gaps.values[:, None] * gaps.normals, atol=1e-13)
    assert inside > 0 or kind == "half_space"


@pytest.mark.parametrize("kind", OBSTACLES)
def test_derivatives_of_gaps_are_slopes_of_gaps_and_of_gradients(arm: sr.SoftModel, kind: str) -> None:
    """Central differences with step 1e-6: 1e-8 of a gap, 1e-6 relative of the second derivative."""
    surroundings, compared = Surroundings(arm, Environment([OBSTACLES[kind]])), 0
    for q in configurations(arm, 12):
        gaps = surroundings.at(q, 10.0)
        smooth = (gaps.features <= 2) & (gaps.values + gaps.radii > 1e-2)
        forces = np.where(smooth, 1.0 + np.arange(len(gaps)), 0.0)
        slopes, changes = np.zeros_like(gaps.jacobian), np.zeros((arm.pinocchio.nv,) * 2)
        for joint, step in enumerate(1e-6 * np.eye(arm.pinocchio.nv)):
            sides = [surroundings.at(q + sign * step, 10.0) for sign in (1.0, -1.0)]
            places = [dict(zip(side.keys, range(len(side)), strict=True)) for side in sides]
            wanted = {key for key, one in zip(gaps.keys, smooth, strict=True) if one}
            if not all(wanted <= place.keys() for place in places):
                break
            rows = [np.array([place.get(key, 0) for key in gaps.keys]) for place in places]
            slopes[:, joint] = (sides[0].values[rows[0]] - sides[1].values[rows[1]]) / 2e-6
            changes[joint] = (forces @ sides[0].jacobian[rows[0]] - forces @ sides[1].jacobian[rows[1]]) / 2e-6
        else:
            assert np.allclose(gaps.jacobian[smooth], slopes[smooth], atol=1e-8)
            assert np.allclose(second_derivative(gaps, forces), changes, atol=1e-6 * max(1.0, np.abs(changes).max()))
            compared += 1
    assert compared >= 6
