r"""Response of a looped chain in equilibrium to given rates of loads, motors and held sums, and with it derivatives both ways.

The loops of `softrobots.compiled.chain.looped_chain` with one more right-hand side, and straight-line functions around them. At
an equilibrium with the tangent stiffness `K`, rates `h` of loads on the unknowns and `f` of the force on the tip, motions
:math:`\dot m` of motors and changes :math:`\dot b` of constrained sums `A s = b` give

.. math:: K x + A^T \Lambda = h + J^T f - K_m \dot m, \quad A x = \dot b

The steps `x` make the tip move by `J x + J_m m'`, and the loads on motors change. The system is symmetric, so it serves both
modes: forwards `h, f, m', b'` are those of the inputs. In reverse, with the weights of unknowns and tip as `h` and `f`, the
motion of the tip is the weight of the force, the change of the load on a motor that of the motor, and :math:`\Lambda` that of
the sums.

Motors that are given motions are elements whose step is known: they turn what is beyond them, and hand on what that does.
"""

from __future__ import annotations

from softrobots.compiled.chain.elements import constants, vector
from softrobots.compiled.chain.layout import TipLayout
from softrobots.compiled.chain.looped_elements import leading_elements
from softrobots.compiled.chain.looped_tip import leading_motors
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unrolled_chain import seen_backwards
from softrobots.compiled.trace.blocks import Block

CONTROL = '''def pass_given_SUFFIX(w: Array) -> None:
    """Find the response at known multipliers of the balance, and these."""
    start_outward_SUFFIX(w)
    outward_all_SUFFIX(w)
    start_inward_SUFFIX(w)
    start_turn_SUFFIX(w)
    inward_all_SUFFIX(w)
    step_all_SUFFIX(w)


def respond_SUFFIX(w: Array) -> None:
    """Find the response to given rates, at an equilibrium."""
    prepare_SUFFIX(w)
    start_given_SUFFIX(w)
    if N_CONSTRAINTS > 0:
        pass_given_SUFFIX(w)
        for i in range(N_CONSTRAINTS):
            hold_SUFFIX(w, i)
    pass_given_SUFFIX(w)
    finish_given_SUFFIX(w)'''
"""Function that makes all passes.

The tangent stiffness depends on the multipliers of the balance. They are those of a first pass: where no step is needed they do
not depend on the tangent.
"""


def response_frame(plan: Plan, tip: TipLayout) -> list[Block]:
    """Trace the straight-line functions around the loops."""
    hold = Block("hold", "Take the multiplier of a sum that is constrained.", ("i",))
    hold.store(plan.layout.held, hold.load(tip.constraint_loads, "i"), "i")
    return [_start(plan, tip), _start_turn(plan, tip), hold, _finish(plan, tip)]


def _start(plan: Plan, tip: TipLayout) -> Block:
    block = Block("start_given", "Turn the rate of the force into the axes behind the leading motors.")
    axes = vector(block.loads(plan.recursion.base, 9)).reshape(3, 3)
    block.store_all(tip.base_force, (axes.T @ vector(block.loads(tip.force, 3))).tolist())
    return block


def _start_turn(plan: Plan, tip: TipLayout) -> Block:
    block = Block("start_turn", "Clear the sums of the given right-hand side, and turn all by the leading motors.")
    block.store_all(tip.column, [0.0] * (tip.base_force - tip.column))
    leading = leading_elements(plan, block)
    turn = constants([0.0, 0.0, 0.0])
    for row, (element, outward_pass) in enumerate(zip(leading, seen_backwards(leading), strict=True)):
        if element.kind == "turn":
            turn = turn + outward_pass.start[:, 2] * block.load(tip.motions + (plan.unknowns.motor(row) or 0))
    block.store_all(tip.turn, turn.tolist())
    return block


def _finish(plan: Plan, tip: TipLayout) -> Block:
    """Add the sums beyond each motor, pass the leading motors, and turn the motion of the tip into world axes."""
    block = Block("finish_given", "Compute the loads on motors, their changes, and the motion of the tip.")
    axes = vector(block.loads(plan.recursion.base, 9)).reshape(3, 3)
    force, total = vector(block.loads(tip.base_force, 3)), vector(block.loads(tip.bends, 3))
    moved, jacobian = vector(block.loads(tip.moved, 3)), {}
    for motor, motion in leading_motors(plan, block):
        jacobian[motor] = force @ motion.moves[:, 0] + total @ motion.twists[:, 0]
        block.store(tip.motor_torques + motor, motion.torque[0])
        moved = moved + motion.moves[:, 0] * block.load(tip.motions + motor)
    for motor in set(range(tip.motors)) - set(jacobian):
        twist = [block.load(tip.twists + axis * tip.motors + motor) for axis in range(3)]
        jacobian[motor] = block.load(tip.jacobian + motor) + total @ vector(twist)
    for motor, value in jacobian.items():
        block.store(tip.jacobian + motor, value)
    block.store_all(tip.moved, (axes @ moved).tolist())
    return block
