"""Motion by the implicit midpoint rule, against closed forms, other integrators and the laws of energy and momentum."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.dynamics.equations import EquationsOfMotion
from tests.support.laws import law

ROBOTS = (
    sr.load_model(sr.InflatableArm()),
    sr.load_model(sr.PccArm(elastic_sections=2)),
    sr.load_model(sr.PccArm(elastic_sections=2), muscles="forces"),
)
LENGTH, MASS = 0.5, 0.3  # of each link of the pendulums


def pendulum(links: int, stiffness: float, **options: Any) -> sr.SoftModel:
    """Links with a point mass at the end of each, hinges about y with a spring; upright where all angles are zero."""
    parts = ['<robot name="pendulum"><link name="link_0"/>']
    for number in range(1, links + 1):
        parts.append(
            f'<link name="link_{number}"><inertial><origin xyz="0 0 {LENGTH}"/><mass value="{MASS}"/>'
            '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="hinge_{number}" type="revolute"><parent link="link_{number - 1}"/><child link="link_{number}"/>'
            f'<origin xyz="0 0 {LENGTH if number > 1 else 0}"/><axis xyz="0 1 0"/>'
            '<limit lower="-9" upper="9" effort="1" velocity="1"/><dynamics damping="0" friction="0"/></joint>'
        )
    parts.append(
        f'<link name="tip"/><joint name="end" type="fixed"><parent link="link_{links}"/><child link="tip"/>'
        f'<origin xyz="0 0 {LENGTH}"/></joint></robot>'
    )
    springs = {f"hinge_{number}": stiffness for number in range(1, links + 1)}
    return sr.load_model("".join(parts), springs=springs, tip="tip", **options)


def double_pendulum(t: float, state: FloatArray, stiffness: float, gravity: float) -> FloatArray:
    """Two point masses on rods: Lagrange's equations in absolute angles from the vertical, upwards."""
    first, second, rate_1, rate_2 = state
    difference = second - first
    mass = MASS * LENGTH**2 * np.array([[2.0, np.cos(difference)], [np.cos(difference), 1.0]])
    push = MASS * LENGTH**2 * np.sin(difference) * np.array([rate_2**2, -(rate_1**2)])
    weight = MASS * gravity * LENGTH * np.array([2.0 * np.sin(first), np.sin(second)])
    springs = stiffness * np.array([difference - first, -difference])
    return np.concatenate([[rate_1, rate_2], np.linalg.solve(mass, push + weight + springs)])


@law("simulate", "Motion")
@given(st.floats(1.0, 50.0), st.floats(-0.5, 0.5), st.floats(0.0, 0.05))
def test_one_spring_vibrates_as_the_scheme_does_in_closed_form(stiffness: float, angle: float, damping_time: float) -> None:
    """The midpoint rule turns a linear vibration by `2 atan(omega h / 2)` a step, and keeps its energy with what is lost."""
    model = pendulum(1, stiffness)
    h, steps, inertia = 0.01, 40, MASS * LENGTH**2
    start = sr.solve_equilibrium(model, (), wrench=(0, 0, 0, 0, stiffness * angle, 0))
    moved = sr.simulate(model, h * steps, (), start=start, damping_time=damping_time, time_step=h)
    assert isinstance(moved, sr.Motion)
    rates = np.array([[0.0, 1.0], [-stiffness / inertia, -stiffness * damping_time / inertia]])
    step = np.linalg.solve(np.eye(2) - 0.5 * h * rates, np.eye(2) + 0.5 * h * rates)
    expected = np.linalg.matrix_power(step, steps) @ [angle, 0.0]
    assert np.allclose([moved.q_springs[-1, 0], moved.velocities[-1, 0]], expected, atol=1e-11)
    assert np.abs(moved.energy.balance).max() <= 1e-9 * max(moved.energy.elastic[0], 1e-9)


def test_a_double_pendulum_with_springs_swings_as_dop853_says_to_second_order() -> None:
    model, stiffness = pendulum(2, 4.0), 4.0
    start = sr.solve_equilibrium(model, (), force=(6.0, 0.0, 0.0))
    angles = np.cumsum(start.q_springs)
    solution = solve_ivp(
        double_pendulum, (0, 1.0), [*angles, 0, 0], "DOP853", args=(stiffness, 9.81), rtol=1e-12, atol=1e-13
    ).y[:, -1]
    errors = []
    for step in (4e-3, 2e-3, 1e-3):
        moved = sr.simulate(model, 1.0, (), start=start, gravity=sr.EARTH_GRAVITY, damping_time=0.0, time_step=step)
        end = np.concatenate([np.cumsum(moved.q_springs[-1]), np.cumsum(moved.velocities[-1])])
        errors.append([np.abs(end - solution).max(), np.abs(moved.energy.balance).max()])
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all((ratios > 3.8) & (ratios < 4.2)), ratios
    assert errors[-1][0] < 1e-3


def test_a_motion_runs_backwards_to_its_start() -> None:
    """The rule is symmetric: from the end with reversed rates it returns to the start, to the rounding of 200 steps."""
    model = pendulum(3, 4.0)
    start = sr.solve_equilibrium(model, (), force=(6.0, 0.0, 0.0))
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "damping_time": 0.0, "time_step": 5e-3}
    there = sr.simulate(model, 1.0, (), start=start, **options)
    end = there.end
    turned = type(end)(model, 0.0, end.q_motors, end.motor_velocities, end.q_springs, -end.velocities)
    back = sr.simulate(model, 1.0, (), start=turned, **options)
    assert np.abs(there.q_springs[-1] - start.q_springs).max() > 0.1
    assert np.abs(back.q_springs[-1] - start.q_springs).max() < 1e-8
    assert np.abs(back.velocities[-1]).max() < 1e-7


@given(st.integers(0, 2), st.randoms(use_true_random=False))
def test_the_equations_are_those_of_lagrange(number: int, random: Any) -> None:
    """`r = d/dt (M xd) - d(T - V)/dx`, by central differences of mass matrix and energies along a path."""
    model = ROBOTS[number]
    draw = np.random.default_rng(random.randrange(2**32))
    turning = np.concatenate([np.full(model.n_motors, 0.01), np.where(model.springs.turning, 0.2, 0.004)])
    x, rates, accelerations = (scale * draw.uniform(-turning, turning) for scale in (1.0, 5.0, 5.0))
    x += np.concatenate([model.relaxed_motors, model.rest])
    if model.muscles and model.muscle_input == "forces":
        rates[-model.n_springs - len(model.muscles) : -model.n_springs] = 0.0
    equations = EquationsOfMotion(model, (1.0, -2.0, -9.81))
    wrench = {model.tip: draw.standard_normal(6)}
    exact = equations.balance(x, rates, accelerations, wrench)
    h = 1e-4

    def momentum(t: float) -> FloatArray:
        return equations.mass_matrix(x + t * rates + 0.5 * t * t * accelerations) @ (rates + t * accelerations)

    def lagrangian(place: int, change: float) -> float:
        moved = x.copy()
        moved[place] += change
        kinetic, elastic, potential = equations.energies(moved, rates)
        return kinetic - elastic - potential

    slopes = [(lagrangian(place, h) - lagrangian(place, -h)) / (2 * h) for place in range(len(x))]
    expected = (momentum(h) - momentum(-h)) / (2 * h) - slopes - equations.load(x, wrench)
    free = slice(model.n_motors if model.muscle_input == "forces" and model.muscles else 0, None)
    if free.start:  # tensions pull
        tensions, strains = x[: model.n_motors], x[model.n_motors :]
        expected[free] += tensions @ model.structure.muscle_paths.at(strains).arms
    assert np.abs(exact[free] - expected[free]).max() < 1e-5 * max(1.0, np.abs(exact).max())
