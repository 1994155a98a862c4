"""Single steps of the solvers, against the Denavit-Hartenberg table and SciPy's generalised eigenvalues; and their budgets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import eigh

import softrobots as sr
from softrobots.elastostatics import (
    LARGEST_STEP,
    elastic_state,
    is_stable,
    largest_residual,
    newton,
    norm,
    positive,
    scaled,
    settle,
    settled,
)
from softrobots.loads import Load
from tests.oracles import arm_energy, central_difference, flexible_jacobian

MOTORS = np.array([0.3, 0.6, -0.8])
SPRINGS = [2, 3, 5, 6]
"""Columns of the springs in the table."""
REST = np.zeros(4)
BENT = np.array([0.21, -0.34, 0.13, -0.08])
PUSH = np.array([3.0, 10.0, -15.0])


def residual_of(arm: sr.SoftModel, springs: np.ndarray, force: np.ndarray, motors: np.ndarray = MOTORS) -> np.ndarray:
    """Spring torques less the load, from the table."""
    angles = np.array([motors[0], motors[1], springs[0], springs[1], motors[2], springs[2], springs[3]])
    return arm.stiffness * springs - flexible_jacobian(angles)[:3, SPRINGS].T @ force


def tangent_of(arm: sr.SoftModel, springs: np.ndarray, force: np.ndarray, motors: np.ndarray = MOTORS) -> np.ndarray:
    """Derivative of `residual_of` by differences, good to nine digits."""
    found = central_difference(lambda y: residual_of(arm, y, force, motors), springs, 1e-5)
    return 0.5 * (found + found.T)


def test_a_state_is_that_of_the_table(arm: sr.SoftModel) -> None:
    state = elastic_state(arm, MOTORS, BENT, Load.of(arm, PUSH))
    k = arm.stiffness[0]
    assert state.q_springs is BENT
    assert np.array_equal(state.q, arm.configuration(MOTORS, BENT))
    assert state.spring_torques == pytest.approx(k * BENT, rel=1e-15)
    assert state.residual == pytest.approx(residual_of(arm, BENT, PUSH), rel=1e-12)
    assert state.error == pytest.approx(np.linalg.norm(state.residual), rel=1e-15)
    assert state.tangent == pytest.approx(tangent_of(arm, BENT, PUSH), abs=1e-7 * k)
    assert state.energy == pytest.approx(arm_energy(MOTORS, BENT, PUSH, k), rel=1e-13)
    assert state.scale == pytest.approx(np.linalg.norm(PUSH) * arm.reach, rel=1e-15)


def test_the_size_of_a_load_counts_moments_and_weight(arm: sr.SoftModel) -> None:
    """`|f| reach + |mu| + |g|`, of every wrench."""
    load = Load.of(arm, PUSH, wrench={"link_1": (1, 2, 2, 3, 4, 0), "tip": (0, 0, 0, 0, 0, 7.0)}, gravity=sr.EARTH_GRAVITY)
    weight = elastic_state(arm, MOTORS, REST, Load.of(arm, gravity=sr.EARTH_GRAVITY)).scale
    assert weight > 0.01
    expected = (np.linalg.norm(PUSH) + 3.0) * arm.reach + 5.0 + 7.0 + weight
    assert elastic_state(arm, MOTORS, REST, load).scale == pytest.approx(expected, rel=1e-14)


def test_the_largest_residual_is_relative_with_a_floor(arm: sr.SoftModel, odd_arm: sr.SoftModel) -> None:
    assert largest_residual(arm, 20.0, 1e-10) == 20.0 * 1e-10
    assert largest_residual(arm, 0.9e-3, 1e-4) == 1e-3 * 1e-4
    assert largest_residual(odd_arm, 0.0, 1e-30) == odd_arm.rounding > 1e-20  # it has rest angles


# --- Single steps of the descent


def stepped(arm: sr.SoftModel, force: np.ndarray, start: np.ndarray, motors: np.ndarray = MOTORS) -> np.ndarray:
    """Where one evaluation of the descent leads."""
    state, spent, _ = settle(arm, motors, Load.of(arm, force), start, max_iterations=1)
    assert spent == 1
    return state.q_springs - start


def test_a_step_is_newtons_where_the_tangent_is_positive(arm: sr.SoftModel) -> None:
    step = -np.linalg.solve(tangent_of(arm, BENT, PUSH), residual_of(arm, BENT, PUSH))
    assert 0.1 < np.linalg.norm(step) < LARGEST_STEP
    assert stepped(arm, PUSH, BENT) == pytest.approx(step, rel=1e-6)  # the differences of the tangent


def test_a_long_step_is_cut_to_the_longest(arm: sr.SoftModel) -> None:
    start = np.array([0.6, 0.5, -0.4, 0.3])
    step = -np.linalg.solve(tangent_of(arm, start, PUSH), residual_of(arm, start, PUSH))
    assert np.linalg.norm(step) > LARGEST_STEP
    assert stepped(arm, PUSH, start) == pytest.approx(0.5 * step / np.linalg.norm(step), rel=1e-6)


@pytest.mark.parametrize("name", ["arm", "stiff_and_soft"])
def test_a_step_from_where_the_tangent_is_not_positive_turns_its_eigenvalues(arm: sr.SoftModel, name: str) -> None:
    """`-V |L|^-1 V^T r` with `K V = diag(k) V L`, `V^T diag(k) V = 1`: SciPy's generalised problem, no scaling by hand."""
    stiffness = (172.71, 172.71, 172.71, 172.71) if name == "arm" else (30.0, 30.0, 900.0, 900.0)
    robot = arm if name == "arm" else sr.load_model(sr.InflatableArm(stiffness=(30.0, 900.0)))
    force = np.array([-600.0, 20.0, 10.0])
    motors, start = np.zeros(3), np.array([0.05, -0.02, 0.01, 0.03])
    state = elastic_state(robot, motors, start, Load.of(robot, force))
    values, vectors = eigh(state.tangent, np.diag(stiffness))
    assert values[0] < -0.1
    step = -vectors @ (vectors.T @ state.residual / np.maximum(np.abs(values), 1e-3))
    step *= min(1.0, LARGEST_STEP / np.linalg.norm(step))
    assert stepped(robot, force, start, motors) == pytest.approx(step, rel=1e-9)


def buckled_force(arm: sr.SoftModel, factor: float) -> np.ndarray:
    return factor * sr.critical_load(arm, np.zeros(3), (-1, 0, 0)) * np.array([-1.0, 0.0, 0.0])


def test_an_unstable_balance_is_left_along_a_softest_direction() -> None:
    """A tenth of a radian within SciPy's eigenvectors of the smallest eigenvalue, its largest part positive."""
    robot = sr.load_model(sr.InflatableArm(stiffness=(150.0, 250.0), hinge_offset=(0.03, 0.06)))
    force = 1.3 * sr.critical_load(robot, np.zeros(3), (-1, 0, 0)) * np.array([-1.0, 0.0, 0.0])
    state = elastic_state(robot, np.zeros(3), REST, Load.of(robot, force))
    assert state.error == 0.0
    values, vectors = eigh(state.tangent, np.diag(robot.stiffness))
    assert values[0] < -0.1
    found = stepped(robot, force, REST, np.zeros(3))
    assert np.linalg.norm(found) == pytest.approx(0.1, rel=1e-12)
    # A round arm buckles in any plane: two eigenvectors.
    plane, _ = np.linalg.qr(vectors[:, np.abs(values - values[0]) < 1e-9])
    assert plane.shape == (4, 2)
    assert np.linalg.norm(plane.T @ found) == pytest.approx(0.1, rel=1e-9)
    assert found[np.argmax(np.abs(found))] > 0.0


def test_a_step_that_raises_the_energy_is_halved(arm: sr.SoftModel) -> None:
    """By powers of two, to the first that lowers the energy by the share of Armijo; each half is an evaluation."""
    force, start = np.array([150.0, 40.0, -80.0]), np.array([1.2, -1.1, 0.9, 1.3])
    load, k = Load.of(arm, force), arm.stiffness[0]
    state = elastic_state(arm, MOTORS, start, load)
    for most in range(1, 12):
        after, spent, _ = settle(arm, MOTORS, load, start, max_iterations=most)
        assert spent <= most
        moved = after.q_springs - start
        if not moved.any():  # the step is not done: it stays where it is
            assert spent == most
            continue
        assert (
            arm_energy(MOTORS, after.q_springs, force, k) < arm_energy(MOTORS, start, force, k) + 1e-4 * state.residual @ moved
        )
        break


# --- Budgets


CASES = {
    "light": (np.array([0.0, 10.0, -15.0]), None),
    "heavy": (np.array([-120.0, 60.0, 80.0]), None),
    "buckled": (np.array([-900.0, 0.0, 0.0]), None),
    "moment": (np.array([5.0, 0.0, 5.0]), (0.0, 0.0, 0.0, 9.0, 4.0, 20.0)),
}


@pytest.mark.parametrize("name", CASES)
def test_no_solver_spends_more_than_it_may_and_none_less_than_it_needs(arm: sr.SoftModel, name: str) -> None:
    """What a full run needs is enough, to the last digit; with less there is no equilibrium, and all of it is spent."""
    force, wrench = CASES[name]
    load = Load.of(arm, force, wrench=wrench)
    full, needed, stable = settle(arm, MOTORS, load, REST)
    assert stable
    assert 1 < needed < 60
    assert full.error <= largest_residual(arm, full.scale, 1e-10)
    again, spent, stable = settle(arm, MOTORS, load, REST, max_iterations=needed)
    assert np.array_equal(again.q_springs, full.q_springs)
    assert (spent, stable) == (needed, True)
    for most in range(1, needed):
        less, spent, _ = settle(arm, MOTORS, load, REST, max_iterations=most)
        assert spent <= most
        assert math.isfinite(less.error)
        if name != "moment":
            assert spent == most
            assert less.error > largest_residual(arm, less.scale, 1e-10)


def test_the_fixed_point_is_the_papers_recursion(arm: sr.SoftModel) -> None:
    """Its iterates, count and best one, from the table."""
    force = np.array([0.0, 10.0, -15.0])
    load, y, count = Load.of(arm, force), BENT, 0
    bound = largest_residual(arm, np.linalg.norm(force) * arm.reach, 1e-10)
    iterates = [y]
    while np.linalg.norm(residual_of(arm, y, force)) > bound:
        y = y - residual_of(arm, y, force) / arm.stiffness
        count += 1
        iterates.append(y)
    assert count > 5
    state, spent, stable = settle(arm, MOTORS, load, BENT, method="fixed_point")
    assert (spent, stable) == (count, True)
    assert state.q_springs == pytest.approx(y, abs=1e-12)
    for most in (1, 3):
        state, spent, stable = settle(arm, MOTORS, load, BENT, method="fixed_point", max_iterations=most)
        assert spent == most
        assert state.q_springs == pytest.approx(iterates[most], abs=1e-12)


def test_of_a_recursion_that_leads_nowhere_the_best_state_is_given(arm: sr.SoftModel) -> None:
    force = np.array([150.0, 0.0, -100.0])
    y, errors, iterates = BENT, [], []
    for _ in range(9):
        iterates.append(y)
        errors.append(np.linalg.norm(residual_of(arm, y, force)))
        y = y - residual_of(arm, y, force) / arm.stiffness
    best = int(np.argmin(errors))
    state, spent, _ = settle(arm, MOTORS, Load.of(arm, force), BENT, method="fixed_point", max_iterations=8)
    assert spent == 8
    assert state.q_springs == pytest.approx(iterates[best], abs=1e-9)
    assert state.error == pytest.approx(errors[best], rel=1e-9)


def test_newton_counts_its_states_and_gives_up_where_it_is_told(arm: sr.SoftModel) -> None:
    force = np.array([0.0, 10.0, -15.0])
    load = Load.of(arm, force)
    found, needed = newton(arm, MOTORS, load, REST)
    assert found is not None
    assert found.error == pytest.approx(np.linalg.norm(residual_of(arm, found.q_springs, force)), abs=1e-12)
    assert found.error <= largest_residual(arm, found.scale, 1e-10)
    assert newton(arm, MOTORS, load, found.q_springs)[1] == 1
    assert newton(arm, MOTORS, load, REST, max_iterations=needed)[1] == needed
    assert newton(arm, MOTORS, load, REST, max_iterations=needed - 1) == (None, needed - 1)
    loose, fewer = newton(arm, MOTORS, load, REST, tolerance=1e-3)
    assert loose is not None
    assert fewer < needed
    assert largest_residual(arm, found.scale, 1e-10) < loose.error <= largest_residual(arm, found.scale, 1e-3)
    first = np.linalg.norm(np.linalg.solve(tangent_of(arm, REST, force), residual_of(arm, REST, force)))
    assert newton(arm, MOTORS, load, REST, largest_step=1.0001 * first)[0] is not None
    assert newton(arm, MOTORS, load, REST, largest_step=0.9999 * first) == (None, 1)


def test_newton_gives_up_at_a_singular_tangent_and_a_step_of_half_a_radian() -> None:
    """One spring of 100 N m/rad that an axial push of 100 N a metre away makes neutral; a side load turns it by more."""
    robot = sr.load_model(ONE_SPRING, springs={"hinge": 100.0})
    assert newton(robot, np.zeros(0), Load.of(robot, np.array([-100.0, 1.0, 0.0])), np.zeros(1)) == (None, 1)
    side = Load.of(robot, np.array([0.0, 49.9, 0.0]))
    assert newton(robot, np.zeros(0), side, np.zeros(1))[0] is not None
    assert newton(robot, np.zeros(0), Load.of(robot, np.array([0.0, 50.1, 0.0])), np.zeros(1)) == (None, 1)


ONE_SPRING = """<robot name="one"><link name="base"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="rod"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="end" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="1 0 0"/></joint><link name="tip"/></robot>"""


# --- What else the solvers are made of


def test_settled_answers_where_the_springs_settle_and_nowhere_else(arm: sr.SoftModel) -> None:
    light, heavy = Load.of(arm, np.array([0.0, 10.0, -15.0])), Load.of(arm, np.array([150.0, 0.0, -100.0]))
    for method in ("newton", "fixed_point"):
        state = settled(arm, MOTORS, light, REST, method=method)
        assert state is not None
        assert state.error <= largest_residual(arm, state.scale, 1e-10)
        rough = settled(arm, MOTORS, light, BENT, method=method, tolerance=1e-2)
        assert rough is not None
        assert largest_residual(arm, state.scale, 1e-6) < rough.error <= largest_residual(arm, state.scale, 1e-2)
        fine = settled(arm, MOTORS, light, REST, method=method, tolerance=1e-13)
        assert fine is not None
    assert settled(arm, MOTORS, heavy, REST) is not None
    assert settled(arm, MOTORS, heavy, REST, method="fixed_point") is None


def test_pivots_and_norms(arm: sr.SoftModel) -> None:
    from eigenpy import LDLT

    factors = LDLT(2)
    assert positive(factors, np.diag([1.0, 1e-12]))
    assert not positive(factors, np.diag([1.0, -1e-12]))
    assert not positive(factors, np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert norm(np.array([3.0, 4.0, 12.0])) == 13.0
    assert np.array_equal(scaled(np.array([[8.0, 6.0], [6.0, 36.0]]), np.array([4.0, 9.0])), [[2.0, 1.0], [1.0, 4.0]])


def test_a_tangent_that_is_not_symmetric_is_stable_where_its_eigenvalues_are(arm: sr.SoftModel) -> None:
    """Its symmetric part may be indefinite: a shear of 3 on eigenvalues 1; and the other way round it is never."""
    k = arm.stiffness
    root = np.sqrt(k)
    sheared = np.eye(4)
    sheared[0, 1] = 3.0
    assert np.linalg.eigvalsh(0.5 * (sheared + sheared.T))[0] < -0.4
    assert is_stable(arm, root[:, None] * sheared * root, symmetric=False)
    for least in (-1e-3, 0.0, 0.9e-9):
        sheared[2, 2] = least
        assert not is_stable(arm, root[:, None] * sheared * root, symmetric=False)
    sheared[2, 2] = 1.2e-9
    assert is_stable(arm, root[:, None] * sheared * root, symmetric=False)
