r"""Bending of an inflated tube whose wall carries tension only: when it goes slack, and its moment beyond that.

Membrane theory of Comer and Levy (AIAA Journal, 1963) and Stein and Hedgepeth (NASA TN D-813, 1961). The wall of a section is
taut over the half angle `u` from the most stretched fibre; the other :math:`t_0 = \pi - u` on either side are slack. With the
moment `M_1` at which the first fibre goes slack, and :math:`\theta_1 = M_1 / k` of a hinge of stiffness `k`,

.. math:: D = \sin u - u \cos u, \qquad \theta / \theta_1 = \pi / D, \qquad M / M_1 = (u - \sin u \cos u) / D

The moment tends to `2 M_1`, at which the tube collapses.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import common_shape, finite_array, non_negative_array, positive_array

_START = (0.779683, -0.796083, 0.69673, -0.592257, 0.346258, -0.106711)  # u = pi s (1 - w _START(w)) to 2e-5; see `softening`
_SERIES = tuple(
    tuple((-1.0) ** j / math.factorial(2 * j + k) for j in reversed(range(13))) for k in (4, 5)
)  # Stumpff functions c_4 and c_5 of squared angles up to pi^2, to rounding


class MomentLimits(NamedTuple):
    """Moments at which the state of an inflated tube changes, arrays of one shape [N m]."""

    slack: Any
    """The first fibre of the wall goes slack, `pi p r^3 / 2` without axial force."""
    wrinkling: Any
    """Half of the circumference is slack, `pi^2 p r^3 / 4`: [Troise 2021] (3)."""
    collapse: Any
    """No wall is taut, `pi p r^3`: no moment is larger."""


class SlackWallMoment(NamedTuple):
    """A bent section with its wall partly slack, arrays of one shape."""

    moment: Any
    """Moment, of the sign of the angle [N m]."""
    tangent: Any
    """Its derivative with respect to the angle [N m/rad]."""
    energy: Any
    """Energy stored [J]."""
    slack_half_angle: Any
    """Half of the part of the circumference that is slack, `t_0` [rad]; 0 where none is."""


def moment_limits(pressure: Any, radius: Any, axial_force: Any = 0.0) -> MomentLimits:
    r"""Return the moments at which the wall goes slack, half of it is slack, and the tube collapses.

    The wall of a straight tube carries the cap force :math:`P = p \pi r^2` and the axial force `N` together, so all three are
    proportional to `P + N`: :math:`(P + N) r` times 1/2, :math:`\pi/4` and 1. They are zero where the push exceeds the cap
    force, and without pressure, which keeps the tube round.

    Args:
        pressure: Gauge pressure [Pa], zero or positive.
        radius: Tube radius [m], positive.
        axial_force: Axial force `N`, positive in tension [N].

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    pressures, radii = non_negative_array("pressure", pressure, "Pa"), positive_array("radius", radius, "m")
    forces = finite_array("axial_force", axial_force, None, "N")
    common_shape("axial_force", common_shape("radius", pressures.shape, radii.shape), forces.shape)
    collapse = np.where(pressures > 0.0, np.maximum(pressures * math.pi * radii**2 + forces, 0.0) * radii, 0.0)[()]
    return MomentLimits(0.5 * collapse, 0.25 * math.pi * collapse, collapse)


def slack_wall_moment(angle: Any, *, stiffness: Any, slack_moment: Any) -> SlackWallMoment:
    r"""Return moment, tangent and energy of a hinge whose wall goes slack.

    Linear up to `slack_moment`; beyond as in the head of this module. The tangent is continuous, but falls from `stiffness` as
    the square root of the angle beyond :math:`\theta_1`. The energy is, with the moment,

    .. math:: U = M_1 \theta_1 + \theta \, (M / 2 + M_1 \cos u)

    Args:
        angle: Angle of the hinge [rad].
        stiffness: Stiffness `k` of the taut tube [N m/rad], positive.
        slack_moment: Moment `M_1` at which the first fibre goes slack [N m], positive; `moment_limits(...).slack`.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    angles, stiff = finite_array("angle", angle, None, "rad"), positive_array("stiffness", stiffness, "N m/rad")
    first = positive_array("slack_moment", slack_moment, "N m")
    common_shape("slack_moment", common_shape("stiffness", angles.shape, stiff.shape), first.shape)
    ratio = stiff * np.abs(angles) / first
    beyond = np.maximum(ratio, 1.0)
    size, slope, energy, taut = softening(beyond, *softening_start(beyond))
    linear = ratio <= 1.0
    return SlackWallMoment(
        np.sign(angles) * first * np.where(linear, ratio, size),
        stiff * np.where(linear, 1.0, slope),
        first**2 / stiff * np.where(linear, 0.5 * ratio**2, energy),
        np.where(linear, 0.0, math.pi - taut)[()],
    )


def softening_start(ratio: Any) -> tuple[Any, Any]:
    """Return the start of `softening` for a float or an array: `s`, the power -1/3 of the ratio, and the root of `1 - s`."""
    start = ratio ** (-1.0 / 3.0)
    return start, (1.0 - start) ** 0.5


def softening(ratio: Any, start: Any, root: Any) -> tuple[Any, Any, Any, Any]:
    r"""Return the law beyond the first slack fibre, in units of `M_1` and :math:`\theta_1`; arguments are not checked.

    Plain arithmetic, for floats, arrays and the traced expressions of compiled solvers alike. `D(u)` is solved for `u` by two
    Newton steps from a polynomial; all terms are Stumpff functions of :math:`u^2`, so that nothing cancels near collapse.

    .. math:: dM/d\theta = (u + \sin u \cos u - 2 \sin^2 u / u) / \pi

    Args:
        ratio: Angle over that of the first slack fibre, at least 1.
        start: Its power of -1/3, at most 1; to 1e-6, because Newton's method begins there.
        root: Square root of 1 less that.

    Returns:
        Moment, tangent, energy and the taut half angle `u` [rad].
    """
    share = 0.0
    for coefficient in reversed(_START):
        share = share * root + coefficient
    taut = math.pi * start * (1.0 - root * share)
    for _ in range(2):
        square = taut * taut
        c2, c3, _, _ = _stumpff(square)
        slope = square * (1.0 - square * c3)  # u sin u, zero at the first slack fibre, where the sum keeps the step finite
        missed = taut * square * (c2 - c3) - math.pi / ratio
        taut = taut - missed * slope / (slope * slope + 1e-18 * square * square)
    square = taut * taut
    c2, c3, c4, c5 = _stumpff(square)
    moment = (c2 + c3 - square * c2 * c3) / (c2 - c3)
    tangent = square * square * taut * (c4 - 3.0 * c5 + c3 * (c2 - 2.0 * c3)) * (1.0 / math.pi)
    energy = ratio * (0.5 * moment + 1.0 - square * c2) + 1.0
    return moment, tangent, energy, taut


def _stumpff(square: Any) -> tuple[Any, Any, Any, Any]:
    """Stumpff functions `c_2` to `c_5` of a squared angle up to `pi^2`; see `softrobots.constant_curvature.stumpff`."""
    c4, c5 = 0.0, 0.0
    for of_four, of_five in zip(*_SERIES, strict=True):
        c4, c5 = c4 * square + of_four, c5 * square + of_five
    return 0.5 - square * c4, 1.0 / 6.0 - square * c5, c4, c5
