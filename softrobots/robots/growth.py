"""Growth of a helical tube by eversion at its tip, as section coordinates of the chain of the whole tube.

Everted wall does not move along the tube. So the first sections have their full length, one is partly everted, and the others
are at the tip, as short as the chain allows. (`HelixTube.grown(length)` is a separate robot with the weight and stiffness of
that length.)
"""

from __future__ import annotations

import numpy as np

from softrobots import helix
from softrobots.core.checks import FloatArray, instance_of, non_negative_number, positive_number
from softrobots.core.errors import ParameterError
from softrobots.robots import HelixTube

SHORTEST = 0.002
"""Length of a section that is not everted, relative to its full length; a chord needs some length."""


def grown_coordinates(tube: HelixTube, length: float, front: float = 0.0) -> FloatArray:
    """Return the section coordinates of a tube that has grown to a length.

    Args:
        tube: The whole tube, with chain="sections".
        length: Everted length of the uninflated tube [m], from `SHORTEST` times the whole length to the whole length.
        front: Length of uninflated tube behind the tip over which the helix forms [m]: there the contraction rises from that of
            the tube to 1 at the tip, where the tube is straight; 0 if the helix forms at the tip.

    Returns:
        Section coordinates, shape (n_sections, 4) [rad, rad, rad, m]. Without a front all sections end on the helix.

    Raises:
        ParameterError: If the tube is no `HelixTube` or is lumped, or a length is out of range.
    """
    instance_of("tube", tube, HelixTube, "a HelixTube")
    if tube.chain != "sections":
        raise ParameterError("tube", tube.chain, 'a HelixTube with chain="sections"; lumped chains cannot grow')
    if tube.real:
        raise ParameterError("tube", tube.actuator, 'a HelixTube with actuator="drawn"')
    grown = positive_number("length", length, "m")
    if not SHORTEST * tube.length <= grown <= tube.length:
        raise ParameterError("length", length, f"from {SHORTEST * tube.length} m to the length of the tube, {tube.length} m")
    front = non_negative_number("front", front, "m")
    count = tube.n_sections
    everted_sections = grown * count / tube.length - count * SHORTEST
    shares = SHORTEST + np.clip(everted_sections - (1.0 - SHORTEST) * np.arange(count), 0.0, 1.0 - SHORTEST)
    pieces = shares * tube.length / count
    to_tip = np.maximum(grown - np.cumsum(pieces) + 0.5 * pieces, 0.0)  # from the middle of each section
    formed = np.minimum(to_tip, front) / front if front > 0.0 else np.ones(count)
    contraction = 1.0 + (tube.contraction - 1.0) * formed
    rest = tube.centre_length / count
    lengths = helix.centre_length(contraction, tube.angle, pieces)
    curvature, torsion = helix.actuator_curvature_torsion(contraction, tube.angle, tube.diameter, "centre", tube.handedness)
    return np.stack([np.zeros(count), curvature * lengths, torsion * lengths, lengths - rest], axis=-1)
