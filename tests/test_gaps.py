"""Gaps between robots and obstacles: values, normals and both derivatives against independent distances."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from scipy.optimize import minimize, minimize_scalar
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.environment.capsules import robot_capsules
from softrobots.environment.cores import cores_of
from softrobots.environment.gaps import Gaps, Surroundings
from softrobots.environment.nearest_points import core_points
from softrobots.environment.obstacle_fields import obstacle_fields
from softrobots.environment.obstacles import Obstacle
from softrobots.environment.self_contact import self_contact_pairs
from softrobots.environment.single_pairs import single_pair
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
    return gaps.load(forces).derivative(Entries.of(np.arange(nv), np.arange(nv), nv))


@pytest.mark.study
@pytest.mark.parametrize("kind", OBSTACLES)
def test_least_gap_of_each_capsule_is_the_distance_by_minimisation(arm: sr.SoftModel, kind: str) -> None:
    """SciPy's minimisation along the core of a distance function of this test; its own tolerance: 1e-10 m."""
    distance, surroundings = distance_function(OBSTACLES[kind]), Surroundings(arm, sr.Environment([OBSTACLES[kind]]))
    inside = 0
    for q in configurations(arm, 10 if kind != "mesh" else 3):
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


@pytest.mark.study
@pytest.mark.parametrize("kind", OBSTACLES)
def test_derivatives_of_gaps_are_slopes_of_gaps_and_of_gradients(arm: sr.SoftModel, kind: str) -> None:
    surroundings = Surroundings(arm, sr.Environment([OBSTACLES[kind]]))
    compared = [compare_derivatives(surroundings, q, 10.0) for q in configurations(arm, 8)]
    assert sum(map(bool, compared)) >= 4
    assert 2 in set().union(*compared) or kind == "half_space"


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder", "capsule"])
def test_curvatures_are_second_differences_of_the_distance(kind: str) -> None:
    """Beyond faces, edges, corners, sides and rims: steps of 3e-4 m leave 1e-9 of rounding and some 1e-6 of fourth order."""
    distance, ((field, _),) = distance_function(OBSTACLES[kind]), obstacle_fields([OBSTACLES[kind]])
    steps, transform = 3e-4 * np.eye(3), OBSTACLES[kind].transform_to_world
    for local in itertools.product((-0.3, 0.02, 0.3), repeat=3):
        point = transform[:3, :3] @ local + transform[:3, 3]
        if distance(point) < 0.05:
            continue
        slopes = [[distance(point + u + v) - distance(point + u - v) for v in steps] for u in (*steps, *-steps)]
        found, normal = (part[0].tolist() for part in field.at(point[None], np.zeros(1, dtype=int)))
        bends = field.bends(0, tuple(point.tolist()), found, tuple(normal))
        hessian = sum((weight * np.outer(a, a) for a, weight in bends), np.zeros((3, 3)))
        assert np.allclose(hessian, np.subtract(slopes[:3], slopes[3:]) / 3.6e-7, atol=1e-5)


@pytest.mark.parametrize("kind", ["half_space", "sphere", "box", "cylinder", "capsule"])
def test_within_a_margin_are_those_of_all_candidates_that_are_so_near(arm: sr.SoftModel, kind: str) -> None:
    surroundings, seen = Surroundings(arm, sr.Environment([OBSTACLES[kind]])), 0
    for q, margin in zip(configurations(arm, 30), itertools.cycle((0.02, 0.1, 0.3)), strict=False):
        every, near = surroundings.at(q, 10.0), surroundings.at(q, margin)
        assert set(near.keys) == {key for key, gap in zip(every.keys, every.values.tolist(), strict=True) if gap <= margin}
        seen += len(near)
    assert seen > 10


# --- A robot that touches itself


@pytest.mark.study
def test_a_folded_robot_is_as_far_from_itself_as_by_minimisation(arm: sr.SoftModel) -> None:
    """Four links: SciPy's minimum over both cores, to its tolerance; derivatives by differences."""
    robot = sr.load_model(sr.InflatableArm(link_lengths=(0.4,) * 4, stiffness=100.0))
    surroundings, random, features = Surroundings(robot, sr.Environment([], self_contact=True)), np.random.default_rng(0), set()
    links, crossing = [one.link for one in robot_capsules(robot) if one.joint > 0], 0
    for _ in range(8):
        q = random.uniform(-1.3, 1.3, robot.pinocchio.nv)
        gaps, cores = surroundings.at(q, 1.0), cores_at(robot, q)
        for row in np.flatnonzero(gaps.features == 2):
            (a, b, one), (c, d, two) = cores[gaps.capsules[row]], cores[gaps.obstacles[row]]
            square = lambda s, a=a, b=b, c=c, d=d: float(((a + s[0] * (b - a) - c - s[1] * (d - c)) ** 2).sum())  # noqa: E731
            found = minimize(square, [0.5, 0.5], bounds=[(0.0, 1.0)] * 2, options={"ftol": 1e-16, "gtol": 1e-13})
            assert gaps.values[row] == pytest.approx(np.sqrt(found.fun) - one - two, abs=1e-9)
            crossing += int(0.01 < found.x[0] < 0.99 and 0.01 < found.x[1] < 0.99)
            assert surroundings.pair(gaps, row) == (links[gaps.capsules[row]], links[gaps.obstacles[row]], True)
        features |= compare_derivatives(surroundings, q, 1.0)
    assert {1, 2} <= features
    assert crossing > 0


def test_which_capsules_may_touch_each_other() -> None:
    """A straight tube: those that it can bring together by bending to half a circle of its radius."""
    robot, radius = sr.load_model(sr.PccArm(segment_lengths=(0.4, 0.4), elastic_sections=4, radius=0.04)), 0.04
    capsules = [one for one in robot_capsules(robot) if one.joint > 0]
    lengths = [np.linalg.norm(one.end - one.start) for one in capsules]
    count = len(capsules)
    between = {(i, j): sum(lengths[j + 1 : i]) for i in range(count) for j in range(i)}
    assert {one.radius for one in capsules} == {radius}
    pairs = self_contact_pairs(robot, cores_of(robot)).tolist()
    assert {tuple(pair) for pair in pairs} == {pair for pair, way in between.items() if way >= np.pi * radius}
    assert 0 < len(pairs) < len(between)


def test_ends_that_neighbours_share_count_once() -> None:
    """Along a tube over a floor; where the radius changes at a joint, both count, for they touch at different heights."""
    for radii, doubles in ((0.055, 0), ((0.055, 0.04), 1)):
        robot = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.5), radius=radii, stiffness=100.0))
        gaps = Surroundings(robot, sr.Environment([sr.HalfSpace((0, 0, 1), -0.2)])).at(np.zeros(7), 1.0)
        places = np.sort(gaps.core_points[:, 0])
        assert int((np.diff(places) < 1e-9).sum()) == doubles
        assert np.allclose(gaps.values, 0.2 - gaps.radii)


def test_two_faces_that_meet_at_a_corner_alone_are_a_corner() -> None:
    """Above the top of a pyramid the normal is the sum of two opposite faces' normals, and the distance that from a point."""
    pyramid = sr.Mesh([(1, 1, 0), (1, -1, 0), (-1, 1, 0), (-1, -1, 0), (0, 0, 1)])
    ((field, _),) = obstacle_fields(sr.Environment([pyramid]))
    for x, y in ((0.0, 0.0), (0.05, 0.0), (0.0, -0.05)):
        point = np.array([[x, y, 1.5]])
        distance, normal = field.at(point, np.zeros(1, dtype=int))
        bends = field.bends(0, (x, y, 1.5), float(distance[0]), tuple(normal[0].tolist()))
        away = np.array([x, y, 0.5])
        assert distance[0] == pytest.approx(np.linalg.norm(away), abs=1e-15)
        expected = (np.eye(3) - np.outer(normal[0], normal[0])) / distance[0]
        assert np.allclose(sum(weight * np.outer(a, a) for a, weight in bends), expected, atol=1e-12)


def test_a_mesh_of_a_box_is_the_box_on_faces_edges_corners_and_borders(rng: np.random.Generator) -> None:
    """Eight corners, and the same with faces of many triangles, against the closed form of the box in other code."""
    half = np.array([0.3, 0.2, 0.15])
    grid = np.array([x for x in itertools.product(*([np.linspace(-1, 1, 5)] * 3)) if np.abs(x).max() == 1.0])
    box = sr.Box(2.0 * half, POSITION, ROTATION)
    transform = box.transform_to_world
    shares = rng.uniform(-2.0, 2.0, (400, 3))
    on_borders = np.where(rng.random((400, 3)) < 0.4, np.sign(shares), shares)
    local = np.concatenate([shares, on_borders]) * half
    points, ways = local @ transform[:3, :3].T + transform[:3, 3], rng.normal(size=(800, 3))
    outside = (np.abs(local) > (1.0 + 1e-9) * half).any(axis=1)
    which = np.zeros(800, dtype=int)
    ((field, _),) = obstacle_fields(sr.Environment([box]))
    distances, normals, bends = field.along(points, which, ways)
    for corners in (grid[(np.abs(grid) == 1.0).all(axis=1)], grid):
        ((mesh, _),) = obstacle_fields(sr.Environment([sr.Mesh(corners * half, POSITION, ROTATION)]))
        found = mesh.along(points, which, ways)
        assert np.abs(found[0] - distances).max() < 1e-14
        assert np.abs(found[1] - normals)[outside].max() < 1e-12  # inside there may be two nearest faces
        assert np.abs(found[2] - bends)[outside].max() < 1e-9 * np.abs(bends).max()
        for row in range(400, 800, 10):
            given = tuple(points[row]), float(distances[row]), tuple(normals[row])
            one = sum(weight * (ways[row] @ a) ** 2 for a, weight in mesh.bends(0, *given))
            assert one == pytest.approx(found[2][row], rel=1e-9, abs=1e-9)


def test_nearest_points_of_random_polyhedra_are_projections(rng: np.random.Generator) -> None:
    """The foot is on the body, and the body is beyond the plane there: that is the nearest point of a convex body."""
    for count in (4, 12, 300):
        corners = rng.normal(size=(count, 3))
        corners /= np.linalg.norm(corners, axis=1)[:, None] if count == 300 else 1.0
        hull = ConvexHull(corners + 5.0)  # away from its own origin
        ((field, _),) = obstacle_fields(sr.Environment([sr.Mesh(corners + 5.0, hull=True)]))
        points = rng.normal(size=(500, 3)) * 2.0 + 5.0
        distances, normals = field.at(points, np.zeros(500, dtype=int))
        depths = (points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        assert np.abs(distances - depths)[depths < 0.0].max(initial=0.0) < 1e-13
        feet, out = points - distances[:, None] * normals, depths > 0.0
        assert (feet @ hull.equations[:, :3].T + hull.equations[:, 3])[out].max() < 1e-13
        beyond = np.vecdot(feet, normals)[:, None] - normals @ (corners.T + 5.0)
        assert beyond[out].min() > -1e-12  # a border counts 1e-9 of the distance as on it, across the normal


@pytest.mark.study
def test_neighbours_do_not_touch_each_other(arm: sr.SoftModel) -> None:
    """At rest nothing is near contact, though neighbouring capsules overlap; a tube of many sections, too."""
    for robot in (arm, sr.load_model(sr.PccArm()), sr.load_model(sr.HelixTube())):
        surroundings = Surroundings(robot, sr.Environment([], self_contact=True))
        gaps = surroundings.at(robot.configuration(robot.relaxed_motors), 10.0)
        assert gaps.values.min(initial=1.0) > 0.0
        assert np.all(gaps.capsules != gaps.obstacles)


# --- Against Coal, and special places


def coal_shape(obstacle: Obstacle) -> tuple[coal.CollisionGeometry, coal.Transform3s]:
    transform = obstacle.transform_to_world
    frame = coal.Transform3s(transform[:3, :3], transform[:3, 3])
    if isinstance(obstacle, sr.HalfSpace):
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0), frame
    if isinstance(obstacle, sr.Sphere):
        return coal.Sphere(obstacle.radius), frame
    if isinstance(obstacle, sr.Box):
        return coal.Box(*obstacle.size), frame
    return (coal.Cylinder if isinstance(obstacle, sr.Cylinder) else coal.Capsule)(obstacle.radius, obstacle.length), frame


@pytest.mark.parametrize("kind", ["half_space", "sphere", "box", "cylinder", "capsule"])
def test_gaps_are_those_of_coal(kind: str) -> None:
    """A section robot, whose capsules are short: Coal's distances at a tolerance of 1e-12, in metres 3e-11 for cylinders."""
    robot = sr.load_model(sr.PccArm())
    obstacle = OBSTACLES[kind].moved(pin.SE3(np.eye(3), np.array([-0.5, -0.1, 0.6])))
    surroundings, (shape, frame) = Surroundings(robot, sr.Environment([obstacle])), coal_shape(obstacle)
    request, compared = coal.DistanceRequest(), 0
    request.gjk_tolerance = 1e-12
    for q in configurations(robot, 6):
        gaps = surroundings.at(0.5 * q, 10.0)
        for number, (start, end, radius) in enumerate(cores_at(robot, 0.5 * q)):
            along = (end - start) / np.linalg.norm(end - start)
            across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
            across /= np.linalg.norm(across)
            axes = coal.Transform3s(np.column_stack([across, np.cross(along, across), along]), 0.5 * (start + end))
            result = coal.DistanceResult()
            found = coal.distance(coal.Capsule(radius, np.linalg.norm(end - start)), axes, shape, frame, request, result)
            ends = np.linalg.norm(gaps.core_points[:, None] - [start, end], axis=2).min(axis=1) < 1e-12
            if found > 0.0:
                assert gaps.values[(gaps.capsules == number) | ends].min() == pytest.approx(found, abs=3e-11)
                compared += 1
    assert compared > 20


def one_link(length: float = 1.0) -> sr.SoftModel:
    """One link of radius 0.05 m on two motors."""
    return sr.load_model(sr.InflatableArm(link_lengths=(length,), radius=0.05, stiffness=100.0))


def lying(obstacle: Obstacle, tilt: float = 0.0) -> Gaps:
    """The arm straight along x, whose base is raised to `z = 0.05` above an obstacle's highest place at `z = 0`."""
    robot = one_link()
    return Surroundings(robot, sr.Environment([obstacle.moved(pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.05])))])).at(
        robot.configuration([0.0, tilt], [0.0, 0.0]), 0.01
    )


TURNED = Rotation.from_euler("x", 90, degrees=True).as_matrix()
FLAT: dict[str, tuple[Obstacle, list[float]]] = {
    "over both edges of a block": (sr.Box((0.2, 0.3, 0.2), (0.5, 0, -0.1)), [0.4, 0.6]),
    "over one edge": (sr.Box((1.0, 0.3, 0.2), (1.1, 0, -0.1)), [0.6, 1.0]),
    "on a mesh": (
        sr.Mesh(np.array(list(itertools.product((0.4, 0.6), (-0.1, 0.2), (-0.2, 0.0))))),
        [0.4, 0.6],
    ),
    "on the end of a cylinder": (sr.Cylinder(0.2, 0.3, (0.5, 0.0, -0.15)), [0.3, 0.7]),
    "along a cylinder": (
        sr.Cylinder(0.1, 0.3, (0.5, 0.0, -0.1), Rotation.from_euler("y", 90, degrees=True).as_matrix()),
        [0.35, 0.65],
    ),
    "along a capsule": (
        sr.Capsule(0.1, 0.3, (0.5, 0.0, -0.1), Rotation.from_euler("y", 90, degrees=True).as_matrix()),
        [0.35, 0.65],
    ),
    "along an edge": (
        sr.Box((0.3, 0.1, 0.1), (0.5, 0.0, -0.1 / np.sqrt(2.0)), Rotation.from_euler("x", 45, degrees=True).as_matrix()),
        [0.35, 0.65],
    ),
    "across a cylinder": (sr.Cylinder(0.1, 0.3, (0.5, 0.0, -0.1), TURNED), [0.5]),
    "on a ball": (sr.Sphere(0.1, (0.5, 0.0, -0.1)), [0.5]),
}


@pytest.mark.parametrize("case", FLAT)
def test_a_link_that_lies_flat_rests_where_it_leaves_the_obstacle(case: str) -> None:
    """By hand: contacts at these places along x. Tilted by 1e-7 rad either way, the outer places are the same to 1e-6 m."""
    obstacle, places = FLAT[case]
    for tilt in (0.0, 1e-7, -1e-7):
        gaps = lying(obstacle, tilt)
        touching = np.abs(gaps.values) < 2e-7
        found = np.sort(gaps.points[touching & (gaps.points[:, 0] > 0.1), 0])
        assert [found[0], found[-1]] == pytest.approx([places[0], places[-1]], abs=2e-6)
        assert np.allclose(gaps.normals[touching], [0, 0, 1], atol=2e-6)
        ways = np.abs(found[:, None] - found)[~np.eye(len(found), dtype=bool)]
        assert ways.min(initial=1.0) > 1e-10  # no contact twice


@pytest.mark.parametrize("kind", OBSTACLES)
def test_a_core_within_an_obstacle_is_pushed_out(kind: str) -> None:
    """Deeper is more negative; moving along the normal by the depth frees the point (of the core)."""
    obstacle = OBSTACLES[kind]
    ((field, _),) = obstacle_fields(sr.Environment([obstacle]))
    centre = obstacle.transform_to_world[:3, 3]
    points = (
        centre
        + np.random.default_rng(2).uniform(-0.05, 0.05, (50, 3))
        - (0.1 * np.array([0, 0, 1]) if kind == "half_space" else 0.0)
    )
    which = np.zeros(len(points), dtype=int)
    depths, normals = field.at(points, which)
    assert np.isfinite(normals).all()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    inside = depths < 0.0
    assert inside.sum() > 20
    assert np.allclose(field.at((points - depths[:, None] * normals)[inside], which[inside])[0], 0.0, atol=1e-12)


def test_material_points_follow_a_moving_obstacle(arm: sr.SoftModel) -> None:
    """A turning and rising box: the slip of its surface by hand."""
    environment = sr.Environment([sr.Box((0.3, 0.2, 0.15), POSITION, ROTATION, pose=rising)])
    q = np.array([0.1, -0.2, 0.05, 0.1, 0.3, 0.0, -0.1])
    gaps = Surroundings(arm, environment.at(0.4)).at(q, 10.0)
    there = Surroundings(arm, environment.at(0.7)).at(q + 0.1, 10.0)
    on_robot, on_obstacle = there.places_of(gaps.material(np.arange(len(gaps))))
    move = rising(0.7) * rising(0.4).inverse()
    assert np.allclose(on_obstacle, [move.act(point) for point in gaps.obstacle_points], atol=1e-12)
    data = arm.pinocchio.createData()
    joints = [[one.joint for one in robot_capsules(arm) if one.joint > 0][number] for number in gaps.capsules]
    local = []
    pin.forwardKinematics(arm.pinocchio, data, q)
    local = [data.oMi[joint].actInv(point) for joint, point in zip(joints, gaps.points, strict=True)]
    pin.forwardKinematics(arm.pinocchio, data, q + 0.1)
    assert np.allclose(on_robot, [data.oMi[joint].act(point) for joint, point in zip(joints, local, strict=True)], atol=1e-12)


def rising(parameter: float) -> pin.SE3:
    return pin.SE3(Rotation.from_rotvec([0.2 * parameter, 0.0, parameter]).as_matrix(), np.array([0.0, 0.1, 0.3 * parameter]))


def test_forces_of_any_direction_on_the_surface_are_a_load(arm: sr.SoftModel) -> None:
    """Torque and its derivative by Pinocchio's Jacobian of a frame at the material point, central differences."""
    surroundings = Surroundings(arm, sr.Environment([OBSTACLES["box"]]))
    q, nv = np.array([0.1, -0.2, 0.05, 0.1, 0.3, 0.0, -0.1]), 7
    gaps = surroundings.at(q, 10.0)
    forces = np.random.default_rng(4).normal(size=(len(gaps), 3))
    points, joints = gaps.material(np.arange(len(gaps))).on_robot, gaps.capsules
    moving = [one for one in robot_capsules(arm) if one.joint > 0]
    model, frames = arm.pinocchio.copy(), []
    for row, (point, number) in enumerate(zip(points, joints, strict=True)):
        placement = pin.SE3(np.eye(3), point)
        frames.append(model.addFrame(pin.Frame(f"touch_{row}", moving[number].joint, 0, placement, pin.FrameType.OP_FRAME)))
    data = model.createData()

    def torque(at: np.ndarray) -> np.ndarray:
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return sum(
            pin.computeFrameJacobian(model, data, at, frame, axes)[:3].T @ f for frame, f in zip(frames, forces, strict=True)
        )

    load = gaps.load(forces)
    assert np.allclose(load.torque, torque(q), atol=1e-12)
    slopes = np.array([(torque(q + h) - torque(q - h)) / 2e-6 for h in 1e-6 * np.eye(nv)])
    assert np.allclose(load.derivative(Entries.of(np.arange(nv), np.arange(nv), nv)), slopes, atol=1e-8)


def test_a_robot_of_meshes_alone_says_what_it_needs(ur5: Path) -> None:
    robot = sr.load_model(ur5, springs={}, tip="tool0")
    with pytest.raises(sr.DescriptionError, match="softrobots:capsule"):
        Surroundings(robot, sr.Environment([sr.Sphere(0.1)]))


def test_an_environment_without_obstacles_has_no_gaps(arm: sr.SoftModel) -> None:
    gaps = Surroundings(arm, sr.Environment()).at(np.zeros(7), 10.0)
    assert len(gaps) == 0
    assert gaps.keys == ()
    assert gaps.jacobian.shape == (0, 7)
    assert not gaps.load(np.zeros(0)).torque.any()


@pytest.mark.parametrize("kind", ["sphere", "box", "cylinder", "capsule"])
def test_no_gap_between_the_ends_is_missed_at_special_places(kind: str) -> None:
    """Cores on a coarse grid, so that they are parallel to faces and axes, tangent and through corners: 401 points of each."""
    shape = {
        "sphere": sr.Sphere(0.5),
        "box": sr.Box((1, 0.5, 0.75)),
        "cylinder": sr.Cylinder(0.5, 1),
        "capsule": sr.Capsule(0.25, 1),
    }[kind]
    ((field, _),) = obstacle_fields(sr.Environment([shape]))
    starts, ends = 0.25 * np.random.default_rng(8).integers(-4, 5, (2, 800, 3))
    tangent = np.array([[0.5, -0.75, -0.5], [0.5, 0.75, -0.5]])
    different = np.any(starts != ends, axis=1)
    starts, ends = np.vstack([starts[different], tangent[0]]), np.vstack([ends[different], tangent[1]])
    which = np.zeros(len(starts), dtype=int)
    found = core_points(field, which, starts, ends - starts, np.full(len(starts), 9.0), 1e-9)
    least = np.minimum(field.at(starts, which)[0], field.at(ends, which)[0])
    np.minimum.at(least, found.pairs, found.distances)
    shares = np.linspace(0.0, 1.0, 401)[:, None, None]
    points = (starts + shares * (ends - starts)).reshape(-1, 3)
    every = field.at(points, np.zeros(len(points), dtype=int))[0]
    assert (field.at_least(points)[:, 0] - every).max() < 1e-7  # on an axis a difference of squares is left
    sampled = every.reshape(401, -1).min(axis=0)
    body, plain = field.single(0), []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        among = single_pair(body, body.seen(start), body.seen(end), math.dist(start, end), 9.0, 1e-9)
        plain.append(min(one.distance for one in among))
    for one in (least, np.array(plain)):
        assert (one - sampled).max() < 1e-12
        assert (sampled - one).max() < 5e-3
