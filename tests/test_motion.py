"""Motion by the implicit midpoint rule, against closed forms, other integrators and the laws of energy and momentum."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import softrobots as sr
from softrobots.core.checks import FloatArray
from softrobots.dynamics import simulation
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.time_grid import first_grid, merged_times
from tests.support.laws import law
from tests.support.pendulums import LENGTH, MASS, double_pendulum, pendulum, tip_of

ROBOTS = (
    sr.load_model(sr.InflatableArm()),
    sr.load_model(sr.PccArm(elastic_sections=2)),
    sr.load_model(sr.PccArm(elastic_sections=2), muscles="forces"),
    sr.load_model(sr.PccArm(chain="lumped", hinges=2)),
    sr.load_model(sr.InflatableArm(moment_law="slack_wall", wrist=(0.08, 0.12))),
)


@law("simulate", "Motion")
@settings(max_examples=25)
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
    # Phases are late by (omega h)^2 / 12 omega t: 1e-6 of the slow swing, at 2 rad/s, and 3e-4 of the small fast one, at 16.
    assert errors[-1][0] < 1e-5


@pytest.mark.parametrize("steps", [{"time_step": 5e-3}, {"time_step": 0.02, "order": 4}])
def test_a_motion_runs_backwards_to_its_start(steps: dict[str, Any]) -> None:
    """Both schemes are symmetric: from the end with reversed rates they return to the start, but for what the steps leave.

    Each of 200 is solved to 1e-13 in its middle, and to 4e-13 / h in a velocity; each of the 50 of fourth order to 1e-13.
    """
    model = pendulum(3, 4.0)
    start = sr.solve_equilibrium(model, (), force=(6.0, 0.0, 0.0))
    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "damping_time": 0.0, **steps}
    there = sr.simulate(model, 1.0, (), start=start, **options)
    end = there.end
    turned = sr.MotionState(model, 0.0, end.q_motors, end.motor_velocities, end.q_springs, -end.velocities)
    back = sr.simulate(model, 1.0, (), start=turned, **options)
    assert np.abs(there.q_springs[-1] - start.q_springs).max() > 0.1
    assert np.abs(back.q_springs[-1] - start.q_springs).max() < 1e-10
    assert np.abs(back.velocities[-1]).max() < 1e-8


@settings(max_examples=40)
@given(st.integers(0, len(ROBOTS) - 1), st.randoms(use_true_random=False))
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


def as_table(times: list[float], values: list[float]) -> Any:
    return times, [(value, 0.0, 0.0) for value in values]


@pytest.mark.parametrize(
    "force",
    [as_table([0.0, 0.31, 0.31], [0.0, 3.0, -2.0]), lambda t: np.array([3.0 * t / 0.31 if t < 0.31 else -2.0, 0.0, 0.0])],
    ids=["table", "function"],
)
def test_the_tip_stays_within_the_tolerance_over_a_run_with_a_jump_of_the_load(force: Any) -> None:
    model, stiffness = pendulum(2, 4.0), 4.0

    def slope(t: float, state: FloatArray, push: Any) -> FloatArray:
        return double_pendulum(t, state, stiffness, 0.0, push(t))

    accurate: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    first = solve_ivp(slope, (0.0, 0.31), np.zeros(4), args=(lambda t: 3.0 * t / 0.31,), **accurate).sol
    second = solve_ivp(slope, (0.31, 1.3), first(0.31), args=(lambda _: -2.0,), **accurate).sol
    for tolerance in (1e-3, 1e-4):
        moved = sr.simulate(model, 1.3, (), force=force, damping_time=0.0, tolerance=tolerance)
        exact = np.array([(first if t <= 0.31 else second)(t) for t in moved.time])
        errors = np.linalg.norm(moved.tip_position - tip_of(exact[:, 0], exact[:, 1]), axis=1)
        assert moved.tip_error is not None
        assert errors.max() < tolerance
        assert 0.25 * moved.tip_error < errors.max() < moved.tip_error <= tolerance  # 1 / 3.6 if two runs are enough
        assert np.abs(moved.steps - 0.31).min() < 1e-12
        assert np.abs(moved.energy.balance).max() < 1e-2 * np.abs(moved.energy.load_work).max()


@pytest.mark.parametrize(("duration", "begin", "end"), [pytest.param(2.0, 0.5, 0.7, marks=pytest.mark.study), (1.0, 0.1, 0.3)])
def test_a_pulse_between_round_times_moves_a_robot_as_dop853_says(duration: float, begin: float, end: float) -> None:
    """A jump is found by bisection, and the sample at which the load begins to change: the same time but for a rounding."""
    model, fast = pendulum(2, 4.0), sr.compile(pendulum(2, 4.0), backend="python")

    def force(t: float) -> tuple[float, float, float]:
        return (3.0 * (begin < t < end), 0.0, 0.0)

    accurate: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    state = np.zeros(4)
    for first, last, push in ((begin, end, 3.0), (end, duration, 0.0)):
        state = solve_ivp(double_pendulum, (first, last), state, args=(4.0, 0.0, push), **accurate).y[:, -1]
    batch = fast.simulations(duration, np.zeros((2, 0)), forces=[force, force], damping_time=0.0, tolerance=1e-4)
    for moved in (
        engine(duration, (), force=force, damping_time=0.0, tolerance=1e-4)
        for engine in (partial(sr.simulate, model), fast.simulate)
    ):
        assert np.linalg.norm(moved.tip_position[-1] - tip_of(*state[:2])) < 1e-4  # the tolerance
        assert np.diff(moved.steps).min() > 1e-9 * duration
        assert np.abs(moved.energy.balance).max() < 1e-2 * np.abs(moved.energy.load_work).max()
    assert np.linalg.norm(batch.tip_position[:, -1] - tip_of(*state[:2]), axis=1).max() < 1e-4


def test_given_steps_are_of_second_order_through_jumps_between_them() -> None:
    """Of a table and of a function, beside steps of any length; both engines take the same ones."""
    model, jump, last = pendulum(2, 4.0), 0.3037, 0.7
    fast = sr.compile(model, backend="python")
    accurate: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    state = solve_ivp(double_pendulum, (0.0, jump), np.zeros(4), args=(4.0, 0.0, 3.0), **accurate).y[:, -1]
    state = solve_ivp(double_pendulum, (jump, last), state, args=(4.0, 0.0, 0.0), **accurate).y[:, -1]
    for force in (as_table([0.0, jump, jump], [3.0, 3.0, 0.0]), lambda t: (3.0 * (t < jump), 0.0, 0.0)):
        errors = []
        for h in (4e-3, 2e-3, 1e-3):
            moved = sr.simulate(model, last, (), force=force, damping_time=0.0, time_step=h)
            errors.append(np.linalg.norm(moved.tip_position[-1] - tip_of(*state[:2])))
            same = fast.simulate(last, (), force=force, damping_time=0.0, time_step=h)
            np.testing.assert_allclose(same.tip_position, moved.tip_position, rtol=0, atol=1e-9)  # what both promise
        assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.1)


@example(groups=[[0.5, 0.25]], apart=0.3)  # the earlier one is too near to zero
@given(
    groups=st.lists(st.lists(st.floats(-0.1, 2.1), max_size=8), min_size=1, max_size=3),
    apart=st.sampled_from([1e-9, 1e-2, 0.3]),
)
def test_times_that_are_one_are_left_out_from_the_last_group_on(groups: list[list[float]], apart: float) -> None:
    merged = merged_times(apart, 2.0, *map(np.array, groups))
    assert (merged[0], merged[-1]) == (0.0, 2.0)
    assert np.all(np.diff(merged) > apart)
    within = [time for time in groups[0] if apart < time < 2.0 - apart]
    assert not within or min(within) in merged


@given(
    breaks=st.lists(st.floats(0.0, 2.0), max_size=8).map(lambda times: np.sort(np.array(times))),
    count=st.integers(1, 300),
    order=st.sampled_from([2, 4]),
)
def test_first_steps_are_short_and_end_at_breaks_or_rows(breaks: FloatArray, count: int, order: int) -> None:
    rows = np.linspace(0.0, 2.0, count + 1)
    grid = first_grid(rows, [breaks], order)
    lengths, ends = np.diff(grid), breaks[(breaks > 2e-9) & (breaks < 2.0 - 2e-9)] if order == 2 else rows
    assert (grid[0], grid[-1]) == (0.0, 2.0)
    assert np.all(lengths > 0.0)
    assert np.all(lengths <= (0.01 if order == 2 else 0.02) * (1.0 + 1e-9))
    assert np.isin(ends[np.diff(ends, prepend=-1.0) > 2e-9], grid).all()


def test_a_short_pulse_in_a_long_table_is_not_passed_over() -> None:
    """Rows on the straight lines of a table change nothing: 1 ms of up to 40 N, with three rows or with four thousand."""
    model, rows = pendulum(2, 4.0), np.linspace(0.0, 2.0, 4001)
    short = as_table([0.7525, 0.753, 0.7535], [0.0, 40.0, 0.0])
    long = as_table(list(rows), list(np.where(np.arange(4001) == 1506, 40.0, 0.0)))
    moved = [sr.simulate(model, 2.0, (), force=force, tolerance=1e-4) for force in (short, long)]
    assert np.ptp(moved[0].tip_position[:, 0]) > 0.01
    assert np.abs(moved[0].tip_position - moved[1].tip_position).max() < 2e-4  # the tolerance of each


def test_a_motor_that_stops_at_once_gives_the_robot_a_blow() -> None:
    """A motor turns at constant speed from rest, and stops: its velocity jumps twice, and the momentum of the rest does not."""
    model = pendulum(2, 0.0, springs={"hinge_2": 3.0}, motors=["hinge_1"])
    speed, stop = 0.8, 0.4

    def slope(t: float, state: FloatArray) -> FloatArray:
        second, rate = state
        first, rate_1 = (speed * t, speed) if t < stop else (speed * stop, 0.0)
        push = -MASS * LENGTH**2 * np.sin(second - first) * rate_1**2
        weight = MASS * 9.81 * LENGTH * np.sin(second)
        return np.array([rate, (push + weight - 3.0 * (second - first)) / (MASS * LENGTH**2)])

    accurate: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}
    before = solve_ivp(slope, (0.0, stop), [0.0, -speed], **accurate).y[:, -1]
    before[1] += speed * np.cos(before[0] - speed * stop)
    after = solve_ivp(slope, (np.nextafter(stop, 1.0), 1.0), before, **accurate).y[:, -1]

    def path(t: float) -> FloatArray:
        return np.array([speed * min(t, stop)])

    for options in ({"time_step": 1e-3}, {"tolerance": 1e-4}):
        moved = sr.simulate(model, 1.0, path, gravity=sr.EARTH_GRAVITY, damping_time=0.0, **options)
        assert moved.velocities[0, 0] == pytest.approx(-2.0 * speed, abs=1e-6)
        assert moved.q_springs[-1, 0] + speed * stop == pytest.approx(after[0], abs=2e-4)  # tolerance over length
        assert moved.velocities[-1, 0] == pytest.approx(after[1], abs=2e-3)  # that times omega = 6 rad/s
        assert np.abs(moved.energy.balance).max() < 1e-3 * np.abs(moved.energy.motor_work).max()


def test_steps_end_at_the_knee_of_a_plateau() -> None:
    """A link whose moment ends in a plateau swings beyond it and back, as SciPy integrates between the events."""
    text = pendulum(1, 1.0).urdf.replace("<robot ", '<robot xmlns:softrobots="urn:softrobots:urdf" ')
    text = text.replace("</joint>", '<softrobots:spring stiffness="8.0" rest="0.0"/></joint>', 1)
    link = '<softrobots:inflated_link springs="hinge_1" radius="0.05" pressure="5e4" max_moment="2.0"/></robot>'
    model = sr.load_model(text.replace("</robot>", link), tip="tip")
    inertia, knee = MASS * LENGTH**2, 2.0 / 8.0

    def slope(t: float, state: FloatArray) -> FloatArray:
        return np.array([state[1], -np.clip(8.0 * state[0], -2.0, 2.0) / inertia])

    begin = np.array([0.0, 1.5 * knee * np.sqrt(8.0 / inertia)])
    start = sr.MotionState(model, 0.0, np.zeros(0), np.zeros(0), begin[:1], begin[1:])
    events: Any = [lambda t, s: s[0] - knee, lambda t, s: s[0] + knee]
    exact = solve_ivp(slope, (0, 2.0), begin, "DOP853", rtol=1e-12, atol=1e-13, events=events, max_step=1e-3)
    moved = sr.simulate(model, 2.0, (), start=start, damping_time=0.0, tolerance=2.5e-5)
    assert moved.tolerance is not None
    assert abs(moved.q_springs[-1, 0] - exact.y[0, -1]) * LENGTH < moved.tolerance
    crossings = np.sort(np.concatenate(exact.t_events))
    nearest = np.abs(moved.steps - crossings[:2, None]).min(axis=1)  # the first grid's phase is late for those that follow
    assert len(crossings) > 6
    assert nearest.max() < 0.1 * np.diff(moved.steps).max()


@pytest.mark.study
@pytest.mark.parametrize("model", ROBOTS, ids=["arm", "lengths", "tensions", "lumped", "wrist"])
def test_every_robot_keeps_its_energy_to_second_order(model: sr.SoftModel) -> None:
    start = sr.solve_equilibrium(model, model.relaxed_motors, force=(1.0, 2.0, 0.5))

    def path(t: float) -> FloatArray:
        scale = model.motor_scale * (0.1 if model.muscle_input == "lengths" and model.muscles else 0.3)
        return np.asarray(model.relaxed_motors + np.sin(8.0 * t) ** 3 * scale)

    options: dict[str, Any] = {"gravity": sr.EARTH_GRAVITY, "damping_time": 0.01, "force": (0.0, 0.5, 0.0)}
    moved = [sr.simulate(model, 0.08, path, start=start, time_step=h, **options) for h in (2e-3, 1e-3)]
    coarse, fine = (np.abs(motion.energy.balance).max() for motion in moved)
    assert coarse < 1e-2 * np.abs(moved[0].energy.kinetic).max()
    assert 3.2 < coarse / fine < 5.0


def test_ctrl_c_returns_what_there_is() -> None:
    model = pendulum(1, 4.0)
    pressed: list[int] = []

    def force(t: float) -> FloatArray:
        pressed.append(1)
        if len(pressed) == 1600:  # of which 1002 look for jumps before the first step
            raise KeyboardInterrupt
        return np.array([np.sin(t), 0.0, 0.0])

    for options in ({"time_step": 1e-3}, {"tolerance": 1e-9}):
        pressed.clear()
        moved = sr.simulate(model, 1.0, (), force=force, **options)
        assert moved.interrupted
        assert repr(moved).endswith("interrupted=True)")
        assert len(repr(moved)) < 150  # in a line, whatever the number of rows
        assert 0.0 < moved.time[-1] <= 1.0
        assert np.all(np.isfinite(moved.q_springs))


def test_ctrl_c_at_any_moment_leaves_a_whole_motion() -> None:
    """Whichever call of the path of the motors it falls into: between steps, within one, or while rows are written."""
    motor = pendulum(2, 4.0, {"hinge_2": 4.0})
    calls, pressed = 0, 0

    def path(t: float) -> list[float]:
        nonlocal calls
        calls += 1
        if calls == pressed:
            raise KeyboardInterrupt
        return [0.1 * np.sin(t) ** 2]

    options: dict[str, Any] = {"time_step": 0.04, "output_step": 0.015, "damping_time": 0.01}
    whole = sr.simulate(motor, 0.2, path, **options)
    total, rows = calls, []
    for back in range(total):
        calls, pressed = 0, total - back
        try:
            moved = sr.simulate(motor, 0.2, path, **options)
        except KeyboardInterrupt:  # while the arguments are checked there is no motion yet
            break
        count = len(moved.time)
        assert moved.interrupted
        assert np.array_equal(moved.q_springs, whole.q_springs[:count])
        assert np.allclose(moved.energy.balance, whole.energy.balance[:count], rtol=0.0, atol=1e-15)
        rows.append(count)
    assert rows[0] > rows[-1] == 1


def test_a_chaotic_motion_ends_in_an_error_that_says_how_far_it_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation, "MOST_STEPS", 500)
    model = pendulum(2, 0.01)
    start = sr.solve_equilibrium(model, (), force=(30.0, 0.0, 5.0))
    with pytest.raises(sr.NotConverged, match="within the tolerance until t = ") as caught:
        sr.simulate(model, 6.0, (), start=start, gravity=sr.EARTH_GRAVITY, damping_time=0.0)
    best = caught.value.best
    assert isinstance(best, sr.Motion)
    assert best.tip_error == caught.value.residual > best.tolerance


@pytest.mark.study
def test_a_section_that_leaves_its_range_ends_in_an_error_with_what_was_reached() -> None:
    with pytest.raises(
        sr.NotConverged, match=r"no step from t = .* succeeds.*: section_1_1.* at the end of the range"
    ) as caught:
        sr.simulate(ROBOTS[1], 1.0, ROBOTS[1].relaxed_motors, force=(1e4, 0.0, 0.0), time_step=0.1)
    best = caught.value.best
    assert np.all(np.isfinite(best.q_springs))
    assert np.all(np.isfinite(best.motor_torques))


MOTORS = (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"q_motors": (0, 0)}, "q_motors"),
        ({"q_motors": lambda t: np.zeros(2)}, r"q_motors\(t=0\)"),
        ({"q_motors": lambda t: np.full(3, np.nan if t > 0.05 else 0.0)}, r"q_motors\(t=0\.0"),
        ({"q_motors": lambda t: np.full(3, float(t > 0.05))}, "jumps at 0.05 s"),
        ({"q_motors": "home"}, "q_motors"),
        ({"force": (1, 2)}, r"^force = \(1, 2\): force must be of shape \(3,\) \[N\], a table .*, or a function"),
        ({"force": ([0.0, 1.0], np.zeros((3, 3)))}, "values of force"),
        ({"force": ([1.0, 0.0], np.zeros((2, 3)))}, "times of force"),
        ({"force": lambda t: "down"}, r"force\(t=0\)"),
        ({"wrench": (1, 2, 3)}, "wrench"),
        ({"wrench": {"tip": lambda t: np.full(6, np.nan if t > 0.05 else 0.0)}}, "wrench"),
        ({"gravity": 9.81}, "gravity"),
        ({"damping_time": -1.0}, "damping_time"),
        ({"mass_damping": -1.0}, "mass_damping"),
        ({"time_step": 0.0}, "time_step"),
        ({"time_step": 1e-12}, "time_step"),
        ({"output_step": -1.0}, "output_step"),
        ({"output_step": 1e-12}, "output_step"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 1e-3, "time_step": 1e-3}, "tolerance"),
        ({"start": "rest"}, "start"),
        ({"start": sr.solve_equilibrium(ROBOTS[0], (0.1, 0.0, 0.0))}, "q_motors"),
        ({"motors": "servo"}, "motors"),
    ],
)
def test_what_cannot_be_simulated_is_refused(arguments: dict[str, Any], match: str) -> None:
    with pytest.raises(sr.ParameterError, match=match):
        sr.simulate(**{"model": ROBOTS[0], "duration": 0.1, "q_motors": MOTORS, "time_step": 1e-2, **arguments})
    with pytest.raises(sr.NameNotFound, match="nowhere"):
        sr.simulate(ROBOTS[0], 0.1, MOTORS, wrench={"nowhere": np.zeros(6)})


@settings(max_examples=20)
@given(st.integers(0, len(ROBOTS) - 1), st.tuples(*(st.floats(-3.0, 3.0),) * 3))
def test_an_equilibrium_that_keeps_its_load_stays(number: int, force: tuple[float, float, float]) -> None:
    """Motors carry what they carry at rest, and nothing moves, to the tolerance of the equilibrium."""
    model = ROBOTS[number]
    start = sr.solve_equilibrium(model, model.relaxed_motors, force=force, gravity=sr.EARTH_GRAVITY, tolerance=1e-13)
    options: dict[str, Any] = {"force": force, "gravity": sr.EARTH_GRAVITY, "damping_time": 0.0}
    kept = sr.simulate(model, 0.02, start.q_motors, start=start, time_step=5e-3, **options)
    assert np.abs(kept.q_springs - start.q_springs).max() < 1e-9
    assert np.allclose(kept.motor_torques, start.motor_torques, rtol=1e-7, atol=1e-7)
    assert np.allclose(kept.tip_position, start.tip_position, atol=1e-9)
    assert np.allclose(kept.forces, force)


def test_a_robot_without_springs_and_one_without_joints_move_as_they_are_told() -> None:
    model = pendulum(2, 0.0, springs={"hinge_2": None}, motors=["hinge_1", "hinge_2"])
    moved = sr.simulate(model, 0.5, lambda t: np.array([t**2, -(t**3)]), gravity=sr.EARTH_GRAVITY)
    assert np.allclose(moved.q_motors, np.stack([moved.time**2, -(moved.time**3)], axis=1))
    assert np.allclose(moved.tip_position, tip_of(moved.time**2, moved.time**2 - moved.time**3))
    assert np.abs(moved.energy.balance).max() < 1e-4
    still = sr.load_model('<robot name="still"><link name="tip"/></robot>', tip="tip", springs={})
    assert np.array_equal(sr.simulate(still, 0.5, (), force=(1.0, 0.0, 0.0)).tip_position[-1], np.zeros(3))


def test_a_short_push_in_a_long_quiet_time_is_not_missed() -> None:
    """A half sine of 20 ms after a second of rest gives the impulse that it has, and the swing that follows from it.

    It is not quite a blow, (omega 20 ms)^2 / 12 = 0.4 %, and the tip is known to the tolerance.
    """
    model, stiffness, inertia = pendulum(1, 8.0), 8.0, MASS * LENGTH**2

    def push(t: float) -> FloatArray:
        return np.array([2.0 * np.sin(np.pi * (t - 1.0) / 0.02) if 1.0 < t < 1.02 else 0.0, 0.0, 0.0])

    moved = sr.simulate(model, 6.0, (), force=push, damping_time=0.0)
    speed = 2.0 * 2.0 / np.pi * 0.02 * LENGTH / inertia
    assert np.abs(moved.velocities).max() == pytest.approx(speed, rel=0.02)
    assert np.abs(moved.q_springs).max() == pytest.approx(speed / np.sqrt(stiffness / inertia), rel=0.02)
