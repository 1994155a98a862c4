"""Bending of one inflated link: deflection, stiffness, Young's modulus, wrinkling.

Notation of [Troise 2021], section 2.1: a tube of length `L`, radius `r` and wall thickness `t` (thin wall), gauge
pressure `p`; cap force `P = p pi r^2`, wall section `S = 2 pi r t`, second moment `I = pi r^3 t`, shear coefficient
`j = 0.5`, shear modulus `G = E / (2 (1 + nu))`.

References:
    [Troise 2021]: M. Troise, M. Gaidano, P. Palmieri, S. Mauro, Applied Sciences 11(6):2558, doi:10.3390/app11062558.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, finite_number, non_negative_number, positive_number
from softrobots.core.errors import ParameterError

SHEAR_COEFFICIENT = 0.5
"""Shear coefficient `j` of a circular thin tube [-], [Troise 2021] section 2.1 after Cowper."""


def wrinkling_moment(pressure: float, radius: float) -> float:
    """Return the bending moment at which the first wrinkle appears: `M_w = (pi/4) pi p r^3`, [Troise 2021] (3).

    Every linear model of this package is valid below it.

    Args:
        pressure: Gauge pressure [Pa], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The moment [N m].

    Raises:
        ParameterError: If an argument is out of range.
    """
    return math.pi**2 / 4.0 * non_negative_number("pressure", pressure, "Pa") * positive_number("radius", radius, "m") ** 3


def required_pressure(moment: float, radius: float) -> float:
    """Return the gauge pressure whose wrinkling moment is `moment`: the inverse of [Troise 2021] (3).

    Args:
        moment: Bending moment [N m], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The pressure [Pa].

    Raises:
        ParameterError: If an argument is out of range.
    """
    return non_negative_number("moment", moment, "N m") / wrinkling_moment(1.0, radius)


def _section(pressure: float, radius: float, wall_thickness: float) -> tuple[float, float, float]:
    """Return cap force [N], wall section [m^2] and second moment of area [m^4] of a pressurised thin tube."""
    pressure = non_negative_number("pressure", pressure, "Pa")
    radius = positive_number("radius", radius, "m")
    wall_thickness = positive_number("wall_thickness", wall_thickness, "m")
    if wall_thickness > 0.1 * radius:
        raise ParameterError("wall_thickness", wall_thickness, f"a thin wall, at most a tenth of the radius {radius} m")
    return pressure * math.pi * radius**2, 2.0 * math.pi * radius * wall_thickness, math.pi * radius**3 * wall_thickness


def _shear_ratio(poisson_ratio: float) -> float:
    """Return `j G / E`."""
    nu = finite_number("poisson_ratio", poisson_ratio, "-")
    if not -1.0 < nu <= 0.5:
        raise ParameterError("poisson_ratio", poisson_ratio, "in (-1, 0.5]")
    return SHEAR_COEFFICIENT / (2.0 * (1.0 + nu))


def deflection(
    position: Any,
    force: float,
    *,
    length: float,
    radius: float,
    wall_thickness: float,
    pressure: float,
    young_modulus: float,
    poisson_ratio: float = 0.3,
) -> FloatArray:
    r"""Return the deflection of an inflated cantilever under a transverse tip force.

    .. math:: v(x) = F / ((E + P/S) I) (l x^2/2 - x^3/6) + F x / (P + j G S)

    [Troise 2021] (1), with the sign of the cubic term corrected: the paper prints `+ x^3/6`, which is not in
    equilibrium with a tip force (a cantilever has `v(l) = F l^3/(3 E I)` plus shear).

    Args:
        position: Distance `x` from the clamp [m], any shape, within [0, length].
        force: Transverse tip force `F` [N].
        length: Distance `l` of the force from the clamp [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive, at most a tenth of the radius.
        pressure: Gauge pressure [Pa], zero or positive.
        young_modulus: Modulus `E` of the wall [Pa], positive.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        Deflection [m], shape of `position`.

    Raises:
        ParameterError: If an argument is out of range.
    """
    length = positive_number("length", length, "m")
    x = finite_array("position", position, None, "m")
    if np.any((x < 0.0) | (x > length)):
        raise ParameterError("position", position, f"within [0, {length}] m, the length of the beam")
    force = finite_number("force", force, "N")
    cap_force, wall_section, second_moment = _section(pressure, radius, wall_thickness)
    modulus = positive_number("young_modulus", young_modulus, "Pa")
    bending = (modulus + cap_force / wall_section) * second_moment
    shear = cap_force + _shear_ratio(poisson_ratio) * modulus * wall_section
    return np.asarray(force / bending * (length * x**2 / 2.0 - x**3 / 6.0) + force * x / shear)


def stiffness_from_young_modulus(
    young_modulus: float,
    *,
    pressure: float,
    length: float,
    radius: float,
    wall_thickness: float,
    poisson_ratio: float = 0.3,
) -> float:
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
        The stiffness [N m/rad].

    Raises:
        ParameterError: If an argument is out of range.
    """
    length = positive_number("length", length, "m")
    tip = deflection(
        length,
        1.0,
        length=length,
        radius=radius,
        wall_thickness=wall_thickness,
        pressure=pressure,
        young_modulus=young_modulus,
        poisson_ratio=poisson_ratio,
    )
    return float(length**2 / tip)


def young_modulus_from_stiffness(
    stiffness: float,
    *,
    pressure: float,
    length: float,
    radius: float,
    wall_thickness: float,
    poisson_ratio: float = 0.3,
) -> float:
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
        The modulus [Pa].

    Raises:
        ParameterError: If an argument is out of range, or the stiffness is not above that of the pressure alone.
    """
    stiffness = positive_number("stiffness", stiffness, "N m/rad")
    length = positive_number("length", length, "m")
    cap_force, wall_section, second_moment = _section(pressure, radius, wall_thickness)
    c = _shear_ratio(poisson_ratio) * wall_section
    bending, shear = stiffness * length / (3.0 * second_moment), stiffness / (c * length)
    stress, shear_stress = cap_force / wall_section, cap_force / c
    middle = 0.5 * ((bending - stress) + (shear - shear_stress))
    half_difference = math.hypot(0.5 * ((bending - stress) - (shear - shear_stress)), math.sqrt(bending) * math.sqrt(shear))
    if middle >= 0.0:
        modulus = middle + half_difference
    else:  # product of both roots over the other root
        modulus = (bending * shear_stress + shear * stress - stress * shear_stress) / (half_difference - middle)
    if modulus <= 0.0:
        floor = stiffness / (bending / stress + shear / shear_stress)
        raise ParameterError("stiffness", stiffness, f"above {floor:.6g} N m/rad, the stiffness due to the pressure alone")
    return modulus
