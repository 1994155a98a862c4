"""Straight-line functions of an unrolled chain: `prepare`, `first_pass`, `newton_pass`, `evaluate`."""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import Evaluation, evaluate
from softrobots.compiled.program.passes import decide, dot, go_on, point_numbers
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar


def equilibrium_blocks(unknowns: Unknowns, layout: Layout, *, weight: bool) -> tuple[list[Block], int]:
    """Trace the functions that find equilibria.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        weight: Whether there is gravity.

    Returns:
        The functions, and the size of the workspace.
    """
    prepare = Block("prepare", "Compute what depends on motors and load only.")
    trace = prepare.trace
    newton_pass = Block("newton_pass", "Evaluate the point, and take a Newton step.", trace=trace)
    at_point = evaluate(unknowns, newton_pass, layout, weight=weight)
    _advance(newton_pass, layout, unknowns, at_point, starts=False)
    evaluation = Block("evaluate", "Evaluate the point: Newton step, energy, residual, pivots.", trace=trace)
    shifted = evaluate(unknowns, evaluation, layout, weight=weight, shift_pivots=True)
    for name, value in numbers(unknowns, layout, evaluation, shifted).items():
        evaluation.store(layout.single(name), value)
    evaluation.store_all(layout.step, shifted.step)
    store_tip(evaluation, layout, shifted)
    singles = [evaluation.load(layout.single(one)) for one in ("mode", "bound", "pivot_shift")]
    varying = [*evaluation.loads(layout.unknown, layout.unknowns), *singles]
    count = hoist([newton_pass, evaluation], prepare, varying, layout.prepared)
    first_pass = Block("first_pass", "Prepare, evaluate the robot at its start, and take a Newton step.", trace=trace)
    first_pass.stores = list(prepare.stores)
    relaxed = evaluate(unknowns, first_pass, layout, weight=weight, at_rest=True)
    _advance(first_pass, layout, unknowns, relaxed, starts=True)
    return [prepare, first_pass, newton_pass, evaluation], layout.prepared + count


def numbers(unknowns: Unknowns, layout: Layout, block: Block, point: Evaluation) -> dict[str, Scalar]:
    """Return the single numbers of an evaluation."""
    products = dot(point.gradient, point.step), dot(point.gradient, point.gradient), dot(point.step, point.step)
    pivots = point.beyond.min_pivot, point.beyond.n_negative_pivots
    return point_numbers(block, layout, unknowns, point.balance, point.energy, products, pivots)


def store_tip(block: Block, layout: Layout, point: Evaluation) -> None:
    """Write the tip in world axes."""
    block.store_all(layout.tip, (point.base + point.base_axes @ point.tip).tolist())


def _advance(block: Block, layout: Layout, unknowns: Unknowns, point: Evaluation, *, starts: bool) -> None:
    """Write the next point of the case."""
    rest = [float(unknowns.chain.rest[strain]) for strain in unknowns.strains]
    mode, share = decide(block, layout, unknowns, numbers(unknowns, layout, block, point), starts=starts)
    here: Sequence[Scalar] = rest if starts else block.loads(layout.unknown, layout.unknowns)
    for place, (one, step) in enumerate(zip(here, point.step, strict=True)):
        block.store(layout.unknown + place, go_on(mode, one, share, step))
    store_tip(block, layout, point)
