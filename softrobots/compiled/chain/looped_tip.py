r"""Response of the tip of a looped chain in equilibrium to the motors, the constrained sums and a force.

The loops of `softrobots.compiled.chain.looped_chain` with tip columns, and straight-line functions around them. With the
columns `X = K^-1 J_k^T` the elastostatic Jacobian of a motor `m` is (`softrobots.compiled.chain.tip_motion`)

.. math:: E_m = J_m + \omega_m \cdot \sum_{k\,beyond} c_k X_k + c_m \cdot \varphi_m

The sum beyond a motor is known at the end of the step pass; until then minus the sum up to the motor is stored.

Constrained sums `A s = b` have multipliers: `K s' + A^T \lambda = ...`. Those of the balance are loads on the sums, those of
the three tip columns the derivative of the tip with respect to them: from `K X + A^T \Lambda = J_k^T`, `A X = 0` and
`K s' + A^T \lambda' = 0`, `A s' = b'` it follows that `J_k s' = \Lambda^T b'`.
"""

from __future__ import annotations

from softrobots.compiled.chain.elements import Load, Motion, vector
from softrobots.compiled.chain.elimination import Outboard
from softrobots.compiled.chain.layout import RecursionLayout, TipLayout
from softrobots.compiled.chain.looped_elements import leading_elements
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.recursion import Balance, inward
from softrobots.compiled.chain.unrolled_chain import seen_backwards
from softrobots.compiled.trace.blocks import Block

CONTROL = '''def look_at_tip(w: Array) -> None:
    """Find the response of the tip to motors, constrained sums and a force, at an equilibrium."""
    start_outward(w)
    outward_tip_all(w)
    start_inward(w)
    start_inward_tip(w)
    inward_tip_all(w)
    step_tip_all(w)
    finish_tip(w)
    for i in range(N):
        finish_column(w, i)'''
"""Function that makes all passes."""


def tip_frame(plan: Plan, tip: TipLayout) -> list[Block]:
    """Trace the straight-line functions around the loops."""
    return [_start_inward_tip(tip), _finish(plan, tip), _finish_column(plan.recursion, tip)]


def _start_inward_tip(tip: TipLayout) -> Block:
    block = Block("start_inward_tip", "Clear the sums of the tip columns.")
    block.store_all(tip.column, [0.0] * (tip.end - tip.column))
    return block


def _finish(plan: Plan, tip: TipLayout) -> Block:
    """Add the sums beyond each motor, pass the leading motors, and turn all into world axes."""
    block = Block("finish_tip", "Compute the response to motors and constrained sums from the sums of the passes.")
    axes = vector(block.loads(plan.recursion.base, 9)).reshape(3, 3)
    total = vector(block.loads(tip.bends, 9)).reshape(3, 3)
    jacobian = {}
    for motor, motion in leading_motors(plan, block):
        jacobian[motor] = motion.moves[:, 0] + total @ motion.twists[:, 0]
        block.store(tip.motor_torques + motor, motion.torque[0])
    for motor in set(range(tip.motors)) - set(jacobian):
        places = [axis * tip.motors + motor for axis in range(3)]
        known, twist = ([block.load(first + place) for place in places] for first in (tip.jacobian, tip.twists))
        jacobian[motor] = vector(known) + total @ vector(twist)
    for motor, column in jacobian.items():
        for axis, value in enumerate((axes @ column).tolist()):
            block.store(tip.jacobian + axis * tip.motors + motor, value)
    for group in range(tip.n_constraints):
        column = vector([block.load(tip.constraint_columns + axis * tip.n_constraints + group) for axis in range(3)])
        for axis, value in enumerate((axes @ column).tolist()):
            block.store(tip.constraint_columns + axis * tip.n_constraints + group, value)
    return block


def leading_motors(plan: Plan, block: Block) -> list[tuple[int, Motion]]:
    """Return number and motion of each leading motor, from the tip on; the loads are those behind the inward pass."""
    unknowns, recursion = plan.unknowns, plan.recursion
    leading, loads = leading_elements(plan, block), []
    motors = [motor for row in range(len(leading)) if (motor := unknowns.motor(row)) is not None]
    for place in (0, 3) if plan.weight else (0,):
        force, lever = block.loads(recursion.force + place, 3), block.loads(recursion.lever + place, 3)
        loads.append(Load(vector(force), vector(lever), 1.0))
    found = []
    for element, outward_pass, motor in zip(leading[::-1], seen_backwards(leading)[::-1], motors[::-1], strict=True):
        inward_pass = inward(element, outward_pass, loads, Outboard.tip(1), Balance())
        loads = inward_pass.loads
        found.append((motor, inward_pass.motion))
    return found


def _finish_column(recursion: RecursionLayout, tip: TipLayout) -> Block:
    block = Block("finish_column", "Turn the tip column of an unknown into world axes.", ("i",))
    axes = vector(block.loads(recursion.base, 9)).reshape(3, 3)
    column = vector([block.load(tip.tip_columns + axis * tip.unknowns, "i") for axis in range(3)])
    for axis, value in enumerate((axes @ column).tolist()):
        block.store(tip.tip_columns + axis * tip.unknowns, value, "i")
    return block
