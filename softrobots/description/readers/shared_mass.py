r"""A little mass for links that other formats do not have: those between the joints of one body.

URDF has one joint a link, so a body with two hinges becomes two links, and the first has nothing of its own. Statics do not
mind, but simulators refuse moving links without mass. A point mass on the axis of a hinge is at rest in both links of that
hinge, so the body can give one to the link before it, and no torque changes: with mass `e` at the point `a`,

.. math:: m' = m - e, \quad m' c' = m c - e a, \quad P' = P - \frac{m e}{m'} (a - c) (a - c)^T

where `P = trace(I) / 2 - I` is the second moment of the body about its centre of mass `c`. `P'` must be that of a real body,
too.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.description.rigid_tree import Body, Placement

_MOST, _SHARE = 1e-4, 0.05  # [kg], and the part of the body's mass that goes at most
_NARROWING = 0.25  # the part of its second moment along the way to the point that goes at most
_LEAST = 1e-9  # [kg]; less is not worth having


def give_mass(body: Body, point: FloatArray, count: int) -> tuple[Body, float]:
    """Take point masses out of a body.

    Args:
        body: A body.
        point: Where they are in the frame of the body, shape (3,) [m].
        count: How many.

    Returns:
        The lighter body, and the mass of each point [kg]; the same body and 0 if it is too light or too small to give any.
    """
    if body.mass <= 0.0 or count == 0:
        return body, 0.0
    moments = _second_moment(body.inertia_in_body)
    away = point - body.centre.position
    if np.linalg.eigvalsh(moments)[0] <= 0.0:
        return body, 0.0
    narrowness = float(away @ np.linalg.solve(moments, away))
    given = min(_MOST * count, _SHARE * body.mass, _NARROWING / max(narrowness, _NARROWING / body.mass))
    if given < _LEAST * count:
        return body, 0.0
    left = body.mass - given
    centre = (body.mass * body.centre.position - given * point) / left
    moments = moments - (body.mass * given / left) * np.outer(away, away)
    inertia = np.trace(moments) * np.eye(3) - moments
    return replace(body, mass=left, centre=Placement(read_only(centre)), inertia=read_only(inertia)), given / count


def small_ball(name: str, mass: float, point: FloatArray, radius: float) -> Body:
    """A link that has nothing but a small mass.

    Args:
        name: Its name.
        mass: Its mass [kg]; 0 gives a link without inertia.
        point: Where the mass is, shape (3,) [m].
        radius: Radius of gyration [m]: the turning of such a link is nothing to the statics.
    """
    return Body(name, mass, Placement(read_only(point)), read_only(mass * radius**2 * np.eye(3)))


def gyration(body: Body) -> float:
    """Mean radius of gyration of a body [m]; 0 without mass."""
    return float(np.sqrt(np.trace(body.inertia) / (3.0 * body.mass))) if body.mass > 0.0 else 0.0


def _second_moment(inertia: FloatArray) -> FloatArray:
    return np.asarray(0.5 * np.trace(inertia) * np.eye(3) - inertia)
