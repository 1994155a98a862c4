"""[PCC paper], the arm of two bending segments: its equations and its few numbers beside ours.

The paper is a derivation. It prints no table, no result in numbers and no distance of the muscles from the backbone; its
figures draw the geometry. So equations are compared, as printed, over random shapes.
"""

from __future__ import annotations

import numpy as np

from softrobots import constant_curvature as cc
from softrobots.constant_curvature import Arc, poses
from softrobots.core.checks import FloatArray
from softrobots.robots import PccArm
from studies.papers import pcc_equations as printed
from studies.papers.pcc_equations import Segment
from studies.papers.rows import UNPUBLISHED, UNREADABLE, Row, absent, equation, erratum, largest, own, rounded, taken

TITLE = "Two-segment arm [PCC paper]"
"""What the paper is called in tables."""

MUSCLE_LENGTH, MUSCLE_ANGLE, OFFSET = "52.4", "120", "60"
"""Section 3: length of a muscle [cm], angle between muscles and turn between segments [degrees]."""
SEGMENTS, MUSCLES = "2", "3"
"""Section 3: segments, and muscles of each."""

DISTANCE = 0.04
"""Distance of the muscles from the backbone [m]: assumed, as in `PccArm`; not published."""

LENGTHS = np.array([[0.50, 0.53, 0.55], [0.54, 0.51, 0.52]])
"""Muscle lengths of an example of our own [m]."""

_CASES = 1000
_RANDOM = "1000 random shapes, bent by 0.2 to 2.5 rad"
_SURE = "as far as the text at hand can be read"


def sizes() -> list[Row]:
    """What the paper states of its robot."""
    robot = PccArm()
    angles = np.degrees(np.sort(np.asarray(robot.muscle_azimuths)))
    return [
        taken(rounded("section 3", "length of a muscle", MUSCLE_LENGTH, 100.0 * robot.segment_lengths[0], "cm")),
        taken(rounded("section 3", "segments", SEGMENTS, float(len(robot.segment_lengths)))),
        taken(rounded("section 3", "muscles of a segment", MUSCLES, float(len(angles)))),
        taken(rounded("section 3", "angle between muscles", MUSCLE_ANGLE, float(np.diff(angles).max()), "degrees")),
        taken(rounded("section 3", "turn between the segments", OFFSET, float(np.degrees(poses.OFFSET)), "degrees")),
        absent(UNPUBLISHED, "(20)", "distance d of the muscles from the backbone", note="0.04 m is assumed here"),
        absent(UNPUBLISHED, "section 5", "positions of the arm, measured or simulated", note="announced for another paper"),
    ]


def one_segment() -> list[Row]:
    """Equations (2) to (14)."""
    segment, arc = _random(1)[0]
    ours = cc.transform(arc, "bending_plane")
    flat = cc.transform(Arc(arc.length, arc.bending, np.zeros(_CASES)), "bending_plane")
    slope = np.arctan2(flat[:, 2, 3], flat[:, 0, 3])
    planar = np.stack([segment.radius * (1 - np.cos(segment.bending)), segment.radius * np.sin(segment.bending)], axis=-1)
    rotation = printed.about_z(segment.azimuth) @ printed.about_y(segment.bending)
    rows = [
        equation(
            "(2)",
            "slope of the chord, 90 degrees less half the bending",
            largest(slope - np.pi / 2 + arc.bending / 2),
            "rad",
            _RANDOM,
        ),
        equation(
            "(3)-(5)",
            "tip in the bending plane",
            largest(flat[:, (0, 2), 3] - planar),
            "m",
            "the figures lay azimuth 0 into y-z, (9) into x-z; (9) counts",
        ),
        equation("(6), (7), (9)", "tip of a segment", largest(ours[:, :3, 3] - printed.tip(segment)), "m", _RANDOM),
    ]
    example, shape = _example()
    height, right = float(printed.tip_height(example[0])), float(cc.transform(shape[0], "bending_plane")[2, 3])
    note = "printed r sin alpha, must be r sin theta, as in (9) and (14); our example"
    rows.append(erratum("(8)", "height of the tip", height, right, "m", note))
    rows.append(equation("(11)-(13)", "rotation as a product", largest(ours[:, :3, :3] - rotation), "", _RANDOM))
    rows.append(equation("(14), (15)", "transform, all entries", largest(ours - printed.pose(segment)), "m", _RANDOM))
    note = "the frame of (14) turns with the azimuth, a body without twist does not; our example"
    angle = float(np.degrees(_angle(cc.transform(shape[0]), cc.transform(shape[0], "bending_plane"))))
    rows.append(own("(14)", "turn between the paper's frame and that of the body", angle, "degrees", note))
    return rows


def two_segments() -> list[Row]:
    """Equations (15) to (19)."""
    (one, first), (two, second) = _random(2)
    ours = cc.chain_transform([first, second], frame="bending_plane")
    product = printed.pose(one) @ printed.pose(Segment(two.radius, two.bending, two.azimuth + printed.OFFSET))
    rows = [equation("(15) x (16)", "transform of two segments, product, all entries", largest(ours - product), "m", _RANDOM)]
    example, shape = _example()
    tip = cc.chain_transform(shape, frame="bending_plane")[:3, 3]
    turned = cc.transform(Arc(shape[1].length, shape[1].bending, shape[1].azimuth + printed.OFFSET), "bending_plane")
    note = f"printed r2 (a2 + pi/3)(1 - cos a2), must be r2 cos(a2 + pi/3)(1 - cos t2); {_SURE}; our example"
    rows.append(
        erratum("(16)", "x of the second segment", float(printed.second_pose(example[1])[0, 3]), float(turned[0, 3]), "m", note)
    )
    x, _, z = (float(number) for number in printed.second_tip(*example))
    note = f"no term r1 cos a1 (1 - cos t1), and cos a1 sin t1 sin t2 with a minus; {_SURE}; our example"
    rows.append(erratum("(17)", "x of the tip", x, float(tip[0]), "m", note))
    apart = largest(printed.second_tip(one, two)[:, 1] - ours[:, 1, 3])
    rows.append(equation("(18)", "y of the tip", apart, "m", _RANDOM))
    note = "printed cos t1 cos t2 in the end, must be cos t1 sin t2; our example"
    rows.append(erratum("(19)", "z of the tip", z, float(tip[2]), "m", note))
    body = cc.chain_transform(shape)[:3, 3]
    names = ("x", "y", "z")
    note = "lengths (0.50, 0.53, 0.55 | 0.54, 0.51, 0.52) m, d = 0.04 m, all ours"
    rows += [
        own("(15), (16)", f"{name} of the tip, frames of (14)", float(value), "m", note)
        for name, value in zip(names, tip, strict=True)
    ]
    rows += [
        own("section 3", f"{name} of the tip, body without twist", float(value), "m", note)
        for name, value in zip(names, body, strict=True)
    ]
    return rows


def muscles() -> list[Row]:
    """Equations (20) to (41)."""
    segment, arc = _random(1)[0]
    lengths = cc.muscles_from_arc(arc, DISTANCE)
    rows = [
        equation(
            "(20)-(22)", "lengths of the muscles", largest(lengths - printed.muscle_lengths(segment, DISTANCE)), "m", _RANDOM
        ),
        absent(UNREADABLE, "(23)-(25), (28)", "steps of the derivation", note="the signs; (26) and (27) follow and are right"),
    ]
    cosines = np.cos(printed.muscle_angles(segment.azimuth))
    left = (lengths[:, 0] - lengths[:, 1]) * (cosines[:, 0] - cosines[:, 2])
    right = (lengths[:, 0] - lengths[:, 2]) * (cosines[:, 0] - cosines[:, 1])
    rows.append(equation("(26), (27)", "proportion of the differences", largest(left - right), "m", _RANDOM))
    example, _ = _example()
    sides = printed.tangent_balance(LENGTHS[0], example[0].azimuth)
    note = f"left side of the equation; printed (l1 - l3) - (l1 - l2), must be the other way round; {_SURE}; (31) is right"
    rows.append(erratum("(30)", "balance that gives the tangent", float(sides[0]), float(sides[1]), "m", note))
    found = cc.arc_from_muscles(lengths, DISTANCE)
    apart = largest(np.sin(found.azimuth) - printed.tangent(lengths) * np.cos(found.azimuth))
    note = "sin = tan cos, as the tangent itself grows without limit"
    rows.append(equation("(31)", "tangent of the azimuth", apart, "", note, 1e-10))
    # The root of (41) cancels: 1e-16 of 0.8 m^2 over twice the root of 1e-4 m^2 or more.
    apart = largest(np.stack([np.cos(found.azimuth) - printed.cosine(lengths), np.sin(found.azimuth) - printed.sine(lengths)]))
    rows.append(equation("(32), (33)", "cosine and sine of the azimuth", apart, "", _RANDOM, 1e-10))
    behind = cc.muscles_from_arc(Arc(*np.array((0.5, 1.0, np.radians(150.0)))), DISTANCE)
    note = "a plain arctangent loses the quadrant; atan2 of (33) and (32) keeps it. Bent towards 150 degrees, ours"
    plain, whole = np.degrees(printed.azimuth(behind)), np.degrees(cc.arc_from_muscles(behind, DISTANCE).azimuth)
    rows.append(erratum("(34)", "azimuth", float(plain), float(whole), "degrees", note))
    apart = largest(arc.length[:, None] / segment.radius[:, None] - lengths / (segment.radius[:, None] - DISTANCE * cosines))
    rows.append(equation("(35), (36)", "bending from any muscle, l/r = l_i/r_i", apart, "rad", _RANDOM))
    apart = largest(segment.radius[:, None] * (arc.length[:, None] - lengths) - arc.length[:, None] * DISTANCE * cosines)
    rows.append(equation("(37), (38)", "r (l - l_i) = l d cos alpha_i", apart, "m^2", _RANDOM))
    rows.append(equation("(39)", "length of the backbone", largest(found.length - printed.length(lengths)), "m", _RANDOM))
    clear = np.abs(np.cos(arc.azimuth)) > 0.2
    apart = largest((found.length / found.bending / printed.radius(lengths, DISTANCE) - 1.0)[clear])
    note = "relative; 0/0 where the first muscle keeps the length of the backbone: |cos alpha| > 0.2"
    rows.append(equation("(40)", "radius of curvature", apart, "", note, 1e-10))
    apart = largest(found.bending - printed.bending(lengths, DISTANCE))
    rows.append(equation("(41)", "bending angle", apart, "rad", f"{_RANDOM}; the root cancels near straight", 1e-10))
    return rows


def _random(count: int) -> list[tuple[Segment, Arc]]:
    """Random segments, in the paper's terms and in ours."""
    random = np.random.default_rng(524)
    result = []
    for _ in range(count):
        length, bending = random.uniform(0.45, 0.6, _CASES), random.uniform(0.2, 2.5, _CASES)
        azimuth = random.uniform(-np.pi, np.pi, _CASES)
        result.append((Segment(length / bending, bending, azimuth), Arc(length, bending, azimuth)))
    return result


def _example() -> tuple[tuple[Segment, Segment], tuple[Arc, Arc]]:
    """The two segments of the example, in the paper's terms and in ours."""
    first, second = (cc.arc_from_muscles(lengths, DISTANCE) for lengths in LENGTHS)
    one, two = (Segment(arc.length / arc.bending, arc.bending, arc.azimuth) for arc in (first, second))
    return (one, two), (first, second)


def _angle(one: FloatArray, other: FloatArray) -> float:
    """Angle of the turn between two frames [rad]."""
    turn = one[:3, :3].T @ other[:3, :3]
    return float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))


JOBS = (sizes, one_segment, two_segments, muscles)
"""What makes the rows."""
