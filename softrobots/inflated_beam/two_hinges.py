"""The two hinges of a rigid link that have the compliance of a beam."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import common_shape, positive_array, refuse_where
from softrobots.inflated_beam.beam import BeamStiffness


class TwoHinges(NamedTuple):
    """A rigid link with two universal joints, alike, in the same distance from its middle, and a joint about its axis there."""

    stiffness: Any
    """Stiffness of each universal joint about both its axes, `2 B / L` [N m/rad]."""
    distance: Any
    """Distance of each universal joint from the middle, `sqrt(L^2/12 + B/A)` [m]."""
    twist_stiffness: Any
    """Stiffness of the joint about the axis, `C / L` [N m/rad]."""


def two_hinges(beam: BeamStiffness, length: Any) -> TwoHinges:
    r"""Return the two hinges with the compliance of a beam under a force and a moment at its end.

    Under a force `F` the end of a beam moves by :math:`F L^3 / 3 B + F L / A` and turns by :math:`F L^2 / 2 B`, under a moment
    `M` by :math:`M L^2 / 2 B` and :math:`M L / B`. Two hinges of `k = 2 B / L` at :math:`L/2 \mp \sqrt{L^2/12 + B/A}` do
    exactly the same.

    Args:
        beam: Stiffness of the beam.
        length: Its length `L` [m], positive.

    Returns:
        The hinges, of the common shape.

    Raises:
        ParameterError: If a length is not positive, or `B / A` is not below `L^2 / 6`: the hinges would be outside the link.
    """
    lengths = positive_array("length", length, "m")
    common_shape("length", lengths.shape, np.shape(beam.bending))
    ratio = beam.bending / (beam.shear * lengths**2)
    refuse_where("length", length, ratio >= 1.0 / 6.0, "such that L^2 is above 6 B / A, {} m^2", 6.0 * ratio * lengths**2)
    apart = lengths * np.sqrt(1.0 / 12.0 + ratio)
    return TwoHinges(2.0 * beam.bending / lengths, apart, beam.twisting / lengths)
