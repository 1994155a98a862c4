"""Generated functions of motion, in the parts that a module is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

from softrobots.compiled.motion.gauss_step import corrections, right_hand_side, stage_values
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.unrolled_motion import (
    State,
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
from softrobots.compiled.trace.expressions import Scalar


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


def unrolled_motion(plan: MotionPlan) -> MotionParts:
    """Trace the functions of an unrolled chain; the factors stand in the first places behind the layout."""
    layout, n = plan.layout, plan.layout.unknowns
    prepare = Block("motion_prepare", "Compute what depends on motors, force, gravity and time step only.")
    factor = Block("motion_factor", "Evaluate and factor; write the correction.", trace=prepare.trace)
    in_stages = layout.in_stages
    states = [_stage_state(plan, factor, stage) for stage in range(2)] if in_stages else [state_of(plan, factor)]
    joints = [joints_of(plan, factor, state) for state in states]
    inverses, lower = factored(newton_matrix(plan, factor, joints[-1]))
    factors = [*inverses, *(one for row in lower for one in row)]
    torques = [residual(plan, factor, *both) for both in zip(joints, states, strict=True)]
    rest = right_hand_side(*torques) if in_stages else torques[0]
    flat = parts_of(factors) if in_stages else factors
    factor.store_all(layout.prepared, flat)
    factor.store_all(layout.correction, _corrections(solved(inverses, lower, rest), in_stages))
    correct = Block("motion_correct", "Evaluate; write the correction with the factors that are there.", trace=prepare.trace)
    loaded = correct.loads(layout.prepared, len(flat))
    kept = of_parts(loaded) if in_stages else loaded
    rows = [kept[n + row * (row - 1) // 2 : n + row * (row + 1) // 2] for row in range(n)]
    correct.store_all(layout.correction, _corrections(solved(kept[:n], rows, rest), in_stages))
    places = (layout.stages, layout.stages + n, layout.position, layout.velocity)
    given = places if in_stages else (layout.unknown, layout.rate, layout.acceleration)
    moving = [*loaded, *(one for place in given for one in correct.loads(place, n))]
    first = layout.prepared + len(flat)
    size = first + hoist([factor, correct], prepare, moving, first)
    tip = Block("motion_tip", "Write the tip at motors and unknowns.")
    tip.store_all(layout.tip, tip_position(plan, tip))
    return MotionParts([prepare, factor, correct, tip], size)


def _stage_state(plan: MotionPlan, block: Block, stage: int) -> State:
    values = [stage_values(plan.layout, block, stage, place) for place in range(plan.layout.unknowns)]
    return list(zip(*values, strict=True))


def _corrections(found: list[Scalar], in_stages: bool) -> list[Scalar]:
    return [one for part in corrections(found) for one in part] if in_stages else found
