"""Motions that cannot go on: the error has what there is, which is the beginning of the motion that goes on."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.cli.main import main
from softrobots.compiled import Status
from softrobots.compiled.run import motion_runs
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.dynamics.midpoint import MidpointRule
from softrobots.dynamics.starting import first_state
from softrobots.dynamics.time_inputs import MotorPath
from tests.support.saved_files import altered, same

MOTORS = (0.3, 0.6, -0.8)
GOAL = np.array((0.5, 0.7, -0.9))
UNTIL = 0.0202  # time at which functions fail [s]


@pytest.fixture(scope="module")
def held(arm: sr.SoftModel) -> sr.Equilibrium:
    return sr.solve_equilibrium(arm, MOTORS, gravity=sr.EARTH_GRAVITY)


@pytest.fixture(scope="module")
def solver(arm: sr.SoftModel) -> CompiledModel:
    return sr.compile(arm, backend="python")


def lost() -> Any:
    raise ConnectionError("the robot does not answer")


WRONG: list[tuple[Callable[[], Any], str, type[Exception]]] = [
    (lost, "ConnectionError: the robot does not answer", ConnectionError),
    (lambda: np.full(3, np.nan), "of finite numbers", sr.ParameterError),
    (lambda: (1.0, 2.0), r"of shape \(3,\)", sr.ParameterError),
]
WAYS: list[dict[str, Any]] = [{"time_step": 2e-3}, {"time_step": 2e-3, "sample_time": 4e-3}, {"tolerance": 1e-3}]


@pytest.mark.parametrize("way", range(len(WAYS)))
def test_a_controller_that_fails_late_leaves_the_motion_until_then(arm: sr.SoftModel, held: sr.Equilibrium, way: int) -> None:
    """Row by row that of the controller which does not fail; the message tells the time of the last step."""
    options = {"start": held, "gravity": sr.EARTH_GRAVITY, "motors": "torque", "output_step": 2e-3} | WAYS[way]

    def torque(t: float, q: Any, qd: Any) -> Any:
        return 400.0 * (GOAL - q) - 30.0 * qd

    whole = sr.simulate(arm, 0.04, None, torque=torque, **options)
    for answer, words, cause in WRONG:

        def failing(t: float, q: Any, qd: Any, answer: Any = answer) -> Any:
            return answer() if t > UNTIL else torque(t, q, qd)

        with pytest.raises(
            sr.NotConverged, match=rf"^the motion ends at t = 0\.0\d+ s of 0\.04 s: .*{words}.*`best`"
        ) as caught:
            sr.simulate(arm, 0.04, None, torque=failing, **options)
        assert isinstance(caught.value.__cause__, cause)
        best = caught.value.best
        assert UNTIL - 6e-3 < best.time[-1] <= UNTIL + 4e-3  # rows 2 ms apart, steps and samples up to 4 ms
        assert best.energy.balance.shape == best.time.shape
        assert np.all(np.isfinite(best.energy.balance))
        if "time_step" in WAYS[way]:  # the first of the runs for a tolerance has other steps than the last
            same_rows(best, whole)
        else:
            assert np.abs(best.tip_position - whole.tip_position[: len(best.time)]).max() < 1e-2  # of a run not yet refined
            assert (best.tolerance, best.tip_error) == (1e-3, None)


def same_rows(best: sr.Motion, whole: sr.Motion) -> None:
    count = len(best.time)
    for name in ("time", "q_motors", "q_springs", "velocities", "motor_velocities", "forces"):
        assert np.array_equal(getattr(best, name), getattr(whole, name)[:count])
    # Works are interpolated, torques of prescribed motors extrapolated, from the steps there are.
    assert np.allclose(best.energy.balance[:-1], whole.energy.balance[: count - 1], rtol=0.0, atol=1e-14)


class Late:
    """A force that is as it should be while it is searched for jumps, and fails later."""

    def __init__(self, calls: int, answer: Callable[[], Any]) -> None:
        self.calls, self.answer = calls, answer

    def __call__(self, time: float) -> Any:
        self.calls -= 1
        return self.answer() if self.calls < 0 and time > UNTIL else push(time)


def push(time: float) -> tuple[float, float, float]:
    return (0.0, 5.0 * math.sin(20.0 * time), 0.0)


def searches(arm: sr.SoftModel) -> int:
    """Calls of a force before the first step."""
    calls = []
    with pytest.raises(sr.ParameterError, match="order"):
        sr.simulate(arm, 0.04, MOTORS, force=lambda t: (calls.append(t), push(t))[1], order=7)
    return len(calls)


@pytest.mark.parametrize("number", range(len(WRONG)))
def test_a_load_that_fails_late_leaves_the_motion_until_then(
    arm: sr.SoftModel, held: sr.Equilibrium, solver: CompiledModel, number: int
) -> None:
    """In both engines, and of a batch the other cases as they are without that one."""
    answer, words, cause = WRONG[number]
    calls = searches(arm)
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "time_step": 1e-3, "output_step": 2e-3}
    whole = sr.simulate(arm, 0.04, MOTORS, start=held, force=push, **options)
    for simulate in (lambda *a, **k: sr.simulate(arm, *a, **k), solver.simulate):
        with pytest.raises(sr.NotConverged, match=rf"ends at t = 0\.02 s of 0\.04 s: .*{words}") as caught:
            simulate(0.04, MOTORS, start=held, force=Late(calls, answer), **options)
        assert isinstance(caught.value.__cause__, cause)
        best = caught.value.best
        assert best.time[-1] == pytest.approx(0.02)
        count = len(best.time)
        assert np.allclose(best.q_springs, whole.q_springs[:count], rtol=0.0, atol=1e-11)  # of two engines, to their tolerance
        assert np.array_equal(best.forces, whole.forces[:count])
    with pytest.raises(sr.NotConverged, match=rf"^case 1: the motion ends at t = 0\.02 s.*{words}") as caught:
        solver.simulations(0.04, MOTORS, starts=held, forces=[push, Late(calls, answer), lambda _: np.zeros(3)], **options)
    batch, calm = caught.value.best, sr.simulate(arm, 0.04, MOTORS, start=held, **options)
    assert batch.status.tolist() == [Status.CERTIFIED, Status.NOT_A_NUMBER, Status.CERTIFIED]
    assert np.allclose(batch.q_springs[::2], [whole.q_springs, calm.q_springs], rtol=0.0, atol=1e-11)
    assert np.allclose(batch.q_springs[1, :count], whole.q_springs[:count], rtol=0.0, atol=1e-11)
    assert not batch.q_springs[1, count:].any()


def test_what_fails_before_there_is_a_step_is_an_error_of_its_own(arm: sr.SoftModel, solver: CompiledModel) -> None:
    with pytest.raises(ConnectionError):
        sr.simulate(arm, 0.1, MOTORS, motors="torque", torque=lambda *_: lost(), time_step=1e-3)
    with pytest.raises(ConnectionError):
        solver.simulate(0.1, MOTORS, force=lambda _: lost(), time_step=1e-3)


def test_a_motion_that_runs_away_leaves_what_can_be_computed() -> None:
    """A wheel on a spring of negative stiffness grows as exp(rate t) until no number is large enough."""
    text = (
        '<robot name="wheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="motor" type="continuous">'
        '<parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/><limit effort="0" velocity="9"/></joint></robot>'
    )
    model, rate = sr.load_model(text, springs={}, tip="wheel"), 100.0
    with pytest.raises(sr.NotConverged, match="the motion ends at t = ") as caught:
        sr.simulate(
            model, 2.0, (0.0,), motors="torque", torque=lambda t, q, qd: rate**2 * (q + 1.0), time_step=2e-3, output_step=2e-3
        )
    best = caught.value.best
    assert best.time[-1] > 0.4
    angles = best.q_motors[:, 0]
    growth = math.log((1.0 + rate * 1e-3) / (1.0 - rate * 1e-3))  # of the midpoint rule in a step
    assert np.allclose(angles[1:] + 1.0, np.cosh(growth * np.arange(1, len(angles))), rtol=1e-9)  # closed form of the scheme
    assert all(np.all(np.isfinite(getattr(best.energy, name))) for name in ("kinetic", "motor_work", "balance"))


def test_the_command_writes_what_there_is_of_a_motion_that_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Steps beyond 60 ms fail; the saved motion is the beginning of the whole one, from which a simulation goes on."""
    words = ["inflatable_arm", "--duration", "0.1", "--gravity", "--time-step", "0.01", "--output-step", "0.01"]
    whole, failed = tmp_path / "whole.npz", tmp_path / "failed.npz"
    assert main(["simulate", *words, "--order", "4", "-o", str(whole)]) == 0  # not by the steps that fail
    assert main(["simulate", *words, "--order", "2", "-o", str(whole), "--overwrite"]) == 0
    step = MidpointRule.step
    monkeypatch.setattr(MidpointRule, "step", lambda rule, at, end: None if end > 0.0601 else step(rule, at, end))
    assert main(["simulate", *words, "-o", str(failed)]) == 1
    _, err = capsys.readouterr()
    assert re.search(r"error: no step from t = 0\.060\d* s succeeds.*; `best` is the motion until there$", err.strip())
    one, other = sr.load_result(whole), sr.load_result(failed)
    assert other.time[-1] == pytest.approx(0.06)
    same_rows(other, one)


def test_energies_of_a_compiled_motion_can_be_interrupted(solver: CompiledModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are computed when they are asked for: Ctrl-C then is Ctrl-C, and they can be asked for again."""
    motion, sample = solver.simulate(0.02, MOTORS, time_step=1e-3), motion_runs.forces_of_steps

    def pressed(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(motion_runs, "forces_of_steps", pressed)
    with pytest.raises(KeyboardInterrupt):
        _ = motion.energy
    monkeypatch.setattr(motion_runs, "forces_of_steps", sample)
    assert np.all(np.isfinite(motion.energy.balance))


def test_compiled_runs_show_their_progress(
    solver: CompiledModel, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr(motion_runs, "_CHUNK", 5)
    monkeypatch.setattr(motion_runs, "_CASE_STEPS", 16 * 21)
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "time_step": 1e-3}
    for shown in (False, True, "swing"):
        solver.simulate(0.02, MOTORS, progress=shown, **options)
        one = capsys.readouterr().err
        solver.simulations(0.02, np.tile(MOTORS, (40, 1)), progress=shown, **options)
        many = capsys.readouterr().err
        if not shown:
            assert one == many == ""
        else:
            assert ("swing: " if shown == "swing" else "motion, 20 steps: ") in one
            assert "4/4" in one  # parts of 5 steps
            assert ("swing: " if shown == "swing" else "motions, 20 steps: ") in many
            assert "3/3" in many  # blocks of 16 cases


def test_all_cases_start_from_one_equilibrium(arm: sr.SoftModel, solver: CompiledModel) -> None:
    """As `start=` of the other engine; with motors elsewhere, or of another robot, it is refused."""
    loaded = sr.solve_equilibrium(arm, MOTORS, (0.0, 6.0, -8.0), gravity=sr.EARTH_GRAVITY)
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "time_step": 1e-3}
    forces = np.array([(0.0, 0.0, 0.0), (0.0, 3.0, 1.0)])
    for motors in (MOTORS, lambda t: np.array(MOTORS) + 0.2 * t):
        batch = solver.simulations(0.02, motors, starts=loaded, forces=forces, **options)
        for force, found in zip(forces, batch.tip_position, strict=True):
            expected = sr.simulate(arm, 0.02, motors, start=loaded, force=force, **options).tip_position
            assert np.abs(found - expected).max() < 1e-11  # of two engines, to their tolerance
    other = sr.load_model(sr.InflatableArm(stiffness=150.0))
    apart = np.array([MOTORS, (0.3, 0.6, -0.7)])
    for motors, start, words in (
        (apart, loaded, "where `start` has the actuators"),
        (lambda t: np.array((0.3, 0.6, -0.7)), loaded, "where `start` has the actuators"),
        (MOTORS, sr.solve_equilibrium(other, MOTORS), "a state of the model given"),
    ):
        with pytest.raises(sr.ParameterError, match=words):
            solver.simulations(0.02, motors, starts=start, **options)
    kept = first_state(arm, loaded, MotorPath(arm, MOTORS, 1.0)).x
    assert np.array_equal(kept, [*MOTORS, *loaded.q_springs])


@pytest.mark.parametrize("suffix", ["npz", "json"])
def test_a_saved_batch_comes_back_equal(solver: CompiledModel, suffix: str, tmp_path: Path) -> None:
    """Failed cases too; another batch goes on from it to the last bit."""
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "output_step": 5e-3}
    forces = np.array([(0.0, 6.0, -8.0), (0.0, np.inf, 0.0), (1.0, 2.0, 3.0)])
    steps = {"time_step": 1e-3} if suffix == "npz" else {"tolerance": 1e-3}
    batch = solver.simulations(0.02, MOTORS, forces=forces, **steps, **options)
    assert batch.status.tolist() == [Status.CERTIFIED, Status.NOT_A_NUMBER, Status.CERTIFIED]
    again = sr.load_result(sr.save_result(batch, tmp_path / f"batch.{suffix}"))
    same(batch, again)
    one, other = (solver.simulations(0.01, MOTORS, starts=start, time_step=1e-3).q_springs for start in (batch, again))
    assert np.array_equal(one, other)
    if suffix == "npz":
        for changes, words in (
            ({"status": np.array([0, 0, 200])}, "which status"),
            ({"status": np.array([0, 4])}, "q_springs"),
            ({"velocities": np.zeros((3, len(batch.time), 5))}, "another shape"),
            ({"tip_position": np.full((3, len(batch.time), 3), np.nan)}, "tip_position"),
            ({"time": np.zeros(len(batch.time))}, "time"),
            ({"interrupted": np.array(2)}, "interrupted"),
        ):
            with pytest.raises(sr.FileFormatError, match=words):
                sr.load_result(altered(tmp_path / "batch.npz", tmp_path / "other.npz", **changes))


@pytest.mark.parametrize("suffix", ["npz", "json"])
def test_a_saved_linear_model_comes_back_equal(held: sr.Equilibrium, suffix: str, tmp_path: Path) -> None:
    for motors, options in (
        ("prescribed", {}),
        ("torque", {"damping_time": 1e-3, "mass_damping": 0.2, "rotor_inertia": (0.05, 0.1, 0.2)}),
    ):
        linear = sr.linearize(held.model, held, motors=motors, **options)
        again = sr.load_result(sr.save_result(linear, tmp_path / f"linear.{suffix}", overwrite=True))
        for name in "ABCD":
            assert np.array_equal(getattr(again, name), getattr(linear, name))
        for name in ("motors", *(f"{kind}_{what}" for kind in ("state", "input", "output") for what in ("names", "units"))):
            assert getattr(again, name) == getattr(linear, name)
        same(linear.equilibrium, again.equilibrium)
    if suffix == "npz":
        for changes, words in (
            ({"A": 1.001 * linear.A}, "its matrix A is not that"),
            ({"D": np.zeros((2, 2))}, "D must be"),
            ({"motors": np.array("voltage")}, "motors"),
        ):
            with pytest.raises(sr.FileFormatError, match=words):
                sr.load_result(altered(tmp_path / "linear.npz", tmp_path / "other.npz", **changes))


@pytest.mark.parametrize("order", [np.array([2, 4]), [4], "4", True, 3, math.nan])
def test_an_order_that_is_none_is_refused(arm: sr.SoftModel, solver: CompiledModel, order: Any) -> None:
    for refused in (
        lambda: sr.simulate(arm, 0.1, MOTORS, order=order),
        lambda: solver.simulate(0.1, MOTORS, order=order),
        lambda: solver.simulations(0.1, MOTORS, order=order),
        lambda: solver.step(np.zeros(4), np.zeros(4), MOTORS, order=order),
    ):
        with pytest.raises(sr.ParameterError, match="order must be 2, 4 or None"):
            refused()
