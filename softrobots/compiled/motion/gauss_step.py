r"""Steps of fourth order, traced: the method of Gauss with two stages, see `softrobots.dynamics.gauss`.

The functions have the names and the work of those of the midpoint rule in `softrobots.compiled.motion.time_step`, so that the
drivers are the same. Each has both stages of an unknown; the residuals of both make one complex right-hand side.
"""

from __future__ import annotations

from collections.abc import Sequence

from softrobots.compiled.motion.extrapolation import beyond_history, compare_change, keep_history
from softrobots.compiled.motion.motion_layout import MotionLayout
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.complex_numbers import ComplexScalar, parts_of
from softrobots.compiled.trace.expressions import Scalar, if_less
from softrobots.dynamics.gauss import FROM_SQUARES, SECOND, SQUARES, STAGES, WEIGHTS


def stage_values(layout: MotionLayout, block: Block, stage: int, place: int = 0, base: str = "") -> tuple[Scalar, ...]:
    """Return an unknown at a stage, its velocity and its acceleration."""
    h = block.load(layout.time_step)
    position, velocity = (block.load(first + place, base) for first in (layout.position, layout.velocity))
    accelerations = [block.load(layout.stages + row * layout.unknowns + place, base) for row in range(2)]
    middle = position + h * (velocity * STAGES[stage] + h * _weighted(SQUARES[stage], accelerations))
    return middle, velocity + h * _weighted(WEIGHTS[stage], accelerations), accelerations[stage]


def right_hand_side(one: Sequence[Scalar], other: Sequence[Scalar]) -> list[Scalar]:
    """Return the complex right-hand side of the torques out of balance at both stages."""
    return [ComplexScalar(first, second * SECOND) for first, second in zip(one, other, strict=True)]


def corrections(found: Sequence[Scalar]) -> tuple[list[Scalar], list[Scalar]]:
    """Return the corrections of the accelerations at both stages from the complex ones."""
    parts, n = parts_of(found), len(found)
    return parts[:n], [one * (1.0 / SECOND) for one in parts[n:]]


def gauss_blocks(layout: MotionLayout) -> tuple[Block, Block, Block]:
    """Return the functions that guess, correct and finish an unknown `i`."""
    return (
        _guess(layout, Block("guess_unknown", "Extrapolate an unknown at both stages, and its accelerations.", ("i",))),
        _apply(layout, Block("apply_correction", "Correct the accelerations at both stages.", ("i",))),
        _finish(layout, Block("finish_unknown", "Go to the end of the step, and remember the stages.", ("i",))),
    )


def place_block(layout: MotionLayout, places: Sequence[int]) -> Block:
    """Return the function that writes an unknown `i` at both stages, side by side, and its velocity and acceleration."""
    block = Block("place_stages", "Place an unknown at both stages.", ("i", "at"))
    for stage in range(2):
        for begin, value in zip(places, stage_values(layout, block, stage, base="i"), strict=True):
            block.store(begin + stage, value, "at")
    return block


def copy_block(name: str, purpose: str, places: Sequence[tuple[int, int]], *bases: str) -> Block:
    """Return the function that copies numbers of an unknown or a strain to and from where those of a stage stand."""
    block = Block(name, purpose, ("i", "at"))
    for to, source in places:
        block.store(to, block.load(source, bases[1]), bases[0])
    return block


def _guess(layout: MotionLayout, block: Block) -> Block:
    h, n = block.load(layout.time_step), layout.unknowns
    position, velocity = (block.load(place, "i") for place in (layout.position, layout.velocity))
    beyond: list[Scalar] = []
    for stage, share in enumerate(STAGES):
        beyond.append(beyond_history(layout, block, stage, position + h * velocity * share))
    accelerations = [block.load(layout.stages + stage * n, "i") for stage in range(2)]
    coasts = block.load(layout.coasts)
    for stage, row in enumerate(FROM_SQUARES):
        guess = _weighted(row, beyond) / (h * h)
        block.store(layout.stages + stage * n, if_less(0.5, coasts, accelerations[stage], guess), "i")
    if layout.coasting:
        gained = (accelerations[0] + accelerations[1]) * (0.5 * h * coasts)  # by the step before, as what it moved
        moved = (velocity - _weighted(STAGES, accelerations) * (0.5 * h)) * (h * coasts)
        for stage, share in enumerate(STAGES):
            torque = block.table("STIFFNESS", 0, "i") * (moved + h * gained * share) + block.load(layout.damping, "i") * gained
            block.store(layout.forces + stage, torque, "2 * i")
    return block


def _apply(layout: MotionLayout, block: Block) -> Block:
    h, n = block.load(layout.time_step), layout.unknowns
    steps = [block.load(layout.correction + stage * n, "i") for stage in range(2)]
    moved: list[Scalar] = []
    for stage, step in enumerate(steps):
        block.store(layout.stages + stage * n, block.load(layout.stages + stage * n, "i") + step, "i")
        moved.append(_weighted(SQUARES[stage], steps) * (h * h))
    compare_change(layout, block, moved)
    return block


def _finish(layout: MotionLayout, block: Block) -> Block:
    h, n = block.load(layout.time_step), layout.unknowns
    position, velocity = (block.load(place, "i") for place in (layout.position, layout.velocity))
    accelerations = [block.load(layout.stages + stage * n, "i") for stage in range(2)]
    beyond = _weighted([0.5 * (1.0 - share) for share in STAGES], accelerations)
    block.store(layout.position, position + h * (velocity + h * beyond), "i")
    block.store(layout.velocity, velocity + h * 0.5 * (accelerations[0] + accelerations[1]), "i")
    keep_history(layout, block, [stage_values(layout, block, stage, base="i")[0] for stage in range(2)])
    return block


def _weighted(weights: Sequence[float], values: Sequence[Scalar]) -> Scalar:
    return values[0] * weights[0] + values[1] * weights[1]
