"""Code of a looped chain: functions for each kind of element, called in loops over the elements.

Three passes per evaluation, each a loop: outward with the axes, inward with loads and elimination, outward again with the
steps. Elements of a kind share their code; numbers in which they differ stand in a table, and values for a later pass in the
record of the element in the workspace. The cost is proportional to the number of elements.

The response of the tip (`softrobots.compiled.chain.looped_tip`) takes the same passes with three more right-hand sides, that
to given loads and motions (`softrobots.compiled.chain.looped_response`) with one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.dry_friction import Rubbing
from softrobots.compiled.chain.elements import Load, symmetric, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, RouteSums
from softrobots.compiled.chain.layout import Layout, RecursionLayout
from softrobots.compiled.chain.looped_sides import before_by_lengths, follow_motor, given_loads, store_tip_step
from softrobots.compiled.chain.muscle_terms import ElementMuscle
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance, InwardPass, inward, outward
from softrobots.compiled.chain.routes import Routes
from softrobots.compiled.chain.traced_elements import TracedElement, hinge
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.blocks import Block, TableColumns, hoist
from softrobots.compiled.trace.expressions import Expression, Scalar


@dataclass
class Kind:
    """Elements that share their code."""

    number: int
    """Its number, in names of functions."""
    rows: list[int]
    """Its elements."""
    blocks: list[Block]
    """Functions of the outward, inward and step pass."""
    columns: TableColumns
    """Numbers in which the elements differ."""
    record: int
    """Size of the record of an element."""


def element_kinds(plan: Plan) -> list[Kind]:
    """Trace the code of every kind of element behind the leading motors."""
    return [_trace_kind(number, rows, plan) for number, rows in enumerate(rows_of_kinds(plan.unknowns).values())]


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


def _trace_kind(number: int, rows: list[int], plan: Plan) -> Kind:
    layout, recursion, tip, infix = plan.layout, plan.recursion, plan.tip, plan.infix
    names = ("at", "row", "q")
    out = Block(f"outward_{infix}{number}", "Outward pass of an element.", names)
    trace = out.trace
    back = Block(f"inward_{infix}{number}", "Inward pass: loads and elimination.", names, trace)
    step_pass = Block(f"step_{infix}{number}", "Steps of its coordinates.", names, trace)
    element, columns = kind_element(plan, number, rows, out)
    axes_loads = out.loads(recursion.axes, 9)
    outward_pass = outward(element, vector(axes_loads).reshape(3, 3))
    out.store_all(recursion.axes, outward_pass.end.ravel().tolist())

    multipliers = plan.unknowns.multipliers_at(rows[0])
    state, loads, beyond, balance = _arriving(back, element, plan, multipliers)
    held = back.loads(recursion.multipliers, multipliers)
    muscles = len(element.muscles)
    tensions, preload = back.loads(recursion.tensions, muscles), back.loads(recursion.preload, muscles)
    routes, added = _arriving_routes(back, plan, rows[0])
    element = replace(element, tensions=tensions, preload=preload, routes=routes)
    state = [*state, *held, *tensions, *preload, *added]
    pivot_shift = back.load(layout.single("pivot_shift"))
    result = inward(
        element,
        outward_pass,
        loads,
        beyond,
        balance,
        tip_columns=3 if tip is not None and not tip.given else 0,
        given=given_loads(back, element, plan),
        pivot_shift=pivot_shift if tip is None else 0.0,
    )
    if result.eliminated is None and tip is not None and tip.given:
        follow_motor(back, result, tip)
    back.store_all(recursion.lever, [one for load in result.loads for one in load.lever])
    plan.store_outboard(back, result.beyond)
    if routes is not None and result.eliminated is not None:
        _store_factors(back, plan.routes, result.twists, result.eliminated)
    if tip is None:
        state = [*state, *_store_constraints(back, element, result, recursion, multipliers)]
        back.store_all(
            recursion.sums,
            [
                balance.energy,
                balance.weight,
                balance.range_margin,
                result.beyond.min_pivot,
                result.beyond.n_negative_pivots,
            ],
        )
        if element.rubbing is not None:
            slid = element.rubbing.at([element.coordinates[one] for one in element.moving]).sliders
            for place, slider in zip(element.rubbing.places, slid, strict=True):
                back.store(layout.slid - layout.unknown + place, slider, "q")
        second = _store_step(step_pass, result, plan, held, routes is not None)
    else:
        second = store_tip_step(step_pass, back, result, plan, tip, multipliers, routes is not None)
    size = hoist([back, step_pass], out, [*state, pivot_shift, *second], 0, "at", overwritten=axes_loads)
    size += hoist([step_pass], back, second, size, "at", overwritten=state)
    return Kind(number, rows, [out, back, step_pass], columns, size)


def _store_constraints(
    block: Block, element: TracedElement, result: InwardPass, recursion: RecursionLayout, multipliers: int
) -> list[Expression]:
    """Add an element to the constrained sums of its segment and to their torques; return the sums before."""
    gaps, torques = block.loads(recursion.gaps, multipliers), block.loads(recursion.constraint_torques, multipliers)
    with_own: list[list[Scalar]] = [list(gaps), list(torques)]
    for place, constraint in enumerate(element.constraints):
        if constraint is not None:
            with_own[0][constraint] = with_own[0][constraint] + (
                element.coordinates[element.moving[place]] - element.rest[place]
            )
            with_own[1][constraint] = with_own[1][constraint] + result.gradient[place]
    if result.eliminated is not None:
        with_own[0] = [gap + own for gap, own in zip(with_own[0], result.excess, strict=False)]
    block.store_all(recursion.gaps, with_own[0])
    block.store_all(recursion.constraint_torques, with_own[1])
    return [*gaps, *torques]


def _arriving_routes(block: Block, plan: Plan, row: int) -> tuple[RouteSums | None, list[Expression]]:
    """Return what routes add to an element, and the workspace elements of that; None if there is none."""
    routes, k = plan.routes, len(plan.unknowns.moving(row))
    if row not in routes.beside:
        return None, []
    load, curvature, push, own = (
        block.loads(place, size)
        for place, size in (
            (routes.load, k),
            (routes.curvature, k * (k + 1) // 2),
            (routes.push, 3 * k),
            (routes.own, k * (k + 1) // 2),
        )
    )
    sides = [block.loads(routes.sides + routes.stride * side, k) for side in range(len(plan.columns))]
    sums = RouteSums(
        vector(load),
        symmetric(curvature, k),
        vector(push).reshape(3, k),
        symmetric(own, k),
        [vector(side) for side in sides],
    )
    return sums, [*load, *curvature, *push, *own, *(one for side in sides for one in side)]


def _store_factors(block: Block, routes: Routes, twists: Any, eliminated: Eliminated) -> None:
    """Write what the elimination of the components of an element needs."""
    block.store_all(routes.twists, twists.ravel().tolist())
    block.store_all(routes.lower, eliminated.lower.ravel().tolist())
    block.store_all(routes.inverse, eliminated.inverse_pivots)
    block.store_all(routes.coupling, eliminated.coupling.ravel().tolist())
    for side, column in enumerate(eliminated.columns):
        block.store_all(routes.columns + routes.stride * side, column)


def _store_step(step_pass: Block, result: InwardPass, plan: Plan, held: Sequence[Scalar], routed: bool) -> list[Expression]:
    """Trace the Newton step of an element; return the sums of the elements before it.

    The residual is that with the multipliers of the last point, which those of this one must agree with.
    """
    layout, recursion = plan.layout, plan.recursion
    turn_loads, sum_loads = step_pass.loads(recursion.turn, 3 + len(held)), step_pass.loads(recursion.steps, 3)
    if result.eliminated is not None:
        turn = vector(turn_loads)
        (before,) = before_by_lengths(step_pass, plan, len(result.gradient), routed)
        steps = result.eliminated.steps(0, turn, before)
        sums: list[Scalar] = list(sum_loads)
        residuals = vector(result.gradient) + result.constrained[: len(held)].T @ vector(held)
        for place, (step, residual) in enumerate(zip(steps, residuals, strict=True)):
            sums = [sums[0] + result.gradient[place] * step, sums[1] + residual * residual, sums[2] + step * step]
            step_pass.store(layout.step - layout.unknown + place, step, "q")
        step_pass.store_all(recursion.turn, (turn + result.twists @ steps)[:3].tolist())
        step_pass.store_all(recursion.steps, sums)
        return [*turn_loads, *sum_loads, *(before or ())]
    return [*turn_loads, *sum_loads]


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


def _arriving(
    block: Block, element: TracedElement, plan: Plan, multipliers: int
) -> tuple[list[Expression], list[Load], Outboard, Balance]:
    """Return the sums before the inward pass of an element: workspace elements, loads, outboard sums, balance."""
    recursion, count = plan.recursion, 6 if plan.weight else 3
    levers, forces = block.loads(recursion.lever, count), block.loads(recursion.force, count)
    loads = [Load(vector(forces[:3]), vector(levers[:3]), 1.0)]
    if plan.weight:
        loads.append(Load(vector(forces[3:]), vector(levers[3:]), element.mass_beyond))
    sums = block.loads(recursion.sums, 5)
    beyond, state = plan.load_outboard(block, 3 + multipliers)
    return [*levers, *state, *sums], loads, beyond, Balance(sums[0], sums[1], sums[2])
