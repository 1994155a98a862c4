r"""How normals and touching points of candidates move with the robot, for forces that are not along the normal.

The nearest point of a core moves with its material and along the core: :math:`\delta x = u + t\,\delta s` with
:math:`\delta s = -(t^T H u + n^T \delta t) / t^T H t` where the minimum is inside of the core, else 0. The normal turns by
:math:`\delta n = H\,\delta x`, and the point on the surface moves by :math:`\delta x - r\,\delta n`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross
from softrobots.environment.candidates import INSIDE
from softrobots.environment.gaps import Gaps


def turning(gaps: Gaps, rows: Any) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of normals and of touching points on the surface of the robot by the joint coordinates.

    At crossed borders the point is taken as fixed in its core.

    Args:
        gaps: The candidates.
        rows: Those that are asked, shape (k,), integers.

    Returns:
        Both of shape (k, 3, nv); those of the points count how they move over the surface, too.
    """
    core, spans = gaps.point_jacobian(rows, gaps.core_points[rows]), gaps.places.spans[gaps.capsules[rows]]
    flat, bends = np.zeros((3, 3)), [gaps.bends(row, gaps.row(row)) for row in rows.tolist()]
    hessian = np.array([sum((weight * np.outer(a, a) for a, weight in one), flat) for one in bends]).reshape(-1, 3, 3)
    pulls = (hessian @ spans[:, :, None])[:, :, 0]
    bend = (pulls * spans).sum(axis=1)
    slides = (gaps.features[rows] == INSIDE) & (bend > 0.0)
    turned = cross(spans, gaps.normals[rows])[:, None, :] @ (gaps.places.jacobian[3:] * gaps.moves[rows][:, None, :])
    along = (pulls[:, None, :] @ core + turned) / np.where(slides, bend, 1.0)[:, None, None]
    core -= np.where(slides, 1.0, 0.0)[:, None, None] * spans[:, :, None] * along
    turns = hessian @ core
    return turns, core - gaps.radii[rows][:, None, None] * turns
