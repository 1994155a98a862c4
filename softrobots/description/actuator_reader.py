"""Reader of the actuators in a URDF: their routes, kinds and numbers."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence

from softrobots.core.errors import DescriptionError
from softrobots.description.route_points import route_length, route_points
from softrobots.description.tag_numbers import described, number, numbers, positive, segment_number
from softrobots.description.urdf_tags import KINDS, NAMESPACE, ActuatorTag, AnySectionTag, RouteTag

_TENDON = ("shortest", "longest", "weakest", "strongest")
NUMBERS = {
    "length": _TENDON,
    "tension": _TENDON,
    "elastic": ("stiffness", *_TENDON, "pretension"),
    "pressure": ("area", "max_pressure"),
    "mckibben": ("diameter", "braid_angle", "max_pressure"),
}
"""Numbers that an actuator of each kind has, beside its rest length."""
_REQUIRED = ("stiffness", "area", "diameter", "braid_angle")  # of those, the ones without a default
_NOT_NEGATIVE = ("shortest", "pretension")
_TOUCHING = 1e-9  # between two pieces of a route [m]


def read_actuators(root: ElementTree.Element, sections: Sequence[AnySectionTag], source: str) -> tuple[ActuatorTag, ...]:
    """Read the actuators of a description in the order of the file, also those written as muscles.

    Args:
        root: The URDF.
        sections: Its sections, base to tip.
        source: Its name, for errors.

    Raises:
        DescriptionError: If the kind of an actuator is unknown, a number is missing, superfluous or out of its range, or a
            route is not one from base to tip within the segments.
    """
    lengths: dict[int, float] = {}
    for tag in sections:
        lengths[tag.segment] = lengths.get(tag.segment, 0.0) + tag.length
    muscle = f"{{{NAMESPACE}}}muscle"
    elements = (element for element in root if element.tag in (f"{{{NAMESPACE}}}actuator", muscle))
    return tuple(
        _muscle(element, lengths, source) if element.tag == muscle else _actuator(element, sections, lengths, source)
        for element in elements
    )


def _muscle(element: ElementTree.Element, lengths: Mapping[int, float], source: str) -> ActuatorTag:
    """An actuator of given length, straight along one segment, that pulls and pushes."""
    where = described(element, "muscle", source)
    rest, shortest, longest, strongest = (
        positive(element, key, where) for key in ("rest_length", "shortest", "longest", "strongest")
    )
    _check_limits(where, shortest, longest)
    azimuth, distance = number(element, "azimuth", where), positive(element, "distance", where)
    segment = _segment(element, where, lengths)
    piece = RouteTag(segment=segment, at=(0.0, lengths[segment]), distance=(distance,) * 2, azimuth=(azimuth,) * 2)
    return ActuatorTag(
        name=element.get("name", ""),
        route=(piece,),
        rest_length=rest,
        shortest=shortest,
        longest=longest,
        weakest=-strongest,
        strongest=strongest,
    )


def _actuator(
    element: ElementTree.Element, sections: Sequence[AnySectionTag], lengths: Mapping[int, float], source: str
) -> ActuatorTag:
    where = described(element, "actuator", source)
    kind = element.get("kind", "")
    if kind not in KINDS:
        raise DescriptionError(f"{where} has kind = {kind[:100]!r}; required: one of {', '.join(KINDS)}")
    required, optional = ([key for key in NUMBERS[kind] if (key in _REQUIRED) is needed] for needed in (True, False))
    missing = [key for key in required if key not in element.attrib]
    superfluous = [key for key in element.attrib if key not in ("name", "kind", "rest_length", *NUMBERS[kind])]
    if missing or superfluous:
        raise DescriptionError(
            f"{where} is of kind {kind} and has {'no ' + ', '.join(missing) if missing else ', '.join(superfluous)[:200]}; "
            f"required: {', '.join(required) or 'no number'}; optional: rest_length, {', '.join(optional)}"
        )
    given = [key for key in NUMBERS[kind] if key in element.attrib]
    values = {key: (number if key in (*_NOT_NEGATIVE, "weakest") else positive)(element, key, where) for key in given}
    negative = [key for key in _NOT_NEGATIVE if values.get(key, 0.0) < 0.0]
    if negative:
        raise DescriptionError(f"{where} has {negative[0]} {values[negative[0]]}; required >= 0")
    if not values.get("braid_angle", 1.0) < math.pi / 2.0:
        raise DescriptionError(f"{where} has braid_angle {values['braid_angle']}; required in (0, pi / 2) rad")
    route = tuple(_piece(child, where, lengths) for child in element.findall(f"{{{NAMESPACE}}}route"))
    _check_order(route, lengths, where)
    if "rest_length" in element.attrib:
        rest = positive(element, "rest_length", where)
    else:
        points = route_points(route, [(tag.segment, tag.length) for tag in sections])
        rest = route_length(points, [tag.rest for tag in sections])
    tag = ActuatorTag(name=element.get("name", ""), route=route, kind=kind, rest_length=rest, **values)
    _check_limits(where, tag.shortest, tag.longest)
    if not tag.weakest < tag.strongest:
        raise DescriptionError(f"{where} is weakest at {tag.weakest} and strongest at {tag.strongest} N")
    if tag.pretension > tag.strongest:
        raise DescriptionError(
            f"{where} has pretension {tag.pretension} N at rest; required at most strongest, {tag.strongest} N"
        )
    return tag


def _piece(element: ElementTree.Element, where: str, lengths: Mapping[int, float]) -> RouteTag:
    where = f"a route of {where}"
    segment = _segment(element, where, lengths)
    at, distance, azimuth = (numbers(element, key, where) for key in ("at", "distance", "azimuth"))
    if not len(at) == len(distance) == len(azimuth):
        raise DescriptionError(
            f"{where} has {len(at)} at, {len(distance)} distance and {len(azimuth)} azimuth; as many of each are required"
        )
    if any(second <= first for first, second in itertools.pairwise(at)):
        raise DescriptionError(f"{where} has at = {' '.join(map(str, at))[:100]}; ascending places are required")
    if min(distance) < 0.0:
        raise DescriptionError(f"{where} has distance {min(distance)}; required >= 0 m")
    end = lengths[segment]
    if not (-_TOUCHING <= at[0] < end - _TOUCHING and _TOUCHING < at[-1] <= end + _TOUCHING):
        raise DescriptionError(
            f"{where} runs from {at[0]} to {at[-1]} m, outside of segment {segment}, which is {end:.9g} m long"
        )
    return RouteTag(segment=segment, at=at, distance=distance, azimuth=azimuth)


def _check_order(route: Sequence[RouteTag], lengths: Mapping[int, float], where: str) -> None:
    """Check that every piece begins where the one before ends."""
    if not route:
        raise DescriptionError(f"{where} has no route; one <softrobots:route> or more is required")
    following = dict(itertools.pairwise(sorted(lengths)))
    for one, other in itertools.pairwise(route):
        within = other.segment == one.segment and abs(other.at[0] - one.at[-1]) <= _TOUCHING
        across = other.segment == following.get(one.segment)
        if not within and not (across and one.at[-1] >= lengths[one.segment] - _TOUCHING and other.at[0] <= _TOUCHING):
            raise DescriptionError(
                f"{where} has a route that ends at {one.at[-1]} m of segment {one.segment}, which is "
                f"{lengths[one.segment]:.9g} m long, and goes on at {other.at[0]} m of segment {other.segment}; each piece "
                "must begin where the one before ends, base to tip"
            )


def _check_limits(where: str, shortest: float, longest: float) -> None:
    if not shortest < longest:
        raise DescriptionError(f"{where} is shortest at {shortest} and longest at {longest} m")


def _segment(element: ElementTree.Element, where: str, lengths: Mapping[int, float]) -> int:
    segment = segment_number(element, where)
    if segment not in lengths:
        available = ", ".join(map(str, sorted(lengths))) or "none"
        raise DescriptionError(f"{where} runs along segment {segment}; available: {available}")
    return segment
