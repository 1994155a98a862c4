"""Input shaping against oscillators integrated by SciPy and the published closed forms."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import softrobots as sr
from softrobots.dynamics.damping import damping_matrix
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.statics.kinematics import frame_placement
from studies.control import shaper_picture, shaping
from studies.motion.examples import swing
from tests.conftest import CHECKOUT
from tests.support.laws import law

KINDS = ("zv", "zvd", "ei")
frequencies, ratios = st.floats(0.5, 20.0), st.floats(0.0, 0.3)


def path(duration: float = 0.5, ends: tuple[float, ...] = (1.0, -0.4), steps: int = 200) -> Any:
    """A path of motors with the quintic time law."""
    s = np.linspace(0.0, 1.0, steps + 1)
    return SimpleNamespace(times=duration * s, q_motors=sr.quintic(s)[:, None] * np.array(ends))


def modes(found: Any, damping: Any = 0.0) -> Any:
    """Modes as `vibration_modes` returns them."""
    return SimpleNamespace(
        frequencies=np.array(found, float), damping_ratios=np.broadcast_to(damping, np.shape(found)).astype(float)
    )


def amplitude(command: Any, end: float, frequency: float, ratio: float) -> float:
    """Amplitude at `end`, about the command, of `y'' + 2 zeta omega y' + omega^2 (y - u) = 0`, by SciPy's DOP853."""
    omega = 2.0 * math.pi * frequency
    turn = omega * math.sqrt(1.0 - ratio**2)

    def slope(t: float, state: Any) -> list[float]:
        return [state[1], omega**2 * (float(command(t)[0]) - state[0]) - 2.0 * ratio * omega * state[1]]

    run = solve_ivp(slope, (0.0, end), [0.0, 0.0], "DOP853", rtol=1e-9, atol=1e-11, max_step=0.02)
    x, v = run.y[0, -1] - float(command(end)[0]), run.y[1, -1]
    return math.hypot(x, (v + ratio * omega * x) / turn)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("real", "ratio"), [(2.0, 0.0), (2.0, 0.1), (2.3, 0.05)])
def test_a_shaped_move_leaves_of_an_oscillator_what_the_closed_form_says(kind: str, real: float, ratio: float) -> None:
    """Shaped for 2 Hz, with the robot at `real`: both moves end at rest, the shaped one later by the last impulse."""
    bare = sr.shape_input(path(), modes([2.0], ratio), numbers=())
    shaped = sr.shape_input(path(), modes([2.0], ratio), shaper=kind)
    assert shaped.numbers == (0,)
    left = amplitude(bare, 0.5, real, ratio)
    share = amplitude(shaped, 0.5 + shaped.shaper.duration, real, ratio) / left
    assert left > 0.05
    assert share == pytest.approx(float(sr.residual_vibration(shaped.shaper, real, ratio)), abs=1e-5)  # DOP853 with rtol 1e-9
    if real == 2.0:
        assert share == pytest.approx(0.05 if kind == "ei" else 0.0, abs=1e-5)


@law("input_shaper", "residual_vibration")
@given(frequency=frequencies, ratio=ratios, kind=st.sampled_from(KINDS))
@settings(max_examples=40)
def test_shapers_are_those_of_their_authors(frequency: float, ratio: float, kind: str) -> None:
    """Sums, spacing, zeros, and the slope of the sensitivity by central differences."""
    shaper = sr.input_shaper(frequency, ratio, shaper=kind)
    period = 1.0 / (frequency * math.sqrt(1.0 - ratio**2))
    assert shaper.amplitudes.sum() == pytest.approx(1.0, abs=1e-14)
    assert (shaper.amplitudes > 0.0).all()
    assert shaper.times == pytest.approx(0.5 * period * np.arange(2 if kind == "zv" else 3), rel=1e-14)
    here = float(sr.residual_vibration(shaper, frequency, ratio))
    assert here == pytest.approx(0.05 if kind == "ei" else 0.0, abs=1e-14)
    near = sr.residual_vibration(shaper, frequency * np.array([1.0 - 1e-4, 1.0 + 1e-4]), ratio)
    if kind == "zv":  # the modulus has a corner there: pi / 2 times the change, with damping down to half of it
        assert near.min() > 0.5e-4
    elif kind == "zvd":
        assert near.max() < 4e-8  # (pi / 2 times the change)^2
    undamped = sr.input_shaper(frequency, 0.0, shaper=kind)
    printed = {"zv": [0.5, 0.5], "zvd": [0.25, 0.5, 0.25], "ei": [1.05 / 4, 0.95 / 2, 1.05 / 4]}[kind]  # (1 + V)/4, (1 - V)/2
    assert undamped.amplitudes == pytest.approx(printed, abs=1e-15)
    if kind == "zv":
        k = math.exp(-ratio * math.pi / math.sqrt(1.0 - ratio**2))
        assert shaper.amplitudes == pytest.approx([1.0 / (1.0 + k), k / (1.0 + k)], rel=1e-13)


def test_extra_insensitive_is_zvd_for_a_mode_that_damps_itself() -> None:
    """At 5 % up to the damping ratio where `2 K^2 = V (1 + K^2)`, 0.504."""
    for ratio, same in ((0.49, False), (0.51, True), (0.8, True)):
        given, zvd = (sr.input_shaper(1.0, ratio, shaper=kind).amplitudes for kind in ("ei", "zvd"))
        assert np.array_equal(given, zvd) == same


def test_extra_insensitive_serves_the_band_of_its_paper() -> None:
    """Insensitivity at 5 %, the width of the band over the frequency: ZV 0.06, ZVD 0.29, EI 0.40 [Singhose et al. 1994]."""
    ratio = np.linspace(0.5, 1.5, 100001)
    width = {}
    for kind in KINDS:
        served = ratio[sr.residual_vibration(sr.input_shaper(1.0, shaper=kind), ratio) <= 0.05 + 1e-12]
        width[kind] = served[-1] - served[0]
    assert width == pytest.approx({"zv": 0.06, "zvd": 0.29, "ei": 0.40}, abs=0.006)  # two digits are printed


@law("shape_input", "ShapedTrajectory", "InputShaper")
@given(
    found=st.lists(frequencies, min_size=1, max_size=4),
    ratio=ratios,
    kind=st.sampled_from(KINDS),
    duration=st.floats(0.05, 2.0),
)
@settings(max_examples=25)
def test_a_shaped_path_rests_at_both_ends_and_cancels_what_it_names(
    found: list[float], ratio: float, kind: str, duration: float
) -> None:
    """Whatever modes were left out would be left 0.5 % of the largest vibration, or were cancelled already."""
    given_path, all_modes = path(duration), modes(found, ratio)
    shaped = sr.shape_input(given_path, all_modes, shaper=kind)
    assert isinstance(shaped, sr.ShapedTrajectory)
    assert isinstance(shaped.shaper, sr.InputShaper)
    assert 0 < len(shaped.numbers) <= len(found)
    assert shaped.times[0] == 0.0
    assert shaped.times[-1] == pytest.approx(duration + shaped.shaper.duration)
    assert np.abs(shaped.q_motors[0]).max() == 0.0
    assert shaped.q_motors[-1] == pytest.approx(given_path.q_motors[-1], abs=1e-14)
    assert shaped(-1.0) == pytest.approx([0.0, 0.0], abs=0.0)
    middle = len(shaped.times) // 2
    assert shaped(float(shaped.times[middle])) == pytest.approx(shaped.q_motors[middle], abs=1e-12)
    assert np.ptp(shaped.q_motors[:, 0]) <= 1.0 + 1e-12  # a mean of values of the path
    for number in shaped.numbers:
        share = float(sr.residual_vibration(shaped.shaper, found[number], ratio))
        assert share <= (0.05 if kind == "ei" else 0.0) + 1e-12


def test_modes_that_do_not_matter_are_left_out() -> None:
    """A pair at one frequency is shaped for once, but for what EI leaves; a mode far above a slow path, and one that does not
    vibrate, not at all."""
    pair = modes([1.0, 1.0, 40.0], 0.02)
    assert sr.shape_input(path(2.0), pair, shaper="zv").numbers == (0,)
    assert sr.shape_input(path(0.03), pair, shaper="zv").numbers == (0, 2)
    by_default = sr.shape_input(path(2.0), pair)
    assert by_default.numbers == (0, 1)
    assert float(sr.residual_vibration(by_default.shaper, 1.0, 0.02)) == pytest.approx(0.05**2, rel=1e-9)
    assert sr.shape_input(path(0.1), modes([1.0, 2.0], [0.01, 1.2])).numbers == (0,)
    assert sr.shape_input(path(ends=(0.0, 0.0)), modes([1.0])).numbers == ()
    assert sr.shape_input(path(), modes([5.0, 1.0]), shaper="zv", numbers=[1]).shaper.duration == pytest.approx(0.5)


def test_a_trajectory_of_the_arm_is_shaped(arm: sr.SoftModel) -> None:
    line = sr.straight_line((0.9, 0.2, 0.3), (0.8, 0.4, 0.4), 0.5, steps=20)
    followed = sr.follow_trajectory(arm, line.targets, times=line.times)
    shaped = sr.shape_input(followed, modes([3.7, 3.9, 15.0, 17.0], 0.05))
    assert shaped.q_motors.shape == (len(shaped.times), arm.n_motors)
    assert shaped(99.0) == pytest.approx(followed.q_motors[-1], abs=1e-12)
    again = sr.shape_input(shaped, modes([8.0], 0.05))
    assert again(99.0) == pytest.approx(followed.q_motors[-1], abs=1e-12)


ONE = modes([1.0])


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: sr.input_shaper(0.0), "frequency"),
        (lambda: sr.input_shaper([]), "frequencies"),
        (lambda: sr.input_shaper([[1.0]]), "frequencies"),
        (lambda: sr.input_shaper(1.0, 1.0), "damping_ratio"),
        (lambda: sr.input_shaper(1.0, -0.1), "damping_ratio"),
        (lambda: sr.input_shaper([1.0, 2.0], [0.1, 0.1, 0.1]), "damping_ratio"),
        (lambda: sr.input_shaper(1.0, shaper="zvdd"), "shaper"),
        (lambda: sr.input_shaper(1.0, tolerance=0.5), "tolerance"),
        (lambda: sr.residual_vibration(None, 1.0), "shaper"),  # type: ignore[arg-type]
        (lambda: sr.residual_vibration(sr.input_shaper(1.0), math.nan), "frequency"),
        (lambda: sr.shape_input(None, ONE), "trajectory.times"),
        (lambda: sr.shape_input(SimpleNamespace(times=[0.0], q_motors=[[0.0]]), ONE), "trajectory.times"),
        (lambda: sr.shape_input(SimpleNamespace(times=[0.0, 1.0], q_motors=[[0.0]]), ONE), "trajectory.q_motors"),
        (lambda: sr.shape_input(path(), None), "modes.frequencies"),
        (lambda: sr.shape_input(path(), ONE, numbers=[1]), "numbers"),
        (lambda: sr.shape_input(path(), ONE, numbers=0), "numbers"),  # type: ignore[arg-type]
        (lambda: sr.shape_input(path(), ONE, numbers=[0, 0]), "numbers"),
        (lambda: sr.shape_input(path(), ONE, shaper="zvdd", numbers=()), "shaper"),
        (lambda: sr.shape_input(path(), ONE)(math.nan), "time"),
    ],
)
def test_what_cannot_be_shaped_is_refused(call: Any, name: str) -> None:
    with pytest.raises(sr.ParameterError, match=f"^{name} "):
        call()


def test_the_sensitivity_is_drawn() -> None:
    figure = shaper_picture.sensitivity(3.5, 0.05)
    lines = {line.get_label().split(",")[0]: line.get_data() for line in figure.axes[0].lines[:3]}
    assert list(lines) == ["ZV", "ZVD", "EI"]
    drawn = {name: float(np.interp(3.5, *data)) for name, data in lines.items()}
    assert drawn == pytest.approx({"ZV": 0.0, "ZVD": 0.0, "EI": 5.0}, abs=1e-9)
    with pytest.raises(sr.ParameterError, match=r"^frequency "):
        shaper_picture.sensitivity(0.0)


def test_a_shaped_move_of_the_arm_leaves_less_than_two_per_cent_of_the_vibration() -> None:
    """Half a second, half a radian, under weight, with the exact modes of its end."""
    arm = sr.load_model(sr.InflatableArm())
    bare, shaped = (swing(shaping.move(arm, 1.0, name)[1]) for name in ("none", "EI"))
    assert bare > 0.01
    assert shaped < 0.02 * bare


@pytest.mark.study
def test_the_record_of_shapers_is_what_a_fresh_run_says() -> None:
    record = json.loads((CHECKOUT / "docs" / "validation" / "input_shaping.json").read_text())["rows"]
    for old, new in zip(record, shaping.study(), strict=True):
        assert old["modes"] == new["modes"]
        assert old["left_m"] == pytest.approx(new["left_m"], rel=1e-3, abs=1e-7)
    whole, half, tenth = (np.array([row["percent"][place] for row in record[1:]]) for place in range(3))
    assert (tenth < 0.6).all()  # nearly linear, for each shaper
    assert (tenth < half).all()
    assert (half < whole).all()  # what is left is of second order in the move


EFFECTS = {"weight": 0.16, "inertia": 0.55, "coupling": 2.52, "centrifugal": 3.21}
"""Percent that ZV leaves of the move with one effect alone, as docs/motion.md tells."""


@pytest.mark.study
def test_what_shaping_leaves_comes_from_forces_of_second_order() -> None:
    """Equations of motion by Runge and Kutta's method, with all effects but some kept as they are where the move ends.

    With none ZV is exact; with all it leaves what the simulation leaves. Percentages are those of the page, to its digits.
    """
    arm, (begin, end) = sr.load_model(sr.InflatableArm()), np.array((shaping.FROM, shaping.TO))
    sagging = sr.solve_equilibrium(arm, end, gravity=sr.EARTH_GRAVITY)
    bare = shaping.point_to_point(begin, end, shaping.DURATION, 201)
    found = sr.vibration_modes(arm, sagging)
    zv, none = (sr.shape_input(bare, found, shaper="zv", numbers=numbers) for numbers in ((0, 1), ()))
    for effects, percent in [((name,), left) for name, left in EFFECTS.items()] + [((), 0.0), (tuple(EFFECTS), 3.94)]:
        shaped, whole = (_left(arm, begin, sagging, move, effects) for move in (zv, none))
        assert 100.0 * shaped / whole == pytest.approx(percent, abs=0.05), effects


def _left(arm: sr.SoftModel, begin: Any, sagging: sr.Equilibrium, move: sr.ShapedTrajectory, effects: tuple[str, ...]) -> float:
    """Largest distance of the tip from its place at rest in the 0.4 s after a move [m]."""
    equations = EquationsOfMotion(arm, sr.EARTH_GRAVITY, damping_matrix(arm, None))
    still, end, rest = np.zeros(7), sagging.q_motors, sagging.q_springs
    at_end, damping = equations.mass_matrix(np.append(end, rest)), equations.damping[3:, 3:]

    def static(x: Any) -> Any:
        return equations.balance(x, still, still, {})[3:]

    steps = 1e-5 * np.eye(7)
    slope = np.array([static(np.append(end, rest) + d) - static(np.append(end, rest) - d) for d in steps]).T / 2e-5
    duration, times = float(move.times[-1]), np.linspace(0.0, float(move.times[-1]), 2001)
    path = CubicSpline(times, [move(time) for time in times], bc_type="clamped")
    speed, acceleration = path.derivative(1), path.derivative(2)

    def rates(time: float, state: Any) -> Any:
        x, on = np.append(path(min(time, duration)), state[:4]), time < duration
        v = np.append(on * speed(min(time, duration)), state[4:])
        mass = equations.mass_matrix(x)
        moved = (mass if "inertia" in effects else at_end)[3:, 3:]
        pushed = (mass if "coupling" in effects else at_end)[3:, :3] @ (on * acceleration(min(time, duration)))
        force = static(x) if "weight" in effects else slope @ (x - np.append(end, rest))
        force += equations.balance(x, v, still, {})[3:] - static(x) if "centrifugal" in effects else damping @ state[4:]
        return np.append(state[4:], -np.linalg.solve(moved, force + pushed))

    first = rest - np.linalg.solve(slope[:, 3:], slope[:, :3] @ (begin - end))
    if "weight" in effects:
        first = sr.solve_equilibrium(arm, begin, gravity=sr.EARTH_GRAVITY).q_springs
    run = solve_ivp(
        rates, (0.0, duration + 0.4), np.append(first, np.zeros(4)), rtol=1e-6, atol=1e-8, max_step=0.01, dense_output=True
    )
    after = run.sol(np.linspace(duration, duration + 0.4, 201))[:4].T
    tips = [frame_placement(arm, arm.configuration(end, y), arm.tip).translation for y in after]
    return float(np.linalg.norm(tips - sagging.tip_position, axis=1).max())
