"""`ring_down`: modes of recorded free vibrations, with standard deviations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import softrobots as sr
from tests.support.laws import law

TIME = np.arange(0.0, 5.0, 0.01)


def vibration(frequencies: Any, ratios: Any, amplitudes: Any, phases: Any) -> np.ndarray:
    """The free vibration of damped oscillators in closed form, at TIME."""
    each = zip(2.0 * np.pi * np.asarray(frequencies), ratios, amplitudes, phases, strict=True)
    return sum(size * np.exp(-z * w * TIME) * np.cos(np.sqrt(1.0 - z**2) * w * TIME + phase) for w, z, size, phase in each)


@law("ring_down", "RingDown")
@given(
    slow=st.floats(0.8, 2.0),
    ratio=st.floats(1.03, 12.0),
    damping=st.tuples(st.floats(0.0, 0.06), st.floats(0.0, 0.1)),
    phases=st.tuples(*[st.floats(-3.0, 3.0)] * 4),
    scale=st.floats(-6.0, 6.0),
)
@settings(max_examples=15)
def test_two_modes_of_two_signals_come_back(slow: float, ratio: float, damping: Any, phases: Any, scale: float) -> None:
    """Without noise least squares ends within rounding, which a second mode that lies close to the first enlarges."""
    frequencies = np.array([slow, ratio * slow])
    signals = [vibration(frequencies, damping, (1.0, 0.6), phases[:2]), vibration(frequencies, damping, (0.4, 1.0), phases[2:])]
    found = sr.ring_down(TIME, 10.0**scale * np.column_stack(signals) + (3.0, -1.0), 2)
    assert isinstance(found, sr.RingDown)
    np.testing.assert_allclose(found.frequencies, frequencies, rtol=1e-8)
    np.testing.assert_allclose(found.damping_ratios, damping, atol=1e-8)
    np.testing.assert_allclose(found.amplitudes, 10.0**scale * np.array([[1.0, 0.4], [0.6, 1.0]]), rtol=1e-6)


@pytest.mark.study
def test_intervals_hold_the_true_values() -> None:
    """Two near modes, noise of another size in each signal; of 30 records 120 intervals, and normal numbers squared."""
    frequencies, ratios = (1.3, 1.36), (0.02, 0.03)
    random, errors = np.random.default_rng(3), []
    for _ in range(30):
        sizes, phases = random.uniform(0.5, 1.0, (2, 2)), random.uniform(-3.0, 3.0, (2, 2))
        signals = np.column_stack([vibration(frequencies, ratios, *one) for one in zip(sizes, phases, strict=True)])
        noise = (0.002, 0.01) * random.standard_normal(signals.shape)
        found = sr.ring_down(TIME, signals + noise, 2)
        errors.append((found.frequencies - frequencies) / found.frequency_std)
        errors.append((found.damping_ratios - ratios) / found.damping_ratio_std)
        np.testing.assert_allclose(found.noise, (0.002, 0.01), rtol=0.12)  # 500 numbers: 3 % each, four times that
    assert 0.88 <= np.mean(np.abs(errors) < 1.96) <= 1.0
    assert 0.6 <= np.mean(np.square(errors)) <= 1.4  # three standard deviations


def test_an_arm_that_is_let_go_tells_its_modes() -> None:
    """Small vibrations; steps of 1 ms slow 3.8 Hz by 5e-5, and the tip sees the two slow modes and, at first, the fast ones."""
    arm, motors, gravity = sr.load_model(sr.InflatableArm(damping_time=0.006)), (0.3, 0.6, -0.8), sr.EARTH_GRAVITY
    modes = sr.vibration_modes(arm, sr.solve_equilibrium(arm, motors, gravity=gravity))
    held = sr.solve_equilibrium(arm, motors, (0.03, 0.05, -0.06), gravity=gravity)
    motion = sr.simulate(arm, 1.5, motors, start=held, gravity=gravity, time_step=1e-3, output_step=0.01)
    found = sr.ring_down(motion.time, motion.tip_position, 3)
    np.testing.assert_allclose(found.frequencies[:2], modes.frequencies[:2], rtol=1e-3)
    np.testing.assert_allclose(found.damping_ratios[:2], modes.damping_ratios[:2], rtol=1e-2)
    assert np.all(found.damping_ratio_std[:2] < 1e-2 * found.damping_ratios[:2])


WAVE = vibration((1.3,), (0.02,), (1.0,), (0.0,))


@pytest.mark.parametrize(
    ("time", "values", "modes", "told"),
    [
        (TIME, WAVE[1:], 1, "values"),
        (TIME[::-1], WAVE, 1, "ascending"),
        (TIME[:15], WAVE[:15], 2, "at least 16 ascending times"),
        (TIME, 0.0 * WAVE, 1, "at least one changes"),
        (TIME, np.where(TIME == 1.0, np.nan, WAVE), 1, "finite"),
        (TIME, np.zeros((len(TIME), 0)), 1, "at least one changes"),
        (TIME, WAVE, 0, "n_modes"),
    ],
)
def test_what_is_no_record_is_refused(time: Any, values: Any, modes: int, told: str) -> None:
    with pytest.raises(sr.ParameterError, match=told):
        sr.ring_down(time, values, modes)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (TIME, "only 0 of them stand out"),
        (np.random.default_rng(1).standard_normal(len(TIME)), "only 0 of them stand out"),
        (
            WAVE + 0.01 * np.random.default_rng(1).standard_normal(len(TIME)),
            r"only 1 of them stand out .*\[1\.[23]",
        ),
        (vibration((1.3, 2.0), (-0.02, 0.02), (1.0, 1.0), (0.0, 1.0)), "one of them grows"),
    ],
)
def test_a_record_without_so_many_vibrations_says_how_many_it_has(values: Any, told: str) -> None:
    with pytest.raises(sr.NotConverged, match=told) as caught:
        sr.ring_down(TIME, values, 2)
    assert isinstance(caught.value.best, sr.RingDown)
