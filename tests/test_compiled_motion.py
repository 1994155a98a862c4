"""Compiled motion: every step satisfies the implicit midpoint rule on Pinocchio's inverse dynamics, in every back end."""

from __future__ import annotations

import dataclasses
import functools
import pickle
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run import motion_runs
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.motion_batch import MotionBatch
from softrobots.compiled.run.motion_cases import MotionCases
from softrobots.core.errors import NotConverged, ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import frame_placement
from tests.support.c_libraries import Controller
from tests.support.laws import law
from tests.support.serial_chains import ROBOTS

GRAVITY = np.array([0.7, -0.4, -9.7])


def out_of_balance(
    model: SoftModel,
    path: np.ndarray,
    y0: np.ndarray,
    v0: np.ndarray,
    a: np.ndarray,
    h: float,
    force: np.ndarray,
    damping: np.ndarray,
) -> np.ndarray:
    """The residual of a step of length h by Pinocchio; `path`: motors at its beginning, middle and end, shape (3, m)."""
    whole, data = model.workspace(tuple(GRAVITY.tolist()))
    y, v = y0 + h / 2 * v0 + h**2 / 4 * a, v0 + h / 2 * a
    columns = [model.pinocchio.joints[model.pinocchio.getJointId(name)].idx_v for name in model.structure.motor_joints]
    springs = model.structure.spring_indices

    def joints(motors: np.ndarray, strains: np.ndarray) -> np.ndarray:
        values = np.zeros(model.pinocchio.nv)
        values[columns], values[springs] = motors, strains
        return values

    q = model.configuration(path[1], y)
    rates, changes = (path[2] - path[0]) / h, 4 * (path[2] - 2 * path[1] + path[0]) / h**2
    torques = pin.rnea(whole, data, q, joints(rates, v), joints(changes, a))
    tip = model.frame_id(model.tip)
    jacobian = pin.computeFrameJacobian(whole, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
    return (torques - jacobian.T @ force)[springs] + model.springs.at(y)[1] + damping @ v


@pytest.mark.parametrize("full", [False, True], ids=["diagonal", "full"])
@pytest.mark.parametrize("kind", ["arm", "two_hinges", "odd", "slack"])
def test_a_step_is_the_implicit_midpoint_rule(kind: str, full: bool, rng: np.random.Generator) -> None:
    slack = sr.InflatableArm(link_model="two_hinges", moment_law="slack_wall")
    model = sr.load_model(slack) if kind == "slack" else ROBOTS[kind]()
    run: Any = make_run(make_motion_program(Unknowns(model.chain()), full_damping=full), "python")
    layout, n, m, h = run.layout, model.n_springs, model.n_motors, 2e-3
    for _ in range(5):
        w = run.workspace()
        y0, v0 = model.rest + rng.normal(size=n) * 0.1, rng.normal(size=n)
        path = rng.normal(size=m) + np.array([[0.0], [h / 2], [h]]) * rng.normal(size=m) + h * h * rng.normal(size=(3, m))
        force, factor = rng.normal(size=3) * 5.0, rng.normal(size=(n, n)) * 0.1
        D = factor @ factor.T if full else np.diag(rng.uniform(size=n))
        numbers = {"position": y0, "velocity": v0, "force": force, "gravity": GRAVITY, "time_step": np.array([h])}
        numbers |= dict(zip(("motors_begin", "motors_middle", "motors_end"), path, strict=True))
        for name, values in (numbers | {"damping": D.ravel() if full else np.diag(D)}).items():
            run.put(w, getattr(layout, name), values)
        assert run.motion_step(w) == 0
        y1, v1, a = (np.array(w[place : place + n]) for place in (layout.position, layout.velocity, layout.acceleration))
        np.testing.assert_allclose(y1, y0 + h * v0 + h**2 / 2 * a, rtol=0, atol=1e-15)  # rounding
        np.testing.assert_allclose(v1, v0 + h * a, rtol=1e-15, atol=1e-15)
        # A change of 1e-13 in the middle is one of K 1e-13 + M 1e-13 / (h^2 / 4) in the torques.
        error = out_of_balance(model, path, y0, v0, a, h, force, D)
        assert np.abs(error).max() < 1e-13 * (model.stiffness.max() + 10.0 * 4 / h**2)
        assert run.place_at(w, 1.0) is None
        q = model.configuration(path[2], y1)
        np.testing.assert_allclose(w[layout.tip : layout.tip + 3], frame_placement(model, q, model.tip).translation, atol=1e-12)


# --- The API


@pytest.fixture(scope="module")
def solver(arm: SoftModel) -> CompiledModel:
    return sr.compile(arm, backend="python")


def swaying(time: float) -> np.ndarray:
    return np.array([0.3, 0.6, -0.8]) + 0.4 * np.sin(4.0 * time) * np.array([1.0, -0.5, 0.7])


def gust(time: float) -> np.ndarray:
    return np.array([0.0, 20.0 * time, -8.0])


def stopping(time: float) -> np.ndarray:
    return np.array([0.3, 0.6, -0.8]) + 2.0 * min(time, 0.0304) * np.array([1.0, -0.5, 0.7])


def options(arm: SoftModel) -> dict[str, tuple[Any, dict[str, Any]]]:
    """Motors and options of simulations of all kinds."""
    loaded = sr.solve_equilibrium(arm, swaying(0.0), (0.0, 5.0, -20.0), gravity=GRAVITY)
    path = sr.straight_line((0.9, 0.2, 0.3), (0.8, 0.4, 0.3), 0.08, 5)
    followed = sr.follow_trajectory(arm, path.positions, times=path.times)
    return {
        "released": (swaying(0.0), {"start": loaded, "gravity": GRAVITY, "damping_time": 1e-3}),
        "stopping": (stopping, {"gravity": GRAVITY, "damping_time": 1e-3}),
        "swaying": (swaying, {"force": gust, "gravity": GRAVITY, "damping_time": 0.0}),
        "trajectory": (followed, {"force": ([0.0, 0.03, 0.1], [[0, 0, 0], [0, 9, 0], [3, 0, 0]]), "mass_damping": 2.0}),
    }


@pytest.mark.parametrize("case", ["released", "stopping", "swaying", "trajectory"])
def test_same_answer_as_simulate_at_the_same_steps(case: str, arm: SoftModel, solver: CompiledModel) -> None:
    motors, given = options(arm)[case]
    given |= {"time_step": 1e-3, "output_step": 3.3e-3}
    found, expected = solver.simulate(0.1, motors, **given), sr.simulate(arm, 0.1, motors, **given)
    for name in ("time", "q_motors", "motor_velocities", "forces", "steps"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-12)
    for name, size in (("q_springs", 1.0), ("velocities", 10.0), ("tip_position", 1.0)):
        # Both solve a step to 1e-13 in its middle, 4e-10 in a velocity.
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-9 * size)
    # Torques feel the acceleration, which is known to 4e-13 / h^2.
    np.testing.assert_allclose(found.motor_torques, expected.motor_torques, rtol=0, atol=1e-5)
    for name in ("kinetic", "elastic", "potential", "dissipated", "load_work", "motor_work"):
        np.testing.assert_allclose(getattr(found.energy, name), getattr(expected.energy, name), rtol=0, atol=1e-8)
    assert pickle.loads(pickle.dumps(found)).energy.kinetic[-1] == found.energy.kinetic[-1]
    stopped = found.q_motors[-1]  # at once
    found, expected = (
        engine(0.02, stopped, start=found, time_step=1e-3) for engine in (solver.simulate, functools.partial(sr.simulate, arm))
    )
    np.testing.assert_allclose(found.velocities, expected.velocities, rtol=0, atol=1e-8)


@pytest.mark.study
def test_the_tolerance_is_kept(solver: CompiledModel, monkeypatch: pytest.MonkeyPatch) -> None:
    given = {"gravity": GRAVITY, "damping_time": 1e-3, "force": (0.0, 4.0, -3.0), "output_step": 5e-3}
    found = solver.simulate(0.2, swaying, tolerance=1e-4, **given)
    exact = solver.simulate(0.2, swaying, time_step=1e-4, **given)  # its own error is a hundredth of that of 1 ms
    assert found.tip_error is not None
    assert found.tip_error <= found.tolerance == 1e-4
    error = np.linalg.norm(found.tip_position - exact.tip_position, axis=1).max()
    assert error <= found.tip_error + 1e-6
    many = solver.simulations(0.2, [swaying, swaying], tolerance=1e-4, forces=(0.0, 4.0, -3.0), **_without(given, "force"))
    assert many.tip_error is not None
    assert many.tip_error.max() <= 1e-4
    monkeypatch.setattr(motion_runs, "MOST_STEPS", 2_000)
    with pytest.raises(NotConverged) as raised:
        solver.simulate(0.2, swaying, tolerance=1e-15, **given)
    assert raised.value.best.tip_error > 1e-15


def _without(given: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in given.items() if key != name}


def test_a_batch_has_the_motions_of_its_cases(solver: CompiledModel, rng: np.random.Generator) -> None:
    given = {"gravity": GRAVITY, "damping_time": 1e-3, "time_step": 2e-3, "output_step": 7e-3}
    motors, forces = rng.uniform(-1, 1, (5, 3)), rng.normal(size=(5, 3)) * 10
    starts = rng.normal(size=(5, 4)) * 0.05, rng.normal(size=(5, 4))
    motors[3, 1] = np.nan
    batch = solver.simulations(0.05, motors, starts=starts, forces=forces, **given)
    assert batch.status.tolist() == [0, 0, 0, Status.NOT_A_NUMBER, 0]
    assert np.all(np.isfinite(batch.tip_position))
    moving = solver.simulations(
        0.05, [swaying, lambda _: motors[0]], forces=[gust, (0.0, 0.0, 0.0)], starts=batch.q_springs[:2, 0], **given
    )
    ends = solver.simulations(0.02, motors[:2], starts=_first(batch, 2), **given)
    for row in (0, 1, 2, 4):
        state = sr.MotionState(solver.model, 0.0, motors[row], np.zeros(3), starts[0][row], starts[1][row])
        one = solver.simulate(0.05, motors[row], start=state, force=forces[row], **given)
        np.testing.assert_allclose(one.time, batch.time, rtol=0, atol=0)
        np.testing.assert_allclose(batch.q_springs[row], one.q_springs, rtol=0, atol=1e-10)  # velocities differ by 1e-10
        np.testing.assert_allclose(batch.tip_position[row], one.tip_position, rtol=0, atol=1e-10)
    state = sr.MotionState(solver.model, 0.0, swaying(0.0), np.zeros(3), starts[0][0], np.zeros(4))
    one = solver.simulate(0.05, swaying, start=state, force=gust, **given)
    np.testing.assert_allclose(moving.tip_position[0], one.tip_position, rtol=0, atol=1e-10)
    one, many = solver.simulate(0.05, stopping, **given), solver.simulations(0.05, [stopping, stopping], **given)
    np.testing.assert_allclose(many.q_springs[1], one.q_springs, rtol=0, atol=1e-10)  # the blow comes between two steps
    np.testing.assert_array_equal(ends.q_springs[:, 0], batch.q_springs[:2, -1])


def test_results_are_frozen(solver: CompiledModel) -> None:
    given: dict[str, Any] = {"gravity": GRAVITY, "damping_time": 1e-3, "tolerance": 1e-2}
    one, many = solver.simulate(2e-3, np.zeros(3), **given), solver.simulations(2e-3, np.zeros((2, 3)), **given)
    for result, name in ((one, "q_springs"), (one, "tip_position"), (one, "energy"), (one, "other"), (many, "tip_error")):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, name, 0.0)
    for array in (one.q_springs, one.tip_position, one.steps, one.motor_torques, many.q_springs, many.steps, many.tip_error):
        assert array is not None
        assert not array.flags.writeable


def test_a_batch_may_be_empty(solver: CompiledModel) -> None:
    for steps in ({"time_step": 1e-3}, {"tolerance": 1e-3}):
        assert solver.simulations(0.02, np.zeros((0, 3)), **steps).q_springs.shape[::2] == (0, 4)


def _first(batch: MotionBatch, count: int) -> tuple[np.ndarray, np.ndarray]:
    return batch.q_springs[:count, -1], batch.velocities[:count, -1]


SMALL = st.floats(-1.0, 1.0)


@law("CompiledModel.simulate", "CompiledModel.simulations", "CompiledModel.step")
@given(st.tuples(*[SMALL] * 3), st.tuples(*[SMALL] * 4), st.tuples(*[SMALL] * 4), st.floats(1e-4, 5e-3))
@settings(max_examples=20)
def test_undamped_motion_runs_backwards(motors: Any, springs: Any, rates: Any, h: float) -> None:
    """The scheme is symmetric in time: with rates reversed the robot goes back where it came from."""
    solver, q = undamped(), np.array(motors)
    y0, v0 = 0.2 * np.array(springs), 2.0 * np.array(rates)
    given: dict[str, Any] = {"gravity": GRAVITY, "damping_time": 0.0, "time_step": h}
    there = solver.simulate(6 * h, q, start=sr.MotionState(solver.model, 0.0, q, np.zeros(3), y0, v0), **given)
    back = sr.MotionState(solver.model, 0.0, q, np.zeros(3), there.q_springs[-1], -there.velocities[-1])
    again = solver.simulate(6 * h, q, start=back, **given)
    # Each step is solved to 1e-13 in its middle, and 4e-13 / h in a velocity.
    np.testing.assert_allclose(again.q_springs, there.q_springs[::-1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(again.velocities, -there.velocities[::-1], rtol=0, atol=1e-11 / h)
    batch = solver.simulations(6 * h, q, starts=(there.q_springs[-1], -there.velocities[-1]), **given)
    np.testing.assert_allclose(batch.q_springs[0], there.q_springs[::-1], rtol=0, atol=1e-11)
    step = solver.step(there.q_springs[1], -there.velocities[1], q, **given)
    np.testing.assert_allclose(step.q_springs, y0, rtol=0, atol=1e-11)


@functools.cache
def undamped() -> CompiledModel:
    return sr.compile(ROBOTS["arm"](), backend="python")


def test_steps_that_do_not_converge_are_halved(solver: CompiledModel) -> None:
    """A step in which motors turn by 1.5 rad and springs by 1 rad: alone, in a batch, and as two halves."""
    state, h = (np.zeros(4), np.array([20.0, 20.0, 10.0, -14.0])), 0.05
    begin = sr.MotionState(solver.model, 0.0, np.zeros(3), np.zeros(3), *state)

    def turning(time: float) -> np.ndarray:
        return 30.0 * time * np.array([1.0, -0.7, 0.5])

    given: dict[str, Any] = {"start": begin, "damping_time": 0.0}
    whole = solver.simulate(h, turning, time_step=h, **given)
    halves = solver.simulate(h, turning, time_step=h / 2, **given)
    assert len(whole.steps) == 2  # it is one step to the caller
    np.testing.assert_allclose(whole.q_springs[-1], halves.q_springs[-1], rtol=0, atol=1e-10)
    calm = (lambda _: np.zeros(3)), (lambda _: np.zeros(3))
    batch = solver.simulations(h, [*calm, turning], starts=state, time_step=h, damping_time=0.0)
    assert np.all(batch.certified)
    np.testing.assert_allclose(batch.q_springs[2], whole.q_springs, rtol=0, atol=1e-12)
    step = solver.step(
        whole.q_springs[0], whole.velocities[0], [turning(0.0), turning(h / 2), turning(h)], time_step=h, damping_time=0.0
    )
    np.testing.assert_allclose(step.q_springs, whole.q_springs[-1], rtol=0, atol=1e-12)


def test_a_step_is_that_of_a_simulation(solver: CompiledModel) -> None:
    given = {"gravity": GRAVITY, "damping_time": 1e-3, "time_step": 1e-3}
    whole = solver.simulate(5e-3, swaying, force=gust, **given)
    springs, rates = whole.q_springs[0], whole.velocities[0]  # behind the blow with which the motors begin
    for row in range(5):
        begin = 1e-3 * row
        motors = [swaying(time) for time in (begin, begin + 0.5e-3, begin + 1e-3)]
        springs, rates, tip = solver.step(springs, rates, motors, gust(begin + 0.5e-3), **given)
        np.testing.assert_allclose(springs, whole.q_springs[row + 1], rtol=0, atol=1e-11)
        np.testing.assert_allclose(rates, whole.velocities[row + 1], rtol=0, atol=1e-9)
        np.testing.assert_allclose(tip, whole.tip_position[row + 1], rtol=0, atol=1e-11)


def test_a_motion_that_fails_says_where(solver: CompiledModel) -> None:
    with pytest.raises(NotConverged, match="no step from t = 0 s") as raised:
        solver.simulate(0.01, np.zeros(3), force=(0.0, 1e20, 0.0), time_step=1e-3)
    assert raised.value.best.time.tolist() == [0.0]
    batch = solver.simulations(0.01, np.zeros(3), forces=np.array([[0, 1.0, 0], [0, 1e20, 0], [0, np.inf, 0]]), time_step=1e-3)
    assert batch.status.tolist() == [Status.CERTIFIED, Status.UNSETTLED, Status.NOT_A_NUMBER]
    assert np.all(np.isfinite(batch.q_springs))
    assert np.all(np.isfinite(batch.tip_position))
    with pytest.raises(NotConverged, match="small parts"):
        solver.step(np.zeros(4), np.zeros(4), np.zeros(3), (0.0, 1e20, 0.0))


def test_an_interrupted_motion_has_what_there_is(solver: CompiledModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C in the seventh of ten parts of a run."""
    given: dict[str, Any] = {"time_step": 1e-3, "gravity": GRAVITY, "output_step": 1e-3}
    whole, sample, calls = solver.simulate(0.1, np.zeros(3), **given), motion_runs.forces_of_steps, []

    def pressed(*arguments: Any) -> np.ndarray:
        calls.append(arguments)
        if len(calls) == 7:
            raise KeyboardInterrupt
        return sample(*arguments)

    monkeypatch.setattr(motion_runs, "_CHUNK", 10)
    monkeypatch.setattr(motion_runs, "forces_of_steps", pressed)
    motion = solver.simulate(0.1, np.zeros(3), **given)
    assert motion.interrupted
    assert motion.time[-1] == pytest.approx(0.06)
    np.testing.assert_array_equal(motion.q_springs, whole.q_springs[: len(motion.time)])


def test_an_interrupted_batch_has_the_cases_that_are_done(solver: CompiledModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C in the third of ten parts of the second sixteen of 48 cases; what runs meanwhile is slow."""
    given: dict[str, Any] = {"time_step": 1e-3, "gravity": GRAVITY, "output_step": 1e-2}
    motors = np.random.default_rng(1).uniform(-0.5, 0.5, (48, 3))
    whole, forces, calls = solver.simulations(0.1, motors, **given), MotionCases.forces, []

    def pressed(cases: MotionCases, grid: np.ndarray, rows: slice) -> np.ndarray:
        calls.append(rows.start)
        if len(calls) == 13:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        time.sleep(0.1 * (len(calls) >= 13))
        return forces(cases, grid, rows)

    monkeypatch.setattr(motion_runs, "_CHUNK", 10)
    monkeypatch.setattr(motion_runs, "_CASE_STEPS", 16 * 101)
    monkeypatch.setattr(MotionCases, "forces", pressed)
    batch = solver.simulations(0.1, motors, **given)
    assert batch.interrupted
    assert not whole.interrupted
    np.testing.assert_array_equal(batch.status, np.repeat([Status.CERTIFIED, Status.UNSETTLED, Status.UNSETTLED], 16))
    np.testing.assert_allclose(
        batch.tip_position[:16], whole.tip_position[:16], rtol=0, atol=1e-9
    )  # parts begin without a past
    assert np.all(np.isfinite(batch.tip_position))


def test_long_batches_are_done_in_parts(solver: CompiledModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C ends a batch between two of them."""
    given: dict[str, Any] = {"forces": np.linspace((0.0, 0.0, 0.0), (0.0, 5.0, 0.0), 64), "time_step": 1e-3}
    whole, forces, parts = solver.simulations(0.01, np.zeros(3), **given), MotionCases.forces, []

    def looked_at(cases: MotionCases, grid: np.ndarray, rows: slice) -> np.ndarray:
        parts.append(rows)
        return forces(cases, grid, rows)

    monkeypatch.setattr(motion_runs, "_CASE_STEPS", 16 * 11)
    monkeypatch.setattr(MotionCases, "forces", looked_at)
    found = solver.simulations(0.01, np.zeros(3), **given)
    np.testing.assert_allclose(found.q_springs, whole.q_springs, rtol=0, atol=1e-14)  # rounding of vector instructions
    assert parts == [slice(first, first + 16) for first in (0, 16, 32, 48)]


REFUSED: list[tuple[Any, str]] = [
    (lambda c: c.simulate(0.0, np.zeros(3)), "duration"),
    (lambda c: c.simulate(1.0, np.zeros(2)), "q_motors"),
    (lambda c: c.simulate(1.0, np.full(3, 1e12)), "q_motors"),
    (lambda c: c.simulate(1.0, np.zeros(3), start=5), "start"),
    (lambda c: c.simulate(1.0, np.zeros(3), force=np.zeros(2)), "force"),
    (lambda c: c.simulate(1.0, np.zeros(3), time_step=-1.0), "time_step"),
    (lambda c: c.simulate(1.0, np.zeros(3), time_step=1e-3, tolerance=1e-3), "tolerance"),
    (lambda c: c.simulate(1.0, np.zeros(3), mass_damping=-1.0), "mass_damping"),
    (lambda c: c.step(np.zeros(3), np.zeros(4), np.zeros(3)), "q_springs"),
    (lambda c: c.step(np.zeros(4), np.zeros(4), np.zeros((2, 3))), "q_motors"),
    (lambda c: c.step(np.zeros(4), np.zeros(4), np.zeros(3), np.full(3, np.nan)), "force"),
    (lambda c: c.simulations(1.0, np.zeros((4, 3)), forces=np.zeros((3, 3))), "q_motors"),
    (lambda c: c.simulations(1.0, np.zeros(3), threads=0), "threads"),
]


@pytest.mark.parametrize("row", range(len(REFUSED)))
def test_refused(row: int, solver: CompiledModel) -> None:
    call, name = REFUSED[row]
    with pytest.raises(ParameterError, match=name):
        call(solver)


@pytest.mark.system
def test_the_c_file_takes_the_same_steps(solver: CompiledModel, arm: SoftModel, tmp_path: Path) -> None:
    """Through ctypes, as a controller calls it."""
    given = {"gravity": GRAVITY, "damping_time": 1e-3, "time_step": 1e-3}
    expected = solver.simulate(0.1, swaying, force=gust, output_step=1e-3, **given)
    controller = Controller(solver, tmp_path, name="moving", motion=True)
    controller.put("GRAVITY", GRAVITY)
    controller.put("DAMPING", 1e-3 * arm.stiffness)
    controller.put("TIME_STEP", [1e-3])
    controller.put("VELOCITY", expected.velocities[0])  # behind the blow with which the motors begin
    for row in range(100):
        for name, share in (("MOTORS_BEGIN", 0.0), ("MOTORS_MIDDLE", 0.5), ("MOTORS_END", 1.0)):
            controller.put(name, swaying(1e-3 * (row + share)))
        controller.put("FORCE", gust(1e-3 * (row + 0.5)))
        assert controller.call("motion_step") == 0
        np.testing.assert_allclose(controller.get("POSITION", 4), expected.q_springs[row + 1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("least", [4, 10**9])
def test_chosen_steps_go_on_to_shorter_ones_where_long_ones_fail(least: int) -> None:
    """Runs of less than `least` steps fail, others have an error of second order; a few failures in a row are the end."""
    runs: list[int] = []

    def take(grid: np.ndarray) -> motion_runs.StepsTaken:
        runs.append(len(grid) - 1)
        rows = np.full((1, 1, 3), (1.0 / runs[-1] ** 2, 0.0, 0.0) if runs[-1] >= least else np.nan)
        return motion_runs.StepsTaken(grid, rows, np.array([Status.CERTIFIED if runs[-1] >= least else Status.UNSETTLED]))

    taken = motion_runs.halve_to_tolerance(take, np.linspace(0.0, 1.0, 2), 1e-3, 2)
    assert (taken.status[0] == Status.CERTIFIED) == (least == 4)
    if least == 4:
        assert taken.errors is not None
        assert 1.0 / runs[-1] ** 2 <= taken.errors[0] <= 1e-3
        assert taken.is_within
    assert runs == [2**power for power in range(len(runs))]
    assert len(runs) < 8
