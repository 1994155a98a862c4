"""Compiled solvers of the arm: against Pinocchio's path, the DH table, printed numbers, and laws of mechanics."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run import compiled_code
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.conftest import missing
from tests.support.foreign import BRANCHED
from tests.support.load_cases import cases, directions
from tests.support.oracles import REFERENCE_EQUILIBRIA, arm_balance
from tests.support.tables import each_row

GRAVITY = np.array(sr.EARTH_GRAVITY)
STIFFNESS = sr.inflated_beam.MEAN_STIFFNESS
CRITICAL = 114.0657 * STIFFNESS / 172.71  # docs/theory.md 1.4 [N]
REACH = 1.2  # [m]


@pytest.fixture(scope="session")
def plain(arm: sr.SoftModel) -> CompiledModel:
    return sr.compile(arm, backend="python")


@pytest.fixture(scope="session")
def fast(arm: sr.SoftModel) -> CompiledModel:
    if importlib.util.find_spec("numba") is None:
        missing("numba is not installed")
    return sr.compile(arm, backend="numba")


@pytest.fixture(params=["python", pytest.param("numba", marks=pytest.mark.study)])  # numba compiles for seconds
def solver(request: pytest.FixtureRequest) -> CompiledModel:
    """The arm on both back ends."""
    return request.getfixturevalue("plain" if request.param == "python" else "fast")


@pytest.fixture(scope="session")
def three_links() -> CompiledModel:
    """Four motors, six springs."""
    return sr.compile(sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3))), backend="python")


@pytest.fixture(scope="session")
def one_link() -> CompiledModel:
    """Two motors, two springs."""
    return sr.compile(sr.load_model(sr.InflatableArm(link_lengths=(0.6,))), backend="python")


def apart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distance of each row from its counterpart, relative to that."""
    return np.asarray(np.linalg.norm(one - other, axis=-1) / np.linalg.norm(other, axis=-1))


def parts(batch: Any) -> dict[str, np.ndarray]:
    return {name: np.asarray(value) for name, value in vars(batch).items() if value is not None}


def assert_same_rows(one: Any, other: Any, rows: Any, others: Any) -> None:
    """The same bits."""
    for name, value in parts(one).items():
        assert np.array_equal(value[rows], parts(other)[name][others]), name


def assert_clean(batch: Any) -> None:
    for name, value in parts(batch).items():
        assert not np.any(np.isnan(value)), name
        assert not value.flags.writeable, name


# --- Equilibria


@pytest.mark.study
def test_ten_thousand_random_cases_equal_the_pinocchio_path(solver: CompiledModel, rng: np.random.Generator) -> None:
    """Every case at 18 N, from rest on both sides: 1e-10 relative. Pinocchio's path is asked for 1e-13."""
    motors, forces = cases(rng, 10_000, 18.0, 18.0)
    found = solver.equilibria(motors, forces)
    assert found.counts() == {Status.CERTIFIED: 10_000}
    # Numba's and NumPy's answers are one another's to rounding, see below; half of the cases for each saves a second.
    half = slice(0, 5000) if solver.backend == "numba" else slice(5000, 10_000)
    expected = [
        sr.solve_equilibrium(solver.model, q, f, tolerance=1e-13) for q, f in zip(motors[half], forces[half], strict=True)
    ]
    assert np.max(apart(found.q_springs[half], np.array([one.q_springs for one in expected]))) < 1e-10
    assert np.max(apart(found.tip_positions[half], np.array([one.tip_position for one in expected]))) < 1e-10


@pytest.mark.study
def test_every_one_of_1e5_hard_cases_is_certified_and_rightly_so(solver: CompiledModel, rng: np.random.Generator) -> None:
    """1-200 N: residual and smallest eigenvalue of the tangent, both from the DH table; fewer without numba."""
    count = 100_000 if solver.backend == "numba" else 2_000
    motors, forces = cases(rng, count, 1.0, 200.0)
    found = solver.equilibria(motors, forces)
    assert found.counts() == {Status.CERTIFIED: count}
    residual, tangent, tips = arm_balance(motors, found.q_springs, forces, STIFFNESS)
    size = np.linalg.norm(forces, axis=1) * REACH
    assert np.max(np.linalg.norm(residual, axis=1) / size) < 1e-10  # what CERTIFIED promises
    assert np.min(np.linalg.eigvalsh(tangent)) > 1e-9 * STIFFNESS
    assert np.max(np.abs(tips - found.tip_positions)) < 1e-13  # rounding of a metre
    # The residual that is told is the true one, but for rounding of torques of 100 N m.
    assert np.allclose(found.residual, np.linalg.norm(residual, axis=1), rtol=1e-3, atol=1e-12)


def test_the_branch_is_that_of_the_pinocchio_path(solver: CompiledModel, rng: np.random.Generator) -> None:
    """Both descend from rest. Of 300 cases at 150-200 N, where there are several equilibria, at most 1 % may differ."""
    motors, forces = cases(rng, 300, 150.0, 200.0)
    found = solver.equilibria(motors, forces)
    others = 0
    for row in range(300):
        expected = sr.solve_equilibrium(solver.model, motors[row], forces[row])
        here = sr.solve_equilibrium(solver.model, motors[row], forces[row], q_springs0=found.q_springs[row], tolerance=1e-9)
        assert expected.stable
        assert here.stable
        assert here.iterations <= 1
        others += np.linalg.norm(expected.q_springs - found.q_springs[row]) > 1e-6
    assert others <= 3


def test_theorys_table() -> None:
    """Five printed digits, at k = 172.71 N m/rad."""
    compiled = sr.compile(sr.load_model(sr.InflatableArm(stiffness=172.71)), backend="python")
    for motors, springs, tip in REFERENCE_EQUILIBRIA:
        found = compiled.equilibrium(motors, (0.0, 10.0, -15.0))
        assert np.allclose(found.q_springs, springs, rtol=0.0, atol=6e-6)
        assert np.allclose(found.tip_position, tip, rtol=0.0, atol=6e-6)
        assert np.array_equal(found.q_motors, motors)
        assert np.array_equal(found.force, (0.0, 10.0, -15.0))


@pytest.mark.study
@pytest.mark.parametrize("gravity", [GRAVITY, np.array([3.0, -2.0, 7.0])])
def test_gravity(solver: CompiledModel, gravity: np.ndarray, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 60, 0.0, 60.0)
    found = solver.equilibria(motors, forces, gravity=gravity)
    assert np.all(found.certified)
    for row in range(60):
        expected = sr.solve_equilibrium(solver.model, motors[row], forces[row], gravity=gravity, tolerance=1e-13)
        assert apart(found.q_springs[row], expected.q_springs) < 1e-10
        assert apart(found.tip_positions[row], expected.tip_position) < 1e-10
    for given in [gravity, tuple(gravity.tolist()), gravity.tolist()] * 2:  # all kinds of numbers, twice in a row
        one = solver.equilibrium(motors[0], forces[0], gravity=given)
        expected = sr.solve_equilibrium(solver.model, motors[0], forces[0], gravity=gravity, tolerance=1e-13)
        np.testing.assert_allclose(one.q_springs, expected.q_springs, rtol=0, atol=1e-9)  # as above
        assert one.stable


def test_buckling(solver: CompiledModel) -> None:
    """Below 114.0657 N along the axis the straight arm is stable; above it is a saddle, which is left."""
    pushes = CRITICAL * np.array([0.5, 0.999, 1.001, 1.1, 1.75])
    found = solver.equilibria(np.zeros(3), np.outer(pushes, (-1.0, 0.0, 0.0)))
    assert found.counts() == {Status.CERTIFIED: 5}
    assert np.all(found.q_springs[:2] == 0.0)
    for row in (2, 3, 4):
        assert np.linalg.norm(found.q_springs[row]) > 0.02
        single = solver.equilibrium(np.zeros(3), (-pushes[row], 0.0, 0.0))
        checked = sr.solve_equilibrium(solver.model, np.zeros(3), single.force, q_springs0=single.q_springs)
        assert checked.stable
        assert checked.iterations <= 1
    pulled = solver.equilibrium(np.zeros(3), (500.0, 0.0, 0.0))  # where the fixed point diverges
    assert np.all(pulled.q_springs == 0.0)


def test_a_start_chooses_among_several_equilibria(solver: CompiledModel) -> None:
    """A buckled arm may bow up or down, by symmetry equally far."""
    push = np.array([-1.3 * CRITICAL, 0.0, 0.0])
    up, down = (solver.equilibrium(np.zeros(3), push, q_springs0=(0.0, side, 0.0, side)) for side in (0.5, -0.5))
    assert up.q_springs[1] > 0.1
    assert np.allclose(up.q_springs, -down.q_springs, rtol=0.0, atol=1e-9)


def test_a_single_case_is_a_row_of_a_batch(solver: CompiledModel, rng: np.random.Generator) -> None:
    """To rounding, as sums may be contracted differently."""
    motors, forces = cases(rng, 100, 1.0, 100.0)
    found = solver.equilibria(motors, forces)
    for row in range(100):
        for q, f in ((motors[row], forces[row]), (motors[row].tolist(), tuple(forces[row]))):
            single = solver.equilibrium(q, f)
            assert np.allclose(single.q_springs, found.q_springs[row], rtol=0.0, atol=1e-12)
            assert single.residual <= 1e-10 * np.linalg.norm(f) * REACH
    one = solver.equilibria(motors, forces[0])  # one row for all
    other = solver.equilibria(motors, np.tile(forces[0], (100, 1)))
    assert_same_rows(one, other, slice(None), slice(None))
    assert solver.equilibria(motors[:0], forces[:0]).q_springs.shape == (0, 4)


def test_only_sections_have_strains_to_lock(plain: CompiledModel) -> None:
    with pytest.raises(sr.ParameterError, match="without sections"):
        sr.compile(plain.model, locked_strains=("twist",))
    with pytest.raises(sr.NameNotFound, match="shear"):
        sr.compile(plain.model, locked_strains=("shear",))
    for no_tuple in ("twist", 5):
        with pytest.raises(sr.ParameterError, match="a tuple of names, of bend_x"):
            sr.compile(plain.model, locked_strains=no_tuple)


# --- Lanes


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, GRAVITY])
def test_no_failure_touches_another(solver: CompiledModel, gravity: Any, rng: np.random.Generator) -> None:
    """NaN, infinities and monstrous numbers between good rows: those have the same bits as without."""
    motors, forces = cases(rng, 1000, 1.0, 200.0)
    clean = solver.equilibria(motors, forces, gravity=gravity)
    evil_motors, evil_forces = motors.copy(), forces.copy()
    none = {0: np.nan, 3: np.inf, 17: -np.inf, 127: 1e40, 128: -1e300, 999: np.nan}
    for row, value in none.items():
        (evil_forces if row % 2 else evil_motors)[row, row % 3] = value
    monstrous = {130: 1e6, 131: 1e9, 500: 1e15, 501: 1e29}
    for row, value in monstrous.items():
        evil_forces[row] = value * forces[row] / 200.0
    evil_motors[502] = 1e25
    found = solver.equilibria(evil_motors, evil_forces, gravity=gravity)
    assert_clean(found)
    bad = [*none, *monstrous, 502]
    good = np.setdiff1d(np.arange(1000), bad)
    assert_same_rows(found, clean, good, good)
    assert np.all(clean.certified)
    assert np.all(found.status[list(none)] == Status.NOT_A_NUMBER)
    assert np.all(np.isinf(found.residual[list(none)]))
    counts = found.counts()
    assert sum(counts.values()) == 1000
    assert counts[Status.NOT_A_NUMBER] >= len(none)
    for row in monstrous:  # whatever is certified is in balance to what the doubles can tell
        if found.status[row] == Status.CERTIFIED:
            assert found.residual[row] <= 1e-10 * (np.linalg.norm(evil_forces[row]) * 1.3 + 100.0)


def test_rows_do_not_depend_on_order_company_or_threads(solver: CompiledModel, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 20_000 if solver.backend == "numba" else 9000, 1.0, 200.0)
    whole = solver.equilibria(motors, forces)
    order = rng.permutation(len(motors))
    assert_same_rows(solver.equilibria(motors[order], forces[order]), whole, slice(None), order)
    for rows in (slice(0, 1), slice(5, 12), slice(100, 229)):
        assert_same_rows(solver.equilibria(motors[rows], forces[rows]), whole, slice(None), rows)
    assert_same_rows(solver.equilibria(motors, forces, threads=2), whole, slice(None), slice(None))


def test_two_threads_may_share_a_model(solver: CompiledModel, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 400, 1.0, 100.0)
    alone = [solver.equilibrium(q, f).q_springs for q, f in zip(motors, forces, strict=True)]
    batch = solver.equilibria(motors, forces)
    with ThreadPoolExecutor(2) as pool:
        singles = pool.map(lambda row: solver.equilibrium(motors[row], forces[row]).q_springs, range(400))
        batches = [pool.submit(solver.equilibria, motors[half], forces[half]) for half in (slice(0, 200), slice(200, 400))]
        assert all(np.array_equal(one, other) for one, other in zip(singles, alone, strict=True))
        for future, half in zip(batches, (slice(0, 200), slice(200, 400)), strict=True):
            assert_same_rows(future.result(), batch, slice(None), half)


# --- Load estimation


def measured(model: sr.SoftModel, motors: np.ndarray, forces: np.ndarray, gravity: Any = None) -> np.ndarray:
    """Motor torques by Pinocchio's path."""
    return np.array(
        [
            sr.solve_equilibrium(model, q, f, gravity=gravity, tolerance=1e-13).motor_torques
            for q, f in zip(motors, forces, strict=True)
        ]
    )


def assert_explains(compiled: CompiledModel, motors: np.ndarray, torques: np.ndarray, found: Any, row: int) -> None:
    """The force is in equilibrium with the torques, says Pinocchio's path."""
    checked = sr.solve_equilibrium(compiled.model, motors[row], found.forces[row], q_springs0=found.q_springs[row])
    assert checked.stable
    assert np.allclose(checked.q_springs, found.q_springs[row], rtol=0.0, atol=1e-8)
    assert np.allclose(checked.motor_torques, torques[row], rtol=0.0, atol=1e-8)


@pytest.mark.study
def test_estimates_are_the_true_force(solver: CompiledModel, rng: np.random.Generator) -> None:
    """To 1e-8 where every direction is well felt; elsewhere another force may explain the torques, too."""
    motors, forces = cases(rng, 200, 1.0, 30.0)
    torques = measured(solver.model, motors, forces)
    found = solver.estimate_loads(motors, torques)
    assert_clean(found)
    well = found.observability > 0.05
    assert np.count_nonzero(well) > 150
    assert np.all(found.certified[well])
    assert np.max(apart(found.forces[well], forces[well])) < 1e-8
    for row in np.flatnonzero(found.certified & ~well):
        assert_explains(solver, motors, torques, found, row)
    assert np.all(found.certified | (found.observability < 0.01))
    assert np.max(found.unexplained[found.certified]) < 1e-8
    single = solver.estimate_load(motors[np.argmax(well)], torques[np.argmax(well)])
    assert apart(single.force, forces[np.argmax(well)]) < 1e-8
    assert single.unexplained < 1e-8
    assert single.residual < 1e-8
    assert "force" in repr(single)


def test_observability_is_the_smallest_singular_value_of_the_elastostatic_jacobian(
    plain: CompiledModel, three_links: CompiledModel, rng: np.random.Generator
) -> None:
    for compiled in (plain, three_links):
        motors, forces = cases(rng, 30, 1.0, 30.0, compiled.model.n_motors)
        found = compiled.estimate_loads(motors, measured(compiled.model, motors, forces))
        for row in np.flatnonzero(found.certified):
            settled = sr.solve_equilibrium(compiled.model, motors[row], found.forces[row], q_springs0=found.q_springs[row])
            expected = np.linalg.svd(sr.elastostatic_jacobian(compiled.model, settled), compute_uv=False)[2]
            # By five Newton steps from zero on its square, which comes from below.
            assert 0.95 * expected < found.observability[row] < 1.0001 * expected


@pytest.mark.study
@each_row("motors", [(0.4, 0.3, 0.0), (0.2, np.pi / 2.0 - 0.4, 0.8)])
def test_hidden_forces_are_said_to_be_hidden(solver: CompiledModel, motors: tuple[float, float, float]) -> None:
    """Without load: along a straight arm; and sideways where the tip is above the first motor."""
    torques = measured(solver.model, np.array([motors]), np.zeros((1, 3)))
    found = solver.estimate_loads(np.array([motors]), torques)
    assert found.counts() == {Status.UNOBSERVABLE: 1}
    assert found.observability[0] < 1e-3 * REACH
    assert found.unexplained[0] <= 1e-8
    with pytest.raises(sr.LoadNotFound, match="do not feel every direction") as caught:
        solver.estimate_load(motors, torques[0])
    assert np.all(np.isfinite(caught.value.best.force))
    assert len(sr.estimate_load(solver.model, motors, torques[0]).unobservable_directions) == 1


def test_torques_that_no_force_explains(solver: CompiledModel) -> None:
    """The straight elbow takes the third motor's torque from the second; Pinocchio's path finds none, either."""
    motors, torques = np.zeros(3), np.array([0.0, 5.0, 50.0])
    found = solver.estimate_loads(motors, torques)
    assert found.counts() == {Status.NOT_REACHED: 1}
    assert found.unexplained[0] > 1.0
    assert_clean(found)
    for estimate in (solver.estimate_load, lambda q, t: sr.estimate_load(solver.model, q, t)):
        with pytest.raises(sr.LoadNotFound, match="explains"):
            estimate(motors, torques)


def test_four_motors_fit_a_force(three_links: CompiledModel, rng: np.random.Generator) -> None:
    """Least squares; what the force leaves is told, and what it leaves cannot be made less by a small change of it."""
    motors, forces = cases(rng, 60, 1.0, 30.0, 4)
    torques = measured(three_links.model, motors, forces)
    found = three_links.estimate_loads(motors, torques)
    well = found.observability > 0.02
    assert np.count_nonzero(well) > 50
    assert np.max(apart(found.forces[well], forces[well])) < 1e-8
    noisy = torques + rng.normal(scale=0.05, size=torques.shape)
    fitted = three_links.estimate_loads(motors, noisy)
    assert np.all(fitted.certified[well])
    for row in np.flatnonzero(well)[:20]:
        expected = sr.estimate_load(three_links.model, motors[row], noisy[row])
        assert np.linalg.norm(expected.force - fitted.forces[row]) < 1e-6 * np.linalg.norm(expected.force)
        settled = sr.solve_equilibrium(three_links.model, motors[row], fitted.forces[row])
        left = noisy[row] - settled.motor_torques
        assert np.isclose(fitted.unexplained[row], np.linalg.norm(left), rtol=1e-6)
        # The force acts on the torques by the transposed elastostatic Jacobian.
        assert np.linalg.norm(sr.elastostatic_jacobian(three_links.model, settled) @ left) < 1e-7


def test_two_motors_never_feel_a_whole_force(one_link: CompiledModel, rng: np.random.Generator) -> None:
    """The force explains the torques, but so do others: never an answer."""
    motors, forces = cases(rng, 20, 1.0, 20.0, 2)
    torques = measured(one_link.model, motors, forces)
    found = one_link.estimate_loads(motors, torques)
    assert found.counts() == {Status.UNOBSERVABLE: 20}
    assert np.all(found.observability == 0.0)
    for row in range(20):
        assert_explains(one_link, motors, torques, found, row)
    with pytest.raises(sr.LoadNotFound, match="do not feel every direction"):
        one_link.estimate_load(motors[0], torques[0])


def test_no_estimate_touches_another(solver: CompiledModel, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 300, 1.0, 30.0)
    torques = measured(solver.model, motors, forces)
    clean = solver.estimate_loads(motors, torques)
    evil = torques.copy()
    evil[[0, 77, 299], 1] = np.nan, np.inf, 1e40
    evil[[5, 128]] *= [[1e6], [1e28]]
    found = solver.estimate_loads(motors, evil)
    assert_clean(found)
    good = np.setdiff1d(np.arange(300), [0, 5, 77, 128, 299])
    assert_same_rows(found, clean, good, good)
    assert np.all(found.status[[0, 77, 299]] == Status.NOT_A_NUMBER)
    assert np.all(np.isinf(found.unexplained[[0, 77, 299]]))


# --- Inverse kinematics


def assert_arrived(compiled: CompiledModel, found: Any, targets: np.ndarray, forces: np.ndarray, rows: Any) -> None:
    """Certified rows are at their targets within the limits, in equilibria of Pinocchio's path."""
    limits = compiled.model.motor_limits
    for row in rows:
        checked = sr.solve_equilibrium(compiled.model, found.q_motors[row], forces[row], q_springs0=found.q_springs[row])
        assert checked.stable
        assert checked.iterations <= 1
        assert np.linalg.norm(checked.tip_position - targets[row]) < 1.1e-9
        assert np.all((found.q_motors[row] >= limits[:, 0] - 1e-9) & (found.q_motors[row] <= limits[:, 1] + 1e-9))


@pytest.mark.study
def test_targets_made_by_equilibria_are_reached(solver: CompiledModel, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 200, 1.0, 30.0)
    motors *= 0.8
    targets = solver.equilibria(motors, forces).tip_positions
    start = motors + rng.normal(scale=0.05, size=motors.shape)
    found = solver.inverse_kinematics(targets, forces, q_motors0=start)
    assert_clean(found)
    assert np.count_nonzero(found.certified) >= 198  # a start may lie on the other side of a singular pose
    assert np.count_nonzero(np.linalg.norm(found.q_motors - motors, axis=1) < 1e-6) > 166
    assert np.max(found.tip_error[found.certified]) <= 1e-9
    assert_arrived(solver, found, targets, forces, np.flatnonzero(found.certified)[:50])


@pytest.mark.study
def test_the_default_start_is_singular_and_does_not_matter(solver: CompiledModel, rng: np.random.Generator) -> None:
    """At zero the elbow is straight: the first step is damped. Newton from one start need not find every target."""
    motors, forces = cases(rng, 100, 1.0, 15.0)
    motors *= 0.3
    targets = solver.equilibria(motors, forces).tip_positions
    found = solver.inverse_kinematics(targets, forces)
    assert np.count_nonzero(found.certified) > 60
    assert set(found.counts()) <= {Status.CERTIFIED, Status.NOT_REACHED}
    assert_arrived(solver, found, targets, forces, np.flatnonzero(found.certified))


def test_unreachable_targets_say_so(solver: CompiledModel, rng: np.random.Generator) -> None:
    targets = directions(rng, 30) * rng.uniform(1.6, 50.0, (30, 1))  # springs do not stretch: nothing beyond 1.2 m
    found = solver.inverse_kinematics(targets, (0.0, 0.0, 5.0), q_motors0=(0.1, 0.2, 0.3))
    assert not np.any(found.certified)
    assert set(found.counts()) <= {Status.NOT_REACHED, Status.UNSETTLED, Status.UNSTABLE}
    assert np.all(found.tip_error >= np.linalg.norm(targets, axis=1) - REACH - 1e-9)
    assert_clean(found)


def test_limits(rng: np.random.Generator) -> None:
    """Targets of motors inside and outside narrow limits: an answer is inside, or there is none."""
    narrow = sr.compile(sr.load_model(sr.InflatableArm(motor_limit=1.0)), backend="python")
    motors, forces = cases(rng, 200, 1.0, 15.0)
    motors *= 1.4 / np.pi
    targets = narrow.equilibria(motors, forces).tip_positions
    found = narrow.inverse_kinematics(targets, forces, q_motors0=motors)
    inside = np.all(np.abs(motors) < 1.0, axis=1)
    assert 40 < np.count_nonzero(inside) < 150
    assert np.all(found.certified[inside])
    assert np.max(np.abs(found.q_motors[inside] - motors[inside])) < 1e-6
    assert set(found.counts()) <= {Status.CERTIFIED, Status.NOT_REACHED, Status.BEYOND_LIMITS}
    assert_arrived(narrow, found, targets, forces, np.flatnonzero(found.certified))
    assert np.count_nonzero(found.status[~inside] == Status.BEYOND_LIMITS) > 0


def test_motors_to_spare_and_too_few(three_links: CompiledModel, one_link: CompiledModel, rng: np.random.Generator) -> None:
    for compiled in (three_links, one_link):
        count = compiled.model.n_motors
        motors, forces = cases(rng, 100, 1.0, 20.0, count)
        motors *= 0.6
        targets = compiled.equilibria(motors, forces, gravity=GRAVITY).tip_positions
        start = motors + rng.normal(scale=0.05, size=motors.shape)
        found = compiled.inverse_kinematics(targets, forces, q_motors0=start, gravity=GRAVITY)
        assert np.count_nonzero(found.certified) >= 98
        tips = compiled.equilibria(found.q_motors, forces, gravity=GRAVITY).tip_positions
        assert np.max(np.linalg.norm(tips - targets, axis=1)[found.certified]) < 1.1e-9
        if count == 2:  # two motors put the tip on a surface only
            aside = compiled.inverse_kinematics(targets * 1.2, forces, q_motors0=motors, gravity=GRAVITY)
            assert aside.counts() == {Status.NOT_REACHED: 100}


def test_no_target_touches_another(solver: CompiledModel, rng: np.random.Generator) -> None:
    motors, forces = cases(rng, 300, 1.0, 20.0)
    targets = solver.equilibria(0.7 * motors, forces).tip_positions
    clean = solver.inverse_kinematics(targets, forces, q_motors0=0.7 * motors + 0.02)
    evil_targets, evil_forces, start = targets.copy(), forces.copy(), 0.7 * motors + 0.02
    evil_targets[0], evil_targets[9], evil_targets[128] = np.nan, 1e40, 1e6
    evil_forces[20], evil_forces[21] = np.inf, 1e20
    start[30], start[31] = np.nan, 1e12
    found = solver.inverse_kinematics(evil_targets, evil_forces, q_motors0=start)
    assert_clean(found)
    good = np.setdiff1d(np.arange(300), [0, 9, 20, 21, 30, 31, 128])
    assert_same_rows(found, clean, good, good)
    assert np.all(found.status[[0, 9, 20, 30]] == Status.NOT_A_NUMBER)
    assert np.all(np.isinf(found.tip_error[[0, 9, 20, 30]]))
    assert found.status[128] != Status.CERTIFIED


# --- Paths


def circle(count: int, centre: tuple[float, float, float] = (0.75, 0.1, 0.3), radius: float = 0.2) -> np.ndarray:
    turn = np.linspace(0.0, 2.0 * np.pi, count)
    return np.asarray(np.array(centre) + radius * np.array([np.zeros(count), np.cos(turn), np.sin(turn)]).T)


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, GRAVITY])
def test_two_hundred_waypoints(plain: CompiledModel, fast: CompiledModel, gravity: Any) -> None:
    targets, force = circle(200), np.array([0.0, 10.0, -15.0])
    for compiled in (plain, fast) if gravity is None else (plain,):
        found = compiled.follow(targets, force, gravity=gravity)
        assert found.counts() == {Status.CERTIFIED: 200}
        assert np.max(found.tip_error) <= 1e-9
        assert_clean(found)
        expected = sr.follow_trajectory(compiled.model, targets[::20], force, gravity=gravity)
        assert np.max(np.abs(found.q_motors[::20] - expected.q_motors)) < 1e-8
        tips = compiled.equilibria(found.q_motors, force, gravity=gravity)
        assert np.max(np.linalg.norm(tips.tip_positions - targets, axis=1)) < 1.1e-9
        assert np.max(np.abs(tips.q_springs - found.q_springs)) < 1e-8
        again = compiled.follow(targets, force, gravity=gravity, q_motors0=found.q_motors[0])
        assert np.max(np.abs(again.q_motors - found.q_motors)) < 1e-8
    with pytest.raises(sr.ParameterError, match="finite"):
        plain.follow(np.full((3, 3), np.nan), force)


def test_a_closed_path_ends_where_it_began_and_a_straight_start_is_no_obstacle(solver: CompiledModel) -> None:
    found = solver.follow(circle(60), (1.0, 2.0, -3.0), q_motors0=np.zeros(3))
    assert np.all(found.certified)
    assert np.allclose(found.q_motors[0], found.q_motors[-1], rtol=0.0, atol=1e-8)


def test_few_waypoints_far_apart(solver: CompiledModel) -> None:
    """Between two it goes by smaller steps, so that the same elbow arrives as on a fine path."""
    coarse, fine = solver.follow(circle(5), (0.0, 5.0, 5.0)), solver.follow(circle(201), (0.0, 5.0, 5.0))
    assert np.all(coarse.certified)
    assert np.allclose(coarse.q_motors, fine.q_motors[::50], rtol=0.0, atol=1e-8)
    one = solver.follow(circle(5)[:1], (0.0, 5.0, 5.0))
    assert np.allclose(one.q_motors[0], fine.q_motors[0], rtol=0.0, atol=1e-8)


def test_a_waypoint_out_of_reach_marks_only_itself(solver: CompiledModel) -> None:
    targets = circle(50)
    clean = solver.follow(targets, (0.0, 5.0, 5.0))
    targets[20], targets[33] = (3.0, 0.0, 0.0), (0.0, 0.0, 9.0)
    found = solver.follow(targets, (0.0, 5.0, 5.0))
    assert found.counts() == {Status.CERTIFIED: 48, Status.NOT_REACHED: 2}
    assert np.flatnonzero(~found.certified).tolist() == [20, 33]
    assert np.all(found.tip_error[[20, 33]] > 1.0)
    assert np.all(np.isfinite(found.q_motors))
    others = found.certified
    assert np.max(np.abs(found.q_motors[others] - clean.q_motors[others])) < 1e-8


def test_a_path_beyond_the_limits_of_a_motor() -> None:
    narrow = sr.compile(sr.load_model(sr.InflatableArm(motor_limit=1.3)), backend="python")
    turn = np.linspace(0.0, 1.8, 40)
    targets = np.array([np.cos(turn), np.sin(turn), np.full(40, 0.1)]).T
    found = narrow.follow(targets, (0.0, 0.0, -5.0))
    assert 20 < np.count_nonzero(found.certified) < 35
    assert np.all(np.abs(found.q_motors[found.certified]) <= 1.3 + 1e-9)
    assert set(found.counts()) <= {Status.CERTIFIED, Status.NOT_REACHED, Status.BEYOND_LIMITS}


@pytest.mark.study
def test_a_first_waypoint_out_of_reach(solver: CompiledModel) -> None:
    for start in (None, (0.1, 0.2, 0.3)):
        with pytest.raises(sr.TargetUnreachable) as caught:
            solver.follow([(4.0, 0.0, 0.0), (0.7, 0.0, 0.0)], (0.0, 0.0, -5.0), q_motors0=start)
        assert "nan" not in str(caught.value)


# --- What is refused


@each_row(
    ("call", "words"),
    [
        (lambda c: c.equilibrium((0.0, 0.0)), "q_motors"),
        (lambda c: c.equilibrium((0.0, 0.0, np.nan)), "q_motors"),
        (lambda c: c.equilibrium(np.array([0.0, 0.0, np.inf])), "q_motors"),
        (lambda c: c.equilibrium(np.zeros(3), np.array([np.nan, 0.0, 0.0])), "force"),
        (lambda c: c.equilibrium(np.zeros(3), np.array([1e40, 0.0, 0.0])), "force"),
        (lambda c: c.equilibrium(np.zeros(3), (1.0, 2.0)), "force"),
        (lambda c: c.equilibrium(np.zeros(3), "up"), "force"),
        (lambda c: c.equilibrium(np.zeros(3), gravity=(0.0, np.nan, 0.0)), "gravity"),
        (lambda c: c.equilibrium(np.zeros(3), gravity=np.array([0.0, np.nan, 0.0])), "gravity"),
        (lambda c: c.equilibrium(np.zeros(3), q_springs0=(0.0, 0.0)), "q_springs0"),
        (lambda c: c.equilibrium(np.zeros(3), q_springs0=(0.0, 0.0, 0.0, np.inf)), "q_springs0"),
        (lambda c: c.equilibria(np.zeros((4, 2)), np.zeros(3)), "q_motors"),
        (
            lambda c: c.equilibria(np.zeros((4, 3)), np.zeros((5, 3))),
            r"^q_motors = array\(.*: q_motors must be of as many rows as the others have \(q_motors 4, forces 5\)$",
        ),
        (lambda c: c.equilibria(np.zeros((4, 3)), np.zeros((2, 2, 3))), "forces"),
        (lambda c: c.equilibria([["a", "b", "c"]], np.zeros(3)), "q_motors"),
        (lambda c: c.equilibria(np.zeros((4, 3)), np.zeros(3), gravity=(0.0, 0.0)), "gravity"),
        (lambda c: c.equilibria(np.zeros((4, 3)), np.zeros(3), gravity=(0.0, 0.0, np.nan)), "gravity"),
        (lambda c: c.equilibria(np.zeros((4, 3)), np.zeros(3), threads=0), "threads"),
        (lambda c: c.equilibria(np.zeros((4, 3)), np.zeros(3), threads=1.5), "threads"),
        (lambda c: c.estimate_load(np.zeros(3), np.zeros(2)), "motor_torques"),
        (lambda c: c.estimate_load(np.zeros(3), np.array([0.0, 0.0, np.nan])), "motor_torques"),
        (lambda c: c.estimate_loads(np.zeros(3), np.zeros((4, 4))), "motor_torques"),
        (lambda c: c.estimate_loads(np.zeros(3), np.zeros((4, 3)), threads=-1), "threads"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 2))), "targets"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 3)), tolerance=0.0), "tolerance"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 3)), tolerance=np.nan), "tolerance"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 3)), q_motors0=np.zeros((3, 3))), "as many rows"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 3)), q_springs0=np.zeros(3)), "q_springs0"),
        (lambda c: c.inverse_kinematics(np.zeros((4, 3)), threads=0), "threads"),
        (lambda c: c.follow(np.zeros((0, 3))), "at least one"),
        (lambda c: c.follow(np.zeros((2, 2))), "targets"),
        (lambda c: c.follow(np.full((2, 3), 0.5), (1.0, 2.0)), "force"),
        (lambda c: c.follow(np.full((2, 3), 0.5), q_motors0=(0.0, np.nan, 0.0)), "q_motors0"),
        (lambda c: c.follow(np.full((2, 3), 0.5), tolerance=-1.0), "tolerance"),
        (lambda c: c.c_source(prefix="2 bad"), "prefix"),
    ],
)
def test_bad_input(plain: CompiledModel, call: Any, words: str) -> None:
    with pytest.raises(sr.ParameterError, match=words):
        call(plain)


def test_fast_calls_refuse_bad_input_too(plain: CompiledModel) -> None:
    """Arrays of the right kind go straight into the compiled code; what comes out tells what came in."""
    for motors, force in ((np.array([0.0, np.nan, 0.0]), np.ones(3)), (np.ones(3), np.array([np.inf, 0.0, 0.0]))):
        with pytest.raises(sr.ParameterError, match="finite"):
            plain.equilibrium(motors, force)
        with pytest.raises(sr.ParameterError, match="finite"):
            plain.estimate_load(motors, force)
    with pytest.raises(sr.ParameterError, match="at most"):
        plain.estimate_load(np.ones(3), np.array([1e200, 0.0, 0.0]))  # its square is infinite


def test_robots_that_cannot_be_compiled(plain: CompiledModel) -> None:
    with pytest.raises(sr.DescriptionError, match=r"saturat|largest moment|linear"):
        sr.compile(sr.load_model(sr.InflatableArm(max_moment=20.0)))
    with pytest.raises(sr.DescriptionError):  # "gripper" is on another branch
        sr.compile(sr.load_model(BRANCHED, springs={"wrist": 20.0, "gripper": 30.0}, tip="finger"))
    with pytest.raises(sr.ParameterError, match="model"):
        sr.compile("arm")
    with pytest.raises(sr.ParameterError, match=r"numba.*python"):
        sr.compile(plain.model, backend="cuda")


def test_without_numba(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "numba" else found(name, *rest))
    assert sr.compile(arm).backend == "python"
    with pytest.raises(sr.MissingDependency, match=r"softrobots\[fast\]"):
        sr.compile(arm, backend="numba")


# --- What is opt-in


def test_a_process_that_does_not_ask_for_numba_does_not_import_it() -> None:
    code = (
        "import sys, numpy, softrobots\n"
        "assert 'numba' not in sys.modules\n"
        "model = softrobots.load_model(softrobots.InflatableArm())\n"
        "compiled = softrobots.compile(model, backend='python')\n"
        "compiled.equilibria(numpy.zeros((9, 3)), numpy.ones(3))\n"
        "assert 'numba' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_nothing_else_compiles_silently(arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any, **__: Any) -> None:
        raise AssertionError("compiled without being asked")

    monkeypatch.setattr(compiled_code, "make_program", refuse)
    monkeypatch.setattr(compiled_code, "make_run", refuse)
    settled = sr.solve_equilibrium(arm, (0.1, 0.2, 0.3), (0.0, 5.0, -5.0))
    sr.estimate_load(arm, settled.q_motors, settled.motor_torques)
    sr.solve_ik(arm, (0.8, 0.1, 0.2), (0.0, 5.0, -5.0))
    sr.follow_trajectory(arm, [(0.8, 0.1, 0.2), (0.8, 0.1, 0.21)])
    sr.sample_workspace(arm, 3)
    with pytest.raises(AssertionError, match="without being asked"):
        sr.compile(arm).equilibrium((0.1, 0.2, 0.3))


def test_what_is_printed(plain: CompiledModel) -> None:
    assert repr(plain) == "CompiledModel('inflatable_arm', backend='python')"
    text = plain.source()
    compile(text, "generated", "exec")  # it is Python
    assert "def settle(" in text
    assert "gravity" in plain.source(gravity=True).splitlines()[0]
    assert len(plain.source(lanes=True)) > len(text)
    assert "settle_batch" in plain.source(lanes=True)
    assert text == sr.compile(plain.model, backend="python").source()
    found = plain.equilibrium((0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert "CERTIFIED" in repr(found)
    for name, value in zip(plain.model.spring_joints, found.q_springs, strict=True):
        assert re.search(rf"^{name} +{value:.6f}  rad$", str(found), re.M)
    for part in (found.q_springs, found.q_motors, found.force, found.tip_position):
        assert not part.flags.writeable
    assert {one.explanation for one in Status} >= {"certified stable"}
