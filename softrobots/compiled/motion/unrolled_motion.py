r"""Equations of motion of an unrolled chain, traced: the residual by Newton and Euler, the mass matrix by composite bodies.

The residual of the free coordinates, with forces from the recursion of Luh, Walker and Paul (1980, J. Dyn. Sys. Meas. Control
102, 69) in the axes of each element, gravity as an acceleration of the base upwards, and the torques of springs and dampers,

.. math:: r = ID(y, \dot y, \ddot y) + dV/dy + D \dot y - J^T F

Its derivative by the acceleration of the implicit midpoint rule is, without what turns of the weight and velocities contribute,

.. math:: A = M + \tfrac h 2 D + \tfrac{h^2}{4} K

with the mass matrix M of composite bodies (Walker and Orin 1982, J. Dyn. Sys. Meas. Control 104, 205) and the springs' K.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, turned, turned_by, vector
from softrobots.compiled.chain.slack_hinges import with_slack_hinges
from softrobots.compiled.chain.traced_elements import TracedElement
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.moving_joints import CompositeBody
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar
from softrobots.model.serial_chain import bodies_of

_UP = constants([0.0, 0.0, 1.0])


class _Joint(NamedTuple):
    """An element at its coordinate."""

    element: TracedElement
    """Its constants and coordinate."""
    axes: Any
    """Its axes in those of the element before, shape (3, 3)."""
    origin: Vector
    """Its origin there, shape (3,) [m]."""
    body: CompositeBody
    """The body fixed to it."""

    @property
    def slides(self) -> bool:
        """Whether it slides rather than turns."""
        return self.element.kind == "slide"


State = Sequence[Sequence[Scalar]]
"""Unknowns, their velocities and their accelerations."""


def state_of(plan: MotionPlan, block: Block) -> State:
    """Return the state of the workspace."""
    layout = plan.layout
    return [block.loads(place, layout.unknowns) for place in (layout.unknown, layout.rate, layout.acceleration)]


def joints_of(plan: MotionPlan, block: Block, state: State, bends: Sequence[tuple[Scalar, Scalar]] = ()) -> list[_Joint]:
    """Return the elements at the motors of the workspace and the unknowns of a state; `bends`: their cosines and sines."""
    unknowns = plan.unknowns
    rows = range(len(unknowns.chain.elements))
    traced = [unknowns.traced(row, block.load, lambda place: state[0][place]) for row in rows]
    joints = []
    elements = with_slack_hinges(unknowns, traced, unknowns.chain)
    for row, (element, given) in enumerate(zip(elements, unknowns.chain.elements, strict=True)):
        (body,) = bodies_of(given)
        inertia = CompositeBody(float(body.mass), constants(body.first_moment), constants(body.inertia))
        axes, origin = element.rotation, element.translation
        if element.kind == "slide":
            origin = origin + axes[:, 2] * element.coordinates[0]
        elif bends and element.moving:
            axes = turned_by(axes, *bends[unknowns.place[unknowns.moving(row)[0]]])
        else:
            axes = turned(axes, element.coordinates[0])
        joints.append(_Joint(element, axes, origin, inertia))
    return joints


def tip_position(plan: MotionPlan, block: Block) -> list[Scalar]:
    """Return the tip at motors and unknowns of the workspace, world axes [m]."""
    tip = constants(plan.unknowns.chain.tip_translation)
    for joint in reversed(joints_of(plan, block, state_of(plan, block))):
        tip = joint.origin + joint.axes @ tip
    return list(tip)


def residual(plan: MotionPlan, block: Block, joints: Sequence[_Joint], state: State) -> list[Scalar]:
    """Return the torque out of balance on each unknown [N m or N]."""
    unknowns, layout = plan.unknowns, plan.layout
    chain = unknowns.chain
    spin, turning = constants(np.zeros(3)), constants(np.zeros(3))  # angular velocity and acceleration
    lift = -vector(block.loads(layout.gravity, 3))  # acceleration of the origin
    force = vector(block.loads(layout.force, 3))
    wrenches = []
    for row, joint in enumerate(joints):
        rate, change = _rates(plan, block, row, state)
        lift = lift + cross(turning, joint.origin) + cross(spin, cross(spin, joint.origin))
        spin, turning, lift, force = (joint.axes.T @ one for one in (spin, turning, lift, force))
        if joint.slides:
            lift = lift + cross(spin, _UP * rate) * 2.0 + _UP * change
        else:
            turning = turning + cross(spin, _UP * rate) + _UP * change
            spin = spin + _UP * rate
        mass, moment, inertia = joint.body
        push = lift * mass + cross(turning, moment) + cross(spin, cross(spin, moment))
        turn = inertia @ turning + cross(spin, inertia @ spin) + cross(moment, lift)
        wrenches.append((push, turn))
    push, turn = -force, cross(force, constants(chain.tip_translation))
    torques: list[list[Scalar]] = [[] for _ in joints]
    for row in reversed(range(len(joints))):
        joint = joints[row]
        push, turn = push + wrenches[row][0], turn + wrenches[row][1]
        if joint.element.moving:
            torques[row] = [(push if joint.slides else turn)[2] + _carried(joint.element)]
        push = joint.axes @ push
        turn = joint.axes @ turn + cross(joint.origin, push)
    total = unknowns.in_order(torques)
    rates, n = state[1], layout.unknowns
    if not layout.full_damping:
        return [one + block.load(layout.damping + row) * rates[row] for row, one in enumerate(total)]
    damping = [vector(block.loads(layout.damping + n * row, n)) for row in range(n)]
    return [one + damping[row] @ vector(rates) for row, one in enumerate(total)]


def newton_matrix(plan: MotionPlan, block: Block, joints: Sequence[_Joint]) -> Any:
    """Return `A`, shape (n, n)."""
    unknowns, layout = plan.unknowns, plan.layout
    n, (half, quarter) = layout.unknowns, plan.factors(block)
    place = {row: unknowns.place[unknowns.moving(row)[0]] for row, joint in enumerate(joints) if joint.element.moving}
    matrix = constants(np.zeros((n, n)))
    beyond = CompositeBody(0.0, constants(np.zeros(3)), constants(np.zeros((3, 3))))
    for row in reversed(range(len(joints))):
        if row < min(place):
            break
        joint = joints[row]
        beyond = joint.body + beyond
        if row in place:
            if joint.slides:
                push, turn = _UP * beyond.mass, cross(beyond.moment, _UP)
            else:
                push, turn = cross(_UP, beyond.moment), beyond.inertia[:, 2]
            for inner in range(row, min(place) - 1, -1):
                if inner in place:
                    entry = (push if joints[inner].slides else turn)[2]
                    matrix[place[row], place[inner]] = matrix[place[inner], place[row]] = entry
                push = joints[inner].axes @ push
                turn = joints[inner].axes @ turn + cross(joints[inner].origin, push)
        beyond = beyond.seen_from(joint.axes, joint.origin)
    for row, at in place.items():
        law = joints[row].element.law
        stiffness = joints[row].element.stiffness[0] if law is None else law.stiffness
        matrix[at, at] = matrix[at, at] + quarter * stiffness
        if law is not None and law.coupling is not None:  # with the inner spring of the hinge, the element before
            inner = place[row - 1]
            matrix[at, inner] = matrix[inner, at] = matrix[at, inner] + quarter * law.coupling
    for row in range(n):
        for column in range(n) if layout.full_damping else [row]:
            damping = block.load(layout.damping + (n * row + column if layout.full_damping else row))
            matrix[row, column] = matrix[row, column] + half * damping
    return matrix


def factored(matrix: Any) -> tuple[list[Scalar], list[list[Scalar]]]:
    """Return inverse pivots, and the rows of `L` of `A = L D L^T` to the left of the diagonal."""
    n = len(matrix)
    inverses: list[Scalar] = []
    lower: list[list[Scalar]] = []
    pivots: list[Scalar] = []
    for row in range(n):
        products: list[Scalar] = []  # L times D
        for column in range(row):
            shared = sum((products[k] * lower[column][k] for k in range(column)), 0.0)
            products.append(matrix[row, column] - shared)
        lower.append([product * inverse for product, inverse in zip(products, inverses, strict=True)])
        pivots.append(matrix[row, row] - sum((a * b for a, b in zip(products, lower[row], strict=True)), 0.0))
        inverses.append(1.0 / pivots[row])
    return inverses, lower


def solved(inverses: Sequence[Scalar], lower: Sequence[Sequence[Scalar]], side: Sequence[Scalar]) -> list[Scalar]:
    """Return `-A^-1 side`."""
    n = len(side)
    values: list[Scalar] = []
    for row in range(n):
        values.append(side[row] - sum((lower[row][k] * values[k] for k in range(row)), 0.0))
    values = [-(value * inverse) for value, inverse in zip(values, inverses, strict=True)]
    for row in reversed(range(n)):
        values[row] = values[row] - sum((lower[k][row] * values[k] for k in range(row + 1, n)), 0.0)
    return values


def _rates(plan: MotionPlan, block: Block, row: int, state: State) -> tuple[Scalar, Scalar]:
    """Return velocity and acceleration of an element's coordinate."""
    layout, motor = plan.layout, plan.unknowns.motor(row)
    if motor is not None:
        return block.load(layout.motor_velocities + motor), block.load(layout.motor_accelerations + motor)
    at = plan.unknowns.place[plan.unknowns.moving(row)[0]]
    return state[1][at], state[2][at]


def _carried(element: TracedElement) -> Scalar:
    """Return the torque of the spring of an element."""
    if element.law is not None:
        return element.law.torque
    return (element.coordinates[0] - element.rest[0]) * element.stiffness[0]
