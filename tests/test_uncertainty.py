"""Covariance, intervals and outliers of a linear fit, against closed forms and refits; combinations that no row tells apart."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import softrobots as sr
from softrobots.identification.gauges import find_gauges
from softrobots.identification.uncertainty import (
    Uncertainty,
    outliers,
    standardised_residuals,
    uncertainty_from_blocks,
    uncertainty_from_rows,
)

seeds_ = st.integers(0, 2**32 - 1)


def fitted(jacobian: np.ndarray, measured: np.ndarray, prior: Any = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates and residuals of the least squares with priors at 0, by the normal equations."""
    found = np.linalg.solve(jacobian.T @ jacobian + np.diag(np.broadcast_to(prior, jacobian.shape[1])), jacobian.T @ measured)
    return found, measured - jacobian @ found


# --- Rows


def test_a_straight_line_has_the_covariance_of_polyfit() -> None:
    rng = np.random.default_rng(1)
    x = np.linspace(0.0, 3.0, 12)
    y = 2.0 * x - 1.0 + 0.3 * rng.standard_normal(12)
    jacobian = np.vander(x, 2)
    _, residuals = fitted(jacobian, y)
    _, known = np.polyfit(x, y, 1, cov="unscaled")
    line, unknown = np.polyfit(x, y, 1, cov=True)
    assert uncertainty_from_rows(jacobian, residuals).covariance == pytest.approx(known, rel=1e-10)  # rounding
    found = uncertainty_from_rows(jacobian, residuals, std_known=False)
    assert found.covariance == pytest.approx(unknown, rel=1e-10)
    assert found.freedoms == pytest.approx(10.0)
    expected = stats.t.interval(0.95, 10, line, np.sqrt(np.diag(unknown)))
    assert found.intervals(line) == pytest.approx(np.array(expected).T, rel=1e-9)


def test_intervals_with_known_errors_are_normal_and_logarithmic_ones_are_ratios() -> None:
    found = uncertainty_from_rows(np.diag([10.0, 4.0]), np.zeros(2))
    low, high = stats.norm.interval(0.95)
    assert found.intervals([5.0, 5.0], [False, True]) == pytest.approx(
        np.array([[5.0 + low / 10.0, 5.0 + high / 10.0], [5.0 * np.exp(low / 4.0), 5.0 * np.exp(high / 4.0)]]), rel=1e-12
    )


def test_an_interval_with_hardly_a_degree_of_freedom_is_open_without_a_warning() -> None:
    """Student's t of 1e-5 degrees is beyond all numbers; pytest turns warnings into errors."""
    ends = Uncertainty(np.diag([0.2, 0.04, 0.0]), 1e-5, np.ones(3, dtype=bool)).intervals([1.0, 2.0, 3.0], [True, False, False])
    assert ends[0].tolist() == [0.0, np.inf]
    assert -ends[1, 0] == ends[1, 1] > 1e20
    assert ends[2].tolist() == [3.0, 3.0]


@given(seeds_)
@settings(max_examples=20, deadline=None)
def test_a_prior_is_a_row_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    jacobian, prior = rng.standard_normal((9, 3)), np.array([4.0, 0.0, 0.25])
    rows = np.vstack([jacobian, np.diag(np.sqrt(prior))])
    found = uncertainty_from_rows(jacobian, np.zeros(9), prior=prior)
    assert found.covariance == pytest.approx(np.linalg.inv(rows.T @ rows), rel=1e-8, abs=1e-12)  # condition up to 1e3
    assert found.correlation == pytest.approx(found.covariance / np.outer(found.std, found.std), abs=1e-12)


def test_an_estimate_with_prior_and_unknown_scale_scatters_as_told() -> None:
    """1000 draws of truth and noise: told and true mean squares of the errors are known to 3 and 5 %; with five rows, to count
    the parameter that the prior holds as a whole one would make the told one a third larger."""
    rng = np.random.default_rng(2)
    jacobian, prior = rng.standard_normal((5, 2)), np.array([25.0, 0.0])
    squares, told = [], []
    for _ in range(1000):
        truth = rng.standard_normal(2) / np.array([5.0, np.inf])
        found, residuals = fitted(jacobian, jacobian @ truth + rng.standard_normal(5), prior)
        squares.append((found - truth) ** 2)
        told.append(np.diag(uncertainty_from_rows(jacobian, residuals, prior=prior, std_known=False).covariance))
    assert np.mean(told, axis=0) == pytest.approx(np.mean(squares, axis=0), rel=0.15)


# --- Blocks


@given(seeds_, st.integers(2, 12))
@settings(max_examples=20, deadline=None)
def test_the_covariance_of_blocks_is_that_of_leaving_out_each_block(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    blocks = rng.permutation(np.repeat(np.arange(count), 6))
    jacobian, measured = rng.standard_normal((6 * count, 3)), rng.standard_normal(6 * count)
    centre, residuals = fitted(jacobian, measured)
    left_out = np.array([fitted(jacobian[blocks != one], measured[blocks != one])[0] for one in range(count)]) - centre
    expected = (count - 1) / count * left_out.T @ left_out
    found = uncertainty_from_blocks(jacobian, residuals, [f"pattern {one}" for one in blocks])
    assert found.covariance == pytest.approx(expected, rel=1e-6, abs=1e-10)  # one block may leave little to the others
    assert found.freedoms == count - 1
    again = uncertainty_from_blocks(5.0 * jacobian, 5.0 * residuals, blocks)
    assert again.covariance == pytest.approx(found.covariance, rel=1e-9)  # only ratios of the weights matter


def test_blocks_of_one_row_are_hc3() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0.0, 2.0, 15), rng.standard_normal(15)
    _, residuals = fitted(x[:, None], y)
    leverage = x**2 / (x @ x)
    hc3 = np.sum((x * residuals / (1.0 - leverage)) ** 2) / (x @ x) ** 2
    found = uncertainty_from_blocks(x[:, None], residuals, range(15))
    assert found.covariance[0, 0] == pytest.approx(14.0 / 15.0 * hc3, rel=1e-10)


def test_what_one_block_alone_tells_has_no_interval_by_blocks() -> None:
    rng = np.random.default_rng(4)
    blocks = np.repeat([0, 1, 2, 3], 5)
    jacobian = np.column_stack([rng.standard_normal(20), np.where(blocks == 2, rng.standard_normal(20), 0.0)])
    _, residuals = fitted(jacobian, rng.standard_normal(20))
    found = uncertainty_from_blocks(jacobian, residuals, blocks)
    assert found.determined.tolist() == [True, False]
    assert np.all(np.isinf(found.intervals([1.0, 1.0])[1]))
    assert np.all(np.isfinite(found.covariance))


# --- Rank


@given(seeds_)
@settings(max_examples=20, deadline=None)
def test_what_is_not_determined_is_held_and_the_others_do_not_feel_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = rng.standard_normal((20, 3)) * [1.0, 1e4, 1e-4]
    jacobian = np.column_stack([own, own[:, 2] * 7.0, np.zeros(20)])  # the last two are told from nothing
    found = uncertainty_from_rows(jacobian, np.zeros(20))
    assert found.determined.tolist() == [True, True, False, False, False]
    expected = np.linalg.inv(own.T @ own)
    ratio = found.covariance[:2, :2] / expected[:2, :2]
    assert ratio == pytest.approx(1.0, rel=1e-5)
    assert np.all(np.isfinite(found.covariance))
    assert np.all(np.isinf(found.std[2:]))
    assert np.all(np.isfinite(found.correlation))
    assert uncertainty_from_rows(jacobian, np.zeros(20), prior=[0, 0, 1.0, 1.0, 1.0]).determined.all()


# --- Outliers


def test_standardised_residuals_are_errors_of_the_prediction_without_the_row() -> None:
    """Leaving a row out changes its residual e to e / (1 - h), of variance 1 / (1 - h)."""
    rng = np.random.default_rng(5)
    jacobian, measured = rng.standard_normal((12, 3)), rng.standard_normal(12)
    _, residuals = fitted(jacobian, measured)
    expected = []
    for row in range(12):
        others = np.arange(12) != row
        without, _ = fitted(jacobian[others], measured[others])
        spread = 1.0 + jacobian[row] @ np.linalg.inv(jacobian[others].T @ jacobian[others]) @ jacobian[row]
        expected.append((measured[row] - jacobian[row] @ without) / np.sqrt(spread))
    scaled = np.array(expected) / (1.4826 * np.median(np.abs(expected)))
    assert standardised_residuals(jacobian, residuals) == pytest.approx(scaled, rel=1e-9)


def test_planted_outliers_are_found_and_hardly_any_other() -> None:
    """Without outliers 5 % of the fits name a row; of 200 that is 10, and 24 has a probability below 1e-4."""
    rng = np.random.default_rng(6)
    jacobian, false = rng.standard_normal((200, 4)), 0
    for _ in range(200):
        measured = rng.standard_normal(200)
        false += len(outliers(jacobian, fitted(jacobian, measured)[1])) > 0
        measured[17] += 20.0
        measured[90] -= 9.0
        assert outliers(jacobian, fitted(jacobian, measured)[1])[:2].tolist() == [17, 90]
    assert false < 24
    assert len(outliers(jacobian, 1e-12 * rng.standard_t(1.0, 200))) == 0  # rounding errors are none


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: uncertainty_from_rows(np.eye(3), np.zeros(3), std_known=False), "more rows than parameters"),
        (lambda: uncertainty_from_rows(np.eye(3), np.zeros(4)), r"residuals must be an array of shape \(3,\)"),
        (lambda: uncertainty_from_rows(np.full((3, 1), np.nan), np.zeros(3)), "finite numbers"),
        (lambda: uncertainty_from_rows(np.eye(3), np.zeros(3), prior=[1.0]), "one for each of the 3 parameters"),
        (lambda: uncertainty_from_rows(np.eye(3), np.zeros(3), prior=-1.0), "zero or positive"),
        (lambda: uncertainty_from_blocks(np.eye(3), np.zeros(3), ["a", "a", "a"]), "at least two different labels"),
        (lambda: uncertainty_from_blocks(np.eye(3), np.zeros(3), ["a", "b"]), "one label for each of the 3 rows"),
        (lambda: find_gauges(np.eye(3), []), r"shape \(n, 0\)"),
    ],
)
def test_what_does_not_fit_together_is_refused(call: Any, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        call()


# --- What cannot be told apart


class Named(NamedTuple):
    name: str
    unit: str
    value: float = 1.0
    logarithmic: bool = False


K1, K2 = Named("link[1].stiffness", "N m/rad", 200.0, True), Named("link[2].stiffness", "N m/rad", 300.0, True)
YAW, OFFSET = Named("base.rotation.z", "rad", 0.0), Named("motor[1].offset", "rad", 0.0)
PLACE, MARKER = Named("base.position.x", "m", 0.0), Named("marker.tip.offset.x", "m", 0.0)
RADIUS, WALL = Named("radius", "m", 0.05, True), Named("wall_thickness", "m", 0.001, True)
LOOSE = tuple(Named(f"tendon[{one}].tendon_pretension", "N", 5.0) for one in (1, 2, 3))
HINGE, REST = Named("hinge_offset", "m", 0.1), Named("first_length", "m", 0.2)


@pytest.mark.parametrize(
    ("parameters", "null", "kind", "words"),
    [
        ((K1, K2), (1.0, 1.0), "scale", "raising link[1].stiffness and link[2].stiffness by 1 %"),
        ((K1,), (1.0,), "scale", "raising link[1].stiffness by 1 %"),
        ((K1, K2), (1.0, -1.0), "product", "raising link[1].stiffness by 1 % and lowering link[2].stiffness by 1 %"),
        ((K1, LOOSE[0]), (1.0, 5.0), "scale", "by 1 % and tendon[1].tendon_pretension by 0.05 N"),
        ((RADIUS, WALL), (1.0, -1.0), "product", "only as a product"),
        ((RADIUS, WALL), (1.0, 1.0), "ratio", "only as a ratio"),
        ((RADIUS, WALL), (1.0, 2.0), "together", "raising radius by 0.5 % and wall_thickness by 1 %"),
        (
            (YAW, OFFSET),
            (1.0, -1.0),
            "azimuths",
            "raising base.rotation.z by 0.01 rad and lowering motor[1].offset by 0.01 rad",
        ),
        ((PLACE, MARKER), (1.0, -1.0), "place", "the place of the base against the offsets of markers"),
        (LOOSE, (1.0, 1.0, 1.0), "preloads", "by 0.05 N"),
        (LOOSE, (1.0, 1.0, -2.0), "preloads", "common and single ones"),
        ((HINGE, REST), (1.0, -1.0), "sum", "only as a sum"),
        ((HINGE, REST), (1.0, 1.0), "difference", "only as a difference"),
        ((WALL,), (1.0,), "alone", "almost no effect"),
    ],
)
def test_a_known_null_space_is_named(parameters: Any, null: Any, kind: str, words: str) -> None:
    """Two parameters more, that are told apart, stand before and after them."""
    rng = np.random.default_rng(7)
    direction = np.array(null)
    jacobian = 1e3 * rng.standard_normal((40, len(null) + 2))
    inside = jacobian[:, 1:-1]
    inside -= np.outer(inside @ direction, direction) / (direction @ direction)
    everything = (Named("density", "kg/m^3", 1.0, True), *parameters, Named("length", "m", 1.0, True))
    (found,) = find_gauges(jacobian, everything)
    assert found.kind == kind
    assert words in found.text
    assert set(found.names) == {one.name for one in parameters}
    ratio = found.steps / direction[np.array(found.members) - 1]
    assert ratio == pytest.approx(ratio[0], rel=1e-6)  # the null vector to the rounding of the Jacobian
    assert found.change < 1e-9
    assert find_gauges(jacobian, everything, prior=[0.0, 1e4] + [0.0] * len(null)) == ()


def test_of_many_members_six_are_named() -> None:
    """Those with the largest effect on predictions, and how many more there are."""
    effects = np.array([3.0, 12.0, 5.0, 11.0, 1.0, 10.0, 2.0, 9.0, 4.0, 8.0, 6.0, 7.0])  # of steps of 1
    rows = np.random.default_rng(5).standard_normal((40, 12))
    jacobian = (rows - rows.mean(axis=1, keepdims=True)) / np.linalg.norm(rows - rows.mean(axis=1, keepdims=True), axis=0)
    change = np.linalg.svd(jacobian)[2][-1] / effects
    (found,) = find_gauges(1e3 * jacobian * effects, [Named(f"m{int(one)}", "m") for one in effects])
    assert len(found.members) == 12
    assert found.steps / change[list(found.members)] == pytest.approx(found.steps[0] / change[found.members[0]], rel=1e-6)
    head, _, moves = found.text.partition(": only together")
    assert head == f"{', '.join(found.names[:6])} and 6 more"
    assert not set(found.names[6:]) & set(moves.split())
    assert "and 6 more as they follow, changes no prediction by more than" in moves


@given(seeds_, st.integers(1, 3))
@settings(max_examples=20, deadline=None)
def test_each_group_is_dependent_and_no_part_of_it(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    null = np.zeros((count, 9))
    for one in range(count):  # each in parameters of its own
        null[one, 3 * one : 3 * one + rng.integers(2, 4)] = 1.0
    null *= rng.uniform(0.5, 2.0, 9) * rng.choice([-1.0, 1.0], 9)
    jacobian = 1e3 * rng.standard_normal((60, 9))
    jacobian -= jacobian @ np.linalg.pinv(null) @ null
    found = find_gauges(jacobian, [Named(f"field_{one}", "-", 1.0, True) for one in range(9)])
    assert sorted(tuple(sorted(one.members)) for one in found) == [tuple(np.flatnonzero(row)) for row in null]
    for one in found:
        members = list(one.members)
        assert np.linalg.matrix_rank(jacobian[:, members], tol=1e-6) == len(members) - 1
        assert jacobian[:, members] @ one.steps == pytest.approx(0.0, abs=1e-9)
        assert np.max(np.abs(one.steps)) == pytest.approx(0.01)
    assert find_gauges(1e3 * rng.standard_normal((60, 9)), [Named(f"f{one}", "m") for one in range(9)]) == ()


def test_what_noise_hides_is_told_with_its_size() -> None:
    """A column of norm 0.2 of a logarithmic parameter: one standard deviation is 500 %; the same of a length of 1 m."""
    jacobian = np.zeros((4, 2))
    jacobian[0], jacobian[1] = (0.2, 0.0), (0.0, 50.0)
    (found,) = find_gauges(jacobian, (RADIUS, HINGE))
    assert found.names == ("radius",)
    assert found.change == pytest.approx(0.002)  # by 1 %
    assert "2.0e-03 standard deviations" in found.text


def test_what_noise_hides_is_no_scale() -> None:
    """A force tells the scale of a stiffness badly; and of two stiffnesses, one is told well, so that the scale is known."""
    badly = find_gauges([[0.2], [0.0]], (K1,))
    unseen = find_gauges([[0.0], [0.0]], (K1,))
    one_of_two = find_gauges([[0.0, 0.0], [0.0, 50.0]], (K1, K2))
    assert [[one.kind for one in found] for found in (badly, unseen, one_of_two)] == [["alone"], ["scale"], ["alone"]]
