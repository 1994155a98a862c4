"""Unrolled chains: the passes over all elements traced as straight-line code.

Vectors are in the axes behind the leading motors, which carry the rest of the robot as one rigid body: the load is turned into
those axes once, and their joints cost nothing afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Load, Vector, constants, turned, vector
from softrobots.compiled.chain.elimination import Outboard, resized
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance, InwardPass, OutwardPass, inward, outward
from softrobots.compiled.chain.slack_hinges import with_slack_hinges
from softrobots.compiled.chain.traced_elements import TracedElement
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, scalar


@dataclass
class Evaluation:
    """A chain at given coordinates, traced; vectors in the axes behind the leading motors."""

    unknown: Sequence[Scalar]
    """The unknowns."""
    inward_passes: list[InwardPass]
    """Result of each element, the leading motors included."""
    turns: list[list[Vector]]
    """By element and right-hand side: the turn of all elements nearer to the base."""
    steps: list[list[Vector]]
    """By element and right-hand side: its part of the solution; the first side is the Newton step."""
    gradient: list[Scalar]
    """Derivative of the energy with respect to the unknowns: the out-of-balance torque."""
    step: list[Scalar]
    """Newton step of the unknowns."""
    balance: Balance
    """Sums over the elements."""
    beyond: Outboard
    """Pivots of all elements."""
    energy: Scalar
    """Elastic energy plus potential of the loads, up to a constant [J]."""
    tip: Vector
    """The tip from the origin behind the leading motors [m]."""
    tip_axes: Any
    """Its axes, shape (3, 3)."""
    base_axes: Any
    """Axes of the frame behind the leading motors in the world, shape (3, 3)."""
    base: Vector
    """Its origin in the world [m]."""


def evaluate(
    plan: Plan,
    block: Block,
    *,
    at_rest: bool = False,
    forceless: bool = False,
    tip_columns: int = 0,
    shift_pivots: bool = False,
) -> Evaluation:
    """Trace a chain at the coordinates in the workspace.

    Args:
        plan: The chain and its places.
        block: Block of the expressions.
        at_rest: Whether the unknowns are at rest, instead of in the workspace.
        forceless: Whether there is no force on the tip.
        tip_columns: Number of right-hand sides for the motion of the tip, see `recursion.inward`.
        shift_pivots: Whether pivots are shifted by the `pivot_shift` in the workspace.
    """
    unknowns, layout = plan.unknowns, plan.layout
    chain = plan.numbers_in(block)
    at_start = [scalar(chain.rest[strain]) for strain in unknowns.strains]
    unknown: Sequence[Scalar] = at_start if at_rest else block.loads(layout.unknown, layout.unknowns)
    rows = range(len(chain.elements))
    elements = [unknowns.traced(row, block.load, lambda place: unknown[place], chain) for row in rows]
    elements = with_slack_hinges(unknowns, elements, chain)
    leading = unknowns.leading_motors
    base_axes, base = place_base(elements[:leading])
    force = constants(np.zeros(3)) if forceless else base_axes.T @ vector(block.loads(layout.force, 3))
    forces = [force, base_axes.T @ vector(block.loads(layout.gravity, 3))] if plan.weight else [force]

    axes, outward_passes = constants(np.eye(3)), []
    for element in elements[leading:]:
        outward_passes.append(outward(element, axes))
        axes = outward_passes[-1].end
    tip_axes = axes @ constants(chain.tip_rotation)
    levers, shares = [axes @ constants(chain.tip_translation), constants(np.zeros(3))], [1.0, 0.0]
    loads = [Load(*one) for one in zip(forces, levers, shares, strict=False)]
    pivot_shift = block.load(layout.single("pivot_shift")) if shift_pivots else 0.0

    outward_passes = seen_backwards(elements[:leading]) + outward_passes
    sides = 1 + tip_columns
    beyond, balance = Outboard.tip(sides), Balance()
    backwards: list[InwardPass] = []
    energy: Scalar = 0.0
    tip = loads[0].lever
    for row in reversed(range(len(elements))):
        one = inward(
            elements[row], outward_passes[row], loads, beyond, balance, tip_columns=tip_columns, pivot_shift=pivot_shift
        )
        loads, beyond = one.loads, one.beyond
        backwards.append(one)
        if row == leading:
            tip = loads[0].lever
            energy = balance.energy - sum(load.force @ load.lever for load in loads)
    inward_passes = backwards[::-1]

    turn: list[Vector] = [constants(np.zeros(3)) for _ in range(sides)]
    turns, steps = [], []
    for one in inward_passes:
        turns.append(turn)
        own: list[Vector] = [constants(np.zeros(0))] * sides
        if one.eliminated is not None:
            own = [one.eliminated.steps(side, nearer) for side, nearer in enumerate(turn)]
            turn = [one.turned(nearer, step) for nearer, step in zip(turn, own, strict=True)]
        steps.append(own)
    gradient = unknowns.in_order([one.gradient for one in inward_passes])
    step = unknowns.in_order([own[0] for own in steps])
    return Evaluation(
        unknown, inward_passes, turns, steps, gradient, step, balance, beyond, energy, tip, tip_axes, base_axes, base
    )


def solve_again(unknowns: Unknowns, point: Evaluation, sides: Sequence[Sequence[Scalar]]) -> list[Scalar]:
    """Return the step of the unknowns with another right-hand side: the gradient of those of each element."""
    total, columns = constants(np.zeros(3)), {}
    for row in reversed(range(len(point.inward_passes))):
        one = point.inward_passes[row]
        if one.eliminated is not None:
            eliminated = one.eliminated
            total = resized(total, len(one.twists))
            column = eliminated.reduced([value + one.twists[:, j] @ total for j, value in enumerate(sides[row])])
            for coupling, pivot, value in zip(eliminated.coupling, eliminated.inverse_pivots, column, strict=True):
                total = resized(total, len(coupling)) + coupling * (pivot * value)
            columns[row] = replace(eliminated, columns=[column])
    turn: Vector = constants(np.zeros(3))
    steps: list[Sequence[Scalar]] = [[] for _ in sides]
    for row, eliminated in sorted(columns.items()):
        steps[row] = eliminated.steps(0, turn)
        turn = point.inward_passes[row].turned(turn, steps[row])
    return unknowns.in_order(steps)


def place_base(leading: list[TracedElement]) -> tuple[Any, Vector]:
    """Return axes, shape (3, 3), and origin, shape (3,) [m], of the frame behind the leading motors in the world."""
    axes, origin = constants(np.eye(3)), constants(np.zeros(3))
    for element in leading:
        origin, axes = origin + axes @ element.translation, axes @ element.rotation
        if element.kind == "turn":
            axes = turned(axes, element.coordinates[0])
        else:
            origin = origin + axes[:, 2] * element.coordinates[0]
    return axes, origin


def seen_backwards(leading: list[TracedElement]) -> list[OutwardPass]:
    """Return the outward passes of the leading motors in the axes behind the last of them."""
    axes, backwards = constants(np.eye(3)), []
    for element in reversed(leading):
        start = turned(axes, -element.coordinates[0]) if element.kind == "turn" else axes
        before = start @ element.rotation.T
        backwards.append(OutwardPass(start, before @ element.translation, axes, None))
        axes = before
    return backwards[::-1]
