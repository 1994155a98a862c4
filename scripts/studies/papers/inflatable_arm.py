"""[Troise 2021], the inflatable arm: its tables, equations and numbers beside ours.

Printed numbers stand here as they are printed, but for `k` and `M_max` of Table 3, of which the robot is made: they are
`softrobots.inflated_beam.TABLE_3`.

References:
    [Troise 2021]: M. Troise, M. Gaidano, P. Palmieri, S. Mauro, Applied Sciences 11(6):2558, doi:10.3390/app11062558.
"""

from __future__ import annotations

import math

import numpy as np

from softrobots import inflated_beam
from softrobots.inflated_beam import TABLE_3, BendingTest
from softrobots.robots import InflatableArm
from softrobots.statics.equilibrium import solve_equilibrium
from studies.papers.arm_path import FORCE, arm
from studies.papers.rows import MEASURED, Row, absent, equation, erratum, fitted, own, rounded, taken, within

TITLE = "Inflatable arm [Troise 2021]"
"""What the paper is called in tables."""

LENGTH, RADIUS, WALL = "600", "55", "0.5"
"""Section 3: the prototype link [mm]."""
HINGE, PROBE = "30", "500"
"""Section 4: distances of the first wrinkle, `l1`, and of the probe, `h`, from the clamp [mm]."""
WRINKLING_MOMENTS = ("4.11", "8.21", "12.32", "16.42", "20.53", "24.63")
"""Table 3, column `M_w` [N m]."""
STIFFNESS_RANGE, MEAN_STIFFNESS = ("155.89", "187.30"), "172.71"
"""Section 4 [N m/rad]."""
MODULUS_RANGE = {10e3: "140", 60e3: "136"}
"""Section 4: modulus [MPa] by pressure [Pa]; printed as 136-140 MPa for 10 to 60 kPa."""
LARGEST_MOMENT, PRESSURE = "17.51", "50"
"""Section 4: largest moment on link 1 [N m], and the pressure that it demands [kPa]."""
TANK_PRESSURE = 30e6
"""Section 2 [Pa]."""

POISSON_RATIO = 0.25
"""With it both printed moduli come out to their last digit; the paper states none, and 0.3 is the default of the library."""

_TUBE = {"length": 1e-3 * float(LENGTH), "radius": 1e-3 * float(RADIUS), "wall_thickness": 1e-3 * float(WALL)}


def sizes() -> list[Row]:
    """Sizes of the prototype and of the robot."""
    robot, test = InflatableArm(), BendingTest()
    result = {
        "length L of a link": (LENGTH, robot.link_lengths),
        "radius r": (RADIUS, robot.radius),
        "wall thickness t": (WALL, robot.wall_thickness),
        "first wrinkle l1": (HINGE, robot.hinge_offset),
    }
    rows = [
        taken(rounded("section 3" if name[0] != "f" else "section 4", name, printed, 1e3 * float(np.ravel(value)[0]), "mm"))
        for name, (printed, value) in result.items()
    ]
    rows.append(taken(rounded("section 4", "distance h of the probe", PROBE, 1e3 * test.probe_distance, "mm")))
    litres = 1e3 * robot.tank_volume(TANK_PRESSURE)
    rows.append(
        own(
            "section 2",
            "tank that inflates the whole arm to 50 kPa",
            litres,
            "litre",
            "from 30 MPa, in space",
            "limited in size",
        )
    )
    return rows


def deflection() -> list[Row]:
    """Equation (1), and the modulus that it gives from the mean stiffness."""
    load = {"pressure": 50e3, "young_modulus": 138e6}
    ours = float(inflated_beam.deflection(_TUBE["length"], 10.0, **_TUBE, **load))
    printed = deflection_as_printed(_TUBE["length"], 10.0, **load)
    note = "printed + x^3/6, must be -: a cantilever has v(l) = F l^3/(3 E I) and shear. 10 N, 50 kPa, 138 MPa, nu = 0.3"
    rows = [erratum("(1)", "deflection of the tip", 1e3 * printed, 1e3 * ours, "mm", note)]
    stiffness = float(MEAN_STIFFNESS)

    def modulus(pressure: float, ratio: float) -> float:
        found = inflated_beam.young_modulus_from_stiffness(stiffness, pressure=pressure, **_TUBE, poisson_ratio=ratio)
        return 1e-6 * float(found)

    low, high = MODULUS_RANGE
    at = {pressure: f"E from the mean k at {pressure / 1e3:g} kPa" for pressure in MODULUS_RANGE}
    note = "assumed, the paper does not say: force at the full length, theta = v/L, G = E/(2(1 + nu)), "
    moduli = [rounded("section 4", at[low], MODULUS_RANGE[low], modulus(low, 0.3), "MPa", note + "nu = 0.3")]
    why = "nu = 0.3; allowed: 1 MPa. Within the printed range, but 137 by rounding: cut, or another nu (next rows)"
    moduli.append(within("section 4", at[high], MODULUS_RANGE[high], modulus(high, 0.3), 1.0, "MPa", why))
    for pressure, text in MODULUS_RANGE.items():
        note = "the same with nu = 0.25; any nu from 0.20 to 0.25 rounds to both prints"
        moduli.append(rounded("section 4", at[pressure], text, modulus(pressure, POISSON_RATIO), "MPa", note))
    rows += [fitted(row, "E from (1), force at the full length") for row in moduli]
    twice = 1e-6 * _modulus_as_printed(stiffness, low)
    note = "with the printed sign; the paper's own 140 MPa needs the minus"
    rows.append(erratum("(1)", at[low], twice, modulus(low, 0.3), "MPa", note))
    return rows


def table_3() -> list[Row]:
    """Equation (3) and Table 3."""
    radius = _TUBE["radius"]
    rows = [
        rounded(
            "Table 3, (3)",
            f"M_w at {row.pressure / 1e3:g} kPa",
            text,
            inflated_beam.wrinkling_moment(row.pressure, radius),
            "N m",
        )
        for row, text in zip(TABLE_3, WRINKLING_MOMENTS, strict=True)
    ]
    stiffness = [row.stiffness for row in TABLE_3]
    note = "of the six printed k; those are measured"
    rows.append(taken(rounded("section 4", "mean stiffness", MEAN_STIFFNESS, float(np.mean(stiffness)), "N m/rad", note)))
    for name, text, value in zip(("smallest", "largest"), STIFFNESS_RANGE, (min(stiffness), max(stiffness)), strict=True):
        rows.append(taken(rounded("section 4", f"{name} stiffness", text, value, "N m/rad", note)))
    moments = {row.pressure: row.max_moment for row in TABLE_3 if row.max_moment is not None}
    share = min(moment / inflated_beam.wrinkling_moment(pressure, radius) for pressure, moment in moments.items())
    note = "above 1 in all five rows: the largest moment lies beyond the first wrinkle"
    rows.append(own("Table 3", "smallest M_max / M_w", share, "", note, "follows the trend"))
    raw = "force and displacement of the tests are not published, so the regression cannot be repeated"
    columns: dict[str, tuple[str, list[str]]] = {
        "k": ("N m/rad", [f"{row.stiffness:.2f}" for row in TABLE_3]),
        "sigma_k": ("N m/rad", [f"{row.stiffness_std:.2f}" for row in TABLE_3]),
        "M_max": ("N m", [f"{moment:.2f}" for moment in moments.values()]),
    }
    for name, (unit, texts) in columns.items():
        rows.append(absent(MEASURED, "Table 3", name, f"{texts[0]} ... {texts[-1]}", unit, raw))
    note = f"exact geometry of the test evaluated for small angles, as the paper does; its sigma_k is {_std():.1f} % or more"
    rows.append(own("section 4", "largest error of k by small angles", 100.0 * _small_angle_error(), "%", note))
    rows.append(absent(MEASURED, "Figure 9", "points of the tests", note=raw))
    knee = max(moment / row.stiffness for row, moment in zip(TABLE_3, moments.values(), strict=False))
    note = "of the curves tau = min(k theta, M_max) from Table 3, see the picture; the paper prints no number"
    rows.append(own("Figure 9", "largest angle of a knee, M_max / k", knee, "rad", note))
    return rows


def springs() -> list[Row]:
    """Equations (2) and (7), and the pressure that the largest moment demands."""
    found = solve_equilibrium(arm(), (0.3, 0.6, -0.8), FORCE)
    apart = float(np.abs(found.spring_torques - float(MEAN_STIFFNESS) * found.q_springs).max())
    rows = [taken(equation("(2), (7)", "torques of the springs, tau_k = k q_k", apart, "N m", "posture (0.3, 0.6, -0.8) rad"))]
    moment, radius = float(LARGEST_MOMENT), _TUBE["radius"]
    tabulated = inflated_beam.required_tabulated_pressure(moment, radius)
    if tabulated is not None:
        note = "the first pressure of Table 3 whose M_w is above 17.51 N m"
        rows.append(rounded("section 4", "pressure for 17.51 N m", PRESSURE, 1e-3 * tabulated, "kPa", note))
    exact = 1e-3 * inflated_beam.required_pressure(moment, radius)
    rows.append(own("(3)", "pressure for 17.51 N m, exact", exact, "kPa", "M_w = 17.51 N m", ">= 50"))
    size = float(np.linalg.norm(FORCE))
    reach = 2.0 * _TUBE["length"] - 1e-3 * float(HINGE)
    note = f"of the load of 18.03 N about the hinge of link 1, at least; it can be, the arm beyond is {reach:g} m long"
    rows.append(own("section 4", "lever arm that 17.51 N m needs", moment / size, "m", note))
    return rows


def deflection_as_printed(position: float, force: float, *, pressure: float, young_modulus: float) -> float:
    """(1) of the prototype as it is printed, with `+ x^3/6`, the force at the full length and nu = 0.3 [m]."""
    cap, wall, second = _section(pressure)
    bending, shear = (young_modulus + cap / wall) * second, cap + 0.5 * young_modulus / 2.6 * wall
    return force * ((_TUBE["length"] * position**2 / 2.0 + position**3 / 6.0) / bending + position / shear)


def _modulus_as_printed(stiffness: float, pressure: float) -> float:
    """Modulus that (1) as printed gives from a stiffness `L^2 / v(L)` at 1 N, by halving an interval [Pa]."""
    low, high = 1e6, 1e10
    for _ in range(200):
        middle = math.sqrt(low * high)
        soft = _TUBE["length"] ** 2 / deflection_as_printed(_TUBE["length"], 1.0, pressure=pressure, young_modulus=middle)
        low, high = (middle, high) if soft < stiffness else (low, middle)
    return low


def _section(pressure: float) -> tuple[float, float, float]:
    """Cap force [N], section of the wall [m^2] and second moment [m^4], as section 2.1 defines them."""
    radius, wall = _TUBE["radius"], _TUBE["wall_thickness"]
    return pressure * math.pi * radius**2, 2.0 * math.pi * radius * wall, math.pi * radius**3 * wall


def _std() -> float:
    """Smallest printed `sigma_k / k` [%]."""
    return 100.0 * min(row.stiffness_std / row.stiffness for row in TABLE_3)


def _small_angle_error() -> float:
    """Largest relative error of `k`, where exact tests are evaluated for small angles, over the rows of Table 3.

    The probe pushes the wall, a radius from the axis, 1.6 times as far as the knee (or to the wrinkling moment).
    """
    test = BendingTest(offset=_TUBE["radius"])
    errors = []
    for row in TABLE_3:
        limit = inflated_beam.wrinkling_moment(row.pressure, _TUBE["radius"])
        most = row.max_moment or limit
        angle = np.linspace(0.0, (1.6 if row.max_moment else 1.0) * most / row.stiffness, 60)
        torque = inflated_beam.moment(angle, stiffness=row.stiffness, max_moment=most)
        moved = test.displacement(angle)
        force = torque / test.moment(moved, np.ones_like(moved))
        read = test.small_angles(moved, force)
        fit = inflated_beam.fit_characterisation(*read, pressure=row.pressure, radius=_TUBE["radius"], angle_offset=0.0)
        errors.append(abs(fit.stiffness / row.stiffness - 1.0))
    return max(errors)


JOBS = (sizes, deflection, table_3, springs)
"""What makes the rows on the link."""
