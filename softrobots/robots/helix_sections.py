"""The sections of constant strain of a helical tube: their strains, and how many it needs."""

from __future__ import annotations

import math

import numpy as np

from softrobots.constant_curvature.strain_chain import LARGEST_BENDING, in_range
from softrobots.core.checks import FloatArray
from softrobots.robots.continuum_arm import MOST_SECTIONS


def actuator_strains(contraction: float, angle: float, diameter: float, sign: float) -> FloatArray:
    r"""Return the strains of the line of the actuator, per length that it has at contraction 1, in frames that follow it.

    .. math:: k_y = \frac{\cos 2\theta - \lambda}{D}, \qquad \tau = \pm\frac{\sin 2\theta}{D}, \qquad \nu = \lambda

    That is (15) of [Blumenschein 2018] times the contraction: the actuator contracts without twist of its frames.

    Args:
        contraction: Contracted over original length `lambda`, in (0, 1] [-].
        angle: Angle `theta` of the actuator to the axis of the tube, in [0, pi/2) [rad].
        diameter: Diameter `D` of the tube, positive [m].
        sign: 1 for a right-handed helix, -1 for a left-handed one.

    Returns:
        `(kx, ky, tau, stretch)`, shape (4,) [rad/m, rad/m, rad/m, -].
    """
    bend = (math.cos(2.0 * angle) - contraction) / diameter
    return np.array([0.0, bend, sign * math.sin(2.0 * angle) / diameter, contraction])


def fewest_sections(strains: FloatArray, length: float) -> int:
    """Return how many sections keep their coordinates in range: none bends by more than 170 degrees or twists by half a turn.

    Args:
        strains: Strains of the chain `(kx, ky, tau, stretch)`, shape (4,) [rad/m, rad/m, rad/m, -].
        length: Rest length of the chain [m].

    Returns:
        Their number; `MOST_SECTIONS` + 1 or more if more than `MOST_SECTIONS` are needed.
    """
    total = (strains - [0.0, 0.0, 0.0, 1.0]) * length
    fewest: int = max(1, math.ceil(abs(total[1]) / LARGEST_BENDING), math.ceil(abs(total[2]) / math.pi))
    while fewest <= MOST_SECTIONS and not in_range(total / fewest, length / fewest):
        fewest += 1
    return fewest
