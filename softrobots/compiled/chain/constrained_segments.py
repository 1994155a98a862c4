"""Ends of a segment with given muscle lengths: its multipliers are added at its tip and eliminated at its base."""

from __future__ import annotations

import numpy as np

from softrobots.compiled.chain.elements import vector
from softrobots.compiled.chain.elimination import eliminate_multipliers
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar


def segment_blocks(plan: Plan, number: int, segment: Segment) -> tuple[list[Block], int]:
    """Trace the functions at the ends of the constrained segment of this number.

    Returns:
        Functions that add the multipliers at its tip, eliminate them at its base, and solve for them there on the step pass;
        and the size of the record.
    """
    chain, recursion, tip, infix = plan.unknowns.chain, plan.recursion, plan.tip, plan.infix
    softness = [float(np.sum(1.0 / chain.stiffness[list(chain.constrained[group])])) for group in segment.groups]  # of each sum
    count = len(softness)
    add = Block(f"add_multipliers_{infix}{number}", "Add the multipliers of a segment, without coupling.")
    add.store_all(recursion.matrix + 6, [0.0] * (count * (count + 7) // 2))
    if tip is None:
        add.store_all(recursion.gaps, [0.0] * count)
        add.store_all(recursion.constraint_torques, [0.0] * count)
    for place in plan.columns:
        add.store_all(place + 3, [0.0] * count)
    eliminate = Block(f"eliminate_multipliers_{infix}{number}", "Eliminate the multipliers of a segment.", ("at",))
    outboard, state = plan.load_outboard(eliminate, 3 + count)
    gaps: list[Scalar] = [0.0] * count
    if tip is None:
        arrived = eliminate.loads(recursion.gaps, count)
        state = [*state, *arrived]
        gaps = [*arrived]
    eliminated, beyond = eliminate_multipliers(outboard, gaps, softness)
    plan.store_outboard(eliminate, beyond)
    eliminate.store_all(recursion.sums + 3, [beyond.min_pivot, beyond.n_negative_pivots])
    solve = Block(f"solve_multipliers_{infix}{number}", "Find the multipliers of a segment.", ("at",), eliminate.trace)
    turns = [solve.loads(place, 3) for place in plan.turns]
    sums = solve.loads(recursion.steps, 3)
    if tip is None:
        totals = eliminate.loads(recursion.constraint_torques, count)
        error: Scalar = sums[1]
        for place, (group, total, gap, soft) in enumerate(zip(segment.groups, totals, gaps, softness, strict=True)):
            solve.store(recursion.constraint_torques + place, total * (1.0 / len(chain.constrained[group])))
            torque = gap * (1.0 / soft)  # of closing the gap
            error = error + torque * torque
        solve.store(recursion.steps + 1, error)
        state = [*state, *totals]
    for side, (place, turn) in enumerate(zip(plan.turns, turns, strict=True)):
        multipliers = eliminated.steps(side, vector(turn)).tolist()
        solve.store_all(place + 3, multipliers)
        if tip is not None:
            first = tip.constraint_loads if side == 0 else tip.constraint_columns + (side - 1) * tip.n_constraints
            for group, value in zip(segment.groups, multipliers, strict=True):
                solve.store(first + group, value)
    arriving = [*(one for turn in turns for one in turn), *sums]
    size = hoist([solve], eliminate, arriving, 0, "at", overwritten=state)
    return [add, eliminate, solve], size
