"""The fit of a bending test: where its knee is, by trying every split; its error, by SciPy; its limits, on exact numbers."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from softrobots import ParameterError, inflated_beam
from tests.support.tables import each_row

TUBE = {"pressure": 50e3, "radius": 0.055}
WRINKLING = inflated_beam.wrinkling_moment(**TUBE)


def fitted(angle: np.ndarray, moment: np.ndarray, **tube: float) -> inflated_beam.Characterisation:
    return inflated_beam.fit_characterisation(angle, moment, **(TUBE | tube))


def squares_of_split(angle: np.ndarray, moment: np.ndarray, before: int) -> float:
    """Sum of squares about the best line through the origin before, and the mean after."""
    line, plateau = (angle[:before], moment[:before]), moment[before:]
    slope = np.linalg.lstsq(line[0][:, None], line[1], rcond=None)[0][0]
    return float(np.sum((line[1] - slope * line[0]) ** 2) + (np.sum((plateau - plateau.mean()) ** 2) if len(plateau) else 0.0))


def best_split(angle: np.ndarray, moment: np.ndarray) -> tuple[int, float]:
    """Of all splits with at least three points on both sides the best, and its F ratio against no plateau."""
    n = len(angle)
    tried = {before: squares_of_split(angle, moment, before) for before in range(3, n - 2)}
    best = min(tried, key=lambda before: tried[before])
    return best, (squares_of_split(angle, moment, n) - tried[best]) / (tried[best] / (n - 3))


def switch(saturates: Callable[[float], bool], low: float, high: float) -> float:
    """Where the answer changes."""
    assert saturates(low) != saturates(high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if saturates(middle) == saturates(low) else (low, middle)
    return high


@settings(max_examples=60)
@given(st.integers(1, 12), st.integers(3, 8), st.integers(0, 2**32 - 1), st.sampled_from([1e-4, 0.02]))
def test_the_knee_is_the_best_of_all_splits(rising: int, flat: int, seed: int, noise: float) -> None:
    """A clear plateau begins where the best split has it; with one or two points before it, a line of three is taken."""
    angle = np.arange(1.0, rising + flat + 1.0) / 100.0
    moment = 0.5 * WRINKLING * np.minimum(np.arange(1.0, rising + flat + 1.0), rising + 0.5) / rising
    moment += noise * WRINKLING / rising * np.random.default_rng(seed).normal(size=len(angle))
    if rising + flat < 6:
        assert fitted(angle, moment).n_saturated == 0
        return
    before, ratio = best_split(angle, moment)
    if ratio > 13.0:
        fit = fitted(angle, moment)
        assert fit.n_saturated == len(angle) - before
        assert fit.max_moment == pytest.approx(moment[before:].mean(), rel=1e-13)


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5])
def test_chance_is_a_ratio_of_twelve(seed: int) -> None:
    """The noise at which a plateau is no longer told from chance is that at which the F ratio is 12."""
    angle = np.arange(1.0, 11.0) / 100.0
    clean, noise = np.minimum(angle, 0.065), np.random.default_rng(seed).normal(size=10) / 100.0

    def saturates(share: float) -> bool:
        return fitted(angle, 0.5 * WRINKLING * (clean + share * noise) / 0.07).n_saturated > 0

    share = switch(saturates, 0.01, 3.0)
    # The split may be another one just above; the ratio is that of the best on both sides, and continuous.
    assert best_split(angle, clean + share * noise)[1] == pytest.approx(12.0, rel=1e-9)


def test_a_plateau_rises_by_less_than_half_the_slope() -> None:
    angle = np.arange(1.0, 17.0) / 100.0

    def moment(rise: float) -> np.ndarray:
        """Slope 1 up to the eighth point, then a drop and another slope: the knee stays where it is."""
        return 0.5 * WRINKLING / 0.08 * np.where(angle < 0.085, angle, 0.03 + rise * (angle - 0.125))

    def saturates(rise: float) -> bool:
        return fitted(angle, moment(rise)).n_saturated > 0

    assert best_split(angle, moment(0.5))[0] == 8
    assert switch(saturates, 0.1, 0.9) == pytest.approx(0.5, rel=1e-12)


def test_half_the_slope_itself_is_no_plateau() -> None:
    """All numbers here are exact: slope 16 up to the fourth point, and 8 about a mean of nearly nothing from there."""
    angle = np.arange(1.0, 9.0) / 128.0
    moment = np.where(angle < 4.5 / 128.0, 16.0 * angle, 8.0 * (angle - 6.5 / 128.0) + 2.0**-4)
    assert best_split(angle, moment)[0] == 4
    assert best_split(angle, moment)[1] > 13.0
    assert fitted(angle, moment).n_saturated == 0
    flatter = np.where(angle < 4.5 / 128.0, moment, 7.99 * (angle - 6.5 / 128.0) + 2.0**-4)
    assert fitted(angle, flatter).n_saturated == 4


@pytest.mark.parametrize("past", [0, 6])
def test_moments_and_pressure_of_any_size_give_the_same_knee(past: int) -> None:
    random = np.random.default_rng(7)
    angle = np.arange(1.0, 13.0) / 100.0
    moment = 0.1 * WRINKLING * np.minimum(100.0 * angle, 12.5 - past) + 0.01 * random.normal(size=12)
    found = fitted(angle, moment)
    assert found.n_saturated == past
    for power in (-40, -20, 20):
        scale = 2.0**power  # changes no digit
        other = fitted(angle, scale * moment, pressure=scale * TUBE["pressure"])
        assert (other.stiffness, other.stiffness_std) == (scale * found.stiffness, scale * found.stiffness_std)
        assert (other.n_linear, other.n_saturated) == (found.n_linear, found.n_saturated)


def test_the_error_of_the_slope_is_that_of_scipy() -> None:
    random = np.random.default_rng(3)
    for n in (3, 4, 12):
        angle = np.arange(1.0, n + 1.0) / 100.0
        moment = 0.5 * WRINKLING * angle / angle[-1] * (1.0 + 0.01 * random.normal(size=n))
        fit = fitted(angle, moment)
        slope, covariance = curve_fit(lambda theta, k: k * theta, angle, moment)
        assert fit.stiffness == pytest.approx(slope[0], rel=1e-7)  # the tolerance of curve_fit
        assert fit.stiffness_std == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-5)


def test_a_point_at_the_wrinkling_moment_has_wrinkled() -> None:
    """All numbers here are exact: the slope is 128, and its product with the last angle is the limit itself."""
    limit = inflated_beam.wrinkling_moment(2.0**14, 2.0**-4)
    angle = limit / 128.0 * np.array([0.25, 0.5, 0.75, 1.0])
    fit = fitted(angle, 128.0 * angle, pressure=2.0**14, radius=2.0**-4)
    assert fit.stiffness == 128.0
    assert (fit.n_linear, fit.n_saturated) == (3, 0)
    assert fit.mean_moment_above_wrinkling == limit


@pytest.mark.parametrize("pressure", [10e3, 20e3, 30e3, 40e3, 50e3, 60e3])
def test_a_tabulated_pressure_carries_its_own_moment(pressure: float) -> None:
    radius = next(r for r in np.linspace(0.05, 0.06, 50) if exact_pressure(pressure, r) == pressure)
    moment = pressure * inflated_beam.wrinkling_moment(1.0, radius)
    assert inflated_beam.required_tabulated_pressure(moment, radius) == pressure


def exact_pressure(pressure: float, radius: float) -> float:
    """The pressure back from its moment, which rounding may have changed."""
    return inflated_beam.required_pressure(pressure * inflated_beam.wrinkling_moment(1.0, radius), radius)


def test_a_moment_at_angle_zero_keeps_its_sign() -> None:
    angle = np.array([0.0, 0.01, 0.02, 0.03, 0.04])
    moment = np.array([1.5 * WRINKLING, 1.0, 2.0, 3.0, 4.0])
    assert fitted(angle, moment).mean_moment_above_wrinkling == 1.5 * WRINKLING


def test_points_of_one_angle_may_be_many_and_come_in_any_order(rng: np.random.Generator) -> None:
    """The knee may be among them: here at 0.03, where half of the points have slipped to the plateau."""
    angle = np.repeat([0.01, 0.02, 0.03, 0.2, 0.3], 8)
    moment = np.repeat([1.0, 2.0, 3.0, 10.0, 10.0], 8) * (1.0 + 1e-3 * rng.normal(size=40))
    fit = fitted(angle, moment)
    assert (fit.n_linear, fit.n_saturated) == (24, 16)
    moment[18:24:2] = 9.9
    fit = fitted(angle, moment)
    assert (fit.n_linear, fit.n_saturated) == (21, 19)
    for _ in range(5):
        order = rng.permutation(40)
        assert fitted(angle[order], moment[order]) == fit


def test_the_slope_is_that_of_its_own_points_where_the_last_of_them_wavers() -> None:
    """With the last point the slope is so steep that it is beyond wrinkling; without, it would be below."""
    angle, moment = np.array([0.02, 0.04, 0.06, 0.1]), np.array([3.8, 7.6, 11.4, 22.0])
    assert 190.0 * 0.1 < WRINKLING < (angle @ moment) / (angle @ angle) * 0.1
    fit = fitted(angle, moment)
    assert (fit.n_linear, fit.max_moment) == (3, None)
    assert fit.stiffness == pytest.approx(190.0, rel=1e-14)
    assert fit.stiffness_std < 1e-10


def test_small_stiffnesses_and_unit_angles_are_taken() -> None:
    """Three points are enough; nothing is special about a slope below 1 or a sum of squares of 1."""
    for angle, k in itertools.product([np.full(4, 0.5), np.array([0.1, 0.2, 0.3])], [1e-3, 0.5, 1.0]):
        fit = fitted(angle, k * angle)
        assert fit.stiffness == pytest.approx(k, rel=1e-14)
        assert fit.n_linear == len(angle)


@each_row(
    ("angle", "moment", "field", "told"),
    [
        ([0.0, 0.1, -0.2, 0.0], [0.0, 1.0, -2.0, 0.0], "angle", "at least three angles different from zero"),
        ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0], "moment", "of the same sign as the angle (the fitted slope is not positive)"),
        ([0.1, 0.2, 0.3], [-1.0, -2.0, -3.0], "moment", "of the same sign as the angle (the fitted slope is not positive)"),
        ([0.1, 0.2, 0.3, 0.4], [7.0, 14.0, 21.0, 28.0], "moment", "at least three loaded points below wrinkling at 20.53 N m"),
    ],
)
def test_what_cannot_be_fitted_is_told(angle: list[float], moment: list[float], field: str, told: str) -> None:
    with pytest.raises(ParameterError) as caught:
        fitted(np.array(angle), np.array(moment))
    assert caught.value.field == field
    assert np.array_equal(caught.value.value, angle if field == "angle" else moment)
    assert told in caught.value.requirement
