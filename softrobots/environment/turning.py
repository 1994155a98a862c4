r"""How normals and touching points of candidates move with the robot, for forces that are not along the normal.

The nearest point of a core moves with its material and along the core: :math:`\delta x = u + t\,\delta s` with
:math:`\delta s = -(t^T H u + n^T \delta t) / t^T H t` where the minimum is inside of the core, else 0. The normal turns by
:math:`\delta n = H\,\delta x`, and the point on the surface moves by :math:`\delta x - r\,\delta n`.
"""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.vectors import cross
from softrobots.environment.candidates import INSIDE
from softrobots.environment.distance_fields import HalfSpaces
from softrobots.environment.gaps import Gaps


def turning(gaps: Gaps) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of normals and of touching points on the surface of the robot by the joint coordinates.

    At crossed borders the point is taken as fixed in its core.

    Returns:
        Both of shape (m, 3, nv); those of the points count how they move over the surface, too.
    """
    core = gaps.point_jacobian(np.arange(len(gaps)), gaps.core_points)
    normals, first = np.zeros_like(core), 0
    for field, which in gaps.parts:
        rows = np.arange(first, first + len(which))
        first += len(which)
        if isinstance(field, HalfSpaces) or not len(rows):
            continue
        places = (gaps.core_points[rows], gaps.distances[rows], gaps.normals[rows])
        bends = [field.bends(*one) for one in zip(which.tolist(), *(part.tolist() for part in places), strict=True)]
        hessian = np.array([sum((weight * np.outer(a, a) for a, weight in one), np.zeros((3, 3))) for one in bends])
        spans = gaps.places.spans[gaps.capsules[rows]]
        pulls = (hessian @ spans[:, :, None])[:, :, 0]
        bend = (pulls * spans).sum(axis=1)
        slides = (gaps.features[rows] == INSIDE) & (bend > 0.0)
        turned = cross(spans, gaps.normals[rows])[:, None, :] @ (gaps.places.jacobian[3:] * gaps.moves[rows][:, None, :])
        along = (pulls[:, None, :] @ core[rows] + turned) / np.where(slides, bend, 1.0)[:, None, None]
        core[rows] -= np.where(slides, 1.0, 0.0)[:, None, None] * spans[:, :, None] * along
        normals[rows] = hessian @ core[rows]
    return normals, core - gaps.radii[:, None, None] * normals
