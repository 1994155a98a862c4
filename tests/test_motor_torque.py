"""Motors that move by their torque, against closed forms of one joint, equilibria and the balance of power."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import softrobots as sr
from softrobots.dynamics.motor_torque import CREEP

INERTIA, ROTOR = 0.03, 0.02
WHOLE = INERTIA + ROTOR


def wheel(damping: float = 0.0, friction: float = 0.0, effort: float = 0.0) -> sr.SoftModel:
    """One motor that turns a wheel about its axis of symmetry."""
    return sr.load_model(
        '<robot name="wheel" xmlns:softrobots="urn:softrobots:urdf"><link name="base"/><link name="wheel"><inertial>'
        f'<mass value="1"/><inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="motor" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>'
        f'<limit effort="{effort}" velocity="9"/><dynamics damping="{damping}" friction="{friction}"/>'
        f'<softrobots:rotor inertia="{ROTOR}"/></joint></robot>',
        springs={},
        tip="wheel",
    )


def run(model: sr.SoftModel, duration: float, torque: Any, **options: Any) -> sr.Motion:
    """The wheel from zero at rest."""
    return sr.simulate(model, duration, options.pop("q_motors", (0.0,)), motors="torque", torque=torque, **options)


def test_a_motor_under_proportional_and_derivative_control_is_a_damped_oscillator() -> None:
    """Of second order in the step; viscous friction of the file adds to the derivative gain."""
    kp, kd, damping, target = 8.0, 0.3, 0.1, 0.7
    rates = np.array([[0.0, 1.0], [-kp / WHOLE, -(kd + damping) / WHOLE]])
    errors = []
    for h in (2e-3, 1e-3):
        moved = run(wheel(damping), 0.4, lambda _, q, qd: kp * (target - q) - kd * qd, time_step=h, output_step=0.1)
        exact = [target + (expm(rates * t) @ [-target, 0.0])[0] for t in moved.time]
        errors.append(np.abs(moved.q_motors[:, 0] - exact).max())
    assert errors[1] < 2e-5  # (omega h)^3 / 12 a step of a vibration at omega = 13 rad/s, 400 steps of 1 ms
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_stiff_gains_are_no_reason_for_short_steps() -> None:
    """A gain whose frequency is 40 times what the step resolves: the motor follows a slow reference within its lag."""
    kp = WHOLE * 4e4**2
    kd = 2.0 * 4e4 * WHOLE
    moved = run(
        wheel(), 0.5, lambda t, q, qd: kp * (math.sin(t) - q) + kd * (math.cos(t) - qd), time_step=1e-3, output_step=1e-2
    )
    assert np.abs(moved.q_motors[:, 0] - np.sin(moved.time)).max() < 1e-4
    assert len(moved.steps) == 501


@pytest.mark.parametrize("sample_time", [5e-3, 7e-3])
def test_a_sampled_controller_is_the_exact_difference_equation(sample_time: float) -> None:
    """A constant torque between samples turns a free wheel by a parabola, which the midpoint rule has exactly."""
    kp, kd, target = 8.0, 0.3, 0.7
    calls = []

    def torque(t: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        calls.append(t)
        return kp * (target - q) - kd * qd

    moved = run(wheel(), 0.42, torque, sample_time=sample_time, time_step=4e-3, output_step=sample_time)
    assert calls == pytest.approx(sample_time * np.arange(round(0.42 / sample_time)), abs=1e-12)
    q = v = 0.0
    for row in range(len(moved.time)):
        assert moved.q_motors[row, 0] == pytest.approx(q, abs=1e-12)
        acceleration = (kp * (target - q) - kd * v) / WHOLE
        q, v = q + sample_time * v + 0.5 * sample_time**2 * acceleration, v + sample_time * acceleration


def test_dry_friction_stops_a_wheel_where_it_must_and_holds_it() -> None:
    """It slides `I v^2 / 2 f`; below the friction a torque moves it no faster than `CREEP`, above it moves it freely."""
    friction, speed = 0.5, 3.0
    model = wheel(friction=friction)
    pushed = run(model, 0.1, (WHOLE * speed / 0.1 + friction,), time_step=1e-3)
    assert pushed.motor_velocities[-1, 0] == pytest.approx(speed, rel=1e-9)  # constant torques: the rule is exact
    slid = run(model, 0.5, (0.0,), q_motors=None, start=pushed, time_step=1e-3)
    way = slid.q_motors[-1, 0] - slid.q_motors[0, 0]
    assert way == pytest.approx(WHOLE * slid.motor_velocities[0, 0] ** 2 / (2.0 * friction), rel=2e-3)  # a step at the stop
    assert slid.energy.dissipated[-1] == pytest.approx(slid.energy.kinetic[0], rel=1e-9)
    stalled = run(model, 1.0, (0.75 * friction,), time_step=5e-3)
    assert stalled.q_motors[-1, 0] == pytest.approx(CREEP * 0.75, rel=1e-2)
    freed = run(model, 1.0, (1.5 * friction,), time_step=1e-2)
    assert freed.q_motors[-1, 0] == pytest.approx(0.25 * friction / WHOLE, rel=1e-9)


def test_light_joints_under_much_dry_friction_need_no_short_steps() -> None:
    """Joints without rotors, stopped by 5 N m of friction: they settle at once, and where they stick they stay."""
    urdf = sr.InflatableArm().urdf().replace('damping="0.0" friction="0.0"', 'damping="0.0" friction="5.0"')
    model, goal = sr.load_model(urdf), np.array((0.3, 0.2, -0.4))
    options: dict[str, Any] = {"motors": "torque", "torque": sr.PD(model, goal, 150.0, 5.0), "time_step": 4e-3}
    moved = sr.simulate(model, 1.2, (0.0, 0.5, -0.5), output_step=4e-3, **options)
    assert len(moved.steps) < 400  # 301, and a few that were halved
    late = moved.time > 0.8
    assert np.abs(moved.motor_velocities[late]).max() <= CREEP
    assert np.ptp(moved.q_motors[late], axis=0).max() < 0.4 * CREEP
    assert (np.abs(150.0 * (goal - moved.q_motors[late])) < 6.0).all()  # friction, and what is left of the swing, carry it


def test_torque_is_limited_to_the_effort_of_the_file() -> None:
    moved = run(wheel(effort=2.0), 0.1, (50.0,), time_step=1e-3)
    assert moved.q_motors[-1, 0] == pytest.approx(0.5 * 2.0 / WHOLE * 0.1**2, rel=1e-12)
    assert (moved.motor_torques == -2.0).all()  # the sign of what motors carry
    braked = run(wheel(effort=2.0), 0.3, lambda t, q, qd: 50.0 * (0.2 - q) - 3.0 * qd, time_step=1e-3)
    asked = 50.0 * (0.2 - braked.q_motors) - 3.0 * braked.motor_velocities
    assert braked.motor_torques == pytest.approx(-np.clip(asked, -2.0, 2.0), abs=1e-12)
    assert run(wheel(), 0.1, (50.0,), time_step=1e-3).q_motors[-1, 0] == pytest.approx(25.0 / WHOLE * 0.01, rel=1e-12)


@pytest.fixture(scope="module")
def geared() -> sr.SoftModel:
    """The arm with rotors and friction."""
    urdf = sr.InflatableArm(rotor_inertia=0.05).urdf()
    return sr.load_model(urdf.replace('damping="0.0" friction="0.0"', 'damping="0.2" friction="0.3"'))


def test_motors_that_exert_what_they_carry_hold_the_equilibrium() -> None:
    """With load and weight, without friction to help; to the residual of the equilibrium, growing slowly."""
    model = sr.load_model(sr.InflatableArm(rotor_inertia=0.05))
    options: dict[str, Any] = {"force": (0, 10, -15), "gravity": sr.EARTH_GRAVITY}
    force = options["force"]
    found = sr.solve_ik(model, (0.8, 0.3, 0.4), force, gravity=sr.EARTH_GRAVITY).equilibrium
    held = sr.simulate(model, 0.2, None, start=found, motors="torque", torque=-found.motor_torques, time_step=2e-3, **options)
    assert np.abs(held.q_motors - found.q_motors).max() < 1e-9
    assert np.abs(held.tip_position - (0.8, 0.3, 0.4)).max() < 1e-9
    assert held.motor_torques == pytest.approx(np.tile(found.motor_torques, (len(held.time), 1)), abs=1e-12)


def test_the_balance_of_power_closes_with_motors_friction_and_springs(geared: sr.SoftModel) -> None:
    """To second order in the step; the work of the motors is that of the torques in the rows, by the trapezium rule."""
    target = np.array((0.5, 0.4, -0.5))
    errors = []
    for h in (2e-3, 1e-3):
        moved = sr.simulate(
            geared,
            0.25,
            (0.3, 0.6, -0.8),
            gravity=sr.EARTH_GRAVITY,
            motors="torque",
            torque=lambda _, q, qd: 100.0 * (target - q) - 8.0 * qd,
            time_step=h,
            output_step=h,
        )
        errors.append(np.abs(moved.energy.balance).max())
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 3.0
    power = -np.einsum("ij,ij->i", moved.motor_torques, moved.motor_velocities)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(moved.time))])
    assert np.abs(work - moved.energy.motor_work).max() < 5e-3 * np.abs(work).max()
    assert (np.diff(moved.energy.dissipated) >= 0.0).all()


def test_a_motor_and_a_spring_are_two_masses_with_a_spring() -> None:
    """One motor, one link on a spring, both about one axis: SciPy's DOP853 on `I1 q1'' + I2 (q1 + q2)'' = tau` and so on."""
    first, second, stiffness, push = 0.05, 0.03, 4.0, 0.6
    body = '<inertial><mass value="1"/><inertia ixx="{0}" iyy="{0}" izz="{0}" ixy="0" ixz="0" iyz="0"/></inertial>'
    joint = (
        '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><axis xyz="0 0 1"/>'
        '<limit effort="0" velocity="9"/></joint>'
    )
    urdf = (
        f'<robot name="two"><link name="base"/><link name="one">{body.format(first)}</link>'
        f'<link name="two">{body.format(second)}</link>{joint.format("motor", "base", "one")}'
        f"{joint.format('spring', 'one', 'two')}</robot>"
    )
    model = sr.load_model(urdf, springs={"spring": stiffness}, tip="two")
    moved = sr.simulate(model, 0.6, (0.0,), motors="torque", torque=lambda t, *_: (push * math.sin(9.0 * t),), time_step=1e-3)
    mass = np.array([[first + second, second], [second, second]])

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        return np.concatenate([state[2:], np.linalg.solve(mass, [push * math.sin(9.0 * t), -stiffness * state[1]])])

    exact = solve_ivp(slope, (0.0, 0.6), np.zeros(4), "DOP853", t_eval=moved.time, rtol=1e-11, atol=1e-13).y
    allowed = 1.6e-5  # (omega h)^2 / 24 of an angle of 0.1 rad, omega = 15 rad/s, and its phase
    assert np.abs(moved.q_motors[:, 0] - exact[0]).max() < allowed
    assert np.abs(moved.q_springs[:, 0] - exact[1]).max() < allowed


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"torque": None}, "torque"),
        ({"torque": (1.0, 2.0)}, "torque"),
        ({"torque": lambda *_: math.nan}, r"torque\(t=0.0005, ...\)"),
        ({"torque": lambda *_: (1.0, 2.0)}, r"torque\(t=0.0005, ...\)"),
        ({"torque": (1.0,), "sample_time": 0.0}, "sample_time"),
        ({"torque": (1.0,), "sample_time": 1e-12}, "sample_time"),
        ({"torque": (1.0,), "motors": "prescribed"}, "torque"),
        ({"sample_time": 1e-3, "motors": "prescribed"}, "sample_time"),
        ({"torque": (1.0,), "q_motors": None}, "q_motors"),
        ({"torque": (1.0,), "motors": "voltage"}, "motors"),
    ],
)
def test_what_moves_no_motor_is_refused(change: dict[str, Any], name: str) -> None:
    options = {"motors": "torque", "q_motors": (0.0,), "time_step": 1e-3} | change
    with pytest.raises(sr.ParameterError, match=f"^{name} = "):
        sr.simulate(wheel(), 0.1, **options)


def test_a_robot_without_motor_joints_has_no_torques() -> None:
    model = sr.load_model(wheel().urdf, springs={"motor": 1.0}, tip="wheel")
    with pytest.raises(sr.ParameterError, match="without motor joints"):
        sr.simulate(model, 0.1, (), motors="torque", torque=())


def test_chosen_steps_keep_their_tolerance_and_end_at_every_sample(geared: sr.SoftModel) -> None:
    """The tip of the run with chosen steps is that of a run with steps of an eighth of a sample."""
    held = sr.solve_equilibrium(geared, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)
    target = np.array((0.4, 0.5, -0.7))
    options: dict[str, Any] = {
        "start": held,
        "gravity": sr.EARTH_GRAVITY,
        "motors": "torque",
        "torque": lambda _, q, qd: 200.0 * (target - q) - 10.0 * qd - held.motor_torques,
        "sample_time": 4e-3,
        "output_step": 0.05,
    }
    chosen = sr.simulate(geared, 0.16, None, tolerance=1e-4, **options)
    fine = sr.simulate(geared, 0.16, None, time_step=5e-4, **options)
    assert chosen.tip_error is not None
    assert chosen.tip_error <= 1e-4
    assert np.linalg.norm(chosen.tip_position - fine.tip_position, axis=1).max() < 1.5e-4  # and the error of the other
    for instant in 4e-3 * np.arange(40):
        assert np.abs(chosen.steps - instant).min() < 1e-9


def test_mujoco_moves_the_exported_arm_as_we_do(tool: Callable[[str], ModuleType]) -> None:
    """With its armature, springs, their damping and weight, under torques over time; Runge-Kutta at a tenth of our step."""
    mujoco = tool("mujoco")
    model = sr.load_model(sr.InflatableArm(rotor_inertia=0.05))
    start = sr.solve_equilibrium(model, (0.3, 0.6, -0.8), gravity=sr.EARTH_GRAVITY)

    def torque(t: float, q: Any, qd: Any) -> Any:
        return -start.motor_torques + np.array((3.0, -2.0, 1.0)) * np.sin(12.0 * t) + 20.0 * (start.q_motors - q) - qd

    options: dict[str, Any] = {"start": start, "gravity": sr.EARTH_GRAVITY, "motors": "torque", "torque": torque}
    ours = sr.simulate(model, 0.2, None, time_step=1e-3, output_step=0.05, **options)
    other = mujoco.MjModel.from_xml_string(
        sr.export.to_mjcf(model, start.q_motors, damping="file", gravity=sr.EARTH_GRAVITY, limits=False)
    )
    other.opt.integrator, other.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1e-4
    other.actuator_gainprm[:], other.actuator_biasprm[:] = 0.0, 0.0  # the servos of the export let go
    other.geom_contype[:] = 0
    data = mujoco.MjData(other)
    names = [other.joint(number).name for number in range(other.njnt)]
    order = [model.pinocchio.getJointId(name) - 1 for name in names]
    motors = [names.index(name) for name in model.motor_joints]
    data.qpos[:] = np.array(start.q)[order]
    for row in range(1, len(ours.time)):
        while data.time < ours.time[row] - 1e-9:
            data.qfrc_applied[motors] = torque(data.time + 0.5e-4, data.qpos[motors], data.qvel[motors])
            mujoco.mj_step(other, data)
        # torques held over a tenth of a millisecond lag by half of it: 1e-5 of motions near 1 rad/s
        assert data.qpos == pytest.approx(np.array(ours.configuration(row))[order], abs=1e-4)
    assert np.abs(ours.q_motors[-1] - ours.q_motors[0]).max() > 0.05
