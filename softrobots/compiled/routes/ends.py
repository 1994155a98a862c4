"""Ends of a segment with routed actuators, traced: their lengths are whole at its tip, and give the tensions."""

from __future__ import annotations

import numpy as np

from softrobots.compiled.chain.elements import constants
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.routes.laws import tension
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, smaller


def keep_lengths(plan: Plan, number: int, segment: Segment) -> Block:
    """Trace the function at the tip of the segment of this number on the outward pass."""
    routes, block = plan.routes, Block(f"keep_lengths_{number}", "Keep the lengths of the actuators of a segment.")
    for place, muscle in enumerate(segment.muscles):
        block.store(routes.changes + muscle, block.load(routes.lengths + place))
        block.store(routes.lengths + place, 0.0)
    return block


def start_lengths(plan: Plan, number: int, segment: Segment) -> Block:
    """Trace the function there on the inward pass: tensions, energy, and `P` and `s` of the lengths."""
    chain, routes, layout, recursion = plan.unknowns.chain, plan.routes, plan.layout, plan.recursion
    block = Block(f"start_lengths_{plan.infix}{number}", "Find the tensions of the actuators of a segment.")
    square = constants(np.zeros((routes.components, routes.components)))
    energy: Scalar = 0.0
    for place, muscle in enumerate(segment.muscles):
        beyond = block.load(routes.changes + muscle) + float(chain.muscle_paths.straightened[muscle])
        pull = tension(chain.actuators[muscle], block.load(layout.actuators + muscle), beyond)
        energy = energy + pull.energy
        block.store(routes.tensions + place, pull.value)
        block.store(routes.pulled + muscle, pull.value)
        if muscle in segment.stretched:
            square[place, place] = -pull.slope
    if plan.tip is None:
        block.store(recursion.sums, block.load(recursion.sums) + energy)
        block.store(recursion.sums + 2, smaller(block.load(recursion.sums + 2), block.load(routes.margin)))
    block.store_all(routes.square, square.ravel().tolist())
    block.store_all(routes.cross, [0.0] * (3 * routes.components))
    block.store_all(routes.sums, [0.0] * (routes.components * len(plan.turns)))
    return block


def leave_segment(plan: Plan, number: int) -> Block:
    """Trace the function there on the step pass: the lengths of the next segment begin."""
    routes, block = plan.routes, Block(f"leave_segment_{plan.infix}{number}", "Clear the steps of the lengths of a segment.")
    block.store_all(routes.turns, [0.0] * (routes.components * len(plan.turns)))
    return block
