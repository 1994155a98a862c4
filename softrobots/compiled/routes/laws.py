"""Tensions of actuators by input and length, traced; the laws are those of `softrobots.model.actuator_laws`."""

from __future__ import annotations

from typing import NamedTuple

from softrobots.compiled.trace.expressions import Scalar, if_less
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


def tension(tag: ActuatorTag, given: Scalar, beyond: Scalar) -> Tension:
    """Trace the tension of an actuator.

    Args:
        tag: The actuator.
        given: Its input: tension [N], pressure [Pa] or length of the motor [m].
        beyond: Its length beyond that at rest [m].
    """
    if tag.kind == "elastic":
        pull = (beyond - (given - tag.rest_length)) * tag.stiffness + tag.pretension
        taut = if_less(0.0, pull, pull, 0.0)
        slope = if_less(ROUNDING * tag.stiffness * tag.rest_length, pull, tag.stiffness, 0.0)
        return Tension(taut, slope, taut * taut * (0.5 / tag.stiffness))
    if tag.kind == "mckibben":
        square, least = pull_factors(tag)
        share, slack = beyond * (1.0 / tag.rest_length) + 1.0, (least / square) ** 0.5
        force = share * share * square - least
        work = ((share * share + share * slack + slack * slack) * (square / 3.0) - least) * (share - slack) * tag.rest_length
        parts = (force, share * (2.0 * square / tag.rest_length), work)
        return Tension(*(given * if_less(slack * (1.0 + ROUNDING), share, one, 0.0) for one in parts))
    value = given * -tag.area if tag.kind == "pressure" else given
    return Tension(value, 0.0, value * beyond)
