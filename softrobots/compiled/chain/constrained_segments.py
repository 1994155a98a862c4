"""Ends of a segment with muscles: multipliers of given lengths are added at its tip and eliminated at its base.

Given lengths are constraints of the strains, nonlinear where the segment twists. A Newton step closes their gap to first order;
the tangent takes the tensions from the multipliers of the last point. What closing the gap will save counts in the energy
already, to second order: minus the mean torque of the sums times the gap, plus the elastic energy of the gap itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import vector
from softrobots.compiled.chain.elimination import eliminate_multipliers
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.settings import LARGEST_NUMBER
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less


def segment_blocks(plan: Plan, number: int, segment: Segment) -> tuple[list[Block], int]:
    """Trace the functions at the ends of the segment of this number.

    Returns:
        Functions that set the tensions and add the multipliers at its tip, and, if it has multipliers, eliminate them at its
        base, and solve for them there on the step pass; and the size of the record.
    """
    chain, recursion, tip, infix = plan.unknowns.chain, plan.recursion, plan.tip, plan.infix
    count = len(segment.groups)
    add = Block(f"add_multipliers_{infix}{number}", "Set the tensions of a segment, and add its multipliers, without coupling.")
    _set_tensions(plan, add, number, segment)
    if count == 0:
        return [add], 0
    add.store_all(recursion.matrix + 6, [0.0] * (count * (count + 7) // 2))
    if tip is None:
        add.store_all(recursion.gaps, [0.0] * count)
        add.store_all(recursion.constraint_torques, [0.0] * count)
    for place in plan.columns:
        add.store_all(place + 3, [0.0] * count)
    eliminate = Block(f"eliminate_multipliers_{infix}{number}", "Eliminate the multipliers of a segment.", ("at",))
    softness = sum_numbers(plan, eliminate, number, segment)[0].tolist()
    outboard, state = plan.load_outboard(eliminate, 3 + count)
    gaps: list[Scalar] = [0.0] * count
    slope: Scalar = 0.0
    if tip is None:
        arrived, totals = eliminate.loads(recursion.gaps, count), eliminate.loads(recursion.constraint_torques, count)
        energy = eliminate.load(recursion.sums)
        state = [*state, *arrived, *totals]
        gaps = [*arrived]
        saved: Scalar = energy
        for group, total, gap, soft in zip(segment.groups, totals, gaps, softness, strict=True):
            torque = gap * (1.0 / soft)  # of closing the gap
            mean = total * (1.0 / len(chain.constrained[group]))
            saved = saved + gap * (torque * 0.5 - mean)
            slope = slope + gap * (mean - torque)
        eliminate.store(recursion.sums, saved)
    given = plan.given_gaps(eliminate, segment.groups)
    eliminated, beyond = eliminate_multipliers(outboard, gaps, softness, *given)
    plan.store_outboard(eliminate, beyond)
    eliminate.store_all(recursion.sums + 3, [beyond.min_pivot, beyond.n_negative_pivots])
    solve = Block(f"solve_multipliers_{infix}{number}", "Find the multipliers of a segment.", ("at",), eliminate.trace)
    turns = [solve.loads(place, 3) for place in plan.turns]
    sums = solve.loads(recursion.steps, 3)
    if tip is None:
        error: Scalar = sums[1]
        for gap, soft in zip(gaps, softness, strict=True):
            error = error + (gap * (1.0 / soft)) * (gap * (1.0 / soft))
        solve.store_all(recursion.steps, [sums[0] + slope, error])
    for side, (place, turn) in enumerate(zip(plan.turns, turns, strict=True)):
        multipliers = eliminated.steps(side, vector(turn)).tolist()
        solve.store_all(place + 3, multipliers)
        for group, value in zip(segment.groups, multipliers, strict=True):
            if tip is None:  # out of range it may be no number: then the next point begins anew
                solve.store(plan.layout.held + group, if_less(absolute(value), LARGEST_NUMBER, value, 0.0))
            else:
                first = tip.constraint_loads if side == 0 else tip.constraint_columns + (side - 1) * tip.n_constraints
                solve.store(first + group, value)
    arriving = [*(one for turn in turns for one in turn), *sums]
    size = hoist([solve], eliminate, arriving, 0, "at", overwritten=state)
    return [add, eliminate, solve], size


def sum_numbers(plan: Plan, block: Block, number: int, segment: Segment) -> Any:
    """Return numbers of the constrained sums of a segment: compliances, rest and stiffness of the first strain, and slopes.

    Shape (3 + M, n_groups), with the derivative of the sums by the length of each of the M muscles of the robot.
    """
    chain = plan.unknowns.chain
    groups = [list(chain.constrained[group]) for group in segment.groups]
    first = [group[0] for group in groups]  # all strains of a sum have the same torque at the start
    softness = [float(np.sum(1.0 / chain.stiffness[group])) for group in groups]
    slopes = chain.constrained_slope[list(segment.groups)].T
    return plan.numbers(block, f"SUMS_{number}", np.vstack([softness, chain.rest[first], chain.stiffness[first], slopes]))


def _set_tensions(plan: Plan, block: Block, number: int, segment: Segment) -> None:
    """Write the tensions of a segment: as given, or as of the multipliers of the last point and the preload of the start."""
    chain, layout, recursion = plan.unknowns.chain, plan.layout, plan.recursion
    if not segment.groups:
        block.store_all(recursion.tensions, [block.load(layout.actuators + muscle) for muscle in segment.muscles])
        return
    held = [block.load(layout.held + group) for group in segment.groups]
    block.store_all(recursion.multipliers, held)
    _, rest, stiffness, *slopes = sum_numbers(plan, block, number, segment)
    first = [plan.unknowns.place[chain.constrained[group][0]] for group in segment.groups]
    preload = (vector([block.load(layout.start + place) for place in first]) - rest) * stiffness
    for place, muscle in enumerate(segment.muscles):
        block.store(recursion.preload + place, slopes[muscle] @ preload)
        block.store(recursion.tensions + place, slopes[muscle] @ (vector(held) - preload))
