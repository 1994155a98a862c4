"""C source of whole robots: compiled without a library, called through ctypes, and compared with the Python back end."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.conftest import missing
from tests.support.c_libraries import Controller
from tests.support.load_cases import cases, directions

pytestmark = pytest.mark.system

GRAVITY = np.array(sr.EARTH_GRAVITY)
Array = ctypes.POINTER(ctypes.c_double)
SAME = 1e-12  # sine and cosine differ from libm's by an ulp; of angles of a radian and lengths of a metre


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("robots")


@pytest.fixture(scope="module")
def solver(arm: sr.SoftModel) -> CompiledModel:
    return sr.compile(arm, backend="python")


@pytest.fixture(scope="module", params=[None, GRAVITY], ids=["weightless", "heavy"])
def controller(request: pytest.FixtureRequest, solver: CompiledModel, folder: Path) -> tuple[Controller, Any]:
    heavy = request.param is not None
    return Controller(solver, folder, gravity=heavy, name="heavy_arm" if heavy else "arm"), request.param


def ready(controller: Controller, motors: np.ndarray, force: np.ndarray, gravity: Any) -> None:
    controller.clear()
    controller.put("MOTORS", motors)
    controller.put("FORCE", force)
    if gravity is not None:
        controller.put("GRAVITY", gravity)


def test_equilibria(controller: tuple[Controller, Any], solver: CompiledModel, rng: np.random.Generator) -> None:
    """200 cases, a third of them hard enough for the descent."""
    in_c, gravity = controller
    motors, forces = cases(rng, 200, 1.0, 120.0)
    forces[150:] *= 1.6
    for q, f in zip(motors, forces, strict=True):
        ready(in_c, q, f, gravity)
        assert in_c.call("settle") == Status.CERTIFIED
        expected = solver.equilibrium(q, f, gravity=gravity)
        assert np.allclose(in_c.get("UNKNOWN", 4), expected.q_springs, rtol=0.0, atol=SAME)
        assert np.allclose(in_c.get("TIP", 3), expected.tip_position, rtol=0.0, atol=SAME)
        assert abs(np.sqrt(in_c.get("ERROR", 1)[0]) - expected.residual) < 1e-10 * np.linalg.norm(f)
        in_c.put("UNKNOWN", expected.q_springs + 0.01)
        assert in_c.call("settle_from") == Status.CERTIFIED
        assert np.allclose(in_c.get("UNKNOWN", 4), expected.q_springs, rtol=0.0, atol=1e-9)  # from elsewhere


def test_bad_numbers_end_in_a_status(controller: tuple[Controller, Any]) -> None:
    in_c, gravity = controller
    for motors, force in (((np.nan, 0.0, 0.0), np.ones(3)), (np.ones(3), (np.inf, 0.0, 0.0)), (np.ones(3), (0.0, np.nan, 0.0))):
        ready(in_c, np.array(motors), np.array(force), gravity)
        assert in_c.call("settle") in (Status.NOT_A_NUMBER, Status.UNSETTLED)


def test_load_estimation(controller: tuple[Controller, Any], solver: CompiledModel, rng: np.random.Generator) -> None:
    in_c, gravity = controller
    motors, forces = cases(rng, 200, 1.0, 30.0)
    for q, f in zip(motors, forces, strict=True):
        torques = sr.solve_equilibrium(solver.model, q, f, gravity=gravity, tolerance=1e-12).motor_torques
        ready(in_c, q, np.zeros(3), gravity)
        in_c.put("TORQUES", torques)
        status = in_c.call("estimate")
        expected = solver.estimate_loads(q[None], torques[None], gravity=gravity)
        assert status == expected.status[0]
        # A force is as uncertain as the motors feel it weakly.
        weakness = 1.0 / max(expected.observability[0], 1e-6)
        if status == Status.CERTIFIED:
            assert np.linalg.norm(in_c.get("FORCE", 3) - expected.forces[0]) < 1e-10 * weakness**2
            if expected.observability[0] > 0.05:
                assert np.linalg.norm(in_c.get("FORCE", 3) - f) < 1e-8 * np.linalg.norm(f)


def test_inverse_kinematics(controller: tuple[Controller, Any], solver: CompiledModel, rng: np.random.Generator) -> None:
    in_c, gravity = controller
    motors, forces = cases(rng, 200, 1.0, 30.0)
    motors *= 0.8
    targets = solver.equilibria(motors, forces, gravity=gravity).tip_positions
    start = motors + rng.normal(scale=0.03, size=motors.shape)
    expected = solver.inverse_kinematics(targets, forces, q_motors0=start, gravity=gravity)
    assert np.count_nonzero(expected.certified) > 195
    for row in np.flatnonzero(expected.certified):
        ready(in_c, start[row], forces[row], gravity)
        in_c.put("TARGET", targets[row])
        in_c.put("TOLERATED", [1e-9])
        assert in_c.call("reach") == Status.CERTIFIED
        settled = solver.equilibrium(in_c.get("MOTORS", 3), forces[row], gravity=gravity)
        assert np.linalg.norm(settled.tip_position - targets[row]) < 1.1e-9
    ready(in_c, np.array([0.1, 0.2, 0.3]), directions(rng, 1)[0], gravity)
    in_c.put("TARGET", (2.0, 0.0, 0.0))
    in_c.put("TOLERATED", [1e-9])
    assert in_c.call("reach") == Status.NOT_REACHED


def test_paths(controller: tuple[Controller, Any], solver: CompiledModel) -> None:
    in_c, gravity = controller
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    targets = np.array([np.full(200, 0.75), 0.1 + 0.2 * np.cos(turn), 0.3 + 0.2 * np.sin(turn)]).T
    targets[50] = (5.0, 0.0, 0.0)
    expected = solver.follow(targets, (0.0, 10.0, -15.0), gravity=gravity)
    ready(in_c, expected.q_motors[0], np.array([0.0, 10.0, -15.0]), gravity)
    in_c.put("TOLERATED", [1e-9])
    motors, springs = np.zeros((200, 3)), np.zeros((200, 4))
    residuals, errors, statuses = np.zeros(200), np.zeros(200), np.zeros(200)
    arrays = [one.ctypes.data_as(Array) for one in (motors, springs, residuals, errors, statuses)]
    reached = in_c.call("follow", np.ascontiguousarray(targets).ctypes.data_as(Array), 200, *arrays)
    assert reached == 199
    assert np.array_equal(statuses, expected.status)
    certified = expected.certified
    assert np.max(np.abs(motors - expected.q_motors)[certified]) < 1e-8  # two answers within 1e-9 m
    assert np.max(np.sqrt(errors[certified])) <= 1e-9


def test_poses(folder: Path, rng: np.random.Generator) -> None:
    """An arm with a wrist: poses that equilibria have are reached, and a path of them is followed as in Python."""
    model = sr.load_model(sr.InflatableArm(wrist=(0.08, 0.12)))
    solver = sr.compile(model, backend="python")
    in_c = Controller(solver, folder, gravity=True, name="wristed", poses=True)
    pushes = directions(rng, 5) * 12.0
    for push in pushes:
        motors = rng.uniform(-1.2, 1.2, 6)
        pose = sr.solve_equilibrium(model, motors, push, gravity=GRAVITY).transform_tip_to_world
        ready(in_c, motors + rng.uniform(-0.05, 0.05, 6), push, GRAVITY)
        in_c.put("TARGET", [*pose.translation, *pose.rotation.ravel()])
        in_c.put("TOLERATED", [1e-9])
        assert in_c.call("reach") == Status.CERTIFIED
        there = sr.solve_equilibrium(model, in_c.get("MOTORS", 6), push, gravity=GRAVITY).transform_tip_to_world
        assert np.linalg.norm(there.translation - pose.translation) < 1.1e-9
        assert np.linalg.norm(pin.log3(there.rotation.T @ pose.rotation)) < 1.1e-9
    line = sr.straight_line(
        pose, sr.solve_equilibrium(model, motors + 0.2, push, gravity=GRAVITY).transform_tip_to_world, 1.0, 20
    )
    expected = solver.follow(line.targets, push, q_motors0=motors, gravity=GRAVITY)
    targets = np.concatenate([line.positions, line.orientations.reshape(-1, 9)], axis=1)
    ready(in_c, motors, push, GRAVITY)
    in_c.put("TOLERATED", [1e-9])
    found, springs, errors = np.zeros((21, 6)), np.zeros((21, 4)), np.zeros((21, 2))
    arrays = [one.ctypes.data_as(Array) for one in (found, springs, np.zeros(21), errors, np.zeros(21))]
    assert in_c.call("follow", targets.ctypes.data_as(Array), 21, *arrays) == 21
    assert np.abs(found - expected.q_motors).max() < 1e-6  # two answers within 1e-9 rad
    assert np.sqrt(errors).max() <= 1e-9


@pytest.mark.study
def test_slack_walls(folder: Path, rng: np.random.Generator) -> None:
    """The law of a slack wall, its cube roots and the coupling of both springs of a link, as in Python."""
    solver = sr.compile(sr.load_model(sr.InflatableArm(moment_law="slack_wall")), backend="python")
    in_c = Controller(solver, folder, gravity=True, name="slack_arm")
    motors, forces = cases(rng, 60, 1.0, 60.0)
    for q, f in zip(motors, forces, strict=True):
        ready(in_c, q, f, GRAVITY)
        assert in_c.call("settle") == Status.CERTIFIED
        expected = solver.equilibrium(q, f, gravity=GRAVITY)
        assert np.allclose(in_c.get("UNKNOWN", 4), expected.q_springs, rtol=0.0, atol=1e-9)  # soft springs


def test_muscles(folder: Path, rng: np.random.Generator) -> None:
    """Lengths start the unknowns at a shape that has them; tensions pull on the strains."""
    for input_ in ("lengths", "forces"):
        solver = sr.compile(sr.load_model(sr.PccArm(elastic_sections=2), muscles=input_), backend="python")
        in_c = Controller(solver, folder, gravity=False, name=f"pcc_{input_}")
        assert in_c.place["N_MUSCLES"] == 6
        for _ in range(20):
            size = 0.524 * rng.uniform(0.93, 1.07, 6) if input_ == "lengths" else rng.uniform(0.0, 30.0, 6)
            force = rng.uniform(-3.0, 3.0, 3)
            expected = solver.equilibrium(size, force)
            in_c.clear()
            in_c.put("FORCE", force)
            in_c.call("put_muscles", (ctypes.c_double * 6)(*size))
            assert in_c.call("settle") == Status.CERTIFIED
            assert np.allclose(in_c.get("TIP", 3), expected.tip_position, rtol=0.0, atol=1e-11)
            assert np.array_equal(expected.q_motors, size)
        in_c.call("look_at_tip")  # of the last case
        run = solver._run(False)
        jacobian = solver._actuation.jacobian(run, list(in_c.w))
        settled = sr.solve_equilibrium(solver.model, size, force, q_springs0=expected.q_springs)
        slope = sr.elastostatic_jacobian(solver.model, settled)
        assert np.allclose(jacobian, slope, rtol=0.0, atol=1e-9 * np.abs(slope).max())


def test_nothing_is_left_to_a_library(controller: tuple[Controller, Any], folder: Path) -> None:
    """No undefined symbols, no variables, and names that begin with the prefix."""
    if not shutil.which("nm"):
        missing("nm is not installed (Debian: apt-get install binutils)")
    in_c, _ = controller
    done = subprocess.run(["nm", "-D", str(in_c.path)], capture_output=True, text=True, check=True)
    symbols = [line.split()[-2:] for line in done.stdout.splitlines()]
    assert symbols
    assert all(kind == "T" and name.startswith(("arm_", "heavy_arm_")) for kind, name in symbols), symbols
