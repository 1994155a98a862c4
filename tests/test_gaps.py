"""Gaps between robots and obstacles: values, normals and both derivatives against independent distances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.optimize import minimize, minimize_scalar
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.environment.capsules import robot_capsules
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.environment.obstacles import Obstacle
from softrobots.model.joint_loads import Entries

POSITION, ROTATION = (0.7, 0.1, -0.25), Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix()
OBSTACLES: dict[str, Obstacle] = {
    "half_space": sr.HalfSpace((0.1, -0.2, 1.0), -0.3),
    "sphere": sr.Sphere(0.12, POSITION),
    "box": sr.Box((0.3, 0.2, 0.15), POSITION, ROTATION),
    "cylinder": sr.Cylinder(0.1, 0.2, POSITION, ROTATION),
    "capsule": sr.Capsule(0.1, 0.2, POSITION, ROTATION),
    "mesh": sr.Mesh(np.random.default_rng(3).normal(size=(12, 3)), POSITION, ROTATION, scale=0.1, hull=True),
}


def distance_function(obstacle: Obstacle) -> Callable[[np.ndarray], float]:
    """Distance of a point outside, by projection of the point on the body; written for this test, or trimesh's."""
    transform = obstacle.transform_to_world
    if isinstance(obstacle, sr.Mesh):
        body = trimesh.Trimesh(obstacle.vertices, obstacle.triangles).apply_transform(transform)
        return lambda point: max(0.0, -float(trimesh.proximity.signed_distance(body, point[None])[0]))

    def distance(point: np.ndarray) -> float:
        x, y, z = local = transform[:3, :3].T @ (point - transform[:3, 3])
        if isinstance(obstacle, sr.HalfSpace):
            return float(z)
        if isinstance(obstacle, sr.Sphere):
            return float(np.linalg.norm(local)) - obstacle.radius
        if isinstance(obstacle, sr.Box):
            return float(np.linalg.norm(local - np.clip(local, -0.5 * obstacle.size, 0.5 * obstacle.size)))
        axial = np.clip(z, -0.5 * obstacle.length, 0.5 * obstacle.length)
        if isinstance(obstacle, sr.Capsule):
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


def compare_derivatives(surroundings: Surroundings, q: np.ndarray, margin: float) -> set[int]:
    """Compare with central differences, step 1e-6: 1e-8 of a gap, 1e-6 relative of the second derivative.

    Left out are points within bodies and crossed borders, whose material point another one replaces at each step. Returns the
    features compared: none if a candidate appears or disappears within the step.
    """
    gaps, nv = surroundings.at(q, margin), len(q)
    smooth = (gaps.features <= 2) & (gaps.core_points - gaps.obstacle_points > 0.01).any(axis=1)
    forces = np.where(smooth, 1.0 + np.arange(len(gaps)), 0.0)
    slopes, changes = np.zeros_like(gaps.jacobian), np.zeros((nv, nv))
    for joint, step in enumerate(1e-6 * np.eye(nv)):
        sides = [surroundings.at(q + sign * step, margin + 1e-3) for sign in (1.0, -1.0)]
        places = [dict(zip(side.keys, range(len(side)), strict=True)) for side in sides]
        wanted = {key for key, one in zip(gaps.keys, smooth, strict=True) if one}
        if not all(wanted <= place.keys() for place in places):
            return set()
        rows = [np.array([place.get(key, 0) for key in gaps.keys], dtype=int) for place in places]
        slopes[:, joint] = (sides[0].values[rows[0]] - sides[1].values[rows[1]]) / 2e-6
        changes[joint] = (forces @ sides[0].jacobian[rows[0]] - forces @ sides[1].jacobian[rows[1]]) / 2e-6
    assert np.allclose(gaps.jacobian[smooth], slopes[smooth], atol=1e-8)
    assert np.allclose(second_derivative(gaps, forces), changes, atol=1e-6 * max(1.0, np.abs(changes).max()))
    return set(gaps.features[smooth].tolist())


def second_derivative(gaps: Gaps, forces: np.ndarray) -> np.ndarray:
    nv = gaps.jacobian.shape[1]
    rows, weights = gaps.curvature(forces)
    load = gaps.load(forces)
    assert np.allclose(load.torque, forces @ gaps.jacobian, atol=1e-13 * max(1.0, float(forces.sum())))
    return load.derivative(Entries.of(np.arange(nv), np.arange(nv), nv)) + rows.T @ (weights[:, None] * rows)


@pytest.mark.parametrize("kind", OBSTACLES)
def test_least_gap_of_each_capsule_is_the_distance_by_minimisation(arm: sr.SoftModel, kind: str) -> None:
    """SciPy's minimisation along the core of a distance function of this test; its own tolerance: 1e-10 m."""
    distance, surroundings = distance_function(OBSTACLES[kind]), Surroundings(arm, sr.Environment([OBSTACLES[kind]]))
    inside = 0
    for q in configurations(arm, 25 if kind != "mesh" else 5):
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
    surroundings = Surroundings(arm, sr.Environment([OBSTACLES[kind]]))
    compared = [compare_derivatives(surroundings, q, 10.0) for q in configurations(arm, 12)]
    assert sum(map(bool, compared)) >= 6
    assert 2 in set().union(*compared) or kind == "half_space"


# --- A robot that touches itself


def test_a_folded_robot_is_as_far_from_itself_as_by_minimisation(arm: sr.SoftModel) -> None:
    """Three links: SciPy's minimum over both cores, to its tolerance; derivatives by differences."""
    robot = sr.load_model(sr.InflatableArm(link_lengths=(0.6, 0.6, 0.6)))
    surroundings, random, features = Surroundings(robot, sr.Environment([], self_contact=True)), np.random.default_rng(5), set()
    for _ in range(8):
        q = random.uniform(-1.3, 1.3, robot.pinocchio.nv)
        gaps, cores = surroundings.at(q, 1.0), cores_at(robot, q)
        for row in np.flatnonzero(gaps.features == 2):
            (a, b, one), (c, d, two) = cores[gaps.capsules[row]], cores[gaps.obstacles[row]]
            square = lambda s, a=a, b=b, c=c, d=d: float(((a + s[0] * (b - a) - c - s[1] * (d - c)) ** 2).sum())  # noqa: E731
            found = minimize(square, [0.5, 0.5], bounds=[(0.0, 1.0)] * 2, options={"ftol": 1e-16, "gtol": 1e-13})
            assert gaps.values[row] == pytest.approx(np.sqrt(found.fun) - one - two, abs=1e-9)
            assert surroundings.names[gaps.obstacles[row]] == surroundings.links[gaps.obstacles[row]]
        features |= compare_derivatives(surroundings, q, 1.0)
    assert features == {0, 1, 2} or features == {1, 2}


def test_neighbours_do_not_touch_each_other(arm: sr.SoftModel) -> None:
    """At rest nothing is near contact, though neighbouring capsules overlap; a tube of many sections, too."""
    for robot in (arm, sr.load_model(sr.PccArm()), sr.load_model(sr.HelixTube())):
        surroundings = Surroundings(robot, sr.Environment([], self_contact=True))
        gaps = surroundings.at(robot.configuration(robot.relaxed_motors), 10.0)
        assert gaps.values.min(initial=1.0) > 0.0
        assert np.all(gaps.capsules != gaps.obstacles)
