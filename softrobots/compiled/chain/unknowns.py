"""Unknown strains of a chain, and its elements for a trace."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softrobots.compiled.chain.elements import constants
from softrobots.compiled.chain.recursion import TracedElement
from softrobots.compiled.settings import LARGEST_POSITION, MAX_UNROLLED_JOINTS
from softrobots.compiled.trace.expressions import Scalar
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.model.serial_chain import ChainBody, ChainJoint, ChainSection, Element, SerialChain


@dataclass(frozen=True, eq=False)
class Unknowns:
    """A chain and its unknown strains."""

    chain: SerialChain
    """The chain."""
    locked: tuple[str, ...] = ()
    """Section strains that keep their rest value, of `strain_chain.STRAINS`."""

    def __post_init__(self) -> None:
        """Refuse unknown names, strains that muscle lengths constrain, and all four at once."""
        for name in self.locked:
            if name not in STRAINS:
                raise NameNotFound("section strain", name, STRAINS)
        if set(self.locked) == set(STRAINS):
            raise ParameterError("locked_strains", self.locked, "three strains at most: with all four a section is rigid")
        constrained = {strain for group in self.chain.held for strain in group}
        clash = sorted({STRAINS[(strain - self._first_section) % 4] for strain in constrained & self._locked_strains})
        if clash:
            raise ParameterError("locked_strains", self.locked, f"without {', '.join(clash)}, which muscle lengths constrain")
        if self.chain.rest.size and float(np.abs(self.chain.rest).max()) > LARGEST_POSITION:
            raise ParameterError(
                "model",
                self.chain.name,
                f"a robot with rest positions of springs within +-{LARGEST_POSITION:g} rad or m, to be compiled",
            )
        if self.locked and not self._locked_strains:
            raise ParameterError("locked_strains", self.locked, "empty for a robot without sections of constant strain")

    @cached_property
    def strains(self) -> tuple[int, ...]:
        """Indices of the unknown strains, in order."""
        return tuple(row for row in range(len(self.chain.stiffness)) if row not in self._locked_strains)

    @cached_property
    def place(self) -> dict[int, int]:
        """Place of each unknown strain among the unknowns."""
        return {strain: place for place, strain in enumerate(self.strains)}

    @cached_property
    def multiplier(self) -> dict[int, tuple[int, int]]:
        """By constrained strain: the segment, and the number of its multiplier there."""
        multipliers: dict[int, tuple[int, int]] = {}
        for row, group in enumerate(self.chain.held):
            segment = self.segment_of_group[row]
            number = sum(other == segment for other in self.segment_of_group[:row])
            multipliers |= {strain: (segment, number) for strain in group}
        return multipliers

    @cached_property
    def segment_of_group(self) -> tuple[int, ...]:
        """Segment of each constrained group, from 0: groups with overlapping elements share one."""
        spans = [self._span(group) for group in self.chain.held]
        segments: list[int] = []
        for row, span in enumerate(spans):
            same = [segments[other] for other in range(row) if spans[other][0] <= span[1] and span[0] <= spans[other][1]]
            segments.append(same[0] if same else max(segments, default=-1) + 1)
        return tuple(segments)

    @cached_property
    def segment_spans(self) -> tuple[tuple[int, int], ...]:
        """First and last element of each constrained segment."""
        ends = []
        for segment in range(len(set(self.segment_of_group))):
            spans = [
                self._span(group) for group, one in zip(self.chain.held, self.segment_of_group, strict=True) if one == segment
            ]
            ends.append((min(first for first, _ in spans), max(last for _, last in spans)))
        return tuple(ends)

    @cached_property
    def masses_beyond(self) -> tuple[float, ...]:
        """Mass beyond each element, without its own [kg]."""
        own = [sum(body.mass for body in bodies_of(element)) for element in self.chain.elements]
        return tuple(float(sum(own[row + 1 :])) for row in range(len(own)))

    @cached_property
    def leading_motors(self) -> int:
        """Number of elements, all motors, before the first unknown."""
        for row, element in enumerate(self.chain.elements):
            if isinstance(element, ChainSection) or element.motor is None:
                return row
        return len(self.chain.elements)

    def traced(
        self, row: int, motor: Callable[[int], Scalar], unknown: Callable[[int], Scalar], pull: Callable[[int], Scalar]
    ) -> TracedElement:
        """Return an element with its constants.

        Args:
            row: Index of the element.
            motor: Position of a motor by its number.
            unknown: An unknown by its place.
            pull: Constant load on an unknown by its place.
        """
        element, chain = self.chain.elements[row], self.chain
        strains = strains_of(element)
        moving = tuple(place for place, strain in enumerate(strains) if strain in self.place)
        places = [self.place[strains[one]] for one in moving]
        if isinstance(element, ChainJoint):
            kind = "slide" if element.slides else "turn"
            coordinates = [motor(element.motor)] if element.motor is not None else [unknown(places[0])]
        else:
            kind = "section"
            coordinates = [
                unknown(self.place[strain]) if strain in self.place else float(chain.rest[strain]) for strain in strains
            ]
        constraints = tuple(self.multiplier[strains[one]][1] if strains[one] in self.multiplier else None for one in moving)
        return TracedElement(
            kind=kind,
            rotation=constants(element.rotation),
            translation=constants(element.translation),
            bodies=[(float(body.mass), constants(body.first_moment)) for body in bodies_of(element)],
            mass_beyond=self.masses_beyond[row],
            coordinates=coordinates,
            moving=moving,
            stiffness=[float(chain.stiffness[strains[one]]) for one in moving],
            rest=[float(chain.rest[strains[one]]) for one in moving],
            pull=[pull(place) for place in places],
            constraints=constraints,
            length=element.length if isinstance(element, ChainSection) else 0.0,
        )

    @property
    def pulled(self) -> bool:
        """Whether muscles have given tensions."""
        return self.chain.muscle_input == "forces" and len(self.chain.muscle_rest) > 0

    @property
    def is_unrolled(self) -> bool:
        """Whether the chain is unrolled: few joints, no sections and no muscles."""
        sections = any(isinstance(element, ChainSection) for element in self.chain.elements)
        return not sections and len(self.chain.muscle_rest) == 0 and len(self.chain.elements) <= MAX_UNROLLED_JOINTS

    @property
    def moved_by_motors(self) -> bool:
        """Whether the actuators are motor joints of an unrolled chain, at least one."""
        return self.is_unrolled and self.chain.n_motors > 0

    @property
    def spring_rounding(self) -> float:
        """Rounding of the spring torques [N m], see `SoftModel.rounding`."""
        chain, strains = self.chain, list(self.strains)
        return 8.0 * float(np.finfo(np.float64).eps) * float(np.linalg.norm(chain.stiffness[strains] * chain.rest[strains]))

    def multipliers_at(self, row: int) -> int:
        """Return the number of multipliers of the segment of an element; 0 outside of constrained segments."""
        for segment, (first, last) in enumerate(self.segment_spans):
            if first <= row <= last:
                return sum(one == segment for one in self.segment_of_group)
        return 0

    def moving(self, row: int) -> tuple[int, ...]:
        """Return the unknown strains of an element."""
        return tuple(strain for strain in strains_of(self.chain.elements[row]) if strain in self.place)

    @property
    def _first_section(self) -> int:
        first = [element.strain for element in self.chain.elements if isinstance(element, ChainSection)]
        return min(first, default=len(self.chain.stiffness))

    @cached_property
    def _locked_strains(self) -> frozenset[int]:
        rows = [STRAINS.index(name) for name in self.locked]
        return frozenset(
            element.strain + row for element in self.chain.elements if isinstance(element, ChainSection) for row in rows
        )

    def _span(self, group: Sequence[int]) -> tuple[int, int]:
        rows = [row for row, element in enumerate(self.chain.elements) if set(strains_of(element)) & set(group)]
        return min(rows), max(rows)


def strains_of(element: Element) -> tuple[int, ...]:
    """Return the indices of the strains of an element; none for a motor."""
    if isinstance(element, ChainSection):
        return tuple(element.strain + place for place in range(4))
    return () if element.strain is None else (element.strain,)


def bodies_of(element: Element) -> tuple[ChainBody, ...]:
    """Return the bodies of an element."""
    return element.bodies if isinstance(element, ChainSection) else (element.body,)


def compliances_of(unknowns: Unknowns, segment: int) -> list[float]:
    """Return the compliance of the sum of each multiplier of a segment [rad/(N m) or m/N]."""
    groups = [group for group, one in zip(unknowns.chain.held, unknowns.segment_of_group, strict=True) if one == segment]
    return [float(np.sum(1.0 / unknowns.chain.stiffness[list(group)])) for group in groups]
