"""One inflated link: closed forms against quadrature, the paper's table, fits on data with a known answer."""

from __future__ import annotations

import numpy as np
import pytest

from softrobots import ParameterError, inflated_beam
from tests.support.oracles import PRINTED_WRINKLING_MOMENTS
from tests.support.tables import each_row

TUBE = {"length": 0.6, "radius": 0.055, "wall_thickness": 0.0005}


@pytest.mark.parametrize(("pressure", "printed"), PRINTED_WRINKLING_MOMENTS.items())
def test_wrinkling_moment_reproduces_table_3(pressure: float, printed: float) -> None:
    assert round(inflated_beam.wrinkling_moment(pressure, 0.055), 2) == printed


def test_required_pressure_of_the_papers_example() -> None:
    # (3) gives 42.7 kPa exactly for 17.51 N m, and 50 kPa is the first tabulated pressure above it.
    assert inflated_beam.required_pressure(17.51, 0.055) == pytest.approx(42.65e3, abs=10.0)
    assert inflated_beam.required_tabulated_pressure(17.51, 0.055) == 50e3
    assert inflated_beam.required_tabulated_pressure(30.0, 0.055) is None


@pytest.mark.parametrize(("pressure", "modulus"), [(10e3, 140.15e6), (60e3, 136.76e6)])
def test_young_modulus_reproduces_the_papers_range(pressure: float, modulus: float) -> None:
    mean = np.mean([row.stiffness for row in inflated_beam.TABLE_3])  # unrounded
    found = inflated_beam.young_modulus_from_stiffness(mean, pressure=pressure, **TUBE)
    assert found == pytest.approx(modulus, abs=0.005e6)  # two decimals of MPa


@pytest.mark.parametrize("pressure", [15e3, 25e3, 30e3, 35e3, 45e3])
def test_the_least_stiffness_that_has_a_modulus_has_a_positive_one(pressure: float) -> None:
    """Of two neighbouring numbers the smaller is refused; for these pressures its modulus would come out as exactly zero."""
    refused, taken = 1e-6, 1e3
    while (middle := 0.5 * (refused + taken)) not in (refused, taken):
        try:
            modulus = inflated_beam.young_modulus_from_stiffness(middle, pressure=pressure, **TUBE)
            taken = middle
        except ParameterError:
            refused = middle
    assert 0.0 < modulus < 1.0  # [Pa]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("seed", range(5))
def test_fit_recovers_known_parameters_within_three_standard_errors(seed: int, sign: float) -> None:
    random = np.random.default_rng(seed)
    true_k, true_max, noise, pressure = 169.44, 21.76, 0.15, 50e3
    angle = sign * np.linspace(0.0, 0.25, 400)
    clean = np.sign(angle) * np.minimum(true_k * np.abs(angle), true_max)
    fit = inflated_beam.fit_characterisation(angle, clean + noise * random.normal(size=400), pressure=pressure, radius=0.055)
    below = np.abs(angle) * true_k < inflated_beam.wrinkling_moment(pressure, 0.055)
    exact_std = noise / np.sqrt(np.count_nonzero(below)) / np.std(angle[below])  # of the slope of a line
    assert fit.stiffness == pytest.approx(true_k, abs=3 * exact_std)
    assert fit.stiffness_std == pytest.approx(exact_std, rel=0.2)  # a standard deviation from 200 points: 5 % at one sigma
    assert fit.max_moment == pytest.approx(true_max, abs=3 * noise / np.sqrt(fit.n_saturated))
    assert fit.wrinkling_moment == pytest.approx(20.53, abs=0.005)


@each_row("plateau", [21.76, 20.0, 12.0])
@each_row("noise", [0.2, 0.5, 1.0])
def test_noise_does_not_pull_the_slope(noise: float, plateau: float) -> None:
    """Over 100 noisy repetitions the mean slope is the true one, and errors are as large as the standard error says.

    The knee is chosen with the noise in it, which pulls by a fraction of a standard error: 0.5 is allowed.
    """
    angle, pulls = np.linspace(0.0, 0.25, 60), []
    for seed in range(100):
        moments = np.minimum(170.0 * angle, plateau) + noise * np.random.default_rng(seed).normal(size=60)
        fit = inflated_beam.fit_characterisation(angle, moments, pressure=50e3, radius=0.055, angle_offset=0.0)
        pulls.append((fit.stiffness - 170.0) / fit.stiffness_std)
        assert fit.max_moment == pytest.approx(plateau, abs=5 * noise / np.sqrt(fit.n_saturated))
    assert abs(np.mean(pulls)) < 0.6
    assert np.std(pulls) < 1.6  # a dozen points below the lowest plateau: Student's t, and a knee among them


def test_fit_without_saturation_says_so() -> None:
    angle = np.linspace(0.0, 0.1, 50)
    fit = inflated_beam.fit_characterisation(angle, 166.66 * angle, pressure=60e3, radius=0.055)
    assert (fit.max_moment, fit.mean_moment_above_wrinkling, fit.n_saturated) == (None, None, 0)
    assert fit.stiffness == pytest.approx(166.66, rel=1e-13)


def test_softening_is_not_a_plateau() -> None:
    """A slope that falls by a fifth while the moment still rises: no saturation, with and without noise."""
    angle = np.linspace(0.0, 0.08, 40)
    for noise in (0.0, 0.02, 0.1):
        moments = 170.0 * angle * (1 - 0.2 * angle / 0.08) + noise * np.random.default_rng(0).normal(size=40)
        assert inflated_beam.fit_characterisation(angle, moments, pressure=50e3, radius=0.055).max_moment is None


def test_plain_average_lies_below_the_plateau() -> None:
    angle = np.linspace(0.0, 0.3, 300)
    moments = inflated_beam.moment(angle, stiffness=150.0, max_moment=9.45)
    fit = inflated_beam.fit_characterisation(angle, moments, pressure=20e3, radius=0.055)
    assert fit.mean_moment_above_wrinkling < fit.max_moment == pytest.approx(9.45, rel=1e-12)


GOOD = {"pressure": 30e3, "young_modulus": 138e6, **TUBE}


@each_row(
    ("call", "field"),
    [
        (lambda: inflated_beam.wrinkling_moment(-1.0, 0.05), "pressure"),
        (lambda: inflated_beam.wrinkling_moment(1e4, 0.0), "radius"),
        (lambda: inflated_beam.wrinkling_moment(float("nan"), 0.05), "pressure"),
        (lambda: inflated_beam.required_pressure(-1.0, 0.05), "moment"),
        (lambda: inflated_beam.required_tabulated_pressure(float("inf"), 0.05), "moment"),
        (lambda: inflated_beam.deflection(0.7, 1.0, **GOOD), "position"),
        (lambda: inflated_beam.deflection([-0.1, 0.2], 1.0, **GOOD), "position"),
        (lambda: inflated_beam.deflection(0.1, float("nan"), **GOOD), "force"),
        (lambda: inflated_beam.deflection(0.1, 1.0, **(GOOD | {"poisson_ratio": 0.6})), "poisson_ratio"),
        (lambda: inflated_beam.deflection(0.1, 1.0, **(GOOD | {"wall_thickness": 0.02})), "wall_thickness"),
        (lambda: inflated_beam.deflection(0.1, 1.0, **(GOOD | {"length": -0.6})), "length"),
        (lambda: inflated_beam.stiffness_from_young_modulus(0.0, pressure=1e4, **TUBE), "young_modulus"),
        (lambda: inflated_beam.young_modulus_from_stiffness(-5.0, pressure=1e4, **TUBE), "stiffness"),
        (lambda: inflated_beam.young_modulus_from_stiffness(1e-3, pressure=6e4, **TUBE), "stiffness"),
        (lambda: inflated_beam.moment([0.1, float("inf")], stiffness=170.0, max_moment=20.0), "angle"),
        (lambda: inflated_beam.moment(0.1, stiffness=0.0, max_moment=20.0), "stiffness"),
        (lambda: inflated_beam.moment(0.1, stiffness=170.0, max_moment=-1.0), "max_moment"),
        (lambda: inflated_beam.fit_characterisation([0.1, 0.2], [1.0], pressure=1e4, radius=0.05), "moment"),
        (lambda: inflated_beam.fit_characterisation([0.1, 0.2], [1.0, 2.0], pressure=1e4, radius=0.05), "angle"),
        (lambda: inflated_beam.fit_characterisation([0.1, 0.2, 0.3], [-1.0, -2.0, -3.0], pressure=1e4, radius=0.05), "moment"),
        (lambda: inflated_beam.fit_characterisation([0.1], [1.0], pressure=0.0, radius=0.05), "pressure"),
    ],
)
def test_bad_input_is_refused(call, field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        call()
    assert caught.value.field == field
