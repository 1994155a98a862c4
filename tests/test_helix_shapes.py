"""Actuator to helix and back against the paper's own formulas at 80 digits, chords of the curves and the paper's numbers."""

from __future__ import annotations

import itertools
import math
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softrobots import helix
from softrobots.core.checks import LARGEST
from softrobots.core.errors import ParameterError, StraightTube
from softrobots.helix import HelixShape
from tests.support.helix_forms import (
    ANGLES,
    CONTRACTIONS,
    DEG,
    LAST,
    TOLERANCE,
    D,
    angles_,
    assert_close,
    contractions_,
    diameters_,
    exact_forward,
    length_by_chords,
)
from tests.support.laws import law
from tests.support.tables import each_row

DIAMETERS = (1e-3, D, 1.0, 1e3)


# --- Oracles: nothing here calls the package. 80 digits, as 1 - cos of 1e-15 is 5e-31 and its square appears


def exact_inverse(outer: Any, inner: Any, pitch: Any) -> tuple[Any, Any, Any]:
    """[Blumenschein 2018] (6), (11) and (7) as printed: contraction, angle, diameter."""
    outer, inner, pitch = map(mp.mpf, (outer, inner, pitch))
    long, short = mp.sqrt(pitch**2 + outer**2), mp.sqrt(pitch**2 + inner**2)
    cosine = (inner * outer + pitch**2) / (long * short)
    return short / long, mp.acos(min(max(cosine, -1), 1)) / 2, outer - inner


def forward_condition(contraction: Any, angle: Any, diameter: Any) -> Any:
    """Change of `Ro + i b` and of `Ri + i b`, in size, per relative change of the arguments: `sum_j |dy/dx_j| |x_j|`.

    From `Ro + i b = D/(1 - z)`, `Ri = Ro - D`, `z = lambda exp(2 i theta)`: `d(Ro + i b) = (Ro + i b) dD/D + D dz/(1 - z)^2`,
    `dz = z (dlambda/lambda + 2 i theta dtheta/theta)`. (Of a part alone the first derivative may vanish, the change does not.)
    """
    share, half, size = map(mp.mpf, (contraction, angle, diameter))
    z = share * mp.expj(2 * half)
    return abs(size / (1 - z)) + (1 + 2 * half) * abs(size * z / (1 - z) ** 2)


def inverse_condition(outer: Any, inner: Any, pitch: Any) -> tuple[Any, Any, Any]:
    """Change of lambda, theta and D per relative change of Ro, b and of the number `zi = Ri + i b` (Ri may be zero).

    `log lambda + 2 i theta = log zi - log zo`, differentiated; `sum_j |dx_i/dy_j| s_j`, `s = (Ro, |zi|, b)`.
    """
    outer, inner, pitch = map(mp.mpf, (outer, inner, pitch))
    by_outer, by_inner = 1 / mp.mpc(outer, pitch), 1 / mp.mpc(inner, pitch)
    size = abs(mp.mpc(inner, pitch))
    entries = [by_outer * outer, by_inner * size, 1j * (by_inner - by_outer) * pitch]
    contraction = size / abs(mp.mpc(outer, pitch))
    return contraction * sum(abs(e.real) for e in entries), sum(abs(e.imag) for e in entries) / 2, outer + size


def arrays(shape: HelixShape) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return shape.outer_radius, shape.inner_radius, shape.pitch


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(80):
        yield


# --- The paper's formulas over the whole domain


@each_row("contraction", CONTRACTIONS)
@each_row("diameter", DIAMETERS)
def test_forward_is_the_papers_12_to_the_last_digits(contraction: float, diameter: float) -> None:
    """Not only to the condition number: of the inputs as they are, each path to the rounding of its own size `|R + i b|`."""
    angles = [angle for angle in ANGLES if (contraction, angle) != (1.0, 0.0)]
    shape = helix.forward(contraction, angles, diameter)
    for place, angle in enumerate(angles):
        exact = exact_forward(contraction, angle, diameter)
        sizes = (exact[0], abs(mp.mpc(exact[1], exact[2])), exact[2])
        for found, number, size in zip(arrays(shape), exact, sizes, strict=True):
            assert_close(found[place], number, TOLERANCE * size)


def assert_recovered(contraction: float, angle: float, diameter: float, found: helix.Actuator) -> None:
    condition = inverse_condition(*exact_forward(contraction, angle, diameter))
    # A number whose condition number is below its own size is still stored with its own rounding.
    for back, number, change in zip(found, (contraction, angle, diameter), condition, strict=True):
        assert_close(back, mp.mpf(number), TOLERANCE * max(change, mp.mpf(number)))


@pytest.mark.study
@pytest.mark.parametrize("contraction", CONTRACTIONS)
def test_inverse_of_forward_is_the_actuator(contraction: float) -> None:
    for angle, diameter in itertools.product(ANGLES, DIAMETERS):
        if (contraction, angle) != (1.0, 0.0):
            found = helix.inverse(helix.forward(contraction, angle, diameter))
            assert_recovered(contraction, angle, diameter, found)
            assert float(found.contraction) <= 1.0


@pytest.mark.study
@law("helix.forward", "helix.inverse")
@settings(max_examples=300)
@given(contractions_, angles_, diameters_)
def test_inverse_of_forward_is_the_actuator_anywhere(contraction: float, angle: float, diameter: float) -> None:
    try:
        shape = helix.forward(contraction, angle, diameter)
    except StraightTube:
        # Allowed where the helix is so wide that the tube is lost in rounding of its radius, and nowhere else.
        assert 1.0 - contraction < 4e-16
        assert angle < 4e-16
        return
    assert_recovered(contraction, angle, diameter, helix.inverse(shape))


# Outer radius 1; inner radius from one rounding below it to minus it, and pitch from flat to nearly straight.
INNER = (1 - 1e-12, 0.999, 0.6, 1e-5, 1e-30, 0.0, -1e-9, -0.3, -0.999, -(1 - 1e-12), -1.0)
PITCHES = (1e-12, 1e-6, 0.01, 0.3, 1.0, 50.0, 1e6)


@each_row("inner", INNER)
@each_row("scale", [1e-3, 1.0, 300.0])
def test_inverse_is_the_papers_and_forward_of_it_is_the_shape(inner: float, scale: float) -> None:
    for pitch in PITCHES:
        shape = HelixShape(scale, inner * scale, pitch * scale)
        numbers = [float(number) for number in arrays(shape)]
        found, exact = helix.inverse(shape), exact_inverse(*numbers)
        for back, number, change in zip(found, exact, inverse_condition(*numbers), strict=True):
            assert_close(back, number, TOLERANCE * max(change, number))
        change = forward_condition(*exact)
        for back, number in zip(arrays(helix.forward(*found)), numbers, strict=True):
            assert_close(back, mp.mpf(number), TOLERANCE * change)


@pytest.mark.parametrize("inner", [1e-30, 1e-5, 0.6, 0.999])
def test_planar_arcs_have_an_actuator_along_the_tube(inner: float) -> None:
    found = helix.inverse(HelixShape(1.0, inner, 0.0))
    assert float(found.angle) == 0.0
    assert float(found.contraction) == pytest.approx(inner, rel=TOLERANCE)
    assert float(found.diameter) == 1.0 - inner


@law("helix.forward")
@given(contractions_, angles_, diameters_)
def test_paths_are_complex_numbers_in_the_ratio_of_the_actuator(contraction: float, angle: float, diameter: float) -> None:
    """`(Ri + i b)/(Ro + i b) = lambda exp(2 i theta)`, the three constraints (6), (7), (11) in one."""
    try:
        outer, inner, pitch = map(float, arrays(helix.forward(contraction, angle, diameter)))
    except StraightTube:
        return
    ratio = complex(inner, pitch) / complex(outer, pitch)
    expected = contraction * np.exp(2j * angle)
    assert abs(ratio - expected) <= TOLERANCE * contraction
    assert outer - inner == pytest.approx(diameter, abs=TOLERANCE * (abs(outer) + abs(inner)))  # what rounding of radii leaves


@law("helix.forward")
@given(contractions_, angles_, diameters_)
def test_centre_line_never_passes_the_axis(contraction: float, angle: float, diameter: float) -> None:
    """`Rc = D (1 - lambda^2)/(2 den)` is not negative, although Ri may be; Ri is while lambda > cos 2theta."""
    try:
        shape = helix.forward(contraction, angle, diameter)
    except StraightTube:
        return
    assert float(shape.centre_radius) >= 0.0
    exact_outer, exact_inner, _ = exact_forward(contraction, angle, diameter)
    bound = TOLERANCE * (exact_outer + abs(exact_inner))  # the sum of two radii that may cancel
    assert_close(shape.centre_radius, (exact_outer + exact_inner) / 2, bound)
    if abs(exact_inner) > TOLERANCE * abs(mp.mpc(exact_inner, float(shape.pitch))):
        assert (float(shape.inner_radius) < 0.0) == (mp.mpf(contraction) > mp.cos(2 * mp.mpf(angle)))


# --- Limits


@each_row("angle", [1e-15, 1e-6, 5 * DEG, 45 * DEG, 1.5, math.pi / 2 - 1e-9])
@each_row("diameter", DIAMETERS)
def test_a_full_length_actuator_winds_around_a_straight_tube(angle: float, diameter: float) -> None:
    shape = helix.forward(1.0, angle, diameter)
    assert float(shape.outer_radius) == diameter / 2
    assert float(shape.inner_radius) == -diameter / 2
    assert float(shape.centre_radius) == 0.0
    assert_close(shape.pitch, mp.mpf(diameter) / (2 * mp.tan(mp.mpf(angle))), TOLERANCE * mp.mpf(float(shape.pitch)))
    assert float(helix.inverse(shape).contraction) == 1.0


@each_row("contraction", CONTRACTIONS[:-1])
@each_row("diameter", DIAMETERS)
def test_an_actuator_along_the_tube_makes_a_planar_arc(contraction: float, diameter: float) -> None:
    shape = helix.forward(contraction, 0.0, diameter)
    exact = mp.mpf(diameter) / (1 - mp.mpf(contraction))
    assert float(shape.pitch) == 0.0
    assert_close(shape.outer_radius, exact, TOLERANCE * exact)
    assert_close(shape.inner_radius, mp.mpf(contraction) * exact, TOLERANCE * mp.mpf(contraction) * exact)
    assert float(helix.inverse(shape).angle) == 0.0


@pytest.mark.parametrize("angle", [0.0, 1e-15, 5 * DEG, 45 * DEG, 1.5])
def test_a_tiny_actuator_makes_a_torus(angle: float) -> None:
    shape = helix.forward(1e-30, angle, D)
    assert float(shape.outer_radius) == D
    assert_close(shape.inner_radius, mp.mpf(D) * 1e-30 * mp.cos(2 * mp.mpf(angle)), TOLERANCE * D * 1e-30)
    assert_close(shape.pitch, mp.mpf(D) * 1e-30 * mp.sin(2 * mp.mpf(angle)), TOLERANCE * 1e-30 * float(shape.pitch * 1e30))


@pytest.mark.parametrize("angle", [1e-7, 0.01, 5 * DEG, 10 * DEG, 0.5, 0.7, 45 * DEG - 1e-12])
def test_an_inner_path_on_the_axis_is_found(angle: float) -> None:
    """lambda = cos 2theta: the inner path is the axis itself; the rounding of lambda is all that is left of its radius."""
    contraction = math.cos(2.0 * angle)
    shape = helix.forward(contraction, angle, D)
    left = D * contraction * (mp.cos(2 * mp.mpf(angle)) - mp.mpf(contraction)) / mp.sin(2 * mp.mpf(angle)) ** 2
    size = D * contraction / mp.sin(2 * mp.mpf(angle))
    assert_close(shape.inner_radius, left, TOLERANCE * size)
    assert_close(shape.pitch, size, TOLERANCE * size + 2 * abs(left))
    assert float(shape.outer_radius) == pytest.approx(D, abs=2 * float(abs(left)) + TOLERANCE * float(size))
    assert_recovered(contraction, angle, D, helix.inverse(shape))


@pytest.mark.parametrize(
    ("contraction", "angle"), [(1.0, 0.0), (1.0, 1e-200), (1.0, 5e-324), ([0.5, 1.0], 0.0), (1.0, [[0.1], [0.0]])]
)
def test_the_straight_tube_has_no_helix(contraction: Any, angle: Any) -> None:
    with pytest.raises(StraightTube, match="straight") as caught:
        helix.forward(contraction, angle, D)
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(("contraction", "diameter"), [(LAST, 1e29), (LAST, 1e30)])
def test_a_radius_beyond_all_numbers_is_straight(contraction: float, diameter: float) -> None:
    with pytest.raises(StraightTube, match="radius of"):
        helix.forward(contraction, 0.0, diameter)


def test_radii_that_rounding_made_unequal_are_a_straight_tube() -> None:
    """Measured or computed radii of a straight tube may differ by rounding, to either side."""
    for inner in (-1.0 - 1e-13, -1.0 + 1e-13):
        shape = HelixShape(1.0, inner, 0.3)
        assert 0.0 <= float(shape.centre_radius) <= 1e-13
        assert 1.0 - 1e-12 < float(helix.inverse(shape).contraction) <= 1.0
        assert helix.forward(*helix.inverse(shape)).shape == ()


def test_both_ways_to_the_straight_tube_disagree() -> None:
    """Which is why it is an error: lambda -> 1 first gives (D/2, -D/2, inf), theta -> 0 first (inf, inf, 0)."""
    first = helix.forward(1.0, 1e-12, D)
    other = helix.forward(1.0 - 1e-12, 0.0, D)
    assert float(first.outer_radius) == D / 2
    assert float(first.pitch) > 1e9 * D
    assert min(float(other.outer_radius), float(other.inner_radius)) > 1e9 * D
    assert float(other.pitch) == 0.0


# --- Measuring a helix


MEASURED = [
    (0.66, 5 * DEG, D),
    (0.5, 2.5 * DEG, D),
    (0.9, 10 * DEG, D),
    (0.99, 10 * DEG, 0.05),  # inner path beyond the axis
    (1.0, 20 * DEG, 0.1),
    (0.7, 0.0, 0.02),  # planar
    (0.2, 1.2, 2.0),
]


@pytest.mark.parametrize("turns", [1.0, 0.5, 2.25])
@pytest.mark.parametrize(("contraction", "angle", "diameter"), MEASURED)
def test_a_helix_is_measured_by_the_arcs_of_its_points(contraction: float, angle: float, diameter: float, turns: float) -> None:
    shape = helix.forward(contraction, angle, diameter)
    arcs = [
        length_by_chords(lambda s, path=path: helix.points(shape, s, path), 0.3, 0.3 + 2.0 * np.pi * turns)
        for path in ("outer", "inner")
    ]
    found = helix.measure(*arcs, diameter, turns)
    # Romberg's chords have rounding of 1e-14 of the length; m divides the squared lengths by D.
    size = arcs[0] / (2.0 * np.pi * turns)
    radius_error = 2e-13 * size**2 / diameter
    assert float(found.outer_radius) == pytest.approx(float(shape.outer_radius), abs=radius_error)
    assert float(found.inner_radius) == pytest.approx(float(shape.inner_radius), abs=radius_error)
    assert abs(float(found.pitch) ** 2 - float(shape.pitch) ** 2) <= 4.0 * size * radius_error
    if angle > 0.0:
        assert np.allclose(helix.inverse(found), (contraction, angle, diameter), rtol=1e-9, atol=0.0)


@pytest.mark.study
@law("helix.measure")
@settings(max_examples=200)
@given(contractions_, angles_, diameters_)
def test_measure_is_the_corrected_16(contraction: float, angle: float, diameter: float) -> None:
    """The circumferences of 17 at 80 digits, rounded to floats; their rounding times the derivatives of 16 is allowed."""
    assume(contraction < 1.0 or angle > 1e-25)  # else wider than the 1e30 m that are taken, up to infinite
    outer, inner, pitch = exact_forward(contraction, angle, diameter)
    arcs = [float(2 * mp.pi * mp.sqrt(radius**2 + pitch**2)) for radius in (outer, inner)]
    size = mp.sqrt(outer**2 + pitch**2)
    change = TOLERANCE * size**2 / diameter  # of m, to which both radii add D/2
    try:
        found = helix.measure(*arcs, diameter)
    except ParameterError:
        # Allowed where rounding of the arcs alone can make the pitch imaginary or zero.
        assert pitch**2 <= 4 * outer * change or pitch**2 <= 4e-12 * size**2
        return
    allowed = change + TOLERANCE * size
    assert_close(found.outer_radius, outer, allowed)
    assert_close(found.inner_radius, inner, allowed)
    # Differences below 1e-12 of the arc count as flat: b^2 = (Lo/2pi - Ro)(Lo/2pi + Ro).
    assert_close(found.pitch**2, pitch**2, 4 * size * allowed + 2e-12 * size**2)


def test_measured_radii_as_printed_are_one_diameter_short() -> None:
    shape = helix.forward(0.66, 5 * DEG, D)
    outer, inner = (2.0 * np.pi * np.hypot(radius, shape.pitch) for radius in (shape.outer_radius, shape.inner_radius))
    middle = (outer**2 - inner**2) / (8.0 * np.pi**2 * D)
    printed = np.array([middle - D / 2, middle - 3 * D / 2])  # (16) as printed
    # Squared lengths of 0.55 m over 2.6 m: some 1e-16 of 0.1 m.
    assert np.allclose(printed + D, [shape.outer_radius, shape.inner_radius], rtol=1e-13, atol=0.0)


def test_a_flat_coil_is_measured_although_rounding_may_make_its_pitch_imaginary() -> None:
    for radius in np.linspace(0.04, 0.3, 200):
        found = helix.measure(2 * np.pi * radius, 2 * np.pi * (radius - D), D)
        assert float(found.outer_radius) == pytest.approx(radius, rel=1e-13)  # squares of 0.3 m over 0.03 m
        assert float(found.pitch) <= 2e-6 * radius  # the root of 1e-12


# --- The paper's numbers


def test_reference_of_theory() -> None:
    shape = helix.forward(0.66, 5 * DEG, D)
    assert float(shape.outer_radius) == pytest.approx(0.0854078008, abs=5e-11)  # printed digits
    assert float(shape.inner_radius) == pytest.approx(0.0523078008, abs=5e-11)
    assert float(shape.pitch) == pytest.approx(0.0279647090, abs=5e-11)
    assert float(shape.turn_height) == pytest.approx(2 * math.pi * 0.0279647090, abs=4e-10)
    assert float(shape.centre_radius) == pytest.approx(0.5 * (0.0854078008 + 0.0523078008), abs=5e-11)
    assert float(shape.diameter) == pytest.approx(D, rel=4e-16)


# --- Arrays and the shape object


def test_arguments_broadcast() -> None:
    shares, angles, sizes = np.linspace(0.5, 0.9, 4)[:, None], DEG * np.array([2.5, 5, 10]), np.full((2, 1, 1), D)
    shape = helix.forward(shares, angles, sizes)
    assert shape.shape == shape.pitch.shape == shape.outer_radius.shape == shape.inner_radius.shape == (2, 4, 3)
    back = helix.inverse(shape)
    assert back.contraction.shape == back.angle.shape == back.diameter.shape == (2, 4, 3)
    one = helix.forward(shares[1, 0], angles[2], D)
    # An array goes through other loops than a number: the last digit of sines may differ.
    for many, single in zip(arrays(shape), arrays(one), strict=True):
        assert float(many[1, 1, 2]) == pytest.approx(float(single), rel=2e-15)
    assert np.allclose(back.angle, angles, rtol=1e-13, atol=0.0)
    arcs = 2 * np.pi * np.hypot(shape.outer_radius, shape.pitch), 2 * np.pi * np.hypot(shape.inner_radius, shape.pitch)
    assert helix.measure(*arcs, D).shape == (2, 4, 3)
    assert helix.measure(*arcs, D, np.ones((5, 1, 1, 1))).shape == (5, 2, 4, 3)
    assert helix.forward(0.5, 0.1, D).shape == ()
    assert helix.forward(np.zeros((0,)) + 0.5, 0.1, D).shape == (0,)


def test_shapes_are_frozen_and_copied() -> None:
    given_radius = np.array([0.08, 0.09])
    shape = HelixShape(given_radius, 0.05, 0.02)
    given_radius[0] = 5.0
    assert shape.outer_radius.tolist() == [0.08, 0.09]
    assert shape.inner_radius.tolist() == [0.05, 0.05]
    assert shape.shape == (2,)
    with pytest.raises(FrozenInstanceError):
        shape.pitch = np.zeros(2)  # type: ignore[misc]
    for values in arrays(shape):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0
    assert pickle.loads(pickle.dumps(shape)).outer_radius.tolist() == [0.08, 0.09]


def test_radius_by_name_of_the_path() -> None:
    shape = HelixShape(0.08, 0.05, 0.02)
    assert [float(shape.radius(path)) for path in helix.PATHS] == [0.05, float(shape.centre_radius), 0.08]


@pytest.mark.study
@law(
    "helix.HelixShape",
    "helix.curvature_torsion",
    "helix.frames",
    "helix.turn_angle",
    "helix.height",
    "helix.length_for_turns",
    "helix.inverse",
)
@settings(max_examples=400)
@given(
    *[st.one_of(st.floats(-1e30, 1e30), st.sampled_from([0.0, 5e-324, 1e-320, 1e-160, -1e-91, 1e-91, 1e-60, 1e30]))] * 3,
    st.sampled_from(helix.PATHS),
)
def test_whatever_shape_is_accepted_gives_finite_numbers(outer: float, inner: float, pitch: float, path: str) -> None:
    try:
        shape = HelixShape(outer, inner, pitch)
    except ParameterError:
        return
    assert np.all(np.isfinite(helix.curvature_torsion(shape, path)))
    assert np.all(np.isfinite(helix.frames(shape, 1e10, path)))
    assert np.isfinite(helix.turn_angle(shape, 1e30, path))
    assert np.isfinite(helix.height(shape, np.nextafter(np.pi / 2, 0.0), 1e30))
    assert np.isfinite(helix.length_for_turns(shape, 0.3, 1e30))
    try:
        found = helix.inverse(shape)
    except ParameterError as error:
        assert error.field == "shape"
        assert outer > 1e10 * pitch
        return
    assert np.all(np.isfinite(found))


@pytest.mark.study
@law("helix.actuator_curvature_torsion", "helix.material_twist", "helix.volume", "helix.actuator_tension", "helix.forward")
@settings(max_examples=400)
@given(
    st.one_of(st.sampled_from([1e-30, LAST, 1.0]), st.floats(1e-30, 1.0)),
    st.one_of(st.sampled_from([0.0, 5e-324, 1e-160, 1e-31, float(np.nextafter(np.pi / 2, 0.0))]), st.floats(0.0, 1.57)),
    st.sampled_from([1e-30, D, 1e30]),
    st.sampled_from(helix.PATHS),
)
def test_whatever_actuator_is_accepted_gives_finite_numbers(share: float, angle: float, diameter: float, path: str) -> None:
    assert np.all(np.isfinite(helix.actuator_curvature_torsion(share, angle, diameter, path)))
    assert np.isfinite(helix.material_twist(share, angle, diameter))
    assert np.isfinite(helix.volume(share, angle, diameter, 1e30))
    assert np.isfinite(helix.actuator_tension(share, angle, diameter, 1e30))
    try:
        shape = helix.forward(share, angle, diameter)
    except StraightTube:
        return
    assert np.all(np.isfinite(arrays(shape)))
    assert np.all(np.isfinite(helix.curvature_torsion(shape, path)))


# --- Refusals


NAN, INF = float("nan"), float("inf")
CIRCLE = 2 * np.pi


@each_row(
    ("call", "field"),
    [
        (lambda: helix.forward(0.0, 0.1, D), "contraction"),
        (lambda: helix.forward(-0.5, 0.1, D), "contraction"),
        (lambda: helix.forward(1.0 + 1e-15, 0.1, D), "contraction"),
        (lambda: helix.forward([0.5, NAN], 0.1, D), "contraction"),
        (lambda: helix.forward("half", 0.1, D), "contraction"),
        (lambda: helix.forward(True, 0.1, D), "contraction"),
        (lambda: helix.forward(0.5, -1e-9, D), "angle"),
        (lambda: helix.forward(0.5, np.pi / 2, D), "angle"),
        (lambda: helix.forward(0.5, 5.0, D), "angle"),  # degrees
        (lambda: helix.forward(0.5, NAN, D), "angle"),
        (lambda: helix.forward(0.5, INF, D), "angle"),
        (lambda: helix.forward(0.5, None, D), "angle"),
        (lambda: helix.forward(0.5, 0.1, 0.0), "diameter"),
        (lambda: helix.forward(0.5, 0.1, -D), "diameter"),
        (lambda: helix.forward(0.5, 0.1, NAN), "diameter"),
        (lambda: helix.forward(0.5, 0.1, INF), "diameter"),
        (lambda: helix.forward([0.5, 0.6], [0.1, 0.2, 0.3], D), "diameter"),  # shapes that do not broadcast
        (lambda: HelixShape(NAN, 0.05, 0.02), "outer_radius"),
        (lambda: HelixShape("wide", 0.05, 0.02), "outer_radius"),
        (lambda: HelixShape(0.08, INF, 0.02), "inner_radius"),
        (lambda: HelixShape(0.08, 0.08, 0.02), "inner_radius"),  # no tube
        (lambda: HelixShape(0.05, 0.08, 0.02), "inner_radius"),  # outside in
        (lambda: HelixShape(0.05, -0.0501, 0.02), "inner_radius"),  # the longer path
        (lambda: HelixShape(-0.05, -0.08, 0.02), "inner_radius"),
        (lambda: HelixShape([0.08, 0.08], [0.05, 0.09], 0.02), "inner_radius"),
        (lambda: HelixShape(1e-310, 0.0, 1.0), "inner_radius"),  # a tube too thin for numbers
        (lambda: HelixShape(0.08, 0.05, -0.02), "pitch"),
        (lambda: HelixShape(0.08, 0.05, NAN), "pitch"),
        (lambda: HelixShape(0.08, 0.0, 0.0), "pitch"),  # an actuator that is a point
        (lambda: HelixShape(0.08, -0.01, 0.0), "pitch"),
        (lambda: HelixShape(0.08, 1e-100, 1e-100), "pitch"),
        (lambda: HelixShape([0.08, 0.09], [0.05, 0.05, 0.05], 0.02), "pitch"),  # shapes that do not broadcast
        (lambda: HelixShape(0.08, 0.05, 0.02).radius("middle"), "path"),
        (lambda: HelixShape(0.08, 0.05, 0.02).radius(1), "path"),
        (lambda: helix.inverse((0.08, 0.05, 0.02)), "shape"),
        (lambda: helix.inverse(HelixShape(0.5, -0.5, 1e-17)), "shape"),  # across the tube
        (lambda: helix.measure(0.0, 0.4, D), "outer_arc"),
        (lambda: helix.measure(NAN, 0.4, D), "outer_arc"),
        (lambda: helix.measure(0.5, -0.4, D), "inner_arc"),
        (lambda: helix.measure(0.5, 0.0, D), "inner_arc"),
        (lambda: helix.measure(0.5, 0.51, D), "inner_arc"),  # the actuator is the shorter path
        (lambda: helix.measure([0.5, 0.4], [0.4, 0.5], D), "inner_arc"),
        (lambda: helix.measure(0.5, 0.4, 0.0), "diameter"),
        (lambda: helix.measure(0.5, 0.4, [D, -D]), "diameter"),
        (lambda: helix.measure(0.5, 0.4, D, 0.0), "turns"),
        (lambda: helix.measure(0.5, 0.4, D, -1.0), "turns"),
        (lambda: helix.measure(0.5, 0.4, D, NAN), "turns"),
        (lambda: helix.measure(0.5, 0.4, 1e-3), "outer_arc"),  # 100 mm of difference need a tube of more than 1 mm
        (lambda: helix.measure(0.5, 0.4, 1.0), "outer_arc"),  # a tube wider than the coil
        (lambda: helix.measure(CIRCLE, 0.5 * CIRCLE, 1.5), "inner_arc"),  # flat, and the inner path beyond the axis
    ],
)
def test_bad_input_is_refused(call: Callable[[], Any], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        call()
    assert caught.value.field == field


def test_errors_say_what_came_and_what_is_required() -> None:
    with pytest.raises(ParameterError, match=r"contraction = 1\.5: contraction must be in \(0, 1\]"):
        helix.forward(1.5, 0.1, D)
    with pytest.raises(ParameterError, match=r"angle = 5: angle must be in \[0, pi/2\) rad"):
        helix.forward(0.5, 5, D)
    with pytest.raises(ParameterError, match=r"path = 'middle': path must be one of 'inner', 'centre', 'outer'"):
        HelixShape(0.08, 0.05, 0.02).radius("middle")


def test_arcs_in_a_plane_have_no_pitch_at_all() -> None:
    """The rounding of their lengths is not taken for a rise, which would be the root of it: a millionth and more."""
    for contraction in np.linspace(0.05, 0.95, 200):
        shape = helix.forward(contraction, 0.0, 0.0331)
        found = helix.measure(2.0 * np.pi * shape.outer_radius, 2.0 * np.pi * shape.inner_radius, 0.0331)
        assert found.pitch == 0.0


def test_arcs_that_no_helix_has_are_told() -> None:
    with pytest.raises(ParameterError, match=r"at least a circle of the outer radius 0\.6") as caught:
        helix.measure(0.5, 0.1, 0.005)  # twelve diameters of difference in a circle of sixteen
    assert (caught.value.field, caught.value.value) == ("outer_arc", 0.5)
    outer_arc = 0.5
    with pytest.raises(ParameterError, match="such that a helix explains both arcs at this diameter") as caught:
        helix.measure(outer_arc, 1e-30, outer_arc / (2.0 * np.pi))  # a circle through the axis: no inner radius, no rise
    assert (caught.value.field, caught.value.value) == ("inner_arc", 1e-30)


def test_what_must_be_positive_is_at_least_1e_90_m() -> None:
    """The limit itself is taken; a little less is not, and the error tells what came."""
    least = LARGEST**-3
    below = math.nextafter(least, 0.0)
    HelixShape(least, 0.0, 1.0)
    HelixShape(1.0, 0.0, least)
    HelixShape(1.0, least, 0.0)
    with pytest.raises(ParameterError, match="they differ by D"):
        HelixShape(below, 0.0, 1.0)
    for inner, pitch in ((0.0, below), (below, 0.0)):
        with pytest.raises(ParameterError, match=r"positive where the inner radius .* m is not") as caught:
            HelixShape(1.0, inner, pitch)
        assert (caught.value.field, caught.value.value) == ("pitch", pitch)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_the_actuator_is_on_the_shorter_path_but_for_rounding(size: float) -> None:
    """Rounding is relative to the diameter."""
    HelixShape(size, -size * (1.0 + 1e-12), 1.0)
    with pytest.raises(ParameterError, match="at least minus the outer radius"):
        HelixShape(size, -size * (1.0 + 1e-9), 1.0)


def test_a_nearly_straight_tube_has_a_shape_while_numbers_hold_it() -> None:
    angle = 0.8e-30
    shape = helix.forward(1.0, angle, 0.1)
    assert shape.pitch == pytest.approx(0.1 / (2.0 * angle), rel=1e-12)
    assert shape.outer_radius == pytest.approx(0.05, rel=1e-12)
    with pytest.raises(
        StraightTube, match=r"leaves the tube straight: no helix radius; a contraction below 1 or an angle above 0"
    ):
        helix.forward(1.0, 0.4e-30, 0.1)


def test_radii_that_rounding_makes_one_are_those_of_a_straight_tube(rng: np.random.Generator) -> None:
    """At the largest contraction below 1 the radii are ten million billion diameters."""
    for angle, diameter in zip(10.0 ** rng.uniform(-18.0, -15.0, 300), rng.uniform(0.5, 2.0, 300), strict=True):
        try:
            shape = helix.forward(math.nextafter(1.0, 0.0), angle, diameter)
        except StraightTube as error:
            assert "the tube is straight" in str(error)
        else:
            assert 0.0 < shape.diameter < 4.0
