"""Ends of a segment with routed actuators, traced: their lengths are whole at its tip, and give the tensions.

The laws of the tensions are those of `softrobots.model.actuator_laws`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

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


def law_numbers(tag: ActuatorTag) -> tuple[float, ...]:
    """Return the numbers of the law of an actuator, as many of each kind; see `tension`."""
    if tag.kind == "elastic":
        return tag.rest_length, tag.stiffness, tag.pretension
    if tag.kind == "mckibben":
        square, least = pull_factors(tag)
        return tag.rest_length, square, least, (least / square) ** 0.5
    return (tag.area,) if tag.kind == "pressure" else ()


def tension(kind: str, numbers: Sequence[Scalar], given: Scalar, beyond: Scalar) -> Tension:
    """Trace the tension of an actuator.

    Args:
        kind: Its kind.
        numbers: Its `law_numbers`.
        given: Its input: tension [N], pressure [Pa] or length of the motor [m].
        beyond: Its length beyond that at rest [m].
    """
    if kind == "elastic":
        length, stiffness, pretension = numbers
        pull = (beyond - (given - length)) * stiffness + pretension
        taut = if_less(0.0, pull, pull, 0.0)
        slope = if_less(ROUNDING * stiffness * length, pull, stiffness, 0.0)
        return Tension(taut, slope, taut * taut * (0.5 / stiffness))
    if kind == "mckibben":
        length, square, least, slack = numbers
        share = beyond * (1.0 / length) + 1.0
        force = share * share * square - least
        work = ((share * share + share * slack + slack * slack) * (square / 3.0) - least) * (share - slack) * length
        parts = (force, share * (2.0 * square / length), work)
        return Tension(*(given * if_less(slack * (1.0 + ROUNDING), share, one, 0.0) for one in parts))
    value = given * -numbers[0] if kind == "pressure" else given
    return Tension(value, 0.0, value * beyond)


def muscle_numbers(plan: Plan, block: Block, muscle: int) -> list[Scalar]:
    """Return by how much an actuator is longer at zero strain than at rest [m], and the numbers of its law."""
    chain = plan.unknowns.chain
    values = [float(chain.muscle_paths.straightened[muscle]), *law_numbers(chain.actuators[muscle])]
    return [*plan.numbers(block, f"MUSCLE_{muscle}", values)]


def held_numbers(plan: Plan, block: Block, number: int, segment: Segment) -> tuple[Any, Any, Any]:
    """Return numbers of the given lengths of a segment.

    Returns:
        Combinations of them that the robot can choose, shape (c, M), the compliance of each, (c,), lengths at rest, (M,) [m].
    """
    chain, muscles = plan.unknowns.chain, list(segment.stretched)
    shares = held_factors(chain.spread[:, muscles])[1]
    shares = np.eye(len(muscles)) if len(shares) == len(muscles) else shares
    softness = ((shares @ chain.muscle_paths.at(chain.rest).arms[muscles]) ** 2 / chain.stiffness).sum(axis=1)
    values = [shares.ravel(), softness, chain.muscle_paths.rest[muscles]]
    every = plan.numbers(block, f"HELD_{number}", np.concatenate(values))
    return every[: shares.size].reshape(shares.shape), *np.split(every[shares.size :], [len(shares)])


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
        straightened, *law = muscle_numbers(plan, block, muscle)
        beyond = block.load(routes.changes + muscle) + straightened
        pull = tension(chain.actuators[muscle].kind, law, block.load(layout.actuators + muscle), beyond)
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
    muscles, all_ = list(segment.stretched), routes.components
    count = len(muscles)
    eliminate = Block(f"eliminate_lengths_{plan.infix}{number}", "Eliminate the given lengths of a segment.", ("at",))
    shares, softness, rest = held_numbers(plan, eliminate, number, segment)
    inner, state = plan.load_outboard(eliminate, 3)
    cross = vector(eliminate.loads(routes.cross, 3 * count)).reshape(count, 3)
    square = vector(eliminate.loads(routes.square, all_ * all_)).reshape(all_, all_)[:count, :count]
    sums = [vector(eliminate.loads(routes.sums + all_ * side, count)) for side in range(len(plan.turns))]
    matrix = np.block([[inner.matrix, (shares @ cross).T], [shares @ cross, shares @ square @ shares.T]])
    columns = [vector([*one, *(shares @ own)]) for one, own in zip(inner.columns, sums, strict=True)]
    gaps = constants(np.zeros(len(shares)))
    if tip is None:
        given_lengths = vector([eliminate.load(layout.actuators + one) for one in muscles]) - rest
        gaps = shares @ (vector([eliminate.load(routes.changes + one) for one in muscles]) - given_lengths)
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
            torque = gap * (1.0 / soft)
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
