"""Right-hand sides of the elements of a looped chain besides that of the balance, traced; see `looped_tip`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from softrobots.compiled.chain.elements import vector
from softrobots.compiled.chain.elimination import resized
from softrobots.compiled.chain.layout import TipLayout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import InwardPass
from softrobots.compiled.chain.traced_elements import TracedElement
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression


def before_by_lengths(block: Block, plan: Plan, k: int, routed: bool) -> list[list[Expression] | None]:
    """Return what the lengths add to the turn of all elements nearer to the base, for each right-hand side."""
    places = [plan.routes.before + plan.routes.stride * side for side in range(len(plan.turns))] if routed else []
    return [block.loads(place, k) for place in places] or [None] * len(plan.turns)


def given_loads(block: Block, element: TracedElement, plan: Plan) -> tuple[Any, Any] | None:
    """Return the rates of the force on the tip and of the loads on the unknowns of an element, where they are given."""
    tip = plan.tip
    if tip is None or not tip.given:
        return None
    loads = block.loads(tip.loads - plan.layout.unknown, len(element.moving), "q")
    return vector(block.loads(tip.base_force, 3)), vector(loads)


def follow_motor(block: Block, result: InwardPass, tip: TipLayout) -> None:
    """Hand on what the given motion of a motor does to the elements nearer to the base, beyond it in balance."""
    beyond, n = result.beyond, len(result.beyond.matrix)
    twist, bend = resized(result.motion.twists[:, 0], n), resized(result.motion.bends[:, 0], n)
    column = beyond.columns[1] - (bend + beyond.matrix @ twist) * block.load(tip.motions, "q")
    result.beyond = replace(beyond, columns=[beyond.columns[0], column])


def store_tip_step(
    step_pass: Block, back: Block, result: InwardPass, plan: Plan, tip: TipLayout, multipliers: int, routed: bool
) -> list[Expression]:
    """Trace the response of an element to a force on the tip; for a motor, its column of the Jacobian so far."""
    layout = plan.layout
    turn_loads = [step_pass.loads(place, 3 + multipliers) for place in plan.turns]
    bend_loads = [step_pass.loads(tip.bends + 3 * row, 3) for row in range(tip.rows)]
    before = before_by_lengths(step_pass, plan, len(result.gradient), routed)
    moves = result.motion.moves
    moved_loads = step_pass.loads(tip.moved, 3) if tip.given else []
    if tip.given:
        moving = vector([step_pass.load(tip.motions, "q")])
        if result.eliminated is not None:
            moving = result.eliminated.steps(1, vector(turn_loads[1]), before[1])
        step_pass.store_all(tip.moved, (vector(moved_loads) + moves @ moving).tolist())
        moves = (vector(back.loads(tip.base_force, 3)) @ moves).reshape(1, -1)
    if result.eliminated is None:
        twist, bend = result.motion.twists[:, 0], result.motion.bends[:, 0]
        back.store(tip.motor_torques, result.motion.torque[0], "q")
        for axis, (nearer, turn) in enumerate(zip(bend_loads, turn_loads[1:], strict=True)):
            follow = moves[axis, 0] - twist @ vector(nearer) + bend @ vector(turn[:3])
            step_pass.store(tip.jacobian + axis * tip.motors, follow, "q")
        for axis, value in enumerate(twist):
            back.store(tip.twists + axis * tip.motors, value, "q")
        if tip.given:
            step_pass.store_all(plan.turns[1], (vector(turn_loads[1][:3]) + twist * moving[0]).tolist())
    else:
        steps = [result.eliminated.steps(side, vector(turn), before[side]) for side, turn in enumerate(turn_loads)]
        for place, turn, step in zip(plan.turns, turn_loads, steps, strict=True):
            step_pass.store_all(place, (vector(turn) + result.twists @ step)[:3].tolist())
        for axis, (nearer, step) in enumerate(zip(bend_loads, steps[1:], strict=True)):
            step_pass.store_all(tip.tip_columns + axis * tip.unknowns - layout.unknown, step.tolist(), "q")
            step_pass.store_all(tip.bends + 3 * axis, (vector(nearer) + result.motion.bends @ step).tolist())
    return [one for part in (*turn_loads, *bend_loads, *before, moved_loads) for one in part or ()]
