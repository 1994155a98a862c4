"""Equilibria in contact without friction: against SciPy, by hand, and by enumeration of active sets."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve, minimize, minimize_scalar
from scipy.spatial.transform import Rotation

import softrobots as sr
from softrobots.environment.capsules import robot_capsules
from softrobots.environment.environment import Environment
from softrobots.environment.obstacles import Box, Cylinder, HalfSpace, Sphere
from softrobots.statics.elastic_state import ElasticProblem
from studies.soak import contact_cases, contact_running
from tests.support.law_robots import PUSHES, directions, model
from tests.support.oracles import arm_energy
from tests.support.planar_robots import joint, robot

MOTORS, FORCE = (0.3, 0.6, -0.8), np.array([0.0, 30.0, -80.0])
WALLS = {
    "floor": [HalfSpace((0, 0, 1), -0.1)],
    "sphere": [Sphere(0.3, (0.93, 0.32, -0.11))],
    "corner": [HalfSpace((0, 0, 1), -0.1), HalfSpace((0.2, -1, 0.1), -0.55)],
    "floor and sphere": [HalfSpace((0.3, 0, 1), -0.08), Sphere(0.2, (0.65, 0.45, 0.1))],
}


def distances(model: sr.SoftModel, obstacles: list, q: np.ndarray) -> np.ndarray:
    """Distance of each capsule of a robot from half-spaces and spheres, by elementary geometry."""
    data = model.pinocchio.createData()
    pin.forwardKinematics(model.pinocchio, data, q)
    found = []
    for one in robot_capsules(model):
        a, b = data.oMi[one.joint].act(one.start), data.oMi[one.joint].act(one.end)
        for obstacle in obstacles:
            if isinstance(obstacle, HalfSpace):
                normal = np.array(obstacle.normal) / np.linalg.norm(obstacle.normal)
                found.append(min(normal @ a, normal @ b) - obstacle.offset - one.radius)
            else:
                share = np.clip((np.array(obstacle.position) - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
                found.append(np.linalg.norm(a + share * (b - a) - obstacle.position) - obstacle.radius - one.radius)
    return np.array(found)


@pytest.mark.parametrize("obstacles", WALLS.values(), ids=WALLS)
def test_energy_is_minimal_by_scipy_among_obstacles(arm: sr.SoftModel, obstacles: list) -> None:
    """SLSQP on the energy of Table 2 and the distances of the test; it stops at 1e-12 J, so about sqrt(2e-12 / 170) rad."""
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, environment=Environment(obstacles))

    def gaps(y: np.ndarray) -> np.ndarray:
        return distances(arm, obstacles, arm.configuration(MOTORS, y))

    best = minimize(
        lambda y: arm_energy(np.array(MOTORS), y, FORCE, 172.71),
        np.zeros(4),
        method="SLSQP",
        constraints={"type": "ineq", "fun": gaps},
        options={"ftol": 1e-12, "maxiter": 200},
    )
    assert found.contacts
    assert np.abs(found.q_springs - best.x).max() < 1e-6
    assert gaps(found.q_springs).min() > -1e-12
    assert found.stable
    assert all(contact.normal_force > 0.0 and contact.strict for contact in found.contacts)


def test_torques_balance_with_contact_forces_at_their_points(arm: sr.SoftModel) -> None:
    """Springs and motors carry the load and the contact forces, each by the Jacobian of its point."""
    environment = Environment(WALLS["floor and sphere"])
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, gravity=sr.EARTH_GRAVITY, environment=environment)
    model, data = arm.pinocchio, arm.pinocchio.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    gravity = model.copy()
    gravity.gravity.linear = np.array(sr.EARTH_GRAVITY)
    torque = -pin.computeGeneralizedGravity(gravity, gravity.createData(), found.q)
    tip = pin.computeFrameJacobian(model, data, found.q, model.getFrameId("tip"), axes)
    torque += tip[:3].T @ FORCE
    for contact in found.contacts:
        frame = model.getFrameId(contact.link)
        jacobian = pin.computeFrameJacobian(model, data, found.q, frame, axes)
        lever = contact.point - pin.updateFramePlacement(model, data, frame).translation
        torque += jacobian[:3].T @ contact.force + jacobian[3:].T @ np.cross(lever, contact.force)
    rounding = 1e-12 * np.linalg.norm(FORCE) * 1.2
    assert len(found.contacts) == 2
    assert np.abs(torque[arm.spring_indices] - found.spring_torques).max() < found.tolerance
    assert np.abs(torque[arm.motor_indices] - found.motor_torques).max() < rounding + found.tolerance


# --- By hand

LINK, HINGE, STIFFNESS, BODY = 0.6, 0.03, 172.71, 0.055  # of the paper's arm, and the radius of its capsules


def test_a_stretched_arm_on_a_ceiling_is_two_springs_and_one_multiplier(arm: sr.SoftModel) -> None:
    """The end of the stretched arm is pushed up against a ceiling: moments about both hinges, and the height of the end.

    `k a1 = f x - R x`, with the lever arms of the end about each hinge; the bent links stay in the plane of the push.
    """
    ceiling, push = 0.06 + BODY, np.array([5.0, 0.0, 60.0])

    def equations(unknown: np.ndarray) -> list[float]:
        first, second, reaction = unknown
        along = (LINK - HINGE) * np.array([np.cos(first), np.sin(first)])
        along += HINGE * np.array([np.cos(first), np.sin(first)])
        last = (LINK - HINGE) * np.array([np.cos(first + second), np.sin(first + second)])
        end = along + last
        up = push[2] - reaction
        moments = [up * arm_[0] - push[0] * arm_[1] for arm_ in (end, last)]
        return [STIFFNESS * first - moments[0], STIFFNESS * second - moments[1], end[1] + BODY - ceiling]

    first, second, reaction = fsolve(equations, [0.05, 0.05, 30.0], xtol=1e-12)
    found = sr.solve_equilibrium(arm, (0, 0, 0), push, environment=Environment([HalfSpace((0, 0, -1), -ceiling)]))
    (contact,) = found.contacts
    assert np.allclose(found.q_springs, [0.0, first, 0.0, second], atol=1e-10)
    assert contact.normal_force == pytest.approx(reaction, rel=1e-10)
    assert np.allclose(contact.force, [0.0, 0.0, -reaction])
    assert np.allclose(contact.point, [*found.tip_position[:2], ceiling], atol=1e-12)
    assert np.allclose(contact.point, contact.obstacle_point, atol=1e-12)
    assert (contact.link, contact.obstacle, contact.status) == ("link_2", "half_space_1", "pressed")
    assert found.eigenvalues.shape == (3,)  # four springs, less one pressed contact
    assert found.stability.kind == "stable"


@pytest.fixture(scope="module")
def one_link() -> sr.SoftModel:
    """One link on two springs."""
    return sr.load_model(sr.InflatableArm(link_lengths=(LINK,), hinge_offset=HINGE, stiffness=STIFFNESS))


def end_of(springs: np.ndarray) -> np.ndarray:
    """End of one link: turned sideways about z, then up about -y of the turned link."""
    side, up = springs
    along = np.array([np.cos(side) * np.cos(up), np.sin(side) * np.cos(up), np.sin(up)])
    return np.array([HINGE, 0.0, 0.0]) + (LINK - HINGE) * along


def slopes_of(springs: np.ndarray) -> np.ndarray:
    """Derivative of `end_of`."""
    side, up = springs
    first = np.array([-np.sin(side) * np.cos(up), np.cos(side) * np.cos(up), 0.0])
    second = np.array([-np.cos(side) * np.sin(up), -np.sin(side) * np.sin(up), np.cos(up)])
    return (LINK - HINGE) * np.stack([first, second], axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_spring_pairs_are_one_of_all_active_sets(one_link: sr.SoftModel, seed: int) -> None:
    """All subsets of eight walls around the end of a link, each solved as equations; the answer is the lowest that holds.

    Three walls or more do not meet in the two springs; their subsets have no solution.
    """
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(8, 3)) * [0.3, 1.0, 1.0]
    normals[:, 0] = -np.abs(normals[:, 0])  # the end is nearer to each wall than the base
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = normals @ end_of(np.zeros(2)) - BODY - rng.uniform(0.01, 0.15, 8)
    force = rng.uniform(-120.0, 120.0, 3)
    walls = [HalfSpace(tuple(normal), offset) for normal, offset in zip(normals, offsets, strict=True)]

    def energy(y: np.ndarray) -> float:
        return 0.5 * STIFFNESS * float(y @ y) - float(force @ end_of(y))

    candidates = []
    for held in [held for size in range(3) for held in combinations(range(8), size)]:
        n, d = normals[list(held)], offsets[list(held)]

        def equations(x: np.ndarray, n: np.ndarray = n, d: np.ndarray = d) -> np.ndarray:
            y, pressed = x[:2], x[2:]
            pull = STIFFNESS * y - slopes_of(y).T @ (force + pressed @ n)
            return np.concatenate([pull / STIFFNESS, n @ end_of(y) - d - BODY])

        x, _, flag, _ = fsolve(equations, np.zeros(2 + len(held)), xtol=1e-13, full_output=True)
        gaps = normals @ end_of(x[:2]) - offsets - BODY
        if flag == 1 and np.abs(equations(x)).max() < 1e-10 and gaps.min() > -1e-9 and x[2:].min(initial=0.0) > -1e-9:
            candidates.append((energy(x[:2]), held, x))
    best = min(candidates, key=lambda one: one[0])
    found = sr.solve_equilibrium(one_link, (0, 0), force, environment=Environment(walls))
    pressed = {contact.obstacle: contact.normal_force for contact in found.contacts if contact.strict}
    assert found.stable
    assert np.abs(found.q_springs - best[2][:2]).max() < 1e-8
    assert pressed == pytest.approx({f"half_space_{1 + i}": f for i, f in zip(best[1], best[2][2:], strict=True)}, rel=1e-7)


def test_balls_on_six_springs_are_one_of_all_256_active_sets() -> None:
    """Two balls on slides among four walls: a convex quadratic programme, whose one solution is found by trying every set.

    Sets that hold have two to four contacts here; gaps and torques are linear, so that only rounding is left.
    """
    radius, names = 0.1, ("a", "b", "one", "c", "d", "tip")
    axes = ("1 0 0", "0 1 0", "0 0 1")
    places = ('xyz="1 0 1"', "", 'xyz="0 0 -1"', 'xyz="1 0 0"', "", "")  # no ball is where the robot stands
    stiffness = np.array([100.0, 60.0, 150.0, 80.0, 120.0, 50.0])
    joints = [
        joint(f"slide_{i}", "prismatic", parent, child, axes[i % 3], k, places[i])
        for i, (parent, child, k) in enumerate(zip(("base", *names[:-1]), names, stiffness, strict=True))
    ]
    balls = robot(("base", *names), joints, [(name, "0 0 0", "0 0 0", radius) for name in ("one", "tip")])
    jacobian = np.stack([np.hstack([np.eye(3), np.zeros((3, 3))]), np.hstack([np.eye(3), np.eye(3)])])  # of the centres
    rest = np.array([[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    held_sizes = set()
    for seed in range(12):
        rng = np.random.default_rng(seed)
        normals = rng.normal(size=(4, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        offsets = (rest @ normals.T).min(axis=0) - radius - rng.uniform(0.01, 0.1, 4)
        forces = rng.uniform(-40.0, 40.0, (2, 3)) - 15.0 * normals.sum(axis=0)
        rows = np.concatenate([normals @ one for one in jacobian])
        gaps = (rest @ normals.T - offsets - radius).ravel()
        pull = np.einsum("bij,bi->j", jacobian, forces)
        held, springs, pressed = min(
            found for found in (solved(stiffness, pull, rows, gaps, one) for one in subsets(8)) if found is not None
        )
        held_sizes.add(len(held))
        walls = [HalfSpace(tuple(normal), offset) for normal, offset in zip(normals, offsets, strict=True)]
        loads = {name: (*force, 0, 0, 0) for name, force in zip(("one", "tip"), forces, strict=True)}
        answer = sr.solve_equilibrium(balls, (), wrench=loads, environment=Environment(walls))
        assert answer.stable
        assert answer.q_springs == pytest.approx(springs, abs=1e-9)
        expected = {(("one", "tip")[i // 4], f"half_space_{1 + i % 4}"): f for i, f in zip(held, pressed, strict=True)}
        assert {(one.link, one.obstacle): one.normal_force for one in answer.contacts if one.strict} == pytest.approx(
            expected, rel=1e-7
        )
    assert held_sizes >= {3, 4}


def subsets(count: int) -> list[tuple[int, ...]]:
    """All subsets of the first numbers."""
    return [held for size in range(count + 1) for held in combinations(range(count), size)]


def solved(
    stiffness: np.ndarray, pull: np.ndarray, rows: np.ndarray, gaps: np.ndarray, held: tuple[int, ...]
) -> tuple[tuple[int, ...], list[float], list[float]] | None:
    """Springs and forces if exactly the contacts `held` press; None if that does not hold."""
    chosen, n = rows[list(held)], len(stiffness)
    matrix = np.block([[np.diag(stiffness), -chosen.T], [chosen, np.zeros((len(held),) * 2)]])
    if np.linalg.matrix_rank(chosen) < len(held):
        return None
    found = np.linalg.solve(matrix, np.concatenate([pull, -gaps[list(held)]]))
    holds = (gaps + rows @ found[:n]).min() > -1e-12 and found[n:].min(initial=0.0) >= 0.0
    return (held, found[:n].tolist(), found[n:].tolist()) if holds else None


@pytest.mark.parametrize("radius", [1e4, 1e5, 1e6])
def test_a_wall_that_is_a_large_ball_is_certified_as_the_wall(arm: sr.SoftModel, radius: float) -> None:
    """Rounding of gaps, 1e-16 of the distance of the centre, says nothing of stability; gaps differ by `l^2 / (2 R)`."""
    motors, force = (0, 0.9, -0.4), (0, 0, -20)
    wall = sr.solve_equilibrium(arm, motors, force, environment=Environment([HalfSpace((-1, 0, 0), -1.0)]))
    ball = sr.solve_equilibrium(arm, motors, force, environment=Environment([Sphere(radius, (radius + 1, 0, 0.6))]))
    assert wall.stable
    assert ball.stable
    assert ball.stability.kind == "stable"
    assert ball.contacts[0].normal_force == pytest.approx(wall.contacts[0].normal_force, rel=10.0 / radius)


def test_before_the_tip_a_gap_is_smaller_by_the_radius_of_the_cap(arm: sr.SoftModel) -> None:
    """A wall 0.3 m before the flat end of the straight arm, and one 0.3 m beside its axis; `capsule_error` has neither."""
    found = sr.solve_equilibrium(arm, (0, 0, 0))
    before, beside = HalfSpace((-1, 0, 0), -found.tip_position[0] - 0.3), HalfSpace((0, 0, 1), -0.3)
    assert found.clearance(Environment([before])).distance == pytest.approx(0.3 - BODY, abs=1e-12)
    assert found.clearance(Environment([beside])).distance == pytest.approx(0.3 - BODY, abs=1e-12)
    assert sr.capsule_error(arm, (0, 0, 0)).shape == (0,)


def test_three_walls_on_one_end_share_the_load_by_least_norm(one_link: sr.SoftModel) -> None:
    """Three walls through one point and two springs: forces are not unique, and those of least norm are told as such."""
    end, push = end_of(np.zeros(2)), np.array([0.0, 40.0, 70.0])
    normals = np.array([[-0.6, -0.8, 0.0], [-0.6, 0.0, -0.8], [-0.28, -0.576, -0.768]])
    walls = [HalfSpace(tuple(normal), normal @ end - BODY) for normal in normals]
    found = sr.solve_equilibrium(one_link, (0, 0), push, environment=Environment(walls))
    forces = [contact.normal_force for contact in found.contacts]
    assert np.allclose(found.q_springs, 0.0, atol=1e-12)
    slopes = slopes_of(np.zeros(2))
    assert np.allclose(forces, np.linalg.pinv(-(normals @ slopes).T) @ (slopes.T @ push), rtol=1e-9)
    assert not found.contact_forces_unique
    assert found.stable
    assert len(found.eigenvalues) == 0


def test_a_touch_without_force_is_told(one_link: sr.SoftModel) -> None:
    """A wall at the relaxed end is touched, not pressed; it does not count in the certificate."""
    wall = Environment([HalfSpace((0, 0, 1), end_of(np.zeros(2))[2] - BODY)])
    found = sr.solve_equilibrium(one_link, (0, 0), environment=wall)
    (contact,) = [one for one in found.contacts if one.gap <= 1e-12 and one.normal_force == 0.0][:1]
    assert (contact.status, contact.strict, found.stable) == ("touching", False, True)
    assert found.contact_gradients.shape == (0, 2)


@pytest.mark.parametrize("push", [40.0, 120.0])
def test_an_arm_slides_off_the_ridge_of_a_ball(one_link: sr.SoftModel, push: float) -> None:
    """Pushed down on a small ball straight below: on its top the link is at a saddle if `R l^2 / d > k`, and leaves it.

    `R` is the reaction, `l` its lever, `d` the distance of the core from the centre of the ball. Below that the link stays.
    """
    lever, ball, sag = 0.4, 0.02, 1e-3
    centre = (HINGE + lever, 0.0, -BODY - ball + sag)
    reaction = (push * (LINK - HINGE) + STIFFNESS * sag / lever) / lever
    stays = reaction * lever**2 / (ball + BODY) < STIFFNESS
    found = sr.solve_equilibrium(one_link, (0, 0), (0, 0, -push), environment=Environment([Sphere(ball, centre)]))
    assert stays == (push < 100.0)
    assert stays == bool(found.contacts and abs(found.q_springs[0]) < 1e-9)
    assert stays or found.q_springs[1] < -0.1
    assert found.stable
    if stays:
        assert found.contacts[0].normal_force == pytest.approx(reaction, rel=1e-3)  # the point is 0.2 mm off the top


def test_both_ends_of_a_link_lie_on_a_floor(arm: sr.SoftModel) -> None:
    """A link that lies flat on a floor presses both ends of its capsule; both forces follow from force and moment."""
    floor = Environment([HalfSpace((0, 0, 1), -BODY)])
    found = sr.solve_equilibrium(arm, (0, 0, 0), gravity=sr.EARTH_GRAVITY, environment=floor)
    assert np.allclose(found.q_springs, 0.0, atol=1e-12)
    assert found.stable
    assert all(abs(contact.gap) < 1e-12 for contact in found.contacts)
    free = sr.solve_equilibrium(arm, (0, 0, 0), gravity=sr.EARTH_GRAVITY)
    assert free.tip_position[2] < -1e-3


def box_distance(size: np.ndarray, centre: np.ndarray, rotation: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Distance of a segment from a box: least over the segment of a convex function."""

    def distance(share: float) -> float:
        local = rotation.T @ (a + share * (b - a) - centre)
        return float(np.linalg.norm(local - np.clip(local, -0.5 * size, 0.5 * size)))

    inside = minimize_scalar(distance, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-10}).fun
    return min(inside, distance(0.0), distance(1.0))


UPRIGHT = Rotation.align_vectors([[0, 0, 1]], [[1, 1, 1]])[0].as_matrix()  # stands on a corner


@pytest.mark.parametrize(
    ("place", "rotation", "push"),
    [
        ((0.45, 0.16, -0.1), np.eye(3), (0, 20, -120)),  # an edge, from the side
        ((0.55, -0.12, -0.12), np.eye(3), (0, 20, -120)),  # an edge and the end of the link
        ((0.66, 0.1, -0.2), np.eye(3), (0, 20, -120)),  # the end of the link on a face
        ((0.45, 0.003, -0.24), UPRIGHT, (0, 1, -30)),  # a corner
    ],
)
def test_links_lean_on_faces_edges_and_corners_of_a_box(
    one_link: sr.SoftModel, place: tuple, rotation: np.ndarray, push: tuple
) -> None:
    """SLSQP on the closed energy and the distance of the test; it differentiates by differences."""
    size = np.array([0.2, 0.2, 0.2])
    found = sr.solve_equilibrium(one_link, (0, 0), push, environment=Environment([Box(tuple(size), place, rotation)]))

    def gap(y: np.ndarray) -> float:
        return box_distance(size, np.array(place), rotation, np.array([HINGE, 0.0, 0.0]), end_of(y)) - BODY

    best = minimize(
        lambda y: 0.5 * STIFFNESS * float(y @ y) - float(push @ end_of(y)),
        found.q_springs + 1e-2,
        method="SLSQP",
        constraints={"type": "ineq", "fun": gap},
        options={"ftol": 1e-13, "maxiter": 200},
    )
    assert [contact.strict for contact in found.contacts] == [True]
    assert found.stable
    assert np.abs(found.q_springs - best.x).max() < 1e-5
    assert abs(gap(found.q_springs)) < 1e-9


def test_work_of_a_growing_force_is_stored_while_it_slides(arm: sr.SoftModel) -> None:
    """On frictionless obstacles the work of a force from 0.5 to 1 times its size is the change of the springs' energy.

    Gauss and Legendre on eight forces, at each of which the same contacts are pressed.
    """
    environment = Environment(WALLS["sphere"])

    def at(share: float) -> sr.Equilibrium:
        return sr.solve_equilibrium(arm, MOTORS, share * FORCE, environment=environment)

    ends = [at(0.5), at(1.0)]
    places, weights = np.polynomial.legendre.leggauss(8)
    between = [at(0.75 + 0.25 * place) for place in places]
    assert {len(one.contacts) for one in (*ends, *between)} == {1}
    moved = sum(0.25 * weight * FORCE @ one.tip_position for weight, one in zip(weights, between, strict=True))
    work = FORCE @ ends[1].tip_position - 0.5 * FORCE @ ends[0].tip_position - moved
    stored = [0.5 * STIFFNESS * one.q_springs @ one.q_springs for one in ends]
    assert work == pytest.approx(stored[1] - stored[0], rel=1e-9)


def test_a_start_deep_inside_finds_its_way_out(one_link: sr.SoftModel) -> None:
    """Relaxed, the link goes through a slab that ends 0.12 m and 0.32 m beside it: the way out is aside."""
    slab = Box((0.2, 0.44, 0.6), (0.45, -0.1, 0.0))
    found = sr.solve_equilibrium(one_link, (0, 0), (0, -30, 0), environment=Environment([slab]))
    (contact,) = found.contacts
    assert found.stable
    assert abs(found.q_springs[0]) > 0.3  # 0.12 m and the radius, on a lever of 0.5 m; more on the other side
    assert contact.normal_force > 0.0
    assert (
        abs(box_distance(slab.size, slab.position, np.eye(3), np.array([HINGE, 0, 0]), end_of(found.q_springs)) - BODY) < 1e-9
    )


# --- Whatever robot

spheres = st.tuples(st.floats(0.05, 0.3), st.floats(0.3, 1.0), directions, st.floats(-0.3, 0.6))


@pytest.mark.study
@settings(max_examples=25, deadline=None)
@given(
    kind=st.sampled_from(["arm", "limp", "slack", "two_hinges", "pulled", "tendons", "helix", "helix_lumped"]),
    obstacles=st.lists(spheres, min_size=1, max_size=3),
    direction=directions,
    size=st.floats(0.0, 0.5),
)
def test_nothing_penetrates_and_nothing_pulls(kind: str, obstacles: list, direction: np.ndarray, size: float) -> None:
    """Random balls near random robots of every kind: gaps, signs and balance hold, or the failure is named."""
    robot = model(kind)
    motors = robot.relaxed_motors
    free = sr.solve_equilibrium(robot, motors)
    balls = []
    for radius, along, side, apart in obstacles:
        centre = along * free.tip_position + np.array(side) * (radius * robot.reach + apart * robot.reach)
        ball = Sphere(radius * robot.reach, tuple(centre))
        if distances(robot, [ball], robot.configuration(motors)).min() > 0.0:
            balls.append(ball)
    assume(balls)
    try:
        found = sr.solve_equilibrium(robot, motors, size * PUSHES[kind] * direction, environment=Environment(balls))
    except sr.EquilibriumNotFound as error:
        assert np.isfinite(error.residual)
        return
    assert distances(robot, balls, found.q).min() > -1e-9 * robot.reach
    assert found.residual <= found.tolerance
    for contact in found.contacts:
        assert contact.normal_force >= 0.0
        assert abs(contact.normal_force * contact.gap) <= 1e-9 * robot.reach * contact.normal_force
        assert np.allclose(contact.point - contact.obstacle_point, contact.gap * contact.normal, atol=1e-12)


# --- Refusals


def test_what_contact_cannot_have_is_refused_by_name(arm: sr.SoftModel) -> None:
    floor = Environment([HalfSpace((0, 0, 1), -0.1)])
    with pytest.raises(sr.ParameterError, match="'newton' in contact"):
        sr.solve_equilibrium(arm, MOTORS, FORCE, environment=floor, method="fixed_point")
    with pytest.raises(sr.ParameterError, match="follow_contact takes moments"):
        sr.solve_equilibrium(arm, MOTORS, wrench=(0, 0, 0, 0, 1, 0), environment=floor)
    with pytest.raises(sr.ParameterError, match="environment"):
        sr.solve_equilibrium(arm, MOTORS, FORCE, environment=[HalfSpace((0, 0, 1))])
    block = Environment([Box((0.05, 0.05, 0.05), (0.03, 0.0, 0.07))])
    with pytest.raises(sr.EquilibriumNotFound, match=r"'link_1_root' is 0\.01 m inside of 'box_1', wherever the springs are"):
        sr.solve_equilibrium(arm, (0, 0, 0), environment=block)


@pytest.mark.parametrize(
    ("obstacle", "told"),
    [
        (Box((0.4, 0.4, 0.4), (0, 0, 0.1), name="block"), r"'link_1_root' starts, is 0\.1 m inside of 'block'.*on the surface"),
        (Cylinder(0.2, 0.2, (0, 0, -0.09), name="foot"), r"is 0\.01 m inside of 'foot'"),
        (Sphere(0.3, name="ball"), r"is 0\.3 m inside of 'ball'.*at most its radius of 0\.055 m"),
        (HalfSpace((0, 0, 1), 0.06, name="floor"), r"is 0\.06 m inside of 'floor'"),
    ],
)
def test_a_base_inside_of_an_obstacle_is_refused_before_anything_is_solved(
    arm: sr.SoftModel, obstacle: sr.Obstacle, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where nothing moves it, nothing can free it: the searches of inverse kinematics took half a minute to fail."""
    monkeypatch.setattr(ElasticProblem, "state", lambda *_: pytest.fail("solved"))
    around: Any = {"environment": Environment([HalfSpace((-1, 0, 0), -5.0), obstacle])}
    for solve in (
        lambda: sr.solve_equilibrium(arm, MOTORS, FORCE, **around),
        lambda: sr.solve_ik(arm, (0.9, 0.1, 0.7), FORCE, **around),
        lambda: sr.follow_trajectory(arm, [(0.9, 0.1, 0.7), (0.9, 0.1, 0.69)], FORCE, **around),
        lambda: sr.follow_contact(arm, [MOTORS, MOTORS], FORCE, friction=0.3, **around),
        lambda: sr.compile(arm, backend="python").equilibria([MOTORS], FORCE, **around),
    ):
        with pytest.raises(sr.ParameterError, match=told):
            solve()


def test_a_half_space_may_hold_the_base_up_to_its_radius(arm: sr.SoftModel) -> None:
    """The robot stands in it as on it."""
    floor = Environment([HalfSpace((0, 0, 1), 0.05, name="floor")])
    assert sr.solve_equilibrium(arm, (0, 0.9, -0.4), environment=floor).stable


@pytest.mark.parametrize("force", [(3, 0, -8), (3, 0, -28), (3, 0.01, -28)])
def test_a_slab_is_a_floor_for_a_robot_that_stands_on_it(force: tuple) -> None:
    """A slab as thick as two bodies, through which a long step would lead; a half-space has no other side."""
    rod = sr.load_model(sr.PccArm(muscle_azimuths=(), elastic_sections=8))
    slab, floor = sr.Environment([Box((2, 2, 0.2), (0, 0, -0.1))]), sr.Environment([HalfSpace((0, 0, 1))])
    on_slab, on_floor = (sr.solve_equilibrium(rod, (), force, environment=ground) for ground in (slab, floor))
    assert on_slab.stable
    assert on_slab.tip_position == pytest.approx(on_floor.tip_position, abs=1e-8)  # both to 1e-10 of the load


@pytest.mark.study
def test_a_start_inside_of_an_obstacle_without_a_near_way_out_is_bent_aside() -> None:
    """The relaxed robot runs through the middle of three obstacles; the energy is that of the equilibrium with them."""
    random = contact_running.family_of("arm")
    body = contact_cases.PlainBody(contact_cases.PlainStatics(random.robot()))
    case, obstacles = contact_cases.draw(random, body, 101, 122)
    assert body.nearest(obstacles, body.cores(case.motors, np.zeros((1, 4)))[0]).gap.min() < -0.1
    tally = contact_cases.judge(random, 101, range(122, 123))
    assert tally.broken == []
    assert sum(count for outcome, count in tally.outcomes.items() if outcome.isdecimal()) == 1


def test_a_stretched_arm_bends_aside_where_a_wall_is_too_near(arm: sr.SoftModel) -> None:
    """Its tip moves along the wall's normal to second order, by half of `a^T M a`: the force is that of buckling."""
    nearer = 0.01
    wall = sr.Environment([sr.HalfSpace((-1, 0, 0), nearer - 2 * LINK - BODY, name="wall")])
    found = sr.solve_equilibrium(arm, (0, 0, 0), environment=wall)
    (contact,) = found.contacts
    assert found.stable
    assert found.tip_position[0] == pytest.approx(2 * LINK - nearer, abs=1e-11)
    shortening = np.array([[2 * LINK - HINGE, LINK - HINGE], [LINK - HINGE, LINK - HINGE]])
    buckling = STIFFNESS / np.linalg.eigvalsh(shortening)[-1]
    assert contact.normal_force == pytest.approx(buckling, rel=nearer)  # 1 + O(shortening)
    with pytest.raises(sr.EquilibriumNotFound, match=r"'link_1_root' is .* inside of 'ball', wherever the springs are"):
        sr.solve_equilibrium(arm, (0, 0.9, -0.4), environment=sr.Environment([sr.Sphere(0.05, (0, 0, 0.02), name="ball")]))


def test_a_contact_where_two_capsules_meet_is_told_once_and_with_its_force() -> None:
    """A ball pressed on the middle of a section; its force is the derivative of the energy by the way of the ball.

    The nearest point is 2.5e-6 m beside the end that the halves of the section share, where gaps are zero within the tolerance.
    """
    rod, way, step = sr.load_model(sr.PccArm()), np.cross([0.0, 0.0, 1.0], [0.3, 1.0, 0.2]), 1e-6
    way /= np.linalg.norm(way)

    def pressed(depth: float) -> sr.Equilibrium:
        ball = sr.Sphere(0.02, (0.0, 0.0, 0.5895) + (0.07 - depth) * way)
        return sr.solve_equilibrium(rod, rod.relaxed_motors, environment=sr.Environment([ball]))

    (contact,) = pressed(1e-3).contacts
    energies = [0.5 * rod.stiffness @ (pressed(1e-3 + change).q_springs - rod.rest) ** 2 for change in (step, -step)]
    assert contact.strict
    assert contact.normal_force == pytest.approx((energies[0] - energies[1]) / (2.0 * step), rel=1e-5)  # rounding over the step
