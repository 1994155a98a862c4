"""Patterns for making a helix: lengths, the drawing measured, the table, and the pinched tube against the smooth one."""

from __future__ import annotations

import csv
import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from softrobots import helix
from softrobots.core.errors import OutputExists, ParameterError
from softrobots.helix import HelixDesign, Pattern, pinch_pattern, write_template, write_template_table
from tests.support.laws import law
from tests.support.tables import each_row

D = 0.0331  # the paper's tube
REFERENCE = (0.66, math.radians(5.0), D, 1.2)
METHODS = ("pinch", "tape", "stoppers")
SVG = "{http://www.w3.org/2000/svg}"
MM = 1e-6  # positions are written to the nanometre [mm]


def planned(actuator: tuple[float, float, float, float], *plan: Any, hand: str = "right") -> Pattern:
    """Plan of a tube by its contraction, angle, diameter and length."""
    contraction, angle, diameter, length = actuator
    turns = float(helix.turns(helix.forward(contraction, angle, diameter), angle, length))
    return pinch_pattern(HelixDesign(contraction, angle, diameter, turns, hand), *plan)


# --- Stoppers and gaps


def test_a_stopper_of_two_and_a_gap_of_one_contract_to_two_thirds():
    assert float(helix.contraction_from_stoppers(0.02, 0.01)) == pytest.approx(2.0 / 3.0, rel=1e-15)
    table = helix.contraction_from_stoppers([0.01, 0.02], [[0.0], [0.01]])
    assert table == pytest.approx(np.array([[1.0, 1.0], [0.5, 2.0 / 3.0]]), rel=1e-15)


@law("helix.contraction_from_stoppers")
@given(st.floats(1e-3, 1.0), st.floats(1e-3, 1.0))
def test_a_gap_takes_its_share_of_the_string(contraction: float, stopper: float):
    gap = stopper * (1.0 - contraction) / contraction
    assert float(helix.contraction_from_stoppers(stopper, gap)) == pytest.approx(contraction, rel=1e-14)


@each_row(
    ("call", "arguments"),
    [
        (helix.contraction_from_stoppers, (0.0, 0.01)),
        (helix.contraction_from_stoppers, (0.01, -0.01)),
        (helix.contraction_from_stoppers, (0.01, math.nan)),
        (helix.contraction_from_stoppers, ([0.01, 0.02], [0.1, 0.2, 0.3])),
    ],
)
def test_bad_stoppers_are_refused(call: Callable[..., Any], arguments: tuple[Any, ...]):
    with pytest.raises(ParameterError):
        call(*arguments)


# --- The pattern

actuators = st.tuples(st.floats(0.2, 0.97), st.floats(0.0, 1.4), st.floats(0.01, 0.2))


@law("helix.pinch_pattern")
@settings(max_examples=60)
@given(actuators, st.floats(0.02, 0.99), st.floats(1.0, 60.0))
def test_pinches_and_what_stays_make_up_the_line(actuator: tuple[float, float, float], share: float, periods: float):
    contraction, angle, diameter = actuator
    quarter = 0.5 * math.pi * diameter / (1.0 - contraction + 2.0 * contraction * math.sin(angle))
    spacing = 0.6 * share * quarter  # the nearest one that fits is wider by at most a half
    length = periods * spacing * math.cos(angle)
    plan = planned((contraction, angle, diameter, length), spacing)
    pinches, kept = plan.ends.arc - plan.starts.arc, plan.stoppers[:, 1] - plan.stoppers[:, 0]
    line = length / math.cos(angle)
    rounding = 1e-12 * line
    assert pinches == pytest.approx((1.0 - contraction) * plan.spacing, abs=rounding)
    assert kept[1:-1] == pytest.approx(contraction * plan.spacing, abs=rounding)
    assert float(pinches.sum() + kept.sum()) == pytest.approx(line, abs=rounding)
    assert kept[[0, -1]] == pytest.approx(0.5 * contraction * plan.spacing, abs=rounding)
    assert float(kept.sum()) == pytest.approx(contraction * line, abs=rounding)
    # The nearest count: no other fits a spacing nearer to the one asked for.
    assert abs(line / spacing - plan.count) <= 0.5 + 1e-9


def test_a_length_of_whole_periods_keeps_its_spacing():
    for count in range(1, 200):
        plan = planned((0.66, 0.0, D, count * 0.02), 0.02)
        assert (plan.count, plan.spacing) == (count, pytest.approx(0.02, rel=1e-13))


@each_row("hand", ["right", "left"])
@each_row("angle", [0.0, 0.1, 1.2])
def test_rolled_up_the_points_lie_on_the_helix_of_the_line(hand: str, angle: float):
    plan = planned((0.66, angle, D, 0.6), 0.011, hand=hand)
    sign = 1.0 if hand == "right" else -1.0
    for points in (plan.starts, plan.ends):
        turned = sign * 2.0 * np.sin(angle) * points.arc / D  # a helix on a cylinder of the diameter D
        rolled = np.exp(2j * points.y / D)
        assert np.abs(rolled - np.exp(1j * turned)).max() < 1e-11  # 1e-12 a wrap
        assert points.x == pytest.approx(points.arc * math.cos(angle), abs=1e-15)
        assert np.all((points.y >= 0.0) & (points.y < math.pi * D))
        unrolled = points.y + points.wrap * math.pi * D
        assert np.diff(unrolled) == pytest.approx(sign * math.sin(angle) * np.diff(points.arc), abs=1e-12)


def test_the_sheet_is_seen_from_outside_so_that_a_right_handed_line_runs_down():
    plan = planned((0.66, 0.3, D, 0.6), 0.01, hand="right")
    # x to the right along the tube, y up, z towards the viewer: on the near side of the tube a right-handed rotation about the
    # axis moves the wall by axis x outward = (0, -1, 0): down, where y of the sheet points.
    axis, outward = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    assert np.cross(axis, outward).tolist() == [0.0, -1.0, 0.0]
    assert plan.starts.y[1] > plan.starts.y[0]
    mirrored = planned((0.66, 0.3, D, 0.6), 0.01, hand="left")
    assert mirrored.starts.y[1] < mirrored.starts.y[0]


def test_a_design_gives_its_actuator_length_and_hand():
    design = helix.design_grasp(0.020, 0.080, diameter=D, turns=1.5, handedness="left")
    plan = pinch_pattern(design, 0.02)
    assert (plan.contraction, plan.angle, plan.tube_length) == (design.contraction, design.angle, design.tube_length)
    assert plan.handedness == "left"
    assert plan.turns == pytest.approx(1.5, rel=1e-12)
    assert float(plan.shape.inner_radius) == pytest.approx(0.020, rel=1e-12)


# --- The drawing, measured


def read(path: Path) -> ET.Element:
    root = ET.parse(path).getroot()
    assert root.tag == SVG + "svg"
    return root


def found(root: ET.Element, kind: str) -> list[ET.Element]:
    """Elements of a class, without the copies across the seam."""
    return [element for element in root.iter() if element.get("class", "").split() == [kind]]


def ends(line: ET.Element) -> tuple[np.ndarray, np.ndarray]:
    x1, y1, x2, y2 = (float(line.attrib[name]) for name in ("x1", "y1", "x2", "y2"))
    return np.array([x1, y1]), np.array([x2, y2])


def corners(polygon: ET.Element) -> np.ndarray:
    return np.array([[float(number) for number in pair.split(",")] for pair in polygon.attrib["points"].split()])


def by_id(root: ET.Element, name: str) -> ET.Element:
    (element,) = (element for element in root.iter() if element.get("id") == name)
    return element


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("hand", ["right", "left"])
def test_one_unit_of_the_drawing_is_a_millimetre_and_the_sheet_and_the_ruler_measure_right(
    method: str, hand: str, tmp_path: Path
):
    root = read(write_template(planned(REFERENCE, 0.02, method, hand=hand), tmp_path / "tube.svg"))
    width, height = root.attrib["width"], root.attrib["height"]
    assert width.endswith("mm")
    assert height.endswith("mm")
    assert [float(number) for number in root.attrib["viewBox"].split()] == [0.0, 0.0, float(width[:-2]), float(height[:-2])]
    scaled = [element.attrib["transform"] for element in root.iter() if "transform" in element.attrib]
    assert all(transform.startswith("translate(") for transform in scaled)  # nothing is scaled or turned on the way
    sheet = by_id(root, "sheet-outline")
    assert float(sheet.attrib["width"]) == pytest.approx(1200.0, abs=MM)
    assert float(sheet.attrib["height"]) == pytest.approx(1e3 * math.pi * D, abs=MM)
    (ruler,) = (line for line in by_id(root, "check-ruler") if line.get("class") == "ruler")
    start, end = ends(ruler)
    assert np.linalg.norm(end - start) == pytest.approx(100.0, abs=MM)
    ticks = [ends(line)[0][0] for line in by_id(root, "check-ruler") if line.get("class") == "tick"]
    assert np.diff(ticks) == pytest.approx(10.0, abs=MM)
    folds = [ends(line) for line in found(root, "fold")]
    assert [float(start[1]) for start, _ in folds] == pytest.approx([0.0, 500.0 * math.pi * D, 1e3 * math.pi * D], abs=MM)
    # All of it is on the drawing.
    left, top = (float(number) for number in by_id(root, "sheet").attrib["transform"][len("translate(") : -1].split())
    assert 0.0 < left < left + 1200.0 < float(width[:-2])
    assert 0.0 < top < top + 1e3 * math.pi * D < float(height[:-2])


@pytest.mark.parametrize(("hand", "slope"), [("right", 1.0), ("left", -1.0)])
@pytest.mark.parametrize(("degrees", "length"), [(5.0, 1.2), (0.0, 0.5), (60.0, 0.3), (88.0, 0.05)])
def test_the_drawn_actuator_line_has_the_angle_of_the_actuator_and_wraps_at_the_seam(
    hand: str, slope: float, degrees: float, length: float, tmp_path: Path
):
    plan = planned((0.66, math.radians(degrees), D, length), 0.01, hand=hand)
    root = read(write_template(plan, tmp_path / "tube.svg"))
    pieces = [ends(line) for line in found(root, "actuator-line")]
    total = 0.0
    for start, end in pieces:
        across, along = end[1] - start[1], end[0] - start[0]
        piece = math.hypot(across, along)
        total += piece
        assert math.atan2(across, along) == pytest.approx(slope * math.radians(degrees), abs=2.0 * MM / piece)
        assert -MM <= min(start[1], end[1]) <= max(start[1], end[1]) <= 1e3 * math.pi * D + MM
    assert total == pytest.approx(1e3 * length / math.cos(math.radians(degrees)), rel=1e-9, abs=1e-4)
    assert pieces[0][0] == pytest.approx([0.0, 0.0 if slope > 0.0 or not degrees else 1e3 * math.pi * D], abs=MM)
    assert pieces[-1][1][0] == pytest.approx(1e3 * length, abs=MM)
    for (_, before), (after, _) in itertools.pairwise(pieces):
        assert after[0] == pytest.approx(before[0], abs=MM)
        assert abs(after[1] - before[1]) == pytest.approx(1e3 * math.pi * D, abs=2.0 * MM)


@pytest.mark.parametrize("contraction", [0.5, 0.66, 0.9])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_drawn_marks_are_square_to_the_line_and_their_distances_have_the_ratio_of_the_contraction(
    contraction: float, hand: str, tmp_path: Path
):
    angle = math.radians(10.0)
    plan = planned((contraction, angle, D, 45 * 0.02 * math.cos(angle)), 0.02, hand=hand)
    root = read(write_template(plan, tmp_path / "tube.svg"))
    groups = found(root, "pinch")
    assert len(groups) == plan.count == 45
    direction = np.array([math.cos(angle), math.sin(angle) * (1.0 if hand == "right" else -1.0)])
    lines = [ends(line) for line in found(root, "actuator-line")]
    previous = None
    for group in groups:
        (first,), (last,) = ([line for line in group if line.get("class") == f"mark {name}"] for name in ("start", "end"))
        middles = []
        for mark in (first, last):
            one, other = ends(mark)
            assert float((other - one) @ direction) == pytest.approx(0.0, abs=5.0 * MM)
            assert np.linalg.norm(other - one) > 5.0  # it can be seen
            middles.append(0.5 * (one + other))
        pinch = middles[1] - middles[0]
        assert np.linalg.norm(pinch) == pytest.approx(20.0 * (1.0 - contraction), abs=5.0 * MM)
        # on the line, up to whole wraps
        start = lines[0][0]
        off = (middles[0] - start) @ np.array([-direction[1], direction[0]]) / math.cos(angle)
        wraps = off / (1e3 * math.pi * D)
        assert wraps == pytest.approx(round(float(wraps)), abs=1e-6)
        if previous is not None:
            stays = (middles[0][0] - previous[0]) / math.cos(angle)
            assert stays == pytest.approx(20.0 * contraction, abs=5.0 * MM)
            assert stays / (stays + np.linalg.norm(pinch)) == pytest.approx(contraction, abs=1e-6)
        previous = middles[1]
        arrows = [corners(arrow) for arrow in group if arrow.get("class") == "arrow"]
        heads = [(arrow[1] - arrow[0]) @ direction for arrow in arrows]
        assert heads[0] > 0.0 > heads[1]  # towards each other
        assert (arrows[0][1] - arrows[1][1]) @ direction < 0.0  # and they do not cross


def test_what_crosses_the_seam_is_drawn_on_both_sides(tmp_path: Path):
    root = read(write_template(planned(REFERENCE, 0.02), tmp_path / "tube.svg"))
    around = 1e3 * math.pi * D
    shapes: dict[str, list[np.ndarray]] = {}
    for group in root.iter():
        if group.get("class", "").split()[:1] == ["pinch"]:
            (area,) = group.findall(SVG + "polygon")
            shapes.setdefault(group.attrib["data-number"], []).append(corners(area))
    crossing = 0
    for drawn in shapes.values():
        low, high = drawn[0][:, 1].min(), drawn[0][:, 1].max()
        assert low < around
        assert high > 0.0
        if low < -0.01 or high > around + 0.01:
            crossing += 1
            (other,) = drawn[1:]
            shift = other - drawn[0]
            assert shift[:, 0] == pytest.approx(0.0, abs=2.0 * MM)
            assert np.abs(shift[:, 1]) == pytest.approx(around, abs=2.0 * MM)
    assert crossing > 3  # the line starts on the seam


def test_drawn_stoppers_and_gaps_follow_each_other_without_a_break(tmp_path: Path):
    angle = math.radians(9.0)
    plan = planned((0.7, angle, D, 17 * 0.03 * math.cos(angle)), 0.03, "stoppers")
    root = read(write_template(plan, tmp_path / "tube.svg"))
    direction = np.array([math.cos(angle), math.sin(angle)])
    lengths = {}
    for kind, count in (("stopper", plan.count + 1), ("gap", plan.count)):
        boxes = [corners(group[0]) for group in found(root, kind)]
        assert len(boxes) == count
        lengths[kind] = [float((box[1] - box[0]) @ direction) for box in boxes]
        for box in boxes:
            assert float((box[2] - box[1]) @ direction) == pytest.approx(0.0, abs=5.0 * MM)
    assert lengths["gap"] == pytest.approx([9.0] * plan.count, abs=5.0 * MM)
    assert lengths["stopper"][1:-1] == pytest.approx([21.0] * (plan.count - 1), abs=5.0 * MM)
    assert sum(lengths["gap"]) + sum(lengths["stopper"]) == pytest.approx(17 * 30.0, abs=1e-3)


def test_drawn_tape_covers_the_pinch_and_its_length_when_closed_is_the_tape(tmp_path: Path):
    plan = planned(REFERENCE, 0.02, "tape")
    root = read(write_template(plan, tmp_path / "tube.svg"))
    direction = np.array([math.cos(REFERENCE[1]), math.sin(REFERENCE[1])])
    tapes, pinches = found(root, "tape"), found(root, "pinch")
    assert len(tapes) == len(pinches) == plan.count
    for tape, pinch in zip(tapes, pinches, strict=True):
        box = corners(tape[0])
        assert (box[1] - box[0]) @ direction == pytest.approx(1e3 * (plan.tape_length + plan.pinch_length), abs=5.0 * MM)
        assert np.linalg.norm(box[2] - box[1]) == pytest.approx(250.0 * D, abs=5.0 * MM)
        (start, end) = (sum(ends(line)) / 2.0 for line in pinch if "mark" in line.get("class", ""))
        assert box.mean(axis=0) == pytest.approx(0.5 * (start + end), abs=5.0 * MM)


def test_the_drawing_says_the_numbers_and_its_words_stay_on_the_page(tmp_path: Path):
    for number, method in enumerate(METHODS):
        root = read(write_template(planned((0.66, 0.1, D, 0.1 * math.cos(0.1)), 0.01, method), tmp_path / f"{number}.svg"))
        words = [element for element in root.iter(SVG + "text")]
        text = " ".join(element.text or "" for element in words)
        shape = helix.forward(0.66, 0.1, D)
        for number_ in (shape.outer_radius, shape.inner_radius, shape.turn_height, D, 0.1, 0.0066, 0.0034):
            assert f"{float(number_) * 1e3:.2f} mm" in text
        for phrase in ("5.730 degrees", "0.6600", "right-handed", "100 mm long"):
            assert phrase in text
        width = float(root.attrib["width"][:-2])
        for element in root.iter(SVG + "text"):
            if element in list(by_id(root, "legend")) + list(by_id(root, "title-block")):
                size = 0.52 * float(element.attrib["font-size"])  # of a letter, generously
                assert float(element.attrib["x"]) + size * len(element.text or "") < width
        rows = sorted(
            {float(e.attrib["y"]) for e in by_id(root, "legend")} | {float(e.attrib["y"]) for e in by_id(root, "title-block")}
        )
        assert min(np.diff(rows)) > 4.0  # no line on another
        assert rows[-1] < float(root.attrib["height"][:-2])


@pytest.mark.parametrize("spacing", [0.0005, 0.003, 0.02])
def test_numbers_beside_the_pinches_keep_apart(spacing: float, tmp_path: Path):
    root = read(write_template(planned((0.8, 0.1, D, 0.3), spacing), tmp_path / "tube.svg"))
    labels = found(root, "number")
    places = np.array([[float(label.attrib["x"]), float(label.attrib["y"])] for label in labels])
    assert len(labels) >= 10
    apart = np.abs(places[:, None] - places[None]) + 100.0 * np.eye(len(places))[..., None]
    assert np.all((apart[..., 0] > 5.5) | (apart[..., 1] > 2.6))  # three digits are 4.3 mm wide
    assert np.all((places[:, 1] > 0.0) & (places[:, 1] < 1e3 * math.pi * D))


# --- The table


@pytest.mark.parametrize("method", METHODS)
def test_the_table_comes_back_as_the_pattern(method: str, tmp_path: Path):
    plan = planned(REFERENCE, 0.02, method, hand="left")
    with write_template_table(plan, tmp_path / "tube.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    kind = "gap" if method == "stoppers" else "pinch"
    taken = [row for row in rows if row["kind"] == kind]
    assert [int(row["number"]) for row in taken] == list(range(1, plan.count + 1))
    for points, name in ((plan.starts, "start"), (plan.ends, "end")):
        assert [float(row[f"{name}_mm"]) for row in taken] == pytest.approx(list(1e3 * points.arc), abs=MM)
        assert [float(row[f"{name}_x_mm"]) for row in taken] == pytest.approx(list(1e3 * points.x), abs=MM)
        assert [float(row[f"{name}_y_mm"]) for row in taken] == pytest.approx(list(1e3 * points.y), abs=MM)
        assert [int(row[f"{name}_wrap"]) for row in taken] == points.wrap.tolist()
    assert [float(row["start_mm"]) for row in rows] == sorted(float(row["start_mm"]) for row in rows)
    if method == "stoppers":
        edges = [(float(row["start_mm"]), float(row["end_mm"])) for row in rows]
        assert [end for _, end in edges[:-1]] == [start for start, _ in edges[1:]]
        assert (edges[0][0], edges[-1][1]) == (0.0, pytest.approx(1e3 * plan.line_length, abs=MM))
    assert {row["kind"] for row in rows} == {"pinch": {"pinch"}, "tape": {"pinch", "tape"}, "stoppers": {"gap", "stopper"}}[
        method
    ]


# --- The pinched tube against the smooth one


def composed(plan: Pattern) -> list[np.ndarray]:
    """Outer frames of the pinched tube at the borders of its pieces, by matrix exponentials of the curvatures in (15)."""
    sign = 1.0 if plan.handedness == "right" else -1.0
    straight = (1.0 - math.cos(2.0 * plan.angle)) / D, sign * math.sin(2.0 * plan.angle) / D

    def along(curvature: float, torsion: float, length: float) -> np.ndarray:
        rates = np.array([[0.0, -torsion, curvature, 0.0], [torsion, 0.0, 0.0, 0.0], [-curvature, 0.0, 0.0, 1.0], [0.0] * 4])
        return np.asarray(expm(length * rates))

    poses = [np.eye(4)]
    for first, last in zip(plan.starts.arc, plan.ends.arc, strict=True):
        begun = plan.ends.arc[(len(poses) - 3) // 2] if len(poses) > 1 else 0.0
        poses.append(poses[-1] @ along(*straight, first - begun))
        poses.append(poses[-1] @ along(1.0 / D, 0.0, last - first))
    poses.append(poses[-1] @ along(*straight, plan.line_length - plan.ends.arc[-1]))
    return poses


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_pieces_are_joined_as_matrix_exponentials_of_the_outer_curvature(hand: str):
    plan = planned((0.66, 0.2, D, 0.3), 0.021, hand=hand)
    centres = np.array([(pose @ [0.5 * D, 0.0, 0.0, 1.0])[:3] for pose in composed(plan)])
    line = helix.discrete_centre_line(plan, samples=3)
    marks = [0]  # where the pieces of the composed tube end among the samples
    marks.append(3)
    for _ in range(plan.count - 1):
        marks += [marks[-1] + 3, marks[-1] + 9]
    marks += [marks[-1] + 3, marks[-1] + 6]
    assert marks[-1] == len(line.points) - 1
    turned, _ = Rotation.align_vectors(line.points[marks][1:], centres[1:] - centres[0])  # where they start is a convention
    assert np.abs(turned.apply(centres - centres[0]) - line.points[marks]).max() < 1e-12


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_wall_is_straight_between_the_pinches_and_turns_about_the_actuator_in_them(hand: str):
    contraction, angle, spacing, samples = 0.6, 0.15, 0.02, 5
    plan = planned((contraction, angle, D, 0.3), spacing, hand=hand)
    spacing = plan.spacing
    points = helix.discrete_centre_line(plan, samples).points
    for period in range(plan.count):
        first = 3 * samples * period
        before, pinch = points[first : first + samples + 1], points[first + samples : first + 2 * samples + 1]
        steps = np.diff(before, axis=0)
        assert np.linalg.norm(steps, axis=1) == pytest.approx(0.5 * contraction * spacing * math.cos(angle) / samples, rel=1e-9)
        assert np.abs(np.cross(steps[0], steps[1:])).max() < 1e-18
        # a pinch: equal chords of a circle of the radius D/2, through p/D in all
        chord = D * math.sin(0.5 * (1.0 - contraction) * spacing / D / samples)
        assert np.linalg.norm(np.diff(pinch, axis=0), axis=1) == pytest.approx(chord, rel=1e-9)
        bends = np.diff(pinch, n=2, axis=0)
        assert np.linalg.norm(bends, axis=1) == pytest.approx(chord**2 / (0.5 * D), rel=1e-9)
        normal = np.cross(bends[0], pinch[1] - pinch[0])
        # The fold is square to the actuator line: the tube enters it at the angle theta.
        entering = steps[-1] / np.linalg.norm(steps[-1])
        assert abs(entering @ normal / np.linalg.norm(normal)) == pytest.approx(math.sin(angle), rel=1e-6)


@pytest.mark.parametrize(("contraction", "angle"), [(0.66, math.radians(5.0)), (0.5, 0.3), (0.9, 0.05), (0.7, 0.9)])
def test_hinges_that_bring_the_marks_together_make_the_papers_helix(contraction: float, angle: float):
    # An independent model of a pinch: the tube is rigid; at each pinch it turns about the point of the wall opposite, by the
    # smallest rotation that brings the far mark onto the near one. No curvature, no frame of a path. It must tend to (12).
    zeta = contraction * complex(math.cos(2.0 * angle), math.sin(2.0 * angle))
    wanted = D * (1.0 + zeta) / (2.0 * (1.0 - zeta))
    errors = []
    for spacing in (4e-3, 2e-3, 1e-3):
        opposite, across = np.array([-0.5 * D, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])  # the actuator is on the +x side here
        actuator = np.array([0.0, math.sin(angle), math.cos(angle)])
        turn = Rotation.from_rotvec((1.0 - contraction) * spacing / D * np.cross(actuator, across))
        hinge, ahead, azimuth = np.eye(4), np.eye(4), np.eye(4)
        hinge[:3, :3], hinge[:3, 3] = turn.as_matrix(), opposite - turn.apply(opposite)
        ahead[2, 3] = spacing * math.cos(angle)  # the wall opposite keeps its length
        azimuth[:3, :3] = Rotation.from_rotvec([0.0, 0.0, 2.0 * spacing * math.sin(angle) / D]).as_matrix()
        motion = hinge @ ahead @ azimuth
        turned = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
        axis = turned / np.linalg.norm(turned)
        rise = float(axis @ motion[:3, 3]) / np.linalg.norm(turned)
        foot = np.linalg.lstsq(np.eye(3) - motion[:3, :3], motion[:3, 3] - axis * (axis @ motion[:3, 3]), rcond=1e-12)[0]
        radius = np.linalg.norm(foot - axis * (axis @ foot))
        errors.append(abs(complex(radius, rise) - wanted))
    assert errors[-1] < 3e-3 * abs(wanted)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.02)


CASES = [(0.66, math.radians(5.0)), (0.5, 0.35), (0.9, math.radians(2.5)), (0.66, 0.0), (0.7, 0.9)]


@pytest.mark.parametrize(("contraction", "angle"), CASES)
def test_radius_rise_and_tip_converge_with_the_square_of_the_spacing(contraction: float, angle: float):
    errors = []
    for count in (40, 80, 160):
        length = 0.6
        plan = planned((contraction, angle, D, length), length / math.cos(angle) / count)
        error = helix.shape_error(plan)
        errors.append((abs(error.centre_radius_error), abs(error.turn_height_error), error.tip))
    radius, rise, tip = np.log2(np.maximum(errors[:-1], 1e-30) / np.maximum(errors[1:], 1e-30)).T
    assert radius == pytest.approx(2.0, abs=0.1)
    assert tip == pytest.approx(2.0, abs=0.1)
    if angle:
        assert rise == pytest.approx(2.0, abs=0.1)
    else:
        assert [row[1] for row in errors] == [0.0] * 3  # planar


@pytest.mark.parametrize(("angle", "order"), [(0.0, 2.0), (0.35, 1.0)])
def test_between_the_pinches_the_centre_line_swings_by_the_spacing_unless_the_actuator_is_straight(angle: float, order: float):
    errors = []
    for count in (300, 600, 1200):
        length = 0.6
        plan = planned((0.5, angle, D, length), length / math.cos(angle) / count)
        error = helix.shape_error(plan)
        errors.append((error.largest_aligned, error.rms_aligned))
    # towards first order from above, as the part of second order fades
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(order, abs=0.12)


def test_the_reference_tube_pinched_every_two_centimetres_is_right_to_a_millimetre():
    # docs/theory.md 3: Ro, Ri and b of the reference, from which the smooth centre line here is computed
    centre, pitch = 0.5 * (0.0854078008 + 0.0523078008), 0.0279647090
    error = helix.shape_error(planned((*REFERENCE[:3], 1.0), 0.02))
    assert error.centre_radius - error.centre_radius_error == pytest.approx(centre, rel=1e-8)
    assert error.pitch - error.turn_height_error / (2.0 * math.pi) == pytest.approx(pitch, rel=1e-8)
    assert error.rms_aligned < error.rms < error.largest < 1e-3
    assert 1e-4 < error.largest_aligned < error.largest


@pytest.mark.parametrize("hand", ["right", "left"])
def test_the_distances_are_those_of_the_analytic_helix(hand: str):
    plan = planned((0.66, 0.2, D, 0.5), 0.021, hand=hand)
    line, error = helix.discrete_centre_line(plan), helix.shape_error(plan)
    # The smooth centre line from the complex form, put at the origin with z along it and x towards its axis.
    zeta = 0.66 * complex(math.cos(0.4), math.sin(0.4))
    outer, centre = D / (1.0 - zeta), D * (1.0 + zeta) / (2.0 * (1.0 - zeta))
    angle, sign = line.line_arc / abs(outer), 1.0 if hand == "right" else -1.0
    around = np.stack([centre.real * np.cos(angle), sign * centre.real * np.sin(angle), centre.imag * angle], axis=-1)
    tangent = np.array([0.0, sign * centre.real, centre.imag]) / abs(centre)
    normal = np.array([-1.0, 0.0, 0.0])
    base = np.stack([normal, np.cross(tangent, normal), tangent])
    smooth = (around - around[0]) @ base.T
    apart = np.linalg.norm(line.points - smooth, axis=1)
    assert (error.largest, error.tip) == (pytest.approx(apart.max(), rel=1e-9), pytest.approx(apart[-1], rel=1e-9))
    steps = np.linalg.norm(np.diff(line.points, axis=0), axis=1)  # chords, which are the arcs to 1e-5 here
    weights = 0.5 * (np.append(0.0, steps) + np.append(steps, 0.0))
    assert error.rms == pytest.approx(math.sqrt(weights @ apart**2 / weights.sum()), rel=1e-4)
    # The best turn and shift by SciPy.
    moved, target = line.points - weights @ line.points / weights.sum(), smooth - weights @ smooth / weights.sum()
    _, root = Rotation.align_vectors(target, moved, weights=weights)
    assert error.rms_aligned == pytest.approx(root / math.sqrt(weights.sum()), rel=1e-4)
    # both start alike: at the origin, with the outer path along the same line
    assert np.abs(line.points[0]).max() < 1e-15
    assert line.line_arc[-1] == pytest.approx(plan.line_length, rel=1e-12)
    assert line.centre_arc[-1] == pytest.approx(steps.sum(), rel=1e-4)


def test_a_left_handed_tube_is_the_mirror_image_of_a_right_handed_one():
    right, left = (helix.discrete_centre_line(planned(REFERENCE, 0.02, hand=hand)) for hand in ("right", "left"))
    assert np.abs(right.points * [1.0, -1.0, 1.0] - left.points).max() < 1e-13


def test_the_helix_of_the_periods_is_that_on_which_their_ends_lie():
    plan = planned(REFERENCE, 0.03)
    error = helix.shape_error(plan)
    points = helix.discrete_centre_line(plan, samples=2).points[:: 3 * 2][: plan.count + 1]
    # A rigid motion repeated: third differences give axis and angle without the package's screw.
    first, second, third = (np.diff(points, n=n, axis=0) for n in (1, 2, 3))
    axis = np.cross(second[0], second[1]) / np.linalg.norm(np.cross(second[0], second[1]))
    cosine = second[0] @ second[1] / (np.linalg.norm(second[0]) * np.linalg.norm(second[1]))
    assert np.abs(third @ axis).max() < 1e-15
    assert error.pitch == pytest.approx(abs(first[0] @ axis) / math.acos(cosine), rel=1e-8)
    assert len(points) == plan.count + 1


# --- Bad input


POSITIVE = "positive [m]"


def refused(call: Callable[[], Any]) -> ParameterError:
    with pytest.raises(ParameterError) as caught:
        call()
    return caught.value


PLAIN = HelixDesign(0.5, 0.1, D, 4.0)


@each_row(
    ("change", "field", "requirement"),
    [
        ({"design": HelixDesign(1.0, 0.1, D, 1.0)}, "contraction", "below 1: at 1 there is nothing to pinch"),
        ({"design": HelixDesign(0.5, 1.56, D, 1.0)}, "angle", "at most 1.5533 rad (89 degrees) for a sheet that can be drawn"),
        ({"design": (0.5, 0.1, D, 1.0)}, "design", "a HelixDesign"),
        ({"design": None}, "design", "a HelixDesign"),
        ({"spacing": 0.0}, "spacing", POSITIVE),
        ({"spacing": math.inf}, "spacing", "a finite number [m]"),
        ({"spacing": 0.2}, "spacing", "at most 0.08668 m, with which a period turns the tube by a quarter turn"),
        (
            {"spacing": 1e-5},
            "spacing",
            f"at least {PLAIN.tube_length / math.cos(0.1) / 2e4:.3g} m, so that there are at most 20000 pinches",
        ),
        ({"method": "glue"}, "method", "one of 'pinch', 'tape', 'stoppers'"),
    ],
)
def test_a_bad_pattern_is_refused(change: dict[str, Any], field: str, requirement: str):
    asked: dict[str, Any] = {"design": PLAIN, "spacing": 0.02} | change
    error = refused(lambda: pinch_pattern(**asked))
    assert (error.field, error.requirement) == (field, requirement)
    assert error.value == asked.get(field, getattr(asked["design"], field, None))


def test_what_is_just_allowed_is_planned():
    steep = planned((0.5, math.radians(89.0), D, 1.0), 0.02)
    assert steep.count == round(1.0 / math.cos(math.radians(89.0)) / 0.02)
    assert planned((0.5, 0.0, D, 20.0 * (1.0 - 1e-12)), 0.001).count == 20_000  # so many are planned
    quarter = 0.5 * math.pi * D / 0.5  # of a straight line, which turns by the pinches alone
    assert planned((0.5, 0.0, D, 10.0 * quarter * (1.0 - 1e-12)), quarter).count == 10


@pytest.mark.parametrize("angle", [0.3, 1.0, 1.4])
def test_a_period_turns_the_tube_by_a_quarter_turn_at_most(angle: float):
    """The bend of a pinch about one side of the tube, and twice the angle of what stays."""
    contraction = 0.6
    widest = 0.5 * math.pi * D / (0.4 + 1.2 * math.sin(angle))
    for share, fits in ((0.999, True), (1.001, False)):
        length = 10.0 * share * widest * math.cos(angle)  # ten periods
        if fits:
            assert planned((contraction, angle, D, length), share * widest).count == 10
        else:
            assert refused(lambda length=length: planned((contraction, angle, D, length), 1.001 * widest)).field == "spacing"


def test_what_is_not_said_of_a_pattern():
    """The line starts at the fold; tape is half as long as what stays, and a quarter as wide as the tube."""
    plan = planned((0.5, 0.1, D, 0.02 * 50 * math.cos(0.1)), 0.02, "tape")
    assert (plan.tape_length, plan.tape_width) == (pytest.approx(0.005, rel=1e-12), 0.25 * D)
    assert float(plan.locate(0.0).y) == 0.0


def test_the_shapes_that_do_not_fit_are_told():
    error = refused(lambda: helix.contraction_from_stoppers([0.01, 0.02], [0.1, 0.2, 0.3]))
    assert (error.field, error.value) == ("gap", ((2,), (3,)))


@each_row("arc", [-0.01, 10.0, math.nan, "far"])
def test_points_off_the_line_are_refused(arc: Any):
    with pytest.raises(ParameterError, match="arc"):
        planned(REFERENCE, 0.02).locate(arc)


def test_rounding_beyond_the_ends_of_the_line_is_no_error():
    """A part in 1e9 of the line."""
    plan = planned((0.5, 0.1, D, 7.0), 0.02)
    for arc in (-0.9e-9 * plan.line_length, (1.0 + 0.9e-9) * plan.line_length):
        assert float(plan.locate(arc).arc) == arc
    for arc in (-1.1e-9 * plan.line_length, (1.0 + 1.1e-9) * plan.line_length):
        assert refused(lambda arc=arc: plan.locate(arc)).field == "arc"


def test_rounding_at_the_seam_starts_the_next_wrap():
    """Just before the seam a point rounds to a whole turn: the seam itself, in whole wraps, never at its far side."""
    plan = planned((0.5, 0.1, D, 1.0), 0.02, hand="left")
    found = plan.locate([0.0, 1e-20, 1e-3])
    assert found.wrap.dtype == np.int64
    assert found.wrap.tolist() == [0, 0, -1]
    assert found.y[:2].tolist() == [0.0, 0.0]
    assert found.y[2] == pytest.approx(math.pi * D - 1e-3 * math.sin(0.1), abs=1e-15)


def test_what_is_no_pattern_is_refused_by_name():
    error = refused(lambda: helix.discrete_centre_line(REFERENCE))
    assert (error.field, error.value) == ("pattern", REFERENCE)
    assert "pattern must be a Pattern; helix.pinch_pattern(design, spacing) makes one" in str(error)


@each_row(
    ("call", "arguments"),
    [
        (helix.shape_error, ("plan",)),
        (helix.discrete_centre_line, (REFERENCE,)),
        (helix.shape_error, (planned(REFERENCE, 0.02), 0)),
        (helix.discrete_centre_line, (planned(REFERENCE, 0.02), 1.5)),
        (helix.discrete_centre_line, (planned(REFERENCE, 0.02), 10**6)),
    ],
)
def test_a_shape_error_of_nothing_is_refused(call: Callable[..., Any], arguments: tuple[Any, ...]):
    with pytest.raises(ParameterError):
        call(*arguments)


@pytest.mark.parametrize(("size", "length"), [(1e-4, 0.01), (20.0, 100.0), (1.0, 300.0)])
def test_a_tube_that_no_bench_holds_is_not_drawn(size: float, length: float, tmp_path: Path):
    plan = planned((0.66, 0.1, size, length), size)
    with pytest.raises(ParameterError):
        write_template(plan, tmp_path / "tube.svg")


def test_nothing_is_overwritten_unless_told(tmp_path: Path):
    plan = planned(REFERENCE, 0.02)
    files = ((write_template, "a.svg"), (write_template_table, "a.csv"))
    for write, name in ((partial(function, plan), name) for function, name in files):
        write(tmp_path / name)
        with pytest.raises(OutputExists):
            write(tmp_path / name)
        write(tmp_path / name, overwrite=True)


def test_arrays_of_a_pattern_are_read_only():
    plan = planned(REFERENCE, 0.02)
    line = helix.discrete_centre_line(plan)
    for array in (plan.starts.arc, plan.ends.y, plan.starts.wrap, plan.stoppers, line.points, line.line_arc, line.centre_arc):
        assert not array.flags.writeable
