r"""Extrapolation of the middle of a step of time from those of the steps before, and the changes by its corrections, traced.

The polynomial through the last k middles of equal steps continues to the sum of their backward differences

.. math:: y_{n+1} \approx \sum_{j<k} \nabla^j y_n, \quad \nabla^j y_n = \nabla^{j-1} y_n - \nabla^{j-1} y_{n-1}

The error that this had in the step before is the difference of order k there. So each step takes as many as would have been
best in the step before: all of them in smooth motion, one or two where stiff springs ring.
"""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.motion.motion_layout import MotionLayout
from softrobots.compiled.motion_settings import COASTING_ERROR, KEPT_DIFFERENCES
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, larger


def choose_order(layout: MotionLayout) -> Block:
    """Return the function that writes the weights of the differences; it clears their sizes for the next step."""
    block = Block("choose_order", "Choose the number of steps before from which the next is extrapolated.")
    count = block.load(layout.n_history)
    order: Scalar = 1.0
    least: Scalar = block.load(layout.sizes + 1)
    for k in range(2, KEPT_DIFFERENCES):
        error = if_less(k + 0.5, count, block.load(layout.sizes + k), 1e300)
        order = if_less(error, least, float(k), order)
        least = if_less(error, least, error, least)
    block.store(layout.weights, if_less(0.5, count, 1.0, 0.0))
    if layout.coasting:
        nearer = if_less(block.load(layout.sizes + 1) * COASTING_ERROR, least, 1.0, 0.0)
        block.store(layout.coasts, if_less(0.5, count, if_less(block.load(layout.failed), 0.5, nearer, 0.0), 0.0))
    for k in range(1, KEPT_DIFFERENCES):
        block.store(layout.weights + k, if_less(k + 0.5, order, 1.0, 0.0))
    block.store_all(layout.sizes, [0.0] * KEPT_DIFFERENCES)
    return block


def beyond_history(layout: MotionLayout, block: Block, stage: int, coasting: Scalar) -> Scalar:
    """Return how far the extrapolated middle of an unknown `i` is from where it coasts to; zero without steps before.

    Writes the scale of its changes, which are relative to where it coasts to, or to 1 rad or m.
    """
    places = range(layout.history + stage * layout.unknowns, layout.sizes, _stages(layout) * layout.unknowns)
    last, *differences = (block.load(place, "i") for place in places)
    if stage == 0:
        block.store(layout.scale, 1.0 / larger(absolute(coasting), 1.0), "i")
    beyond: Scalar = (last - coasting) * block.load(layout.weights)
    for k, difference in enumerate(differences, 1):
        beyond = beyond + difference * block.load(layout.weights + k)
    return beyond


def compare_change(layout: MotionLayout, block: Block, moved: Sequence[Scalar]) -> None:
    """Let the changes of an unknown `i` in the middle, or at both stages, count for the largest of the correction."""
    change: Scalar = block.load(layout.change)
    scale = block.load(layout.scale, "i")
    for one in moved:
        size = absolute(one) * scale
        change = larger(change, if_less(size, 1e300, size, 1e300))  # also of NaN
    block.store(layout.change, change)


def keep_history(layout: MotionLayout, block: Block, middles: Sequence[Scalar]) -> None:
    """Update the differences of an unknown `i`, and their sizes, with its middle, or its values at both stages."""
    n = layout.unknowns
    for stage, middle in enumerate(middles):
        difference: Scalar = middle
        for k in range(KEPT_DIFFERENCES):
            place = layout.history + (k * len(middles) + stage) * n
            before = block.load(place, "i")
            block.store(place, difference, "i")
            if k and not stage:
                block.store(layout.sizes + k, larger(block.load(layout.sizes + k), absolute(difference)))
            difference = difference - before


def _stages(layout: MotionLayout) -> int:
    return 2 if layout.in_stages else 1
