"""Elements of a looped chain for a trace: kinds of them that share code, and the numbers in which they differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.dry_friction import Rubbing
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.muscle_terms import ElementMuscle
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.traced_elements import TracedElement, hinge
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.compiled.trace.expressions import Scalar


def rows_of_kinds(unknowns: Unknowns) -> dict[Any, list[int]]:
    """Return the elements of each kind, by what they share."""
    groups: dict[Any, list[int]] = {}
    for row in range(unknowns.leading_motors, len(unknowns.chain.elements)):
        groups.setdefault(element_signature(unknowns, row), []).append(row)
    return groups


def kind_element(plan: Plan, number: int, rows: Sequence[int], block: Block) -> tuple[TracedElement, TableColumns]:
    """Return an element of a kind, with table entries for the numbers in which its elements differ, and the table."""
    columns = plan.table(block, f"TABLE_{number}", len(rows))
    return _common([plan.unknowns.traced(row) for row in rows], plan, block, columns), columns


def leading_elements(plan: Plan, block: Block) -> list[TracedElement]:
    """Return the motors before the first unknown, with their positions in the workspace."""
    elements = []
    for row, one in enumerate(plan.unknowns.leading(block)):
        columns = plan.table(block, f"LEADING_{row}", 1, "")
        mass = columns.entry([one.mass_beyond])
        elements.append(replace(table_element([one], columns), mass_beyond=mass))
    return elements


def element_signature(unknowns: Unknowns, row: int) -> tuple[Any, ...]:
    """Return the properties that elements with the same code share."""
    one = unknowns.traced(row)
    routed = unknowns.routed and unknowns.segment_at(row) is not None
    constraint = -1 if routed else unknowns.multipliers_at(row)
    muscles = [(muscle.number, muscle.twists, [arm == 0.0 for arm in muscle.arms]) for muscle in one.muscles]
    return *_signature(one), constraint, str(muscles), () if one.rubbing is None else one.rubbing.places


def _signature(one: TracedElement) -> tuple[Any, ...]:
    zeros = (np.asarray(one.rotation, dtype=np.float64) == 0.0).tolist()
    members = [_signature(member) for member in one.members]
    return one.kind, one.moving, one.constraints, str(zeros), bool(np.any(one.translation != 0.0)), str(members)


def _common(ones: Sequence[TracedElement], plan: Plan, block: Block, columns: TableColumns, first: int = 0) -> TracedElement:
    """Return an element of a kind, with table entries for the numbers in which its elements differ."""
    rubbing = _rubbing([one.rubbing for one in ones], plan.layout, block, columns)
    if ones[0].members:
        alike = zip(*(one.members for one in ones), strict=True)
        members = [_common(members, plan, block, columns, place) for place, members in enumerate(alike)]
        return replace(hinge(members), rubbing=rubbing)
    unknown = iter(block.loads(first, max(len(ones[0].moving), 1), "q"))
    coordinates = [
        next(unknown)
        if place in ones[0].moving or not ones[0].moving
        else columns.entry([one.coordinates[place] for one in ones])
        for place in range(len(ones[0].coordinates))
    ]
    return replace(
        table_element(ones, columns),
        mass_beyond=columns.entry([one.mass_beyond for one in ones]),
        coordinates=coordinates,
        rest=_relaxed(ones, block, plan.layout, columns),
        rubbing=rubbing,
    )


def _rubbing(ones: Sequence[Rubbing | None], layout: Layout, block: Block, columns: TableColumns) -> Rubbing | None:
    """Return the dry friction of a kind, with its sliders in the workspace; None if it has none."""
    rubbing = [one for one in ones if one is not None]
    if not rubbing:
        return None
    sliders = [block.load(layout.sliders - layout.unknown + place, "q") for place in rubbing[0].places]
    return Rubbing(columns.entry([one.limit for one in rubbing]), rubbing[0].places, sliders)


def table_element(ones: Sequence[TracedElement], columns: TableColumns) -> TracedElement:
    """Return the first of the elements of a kind, with table entries for the numbers in which they differ."""
    first = ones[0]
    return replace(
        first,
        rotation=columns.entries([one.rotation for one in ones]),
        translation=columns.entries([one.translation for one in ones]),
        bodies=[
            (columns.entry([one.bodies[place][0] for one in ones]), columns.entries([one.bodies[place][1] for one in ones]))
            for place in range(len(first.bodies))
        ],
        stiffness=columns.entries([one.stiffness for one in ones]).tolist(),
        muscles=[_muscle([one.muscles[place] for one in ones], columns) for place in range(len(first.muscles))],
        length=columns.entry([one.length for one in ones]),
    )


def _muscle(ones: Sequence[ElementMuscle], columns: TableColumns) -> ElementMuscle:
    """Return a muscle beside the elements of a kind, with table entries for the numbers in which they differ."""
    return replace(
        ones[0],
        arms=columns.entries([one.arms for one in ones]).tolist(),
        distance=columns.entry([one.distance for one in ones]),
        length=columns.entry([one.length for one in ones]),
        twist=columns.entry([one.twist for one in ones]),
        shares=columns.entries([one.shares for one in ones]).tolist(),
    )


def _relaxed(ones: Sequence[TracedElement], block: Block, layout: Layout, columns: TableColumns) -> list[Scalar]:
    """Return the rest values of the unknowns of a kind.

    For constrained ones that is their start, which distributes the given sums by stiffness, so that the springs load all terms
    of a sum alike: only the multipliers carry the torque of the constraint, and it adds no rounding to the residual.
    """
    at_rest: list[Scalar] = columns.entries([one.rest for one in ones]).tolist()
    start = layout.start - layout.unknown
    return [
        rest if constraint is None else block.load(start + place, "q")
        for place, (rest, constraint) in enumerate(zip(at_rest, ones[0].constraints, strict=True))
    ]
