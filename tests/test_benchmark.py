"""The benchmark measures what it says: baselines give the right answers, ratios are of one round, what is missing is named."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.statics.kinematics import frame_placement
from studies.benchmark import (
    cases,
    compiled_solvers,
    contact_jobs,
    motion_jobs,
    mujoco_settling,
    pinocchio_solvers,
    processes,
    tendon_jobs,
)
from studies.benchmark.aligned_joints import aligned_joints
from studies.benchmark.cases import FORCE, ROD_LENGTH, ROD_STIFFNESS, path_targets, rod, rod_forces, standard_cases
from studies.benchmark.comparison import Comparison, Settings, figure, quick_settings
from studies.benchmark.jobs import JOBS, measure
from studies.benchmark.measurement import Workload, interleaved, ratio, require_agreement
from studies.benchmark.mujoco_motion import MujocoMotion, Released, tip_error
from studies.benchmark.mujoco_settling import SettlingArm
from studies.benchmark.numpy_arrays import ArrayArm
from studies.benchmark.pictures import PICTURES
from studies.benchmark.pink_kinematics import PinkArm
from studies.benchmark.pinocchio_solvers import NEWTON, PinocchioArm
from studies.benchmark.results import AT_LEAST, AT_MOST, Curve, Results, Row, as_json, read_results, require_whole, table
from studies.benchmark.scipy_solvers import scipy_root
from tests.conftest import CHECKOUT, load_script, missing
from tests.support.tables import each_row

pytestmark = pytest.mark.study

SAME = 1e-8
"""[rad]: residuals are below 1e-10 f L, 2e-9 N m, over at least 80 N m/rad, which a load can soften by a few times."""
RECORDED = CHECKOUT / "docs" / "benchmark.json"


def cases_of(model: sr.SoftModel, count: int, size: float) -> list[tuple[np.ndarray, np.ndarray]]:
    random = np.random.default_rng(5)
    forces = random.normal(size=(count, 3))
    forces *= size / np.linalg.norm(forces, axis=1, keepdims=True)
    return list(zip(random.uniform(-np.pi, np.pi, (count, model.n_motors)), forces, strict=True))


def equilibria(model: sr.SoftModel, cases: list, gravity: object = None) -> np.ndarray:
    return np.array([sr.solve_equilibrium(model, *case, gravity=gravity, tolerance=1e-13).q_springs for case in cases])


@pytest.fixture(params=["arm", "odd_arm"])
def robot(request: pytest.FixtureRequest) -> sr.SoftModel:
    """The paper's arm, and one whose links differ and whose springs are bent at rest."""
    return request.getfixturevalue(request.param)


# --- Baselines against the general solver


@pytest.mark.parametrize("solve", [pinocchio_solvers.fixed_point, pinocchio_solvers.plain_fixed_point, *NEWTON.values()])
def test_pinocchio_solvers_find_the_equilibria(robot: sr.SoftModel, solve: Callable) -> None:
    cases, bare = cases_of(robot, 8, FORCE), PinocchioArm(robot)
    found = np.array([solve(bare, *case)[robot.spring_indices] for case in cases])
    assert np.abs(found - equilibria(robot, cases)).max() < SAME


@pytest.mark.parametrize("solve", [pinocchio_solvers.fixed_point, pinocchio_solvers.newton_by_torque_derivatives])
def test_pinocchio_solvers_find_the_equilibria_under_gravity(robot: sr.SoftModel, solve: Callable) -> None:
    cases, bare = cases_of(robot, 8, FORCE), PinocchioArm(robot, sr.EARTH_GRAVITY)
    found = np.array([solve(bare, *case)[robot.spring_indices] for case in cases])
    assert np.abs(found - equilibria(robot, cases, sr.EARTH_GRAVITY)).max() < SAME
    assert np.abs(found - equilibria(robot, cases)).max() > 1e-4  # the weight is felt


@pytest.mark.parametrize("form", list(NEWTON))
def test_newton_has_the_exact_derivative(arm: sr.SoftModel, form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong one, e.g. that of a follower load, converges slowly: three steps are enough for quadratic convergence only."""
    monkeypatch.setattr(pinocchio_solvers, "_MOST_NEWTON", 4)
    cases, bare = cases_of(arm, 8, FORCE), PinocchioArm(arm)
    found = np.array([NEWTON[form](bare, *case)[arm.spring_indices] for case in cases])
    assert np.abs(found - equilibria(arm, cases)).max() < SAME


def test_scipys_solver_finds_the_equilibria(robot: sr.SoftModel) -> None:
    cases, bare = cases_of(robot, 4, FORCE), PinocchioArm(robot)
    found = np.array([scipy_root()(bare, *case)[robot.spring_indices] for case in cases])
    assert np.abs(found - equilibria(robot, cases)).max() < SAME


def test_array_operations_find_the_equilibria(robot: sr.SoftModel) -> None:
    cases = cases_of(robot, 8, FORCE)
    motors, forces = (np.array(part) for part in zip(*cases, strict=True))
    assert np.abs(ArrayArm(robot).equilibria(motors, forces) - equilibria(robot, cases)).max() < SAME


def test_array_operations_say_when_they_fail(arm: sr.SoftModel) -> None:
    motors, forces = (np.array(part) for part in zip(*cases_of(arm, 30, 2000.0), strict=True))
    with pytest.raises(sr.NotConverged, match=r"\d+ of 30 cases did not converge in 50 iterations"):
        ArrayArm(arm).equilibria(motors, forces)


def test_aligned_joints_are_those_of_pinocchio(robot: sr.SoftModel) -> None:
    q = np.random.default_rng(0).uniform(-2.0, 2.0, robot.pinocchio.nv)
    linear, angular = ArrayArm(robot).jacobians(q[None])
    data = robot.pinocchio.createData()
    frame = robot.frame_id(robot.tip)
    expected = pin.computeFrameJacobian(robot.pinocchio, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
    assert np.allclose(np.vstack([linear[0], angular[0]]), expected[:, robot.spring_indices], atol=1e-13)


def test_sliding_joints_are_known_and_branches_refused() -> None:
    hinges = rod(2, "lumped")
    assert aligned_joints(hinges).slides == (False,) * 4
    sliding = sr.load_model(sr.PccArm(chain="lumped", hinges=1, muscle_azimuths=(), segment_lengths=(0.5,)))
    assert sum(aligned_joints(sliding).slides) == 1
    with pytest.raises(sr.ParameterError, match="robot of revolute joints"):
        ArrayArm(sliding)
    inner = sr.load_model(sr.InflatableArm(), tip="link_1")
    with pytest.raises(sr.ParameterError, match="without branches"):
        aligned_joints(inner)


@pytest.mark.parametrize("setting", [(0.01, 8.0, 20), (0.2, 40.0, 20)], ids=["simulation", "relaxation"])
def test_mujoco_settles_in_the_equilibria(tool: Callable, arm: sr.SoftModel, setting: tuple) -> None:
    tool("mujoco")
    cases, simulator = cases_of(arm, 4, FORCE), SettlingArm(arm)
    simulator.set(*setting)
    found = np.array([simulator.settle(*case)[0] for case in cases])
    assert np.abs(found - equilibria(arm, cases)).max() < SAME


def test_the_best_settings_of_mujoco_are_chosen(tool: Callable, arm: sr.SoftModel, tmp_path: Path, monkeypatch) -> None:
    tool("mujoco")
    monkeypatch.chdir(tmp_path)
    motors, forces = (np.array(part) for part in zip(*cases_of(arm, 2, FORCE), strict=True))
    simulator = SettlingArm(arm)
    tried = simulator.tune(motors, forces, time_steps=(0.01, 5.0), dampings=(8.0, 0.01), strides=(20,))
    assert len(tried) == 4
    assert (tried[0].time_step, tried[0].damping) == (0.01, 8.0)
    assert tried[-1].seconds == float("inf")
    assert simulator.model.opt.timestep == 0.01
    with pytest.raises(sr.NotConverged, match="none of the settings"):
        simulator.tune(motors, forces, time_steps=(5.0,), dampings=(0.01,), strides=(20,))
    assert list(tmp_path.iterdir()) == []  # MuJoCo writes a log of its warnings unless it is told not to
    assert mujoco_settling.TOLERANCE == 1e-10  # as everybody else


def test_newton_on_seven_equations_finds_the_force(arm: sr.SoftModel) -> None:
    """Condition numbers below 10: 1e-13 of the torques, at most 20 N m, over 0.1 m; 1e-6 N leaves room for soft poses."""
    checked = 0
    for q_motors, force in cases_of(arm, 20, FORCE):
        known = sr.solve_equilibrium(arm, q_motors, force, tolerance=1e-13)
        estimate = sr.estimate_load(arm, q_motors, known.motor_torques)
        if estimate.condition_number < 10.0:
            found, q = pinocchio_solvers.estimate_force(PinocchioArm(arm), q_motors, known.motor_torques)
            assert np.abs(found - estimate.force).max() < 1e-6
            assert np.abs(q - known.q).max() < SAME
            checked += 1
    assert checked >= 5


@pytest.mark.parametrize("limits", [False, True])
def test_pink_puts_the_rigid_tip_on_the_path(tool: Callable, arm: sr.SoftModel, limits: bool) -> None:
    tool("pink")
    targets = path_targets(6)
    start = sr.solve_ik(arm, targets[0], elbow="up").q_motors
    for q, target in zip(PinkArm(arm, limits=limits).follow(targets, start), targets, strict=True):
        assert np.linalg.norm(sr.solve_equilibrium(arm, q).tip_position - target) < 2e-9  # weightless and unloaded: rigid
    with pytest.raises(sr.NotConverged, match=r"does not reach \[3.0, 0.0, 0.0\] m"):
        PinkArm(arm, limits=limits).follow(np.array([[3.0, 0.0, 0.0]]), start)


def test_the_standard_cases_are_what_they_say() -> None:
    cases = standard_cases(4000)
    assert np.allclose(np.linalg.norm(cases.forces, axis=1), FORCE, rtol=1e-14)
    assert np.abs(cases.forces.mean(axis=0)).max() < 0.7  # five standard deviations of a mean of 4000
    assert np.abs(cases.q_motors).max() <= np.pi
    assert np.allclose(cases.q_motors.std(axis=0), np.pi / np.sqrt(3.0), rtol=0.05)
    assert abs(np.corrcoef(cases.q_motors[:, 0], cases.forces[:, 0])[0, 1]) < 0.08
    assert np.allclose(np.linalg.norm(rod_forces(3), axis=1) * ROD_LENGTH**2 / ROD_STIFFNESS, 1.0)
    assert rod(2).pinocchio.nv == 12


# --- The measurement


def test_everybody_runs_once_a_round_and_costs_are_a_case() -> None:
    now, order = [0.0], []

    def spend(name: str, seconds: list[float]) -> Callable[[], None]:
        def run() -> None:
            order.append(name)
            now[0] += seconds[(order.count(name) - 1) % len(seconds)]

        return run

    workloads = {"a": Workload(2, spend("a", [9.0, 9.0, 4.0, 8.0])), "b": Workload(5, spend("b", [9.0, 9.0, 10.0, 30.0]))}
    seconds = interleaved(workloads, 2, clock=lambda: now[0], shortest=0.0)
    assert order == ["a", "a", "b", "b", *"abab"]  # warm-up first
    assert seconds["a"].tolist() == [2.0, 4.0]
    assert seconds["b"].tolist() == [2.0, 6.0]


def test_short_runs_are_repeated_until_they_last() -> None:
    runs = []
    interleaved({"a": Workload(1, lambda: runs.append(0))}, 1, shortest=1e-3)
    assert len(runs) > 100  # of some 0.1 us each
    with pytest.raises(sr.ParameterError, match="rounds"):
        interleaved({}, 0)


def test_ratios_are_taken_within_rounds() -> None:
    """The third round is ten times slower for both: the median of the ratios is 3, the ratio of the medians 3.5."""
    slow, fast = np.array([3.0, 8.0, 40.0, 6.0, 7.0]), np.array([1.0, 2.0, 20.0, 2.0, 2.0])
    assert ratio(slow, fast) == (3.0, 2.0, 4.0)
    assert np.median(slow) / np.median(fast) == 3.5


@each_row(("one", "other"), [([1.0], [1.0, 2.0]), ([], []), ([1.0], [0.0]), ([0.0], [1.0]), ([1.0], [np.nan])])
def test_ratios_of_nothing_are_refused(one: list, other: list) -> None:
    with pytest.raises(sr.ParameterError, match="denominator"):
        ratio(np.array(one), np.array(other))


@pytest.mark.parametrize("off", [2e-8, np.nan])
def test_wrong_answers_are_not_timed(off: float) -> None:
    require_agreement("it", np.array([1.0]), np.array([1.0]), 1e-8, "rad")
    with pytest.raises(sr.SoftRobotsError, match=r"it is off by .* rad, allowed are 1e-08: it is not timed"):
        require_agreement("it", np.array([1.0 + off]), np.array([1.0]), 1e-8, "rad")


def test_a_race_names_who_does_not_take_part() -> None:
    comparison = Comparison(Settings(3, shortest=0.0), "comparison", clock=iter(range(100)).__next__)

    def refuse() -> Workload:
        raise sr.MissingDependency("mujoco", "interop")

    comparison.add("here", lambda: Workload(4, lambda: None))
    comparison.add("twin", lambda: Workload(1, lambda: None))
    comparison.add("gone", refuse)
    comparison.run()
    row = comparison.cheaper("job", "here", "twin", AT_LEAST, 4.0)
    assert (row.value, row.low, row.high, row.our_seconds, row.baseline_seconds) == (4.0, 4.0, 4.0, 0.25, 1.0)
    assert (row.met, row.skipped) == (True, "")
    assert comparison.costlier("job", "here", "twin", AT_MOST, 0.2).met is False  # 0.25
    skipped = comparison.cheaper("job", "here", "gone", AT_LEAST, 4.0)
    assert (skipped.value, skipped.met, skipped.our_seconds) == (None, None, 0.25)
    assert skipped.skipped.startswith("gone: mujoco is not installed")
    assert "| skipped: gone: mujoco is not installed" in table([skipped])


# --- The jobs, with a stand-in for the compiled solvers that asks the general ones


class StandIn:
    """The interface of a compiled model."""

    def __init__(self, model: sr.SoftModel) -> None:
        self.model = model

    def equilibrium(self, q_motors: object, force: object, *, gravity: object = None) -> sr.Equilibrium:
        return sr.solve_equilibrium(self.model, q_motors, force, gravity=gravity)

    def equilibria(self, q_motors: object, forces: object, *, gravity: object = None, threads: int = 1) -> SimpleNamespace:
        found = [self.equilibrium(*case, gravity=gravity) for case in zip(q_motors, forces, strict=True)]
        springs, tips = (np.array([getattr(one, name) for one in found]) for name in ("q_springs", "tip_position"))
        return SimpleNamespace(q_springs=springs, tip_positions=tips)

    def estimate_load(self, q_motors: object, motor_torques: object) -> sr.LoadEstimate:
        return sr.estimate_load(self.model, q_motors, motor_torques)

    def estimate_loads(self, q_motors: object, motor_torques: object) -> SimpleNamespace:
        found = [self.estimate_load(*case) for case in zip(q_motors, motor_torques, strict=True)]
        return SimpleNamespace(forces=np.array([one.force for one in found]))

    def follow(self, targets: object, force: object, *, q_motors0: object, tolerance: float) -> sr.Trajectory:
        return sr.follow_trajectory(self.model, targets, force, q_motors0=q_motors0)

    def simulate(self, duration: float, q_motors: object, **options: object) -> sr.Motion:
        return sr.simulate(self.model, duration, q_motors, **options)

    def simulations(self, duration: float, q_motors: object, *, forces: object, **options: object) -> list[sr.Motion]:
        pairs = zip(q_motors, forces, strict=True)
        return [self.simulate(duration, motors, force=force, **options) for motors, force in pairs]


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple]]:
    """What `softrobots.compile` was asked for."""
    asked = []

    def make(model: sr.SoftModel, *, backend: str, locked_strains: tuple) -> StandIn:
        asked.append((model.pinocchio.name, model.pinocchio.nv, backend, locked_strains))
        return StandIn(model)

    monkeypatch.setattr(compiled_solvers, "compile_model", make)
    compiled_solvers.compiled.cache_clear()
    yield asked
    compiled_solvers.compiled.cache_clear()


QUICK = dataclasses.replace(quick_settings(1, progress=False), batch=24, singles=3, waypoints=5, batches=(1, 4))


def test_jobs_compare_ours_with_the_baselines(tool: Callable, stand_in: list) -> None:
    tool("pink")
    results = measure(QUICK, ["threads", "gravity", "estimation", "trajectory", "rod"])
    assert [row.skipped for row in results.rows] == [""] * len(results.rows)
    assert all(row.low <= row.value <= row.high and row.our_seconds > 0.0 for row in results.rows)
    targets = {(row.job.split(",")[0], row.target) for row in results.rows if row.target is not None}
    assert targets == {
        ("load estimation", 130.0),
        ("load estimation", 800.0),
        ("trajectory", 350.0),
        ("rod of 3 sections", 4.0),
    }
    assert {asked[2:] for asked in stand_in} == {("numba", ()), ("python", ()), ("numba", ("twist", "stretch"))}
    for row in results.rows:
        quotient = row.baseline_seconds / row.our_seconds  # of one round
        assert row.value == pytest.approx(1.0 / quotient if row.unit == "times as costly" else quotient, rel=1e-12)
        assert row.clock == ("wall" if "wall clock" in row.job else "CPU")


def test_motion_is_compared_with_real_time_and_with_mujoco(
    tool: Callable, stand_in: list, monkeypatch: pytest.MonkeyPatch
) -> None:
    tool("mujoco")
    monkeypatch.setattr(motion_jobs, "reference", lambda duration, rows: np.zeros((rows + 1, 3)))
    monkeypatch.setattr(motion_jobs, "ARM_STEP", 1e-2)  # the stand-in takes a tenth of the steps in a tenth of the time
    results = measure(QUICK, ["motion"])
    assert [row.skipped for row in results.rows] == [""] * 12
    assert [row.target for row in results.rows] == [100.0, 10.0, 50.0, 10.0, 1000.0, 5000.0, None, None, 10.0, 10.0, 10.0, 10.0]
    for row in results.rows:
        assert row.value == pytest.approx(row.baseline_seconds / row.our_seconds, rel=1e-12)
    assert sum("MuJoCo" in note and "steps of" in note for note in results.notes) == 7


def test_elastic_tendons_are_compared_with_mujoco(tool: Callable, stand_in: list, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo settles a robot of hinges: its tip is compared with that of sections before anything is timed."""
    tool("mujoco")
    for name in ("TIME_STEPS", "LARGE_STEPS"):
        monkeypatch.setattr(tendon_jobs, name, (0.01,))
    monkeypatch.setattr(tendon_jobs, "DAMPINGS", (0.02,))
    results = measure(QUICK, ["tendons"])
    assert [row.skipped for row in results.rows] == [""] * 5
    assert [(row.unit, row.target) for row in results.rows] == [
        ("s", 5e-3), ("s", 1e-4), ("times cheaper", 50.0), ("times cheaper", None), ("times cheaper", None)
    ]  # fmt: skip
    assert sum("four pairs of hinges a segment" in note for note in results.notes) == 2
    monkeypatch.setattr(tendon_jobs, "_NEAR", 1e-5)
    rows = measure(QUICK, ["tendons"]).rows
    assert all("is off by" in row.skipped for row in rows[2:])


@pytest.mark.study
def test_equilibria_in_contact_are_compared_with_mujoco(tool: Callable, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its forces are compared with ours on its robot before anything is timed; settings that are too soft are passed over."""
    tool("mujoco")
    scene = contact_jobs.leaning_arm(2)
    monkeypatch.setattr(contact_jobs, "compiled", lambda model, backend: compiled_solvers.compiled(model, "python"))
    monkeypatch.setattr(contact_jobs, "TIME_STEPS", (0.002, 0.01))
    monkeypatch.setattr(contact_jobs, "LARGE_STEPS", ())
    monkeypatch.setattr(contact_jobs, "leaning_arm", lambda count, on="wall": scene._replace(dampings=(16.0,)))
    monkeypatch.setattr(contact_jobs, "lying_rod", lambda count, sections: scene._replace(dampings=(16.0,), name="again"))
    results = measure(QUICK, ["contact"])
    assert [row.skipped for row in results.rows] == [""] * 20
    assert [row.target for row in results.rows] == 2 * [5e-4, 5e-4, 20.0, None, None, None, 20.0, 20.0, 20.0] + 2 * [5e-4]
    assert sum("time step 0.01 s" in note for note in results.notes) == 4
    monkeypatch.setattr(contact_jobs, "FORCE_TOLERANCE", 3e-6)
    assert sum("time step 0.002 s" in note for note in measure(QUICK, ["contact"]).notes) == 4


@pytest.mark.study
def test_a_rod_on_pegs_presses_on_them_as_in_mujoco(tool: Callable) -> None:
    """A rod of few sections lies on some of ten pegs; MuJoCo settles to our forces on the same hinges."""
    tool("mujoco")
    scene = contact_jobs.lying_rod(2, 6)
    simulator = contact_jobs.SettlingSurroundings(scene)
    for case in zip(*scene.cases, strict=True):
        simulator.settle(*case)
        found = scene.solve(scene.theirs, *case)
        forces = simulator.obstacle_forces(scene.environment.names)
        assert sum(contact.strict for contact in found.contacts) > 2
        assert (
            np.abs(forces - contact_jobs.stacked(contact_jobs.forces_of(found), scene.environment.names)).max()
            < 1e-3 * forces.max()
        )


def test_mujoco_settles_to_where_tendons_and_weight_say(tool: Callable) -> None:
    """Its legs between hinges are the tendon's length to second order: four hinges a segment leave 0.3 mm of 187 mm."""
    tool("mujoco")
    arm, commands = tendon_jobs.tendon_arm("lumped"), tendon_jobs.commands(4).q_motors
    simulator = mujoco_settling.SettlingTendons(arm, tendon_jobs.GRAVITY)
    simulator.set(0.01, 0.02, 20)
    for motors in commands:
        springs, steps = simulator.settle(motors, np.zeros(3))
        assert steps % 20 == 0
        q = arm.configuration(motors, springs)
        found = sr.solve_equilibrium(arm, motors, gravity=tendon_jobs.GRAVITY)
        assert np.linalg.norm(frame_placement(arm, q, arm.tip).translation - found.tip_position) < 3e-4


def test_mujoco_is_tuned_for_an_error_of_the_tip(tool: Callable) -> None:
    tool("mujoco")
    start = sr.solve_equilibrium(cases.arm(), (0.3, 0.6, -0.8), force=(0.0, 10.0, -15.0), gravity=sr.EARTH_GRAVITY)
    simulator = MujocoMotion(Released(start, sr.EARTH_GRAVITY, 1e-3, 0.02, 5))
    moved = sr.simulate(
        cases.arm(),
        0.1,
        start.q_motors,
        start=start,
        gravity=sr.EARTH_GRAVITY,
        damping_time=1e-3,
        time_step=1e-4,
        output_step=0.02,
    )
    assert "RK4" in simulator.tune(moved.tip_position, 2e-6)
    assert tip_error(simulator.path(), moved.tip_position) < 2e-6  # both are the same arm
    simulator.set("RK4", 1)
    assert tip_error(simulator.path(), moved.tip_position) > 2e-6
    with pytest.raises(sr.SoftRobotsError, match="no step that keeps the tip within 0 mm"):
        simulator.tune(moved.tip_position + 1e-3, 0.0)


def test_curves_go_over_all_sizes(stand_in: list, tmp_path: Path) -> None:
    results = measure(dataclasses.replace(QUICK, sizes=(2, 3)), ["sizes", "batches"])
    assert [curve.sizes for curve in results.curves if curve.picture == "sizes"] == [(2, 3)] * 5
    assert [curve.sizes for curve in results.curves if curve.picture == "batches"] == [(1, 4)] * 4
    assert (results.rows, results.notes) == ((), ())  # growth is told from 10 to 50
    files = load_script("benchmark").write_pictures(results, tmp_path, overwrite=False)
    assert [file.name for file in files] == ["benchmark_sizes.png", "benchmark_batches.png"]


def test_wrong_answers_of_ours_are_not_timed(stand_in: list, monkeypatch: pytest.MonkeyPatch) -> None:
    def half(self: StandIn, q_motors: object, force: np.ndarray, *, gravity: object = None) -> sr.Equilibrium:
        return sr.solve_equilibrium(self.model, q_motors, 0.5 * np.asarray(force), gravity=gravity)

    monkeypatch.setattr(StandIn, "equilibrium", half)
    rows = measure(QUICK, ["gravity"]).rows[:-1]  # the last one compares ours with ours
    assert all("is off by" in row.skipped and row.value is None and row.baseline_seconds > 0.0 for row in rows)


# --- Results


def made_up() -> Results:
    """Results of a whole benchmark."""
    rows = (
        Row("equilibrium", "ours", "theirs", "times cheaper", 612.4, 600.0, 650.0, AT_LEAST, 500.0, 1.2e-7, 7.3e-5),
        Row("rod", "ours", "a call", "times as costly", 4.21, 4.0, 5.0, AT_MOST, 4.0, 4.2e-5, 1e-5),
        Row("rod", "ours", "something", "times cheaper", 3.0, 2.0, 4.0, "", None, 1e-3, 3e-3),
        figure("first answer", "ours", "s", np.array([0.7, 0.8, 0.9]), AT_MOST, 1.0),
        figure("one call", "ours", "s", np.array([6e-5]), AT_MOST, 1e-4),
        figure("memory", "ours", "bytes", np.array([52.0]), AT_MOST, 200.0),
    )
    curves = tuple(Curve(name, label, (10, 50), (1e-6, 5e-6)) for name in PICTURES for label in ("a", "b"))
    settings = dataclasses.asdict(Settings(7)) | {"jobs": list(JOBS)}
    return Results({"processor": "abacus", "system": "wood", "Python": "3"}, settings, rows, curves, ("tuned",))


def test_targets_are_met_or_not() -> None:
    assert [row.met for row in made_up().rows] == [True, False, None, True, True, True]
    lines = table(made_up().rows).splitlines()[2:]
    assert lines[0] == "| equilibrium | ours | theirs | 120 ns | 73.0 us | 612 times cheaper | at least 500x | met |"
    assert lines[1] == "| rod | ours | a call | 42.0 us | 10.0 us | 4.21 times as costly | at most 4x | **missed** |"
    assert lines[2].endswith("| 3.00 times cheaper |  |  |")
    assert lines[3] == "| first answer | ours | - | 800 ms | - | 800 ms | at most 1 s | met |"
    assert lines[4] == "| one call | ours | - | 60.0 us | - | 60.0 us | at most 100 us | met |"
    assert lines[5] == "| memory | ours | - | - | - | 52.0 B | at most 200 B | met |"


def test_results_come_back_from_json(tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    file.write_text(as_json(made_up()), encoding="utf-8")
    back = read_results(file)
    assert back.rows == made_up().rows
    assert back.curves == made_up().curves
    assert as_json(back) == as_json(made_up())


@each_row("text", ["{", "[]", '{"rows": [{"job": 1}]}', '{"rows": [], "curves": [{}], "machine": {}}', "3"])
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(sr.FileFormatError, match=r"results\.json"):
        read_results(file)
    with pytest.raises(sr.FileFormatError, match="cannot read"):
        read_results(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("settings", "row", "told"),
    [({"quick": True}, {}, "--quick"), ({"jobs": ["rod"]}, {}, "equilibrium"), ({}, {"skipped": "no pink"}, "rod against")],
)
def test_docs_are_made_of_whole_results_only(settings: dict, row: dict, told: str) -> None:
    results = made_up()
    require_whole(results, list(JOBS))
    partial = dataclasses.replace(
        results, settings=results.settings | settings, rows=(dataclasses.replace(results.rows[1], **row),)
    )
    with pytest.raises(sr.ParameterError, match=f"{told}.*must be given for results of the whole benchmark"):
        require_whole(partial, list(JOBS))


# --- The script


def test_the_script_runs_end_to_end(tool: Callable, stand_in: list, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    tool("mujoco")
    target = tmp_path / "results.json"
    arguments = ["--quick", "--rounds", "1", "--only", "equilibrium", "trajectory", "--json", str(target)]
    assert load_script("benchmark").main(arguments) == 0
    printed = capsys.readouterr()
    assert "round" in printed.err  # the progress bar
    results = read_results(target)
    assert results.settings["jobs"] == ["equilibrium", "trajectory"]
    assert results.machine["numpy"] == np.__version__
    by_baseline = {row.baseline: row for row in results.rows}
    timed = [name for name, row in by_baseline.items() if row.baseline_seconds is not None]
    assert len(timed) >= 8
    assert any("MuJoCo settling, tuned, any step: time step" in note for note in results.notes)
    assert load_script("benchmark").main(["--from", str(target)]) == 0
    assert capsys.readouterr().out == printed.out.partition("\nwritten: ")[0]
    assert load_script("benchmark").main(arguments) == 2  # the file is there
    assert "exists" in capsys.readouterr().err
    assert load_script("benchmark").main(["--from", str(target), "--docs", str(tmp_path)]) == 2
    assert "whole benchmark" in capsys.readouterr().err
    assert load_script("benchmark").main(["--quick", "--docs", str(tmp_path)]) == 2  # before anything is measured
    assert "for all jobs, without --quick" in capsys.readouterr().err
    told = json.loads(target.read_text(encoding="utf-8"))
    del told["machine"]["processor"]
    (tmp_path / "foreign.json").write_text(json.dumps(told), encoding="utf-8")
    assert load_script("benchmark").main(["--from", str(tmp_path / "foreign.json")]) == 2
    assert "holds no results" in capsys.readouterr().err
    assert load_script("benchmark").main(["--rounds", "0"]) == 2
    assert "--rounds = 0" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("module", "job", "told"),
    [
        ("mujoco", "equilibrium", r"mujoco is not installed.*softrobots\[interop\]"),
        ("pink", "trajectory", r"pin-pink with daqp is not installed.*softrobots\[bench\]"),
    ],
)
def test_a_baseline_that_is_not_installed_is_named(
    monkeypatch: pytest.MonkeyPatch, stand_in: list, module: str, job: str, told: str
) -> None:
    for name in [name for name in sys.modules if name == module or name.startswith(f"{module}.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    results = measure(QUICK, [job])
    assert re.search(f"skipped: .*{told}", table(results.rows))


def test_docs_are_made_of_a_recorded_run(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    script, saved = load_script("benchmark"), tmp_path / "saved.json"
    saved.write_text(as_json(made_up()), encoding="utf-8")
    (tmp_path / "docs").mkdir()
    page = tmp_path / script.PAGE
    page.write_text(f"Before.\n\n{script.BEGIN}\nold\n{script.END}\n\nAfter.\n", encoding="utf-8")
    assert script.main(["--from", str(saved), "--docs", str(tmp_path)]) == 0
    text = page.read_text(encoding="utf-8")
    assert text.startswith("Before.\n\n")
    assert text.endswith("\n\nAfter.\n")
    assert "| something |" in text
    assert "old" not in text
    assert (tmp_path / "docs" / "benchmark.json").read_text(encoding="utf-8") == as_json(made_up())
    for name in PICTURES:
        assert (tmp_path / "docs" / "images" / f"benchmark_{name}.png").read_bytes()[:4] == b"\x89PNG"
    page.write_text("no marks\n", encoding="utf-8")
    assert script.main(["--from", str(saved), "--docs", str(tmp_path)]) == 2
    assert "docs/compiled.md must have the lines <!-- benchmark:begin -->" in capsys.readouterr().err


def test_the_tables_of_the_pages_are_those_of_the_recorded_run() -> None:
    if not RECORDED.is_file():
        missing("docs/benchmark.json has not been recorded: scripts/benchmark.py --docs")
    script, results = load_script("benchmark"), read_results(RECORDED)
    require_whole(results, list(JOBS))
    assert script.page_with(CHECKOUT, script.document(results)) == (CHECKOUT / script.PAGE).read_text(encoding="utf-8")
    for name in PICTURES:
        assert (CHECKOUT / "docs" / "images" / f"benchmark_{name}.png").stat().st_size > 10_000


# --- Processes of their own


def test_a_process_that_fails_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "FIRST_ANSWER", "raise ValueError('no arm')")
    with pytest.raises(sr.SoftRobotsError, match="a process of the benchmark failed: ValueError: no arm"):
        processes.first_answer()
    monkeypatch.setattr(processes, "FIRST_ANSWER", 'print(\'{"stages": {"solve": 0.0}, "numba": true}\')')
    with pytest.raises(sr.SoftRobotsError, match="imports numba"):
        processes.first_answer()
    (row,) = measure(quick_settings(1, progress=False), ["fresh"]).rows
    assert "imports numba" in row.skipped


def test_memory_of_a_batch_is_what_it_needs_beyond_its_outputs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A solver that fills 80 bytes a case and drops them, beside outputs of 4 + 1 + 1 + 3 numbers; memory comes in pages."""

    class Solver:
        def equilibria(self, q_motors: np.ndarray, forces: np.ndarray) -> object:
            n = len(forces)
            outputs = {
                "q_springs": np.ones((n, 4)),
                "status": np.ones(n),
                "residual": np.ones(n),
                "tip_positions": np.ones((n, 3)),
            }
            np.ones((n, 10)).sum()
            return type("Result", (), outputs)()

    monkeypatch.setattr(processes, "compiled", lambda *_: Solver())
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("the peak can be forgotten on Linux only")
    count = 400_000
    assert processes.peak_bytes(count, "numba") / count == pytest.approx(80.0, abs=8.0)


@pytest.mark.study
def test_processes_of_their_own_need_no_surroundings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert np.isfinite(processes.bytes_per_case(1000, "python"))
    assert processes.first_answer()["total"] > 0


def test_without_numba_the_rest_is_still_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise sr.MissingDependency("numba", "fast")

    monkeypatch.setattr(compiled_solvers, "compile_model", refuse)
    compiled_solvers.compiled.cache_clear()
    results = measure(QUICK, ["rod"])
    compiled_solvers.compiled.cache_clear()
    assert all("numba is not installed" in row.skipped and row.baseline_seconds is not None for row in results.rows)
    assert json.loads(as_json(results))["rows"][0]["met"] is None
