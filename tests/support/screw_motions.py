"""Motions of a section of constant strain by SciPy and mpmath."""

from __future__ import annotations

import math
from typing import Any

import mpmath as mp
import numpy as np
from scipy.linalg import expm

H = 0.131  # rest length of a section of the default arm [m]


def exact_stumpff(k: int, x: float) -> Any:
    """The series of the definition at 100 digits: with 200 terms exact to 1e-50 up to an angle of 60."""
    with mp.workdps(100):
        square = mp.mpf(x)
        return mp.fsum((-square) ** j / mp.factorial(2 * j + k) for j in range(200))


def screw_matrix(z: np.ndarray, h: float) -> np.ndarray:
    """Motion of a section of constant strain, by scipy."""
    x, y, twist, stretch = z
    return expm(np.array([[0, -twist, y, 0], [twist, 0, -x, 0], [-y, x, 0, h + stretch], [0, 0, 0, 0]]))


def exact_screw(x: Any, y: Any, twist: Any, stretch: Any) -> Any:
    """The same by mpmath, at rest length H."""
    return mp.expm(mp.matrix([[0, -twist, y, 0], [twist, 0, -x, 0], [-y, x, 0, mp.mpf(H) + stretch], [0, 0, 0, 0]]))


def rotation(axis: int, angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    made = np.eye(4)
    made[i, i], made[j, j], made[i, j], made[j, i] = c, c, -s, s
    return made
