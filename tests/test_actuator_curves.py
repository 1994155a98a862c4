"""Curves of actuators along their routes in the bent body, their colours, dashes and legends."""

from __future__ import annotations

import math

import numpy as np
import pytest

import softrobots as sr
from softrobots.description.urdf_tags import ActuatorTag, RouteTag
from softrobots.statics.kinematics import frame_placement
from softrobots.view.actuator_curves import actuator_curves, route_places
from softrobots.view.appearance import body_parts
from softrobots.view.body import BentSections
from softrobots.view.legend import tension_entries
from softrobots.view.meshcat_page.page_text import legend_rows
from softrobots.view.scene import SceneBuilder
from softrobots.view.tension_scale import DrawnActuator, drawn_actuators, scale_end, tension_colour

LENGTHS = (0.5, 0.3)
SECTIONS = 3


def route(segment: int, at: tuple[float, ...], distance: tuple[float, ...], azimuth: tuple[float, ...]) -> RouteTag:
    return RouteTag(segment=segment, at=at, distance=distance, azimuth=azimuth)


ROUTES = {
    "straight": (route(1, (0.0, 0.5), (0.03, 0.03), (0.4, 0.4)), route(2, (0.0, 0.3), (0.02, 0.02), (-1.0, -1.0))),
    "helix": (route(1, (0.0, 0.5), (0.03, 0.03), (0.0, 5.0 * math.pi)),),
    "table": (route(1, (-0.1, 0.2, 0.35, 0.6), (0.01, 0.03, 0.02, 0.04), (0.0, 0.5, -0.7, 2.0)),),
    "partial": (route(1, (0.12, 0.5), (0.03, 0.01), (0.2, 0.9)), route(2, (0.0, 0.25), (0.01, 0.02), (0.9, 0.9))),
}


MODEL = sr.load_model(sr.PccArm(segment_lengths=LENGTHS, elastic_sections=SECTIONS), muscles="forces")


def tags(**changes: object) -> tuple[ActuatorTag, ...]:
    return tuple(ActuatorTag(name=name, route=way, rest_length=0.5, **changes) for name, way in ROUTES.items())


def offset(piece: RouteTag, at: float) -> np.ndarray:
    distance, azimuth = (np.interp(at, piece.at, values) for values in (piece.distance, piece.azimuth))
    return np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), 0.0])


def nearest(points: np.ndarray, point: np.ndarray) -> float:
    return float(np.linalg.norm(points - point, axis=1).min())


def test_curves_go_through_the_offsets_from_the_frames_of_pinocchio() -> None:
    """At the end of each section, a link of the chain: bent, twisted and stretched at random."""
    random = np.random.default_rng(5)
    for _ in range(5):
        z = random.normal(0.0, 0.3, MODEL.n_springs) * np.tile([1.0, 1.0, 1.0, 0.05], MODEL.n_springs // 4)
        q = MODEL.configuration(MODEL.relaxed_motors, z)
        for curve, way in zip(
            actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, z), tags(), 4), ROUTES.values(), strict=True
        ):
            for piece in way:
                length = LENGTHS[piece.segment - 1]
                for section in range(1, SECTIONS + 1):
                    at = section * length / SECTIONS
                    if not piece.at[0] <= at <= piece.at[-1]:
                        continue
                    end = frame_placement(MODEL, q, f"section_{piece.segment}_{section}")
                    assert nearest(curve.points, end.act(offset(piece, at))) < 1e-12  # rounding of a robot of 0.8 m


def test_routes_begin_end_and_bend_where_they_say() -> None:
    """Straight robot: the place of a point along z tells its place on the route, and its offset is that of the table."""
    sections = BentSections(MODEL, MODEL.relaxed_motors, np.zeros(MODEL.n_springs))
    turn = np.array([0.0, math.pi / 3])  # of the frames of the segments, the offset of the arm
    for curve, way in zip(actuator_curves(sections, tags(), 4), ROUTES.values(), strict=True):
        starts = (0.0, LENGTHS[0])
        ends = [starts[p.segment - 1] + min(max(a, 0.0), LENGTHS[p.segment - 1]) for p in way for a in (p.at[0], p.at[-1])]
        assert curve.points[[0, -1], 2] == pytest.approx([ends[0], ends[-1]], abs=1e-14)
        for piece in way:
            places = route_places(sections, piece, 4)
            corners = [at for at in piece.at if 0.0 <= at <= LENGTHS[piece.segment - 1]]
            assert all(np.abs(places - at).min() < 1e-15 for at in corners)  # tables are drawn at their corners
            assert np.abs(np.diff(np.interp(places, piece.at, piece.azimuth))).max() < 0.3 + 1e-12
            for at in places:
                bent = offset(piece, at)
                angle = turn[piece.segment - 1]
                around = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ bent[:2]
                assert nearest(curve.points, np.append(around, starts[piece.segment - 1] + at)) < 1e-14


def test_a_helix_is_as_long_as_the_closed_form() -> None:
    """On a straight robot sqrt(L^2 + (d phi)^2); the polyline falls short of it by less than the square of its corners."""
    curve = actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, np.zeros(MODEL.n_springs)), tags())[1]
    length = float(np.linalg.norm(np.diff(curve.points, axis=0), axis=1).sum())
    exact = math.hypot(0.5, 0.03 * 5.0 * math.pi)
    assert exact * (1.0 - 0.3**2 / 24.0) < length < exact


def test_the_tube_of_a_steep_helix_is_not_pinched() -> None:
    """Its volume is the hexagon across it times its length (Pappus), for twenty turns on half a metre, too."""
    steep = (route(1, (0.0, 0.5), (0.04, 0.04), (0.0, 40.0 * math.pi)),)
    tag = ActuatorTag(name="steep", route=steep, rest_length=5.0)
    (curve,) = actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, np.zeros(MODEL.n_springs)), (tag,))
    corners, triangles = curve.surface()
    a, b, c = (corners[triangles[:, place]] for place in range(3))
    volume = float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
    hexagon = 1.5 * math.sqrt(3.0) * curve.radius**2
    assert volume == pytest.approx(
        hexagon * math.hypot(0.5, 0.04 * 40.0 * math.pi), rel=0.03
    )  # corners of 0.3 rad: 0.3^2 (1/24 + 1/8), more where they are uneven


def test_actuators_through_the_same_holes_are_shown_side_by_side() -> None:
    """Tendons from the base to the end of each segment: their curves coincide, what is drawn of them does not."""
    z = np.random.default_rng(8).normal(0.0, 0.1, MODEL.n_springs) * np.tile([1.0, 1.0, 1.0, 0.05], MODEL.n_springs // 4)
    whole = ROUTES["straight"]
    pair = [ActuatorTag(name=f"tendon_{n}", route=whole[:n], kind="tension", rest_length=0.5) for n in (1, 2)]
    short, long = actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, z), tuple(pair))
    count = len(short.points)
    assert np.allclose(long.points[:count], short.points, atol=1e-14)
    apart = np.linalg.norm(long.shown[:count] - short.shown, axis=1)
    assert apart.min() > 2.0 * short.radius
    assert np.allclose(0.5 * (long.shown[:count] + short.shown), short.points, atol=1e-14)
    backbone = frame_placement(MODEL, MODEL.configuration(MODEL.relaxed_motors, z), "section_1_3")
    assert abs(backbone.rotation[:, 2] @ (long.shown[count - 1] - short.shown[-1])) < 1e-14  # across the body
    (alone,) = actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, z), (pair[1],))
    assert np.array_equal(alone.shown, alone.points)


@pytest.mark.parametrize(("kind", "size", "radius"), [
    ("pressure", {"area": 3e-4}, math.sqrt(3e-4 / math.pi)),
    ("mckibben", {"diameter": 0.012, "braid_angle": 0.4}, 0.006),
    ("elastic", {"stiffness": 1e3}, 0.09 * 0.05),
])  # fmt: skip
def test_actuators_are_as_thick_as_they_are(kind: str, size: dict[str, float], radius: float) -> None:
    """Corners of the tube around the curve stand a radius from it, across it."""
    z = np.random.default_rng(3).normal(0.0, 0.2, MODEL.n_springs) * np.tile([1.0, 1.0, 1.0, 0.05], MODEL.n_springs // 4)
    for curve in actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, z), tags(kind=kind, **size)):
        corners, triangles = curve.surface()
        rings = corners[:-2].reshape(len(curve.points), 6, 3) - curve.points[:, None]
        assert np.allclose(np.linalg.norm(rings, axis=2), radius, atol=1e-12)
        along = np.gradient(curve.points, axis=0)
        assert np.abs(np.einsum("nsi,ni->ns", rings, along)).max() < 1e-12
        assert triangles.max() == len(corners) - 1


def test_only_elastic_tendons_without_tension_are_dashed() -> None:
    """Half of the curve is drawn, in straight dashes whose ends are on the curve; as many whatever the shape."""
    counts = set()
    for kind, tension in (("elastic", 0.0), ("elastic", 3.0), ("tension", 0.0), ("length", -2.0)):
        sections = BentSections(MODEL, MODEL.relaxed_motors, np.full(MODEL.n_springs, 0.02 * tension))
        row = tags(kind=kind)
        drawn = drawn_actuators(row, actuator_curves(sections, row), np.full(4, tension))
        slack = kind == "elastic" and tension == 0.0
        assert {actuator.slack for actuator in drawn} == {slack}
        for actuator in drawn:
            dashes = actuator.curve.dashes()
            lengths = np.array([np.linalg.norm(end - start) for start, end in dashes])
            whole = float(np.linalg.norm(np.diff(actuator.curve.points, axis=0), axis=1).sum())
            assert lengths.sum() == pytest.approx(0.5 * whole, rel=0.05)  # chords of a helix, and one dash more than gaps
            counts.add(len(actuator.curve.dashed_surface()[0]))
            assert dashes[0][0] == pytest.approx(actuator.curve.points[0])
            assert dashes[-1][1] == pytest.approx(actuator.curve.points[-1])
    assert len(counts) == 1


def test_what_is_drawn_has_the_colours_and_the_words_of_the_legend() -> None:
    pcc = sr.load_model(sr.PccArm())
    loaded = sr.solve_equilibrium(pcc, (0.47, 0.53, 0.55, 0.50, 0.55, 0.53), (6, 4, -3))
    scene = SceneBuilder(pcc).loaded(loaded)
    told = dict(zip(pcc.motor_joints, tension_entries([scene.actuators]), strict=True))
    parts = {part.path.removeprefix("actuators/"): part for part in body_parts(scene) if part.path.startswith("actuators/")}
    assert parts.keys() == told.keys()
    for (name, entry), force in zip(told.items(), loaded.muscle_forces.tolist(), strict=True):
        assert parts[name].colour == entry.colour
        assert entry.meaning == f"{name}: {'pulls' if force > 0.0 else 'pushes'} {abs(force):.3g} N"
        red, _, blue, _ = entry.colour
        assert (blue > red) == (force > 0.0)


@pytest.mark.study
def test_slack_tendons_are_dashed_on_pages_and_in_figures() -> None:
    """Those without tension in the balance, and no others."""
    arm = sr.load_model(sr.TendonArm(elastic_sections=2))
    loose = sr.solve_equilibrium(arm, arm.relaxed_motors + 1e-3 * np.array((-3, 1, 0, -6, 4, 0, -8, 4, 4)))
    slack = {name for name, force in zip(arm.motor_joints, loose.muscle_forces.tolist(), strict=True) if force == 0.0}
    assert 0 < len(slack) < 9
    assert {name for name, hangs in zip(arm.motor_joints, loose.muscle_slack, strict=True) if hangs} == slack
    scene = SceneBuilder(arm).loaded(loose)
    parts = [part for part in body_parts(scene) if part.path.startswith("actuators/")]
    assert {part.path.split("/")[1] for part in parts if part.path.endswith("/slack")} == slack
    assert all(len(part.surface()[0]) == 24 * (2 * 6 + 2) for part in parts if part.path.endswith("/slack"))
    rows = legend_rows(tension_entries([scene.actuators]))
    for row in rows.strip().splitlines():
        assert ("repeating-linear-gradient" in row) == any(f"{name}: slack" in row for name in slack)
    axes = sr.plot(loose).axes[0]
    curves = {tuple(actuator.curve.shown[-1]): actuator.curve.name for actuator in scene.actuators}
    lines = {curves.get(tuple(np.array(line.get_data_3d())[:, -1])): line.get_linestyle() for line in axes.lines}
    assert {name for name, style in lines.items() if name is not None and style == "--"} == slack
    assert set(arm.motor_joints) <= lines.keys()


def drawn(*tensions: float | None, slack: bool = False) -> list[DrawnActuator]:
    curves = actuator_curves(BentSections(MODEL, MODEL.relaxed_motors, np.zeros(MODEL.n_springs)), tags()[: len(tensions)])
    return [DrawnActuator(curve, tension, slack and tension == 0.0) for curve, tension in zip(curves, tensions, strict=True)]


def test_legends_of_states_and_scales() -> None:
    still = tension_entries([drawn(0.0, 1234.5, -0.02, 0.0, slack=True)])
    assert [entry.meaning for entry in still] == [
        "straight: slack",
        "helix: pulls 1234 N",
        "table: pushes 0.02 N",
        "partial: slack",
    ]
    assert [entry.dashed for entry in still] == [True, False, False, True]
    moving = tension_entries([drawn(0.0, 3.0, slack=True), drawn(7.0, -4.0)])
    assert [entry.meaning for entry in moving] == [
        "pulls 10 N", "pulls 5 N", "0 N", "pushes 5 N", "pushes 10 N", "slack",
        "straight: pulls 0 to 7 N", "helix: -4 N (pushes) to 3 N (pulls)",
    ]  # fmt: skip
    assert [entry.meaning for entry in tension_entries([drawn(None, None)])] == ["actuator"]
    assert tension_entries([[]]) == []
    many = tension_entries([[actuator._replace(tension=2.0) for actuator in crowd(13)]])
    assert [entry.meaning for entry in many] == ["pulls 2 N", "pulls 1 N", "0 N"]


def crowd(count: int) -> list[DrawnActuator]:
    sections = BentSections(MODEL, MODEL.relaxed_motors, np.zeros(MODEL.n_springs))
    row = [ActuatorTag(name=f"tendon_{number}", route=ROUTES["straight"], rest_length=0.8) for number in range(count)]
    return [DrawnActuator(curve) for curve in actuator_curves(sections, tuple(row))]


def test_the_scale_ends_at_a_round_number_that_no_tension_exceeds() -> None:
    assert [scale_end([x]) for x in (0.0, 0.7, -3.0, 10.0, 101.0)] == [1.0, 1.0, 5.0, 10.0, 200.0]
    assert scale_end([None, 2.0, -7.0]) == 10.0
    assert tension_colour(None, 1.0) == tension_colour(0.0, 1.0)
