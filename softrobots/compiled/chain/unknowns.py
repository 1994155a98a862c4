"""Unknown strains of a chain, and its elements for a trace."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from softrobots.compiled.chain.dry_friction import Rubbing
from softrobots.compiled.chain.elements import constants
from softrobots.compiled.chain.muscle_terms import ElementMuscle
from softrobots.compiled.chain.traced_elements import TracedElement, hinge
from softrobots.compiled.settings import LARGEST_NUMBER, LARGEST_POSITION, MAX_UNROLLED_JOINTS
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, scalar
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.model.actuator_laws import ROUNDING, ActuatorLaws
from softrobots.model.dry_friction import rounding_of
from softrobots.model.serial_chain import ChainHinge, ChainJoint, ChainSection, Element, SerialChain, bodies_of, strains_of

STRETCHED = ("elastic", "mckibben")
"""Kinds of actuators whose tension depends on the length."""


class Segment(NamedTuple):
    """Part of a chain with muscles: those with overlapping elements share one."""

    first: int
    """Its first element."""
    last: int
    """Its last element."""
    groups: tuple[int, ...]
    """Its groups of `SerialChain.constrained`, one multiplier each; empty if tensions are given."""
    muscles: tuple[int, ...]
    """Its muscles; with `Unknowns.routed` those first whose tension depends on the length, from the tip on."""
    stretched: tuple[int, ...] = ()
    """Those whose tension depends on the length; with `Unknowns.held_lengths`, or guides that rub, all."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A chain and its unknown strains."""

    chain: SerialChain
    """The chain."""
    locked: tuple[str, ...] = ()
    """Section strains that keep their rest value, of `strain_chain.STRAINS`."""
    as_routes: bool = False
    """Whether straight muscles along one segment each are taken as routes, too: motion does so with given lengths."""

    def __post_init__(self) -> None:
        """Refuse unknown names, strains that muscle lengths constrain, and all of a section at once."""
        for name in self.locked:
            if name not in STRAINS:
                raise NameNotFound("section strain", name, STRAINS)
        if self.locked and self.held_lengths and not self.as_routes:
            raise ParameterError(
                "locked_strains", self.locked, "empty for muscles of given length that wind or pass several segments"
            )
        constrained = {strain for group in self.chain.constrained for strain in group}
        sections = [element for element in self.chain.elements if isinstance(element, ChainSection)]
        named = [pair for element in sections for pair in zip(STRAINS, strains_of(element), strict=False)]
        if any(self._locked_strains.issuperset(strains_of(element)) for element in sections):
            raise ParameterError("locked_strains", self.locked, "fewer strains: with all of them a section is rigid")
        clash = sorted({name for name, strain in named if name in self.locked and strain in constrained})
        if clash:
            raise ParameterError("locked_strains", self.locked, f"without {', '.join(clash)}, which muscle lengths constrain")
        if self.chain.rest.size and float(np.abs(self.chain.rest).max()) > LARGEST_POSITION:
            requirement = f"a robot with rest positions of springs within +-{LARGEST_POSITION:g} rad or m, to be compiled"
            raise ParameterError("model", self.chain.name, requirement)
        if self.chain.slack_hinges and not self.is_unrolled:
            requirement = (
                f"at most {MAX_UNROLLED_JOINTS} joints, without muscles or dry friction, to be compiled with slack walls"
            )
            raise ParameterError("model", self.chain.name, requirement)
        if self.locked and not self._locked_strains:
            raise ParameterError("locked_strains", self.locked, "empty for a robot without sections that have such strains")

    @cached_property
    def strains(self) -> tuple[int, ...]:
        """Indices of the unknown strains, in order."""
        return tuple(row for row in range(len(self.chain.stiffness)) if row not in self._locked_strains)

    @cached_property
    def rest(self) -> tuple[float, ...]:
        """Rest value of each unknown strain [rad or m]."""
        return tuple(float(self.chain.rest[strain]) for strain in self.strains)

    @cached_property
    def place(self) -> dict[int, int]:
        """Place of each unknown strain among the unknowns."""
        return {strain: place for place, strain in enumerate(self.strains)}

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The segments with muscles."""
        return tuple(self._segment(muscles) for muscles in reversed(self.chain.overlapping))

    def _segment(self, muscles: Sequence[int]) -> Segment:
        """Return the segment of muscles that overlap, sorted by their ends, tip to base."""
        chain, spans = self.chain, self.chain.spans
        first, last = min(spans[one][0] for one in muscles), max(spans[one][1] for one in muscles)
        groups = tuple(
            number for number, group in enumerate(chain.constrained) if first <= self.chain.element_of[group[0]] <= last
        )
        whole = self.held_lengths or chain.guides is not None
        stretched = tuple(one for one in muscles if whole or chain.actuators[one].kind in STRETCHED)
        ordered = [*stretched, *(one for one in muscles if one not in stretched)] if self.routed else sorted(muscles)
        return Segment(first, last, groups, tuple(ordered), stretched)

    @cached_property
    def multiplier(self) -> dict[int, int]:
        """By constrained strain: the number of its multiplier in its segment."""
        numbered = [(number, group) for segment in self.segments for number, group in enumerate(segment.groups)]
        return {strain: number for number, group in numbered for strain in self.chain.constrained[group]}

    @cached_property
    def slack_hinges(self) -> tuple[tuple[int, int, float], ...]:
        """Elements of the inner and the outer spring of each hinge whose wall goes slack, and the moment of that [N m]."""
        rows = {strains_of(element)[0]: row for row, element in enumerate(self.chain.elements) if strains_of(element)}
        return tuple((rows[inner], rows[outer], moment) for inner, outer, moment in self.chain.slack_hinges)

    def motor(self, row: int) -> int | None:
        """Return the number of the motor that an element is; None for other elements."""
        element = self.chain.elements[row]
        return element.motor if isinstance(element, ChainJoint) else None

    @cached_property
    def leading_motors(self) -> int:
        """Number of elements, all motors, before the first unknown."""
        rows = range(len(self.chain.elements))
        return next((row for row in rows if self.motor(row) is None), len(rows))

    def leading(self, block: Block) -> list[TracedElement]:
        """Return the leading motors, with their positions in the workspace."""
        return [self.traced(row, block.load) for row in range(self.leading_motors)]

    def traced(
        self,
        row: int,
        motor: Callable[[int], Scalar] = lambda _: 0.0,
        unknown: Callable[[int], Scalar] = lambda _: 0.0,
        numbers: SerialChain | None = None,
    ) -> TracedElement:
        """Return an element with its constants, without muscle tensions.

        Args:
            row: Index of the element.
            motor: Position of a motor by its number.
            unknown: An unknown by its place.
            numbers: The chain with expressions instead of some of its numbers.
        """
        chain = self.chain if numbers is None else numbers
        element: Element | ChainHinge = chain.elements[row]
        if isinstance(element, ChainHinge):
            joints = zip(element.joints, element.masses_beyond, strict=True)
            one = hinge([self._traced(chain, *joint, motor, unknown) for joint in joints])
        else:
            one = self._traced(chain, element, chain.masses_beyond[row], motor, unknown)
        return replace(one, muscles=self._muscles(row), rubbing=Rubbing.of(chain.friction, self.moving(row)))

    def _traced(
        self,
        chain: SerialChain,
        element: Element,
        mass_beyond: float,
        motor: Callable[[int], Scalar],
        unknown: Callable[[int], Scalar],
    ) -> TracedElement:
        strains = strains_of(element)
        moving = tuple(place for place, strain in enumerate(strains) if strain in self.place)
        places = [self.place[strains[one]] for one in moving]
        if isinstance(element, ChainJoint):
            kind = "slide" if element.slides else "turn"
            coordinates = [motor(element.motor)] if element.motor is not None else [unknown(places[0])]
        else:
            kind = "section"
            coordinates = [
                unknown(self.place[strain]) if strain in self.place else scalar(chain.rest[strain]) for strain in strains
            ]
            coordinates += [0.0] * (len(STRAINS) - len(strains))
        return TracedElement(
            kind=kind,
            rotation=constants(element.rotation),
            translation=constants(element.translation),
            bodies=[(scalar(body.mass), constants(body.first_moment)) for body in bodies_of(element)],
            mass_beyond=scalar(mass_beyond),
            coordinates=coordinates,
            moving=moving,
            stiffness=[scalar(chain.stiffness[strains[one]]) for one in moving],
            rest=[scalar(chain.rest[strains[one]]) for one in moving],
            muscles=[],
            constraints=tuple(self.multiplier.get(strains[one]) for one in moving),
            length=element.length if isinstance(element, ChainSection) else 0.0,
        )

    def _muscles(self, row: int) -> list[ElementMuscle]:
        """Return the muscles beside an element."""
        paths, segment, strains = self.chain.muscle_paths, self.segment_at(row), strains_of(self.chain.elements[row])
        beside: list[ElementMuscle] = []
        if segment is None or self.routed:
            return beside
        for number, muscle in enumerate(segment.muscles):
            for path in np.flatnonzero((paths.muscle == muscle) & np.isin(paths.places, strains).any(axis=1)).tolist():
                own = [paths.places[path].tolist().index(strain) for strain in strains]
                beside.append(
                    ElementMuscle(
                        number=number,
                        arms=[float(paths.arms[path, place]) for place in own],
                        distance=float(paths.distance[path]),
                        length=float(paths.length[path]),
                        twist=float(paths.origin[path, STRAINS.index("twist")]),
                        twists=STRAINS.index("twist") in own,
                        shares=[float(self.chain.constrained_slope[group, muscle]) for group in segment.groups],
                    )
                )
        return beside

    @property
    def routed(self) -> bool:
        """Whether the muscles are looped over, see `softrobots.compiled.chain.routes`."""
        return self.as_routes or self.chain.routed

    @property
    def held_lengths(self) -> bool:
        """Whether given lengths of routed muscles are constraints, each with a tension as multiplier."""
        return self.routed and self.chain.muscle_input == "lengths"

    @property
    def n_constraints(self) -> int:
        """Number of multipliers: of constrained sums, or of lengths of routed muscles."""
        return len(self.chain.actuators) if self.held_lengths else len(self.chain.constrained)

    @property
    def n_tensions(self) -> int:
        """Number of muscles of which an input is in the workspace: all but those that constrain sums of strains."""
        return len(self.chain.actuators) if self.chain.muscle_input == "forces" or self.held_lengths else 0

    @property
    def least_inputs(self) -> tuple[float, ...]:
        """Least input of each muscle whose length is not given; see `ActuatorLaws.refusal`."""
        least = {"length": 0.0, "elastic": float(np.finfo(np.float64).tiny), "mckibben": 0.0}
        return tuple(least.get(one.kind, -LARGEST_NUMBER) for one in self.chain.actuators[: self.n_tensions])

    @property
    def most_muscles(self) -> int:
        """Largest number of muscles of a segment."""
        return max((len(segment.muscles) for segment in self.segments), default=0)

    @property
    def is_unrolled(self) -> bool:
        """Whether the chain is unrolled: few joints, no sections, no muscles and no dry friction."""
        looped = self.chain.friction or any(isinstance(element, ChainSection) for element in self.chain.elements)
        return not looped and len(self.chain.muscle_paths.rest) == 0 and len(self.chain.elements) <= MAX_UNROLLED_JOINTS

    @property
    def moved_by_motors(self) -> bool:
        """Whether the actuators are motor joints of an unrolled chain, at least one."""
        return self.is_unrolled and self.chain.n_motors > 0

    @property
    def spring_rounding(self) -> float:
        """Rounding of the torques of springs, stiff tendons and dry friction [N m], see `SoftModel.rounding`."""
        chain, strains = self.chain, list(self.strains)
        rounding = ActuatorLaws(chain.actuators).rounding + rounding_of([limit for *_, limit in chain.friction])
        if self.held_lengths:  # rounding of each length, over its change by its own tension
            softness = (chain.muscle_paths.at(chain.rest).arms ** 2 / chain.stiffness).sum(axis=1)
            rounding += float(np.linalg.norm(chain.muscle_paths.rest / softness)) * ROUNDING
        rested = float(np.linalg.norm(chain.stiffness[strains] * chain.rest[strains]))
        return rounding + 8.0 * float(np.finfo(np.float64).eps) * rested

    def multipliers_at(self, row: int) -> int:
        """Return the number of multipliers of the segment of an element; 0 outside of constrained segments."""
        segment = self.segment_at(row)
        return 0 if segment is None else len(segment.groups)

    def segment_at(self, row: int) -> Segment | None:
        """Return the segment with muscles of an element."""
        return next((one for one in self.segments if one.first <= row <= one.last), None)

    def moving(self, row: int) -> tuple[int, ...]:
        """Return the unknown strains of an element."""
        return tuple(strain for strain in strains_of(self.chain.elements[row]) if strain in self.place)

    def in_order(self, by_element: Sequence[Sequence[Scalar]]) -> list[Scalar]:
        """Return numbers of the unknowns of each element in the order of the unknowns."""
        pairs = (zip(self.moving(row), values, strict=True) for row, values in enumerate(by_element))
        by_strain = dict(itertools.chain.from_iterable(pairs))
        return [by_strain[strain] for strain in self.strains]

    @cached_property
    def _locked_strains(self) -> frozenset[int]:
        sections = [strains_of(element) for element in self.chain.elements if isinstance(element, ChainSection)]
        pairs = [pair for strains in sections for pair in zip(STRAINS, strains, strict=False)]
        return frozenset(strain for name, strain in pairs if name in self.locked)
