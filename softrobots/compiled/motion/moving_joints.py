r"""Motion of joints and sections with the bodies on them, traced: outward kinematics, forces of the bodies.

All vectors are in one set of axes that do not turn, with the origin of a frame as the point of reference: accelerations by
the recursion of Luh, Walker and Paul (1980, J. Dyn. Sys. Meas. Control 102, 69), gravity as an upward
acceleration of the base.

A section of constant strain moves as its six joints (`softrobots.constant_curvature.strain_chain`), whose rates follow from the
velocity of the chord and the angular velocity of the end. With the section coordinates `z`, the screw motion gives both as
`S(z) zd` and the accelerations as `S zdd + b(z, zd)`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Screw, Vector, constants, cross, is_zero, matrix, outer, vector
from softrobots.compiled.trace.expressions import Expression, Scalar, cosine, sine, square_root

SECTION_AXES = (0, 1, 2, 0, 1, 2)
"""Axis of each joint of a section: x, y, z."""


class RigidBody(NamedTuple):
    """A rigid body fixed to a frame; numbers are constants or table entries."""

    mass: Scalar
    """Mass [kg]."""
    moment: Vector
    """First moment in the axes of the frame, shape (3,) [kg m]."""
    inertia: Any
    """Rotational inertia about the origin in these axes, less the round part, shape (3, 3) [kg m^2]."""
    round_axis: int
    """Axis of the frame about which the round part is."""
    across: Scalar
    """Its inertia about the other axes [kg m^2]."""
    along: Scalar
    """How much larger it is about that axis [kg m^2]."""
    centre: Vector
    """Centre of mass in the axes of the frame, shape (3,) [m]; zero without mass."""

    def turned(self, axes: Any) -> Any:
        """Return the rotational inertia in the axes in which those of the frame are given, shape (3, 3)."""
        n = axes[:, self.round_axis]
        return constants(np.eye(3)) * self.across + outer(n, n) * self.along + axes @ self.inertia @ axes.T

    @property
    def is_rod(self) -> bool:
        """Whether it is round about an axis through its centre of mass, as a straight rod with the origin on it."""
        aside = [self.moment[axis] for axis in range(3) if axis != self.round_axis]
        return all(is_zero(one) for one in (*self.inertia.ravel(), *aside))

    @property
    def needed_axes(self) -> list[int]:
        """The axes of the frame that matter."""
        if any(not is_zero(one) for one in self.inertia.ravel()):
            return [0, 1, 2]
        return [
            axis for axis in range(3) if not is_zero(self.moment[axis]) or (axis == self.round_axis and not is_zero(self.along))
        ]


class CompositeBody(NamedTuple):
    """A rigid body, or several that move as one, seen from a frame."""

    mass: Scalar
    """Mass [kg]."""
    moment: Vector
    """First moment, shape (3,) [kg m]."""
    inertia: Any
    """Rotational inertia about the origin, shape (3, 3) [kg m^2]."""

    def __add__(self, other: Any) -> CompositeBody:
        return CompositeBody(self.mass + other.mass, self.moment + other.moment, self.inertia + other.inertia)

    def seen_from(self, axes: Any, origin: Vector) -> CompositeBody:
        """Return the bodies in the frame in which theirs has given axes, shape (3, 3), and origin, shape (3,) [m].

        With `c` the first moment and `p` the origin, `I' = R I R^T - p^ c^ - c^ p^ - m p^ p^`, where `v^ w = v x w`.
        """
        moment, inertia = axes @ self.moment, axes @ self.inertia @ axes.T
        shifted = 2.0 * (origin @ moment) + self.mass * (origin @ origin)
        mixed = outer(origin, moment + origin * (self.mass * 0.5))
        inertia = inertia + np.eye(3) * shifted - mixed - mixed.T
        return CompositeBody(self.mass, moment + origin * self.mass, inertia)


def round_part(inertia: Any) -> tuple[int, float, float] | None:
    """Return axis, inertia across it, and how much more there is about it; None if a body is not round."""
    diagonal = np.diag(inertia)
    small = 1e-14 * float(np.abs(diagonal).max())
    if np.abs(inertia - np.diag(diagonal)).max() <= small:
        for axis in range(3):
            across, other = diagonal[axis - 1], diagonal[axis - 2]
            if abs(across - other) <= small:
                return axis, float(across), float(diagonal[axis] - across)
    return None


@dataclass
class MovingFrame:
    """A frame that moves, in axes that do not turn."""

    axes: Any
    """Its axes, shape (3, 3)."""
    spin: Vector
    """Its angular velocity [rad/s]."""
    turning: Vector
    """Its angular acceleration [rad/s^2]."""
    lift: Vector
    """Acceleration of its origin, less gravity [m/s^2]."""
    swings: dict[tuple[float, ...], tuple[Vector, Vector]] = field(default_factory=dict)
    """Velocity and acceleration of unit vectors that the last joint does not turn, by the numbers of their expressions."""

    def swing(self, direction: Vector) -> tuple[Vector, Vector]:
        """Return velocity and acceleration of a unit vector that moves with the frame."""
        numbers, opposite = _numbers(direction), _numbers(-direction)
        if opposite < numbers:  # one of the two, so that a vector and its opposite share their expressions
            velocity, acceleration = self.swing(-direction)
            return -velocity, -acceleration
        if numbers not in self.swings:
            velocity = cross(self.spin, direction)
            self.swings[numbers] = velocity, cross(self.turning, direction) + cross(self.spin, velocity)
        return self.swings[numbers]

    def shifted(self, axes: Any, by: Sequence[Scalar]) -> MovingFrame:
        """Return the same axes at another origin that moves with them, at coordinates `by` along given ones of these axes."""
        lift = self.lift
        for axis, distance in zip(axes, by, strict=True):
            if not is_zero(distance):
                lift = lift + self.swing(self.axes[:, axis])[1] * distance
        return replace(self, lift=lift)


class JointState(NamedTuple):
    """A joint at its coordinate, before its frame: about or along an axis of the frame."""

    axis: int
    """Number of the axis: x, y or z."""
    offset: Scalar | None
    """How far it slides [m]; None if it turns."""
    cosine: Scalar
    """Cosine of its angle."""
    sine: Scalar
    """Sine of its angle."""
    rate: Scalar
    """Its velocity."""
    change: Scalar
    """Its acceleration."""


def joint_state(slides: bool, coordinate: Scalar, rate: Scalar, change: Scalar) -> JointState:
    """Return the state of a joint about, or along, the z axis of its frame."""
    if slides:
        return JointState(2, coordinate, 1.0, 0.0, rate, change)
    return JointState(2, None, cosine(coordinate), sine(coordinate), rate, change)


def moved(frame: MovingFrame, joint: JointState) -> tuple[MovingFrame, Vector, Vector | None]:
    """Return the frame behind a joint, the axis of the joint, and how far the joint moves the origin (None: it turns)."""
    axis = frame.axes[:, joint.axis]
    velocity = axis * joint.rate
    swing = cross(frame.spin, velocity)
    if joint.offset is not None:
        shift = axis * joint.offset
        behind = frame.shifted([joint.axis], [joint.offset])
        return replace(behind, lift=behind.lift + swing * 2.0 + axis * joint.change), axis, shift
    one, other = (joint.axis + 1) % 3, (joint.axis + 2) % 3
    axes = frame.axes.copy()
    axes[:, one] = frame.axes[:, one] * joint.cosine + frame.axes[:, other] * joint.sine
    axes[:, other] = frame.axes[:, other] * joint.cosine - frame.axes[:, one] * joint.sine
    behind = MovingFrame(axes, frame.spin + velocity, frame.turning + swing + axis * joint.change, frame.lift)
    frame.swing(axis)
    behind.swings |= {key: frame.swings[key] for key in (_numbers(axis), _numbers(-axis)) if key in frame.swings}
    return behind, axis, None


def _numbers(direction: Vector) -> tuple[float, ...]:
    """Return what tells a vector from others."""
    return tuple(one.number if isinstance(one, Expression) else -3.0 - one for one in direction)


def wrench(frame: MovingFrame, body: RigidBody) -> tuple[Vector, Vector]:
    r"""Return force and moment about the origin that move a body as its frame moves [N], [N m].

    For a rod along the unit vector `n`, with first moment `b` and inertias :math:`I_t` across and :math:`I_a` along it

    .. math:: f = m a + b \ddot n, \quad
        \tau = n \times (I_t \ddot n + b a) + I_a (n (n \cdot \dot\omega) + \dot n (n \cdot \omega))
    """
    if body.is_rod:
        n, first = frame.axes[:, body.round_axis], body.moment[body.round_axis]
        if _numbers(-n) < _numbers(n):
            n, first = -n, -first
        velocity, acceleration = frame.swing(n)
        axial = n * (n @ frame.turning) + velocity * (n @ frame.spin)
        turn = cross(n, acceleration) * body.across + axial * (body.across + body.along)
        return frame.lift * body.mass + acceleration * first, turn + cross(n, frame.lift) * first
    moment, inertia = frame.axes @ body.moment, body.turned(frame.axes)
    force = frame.lift * body.mass + cross(frame.turning, moment) + cross(frame.spin, cross(frame.spin, moment))
    return force, inertia @ frame.turning + cross(frame.spin, inertia @ frame.spin) + cross(moment, frame.lift)


class SectionState:
    """The six joints of a section at section coordinates, with their rates."""

    def __init__(self, z: Sequence[Scalar], rates: Sequence[Scalar], changes: Sequence[Scalar], length: Scalar) -> None:
        """Evaluate the joints at section coordinates, velocities and accelerations (4), and rest length [m]."""
        self.screw = motion = Screw(z, length)
        """Its screw motion."""
        self._chord_axes(motion)
        lift, turning = motion.accelerations(rates)
        back = self._chord.T
        slopes, twists = motion.slopes()
        self.slopes = np.array([self._rates(back @ slopes[:, j], back @ twists[:, j]) for j in range(4)], dtype=object).T
        """Derivatives of the joint positions by the section coordinates, shape (6, 4)."""
        joint_rates = self.slopes @ vector(rates)
        own_lift, own_turning = self._own_accelerations(joint_rates)
        bias = self._rates(back @ lift - own_lift, back @ turning - own_turning)
        self.joints = [
            JointState(axis, offset, cosine_, sine_, rate, change)
            for axis, offset, (cosine_, sine_), rate, change in zip(
                SECTION_AXES,
                (None, None, self._size, None, None, None),
                self._angles,
                joint_rates,
                self.slopes @ vector(changes) + bias,
                strict=True,
            )
        ]
        """The joints, base to tip."""

    def _chord_axes(self, motion: Screw) -> None:
        """Cosine and sine of each joint from the pose of the end."""
        x, y, z = motion.position
        across = square_root(y * y + z * z)
        self._size = size = square_root(x * x + y * y + z * z)
        aside, over = 1.0 / across, 1.0 / size
        first, second = (z * aside, -y * aside), (across * over, x * over)
        (c1, s1), (c2, s2) = first, second
        self._chord = matrix([[c2, 0.0, s2], [s1 * s2, c1, -s1 * c2], [-c1 * s2, s1, c1 * c2]])
        ball = self._chord.T @ motion.rotation
        flat = square_root(ball[1, 2] * ball[1, 2] + ball[2, 2] * ball[2, 2])
        low = 1.0 / flat
        third = (ball[2, 2] * low, -ball[1, 2] * low)
        self._angles = [first, second, (1.0, 0.0), third, (flat, ball[0, 2]), (ball[0, 0] * low, -ball[0, 1] * low)]

    def _rates(self, velocity: Vector, spin: Vector) -> Vector:
        """Rates of the joints from the velocity of the end and its angular velocity, in the axes of the chord, shape (6,)."""
        _, (c2, s2), _, (c4, s4), (c5, s5), _ = self._angles
        over = 1.0 / self._size
        u1, u2 = -velocity[1] * (over / c2), velocity[0] * over
        x, y, z = spin - vector([u1 * c2, u2, u1 * s2])
        tilt = (z * c4 - y * s4) * (1.0 / c5)
        return vector([u1, u2, velocity[2], x - s5 * tilt, y * c4 + z * s4, tilt])

    def _own_accelerations(self, rates: Vector) -> tuple[Vector, Vector]:
        """Accelerations of the end at constant rates of the joints, in the axes of the chord: linear, angular."""
        _, (c2, s2), _, (c4, s4), (c5, s5), _ = self._angles
        u1, u2, slide, *ball = rates
        spin = vector([u1 * c2, u2, u1 * s2])
        turning = vector([-s2, 0.0, c2]) * (u1 * u2)
        chord = vector([0.0, 0.0, self._size])
        lift = cross(spin, vector([0.0, 0.0, slide * 2.0])) + cross(turning, chord) + cross(spin, cross(spin, chord))
        for axis, rate in zip(([1.0, 0.0, 0.0], [0.0, c4, s4], [s5, -s4 * c5, c4 * c5]), ball, strict=True):
            own = vector(axis) * rate
            turning = turning + cross(spin, own)
            spin = spin + own
        return lift, turning
