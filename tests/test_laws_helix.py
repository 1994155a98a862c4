"""Laws of `helix`: what the paths of a helix share, what contraction and size change, and what a design or a plan keeps."""

from __future__ import annotations

import csv
import io
import math
import re
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from softrobots import SelfIntersection, helix, load_result, save_result
from softrobots.core.errors import ParameterError
from softrobots.helix import HANDEDNESS, PATHS, HelixShape
from studies.papers import helix_grid
from tests.support.laws import law
from tests.support.tables import each_row

TURN = 2.0 * math.pi
HANDS = {"right": 1.0, "left": -1.0}
MIRROR = np.diag([1.0, -1.0, 1.0])
STEP = 1e-5
SMALLEST, LARGEST = 0.05, 1.5  # angles that are neither nearly straight nor nearly across: sizes within 50 diameters

shares_ = st.floats(0.05, 0.99)
angles_ = st.floats(SMALLEST, LARGEST)
diameters_ = st.floats(0.005, 0.5)
actuators_ = st.tuples(shares_, angles_, diameters_)
shapes_ = actuators_.map(lambda actuator: helix.forward(*actuator))
paths_, hands_, turns_ = st.sampled_from(PATHS), st.sampled_from(HANDEDNESS), st.floats(-20.0, 20.0)
powers_ = st.integers(-20, 20).map(lambda power: 2.0**power)  # scaling by one changes no digit


def around_axis(angle: float, rise: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    pose[2, 3] = rise
    return pose


def size_of(shape: HelixShape, path: str) -> float:
    """Length of a path per turn angle [m]."""
    return float(np.hypot(shape.radius(path), shape.pitch))


# --- The curves


@law("helix.frames", "helix.points", "helix.transform_base_to_axis", "helix.HelixShape")
@settings(max_examples=40)
@given(shapes_, paths_, hands_, turns_, turns_)
def test_a_helix_is_carried_along_itself(shape: HelixShape, path: str, hand: str, s: float, further: float) -> None:
    """By the screw motion of its axis; and its mirror image winds the other way."""
    screw = around_axis(HANDS[hand] * further, float(shape.pitch) * further)
    here, there = helix.frames(shape, [s, s + further], path, hand)
    rounding = 1e-14 * 40.0 * (1.0 + size_of(shape, path))  # angles up to 40
    assert np.allclose(screw @ here, there, rtol=0.0, atol=rounding)
    assert np.array_equal(helix.points(shape, s, path, hand), here[:3, 3])
    other = HANDEDNESS[HANDEDNESS[0] == hand]
    assert np.allclose(helix.points(shape, s, path, other), MIRROR @ here[:3, 3], rtol=0.0, atol=0.0)
    base = helix.transform_base_to_axis(shape, hand)
    assert np.allclose(base[:3, 3], [shape.centre_radius, 0.0, 0.0], rtol=0.0, atol=0.0)
    assert np.array_equal(base[:3, 0], [-1.0, 0.0, 0.0])
    assert isinstance(shape, HelixShape)


@law("helix.tangents", "helix.normals", "helix.binormals", "helix.curvature_torsion", "helix.turn_angle", "helix.points")
@settings(max_examples=40)
@given(shapes_, paths_, hands_, turns_)
def test_frames_obey_frenet(shape: HelixShape, path: str, hand: str, s: float) -> None:
    """`p' = T`, `T' = kappa N`, `B' = -tau N` by arc length, signed: central differences, error STEP^2/6, rounding / STEP."""
    size = size_of(shape, path)
    assert float(helix.turn_angle(shape, size * s, path)) == pytest.approx(s, rel=1e-15)

    def rate(curve: Any) -> np.ndarray:
        after, before = (curve(shape, s + step, path, hand) for step in (STEP, -STEP))
        return np.asarray((after - before) / (2.0 * STEP * size))

    kappa, tau = helix.curvature_torsion(shape, path, hand)
    tangent, normal, binormal = (curve(shape, s, path, hand) for curve in (helix.tangents, helix.normals, helix.binormals))
    assert np.allclose(np.cross(tangent, normal), binormal, rtol=0.0, atol=1e-15)
    close = {"rtol": 0.0, "atol": 1e-9}
    assert np.allclose(rate(helix.points), tangent, **close)
    assert np.allclose(size * rate(helix.tangents), size * kappa * normal, **close)
    assert np.allclose(size * rate(helix.binormals), -size * tau * normal, **close)
    # Towards the axis, as seen from the outer path.
    assert np.allclose(helix.points(shape, s, "outer", hand) - helix.points(shape, s, "inner", hand), -shape.diameter * normal)


@law("helix.turns", "helix.height", "helix.centre_length", "helix.length_for_turns", "helix.turn_angle")
@settings(max_examples=40)
@given(actuators_, st.floats(0.01, 100.0), st.floats(0.01, 100.0))
def test_unrolled_paths_are_right_triangles(actuator: tuple[float, float, float], one: float, two: float) -> None:
    """Height and way around of each path, against the lengths that the wall and the actuator keep."""
    share, angle, _ = actuator
    shape = helix.forward(*actuator)
    count, rise = float(helix.turns(shape, angle, one)), float(helix.height(shape, angle, one))
    lengths = {"outer": one / math.cos(angle), "inner": share * one / math.cos(angle)}
    lengths["centre"] = float(helix.centre_length(share, angle, one))
    for path, length in lengths.items():
        assert math.hypot(rise, TURN * count * float(shape.radius(path))) == pytest.approx(length, rel=1e-12)
        assert float(helix.turn_angle(shape, length, path)) == pytest.approx(TURN * count, rel=1e-12)
    assert count + float(helix.turns(shape, angle, two)) == pytest.approx(
        float(helix.turns(shape, angle, one + two)), rel=1e-14
    )
    assert float(helix.length_for_turns(shape, angle, count)) == pytest.approx(one, rel=1e-14)


@law(
    "helix.forward",
    "helix.inverse",
    "helix.measure",
    "helix.actuator_curvature_torsion",
    "helix.material_twist",
    "helix.Actuator",
)
@settings(max_examples=40)
@given(actuators_, powers_, hands_, paths_, st.integers(1, 9))
def test_larger_tubes_are_similar(actuator: tuple[float, float, float], size: float, hand: str, path: str, turns: int) -> None:
    """Lengths grow with the diameter, curvatures and twists fall, angles stay; to the last digit."""
    share, angle, diameter = actuator
    one, large = helix.forward(*actuator), helix.forward(share, angle, size * diameter)
    for name in ("outer_radius", "inner_radius", "pitch"):
        assert float(getattr(large, name)) == size * float(getattr(one, name))
    found = helix.inverse(one), helix.inverse(large)
    assert isinstance(found[0], helix.Actuator)
    assert (found[1].contraction, found[1].angle) == (found[0].contraction, found[0].angle)
    assert found[1].diameter == size * found[0].diameter
    bends = [helix.actuator_curvature_torsion(share, angle, d, path, hand) for d in (diameter, size * diameter)]
    assert np.array_equal(bends[0], np.multiply(size, bends[1]))
    twists = [helix.material_twist(share, angle, d, hand) for d in (diameter, size * diameter)]
    assert twists[0] == size * twists[1]
    other = HANDEDNESS[HANDEDNESS[0] == hand]
    assert helix.material_twist(share, angle, diameter, other) == -twists[0]
    mirrored = helix.actuator_curvature_torsion(share, angle, diameter, path, other)
    assert (mirrored[0], mirrored[1]) == (bends[0][0], -bends[0][1])
    # So many turns are measured as one: the same shape. Radii are differences of squares over the diameter.
    arcs = [TURN * size_of(one, line) for line in ("outer", "inner")]
    measured = helix.measure(*arcs, diameter), helix.measure(*(turns * arc for arc in arcs), diameter, turns)
    for name in ("outer_radius", "inner_radius"):
        numbers = [float(getattr(shape, name)) for shape in (*measured, one)]
        assert numbers == pytest.approx([numbers[2]] * 3, abs=1e-13 * arcs[0] ** 2 / diameter)


@law("helix.volume", "helix.actuator_tension", "helix.centre_length", "helix.material_twist")
@settings(max_examples=40)
@given(actuators_, st.floats(0.01, 100.0), st.one_of(st.just(0.0), st.floats(1.0, 1e6)))
def test_the_pressure_works_on_the_actuator(actuator: tuple[float, float, float], length: float, pressure: float) -> None:
    """`P dV = T dLa` as the actuator contracts; no more gas is in the bent tube than work was done; twist by its definition."""
    share, angle, diameter = actuator
    step = 1e-6 * share

    def volume(at: float) -> float:
        return float(helix.volume(at, angle, diameter, length))

    paid_out = 2.0 * step * length / math.cos(angle)
    tension = pressure * (volume(share + step) - volume(share - step)) / paid_out
    # Difference of second order, against the third derivative of |1 + zeta|; rounding of the volume over the step.
    largest = pressure * 0.25 * math.pi * diameter**2
    assert float(helix.actuator_tension(*actuator, pressure)) == pytest.approx(tension, abs=1e-8 * largest / share)
    assert volume(share) == pytest.approx(
        0.25 * math.pi * diameter**2 * float(helix.centre_length(share, angle, length)), rel=1e-15
    )
    assert volume(1.0) == pytest.approx(0.25 * math.pi * diameter**2 * length, rel=1e-15)
    _, torsion = helix.actuator_curvature_torsion(*actuator)
    winding = 2.0 * math.tan(angle) / diameter
    stretch = float(helix.centre_length(share, angle, 1.0))
    assert float(helix.material_twist(*actuator)) == pytest.approx(float(torsion) * stretch - winding, abs=1e-13 * winding)


# --- Contact


@law("helix.contraction_limit", "helix.self_contact", "helix.check_self_contact", "helix.SelfContact")
@settings(max_examples=40)
@given(st.floats(1e-3, 1.57), st.floats(1e-6, 1.0), diameters_)
def test_there_is_contact_below_the_limit_and_none_above(angle: float, apart: float, diameter: float) -> None:
    limit = float(helix.contraction_limit(angle, diameter))
    above = limit + apart * (1.0 - limit)
    assert not helix.check_self_contact(helix.forward(above, angle, diameter)).touches
    below = limit * (1.0 - apart * 0.999)
    assume(below > 1e-6)
    shape = helix.forward(below, angle, diameter)
    found = helix.self_contact(shape)
    assert isinstance(found, helix.SelfContact)
    assert found.touches
    with pytest.raises(SelfIntersection) as caught:
        helix.check_self_contact(shape)
    assert str(caught.value).startswith(str(found))


@law("helix.simple_contraction_limit", "helix.contraction_limit")
@settings(max_examples=40)
@given(st.floats(0.0, 1.57), st.floats(0.0, 1.57), st.floats(1e-6, 0.9))
def test_a_turn_rises_by_a_diameter_from_the_simple_limit_on(angle: float, steeper: float, apart: float) -> None:
    """It allows more than the exact limit up to where tubes fold; both are lowest where a turn rises most, at about 36 degrees.

    With `q = cos(2 theta) + pi sin(2 theta)` the rule is least strict at `tan(2 theta) = pi`.
    """
    limit, exact = float(helix.simple_contraction_limit(angle)), float(helix.contraction_limit(angle))
    assert 0.0 < exact <= 1.0
    if angle < math.radians(72.0):
        if limit < 1.0 - 1e-9:
            for share in (limit * (1.0 - apart), limit + apart * (1.0 - limit)):
                assert (helix.forward(share, angle, 1.0).turn_height >= 1.0) == (share > limit)
        assert limit <= exact + 1e-15
    low, high = sorted((angle, steeper))
    lowest = 0.5 * math.atan(math.pi)
    assert limit >= math.sqrt(1.0 + math.pi**2) - math.pi - 1e-15
    if high <= lowest or low >= lowest:
        change = float(helix.simple_contraction_limit(high) - helix.simple_contraction_limit(low))
        assert change * (1.0 if low >= lowest else -1.0) >= -1e-15
    if high <= 0.55 or (low >= 0.7 and high < math.radians(90.0)):
        change = float(helix.contraction_limit(high) - helix.contraction_limit(low))
        assert change * (1.0 if low >= 0.7 else -1.0) >= -1e-15


@law("helix.self_contact")
@settings(max_examples=40)
@given(shapes_, st.lists(st.floats(0.1, 3.0), min_size=2, max_size=8))
def test_a_longer_tube_is_no_farther_from_itself(shape: HelixShape, counts: list[float]) -> None:
    found = helix.self_contact(shape, [*sorted(counts), math.inf])
    assert np.all(np.diff(found.has_neighbours.astype(int)) >= 0)
    assert np.all(np.diff(found.touches.astype(int)) >= 0)
    apart = found.turn_distance[found.has_neighbours]
    assert np.all(np.diff(apart) <= 1e-12 * float(shape.outer_radius))
    points = helix.points(shape, found.turn_angle)
    measured = np.linalg.norm(points - helix.points(shape, 0.0), axis=1)
    assert np.allclose(measured, found.turn_distance, rtol=1e-9, atol=0.0)
    assert np.all((found.turn_angle <= TURN * np.array([*sorted(counts), 1e9]) + 1e-9) | ~found.has_neighbours)


@settings(max_examples=15)
@given(st.lists(shares_, min_size=1, max_size=4), st.lists(angles_, min_size=1, max_size=3), diameters_)
def test_a_table_has_a_row_for_each_helix(shares: list[float], angles: list[float], diameter: float) -> None:
    """The last axis fastest, and the CSV file gives every digit back."""
    table = helix_grid.shape_table(shares, np.array(angles)[:, None], diameter)
    assert isinstance(table, helix_grid.ShapeTable)
    assert [(row.angle, row.contraction) for row in table.rows] == [(angle, share) for angle in angles for share in shares]
    rows = (*table.rows, *helix_grid.paper_grid().rows)
    back = helix.inverse(HelixShape(*np.array([(row.outer_radius, row.inner_radius, row.pitch) for row in rows]).T))
    assert np.allclose(back.contraction, [row.contraction for row in rows], rtol=1e-11, atol=0.0)
    assert np.allclose(back.angle, [row.angle for row in rows], rtol=1e-11, atol=0.0)
    for row, limit in zip(rows, helix.contraction_limit([row.angle for row in rows]), strict=True):
        assert isinstance(row, helix_grid.ShapeRow)
        assert row.realisable == (row.contraction > limit) or abs(row.contraction - limit) < 1e-6
        assert row.realisable_by_simple_rule == (TURN * row.pitch >= row.diameter)
    with tempfile.TemporaryDirectory() as folder:
        written = table.write_csv(Path(folder) / "table.csv").read_text(encoding="utf-8")
    names, *lines = list(csv.reader(io.StringIO(written)))
    assert len(names) == len(helix_grid.ShapeRow.__dataclass_fields__)
    known = {"": None, "true": True, "false": False}
    read = [[known[cell] if cell in known else float(cell) for cell in line] for line in lines]
    assert read == [list(row.values()) for row in table.as_rows()]


# --- Grasping


@law("helix.grasp_force", "helix.GraspForce", "helix.GraspTest")
@settings(max_examples=40)
@given(
    st.floats(1.0, 1e6),
    st.floats(0.005, 0.2),
    st.one_of(st.just(0.0), st.floats(1e-6, 1.0)),
    st.floats(1.0, 8.0),
    st.floats(0.1, 9.0),
    powers_,
    st.one_of(st.just(0.0), st.floats(1e-6, 0.3)),
)
def test_grasps_are_similar_and_forces_add_up_over_the_turns(
    pressure: float, radius: float, share: float, rise: float, turns: float, size: float, gap: float
) -> None:
    """A force is a pressure times an area; twice as many turns grip twice as hard; unwrapping is `-P dV/dL` by differences."""
    opening = gap * radius / math.pi  # of the radius; a gap is also a larger object that deflects as much more
    test = helix.GraspTest(radius, 0.03 * rise, turns, (0.999 * share * min(radius, 0.015) - opening,), 0.03, gap * radius)
    found = test.force(pressure)
    assert isinstance(found, helix.GraspForce)
    large = test._replace(
        object_radius=size * radius, turn_height=size * test.turn_height, diameter=size * 0.03, gap=size * test.gap
    )
    scaled = large.force(pressure, size * np.array(test.deflections))
    for name, power in (("force", 2), ("unwrapping", 2), ("contact", 2), ("volume", 3), ("contact_width", 1)):
        assert np.array_equal(getattr(scaled, name), size**power * getattr(found, name))
    assert np.allclose(test._replace(turns=2.0 * turns).force(pressure).force, 2.0 * found.force, rtol=1e-14)
    radius += opening
    depth = test.deflections[0] + opening
    alone = helix.grasp_force(
        pressure, object_radius=radius, deflection=depth, turn_height=0.03 * rise, turns=turns, diameter=0.03
    )
    assert np.allclose(alone.force, found.force, rtol=1e-14)
    pitch, step = 0.03 * rise / TURN, 1e-5 * radius
    inner = TURN * turns * math.hypot(radius, pitch)

    def volume(at: float) -> float:
        return 0.25 * math.pi * 0.03**2 * inner * math.hypot(at + 0.015, pitch) / math.hypot(at, pitch)

    slope = (volume(radius + step) - volume(radius - step)) / (2.0 * step) / math.pi
    size_ = volume(radius) / radius
    assert float(found.volume_slope[0]) == pytest.approx(slope, abs=1e-9 * size_)
    assert float(found.volume[0]) == pytest.approx(volume(radius), rel=1e-14)


# --- Design


wishes_ = st.fixed_dictionaries(
    {"radius": st.floats(0.01, 0.3), "turn_height": st.floats(0.005, 0.6), "turns": st.floats(0.3, 6.0), "hand": hands_}
)


def apart(radius: Any, height: Any, wish: helix.Wish) -> np.ndarray:
    return np.hypot(np.log(radius / wish.radius), np.log(height / wish.turn_height))


@law("helix.design_grasp", "helix.HelixDesign", "helix.Wish", "helix.Deviation", "helix.DesignWarning")
@settings(max_examples=25)
@given(wishes_, st.floats(0.0, 0.9))
def test_a_design_is_its_wish_or_warns_that_it_cannot_be_made(wish: dict[str, Any], squeezed: float) -> None:
    squeeze = squeezed * wish["radius"]
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        design = helix.design_grasp(
            wish["radius"],
            wish["turn_height"],
            diameter=0.03,
            turns=wish["turns"],
            squeeze=squeeze,
            handedness=wish["hand"],
            on_unrealisable="warn",
        )
    assert isinstance(design, helix.HelixDesign)
    assert design.wish == helix.Wish("grasp", "inner", wish["radius"] - squeeze, wish["turn_height"], squeeze)
    assert isinstance(design.deviation, helix.Deviation)
    # Radii are up to 10 diameters here, and half a diameter may be taken from them.
    assert design.deviation == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert [type(warning.message) for warning in told] == [helix.DesignWarning] * (not design.realisable)
    again = helix.HelixDesign(design.contraction, design.angle, 0.03, wish["turns"], wish["hand"])
    assert again.tube_length == design.tube_length
    assert again.realisable == design.realisable
    assert bool(design.contact.touches) == (not design.realisable)
    with tempfile.TemporaryDirectory() as folder:
        loaded = load_result(save_result(design, Path(folder) / "design.json"))
    assert (loaded.contraction, loaded.angle, loaded.wish) == (design.contraction, design.angle, design.wish)
    assert str(loaded) == str(design)


@law("helix.design_antenna", "helix.Deviation")
@settings(max_examples=4)
@given(wishes_, powers_)
def test_no_helix_that_can_be_made_is_nearer_than_the_nearest(wish: dict[str, Any], size: float) -> None:
    """Of a thousand anywhere and a thousand beside it; it can be made, is nearest to itself, and similar for similar wishes."""
    options = {"on_unrealisable": "nearest", "turns": wish["turns"]}
    design = helix.design_antenna(wish["radius"], wish["turn_height"], diameter=0.03, handedness=wish["hand"], **options)
    assert design.realisable
    assert design.wish is not None
    assert isinstance(design.deviation, helix.Deviation)
    random = np.random.default_rng(0)
    beside = 10.0 ** random.uniform(-7.0, -1.0, 1000) * random.choice([-1.0, 1.0], (2, 1000))
    tried = helix.forward(
        np.clip(np.append(random.uniform(0.3, 1.0, 1000), design.contraction + beside[0]), 1e-3, 1.0),
        np.clip(np.append(random.uniform(1e-3, 1.2, 1000), design.angle + beside[1]), 1e-3, 1.5),
        0.03,
    )
    free = ~helix.self_contact(tried, wish["turns"]).touches & (tried.centre_radius > 0.0)
    nearest = apart(tried.centre_radius[free], tried.turn_height[free], design.wish).min()
    assert design.deviation.distance <= nearest * (1.0 + 1e-9) + 1e-12
    radius, height = float(design.shape.centre_radius), float(design.shape.turn_height)
    assert design.deviation.distance == pytest.approx(float(apart(radius, height, design.wish)), abs=1e-12)
    again = helix.design_antenna(radius, height, diameter=0.03, **options)
    assert again.deviation is not None
    assert again.deviation.distance < 1e-6  # what is on the border may be a rounding beyond it
    large = helix.design_antenna(size * wish["radius"], size * wish["turn_height"], diameter=size * 0.03, **options)
    assert large.deviation is not None
    assert large.deviation.distance == pytest.approx(design.deviation.distance, abs=1e-9)


# --- Fabrication


@st.composite
def patterns(draw: Any, most: int = 40) -> helix.Pattern:
    """Any plan of a tube that fits on a bench."""
    share, angle, diameter = draw(st.floats(0.2, 0.97)), draw(st.floats(0.0, 1.4)), draw(st.floats(0.01, 0.2))
    widest = 0.5 * math.pi * diameter / (1.0 - share + 2.0 * share * math.sin(angle))
    spacing = draw(st.floats(0.1, 0.6)) * widest  # the nearest that fits is wider by half at most
    length = draw(st.floats(1.0, most)) * spacing * math.cos(angle)
    turns = float(helix.turns(helix.forward(share, angle, diameter), angle, length))
    design = helix.HelixDesign(share, angle, diameter, turns, draw(hands_))
    return helix.pinch_pattern(design, spacing, draw(st.sampled_from(helix.METHODS)))


@law("helix.pinch_pattern", "helix.Pattern", "helix.SheetPoints", "helix.contraction_from_stoppers")
@settings(max_examples=30)
@given(patterns(), st.lists(st.floats(0.0, 1.0), min_size=1, max_size=9))
def test_the_line_of_a_plan_is_straight_on_the_sheet(plan: helix.Pattern, shares: list[float]) -> None:
    """And what stays, closed up, is as long as the contraction says; the seam is crossed, not walked along."""
    arc = np.sort(shares) * plan.line_length
    found = plan.locate(arc)
    assert isinstance(plan, helix.Pattern)
    assert isinstance(found, helix.SheetPoints)
    assert np.all((found.y >= 0.0) & (found.y < plan.sheet_width))
    unrolled = found.y + found.wrap * plan.sheet_width
    close = {"rtol": 0.0, "atol": 1e-14 * (plan.line_length + 10.0 * plan.sheet_width)}
    assert np.allclose(np.hypot(found.x, unrolled), arc, **close)
    assert np.allclose(unrolled, HANDS[plan.handedness] * math.tan(plan.angle) * found.x, **close)
    stays = float(np.diff(plan.stoppers).sum())
    assert stays == pytest.approx(plan.contraction * plan.line_length, rel=1e-12)
    assert stays + plan.count * plan.pinch_length == pytest.approx(plan.line_length, rel=1e-12)
    assert helix.contraction_from_stoppers(plan.remaining_length, plan.pinch_length) == pytest.approx(
        plan.contraction, rel=1e-12
    )


@law("helix.discrete_centre_line", "helix.DiscreteCentreLine", "helix.shape_error", "helix.ShapeError")
@settings(max_examples=12)
@given(patterns(12), powers_, st.integers(1, 4))
def test_a_pinched_tube_keeps_its_lengths_and_its_errors_scale(plan: helix.Pattern, size: float, samples: int) -> None:
    """Of straight pieces and arcs of half the diameter: the chords are shorter than the line by no more than arcs are."""
    line = helix.discrete_centre_line(plan, samples)
    assert isinstance(line, helix.DiscreteCentreLine)
    whole = 0.5 * plan.count * plan.pinch_length + (plan.line_length - plan.count * plan.pinch_length) * math.cos(plan.angle)
    assert line.centre_arc[-1] == pytest.approx(whole, rel=1e-12)
    assert line.line_arc[-1] == pytest.approx(plan.line_length, rel=1e-12)
    steps, chords = np.diff(line.centre_arc), np.linalg.norm(np.diff(line.points, axis=0), axis=1)
    slack = 1e-13 * whole
    assert np.all(chords <= steps + slack)
    # In a pinch the line turns by its length over half the diameter.
    assert np.all(chords >= plan.diameter * np.sin(np.minimum(steps / plan.diameter, 0.5 * math.pi)) - slack)
    error = helix.shape_error(plan, samples)
    assert isinstance(error, helix.ShapeError)
    assert 0.0 <= error.rms_aligned <= error.rms * (1.0 + 1e-12)
    assert error.rms <= error.largest + slack
    assert error.tip <= error.largest
    scaled_design = helix.HelixDesign(plan.contraction, plan.angle, size * plan.diameter, plan.turns, plan.handedness)
    large = helix.pinch_pattern(scaled_design, size * plan.spacing)
    assert large.count == plan.count
    scaled = helix.shape_error(large, samples)
    for name in ("largest", "rms", "tip", "centre_radius", "pitch", "rms_aligned"):
        assert getattr(scaled, name) == pytest.approx(size * getattr(error, name), rel=1e-6, abs=1e-11 * size * whole)


@law("helix.write_template", "helix.write_template_table")
@settings(max_examples=6)
@given(patterns(12))
def test_drawings_and_table_hold_every_mark(plan: helix.Pattern) -> None:
    """Once on the sheet, and in the table where the plan has it."""
    with tempfile.TemporaryDirectory() as folder:
        sheet = helix.write_template(plan, Path(folder) / "sheet.svg").read_text(encoding="utf-8")
        table = helix.write_template_table(plan, Path(folder) / "table.csv").read_text(encoding="utf-8")
    kind = "gap" if plan.method == "stoppers" else "pinch"
    wanted = {f'id="{kind}-{number}"' for number in range(1, plan.count + 1)}
    assert set(re.findall(rf'id="{kind}-\d+"', sheet)) == wanted
    rows = [row for row in csv.DictReader(io.StringIO(table)) if row["kind"] == kind]
    starts = [float(row["start_mm"]) for row in rows]
    assert starts == pytest.approx(1e3 * plan.starts.arc, abs=2e-3)  # printed in micrometres


# --- Actuators that vary


@law("helix.bent_tube", "helix.BentTube", "helix.frames", "helix.transform_base_to_axis")
@settings(max_examples=4)
@given(st.floats(0.3, 0.99), st.floats(0.05, 1.0), st.floats(0.1, 0.9), hands_)
def test_a_constant_actuator_in_pieces_makes_the_helix(share: float, angle: float, cut: float, hand: str) -> None:
    """With a row more in the middle of the table, or by functions, the tube is the same: frames of the closed form."""
    tube = helix.bent_tube(([0.0, 0.3 * cut, 0.3], [share] * 3), angle, 0.03, 0.3, handedness=hand, samples=7)
    other = helix.bent_tube(share, lambda s: angle, 0.03, 0.3, handedness=hand, samples=7)
    assert isinstance(tube, helix.BentTube)
    shape = helix.forward(share, angle, 0.03)
    s = TURN * helix.turns(shape, angle, 0.3) * np.linspace(0.0, 1.0, 7)
    exact = np.linalg.inv(helix.transform_base_to_axis(shape, hand)) @ helix.frames(shape, s, "centre", hand)
    for found in (tube, other):
        assert np.allclose(found.poses, exact, rtol=0.0, atol=1e-10)  # a hundred steps of tolerance 1e-12
        assert found.arc_length[-1] == pytest.approx(float(helix.centre_length(share, angle, 0.3)), rel=1e-11)


@law("helix.ActuatorTable")
@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.floats(1e3, 1e5), st.floats(0.01, 1.0)), min_size=2, max_size=6),
    st.floats(0.01, 0.99),
    powers_,
)
def test_a_table_is_the_same_in_other_units(steps: list[tuple[float, float]], share: float, size: float) -> None:
    """A pascal more or a scale of the pressure moves it along."""
    pressures = np.cumsum([0.0, *(step[0] for step in steps)])
    levels = np.cumsum([0.1, *(step[1] for step in steps)])
    table = helix.ActuatorTable(pressures, levels / levels[-1])
    at = float(share * pressures[-1])
    other = helix.ActuatorTable(size * (pressures + 256.0), levels / levels[-1])
    found = float(table.contraction_at(at))
    assert float(other.contraction_at(size * (at + 256.0))) == pytest.approx(found, rel=1e-9)
    with pytest.raises(ParameterError, match="within the measured table"):
        table.contraction_at(pressures[-1] * (1.0 + 1e-9))


@each_row(
    ("call", "field", "shapes"),
    [
        (lambda: helix.turns(helix.forward([0.6, 0.7], 0.2, 0.03), [0.1, 0.2, 0.3], 1.0), "angle", ((2,), (3,))),
        (lambda: helix.actuator_tension(0.6, [0.1, 0.2], 0.03, [1.0, 2.0, 3.0]), "pressure", None),
        (lambda: helix.actuator_tension(0.6, 0.1, [0.03, 0.04], [1.0, 2.0, 3.0]), "pressure", None),
        (lambda: helix.actuator_tension([0.6, 0.7], 0.1, 0.03, [1.0, 2.0, 3.0]), "pressure", None),
    ],
)
def test_shapes_that_do_not_fit_are_told(
    call: Callable[[], object], field: str, shapes: tuple[tuple[int, ...], ...] | None
) -> None:
    with pytest.raises(ParameterError, match="of a shape that broadcasts with the others") as caught:
        call()
    assert caught.value.field == field
    assert shapes in (None, caught.value.value)
