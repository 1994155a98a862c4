"""An inflated link as a beam that bends, shears and twists, and the two hinges with the same compliance."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import common_shape, non_negative_array, positive_array, refuse_where
from softrobots.inflated_beam.beam import SHEAR_COEFFICIENT

POISSON_RATIO = 0.3
"""Poisson ratio of the wall where no shear modulus is given [-]: an isotropic wall, an assumption."""


class BeamStiffness(NamedTuple):
    """Stiffness of an inflated link as a Timoshenko beam that also twists."""

    bending: Any
    """`B = (E + P/S) I` [N m^2]."""
    shear: Any
    """`A = P + j G S`, force over shear angle [N]."""
    twisting: Any
    """`C = (G + P/S) 2 pi r^3 t` [N m^2]."""


class TwoHinges(NamedTuple):
    """A rigid link with two universal joints, alike, in the same distance from its middle, and a joint about its axis there."""

    stiffness: Any
    """Stiffness of each universal joint about both its axes, `2 B / L` [N m/rad]."""
    distance: Any
    """Distance of each universal joint from the middle, `sqrt(L^2/12 + B/A)` [m]."""
    twist_stiffness: Any
    """Stiffness of the joint about the axis, `C / L` [N m/rad]."""


def beam_stiffness(
    young_modulus: Any, *, pressure: Any, radius: Any, wall_thickness: Any, shear_modulus: Any = None
) -> BeamStiffness:
    """Return the stiffness of an inflated tube in bending, shear and torsion.

    Bending and shear are those of [Troise 2021] (1). In torsion the tension of the wall, `N = P / (2 pi r)` a length, adds
    `2 pi r^3 N` to that of the wall, the effect of Wagner.

    Args:
        young_modulus: Modulus `E` of the wall [Pa], positive.
        pressure: Gauge pressure [Pa], zero or positive.
        radius: Tube radius `r` [m], positive.
        wall_thickness: Wall thickness `t` [m], positive, at most a tenth of the radius.
        shear_modulus: Modulus `G` of the wall [Pa], positive; by default that of an isotropic wall with a Poisson ratio of 0.3,
            `E / 2.6`. A coated weave has one of its own.

    Returns:
        The three, each of the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    modulus, p = positive_array("young_modulus", young_modulus, "Pa"), non_negative_array("pressure", pressure, "Pa")
    r, t = positive_array("radius", radius, "m"), positive_array("wall_thickness", wall_thickness, "m")
    isotropic = modulus / (2.0 * (1.0 + POISSON_RATIO))
    g = isotropic if shear_modulus is None else positive_array("shear_modulus", shear_modulus, "Pa")
    shape = common_shape("pressure", modulus.shape, p.shape)
    for name, array in (("radius", r), ("wall_thickness", t), ("shear_modulus", g)):
        shape = common_shape(name, shape, array.shape)
    refuse_where("wall_thickness", wall_thickness, t > 0.1 * r, "a thin wall, at most a tenth of the radius {} m", r)
    modulus, p, r, t, g = (np.broadcast_to(array, shape) for array in (modulus, p, r, t, g))
    cap_force, section = p * math.pi * r**2, 2.0 * math.pi * r * t
    stress = cap_force / section
    bending, twisting = (modulus + stress) * math.pi * r**3 * t, (g + stress) * section * r**2
    return BeamStiffness(bending, cap_force + SHEAR_COEFFICIENT * g * section, twisting)


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
