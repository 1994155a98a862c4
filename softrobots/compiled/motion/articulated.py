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

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, outer, skew, symmetric, upper_triangle, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, eliminate
from softrobots.compiled.motion.moving_joints import RigidBody
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


def with_body(inertia: Any, body: RigidBody, axes: Any) -> Any:
    """Return an inertia, shape (6, 6), angular part first, with a body added."""
    lever, linear = skew(axes @ body.moment), constants(np.eye(3)) * body.mass
    return inertia + np.block([[body.turned(axes), lever], [-lever, linear]])


def moved_wrench(wrench: Vector, by: Vector) -> Vector:
    """Return a moment and force, shape (6,), about a point that is `by` nearer to the base."""
    return np.concatenate([wrench[:3] + cross(by, wrench[3:]), wrench[3:]])


def moved_acceleration(acceleration: Vector, by: Vector) -> Vector:
    """Return an angular and a linear acceleration, shape (6,), at a point that is `by` nearer to the tip."""
    return np.concatenate([acceleration[:3], acceleration[3:] + cross(acceleration[:3], by)])


def moved_inertia(inertia: Any, by: Vector) -> Any:
    """Return an inertia about a point that is `by` nearer to the base."""
    lever, linear, before = skew(by), inertia[3:, 3:], inertia[:3, 3:]
    mixed = before + lever @ linear
    angular = inertia[:3, :3] - mixed @ lever - (before @ lever).T
    angular = symmetric([angular[index] for index in upper_triangle(3)], 3)  # its halves are rounded differently
    return np.block([[angular, mixed], [mixed.T, linear]])


@dataclass
class ArticulatedGroup:
    """Factors of a group of joints."""

    eliminated: Eliminated
    """Elimination of its coordinates."""
    gain: Any
    """`G^-1 U^T`: what its coordinates yield to an acceleration of its base, shape (k, 6)."""
    motions: Any
    """Angular and linear velocity at its end per coordinate, shape (6, k)."""
    shift: Vector
    """From its first joint to its end [m]."""
    reach: Vector
    """From there to the next group [m]."""


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


def articulate(
    inertia: Any, pull: Pull, joints: list[JointLine], reach: Vector, slopes: Any, own: Any, quarter: Scalar
) -> tuple[ArticulatedGroup, Any, Pull]:
    """Eliminate the coordinates of a group of joints.

    Args:
        inertia: Inertia of all beyond, about the origin of the next group, shape (6, 6).
        pull: Forces on all beyond, from there.
        joints: The joints, base to tip.
        reach: From the end of the last joint to there [m].
        slopes: Derivatives of the joint positions by the coordinates, shape (n, k).
        own: `h/2 D + h^2/4 K` of the coordinates themselves, with that of tensions along the group, shape (k, k).
        quarter: `h^2/4` [s^2].

    Returns:
        The factors, and inertia and forces from the origin of the group.
    """
    inertia, pull, shift = moved_inertia(inertia, reach), pull.moved(reach), constants(np.zeros(3))
    motions: list[Vector] = []  # angular and linear velocity of the end by each joint
    pushes: list[Vector] = []  # moment and force by its acceleration, and by the turn of all nearer to the base
    products = constants(np.zeros((len(joints), len(joints))))
    for number in reversed(range(len(joints))):
        joint = joints[number]
        inertia = with_body(inertia, joint.body, joint.axes)
        pull = pull.with_force(joint.force, joint.axes @ joint.body.centre)
        if len(own):
            push = (inertia[:, :3] if joint.shift is None else inertia[:, 3:]) @ joint.axis
            turned = pull.bend(joint) * quarter
            pushes.insert(0, np.concatenate([push[:3] + turned, push[3:]]))
            for place, one in enumerate(pushes):
                products[number, number + place] = products[number + place, number] = joint.load(one)
            still = constants(np.zeros(3))
            motion = (joint.axis, cross(joint.axis, shift)) if joint.shift is None else (still, joint.axis)
            motions.insert(0, np.concatenate(motion))
        if joint.shift is not None:
            inertia, pull, shift = moved_inertia(inertia, joint.shift), pull.moved(joint.shift), shift + joint.shift
            pushes = [moved_wrench(push, joint.shift) for push in pushes]
    if not len(own):
        rigid = Eliminated(constants(np.eye(0)), [], constants(np.zeros((0, 6))), [])
        return ArticulatedGroup(rigid, rigid.coupling, constants(np.zeros((6, 0))), shift, reach), inertia, pull
    block = slopes.T @ (products @ slopes) + own
    bends = -(np.stack(pushes, axis=1) @ slopes)
    none = constants(np.zeros(bends.shape))
    eliminated, rest = eliminate(Outboard(-inertia, [], 1.0, 0.0), none, bends, block, [], [1.0] * len(own))
    gain = np.stack([eliminated.solved([*column]) for column in eliminated.coupling.T], axis=1)
    return ArticulatedGroup(eliminated, gain, np.stack(motions, axis=1) @ slopes, shift, reach), -rest.matrix, pull


def carried_inward(group: ArticulatedGroup, gradient: list[Scalar], beyond: Vector) -> tuple[list[Scalar], Vector]:
    """Take the torques out of balance on a group to its base.

    Args:
        group: Its factors.
        gradient: The torque out of balance on each coordinate (k).
        beyond: Sum `s` of the elimination at the next group, shape (6,).

    Returns:
        What the coordinates yield to them, and `s` at the origin of the group.
    """
    factors, beyond = group.eliminated, moved_wrench(beyond, group.reach)
    values = [value + group.motions[:, place] @ beyond for place, value in enumerate(gradient)]
    total = moved_wrench(beyond, group.shift)
    for gain, value in zip(group.gain, values, strict=True):
        total = total + gain * value
    return factors.solved(factors.reduced(values)), total


def carried_outward(group: ArticulatedGroup, yielded: Vector, before: Vector) -> tuple[Vector, Vector]:
    """Return the corrections of the coordinates of a group, and the acceleration of the next that they give, shape (6,)."""
    after = moved_acceleration(before, group.shift)
    if not len(yielded):
        return vector([]), moved_acceleration(after, group.reach)
    steps = group.gain @ before - yielded
    return steps, moved_acceleration(after + group.motions @ steps, group.reach)
