r"""Articulated inertia of a group of joints and of all bodies beyond, traced: the equations of motion solved in linear time.

The matrix of a Newton step of implicit time stepping, `A = M + h/2 D + h^2/4 K`, is a mass matrix with inertias on the
coordinates themselves. So its equations are solved from the tip to the base by articulated bodies (Featherstone, Rigid Body
Dynamics Algorithms, 2008, chapter 7): the bodies beyond a group of joints answer an acceleration of its base with a force as
one rigid body would, with an inertia of 6 x 6. With the inertia `C_j` of the bodies beyond joint `j` of a group, its axis
`s_j`, and the derivatives `m'` of the joint positions by the coordinates,

.. math:: U = \sum_j (C_j s_j + \tfrac{h^2}4 c_j) m'_j, \quad
    G = m'^T [s_i^T (C_j s_j + \tfrac{h^2}4 c_j)]_{i \le j}\, m' + \tfrac h2 D + \tfrac{h^2}4 K

and the group hands on `I - U G^{-1} U^T`. The moments `c_j` are how forces that keep their direction change the torque of a
joint where all nearer to the base turns, as in `softrobots.compiled.chain.elements`. Forces of the bodies nearly do, and with
this part of the stiffness the corrections of a step shrink by a factor of a thousand each instead of fifty.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, outer, skew, symmetric, upper_triangle, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, eliminate
from softrobots.compiled.motion.group_record import GroupRecord
from softrobots.compiled.motion.moving_joints import RigidBody
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar


@dataclass
class JointLine:
    """A joint and the body behind it, in the axes and at the origin of the frame behind it."""

    axis: Vector
    """Its axis."""
    shift: Vector | None
    """How far it moves the origin [m]; None if it turns."""
    axes: Any
    """Axes of the frame, shape (3, 3); of a round body only the one axis is used."""
    body: RigidBody
    """The body."""
    force: Vector
    """Force that moves the body, shape (3,) [N]."""

    def load(self, wrench: Vector) -> Scalar:
        """Return the part that the joint feels of a moment and force about the origin, shape (6,)."""
        return self.axis @ (wrench[:3] if self.shift is None else wrench[3:])  # type: ignore[no-any-return]


class GroupMotion(NamedTuple):
    """What the outward pass of a group leaves in its record."""

    joints: list[JointLine]
    """Its joints, base to tip; axes of their frames are not kept."""
    wrenches: list[Vector]
    """Moment and force that move the body behind each joint, shape (6,)."""
    reach: Vector
    """From its end to the next group [m]."""
    slopes: Any
    """Derivatives of the joint positions by the unknowns, shape (n, m)."""
    torques: Any
    """Torque of spring, damper and muscles on each unknown (m)."""

    def at(self, record: GroupRecord, block: Block, stage: int) -> GroupMotion:
        """Return the same at one of the stages."""
        at = partial(record.at, block, stage=stage)
        joints = []
        for one in self.joints:
            shift = None if one.shift is None else at(one.shift)
            joints.append(JointLine(at(one.axis), shift, at(one.axes), one.body, at(one.force)))
        return GroupMotion(joints, self.wrenches, at(self.reach), at(self.slopes), self.torques)


def inertia_of(body: RigidBody, axes: Any) -> Any:
    """Return the inertia of a body, shape (6, 6), angular part first."""
    lever, linear = skew(axes @ body.moment), constants(np.eye(3)) * body.mass
    return np.block([[body.turned(axes), lever], [-lever, linear]])


def at_stages(move: Callable[[Vector, Vector], Vector], values: Vector, by: Sequence[Vector]) -> Vector:
    """Return the wrenches or accelerations of all stages, shape (6 k,), moved `by` a vector at each stage (k)."""
    return np.concatenate([move(values[6 * stage : 6 * stage + 6], one) for stage, one in enumerate(by)])


def moved_wrench(wrench: Vector, by: Vector) -> Vector:
    """Return a moment and force, shape (6,), about a point that is `by` nearer to the base."""
    return np.concatenate([wrench[:3] + cross(by, wrench[3:]), wrench[3:]])


def moved_acceleration(acceleration: Vector, by: Vector) -> Vector:
    """Return an angular and a linear acceleration, shape (6,), at a point that is `by` nearer to the tip."""
    return np.concatenate([acceleration[:3], acceleration[3:] + cross(acceleration[:3], by)])


def moved_inertia(inertia: Any, by: Vector) -> Any:
    """Return an inertia, shape (6, 6), about a point that is `by` nearer to the base."""
    lever, linear = skew(by), inertia[3:, 3:]
    mixed = inertia[:3, 3:] + lever @ linear
    angular = inertia[:3, :3] - mixed @ lever + lever @ inertia[3:, :3]
    angular = symmetric([angular[index] for index in upper_triangle(3)], 3)  # its halves are rounded differently
    return np.block([[angular, mixed], [mixed.T, linear]])


@dataclass
class ArticulatedGroup:
    """Factors of a group of joints."""

    eliminated: Eliminated
    """Elimination of its coordinates."""
    gain: Any
    """`D^-1 L^-1 U^T` of the factors `G = L D L^T`, shape (k m, 6 k)."""
    motions: Any
    """Angular and linear velocity at its end per coordinate, shape (6 k, k m)."""
    shift: list[Vector]
    """From its first joint to its end [m], at each stage (k)."""
    reach: list[Vector]
    """From there to the next group [m], at each stage (k)."""


@dataclass
class Pull:
    """Forces on bodies, seen from a point nearer to the base."""

    force: Vector
    """Their sum, shape (3,) [N]."""
    spread: Any
    """Sum of the products of lever and force, shape (3, 3) [N m]."""

    def with_force(self, force: Vector, lever: Vector) -> Pull:
        """Return the same with another force."""
        return Pull(self.force + force, self.spread + outer(lever, force))

    def moved(self, by: Vector) -> Pull:
        """Return the same from a point that is `by` nearer to the base."""
        return Pull(self.force, self.spread + outer(by, self.force))

    def bend(self, joint: JointLine) -> Vector:
        """Return the derivative of the torque of a joint by a turn of all nearer to the base, shape (3,)."""
        if joint.shift is not None:
            return cross(joint.axis, self.force)
        return self.spread @ joint.axis - joint.axis * sum(np.diag(self.spread), 0.0)


def articulate(inertia: Any, pull: Pull, motion: GroupMotion, own: Any, quarter: Scalar) -> tuple[ArticulatedGroup, Any, Pull]:
    """Eliminate the coordinates of a group of joints.

    Args:
        inertia: Inertia of all beyond, about the origin of the next group, shape (6, 6).
        pull: Forces on all beyond, from there.
        motion: The group.
        own: `h/2 D + h^2/4 K` of the coordinates themselves, with that of tensions along the group, shape (m, m).
        quarter: `h^2/4` [s^2].

    Returns:
        The factors, and inertia and forces from the origin of the group.
    """
    n, m = motion.slopes.shape
    inertia, pull = moved_inertia(inertia, motion.reach), pull.moved(motion.reach)
    shift = constants(np.zeros(3))
    motions = constants(np.zeros((6, n)))  # angular and linear velocity of the end by each joint
    pushes = motions.copy()  # moment and force by its acceleration, and by the turn of all nearer to the base
    products = constants(np.zeros((n, n)))
    for number in reversed(range(n)):
        joint = motion.joints[number]
        inertia = inertia + inertia_of(joint.body, joint.axes)
        pull = pull.with_force(joint.force, joint.axes @ joint.body.centre)
        turns = slice(3) if joint.shift is None else slice(3, 6)
        pushes[:, number] = inertia[:, turns] @ joint.axis
        pushes[:3, number] += pull.bend(joint) * quarter
        motions[turns, number] = joint.axis
        if joint.shift is None:
            motions[3:, number] = cross(joint.axis, shift)
        for place in range(number, n):
            products[number, place] = products[place, number] = joint.load(pushes[:, place])
        if joint.shift is not None:
            inertia, pull, shift = moved_inertia(inertia, joint.shift), pull.moved(joint.shift), shift + joint.shift
            pushes = np.stack([moved_wrench(push, joint.shift) for push in pushes.T], axis=1)
    slopes = motion.slopes
    block, none = slopes.T @ (products @ slopes) + own, constants(np.zeros((6, m)))
    eliminated, rest = eliminate(Outboard(-inertia, [], 1.0, 0.0), none, -(pushes @ slopes), block, [], [1.0] * m)
    gain = eliminated.coupling * vector(eliminated.inverse_pivots)[:, None]
    return ArticulatedGroup(eliminated, gain, motions @ slopes, [shift], [motion.reach]), -rest.matrix, pull


def carried_inward(group: ArticulatedGroup, gradient: Sequence[Scalar], beyond: Vector) -> tuple[list[Scalar], Vector]:
    """Take the torques out of balance on a group to its base.

    Args:
        group: Its factors.
        gradient: The torque out of balance on each coordinate at all stages (k m), negative at the second.
        beyond: Sum `s` of the elimination at the next group, shape (6 k,).

    Returns:
        What the coordinates yield to them, and `s` at the origin of the group.
    """
    factors, beyond = group.eliminated, at_stages(moved_wrench, beyond, group.reach)
    values = [value + group.motions[:, place] @ beyond for place, value in enumerate(gradient)]
    total = at_stages(moved_wrench, beyond, group.shift)
    reduced = factors.reduced(values)
    for gain, value in zip(group.gain, reduced, strict=True):
        total = total + gain * value
    return [value * inverse for value, inverse in zip(reduced, factors.inverse_pivots, strict=True)], total


def carried_outward(group: ArticulatedGroup, yielded: Vector, before: Vector) -> tuple[Vector, Vector]:
    """Return the corrections of the coordinates of a group, and the acceleration of the next that they give, shape (6 k,)."""
    after = at_stages(moved_acceleration, before, group.shift)
    first = len(before) // 2  # two sums, as each addition waits for the one before it
    turned = group.gain[:, :first] @ before[:first] + group.gain[:, first:] @ before[first:]
    steps = group.eliminated.raised(turned - yielded)
    return steps, at_stages(moved_acceleration, after + group.motions @ steps, group.reach)
