"""State machine of a Newton pass, traced: whether a case goes on, is solved, or is left to the descent."""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.settings import ARMIJO, ENERGY_ROUNDING, LARGEST_STEP, NEWTON_TOLERANCE, POSITIVE_PIVOT
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger, square_root


def point_numbers(
    *,
    slope: Scalar,
    error: Scalar,
    length: Scalar,
    energy: Scalar,
    elastic: Scalar,
    load: Scalar,
    range_margin: Scalar,
    min_pivot: Scalar,
    n_negative_pivots: Scalar,
) -> dict[str, Scalar]:
    """Return the single numbers of a point from sums over the chain.

    Args:
        slope: Derivative of the energy along the Newton step.
        error: Squared out-of-balance torque.
        length: Squared Newton step.
        energy: Elastic energy plus potential [J].
        elastic: Elastic energy [J].
        load: Squared size of the load [N^2 m^2].
        range_margin: Negative if a section is beyond its range.
        min_pivot: Smallest pivot.
        n_negative_pivots: Number of pivots that are not positive.
    """
    return {
        "energy": if_less(range_margin, 0.0, 1e300, energy),
        "slope": slope,
        "error": error,
        "length": length,
        "size": load,
        "rounding": (square_root(load) + absolute(elastic) * 2.0 + absolute(energy)) * ENERGY_ROUNDING,
        "min_pivot": min_pivot,
        "n_negative_pivots": n_negative_pivots,
        "range_margin": range_margin,
    }


def decide(
    block: Block,
    layout: Layout,
    point: dict[str, Scalar],
    *,
    n_constraints: int,
    spring_rounding: float,
    mode: Scalar,
    bound: Scalar,
) -> tuple[Scalar, Scalar]:
    """Trace the new mode of a case.

    Mode 0 goes on, 1 is in stable balance, 2 is left to the descent: where pivots are not positive, a section is beyond its
    range, the energy does not decrease enough, or a number is NaN.

    Args:
        block: The block of the pass.
        layout: The places in the workspace.
        point: The numbers of the point, see `point_numbers`.
        n_constraints: Number of multipliers.
        spring_rounding: Rounding of the spring torques [N m].
        mode: Mode before.
        bound: Largest energy that the point may have [J].

    Returns:
        The mode, and the share of the step that mode 0 takes.
    """
    error, length, energy = point["error"], point["length"], point["energy"]
    settled_to = larger(point["size"] * NEWTON_TOLERANCE**2, spring_rounding**2)
    all_signs = if_less(absolute(point["n_negative_pivots"] - float(n_constraints)), 0.5, 1.0, 0.0)
    sound = if_less(point["size"], 1e300, if_less(point["range_margin"], 0.0, 0.0, all_signs), 0.0)
    stable = if_less(POSITIVE_PIVOT, point["min_pivot"], sound, 0.0)
    going = if_less(energy, bound, 2.0 - 2.0 * stable, 2.0)
    new_mode = if_less(1.5, mode, 2.0, if_less(error, settled_to, 2.0 - stable, going))
    share = LARGEST_STEP / square_root(larger(length, LARGEST_STEP**2))
    block.store(layout.single("mode"), new_mode)
    block.store(layout.single("bound"), energy + point["slope"] * share * ARMIJO + point["rounding"])
    block.store(layout.single("error"), error)
    return new_mode, share


def go_on(mode: Scalar, here: Scalar, share: Scalar, step: Scalar) -> Scalar:
    """Return a number after a share of its step, if the case goes on."""
    return if_less(mode, 0.5, here + share * step, here)


def dot(one: Sequence[Scalar], other: Sequence[Scalar]) -> Scalar:
    """Return the sum of products."""
    return sum((a * b for a, b in zip(one, other, strict=True)), 0.0)
