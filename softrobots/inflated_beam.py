"""One inflated link as a beam: deflection, stiffness and modulus, wrinkling, characterisation data, inflation.

Notation of [Troise 2021], section 2.1: a tube of length `L`, radius `r` and wall thickness `t` (thin wall), gauge
pressure `p`; cap force `P = p pi r^2`, wall section `S = 2 pi r t`, second moment `I = pi r^3 t`, shear coefficient
`j = 0.5`, shear modulus `G = E / (2 (1 + nu))`.

References:
    [Troise 2021]: M. Troise, M. Gaidano, P. Palmieri, S. Mauro, Applied Sciences 11(6):2558, doi:10.3390/app11062558.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.checks import FloatArray, finite_array, finite_number, non_negative_number, positive_number
from softrobots.errors import ParameterError

SHEAR_COEFFICIENT = 0.5
"""Shear coefficient `j` of a circular thin tube [-], [Troise 2021] section 2.1 after Cowper."""


class CharacterisationRow(NamedTuple):
    """One row of [Troise 2021], Table 3 (measured on the prototype link)."""

    pressure: float
    """Gauge pressure [Pa]."""
    stiffness: float
    """Fitted stiffness `k` [N m/rad]."""
    stiffness_std: float
    """Its standard deviation [N m/rad]."""
    max_moment: float | None
    """Mean moment beyond wrinkling [N m]; None where the paper prints N/A."""


TABLE_3 = (
    CharacterisationRow(10e3, 182.56, 3.37, 4.99),
    CharacterisationRow(20e3, 187.30, 1.48, 9.45),
    CharacterisationRow(30e3, 155.89, 2.66, 14.99),
    CharacterisationRow(40e3, 174.42, 6.22, 18.77),
    CharacterisationRow(50e3, 169.44, 5.51, 21.76),
    CharacterisationRow(60e3, 166.66, 4.99, None),
)
"""Characterisation of the prototype link, [Troise 2021] Table 3."""

MEAN_STIFFNESS = 172.71
"""Mean stiffness of the prototype link as printed in [Troise 2021] [N m/rad]; the six rows average 172.7117."""


def wrinkling_moment(pressure: float, radius: float) -> float:
    """Bending moment at which the first wrinkle appears: `M_w = (pi/4) pi p r^3`, [Troise 2021] (3).

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
    """Smallest gauge pressure whose wrinkling moment is `moment`: the inverse of [Troise 2021] (3).

    Args:
        moment: Bending moment [N m], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The pressure [Pa].

    Raises:
        ParameterError: If an argument is out of range.
    """
    return non_negative_number("moment", moment, "N m") / wrinkling_moment(1.0, radius)


def required_tabulated_pressure(moment: float, radius: float) -> float | None:
    """Smallest pressure of [Troise 2021] Table 3 whose wrinkling moment is at least `moment`.

    Args:
        moment: Bending moment [N m], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The pressure [Pa]; None if the moment exceeds the highest row.

    Raises:
        ParameterError: If an argument is out of range.
    """
    exact = required_pressure(moment, radius)
    return next((row.pressure for row in TABLE_3 if row.pressure >= exact), None)


@dataclass(frozen=True)
class _Section:
    """Section properties of a pressurised thin tube."""

    cap_force: float
    wall_section: float
    second_moment: float

    @classmethod
    def of(cls, pressure: float, radius: float, wall_thickness: float) -> _Section:
        pressure = non_negative_number("pressure", pressure, "Pa")
        radius = positive_number("radius", radius, "m")
        wall_thickness = positive_number("wall_thickness", wall_thickness, "m")
        if wall_thickness > 0.1 * radius:
            raise ParameterError("wall_thickness", wall_thickness, f"a thin wall, at most a tenth of the radius {radius} m")
        return cls(pressure * math.pi * radius**2, 2.0 * math.pi * radius * wall_thickness, math.pi * radius**3 * wall_thickness)


def _shear_ratio(poisson_ratio: float) -> float:
    """Return `j G / E`."""
    nu = finite_number("poisson_ratio", poisson_ratio)
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
    r"""Deflection of an inflated cantilever under a transverse tip force.

    .. math:: v(x) = F / ((E + P/S) I) (l x^2/2 - x^3/6) + F x / (P + j G S)

    [Troise 2021] (1), with the sign of the cubic term corrected: the paper prints `+ x^3/6`, which is not in
    equilibrium with a tip force (a cantilever has `v(l) = F l^3/(3 E I)` plus shear).

    Args:
        position: Distance `x` from the clamp [m], any shape, within [0, length].
        force: Transverse tip force `F` [N].
        length: Distance `l` of the force from the clamp [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive and thin.
        pressure: Gauge pressure [Pa], zero or positive.
        young_modulus: Modulus `E` of the wall [Pa], positive.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        Deflection [m], shape of `position`.

    Raises:
        ParameterError: If an argument is out of range.
    """
    length = positive_number("length", length, "m")
    x = finite_array("position", position, (None,) * np.ndim(position), "m")
    if np.any((x < 0.0) | (x > length)):
        raise ParameterError("position", position, f"within [0, {length}] m, the length of the beam")
    force = finite_number("force", force, "N")
    section = _Section.of(pressure, radius, wall_thickness)
    modulus = positive_number("young_modulus", young_modulus, "Pa")
    bending = (modulus + section.cap_force / section.wall_section) * section.second_moment
    shear = section.cap_force + _shear_ratio(poisson_ratio) * modulus * section.wall_section
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
    """Stiffness `k` of the pseudo-rigid hinge that a modulus gives.

    `k = tau / theta` with `tau = F L` and `theta = v(L) / L`, `v` from [Troise 2021] (1) with the tip at the full length
    (`l = x = L`). These assumptions reproduce the paper's 136-140 MPa; the paper does not state its own.

    Args:
        young_modulus: Modulus of the wall [Pa], positive.
        pressure: Gauge pressure [Pa], zero or positive.
        length: Link length `L` [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive and thin.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        The stiffness [N m/rad].

    Raises:
        ParameterError: If an argument is out of range.
    """
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
    """Modulus of the wall that a measured hinge stiffness implies; inverse of `stiffness_from_young_modulus`.

    With `a = L^3/(3 I)`, `c = j S/(2 (1 + nu))` the relation `a/(E + P/S) + L/(P + c E) = L^2/k` is quadratic in `E`.

    Args:
        stiffness: Hinge stiffness `k` [N m/rad], positive.
        pressure: Gauge pressure [Pa], zero or positive.
        length: Link length `L` [m], positive.
        radius: Tube radius [m], positive.
        wall_thickness: Wall thickness [m], positive and thin.
        poisson_ratio: Poisson ratio of the wall [-], in (-1, 0.5].

    Returns:
        The modulus [Pa].

    Raises:
        ParameterError: If an argument is out of range, or the stiffness is so small that pressure alone exceeds it.
    """
    stiffness = positive_number("stiffness", stiffness, "N m/rad")
    length = positive_number("length", length, "m")
    section = _Section.of(pressure, radius, wall_thickness)
    a = length**3 / (3.0 * section.second_moment)
    c = _shear_ratio(poisson_ratio) * section.wall_section
    cap, stress, compliance = section.cap_force, section.cap_force / section.wall_section, length**2 / stiffness
    quadratic = compliance * c
    linear = compliance * (cap + c * stress) - a * c - length
    constant = compliance * stress * cap - a * cap - length * stress
    # The larger root, in the form that does not cancel; the other root has a negative denominator in (1).
    root = math.sqrt(max(linear**2 - 4.0 * quadratic * constant, 0.0))
    modulus = (root - linear) / (2.0 * quadratic) if linear < 0.0 else -2.0 * constant / (linear + root)
    if modulus <= 0.0:
        floor = length**2 / (a / stress + length / cap) if cap > 0.0 else 0.0
        raise ParameterError("stiffness", stiffness, f"above {floor:.6g} N m/rad, what the pressure alone gives")
    return modulus


def moment(angle: Any, *, stiffness: float, max_moment: float) -> FloatArray:
    """Moment of a link bent by an angle: `tau = sign(theta) min(k |theta|, M_max)`, [Troise 2021] section 4.

    Args:
        angle: Hinge angle [rad], any shape.
        stiffness: Stiffness `k` [N m/rad], positive.
        max_moment: Saturation moment `M_max` [N m], positive.

    Returns:
        Moment [N m], shape of `angle`.

    Raises:
        ParameterError: If an argument is out of range.
    """
    theta = finite_array("angle", angle, (None,) * np.ndim(angle), "rad")
    stiffness = positive_number("stiffness", stiffness, "N m/rad")
    max_moment = positive_number("max_moment", max_moment, "N m")
    return np.asarray(np.clip(stiffness * theta, -max_moment, max_moment))


@dataclass(frozen=True)
class Characterisation:
    """What `fit_characterisation` finds in the raw data of a bending test."""

    stiffness: float
    """Slope of the points below wrinkling, through the origin [N m/rad]."""
    stiffness_std: float
    """Its standard error [N m/rad]."""
    max_moment: float | None
    """Mean moment of the points past the knee `M_max / k` [N m]; None if no point is there."""
    mean_moment_above_wrinkling: float | None
    """Mean moment of all points above the wrinkling moment, the paper's `M_max` read literally [N m]; it includes the
    points still rising between `M_w` and `M_max`, so it lies below `max_moment`. None if no point is above."""
    wrinkling_moment: float
    """`M_w` of [Troise 2021] (3) [N m]."""
    n_linear: int
    """How many points the slope was fitted on."""
    n_saturated: int
    """How many points `max_moment` was averaged over."""


def fit_characterisation(angle: Any, moment: Any, *, pressure: float, radius: float) -> Characterisation:
    """Fit the moment-angle law to the raw data of a bending test, as [Troise 2021] section 4 did.

    The stiffness is the least-squares slope, through the origin (law (2) has no offset), of the points whose moment is
    below the theoretical wrinkling moment (3). The saturation moment is the mean of the points past the knee, found by
    repeating "average the points with `k |theta|` above the last average" until it stands still. Negative angles count
    by their absolute value (the law is odd).

    Args:
        angle: Hinge angles [rad], shape (n,).
        moment: Moments [N m], shape (n,).
        pressure: Gauge pressure of the test [Pa], positive.
        radius: Tube radius [m], positive.

    Returns:
        The fit and what it rests on.

    Raises:
        ParameterError: If shapes differ, a number is not finite, or fewer than three points lie below wrinkling.
    """
    theta = finite_array("angle", angle, (None,), "rad")
    tau = finite_array("moment", moment, theta.shape, "N m")
    limit = wrinkling_moment(positive_number("pressure", pressure, "Pa"), radius)
    tau = np.where(theta < 0.0, -tau, tau)
    theta = np.abs(theta)
    linear = tau < limit
    n_linear = int(np.count_nonzero(linear))
    spread = float(theta[linear] @ theta[linear])
    if n_linear < 3 or spread == 0.0:
        raise ParameterError("moment", moment, f"data with at least three loaded points below wrinkling at {limit:.4g} N m")
    stiffness = float(theta[linear] @ tau[linear]) / spread
    if stiffness <= 0.0:
        raise ParameterError("moment", moment, "of the same sign as the angle (the fitted slope is not positive)")
    scatter = tau[linear] - stiffness * theta[linear]
    above = tau[~linear]
    saturated, plateau = ~linear, float(above.mean()) if above.size else limit
    for _ in range(100):
        following = (stiffness * theta > plateau) & (tau >= 0.5 * limit)
        if not following.any() or np.array_equal(following, saturated):
            break
        saturated, plateau = following, float(tau[following].mean())
    return Characterisation(
        stiffness=stiffness,
        stiffness_std=math.sqrt(float(scatter @ scatter) / (n_linear - 1) / spread),
        max_moment=plateau if above.size else None,
        mean_moment_above_wrinkling=float(above.mean()) if above.size else None,
        wrinkling_moment=limit,
        n_linear=n_linear,
        n_saturated=int(np.count_nonzero(saturated)) if above.size else 0,
    )


def volume(length: float, radius: float) -> float:
    """Volume of an inflated tube, `pi r^2 L` [m^3].

    Args:
        length: Tube length [m], positive.
        radius: Tube radius [m], positive.

    Raises:
        ParameterError: If an argument is not positive.
    """
    return math.pi * positive_number("radius", radius, "m") ** 2 * positive_number("length", length, "m")


def tank_volume(inflated_volume: float, pressure: float, tank_pressure: float, *, ambient_pressure: float = 0.0) -> float:
    """Volume of the tank that inflates a given volume once, isothermally (Boyle).

    The tank gives gas until both are at the same absolute pressure `p + p_a`:
    `(p_tank + p_a) V_tank = (p + p_a)(V_tank + V)`, the tubes being empty before.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Gauge pressure wanted in it [Pa], positive.
        tank_pressure: Gauge pressure of the full tank [Pa], above `pressure`. The paper mentions 30 MPa.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default), 101325 on the ground.

    Returns:
        The tank volume [m^3].

    Raises:
        ParameterError: If an argument is out of range.
    """
    inflated_volume = positive_number("inflated_volume", inflated_volume, "m^3")
    pressure = positive_number("pressure", pressure, "Pa")
    tank_pressure = positive_number("tank_pressure", tank_pressure, "Pa")
    if tank_pressure <= pressure:
        raise ParameterError("tank_pressure", tank_pressure, f"above the pressure {pressure} Pa of the inflated volume")
    ambient_pressure = non_negative_number("ambient_pressure", ambient_pressure, "Pa")
    return (pressure + ambient_pressure) * inflated_volume / (tank_pressure - pressure)


def tank_pressure(inflated_volume: float, pressure: float, tank_volume: float, *, ambient_pressure: float = 0.0) -> float:
    """Gauge pressure to which a tank of given volume must be filled to inflate a given volume once, isothermally.

    The inverse of `tank_volume`.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Gauge pressure wanted in it [Pa], positive.
        tank_volume: Volume of the tank [m^3], positive.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

    Returns:
        The gauge pressure of the full tank [Pa].

    Raises:
        ParameterError: If an argument is out of range.
    """
    inflated_volume = positive_number("inflated_volume", inflated_volume, "m^3")
    pressure = positive_number("pressure", pressure, "Pa")
    tank_volume = positive_number("tank_volume", tank_volume, "m^3")
    ambient_pressure = non_negative_number("ambient_pressure", ambient_pressure, "Pa")
    return pressure + (pressure + ambient_pressure) * inflated_volume / tank_volume
