"""Tables 1 and 2 and equation (4) of [Troise 2021] as printed: Denavit-Hartenberg products and the Jacobian on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray


class DhRow(NamedTuple):
    """One row of a Denavit-Hartenberg table."""

    length: str
    """Entry of the column `a`: "0", or the name of a length."""
    twist: float
    """Entry of the column `alpha` [rad]; every `d` is zero."""


TABLE_1 = (DhRow("0", math.pi / 2), DhRow("L", 0.0), DhRow("L", 0.0))
"""[Troise 2021] Table 1: the rigid arm."""

TABLE_2 = (
    DhRow("0", math.pi / 2),
    DhRow("l1", -math.pi / 2),
    DhRow("0", math.pi / 2),
    DhRow("l2", 0.0),
    DhRow("l1", -math.pi / 2),
    DhRow("0", math.pi / 2),
    DhRow("l2", 0.0),
)
"""[Troise 2021] Table 2: the arm with springs. Joints 1, 2 and 5 are motors, the others springs."""

MOTORS, SPRINGS = (0, 1, 4), (2, 3, 5, 6)
"""Places of the motors and of the springs among the seven joints, section 2.2."""


def frames(table: Sequence[DhRow], angles: FloatArray, lengths: dict[str, float]) -> list[FloatArray]:
    """Transforms of frames 0 to n to the base: products of `Rz(theta) Tz(d) Tx(a) Rx(alpha)`.

    Args:
        table: The table.
        angles: Joint angles, shape (n,) [rad].
        lengths: The lengths that the table names [m].

    Returns:
        n + 1 transforms, each (4, 4), translation in metres.
    """
    placed: list[FloatArray] = [np.eye(4)]
    for row, angle in zip(table, angles, strict=True):
        a = 0.0 if row.length == "0" else lengths[row.length]
        ct, st, ca, sa = math.cos(angle), math.sin(angle), math.cos(row.twist), math.sin(row.twist)
        step = [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0.0, sa, ca, 0.0], [0.0, 0.0, 0.0, 1.0]]
        placed.append(placed[-1] @ np.array(step))
    return placed


def jacobian(placed: Sequence[FloatArray]) -> FloatArray:
    """Geometric Jacobian of the last frame, [Troise 2021] (4): columns `[z_{i-1} x (p_e - p_{i-1}); z_{i-1}]`.

    Args:
        placed: Transforms of frames 0 to n.

    Returns:
        Shape (6, n), linear rows first [m/rad; rad/rad].
    """
    tip = placed[-1][:3, 3]
    columns = [np.concatenate([np.cross(pose[:3, 2], tip - pose[:3, 3]), pose[:3, 2]]) for pose in placed[:-1]]
    return np.array(columns).T
