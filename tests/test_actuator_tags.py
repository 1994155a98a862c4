"""Actuators in a URDF: what their tags say, what is refused, and how they travel with their robot."""

from __future__ import annotations

import math
from functools import cache

import pytest
from scipy.integrate import quad

import softrobots as sr
from softrobots.description.tag_reader import read_tags
from softrobots.description.urdf_tags import ActuatorTag

LENGTHS = (0.4, 0.3)
ALONG_1 = '<softrobots:route segment="1" at="0 0.4" distance="0.03 0.03" azimuth="0.3 0.3"/>'
ALONG_2 = '<softrobots:route segment="2" at="0 0.3" distance="0.03 0.03" azimuth="0 0"/>'


@cache
def bare() -> str:
    return sr.PccArm(segment_lengths=LENGTHS, muscle_azimuths=()).urdf()


def with_actuator(*routes: str, **attributes: object) -> str:
    """An arm of two segments with one actuator."""
    words = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    return bare().replace("</robot>", f'<softrobots:actuator name="a" {words}>{"".join(routes)}</softrobots:actuator></robot>')


def one(*routes: str, **attributes: object) -> ActuatorTag:
    (tag,) = read_tags(with_actuator(*routes, **attributes)).muscles
    return tag


def test_an_actuator_through_two_segments_is_read() -> None:
    numbers = {"shortest": 0.5, "longest": 0.8, "weakest": -1.0, "strongest": 60.0, "stiffness": 8e3, "pretension": 2.0}
    tag = one(ALONG_1, ALONG_2, kind="elastic", rest_length=0.69, **numbers)
    assert (tag.name, tag.kind, tag.rest_length) == ("a", "elastic", 0.69)
    assert {name: getattr(tag, name) for name in numbers} == numbers
    assert (tag.segments, tag.straight, tag.distance, tag.azimuth) == ((1, 2), True, 0.03, 0.3)
    assert (tag.route[1].at, tag.route[1].distance, tag.route[1].azimuth) == ((0.0, 0.3), (0.03, 0.03), (0.0, 0.0))


def test_what_is_not_stated_has_its_default() -> None:
    tag = one(ALONG_1, ALONG_2, kind="tension")
    assert tag.rest_length == pytest.approx(0.7, abs=1e-15)
    assert (tag.shortest, tag.longest, tag.weakest, tag.strongest) == (0.0, math.inf, 0.0, math.inf)
    assert one(ALONG_1, kind="pressure", area=1e-3).max_pressure == math.inf


def test_the_rest_length_of_a_winding_route_is_that_of_its_curve() -> None:
    """A cone and a helix in one table, by SciPy's quadrature."""
    table = '<softrobots:route segment="1" at="0 0.1 0.4" distance="0.02 0.03 0.03" azimuth="0 0 4.5"/>'
    cone = 0.1 * math.hypot(1.0, 0.01 / 0.1)
    helix = quad(lambda _: math.hypot(1.0, 0.03 * 4.5 / 0.3), 0.1, 0.4)[0]
    assert one(table, kind="length").rest_length == pytest.approx(cone + helix, rel=1e-14)
    assert not one(table, kind="length").straight


def test_a_muscle_of_before_is_an_actuator_of_given_length() -> None:
    for tag in read_tags(sr.PccArm(segment_lengths=LENGTHS).urdf()).muscles:
        (piece,) = tag.route
        assert (tag.kind, tag.weakest, tag.straight) == ("length", -tag.strongest, True)
        assert piece.at == (0.0, pytest.approx(LENGTHS[piece.segment - 1], rel=1e-15))
        assert tag.rest_length == pytest.approx(piece.at[1], rel=1e-15)


REFUSED = [
    ((ALONG_1,), {"kind": "rubber"}, "has kind = 'rubber'; required: one of length, tension, elastic, pressure, mckibben"),
    ((ALONG_1,), {}, "has kind = ''"),
    ((ALONG_1,), {"kind": "elastic"}, "is of kind elastic and has no stiffness; required: stiffness"),
    ((ALONG_1,), {"kind": "mckibben", "diameter": 0.02}, "has no braid_angle"),
    ((ALONG_1,), {"kind": "mckibben", "diameter": 0.02, "braid_angle": 1.6}, "has braid_angle 1.6"),
    ((ALONG_1,), {"kind": "tension", "stiffness": 3.0}, "is of kind tension and has stiffness; required: no number"),
    ((ALONG_1,), {"kind": "pressure", "area": 1e-3, "strongest": 3.0}, "has strongest; required: area; optional: rest_length"),
    ((ALONG_1,), {"kind": "length", "colour": "red"}, "has colour"),
    ((ALONG_1,), {"kind": "elastic", "stiffness": 0}, "has stiffness 0.0; a positive number"),
    ((ALONG_1,), {"kind": "elastic", "stiffness": "nan"}, "has stiffness = 'nan'"),
    ((ALONG_1,), {"kind": "elastic", "stiffness": 1, "pretension": -1}, "has pretension -1.0; required >= 0"),
    (
        (ALONG_1,),
        {"kind": "elastic", "stiffness": 1, "pretension": 3, "strongest": 2},
        "pretension 3.0 N.* at most strongest, 2.0",
    ),
    ((ALONG_1,), {"kind": "length", "shortest": 1, "longest": 0.5}, "is shortest at 1.0 and longest at 0.5 m"),
    ((ALONG_1,), {"kind": "tension", "weakest": 2, "strongest": 1}, "is weakest at 2.0 and strongest at 1.0 N"),
    ((ALONG_1,), {"kind": "tension", "rest_length": 0}, "has rest_length 0.0"),
    ((), {"kind": "tension"}, "has no route"),
    ((ALONG_1.replace('"1"', '"3"'),), {"kind": "tension"}, "runs along segment 3; available: 1, 2"),
    ((ALONG_1.replace('"0 0.4"', '"0 0"'),), {"kind": "tension"}, "ascending places are required"),
    ((ALONG_1.replace('"0 0.4"', '"0.4 0"'),), {"kind": "tension"}, "has at = 0.4 0.0; ascending"),
    ((ALONG_1.replace('"0 0.4"', '"0"'),), {"kind": "tension"}, "has at = '0'; 2 to 1000 finite numbers"),
    ((ALONG_1.replace('"0 0.4"', '"0 x"'),), {"kind": "tension"}, "has at = '0 x'; 2 to 1000 finite"),
    ((ALONG_1.replace('"0 0.4"', '"0 0.2 0.4"'),), {"kind": "tension"}, "has 3 at, 2 distance and 2 azimuth"),
    ((ALONG_1.replace("0.03 0.03", "0.03 -0.03"),), {"kind": "tension"}, "has distance -0.03; required >= 0"),
    ((ALONG_1.replace('"0 0.4"', '"0.4 0.5"'),), {"kind": "tension"}, "outside of segment 1, which is 0.4 m long"),
    ((ALONG_1.replace('"0 0.4"', '"-1 0"'),), {"kind": "tension"}, "runs from -1.0 to 0.0 m, outside of segment 1"),
    ((ALONG_1.replace('"0 0.4"', '"0 0.6"'),), {"kind": "tension"}, "runs from 0.0 to 0.6 m, outside of segment 1"),
    ((ALONG_1.replace('"0 0.4"', '"-0.1 0.4"'),), {"kind": "tension"}, "runs from -0.1 to 0.4 m, outside of segment 1"),
    ((ALONG_2, ALONG_1), {"kind": "tension"}, "ends at 0.3 m of segment 2.*goes on at 0.0 m of segment 1"),
    ((ALONG_1, ALONG_1), {"kind": "tension"}, "must begin where the one before ends"),
    ((ALONG_1.replace("0.4", "0.3"), ALONG_2), {"kind": "tension"}, "ends at 0.3 m of segment 1, which is 0.4 m long"),
    ((ALONG_1, ALONG_2.replace('"0 0.3"', '"0.1 0.3"')), {"kind": "tension"}, "goes on at 0.1 m of segment 2"),
]


@pytest.mark.parametrize(("routes", "attributes", "message"), REFUSED, ids=range(len(REFUSED)))
def test_malformed_actuators_are_refused(routes: tuple[str, ...], attributes: dict[str, object], message: str) -> None:
    with pytest.raises(sr.DescriptionError, match=message):
        read_tags(with_actuator(*routes, **attributes))


def test_a_route_may_change_within_a_segment() -> None:
    halves = [ALONG_1.replace('"0 0.4"', at) for at in ('"0 0.2"', '"0.2 0.4"')]
    tag = one(*halves, ALONG_2, kind="tension")
    assert tag.segments == (1, 2)
    assert tag.rest_length == pytest.approx(0.7, abs=1e-15)


def test_actuators_travel_with_a_robot_on_another() -> None:
    """Names get the prefix, and segments are numbered after those of the carrier."""
    carrier = sr.PccArm(segment_lengths=(0.2,))
    whole = sr.mount(carrier, "tip", with_actuator(ALONG_1, ALONG_2, kind="tension"), prefix="upper_")
    tag = read_tags(whole).muscles[-1]
    assert (tag.name, tag.segments) == ("upper_a", (2, 3))
