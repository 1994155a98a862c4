"""Compiled motion of robots with actuators of every kind on any route, also of given lengths: against simulate, and by laws."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.motion_program import make_motion_program
from softrobots.compiled.run.backends import make_run
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.gauss import SQUARES, STAGES, WEIGHTS
from tests.support.c_libraries import Controller
from tests.support.serial_chains import ARM, LENGTHS, ROBOTS

GRAVITY = (0.4, -1.0, -9.7)
PULLS = {"length": 2e-3, "elastic": 2e-3, "tension": 4.0, "pressure": 4e4, "mckibben": 4e4}
"""Size of the changes of the inputs: some elastic tendons go slack."""
ARMS: dict[str, Callable[[], sr.SoftModel]] = {
    "tendons": ROBOTS["tendons"],
    "winding": ROBOTS["winding"],
    "lumped": lambda: sr.load_model(
        sr.PccArm(segment_lengths=LENGTHS, chain="lumped", hinges=1, kind=("mckibben", "elastic"), routing="base")
    ),
    "on an arm": lambda: sr.load_model(
        sr.mount(sr.InflatableArm().urdf(), "tip", sr.PccArm(**ARM, kind=("elastic", "pressure"), routing="base"))
    ),
    "lengths": ROBOTS["pcc"],
    "uneven lengths": ROBOTS["uneven"],
    "winding lengths": ROBOTS["coils"],
    "lengths on an arm": ROBOTS["stacked"],
    "lumped winding": ROBOTS["lumped_winding"],
    "lumped coils": ROBOTS["lumped_coils"],
}


@cache
def robot(name: str) -> sr.SoftModel:
    return ARMS[name]()


@cache
def solver(name: str) -> CompiledModel:
    return sr.compile(robot(name), backend="python")


def inputs(model: sr.SoftModel, rng: np.random.Generator) -> np.ndarray:
    """Inputs near rest: motor joints up to half a radian, actuators by their kind; lengths of one shape."""
    joints = model.n_motors - len(model.muscles)
    sizes = np.array([0.5] * joints + [PULLS[tag.kind] for tag in model.muscles])
    signs = [-1.0] * joints + [-1.0 if tag.kind in ("length", "elastic") else 0.0 for tag in model.muscles]
    return np.asarray(model.relaxed_motors + sizes * rng.uniform(signs, 1.0))


def close(found: Any, expected: Any, steps: int, h: float) -> None:
    """Two runs at the same steps: each step is solved to 1e-13 of a radian or metre, and a velocity to that over the step."""
    np.testing.assert_allclose(found.tip_position, expected.tip_position, rtol=0, atol=1e-9 * expected.model.reach)
    np.testing.assert_allclose(
        found.q_springs, expected.q_springs, rtol=0, atol=1e-9 * np.abs(expected.q_springs).max() + steps * 1e-12
    )
    left = 1e-9 * np.abs(expected.velocities).max() + steps * 2e-13 / h
    np.testing.assert_allclose(found.velocities, expected.velocities, rtol=0, atol=left)


@pytest.mark.study
@pytest.mark.parametrize(("name", "order"), [(name, 4 if place % 2 else 2) for place, name in enumerate(ARMS)])
def test_a_released_robot_moves_as_simulate_says(name: str, order: int, rng: np.random.Generator) -> None:
    """From relaxed springs, under its weight, a force and inputs that differ from those at rest, damped by the file or not."""
    model, h, steps = robot(name), 1e-3, 6
    given = {"force": (0.2, 0.1, -0.1), "gravity": GRAVITY, "time_step": h, "output_step": h, "order": order}
    given["mass_damping"] = 5.0
    motors = inputs(model, rng)
    expected = sr.simulate(model, steps * h, motors, **given)
    found = solver(name).simulate(steps * h, motors, **given)
    assert np.abs(expected.q_springs[-1] - expected.q_springs[0]).max() > 1e-4
    close(found, expected, steps, h)
    np.testing.assert_allclose(found.energy.elastic, expected.energy.elastic, rtol=1e-8, atol=1e-12)


def test_tendons_go_slack_and_taut_again() -> None:
    """Violent motion of tendons of which half hang loose: both engines take all steps whole, and agree."""
    model, h, steps = robot("tendons"), 1e-3, 20
    motors = model.relaxed_motors + 1e-3 * np.array((-3.0, 1.0, 0.0, -6.0, 4.0, 0.0))
    given = {"gravity": GRAVITY, "damping_time": 0.005, "time_step": h, "output_step": h}
    expected = sr.simulate(model, steps * h, motors, **given)
    found = solver("tendons").simulate(steps * h, motors, **given)
    slack = expected.motor_torques == 0.0
    assert (slack.any(axis=0) & ~slack.all(axis=0)).any()
    assert len(expected.steps) == steps + 1
    close(found, expected, steps, h)


@pytest.mark.parametrize(("chain", "seed"), [("sections", 0), ("lumped", 2)])
def test_undamped_tendons_that_slacken_are_solved_by_the_steps_that_were_asked_for(chain: str, seed: int) -> None:
    """Where corrections run away from the guess by the steps before, they start anew: neither engine takes shorter steps."""
    model, rng = sr.load_model(sr.TendonArm(chain=chain, elastic_sections=2, hinges=2)), np.random.default_rng(seed)
    motors = model.motor_limits.mean(axis=1) * (1.0 + 0.02 * rng.uniform(-1.0, 1.0, model.n_motors))
    gravity, force = 6.0 * rng.normal(size=3), 0.5 * rng.normal(size=3)
    given: dict[str, Any] = {"start": sr.solve_equilibrium(model, motors, force, gravity=gravity), "gravity": gravity}
    given |= {"damping_time": 0.0, "time_step": 2e-3, "order": 4}
    slow, fast = (
        one(0.02, motors, **given) for one in (partial(sr.simulate, model), sr.compile(model, backend="python").simulate)
    )
    assert len(slow.steps) == 11
    np.testing.assert_allclose(fast.q_springs, slow.q_springs, rtol=0, atol=1e-9 * np.abs(slow.q_springs).max())


@pytest.mark.study
@pytest.mark.parametrize("name", ["tendons", "lengths", "winding lengths"])
def test_inputs_may_move(name: str, rng: np.random.Generator) -> None:
    """Motors of tendons, lengths and motor joints that swing, one robot by itself and two side by side."""
    model, h, steps = robot(name), 1e-3, 6
    change = inputs(model, rng) - model.relaxed_motors

    def path(t: float) -> np.ndarray:
        return np.asarray(model.relaxed_motors + change * np.sin(40.0 * t) ** 2)

    given = {"gravity": GRAVITY, "damping_time": 0.005, "time_step": h, "output_step": 2 * h}
    expected = sr.simulate(model, steps * h, path, **given)
    close(solver(name).simulate(steps * h, path, **given), expected, steps, h)
    batch = solver(name).simulations(steps * h, [path, lambda t: path(0.5 * t)], **given)
    assert batch.certified.all()
    np.testing.assert_allclose(batch.tip_position[0], expected.tip_position, rtol=0, atol=1e-9 * model.reach)
    assert np.abs(batch.tip_position[1] - batch.tip_position[0]).max() > 1e-5


@pytest.mark.study
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("name", ["tendons", "winding", "lengths", "winding lengths", "lumped winding", "lumped coils"])
def test_a_step_solves_the_equations_of_motion(name: str, order: int, rng: np.random.Generator) -> None:
    """Pinocchio's equations at the stages of one step from a fast random state; damped by a number for each strain."""
    model, h = robot(name), 5e-4
    n, m, motors = model.n_springs, model.n_motors, inputs(model, rng)
    run: Any = make_run(make_motion_program(Unknowns(model.chain()), order=order), "python")
    layout, w = run.layout, run.workspace()
    y0, v0 = model.rest + 2e-3 * rng.normal(size=n), 0.5 * rng.normal(size=n)
    damping = 1e-3 * model.chain().stiffness * rng.uniform(0.5, 1.5, len(model.chain().stiffness))
    state = {"position": y0, "velocity": v0, "gravity": np.array(GRAVITY), "time_step": np.array([h]), "damping": damping}
    for key, values in (state | dict.fromkeys(("motors_begin", "motors_middle", "motors_end"), motors)).items():
        run.put(w, getattr(layout, key), values)
    assert run.motion_step(w) == Status.CERTIFIED
    place, count = (layout.stages, 2) if order == 4 else (layout.acceleration, 1)
    a = np.array(w[place : place + count * n]).reshape(count, n)
    squares, weights = (np.array(SQUARES), np.array(WEIGHTS)) if order == 4 else (np.full((1, 1), 0.25), np.full((1, 1), 0.5))
    shares = np.array(STAGES if order == 4 else (0.5,))[:, None]
    free = model.chain().free  # of the strains, without given lengths the identity
    equations, still = EquationsOfMotion(model, GRAVITY, free.T @ (damping[:, None] * free)), np.zeros(m)
    y, v = y0 + h * shares * v0 + h * h * squares @ a, v0 + h * weights @ a
    for stage in range(count):
        x, rates, changes = (np.concatenate(parts) for parts in ((motors, y[stage]), (still, v[stage]), (still, a[stage])))
        error = equations.balance(x, rates, changes, {})[m:]
        # A change of 1e-13 at a stage is one of K 1e-13 + M 1e-13 / (h^2 / 4) in the torques.
        size = np.abs(equations.stiffness(x, {})).max() + np.abs(equations.mass_matrix(x)).max() * 4.0 / h**2
        assert np.abs(error).max() < 1e-12 * size


@pytest.mark.study
def test_locked_strains_of_given_lengths_stay_at_rest(rng: np.random.Generator) -> None:
    """Without twist: the motion is that of an arm ten million times as stiff in twist, and lengths are linear."""
    arm = {"segment_lengths": (0.5, 0.4), "elastic_sections": 2}
    model, stiff = sr.load_model(sr.PccArm(**arm)), sr.load_model(sr.PccArm(**arm, torsional_stiffness=1e7))
    motors, given = inputs(model, rng), {"gravity": GRAVITY, "damping_time": 0.01, "time_step": 1e-3}
    found = sr.compile(model, backend="python", locked_strains=("twist",)).simulate(0.01, motors, **given)
    expected = sr.compile(stiff, backend="python").simulate(0.01, motors, **given)
    turned = [place for place, name in enumerate(model.springs.names) if "twist" in name]
    assert np.abs(found.q_springs[:, turned]).max() == 0.0
    np.testing.assert_allclose(found.tip_position, expected.tip_position, rtol=0, atol=1e-7)


def test_a_step_beyond_the_range_of_a_route_fails() -> None:
    """A section that is bent until the tendon inside of its bend has no length."""
    model = robot("winding lengths")
    with pytest.raises(sr.NotConverged):
        solver("winding lengths").step(model.rest, np.full(model.n_springs, 1e6), model.relaxed_motors)


@pytest.mark.system
@pytest.mark.parametrize(("name", "order"), [("tendons", 4), ("winding lengths", 2)])
def test_the_c_file_takes_the_same_steps(name: str, order: int, tmp_path: Path, rng: np.random.Generator) -> None:
    """Through ctypes."""
    model, motors, h = robot(name), inputs(robot(name), rng), 1e-3
    expected = solver(name).simulate(
        10 * h, motors, gravity=GRAVITY, damping_time=0.01, time_step=h, output_step=h, order=order
    )
    controller = Controller(solver(name), tmp_path, name="arm", motion=True, order=order)
    numbers = {"GRAVITY": GRAVITY, "DAMPING": 0.01 * model.chain().stiffness, "TIME_STEP": [h], "POSITION": model.rest}
    numbers |= dict.fromkeys(("MOTORS_BEGIN", "MOTORS_MIDDLE", "MOTORS_END"), motors)
    for key, values in numbers.items():
        controller.put(key, values)
    for row in range(10):
        assert controller.call("motion_step") == 0
        found = controller.get("POSITION", model.n_springs)
        np.testing.assert_allclose(found, expected.q_springs[row + 1], rtol=0, atol=1e-11)


@pytest.mark.system
def test_numba_takes_the_same_steps(rng: np.random.Generator) -> None:
    """In lanes; a lane that fails there would be done alone."""
    model = sr.load_model(sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1))
    motors = np.array([inputs(model, rng) for _ in range(2)])
    given = {"gravity": GRAVITY, "damping_time": 0.01, "time_step": 1e-3, "output_step": 1e-3}
    expected = sr.compile(model, backend="python").simulate(0.01, motors[1], **given)
    found = sr.compile(model, backend="numba").simulations(0.01, motors, **given)
    np.testing.assert_allclose(found.tip_position[1], expected.tip_position, rtol=0, atol=1e-11)


@pytest.mark.study
def test_motors_that_stand_do_no_work_in_steps_that_were_halved() -> None:
    """Two tendons pulled by a tenth at once bend sections nearly beyond their range; middles of whole steps are beyond it."""
    motors = robot("tendons").relaxed_motors * (0.9, 1.0, 1.0, 1.0, 0.9, 1.0)
    moved = solver("tendons").simulate(0.04, motors, force=(0.3, 0.0, 0.0), damping_time=0.0, time_step=0.02)
    assert np.all(moved.energy.motor_work == 0.0)
    assert np.all(np.isfinite(moved.energy.balance))
