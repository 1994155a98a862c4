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

from softrobots.compiled.chain.elements import Load, symmetric, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, RouteSums
from softrobots.compiled.chain.layout import RecursionLayout
from softrobots.compiled.chain.looped_elements import kind_element, rows_of_kinds
from softrobots.compiled.chain.looped_sides import before_by_lengths, follow_motor, given_loads, store_tip_step
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance, InwardPass, inward, outward
from softrobots.compiled.chain.routes import Routes
from softrobots.compiled.chain.traced_elements import TracedElement
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
    bent: int = 0
    """Number of places of sections whose joints are found at once; 0 of other kinds."""


def element_kinds(plan: Plan) -> list[Kind]:
    """Trace the code of every kind of element behind the leading motors."""
    return [_trace_kind(number, rows, plan) for number, rows in enumerate(rows_of_kinds(plan.unknowns).values())]


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
