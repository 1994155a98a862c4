"""The straight-line functions of a short chain: `prepare`, `first_pass`, `newton_pass`, `evaluate`."""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import Evaluation, evaluate
from softrobots.compiled.program.passes import decide, dot, go_on, point_numbers
from softrobots.compiled.settings import LEAST_SIZE
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar, larger


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
    newton_pass = Block("newton_pass", "Evaluate the point, and go on to the next.", trace=trace)
    at_point = evaluate(unknowns, newton_pass, layout, weight=weight)
    _advance(newton_pass, layout, unknowns, at_point, starts=False)
    point = Block("evaluate", "Evaluate the point: Newton step, energy, residual, pivots.", trace=trace)
    shift_pivots = evaluate(unknowns, point, layout, weight=weight, shift_pivots=True)
    for name, value in numbers(unknowns, layout, point, shift_pivots).items():
        point.store(layout.single(name), value)
    point.store_all(layout.step, shift_pivots.step)
    store_tip(point, layout, shift_pivots)
    singles = [point.load(layout.single(one)) for one in ("mode", "bound", "pivot_shift")]
    varying = [*point.loads(layout.unknown, layout.unknowns), *singles]
    count = hoist([newton_pass, point], prepare, varying, layout.prepared)
    first_pass = Block("first_pass", "Prepare, evaluate the robot at its start, and go on from there.", trace=trace)
    first_pass.stores = list(prepare.stores)
    relaxed = evaluate(unknowns, first_pass, layout, weight=weight, at_rest=True)
    _advance(first_pass, layout, unknowns, relaxed, starts=True)
    return [prepare, first_pass, newton_pass, point], layout.prepared + count


def numbers(unknowns: Unknowns, layout: Layout, block: Block, made: Evaluation) -> dict[str, Scalar]:
    """The single numbers of an evaluation."""
    force = block.loads(layout.force, 3)
    load = sum((one * one for one in force), 0.0) * unknowns.chain.reach**2 + made.balance.weight
    return point_numbers(
        slope=dot(made.gradient, made.step),
        error=dot(made.gradient, made.gradient),
        length=dot(made.step, made.step),
        energy=made.energy,
        elastic=made.balance.energy,
        load=larger(load, LEAST_SIZE**2),
        range_margin=made.balance.range_margin,
        min_pivot=made.beyond.min_pivot,
        n_negative_pivots=made.beyond.n_negative_pivots,
    )


def store_tip(block: Block, layout: Layout, made: Evaluation) -> None:
    """Write the tip in world axes."""
    block.store_all(layout.tip, (made.base + made.base_axes @ made.tip).tolist())


def _advance(block: Block, layout: Layout, unknowns: Unknowns, made: Evaluation, *, starts: bool) -> None:
    """Write where the case goes on."""
    rest = [float(unknowns.chain.rest[strain]) for strain in unknowns.strains]
    mode, share = decide(
        block,
        layout,
        numbers(unknowns, layout, block, made),
        n_constraints=0,
        spring_rounding=unknowns.spring_rounding,
        mode=0.0 if starts else block.load(layout.single("mode")),
        bound=1e300 if starts else block.load(layout.single("bound")),
    )
    here: Sequence[Scalar] = rest if starts else block.loads(layout.unknown, layout.unknowns)
    for place, (one, step) in enumerate(zip(here, made.step, strict=True)):
        block.store(layout.unknown + place, go_on(mode, one, share, step))
    store_tip(block, layout, made)
