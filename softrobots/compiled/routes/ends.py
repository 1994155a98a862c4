"""Ends of a segment with routed actuators, traced: their lengths are whole at its tip, and give the tensions.

The laws of the tensions are those of `softrobots.model.actuator_laws`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import constants, vector
from softrobots.compiled.chain.elimination import Outboard, eliminate_multipliers
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.routes import Routed
from softrobots.compiled.chain.unknowns import Segment
from softrobots.compiled.motion.held_motion import held_factors
from softrobots.compiled.settings import LARGEST_NUMBER
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Scalar, absolute, if_less, smaller
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuator_laws import ROUNDING, pull_factors


class Tension(NamedTuple):
    """Tension of an actuator."""

    value: Scalar
    """Tension, negative where it pushes [N]."""
    slope: Scalar
    """Its derivative by the length [N/m]; 0 where it is slack."""
    energy: Scalar
    """Energy whose derivative by the length is the tension [J]."""


def tension(tag: ActuatorTag, given: Scalar, beyond: Scalar) -> Tension:
    """Trace the tension of an actuator.

    Args:
        tag: The actuator.
        given: Its input: tension [N], pressure [Pa] or length of the motor [m].
        beyond: Its length beyond that at rest [m].
    """
    if tag.kind == "elastic":
        pull = (beyond - (given - tag.rest_length)) * tag.stiffness + tag.pretension
        taut = if_less(0.0, pull, pull, 0.0)
        slope = if_less(ROUNDING * tag.stiffness * tag.rest_length, pull, tag.stiffness, 0.0)
        return Tension(taut, slope, taut * taut * (0.5 / tag.stiffness))
    if tag.kind == "mckibben":
        square, least = pull_factors(tag)
        share, slack = beyond * (1.0 / tag.rest_length) + 1.0, (least / square) ** 0.5
        force = share * share * square - least
        work = ((share * share + share * slack + slack * slack) * (square / 3.0) - least) * (share - slack) * tag.rest_length
        parts = (force, share * (2.0 * square / tag.rest_length), work)
        return Tension(*(given * if_less(slack * (1.0 + ROUNDING), share, one, 0.0) for one in parts))
    value = given * -tag.area if tag.kind == "pressure" else given
    return Tension(value, 0.0, value * beyond)


def keep_lengths(plan: Routed, number: int, segment: Segment) -> Block:
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
        if plan.unknowns.held_lengths:  # the tension is the multiplier of the last point
            tension_held = block.load(layout.held + muscle)
            block.store(routes.tensions + place, tension_held)
            block.store(routes.pulled + muscle, tension_held)
            continue
        beyond = block.load(routes.changes + muscle) + float(chain.muscle_paths.straightened[muscle])
        pull = tension(chain.actuators[muscle], block.load(layout.actuators + muscle), beyond)
        energy = energy + pull.energy
        block.store(routes.tensions + place, pull.value)
        block.store(routes.pulled + muscle, pull.value)
        if routes.guided:
            block.store(routes.stretching + place, pull.slope)
        elif muscle in segment.stretched:
            square[place, place] = -pull.slope
    if plan.tip is None:
        block.store(recursion.sums, block.load(recursion.sums) + energy)
        block.store(recursion.sums + 2, smaller(block.load(recursion.sums + 2), block.load(routes.margin)))
    block.store_all(routes.square, square.ravel().tolist())
    block.store_all(routes.cross, [0.0] * (3 * routes.components))
    block.store_all(routes.sums, [0.0] * (routes.components * len(plan.turns)))
    return block


def held_blocks(plan: Plan, number: int, segment: Segment) -> tuple[list[Block], int]:
    """Trace the functions at the base of a segment that eliminate given lengths, and solve for the changes of their tensions.

    What closing the gaps saves counts in the energy: the tension that the step leads to times the gap, as in Fletcher's penalty
    function, and the elastic energy of the gap. Lengths that depend on each other hold as many combinations of them as the
    robot can choose, with tensions in the same proportions.

    Returns:
        The functions, and the size of their record.
    """
    routes, recursion, layout, tip = plan.routes, plan.recursion, plan.layout, plan.tip
    chain, muscles, all_ = plan.unknowns.chain, list(segment.stretched), routes.components
    shares = held_factors(chain.spread[:, muscles])[1]
    shares = np.eye(len(muscles)) if len(shares) == len(muscles) else shares
    softness = ((shares @ chain.muscle_paths.at(chain.rest).arms[muscles]) ** 2 / chain.stiffness).sum(axis=1)
    count, shares = len(muscles), constants(shares)
    eliminate = Block(f"eliminate_lengths_{plan.infix}{number}", "Eliminate the given lengths of a segment.", ("at",))
    inner, state = plan.load_outboard(eliminate, 3)
    cross = vector(eliminate.loads(routes.cross, 3 * count)).reshape(count, 3)
    square = vector(eliminate.loads(routes.square, all_ * all_)).reshape(all_, all_)[:count, :count]
    sums = [vector(eliminate.loads(routes.sums + all_ * side, count)) for side in range(len(plan.turns))]
    matrix = np.block([[inner.matrix, (shares @ cross).T], [shares @ cross, shares @ square @ shares.T]])
    columns = [vector([*one, *(shares @ own)]) for one, own in zip(inner.columns, sums, strict=True)]
    gaps = constants(np.zeros(len(shares)))
    if tip is None:
        given_lengths = [eliminate.load(layout.actuators + one) - float(chain.muscle_paths.rest[one]) for one in muscles]
        gaps = shares @ (vector([eliminate.load(routes.changes + one) for one in muscles]) - vector(given_lengths))
    whole = Outboard(matrix, columns, inner.min_pivot, inner.n_negative_pivots)
    given = [shares @ vector(one) for one in plan.given_gaps(eliminate, muscles)]
    eliminated, beyond = eliminate_multipliers(whole, gaps, softness.tolist(), *given)
    plan.store_outboard(eliminate, beyond)
    negative = beyond.n_negative_pivots + float(count - len(shares))  # one of each length is expected
    eliminate.store_all(recursion.sums + 3, [beyond.min_pivot, negative])
    solve = Block(f"solve_lengths_{plan.infix}{number}", "Find the tensions that hold given lengths.", ("at",), eliminate.trace)
    turns = [solve.loads(place, 3) for place in plan.turns]
    changes = [eliminated.steps(side, vector(turn)) for side, turn in enumerate(turns)]
    for side, change in enumerate(changes):
        solve.store_all(routes.turns + all_ * side, (shares.T @ change).tolist())
    held = vector([solve.load(layout.held + muscle) for muscle in muscles])
    arriving = [one for turn in turns for one in turn]
    if tip is None:
        arriving += [solve.load(recursion.sums), *solve.loads(recursion.steps, 2)]
        energy: Scalar = arriving[-3]
        slope: Scalar = arriving[-2]
        error: Scalar = arriving[-1]
        for old, change, gap, soft in zip(shares @ held, changes[0], gaps, softness, strict=True):
            torque = gap * float(1.0 / soft)
            energy = energy + gap * (old + change + torque * 0.5)
            slope = slope - gap * (change + torque)
            error = error + torque * torque
        for muscle, new in zip(muscles, held + shares.T @ changes[0], strict=True):
            solve.store(layout.held + muscle, if_less(absolute(new), LARGEST_NUMBER, new, 0.0))
        solve.store(recursion.sums, energy)
        solve.store_all(recursion.steps, [slope, error])
    else:
        places = [tip.constraint_loads, *tip.each(tip.constraint_columns, tip.n_constraints)]
        for place, column in zip(places, changes, strict=True):
            for muscle, value in zip(muscles, shares.T @ column, strict=True):
                solve.store(place + muscle, value)
    crossing = [*cross.ravel(), *square.ravel(), *(one for side in sums for one in side)]
    size = hoist([solve], eliminate, arriving, 0, "at", overwritten=[*state, *crossing])
    return [eliminate, solve], size


def leave_segment(plan: Plan, number: int) -> Block:
    """Trace the function there on the step pass: the lengths of the next segment begin."""
    routes, block = plan.routes, Block(f"leave_segment_{plan.infix}{number}", "Clear the steps of the lengths of a segment.")
    block.store_all(routes.turns, [0.0] * (routes.components * len(plan.turns)))
    return block
