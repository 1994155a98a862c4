"""Steps of fourth order: closed forms, SciPy's DOP853, energy and reversal, in both engines."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import softrobots as sr
from softrobots.core.errors import ParameterError
from tests.support.c_libraries import Controller
from tests.support.pendulums import LENGTH, MASS, double_pendulum, pendulum, tip_of
from tests.support.round_rods import RoundRod
from tests.support.serial_chains import ROBOTS

GRAVITY = (0.7, -0.4, -9.7)


@pytest.mark.parametrize("damping_time", [0.0, 0.03])
def test_one_spring_vibrates_as_the_scheme_does_in_closed_form(damping_time: float) -> None:
    """A step multiplies a linear vibration by the (2, 2) Pade approximation of the exponential, and keeps its energy."""
    stiffness, angle, h, steps, inertia = 20.0, 0.4, 0.03, 40, MASS * LENGTH**2
    model = pendulum(1, stiffness)
    start = sr.solve_equilibrium(model, (), wrench=(0, 0, 0, 0, stiffness * angle, 0))
    moved = sr.simulate(model, h * steps, (), start=start, damping_time=damping_time, time_step=h, order=4)
    z = h * np.array([[0.0, 1.0], [-stiffness / inertia, -stiffness * damping_time / inertia]])
    step = np.linalg.solve(np.eye(2) - z / 2 + z @ z / 12, np.eye(2) + z / 2 + z @ z / 12)
    expected = np.linalg.matrix_power(step, steps) @ [angle, 0.0]
    assert np.allclose([moved.q_springs[-1, 0], moved.velocities[-1, 0]], expected, rtol=0, atol=1e-10)
    assert np.abs(moved.energy.balance).max() <= 1e-9 * moved.energy.elastic[0]


@pytest.mark.study
def test_a_double_pendulum_swings_as_dop853_says_to_fourth_order() -> None:
    """And so does its energy; torques are not needed to be, as no motor moves."""
    model, stiffness = pendulum(2, 4.0), 4.0
    start = sr.solve_equilibrium(model, (), force=(6.0, 0.0, 0.0))
    first = [*np.cumsum(start.q_springs), 0.0, 0.0]
    exact = solve_ivp(double_pendulum, (0, 1.0), first, "DOP853", args=(stiffness, 9.81), rtol=1e-13, atol=1e-14).y[:, -1]
    errors = []
    for step in (0.02, 0.01, 0.005):
        moved = sr.simulate(model, 1.0, (), start=start, gravity=sr.EARTH_GRAVITY, damping_time=0.0, time_step=step, order=4)
        end = np.concatenate([np.cumsum(moved.q_springs[-1]), np.cumsum(moved.velocities[-1])])
        errors.append([np.abs(end - exact).max(), np.abs(moved.energy.balance).max()])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((ratios > 14.0) & (ratios < 18.0)), ratios
    for tolerance in (1e-4, 1e-6):  # by default, where nothing moves but the robot
        moved = sr.simulate(model, 1.0, (), start=start, gravity=sr.EARTH_GRAVITY, damping_time=0.0, tolerance=tolerance)
        assert moved.tip_error is not None
        assert np.linalg.norm(moved.tip_position[-1] - tip_of(exact[0], exact[1])) < moved.tip_error <= tolerance
        assert len(moved.steps) < 1000  # the midpoint rule takes 12,801 for 1e-6 m


@pytest.mark.study
@pytest.mark.parametrize("kind", ["arm", "two_hinges", "odd", "rod"])
def test_compiled_steps_are_those_of_simulate(kind: str) -> None:
    """Single, in a batch and step by step: unrolled chains, and a looped rod of hinges and a slide at one point."""
    rod = sr.PccArm(segment_lengths=(0.524,), muscle_azimuths=(), chain="lumped", hinges=5)  # the least that has loops
    model = sr.load_model(rod) if kind == "rod" else ROBOTS[kind]()
    motors, rng = model.relaxed_motors, np.random.default_rng(4)
    push = 0.2 * model.springs.stiffness.min() / model.reach * rng.standard_normal(3)
    start = sr.solve_equilibrium(model, motors, push, gravity=GRAVITY)
    force = -0.5 * push
    options: dict[str, Any] = {"gravity": GRAVITY, "damping_time": 1e-3, "time_step": 4e-3, "order": 4}
    expected = sr.simulate(model, 0.04, motors, start=start, force=force, **options)
    solver = sr.compile(model, backend="python")
    found = solver.simulate(0.04, motors, start=start, force=force, **options)
    assert np.ptp(expected.tip_position, axis=0).max() > 1e-4
    for name in ("q_springs", "velocities", "motor_torques", "tip_position"):
        size = np.abs(getattr(expected, name)).max(initial=1.0)
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(found.energy.balance, expected.energy.balance, rtol=0, atol=1e-9)
    many = solver.simulations(0.04, motors, starts=np.tile(start.q_springs, (2, 1)), forces=force, **options)
    np.testing.assert_allclose(many.tip_position[1], expected.tip_position, rtol=0, atol=1e-9)
    springs, rates, _ = solver.step(start.q_springs, np.zeros(model.n_springs), motors, force, **options)
    np.testing.assert_allclose(springs, expected.q_springs[1], rtol=0, atol=1e-9)
    np.testing.assert_allclose(rates, expected.velocities[1], rtol=0, atol=1e-9 * max(1.0, np.abs(rates).max()))


@pytest.mark.study
def test_a_slender_rod_swings_far_by_the_steps_of_simulate() -> None:
    """Undamped, released upright from a sideways force of six times its weight; twists hardly move, and settle slowly.

    A step may leave 1e-9 rad in either engine; one that is halved in one of them alone differs by 1e-3 rad. Compiled motion
    keeps to its plane: all that bends or twists out of it is zero.
    """
    rod = RoundRod(0.6, 0.8e-3, 200e9, 7850.0)
    model = sr.load_model(
        sr.PccArm(
            segment_lengths=(rod.length,), muscle_azimuths=(), radius=rod.radius, linear_density=rod.density * rod.area,
            bending_stiffness=rod.bending, torsional_stiffness=rod.bending / 1.5, axial_stiffness=rod.young * rod.area,
            chain="flexures", elastic_sections=6, extension=False,
        )
    )  # fmt: skip
    gravity = (0.0, 0.0, -9.81)
    start = sr.solve_equilibrium(model, (), (0.6, 0.0, 0.0), gravity=gravity)
    options: dict[str, Any] = {"start": start, "gravity": gravity, "damping_time": 0.0, "time_step": 2e-3, "order": 4}
    moved = [engine(0.2, (), **options) for engine in (partial(sr.simulate, model), sr.compile(model).simulate)]
    assert np.ptp(moved[0].tip_position[:, 0]) > 0.5
    np.testing.assert_allclose(moved[1].q_springs, moved[0].q_springs, rtol=0, atol=1e-8)
    by_flexure = moved[1].q_springs.reshape(len(moved[1].q_springs), -1, 3)
    assert np.all(by_flexure[..., ::2] == 0.0)  # bending out of the plane, and twist


@pytest.mark.system
@pytest.mark.parametrize("kind", ["arm", "rod"])
def test_numba_and_the_c_file_take_the_same_steps(kind: str, tmp_path: Path) -> None:
    rod = sr.PccArm(segment_lengths=(0.524,), muscle_azimuths=(), chain="lumped", hinges=5)  # the least that has loops
    model = sr.load_model(rod) if kind == "rod" else ROBOTS[kind]()
    motors = model.relaxed_motors
    options: dict[str, Any] = {"gravity": GRAVITY, "time_step": 4e-3, "order": 4}
    expected = sr.simulate(model, 0.08, motors, damping_time=0.0, **options)
    fast = sr.compile(model, backend="numba")
    found = fast.simulate(0.08, motors, damping_time=0.0, **options)
    np.testing.assert_allclose(found.tip_position, expected.tip_position, rtol=0, atol=1e-9)
    many = fast.simulations(0.08, np.tile(motors, (2, 1)), damping_time=0.0, **options)
    np.testing.assert_allclose(many.tip_position[1], expected.tip_position, rtol=0, atol=1e-9)
    controller = Controller(fast, tmp_path, name="fourth", motion=True, order=4)
    controller.put("GRAVITY", GRAVITY)
    controller.put("TIME_STEP", [4e-3])
    for name in ("MOTORS_BEGIN", "MOTORS_MIDDLE", "MOTORS_END") if len(motors) else ():
        controller.put(name, motors)
    for row in range(20):
        assert controller.call("motion_step") == 0
        found_springs = controller.get("POSITION", model.n_springs)
        np.testing.assert_allclose(np.sort(found_springs), np.sort(expected.q_springs[row + 1]), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"order": 3}, "2, 4 or None"),
        ({"order": 4, "force": lambda t: (t, 0.0, 0.0)}, "change over time"),
        ({"order": 4, "force": ([0.0, 1.0], [(0, 0, 0), (1, 0, 0)])}, "change over time"),
    ],
)
def test_other_orders_are_refused(arguments: dict[str, Any], match: str) -> None:
    model = pendulum(2, 4.0)
    with pytest.raises(ParameterError, match=match):
        sr.simulate(model, 1.0, (), **arguments)
    with pytest.raises(ParameterError, match=match):
        sr.compile(model, backend="python").simulate(1.0, (), **arguments)
