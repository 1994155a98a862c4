"""Hinges of inflated links whose wall goes slack, traced: two springs, one behind the other, with one law of their moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from softrobots.compiled.chain.traced_elements import SpringLaw, TracedElement
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.expressions import Scalar, if_less, inverse_cube_root, larger, square_root
from softrobots.inflated_beam.membrane_tube import softening
from softrobots.model.serial_chain import SerialChain


def with_slack_hinges(unknowns: Unknowns, elements: Sequence[TracedElement], numbers: SerialChain) -> list[TracedElement]:
    """Return the elements with the laws of the springs of slack hinges; `numbers` holds the moments at which they go slack."""
    traced = list(elements)
    for place, (inner, outer, _) in enumerate(unknowns.slack_hinges):
        slack_moment = numbers.slack_hinges[place][2]
        angles = [traced[row].coordinates[0] - traced[row].rest[0] for row in (inner, outer)]
        laws = _laws(angles[0], angles[1], traced[inner].stiffness[0], slack_moment)
        for row, law in zip((inner, outer), laws, strict=True):
            traced[row] = replace(traced[row], law=law)
    return traced


def _laws(inner: Scalar, outer: Scalar, stiffness: Scalar, slack_moment: Scalar) -> tuple[SpringLaw, SpringLaw]:
    """Laws of both springs at their angles from rest [rad]; linear to the last digit up to the first slack fibre."""
    first = slack_moment / stiffness
    square = larger(inner * inner + outer * outer, first * first)
    ratio = square_root(square) * (1.0 / first)
    start = inverse_cube_root(ratio)
    moment, tangent, energy, _ = softening(ratio, start, square_root(larger(1.0 - start, 1e-300)))  # its slope is finite
    taut = (inner * inner + outer * outer) * (0.5 * stiffness)
    secant = if_less(1.0, ratio, moment / ratio * stiffness, stiffness)
    bending = if_less(1.0, ratio, (tangent * stiffness - secant) / square, 0.0)
    stored = if_less(1.0, ratio, energy * (slack_moment * first), taut)
    return (
        SpringLaw(secant * inner, secant + bending * inner * inner, 0.0, None),
        SpringLaw(secant * outer, secant + bending * outer * outer, stored, bending * inner * outer),
    )
