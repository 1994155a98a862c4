"""Single steps of the solvers, against the Denavit-Hartenberg table and SciPy's generalised eigenvalues; and their budgets."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import eigh

import softrobots as sr
from softrobots.statics import elastostatics
from softrobots.statics.elastic_state import (
    ElasticProblem,
    ElasticState,
    elastic_state,
    largest_residual,
    norm,
    positive,
    scaled,
)
from softrobots.statics.elastostatics import LARGEST_STEP, _descend, _escape, _stiff_step, balanced_state, newton, solve_springs
from softrobots.statics.loads import Load
from softrobots.statics.stability import is_positive
from tests.support.oracles import arm_energy, central_difference, flexible_jacobian

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
    state, spent, _ = solve_springs(arm, motors, Load.of(arm, force), start, max_iterations=1)
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
        after, spent, _ = solve_springs(arm, MOTORS, load, start, max_iterations=most)
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
    full, needed, stable = solve_springs(arm, MOTORS, load, REST)
    assert stable == (name != "moment")  # with the moment it flutters
    assert 1 < needed < 60
    assert full.error <= largest_residual(arm, full.scale, 1e-10)
    again, spent, stable = solve_springs(arm, MOTORS, load, REST, max_iterations=needed)
    assert np.array_equal(again.q_springs, full.q_springs)
    assert (spent, stable) == (needed, name != "moment")
    for most in range(1, needed):
        less, spent, _ = solve_springs(arm, MOTORS, load, REST, max_iterations=most)
        assert spent <= most
        assert math.isfinite(less.error)
        if name != "moment":
            assert spent == most
            assert less.error > largest_residual(arm, less.scale, 1e-10)


@pytest.fixture
def evaluations(monkeypatch: pytest.MonkeyPatch) -> list[np.ndarray]:
    """The springs at which a state was evaluated."""
    made: list[np.ndarray] = []
    state = ElasticProblem.state
    monkeypatch.setattr(ElasticProblem, "state", lambda case, springs: (made.append(springs), state(case, springs))[1])
    return made


TWISTED = {  # evaluations that are enough, force, world-fixed moment, motors
    "whole at once": (4, (0.0, 3.0, -5.0), (2.0, 3.0, 0.0), (0.1, 0.5, -1.0)),
    "grown": (34, (-300.0, 350.0, 200.0), (-40.0, 50.0, 60.0), (0.3, 1.2, -0.9)),
    "grown slowly": (89, (-110.0, 518.0, 403.0), (-163.0, -113.0, -10.0), (-1.2, -1.0, 1.0)),
    "the path turns back": (
        89,
        (633.6724538307325, -203.96078999479553, 555.9386835480127),
        (-1.2601314632132419, 0.6222672308654772, -0.056069818692433174),
        (0.20626073722580562, -0.6259864319449453, -2.2990825922344698),
    ),
}


@pytest.mark.parametrize("name", TWISTED)
def test_loads_without_a_potential(arm: sr.SoftModel, evaluations: list[np.ndarray], name: str) -> None:
    """With too few evaluations a part of the load balances, by the table: none, or what it had grown to; then all of it."""
    enough, *given = TWISTED[name]
    force, moment, motors = (np.array(part) for part in given)
    wrench = np.concatenate([force, moment])
    load = Load.of(arm, wrench=wrench)
    shares, answers = [], []
    for most in (1, 2, 3, 4, 5, 8, 13, 21, 34, 40, 55, 89, 144, 200):
        evaluations.clear()
        state, spent, _ = solve_springs(arm, motors, load, REST, max_iterations=most)
        assert spent <= most
        # Where Newton ends at its limit, and where the descent begins, one is not counted.
        assert spent <= len(evaluations) <= spent + 4
        y = state.q_springs
        angles = np.array([motors[0], motors[1], y[0], y[1], motors[2], y[2], y[3]])
        pull = flexible_jacobian(angles)[:, SPRINGS].T @ wrench
        shares.append(float(arm.stiffness * y @ pull / (pull @ pull)))
        assert np.linalg.norm(arm.stiffness * y - shares[-1] * pull) <= 1e-10 * state.scale
        assert (state.error <= largest_residual(arm, state.scale, 1e-10)) == (most >= enough)
        if most >= enough:
            assert shares[-1] == pytest.approx(1.0, abs=1e-10)
            assert (spent == len(evaluations)) == (name != "the path turns back")
            answers.append(y)
    assert shares[0] == 0.0
    assert shares[: -len(answers)] == sorted(shares[: -len(answers)])
    assert np.ptp(answers, axis=0).max() <= 1e-9


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
    state, spent, stable = solve_springs(arm, MOTORS, load, BENT, method="fixed_point")
    assert (spent, stable) == (count, True)
    assert state.q_springs == pytest.approx(y, abs=1e-12)
    for most in (1, 3):
        state, spent, stable = solve_springs(arm, MOTORS, load, BENT, method="fixed_point", max_iterations=most)
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
    state, spent, _ = solve_springs(arm, MOTORS, Load.of(arm, force), BENT, method="fixed_point", max_iterations=8)
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
    assert newton(arm, MOTORS, load, REST, tolerance=1e-30) == (None, 20)  # never
    loose, fewer = newton(arm, MOTORS, load, REST, tolerance=1e-3)
    assert loose is not None
    assert fewer < needed
    assert largest_residual(arm, found.scale, 1e-10) < loose.error <= largest_residual(arm, found.scale, 1e-3)


def test_newton_gives_up_at_a_singular_tangent_and_a_step_of_half_a_radian() -> None:
    """One spring of 100 N m/rad that an axial push of 100 N a metre away makes neutral; a side load turns it by more."""
    robot = sr.load_model(ONE_SPRING, springs={"hinge": 100.0})
    assert newton(robot, np.zeros(0), Load.of(robot, np.array([-100.0, 1.0, 0.0])), np.zeros(1)) == (None, 1)
    side = Load.of(robot, np.array([0.0, 49.9, 0.0]))
    assert newton(robot, np.zeros(0), side, np.zeros(1))[0] is not None
    half = Load.of(robot, np.array([0.0, 50.0, 0.0]))
    assert newton(robot, np.zeros(0), half, np.zeros(1))[0] is not None
    assert newton(robot, np.zeros(0), Load.of(robot, np.array([0.0, 50.1, 0.0])), np.zeros(1)) == (None, 1)


ONE_SPRING = """<robot name="one"><link name="base"/>
<joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<link name="rod"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="end" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="1 0 0"/></joint><link name="tip"/></robot>"""


# --- The descent on landscapes that no robot need have


class Landscape(ElasticProblem):
    """An energy with its derivatives, by springs of stiffness 1, in place of a robot under a load of a given scale."""

    def __init__(self, heights: Callable[..., tuple[float, Any, Any]], count: int, *, scale: float, tolerance: float) -> None:
        self.heights, self.scale, self.tolerance = heights, scale, tolerance
        springs: Any = SimpleNamespace(least_tangent=1e-9 * np.eye(count))
        self.model: Any = SimpleNamespace(stiffness=np.ones(count), rounding=0.0, springs=springs)
        self.load: Any = SimpleNamespace(conservative=True)

    def state(self, q_springs: np.ndarray) -> ElasticState:
        energy, slope, tangent = self.heights(*q_springs)
        nothing: Any = None
        residual = np.atleast_1d(np.array(slope, dtype=float))
        made = np.array(tangent, dtype=float).reshape(len(residual), -1)
        rest = (nothing, nothing, nothing, q_springs, self.scale, residual, made, energy, float(np.linalg.norm(residual)))
        return ElasticState(q_springs, *rest)

    def descend(self, *start: float, most: int = 50) -> tuple[np.ndarray, int, bool]:
        """Springs, evaluations and stability at the end."""
        state, spent, stable = _descend(self, np.array(start), most)
        return state.q_springs, spent, stable


def test_halved_steps_on_a_valley_with_straight_walls() -> None:
    """`sqrt(w^2 + x^2)`: from 2 w Newton's step is -10 w; halves end at -8, -3, and -0.5 w, the first that is lower."""

    def walls(x: float, w: float = 0.05) -> tuple[float, float, float]:
        height = math.hypot(w, x)
        return height, x / height, w * w / height**3

    valley = Landscape(walls, 1, scale=1.0, tolerance=1e-10)
    for most in (1, 2):  # within a step: it stays where it is
        assert valley.descend(0.1, most=most) == (pytest.approx(0.1, abs=0.0), most, True)
    assert valley.descend(0.1, most=3) == (pytest.approx(-0.025, rel=1e-12), 3, True)
    y, spent, stable = valley.descend(0.1)
    assert abs(y[0]) < 1e-11
    assert spent < 10
    assert stable


def test_a_wall_and_a_plain_end_the_descent() -> None:
    """Pressed against the end of its range a section is not in equilibrium; on a plain it is in a neutral one."""
    wall = Landscape(lambda x: (-x if x < 1.0 else math.inf, -1.0, 1.0), 1, scale=1.0, tolerance=1e-10)
    y, spent, stable = wall.descend(0.9, most=500)
    assert 0.999 < y[0] < 1.0
    assert 40 < spent < 500
    assert stable
    assert not wall.balanced(wall.state(y))
    assert Landscape(lambda x: (0.0, 0.0, 0.0), 1, scale=1.0, tolerance=1e-10).descend(0.3) == (0.3, 0, False)


def test_beside_a_saddle_the_descent_goes_downhill_where_energies_cannot_be_told_apart() -> None:
    """`-x^2/2 + x^4/4 + y^2/2`, 1e-5 from the saddle: Newton's step of the size of x gains 1e-10, and rounding is 1e-9."""

    def saddle(x: float, y: float) -> tuple[float, Any, Any]:
        return -0.5 * x * x + 0.25 * x**4 + 0.5 * y * y, (x**3 - x, y), ((3.0 * x * x - 1.0, 0.0), (0.0, 1.0))

    y, spent, stable = Landscape(saddle, 2, scale=1e5, tolerance=1e-17).descend(1e-5, 0.0)
    assert y == pytest.approx([1.0, 0.0], abs=1e-10)
    assert spent < 20
    assert stable


def test_along_a_curved_valley_the_descent_goes_to_its_bottom_where_energies_cannot_be_told_apart() -> None:
    """`(y - x^2)^2 / 2 + 1e-5 x^2 / 2` from beside (0.3, 0.09): a whole step goes along the valley, and out of its bend."""

    def bend(x: float, y: float) -> tuple[float, Any, Any]:
        off = y - x * x
        across = ((4.0 * x * x - 2.0 * off + 1e-5, -2.0 * x), (-2.0 * x, 1.0))
        return 0.5 * off * off + 0.5e-5 * x * x, (-2.0 * x * off + 1e-5 * x, off), across

    valley = Landscape(bend, 2, scale=1e10, tolerance=1e-15)
    start = np.array([0.3, 0.09 - 2e-5])
    state = valley.state(start)
    assert not valley.balanced(state)
    assert valley.state(start - np.linalg.solve(state.tangent, state.residual)).error > state.error
    y, spent, stable = valley.descend(*start)
    assert spent == 2  # the whole step, and the part of it against stiffness
    assert np.linalg.norm(y - start) < 3e-5
    assert abs(y[1] - y[0] ** 2) < 2e-6
    assert valley.balanced(valley.state(y))
    assert stable
    # Where that is not enough, it ends somewhere there.
    again, spent, stable = Landscape(bend, 2, scale=1e10, tolerance=1e-18).descend(*y)
    assert spent < 20
    assert stable
    assert valley.state(again).error < valley.state(y).error


def test_where_steps_are_lost_in_rounding_the_descent_ends() -> None:
    """Residuals that do not shrink: a step too short to change the number, and one against no stiffness to speak of."""
    stuck = Landscape(lambda x: (0.0, 1e-17, 1.0), 1, scale=1.0, tolerance=1e-20)
    assert stuck.descend(1.0) == (1.0, 2, True)
    soft = Landscape(lambda x: (0.0, 1e-13, 1e-5), 1, scale=1e10, tolerance=1e-30)
    assert soft.descend(1.0) == (1.0, 2, True)


# --- What else the solvers are made of


def test_settled_answers_where_the_springs_settle_and_nowhere_else(arm: sr.SoftModel) -> None:
    light, heavy = Load.of(arm, np.array([0.0, 10.0, -15.0])), Load.of(arm, np.array([150.0, 0.0, -100.0]))
    for method in ("newton", "fixed_point"):
        state = balanced_state(arm, MOTORS, light, REST, method=method)
        assert state is not None
        assert state.error <= largest_residual(arm, state.scale, 1e-10)
        rough = balanced_state(arm, MOTORS, light, BENT, method=method, tolerance=1e-2)
        assert rough is not None
        assert largest_residual(arm, state.scale, 1e-6) < rough.error <= largest_residual(arm, state.scale, 1e-2)
        fine = balanced_state(arm, MOTORS, light, REST, method=method, tolerance=1e-13)
        assert fine is not None
    assert balanced_state(arm, MOTORS, heavy, REST) is not None
    assert balanced_state(arm, MOTORS, heavy, REST, method="fixed_point") is None


def test_the_limits_of_the_descent(arm: sr.SoftModel) -> None:
    """What settles has at most the largest residual; what is too high is above rounding, too: 1e-14 of all energies."""
    case, k = ElasticProblem(arm, MOTORS, Load.of(arm, PUSH)), arm.stiffness[0]
    state = case.state(BENT)
    rounding = 1e-14 * (np.linalg.norm(PUSH) * arm.reach + k * BENT @ BENT + abs(state.energy))
    assert case.rounding(state) == pytest.approx(rounding, rel=1e-12, abs=0.0)
    most = largest_residual(arm, state.scale, 1e-10)
    assert case.balanced(state._replace(error=most))
    assert not case.balanced(state._replace(error=np.nextafter(most, 1.0)))
    for energy, change in ((0.0, -1e-15), (0.5, -0.25), (-3.0, -0.25)):
        level = state._replace(energy=energy)
        highest, rounding = energy + change, case.rounding(level)
        for share, expected in ((-2.0, False), (-0.5, False), (0.5, False), (1.0, False), (2.0, True)):
            assert case.too_high(state._replace(energy=highest + share * rounding), level, change) == expected


def test_settled_takes_the_largest_residual_itself(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    load = Load.of(arm, PUSH)
    state = elastic_state(arm, MOTORS, BENT, load)
    most = largest_residual(arm, state.scale, 1e-10)
    for error, taken in ((most, True), (np.nextafter(most, 1.0), False)):
        monkeypatch.setattr(elastostatics, "solve_springs", lambda *_, e=error, **__: (state._replace(error=e), 1, True))
        assert (balanced_state(arm, MOTORS, load, REST) is not None) == taken


def test_forces_of_muscles_have_a_potential_and_a_size(rng: np.random.Generator) -> None:
    """The residual is the slope of the energy; the scale counts the forces at the reach."""
    robot = sr.load_model(sr.PccArm(elastic_sections=1), muscles="forces")
    motors = rng.uniform(-10.0, 10.0, robot.n_motors)
    springs = robot.rest + 0.02 * rng.normal(size=robot.n_springs)
    load = Load.of(robot, PUSH / 10.0)
    state = elastic_state(robot, motors, springs, load)
    slope = central_difference(lambda y: np.array([elastic_state(robot, motors, y, load).energy]), springs, 1e-6)[0]
    assert state.residual == pytest.approx(slope, abs=1e-7)  # rounding of the energy over the step
    forces = motors[-len(robot.muscles) :]
    assert np.linalg.norm(forces) > 5.0
    expected = (np.linalg.norm(PUSH) / 10.0 + np.abs(forces).sum()) * robot.reach
    assert state.scale == pytest.approx(expected, rel=1e-14)


def test_a_section_beyond_its_range_is_nowhere() -> None:
    """A state of zeros that no solver accepts; its coordinates and the torques of its springs are what they are."""
    robot = sr.load_model(sr.PccArm(elastic_sections=1), muscles="forces")
    motors, n, m = np.array(robot.relaxed_motors), robot.n_springs, robot.n_motors
    springs = np.zeros(n)
    springs[0] = 7.0  # more than a turn
    load = Load.of(robot, np.array([1.0, 2.0, 3.0]), gravity=sr.EARTH_GRAVITY)
    state = elastic_state(robot, motors, springs, load)
    assert (state.energy, state.error, state.scale) == (math.inf, math.inf, 0.0)
    assert state.q_springs is springs
    assert state.q.shape == (robot.pinocchio.nq,)
    assert not state.point.valid
    for found, shape in zip(
        (state.residual, state.tangent, state.load.motors, state.load.elastic, state.load.derivative, state.load.coupling),
        ((n,), (n, n), (m,), (n,), (n, n), (n, m)),
        strict=True,
    ):
        assert np.array_equal(found, np.zeros(shape))
    assert (state.load.potential, state.load.scale) == (0.0, 0.0)
    inside = elastic_state(robot, motors, springs / 10.0, load)
    assert inside.point.valid
    assert state.spring_torques == pytest.approx(10.0 * inside.spring_torques, rel=1e-14)


def drawn_tangents(rng: np.random.Generator, count: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Stiffnesses `k`, tangents `K` and the solution of `K V = diag(k) V L`; the eigenvalues `L` are -0.3, 0.0004, 0.6, 3."""
    chosen = np.array([-0.3, 4e-4, 0.6, 3.0])
    for _ in range(count):
        stiffness = 10.0 ** rng.uniform(0.0, 3.0, 4)
        turn, _ = np.linalg.qr(rng.normal(size=(4, 4)))
        root = np.sqrt(stiffness)
        tangent = root[:, None] * (turn * chosen @ turn.T) * root
        tangent = 0.5 * (tangent + tangent.T)
        values, vectors = eigh(tangent, np.diag(stiffness))
        assert values == pytest.approx(chosen, abs=1e-12)
        yield stiffness, tangent, values, vectors


def test_a_step_against_stiffness_leaves_out_what_has_none(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """`-sum v (v^T r) / l` over the eigenvalues above a thousandth, of SciPy's generalised problem."""
    blank = elastic_state(arm, MOTORS, REST, Load.of(arm))
    for stiffness, tangent, values, vectors in drawn_tangents(rng, 5):
        residual = rng.normal(size=4)
        expected = -sum(v * (v @ residual) / value for value, v in zip(values[2:], vectors.T[2:], strict=True))
        found = _stiff_step(blank._replace(tangent=tangent, residual=residual), stiffness)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.linalg.norm(expected))


def test_an_escape_is_along_the_softest_direction_and_its_largest_part_positive(
    arm: sr.SoftModel, rng: np.random.Generator
) -> None:
    blank = elastic_state(arm, MOTORS, REST, Load.of(arm))
    signs = set()
    for stiffness, tangent, _, vectors in drawn_tangents(rng, 30):
        found = _escape(blank._replace(tangent=tangent), stiffness)
        softest = vectors[:, 0] * np.sign(vectors[np.argmax(np.abs(vectors[:, 0])), 0])
        assert found == pytest.approx(0.1 * softest / np.linalg.norm(softest), abs=1e-12)
        signs.add(softest[0] > 0.0)
        assert _escape(blank._replace(tangent=tangent + np.diag(0.3 * stiffness)), stiffness) is None
    assert signs == {True, False}  # the first part is not always the largest


def test_the_evaluations_that_are_spent_unless_others_are_asked_for(
    arm: sr.SoftModel, evaluations: list[np.ndarray], monkeypatch: pytest.MonkeyPatch
) -> None:
    """1000 of the recursion, where no equilibrium is found."""
    heavy = Load.of(arm, np.array([150.0, 0.0, -100.0]))
    assert solve_springs(arm, MOTORS, heavy, REST, method="fixed_point")[1] == 1000
    evaluations.clear()
    assert balanced_state(arm, MOTORS, heavy, REST, method="fixed_point") is None
    assert len(evaluations) == 1 + 1000
    asked = []
    monkeypatch.setattr(
        elastostatics, "solve_springs", lambda *given, **options: (asked.append(options), solve_springs(*given))[1]
    )
    balanced_state(arm, MOTORS, heavy, REST)
    balanced_state(arm, MOTORS, heavy, REST, method="newton", tolerance=1e-8)
    assert asked == [{"method": "newton", "tolerance": tolerance} for tolerance in (1e-10, 1e-8)]


def test_pivots_and_norms(arm: sr.SoftModel) -> None:
    from eigenpy import LDLT

    factors = LDLT(2)
    assert positive(factors, np.diag([1.0, 1e-12]))
    assert not positive(factors, np.diag([1.0, -1e-12]))
    assert not positive(factors, np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert norm(np.array([3.0, 4.0, 12.0])) == 13.0
    assert np.array_equal(scaled(np.array([[8.0, 6.0], [6.0, 36.0]]), np.array([4.0, 9.0])), [[2.0, 1.0], [1.0, 4.0]])


def test_a_symmetric_tangent_is_stable_above_rounding(arm: sr.SoftModel) -> None:
    root = np.sqrt(arm.stiffness)
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(4, 4)))
    for least, stable in ((-1.2e-9, False), (0.0, False), (0.8e-9, False), (1.2e-9, True), (1.0, True)):
        tangent = root[:, None] * (turn * np.array([2.0, 1.0, 0.5, least]) @ turn.T) * root
        assert is_positive(arm, 0.5 * (tangent + tangent.T)) == stable
    for lost in (math.nan, math.inf):
        assert not is_positive(arm, np.diag([lost, 1.0, 1.0, 1.0]))
