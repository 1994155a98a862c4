"""Laws of `constant_curvature`: derivatives through straight, symmetries of muscles and arcs, chains of chains."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softrobots import ParameterError
from softrobots import constant_curvature as cc
from softrobots.constant_curvature import Arc
from tests.support.laws import law

FRAMES = ("torsion_free", "bending_plane")
STEP = 1e-5
DIFFERENCES = 2e-9  # STEP^2 / 6 times third derivatives of some tens (of polar coordinates and 3 segments), rounding / STEP

lengths_ = st.floats(0.05, 2.0)
bendings_ = st.one_of(st.floats(-9.0, -3.0).map(lambda exponent: 10.0**exponent), st.floats(1e-3, 3.0), st.just(0.0))
azimuths_ = st.floats(-np.pi, np.pi)
arcs_ = st.builds(Arc, lengths_, bendings_, azimuths_)
bent_ = st.builds(Arc, lengths_, st.floats(0.05, 3.0), azimuths_)
frames_ = st.sampled_from(FRAMES)


@st.composite
def muscles(draw: Callable[..., Any], count: int | None = None) -> np.ndarray:
    """Azimuths of some muscles, no two within 17 degrees."""
    number = draw(st.integers(3, 6)) if count is None else count
    slots = np.arange(number) + np.array(draw(st.lists(st.floats(-0.35, 0.35), min_size=number, max_size=number)))
    return np.array(draw(st.permutations(list(2.0 * np.pi * slots / number + draw(azimuths_)))))


def around_z(angle: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    return pose


def velocity(pose_at: Callable[[np.ndarray], np.ndarray], at: np.ndarray) -> np.ndarray:
    """Velocity of the point and angular velocity per coordinate, by central differences, shape (6, n)."""
    here, columns = pose_at(at)[:3, :3], []
    for unit in np.eye(len(at)):
        rate = (pose_at(at + STEP * unit) - pose_at(at - STEP * unit)) / (2.0 * STEP)
        turn = rate[:3, :3] @ here.T
        columns.append(
            [*rate[:3, 3], *(0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]))]
        )
    return np.array(columns).T


# --- Derivatives


@law("constant_curvature.strain_jacobian", "constant_curvature.arc_from_strains")
@settings(max_examples=40)
@given(arcs_)
def test_strain_jacobian_is_the_velocity_of_the_tip(arc: Arc) -> None:
    """Bending and length, straight or nearly so too; of the twist the linear part at first order only, so not here."""
    z = cc.strains_from_arc(arc)

    def pose(moved: np.ndarray) -> np.ndarray:
        return cc.transform(cc.arc_from_strains([moved[0], moved[1], 0.0, moved[2]]))

    found = cc.strain_jacobian(z)[:, [0, 1, 3]]
    assert np.allclose(found, velocity(pose, z[[0, 1, 3]]), rtol=0.0, atol=DIFFERENCES)


@law("constant_curvature.arc_jacobian")
@settings(max_examples=40)
@given(st.builds(Arc, lengths_, st.floats(1.01 * STEP, 3.0), azimuths_), frames_)
def test_arc_jacobian_is_the_velocity_of_the_tip(arc: Arc, frame: str) -> None:
    def pose(moved: np.ndarray) -> np.ndarray:
        return cc.transform(Arc(*moved), frame)

    at = np.array([arc.length, arc.bending, arc.azimuth])
    assert np.allclose(cc.arc_jacobian(arc, frame), velocity(pose, at), rtol=0.0, atol=DIFFERENCES)


@law("constant_curvature.arc_jacobian", "constant_curvature.strain_jacobian", "constant_curvature.strains_from_arc")
@settings(max_examples=40)
@given(arcs_)
def test_arc_jacobian_is_the_strain_jacobian_in_polar_coordinates(arc: Arc) -> None:
    """Exactly, however small the bending: one goes by sines of the azimuth, the other by products of the strains."""
    theta, alpha = float(arc.bending), float(arc.azimuth)
    polar = np.zeros((4, 3))
    polar[:, 0] = [0.0, 0.0, 0.0, 1.0]
    polar[:, 1] = [-math.sin(alpha), math.cos(alpha), 0.0, 0.0]
    polar[:, 2] = [-theta * math.cos(alpha), -theta * math.sin(alpha), 0.0, 0.0]
    found = cc.arc_jacobian(arc)
    # Relative to a column: the last one is as small as the bending.
    allowed = 1e-14 * np.maximum(np.abs(polar).max(axis=0), 1e-300) * max(1.0, float(arc.length))
    assert np.all(np.abs(found - cc.strain_jacobian(cc.strains_from_arc(arc)) @ polar) <= allowed)


@law("constant_curvature.muscle_jacobian", "constant_curvature.muscles_from_arc", "constant_curvature.arc_from_muscles")
@settings(max_examples=40)
@given(bent_, st.floats(0.01, 0.1), muscles(3), frames_, st.floats(-7.0, 0.0).map(lambda exponent: 10.0**exponent))
def test_muscle_jacobian_is_the_velocity_of_the_tip(
    arc: Arc, share: float, azimuths: np.ndarray, frame: str, straighten: float
) -> None:
    """Any three muscles; nearly straight in the torsion-free frame only, where the other one has no small derivatives."""
    if frame == "torsion_free":
        arc = Arc(arc.length, straighten * arc.bending, arc.azimuth)
    distance = share * float(arc.length)
    lengths = cc.muscles_from_arc(arc, distance, azimuths)

    def pose(moved: np.ndarray) -> np.ndarray:
        return cc.transform(cc.arc_from_muscles(distance * moved, distance, azimuths), frame)

    # In units of the distance, so that a step bends by as much as it is; a muscle a short way from the others bends more.
    found = distance * cc.muscle_jacobian(lengths, distance, azimuths, frame)
    bends = float(np.linalg.norm(found[3:], axis=0).max())
    assert np.allclose(found, velocity(pose, lengths / distance), rtol=0.0, atol=DIFFERENCES * max(bends, 1.0) ** 3)


@law("constant_curvature.chain_arc_jacobian", "constant_curvature.chain_transform")
@settings(max_examples=15)
@given(st.lists(bent_, min_size=1, max_size=3), st.lists(azimuths_, min_size=3, max_size=3), frames_)
def test_chain_arc_jacobian_is_the_velocity_of_the_tip(arcs: list[Arc], turns: list[float], frame: str) -> None:
    offsets, at = turns[: len(arcs)], np.array([[arc.length, arc.bending, arc.azimuth] for arc in arcs])

    def pose(moved: np.ndarray) -> np.ndarray:
        return cc.chain_transform(Arc(*moved.reshape(-1, 3).T), offsets, frame)

    assert np.allclose(
        cc.chain_arc_jacobian(arcs, offsets, frame), velocity(pose, at.ravel()), rtol=0.0, atol=10.0 * DIFFERENCES
    )


@law("constant_curvature.chain_muscle_jacobian")
@settings(max_examples=15)
@given(st.lists(bent_, min_size=1, max_size=3), frames_)
def test_chain_muscle_jacobian_is_the_velocity_of_the_tip(arcs: list[Arc], frame: str) -> None:
    distances = np.array([0.1 * float(arc.length) for arc in arcs])
    lengths = np.array([cc.muscles_from_arc(arc, d) for arc, d in zip(arcs, distances, strict=True)])

    def pose(moved: np.ndarray) -> np.ndarray:
        return cc.chain_transform(cc.arc_from_muscles(distances[:, None] * moved.reshape(-1, 3), distances), None, frame)

    found = cc.chain_muscle_jacobian(lengths, distances, frame=frame) * np.repeat(distances, 3)
    expected = velocity(pose, (lengths / distances[:, None]).ravel())
    turns = float(np.linalg.norm(found[3:], axis=0).max())  # in the bending plane as the reciprocal of the bending
    assert np.allclose(found, expected, rtol=0.0, atol=10.0 * DIFFERENCES * max(turns, 1.0) ** 3)


# --- Muscles


def columns(lengths: np.ndarray, distance: float, azimuths: np.ndarray) -> np.ndarray:
    return cc.muscle_jacobian(lengths, distance, azimuths, tolerance=1.0)


@law("constant_curvature.strains_from_muscles", "constant_curvature.muscle_jacobian", "constant_curvature.muscle_residual")
@settings(max_examples=40)
@given(muscles(), st.data())
def test_the_order_of_the_muscles_does_not_matter(azimuths: np.ndarray, data: st.DataObject) -> None:
    """Of any muscles of any lengths; which also do not know a turn of the whole from a turn of what they bend."""
    count = len(azimuths)
    lengths = np.array(data.draw(st.lists(st.floats(0.45, 0.55), min_size=count, max_size=count)))
    order, turn = data.draw(st.permutations(range(count))), data.draw(azimuths_)
    strains = cc.strains_from_muscles(lengths, 0.05, azimuths, 1.0)
    # The condition number of muscles 17 degrees apart is below 30; strains are lengths over 0.05 m.
    close = {"rtol": 0.0, "atol": 1e-12}
    assert np.allclose(cc.strains_from_muscles(lengths[order], 0.05, azimuths[order], 1.0), strains, **close)
    residual = float(cc.muscle_residual(lengths, 0.05, azimuths))
    assert float(cc.muscle_residual(lengths[order], 0.05, azimuths[order])) == pytest.approx(residual, abs=1e-14)
    here = columns(lengths, 0.05, azimuths)
    assert np.allclose(columns(lengths[order], 0.05, azimuths[order]), here[:, order], rtol=0.0, atol=1e-11)
    rotation = around_z(turn)[:3, :3]
    turned = cc.strains_from_muscles(lengths, 0.05, azimuths + turn, 1.0)
    assert np.allclose(turned, [*(rotation[:2, :2] @ strains[:2]), 0.0, strains[3]], **close)
    both = np.kron(np.eye(2), rotation)
    assert np.allclose(columns(lengths, 0.05, azimuths + turn), both @ here, rtol=0.0, atol=1e-11)


@law("constant_curvature.arc_from_muscles", "constant_curvature.muscles_from_arc", "constant_curvature.transform")
@settings(max_examples=40)
@given(arcs_, st.floats(0.01, 0.1), muscles())
def test_the_mirror_image_of_the_muscles_is_that_of_the_arc(arc: Arc, share: float, azimuths: np.ndarray) -> None:
    distance, mirror = share * float(arc.length), np.diag([1.0, -1.0, 1.0, 1.0])
    lengths = cc.muscles_from_arc(arc, distance, azimuths)
    image = Arc(arc.length, arc.bending, -arc.azimuth)
    assert np.allclose(cc.muscles_from_arc(image, distance, -azimuths), lengths, rtol=1e-15, atol=0.0)
    found = cc.arc_from_muscles(lengths, distance, azimuths), cc.arc_from_muscles(lengths, distance, -azimuths)
    tips = [cc.transform(one) for one in found]
    # Lengths are stored to a rounding; over the distance that is the angle (condition number 30).
    close = {"rtol": 0.0, "atol": 30.0 * np.spacing(float(arc.length)) / distance + 1e-15}
    assert np.allclose(tips[1], mirror @ tips[0] @ mirror, **close)
    assert np.allclose(tips[0], cc.transform(arc), **close)


@law("constant_curvature.arc_from_muscles", "constant_curvature.muscle_jacobian", "constant_curvature.Arc")
@settings(max_examples=40)
@given(arcs_, st.floats(0.01, 0.1), muscles(3), st.integers(-20, 20), st.floats(0.0, 1.0))
def test_larger_segments_are_similar_and_longer_muscles_only_lengthen(
    arc: Arc, share: float, azimuths: np.ndarray, power: int, more: float
) -> None:
    distance, size = share * float(arc.length), 2.0**power  # a power of two changes no digit
    lengths = cc.muscles_from_arc(arc, distance, azimuths)
    one, large = (
        cc.arc_from_muscles(lengths, distance, azimuths),
        cc.arc_from_muscles(size * lengths, size * distance, azimuths),
    )
    assert (float(large.length), float(large.bending)) == (size * float(one.length), float(one.bending))
    assert large.azimuth == one.azimuth
    jacobian = cc.muscle_jacobian(lengths, distance, azimuths)
    scaled = cc.muscle_jacobian(size * lengths, size * distance, azimuths)
    assert np.array_equal(scaled[:3], jacobian[:3])
    assert np.array_equal(scaled[3:], jacobian[3:] / size)
    longer = cc.arc_from_muscles(lengths + more, distance, azimuths)
    assert float(longer.length) == pytest.approx(float(one.length) + more, rel=1e-14)
    bent = [a.bending * np.exp(1j * a.azimuth) for a in (one, longer)]
    assert abs(bent[1] - bent[0]) <= 30.0 * np.spacing(float(arc.length) + more) / distance


@law("constant_curvature.muscle_residual")
@settings(max_examples=40)
@given(arcs_, muscles(5), st.lists(st.floats(-0.01, 0.01), min_size=5, max_size=5), st.floats(0.1, 10.0))
def test_the_residual_does_not_know_what_an_arc_adds(
    arc: Arc, azimuths: np.ndarray, errors: list[float], factor: float
) -> None:
    """It is a seminorm: zero of arcs, the same with an arc on top, as large as its errors; and no error of mine is larger."""
    distance = 0.05 * float(arc.length)
    lengths, wrong = cc.muscles_from_arc(arc, distance, azimuths), np.array(errors)
    exact = 1e-13 * float(arc.length) + 1e-15
    assert float(cc.muscle_residual(lengths, distance, azimuths)) <= exact
    base = 1.0 + wrong
    missed = float(cc.muscle_residual(base, distance, azimuths))
    assert float(cc.muscle_residual(base + lengths, distance, azimuths)) == pytest.approx(missed, abs=exact + 1e-14)
    assert float(cc.muscle_residual(factor * base, distance, azimuths)) == pytest.approx(factor * missed, abs=1e-13)
    assert missed <= float(np.linalg.norm(wrong)) + 1e-14  # least squares: no larger than what zero bending would leave


# --- Arcs and chains


@law("constant_curvature.transform", "constant_curvature.strains_from_arc")
@settings(max_examples=40)
@given(arcs_)
def test_an_arc_is_the_same_from_its_tip(arc: Arc) -> None:
    """Seen from the other end, turned over half a turn about the axis in the plane of bending, it is itself."""
    alpha = float(arc.azimuth)
    over = around_z(alpha) @ np.diag([1.0, -1.0, -1.0, 1.0]) @ around_z(-alpha)
    pose = cc.transform(arc)
    assert np.allclose(over @ np.linalg.inv(pose) @ over, pose, rtol=0.0, atol=1e-14 * max(1.0, float(arc.length)))
    assert np.linalg.norm(pose[:3, 3]) <= float(arc.length) * (1.0 + 1e-15)  # the chord
    turned = cc.strains_from_arc(arc)[:3]
    assert np.allclose(pose[:3, :3] @ turned, turned, rtol=0.0, atol=1e-14)  # the bending vector is its axis


@law("constant_curvature.transform", "constant_curvature.backbone")
@settings(max_examples=40)
@given(lengths_, st.floats(-9.0, -2.0).map(lambda exponent: 10.0**exponent), azimuths_, st.floats(0.0, 1.0))
def test_nearly_straight_arcs_are_parabolas(length: float, theta: float, alpha: float, s: float) -> None:
    """To second order `(l theta s^2/2, l s)`; what is left out is of third order, and no digit is lost before."""
    arc = Arc(length, theta, alpha)
    aside, rise = 0.5 * length * theta * s**2, length * s
    found = cc.backbone(arc, [s])[0]
    exact = np.array([aside * math.cos(alpha), aside * math.sin(alpha), rise])
    assert np.all(np.abs(found - exact) <= length * np.array([theta**3, theta**3, theta**2]) / 6.0 + 1e-15 * np.abs(exact))
    assert np.allclose(cc.backbone(arc, [1.0])[0], cc.transform(arc)[:3, 3], rtol=1e-15, atol=1e-300)


@law("constant_curvature.chain_transforms", "constant_curvature.chain_transform", "constant_curvature.transform")
@settings(max_examples=30)
@given(st.lists(arcs_, min_size=2, max_size=5), st.lists(azimuths_, min_size=5, max_size=5), st.integers(1, 4), frames_)
def test_a_chain_is_its_beginning_and_then_its_end(arcs: list[Arc], turns: list[float], cut: int, frame: str) -> None:
    offsets, cut = turns[: len(arcs)], min(cut, len(arcs) - 1)
    poses = cc.chain_transforms(arcs, offsets, frame)
    first = cc.chain_transforms(arcs[:cut], offsets[:cut], frame)
    second = cc.chain_transforms(arcs[cut:], offsets[cut:], frame)
    reach = sum(float(arc.length) for arc in arcs)
    close = {"rtol": 0.0, "atol": 1e-14 * max(1.0, reach)}
    assert np.allclose(poses[:cut], first, **close)
    assert np.allclose(poses[cut:], first[-1] @ second, **close)
    assert np.allclose(poses[0], around_z(offsets[0]) @ cc.transform(arcs[0], frame), **close)
    tip = cc.chain_transform(arcs, offsets, frame)
    assert np.array_equal(tip, poses[-1])
    assert np.linalg.norm(tip[:3, 3]) <= reach * (1.0 + 1e-14)


@law("constant_curvature.chain_transform", "constant_curvature.chain_arc_jacobian")
@settings(max_examples=30)
@given(st.lists(arcs_, min_size=1, max_size=3), azimuths_)
def test_an_offset_turns_the_azimuths_of_what_follows(arcs: list[Arc], turn: float) -> None:
    """Torsion-free: a segment turned about its base and back about its tip is one bent to another side."""
    offsets = [turn] + [0.0] * (len(arcs) - 1)
    turned = [Arc(arc.length, arc.bending, arc.azimuth + turn) for arc in arcs]
    rotation, zeros = around_z(turn), [0.0] * len(arcs)
    reach = sum(float(arc.length) for arc in arcs)
    close = {"rtol": 0.0, "atol": 1e-14 * max(1.0, reach)}
    assert np.allclose(cc.chain_transform(arcs, offsets), cc.chain_transform(turned, zeros) @ rotation, **close)
    both = np.kron(np.eye(2), rotation[:3, :3])
    whole, straight_on = cc.chain_arc_jacobian(arcs, offsets), cc.chain_arc_jacobian(arcs, zeros)
    assert np.allclose(whole, both @ straight_on, **close)


@law("constant_curvature.muscle_jacobian", "constant_curvature.chain_muscle_jacobian")
@settings(max_examples=15)
@given(lengths_, st.floats(0.01, 0.1))
def test_a_straight_segment_has_no_bending_plane(length: float, share: float) -> None:
    """Its torsion-free Jacobian is that of a straight rod all the same: tip aside by `l/2` per bending, no twist."""
    distance = share * length
    with pytest.raises(ParameterError, match="the azimuth of a straight one has no derivative"):
        cc.muscle_jacobian([length] * 3, distance, frame="bending_plane")
    found = cc.muscle_jacobian([length] * 3, distance)
    bending = found[3:5]
    assert np.allclose(found[:2], 0.5 * length * np.array([bending[1], -bending[0]]), rtol=1e-15, atol=0.0)
    assert np.allclose(found[2], 1.0 / 3.0, rtol=1e-15, atol=0.0)
    assert not found[5].any()
    two = cc.chain_muscle_jacobian([[length] * 3] * 2, distance, offsets=(0.0, 0.0))
    assert np.allclose(two[:2, :3], 1.5 * length * np.array([bending[1], -bending[0]]), rtol=1e-14, atol=0.0)
    assert np.allclose(two[:2, 3:], found[:2], rtol=1e-14, atol=0.0)


@law("constant_curvature.Arc")
@settings(max_examples=20)
@given(st.lists(bent_, min_size=1, max_size=4), frames_)
def test_arcs_in_an_array_are_the_arcs_one_by_one(arcs: list[Arc], frame: str) -> None:
    together = Arc(*np.array([[arc.length, arc.bending, arc.azimuth] for arc in arcs]).T)
    assert together.shape == (len(arcs),)
    for function in (cc.transform, cc.arc_jacobian):
        # Vectorised sines may differ from single ones in the last digit.
        assert np.allclose(function(together, frame), [function(arc, frame) for arc in arcs], rtol=1e-15, atol=1e-15)
    assert np.allclose(
        cc.backbone(together, [0.3, 1.0]), [cc.backbone(arc, [0.3, 1.0]) for arc in arcs], rtol=1e-15, atol=1e-15
    )
