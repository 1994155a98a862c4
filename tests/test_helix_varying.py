"""Tubes with a varying actuator: the closed helix, quadrature, matrix exponentials, Taylor series by mpmath, and lengths."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

from softrobots import helix
from softrobots.core.errors import ParameterError
from softrobots.helix import bent_tube
from tests.support.laws import law
from tests.support.tables import each_row

D = 0.0331
LENGTH = 1.5
FIVE = np.radians(5.0)


def share_wave(s: float) -> float:
    return 0.7 + 0.2 * float(np.sin(4.0 * s))


def angle_ramp(s: float) -> float:
    return 0.05 + 0.3 * s / LENGTH


# --- Oracles: nothing here calls the package


def strain(contraction: float, angle: float, sign: float) -> np.ndarray:
    """Motion per rest length of a tube with a constant actuator, from complex numbers: curvature and torsion of the centre."""
    zeta = contraction * np.exp(2j * angle)
    outer, inner = D / (1.0 - zeta), D * zeta / (1.0 - zeta)  # radius and i pitch
    centre = 0.5 * (outer + inner)
    along = abs(centre) / abs(outer) / np.cos(angle)  # the outer line keeps its length
    curvature, torsion = centre.real / abs(centre) ** 2, sign * centre.imag / abs(centre) ** 2
    turn = along * np.array([[0.0, -torsion, curvature], [torsion, 0.0, 0.0], [-curvature, 0.0, 0.0]])
    rate = np.zeros((4, 4))
    rate[:3, :3], rate[2, 3] = turn, along
    return rate


def path_length(points: np.ndarray, positions: np.ndarray) -> float:
    """Length of a sampled curve: Simpson's rule on the speed of a spline."""
    speed = np.linalg.norm(CubicSpline(positions, points)(positions, 1), axis=1)
    step = positions[1] - positions[0]
    return float(step / 3.0 * (speed[0] + 4.0 * speed[1:-1:2].sum() + 2.0 * speed[2:-1:2].sum() + speed[-1]))


# --- A constant actuator


@pytest.mark.parametrize("handedness", helix.HANDEDNESS)
@pytest.mark.parametrize(
    ("contraction", "angle"),
    [(0.66, FIVE), (0.9, 2.0 * FIVE), (0.5, 0.5 * FIVE), (0.4, 0.7), (0.66, 0.0), (1.0, FIVE), (0.999999, 1e-6), (0.05, 1.2)],
)
def test_a_constant_actuator_gives_the_closed_helix(contraction: float, angle: float, handedness: str) -> None:
    tube = bent_tube(contraction, angle, D, LENGTH, handedness=handedness)
    shape = helix.forward(contraction, angle, D)
    lengths = np.asarray(helix.centre_length(contraction, angle, LENGTH)) * tube.rest_positions / LENGTH
    s = helix.turn_angle(shape, lengths)
    axis_to_base = np.linalg.inv(helix.transform_base_to_axis(shape, handedness))
    # 1e-10 is asked for; a step of the integrator leaves 1e-12, and the tube turns by up to 90 rad.
    np.testing.assert_allclose(tube.poses, axis_to_base @ helix.frames(shape, s, "centre", handedness), rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(tube.arc_length, lengths, rtol=1e-12)
    for path in helix.PATHS:
        there = helix.points(shape, s, path, handedness) @ axis_to_base[:3, :3].T + axis_to_base[:3, 3]
        np.testing.assert_allclose(tube.points(path), there, rtol=0.0, atol=1e-10)
    curvature, torsion = helix.curvature_torsion(shape, "centre", handedness)
    np.testing.assert_allclose(tube.curvature, curvature, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(tube.torsion, torsion, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("given_", [1.0, lambda s: 1.0, ([0.0, 9.0], [1.0, 1.0])])
def test_the_straight_tube_stays_straight(given_: Any) -> None:
    tube = bent_tube(given_, 0.0, D, LENGTH, samples=11)
    expected = np.broadcast_to(np.eye(4), (11, 4, 4)).copy()
    expected[:, 2, 3] = np.linspace(0.0, LENGTH, 11)
    np.testing.assert_allclose(tube.poses, expected, rtol=0.0, atol=1e-15)
    assert not tube.curvature.any()
    assert not tube.torsion.any()


# --- A varying actuator


@pytest.mark.parametrize(
    "contraction", [share_wave, lambda s: 1.0 - 0.5 * s / LENGTH, lambda s: 1.0 - 0.4 * np.exp(-50.0 * (s - 0.7) ** 2)]
)
def test_a_straight_actuator_bends_in_a_plane(contraction: Callable[[float], float]) -> None:
    """x = int sin(phi) dL, z = int cos(phi) dL, phi = int (1 - lambda)/D ds, dL = (1 + lambda)/2 ds, by quadrature."""
    tube = bent_tube(contraction, 0.0, D, LENGTH, samples=7)

    def phi(s: float) -> float:
        return quad(lambda u: (1.0 - contraction(u)) / D, 0.0, s, epsabs=1e-11, limit=200)[0]

    for i in (1, 3, 6):
        end = tube.rest_positions[i]
        x = quad(lambda s: np.sin(phi(s)) * 0.5 * (1.0 + contraction(s)), 0.0, end, epsabs=1e-11, limit=200)[0]
        z = quad(lambda s: np.cos(phi(s)) * 0.5 * (1.0 + contraction(s)), 0.0, end, epsabs=1e-11, limit=200)[0]
        np.testing.assert_allclose(tube.points("centre")[i], [x, 0.0, z], rtol=0.0, atol=2e-10)
        bent = [[np.cos(phi(end)), 0.0, np.sin(phi(end))], [0.0, 1.0, 0.0], [-np.sin(phi(end)), 0.0, np.cos(phi(end))]]
        np.testing.assert_allclose(tube.poses[i, :3, :3], bent, rtol=0.0, atol=2e-10)


@pytest.mark.parametrize("handedness", helix.HANDEDNESS)
def test_a_stepped_actuator_is_a_product_of_matrix_exponentials(handedness: str) -> None:
    cuts = [0.0, 0.4, 0.9, 1.2, LENGTH]
    shares, angles = (0.6, 0.95, 0.95, 0.75), (0.1, 0.1, 0.3, 0.3)  # one jumps at 0.4 and 1.2, the other at 0.9
    share_table = ([0.0, 0.4, 0.4, 1.2, 1.2, LENGTH], [0.6, 0.6, 0.95, 0.95, 0.75, 0.75])
    angle_table = ([0.0, 0.9, 0.9, LENGTH], [0.1, 0.1, 0.3, 0.3])
    tube = bent_tube(share_table, angle_table, D, LENGTH, handedness=handedness, samples=16)
    places = [0, 4, 9, 12]
    sign, pose = (1.0 if handedness == "right" else -1.0), np.eye(4)
    for i in range(4):
        np.testing.assert_allclose(tube.poses[places[i]], pose, rtol=0.0, atol=1e-10)
        pose = pose @ expm((cuts[i + 1] - cuts[i]) * strain(shares[i], angles[i], sign))
    np.testing.assert_allclose(tube.poses[15], pose, rtol=0.0, atol=1e-10)


def test_a_varying_tube_solves_its_differential_equation_by_taylor_series() -> None:
    """Contraction and angle linear in the position; the series of mpmath at 25 digits, rotation matrices, no quaternion."""
    length = 0.12
    tube = bent_tube(lambda s: 0.9 - 3.0 * s, lambda s: 0.1 + 2.0 * s, D, length, samples=2)
    with mp.workdps(25):
        size = mp.mpf(D)

        def rate(s: Any, state: list[Any]) -> list[Any]:
            share, angle = mp.mpf(9) / 10 - 3 * s, mp.mpf(1) / 10 + 2 * s
            cosine = mp.cos(2 * angle)
            squared = 1 + share**2 + 2 * share * cosine  # |1 + zeta|^2
            along = mp.sqrt(squared) / (2 * mp.cos(angle))
            bending, twist = (
                along * 2 * (1 - share**2) / (size * squared),
                along * 4 * share * mp.sin(2 * angle) / (size * squared),
            )
            x, y, z = state[0:3], state[3:6], state[6:9]  # axes of the frame
            return [
                *(twist * b - bending * c for b, c in zip(y, z, strict=True)),
                *(-twist * a for a in x),
                *(bending * a for a in x),
                *(along * c for c in z),
            ]

        start = [mp.mpf(value) for value in (1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0)]
        end = mp.odefun(rate, 0, start, tol=mp.mpf(10) ** -16)(mp.mpf(length))
        expected = np.array([float(value) for value in end]).reshape(4, 3).T
    np.testing.assert_allclose(tube.poses[-1, :3], expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("handedness", helix.HANDEDNESS)
def test_lines_keep_their_lengths_wherever_the_actuator_varies(handedness: str) -> None:
    """Outer line 1/cos(theta), actuator lambda/cos(theta) per rest length: the paper's constraints, exact when varying too."""
    tube = bent_tube(share_wave, angle_ramp, D, LENGTH, handedness=handedness, samples=2001)
    s = tube.rest_positions
    outer = quad(lambda u: 1.0 / np.cos(angle_ramp(u)), 0.0, LENGTH, epsabs=1e-12)[0]
    inner = quad(lambda u: share_wave(u) / np.cos(angle_ramp(u)), 0.0, LENGTH, epsabs=1e-12)[0]
    # A spline of speed: (rotation of a step, 0.02 rad)^4 / 100
    assert path_length(tube.points("outer"), s) == pytest.approx(outer, abs=1e-8)
    assert path_length(tube.points("inner"), s) == pytest.approx(inner, abs=1e-8)
    assert path_length(tube.points("centre"), s) == pytest.approx(tube.arc_length[-1], abs=1e-8)
    tangents = [CubicSpline(s, line)(s, 1)[5:-5] for line in (tube.points("inner"), tube.points("outer"))]
    cosine = np.einsum("ij,ij->i", *(t / np.linalg.norm(t, axis=1, keepdims=True) for t in tangents))
    np.testing.assert_allclose(np.arccos(cosine), 2.0 * tube.angle[5:-5], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(tube.points("outer") - tube.points("inner"), axis=1), D, rtol=1e-12)


@pytest.mark.parametrize("contraction", [0.5, 0.66, 0.9])
@pytest.mark.parametrize("angle", [0.0, 2.0 * FIVE, 0.9])
def test_the_outer_line_of_a_constant_actuator_keeps_its_length(contraction: float, angle: float) -> None:
    tube = bent_tube(contraction, angle, D, 0.5, samples=2001)
    assert path_length(tube.points("outer"), tube.rest_positions) == pytest.approx(0.5 / np.cos(angle), abs=1e-7)


@law("helix.bent_tube")
@settings(max_examples=15, deadline=None)
@given(
    shares=st.lists(st.floats(0.3, 1.0), min_size=2, max_size=6),
    angles=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=6),
    handedness=st.sampled_from(helix.HANDEDNESS),
)
def test_frames_are_rotations_and_mirrored_by_handedness(shares: list[float], angles: list[float], handedness: str) -> None:
    tables = [(np.linspace(0.0, 0.4, len(values)), values) for values in (shares, angles)]
    tube = bent_tube(*tables, D, 0.4, handedness=handedness, samples=21)
    turn = tube.poses[:, :3, :3]
    np.testing.assert_allclose(np.swapaxes(turn, 1, 2) @ turn, np.broadcast_to(np.eye(3), turn.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(turn), 1.0, rtol=1e-14)
    np.testing.assert_array_equal(tube.poses[:, 3], np.broadcast_to([0.0, 0.0, 0.0, 1.0], (21, 4)))
    np.testing.assert_allclose(tube.poses[0], np.eye(4), atol=1e-15)
    other = bent_tube(*tables, D, 0.4, handedness=helix.HANDEDNESS[helix.HANDEDNESS[0] == handedness], samples=21)
    np.testing.assert_allclose(other.points("centre"), tube.points("centre") * [1.0, -1.0, 1.0], rtol=0.0, atol=1e-11)


def test_a_tube_is_the_start_of_a_longer_one_and_scales_with_the_diameter() -> None:
    half = bent_tube(share_wave, angle_ramp, D, 0.5 * LENGTH, samples=101)
    whole = bent_tube(share_wave, angle_ramp, D, LENGTH, samples=201)
    np.testing.assert_allclose(half.poses, whole.poses[:101], rtol=0.0, atol=1e-10)
    large = bent_tube(lambda s: share_wave(s / 2.5), lambda s: angle_ramp(s / 2.5), 2.5 * D, 2.5 * LENGTH, samples=201)
    np.testing.assert_allclose(large.points("centre"), 2.5 * whole.points("centre"), rtol=0.0, atol=1e-10)


def test_curvature_and_torsion_are_those_of_the_centre_line() -> None:
    """From derivatives of the sampled points by arc length, where the curve bends."""
    tube = bent_tube(share_wave, angle_ramp, D, LENGTH, samples=4001)
    curve = CubicSpline(tube.arc_length, tube.poses[:, :3, 2])  # the tangent
    turning = curve(tube.arc_length, 1)
    curvature = np.linalg.norm(turning, axis=1)
    np.testing.assert_allclose(curvature[5:-5], tube.curvature[5:-5], rtol=1e-5)
    binormal = CubicSpline(tube.arc_length, np.cross(tube.poses[:, :3, 2], turning / curvature[:, None]))
    torsion = -np.einsum("ij,ij->i", binormal(tube.arc_length, 1), tube.poses[:, :3, 0])
    np.testing.assert_allclose(torsion[20:-20], tube.torsion[20:-20], rtol=1e-3)


# --- Ways of saying it


def test_a_table_is_straight_between_its_rows() -> None:
    positions, shares, angles = [0.0, 0.3, 0.8, LENGTH], [0.9, 0.6, 0.7, 0.95], [0.1, 0.0, 0.2, 0.15]
    table = bent_tube((positions, shares), np.array([positions, angles]), D, LENGTH)
    share, angle = (lambda s: float(np.interp(s, positions, shares))), (lambda s: np.interp(s, positions, angles))
    for said in ((share, (positions, angles)), ((positions, shares), angle)):  # the other one's rows are where it has kinks
        np.testing.assert_allclose(table.poses, bent_tube(*said, D, LENGTH).poses, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(table.contraction, np.interp(table.rest_positions, positions, shares), rtol=1e-15)
    np.testing.assert_allclose(table.angle, np.interp(table.rest_positions, positions, angles), rtol=0.0, atol=1e-16)


def test_a_short_bend_in_a_straight_tube_is_not_stepped_over() -> None:
    """A pulse less than two diameters wide turns the tip by the integral of (1 - lambda)/D, at whatever place."""
    for place in (0.31, 3.1, 7.7):

        def pulse(s: float, at: float = place) -> float:
            return 1.0 - 0.5 * np.cos(np.pi * (s - at) / 0.06) ** 4 if abs(s - at) < 0.03 else 1.0

        tube = bent_tube(pulse, 0.0, D, 9.0, samples=2)
        tilt = 0.5 * 0.06 * 3.0 / 8.0 / D  # the mean of cos^4
        # The pulse has three continuous derivatives at its ends: there the error of a step is estimated less well.
        np.testing.assert_allclose(tube.poses[-1, :3, 2], [np.sin(tilt), 0.0, np.cos(tilt)], rtol=0.0, atol=1e-9)


def test_the_result_is_frozen() -> None:
    tube = bent_tube(0.66, FIVE, D, 0.1, samples=3)
    for name in (
        "rest_positions",
        "poses",
        "arc_length",
        "contraction",
        "angle",
        "curvature",
        "torsion",
    ):
        assert not getattr(tube, name).flags.writeable
    assert not tube.points("inner").flags.writeable
    with pytest.raises(FrozenInstanceError):
        tube.length = 1.0
    assert (tube.diameter, tube.length, tube.handedness) == (D, 0.1, "right")
    with pytest.raises(ParameterError, match="path"):
        tube.points("middle")


# --- Bad input


@each_row(
    ("function", "position", "said"),
    [
        (lambda s: 0.5 + s, 0.75, "in (0, 1]"),
        (lambda s: 0.5 - s, 0.75, "in (0, 1]"),
        (lambda s: float("nan") if s > 0.8 else 0.7, 1.5, "in (0, 1]"),
        (lambda s: np.array([0.5, 0.6]), 0.0, "one number"),
        (lambda s: [0.5], 0.0, "one number"),
        (lambda s: None, 0.0, "one number"),
        (lambda s: "half", 0.0, "one number"),
        (lambda s: True, 0.0, "one number"),
        (lambda s: 0.5 + 0j, 0.0, "one number"),
        (lambda: 0.5, 0.0, "TypeError"),
        (lambda s: 0.5 if s < 1.0 else 1 // 0, 1.5, "ZeroDivisionError"),
    ],
)
def test_a_function_without_an_acceptable_value_is_refused_with_the_position(
    function: Callable[..., Any], position: float, said: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        bent_tube(function, FIVE, D, LENGTH, samples=3)
    assert caught.value.field == "contraction"
    assert said in str(caught.value)
    assert f"at the position {position!r} m" in str(caught.value)


def test_a_hole_between_the_samples_is_found_by_the_integrator() -> None:
    with pytest.raises(ParameterError, match=r"angle = nan: .*at the position 0\.7\d+ m"):
        bent_tube(0.8, lambda s: float("nan") if 0.70 < s < 0.74 else 0.1, D, LENGTH, samples=2)


@pytest.mark.parametrize("value", [-0.1, 0.5 * np.pi, float("inf")])
def test_an_angle_out_of_range_is_refused(value: float) -> None:
    for given_ in (value, lambda s: value, ([0.0, LENGTH], [0.1, value])):
        with pytest.raises(ParameterError) as caught:
            bent_tube(0.8, given_, D, LENGTH)
        assert caught.value.field == "angle"


@each_row(
    ("change", "field"),
    [
        ({"contraction": 0.0}, "contraction"),
        ({"contraction": 1.01}, "contraction"),
        ({"contraction": None}, "contraction"),
        ({"contraction": "0.5"}, "contraction"),
        ({"contraction": True}, "contraction"),
        ({"contraction": [0.5, 0.6, 0.7]}, "contraction"),
        ({"contraction": ([0.0, LENGTH], [0.5])}, "contraction"),
        ({"contraction": ([0.0, LENGTH], [0.5, 1.5])}, "contraction"),
        ({"contraction": ([0.0, 1.0], [0.5, 0.6])}, "contraction positions"),  # ends too early
        ({"contraction": ([0.1, LENGTH], [0.5, 0.6])}, "contraction positions"),
        ({"contraction": ([0.0], [0.5])}, "contraction positions"),
        ({"contraction": ([0.0, 1.0, 0.5, LENGTH], [0.5, 0.6, 0.6, 0.6])}, "contraction positions"),
        ({"contraction": ([0.0, 0.0, LENGTH], [0.5, 0.6, 0.6])}, "contraction positions"),
        ({"contraction": ([0.0, LENGTH, LENGTH], [0.5, 0.6, 0.6])}, "contraction positions"),
        ({"contraction": ([0.0, 1.0, 1.0, 1.0, LENGTH], [0.5, 0.6, 0.7, 0.8, 0.8])}, "contraction positions"),
        ({"contraction": ([0.0, 5e-324, LENGTH], [0.5, 0.6, 0.7])}, "contraction positions"),
        ({"angle": ([0.0, float("nan")], [0.1, 0.2])}, "angle positions"),
        ({"diameter": 0.0}, "diameter"),
        ({"diameter": [D]}, "diameter"),
        ({"length": -1.0}, "length"),
        ({"length": float("nan")}, "length"),
        ({"length": 9000.0}, "length"),  # turns by more than 1e5 rad
        ({"handedness": "up"}, "handedness"),
        ({"samples": 1}, "samples"),
        ({"samples": 0}, "samples"),
        ({"samples": 10.0}, "samples"),
        ({"samples": None}, "samples"),
        ({"samples": 2_000_000}, "samples"),
        ({"samples": [0.1, 0.5]}, "samples"),
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ParameterError) as caught:
        bent_tube(**({"contraction": 0.66, "angle": FIVE, "diameter": D, "length": LENGTH} | change))
    assert caught.value.field == field


def test_a_function_that_is_nowhere_smooth_ends_with_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("softrobots.helix.varying_actuator._EVALUATIONS", 2000)
    noise = itertools.cycle(np.random.default_rng(0).uniform(0.4, 0.9, 997).tolist())
    with pytest.raises(ParameterError, match=r"smooth functions \(stuck at this position \[m\]: more than \d+ evaluations"):
        bent_tube(lambda s: next(noise), FIVE, D, LENGTH)


@pytest.mark.parametrize(("diameter", "length"), [(1e-30, 1e-30), (1e30, 1e30), (1e30, 1e-30)])
def test_sizes_at_the_ends_of_the_range_are_computed(diameter: float, length: float) -> None:
    tube = bent_tube(0.66, FIVE, diameter, length)
    assert np.isfinite(tube.poses).all()
    assert tube.arc_length[-1] == pytest.approx(float(helix.centre_length(0.66, FIVE, length)), rel=1e-12)
