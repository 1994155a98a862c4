"""A section of constant strain as rigid joints: against scipy's and mpmath's matrix exponential and an analytic helix."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from softrobots.constant_curvature.screws import Screw
from softrobots.constant_curvature.strain_chain import JOINTS, SectionChain, in_range, joint_positions
from softrobots.constant_curvature.stumpff import stumpff
from softrobots.core.vectors import skew
from tests.support.oracles import central_difference
from tests.support.screw_motions import H, exact_screw, exact_stumpff, rotation, screw_matrix
from tests.support.tables import each_row

SIZES = (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, math.pi - 0.1)  # of the rotation over a section [rad]
UNIT = np.array([0.55, -0.72, 0.42]) / np.linalg.norm([0.55, -0.72, 0.42])  # bending in a slanted plane, with twist
STRETCH = 0.02  # [m], and as much is tested as compression

angles_ = st.floats(-1.2, 1.2)
sections_ = st.tuples(angles_, angles_, angles_, st.floats(-0.04, 0.1)).map(np.array)


def second_derivative(chain: SectionChain) -> np.ndarray:
    """Second derivative of the joint positions, shape (..., 6, 4, 4), from unit weights."""
    weights = (np.broadcast_to(unit, chain.positions.shape) for unit in np.eye(6))
    return np.stack([chain.curvature(unit) for unit in weights], axis=-3)


# --- Oracles: nothing here calls the package


def exact_joints(*arguments: Any) -> list[Any]:
    """The joint positions of docs/theory.md 2.4 from mpmath's exponential, at section coordinates x, y, twist, elongation."""
    pose = exact_screw(*arguments)
    px, py, pz = pose[0, 3], pose[1, 3], pose[2, 3]
    u1, u2 = mp.atan2(-py, pz), mp.atan2(px, mp.hypot(py, pz))
    about_x = mp.matrix([[1, 0, 0], [0, mp.cos(u1), -mp.sin(u1)], [0, mp.sin(u1), mp.cos(u1)]])
    about_y = mp.matrix([[mp.cos(u2), 0, mp.sin(u2)], [0, 1, 0], [-mp.sin(u2), 0, mp.cos(u2)]])
    turn = (about_x * about_y).T * pose[:3, :3]
    chord = mp.sqrt(px**2 + py**2 + pz**2)
    return [u1, u2, chord, mp.atan2(-turn[1, 2], turn[2, 2]), mp.asin(turn[0, 2]), mp.atan2(-turn[0, 1], turn[0, 0])]


@functools.cache
def exact_derivatives(z: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """First (6, 4) and second (6, 4, 4) derivative of `exact_joints`: central differences of step 1e-20 at 90 digits.

    Truncation is 1e-40 relative, rounding 1e-90 / 1e-40 in the second derivative: exact in double precision.
    """
    with mp.workdps(90):
        step = mp.mpf(10) ** -20

        @functools.cache
        def moved(steps: tuple[int, ...]) -> list[Any]:
            return exact_joints(*(mp.mpf(value) + count * step for value, count in zip(z, steps, strict=True)))

        def at(*places: int) -> list[Any]:
            steps = [0, 0, 0, 0]
            for place in places:
                steps[abs(place) - 1] += 1 if place > 0 else -1
            return moved(tuple(steps))

        first, second = np.zeros((6, 4)), np.zeros((6, 4, 4))
        for a in range(1, 5):
            first[:, a - 1] = [float((p - m) / (2 * step)) for p, m in zip(at(a), at(-a), strict=True)]
            for b in range(1, a + 1):
                corners = zip(at(a, b), at(a, -b), at(-a, b), at(-a, -b), strict=True)
                values = [float((pp - pm - mp_ + mm) / (4 * step**2)) for pp, pm, mp_, mm in corners]
                second[:, a - 1, b - 1] = second[:, b - 1, a - 1] = values
        return first, second


def chain_matrix(joints: Sequence[float]) -> np.ndarray:
    """Rx(u1) Ry(u2) Tz(c) Rx(r1) Ry(r2) Rz(r3), written out."""
    u1, u2, c, r1, r2, r3 = joints
    slide = np.eye(4)
    slide[2, 3] = c
    return rotation(0, u1) @ rotation(1, u2) @ slide @ rotation(0, r1) @ rotation(1, r2) @ rotation(2, r3)


def section(size: float, stretch: float = STRETCH) -> np.ndarray:
    return np.array([*(size * UNIT), stretch])


# --- Stumpff functions


ANGLES = (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.5, 0.999, 1.001, 3.0, math.pi, 6.0, 2 * math.pi, 6.32, 6.33, 7.0, 20.0, 50.0)


def test_stumpff_functions_of_no_number_are_none() -> None:
    assert stumpff(np.zeros((0, 3)), 5).shape == (6, 0, 3)


@pytest.mark.study
@pytest.mark.parametrize("highest", range(1, 8))
def test_stumpff_functions_are_those_of_the_series(highest: int) -> None:
    """Relative to `1/k!`, the value at zero: `c_k = 1/k! - x c_{k+2}` magnifies rounding by x / ((k + 1)(k + 2)) up to x = 40.

    Alone, and in one call in which the series and the sines serve different elements.
    """
    squares = np.array(ANGLES) ** 2
    together = stumpff(squares.reshape(1, -1), highest)
    assert together.shape == (highest + 1, 1, len(ANGLES))
    for k, (place, x) in itertools.product(range(highest + 1), enumerate(squares)):
        exact = exact_stumpff(k, float(x))
        magnified = 1.0 + min(float(x), 40.0) / ((k + 1) * (k + 2))
        for found in (together[k, 0, place], stumpff(np.array(x), highest)[k]):
            assert abs(found - exact) < 4 * 2.3e-16 * magnified / math.factorial(k), (k, math.sqrt(x))


def test_stumpff_functions_at_small_angles_are_exact_to_the_last_places() -> None:
    """Below an angle of 1 nothing cancels: two units in the last place of each value."""
    for angle in ANGLES[:7]:
        found = stumpff(np.array(angle**2), 7)
        for k in range(8):
            assert abs(found[k] - exact_stumpff(k, angle**2)) <= 2 * np.spacing(found[k]), (k, angle)


# --- The screw motion


@pytest.mark.study
@each_row("size", [*SIZES, math.pi, 4.0, 2 * math.pi, 9.0])
@each_row("unit", [UNIT, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
@each_row("stretch", [0.0, STRETCH, -STRETCH])
def test_screw_is_the_exponential(size: float, unit: np.ndarray, stretch: float) -> None:
    """mpmath's to ten units in the last place, a hundred about a whole turn, where the series of `stumpff` cancel most.

    And scipy's, which squares up to 5 times from norm 9, to a few hundred.
    """
    z = np.array([*(size * np.asarray(unit)), stretch])
    screw = Screw(z, H)
    with mp.workdps(50):
        exact = np.array(exact_screw(*map(mp.mpf, z.tolist())).tolist(), dtype=np.float64)
    for oracle, tolerance in ((exact, 2e-15 if size < 4.5 else 2e-14), (screw_matrix(z, H), 1e-13)):
        assert np.abs(screw.rotation - oracle[:3, :3]).max() < tolerance
        assert np.abs(screw.position - oracle[:3, 3]).max() < tolerance * H


@given(st.lists(sections_, min_size=1, max_size=5), st.floats(0.05, 2.0))
@settings(max_examples=50)
def test_many_screws_at_once_are_the_same_as_one_by_one(sections: list, h: float) -> None:
    z = np.array(sections)
    lengths = h * np.arange(1, len(z) + 1)
    together = Screw(z, lengths)
    for row, (one, length) in enumerate(zip(z, lengths, strict=True)):
        exact = screw_matrix(one, length)
        assert np.allclose(together.rotation[row], exact[:3, :3], atol=5e-15, rtol=0)
        assert np.allclose(together.position[row], exact[:3, 3], atol=5e-15 * length, rtol=0)


@pytest.mark.parametrize("size", SIZES)
def test_twists_are_the_integral_of_the_adjoint(size: float) -> None:
    """docs/theory.md 2.4: `T(x) = int_0^1 exp(-s ad_x) ds`, a corner of one larger exponential: ten units in the last place."""
    z = section(size)
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = skew(z[:3])
    adjoint[:3, 3:] = skew(np.array([0.0, 0.0, H + z[3]]))
    block = np.zeros((12, 12))
    block[:6, :6], block[:6, 6:] = -adjoint, np.eye(6)
    integral = expm(block)[:6, 6:]
    exact = integral[:, [3, 4, 5, 2]]  # rotations about x, y, z; elongation along z
    assert np.abs(Screw(z, H).twists() - exact).max() < 5e-15


@given(sections_, st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array))
@settings(max_examples=60)
def test_slope_of_the_twists(z: np.ndarray, covector: np.ndarray) -> None:
    """Central differences of step 1e-5: truncation 1e-10 / 6 times third derivatives of size 1, rounding 1e-16 / 1e-5."""

    def contracted(at: np.ndarray) -> np.ndarray:
        return covector @ Screw(at, H).twists()

    screw = Screw(z, H)
    assert np.allclose(screw.curvature(screw.twists(), covector), central_difference(contracted, z, 1e-5), atol=2e-10)


# --- The chain


@each_row("size", SIZES)
@each_row("unit", [UNIT, -UNIT, (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
@each_row("stretch", [0.0, STRETCH, -STRETCH])
def test_the_chain_carries_the_section_exactly(size: float, unit: np.ndarray, stretch: float) -> None:
    """Position and orientation. 1e-14 is some ten units in the last place of six products."""
    z = np.array([*(size * np.asarray(unit)), stretch])
    assert in_range(z, H)
    found, exact = chain_matrix(joint_positions(z, H)), screw_matrix(z, H)
    assert np.abs(found[:3, :3] - exact[:3, :3]).max() < 1e-14
    assert np.abs(found[:3, 3] - exact[:3, 3]).max() < 1e-14 * H


@given(
    st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.5, 2.0)).map(np.array),
    st.floats(0.01, 10.0),
)
@settings(max_examples=150)
def test_any_section_in_range_is_carried_exactly(strain: np.ndarray, h: float) -> None:
    """1e-12: near the end of the range `1/cos(u2)`, up to 1e3, magnifies rounding."""
    z = strain * [1, 1, 1, h]
    assume(in_range(z, h))
    found, exact = chain_matrix(joint_positions(z, h)), screw_matrix(z, h)
    assert np.abs(found[:3, :3] - exact[:3, :3]).max() < 1e-12
    assert np.abs(found[:3, 3] - exact[:3, 3]).max() < 1e-12 * h


def test_many_sections_at_once_are_the_same_as_one_by_one(rng: np.random.Generator) -> None:
    z = np.c_[rng.uniform(-1, 1, (12, 3)), rng.uniform(-0.03, 0.1, 12)].reshape(3, 4, 4)
    lengths = rng.uniform(0.1, 0.3, (3, 4))
    together = SectionChain(z, lengths)
    second = second_derivative(together)
    assert second.shape == (3, 4, 6, 4, 4)
    for place in np.ndindex(3, 4):
        assert np.allclose(chain_matrix(together.positions[place]), screw_matrix(z[place], lengths[place]), atol=1e-14, rtol=0)
        alone = SectionChain(z[place], lengths[place])
        assert np.allclose(together.first[place], alone.first, atol=1e-14, rtol=0)
        assert np.allclose(second[place], second_derivative(alone), atol=1e-13, rtol=0)


@pytest.mark.study
@pytest.mark.parametrize(
    ("size", "unit", "stretch"),
    [(size, UNIT, STRETCH) for size in SIZES]
    + [(size, UNIT, 0.0) for size in (0.0, 1e-9, 1.0)]
    + [(size, np.array([0.6, -0.8, 0.0]), STRETCH) for size in (0.0, 1e-9, 1.0, 2.0)],
)
def test_derivatives_are_exact_and_smooth_through_straight(size: float, unit: np.ndarray, stretch: float) -> None:
    """Against mpmath, bending alone and with twist; the inverse Jacobian of the chain magnifies rounding by tens."""
    z = np.array([*(size * unit), stretch])
    first, second = exact_derivatives(tuple(z.tolist()))
    found = SectionChain(z, H)
    assert np.abs(found.first - first).max() < 2e-14
    assert np.abs(second_derivative(found) - second).max() < 3e-13


def test_values_at_straight() -> None:
    """Half of the bending at each end, all of the stretch in the chord, all of the twist in the last joint."""
    found = SectionChain(np.zeros(4), H)
    assert np.array_equal(found.positions, [0, 0, H, 0, 0, 0])
    slopes = dict(u1=(0, 0.5), u2=(1, 0.5), c=(3, 1.0), r1=(0, 0.5), r2=(1, 0.5), r3=(2, 1.0))
    expected = np.zeros((6, 4))
    for row, name in enumerate(JOINTS):
        column, value = slopes[name]
        expected[row, column] = value
    assert np.allclose(found.first, expected, atol=1e-15, rtol=0)


weights_ = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array)


@given(sections_, weights_)
@settings(max_examples=60)
def test_second_derivative_against_differences_of_the_first(z: np.ndarray, weights: np.ndarray) -> None:
    """Any weights; the contraction of the whole second derivative; and symmetric, although nothing computes it so."""

    def slope(at: np.ndarray) -> np.ndarray:
        return weights @ SectionChain(at, H).first

    chain = SectionChain(z, H)
    curvature = chain.curvature(weights)
    assert np.allclose(curvature, central_difference(slope, z, 1e-5), atol=1e-8, rtol=0)
    assert np.allclose(curvature, np.einsum("j,jab->ab", weights, second_derivative(chain)), atol=1e-12, rtol=0)
    assert np.allclose(curvature, curvature.T, atol=1e-12, rtol=0)


def test_the_last_joint_turns_without_twist() -> None:
    """docs/theory.md 2.4: 18.4 degrees at 90 degrees of bending in azimuth 45, and none in the planes of the axes."""

    def last(azimuth: float) -> float:
        bending = math.pi / 2
        return math.degrees(joint_positions(bending * np.array([-math.sin(azimuth), math.cos(azimuth), 0.0, 0.0]), H)[5])

    assert round(abs(last(math.pi / 4)), 1) == 18.4
    assert last(0.0) == pytest.approx(0.0, abs=1e-13)
    assert last(math.pi / 2) == pytest.approx(0.0, abs=1e-13)


# --- Range


@each_row("azimuth", np.deg2rad(np.arange(0, 360, 15)))
def test_bending_in_any_azimuth_is_in_range_below_half_a_turn(azimuth: float) -> None:
    """The range ends where the chord points forwards by 1e-3 of itself, 0.1 degrees before 180."""

    def bent(degrees: float) -> np.ndarray:
        return math.radians(degrees) * np.array([-math.sin(azimuth), math.cos(azimuth), 0.0, 0.0])

    assert all(in_range(bent(degrees), H) for degrees in (0.0, 1.0, 90.0, 120.0, 170.0, 179.0))
    assert not any(in_range(bent(degrees), H) for degrees in (180.0, 181.0, 200.0, 270.0, 355.0))


def test_each_of_many_sections_has_the_whole_range() -> None:
    """Turns and chords are not added up: twenty are bent by 179.7 degrees; the chord of one alone is out of its range."""
    many = np.tile([math.radians(179.7), 0.0, 0.0, 0.0], (20, 1))
    assert in_range(many, H)
    many[:, 0] = 0.1
    assert in_range(many, H)
    for place in (0, 7, 19):
        one = many.copy()
        one[place, 0] = math.radians(179.95)
        assert not in_range(one, np.full(20, H))


@pytest.mark.parametrize("h", [1e-2, 1.0, 300.0])
def test_a_section_is_longer_than_a_thousandth_of_its_rest_length(h: float) -> None:
    for share, expected in ((5.0, True), (1.5, True), (0.0, True), (-0.998, True), (-0.9995, False), (-1.1, False)):
        assert in_range(np.array([0.1, 0.2, 0.0, share * h]), h) == expected


@given(st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_the_chord_has_the_same_angle_to_both_ends(rotation: list[float]) -> None:
    """By SciPy: why the range asks at one end only."""
    motion = expm(np.block([[skew(np.array(rotation)), np.array([[0.0], [0.0], [H]])], [np.zeros((1, 4))]]))
    assert motion[:3, 2] @ motion[:3, 3] == pytest.approx(motion[2, 3], abs=1e-14)


@pytest.mark.parametrize("degrees", [360.0, 365.0, 400.0, 450.0, 535.0, 720.0, 800.0])
def test_bending_beyond_a_turn_is_out_of_range(degrees: float) -> None:
    """At a turn there is no chord; beyond, it points forwards again, but `in_range` promises bending below 180 degrees."""
    for azimuth in np.deg2rad(np.arange(0, 360, 15)):
        z = math.radians(degrees) * np.array([-math.sin(azimuth), math.cos(azimuth), 0.0, 0.0])
        assert not in_range(z, H), np.rad2deg(azimuth)


@pytest.mark.parametrize(
    "z",
    [
        (0.0, 0.0, math.pi, 0.0),
        (0.0, 0.0, -math.pi, 0.0),
        (0.5, 0.2, 3.2, 0.0),
        (0.0, 0.0, 7.0, 0.0),
        (0.0, 0.0, 0.0, -H),
        (0.0, 0.0, 0.0, -2 * H),
        (0.3, 0.0, 0.1, -1.5 * H),
    ],
)
def test_sections_without_a_chain_are_out_of_range(z: tuple) -> None:
    assert not in_range(np.array(z), H)
    assert not in_range(np.array([np.zeros(4), z, np.zeros(4)]), np.full(3, H))


@each_row("place", range(4))
def test_what_is_no_number_is_out_of_range(place: int) -> None:
    z = np.zeros(4)
    z[place] = math.nan
    assert not in_range(z, H)


@given(st.floats(0.01, 3.1), st.floats(0.01, 3.1))
@settings(max_examples=200)
def test_range_with_twist(kappa: float, twist: float) -> None:
    """docs/theory.md 2.4: valid iff `kappa^2 sin(phi)/phi + tau^2 > 0`; that is `phi^2` times the share of the chord that
    points forwards, so it is asked a little away from its zero."""
    phi = math.hypot(kappa, twist)
    forwards = (kappa**2 * math.sin(phi) / phi + twist**2) / phi**2
    assume(abs(forwards) > 2e-3)
    for z in (np.array([kappa, 0.0, twist, 0.0]), np.array([0.6 * kappa, -0.8 * kappa, -twist, 0.05])):
        if twist <= 1.0:  # beyond, r3 may go past half a turn first
            assert in_range(z, H) == (forwards > 0)
        else:
            assert forwards > 0 or not in_range(z, H)


@pytest.mark.parametrize("z", [(-1.04252223, 1.50593692, -2.73687818, 0.0), (1.85474469, 1.97479562, 2.19416583, 0.0)])
def test_joint_positions_do_not_jump_in_range(z: tuple) -> None:
    """From straight on, in steps of 1/400, no joint moves by more than 0.1 rad a step: a jump is a whole turn of a joint."""
    path = np.linspace(0.0, 1.0, 401)[:, None] * np.array(z)
    inside = np.array([in_range(point, H) for point in path])
    steps = np.abs(np.diff(joint_positions(path[inside], H), axis=0))
    assert inside[:200].all()  # up to half of it at least
    assert steps.max() < 0.1


# --- A helix


@pytest.mark.parametrize(("curvature", "torsion"), [(12.4665, 5.0629), (12.4665, -5.0629), (2.0, 9.0), (20.0, 0.3)])
@pytest.mark.parametrize("stretch", [1.0, 1.15])
def test_sections_of_constant_twist_lie_on_a_helix(curvature: float, torsion: float, stretch: float) -> None:
    """Radius k/(k^2 + t^2), climb t/sqrt(k^2 + t^2) a length, axis along the Darboux vector (0, k, t): pure geometry.

    Curvature and torsion are those of the curve itself, per stretched length. Three turns and more in 40 sections;
    1e-13 is the rounding of 40 products.
    """
    count, h = 40, 0.05
    z = np.array([0.0, h * stretch * curvature, h * stretch * torsion, h * (stretch - 1.0)])
    step = chain_matrix(joint_positions(z, h))
    darboux = math.hypot(curvature, torsion)
    axis = np.array([0.0, curvature, torsion]) / darboux
    radius = curvature / darboux**2
    pose = np.eye(4)
    for number in range(1, count + 1):
        pose = pose @ step
        s = number * h * stretch
        turn = Rotation.from_rotvec(darboux * s * axis).as_matrix()
        point = radius * (np.eye(3)[0] - turn[:, 0]) + s * torsion / darboux * axis
        assert np.abs(pose[:3, 3] - point).max() < 1e-13
        assert np.abs(pose[:3, :3] - turn).max() < 1e-13


def test_every_oracle_of_this_file_agrees_with_the_others() -> None:
    """mpmath's joints in the product written out give scipy's exponential: the oracles share nothing but the equations."""
    for size in SIZES:
        z = section(size)
        with mp.workdps(50):
            joints = [float(joint) for joint in exact_joints(*map(mp.mpf, z.tolist()))]
        assert np.abs(chain_matrix(joints) - screw_matrix(z, H)).max() < 1e-14


@given(st.lists(sections_, min_size=1, max_size=4), st.lists(st.floats(-2.0, 2.0), min_size=16, max_size=16))
@settings(max_examples=60)
def test_the_velocity_product_is_the_derivative_of_the_joint_rates(sections: list, numbers: list[float]) -> None:
    z = np.array(sections)
    rates = np.array(numbers).reshape(4, 4)[: len(z)] * (1.0, 1.0, 1.0, H)
    chain = SectionChain(z, H)
    assume(chain.valid)

    def joint_rates(time: float) -> np.ndarray:
        return (SectionChain(z + time * rates, H).first @ rates[..., None])[..., 0]

    step = 1e-5
    expected = (joint_rates(step) - joint_rates(-step)) / (2.0 * step)
    assert np.abs(chain.velocity_product(rates) - expected).max() <= 1e-6 * max(1.0, np.abs(expected).max())
