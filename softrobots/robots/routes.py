"""Routes of actuators along the backbone of an arm, and the `routing` of an arm, which says what route each actuator has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from softrobots.core.checks import finite_array
from softrobots.core.errors import ParameterError
from softrobots.core.field_help import FieldHelp
from softrobots.robots.field_values import numbers, questioned_angles
from softrobots.robots.fields import PerPart, argument_text

ROUTINGS = ("segment", "base")
"""Where the actuators of a segment start: where the segment does, or at the base of the robot."""

MOST_PLACES = 1000
"""Most places that a route may name, and most routes of a robot."""

_BEYOND = 1e-9  # by which a route may end behind the tip, relative to the length of the robot


@dataclass(frozen=True, kw_only=True)
class Route(FieldHelp):
    """A path fixed in the body of a straight arm, along which an actuator runs.

    Between the places `at`, distance and azimuth are linear in the position along the backbone: constant values are a straight
    line parallel to it, an azimuth that changes is a helix around it.

    Where it begins or ends within a section of the chain, its length is of first order in that of the section: let a segment
    end there.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    at: Sequence[float]
    """Positions along the backbone at rest, from the base of the robot, ascending, two or more [m]."""
    azimuth: PerPart
    """Azimuth there, from the x axis of the base towards y, unwrapped; one number, or one for each position [rad]."""
    distance: PerPart
    """Distance from the backbone there, likewise [m]."""

    def __post_init__(self) -> None:
        """Check every field and store a number for each position."""
        at = finite_array("at", self.at, (None,), "m")
        if not 2 <= len(at) <= MOST_PLACES or at[0] < 0.0 or np.any(np.diff(at) <= 0.0):
            requirement = f"two positions or more, at most {MOST_PLACES}, ascending from 0 or above [m]"
            raise ParameterError("at", self.at, requirement)
        azimuth = questioned_angles("azimuth", numbers("azimuth", self.azimuth, len(at), "rad", "positions"), winding=True)
        distance = numbers("distance", self.distance, len(at), "m", "positions")
        if min(distance) <= 0.0:
            raise ParameterError("distance", self.distance, "above 0 [m]")
        for name, values in (("at", tuple(at.tolist())), ("azimuth", azimuth), ("distance", distance)):
            object.__setattr__(self, name, values)


Routing = tuple[str | int, ...] | tuple[Route, ...]
"""Where the actuators of each segment start, or the routes of all actuators."""


def checked_routing(value: Any, lengths: Sequence[float]) -> Routing:
    """Return the routing of an arm in its final type.

    Args:
        value: One of `ROUTINGS` or the number of the segment where the actuators start, for all segments or one for each; or a
            list of routes, each a `Route` or a mapping of its fields.
        lengths: Lengths of the segments [m].

    Returns:
        One word or number a segment, or routes.

    Raises:
        ParameterError: If it is neither, a segment is behind its actuators, or a route ends behind the tip or where it begins.
    """
    plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    items = (plain,) * len(lengths) if isinstance(plain, str | int) else plain
    if not isinstance(items, list | tuple) or not items:
        raise ParameterError("routing", value, _requirement(len(lengths)))
    if all(isinstance(item, Route | Mapping) for item in items):
        return tuple(_route(item, value, float(np.sum(lengths)), len(items)) for item in items)
    if len(items) != len(lengths):
        raise ParameterError("routing", value, _requirement(len(lengths)))
    return tuple(_start(item, value, segment, len(lengths)) for segment, item in enumerate(items, start=1))


def routing_text(routing: Routing) -> str:
    """Return a routing as the text of a xacro argument: `[segment,1]`, or `at | azimuth | distance; ...` for routes."""
    routes = [item for item in routing if isinstance(item, Route)]
    if not routes:
        return argument_text(routing)
    return "; ".join(" | ".join(" ".join(map(repr, values)) for values in vars(route).values()) for route in routes)


def owner(route: Route, lengths: Sequence[float]) -> int:
    """Return the number of the segment in which a route ends, from 1; its actuator is one of that segment."""
    ends = np.cumsum(lengths)
    return int(np.searchsorted(ends + _BEYOND * ends[-1], route.at[-1])) + 1


def _route(item: Any, value: Any, length: float, count: int) -> Route:
    route = item if isinstance(item, Route) else _of_mapping(item, value)
    if route.at[-1] > (1.0 + _BEYOND) * length or count > MOST_PLACES:
        requirement = f"at most {MOST_PLACES} routes that end within the length of the robot, {length} m"
        raise ParameterError("routing", value, requirement)
    least = 2.0 * _BEYOND * length  # so that a part of it is longer than the tolerance in the segments on both sides
    if route.at[-1] - route.at[0] <= least:
        raise ParameterError("routing", value, f"routes with `at` that spans more than {least:.3g} m; one has {route.at}")
    return route


def _of_mapping(item: Mapping[str, Any], value: Any) -> Route:
    names = [field.name for field in fields(Route)]
    if set(item) != set(names):
        raise ParameterError("routing", value, f"routes with {', '.join(names)}")
    try:
        return Route(**item)
    except ParameterError as error:
        raise ParameterError("routing", value, f"routes with {error.field} {error.requirement}") from error


def _start(item: Any, value: Any, segment: int, count: int) -> str | int:
    plain = item.item() if isinstance(item, np.generic) else item
    if isinstance(plain, str) and plain in ROUTINGS:
        return plain
    if isinstance(plain, int) and not isinstance(plain, bool) and 1 <= plain <= segment:
        return plain
    raise ParameterError("routing", value, _requirement(count))


def _requirement(count: int) -> str:
    words = " or ".join(map(repr, ROUTINGS))
    return (
        f"{words}, or the number of the segment where the actuators of a segment start, at most its own: one for all, or one "
        f"for each of the {count} segments; or a list of routes"
    )
