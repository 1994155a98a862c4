"""State machine of a Newton pass, traced: whether a case goes on, is solved, or is left to the descent."""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance
from softrobots.compiled.settings import (
    ARMIJO,
    CLEARLY_POSITIVE_PIVOT,
    ENERGY_ROUNDING,
    LARGEST_STEP,
    LEAST_SIZE,
    NEWTON_TOLERANCE,
)
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger, square_root


def point_numbers(
    plan: Plan,
    block: Block,
    balance: Balance,
    energy: Scalar,
    products: Sequence[Scalar],
    pivots: Sequence[Scalar],
) -> dict[str, Scalar]:
    """Return the single numbers of a point from sums over the chain.

    Args:
        plan: The chain and its places.
        block: The block of the point.
        balance: Elastic energy, weight and range margin.
        energy: Elastic energy plus potential [J].
        products: Derivative of the energy along the Newton step, squared out-of-balance torque, squared Newton step.
        pivots: Smallest pivot, and number of pivots that are not positive.
    """
    unknowns, layout = plan.unknowns, plan.layout
    force = block.loads(layout.force, 3)
    load = dot(force, force) * unknowns.chain.reach**2 + balance.weight
    tensions = block.loads(plan.routes.pulled if plan.routes.beside else layout.actuators, layout.muscles)
    load = load + dot(tensions, tensions) * unknowns.chain.reach**2
    size = larger(load, LEAST_SIZE**2)
    return {
        "energy": if_less(balance.range_margin, 0.0, 1e300, energy),
        "slope": products[0],
        "error": products[1],
        "length": products[2],
        "size": size,
        "rounding": (square_root(size) + absolute(balance.energy) * 2.0 + absolute(energy)) * ENERGY_ROUNDING,
        "min_pivot": pivots[0],
        "n_negative_pivots": pivots[1],
        "range_margin": balance.range_margin,
    }


def decide(plan: Plan, block: Block, point: dict[str, Scalar], *, starts: bool = False) -> tuple[Scalar, Scalar]:
    """Trace the new mode of a case.

    Mode 0 goes on, 1 is in stable balance, 2 is left to the descent: where pivots are not positive, a section is beyond its
    range, the energy does not decrease enough, or a number is NaN.

    Args:
        plan: The chain and its places.
        block: The block of the pass.
        point: The numbers of the point, see `point_numbers`.
        starts: Whether this is the first pass, without a mode before and a bound of the energy.

    Returns:
        The mode, and the share of the step that mode 0 takes.
    """
    unknowns, layout = plan.unknowns, plan.layout
    mode: Scalar = 0.0 if starts else block.load(layout.single("mode"))
    bound: Scalar = 1e300 if starts else block.load(layout.single("bound"))
    error, length, energy = point["error"], point["length"], point["energy"]
    settled_to = larger(point["size"] * NEWTON_TOLERANCE**2, unknowns.spring_rounding**2)
    all_signs = if_less(absolute(point["n_negative_pivots"] - float(unknowns.n_constraints)), 0.5, 1.0, 0.0)
    sound = if_less(point["size"], 1e300, if_less(point["range_margin"], 0.0, 0.0, all_signs), 0.0)
    stable = if_less(CLEARLY_POSITIVE_PIVOT, point["min_pivot"], sound, 0.0)
    going = if_less(energy, bound, 2.0 - 2.0 * stable, 2.0)
    new_mode = if_less(1.5, mode, 2.0, if_less(error, settled_to, 2.0 - stable, going))
    share = LARGEST_STEP / square_root(larger(length, LARGEST_STEP**2))
    block.store(layout.single("mode"), new_mode)
    block.store(layout.single("bound"), energy + point["slope"] * share * ARMIJO + point["rounding"])
    block.store(layout.single("error"), error)
    return new_mode, share


def go_on(
    block: Block, first: int, here: Sequence[Scalar], step: Sequence[Scalar], mode: Scalar, share: Scalar, base: str = ""
) -> None:
    """Write numbers after a share of their step, if the case goes on."""
    for place, (one, by) in enumerate(zip(here, step, strict=True)):
        block.store(first + place, if_less(mode, 0.5, one + share * by, one), base)


def dot(one: Sequence[Scalar], other: Sequence[Scalar]) -> Scalar:
    """Return the sum of products."""
    return sum((a * b for a, b in zip(one, other, strict=True)), 0.0)
