"""Motion with dry friction: Coulomb's oscillator in closed form, what sticks, slow motion against statics, and energy."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import softrobots as sr
from tests.support.friction_bars import STICK, STIFFNESS, arm, bar, bent, period, released, smooth


def test_the_swings_of_an_oscillator_fall_by_the_same_each_time_until_it_sticks() -> None:
    """Let go at 9.5 times the friction over the stiffness, it turns round at -7.5, 5.5, -3.5, 1.5, and stays at 0.5."""
    band = 0.01  # friction over stiffness [rad]
    model, swing = bar(band * STIFFNESS), period()
    start = bent(model, 9.5 * band, band * STIFFNESS)
    motion = sr.simulate(
        model, 3.0 * swing, [], start=start, time_step=swing / 50.0, output_step=swing / 50.0, damping_time=0.0
    )
    angle, energy = motion.q_springs[:, 1], motion.energy
    slides = np.diff(angle[: int(2.6 * 50)])
    turns = angle[1 : len(slides)][slides[1:] * slides[:-1] < 0.0]
    # A part that turns round gives way by a stick, a hundredth of the band; the rows stand within (pi / 50)^2 / 2 of a turn.
    assert turns[:4] / band == pytest.approx([-7.5, 5.5, -3.5, 1.5], rel=0.003, abs=0.01)
    stuck = angle[int(2.6 * 50) :]
    assert stuck == pytest.approx(np.full(len(stuck), 0.5 * band), abs=2.0 * STICK)
    assert np.abs(motion.velocities[-10:]).max() < 1e-3 * np.abs(motion.velocities).max()
    # Friction takes its moment times the way; the spring in line with the slider gives way by a stick at each turn.
    assert energy.dissipated[-1] == pytest.approx(band * STIFFNESS * band * (17.0 + 13.0 + 9.0 + 5.0 + 1.0), rel=0.01)
    assert np.abs(energy.balance).max() < 1e-5 * energy.elastic[0]


def test_steps_are_of_second_order_while_it_slides() -> None:
    """Before it turns the angle is a cosine about friction over stiffness."""
    band = 0.005
    model, swing = bar(band * STIFFNESS), period()
    start = bent(model, 0.05, band * STIFFNESS)
    exact = band + (start.q_springs[1] - band) * np.cos(0.8 * np.pi)
    steps = [swing / count for count in (20, 40)]
    coarse, fine = (
        sr.simulate(model, 0.4 * swing, [], start=start, time_step=step, damping_time=0.0).q_springs[-1, 1] - exact
        for step in steps
    )
    assert coarse / fine == pytest.approx(4.0, abs=0.2)
    assert abs(fine) < 3e-3 * 0.05


def test_friction_opposes_the_motion_whatever_its_direction() -> None:
    """Bent one way and kicked the other, the end of the bar moves as SciPy says; a slip that turns is of first order."""
    band, swing = 0.01, period()
    model, pace = bar(band * STIFFNESS), 2.0 * np.pi / swing
    place, rates = np.array([0.1, 0.0]), np.array([0.0, 0.06 * pace])

    def accelerations(_: float, state: np.ndarray) -> np.ndarray:
        speed = state[2:]
        return np.concatenate([speed, -(pace**2) * (state[:2] + band * speed / np.linalg.norm(speed))])

    exact = solve_ivp(accelerations, (0.0, 0.8 * swing), np.concatenate([place, rates]), rtol=1e-10, atol=1e-12).y[:2, -1]
    start = sr.MotionState(model, 0.0, np.zeros(0), np.zeros(0), np.append(place, [0.0, 0.0]), np.append(rates, [0.0, 0.0]))
    coarse, fine = (
        sr.simulate(model, 0.8 * swing, [], start=start, time_step=swing / count, damping_time=0.0).q_springs[-1, :2] - exact
        for count in (25, 50)
    )
    assert np.linalg.norm(coarse) / np.linalg.norm(fine) == pytest.approx(2.0, abs=0.4)
    assert np.linalg.norm(fine) < 0.02 * 0.1  # without friction it would be 0.025 rad elsewhere


@pytest.mark.study
@pytest.mark.parametrize("compiled", [False, True])
def test_slow_motion_is_a_path_of_equilibria(compiled: bool) -> None:
    """A tendon is pulled and let go within 2.4 s, where vibrations last 0.1 s: `solve_equilibrium` from state to state."""
    model = arm("tension", guide_friction=0.4, bending_friction=1e-3)

    def pull(time: float) -> np.ndarray:
        return np.array([3.0 * smooth(time) - 2.0 * smooth(time - 1.2)])

    simulate = sr.compile(model, backend="python").simulate if compiled else partial(sr.simulate, model)
    motion = simulate(2.4, pull, time_step=0.02, output_step=1.2, damping_time=0.05)
    found = None
    states = [found := sr.solve_equilibrium(model, pull(time), previous=found) for time in np.linspace(0.3, 2.4, 8)]
    for row, state in ((1, states[3]), (2, states[-1])):
        assert motion.q_springs[row] == pytest.approx(state.q_springs, abs=0.5 * STICK)
    loose = sr.solve_equilibrium(arm("tension"), pull(2.4))
    assert np.abs(states[-1].q_springs - loose.q_springs).max() > 100.0 * STICK  # friction is felt
    assert np.abs(motion.energy.balance).max() < 1e-6 * motion.energy.motor_work.max()
    assert np.diff(motion.energy.dissipated).min() > 0.0


def test_given_lengths_move_against_friction_too() -> None:
    """One section that follows the lengths of its muscles: the motors do the work of friction, its moment times the bending."""
    moment = 0.05
    model = sr.load_model(sr.PccArm(segment_lengths=(0.5,), elastic_sections=1, bending_friction=moment))
    bend = 0.02 * np.cos([0.0, 2.0 * np.pi / 3.0, 4.0 * np.pi / 3.0])

    def lengths(time: float) -> np.ndarray:
        return np.asarray(model.relaxed_motors + bend * (smooth(time) - smooth(time - 1.0)))

    motion = sr.simulate(model, 2.2, lengths, time_step=0.02, output_step=1.1, damping_time=0.0)
    out = sr.solve_equilibrium(model, lengths(1.0))
    back = sr.solve_equilibrium(model, lengths(2.0), previous=out)
    assert motion.motor_torques[-1] == pytest.approx(back.motor_torques, abs=1e-6 * np.abs(out.motor_torques).max())
    angle = np.linalg.norm(out.strains[0, :2]) * 0.5
    # Each way the moment is whole but for the stick, which is given back once; nothing moves at the end.
    assert motion.energy.dissipated[-1] == pytest.approx(2.0 * moment * angle, abs=4.0 * moment * STICK)
    assert motion.energy.motor_work[-1] == pytest.approx(motion.energy.dissipated[-1], rel=2e-3)  # midpoint steps: 100 of them


@pytest.mark.parametrize("fields", [{"bending_friction": 5e-4}, {"guide_friction": 0.1}])
def test_what_friction_takes_is_gone(fields: dict[str, float]) -> None:
    """Let go without damping: friction takes energy in every step, and the balance of power closes."""
    model, start = released(**fields)
    motion = sr.simulate(model, 0.03, start.q_motors, start=start, time_step=1e-3, output_step=1e-3, damping_time=0.0)
    energy = motion.energy
    assert np.abs(energy.balance).max() < 1e-4 * energy.dissipated[-1]
    assert np.diff(energy.dissipated).min() > -1e-4 * energy.dissipated[-1]  # what springs of sliders give back
    assert energy.dissipated[-1] > 0.1 * energy.kinetic.max()


def test_a_robot_that_friction_holds_does_not_move() -> None:
    """Bent and let go to what friction holds: at rest it stays, because it remembers; without that it would spring back."""
    model = arm("tension", bending_friction=2e-3)
    held = sr.solve_equilibrium(model, [0.4], previous=sr.solve_equilibrium(model, [1.0]))
    motion = sr.simulate(model, 0.05, [0.4], start=held, time_step=1e-3, damping_time=0.0)
    assert motion.q_springs[-1] == pytest.approx(held.q_springs, abs=1e-9)
    assert np.abs(held.q_springs - sr.solve_equilibrium(model, [0.4]).q_springs).max() > 0.01


def test_a_motion_goes_on_from_another_and_from_a_file(tmp_path: Path) -> None:
    """Two halves are the whole: the second remembers where the sliders of the first are."""
    model, start = released(bending_friction=5e-4)
    options: dict[str, Any] = {"time_step": 1e-3, "output_step": 0.01}
    whole = sr.simulate(model, 0.02, start.q_motors, start=start, **options)
    first = sr.simulate(model, 0.01, start.q_motors, start=start, **options)
    saved = sr.load_result(sr.save_result(first, tmp_path / "first.npz"))
    for before in (first, first.end, saved):
        second = sr.simulate(model, 0.01, start.q_motors, start=before, **options)
        assert second.q_springs[-1] == pytest.approx(whole.q_springs[-1], abs=1e-9)
    at = sr.MotionState(model, 0.0, first.q_motors[-1], first.motor_velocities[-1], first.q_springs[-1], first.velocities[-1])
    forgot = sr.simulate(model, 0.01, start.q_motors, start=at, **options)
    assert np.abs(forgot.q_springs[-1] - whole.q_springs[-1]).max() > 1e-6


@pytest.mark.study
def test_steps_are_chosen_for_a_tolerance() -> None:
    """The tip at the end is within it of that of a run with steps of a four hundredth of a swing."""
    band = 0.02
    model, swing = bar(band * STIFFNESS), period()
    start = bent(model, 0.1, band * STIFFNESS)
    options: dict[str, Any] = {"start": start, "output_step": 0.7 * swing, "damping_time": 0.0}  # beyond the first turn
    motion = sr.simulate(model, 0.7 * swing, [], tolerance=3e-4, **options)
    fine = sr.simulate(model, 0.7 * swing, [], time_step=swing / 400.0, **options)
    assert motion.tip_error is not None
    assert motion.tip_error <= 3e-4
    assert np.linalg.norm(motion.tip_position[-1] - fine.tip_position[-1]) < 3e-4


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda model, found: sr.simulate(model, 0.1, [], order=4), "order"),
        (lambda model, found: sr.vibration_modes(model, found), "without dry friction, for small vibrations"),
        (lambda model, found: sr.linearize(model, found), "without dry friction, for small vibrations"),
    ],
)
def test_what_needs_smooth_motion_refuses_friction(call: Callable[..., Any], words: str) -> None:
    model = bar(1e-3)
    with pytest.raises(sr.ParameterError, match=words):
        call(model, sr.solve_equilibrium(model, []))
