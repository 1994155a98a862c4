"""Curves, frames and the tube of a helix against derivatives and chords of its points, exponentials, and the paper."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from scipy.linalg import expm

from softrobots import helix
from softrobots.core.errors import ParameterError
from softrobots.helix import HANDEDNESS, PATHS, HelixShape
from tests.support.helix_forms import (
    ANGLES,
    CONTRACTIONS,
    DEG,
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

# Paper's reference; inner path beyond the axis, and on it; straight; planar; the actuator across more than along; tight; wide.
ACTUATORS = [
    (0.66, 5 * DEG, D),
    (0.99, 10 * DEG, 0.05),
    (math.cos(20 * DEG), 10 * DEG, D),
    (1.0, 20 * DEG, 0.1),
    (0.7, 0.0, 0.02),
    (0.8, 60 * DEG, 0.3),
    (0.05, 30 * DEG, 1.0),
    (0.999, 0.002, 0.01),
]
HANDS = {"right": 1.0, "left": -1.0}
every_path = pytest.mark.parametrize("path", PATHS)
every_hand = pytest.mark.parametrize("handedness", HANDEDNESS)
every_actuator = pytest.mark.parametrize("actuator", ACTUATORS, ids=lambda a: f"{a[0]:.4g}-{a[1] / DEG:.3g}deg")


def rates(curve: Callable[[np.ndarray], np.ndarray], s: float, step: float = 0.02) -> list[np.ndarray]:
    """First, second and third derivative by differences over nine places: of sines, truncation at 0.02 is below 1e-14."""
    places = np.arange(-4, 5)
    values = curve(s + step * places)
    powers = places[None, :] ** np.arange(9)[:, None]
    made = []
    for order in (1, 2, 3):
        target = np.zeros(9)
        target[order] = math.factorial(order)
        made.append(np.tensordot(np.linalg.solve(powers.astype(float), target), values, axes=1) / step**order)
    return made


def screw(bend: float, twist: float, length: float) -> np.ndarray:
    """Motion along a section of constant strain (0, bend, twist), by scipy."""
    rate = np.array([[0.0, -twist, bend, 0.0], [twist, 0.0, 0.0, 0.0], [-bend, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    return expm(length * rate)


def exact_curvature_torsion(path: str, contraction: Any, angle: Any, diameter: Any) -> tuple[Any, Any]:
    """[Blumenschein 2018] (15) as printed; the centre line by (5), (12), (13), and (0, 2 tan(theta)/D) where it is straight."""
    share, half, size = map(mp.mpf, (contraction, angle, diameter))
    cosine, sine = mp.cos(2 * half), mp.sin(2 * half)
    if path == "outer":
        return (1 - share * cosine) / size, share * sine / size
    if path == "inner":
        return (cosine - share) / (size * share), sine / (size * share)
    if share == 1:
        return mp.mpf(0), 2 * mp.tan(half) / size
    outer, inner, pitch = exact_forward(contraction, angle, diameter)
    radius = (outer + inner) / 2
    return radius / (pitch**2 + radius**2), pitch / (pitch**2 + radius**2)


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(100):
        yield


# --- Derivatives of the points. Nine-point differences of sines with step 0.02 are good to 1e-13, 1e-11 and 1e-9 of the radius
# (rounding over the step, its square and its cube).


@every_actuator
@every_path
@every_hand
def test_frenet_quantities_are_derivatives_of_the_points(actuator: tuple[float, ...], path: str, handedness: str) -> None:
    shape = helix.forward(*actuator)
    kappa, tau = map(float, helix.curvature_torsion(shape, path, handedness))
    radius, pitch = float(shape.radius(path)), float(shape.pitch)
    size, turns_by = math.hypot(radius, pitch), abs(radius) > 1e-12
    for s in (0.0, 0.7, -2.1, 14.0):
        velocity, second, third = rates(lambda place: helix.points(shape, place, path, handedness), s)
        speed = np.linalg.norm(velocity)
        assert speed == pytest.approx(size, rel=1e-11)
        assert helix.tangents(shape, s, path, handedness) == pytest.approx(velocity / speed, abs=1e-11)
        assert velocity[2] >= 0.0
        turn = np.cross(velocity, second)
        # The signs come from the normal, which points from the outer to the inner path wherever the axis is.
        across = helix.points(shape, s, "inner", handedness) - helix.points(shape, s, "outer", handedness)
        normal = across / np.linalg.norm(across)
        assert helix.normals(shape, s, path, handedness) == pytest.approx(normal, abs=1e-13)
        assert helix.binormals(shape, s, path, handedness) == pytest.approx(np.cross(velocity / speed, normal), abs=1e-11)
        assert kappa == pytest.approx(second @ normal / speed**2, abs=1e-9 / size)
        assert abs(kappa) == pytest.approx(np.linalg.norm(turn) / speed**3, abs=1e-9 / size)
        if turns_by:  # a straight line has no torsion of its own
            assert tau == pytest.approx(turn @ third / (turn @ turn), abs=3e-7 * size / radius**2)


@every_actuator
@every_path
@every_hand
def test_frames_are_proper_and_made_of_the_vectors(actuator: tuple[float, ...], path: str, handedness: str) -> None:
    shape, s = helix.forward(*actuator), np.linspace(-20.0, 20.0, 41)
    poses = helix.frames(shape, s, path, handedness)
    rotations = poses[:, :3, :3]
    # Three sums of three products of sines, each half a unit in the last place.
    assert np.allclose(np.swapaxes(rotations, 1, 2) @ rotations, np.eye(3), rtol=0.0, atol=1e-15)
    assert np.allclose(np.linalg.det(rotations), 1.0, rtol=0.0, atol=2e-15)
    assert np.array_equal(poses[:, 3], np.tile([0.0, 0.0, 0.0, 1.0], (41, 1)))
    assert np.array_equal(poses[:, :3, 3], helix.points(shape, s, path, handedness))
    for column, vectors in enumerate((helix.normals, helix.binormals, helix.tangents)):
        assert np.array_equal(rotations[:, :, column], vectors(shape, s, path, handedness))


@every_hand
def test_the_chain_from_its_base_lies_on_the_centre_line(handedness: str) -> None:
    """Many sections in a row, several turns, from `transform_base_to_axis`: the sections stand on the closed form."""
    shape = helix.forward(0.66, 5 * DEG, D)
    kappa, tau = map(float, helix.actuator_curvature_torsion(0.66, 5 * DEG, D, "centre", handedness))
    step, pose = screw(kappa, tau, 0.05), helix.transform_base_to_axis(shape, handedness)
    assert np.array_equal(pose, helix.frames(shape, 0.0, "centre", handedness))
    assert pose[:3, 3] == pytest.approx((float(shape.centre_radius), 0.0, 0.0), abs=1e-16)
    assert pose[:3, 0] == pytest.approx((-1.0, 0.0, 0.0), abs=0.0)
    for section in range(1, 61):  # 3 m, six turns
        pose = pose @ step
        point = helix.points(shape, helix.turn_angle(shape, 0.05 * section), "centre", handedness)
        assert np.allclose(pose[:3, 3], point, rtol=0.0, atol=1e-13)  # 60 products of matrices of rounding 2e-16


# --- Geometry of the three paths


@every_actuator
@every_hand
def test_a_cross_section_joins_the_three_paths(actuator: tuple[float, ...], handedness: str) -> None:
    """Equal turn angles lie D apart on one common normal, the centre in the middle (5)."""
    shape, s = helix.forward(*actuator), np.linspace(-7.0, 9.0, 17)
    inner, centre, outer = (helix.points(shape, s, path, handedness) for path in PATHS)
    wide = float(shape.outer_radius) + 9.0 * float(shape.pitch)
    assert np.allclose(np.linalg.norm(outer - inner, axis=1), actuator[2], rtol=0.0, atol=1e-15 * wide)
    assert np.allclose(centre, 0.5 * (outer + inner), rtol=0.0, atol=1e-15 * wide)
    for path in PATHS:
        normal = helix.normals(shape, s, path, handedness)
        assert np.allclose(outer - inner, -actuator[2] * normal, rtol=0.0, atol=2e-15 * wide)
        assert np.allclose(np.sum(normal * helix.tangents(shape, s, path, handedness), axis=1), 0.0, atol=1e-15)


@every_hand
def test_a_right_handed_helix_rises_as_it_turns_anticlockwise(handedness: str) -> None:
    shape = helix.forward(0.66, 5 * DEG, D)
    start, later = helix.points(shape, [0.0, 0.1], "outer", handedness)
    assert (np.cross(start, later)[2] > 0.0) == (handedness == "right")
    assert later[2] > start[2]
    mirrored = helix.points(shape, np.linspace(-9, 9, 19), "inner", handedness) * [1.0, -1.0, 1.0]
    other = {"right": "left", "left": "right"}[handedness]
    assert np.array_equal(mirrored, helix.points(shape, np.linspace(-9, 9, 19), "inner", other))


def test_the_papers_parametrisation_is_left_handed() -> None:
    """(1), (R sin s, R cos s, b s), is ours turned by a quarter about z; its Frenet torsion is -b/(R^2 + b^2)."""
    shape, s = helix.forward(0.66, 5 * DEG, D), np.linspace(0.0, 12.0, 13)
    radius, pitch = float(shape.outer_radius), float(shape.pitch)
    printed = np.column_stack([radius * np.sin(s), radius * np.cos(s), pitch * s])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(helix.points(shape, s, "outer", "left") @ quarter.T, printed, rtol=0.0, atol=1e-16)
    assert float(helix.curvature_torsion(shape, "outer", "left")[1]) < 0.0


@law("helix.tangents", "helix.normals")
@given(contractions_, angles_, diameters_)
def test_tangents_of_inner_and_outer_path_are_two_theta_apart(contraction: float, angle: float, diameter: float) -> None:
    """(10) and (11); the angle by its tangent, in the plane across the common normal."""
    if 1.0 - contraction < 1e-13 and angle < 1e-13:
        return  # almost straight: `forward` may refuse
    shape = helix.forward(contraction, angle, diameter)
    for handedness in HANDEDNESS:
        inner, outer, normal = (
            helix.tangents(shape, 0.4, "inner", handedness),
            helix.tangents(shape, 0.4, "outer", handedness),
            helix.normals(shape, 0.4, "centre", handedness),
        )
        # The shorter radius is steeper, and on a right-handed helix turned clockwise as seen along the normal.
        between = math.atan2(np.cross(outer, inner) @ normal, inner @ outer)
        assert abs(between) == pytest.approx(2.0 * angle, abs=1e-15 + TOLERANCE)  # directions are unit vectors
        if angle > 1e-12:
            assert math.copysign(1.0, between) == -HANDS[handedness]


def test_centre_tangent_halves_that_angle_only_nearly() -> None:
    """An erratum of the paper: 3.97 and 6.03 degrees, not 5 and 5 (docs/theory.md 3, two decimals)."""
    shape = helix.forward(0.66, 5 * DEG, D)
    inner, centre, outer = (helix.tangents(shape, 1.0, path) for path in PATHS)
    assert math.degrees(math.acos(outer @ centre)) == pytest.approx(3.97, abs=0.005)
    assert math.degrees(math.acos(centre @ inner)) == pytest.approx(6.03, abs=0.005)
    assert math.degrees(math.acos(inner @ outer)) == pytest.approx(10.0, abs=1e-12)


# --- Curvature and torsion


@pytest.mark.parametrize("contraction", CONTRACTIONS)
@every_path
def test_curvature_and_torsion_are_the_papers_15(contraction: float, path: str) -> None:
    """To rounding of `hypot(kappa, tau)`: of the inner path the curvature passes through zero."""
    for diameter in (1e-3, D, 1e3):
        kappa, tau = helix.actuator_curvature_torsion(contraction, ANGLES, diameter, path)
        for place, angle in enumerate(ANGLES):
            exact = exact_curvature_torsion(path, contraction, angle, diameter)
            size = mp.sqrt(exact[0] ** 2 + exact[1] ** 2)
            assert_close(kappa[place], exact[0], TOLERANCE * size)
            assert_close(tau[place], exact[1], TOLERANCE * abs(exact[1]))
            if path != "inner":
                assert_close(kappa[place], exact[0], TOLERANCE * exact[0])


@law("helix.curvature_torsion", "helix.actuator_curvature_torsion")
@given(contractions_, angles_, diameters_)
def test_curvature_of_the_shape_is_that_of_the_actuator(contraction: float, angle: float, diameter: float) -> None:
    if 1.0 - contraction < 1e-13 and angle < 1e-13:
        return
    shape = helix.forward(contraction, angle, diameter)
    for path, handedness in itertools.product(PATHS, HANDEDNESS):
        size = math.hypot(float(shape.radius(path)), float(shape.pitch))
        # The centre radius is half a sum that may cancel; curvature and torsion change with radius and pitch by 1/size^2.
        parts = size if path != "centre" else size + float(shape.outer_radius) + abs(float(shape.inner_radius))
        allowed = TOLERANCE * parts / size**2
        found, expected = (
            helix.curvature_torsion(shape, path, handedness),
            helix.actuator_curvature_torsion(contraction, angle, diameter, path, handedness),
        )
        assert np.allclose(found, expected, rtol=0.0, atol=allowed)


@every_path
@every_hand
def test_the_straight_tube_has_no_curvature_and_no_torsion(path: str, handedness: str) -> None:
    assert [float(number) for number in helix.actuator_curvature_torsion(1.0, 0.0, D, path, handedness)] == [0.0, 0.0]
    kappa, tau = helix.actuator_curvature_torsion([0.5, 1.0, 1.0], [0.1, 0.0, 0.2], D, path, handedness)
    assert kappa[1] == tau[1] == 0.0
    assert np.all(tau[[0, 2]] * HANDS[handedness] > 0.0)


def test_reference_curvature_and_torsion_of_theory() -> None:
    kappa, tau = helix.actuator_curvature_torsion(0.66, 5 * DEG, D)
    assert float(kappa) == pytest.approx(12.466512, abs=5e-7)  # printed digits
    assert float(tau) == pytest.approx(5.062932, abs=5e-7)
    straight = helix.actuator_curvature_torsion(1.0, 0.3, D)
    assert float(straight[0]) == 0.0
    assert float(straight[1]) == pytest.approx(2.0 * math.tan(0.3) / D, rel=1e-15)


# --- Lengths, turns and volume


@every_actuator
@every_path
@every_hand
def test_turn_angle_is_where_the_path_has_that_length(actuator: tuple[float, ...], path: str, handedness: str) -> None:
    shape, length = helix.forward(*actuator), 0.37
    end = float(helix.turn_angle(shape, length, path))
    # Romberg needs a smooth curve: at most two turns at a time.
    pieces = max(1, math.ceil(end / 12.0))
    places = np.linspace(0.0, end, pieces + 1)
    sums = [length_by_chords(lambda s: helix.points(shape, s, path, handedness), *pair) for pair in itertools.pairwise(places)]
    assert math.fsum(sums) == pytest.approx(length, rel=1e-11)  # chords of a hundredth of a turn: differences of rounded points
    assert float(helix.turn_angle(shape, -length, path)) == -end


@every_actuator
def test_the_outer_path_keeps_its_length(actuator: tuple[float, ...]) -> None:
    """Before, it is a straight line at theta on the unrolled tube; after, it is what the turns measure. Others contract."""
    contraction, angle, _ = actuator
    shape, length = helix.forward(*actuator), 0.29
    count = float(helix.turns(shape, angle, length))
    pieces = np.linspace(0.0, 2.0 * np.pi * count, max(2, math.ceil(2 * count) + 1))
    arcs = {
        path: math.fsum(
            length_by_chords(lambda s, path=path: helix.points(shape, s, path), *pair) for pair in itertools.pairwise(pieces)
        )
        for path in PATHS
    }
    assert arcs["outer"] == pytest.approx(length / math.cos(angle), rel=1e-11)  # as above
    assert arcs["inner"] == pytest.approx(contraction * length / math.cos(angle), rel=1e-11)
    assert arcs["centre"] == pytest.approx(float(helix.centre_length(contraction, angle, length)), rel=1e-11)
    rise = np.diff(helix.points(shape, pieces[[0, -1]])[:, 2])[0]
    assert float(helix.height(shape, angle, length)) == pytest.approx(rise, rel=1e-14)
    assert float(helix.length_for_turns(shape, angle, count)) == pytest.approx(length, rel=1e-15)


def test_a_full_length_actuator_leaves_the_tube_as_it_was() -> None:
    """At contraction 1: height, centre line and volume are those of the cylinder; it turns by `tan(theta) Lt/(pi D)`."""
    for angle in (0.01, 5 * DEG, 1.2):
        shape = helix.forward(1.0, angle, D)
        assert float(helix.height(shape, angle, 1.7)) == pytest.approx(1.7, rel=1e-14)
        assert float(helix.centre_length(1.0, angle, 1.7)) == pytest.approx(1.7, rel=1e-15)
        assert float(helix.volume(1.0, angle, D, 1.7)) == pytest.approx(np.pi * D**2 / 4 * 1.7, rel=1e-15)
        assert float(helix.turns(shape, angle, 1.7)) == pytest.approx(math.tan(angle) * 1.7 / (np.pi * D), rel=1e-14)
    assert float(helix.centre_length(1.0, 0.0, 1.7)) == 1.7  # straight, where `forward` has no answer
    assert float(helix.volume(1.0, 0.0, D, 1.7)) == pytest.approx(np.pi * D**2 / 4 * 1.7, rel=1e-15)


def test_reference_length_of_theory() -> None:
    assert float(helix.centre_length(0.66, 5 * DEG, 1.0)) == pytest.approx(0.830133, abs=5e-7)  # printed digits


@pytest.mark.parametrize("contraction", CONTRACTIONS)
def test_centre_length_is_exact(contraction: float) -> None:
    """By the circle radii of centre and outer path; `|1 + z|/(2 cos theta)`."""
    ratios = helix.centre_length(contraction, ANGLES, 2.0) / 2.0
    for angle, ratio in zip(ANGLES, ratios, strict=True):
        exact = abs(1 + mp.mpf(contraction) * mp.expj(2 * mp.mpf(angle))) / (2 * mp.cos(mp.mpf(angle)))
        assert_close(ratio, exact, TOLERANCE * exact)
        if (contraction, angle) != (1.0, 0.0):
            outer, inner, pitch = exact_forward(contraction, angle, 1)
            centre = mp.sqrt(((outer + inner) / 2) ** 2 + pitch**2)
            assert_close(ratio, centre / (mp.cos(mp.mpf(angle)) * mp.sqrt(outer**2 + pitch**2)), TOLERANCE * exact)


@pytest.mark.parametrize("actuator", [ACTUATORS[0], ACTUATORS[1], ACTUATORS[4]])
def test_volume_is_that_of_the_surface(actuator: tuple[float, ...]) -> None:
    """Circles normal to the centre line, joined by triangles; volume by the divergence theorem, towards ever finer ones."""
    length, volumes = 0.2, []
    shape = helix.forward(*actuator)
    end = 2.0 * np.pi * float(helix.turns(shape, actuator[1], length))
    for count in (40, 80, 160):
        poses = helix.frames(shape, np.linspace(0.0, end, count + 1), "centre")
        around = 2.0 * np.pi * np.arange(count) / count
        ring = 0.5 * actuator[2] * np.stack([np.cos(around), np.sin(around), np.zeros(count)])
        corners = np.swapaxes(poses[:, :3, :3] @ ring, 1, 2) + poses[:, None, :3, 3]
        a, b, c, d = corners[:-1], np.roll(corners[:-1], -1, 1), np.roll(corners[1:], -1, 1), corners[1:]
        six = np.sum(np.cross(a, b) * c) + np.sum(np.cross(a, c) * d)
        for middle, rim, sign in ((poses[0, :3, 3], corners[0], -1.0), (poses[-1, :3, 3], corners[-1], 1.0)):
            six += sign * np.sum(np.cross(rim, np.roll(rim, -1, 0)) @ middle)
        volumes.append(six / 6.0)
    first, second = (fine + (fine - coarse) / 3.0 for coarse, fine in itertools.pairwise(volumes))  # the error is of order two
    found = float(helix.volume(*actuator, length))
    assert second + (second - first) / 15.0 == pytest.approx(found, rel=1e-7)  # and the next of order four


# --- Twist of the wall


def roll_of_the_actuator(actuator: tuple[float, ...], length: float, handedness: str, steps: int) -> float:
    """How far the actuator winds around the centre line beyond parallel transport [rad], from points alone.

    A vector is carried along the centre line by double reflection (Wang et al. 2008, fourth order), and the direction from
    centre to inner path is measured against it.
    """
    shape = helix.forward(*actuator)
    s = np.linspace(0.0, 2.0 * np.pi * float(helix.turns(shape, actuator[1], length)), steps + 1)
    centre, inner = (helix.points(shape, s, path, handedness) for path in ("centre", "inner"))
    ahead = np.array([rates(lambda place: helix.points(shape, place, "centre", handedness), at)[0] for at in s])
    ahead /= np.linalg.norm(ahead, axis=1)[:, None]
    carried, total, before = inner[0] - centre[0], 0.0, 0.0
    for place in range(steps):
        chord = centre[place + 1] - centre[place]
        mirrored, turned = (v - 2.0 * chord * (chord @ v) / (chord @ chord) for v in (carried, ahead[place]))
        second = ahead[place + 1] - turned
        square = second @ second
        carried = mirrored - (2.0 * second * (second @ mirrored) / square if square > 0.0 else 0.0)
        towards = inner[place + 1] - centre[place + 1]
        now = math.atan2(np.cross(carried, towards) @ ahead[place + 1], carried @ towards)
        total += (now - before + math.pi) % (2.0 * math.pi) - math.pi
        before = now
    return total


@pytest.mark.study
@pytest.mark.parametrize("actuator", [a for a in ACTUATORS if a[2] < 0.2], ids=lambda a: f"{a[0]:.4g}-{a[1] / DEG:.3g}deg")
@every_hand
def test_material_twist_is_the_roll_of_the_actuator_less_its_winding(actuator: tuple[float, ...], handedness: str) -> None:
    """On the uncontracted tube the actuator winds by `2 tan(theta)/D`; what it rolls more or less than that the wall twists."""
    length = 0.25
    winding = HANDS[handedness] * 2.0 * math.tan(actuator[1]) / actuator[2] * length
    twist = roll_of_the_actuator(actuator, length, handedness, 300) - winding
    # The carried vector has an error of the fourth power of the step: at most a twentieth of a radian.
    assert twist / length == pytest.approx(float(helix.material_twist(*actuator, handedness)), abs=2e-6)


def test_reference_twist_of_theory() -> None:
    assert float(helix.material_twist(0.66, 5 * DEG, D)) == pytest.approx(-1.0834, abs=5e-5)  # printed digits
    assert float(helix.material_twist(0.66, 5 * DEG, D, "left")) == pytest.approx(1.0834, abs=5e-5)


@pytest.mark.parametrize("contraction", CONTRACTIONS)
def test_material_twist_is_exact(contraction: float) -> None:
    """Centre torsion over its length, less the winding, at 100 digits: no cancellation is left near contraction 1."""
    found = helix.material_twist(contraction, ANGLES, D)
    for angle, twist in zip(ANGLES, found, strict=True):
        half = mp.mpf(angle)
        stretch = abs(1 + mp.mpf(contraction) * mp.expj(2 * half)) / (2 * mp.cos(half))
        exact = exact_curvature_torsion("centre", contraction, angle, D)[1] * stretch - 2 * mp.tan(half) / mp.mpf(D)
        # At contraction 1 the oracle cancels, to 1e-98 of its terms.
        assert_close(twist, exact, TOLERANCE * abs(exact) + mp.mpf(10) ** -80)
        if contraction == 1.0:
            assert twist == 0.0


# --- Tension of the actuator


@pytest.mark.parametrize("contraction", CONTRACTIONS)
def test_tension_is_the_pressure_times_the_derivative_of_the_volume(contraction: float) -> None:
    """`T = P dV/dLa` by differences at 100 digits, of the volume over the length of the actuator."""
    size, pressure, step = mp.mpf(D), 12e3, mp.mpf(10) ** -40
    found = helix.actuator_tension(contraction, ANGLES, D, pressure)

    def volume(share: Any, half: Any) -> Any:
        return mp.pi * size**2 / 4 * abs(1 + share * mp.expj(2 * half)) / (2 * mp.cos(half))

    for angle, tension in zip(ANGLES, found, strict=True):
        half, share = mp.mpf(angle), mp.mpf(contraction)
        h = step * share * mp.cos(half)
        exact = pressure * (volume(share + h, half) - volume(share - h, half)) / (2 * h / mp.cos(half))
        # lambda + cos(2 theta) = 2 cos(theta)^2 - (1 - lambda) may cancel; differences are good to 1e-50.
        terms = (2 * mp.cos(half) ** 2 + (1 - share)) / (2 * abs(1 + share * mp.expj(2 * half)))
        assert_close(tension, exact, (TOLERANCE * terms + mp.mpf(10) ** -50) * pressure * mp.pi * size**2 / 4)


def test_tension_gives_the_collapse_moment_of_theory() -> None:
    """`T D = pi P r^3`: 5.23 N m at 10 kPa for r = 0.055 m, whatever the contraction, above 4.99 N m of section 1.1."""
    for contraction in (0.01, 0.5, 1.0):
        moment = 0.11 * float(helix.actuator_tension(contraction, 0.0, 0.11, 10e3))
        assert moment == pytest.approx(5.23, abs=5e-3)  # printed digits
        assert moment == pytest.approx(math.pi * 10e3 * 0.055**3, rel=1e-15)
    assert float(helix.actuator_tension(0.5, 0.3, 0.11, 0.0)) == 0.0
    assert float(helix.actuator_tension(0.1, 60 * DEG, 0.11, 10e3)) < 0.0  # lambda + cos 2theta = -0.4


# --- Arrays


def test_cases_along_leading_axes() -> None:
    shares, angles = np.linspace(0.5, 0.9, 4)[:, None], DEG * np.array([2.5, 5, 10])
    shape = helix.forward(shares, angles, D)
    s = np.linspace(0.0, 6.0, 7)[:, None, None]
    for path, handedness in itertools.product(PATHS, HANDEDNESS):
        assert helix.points(shape, s, path, handedness).shape == (7, 4, 3, 3)
        assert helix.frames(shape, s, path, handedness).shape == (7, 4, 3, 4, 4)
        assert helix.tangents(shape, s, path, handedness).shape == (7, 4, 3, 3)
        assert helix.normals(shape, s, path, handedness).shape == (7, 4, 3, 3)
        assert helix.binormals(shape, s, path, handedness).shape == (7, 4, 3, 3)
        assert helix.turn_angle(shape, s, path).shape == (7, 4, 3)
        assert helix.transform_base_to_axis(shape, handedness).shape == (4, 3, 4, 4)
        shapes = (
            helix.curvature_torsion(shape, path, handedness),
            helix.actuator_curvature_torsion(shares, angles, D, path, handedness),
        )
        assert [numbers.shape for pair in shapes for numbers in pair] == [(4, 3)] * 4
        one = helix.forward(float(shares[2, 0]), angles[1], D)
        # Arrays go through other loops than numbers: the last digit of sines and roots may differ.
        many = helix.frames(shape, s, path, handedness)[5, 2, 1]
        assert np.allclose(many, helix.frames(one, 5.0, path, handedness), rtol=0.0, atol=3e-15)
    assert helix.turns(shape, angles, 1.0).shape == helix.height(shape, angles, 1.0).shape == (4, 3)
    assert helix.length_for_turns(shape, angles, np.ones((2, 1, 1))).shape == (2, 4, 3)
    assert helix.centre_length(shares, angles, 1.0).shape == helix.volume(shares, angles, D, 1.0).shape == (4, 3)
    assert helix.material_twist(shares, angles, D).shape == (4, 3)
    assert helix.actuator_tension(shares, angles, D, np.ones((2, 1, 1))).shape == (2, 4, 3)
    single = helix.forward(0.66, 5 * DEG, D)
    assert helix.points(single, np.zeros(5)).shape == (5, 3)
    assert helix.points(single, 0.0).shape == (3,)
    assert helix.frames(single, 0.0).shape == (4, 4)
    assert [np.shape(number) for number in helix.actuator_curvature_torsion(0.66, 0.1, [D, D], "inner")] == [(2,), (2,)]


@law("helix.turns", "helix.length_for_turns")
@settings(max_examples=60)
@given(contractions_, angles_, diameters_)
def test_turns_and_length_for_turns_are_inverse(contraction: float, angle: float, diameter: float) -> None:
    if 1.0 - contraction < 1e-13 and angle < 1e-13:
        return
    shape = helix.forward(contraction, angle, diameter)
    for count in (1e-6, 1.5, 1e4):
        again = helix.turns(shape, angle, helix.length_for_turns(shape, angle, count))
        assert float(again) == pytest.approx(count, rel=1e-15)


# --- Refusals


NAN, INF = float("nan"), float("inf")
SHAPE = HelixShape(0.0854, 0.0523, 0.028)
PAIR = HelixShape([0.08, 0.09], 0.05, 0.02)
NUMBERS = (0.0854, 0.0523, 0.028)
BY_SHAPE = [helix.points, helix.tangents, helix.normals, helix.binormals, helix.frames]


@each_row("function", BY_SHAPE)
@each_row(
    ("arguments", "field"),
    [
        ((NUMBERS, 0.0), "shape"),
        ((None, 0.0), "shape"),
        ((SHAPE, NAN), "s"),
        ((SHAPE, [0.0, INF]), "s"),
        ((SHAPE, "whole"), "s"),
        ((SHAPE, 1e31), "s"),
        ((PAIR, [0.0, 0.1, 0.2]), "s"),  # shapes that do not broadcast
        ((SHAPE, 0.0, "middle"), "path"),
        ((SHAPE, 0.0, None), "path"),
        ((SHAPE, 0.0, "inner", "both"), "handedness"),
        ((SHAPE, 0.0, "inner", 1), "handedness"),
    ],
)
def test_curves_refuse_bad_input(function: Callable[..., Any], arguments: tuple[Any, ...], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        function(*arguments)
    assert caught.value.field == field


@each_row(
    "function",
    [
        helix.actuator_curvature_torsion,
        helix.material_twist,
        lambda *arguments: helix.volume(*arguments, 1.0),
        lambda *arguments: helix.actuator_tension(*arguments, 1e4),
    ],
)
@each_row(
    ("arguments", "field"),
    [
        ((0.0, 0.1, D), "contraction"),
        ((1.1, 0.1, D), "contraction"),
        ((NAN, 0.1, D), "contraction"),
        ((0.5, -0.1, D), "angle"),
        ((0.5, np.pi / 2, D), "angle"),
        ((0.5, NAN, D), "angle"),
        ((0.5, 0.1, 0.0), "diameter"),
        ((0.5, 0.1, -D), "diameter"),
        ((0.5, 0.1, INF), "diameter"),
        (([0.5, 0.6], 0.1, [D, D, D]), "diameter"),
    ],
)
def test_actuators_out_of_range_are_refused(function: Callable[..., Any], arguments: tuple[Any, ...], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        function(*arguments)
    assert caught.value.field == field


@each_row(
    ("call", "field"),
    [
        (lambda: helix.curvature_torsion(NUMBERS), "shape"),
        (lambda: helix.curvature_torsion(SHAPE, "middle"), "path"),
        (lambda: helix.curvature_torsion(SHAPE, "inner", "up"), "handedness"),
        (lambda: helix.actuator_curvature_torsion(0.5, 0.1, D, "middle"), "path"),
        (lambda: helix.actuator_curvature_torsion(0.5, 0.1, D, "inner", "up"), "handedness"),
        (lambda: helix.material_twist(0.5, 0.1, D, "up"), "handedness"),
        (lambda: helix.transform_base_to_axis(NUMBERS), "shape"),
        (lambda: helix.transform_base_to_axis(SHAPE, "up"), "handedness"),
        (lambda: helix.turn_angle(NUMBERS, 0.1), "shape"),
        (lambda: helix.turn_angle(SHAPE, NAN), "arc_length"),
        (lambda: helix.turn_angle(PAIR, [0.1, 0.2, 0.3]), "arc_length"),
        (lambda: helix.turn_angle(SHAPE, 0.1, "middle"), "path"),
        (lambda: helix.turns(NUMBERS, 0.1, 1.0), "shape"),
        (lambda: helix.turns(SHAPE, -0.1, 1.0), "angle"),
        (lambda: helix.turns(SHAPE, np.pi / 2, 1.0), "angle"),
        (lambda: helix.turns(SHAPE, NAN, 1.0), "angle"),
        (lambda: helix.turns(SHAPE, 0.1, 0.0), "length"),
        (lambda: helix.turns(SHAPE, 0.1, -1.0), "length"),
        (lambda: helix.turns(SHAPE, 0.1, INF), "length"),
        (lambda: helix.turns(PAIR, 0.1, [1.0, 2.0, 3.0]), "length"),
        (lambda: helix.height(NUMBERS, 0.1, 1.0), "shape"),
        (lambda: helix.height(SHAPE, np.pi / 2, 1.0), "angle"),
        (lambda: helix.height(SHAPE, 0.1, 0.0), "length"),
        (lambda: helix.length_for_turns(NUMBERS, 0.1, 1.0), "shape"),
        (lambda: helix.length_for_turns(SHAPE, np.pi / 2, 1.0), "angle"),
        (lambda: helix.length_for_turns(SHAPE, 0.1, 0.0), "turns"),
        (lambda: helix.length_for_turns(SHAPE, 0.1, NAN), "turns"),
        (lambda: helix.length_for_turns(PAIR, 0.1, [1.0, 2.0, 3.0]), "turns"),
        (lambda: helix.centre_length(1.1, 0.1, 1.0), "contraction"),
        (lambda: helix.centre_length(0.5, np.pi / 2, 1.0), "angle"),
        (lambda: helix.centre_length(0.5, 0.1, 0.0), "length"),
        (lambda: helix.centre_length([0.5, 0.6], 0.1, [1.0, 2.0, 3.0]), "length"),
        (lambda: helix.volume(0.5, 0.1, D, 0.0), "length"),
        (lambda: helix.volume([0.5, 0.6], 0.1, D, [1.0, 2.0, 3.0]), "length"),
        (lambda: helix.actuator_tension(0.5, 0.1, D, -1.0), "pressure"),
        (lambda: helix.actuator_tension(0.5, 0.1, D, NAN), "pressure"),
        (lambda: helix.actuator_tension([0.5, 0.6], 0.1, D, [1.0, 2.0, 3.0]), "pressure"),
    ],
)
def test_bad_input_is_refused(call: Callable[[], Any], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        call()
    assert caught.value.field == field
