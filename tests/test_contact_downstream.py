"""What follows from equilibria in contact: derivatives, estimated forces, modes, files, refusals."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

import softrobots as sr
from softrobots.environment.convex_mesh import Mesh
from softrobots.environment.environment import Environment
from softrobots.environment.gaps import Surroundings
from softrobots.environment.obstacles import Box, HalfSpace, Sphere
from softrobots.statics.contact.contact_sensitivity import ContactSensitivity
from softrobots.statics.contact.pressed_gaps import motor_slopes, pressed_gaps
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.sensitivity import held_motion
from tests.support.law_robots import triples
from tests.support.laws import law
from tests.support.rods import cantilever_frequencies

MOTORS, FORCE = np.array([0.3, 0.4, -0.3]), np.array([5.0, 0.0, -20.0])
WALL = HalfSpace((-1.0, 0.2, -0.1), -1.0)
PROP = Box((0.2, 0.2, 0.2), (0.63, 0.235, -0.03))
CASES = {"wall": [WALL], "sphere": [Sphere(0.1, (1.03, 0.335, -0.045))], "wall and prop": [WALL, PROP]}


@cache
def leaning(name: str) -> sr.Equilibrium:
    """The arm on its obstacles, pressed on each of them."""
    arm = sr.load_model(sr.InflatableArm())
    options = {"gravity": sr.EARTH_GRAVITY, "environment": Environment(CASES[name]), "tolerance": 1e-13}
    found = sr.solve_equilibrium(arm, MOTORS, FORCE, **options)
    assert [contact.status for contact in found.contacts] == ["pressed"] * len(CASES[name])
    return found


def normal_forces(found: sr.Equilibrium) -> np.ndarray:
    return np.array([contact.normal_force for contact in found.contacts])


def fourth_order(function: Callable, at: np.ndarray, step: float) -> np.ndarray:
    """Differences of fourth order; the derivative is in the last axis."""
    columns = []
    for move in step * np.eye(len(at)):
        near, far = (function(at + share * move) - function(at - share * move) for share in (1.0, 2.0))
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)


@pytest.mark.study
@pytest.mark.parametrize("name", CASES)
def test_derivatives_in_contact_are_those_of_solved_equilibria(name: str) -> None:
    """Tip and contact forces by motors and by a force at the tip, to 1e-7: steps of 1e-3 rad leave 5e-9 beside the sphere."""
    found = leaning(name)
    arm, slopes = found.model, sr.contact_sensitivity(found.model, found)

    def moved(motors: np.ndarray, push: np.ndarray) -> np.ndarray:
        options = {"gravity": sr.EARTH_GRAVITY, "environment": found.environment, "q_springs0": found.q_springs}
        there = sr.solve_equilibrium(arm, motors, FORCE + push, **options, tolerance=1e-13)
        return np.concatenate([there.tip_position, normal_forces(there), there.motor_torques])

    count = len(found.contacts)
    by_motors = fourth_order(lambda q: moved(q, np.zeros(3)), MOTORS, 1e-3)
    by_force = fourth_order(lambda f: moved(MOTORS, f), np.zeros(3), 0.05)
    jacobian = sr.elastostatic_jacobian(arm, found)
    pairs = [(jacobian, by_motors[:3]), (slopes.by_motors, by_motors[3 : 3 + count])]
    pairs += [(sr.compliance(arm, found)[:3, :3], by_force[:3]), (slopes.by_wrench[:, :3], by_force[3 : 3 + count])]
    pairs += [(jacobian.T, by_force[3 + count :])]  # Maxwell-Betti: the constraints do no work
    state = elastic_state(arm, MOTORS, found.q_springs, found.load)
    _, through = held_motion(arm, state.tangent, state.load.coupling, pressed_gaps(state))
    pairs += [(motor_slopes(state, found.load)[0] + through, by_motors[3 + count :])]
    for closed, differences in pairs:
        assert np.abs(closed - differences).max() < 1e-7 * np.abs(differences).max()
    assert slopes.contacts == found.contacts


def test_forces_follow_obstacles_that_come_nearer() -> None:
    """Each obstacle moved along the normal of its contact, by differences of fourth order."""
    found = leaning("wall and prop")
    slopes, moves = sr.contact_sensitivity(found.model, found), np.eye(4)

    def approached(distances: np.ndarray) -> np.ndarray:
        environment = found.environment
        for contact, distance in zip(found.contacts, distances, strict=True):
            moves[:3, 3] = distance * contact.normal
            environment = environment.moved(contact.obstacle, moves)
        options = {"gravity": sr.EARTH_GRAVITY, "environment": environment, "q_springs0": found.q_springs}
        there = sr.solve_equilibrium(found.model, MOTORS, FORCE, **options, tolerance=1e-13)
        return np.concatenate([normal_forces(there), there.q_springs])

    differences = fourth_order(approached, np.zeros(2), 1e-4)
    expected = np.concatenate([slopes.by_approach, slopes.springs_by_approach])
    assert np.abs(expected - differences).max() < 1e-7 * np.abs(differences).max()


def test_nothing_pressed_has_no_forces_and_the_derivatives_of_free_space() -> None:
    arm = sr.load_model(sr.InflatableArm())
    far = Environment([HalfSpace((0.0, 0.0, 1.0), -5.0)])
    found, free = (sr.solve_equilibrium(arm, MOTORS, FORCE, environment=around) for around in (far, None))
    assert sr.contact_sensitivity(arm, found).by_motors.shape == (0, 3)
    assert np.abs(sr.elastostatic_jacobian(arm, found) - sr.elastostatic_jacobian(arm, free)).max() < 1e-9


@law("contact_sensitivity", "statics.contact.contact_sensitivity.ContactSensitivity")
@given(step=triples, push=triples)
@settings(max_examples=5)
def test_forces_go_where_their_derivatives_point(step: tuple, push: tuple) -> None:
    """A small step of motors and force changes the contact forces as the derivatives say, up to the square of the step."""
    found = leaning("wall and prop")
    slopes, wrench = sr.contact_sensitivity(found.model, found), np.array([*push, 0.0, 0.0, 0.0])
    options = {"gravity": sr.EARTH_GRAVITY, "environment": found.environment, "q_springs0": found.q_springs}
    left = []
    assert isinstance(slopes, ContactSensitivity)
    for size in (2e-3, 1e-3):
        there = sr.solve_equilibrium(found.model, MOTORS + size * np.array(step), FORCE + size * np.array(push), **options)
        predicted = size * (slopes.by_motors @ step + slopes.by_wrench @ wrench)
        left.append(np.abs(normal_forces(there) - normal_forces(found) - predicted).max())
    assert left[1] <= 0.3 * left[0] + 1e-8


# --- Estimated forces


@pytest.mark.parametrize("name", ["wall", "sphere"])
def test_motor_torques_tell_the_contact_force_at_a_given_place(name: str) -> None:
    """The contact is estimated as a force at its point along its normal, the obstacle unknown: 1e-8 of it.

    The arm leans on the obstacle under its weight alone, which is known.
    """
    arm = sr.load_model(sr.InflatableArm())
    options = {"gravity": sr.EARTH_GRAVITY, "environment": Environment(CASES[name]), "tolerance": 1e-13}
    found = sr.solve_equilibrium(arm, (0.3, 0.2, -0.3) if name == "sphere" else MOTORS, **options)
    (contact,) = found.contacts
    assert contact.normal_force > 1.0
    point = frame_placement(arm, found.q, contact.link).actInv(contact.point)
    marked = sr.with_points(arm, {"touched": (contact.link, point)})
    estimate = partial(sr.estimate_load, marked, found.q_motors, found.motor_torques, frame="touched")
    known = estimate(directions=contact.normal, gravity=sr.EARTH_GRAVITY)
    assert np.abs(known.force - contact.force).max() < 1e-8 * contact.normal_force
    assert np.abs(known.equilibrium.q_springs - found.q_springs).max() < 1e-8
    anywhere = estimate(gravity=sr.EARTH_GRAVITY)  # its direction unknown: all that the motors feel of it
    hidden = anywhere.unobservable_directions
    felt = np.eye(3) - hidden.T @ hidden
    assert np.abs(felt @ (anywhere.force - contact.force)).max() < (1e-6 if len(hidden) == 0 else 1e-2) * contact.normal_force


def test_a_known_obstacle_is_told_from_the_force_at_the_tip() -> None:
    """The prop under the arm is known, the force at the tip is not: both come back from three motor torques."""
    arm = sr.load_model(sr.InflatableArm())
    options = {"gravity": sr.EARTH_GRAVITY, "environment": Environment([PROP])}
    found = sr.solve_equilibrium(arm, (0.3, 0.45, -1.2), FORCE, **options, tolerance=1e-13)
    assert normal_forces(found).min() > 1.0
    estimate = sr.estimate_load(arm, found.q_motors, found.motor_torques, **options)
    assert np.abs(estimate.force - FORCE).max() < 1e-8 * np.linalg.norm(FORCE)
    assert np.abs(normal_forces(estimate.equilibrium) - normal_forces(found)).max() < 1e-7
    free = sr.estimate_load(arm, found.q_motors, found.motor_torques, gravity=sr.EARTH_GRAVITY)
    assert np.linalg.norm(free.force - FORCE) > 1.0  # without the obstacle it would be another one


# --- Inverse kinematics


def assert_leaning(found: sr.Equilibrium, reach: float = 1.2) -> None:
    """The conditions of Karush, Kuhn and Tucker, and the same robot from rest."""
    assert found.converged
    for one in found.contacts:
        assert one.normal_force >= 0.0
        assert abs(one.gap) <= (1e-12 if one.strict else 1e-9) * reach
    gaps = Surroundings(found.model, found.environment).at(found.q, 0.3 * reach).values
    assert gaps.min(initial=0.0) >= -1e-12 * reach
    load = {"wrench": dict(found.load.wrenches), "gravity": found.load.gravity, "environment": found.environment}
    again = sr.solve_equilibrium(found.model, found.q_motors, **load)
    assert np.abs(again.q_springs - found.q_springs).max() < 1e-9


@pytest.mark.parametrize("name", ["wall", "wall and prop"])
def test_a_target_is_reached_while_leaning(name: str) -> None:
    """The pose of an arm on its obstacles is found again from other motors: its tip can only be there in contact."""
    held = leaning(name)
    options = {"gravity": sr.EARTH_GRAVITY, "environment": held.environment}
    found = sr.solve_ik(held.model, held.tip_position, FORCE, q_motors0=MOTORS + (0.1, -0.1, 0.1), **options)
    assert found.error < 1e-9
    assert "half_space_1" in [one.obstacle for one in found.equilibrium.contacts]
    assert_leaning(found.equilibrium)


def test_a_target_behind_a_wall_is_out_of_reach_by_its_depth() -> None:
    """The nearest point is on the wall, where the tip is its radius away: the error is the depth of the target."""
    held = leaning("wall")
    normal = np.array(WALL.normal) / np.linalg.norm(WALL.normal)
    with pytest.raises(sr.TargetUnreachable) as caught:
        sr.solve_ik(
            held.model, held.tip_position - 0.02 * normal, FORCE, q_motors0=MOTORS, starts=1, environment=held.environment
        )
    assert caught.value.residual == pytest.approx(0.02, rel=1e-3)
    assert_leaning(caught.value.best.equilibrium)


def test_a_path_along_a_wall_is_slid_and_one_off_it_leaves_it() -> None:
    """Along the wall every waypoint is reached in contact; the other path begins there, and the second waypoint is free."""
    held = leaning("wall")
    normal = np.array(WALL.normal) / np.linalg.norm(WALL.normal)
    along = np.cross((0.0, 0.0, 1.0), normal) / np.linalg.norm(np.cross((0.0, 0.0, 1.0), normal))
    options = {"gravity": sr.EARTH_GRAVITY, "environment": held.environment, "q_motors0": MOTORS}
    for direction, pressed in ((along, True), (normal, False)):
        steps = np.linspace(0.0, 0.2 if direction @ (0.0, -1.0, 0.0) > 0.0 else -0.2, 5) if pressed else np.linspace(0, 0.1, 5)
        targets = held.tip_position + steps[:, None] * direction
        path = sr.follow_trajectory(held.model, targets, FORCE, **options)
        assert path.tip_error.max() < 1e-9
        forces = path.contact_forces["half_space_1"]
        assert forces[0] == pytest.approx(held.contacts[0].normal_force, rel=1e-9)
        assert (forces[1:].min() > 1.0) if pressed else (forces[1:] == 0.0).all()
        for found in path.equilibria:
            assert_leaning(found)


def test_a_workspace_stays_among_its_obstacles(tmp_path: Path) -> None:
    """No tip is inside of the wall or nearer than its radius; the file brings it back."""
    arm = sr.load_model(sr.InflatableArm())
    space = sr.sample_workspace(arm, 40, force=FORCE, environment=Environment([WALL]))
    normal = np.array(WALL.normal) / np.linalg.norm(WALL.normal)
    assert (space.tip_positions @ normal).min() >= WALL.offset + 0.055 - 1e-9
    again = sr.load_result(sr.save_result(space, tmp_path / "space.npz"))
    assert again.load.environment == space.load.environment
    assert np.array_equal(again.tip_positions, space.tip_positions)


# --- Modes


def propped(count: int) -> np.ndarray:
    """Relative errors of the first two frequencies of a clamped rod on a prop at its end, in the plane of the prop."""
    radius, stiffness = 1e-4, 1.0
    rod = sr.PccArm(
        segment_lengths=(1.0,), muscle_azimuths=(), bending_stiffness=stiffness, linear_density=1.0, radius=radius,
        hinges=count, chain="lumped", torsion=False, extension=False,
    )  # fmt: skip
    model = sr.load_model(rod)
    prop = Environment([Sphere(0.05, (-0.05 - radius + 1e-6, 0.0, 1.0 + 1e-7))])
    held = sr.solve_equilibrium(model, (), environment=prop, tolerance=1e-13)
    assert normal_forces(held).tolist() == pytest.approx([3.0 * stiffness * 1e-6], rel=0.1)  # 3 EI w / L^3
    modes = sr.vibration_modes(model, held)
    assert len(modes.frequencies) == model.n_springs - 1
    omega = 2.0 * np.pi * modes.frequencies[:8]
    clamped, pinned = cantilever_frequencies(0.0), np.array([3.92660231, 7.06858275]) ** 2
    found = [omega[np.argmin(np.abs(omega - exact))] / exact - 1.0 for exact in pinned]
    free = [omega[np.argmin(np.abs(omega - exact))] / exact - 1.0 for exact in clamped]
    assert np.abs(free).max() < 0.05  # across the prop it swings as a cantilever
    return np.array(found)


def test_a_propped_rod_has_the_frequencies_of_a_propped_cantilever() -> None:
    """Clamped and simply supported: 3.9266^2 and 7.0686^2 (Blevins, table 8-1), of second order or better in the hinges."""
    coarse, fine = propped(8), propped(16)
    assert np.abs(fine).max() < 3e-3
    assert np.log2(np.abs(coarse) / np.abs(fine)).min() > 1.8


def test_the_modes_of_an_arm_on_a_wall_by_hand() -> None:
    """One link with two springs, its end on a wall: one mode, whose motion along the wall is all that the constraint leaves.

    With the gradient (a, b) of the gap the motion is along (-b, a), and the square of the frequency is the quotient of its
    stiffness and mass. Mass and stiffness of the free robot come from vibration_modes of the same shape under the force.
    """
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))
    wall = Environment([HalfSpace((-0.8, -0.6, 0.0), -0.5)])
    found = sr.solve_equilibrium(model, (0.2, 0.1), (10.0, 5.0, -5.0), environment=wall, tolerance=1e-13)
    (contact,) = found.contacts
    modes = sr.vibration_modes(model, found)
    assert modes.frequencies.shape == (1,)
    across = np.array([-found.contact_gradients[0, 1], found.contact_gradients[0, 0]])
    point = frame_placement(model, found.q, contact.link).actInv(contact.point)
    marked = sr.with_points(model, {"touched": (contact.link, point)})
    wrenches = {"tip": (10.0, 5.0, -5.0, 0, 0, 0), "touched": (*contact.force, 0, 0, 0)}
    dead = sr.solve_equilibrium(marked, found.q_motors, wrench=wrenches, q_springs0=found.q_springs, tolerance=1e-13)
    assert np.abs(dead.q_springs - found.q_springs).max() < 1e-11
    free = sr.vibration_modes(marked, dead)
    square = (across @ found.tangent_stiffness @ across) / (across @ free.mass_matrix @ across)
    assert modes.frequencies[0] == pytest.approx(np.sqrt(square) / (2.0 * np.pi), rel=1e-10)
    assert np.abs(found.contact_gradients @ modes.shapes).max() < 1e-12  # the gap stays closed


# --- Files


@pytest.mark.parametrize("ending", [".npz", ".json"])
@pytest.mark.parametrize("name", CASES)
def test_a_saved_equilibrium_comes_back_with_its_contacts(name: str, ending: str, tmp_path: Path) -> None:
    found = leaning(name)
    again = sr.load_result(sr.save_result(found, tmp_path / f"leaning{ending}"))
    assert again.environment == found.environment
    assert np.array_equal(again.q_springs, found.q_springs)
    assert (again.stable, again.converged) == (True, True)
    assert [(one.link, one.obstacle, one.status) for one in again.contacts] == [
        (one.link, one.obstacle, one.status) for one in found.contacts
    ]
    for one, other in zip(again.contacts, found.contacts, strict=True):
        assert np.abs(one.force - other.force).max() < 1e-11 * other.normal_force
        assert np.array_equal(one.point, other.point)
    assert np.abs(again.motor_torques - found.motor_torques).max() < 1e-10
    modes = sr.vibration_modes(found.model, found)
    kept = sr.load_result(sr.save_result(modes, tmp_path / f"modes{ending}"))
    assert np.allclose(kept.frequencies, modes.frequencies, rtol=1e-12)
    assert kept.eigenvalues.shape == (2 * len(modes.frequencies),)


def test_other_results_come_back_with_their_obstacles(tmp_path: Path) -> None:
    held = leaning("wall")
    arm, options = held.model, {"gravity": sr.EARTH_GRAVITY, "environment": held.environment}
    normal = np.array(WALL.normal) / np.linalg.norm(WALL.normal)
    path = sr.follow_trajectory(arm, held.tip_position + [[0.0], [0.05]] * normal, FORCE, q_motors0=MOTORS, **options)
    results = {
        "ik": sr.solve_ik(arm, held.tip_position, FORCE, q_motors0=MOTORS, **options),
        "path": path,
        "estimate": sr.estimate_load(arm, MOTORS, held.motor_torques, **options, torque_std=0.1, motor_angle_std=0.01),
    }
    for name, result in results.items():
        again = sr.load_result(sr.save_result(result, tmp_path / f"{name}.npz"))
        one, other = (found.equilibria[0] if name == "path" else found.equilibrium for found in (again, result))
        assert one.environment == held.environment
        assert np.allclose(normal_forces(one), normal_forces(other), rtol=1e-9)
    again = sr.load_result(tmp_path / "estimate.npz")
    assert np.allclose(again.covariance, results["estimate"].covariance, rtol=1e-9)
    again = sr.load_result(tmp_path / "path.npz")
    assert list(again.contact_forces) == list(path.contact_forces) == ["half_space_1"]
    assert np.allclose(again.contact_forces["half_space_1"], path.contact_forces["half_space_1"], rtol=1e-9)


def test_a_file_with_a_robot_inside_of_an_obstacle_is_refused(tmp_path: Path) -> None:
    """The wall is moved into the robot: its forces would still balance."""
    file = sr.save_result(leaning("wall"), tmp_path / "leaning.json")
    text = file.read_text(encoding="utf-8")
    assert text.count("-1.0") >= 1
    deeper = text.replace('\\"offset\\": -1.0', '\\"offset\\": -0.9')
    assert deeper != text
    file.write_text(deeper, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=r"inside of an obstacle|claims a residual"):
        sr.load_result(file)


def test_a_result_names_no_other_file(tmp_path: Path) -> None:
    """Corners of a mesh are in the file of a result; a path in their place is not opened."""
    arm, corners = sr.load_model(sr.InflatableArm()), np.array(list(np.ndindex(2, 2, 2))) * 0.2 + (0.53, 0.13, -0.13)
    held = sr.solve_equilibrium(arm, MOTORS, FORCE, gravity=sr.EARTH_GRAVITY, environment=Environment([Mesh(corners), WALL]))
    file = sr.save_result(held, tmp_path / "leaning.json")
    again = sr.load_result(file)
    assert [one.obstacle for one in again.contacts] == [one.obstacle for one in held.contacts]
    text = file.read_text(encoding="utf-8")
    start = text.index('\\"vertices\\": ') + len('\\"vertices\\": ')
    elsewhere = text[:start] + '\\"/etc/hosts\\"' + text[text.index("]]", start) + 2 :]
    file.write_text(elsewhere, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match="another file"):
        sr.load_result(file)


# --- Linear models


@pytest.mark.parametrize("name", CASES)
def test_a_linear_model_at_rest_is_the_slope_of_solved_equilibria(name: str) -> None:
    """Tip and motor torques by motors and by a force at the tip, against fourth-order differences of equilibria in contact."""
    found = leaning(name)
    arm, linear, m = found.model, sr.linearize(found.model, found), 3
    n = len(linear.state_names) // 2
    assert n == m + arm.n_springs - len(found.contacts)
    assert set(linear.state_names[:n]) <= {*arm.motor_joints, *arm.spring_joints}
    assert linear.A.shape == (2 * n, 2 * n)
    assert len(linear.state_units) == 2 * n
    force = slice(linear.input_names.index("tip_force_x"), None)
    by_inputs = np.column_stack([linear.A[n + m :, :m], linear.B[n + m :, force]])  # of what the springs' accelerations have
    resting = -np.linalg.solve(linear.A[n + m :, m:n], by_inputs)
    outputs = np.column_stack([linear.C[:, :m], linear.D[:, force]]) + linear.C[:, m:n] @ resting

    def moved(inputs: np.ndarray) -> np.ndarray:
        options = {"gravity": sr.EARTH_GRAVITY, "environment": found.environment, "q_springs0": found.q_springs}
        there = sr.solve_equilibrium(arm, MOTORS + inputs[:3], FORCE + 50.0 * inputs[3:], **options, tolerance=1e-13)
        return np.concatenate([there.tip_position, there.motor_torques])

    differences = fourth_order(moved, np.zeros(6), 1e-3) / np.repeat([1.0, 50.0], 3)
    for rows, of in ((outputs[:3], slice(0, 3)), (outputs[6:], slice(3, 6))):
        for part in (slice(0, 3), slice(3, 6)):
            expected = differences[of, part]
            assert np.abs(rows[:, part] - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("name", CASES)
def test_a_linear_model_in_contact_rings_as_the_modes(name: str) -> None:
    """Modes go by an orthonormal basis of the motions that contacts leave, the linear model by some of the springs."""
    found = leaning(name)
    arm, m = found.model, 3

    def same(found: np.ndarray, expected: np.ndarray) -> None:
        assert len(found) == len(expected)
        apart = np.abs(found[:, None] - expected)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-8 * np.abs(expected).max()

    options: dict[str, Any] = {"damping_time": 0.02, "mass_damping": 0.3}
    linear = sr.linearize(arm, found, **options)
    n = len(linear.state_names) // 2
    own = np.r_[m:n, n + m : 2 * n]
    held = sr.vibration_modes(arm, found, **options)
    same(np.linalg.eigvals(linear.A[np.ix_(own, own)]), held.eigenvalues)
    servos = np.array([900.0, 700.0, 500.0])
    options["rotor_inertia"] = 0.05
    linear = sr.linearize(arm, found, motors="torque", **options)
    closed = linear.A - linear.B[:, :m] @ (servos[:, None] * linear.C[6 : 6 + m])
    same(np.linalg.eigvals(closed), sr.vibration_modes(arm, found, servo_stiffness=servos, **options).eigenvalues)


# --- Refusals


def test_a_robot_that_has_no_room_is_told_what_is_inside_of_what() -> None:
    """Forces of two walls balance each other at any depth: that is no equilibrium, nor near a target."""
    arm = sr.load_model(sr.InflatableArm())
    slit = sr.Environment([sr.HalfSpace((0, 0, 1), name="floor"), sr.HalfSpace((0, 0, -1), name="ceiling")])
    with pytest.raises(sr.EquilibriumNotFound, match=r"at any of 2 starts; 'link_[12]' is .* m inside of '(floor|ceiling)'"):
        sr.solve_ik(arm, (0.9, 0.1, 0.3), environment=slit, starts=2)


@pytest.mark.study
def test_what_cannot_take_obstacles_or_friction_says_so(tmp_path: Path) -> None:
    found = leaning("wall")
    felt = sr.estimate_load(found.model, MOTORS, found.motor_torques, environment=found.environment, gravity=sr.EARTH_GRAVITY)
    refused: dict[str, Any] = {
        "simulation": lambda: sr.simulate(found.model, 0.1, MOTORS, start=found),
        "of an estimate": lambda: sr.sensitivity(found.model, felt, "stiffness"),
    }
    for words, call in refused.items():
        with pytest.raises(sr.ParameterError, match=f"{words}.*takes no obstacles"):
            call()
    (rubs,) = sr.follow_contact(
        found.model, MOTORS, FORCE, gravity=sr.EARTH_GRAVITY, environment=found.environment, friction=0.3, parameters=[0.0]
    ).equilibria
    assert {contact.status for contact in rubs.contacts} <= {"sticks", "slips"}
    for call in (sr.compliance, sr.elastostatic_jacobian, sr.contact_sensitivity, sr.vibration_modes, sr.linearize):
        with pytest.raises(sr.ParameterError, match="one whose contacts stick, or have no friction"):
            call(found.model, rubs)
    with pytest.raises(sr.ParameterError, match="a ContactPath is saved with its friction"):
        sr.save_result(rubs, tmp_path / "rubs.npz")
    options = {"environment": found.environment}
    with pytest.raises(sr.ParameterError, match="method"):
        sr.solve_ik(found.model, (0.9, 0.3, 0.2), method="fixed_point", **options)
    with pytest.raises(sr.ParameterError, match="method"):
        sr.follow_trajectory(found.model, [(0.9, 0.3, 0.2)], method="paper", times=[0.0], **options)
    with pytest.raises(sr.ParameterError, match="method"):
        sr.estimate_load(found.model, MOTORS, found.motor_torques, method="alternation", **options)


def test_a_load_estimate_on_a_wall_leaves_out_what_only_the_wall_feels() -> None:
    """The tip's round end leans on the wall: a force along the normal passes into it, and is in the contact instead."""
    arm, motors, force = sr.load_model(sr.InflatableArm()), (0, 0.9, -0.4), (0, 0, -41.0)
    wall = sr.Environment([sr.HalfSpace((-1, 0, 0), -1.0)])
    leaning = sr.solve_equilibrium(arm, motors, force, environment=wall)
    found = sr.estimate_load(arm, motors, leaning.motor_torques, environment=wall)
    assert abs(found.unobservable_directions) == pytest.approx(np.array([[1.0, 0.0, 0.0]]), abs=1e-9)
    assert found.force == pytest.approx(force, abs=1e-6)
    assert found.equilibrium.contacts[0].normal_force == pytest.approx(leaning.contacts[0].normal_force, abs=1e-6)
