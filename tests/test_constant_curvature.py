"""Arcs of constant curvature against mpmath at 60 digits, matrix exponentials, the paper's formulas and geometry."""

from __future__ import annotations

import functools
import itertools
import math
import pickle
import time
from collections.abc import Callable, Sequence
from dataclasses import FrozenInstanceError
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from softrobots import constant_curvature as cc
from softrobots.constant_curvature import Arc
from softrobots.core.errors import ParameterError
from tests.support.laws import law
from tests.support.tables import each_row

FRAMES = ("torsion_free", "bending_plane")
BENDINGS = (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, math.pi)
COILS = (6.25, 6.4, 30.0)  # about a turn and beyond
# The bending-plane frame has no derivative by muscle lengths when straight.
FRAMES_AND_BENDINGS = [
    (frame, bending) for frame in FRAMES for bending in BENDINGS if (frame, bending) != ("bending_plane", 0.0)
]
D = 0.04
UPPER, LOWER = (0.50, 0.53, 0.55), (0.54, 0.51, 0.52)  # docs/theory.md 2.3
UNEVEN = (0.3, 1.9, -1.1)
FIVE = (0.1, 1.2, 2.9, -2.2, -0.7)
ROUNDING = 4e-16  # a few units in the last place of a number of size 1

lengths_ = st.floats(0.05, 3.0)
# Below 1e-308 rad a float has fewer digits, and so has a direction made of two of them.
bendings_ = st.one_of(st.floats(0.0, 6.0, allow_subnormal=False), st.floats(1e-13, 1e-3))
angles_ = st.floats(-3.1, 3.1)


# --- Oracles: nothing here calls the package


def rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def screw(x: float, y: float, twist: float, length: float) -> np.ndarray:
    """Motion of a section of constant strain, by scipy."""
    return expm(np.array([[0.0, -twist, y, 0.0], [twist, 0.0, -x, 0.0], [-y, x, 0.0, length], [0.0, 0.0, 0.0, 0.0]]))


@functools.cache  # a chain differentiates one segment at a time
def exact_screw(x: Any, y: Any, twist: Any, length: Any) -> mp.matrix:
    """Motion of a section of constant strain, by mpmath."""
    return mp.expm(mp.matrix([[0, -twist, y, 0], [twist, 0, -x, 0], [-y, x, 0, length], [0, 0, 0, 0]]))


def exact_rotation_z(angle: Any) -> mp.matrix:
    c, s = mp.cos(angle), mp.sin(angle)
    return mp.matrix([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def exact_arc_pose(length: Any, bending: Any, azimuth: Any, frame: str) -> mp.matrix:
    pose = exact_screw(-bending * mp.sin(azimuth), bending * mp.cos(azimuth), 0, length)
    return pose * exact_rotation_z(azimuth) if frame == "bending_plane" else pose


def exact_muscle_pose(lengths: Sequence[Any], distance: Any, azimuths: Sequence[Any], frame: str) -> mp.matrix:
    """Normal equations of `l_i = l - d (b_x cos(phi_i) + b_y sin(phi_i))`, then the screw."""
    distance = mp.mpf(distance)
    design = mp.matrix([[1, -distance * mp.cos(phi), -distance * mp.sin(phi)] for phi in map(mp.mpf, azimuths)])
    length, bend_x, bend_y = mp.lu_solve(design.T * design, design.T * mp.matrix(list(lengths)))
    pose = exact_screw(-bend_y, bend_x, 0, length)
    return pose * exact_rotation_z(mp.atan2(bend_y, bend_x)) if frame == "bending_plane" else pose


def exact_chain(poses: Sequence[mp.matrix], offsets: Sequence[Any]) -> mp.matrix:
    product = mp.eye(4)
    for pose, offset in zip(poses, offsets, strict=True):
        product = product * exact_rotation_z(mp.mpf(offset)) * pose
    return product


def exact_jacobian(pose: Callable[..., mp.matrix], at: Sequence[float]) -> mp.matrix:
    """Central difference at 60 digits with a step of 1e-25: truncation and rounding lie below 1e-20 of the result."""
    at = [mp.mpf(float(number)) for number in at]
    rotation, step = pose(*at)[:3, :3], mp.mpf(10) ** -25
    jacobian = mp.zeros(6, len(at))
    for column in range(len(at)):
        ahead, behind = list(at), list(at)
        ahead[column] += step
        behind[column] -= step
        rate = (pose(*ahead) - pose(*behind)) / (2 * step)
        spin = rate[:3, :3] * rotation.T
        for row, entry in enumerate([rate[0, 3], rate[1, 3], rate[2, 3], spin[2, 1], spin[0, 2], spin[1, 0]]):
            jacobian[row, column] = entry
    return jacobian


def worst_error(found: np.ndarray, exact: mp.matrix, scale: bool = False) -> float:
    """Largest relative error, of each entry by itself (`scale=False`) or of its row's largest entry (`scale=True`).

    Entries below 1e-30 are zeros: of the matrices at hand, the smallest others are 1e-25.
    """
    assert found.shape == (exact.rows, exact.cols)
    worst = 0.0
    for row, column in itertools.product(range(exact.rows), range(exact.cols)):
        unit = max(abs(exact[row, j]) for j in range(exact.cols)) if scale else abs(exact[row, column])
        error = abs(mp.mpf(float(found[row, column])) - exact[row, column])
        if unit > mp.mpf(10) ** -30:
            worst = max(worst, float(error / unit))
        else:
            assert error < mp.mpf(10) ** -30
    return worst


def paper_lengths(bending: float, azimuth: float, azimuths: Sequence[float]) -> np.ndarray:
    """(20)-(22) written out."""
    return 0.5 - bending * D * np.cos(azimuth - np.array(azimuths))


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(60):
        yield


# --- Exact and smooth through straight
# Required: 1e-12 relative. Entries are compared one by one, so that the tilt of a nearly straight arc counts in full.


@each_row("bending", BENDINGS)
@each_row("frame", FRAMES)
@each_row("azimuth", [0.7, -2.5])
def test_pose_of_an_arc_is_exact(bending: float, frame: str, azimuth: float) -> None:
    exact = exact_arc_pose(mp.mpf(0.5), mp.mpf(bending), mp.mpf(azimuth), frame)
    assert worst_error(cc.transform(Arc(0.5, bending, azimuth), frame), exact) < 1e-12


@pytest.mark.study
@pytest.mark.parametrize("bending", BENDINGS + COILS)
@pytest.mark.parametrize("frame", FRAMES)
def test_derivatives_by_arc_are_exact(bending: float, frame: str) -> None:
    exact = exact_jacobian(lambda *arc: exact_arc_pose(*arc, frame), (0.5, bending, 0.7))
    assert worst_error(cc.arc_jacobian(Arc(0.5, bending, 0.7), frame), exact) < 1e-12


@pytest.mark.study
@pytest.mark.parametrize("bending", BENDINGS + COILS)
def test_pose_and_derivatives_by_strains_are_exact(bending: float) -> None:
    """Twist included: the Jacobian has its column although an arc has none."""
    strains = np.array([-bending * 0.6, bending * 0.8, 0.0, 0.5])
    # From a half turn on sines vanish, where the rounding of the bending remains: one row is one scale.
    half_turn = bending >= math.pi
    pose = cc.transform(cc.arc_from_strains(strains))
    assert worst_error(pose, exact_screw(*map(mp.mpf, strains)), half_turn) < 1e-12
    assert worst_error(cc.strain_jacobian(strains), exact_jacobian(exact_screw, strains), half_turn) < 1e-12


@pytest.mark.study
@each_row(("frame", "bending"), FRAMES_AND_BENDINGS)
@each_row("azimuths", [cc.AZIMUTHS, UNEVEN, FIVE])
def test_pose_and_derivatives_by_muscles_are_exact(frame: str, bending: float, azimuths: tuple[float, ...]) -> None:
    lengths = paper_lengths(bending, 0.7, azimuths)
    exact = exact_muscle_pose([mp.mpf(length) for length in lengths], D, azimuths, frame)
    half_turn = bending == math.pi  # as above
    assert worst_error(cc.transform(cc.arc_from_muscles(lengths, D, azimuths), frame), exact, half_turn) < 1e-12
    derivative = exact_jacobian(lambda *muscles: exact_muscle_pose(muscles, D, azimuths, frame), lengths)
    assert worst_error(cc.muscle_jacobian(lengths, D, azimuths, frame), derivative, half_turn) < 1e-12


def test_straight_is_straight() -> None:
    arc = cc.arc_from_muscles(np.full((4, 3), 0.524), D)
    assert np.array_equal(arc.bending, np.zeros(4))
    assert np.array_equal(arc.azimuth, np.zeros(4))
    straight = np.eye(4)
    straight[2, 3] = 0.524
    for frame in FRAMES:
        assert np.allclose(cc.transform(arc, frame), straight, rtol=0.0, atol=ROUNDING)
    assert float(cc.arc_from_strains([-0.0, -0.0, 0.0, 0.5]).azimuth) == 0.0  # atan2 of two negative zeros is pi


def test_root_of_the_papers_formula_loses_what_differences_keep() -> None:
    """(41) written out in floats loses all digits at a bending of 1e-9; its own number at 60 digits is what comes out here."""
    lengths = paper_lengths(1e-9, 0.7, cc.AZIMUTHS)

    def square(l1: Any, l2: Any, l3: Any) -> Any:
        return l1 * l1 + l2 * l2 + l3 * l3 - l1 * l2 - l1 * l3 - l2 * l3

    exact = float(2 * mp.sqrt(square(*map(mp.mpf, lengths))) / (3 * mp.mpf(D)))
    assert float(cc.arc_from_muscles(lengths, D).bending) == pytest.approx(exact, rel=1e-12)  # as everywhere here
    assert abs(2.0 * math.sqrt(abs(square(*lengths))) / (3.0 * D) / exact - 1.0) > 1e-3


@pytest.mark.parametrize(("lengths", "azimuth"), [((0.4, 0.6, 0.6), 0.0), ((0.6, 0.4, 0.4), math.pi)])
def test_equal_lengths_leave_no_trace_of_azimuth(lengths: tuple[float, ...], azimuth: float) -> None:
    """Two equal muscles bend the paper's segment in the x-z plane, away from the longer side; pi, never -pi."""
    assert float(cc.arc_from_muscles(lengths, D).azimuth) == azimuth


# --- The paper


def test_two_segments_of_theory() -> None:
    arcs = cc.arc_from_muscles([UPPER, LOWER], D)
    assert float(arcs.bending[0]) == pytest.approx(0.726483157, abs=5e-10)  # printed digits
    assert float(arcs.azimuth[0]) == pytest.approx(-0.408637855, abs=5e-10)
    printed = {
        "bending_plane": (0.41771528, -0.30235950, 0.87444230),
        "torsion_free": (0.44957382, -0.31544214, 0.84384418),
    }
    for frame, tip in printed.items():
        assert cc.chain_transform(arcs, frame=frame)[:3, 3] == pytest.approx(tip, abs=5e-9)  # printed digits
        assert np.array_equal(cc.chain_transform(arcs, (0.0, np.pi / 3), frame), cc.chain_transform(arcs, frame=frame))


@pytest.mark.parametrize("azimuth", np.deg2rad([10, 40, 100, 160, -170, -130, -60, -20]))
def test_arc_of_three_muscles_is_the_papers(azimuth: float) -> None:
    """(34) with the quadrant, (39), (40) and (41)."""
    l1, l2, l3 = paper_lengths(0.9, azimuth, cc.AZIMUTHS)
    root = math.sqrt(l1**2 + l2**2 + l3**2 - l1 * l2 - l1 * l3 - l2 * l3)
    arc = cc.arc_from_muscles([l1, l2, l3], D)
    # The paper's root cancels here by a factor of some hundred: 1e-13.
    assert float(arc.bending) == pytest.approx(2.0 * root / (3.0 * D), rel=1e-12)
    assert float(arc.length / arc.bending) == pytest.approx((l1 + l2 + l3) * D / (2.0 * root), rel=1e-12)
    assert float(arc.length) == pytest.approx((l1 + l2 + l3) / 3.0, rel=ROUNDING)
    assert float(arc.azimuth) == pytest.approx(azimuth, abs=1e-14)  # lengths are rounded at 1e-16 of 0.5 m, over 0.036 m
    plain = math.atan(math.sqrt(3.0) * (l2 - l3) / (l2 + l3 - 2.0 * l1))  # (34) as printed
    assert (abs(plain - azimuth) < 1e-12) == (abs(azimuth) < np.pi / 2)


@law("constant_curvature.transform")
@given(lengths_, st.floats(0.01, 6.0), angles_)
def test_pose_is_the_papers(length: float, theta: float, alpha: float) -> None:
    """(9) and (14), written out."""
    r, ct, stheta, ca, sa = length / theta, np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    paper = [
        [ca * ct, -sa, ca * stheta, r * ca * (1 - ct)],
        [sa * ct, ca, sa * stheta, r * sa * (1 - ct)],
        [-stheta, 0.0, ct, r * stheta],
        [0.0, 0.0, 0.0, 1.0],
    ]
    # The paper's r (1 - cos theta) loses two digits at 0.01 rad.
    assert np.allclose(cc.transform(Arc(length, theta, alpha), "bending_plane"), paper, rtol=0.0, atol=1e-13 * max(length, 1.0))


@law("constant_curvature.chain_transform")
@given(lengths_, st.floats(0.01, 6.0), angles_, lengths_, st.floats(0.01, 6.0), angles_)
def test_tip_of_two_segments_is_the_papers_corrected(
    l1: float, theta1: float, alpha1: float, l2: float, theta2: float, alpha2: float
) -> None:
    """(17)-(19) with the errors of print put right, with r_i = l_i / theta_i and beta = alpha_2 + 60 degrees."""
    r1, r2, beta = l1 / theta1, l2 / theta2, alpha2 + np.pi / 3
    c1, s1, c2, s2 = np.cos(theta1), np.sin(theta1), np.cos(theta2), np.sin(theta2)
    ca, sa, cb, sb = np.cos(alpha1), np.sin(alpha1), np.cos(beta), np.sin(beta)
    x = r2 * (ca * cb * c1 * (1 - c2) - sa * sb * (1 - c2) + ca * s1 * s2) + r1 * ca * (1 - c1)
    y = r2 * (sa * cb * c1 * (1 - c2) + ca * sb * (1 - c2) + sa * s1 * s2) + r1 * sa * (1 - c1)
    z = r2 * (-cb * s1 * (1 - c2) + c1 * s2) + r1 * s1
    arcs = [Arc(l1, theta1, alpha1), Arc(l2, theta2, alpha2)]
    tip = cc.chain_transform(arcs, frame="bending_plane")[:3, 3]
    assert np.allclose(tip, [x, y, z], rtol=0.0, atol=1e-13 * max(l1 + l2, 1.0))  # as above


def test_printed_third_component_is_wrong() -> None:
    """(19) as printed, ending in cos theta_1 cos theta_2, misses the tip of the reference by decimetres."""
    arcs = cc.arc_from_muscles([UPPER, LOWER], D)
    (t1, t2), (_, a2), (l1, l2) = arcs.bending, arcs.azimuth, arcs.length
    z = l2 / t2 * (-np.cos(a2 + np.pi / 3) * np.sin(t1) * (1 - np.cos(t2)) + np.cos(t1) * np.cos(t2)) + l1 / t1 * np.sin(t1)
    assert abs(z - cc.chain_transform(arcs, frame="bending_plane")[2, 3]) > 0.1


# --- Independent laws


@law("constant_curvature.transform", "constant_curvature.strains_from_arc")
@given(lengths_, bendings_, angles_)
def test_pose_is_a_matrix_exponential(length: float, theta: float, alpha: float) -> None:
    strains = cc.strains_from_arc(Arc(length, theta, alpha))
    assert np.allclose(strains, [-theta * np.sin(alpha), theta * np.cos(alpha), 0.0, length], rtol=ROUNDING, atol=0.0)
    motion = screw(*strains)
    tolerance = 1e-13 * max(length, 1.0)  # scipy scales and squares: its error grows with the norm of the matrix, up to 9 here
    assert np.allclose(cc.transform(Arc(length, theta, alpha)), motion, rtol=0.0, atol=tolerance)
    assert np.allclose(cc.transform(Arc(length, theta, alpha), "bending_plane"), motion @ rotation_z(alpha), atol=tolerance)


@pytest.mark.parametrize("bending", BENDINGS)
def test_pose_agrees_with_scipy_entry_by_entry(bending: float) -> None:
    motion = screw(-bending * np.sin(0.7), bending * np.cos(0.7), 0.0, 0.5)
    pose = cc.transform(Arc(0.5, bending, 0.7))
    # Below pi scipy keeps every entry to rounding; at pi it leaves rounding where sines vanish.
    assert np.allclose(pose, motion, rtol=1e-12, atol=1e-14 if bending == math.pi else 1e-26)


@pytest.mark.parametrize("azimuths", [cc.AZIMUTHS, FIVE])
@pytest.mark.parametrize("bending", [0.0, 0.3, 2.0])
def test_muscles_are_as_long_as_the_curves_beside_the_backbone(azimuths: tuple[float, ...], bending: float) -> None:
    """(20)-(22) from geometry: the length of the curve at a fixed place of the torsion-free cross-section."""
    lengths = cc.muscles_from_arc(Arc(0.5, bending, 0.7), D, azimuths)
    generator = np.array([[0.0, 0.0, bending * np.cos(0.7), 0.0], [0.0, 0.0, bending * np.sin(0.7), 0.0]])
    generator = np.vstack([generator, [-bending * np.cos(0.7), -bending * np.sin(0.7), 0.0, 0.5], np.zeros(4)])
    nodes, weights = np.polynomial.legendre.leggauss(5)
    speeds = [generator @ expm(0.5 * (1.0 + node) * generator) for node in nodes]
    for phi, length in zip(azimuths, lengths, strict=True):
        place = np.array([D * np.cos(phi), D * np.sin(phi), 0.0, 1.0])
        arc = sum(0.5 * weight * np.linalg.norm(speed @ place) for speed, weight in zip(speeds, weights, strict=True))
        assert length == pytest.approx(arc, rel=1e-13)  # the integrand is constant: quadrature adds rounding only


@pytest.mark.study
@law("constant_curvature.muscles_from_arc", "constant_curvature.arc_from_muscles")
@given(lengths_, st.floats(0.0, 1.0), angles_, st.floats(0.005, 0.04), st.sampled_from([cc.AZIMUTHS, UNEVEN, FIVE]))
def test_muscles_and_arc_are_inverse(
    length: float, theta: float, alpha: float, distance: float, azimuths: tuple[float, ...]
) -> None:
    arc = cc.arc_from_muscles(cc.muscles_from_arc(Arc(length, theta, alpha), distance, azimuths), distance, azimuths)
    # A length is stored to half a unit in the last place, which is this angle; UNEVEN's matrix multiplies it by less than 4.
    resolution = 4.0 * np.spacing(length) / distance
    assert float(arc.length) == pytest.approx(length, abs=4.0 * np.spacing(length))
    found = float(arc.bending) * np.exp(1j * float(arc.azimuth))
    assert abs(found - theta * np.exp(1j * alpha)) <= resolution + 4.0 * np.spacing(theta)


@law("constant_curvature.muscle_residual", "constant_curvature.arc_from_muscles", "constant_curvature.muscles_from_arc")
@given(st.lists(st.floats(0.45, 0.55), min_size=3, max_size=3), st.floats(0.02, 0.2), st.sampled_from([cc.AZIMUTHS, UNEVEN]))
def test_any_three_lengths_are_an_arc(lengths: list[float], distance: float, azimuths: tuple[float, ...]) -> None:
    assert float(cc.muscle_residual(lengths, distance, azimuths)) <= 1e-15  # rounding of 0.5 m
    arc = cc.arc_from_muscles(lengths, distance, azimuths)
    assert -np.pi < float(arc.azimuth) <= np.pi
    assert np.allclose(cc.muscles_from_arc(arc, distance, azimuths), lengths, rtol=0.0, atol=2e-15)  # the same, twice


@law("constant_curvature.arc_from_strains", "constant_curvature.strains_from_arc")
@given(bendings_, angles_, lengths_)
def test_strains_and_arc_are_inverse(theta: float, alpha: float, length: float) -> None:
    arc = cc.arc_from_strains(cc.strains_from_arc(Arc(length, theta, alpha)))
    assert float(arc.length) == length
    assert float(arc.bending) == pytest.approx(theta, rel=ROUNDING)
    assert float(arc.azimuth) == pytest.approx(alpha if theta > 0.0 else 0.0, abs=2 * ROUNDING)  # a unit of the last place of 3


@law("constant_curvature.muscle_residual", "constant_curvature.strains_from_muscles")
@given(st.lists(st.floats(0.4, 0.6), min_size=5, max_size=5))
def test_more_muscles_than_three_are_least_squares(lengths: list[float]) -> None:
    """NumPy's solver on the whole lengths; the residual is what it leaves."""
    design = np.array([[1.0, -D * np.cos(phi), -D * np.sin(phi)] for phi in FIVE])
    solution = np.linalg.lstsq(design, lengths, rcond=None)[0]
    missed = np.max(np.abs(design @ solution - lengths))
    assert float(cc.muscle_residual(lengths, D, FIVE)) == pytest.approx(missed, abs=1e-14)  # 0.5 m, condition number 35
    strains = cc.strains_from_muscles(lengths, D, FIVE, tolerance=1.0)
    assert np.allclose(strains, [-solution[2], solution[1], 0.0, solution[0]], rtol=0.0, atol=1e-13)  # the same over 0.04 m
    if missed > 1.01e-6:
        with pytest.raises(ParameterError, match="an arc within 1e-06 m"):
            cc.arc_from_muscles(lengths, D, FIVE)


@law("constant_curvature.transform")
@given(lengths_, bendings_, angles_, angles_)
def test_turning_the_azimuth_turns_the_arc(length: float, theta: float, alpha: float, turn: float) -> None:
    straight_on, turned = Arc(length, theta, alpha), Arc(length, theta, alpha + turn)
    rotation, tolerance = rotation_z(turn), {"rtol": 0.0, "atol": 4 * ROUNDING * max(length, 1.0)}
    assert np.allclose(
        cc.transform(turned, "bending_plane"), rotation @ cc.transform(straight_on, "bending_plane"), **tolerance
    )
    assert np.allclose(cc.transform(turned), rotation @ cc.transform(straight_on) @ rotation.T, **tolerance)


@pytest.mark.study
@law("constant_curvature.chain_transform", "constant_curvature.transform")
@given(lengths_, bendings_, angles_, st.floats(0.0, 1.0))
def test_parts_of_an_arc_make_the_arc(length: float, theta: float, alpha: float, part: float) -> None:
    """Torsion-free, the azimuth stays; in the bending-plane frame the second part bends straight on."""
    for frame, ahead in (("torsion_free", alpha), ("bending_plane", 0.0)):
        parts = [Arc(part * length, part * theta, alpha), Arc((1.0 - part) * length, (1.0 - part) * theta, ahead)]
        whole = cc.transform(Arc(length, theta, alpha), frame)
        # A dozen products and sums of numbers up to `length`.
        assert np.allclose(cc.chain_transform(parts, (0.0, 0.0), frame), whole, rtol=0.0, atol=8 * ROUNDING * max(length, 1.0))


@law("constant_curvature.transform")
@given(lengths_, bendings_, angles_)
def test_poses_are_rigid(length: float, theta: float, alpha: float) -> None:
    for frame in FRAMES:
        pose = cc.transform(Arc(length, theta, alpha), frame)
        assert np.allclose(pose[:3, :3].T @ pose[:3, :3], np.eye(3), rtol=0.0, atol=4 * ROUNDING)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0, abs=4 * ROUNDING)
        assert pose[3].tolist() == [0.0, 0.0, 0.0, 1.0]


@law("constant_curvature.backbone")
@given(lengths_, st.floats(0.05, 6.0), angles_)
def test_backbone_is_a_circle(length: float, theta: float, alpha: float) -> None:
    points = cc.backbone(Arc(length, theta, alpha), np.linspace(0.0, 1.0, 11))
    radius = length / theta
    centre = radius * np.array([np.cos(alpha), np.sin(alpha), 0.0])
    assert np.allclose(np.linalg.norm(points - centre, axis=1), radius, rtol=1e-14, atol=0.0)  # a sum of three squares
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    chord = 2.0 * radius * math.sin(theta / 20.0)
    assert np.allclose(steps, chord, rtol=0.0, atol=1e-14 * max(radius, 1.0))  # differences of numbers up to the radius
    assert np.array_equal(points[0], np.zeros(3))
    motion = screw(-theta * np.sin(alpha), theta * np.cos(alpha), 0.0, length)
    assert np.allclose(points[-1], motion[:3, 3], rtol=0.0, atol=1e-13 * max(length, 1.0))  # scipy, as above


def test_an_offset_turns_the_frame_not_the_azimuth() -> None:
    """`Rz(offset) T(alpha) = T(alpha + offset)` in the bending-plane frame only: docs/theory.md 2.2."""
    arc, turned = Arc(0.5, 0.8, 0.7), Arc(0.5, 0.8, 1.3)
    for frame in FRAMES:
        difference = cc.chain_transform([arc], (0.6,), frame) - cc.transform(turned, frame)
        assert np.max(np.abs(difference[:3, 3])) < ROUNDING
        assert (np.max(np.abs(difference)) < 2 * ROUNDING) == (frame == "bending_plane")


# --- Chains


THREE = [(0.5, 0.9, 0.7), (0.4, 1.7, -2.1), (0.6, 0.3, 1.4)]
OFFSETS = {2: (0.0, math.pi / 3.0), 3: (0.2, -0.9, 1.5)}


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("count", [2, 3])
def test_chains_and_their_derivatives_are_exact(count: int, frame: str) -> None:
    arcs, offsets = [Arc(*arc) for arc in THREE[:count]], OFFSETS[count]

    def pose(*numbers: Any) -> mp.matrix:
        poses = [exact_arc_pose(*numbers[3 * i : 3 * i + 3], frame) for i in range(count)]
        return exact_chain(poses, offsets)

    at = np.ravel(THREE[:count])
    # Entries are sums of terms up to 2 m, and some nearly cancel: each row is one scale.
    assert worst_error(cc.chain_transform(arcs, offsets, frame), pose(*map(mp.mpf, at)), scale=True) < 1e-12
    assert worst_error(cc.chain_arc_jacobian(arcs, offsets, frame), exact_jacobian(pose, at), scale=True) < 1e-12


@pytest.mark.study
@pytest.mark.parametrize(("frame", "bending"), FRAMES_AND_BENDINGS)
def test_derivatives_of_a_chain_by_muscles_are_exact(frame: str, bending: float) -> None:
    """The paper's arm, with another muscle distance in each segment."""
    lengths = np.array([paper_lengths(bending, 0.7, cc.AZIMUTHS), paper_lengths(0.5 * bending, -2.0, cc.AZIMUTHS)])
    distances = (D, 0.03)

    def pose(*muscles: Any) -> mp.matrix:
        poses = [exact_muscle_pose(muscles[3 * i : 3 * i + 3], distances[i], cc.AZIMUTHS, frame) for i in range(2)]
        return exact_chain(poses, OFFSETS[2])

    exact = exact_jacobian(pose, lengths.ravel())
    assert worst_error(cc.chain_muscle_jacobian(lengths, distances, frame=frame), exact, scale=True) < 1e-12  # as above


def test_poses_of_all_segment_ends() -> None:
    arcs, offsets = [Arc(*arc) for arc in THREE], OFFSETS[3]
    poses, product = cc.chain_transforms(arcs, offsets), np.eye(4)
    assert poses.shape == (3, 4, 4)
    for pose, (length, bending, azimuth), offset in zip(poses, THREE, offsets, strict=True):
        product = product @ rotation_z(offset) @ screw(-bending * np.sin(azimuth), bending * np.cos(azimuth), 0.0, length)
        assert np.allclose(pose, product, rtol=0.0, atol=1e-14)  # scipy's exponential, three times


def test_default_offsets_are_sixty_degrees_between_segments() -> None:
    for count in (1, 2, 4):
        arcs = Arc(0.5, np.linspace(0.2, 0.9, count), 0.4)
        third = math.pi / 3.0
        assert np.array_equal(cc.chain_transform(arcs), cc.chain_transform(arcs, (0.0, third, third, third)[:count]))


# --- Arrays


def test_leading_axes_are_separate_cases(rng: np.random.Generator) -> None:
    lengths = rng.uniform(0.45, 0.55, (4, 2, 3))
    distances = np.array([0.04, 0.05])
    arcs = cc.arc_from_muscles(lengths, distances)
    assert arcs.shape == (4, 2)
    for frame in FRAMES:
        tips, columns = cc.chain_transform(arcs, frame=frame), cc.chain_muscle_jacobian(lengths, distances, frame=frame)
        by_arc, points = cc.chain_arc_jacobian(arcs, frame=frame), cc.backbone(arcs, [0.3, 1.0])
        shapes = (tips.shape, columns.shape, by_arc.shape, points.shape)
        assert shapes == ((4, 4, 4), (4, 6, 6), (4, 6, 6), (4, 2, 2, 3))
        for case in range(4):
            each = [cc.arc_from_muscles(lengths[case, i], distances[i]) for i in range(2)]
            # One case by itself goes through other loops of the same sums: rounding, of Jacobians up to 1 / (d theta).
            assert np.allclose(tips[case], cc.chain_transform(each, frame=frame), rtol=1e-13, atol=1e-14)
            one = cc.chain_muscle_jacobian(lengths[case], distances, frame=frame)
            assert np.allclose(columns[case], one, rtol=1e-12, atol=1e-12)
            assert np.allclose(by_arc[case], cc.chain_arc_jacobian(each, frame=frame), rtol=1e-13, atol=1e-14)
            assert np.allclose(points[case, 1], cc.backbone(each[1], [0.3, 1.0]), rtol=1e-13, atol=1e-14)


def test_shapes_broadcast() -> None:
    arcs = Arc(0.5, np.linspace(0.0, 1.0, 5)[:, None], [0.1, 0.2, 0.3])
    assert arcs.shape == arcs.length.shape == arcs.azimuth.shape == (5, 3)
    assert cc.muscles_from_arc(arcs, [0.02, 0.03, 0.04], FIVE).shape == (5, 3, 5)
    assert cc.muscles_from_arc(Arc(0.5, 0.3, 0.2), [0.02, 0.03]).shape == (2, 3)
    assert cc.muscle_residual(UPPER, [0.02, 0.03]).shape == (2,)
    assert cc.muscle_jacobian(UPPER, [0.02, 0.03]).shape == (2, 6, 3)
    assert cc.chain_transforms([Arc(0.5, 0.3, 0.2), arcs]).shape == (5, 3, 2, 4, 4)
    assert cc.arc_from_muscles(np.zeros((0, 3)), D).shape == (0,)


def test_arcs_are_frozen() -> None:
    given_length = np.array([0.5, 0.6])
    arc = Arc(given_length, 0.3, 0.2)
    given_length[0] = -1.0
    assert arc.length.tolist() == [0.5, 0.6]
    with pytest.raises(FrozenInstanceError):
        arc.bending = np.zeros(2)  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        arc.bending[0] = 1.0
    assert pickle.loads(pickle.dumps(arc)).length.tolist() == [0.5, 0.6]


@pytest.mark.study
@pytest.mark.filterwarnings("ignore::softrobots.SuspiciousInputWarning")  # sizes of any kind are meant
@law("constant_curvature.arc_from_muscles", "constant_curvature.arc_jacobian", "constant_curvature.muscle_jacobian")
@settings(max_examples=200)
@given(st.lists(st.floats(1e-30, 1e30), min_size=3, max_size=3), st.floats(1e-30, 1e30), st.sampled_from(FRAMES))
def test_no_number_is_lost_at_the_ends_of_the_range(lengths: list[float], distance: float, frame: str) -> None:
    """Whatever is accepted gives finite numbers."""
    try:
        arc = cc.arc_from_muscles(lengths, distance)
    except ParameterError:
        return
    assert np.all(np.isfinite(cc.transform(arc, frame)))
    assert np.all(np.isfinite(cc.arc_jacobian(arc, frame)))
    if frame == "torsion_free" or float(arc.bending) > 0.0:
        assert np.all(np.isfinite(cc.muscle_jacobian(lengths, distance, frame=frame)))


# --- Refusals


NAN = float("nan")
ARC = Arc(0.5, 0.8, 0.7)
INCONSISTENT = (0.5, 0.52, 0.5, 0.52, 0.5)


@each_row(
    ("call", "field"),
    [
        (lambda: Arc(-0.5, 0.1, 0.0), "length"),
        (lambda: Arc(NAN, 0.1, 0.0), "length"),
        (lambda: Arc("long", 0.1, 0.0), "length"),
        (lambda: Arc(0.5, -0.1, 0.0), "bending"),
        (lambda: Arc(0.5, [0.1, NAN], 0.0), "bending"),
        (lambda: Arc(0.5, 0.1, float("inf")), "azimuth"),
        (lambda: Arc([0.5, 0.5], [0.1, 0.1, 0.1], 0.0), "azimuth"),
        (lambda: cc.strains_from_arc((0.5, 0.1, 0.0)), "arc"),
        (lambda: cc.arc_from_strains(0.5), "strains"),
        (lambda: cc.arc_from_strains([0.1, 0.2, 0.5]), "strains"),
        (lambda: cc.arc_from_strains([0.1, 0.2, 1e-9, 0.5]), "strains"),
        (lambda: cc.arc_from_strains([0.1, 0.2, 0.0, -0.5]), "strains"),
        (lambda: cc.arc_from_strains([0.1, NAN, 0.0, 0.5]), "strains"),
        (lambda: cc.strain_jacobian([0.1, 0.2, 0.3, 0.5]), "strains"),
        (lambda: cc.arc_from_muscles(UPPER, 0.0), "distance"),
        (lambda: cc.arc_from_muscles(UPPER, -D), "distance"),
        (lambda: cc.arc_from_muscles(UPPER, NAN), "distance"),
        (lambda: cc.arc_from_muscles([UPPER, LOWER], [D, D, D]), "distance"),
        (lambda: cc.arc_from_muscles((0.5, 0.5), D), "lengths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, 0.5, 0.5), D), "lengths"),
        (lambda: cc.arc_from_muscles(0.5, D), "lengths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, 0.0), D), "lengths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, -0.5), D), "lengths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, NAN), D), "lengths"),
        (lambda: cc.arc_from_muscles(INCONSISTENT, D, FIVE), "lengths"),
        (lambda: cc.arc_from_muscles((0.1, 0.9, 0.1), D, (-0.5, 0.0, 0.5)), "lengths"),  # a backbone of -5.6 m
        (lambda: cc.arc_from_muscles(UPPER, D, tolerance=-1.0), "tolerance"),
        (lambda: cc.arc_from_muscles(UPPER, D, tolerance=NAN), "tolerance"),
        (lambda: cc.arc_from_muscles((0.5, 0.5), D, (0.0, 2.0)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, (0.0, 2.0, 2.0)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, (0.0, 2.0, 2.0 * np.pi)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, (0.0, 2.0, 2.0 - 2.0 * np.pi)), "azimuths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, 0.5, 0.5), D, (0.0, -1e-17, 2.0, 4.0)), "azimuths"),
        (lambda: cc.arc_from_muscles((0.5, 0.5, 0.5, 0.5), D, (0.0, 2.0, 4.0, 2.0 + 2.0 * np.pi)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, (0.0, 1e-4, 2e-4)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, (0.0, 2.0, NAN)), "azimuths"),
        (lambda: cc.arc_from_muscles(UPPER, D, [cc.AZIMUTHS]), "azimuths"),
        (lambda: cc.muscle_residual((0.5, 0.5), D), "lengths"),
        (lambda: cc.muscle_residual(UPPER, 0.0), "distance"),
        (lambda: cc.muscle_residual(UPPER, D, (0.0, 0.0, 1.0)), "azimuths"),
        (lambda: cc.muscles_from_arc((0.5, 0.8, 0.7), D), "arc"),
        (lambda: cc.muscles_from_arc(Arc(0.5, 13.0, 0.0), D), "arc"),  # bent more sharply than the muscle is far
        (lambda: cc.muscles_from_arc(Arc(0.0, 0.0, 0.0), D), "arc"),
        (lambda: cc.muscles_from_arc(ARC, 0.0), "distance"),
        (lambda: cc.muscles_from_arc(Arc([0.5, 0.5], 0.1, 0.0), [D, D, D]), "distance"),
        (lambda: cc.muscles_from_arc(ARC, D, (0.0, 1.0)), "azimuths"),
        (lambda: cc.transform((0.5, 0.8, 0.7)), "arc"),
        (lambda: cc.transform(ARC, "paper"), "frame"),
        (lambda: cc.transform(ARC, None), "frame"),
        (lambda: cc.backbone(ARC, 0.5), "s"),
        (lambda: cc.backbone(ARC, [0.5, 1.1]), "s"),
        (lambda: cc.backbone(ARC, [-0.1]), "s"),
        (lambda: cc.backbone(ARC, [NAN]), "s"),
        (lambda: cc.backbone(None, [0.5]), "arc"),
        (lambda: cc.chain_transform(ARC), "arcs"),
        (lambda: cc.chain_transform(Arc(np.zeros(0), 0.0, 0.0)), "arcs"),
        (lambda: cc.chain_transform([]), "arcs"),
        (lambda: cc.chain_transform([ARC, (0.5, 0.8, 0.7)]), "arcs"),
        (lambda: cc.chain_transform(None), "arcs"),
        (lambda: cc.chain_transform([Arc([0.5, 0.5], 0.1, 0.0), Arc([0.5] * 3, 0.1, 0.0)]), "arcs"),
        (lambda: cc.chain_transform([ARC, ARC], (0.0,)), "offsets"),
        (lambda: cc.chain_transform([ARC, ARC], (0.0, NAN)), "offsets"),
        (lambda: cc.chain_transform([ARC, ARC], frame="paper"), "frame"),
        (lambda: cc.chain_transforms([ARC], 0.0), "offsets"),
        (lambda: cc.arc_jacobian((0.5, 0.8, 0.7)), "arc"),
        (lambda: cc.arc_jacobian(ARC, "paper"), "frame"),
        (lambda: cc.chain_arc_jacobian(ARC), "arcs"),
        (lambda: cc.chain_arc_jacobian([ARC], (0.0, 0.0)), "offsets"),
        (lambda: cc.muscle_jacobian(UPPER, D, frame="paper"), "frame"),
        (lambda: cc.muscle_jacobian((0.5, 0.5, 0.5), D, frame="bending_plane"), "lengths"),
        (lambda: cc.muscle_jacobian(INCONSISTENT, D, FIVE), "lengths"),
        (lambda: cc.muscle_jacobian(UPPER, 0.0), "distance"),
        (lambda: cc.chain_muscle_jacobian(UPPER, D), "lengths"),
        (lambda: cc.chain_muscle_jacobian([UPPER, LOWER], [D, D, D]), "distance"),
        (lambda: cc.chain_muscle_jacobian([UPPER, LOWER], D, offsets=(0.0,)), "offsets"),
        (lambda: cc.chain_muscle_jacobian([UPPER, (0.5, 0.5, 0.5)], D, frame="bending_plane"), "lengths"),
        (lambda: cc.chain_muscle_jacobian(["one", "two"], D), "lengths"),
        (lambda: cc.chain_muscle_jacobian([UPPER, (0.5, 0.5)], D), "lengths"),
    ],
)
def test_bad_input_is_refused(call: Callable[[], Any], field: str) -> None:
    with pytest.raises(ParameterError, match=field) as caught:
        call()
    assert caught.value.field == field


def test_many_arcs_are_each_of_them() -> None:
    """Every function of arcs or lengths in an array answers for each element what it answers for that alone."""
    random = np.random.default_rng(5)
    length, bending, azimuth = random.uniform(0.2, 0.6, (2, 3)), random.uniform(0.1, 1.0, (2, 3)), random.uniform(-3, 3, (2, 3))
    arcs, distance = Arc(length, bending, azimuth), random.uniform(0.02, 0.04, 3)
    lengths = cc.muscles_from_arc(arcs, distance)
    assert lengths.shape == (2, 3, 3)
    for place in itertools.product(range(2), range(3)):
        own, apart = Arc(length[place], bending[place], azimuth[place]), distance[place[1]]
        assert np.array_equal(cc.strains_from_arc(arcs)[place], cc.strains_from_arc(own))
        assert np.array_equal(lengths[place], cc.muscles_from_arc(own, apart))
        assert np.array_equal(cc.strains_from_muscles(lengths, distance)[place], cc.strains_from_muscles(lengths[place], apart))
        assert np.array_equal(cc.muscle_residual(lengths, distance)[place], cc.muscle_residual(lengths[place], apart))
    assert cc.muscle_residual(lengths[0, 0], distance).shape == (3,)
    assert cc.muscle_residual(lengths, 0.03).shape == (2, 3)


def test_four_muscles_may_miss_an_arc_by_a_micrometre() -> None:
    """The default tolerance of everything that takes lengths."""
    azimuths = np.array([0.0, 0.5, 1.0, 1.5]) * np.pi
    off = np.array([1.0, -1.0, 1.0, -1.0])  # no arc has any of it: all of it is missed
    calls = (
        cc.strains_from_muscles,
        cc.arc_from_muscles,
        cc.muscle_jacobian,
        lambda *given: cc.chain_muscle_jacobian([given[0]] * 2, *given[1:]),
    )
    for call in calls:
        call(0.5 + 0.99e-6 * off, 0.03, azimuths)
        with pytest.raises(ParameterError, match=r"within 1e-06 m \(they miss it by 1.01e-06 m\)") as caught:
            call(0.5 + 1.01e-6 * off, 0.03, azimuths)
        assert caught.value.field == "lengths"
        assert np.allclose(caught.value.value, 0.5 + 1.01e-6 * off, rtol=0.0, atol=1e-15)


def test_the_tolerance_itself_is_within() -> None:
    lengths = (0.50, 0.53, 0.55, 0.51)
    azimuths = np.array([0.0, 0.5, 1.0, 1.5]) * np.pi
    missed = float(cc.muscle_residual(lengths, D, azimuths))
    assert missed > 1e-3
    cc.strains_from_muscles(lengths, D, azimuths, tolerance=missed)
    with pytest.raises(ParameterError, match="within"):
        cc.strains_from_muscles(lengths, D, azimuths, tolerance=math.nextafter(missed, 0.0))


def test_azimuths_a_nanoradian_apart_are_two() -> None:
    cc.strains_from_muscles((0.5, 0.5, 0.5, 0.5), D, (0.0, 1e-9, 2.0, 4.0))
    with pytest.raises(ParameterError, match="distinct modulo a turn"):
        cc.strains_from_muscles((0.5, 0.5, 0.5, 0.5), D, (0.0, math.nextafter(1e-9, 0.0), 2.0, 4.0))


def test_the_shortest_backbone_is_longer_than_nothing() -> None:
    """Of two neighbouring lengths of a muscle one is refused; with these, the other would make a backbone of exactly zero."""
    azimuths, pair = (0.0, 1.0, 2.0), (0.6732655185893088, 0.7497114868223407)
    refused, taken = 0.1, 0.2
    while (middle := 0.5 * (refused + taken)) not in (refused, taken):
        try:
            backbone = cc.strains_from_muscles((*pair, middle), D, azimuths)[3]
            taken = middle
        except ParameterError as error:
            refused, refusal = middle, error
    assert 0.0 < backbone < 1e-15
    assert refusal.field == "lengths"
    assert np.array_equal(refusal.value, (*pair, refused))
    assert "a backbone of positive length (it has " in refusal.requirement


@given(lengths_, lengths_)
def test_equal_muscles_on_either_side_bend_in_the_plane_of_the_third(front: float, sides: float) -> None:
    """Of the paper's three muscles: exactly, so that the azimuth is 0, or pi."""
    bend = cc.strains_from_muscles((front, sides, sides), D)
    assert bend[0] == 0.0
    assert cc.arc_from_muscles((front, sides, sides), D).azimuth in (0.0, math.pi)


def test_a_straight_segment_without_a_bending_plane_is_told_with_all_lengths() -> None:
    lengths = [UPPER, (0.5, 0.5, 0.5)]
    with pytest.raises(ParameterError) as caught:
        cc.chain_muscle_jacobian(lengths, D, frame="bending_plane")
    assert caught.value.value is lengths
    assert "use 'torsion_free'" in caught.value.requirement


@pytest.mark.study
@pytest.mark.parametrize("azimuths", [cc.AZIMUTHS, (0.1, 1.2, 2.9, -2.2)])
def test_a_million_arcs_take_less_than_half_a_second(azimuths: tuple[float, ...]) -> None:
    """CPU time, the better of two; and arcs come back as the muscles that were made from them, to 1e-12."""
    random = np.random.default_rng(0)
    arcs = Arc(random.uniform(0.5, 0.6, 1_000_000), random.uniform(0.0, 3.0, 1_000_000), random.uniform(-3.1, 3.1, 1_000_000))
    lengths = cc.muscles_from_arc(arcs, D, azimuths)
    taken = []
    for _ in range(2):
        start = time.process_time()
        found = cc.arc_from_muscles(lengths, D, azimuths)
        taken.append(time.process_time() - start)
    assert min(taken) < 0.5
    assert np.abs(found.bending - arcs.bending).max() < 1e-12
    assert np.abs(found.length - arcs.length).max() < 1e-12
