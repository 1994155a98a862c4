"""Arms whose actuators run anywhere: routes and kinds from the parameters to the tags of the URDF."""

from __future__ import annotations

import dataclasses
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.optimize import brentq

import softrobots as sr
from softrobots import constant_curvature
from softrobots.cli.options.robot_parameters import make_robot
from softrobots.description.actuator_reader import NUMBERS
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.robots.continuum_arm import ATTRIBUTES, ContinuumArm
from softrobots.robots.fields import facts_of
from softrobots.robots.parameter_file import read_robot, write_parameters
from softrobots.statics.kinematics import frame_placement
from tests.conftest import CHECKOUT
from tests.support.laws import law
from tests.support.tables import each_row
from tests.support.urdf_reading import check_portable, link_poses

Points = list[tuple[float, np.ndarray]]


def points_at_rest(robot: sr.PccArm | sr.TendonArm, tag: ActuatorTag) -> Points:
    """Where the table of an actuator stands with the arm straight: position along the backbone, and point in the base frame.

    The axes of a segment are those of the link at its end, by the origins of the joints.
    """
    poses, points = link_poses(ElementTree.fromstring(robot.urdf()), {}), []
    for piece in tag.route:
        end = poses[f"segment_{piece.segment}"]
        for at, distance, azimuth in zip(piece.at, piece.distance, piece.azimuth, strict=True):
            offset = (distance * math.cos(azimuth), distance * math.sin(azimuth), at - robot.segment_lengths[piece.segment - 1])
            point = end[:3, :3] @ offset + end[:3, 3]
            points.append((float(point[2]), point))
    return points


def tags_of(robot: sr.PccArm | sr.TendonArm) -> dict[str, ActuatorTag]:
    return {tag.name: tag for tag in read_tags(robot.urdf()).muscles}


lengths_ = st.lists(st.floats(0.05, 0.5), min_size=1, max_size=3)
turn_ = st.floats(-4.0, 4.0, allow_subnormal=False)


@law("TendonArm", "robots.continuum_arm.ContinuumArm")
@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow])
@given(lengths_, st.lists(turn_, min_size=3, max_size=3), st.floats(1e-3, 0.02))
def test_tendons_from_the_base_run_straight_through_turned_segments(
    lengths: list[float], turns: list[float], distance: float
) -> None:
    """At their azimuth in the turned frame of their own segment, from the base to its end: 1e-15 is rounding of cosines."""
    count = len(lengths)
    robot = sr.TendonArm(
        segment_lengths=lengths, offset=turns[:count], tendon_distance=distance, chain="lumped", hinges=1, kind="tension"
    )
    assert isinstance(robot, ContinuumArm)
    tags = tags_of(robot)
    assert list(tags) == [f"tendon_{k}_{m}" for k in range(1, count + 1) for m in (1, 2, 3)]
    assert robot.n_actuators == len(tags)
    for name, tag in tags.items():
        segment, number = (int(word) for word in name.split("_")[1:])
        points = points_at_rest(robot, tag)
        azimuth = math.fsum(turns[:segment]) + robot.tendon_azimuths[number - 1]
        line = distance * np.array([math.cos(azimuth), math.sin(azimuth)])
        assert max(np.abs(point[:2] - line).max() for _, point in points) <= 1e-14 * distance + 1e-17
        assert points[0][0] == pytest.approx(0.0, abs=1e-15)
        assert points[-1][0] == pytest.approx(math.fsum(lengths[:segment]), rel=1e-14)
        assert tag.rest_length == pytest.approx(points[-1][0], rel=1e-14)


@law("Route", "PccArm")
@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow])
@given(
    lengths_,
    st.lists(turn_, min_size=3, max_size=3),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-9.0, 9.0), st.floats(1e-3, 0.1)), min_size=2, max_size=5),
)
def test_a_route_is_where_its_table_says_in_every_segment(
    lengths: list[float], turns: list[float], rows: list[tuple[float, float, float]]
) -> None:
    """Linear in the position from the base, whatever the segments: NumPy's interpolation; its length by SciPy's quadrature."""
    whole = math.fsum(lengths)
    shares, azimuths, distances = (list(column) for column in zip(*sorted(rows), strict=True))
    assume(min(np.diff(shares)) > 1e-3)
    route = sr.Route(at=[share * whole for share in shares], azimuth=azimuths, distance=distances)
    options: dict[str, Any] = {"segment_lengths": lengths, "offset": turns[: len(lengths)], "kind": "tension"}
    robot = sr.PccArm(routing=[route, route], chain="lumped", hinges=1, muscle_contraction=0.2, **options)
    tags = tags_of(robot)
    ends = np.cumsum(lengths)
    segment = 1 + int(np.sum(route.at[-1] > ends + 1e-9 * whole))
    assert list(tags) == [f"muscle_{segment}_{number}" for number in (1, 2)]
    tag = tags[f"muscle_{segment}_2"]
    points = points_at_rest(robot, tag)
    assert points[0][0] == pytest.approx(route.at[0], abs=2e-9 * whole)
    assert points[-1][0] == pytest.approx(route.at[-1], abs=2e-9 * whole)
    for at, point in points:
        azimuth, distance = (np.interp(at, route.at, table) for table in (route.azimuth, route.distance))
        assert np.allclose(point[:2], distance * np.array([np.cos(azimuth), np.sin(azimuth)]), atol=1e-7 * distance, rtol=0)
    length = 0.0
    for i in range(len(rows) - 1):
        step, turn, widening = (np.diff(table[i : i + 2])[0] for table in (route.at, route.azimuth, route.distance))

        def speed(share: float, i: int = i, step: float = step, turn: float = turn, widening: float = widening) -> float:
            return math.hypot(step, widening, turn * (route.distance[i] + share * widening))

        length += quad(speed, 0.0, 1.0, epsabs=0.0, epsrel=1e-12)[0]
    assert tag.rest_length == pytest.approx(length, rel=1e-9)  # 3e-3 and less of change of g are summed by Simpson
    assert tag.shortest == pytest.approx(0.8 * tag.rest_length, rel=1e-15)


kinds_ = st.sampled_from(["tension", "elastic", "pressure", "mckibben"])


@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow])
@given(lengths_, st.data())
def test_any_arm_with_actuators_obeys_the_rules_of_portable_urdf(lengths: list[float], data: st.DataObject) -> None:
    """And the numbers of its actuators are those of the fields that their kind has, and no others."""
    count = len(lengths)
    kinds = data.draw(st.lists(kinds_, min_size=count, max_size=count))
    starts = [data.draw(st.sampled_from(["segment", "base", k + 1])) for k in range(count)]
    form = data.draw(st.sampled_from([{"elastic_sections": 1}, {"chain": "lumped", "hinges": 2}]))
    azimuths = data.draw(st.sampled_from([(0.3,), (0.0, 3.0), (0.0, 2.0, 4.0, 5.0)]))
    robot = sr.PccArm(segment_lengths=lengths, kind=kinds, routing=starts, muscle_azimuths=azimuths, **form)
    check_portable(robot.urdf())
    tags = tags_of(robot)
    assert len(tags) == robot.n_actuators == count * len(azimuths)
    for name, tag in tags.items():
        k = int(name.split("_")[1]) - 1
        first = {"segment": k + 1, "base": 1}.get(starts[k], starts[k])
        assert tag.segments == tuple(range(first, k + 2))
        assert tag.kind == kinds[k]
        given = {"rest_length": pytest.approx(math.fsum(lengths[first - 1 : k + 1]))}
        if tag.kind in ("tension", "elastic"):
            given |= {"weakest": -400.0 if tag.kind == "tension" else 0.0, "strongest": 400.0}
            given |= {"shortest": 0.85 * tag.rest_length, "longest": pytest.approx(1.15 * tag.rest_length)}
        given |= {"stiffness": 10e3, "pretension": 10.0} if tag.kind == "elastic" else {}
        given |= {"area": 3e-4, "max_pressure": 3e5} if tag.kind == "pressure" else {}
        given |= {"diameter": 0.01, "braid_angle": math.radians(25), "max_pressure": 3e5} if tag.kind == "mckibben" else {}
        default = {field.name: field.default for field in dataclasses.fields(ActuatorTag)}
        for field in set(default) - {"name", "route", "kind"}:
            assert getattr(tag, field) == given.get(field, default[field]), field


@settings(max_examples=10)
@given(
    rows=st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(-9.0, 9.0)), min_size=1, max_size=4),
    ending=st.sampled_from(["yaml", "json"]),
)
def test_routes_come_back_from_a_file(
    rows: list[tuple[float, float]], ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    routes = [sr.Route(at=(0.0, at), azimuth=(0.5, azimuth), distance=0.03) for at, azimuth in rows]
    robot = sr.PccArm(routing=routes, kind=("elastic", "mckibben"))
    file = tmp_path_factory.getbasetemp() / f"routes.{ending}"
    values = {"routing": robot.routing, "kind": robot.kind}
    write_parameters(file, "pcc_arm", values, overwrite=True)
    assert read_robot(file) == robot
    write_parameters(file, "pcc_arm", dataclasses.asdict(robot), overwrite=True)
    assert read_robot(file) == robot


def test_routes_and_words_on_the_command_line() -> None:
    """Lists as in a file of parameters."""
    words = ["routing=[{at: [0, 0.5], azimuth: 0.3, distance: 0.04}]", "kind=[elastic,mckibben]"]
    route = sr.Route(at=(0.0, 0.5), azimuth=0.3, distance=0.04)
    assert make_robot("pcc_arm", words) == sr.PccArm(routing=[route], kind=("elastic", "mckibben"))
    assert make_robot("tendon_arm", ["routing=[base,2,segment]"]).routing == ("base", 2, "segment")
    assert make_robot("pcc_arm", ["routing=base"]).routing == ("base", "base")
    assert sr.TendonArm(routing=(np.int64(1), np.str_("base"), 2)).routing == (1, "base", 2)
    with pytest.raises(sr.ParameterError, match="routing must be 'segment' or 'base'"):
        make_robot("pcc_arm", ["routing=[{at: 1"])


def test_one_robot_said_in_several_ways(tmp_path: Path) -> None:
    """Routes that are listed where the words would put them are the same actuators; a bare file says the same as the class."""
    said = sr.PccArm(routing="base", kind="tension", muscle_azimuths=(0.0, 2.0, 4.0), offset=0.5, elastic_sections=1)
    listed = [
        sr.Route(at=(0.0, end), azimuth=azimuth + turn, distance=0.04)
        for end, turn in ((0.524, 0.0), (1.048, 0.5))
        for azimuth in (0.0, 2.0, 4.0)
    ]
    for one, other in zip(
        tags_of(said).values(),
        tags_of(sr.PccArm(routing=listed, kind="tension", offset=0.5, elastic_sections=1)).values(),
        strict=True,
    ):
        assert (one.name, one.segments) == (other.name, other.segments)
        for first, second in zip(one.route, other.route, strict=True):
            assert np.allclose(
                [first.at, first.distance, first.azimuth], [second.at, second.distance, second.azimuth], atol=1e-15
            )
    text = "0 0.524 | 0.3 | 0.04; 0.1 0.9 | 0 3 | 0.03 0.02"
    routes = [
        sr.Route(at=(0, 0.524), azimuth=0.3, distance=0.04),
        sr.Route(at=(0.1, 0.9), azimuth=(0, 3), distance=(0.03, 0.02)),
    ]
    arguments = {"routing": text, "kind": "tension", "elastic_sections": "1"}
    assert (
        expand(xacro_folder() / sr.PccArm.XACRO, arguments)
        == sr.PccArm(routing=routes, kind="tension", elastic_sections=1).urdf()
    )


def test_the_backbone_of_a_tendon_arm_is_a_round_rod() -> None:
    """By numbers: nitinol of 0.5 mm radius; a measured stiffness replaces that of the rod."""
    tag = read_tags(sr.TendonArm(elastic_sections=1, axial_stiffness=5e3).urdf()).sections[0]
    assert tag.bending_stiffness == pytest.approx(2.4544e-3, rel=1e-4)
    assert tag.torsional_stiffness == pytest.approx(1.8880e-3, rel=1e-4)
    assert tag.axial_stiffness == 5e3
    masses = sum(
        body.mass
        for body in sr.load_model(sr.TendonArm(kind="length", routing="segment", elastic_sections=1)).pinocchio.inertias[1:]
    )
    assert masses == pytest.approx(0.05, rel=1e-12)


@pytest.mark.parametrize("kind", ["pressure", "mckibben"])
def test_the_default_muscles_bend_a_segment_by_about_a_radian(kind: str) -> None:
    """One at its largest pressure, in closed form: a tension T bends by T d L / EI and shortens by T L / EA.

    The tension of a McKibben muscle is that of Chou and Hannaford (1996) with the length that it then has, by SciPy's root.
    1e-8: the solver stops at 1e-10 of the load.

    """
    length, distance, stiffness, axial, pressure = 0.524, 0.04, 1.92, 2400.0, 3e5

    def excess(tension: float) -> float:
        share = 1.0 - tension / axial - tension * distance**2 / stiffness
        braid = math.radians(25.0)
        pull = 3.0 / math.tan(braid) ** 2 * share**2 - 1.0 / math.sin(braid) ** 2
        return pressure * math.pi * 0.01**2 / 4.0 * pull - tension

    tension = -pressure * 3e-4 if kind == "pressure" else brentq(excess, 0.0, 1e3, xtol=1e-12)
    model = sr.load_model(sr.PccArm(segment_lengths=(length,), kind=kind, muscle_azimuths=(0.7,), elastic_sections=2))
    found = sr.solve_equilibrium(model, (pressure,))
    assert found.muscle_forces[0] == pytest.approx(tension, rel=1e-8)
    bend = tension * distance * length / stiffness
    assert 0.8 < abs(bend) < 1.25
    arc = constant_curvature.Arc(length * (1.0 - tension / axial), abs(bend), 0.7 if bend > 0.0 else 0.7 + math.pi)
    assert np.allclose(found.transform_tip_to_world.homogeneous, constant_curvature.transform(arc), atol=1e-8)
    assert found.stable
    assert found.within_limits


def test_an_elastic_tendon_should_begin_where_a_section_does() -> None:
    """One strain for a section with a route along a part of it: its length is of first order, as the guide tells."""
    begin, length = 0.0325, 0.12

    def tip(lengths: tuple[float, ...], sections: int) -> np.ndarray:
        route = sr.Route(at=(begin, length), azimuth=0.0, distance=0.0045)
        arm = sr.TendonArm(segment_lengths=lengths, routing=[route], elastic_sections=sections)
        model = sr.load_model(arm)
        return sr.solve_equilibrium(model, model.relaxed_motors - 0.003, (0.02, 0.0, 0.0)).tip_position

    divided = (begin, length - begin)
    fine = tip(divided, 16)
    off = [np.linalg.norm(tip(lengths, count) - fine) / length for lengths, count in (((length,), 8), (divided, 4))]
    assert off[0] == pytest.approx(5e-3, rel=0.1)
    assert off[1] == pytest.approx(2e-4, rel=0.2)


def test_an_arm_with_tendons_on_another_robot_bends_as_alone() -> None:
    """Names get the prefix and segments other numbers; without weight its shape is that of the arm alone, from its base."""
    arm = sr.TendonArm(offset=0.3, elastic_sections=1)
    alone, whole = sr.load_model(arm), sr.load_model(sr.mount(sr.InflatableArm(), "tip", arm, prefix="wrist_"))
    assert whole.motor_joints[-9:] == tuple(f"wrist_{name}" for name in alone.motor_joints)
    pulled = alone.relaxed_motors + 1e-3 * np.array([-2.0, 0.0, 1.0, -1.0, 2.0, 0.0, -3.0, 0.0, 3.0])
    one, other = sr.solve_equilibrium(alone, pulled), sr.solve_equilibrium(whole, (0.3, -0.4, 0.8, *pulled))
    base = frame_placement(whole, other.q, "wrist_base_link")
    assert np.allclose((base * one.transform_tip_to_world).homogeneous, other.transform_tip_to_world.homogeneous, atol=1e-9)
    assert np.allclose(one.muscle_forces, other.muscle_forces[-9:], atol=1e-6)  # N; 8 N/mm and 1e-10 of the load


@each_row(
    ("fields", "field"),
    [
        ({"at": (0.0,)}, "at"),
        ({"at": 0.5}, "at"),
        ({"at": (0.0, 0.0)}, "at"),
        ({"at": (0.5, 0.0)}, "at"),
        ({"at": (-0.1, 0.5)}, "at"),
        ({"at": (0.0, math.nan)}, "at"),
        ({"at": "ab"}, "at"),
        ({"at": np.linspace(0.0, 1.0, 1001)}, "at"),
        ({"azimuth": (0.0, 1.0, 2.0)}, "azimuth"),
        ({"azimuth": None}, "azimuth"),
        ({"azimuth": math.inf}, "azimuth"),
        ({"distance": 0.0}, "distance"),
        ({"distance": (0.1, -0.1)}, "distance"),
        ({"distance": "0.1"}, "distance"),
    ],
)
def test_bad_routes_are_refused(fields: dict[str, Any], field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        sr.Route(**({"at": (0.0, 0.5), "azimuth": 0.0, "distance": 0.04} | fields))
    assert caught.value.field == field


FITS = sr.Route(at=(0.0, 0.1), azimuth=0.0, distance=0.004)
FAR = sr.Route(at=(0.0, 1.1), azimuth=0.0, distance=0.004)
SHORT = sr.Route(at=(1.048 - 1e-11, 1.048), azimuth=0.0, distance=0.004)


@each_row(
    ("kind", "parameters", "field"),
    [
        *(
            (sr.PccArm, {"routing": value}, "routing")
            for value in ("tip", 0, 3, True, None, [], ["base"], ("base", 3), [FAR], [SHORT])
        ),
        *(
            (sr.PccArm, {"routing": value}, "routing")
            for value in (b"base", math.nan, [FITS, "base"], [{"at": (0, 1)}], {"at": 1}, [{1: 2, "at": 3}])
        ),
        (sr.PccArm, {"routing": [{"at": (0, 1), "azimuth": 0, "distance": 0}]}, "routing"),
        (sr.PccArm, {"routing": [FITS] * 1001}, "routing"),
        (sr.PccArm, {"routing": np.array([0.5, 0.6])}, "routing"),
        (sr.PccArm, {"routing": np.timedelta64(1, "s")}, "routing"),
        (sr.PccArm, {"kind": np.zeros(2)}, "kind"),
        (sr.PccArm, {"kind": [np.zeros(2), np.zeros(2)]}, "kind"),
        (sr.PccArm, {"offset": [0.5, [0.6]]}, "offset"),
        (sr.PccArm, {"muscle_azimuths": [0.5, [0.6]]}, "muscle_azimuths"),
        (sr.PccArm, {"muscle_azimuths": np.array(0.5), "kind": "tension"}, "muscle_azimuths"),
        *(
            (sr.PccArm, {"kind": value}, "kind")
            for value in ("rubber", None, 1, (), ("tension",), ("length", "tension"), ("tension", 1))
        ),
        (sr.PccArm, {"kind": "elastic", "muscle_stiffness": 0.0}, "muscle_stiffness"),
        (sr.PccArm, {"kind": "elastic", "muscle_pretension": -1.0}, "muscle_pretension"),
        (sr.PccArm, {"kind": "pressure", "muscle_area": 0.0}, "muscle_area"),
        (sr.PccArm, {"kind": "pressure", "muscle_max_pressure": (1e5, -1.0)}, "muscle_max_pressure"),
        (sr.PccArm, {"kind": "mckibben", "muscle_diameter": math.nan}, "muscle_diameter"),
        (sr.PccArm, {"kind": "mckibben", "muscle_braid_angle": 0.96}, "muscle_braid_angle"),
        (sr.PccArm, {"muscle_least_tension": 400.0}, "muscle_least_tension"),
        (sr.PccArm, {"kind": "elastic", "muscle_force": 9.0}, "muscle_pretension"),
        (sr.TendonArm, {"tendon_pretension": (2.0, 2.0, 100.0)}, "tendon_pretension"),
        (sr.PccArm, {"muscle_stiffness": 5e3}, "muscle_stiffness"),
        (sr.PccArm, {"kind": "tension", "muscle_pretension": 5.0}, "muscle_pretension"),
        (sr.PccArm, {"kind": "elastic", "muscle_area": 1e-4}, "muscle_area"),
        (sr.PccArm, {"kind": "mckibben", "muscle_force": 100.0}, "muscle_force"),
        (sr.PccArm, {"kind": "mckibben", "muscle_least_tension": 0.0}, "muscle_least_tension"),
        (sr.PccArm, {"kind": "tension", "routing": [FITS], "muscle_distance": 0.03}, "muscle_distance"),
        (sr.PccArm, {"kind": "tension", "routing": [FITS], "muscle_azimuths": (0.0, 2.0)}, "muscle_azimuths"),
        (sr.PccArm, {"kind": "tension", "muscle_azimuths": (0.0, 2.0, math.tau)}, "muscle_azimuths"),
        (sr.TendonArm, {"kind": "pressure"}, "kind"),
        (sr.TendonArm, {"tendon_azimuths": (0.0, 0.0)}, "tendon_azimuths"),
        (sr.TendonArm, {"tendon_distance": (0.004, 0.004)}, "tendon_distance"),
        (sr.TendonArm, {"tendon_contraction": 1.0}, "tendon_contraction"),
        (sr.TendonArm, {"tendon_extension": 0.0}, "tendon_extension"),
        (sr.TendonArm, {"tendon_force": 0.0}, "tendon_force"),
        (sr.TendonArm, {"tendon_least_tension": -1.0}, "tendon_least_tension"),
        (sr.TendonArm, {"tendon_least_tension": (0.0, 0.0, 60.0)}, "tendon_least_tension"),
        (sr.TendonArm, {"kind": "tension", "tendon_stiffness": 9e3}, "tendon_stiffness"),
        (sr.TendonArm, {"backbone_radius": 0.0}, "backbone_radius"),
        (sr.TendonArm, {"young_modulus": -1.0}, "young_modulus"),
        (sr.TendonArm, {"poisson_ratio": 0.6}, "poisson_ratio"),
        (sr.TendonArm, {"axial_stiffness": 0.0}, "axial_stiffness"),
    ],
)
def test_bad_parameters_of_actuators_are_refused(kind: type, parameters: dict[str, Any], field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field) as caught:
        kind(**parameters)
    assert caught.value.field == field


@each_row(
    ("file", "arguments", "message"),
    [
        *(
            ("pcc_arm", {"routing": text}, "routing = .* required: segment, base")
            for text in ("tip", "0", "3", "[base,3]", "1.0")
        ),
        *(
            ("pcc_arm", {"kind": "tension", "routing": text}, "routing = .* required: at | azimuth | distance")
            for text in (
                "0 1 | 0 | 0",
                "0 | 0 | 1",
                "1 0 | 0 | 1",
                "0 1 | 0 0 0 | 1",
                "0 1.1 | 0 | 1",
                "0 nan | 0 | 1",
                "0 1 | 0",
                "-1 1|0|1",
            )
        ),
        ("pcc_arm", {"kind": "rubber"}, "kind = rubber : one of"),
        ("pcc_arm", {"kind": "[tension,length]"}, "required length for all segments or for none"),
        ("pcc_arm", {"kind": "tension", "muscle_azimuths": "[0,0]"}, "those that differ"),
        ("pcc_arm", {"kind": "mckibben", "muscle_braid_angle": "0.96"}, "muscle_braid_angle .* required < 0.9553"),
        ("pcc_arm", {"muscle_least_tension": "400"}, "muscle_least_tension .* required below muscle_force"),
        ("tendon_arm", {"kind": "pressure"}, "kind = pressure : one of"),
        ("tendon_arm", {"tendon_least_tension": "60"}, "tendon_least_tension .* required below tendon_force"),
        ("tendon_arm", {"tendon_pretension": "100"}, "pretension = .* required at most force"),
        ("tendon_arm", {"tendon_contraction": "1"}, "tendon_contraction .* required < 1"),
        ("tendon_arm", {"poisson_ratio": "0.6"}, "poisson_ratio .* required <="),
        ("tendon_arm", {"bending_stiffness": "0"}, "bending_stiffness .* required > 0"),
    ],
)
def test_bad_arguments_of_the_xacro_files_are_refused(file: str, arguments: dict[str, str], message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        expand(xacro_folder() / f"{file}.urdf.xacro", arguments)


def test_the_table_of_the_guide_has_the_defaults_and_kinds() -> None:
    kinds_of = {name: {kind for kind in NUMBERS if number in NUMBERS[kind]} for name, number in ATTRIBUTES.items()}
    page = (CHECKOUT / "docs" / "actuators.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([a-z_]+)` \| (.*?) \| *(?:`(\w+)`)? *\| *(.*?) *\| *(.*?) *\| .* \|$", page, flags=re.MULTILINE)
    shown = {sr.PccArm: [row[0] for row in rows], sr.TendonArm: [row[2] for row in rows if row[2]]}
    for first, one, second, other, kinds in rows:
        for kind, name, cell in ((sr.PccArm, first, one), (sr.TendonArm, second, other)):
            if name:
                default, unit = (
                    {field.name: field.default for field in dataclasses.fields(kind)}[name],
                    facts_of(kind)[name].unit,
                )
                number = cell.removesuffix(f" {unit}") if unit else cell
                same = number == ("none" if default is None else default)
                assert same or float(number) == pytest.approx(default, rel=1e-4), (name, cell)
                assert set(filter(None, kinds.split(", "))) == kinds_of.get(name.partition("_")[2], set()), name
    for kind, word in ((sr.PccArm, "muscle"), (sr.TendonArm, "tendon")):
        named = {f"{word}_{name}" for name in (*ATTRIBUTES, "distance", "azimuth_deviation")} & facts_of(kind).keys()
        assert set(shown[kind]) == {"kind", "routing", *named}
