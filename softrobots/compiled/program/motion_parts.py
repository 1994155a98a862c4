"""Generated functions of motion, in the parts that a module is made of."""

from __future__ import annotations

from dataclasses import dataclass, field

from softrobots.compiled.chain.motion_layout import MotionPlan
from softrobots.compiled.chain.unrolled_motion import factored, joints_of, newton_matrix, residual, solved, tip_position
from softrobots.compiled.trace.blocks import Block, hoist


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
    joints = joints_of(plan, factor)
    inverses, lower = factored(newton_matrix(plan, factor, joints))
    factors = [*inverses, *(one for row in lower for one in row)]
    rest = residual(plan, factor, joints)
    factor.store_all(layout.prepared, factors)
    factor.store_all(layout.correction, solved(inverses, lower, rest))
    correct = Block("motion_correct", "Evaluate; write the correction with the factors that are there.", trace=prepare.trace)
    kept = correct.loads(layout.prepared, len(factors))
    rows = [kept[n + row * (row - 1) // 2 : n + row * (row + 1) // 2] for row in range(n)]
    correct.store_all(layout.correction, solved(kept[:n], rows, rest))
    moving = [*kept, *correct.loads(layout.unknown, n), *correct.loads(layout.rate, n), *correct.loads(layout.acceleration, n)]
    first = layout.prepared + len(factors)
    size = first + hoist([factor, correct], prepare, moving, first)
    tip = Block("motion_tip", "Write the tip at motors and unknowns.")
    tip.store_all(layout.tip, tip_position(plan, tip))
    return MotionParts([prepare, factor, correct, tip], size)
