"""Arms of bending segments in a row: their rigid chain, and the actuators along them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softrobots.constant_curvature import muscle_residual
from softrobots.core.checks import finite_array, finite_number
from softrobots.core.errors import ParameterError
from softrobots.core.suspicion import question_length
from softrobots.description.actuator_reader import NUMBERS
from softrobots.robots.field_values import numbers, questionable, questioned_angles
from softrobots.robots.fields import (
    PerPart,
    XacroRobot,
    check_actuator_parameters,
    check_parameters,
    facts_of,
    parameter,
    per_part,
    refuse_given,
)
from softrobots.robots.routes import Route, Routing, checked_routing, owner, routing_text

CHAINS = ("sections", "lumped")
"""Forms of the equivalent rigid chain."""

HINGE_RULES = ("corrected", "midpoint")
"""Where the hinges of the lumped chain stand."""

MOST_SECTIONS = 1000
"""Sections or hinges that a segment may have; an arm has at most twice as many."""

QUARTER_TURN = {"at_least": -math.pi / 2, "at_most": math.pi / 2}
"""Bounds of angles at rest."""

ROUTING = (
    "Where the actuators of a segment start: segment (where it does), base (at the base, through the segments before it) "
    "or the number of a segment, for all or one for each; or a list of routes, each with at (positions along the backbone "
    "from the base), azimuth (from the x axis of the base) and distance there; it is of the segment in which it ends"
)
"""What `routing` is."""

ATTRIBUTES = {
    **{"contraction": "shortest", "extension": "longest", "force": "strongest", "least_tension": "weakest"},
    **{name: name for name in ("stiffness", "pretension", "area", "diameter", "braid_angle", "max_pressure")},
}
"""The number of an actuator (`softrobots.description.actuator_reader.NUMBERS`) that each of their parameters gives."""


@dataclass(frozen=True, kw_only=True)
class ContinuumArm(XacroRobot):
    """Base of an arm of bending segments; the defaults are those of the arm of [PCC paper].

    Its actuators are fields of its class that begin with the same word, `ACTUATOR`: the azimuths and distances of those of a
    segment, and those of `ATTRIBUTES`.

    Raises:
        ParameterError: If a value is out of range or a list has the wrong length; the message names the field.
    """

    segment_lengths: Sequence[float] = per_part(
        (0.524, 0.524),
        "m",
        "Rest lengths of the segments, base to tip; their number is the number of segments",
        "PCC paper, section 3 (52.4 cm)",
        above=0.0,
    )
    offset: PerPart = parameter(
        math.pi / 3,
        "rad",
        "Turn about the backbone before each segment but the first, or a list with one for each and the first",
        "PCC paper, section 3 (60 degrees)",
        form="special",
    )
    linear_density: PerPart = per_part(0.6, "kg/m", "Mass per rest length", "assumed", above=0.0)
    radius: PerPart = per_part(0.05, "m", "Radius of the body; for inertia and pictures", "assumed", above=0.0)
    chain: str = parameter(
        "sections", "", "Form of the equivalent rigid chain: sections, lumped or flexures", options=(*CHAINS, "flexures")
    )
    elastic_sections: int = parameter(
        4,
        "",
        "Sections of constant strain a segment, for chain = sections; 1 is pure constant curvature",
        at_least=1,
        at_most=MOST_SECTIONS,
    )
    hinges: int = parameter(
        12, "", "Pairs of orthogonal springs a segment, or flexures, unless chain = sections", at_least=1, at_most=MOST_SECTIONS
    )
    hinge_rule: str = parameter(
        "corrected",
        "",
        "Where the hinges stand, unless chain = sections: midpoint (in the middle of their sections) or corrected (the outer "
        "ones of a segment moved so that it bends exactly under an end load and its own weight)",
        options=HINGE_RULES,
    )
    torsion: bool = parameter(True, "", "Whether a lumped segment can twist: a torsional spring a hinge")
    extension: bool = parameter(True, "", "Whether a lumped segment can stretch, by a sliding spring a hinge, and flexures can")
    rgba: Sequence[float] | Sequence[Sequence[float]] = parameter(
        (0.55, 0.60, 0.65, 1.0), "", "Colour of a segment: red, green, blue, opacity in 0 to 1", form="colour"
    )
    damping_time: float = parameter(
        0.05, "s", "Damping of each joint over its stiffness; has no effect on the statics", "assumed", at_least=0.0
    )
    base_mass: float = parameter(
        2.0, "kg", "Mass of the base, fixed to the world", "assumed; has no effect on the statics", above=1e-6
    )
    bending_friction: PerPart = per_part(0.0, "N m", "Moment of dry friction that holds the bending of a segment", at_least=0.0)
    guide_friction: PerPart = per_part(
        0.0, "-", "Coefficient of dry friction of actuators in the guides of a segment", at_least=0.0
    )
    rest_bend_x: PerPart = per_part(0.0, "rad", "Bend of a segment about its x axis where it carries no moment", **QUARTER_TURN)
    rest_bend_y: PerPart = per_part(0.0, "rad", "Bend of a segment about its y axis where it carries no moment", **QUARTER_TURN)
    rest_twist: PerPart = per_part(0.0, "rad", "Twist of a segment where it carries no moment", **QUARTER_TURN)
    routing: str | int | Sequence[str | int] | Sequence[Route] = parameter(
        "segment",
        "",
        ROUTING,
        form="special",
    )
    kind: str | Sequence[str] = parameter(
        "length",
        "",
        "What the actuators of a segment are given, for all or one for each: their length, their tension, elastic (the length "
        "at the motor), or the pressure of chambers (pressure) or McKibben muscles (mckibben); length for all or for none",
        form="special",
    )

    ACTUATOR: ClassVar[str]
    """What an actuator is called: the first word of its name and of its fields."""
    KINDS: ClassVar[tuple[str, ...]]
    """What actuators can be given."""

    def __post_init__(self) -> None:
        """Check every field and repeat single numbers for all segments."""
        count = check_parameters(self, "segments", "segment_lengths")
        azimuths = f"{self.ACTUATOR}_azimuths"
        object.__setattr__(self, "offset", self._checked_offset(count))
        object.__setattr__(self, "routing", checked_routing(self.routing, self.segment_lengths))
        object.__setattr__(self, "kind", self._checked_kinds(count))
        object.__setattr__(self, azimuths, self._checked_azimuths(azimuths))
        check_actuator_parameters(self, count, "segments", self.n_actuators)
        most = max(1, 2 * MOST_SECTIONS // count)
        for name in ("elastic_sections", "hinges"):
            if getattr(self, name) > most:
                raise ParameterError(name, getattr(self, name), f"a positive integer, at most {most} for {count} segments")
        self._check_actuators()

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        return super().xacro_arguments() | {"routing": routing_text(self._each("routing"))}

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return len(self.segment_lengths)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain."""
        each = {"sections": 6 * self.elastic_sections, "lumped": self.hinges * (2 + self.torsion + self.extension)}
        return self.n_segments * each.get(self.chain, 6 * self.hinges)

    @property
    def n_actuators(self) -> int:
        """Number of actuators of the whole arm."""
        return len(self.routes) or self.n_segments * len(getattr(self, f"{self.ACTUATOR}_azimuths"))

    @property
    def actuator_segments(self) -> tuple[int, ...]:
        """Number, from 0, of the segment that each actuator is of: in which it ends."""
        if self.routes:
            return tuple(owner(route, self.segment_lengths) - 1 for route in self.routes)
        each = len(getattr(self, f"{self.ACTUATOR}_azimuths"))
        return tuple(segment for segment in range(self.n_segments) for _ in range(each))

    def by_actuator(self, name: str) -> tuple[float, ...]:
        """Values of a field of actuators, one for each, whether it has one a segment or one for each actuator."""
        values = self._each(name)
        return tuple(values[self.place_of(name, number)] for number in range(self.n_actuators))

    def place_of(self, name: str, number: int) -> int:
        """Where in a field of actuators the value of one is, `number` from 0."""
        return self.actuator_segments[number] if len(self._each(name)) == self.n_segments else number

    @property
    def routes(self) -> tuple[Route, ...]:
        """The routes that `routing` lists; none if it says where the actuators of the segments start."""
        routing: Routing = self._each("routing")
        return tuple(item for item in routing if isinstance(item, Route))

    @property
    def starts(self) -> tuple[int, ...]:
        """Number, from 0, of the segment in which the actuators of each segment start; none if `routing` lists routes."""
        starts: dict[str | int, int] = {"base": 0} | {number: number - 1 for number in range(1, self.n_segments + 1)}
        words = [item for item in self._each("routing") if not isinstance(item, Route)]
        return tuple(starts.get(word, segment) for segment, word in enumerate(words))

    def _checked_offset(self, count: int) -> tuple[float, ...]:
        if isinstance(self.offset, list | tuple) or (isinstance(self.offset, np.ndarray) and self.offset.ndim):
            return questioned_angles("offset", numbers("offset", self.offset, count, "rad", "segments"))
        (turn,) = questioned_angles("offset", (finite_number("offset", self.offset, "rad"),))
        return (0.0, *(turn,) * (count - 1))

    def _checked_kinds(self, count: int) -> tuple[str, ...]:
        kinds: Any = (self.kind,) * count if isinstance(self.kind, str) else self.kind
        if (
            not isinstance(kinds, list | tuple)
            or len(kinds) != count
            or any(not isinstance(kind, str) or kind not in self.KINDS for kind in kinds)
            or ("length" in kinds and set(kinds) != {"length"})
        ):
            words = ", ".join(self.KINDS)
            raise ParameterError(
                "kind", self.kind, f"one of {words}, or one for each of the {count} segments; length for all or none"
            )
        return tuple(kinds)

    def _checked_azimuths(self, name: str) -> tuple[float, ...]:
        given = getattr(self, name)
        azimuths = finite_array(name, given, (None,), "rad")
        if len(azimuths) == 0:
            return ()
        around = np.sort(azimuths % math.tau)
        if len(azimuths) > 1 and np.min(np.diff(around, append=around[0] + math.tau)) < 1e-6:
            raise ParameterError(name, given, "azimuths that differ (modulo a turn) [rad]")
        if "length" in self.kind:
            try:
                muscle_residual(np.ones(len(azimuths)), 1.0, azimuths)  # knows what azimuths fix an arc
            except ParameterError as error:
                requirement = "none, or three or more that differ (modulo a turn) and do not all lie close together [rad]"
                raise ParameterError(name, given, f"{requirement}, for kind = length") from error
        return questioned_angles(name, tuple(azimuths.tolist()))

    def _check_actuators(self) -> None:
        """Refuse parameters of actuators that have no effect, and a least tension or a pretension above the largest."""
        prefix, facts = f"{self.ACTUATOR}_", facts_of(self)
        if self.chain == "flexures" and self.n_actuators:
            raise ParameterError(
                "chain", self.chain, f"sections or lumped for an arm with actuators; {prefix}azimuths=() for a rod without"
            )
        used = {number for kind in self.kind for number in NUMBERS[kind]}
        for name, attribute in ATTRIBUTES.items():
            if prefix + name in facts and attribute not in used:
                refuse_given(self, (prefix + name,), f"for kind = {', '.join(dict.fromkeys(self.kind))}")
        if self.routes:
            names = (f"{prefix}azimuths", f"{prefix}azimuth_deviation", f"{prefix}distance")
            refuse_given(self, names, "where routing lists the routes")
            straight: Any = type(self).__dataclass_fields__[names[-1]]
            farthest = float(max(np.max(route.distance) for route in self.routes))
            if questionable(straight, (farthest,)):
                question_length("distance of a route", farthest, straight.default)
        least, most = f"{prefix}least_tension", f"{prefix}force"
        if getattr(self, least) is not None and any(
            low >= high for low, high in zip(self.by_actuator(least), self.by_actuator(most), strict=True)
        ):
            raise ParameterError(least, getattr(self, least), f"below {most}, {self._each(most)} N")
        pretension = f"{prefix}pretension"
        rows = zip(self.actuator_segments, self.by_actuator(pretension), self.by_actuator(most), strict=True)
        if any(self.kind[segment] == "elastic" and at_rest > largest for segment, at_rest, largest in rows):
            raise ParameterError(pretension, getattr(self, pretension), f"at most {most}, {self._each(most)} N")
