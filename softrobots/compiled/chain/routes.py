"""Routes of actuators along a chain, as tables: what passes which element, and where the sums over it stand.

Straight-line code for each actuator beside each element would take minutes to compile; so code of routes is a loop over the
actuators beside an element, and over the points of each (`softrobots.model.muscle_paths`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import accumulate
from typing import NamedTuple, Protocol

import numpy as np

from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.chain.unknowns import Segment, Unknowns
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.model.dry_friction import DryFriction
from softrobots.model.serial_chain import strains_of

POINT_RECORD = 4
"""Numbers kept of a point: components of its direction, and one over its length."""
GUIDE_RECORD = 6
"""Numbers kept of a guide behind those: change of its piece, tension, coupling with what is beyond and with itself, share of
its friction, and the second component of the slope."""


class Beside(NamedTuple):
    """An actuator beside an element."""

    number: int
    """Its number in the segment."""
    paths: tuple[int, ...]
    """Its paths there, of `MusclePaths`."""


class Routed(Protocol):
    """A chain with routes, of statics or of motion."""

    @property
    def unknowns(self) -> Unknowns:
        """The chain."""

    @property
    def routes(self) -> Routes:
        """The routes."""

    def table(self, block: Block, name: str, count: int) -> TableColumns:
        """Begin a table of numbers of `count` elements."""


@dataclass(frozen=True)
class Routes:
    """The routed segments of a chain, and places of their numbers behind `first`.

    The actuators of a segment are numbered (M); the first c of them, whose tensions depend on their lengths, are components of
    the turn of the elements that they pass. A side is a right-hand side of the elimination; `k` the largest number of unknowns
    of an element; sums over its unknowns have so many places.
    """

    unknowns: Unknowns
    """The chain."""
    first: int
    """First of the places."""
    beside: dict[int, tuple[Beside, ...]] = field(init=False)
    """By element of a routed segment: what is beside it."""
    margin: int = field(init=False)
    """Least distance of a route from the end of its range [m]."""
    lengths: int = field(init=False)
    """Change of length of each actuator of a segment, from zero strain, so far [m] (M)."""
    changes: int = field(init=False)
    """The same of each actuator of the robot, whole [m]."""
    pulled: int = field(init=False)
    """Tension of each actuator of the robot [N]."""
    tensions: int = field(init=False)
    """Tension of each actuator of the segment [N] (M)."""
    stretching: int = field(init=False)
    """With guides that rub: its derivative by the length [N/m] (M)."""
    load: int = field(init=False)
    """Sum of tensions times slopes of the lengths, of an element."""
    curvature: int = field(init=False)
    """Sum of tensions times second derivatives of the lengths, upper triangle by columns."""
    push: int = field(init=False)
    """Sum over the components of `P` of turn and component times slopes (3, k)."""
    own: int = field(init=False)
    """Slopes times `P` of the components times slopes, upper triangle by columns."""
    sides: int = field(init=False)
    """Sum of slopes times `s` of the components, of each side."""
    before: int = field(init=False)
    """Sum of `L^-1 C^T` of the components times their turns, of each side."""
    twists: int = field(init=False)
    """Turn per unknown of the element (3, k)."""
    lower: int = field(init=False)
    """`L` of the element (k, k)."""
    inverse: int = field(init=False)
    """`1 / D'` of the element."""
    coupling: int = field(init=False)
    """`L^-1 C^T` of the turn (k, 3)."""
    columns: int = field(init=False)
    """`L^-1 g'` of each side."""
    cross: int = field(init=False)
    """`P` of turn and components, component by component (3 each)."""
    square: int = field(init=False)
    """`P` of the components (c, c)."""
    sums: int = field(init=False)
    """`s` of the components, of each side (4, c)."""
    turns: int = field(init=False)
    """How much the steps nearer to the base lengthen the actuators, of each side (4, c) [m]."""
    slopes: int = field(init=False)
    """Slope of the length of each numbered actuator beside each element, k each."""
    weighted: int = field(init=False)
    """With guides that rub: change of the tension beyond by each unknown, in the order of `slopes` [N/rad or N/m]."""
    meetings: int = field(init=False)
    """`L^-1 C^T` of the components of each element, k each."""
    points: int = field(init=False)
    """`POINT_RECORD` of each point."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Find what is beside each element, and assign the places."""
        rows = [row for one in self.segments for row in range(one.first, one.last + 1) if self.unknowns.moving(row)]
        object.__setattr__(self, "beside", {row: self._beside(row) for row in rows})
        muscles = max((len(one.muscles) for one in self.segments), default=0)
        robot, c, k = len(self.unknowns.chain.actuators), self.components, self.stride
        sums = dict(
            load=k, curvature=k * (k + 1) // 2, push=3 * k, own=k * (k + 1) // 2, sides=4 * k, before=4 * k, twists=3 * k
        )
        sums |= dict(lower=k * k, inverse=k, coupling=3 * k, columns=4 * k, cross=3 * c, square=c * c, sums=4 * c, turns=4 * c)
        sizes = (
            dict(
                margin=1,
                lengths=muscles,
                changes=robot,
                pulled=robot,
                tensions=muscles,
                stretching=muscles if self.guided else 0,
            )
            | sums
        )
        slopes = sum(map(self.rows, rows)) * k
        rest = dict(slopes=slopes, weighted=slopes if self.guided else 0, meetings=sum(map(self.past, rows)) * k)
        rest["points"] = self.record * sum(len(one.paths) for row in rows for one in self.beside[row])
        if rows:
            assign_places(self, self.first, **sizes, **rest, end=0)
        else:
            object.__setattr__(self, "end", self.first)

    @property
    def guided(self) -> bool:
        """Whether actuators rub in their guides, one a point of a route."""
        return self.unknowns.chain.guides is not None

    @property
    def record(self) -> int:
        """Count of numbers kept of a point."""
        return POINT_RECORD + (GUIDE_RECORD if self.guided else 0)

    @property
    def segments(self) -> list[Segment]:
        """The routed segments, base to tip."""
        return list(self.unknowns.segments) if self.unknowns.routed else []

    @property
    def components(self) -> int:
        """Largest number of components of a segment."""
        return max((len(one.stretched) for one in self.segments), default=0)

    @property
    def stride(self) -> int:
        """Largest number of unknowns of an element."""
        return max((len(self.unknowns.moving(row)) for row in self.beside), default=0)

    def past(self, row: int) -> int:
        """Return the number of components at an element: up to the last actuator of them that goes past it."""
        segment, spans = self.unknowns.segment_at(row), self.unknowns.chain.spans
        past = [
            number for number, one in enumerate(segment.stretched if segment else ()) if spans[one][0] <= row <= spans[one][1]
        ]
        return 1 + max(past, default=-1)

    def rows(self, row: int) -> int:
        """Return how many numbered actuators an element has slopes of."""
        return max(self.past(row), 1 + max((one.number for one in self.beside[row]), default=-1))

    def paths(self) -> list[tuple[int, int]]:
        """Return element and path of every point, in the order of the tables."""
        return [(row, path) for row in self.beside for one in self.beside[row] for path in one.paths]

    def tables(self) -> dict[str, object]:
        """Return the tables of the loops."""
        count, chain = len(self.unknowns.chain.elements), self.unknowns.chain
        beside = [self.beside.get(row, ()) for row in range(count)]
        pairs, k = [one for row in beside for one in row], self.stride
        rows, past = ([size(row) if row in self.beside else 0 for row in range(count)] for size in (self.rows, self.past))
        tables = {} if chain.guides is None else self.guide_tables(chain.guides)
        return tables | {
            "FIRST_BESIDE": (0, *accumulate(len(one) for one in beside)),
            "FIRST_POINT": (0, *accumulate(len(one.paths) for one in pairs)),
            "NUMBER": tuple(one.number for one in pairs),
            "N_ROWS": tuple(rows),
            "N_PAST": tuple(past),
            "SLOPES": tuple(accumulate((k * size for size in rows[:-1]), initial=self.slopes)),
            "MEETINGS": tuple(accumulate((k * size for size in past[:-1]), initial=self.meetings)),
            "STRIDE": k,
            "POINTS": self.points,
            "POINT_RECORD": self.record,
            "N_COMPONENTS": self.components,
            "COMPONENT_PUSH": self.cross,
            "COMPONENT_SQUARE": self.square,
        }

    def guide_tables(self, friction: DryFriction) -> dict[str, object]:
        """Return the tables of `guides.RUB` and of `guide_drivers`; guides are in the order of the paths of the actuators."""
        chain, segments = self.unknowns.chain, self.unknowns.segments
        paths = chain.muscle_paths
        point = {path: number for number, (_, path) in enumerate(self.paths())}
        places = np.array([[self.unknowns.place.get(one, -1) for one in row] for row in paths.places.tolist()])
        strains = np.append(chain.rest, 0.0)[paths.places]
        turned, slope = friction.turns
        pieces = np.stack([paths.turned, np.zeros(len(paths.length)), paths.length], axis=-1)
        turned = np.concatenate([turned, pieces[:, None]], axis=1)
        slope = np.concatenate([slope, np.concatenate([paths.across, paths.arms[:, None]], axis=1)[:, None]], axis=1)
        rest = turned + (slope @ np.where(places < 0, strains, 0.0)[:, None, :, None])[..., 0]
        slope = np.where((places < 0)[:, None, None], 0.0, slope)
        return {
            "FIRST_RUBBING": (0, *accumulate(len(one.muscles) for one in segments)),
            "RUBBING": tuple(muscle for one in segments for muscle in one.muscles),
            "N_RUBBING": len(chain.actuators),
            "FIRST_GUIDE": (*paths.starts.tolist(), len(paths.muscle)),
            "GUIDE_AT": tuple(self.points + self.record * point[one] + POINT_RECORD for one in range(len(point))),
            "GUIDE_LENGTH": tuple((paths.length + 0.5 * paths.turned**2 / paths.length).tolist()),
            "GUIDE_LUMPED": tuple(np.where(paths.separable, paths.length, 0.0).tolist()),
            "GUIDE_STICK": tuple(friction.stick.tolist()),
            "GUIDE_REST": tuple(friction.beyond_at_rest.tolist()),
            "GUIDE_COEFFICIENT": tuple(friction.coefficient.tolist()),
            "GUIDE_STRAIN": tuple(np.maximum(places, 0).ravel().tolist()),
            "GUIDE_TURN": tuple(np.concatenate([rest[..., None], slope], axis=-1).ravel().tolist()),
            "STRETCHING": self.stretching,
            "TENSIONS": self.tensions,
            "PULLED": self.pulled,
            "WEIGHTED": self.weighted - self.slopes,
        }

    def _beside(self, row: int) -> tuple[Beside, ...]:
        paths, segment = self.unknowns.chain.muscle_paths, self.unknowns.segment_at(row)
        touching = np.isin(paths.places, strains_of(self.unknowns.chain.elements[row])).any(axis=1)
        found = []
        for number, muscle in enumerate(segment.muscles if segment else ()):
            own = np.flatnonzero(touching & (paths.muscle == muscle)).tolist()
            if own:
                found.append(Beside(number, tuple(own)))
        return tuple(found)
