"""Controllers: what they ask for in closed form, and where they bring the loaded arm."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from studies.control import tracking
from tests.conftest import CHECKOUT
from tests.support.laws import law

START, END, FORCE = (0.8, 0.1, 0.4), (0.9, 0.2, 0.2), (0.0, 10.0, -15.0)
numbers = st.floats(-2.0, 2.0)
triples = st.tuples(numbers, numbers, numbers)


@pytest.fixture(scope="module")
def geared() -> sr.SoftModel:
    return sr.load_model(sr.InflatableArm(rotor_inertia=0.05))


@pytest.fixture(scope="module")
def path() -> sr.Path3D:
    return sr.straight_line(START, END, 0.8, steps=40)


@pytest.fixture(scope="module")
def loaded(geared: sr.SoftModel, path: sr.Path3D) -> sr.Trajectory:
    return sr.follow_trajectory(geared, path.positions, FORCE, gravity=sr.EARTH_GRAVITY, times=path.times)


@law("PD")
@given(reference=triples, extra=triples, kp=st.floats(0.0, 1e3), kd=triples, q=triples, qd=triples)
@settings(max_examples=20)
def test_a_pd_controller_is_its_formula(reference: Any, extra: Any, kp: float, kd: Any, q: Any, qd: Any) -> None:
    """For constants and for a reference that moves as a parabola, whose central difference is exact."""
    arm, gains = sr.load_model(sr.InflatableArm()), np.abs(kd)
    error, speed = np.subtract(reference, q), np.array(qd)
    still = sr.PD(arm, reference, kp, gains, feed_forward=extra)
    assert still(0.3, np.array(q), speed) == pytest.approx(kp * error - gains * speed + extra, abs=1e-9)
    moving = sr.PD(arm, lambda t: np.array(reference) * t * t, kp, gains)
    expected = kp * (np.array(reference) * 0.09 - q) + gains * (np.array(reference) * 0.6 - speed)
    assert moving(0.3, np.array(q), speed) == pytest.approx(expected, abs=1e-8)  # a difference over 2e-5 s of numbers near 1


def test_a_trajectory_is_reference_and_feed_forward_at_its_waypoints(loaded: sr.Trajectory) -> None:
    control = sr.PD(loaded.model, loaded, 100.0, 10.0, feed_forward=loaded)
    for row in (0, 17, 40):
        torque = control(float(loaded.times[row]), loaded.q_motors[row], np.zeros(3))
        speed = np.gradient(loaded.q_motors, loaded.times, axis=0, edge_order=2)[row] if 0 < row < 40 else np.zeros(3)
        # the spline's slope and that of central differences agree to their order: 20 ms squared
        assert torque == pytest.approx(10.0 * speed - loaded.equilibria[row].motor_torques, abs=0.05)


def follow(model: sr.SoftModel, start: sr.Equilibrium, torque: Any, **options: Any) -> sr.Motion:
    """The arm under load and weight, until it has settled."""
    load: dict[str, Any] = {"force": FORCE, "gravity": sr.EARTH_GRAVITY}
    return sr.simulate(model, 2.0, None, start=start, motors="torque", torque=torque, time_step=4e-3, **load | options)


@pytest.mark.study
def test_feed_forward_ends_on_target_where_proportional_control_alone_sags(loaded: sr.Trajectory) -> None:
    """What `PD` alone leaves at rest is its torque over its gain: an equilibrium found by the statics."""
    model, kp = loaded.model, 300.0
    exact = follow(model, loaded.equilibria[0], sr.PD(model, loaded, kp, 25.0, feed_forward=loaded))
    assert np.linalg.norm(exact.tip_position[-1] - END) < 5e-5  # the rest of the vibration after 1.2 s
    assert np.linalg.norm(exact.tip_position - np.array(END), axis=1).max() < 0.25  # the start is 0.245 m away
    sagging = follow(model, loaded.equilibria[0], sr.PD(model, loaded, kp, 25.0))
    motors = loaded.q_motors[-1].copy()
    for _ in range(60):  # q = reference - what they carry / kp
        rest = sr.solve_equilibrium(model, motors, FORCE, gravity=sr.EARTH_GRAVITY)
        motors = 0.5 * motors + 0.5 * (loaded.q_motors[-1] + rest.motor_torques / kp)
    assert np.linalg.norm(rest.tip_position - END) > 0.02
    assert np.linalg.norm(sagging.tip_position[-1] - rest.tip_position) < 5e-5  # as above


@law("ClosedLoop")
@given(
    motors=st.tuples(st.floats(-0.5, 0.5), st.floats(0.2, 0.8), st.floats(-1.2, -0.5)), error=triples, gain=st.floats(0.0, 50.0)
)
@settings(max_examples=10)
def test_the_closed_loop_is_that_of_the_paper(motors: Any, error: Any, gain: float) -> None:
    """In equilibrium it asks for what the motors carry; then its command moves by the motor rows of the inverse Jacobian.

    The Jacobian is that of central differences, with the springs as joints, as the paper has them.
    """
    model = sr.load_model(sr.InflatableArm())
    held = sr.solve_equilibrium(model, motors, FORCE)
    error = 0.02 * np.array(error)
    steady = sr.waypoints([held.tip_position + error] * 2, (0.0, 9.0))
    control = sr.ClosedLoop(model, steady, 1.0, 0.0, start=held, gain=gain, filter_time=0.0)
    first = control(0.0, held.q_motors, np.zeros(3))
    assert first == pytest.approx(-held.motor_torques, abs=1e-9)
    assert np.linalg.norm(control.estimate.tip_position - held.tip_position) < 1e-9
    shifts = 1e-6 * np.eye(7)
    columns = [(tip_of(model, held.q + shift) - tip_of(model, held.q - shift)) / 2e-6 for shift in shifts]
    jacobian = np.array(columns).T
    inverse = jacobian.T @ np.linalg.inv(jacobian @ jacobian.T)
    moved = 0.01 * inverse[list(model.motor_indices)] @ (gain * error)
    second = control(0.01, held.q_motors, np.zeros(3))
    assert second - first == pytest.approx(moved, abs=1e-6)


def tip_of(model: sr.SoftModel, q: np.ndarray) -> np.ndarray:
    """Position of the tip at joint positions, from Pinocchio."""
    data = model.pinocchio.createData()
    pin.framesForwardKinematics(model.pinocchio, data, q)
    return np.array(data.oMf[model.frame_id(model.tip)].translation)


@pytest.mark.study
def test_the_closed_loop_finds_the_target_under_a_load_that_nobody_told_it(geared: sr.SoftModel, path: sr.Path3D) -> None:
    """The error at rest goes to zero, and a second run of the same controller repeats the first bit by bit."""
    start = sr.solve_ik(geared, START, FORCE, gravity=sr.EARTH_GRAVITY).equilibrium
    control = sr.ClosedLoop(geared, path, 400.0, 20.0, start=start, gravity=sr.EARTH_GRAVITY)
    runs = [
        sr.simulate(
            geared,
            duration,
            None,
            start=start,
            force=FORCE,
            gravity=sr.EARTH_GRAVITY,
            motors="torque",
            torque=control,
            sample_time=4e-3,
            time_step=4e-3,
            output_step=0.02,
        )
        for duration in (1.6, 0.1)
    ]
    assert np.linalg.norm(runs[0].tip_position[-1] - END) < 1e-3
    assert np.array_equal(runs[0].q_springs[:5], runs[1].q_springs[:5])


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda m, p, t: sr.PD(m, (0, 0), 1.0, 1.0), "reference"),
        (lambda m, p, t: sr.PD(m, (0, 0, 0), -1.0, 1.0), "kp"),
        (lambda m, p, t: sr.PD(m, (0, 0, 0), 1.0, (1.0, 2.0)), "kd"),
        (lambda m, p, t: sr.PD(m, (0, 0, 0), 1.0, 1.0, feed_forward=(1.0,)), "feed_forward"),
        (lambda m, p, t: sr.PD(sr.load_model(sr.InflatableArm()), t, 1.0, 1.0), "reference"),
        (lambda m, p, t: sr.PD(sr.load_model(m.urdf, motors=[]), (), 1.0, 1.0), "model"),
        (lambda m, p, t: sr.PD("arm", t, 1.0, 1.0), "model"),
        (lambda m, p, t: sr.ClosedLoop(m, p.positions, 1.0, 1.0, start=t.equilibria[0]), "path"),
        (lambda m, p, t: sr.ClosedLoop(m, p, 1.0, 1.0, start=None), "start"),
        (lambda m, p, t: sr.ClosedLoop(sr.load_model(sr.InflatableArm()), p, 1.0, 1.0, start=t.equilibria[0]), "start"),
        (lambda m, p, t: sr.ClosedLoop(m, p, 1.0, 1.0, start=t.equilibria[0], gain=-1.0), "gain"),
        (lambda m, p, t: sr.ClosedLoop(m, p, 1.0, 1.0, start=t.equilibria[0], filter_time=-1.0), "filter_time"),
    ],
)
def test_what_controls_nothing_is_refused(make: Any, name: str, path: sr.Path3D, loaded: sr.Trajectory) -> None:
    with pytest.raises(sr.ParameterError, match=f"^{name} = "):
        make(loaded.model, path, loaded)


@pytest.mark.study
def test_the_record_of_controllers_is_what_a_fresh_run_says() -> None:
    """The last row; and what the guide says: feed-forward ends on the target, the closed loop needs no load told."""
    record = json.loads((CHECKOUT / "docs" / "validation" / "controllers.json").read_text())["rows"]
    for old, new in zip(record[-1:], (one.row() for one in tracking.study(slice(-1, None))), strict=True):
        assert [old[key] for key in ("controller", "load")] == [new[key] for key in ("controller", "load")]
        for key, value in new.items():
            if key.endswith("_m"):
                assert value == pytest.approx(old[key], rel=0.02, abs=2e-5)  # the loop amplifies rounding of its estimates
    ends = {(row["controller"], row["load"]): row["end_m"] for row in record}
    assert ends["PD, with feed-forward", 1.0] < 1e-4 < ends["PD, with feed-forward", 1.2]
    assert ends["closed loop", 1.2] < 2e-4
