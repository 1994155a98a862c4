"""Generated functions of motion, in the parts that a module is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from softrobots.compiled.motion.gauss_step import corrections, place_block, right_hand_side
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.unrolled_motion import (
    factored,
    joints_of,
    newton_matrix,
    residual,
    solved,
    state_of,
    tip_position,
)
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.complex_numbers import of_parts, parts_of
from softrobots.compiled.trace.expressions import Scalar, cosine, sine


@dataclass(frozen=True)
class MotionParts:
    """The functions of a chain that `softrobots.compiled.drivers.motion_drivers` calls, each also for lanes.

    `motion_prepare` computes what depends on motors, force, gravity and time step only; `motion_factor` evaluates the residual
    `r` at `unknown`, `rate` and `acceleration`, factors `A = M + h/2 D + h^2/4 K`, and writes the correction `-A^-1 r`;
    `motion_correct` does so with the factors that are there; `motion_tip` writes the tip at motors and `unknown`.
    """

    blocks: list[Block]
    """Straight-line functions."""
    size: int
    """Size of the workspace."""
    constants: dict[str, object] = field(default_factory=dict)
    """Tables and places that they need."""
    loops: list[str] = field(default_factory=list)
    """Texts of the functions that loop over elements."""
    lane_loops: list[str] = field(default_factory=list)
    """Texts of those for lanes."""


_STAGES = '''def evaluate_stages_SUFFIX(w: Array) -> None:
    """Write the torques out of balance at both stages."""
    for i in range(N):
        place_stages_SUFFIX(w, i, 2 * i)
    stage_torques_SUFFIX(w)


def motion_factor_SUFFIX(w: Array) -> None:
    """Evaluate and factor; write the correction."""
    evaluate_stages_SUFFIX(w)
    stage_factors_SUFFIX(w)
    correct_stages_SUFFIX(w)


def motion_correct_SUFFIX(w: Array) -> None:
    """Evaluate; write the correction with the factors that are there."""
    evaluate_stages_SUFFIX(w)
    correct_stages_SUFFIX(w)'''


def unrolled_motion(plan: MotionPlan) -> MotionParts:
    """Trace the functions of an unrolled chain; the factors stand in the first places behind the layout."""
    prepare = Block("motion_prepare", "Compute what depends on motors, force, gravity and time step only.")
    blocks, size = (_stage_blocks if plan.layout.in_stages else _middle_blocks)(plan, prepare)
    tip = Block("motion_tip", "Write the tip at motors and unknowns.")
    tip.store_all(plan.layout.tip, tip_position(plan, tip))
    text = coast_text(plan, "") + ("\n\n" + _STAGES if plan.layout.in_stages else "")
    loops = [text.replace("_SUFFIX", suffix) for suffix in ("", "_lanes")]
    return MotionParts([prepare, *blocks, tip], size, {}, loops[:1], loops[1:])


def coast_text(plan: MotionPlan, solve: str) -> str:
    """Return the function that corrects a guess by the linear equations of the step before, from what solves them."""
    head = "def motion_coast_SUFFIX(w: Array) -> None:\n"
    purpose = '    """Write the correction by the torques of coasting, with the factors of the step before."""\n'
    return head + purpose + (solve if plan.layout.coasting else "    pass\n")


def _middle_blocks(plan: MotionPlan, prepare: Block) -> tuple[list[Block], int]:
    """Trace the functions of the midpoint rule; return the end of their places, too."""
    layout, n = plan.layout, plan.layout.unknowns
    factor = Block("motion_factor", "Evaluate and factor; write the correction.", trace=prepare.trace)
    state = state_of(plan, factor)
    joints = joints_of(plan, factor, state)
    inverses, lower = factored(newton_matrix(plan, factor, joints))
    factors = [*inverses, *(one for row in lower for one in row)]
    rest = residual(plan, factor, joints, state)
    factor.store_all(layout.prepared, factors)
    factor.store_all(layout.correction, solved(inverses, lower, rest))
    correct = Block("motion_correct", "Evaluate; write the correction with the factors that are there.", trace=prepare.trace)
    kept = correct.loads(layout.prepared, len(factors))
    correct.store_all(layout.correction, solved(kept[:n], _rows(kept, n), rest))
    moving = [*kept, *(one for begin in (layout.unknown, layout.rate, layout.acceleration) for one in correct.loads(begin, n))]
    first = layout.prepared + len(factors)
    return [factor, correct], first + hoist([factor, correct], prepare, moving, first)


def _stage_blocks(plan: MotionPlan, prepare: Block) -> tuple[list[Block], int]:
    """Trace the functions of both stages of Gauss, whose numbers stand side by side, so that compilers do both at once."""
    layout, n, trace = plan.layout, plan.layout.unknowns, prepare.trace
    count = n * (n + 1)  # real numbers of the factors
    unknown, rate, change, cosines, sines, torques, first = (layout.prepared + count + 2 * n * place for place in range(7))
    place = place_block(layout, (unknown, rate, change))
    evaluate = Block("stage_torques", "Write the torques out of balance at both stages.", trace=trace, loop=("stage", 2))
    state = [[evaluate.load(begin + 2 * row, "stage") for row in range(n)] for begin in (unknown, rate, change)]
    bends = [(cosine(one), sine(one)) for one in state[0]]
    for row, torque in enumerate(residual(plan, evaluate, joints_of(plan, evaluate, state), state)):
        for begin, value in zip((torques, cosines, sines), (torque, *bends[row]), strict=True):
            evaluate.store(begin + 2 * row, value, "stage")
    factor = Block("stage_factors", "Factor the matrix of a step at the second stage.", trace=trace)
    last = [[factor.load(begin + 2 * row + 1) for row in range(n)] for begin in (unknown, rate, change, cosines, sines)]
    joints = joints_of(plan, factor, last[:3], list(zip(*last[3:], strict=True)))
    inverses, lower = factored(newton_matrix(plan, factor, joints))
    factor.store_all(layout.prepared, parts_of([*inverses, *(one for row in lower for one in row)]))
    correct = Block("correct_stages", "Write the correction.")
    kept = of_parts(correct.loads(layout.prepared, count))
    both = [[correct.load(torques + 2 * row + stage) for row in range(n)] for stage in range(2)]
    found = corrections(solved(kept[:n], _rows(kept, n), right_hand_side(*both)))
    correct.store_all(layout.correction, [one for part in found for one in part])
    varying = [one for values in (*state, *last) for one in values]
    size = first + hoist([evaluate, factor], prepare, varying, first)
    return [place, evaluate, factor, correct], size


def _rows(factors: Sequence[Scalar], n: int) -> list[Sequence[Scalar]]:
    """Return the rows of `L` to the left of the diagonal, which stand behind the inverse pivots."""
    return [factors[n + row * (row - 1) // 2 : n + row * (row + 1) // 2] for row in range(n)]
