"""One inflated link as a beam: deflection, stiffness, Young's modulus, wrinkling.

Notation of [Troise 2021], section 2.1: a tube of length `L`, radius `r` and wall thickness `t` (thin wall), gauge
pressure `p`; cap force `P = p pi r^2`, wall section `S = 2 pi r t`, second moment `I = pi r^3 t`, shear coefficient
`j = 0.5`, shear modulus `G = E / (2 (1 + nu))`. Every argument is a number or an array; arrays broadcast.

References:
    [Troise 2021]: M. Troise, M. Gaidano, P. Palmieri, S. Mauro, Applied Sciences 11(6):2558, doi:10.3390/app11062558.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, common_shape, finite_array, non_negative_array, positive_array, refuse_where

SHEAR_COEFFICIENT = 0.5
"""Shear coefficient `j` of a circular thin tube [-], [Troise 2021] section 2.1 after Cowper."""
POISSON_RATIO = 0.3
"""Poisson ratio of the wall where no shear modulus is given [-]: an isotropic wall, an assumption."""


def wrinkling_moment(pressure: Any, radius: Any) -> Any:
    """Return the bending moment at which the first wrinkle appears: `M_w = (pi/4) pi p r^3`, [Troise 2021] (3).

    Every linear model of this package is valid below it.

    Args:
        pressure: Gauge pressure [Pa], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The moment [N m], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    pressures, radii = non_negative_array("pressure", pressure, "Pa"), positive_array("radius", radius, "m")
    common_shape("radius", pressures.shape, radii.shape)
    return math.pi**2 / 4.0 * pressures * radii**3


def required_pressure(moment: Any, radius: Any, axial_force: Any = 0.0) -> Any:
    r"""Return the gauge pressure whose wrinkling moment is `moment`: the inverse of [Troise 2021] (3).

    With an axial force `N` it is less by :math:`N / \pi r^2`, but not below zero: the inverse of `moment_limits`.

    Args:
        moment: Bending moment [N m], zero or positive.
        radius: Tube radius [m], positive.
        axial_force: Axial force, positive in tension [N].

    Returns:
        The pressure [Pa], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    moments, of_one_pascal = non_negative_array("moment", moment, "N m"), wrinkling_moment(1.0, radius)
    forces = finite_array("axial_force", axial_force, None, "N")
    common_shape("axial_force", common_shape("radius", moments.shape, of_one_pascal.shape), forces.shape)
    return np.maximum(moments / of_one_pascal - forces / (math.pi * np.asarray(radius, dtype=np.float64) ** 2), 0.0)


class _Section(NamedTuple):
    """A pressurised thin tube: arrays that broadcast."""

    cap_force: FloatArray
    """`P` [N]."""
    wall: FloatArray
    """Section `S` of the wall [m^2]."""
    second_moment: FloatArray
    """`I` [m^4]."""

    @classmethod
    def of(cls, pressure: Any, radius: Any, wall_thickness: Any, **others: FloatArray) -> _Section:
        """Check a tube, and that other arguments broadcast with it."""
        p, r = non_negative_array("pressure", pressure, "Pa"), positive_array("radius", radius, "m")
        t = positive_array("wall_thickness", wall_thickness, "m")
        shape: tuple[int, ...] = ()
        for name, array in ({"pressure": p, "radius": r, "wall_thickness": t} | others).items():
            shape = common_shape(name, shape, array.shape)
        refuse_where("wall_thickness", wall_thickness, t > 0.1 * r, "a thin wall, at most a tenth of the radius {} m", r)
        return cls(p * math.pi * r**2, 2.0 * math.pi * r * t, math.pi * r**3 * t)

    @property
    def stress(self) -> FloatArray:
        """Axial stress of the wall by the pressure, `P/S` [Pa]."""
        return self.cap_force / self.wall

    def bending(self, modulus: FloatArray) -> FloatArray:
        """`B = (E + P/S) I` [N m^2]."""
        return (modulus + self.stress) * self.second_moment

    def shear(self, reduced_modulus: FloatArray) -> FloatArray:
        """`A = P + j G S` [N] of the shear modulus times the shear coefficient, `j G` [Pa]."""
        return self.cap_force + reduced_modulus * self.wall


def _shear_ratio(poisson_ratio: Any) -> FloatArray:
    """`j G / E` [-] of an isotropic wall."""
    nu = finite_array("poisson_ratio", poisson_ratio, None, "-")
    refuse_where("poisson_ratio", poisson_ratio, (nu <= -1.0) | (nu > 0.5), "in (-1, 0.5]")
    return SHEAR_COEFFICIENT / (2.0 * (1.0 + nu))


class BeamStiffness(NamedTuple):
    """Stiffness of an inflated link as a Timoshenko beam that also twists."""

    bending: Any
    """`B = (E + P/S) I` [N m^2]."""
    shear: Any
    """`A = P + j G S`, force over shear angle [N]."""
    twisting: Any
    """`C = (G + P/S) 2 pi r^3 t` [N m^2]."""


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
    modulus = positive_array("young_modulus", young_modulus, "Pa")
    isotropic = modulus / (2.0 * (1.0 + POISSON_RATIO))
    g = isotropic if shear_modulus is None else positive_array("shear_modulus", shear_modulus, "Pa")
    section = _Section.of(pressure, radius, wall_thickness, young_modulus=modulus, shear_modulus=g)
    modulus, g = np.broadcast_arrays(modulus, g)
    twisting = (g + section.stress) * 2.0 * section.second_moment
    return BeamStiffness(section.bending(modulus), section.shear(SHEAR_COEFFICIENT * g), twisting)


def deflection(
    position: Any,
    force: Any,
    *,
    length: Any,
    radius: Any,
    wall_thickness: Any,
    pressure: Any,
    young_modulus: Any,
    poisson_ratio: Any = POISSON_RATIO,
) -> Any:
    r"""Return the deflection of an inflated cantilever under a transverse tip force.

    .. math:: v(x) = F / ((E + P/S) I) (l x^2/2 - x^3/6) + F x / (P + j G S)

    [Troise 2021] (1), with the sign of the cubic term corrected: the paper prints `+ x^3/6`, which is not in
    equilibrium with a tip force (a cantilever has `v(l) = F l^3/(3 E I)` plus shear).

    Args:
        position: Distance `x` from the clamp [m], within [0, length].
        force: Transverse tip force `F` [N].
        length: Distance `l` of the force from the clamp [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive, at most a tenth of the radius.
        pressure: Gauge pressure [Pa], zero or positive.
        young_modulus: Modulus `E` of the wall [Pa], positive.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        Deflection [m], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    x, loads = finite_array("position", position, None, "m"), finite_array("force", force, None, "N")
    lengths, modulus = positive_array("length", length, "m"), positive_array("young_modulus", young_modulus, "Pa")
    ratio = _shear_ratio(poisson_ratio)
    others = {"poisson_ratio": ratio, "young_modulus": modulus, "length": lengths, "position": x, "force": loads}
    section = _Section.of(pressure, radius, wall_thickness, **others)
    refuse_where("position", position, (x < 0.0) | (x > lengths), "within [0, {}] m, the length of the beam", lengths)
    bending, shear = section.bending(modulus), section.shear(ratio * modulus)
    return loads / bending * (lengths * x**2 / 2.0 - x**3 / 6.0) + loads * x / shear


def stiffness_from_young_modulus(
    young_modulus: Any,
    *,
    pressure: Any,
    length: Any,
    radius: Any,
    wall_thickness: Any,
    poisson_ratio: Any = POISSON_RATIO,
) -> Any:
    """Return the stiffness `k` of the pseudo-rigid hinge from Young's modulus.

    `k = tau / theta` with `tau = F L` and `theta = v(L) / L`, `v` from [Troise 2021] (1) with the tip at the full length
    (`l = x = L`). These assumptions reproduce the paper's 136-140 MPa; the paper does not state its own.

    Args:
        young_modulus: Modulus of the wall [Pa], positive.
        pressure: Gauge pressure [Pa], zero or positive.
        length: Link length `L` [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive, at most a tenth of the radius.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        The stiffness [N m/rad], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    lengths = positive_array("length", length, "m")
    tip = deflection(
        lengths,
        1.0,
        length=lengths,
        radius=radius,
        wall_thickness=wall_thickness,
        pressure=pressure,
        young_modulus=young_modulus,
        poisson_ratio=poisson_ratio,
    )
    return lengths**2 / tip


def young_modulus_from_stiffness(
    stiffness: Any,
    *,
    pressure: Any,
    length: Any,
    radius: Any,
    wall_thickness: Any,
    poisson_ratio: Any = POISSON_RATIO,
) -> Any:
    r"""Return Young's modulus of the wall from a hinge stiffness; inverse of `stiffness_from_young_modulus`.

    With :math:`a = k L / (3 I)`, :math:`b = k / (c L)`, :math:`s = P/S`, :math:`t = P/c` and :math:`c = j S/(2 (1 + nu))`
    that is :math:`a/(E + s) + b/(E + t) = 1`, or :math:`(E - a + s)(E - b + t) = a b`, which has one root where both
    denominators are positive.

    Args:
        stiffness: Hinge stiffness `k` [N m/rad], positive.
        pressure: Gauge pressure [Pa], zero or positive.
        length: Link length `L` [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive, at most a tenth of the radius.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        The modulus [Pa], the common shape.

    Raises:
        ParameterError: If an argument is out of range, the shapes do not broadcast, or the stiffness is not above that of the
            pressure alone.
    """
    k, lengths = positive_array("stiffness", stiffness, "N m/rad"), positive_array("length", length, "m")
    ratio = _shear_ratio(poisson_ratio)
    section = _Section.of(pressure, radius, wall_thickness, poisson_ratio=ratio, length=lengths, stiffness=k)
    c = ratio * section.wall
    bending, shear = k * lengths / (3.0 * section.second_moment), k / (c * lengths)
    stress, shear_stress = section.stress, section.cap_force / c
    middle = 0.5 * ((bending - stress) + (shear - shear_stress))
    half_difference = np.hypot(0.5 * ((bending - stress) - (shear - shear_stress)), np.sqrt(bending) * np.sqrt(shear))
    larger = half_difference + np.abs(middle)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of the choice that is not taken
        product = bending * shear_stress + shear * stress - stress * shear_stress
        modulus = np.where(middle >= 0.0, larger, product / larger)  # product of both roots over the other root
        least = k / (bending / stress + shear / shear_stress)
    too_soft = "above {:.6g} N m/rad, the stiffness due to the pressure alone"
    refuse_where("stiffness", stiffness, ~(modulus > 0.0), too_soft, least)
    return modulus[()]
