r"""Actuators as spatial tendons of MuJoCo: straight legs between sites on the links of a lumped chain.

A route is a sum over points (`softrobots.description.route_points`): at the offset `o` from the backbone, with the tangent `t`
per rest length at rest, for the share `f` of a section of rest length `h`. Where the hinge of the section turns by a small `w`
and stretches by `e`, its length is :math:`f |c + w \times o + e|` with :math:`c = h t`, as along a section of constant strain.

A leg from `o - c/2` on the link below the hinge to `o + c/2` on that above is a chord, too short by
:math:`(|c| + e) w^2 / 8`, and the tip of an arm with 30 hinges a segment is then off by a thousandth of its length. (A leg
from `o` to `o + c` has an error of first order in `h`.) A leg along the backbone, from `p c` on the link below back to `q c` on
that above, `p > q`, becomes shorter by `e`, and longer by :math:`p (q |c| + e) w^2 / (2 (p - q) - 2 e / |c|)`. So there are
both, where the hinge has the motion `H`:

.. math:: l = f g \bigl|H\bigl(\tfrac1g (o + \tfrac c2)\bigr) - \tfrac1g (o - \tfrac c2)\bigr|
          + f (g - 1) |H(q c) - p c|, \quad g = \tfrac12 + \tfrac1{\sqrt3}, \quad p = 2 + \sqrt3, \quad q = \sqrt3

(MuJoCo divides the lengths of branches by the divisors of pulleys). The stretch counts once, and these numbers cancel the terms
in :math:`w^2` and :math:`w^2 e`. The second leg is mirrored, from `-q c` to `-p c`, where the hinge stretches before it bends.
At rest the tendon is longer than the actuator by :math:`2 (g - 1)`, 15 % of it, which the laws of the actuators take away.
What remains falls like `1/n^2` with `n` hinges.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.description.rigid_tree import Joint
from softrobots.description.route_points import RoutePoint, route_points
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.export.prepared import PreparedRobot
from softrobots.export.slides import Piston, Winch, piston, winch
from softrobots.model.actuator_laws import input_limits, pull_factors
from softrobots.model.sections import SectionRow
from softrobots.model.soft_model import SoftModel

SPRINGY = ("elastic", "mckibben")
"""Kinds whose tension follows the length: welded, they are springs."""

_NEAR, _FAR = math.sqrt(3.0), 2.0 + math.sqrt(3.0)  # q and p
_CENTRAL = 1.0 / math.sqrt(3.0) - 0.5  # g - 1


class Leg(NamedTuple):
    """A straight piece of a tendon, from a site on the link below a hinge to a site on the link above it."""

    divisor: float
    """Its length is divided by this."""
    below: FloatArray
    """Place of the first site in the body below the hinge, shape (3,) [m]."""
    above: FloatArray
    """Place of the second site in the body above it, shape (3,) [m]."""
    bodies: tuple[str, str]
    """Names of both bodies."""
    rest_length: float
    """Its part of the length of the tendon at rest [m]."""


class Drive(NamedTuple):
    """An actuator of a tendon of length `l`: `tension = gain u + constant + stiffness l + damping l'`, within limits."""

    gain: float
    """Tension per input [1, N/m or m^2]."""
    constant: float
    """Constant part of the tension [N]."""
    stiffness: float
    """Tension per length [N/m]."""
    damping: float
    """Tension per speed [N s/m]."""
    limits: tuple[float, float]
    """Least and largest tension [N]."""
    inputs: tuple[float, float]
    """Least and largest input [m, N or Pa]."""


class Spring(NamedTuple):
    """A spring that is slack up to a length: `tension = linear x + square x^2` at `x` beyond it, plus `damping x'`."""

    slack: float
    """Length up to which it is slack [m]."""
    linear: float
    """[N/m]."""
    square: float
    """[N/m^2]."""
    damping: float
    """[N s/m]."""


Law = Drive | Spring | Winch | Piston
"""What gives a tendon its tension."""


@dataclass(frozen=True, eq=False)
class Tendon:
    """An actuator as a tendon, either driven or a spring."""

    name: str
    """Name of the actuator."""
    legs: tuple[Leg, ...]
    """Its course, base to tip."""
    law: Law
    """Its tension."""
    home: float
    """Its input at home [m, N or Pa]."""


def tendons_of(model: SoftModel, robot: PreparedRobot, *, welded: bool) -> tuple[Tendon, ...]:
    """Return the tendons of a robot: driven actuators, or springs in place of those whose tension follows their length.

    Raises:
        ParameterError: If MuJoCo has no such law: that of a welded elastic actuator that is taut at any length.
    """
    sections = model.structure.section_table
    hinges = [[joint for joint in robot.tree.joints if joint.name in row.joint_names] for row in sections]
    inputs = robot.q_motors[len(model.structure.motor_joints) :].tolist()
    time, tendons = robot.damping_time or 0.0, []
    for place, (tag, value) in enumerate(zip(model.muscles, inputs, strict=True)):
        if welded and tag.kind not in SPRINGY:
            continue
        legs = _legs(tag, sections, hinges)
        beyond = float(model.structure.muscle_paths.rest[place]) - math.fsum(leg.rest_length for leg in legs)
        if welded:
            law: Law = _spring(tag, value, beyond, time)
        elif tag.kind == "length":
            law = winch(model, place, beyond)
        elif tag.kind == "mckibben":
            law = piston(tag, sum(body.mass for body in robot.tree.bodies))
        else:
            law = _drive(tag, beyond, time)
        tendons.append(Tendon(tag.name, legs, law, value))
    return tuple(tendons)


def _legs(tag: ActuatorTag, sections: Sequence[SectionRow], hinges: Sequence[Sequence[Joint]]) -> tuple[Leg, ...]:
    """Legs of the tendon of an actuator along lumped sections, each with its joints, base to tip."""
    legs = []
    for point in route_points(tag.route, [(row.segment, row.length) for row in sections]):
        hinge, share = hinges[point.section], point.weight / sections[point.section].length
        bodies, place = (hinge[0].parent, hinge[-1].child), hinge[0].placement
        offset, tangent = _offset_and_tangent(point, sections[point.section])
        beside = (offset - 0.5 * tangent) / (1.0 + _CENTRAL), (offset + 0.5 * tangent) / (1.0 + _CENTRAL)
        along = (-_NEAR * tangent, -_FAR * tangent) if hinge[0].kind == "prismatic" else (_FAR * tangent, _NEAR * tangent)
        for (below, above), part in ((beside, (1.0 + _CENTRAL) * share), (along, _CENTRAL * share)):
            rest_length = part * float(np.linalg.norm(above - below))
            legs.append(Leg(1.0 / part, place.position + place.rotation @ below, above, bodies, rest_length))
    return tuple(legs)


def _offset_and_tangent(point: RoutePoint, row: SectionRow) -> tuple[FloatArray, FloatArray]:
    """Offset of a point from the backbone, and the tangent there times the length of the section, shape (3,) each [m]."""
    kx, ky, twist, along = (row.rest / row.length).tolist()
    radial = np.array([math.cos(point.azimuth), math.sin(point.azimuth), 0.0])
    around = np.array([-radial[1], radial[0], 0.0])
    offset = point.distance * radial
    tangent = point.widening * radial + point.distance * (point.winding + twist) * around
    tangent[2] = 1.0 + along + kx * offset[1] - ky * offset[0]
    return offset, row.length * tangent


def _drive(tag: ActuatorTag, beyond: float, time: float) -> Drive:
    """The law of a driven actuator, which is by `beyond` [m] longer than its tendon, with a damping time [s]."""
    inputs = input_limits(tag)
    if tag.kind != "elastic":
        return Drive(1.0 if tag.kind == "tension" else -tag.area, 0.0, 0.0, 0.0, (-math.inf, math.inf), inputs)
    constant = tag.pretension + tag.stiffness * beyond
    return Drive(-tag.stiffness, constant, tag.stiffness, time * tag.stiffness, (0.0, tag.strongest), inputs)


def _spring(tag: ActuatorTag, value: float, beyond: float, time: float) -> Spring:
    """The law of an actuator at a fixed input [m or Pa]; see `_drive`."""
    if tag.kind == "elastic":
        slack, linear, square = value - tag.pretension / tag.stiffness, tag.stiffness, 0.0
    else:
        factor, least = pull_factors(tag)
        slack = tag.rest_length * math.sqrt(least / factor)
        square = value * factor / tag.rest_length**2
        linear = 2.0 * square * slack
    if slack <= beyond:
        raise ParameterError("q_motors", value, f"a longer {tag.name}: it is taut at any length, which no spring of MuJoCo is")
    return Spring(slack - beyond, linear, square, time * linear)
