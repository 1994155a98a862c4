"""A membrane tube by numbers: fibres that carry tension only, summed around the circumference."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq


def section_moment(curvature: float, rigidity: float, radius: float, tension: float) -> float:
    """Moment of a section [N m] at a curvature [1/m], from its bending stiffness [N m^2] and the wall's tension [N].

    The force per arc length of a fibre is `max(c (e + curvature r cos(a)), 0)`, with the `c` of `rigidity = pi c r^3`; the mean
    strain `e` is that at which the fibres carry the tension together.
    """
    fibre = rigidity / (math.pi * radius**3)
    nodes, weights = np.polynomial.legendre.leggauss(40)  # exact to rounding for a few cosines

    def resultant(mean: float, power: int) -> float:
        taut = math.acos(max(-1.0, min(1.0, -mean / (curvature * radius))))  # fibres beyond that angle are slack
        angles = 0.5 * taut * (1.0 + nodes)
        forces = fibre * (mean + curvature * radius * np.cos(angles)) * np.cos(angles) ** power
        return float(taut * radius ** (1 + power) * (weights @ forces))

    uniform = tension / (2.0 * math.pi * radius * fibre)  # where no fibre is slack
    low = -curvature * radius * (1.0 - 1e-12)
    mean = brentq(lambda e: resultant(e, 0) - tension, low, max(uniform, -low) * 1.01, xtol=1e-300, rtol=1e-14)
    return resultant(mean, 1)


def hinge_moment(angle: float, stiffness: float, radius: float, tension: float) -> float:
    """Moment of a hinge with such a wall [N m]: a curvature over a length of one."""
    return float(np.sign(angle)) * section_moment(abs(angle), stiffness, radius, tension) if angle else 0.0


def hinge_energy(angle: float, stiffness: float, radius: float, tension: float) -> float:
    """Energy of such a hinge [J]: the moment by Gauss's rule, in halves of the way since the first slack fibre."""
    first = 0.5 * tension * radius / stiffness
    if angle <= first:
        return 0.5 * stiffness * angle**2
    nodes, weights = np.polynomial.legendre.leggauss(20)
    roots = 0.5 * np.sqrt(angle - first) * (1.0 + nodes)  # angles first + root^2: smooth at the first slack fibre
    moments = [hinge_moment(first + root**2, stiffness, radius, tension) for root in roots]
    return 0.5 * stiffness * first**2 + float(0.5 * np.sqrt(angle - first) * weights @ (2.0 * roots * np.array(moments)))
