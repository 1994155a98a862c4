r"""Mass of the links between several joints of one body, which URDF needs and other formats do not have.

Simulators refuse moving links without mass. A point mass on the axis of a hinge is fixed in both links of that hinge, so the
body can give one to the link before the hinge without changing any torque: with mass `e` at the point `a`,

.. math:: m' = m - e, \quad m' c' = m c - e a, \quad P' = P - \frac{m e}{m'} (a - c) (a - c)^T

where `P = trace(I) / 2 - I` is the second moment of the body about its centre of mass `c`. `P'` must be positive definite.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.description.rigid_tree import Body, Placement

_MOST, _SHARE = 1e-4, 0.05  # largest mass [kg] and largest share of the body's mass
_NARROWING = 0.25  # largest share of the second moment along the line to the point
_LEAST = 1e-9  # [kg]; smaller masses are useless


def give_mass(body: Body, point: FloatArray, count: int) -> tuple[Body, float]:
    """Move point masses from a body to other links.

    Args:
        body: The body.
        point: Their position in its frame, shape (3,) [m].
        count: Their number.

    Returns:
        The lighter body, and the mass of each point [kg]; the same body and 0 if it is too light or too small.
    """
    if body.mass <= 0.0 or count == 0:
        return body, 0.0
    inertia = body.inertia_in_body
    moments = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    away = point - body.centre.position
    if np.linalg.eigvalsh(moments)[0] <= 0.0:
        return body, 0.0
    narrowness = float(away @ np.linalg.solve(moments, away))
    moved = min(_MOST * count, _SHARE * body.mass, _NARROWING / max(narrowness, _NARROWING / body.mass))
    if moved < _LEAST * count:
        return body, 0.0
    left = body.mass - moved
    centre = (body.mass * body.centre.position - moved * point) / left
    moments = moments - (body.mass * moved / left) * np.outer(away, away)
    inertia = np.trace(moments) * np.eye(3) - moments
    return replace(body, mass=left, centre=Placement(read_only(centre)), inertia=read_only(inertia)), moved / count


def small_ball(name: str, mass: float, point: FloatArray, radius: float) -> Body:
    """Return a link without shape, with a small mass [kg] at a point, shape (3,) [m]; without inertia if the mass is 0.

    The radius of gyration [m] has no effect on the statics.
    """
    return Body(name, mass, Placement(read_only(point)), read_only(mass * radius**2 * np.eye(3)))


def gyration(body: Body) -> float:
    """Return the mean radius of gyration of a body [m]; 0 without mass."""
    return float(np.sqrt(np.trace(body.inertia) / (3.0 * body.mass))) if body.mass > 0.0 else 0.0
