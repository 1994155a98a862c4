"""Self-contact of helical tubes: against points, walls and high precision that know nothing of the closed form."""

from __future__ import annotations

import cmath
import math
import pickle
import re
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.distance import cdist

from softrobots import ParameterError, SoftRobotsError, helix
from softrobots.core.errors import OutputExists, SelfIntersection
from studies.papers import helix_grid
from tests.support.laws import law
from tests.support.tables import each_row

DIAMETER = 0.0331


def centre_line(contraction: float, angle: float) -> tuple[float, float]:
    """Radius and pitch of the centre line of a tube of diameter 1 (docs/theory.md 3.1, complex form)."""
    turned = cmath.rect(contraction, 2.0 * angle)
    found = 0.5 * (1.0 + turned) / (1.0 - turned)
    return found.real, found.imag


def curve(radius: float, pitch: float, s: np.ndarray) -> np.ndarray:
    return np.stack([radius * np.cos(s), radius * np.sin(s), pitch * s], axis=-1)


def first_extremes(radius: float, pitch: float) -> tuple[float, float, float] | None:
    """Turn angle of the first local maximum and minimum of the distance from one point to the others, and that minimum."""

    def distance(s: float) -> float:
        return float(np.linalg.norm(curve(radius, pitch, np.array(s)) - [radius, 0.0, 0.0]))

    s = np.linspace(0.01, 7.0, 1501)
    apart = np.linalg.norm(curve(radius, pitch, s) - [radius, 0.0, 0.0], axis=-1)
    inner = np.arange(1, s.size - 1)
    lows = inner[(apart[1:-1] < apart[:-2]) & (apart[1:-1] <= apart[2:])]
    highs = inner[(apart[1:-1] > apart[:-2]) & (apart[1:-1] >= apart[2:])]
    if not lows.size:
        return None

    def polished(index: int, sign: float) -> float:
        bounds = (s[index - 1], s[index + 1])
        return float(minimize_scalar(lambda x: sign * distance(x), bounds=bounds, method="bounded", options={"xatol": 1e-12}).x)

    nearest = polished(int(lows[0]), 1.0)
    return polished(int(highs[0]), -1.0), nearest, distance(nearest)


def nearest_over_wall(contraction: float, angle: float) -> float:
    """Least distance from the wall of one section to the centre line, less the radius of the wall; diameter 1.

    Zero, from the centre of the section itself, if the tube does not run into itself; the sampling can only give too much.
    """
    radius, pitch = centre_line(contraction, angle)
    s = np.linspace(-2.5 * np.pi, 2.5 * np.pi, 8001)  # 0 is among them
    tangent = np.array([0.0, radius, pitch]) / math.hypot(radius, pitch)
    normal = np.array([-1.0, 0.0, 0.0])
    around = np.linspace(0.0, 2.0 * np.pi, 121)[:, None]
    wall = [radius, 0.0, 0.0] + 0.5 * (np.cos(around) * normal + np.sin(around) * np.cross(tangent, normal))
    return float(cdist(wall, curve(radius, pitch, s)).min()) - 0.5


CASES = [(lam, deg) for lam in (0.05, 0.3, 0.5, 0.66, 0.8, 0.97) for deg in (0.3, 2.5, 5.0, 10.0, 30.0, 50.0, 70.0)]


@each_row(("contraction", "degrees"), CASES)
def test_turn_distance_is_the_local_minimum_over_points(contraction: float, degrees: float) -> None:
    angle = math.radians(degrees)
    found = helix.self_contact(helix.forward(contraction, angle, DIAMETER))
    radius, pitch = centre_line(contraction, angle)
    expected = first_extremes(DIAMETER * radius, DIAMETER * pitch)
    assert bool(found.has_neighbours) == (expected is not None)
    if expected is None:
        assert float(found.turn_angle) == 2.0 * math.pi
        assert float(found.turn_distance) == pytest.approx(2.0 * math.pi * DIAMETER * pitch, rel=1e-12)
    else:
        assert float(found.turn_distance) == pytest.approx(expected[2], rel=1e-12)  # stationary: the angle enters squared
        assert float(found.turn_angle) == pytest.approx(expected[1], abs=1e-5)  # a minimiser sees half of the digits
    assert float(found.turn_clearance) == pytest.approx(float(found.turn_distance) - DIAMETER, abs=1e-16)


@pytest.mark.parametrize(
    ("contraction", "degrees"), [(0.3, 5.0), (0.5, 2.5), (0.5, 5.0), (0.66, 5.0), (0.3, 20.0), (0.1, 45.0)]
)
def test_no_pair_of_points_on_different_turns_is_nearer(contraction: float, degrees: float) -> None:
    """All pairs over three turns, beyond the hump of the distance that parts neighbouring turns from neighbouring points."""
    angle = math.radians(degrees)
    radius, pitch = centre_line(contraction, angle)
    extremes = first_extremes(radius, pitch)
    assert extremes is not None
    s = np.linspace(0.0, 6.0 * np.pi, 1201)
    points = curve(radius, pitch, s)
    apart = cdist(points, points)[np.abs(s[:, None] - s) >= extremes[0]]
    found = float(helix.self_contact(helix.forward(contraction, angle, 1.0)).turn_distance)
    assert apart.min() >= found * (1.0 - 1e-12)
    assert apart.min() == pytest.approx(found, rel=2e-3)  # points lie up to 0.008 rad beside the minimum


@law("helix.self_contact")
@given(st.floats(0.02, 0.999), st.floats(1e-4, 1.57))
def test_the_distance_is_stationary_and_convex_where_turns_are_nearest(contraction: float, angle: float) -> None:
    found = helix.self_contact(helix.forward(contraction, angle, 1.0))
    radius, pitch = centre_line(contraction, angle)
    s = np.linspace(1e-3, 2.0 * np.pi, 4001)
    slope = radius**2 * np.sin(s) + pitch**2 * s  # half the derivative of the squared distance
    if not found.has_neighbours:
        assert slope.min() > -1e-9 * radius**2  # the distance never falls
        return
    at = float(found.turn_angle)
    assert radius**2 * math.sin(at) + pitch**2 * at == pytest.approx(0.0, abs=1e-12 * radius**2)  # angle to the last digits
    assert radius**2 * math.cos(at) + pitch**2 > -1e-7 * radius**2  # zero where minimum and maximum merge: a square root
    assert float(found.turn_distance) == pytest.approx(
        math.sqrt(2 * radius**2 * (1 - math.cos(at)) + (pitch * at) ** 2), rel=1e-7
    )


@pytest.mark.parametrize("degrees", [1.0, 2.5, 5.0, 10.0, 30.0, 45.0, 50.0, 52.0, 60.0, 75.0])
def test_walls_meet_just_below_the_limit_and_not_above(degrees: float) -> None:
    angle = math.radians(degrees)
    limit = float(helix.contraction_limit(angle))
    assert nearest_over_wall(limit + 0.02 * (1.0 - limit), angle) > -1e-12
    assert nearest_over_wall(limit - 0.02 * (1.0 - limit), angle) < -1e-5
    assert not helix.self_contact(helix.forward(limit + 0.02 * (1.0 - limit), angle, DIAMETER)).touches
    assert helix.self_contact(helix.forward(limit - 0.02 * (1.0 - limit), angle, DIAMETER)).touches


@each_row("degrees", [2.5, 10.0, 40.0, 48.0, 55.0, 70.0])
@each_row("contraction", [0.05, 0.15, 0.25, 0.4, 0.6, 0.85, 0.98])
def test_contact_is_found_where_walls_meet(contraction: float, degrees: float) -> None:
    angle = math.radians(degrees)
    found = helix.self_contact(helix.forward(contraction, angle, DIAMETER))
    assert bool(found.touches) == (nearest_over_wall(contraction, angle) < -1e-6)


@pytest.mark.parametrize(("degrees", "exact", "simple"), [(2.5, 0.4882, 0.4871), (5.0, 0.3739, 0.3719), (10.0, 0.2689, 0.2658)])
def test_limits_of_theory(degrees: float, exact: float, simple: float) -> None:
    assert round(float(helix.contraction_limit(math.radians(degrees), DIAMETER)), 4) == exact
    assert round(float(helix.simple_contraction_limit(math.radians(degrees))), 4) == simple


@pytest.mark.parametrize("degrees", [1e-6, 0.01, 1.0, 2.5, 5.0, 10.0, 20.0, 34.85, 45.0, 50.0, 50.64])
def test_turns_just_touch_at_the_limit_to_twelve_digits(degrees: float) -> None:
    """Contraction and turn angle solved together in 40 digits: the distance is stationary, and the diameter."""
    angle = math.radians(degrees)
    start = float(helix.contraction_limit(angle))
    with mp.workdps(40):

        def equations(contraction: Any, s: Any) -> tuple[Any, Any]:
            turned = contraction * mp.exp(2j * mp.mpf(angle))
            found = (1 + turned) / (1 - turned) / 2
            radius, pitch = found.real, found.imag
            slope = mp.sin(s) / s + (pitch / radius) ** 2
            return slope, 2 * radius**2 * (1 - mp.cos(s)) + (pitch * s) ** 2 - 1

        at = float(helix.self_contact(helix.forward(start, angle, 1.0)).turn_angle)
        solved = mp.findroot(equations, (mp.mpf(round(start, 9)), mp.mpf(at)), tol=1e-50)
        assert abs(mp.mpf(start) - solved[0]) < 1e-12
        assert 4.4934 < solved[1] < 2 * mp.pi  # the minimum, not the maximum


@pytest.mark.parametrize("degrees", [50.66, 55.0, 55.92, 55.93, 60.0, 72.4, 80.0, 89.0, 89.99])
def test_steep_actuators_fold_first(degrees: float) -> None:
    """The centre line bends with the radius D/2 at the limit: curvature from the definition, kappa = R / (R^2 + b^2)."""
    angle = math.radians(degrees)
    limit = float(helix.contraction_limit(angle))
    radius, pitch = centre_line(limit, angle)
    assert radius / (radius**2 + pitch**2) == pytest.approx(2.0, rel=1e-6)
    assert limit == pytest.approx(-math.cos(2.0 * angle), abs=1e-15)
    below = helix.self_contact(helix.forward(limit - 1e-3 * (1.0 - limit), angle, 1.0))
    assert below.folding
    assert float(below.fold_margin) < 0.0


def test_both_conditions_meet_at_one_angle() -> None:
    """Turns decide below 50.65 degrees, the fold above."""

    def difference(angle: float) -> float:
        contraction = -math.cos(2.0 * angle)
        extremes = first_extremes(*centre_line(contraction, angle))
        assert extremes is not None
        return extremes[2] - 1.0

    crossing = brentq(difference, math.radians(49.0), math.radians(51.5), xtol=1e-12)
    assert math.degrees(crossing) == pytest.approx(50.65, abs=0.005)
    found = helix.self_contact(helix.forward(float(helix.contraction_limit(crossing)), crossing, 1.0))
    assert float(found.turn_clearance) == pytest.approx(0.0, abs=1e-9)
    assert float(found.fold_margin) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.01, 0.2, 0.6, 0.88, 0.885, 1.0, 1.3, 1.5])
def test_the_limit_itself_is_free_of_contact(angle: float) -> None:
    limit = float(helix.contraction_limit(angle))
    assert not helix.self_contact(helix.forward(limit, angle, DIAMETER)).touches
    # A millionth of the way down it is not: the tolerance of 1e-9 D hides nothing that matters.
    assert helix.self_contact(helix.forward(limit - 1e-6 * (1.0 - limit), angle, DIAMETER)).touches


def test_an_arc_in_a_plane_lies_on_itself_at_every_contraction_below_1() -> None:
    assert float(helix.contraction_limit(0.0)) == 1.0
    assert helix.self_contact(helix.forward([0.1, 0.5, 0.999], 0.0, DIAMETER)).touches.all()
    assert helix.self_contact(helix.forward([0.1, 0.5, 0.999], 0.0, DIAMETER)).turn_distance == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("angle", [1e-14, 1e-10, 1e-6])
def test_nearly_along_the_tube_the_limit_falls_with_the_root_of_the_angle(angle: float) -> None:
    """2 pi b = D with Rc = D/(1 - lambda), b = 2 theta D/(1 - lambda)^2: 1 - lambda = sqrt(4 pi theta) to first order."""
    first = math.sqrt(4.0 * math.pi * angle)
    assert 1.0 - float(helix.contraction_limit(angle)) == pytest.approx(
        first, rel=first + 1e-8
    )  # 1e-8: digits left in 1 - lambda


@pytest.mark.parametrize("degrees", [1e-3, 2.5, 10.0, 45.0, 60.0, 72.0, 72.3])
def test_a_turn_rises_by_the_diameter_at_the_simple_limit(degrees: float) -> None:
    angle = math.radians(degrees)
    limit = float(helix.simple_contraction_limit(angle))
    assert 2.0 * math.pi * centre_line(limit, angle)[1] == pytest.approx(1.0, rel=1e-9)
    assert all(2.0 * math.pi * centre_line(share, angle)[1] > 1.0 for share in np.linspace(limit, 0.9999, 50)[1:])
    assert all(2.0 * math.pi * centre_line(share, angle)[1] < 1.0 for share in np.linspace(0.001, limit, 50)[:-1])


@each_row("degrees", [0.0, 72.4, 80.0, 89.9])
def test_the_simple_rule_forbids_every_contraction_where_its_limit_is_1(degrees: float) -> None:
    angle = math.radians(degrees)
    assert float(helix.simple_contraction_limit(angle)) == 1.0
    assert all(2.0 * math.pi * centre_line(share, angle)[1] < 1.0 for share in np.linspace(0.001, 0.9999, 200))


def test_the_simple_rule_allows_a_little_too_much_until_the_fold() -> None:
    angles = np.radians([2.5, 5.0, 10.0, 45.0])
    too_much = helix.contraction_limit(angles) - helix.simple_contraction_limit(angles)
    assert np.round(too_much, 4).tolist() == [0.0011, 0.0020, 0.0032, 0.0115]
    angles = np.radians(np.linspace(0.001, 72.0, 200))
    assert np.all(helix.contraction_limit(angles) > helix.simple_contraction_limit(angles))
    assert helix.contraction_limit(math.radians(75.0)) < helix.simple_contraction_limit(
        math.radians(75.0)
    )  # it knows nothing of it


@pytest.mark.study
@law("helix.self_contact", "helix.contraction_limit")
@given(st.floats(0.02, 0.99), st.floats(0.001, 1.56), st.floats(1e-3, 1e3))
def test_contact_scales_with_the_diameter(contraction: float, angle: float, factor: float) -> None:
    one = helix.self_contact(helix.forward(contraction, angle, DIAMETER))
    other = helix.self_contact(helix.forward(contraction, angle, factor * DIAMETER))
    if abs(contraction - float(helix.contraction_limit(angle))) > 1e-6:
        assert bool(one.touches) == bool(other.touches)
    if bool(one.has_neighbours) == bool(other.has_neighbours):  # rounding may decide where minimum and maximum merge
        assert float(other.turn_distance) == pytest.approx(factor * float(one.turn_distance), rel=1e-10)
        assert float(other.turn_angle) == pytest.approx(float(one.turn_angle), abs=1e-6)
    assert float(other.curvature) == pytest.approx(float(one.curvature) / factor, rel=1e-10)
    assert float(other.fold_margin) == pytest.approx(float(one.fold_margin), abs=1e-9 / (1.0 - contraction))


def test_the_limit_has_the_common_shape_and_ignores_the_diameter() -> None:
    found = helix.contraction_limit(np.radians([[2.5], [5.0]]), [0.01, 0.0331, 1.0])
    assert found.shape == (2, 3)
    assert np.array_equal(found, np.repeat(found[:, :1], 3, axis=1))
    assert helix.contraction_limit(0.1).shape == ()
    assert helix.simple_contraction_limit(np.zeros((2, 0))).shape == (2, 0)


@pytest.mark.parametrize(("degrees", "share"), [(2.5, 0.8303), (5.0, 0.6946), (10.0, 0.5065)])
def test_steep_helices_have_no_neighbouring_turns(degrees: float, share: float) -> None:
    """The distance from a point rises all along the curve from these contractions on; looked at over points."""
    angle = math.radians(degrees)
    assert first_extremes(*centre_line(share - 5e-4, angle)) is not None
    assert first_extremes(*centre_line(share + 5e-4, angle)) is None
    below = helix.self_contact(helix.forward(share - 1e-4, angle, DIAMETER))
    above = helix.self_contact(helix.forward(np.linspace(share + 1e-4, 1.0, 50), angle, DIAMETER))
    assert below.has_neighbours
    assert not above.has_neighbours.any()
    assert not above.touches.any()
    assert np.isfinite([above.turn_angle, above.turn_distance, above.turn_clearance, above.curvature, above.fold_margin]).all()


@pytest.mark.parametrize("degrees", [0.5, 5.0, 45.0, 75.0, 89.0])
def test_the_straight_tube_touches_nothing(degrees: float) -> None:
    """Also where its actuator winds so steeply that a turn rises by less than a diameter."""
    found = helix.check_self_contact(helix.forward(1.0, math.radians(degrees), DIAMETER))
    assert not found.touches
    assert not found.has_neighbours
    assert (float(found.curvature), float(found.fold_margin)) == (0.0, 1.0)


@pytest.mark.parametrize(("radius", "pitch"), [(1e-30, 1e-33), (1e20, 1e-25), (1e29, 1e29), (1e25, 1e2), (0.6, 1e-29)])
def test_extreme_sizes_stay_finite(radius: float, pitch: float) -> None:
    diameter = 0.5 * radius
    found = helix.self_contact(helix.HelixShape(radius + diameter, radius, pitch), [0.5, 1.0, math.inf])
    for values in (found.turn_angle, found.turn_distance, found.turn_clearance, found.curvature, found.fold_margin):
        assert np.isfinite(values).all()


@pytest.mark.parametrize("slope", [1e-24, 1e-15, 1e-8, 1e-3])
def test_flat_helices_are_a_rise_apart(slope: float) -> None:
    """d = 2 pi b sqrt(1 - (b/Rc)^2 + ...): the minimum is not lost to rounding however flat the helix is."""
    found = helix.self_contact(helix.HelixShape(1.1, 0.9, slope), [1.0, math.inf])
    assert found.turn_distance == pytest.approx(2.0 * math.pi * slope, rel=2.0 * slope**2 + 1e-14)


@pytest.mark.parametrize("slope", [1e-6, 0.01, 0.1, 0.2, 0.216, 0.217, 0.21723, 0.2172336])
def test_the_angle_between_turns_up_to_where_the_minimum_vanishes(slope: float) -> None:
    """Root of sin(s)/s = -(b/Rc)^2 between the first root of tan(s) = s above pi and 2 pi; 30 digits."""
    pitch = math.sqrt(slope)
    found = helix.self_contact(helix.HelixShape(1.5, 0.5, pitch))
    with mp.workdps(30):
        merged = mp.findroot(lambda s: mp.tan(s) - s, 4.49)
        rest = lambda s: mp.sin(s) / s + mp.mpf(pitch) ** 2  # noqa: E731
        expected = float(mp.findroot(rest, (merged, 2 * mp.pi), solver="anderson", tol=1e-40))
    assert found.has_neighbours
    # rounding of the slope over the derivative of sin(s)/s, which vanishes at the end
    assert float(found.turn_angle) == pytest.approx(expected, abs=4e-15 + 4e-15 / math.sqrt(0.2172337 - slope))


# Short tubes


@pytest.mark.parametrize("contraction", [0.3, 0.6, 0.9])
def test_the_ends_of_a_planar_arc_meet_when_their_chord_is_a_diameter(contraction: float) -> None:
    radius, _ = centre_line(contraction, 0.0)
    meeting = 1.0 - math.asin(0.5 / radius) / math.pi  # 2 Rc sin(pi turns) = D, beyond half a turn
    counts = np.array([0.01, 0.4, meeting - 1e-6, meeting + 1e-6, 1.0, 1.5, math.inf])
    found = helix.self_contact(helix.forward(contraction, 0.0, DIAMETER), counts)
    assert found.touches.tolist() == [False, False, False, True, True, True, True]


@each_row(("contraction", "degrees"), [(0.3, 5.0), (0.45, 2.5), (0.2, 10.0), (0.6, 1.0), (0.15, 30.0), (0.66, 5.0)])
@each_row("count", [0.3, 0.6, 0.75, 0.85, 0.93, 0.97, 1.0, 2.0])
def test_short_tubes_have_what_their_length_allows(contraction: float, degrees: float, count: float) -> None:
    """All pairs of points of the tube that are farther along it than the hump of the distance."""
    angle = math.radians(degrees)
    radius, pitch = centre_line(contraction, angle)
    extremes = first_extremes(radius, pitch)
    assert extremes is not None
    found = helix.self_contact(helix.forward(contraction, angle, 1.0), count)
    s = np.linspace(0.0, 2.0 * np.pi * count, 801)
    apart = cdist(curve(radius, pitch, s), curve(radius, pitch, s))[np.abs(s[:, None] - s) >= extremes[0]]
    assert bool(found.has_neighbours) == bool(apart.size)
    if apart.size:
        assert float(found.turn_distance) == pytest.approx(apart.min(), rel=3e-3)  # points up to 0.016 rad apart
        assert bool(found.touches) == bool(apart.min() < 1.0)


def test_a_planar_arc_comes_round_from_half_a_turn_on() -> None:
    """There its ends are as far from each other as they can be."""
    arc = helix.forward(0.5, 0.0, DIAMETER)
    found = helix.self_contact(arc, np.array([0.25, math.nextafter(0.5, 0.0), 0.5, 0.75]))
    assert found.has_neighbours.tolist() == [False, False, True, True]
    assert found.turn_distance[2] == pytest.approx(2.0 * arc.centre_radius, rel=1e-15)


def test_a_fold_needs_no_length() -> None:
    assert helix.self_contact(helix.forward(0.1, math.radians(60.0), DIAMETER), 0.01).folding


# What callers see


def test_results_are_read_only_arrays_of_the_common_shape() -> None:
    shape = helix.forward([0.3, 0.66, 1.0], math.radians(5.0), DIAMETER)
    found = helix.self_contact(shape, [[0.5], [math.inf]])
    for name in ("diameter", "has_neighbours", "turn_angle", "turn_distance", "curvature"):
        values = getattr(found, name)
        assert values.shape == (2, 3)
        assert not values.flags.writeable
    assert found.touches.tolist() == [[False, False, False], [True, False, False]]


def test_the_sentence_says_what_touches_and_by_how_much() -> None:
    shape = helix.forward(0.3, math.radians(5.0), DIAMETER)
    extremes = first_extremes(*(DIAMETER * size for size in centre_line(0.3, math.radians(5.0))))
    assert extremes is not None
    text = str(helix.self_contact(shape))
    numbers = [float(number) for number in re.findall(r"[\d.]+(?= m\b)", text)]
    assert "runs into itself" in text
    assert numbers == pytest.approx([extremes[2], DIAMETER - extremes[2], DIAMETER], rel=3e-3)  # three digits


@each_row(
    ("contraction", "degrees", "turns", "said"),
    [
        (0.66, 5.0, math.inf, "does not touch itself: the centre lines"),
        (0.9, 5.0, math.inf, "does not touch itself: it has no neighbouring turns"),
        (0.3, 5.0, 0.3, "does not touch itself: it has no neighbouring turns"),
        (0.45, 60.0, 0.3, "bends with a radius of"),
        (0.1, 60.0, math.inf, "less than the diameter of 0.0331 m, and its centre line bends"),
        ([0.66, 0.3, 0.2], 5.0, math.inf, "2 of 3 tubes run into themselves; the tightest, at index (2,): "),
        ([], 5.0, math.inf, "no tube"),
    ],
)
def test_every_kind_of_finding_is_said(contraction: Any, degrees: float, turns: float, said: str) -> None:
    found = helix.self_contact(helix.forward(contraction, math.radians(degrees), DIAMETER), turns)
    assert said in found.describe()
    assert str(found) == found.describe()


def test_contact_is_an_error_that_carries_the_finding() -> None:
    shape = helix.forward([0.3, 0.9], math.radians(5.0), DIAMETER)
    with pytest.raises(SelfIntersection, match="1 of 2 tubes run into themselves") as caught:
        helix.check_self_contact(shape)
    assert caught.value.contact.touches.tolist() == [True, False]
    assert isinstance(caught.value, SoftRobotsError)
    again = pickle.loads(pickle.dumps(caught.value))
    assert again.contact.touches.tolist() == [True, False]


def test_a_short_tube_passes_the_check_that_an_endless_one_fails() -> None:
    shape = helix.forward(0.3, math.radians(5.0), DIAMETER)
    assert not helix.check_self_contact(shape, 0.6).touches
    with pytest.raises(SelfIntersection):
        helix.check_self_contact(shape)


# Bad input

GOOD = helix.forward(0.66, math.radians(5.0), DIAMETER)


@each_row("turns", [0.0, -1.0, math.nan, -math.inf, [math.inf, math.nan], "many", None, True, 1j, [[1.0], [1.0, 2.0]]])
def test_bad_turns_are_refused(turns: Any) -> None:
    with pytest.raises(ParameterError, match="turns"):
        helix.self_contact(GOOD, turns)


@each_row("check", [helix.self_contact, helix.check_self_contact])
@each_row("shape", [None, (0.08, 0.05, 0.03), "helix"])
def test_what_is_no_helix_is_refused(check: Any, shape: Any) -> None:
    with pytest.raises(ParameterError, match="HelixShape"):
        check(shape)


def test_shapes_that_do_not_broadcast_are_refused() -> None:
    with pytest.raises(ParameterError, match="broadcast"):
        helix.self_contact(helix.forward([0.5, 0.6], 0.1, DIAMETER), [1.0, 2.0, 3.0])
    with pytest.raises(ParameterError, match="broadcast"):
        helix.contraction_limit([0.1, 0.2], [1.0, 1.0, 1.0])


@each_row("limit", [helix.contraction_limit, helix.simple_contraction_limit])
@each_row("angle", [-1e-9, 0.5 * math.pi, 2.0, math.nan, math.inf, "steep", None, [0.1, math.nan]])
def test_bad_angles_are_refused(limit: Any, angle: Any) -> None:
    with pytest.raises(ParameterError, match="angle"):
        limit(angle)


@each_row("diameter", [0.0, -0.03, math.nan, math.inf, "thick"])
def test_bad_diameters_are_refused(diameter: Any) -> None:
    with pytest.raises(ParameterError, match="diameter"):
        helix.contraction_limit(0.1, diameter)


# The table of the paper's grid


def test_the_papers_grid_is_realisable_and_follows_equation_12() -> None:
    rows = helix_grid.paper_grid().rows
    actuators = [(round(math.degrees(row.angle), 12), row.contraction) for row in rows]
    shares = (0.5, 0.6, 0.7, 0.8, 0.9)
    assert actuators == [(degrees, share) for degrees in (2.5, 5.0, 10.0) for share in shares] + [(5.0, 0.66)] * 2
    assert [row.diameter for row in rows] == pytest.approx([0.0331] * 16 + [0.08275], rel=1e-15)
    for row in rows:
        cosine, sine = math.cos(2.0 * row.angle), math.sin(2.0 * row.angle)
        scale = row.diameter / (1.0 + row.contraction**2 - 2.0 * row.contraction * cosine)
        assert row.outer_radius == pytest.approx(scale * (1.0 - row.contraction * cosine), rel=1e-12)
        assert row.inner_radius == pytest.approx(scale * row.contraction * (cosine - row.contraction), rel=1e-12)
        assert row.pitch == pytest.approx(scale * row.contraction * sine, rel=1e-12)
        assert row.realisable is (nearest_over_wall(row.contraction, row.angle) > -1e-9) is True
        assert row.realisable_by_simple_rule is (2.0 * math.pi * row.pitch >= row.diameter)


def test_the_grid_tells_where_there_are_neighbouring_turns() -> None:
    for row in helix_grid.paper_grid().rows:
        radius, pitch = centre_line(row.contraction, row.angle)
        extremes = first_extremes(row.diameter * radius, row.diameter * pitch)
        assert (row.turn_distance is None) == (extremes is None)
        if extremes is not None:
            assert row.turn_distance == pytest.approx(extremes[2], rel=1e-12)


def test_the_larger_tube_is_the_reference_two_and_a_half_times() -> None:
    one, large = helix_grid.paper_grid().rows[-2:]
    reference = (0.0854078008, 0.0523078008, 0.0279647090)  # docs/theory.md 3
    assert (one.outer_radius, one.inner_radius, one.pitch) == pytest.approx(reference, abs=5e-11)
    scaled = tuple(2.5 * size for size in reference)
    assert (large.outer_radius, large.inner_radius, large.pitch) == pytest.approx(scaled, abs=15e-11)


def test_a_table_says_what_cannot_be_built() -> None:
    table = helix_grid.shape_table([0.3, 0.3725, 0.38], math.radians(5.0), DIAMETER)
    assert [row.realisable for row in table.rows] == [False, False, True]
    assert [row.realisable_by_simple_rule for row in table.rows] == [False, True, True]  # between the two limits
    assert helix_grid.shape_table([], 0.1, DIAMETER).rows == ()


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    target = tmp_path / "grid.csv"
    target.write_text("mine")
    with pytest.raises(OutputExists):
        helix_grid.paper_grid().write_csv(target)
    assert target.read_text() == "mine"
    helix_grid.paper_grid().write_csv(target, overwrite=True)
    assert target.read_text().startswith("angle [rad]")
    with pytest.raises(ParameterError, match="path"):
        helix_grid.paper_grid().write_csv(3)  # type: ignore[arg-type]


def test_the_words_on_a_tube_hold_its_numbers() -> None:
    """Turns that overlap; a centre line that folds; both; neither; and a tube without neighbouring turns."""
    flat = helix.self_contact(helix.HelixShape(0.1, 0.06, 0.004))  # radius 0.08, diameter 0.04, rise of a turn 0.0251
    distance = minimize_scalar(lambda s: math.hypot(0.16 * math.sin(s / 2), 0.004 * s), bounds=(6.0, 6.3), method="bounded").fun
    apart = f"the centre lines of neighbouring turns are {distance:.4g} m apart"
    assert str(flat) == f"the tube runs into itself: {apart}, {0.04 - distance:.3g} m less than the diameter of 0.04 m"
    steep = helix.self_contact(helix.HelixShape(0.03, -0.01, 0.002))  # centre line of radius 0.01, bent a little less sharply
    radius = (0.01**2 + 0.002**2) / 0.01
    assert f"and its centre line bends with a radius of {radius:.4g} m, less than half the diameter of 0.04 m" in str(steep)
    assert str(steep).startswith("the tube runs into itself: the centre lines of neighbouring turns are ")
    alone = helix.self_contact(helix.HelixShape(0.1, 0.06, 0.08))
    assert str(alone) == "the tube does not touch itself: it has no neighbouring turns"
    free = helix.self_contact(helix.HelixShape(0.1, 0.06, 0.01))
    distance = minimize_scalar(lambda s: math.hypot(0.16 * math.sin(s / 2), 0.01 * s), bounds=(5.0, 6.3), method="bounded").fun
    apart = f"the centre lines of neighbouring turns are {distance:.4g} m apart"
    assert str(free) == f"the tube does not touch itself: {apart}, {distance - 0.04:.3g} m more than the diameter of 0.04 m"


def test_the_tightest_of_several_is_told() -> None:
    """By the gap over the diameter, or the fold where that is tighter or there are no neighbours, whatever the sizes are."""
    outer = np.array([0.1, 1.0, 0.1, 0.012])
    shapes = helix.HelixShape(outer, outer - np.array([0.04, 0.3, 0.04, 0.004]), [0.0053, 0.031, 0.08, 0.0004])
    contact = helix.self_contact(shapes)
    margin = np.where(contact.has_neighbours, (contact.turn_distance - shapes.diameter) / shapes.diameter, 1.0)
    assert contact.has_neighbours.tolist() == [True, True, False, True]
    worst = int(np.argmin(margin))
    assert worst != int(np.argmin(contact.turn_clearance))  # the largest tube overlaps by most metres
    told = helix.self_contact(helix.HelixShape(*(values[worst] for values in (outer, shapes.inner_radius, shapes.pitch))))
    count = np.count_nonzero(contact.touches)
    assert str(contact) == f"{count} of 4 tubes run into themselves; the tightest, at index ({worst},): {told}"


def test_no_tube_at_all_is_told() -> None:
    assert str(helix.self_contact(helix.HelixShape([], [], []))) == "there are no tubes"
