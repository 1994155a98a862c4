"""Laws of motion, on robots of every kind: small vibrations, linear models, damping."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.dynamics.vibration import ModeSwing
from softrobots.statics.elastic_state import elastic_state
from tests.support.law_robots import ROBOTS, Case, cases, load_energy, model, stored_energy, tip_pose
from tests.support.laws import law


def settled(kind: str, case: Case) -> tuple[sr.SoftModel, sr.Equilibrium]:
    """A robot in a stable equilibrium, on no plateau."""
    robot = model(kind)
    found = sr.solve_equilibrium(robot, case.motors(robot), case.force(kind), gravity=case.gravity, tolerance=1e-13)
    assume(found.stable and not any(found.saturated))
    return robot, found


def joint_rates(robot: sr.SoftModel, motors: np.ndarray, springs: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Joint velocities by rates of motors and springs, by central differences of fourth order."""

    def joints(step: float) -> np.ndarray:
        m = robot.n_motors
        return robot.configuration(motors + step * rates[:m], springs + step * rates[m:])

    model, h = robot.pinocchio, 1e-3 / max(1.0, float(np.abs(rates).max()))
    one, two = (pin.difference(model, joints(-step), joints(step)) / (2.0 * step) for step in (h, 2.0 * h))
    return np.asarray((4.0 * one - two) / 3.0)


@pytest.mark.study
@law("vibration_modes", "VibrationModes", "dynamics.vibration.ModeSwing")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(1.0), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=5)
def test_modes_swing_energies_that_neither_mix_nor_depend_on_the_mass_matrix(kind: str, case: Case, seed: int) -> None:
    """Of any mixture `c` of modes the kinetic energy is `c^2 / 2`, the potential one `sum (c omega)^2 / 2`.

    Both energies are written out; second differences of energies have 1e-16 of them over the square of the step as rounding.
    """
    robot, found = settled(kind, case)
    modes = sr.vibration_modes(robot, found)
    assert isinstance(modes, sr.VibrationModes)
    swing = modes.swing(1, 1e-3 * robot.reach)
    assert isinstance(swing, ModeSwing)
    assert np.abs(swing.tip_position - found.tip_position).max() <= 1.01e-3 * robot.reach
    assert np.all(np.diff(modes.frequencies) >= 0.0)
    mixture = np.random.default_rng(seed).normal(size=robot.n_springs) / (2.0 * np.pi * modes.frequencies)
    way = modes.shapes @ mixture
    step = 1e-3 / np.abs(way).max()
    motors, force = found.q_motors, case.force(kind)
    rates = joint_rates(robot, motors, found.q_springs, np.concatenate([np.zeros(robot.n_motors), way]))
    kinetic = pin.computeKineticEnergy(robot.pinocchio, robot.pinocchio.createData(), found.q, rates)
    assert kinetic == pytest.approx(0.5 * mixture @ mixture, rel=1e-7)

    def energy(at: float) -> float:
        springs = found.q_springs + at * way
        return stored_energy(robot, motors, springs) + load_energy(robot, motors, springs, force, case.gravity)

    second = [(energy(h) + energy(-h) - 2.0 * energy(0.0)) / h**2 for h in (step, 2.0 * step)]
    terms = stored_energy(robot, motors, found.q_springs) + np.linalg.norm(force) * robot.reach + 10.0
    stiff = float(((2.0 * np.pi * modes.frequencies * mixture) ** 2).sum())
    assert (4.0 * second[0] - second[1]) / 3.0 == pytest.approx(stiff, rel=1e-5, abs=1e-14 * terms / step**2)
    here, ahead = (tip_pose(robot, motors, found.q_springs + at * way) for at in (-1e-2 * step, 1e-2 * step))
    moved = np.concatenate([ahead.translation - here.translation, pin.log3(ahead.rotation @ here.rotation.T)])
    assert moved / (2e-2 * step) == pytest.approx(modes.tip_shapes @ mixture, rel=1e-6, abs=1e-9 / step)
    assert np.all(modes.effective_masses.sum(axis=0)[:3] <= sum(body.mass for body in robot.pinocchio.inertias) * (1 + 1e-9))


@law("linearize", "LinearModel")
@pytest.mark.parametrize("kind", ROBOTS)
@given(
    case=cases(1.0),
    moment=st.sampled_from([(0.0, 0.0, 0.0), (0.03, -0.05, 0.02)]),
    seed=st.integers(0, 2**32 - 1),
    damping_time=st.floats(0.0, 0.1),
    mass_damping=st.floats(0.0, 3.0),
)
@settings(max_examples=4)
def test_a_linear_model_is_the_slope_of_the_equations_of_motion(
    kind: str, case: Case, moment: Any, seed: int, damping_time: float, mass_damping: float
) -> None:
    """`J^T f = d(residual)/dx x + D v + M a` with Pinocchio's masses, rates by differences, and the residual of the statics.

    Central differences of the residual, fourth order, are exact to 1e-8 of the largest stiffness.
    """
    robot = model(kind)
    motors, force = case.motors(robot), case.force(kind)
    found = sr.solve_equilibrium(robot, motors, wrench=np.concatenate([force, moment]), gravity=case.gravity)
    assume(not any(found.saturated))
    options: dict[str, Any] = {"damping_time": damping_time, "mass_damping": mass_damping}
    m, n = robot.n_motors, robot.n_springs
    placed = m - (len(robot.muscles) if robot.muscle_input == "forces" else 0)
    kept = np.r_[:placed, m : m + n]

    def balance(x: np.ndarray) -> np.ndarray:
        state = elastic_state(robot, motors + x[:m], found.q_springs + x[m:], found.load)
        return np.concatenate([-state.load.motors, state.residual])[kept]

    def slope(way: np.ndarray, h: float = 1e-4) -> np.ndarray:
        one, two = ((balance(step * way) - balance(-step * way)) / (2.0 * step) for step in (h, 2.0 * h))
        return (4.0 * one - two) / 3.0

    columns = np.array([joint_rates(robot, motors, found.q_springs, unit) for unit in np.eye(m + n)[kept]]).T
    mass = columns.T @ robot.data.mass_matrix(found.q) @ columns
    damping = np.zeros((placed + n, placed + n))
    damping[:placed, :placed] = np.diag([*robot.pinocchio.damping[robot.motor_indices], *np.zeros(placed)][:placed])
    damping[placed:, placed:] = damping_time * np.diag(robot.stiffness) + mass_damping * mass[placed:, placed:]
    draw = np.random.default_rng(seed)
    moved, rates, tip_force = draw.normal(size=placed + n), draw.normal(size=placed + n), draw.normal(size=3)
    way = np.zeros(m + n)
    way[kept] = moved = 1e-2 * moved * np.concatenate([robot.motor_scale[:placed], np.ones(n)])
    tensions = way[placed:m] = draw.normal(size=m - placed)
    jacobian = pin.computeFrameJacobian(
        robot.pinocchio, robot.pinocchio.createData(), found.q, robot.frame_id(robot.tip), pin.LOCAL_WORLD_ALIGNED
    )
    pushed = columns.T @ jacobian[:3].T @ tip_force
    states = np.concatenate([moved, rates])
    for driven in ("prescribed", "torque"):
        linear = sr.linearize(robot, found, motors=driven, **options)
        assert isinstance(linear, sr.LinearModel)
        given_inputs = draw.normal(size=placed)
        inputs = np.concatenate([given_inputs, tensions, tip_force])
        accelerations = (linear.A @ states + linear.B @ inputs)[placed + n :]
        outputs = linear.C @ states + linear.D @ inputs
        missing = slope(way) + damping @ rates + mass @ accelerations - pushed
        scale = 1e-8 * (
            robot.stiffness.max() * np.abs(way).max() + np.abs(damping @ rates).max() + np.abs(mass @ accelerations).max()
        )
        scale += 1e-9 * np.abs(found.motor_torques).max(initial=1.0)
        assert np.abs(missing[placed:]).max() < scale
        exerted = given_inputs if driven == "torque" else -outputs[6:]
        assert np.abs(missing[:placed] - exerted).max(initial=0.0) < scale
        assert np.allclose(outputs[:6], jacobian @ (columns @ moved), rtol=0.0, atol=1e-8 * robot.reach)
        assert [len(names) for names in (linear.state_names, linear.input_names, linear.output_names)] == [
            *linear.B.shape,
            len(linear.C),
        ]


@law("damping_time_from_decrement", "ring_down")
@given(
    ratio=st.floats(0.0, 0.3),
    frequency=st.floats(0.1, 1e3),
    phase=st.floats(-3.0, 3.0),
    periods=st.floats(2.0, 12.0),
    offset=st.floats(-10.0, 10.0),
)
@settings(max_examples=40)
def test_a_ring_down_tells_the_damping_time_that_it_was_made_with(
    ratio: float, frequency: float, phase: float, periods: float, offset: float
) -> None:
    """`e^{-zeta omega t} cos` in closed form, 40 samples a period; least squares ends within 1e-6."""
    omega = 2.0 * np.pi * frequency
    slow = np.sqrt(1.0 - ratio**2)
    time = np.arange(0.0, periods, 0.025) / (slow * frequency)
    signal = offset + 0.3 * np.exp(-ratio * omega * time) * np.cos(slow * omega * time + phase)
    found = sr.ring_down(time, signal)
    assert found.damping_ratios[0] == pytest.approx(ratio, rel=1e-5, abs=1e-7)
    assert found.frequencies[0] == pytest.approx(frequency, rel=1e-6)
    decrement = 2.0 * np.pi * ratio / slow
    assert sr.damping_time_from_decrement(decrement, slow * frequency) == pytest.approx(2.0 * ratio / omega, rel=1e-12)
