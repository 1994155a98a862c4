"""Straight-line functions of an unrolled chain: `prepare`, `first_pass`, `newton_pass`, `evaluate`."""

from __future__ import annotations

from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unrolled_chain import Evaluation, evaluate
from softrobots.compiled.program.passes import decide, dot, go_on, point_numbers
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar, scalar


def equilibrium_blocks(plan: Plan) -> tuple[list[Block], int]:
    """Trace the functions that find equilibria; return them and the size of the workspace."""
    layout = plan.layout
    prepare = Block("prepare", "Compute what depends on motors and load only.")
    trace = prepare.trace
    if plan.inputs is not None:
        chain = plan.numbers_in(prepare)
        prepare.store_all(layout.start, [scalar(chain.rest[strain]) for strain in plan.unknowns.strains])
    newton_pass = Block("newton_pass", "Evaluate the point, and take a Newton step.", trace=trace)
    _advance(plan, newton_pass, evaluate(plan, newton_pass))
    evaluation = Block("evaluate", "Evaluate the point: Newton step, energy, residual, pivots.", trace=trace)
    shifted = evaluate(plan, evaluation, shift_pivots=True)
    for name, value in numbers(plan, evaluation, shifted).items():
        evaluation.store(layout.single(name), value)
    evaluation.store_all(layout.step, shifted.step)
    store_tip(plan, evaluation, shifted)
    singles = [evaluation.load(layout.single(one)) for one in ("mode", "bound", "pivot_shift")]
    varying = [*evaluation.loads(layout.unknown, layout.unknowns), *singles]
    count = hoist([newton_pass, evaluation], prepare, varying, layout.prepared)
    first_pass = Block("first_pass", "Prepare, evaluate the robot at its start, and take a Newton step.", trace=trace)
    first_pass.stores = list(prepare.stores)
    _advance(plan, first_pass, evaluate(plan, first_pass, at_rest=True), starts=True)
    return [prepare, first_pass, newton_pass, evaluation], layout.prepared + count


def numbers(plan: Plan, block: Block, point: Evaluation) -> dict[str, Scalar]:
    """Return the single numbers of an evaluation."""
    products = dot(point.gradient, point.step), dot(point.gradient, point.gradient), dot(point.step, point.step)
    pivots = point.beyond.min_pivot, point.beyond.n_negative_pivots
    return point_numbers(plan, block, point.balance, point.energy, products, pivots)


def store_tip(plan: Plan, block: Block, point: Evaluation) -> None:
    """Write the tip in world axes."""
    block.store_all(plan.layout.tip, (point.base + point.base_axes @ point.tip).tolist())


def _advance(plan: Plan, block: Block, point: Evaluation, *, starts: bool = False) -> None:
    """Write the next point of the case."""
    mode, share = decide(plan, block, numbers(plan, block, point), starts=starts)
    go_on(block, plan.layout.unknown, point.unknown, point.step, mode, share)
    store_tip(plan, block, point)
