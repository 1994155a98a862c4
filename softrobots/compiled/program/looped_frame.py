"""Straight-line functions of a looped program around its loops: preparation, start and end of the passes, the Newton step."""

from __future__ import annotations

import numpy as np

from softrobots.compiled.chain.elements import Load, Vector, constants, vector
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.looped_elements import leading_elements
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance
from softrobots.compiled.chain.unrolled_chain import place_base
from softrobots.compiled.program.passes import decide, go_on, point_numbers
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar


def looped_frame(plan: Plan, count: int) -> list[Block]:
    """Trace the straight-line functions around loops of `count` steps."""
    return [
        _prepare(plan, count),
        _start_outward(plan),
        _start_inward(plan),
        _finish(plan),
        _decide(plan),
        _advance(plan),
        _start(plan.layout),
        _relax(plan),
    ]


def _prepare(plan: Plan, count: int) -> Block:
    block = Block("prepare", "Compute what depends on motors and load only.")
    layout, recursion = plan.layout, plan.recursion
    axes, origin = place_base(leading_elements(plan, block))
    for place, load in ((0, layout.force), (3, layout.gravity)):
        block.store_all(recursion.force + place, (axes.T @ vector(block.loads(load, 3))).tolist())
    block.store_all(layout.held, [0.0] * layout.constraints)
    block.store_all(recursion.base, [*axes.ravel().tolist(), *origin.tolist()])
    block.store_all(recursion.end + 1, [0.0, float(count)])
    return block


def _start_outward(plan: Plan) -> Block:
    block = Block("start_outward", "Start the outward pass at the base.")
    routes = plan.routes
    block.store_all(plan.recursion.axes, constants(np.eye(3)).ravel().tolist())
    if routes.beside:
        block.store(routes.margin, 1.0)
        block.store_all(routes.lengths, [0.0] * max(len(one.muscles) for one in routes.segments))
        block.store_all(routes.turns, [0.0] * (4 * routes.components))
    return block


def _start_inward(plan: Plan) -> Block:
    block = Block("start_inward", "Start the inward pass at the tip, and clear all sums.")
    recursion = plan.recursion
    axes = vector(block.loads(recursion.axes, 9)).reshape(3, 3)
    lever = (axes @ tip_from_end(plan, block)).tolist()
    block.store_all(recursion.lever, [*lever, 0.0, 0.0, 0.0] if plan.weight else lever)
    block.store_all(recursion.matrix, [0.0] * 6)
    block.store_all(recursion.column, [0.0] * 3)
    block.store_all(recursion.turn, [0.0] * 3)
    block.store_all(recursion.sums, [0.0, 0.0, 1.0, 1.0, 0.0])
    block.store_all(recursion.steps, [0.0, 0.0, 0.0])
    return block


def tip_from_end(plan: Plan, block: Block) -> Vector:
    """Return the tip in the frame of the last element, shape (3,) [m]."""
    return plan.numbers(block, "TIP", plan.unknowns.chain.tip_translation)


def _finish(plan: Plan) -> Block:
    block = Block("finish", "Compute energy, residual, step and tip from the sums of the passes.")
    layout, recursion = plan.layout, plan.recursion
    sums, steps = block.loads(recursion.sums, 5), block.loads(recursion.steps, 3)
    levers, forces = block.loads(recursion.lever, 6), block.loads(recursion.force, 6)
    loads = [Load(vector(forces[:3]), vector(levers[:3]), 1.0), Load(vector(forces[3:]), vector(levers[3:]), 0.0)]
    energy: Scalar = sums[0] - sum((one.force @ one.lever for one in loads[: 2 if plan.weight else 1]), 0.0)
    numbers = point_numbers(plan, block, Balance(*sums[:3]), energy, steps, sums[3:])
    for name, value in numbers.items():
        block.store(layout.single(name), value)
    base = block.loads(recursion.base, 12)
    block.store_all(layout.tip, (vector(base[9:]) + vector(base[:9]).reshape(3, 3) @ loads[0].lever).tolist())
    return block


def _decide(plan: Plan) -> Block:
    block = Block("decide", "Decide whether the case goes on.")
    layout = plan.layout
    names = ("energy", "slope", "error", "length", "size", "rounding", "min_pivot", "n_negative_pivots", "range_margin")
    point: dict[str, Scalar] = {name: block.load(layout.single(name)) for name in names}
    _, share = decide(plan, block, point)
    block.store(plan.recursion.end, share)
    return block


def _advance(plan: Plan) -> Block:
    block = Block("advance", "Take the step of one unknown, if the case goes on.", ("i",))
    layout = plan.layout
    unknown, step = block.load(layout.unknown, "i"), block.load(layout.step, "i")
    share, mode = block.load(plan.recursion.end), block.load(layout.single("mode"))
    go_on(block, layout.unknown, [unknown], [step], mode, share, "i")
    return block


def _start(layout: Layout) -> Block:
    block = Block("start", "Start a case.")
    for name, value in (("mode", 0.0), ("bound", 1e300), ("pivot_shift", 0.0)):
        block.store(layout.single(name), value)
    return block


def _relax(plan: Plan) -> Block:
    block = Block("relax", "Put an unknown where its spring is relaxed.", ("i",))
    rest = set(plan.unknowns.rest)
    relaxed = rest.pop() if len(rest) == 1 else block.table("REST", 0, "i")
    if plan.inputs is not None:
        relaxed = block.load(plan.layout.start, "i")
    block.store(plan.layout.unknown, relaxed, "i")
    return block
