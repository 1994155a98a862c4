"""Bending tests of an inflated link: the paper's table, the moment-angle law, and its fit to raw data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.checks import FloatArray, finite_array, positive_number
from softrobots.errors import ParameterError
from softrobots.inflated_beam.beam import required_pressure, wrinkling_moment


class CharacterisationRow(NamedTuple):
    """One row of [Troise 2021], Table 3 (measured on the prototype link)."""

    pressure: float
    """Gauge pressure [Pa]."""
    stiffness: float
    """Fitted stiffness `k` [N m/rad]."""
    stiffness_std: float
    """Its standard deviation [N m/rad]."""
    max_moment: float | None
    """Mean moment beyond wrinkling [N m]; None where the paper prints N/A."""


TABLE_3 = (
    CharacterisationRow(10e3, 182.56, 3.37, 4.99),
    CharacterisationRow(20e3, 187.30, 1.48, 9.45),
    CharacterisationRow(30e3, 155.89, 2.66, 14.99),
    CharacterisationRow(40e3, 174.42, 6.22, 18.77),
    CharacterisationRow(50e3, 169.44, 5.51, 21.76),
    CharacterisationRow(60e3, 166.66, 4.99, None),
)
"""Characterisation of the prototype link, [Troise 2021] Table 3."""

MEAN_STIFFNESS = 172.71
"""Mean stiffness of the prototype link as printed in [Troise 2021] [N m/rad]; the six rows average 172.7117."""


def required_tabulated_pressure(moment: float, radius: float) -> float | None:
    """Smallest pressure of [Troise 2021] Table 3 whose wrinkling moment is at least `moment`.

    Args:
        moment: Bending moment [N m], zero or positive.
        radius: Tube radius [m], positive.

    Returns:
        The pressure [Pa]; None if the moment exceeds the highest row.

    Raises:
        ParameterError: If an argument is out of range.
    """
    exact = required_pressure(moment, radius)
    return next((row.pressure for row in TABLE_3 if row.pressure >= exact), None)


def moment(angle: Any, *, stiffness: float, max_moment: float) -> FloatArray:
    """Moment of a link bent by an angle: `tau = sign(theta) min(k |theta|, M_max)`, [Troise 2021] section 4.

    Args:
        angle: Hinge angle [rad], any shape.
        stiffness: Stiffness `k` [N m/rad], positive.
        max_moment: Saturation moment `M_max` [N m], positive.

    Returns:
        Moment [N m], shape of `angle`.

    Raises:
        ParameterError: If an argument is out of range.
    """
    theta = finite_array("angle", angle, (None,) * np.ndim(angle), "rad")
    stiffness = positive_number("stiffness", stiffness, "N m/rad")
    max_moment = positive_number("max_moment", max_moment, "N m")
    return np.asarray(np.clip(stiffness * theta, -max_moment, max_moment))


@dataclass(frozen=True)
class Characterisation:
    """What `fit_characterisation` finds in the raw data of a bending test."""

    stiffness: float
    """Slope of the points below wrinkling, through the origin [N m/rad]."""
    stiffness_std: float
    """Its standard error [N m/rad]."""
    max_moment: float | None
    """Mean moment of the points past the knee `M_max / k` [N m]; None if no point is there."""
    mean_moment_above_wrinkling: float | None
    """Mean moment of all points above the wrinkling moment, the paper's `M_max` read literally [N m]; it includes the
    points still rising between `M_w` and `M_max`, so it lies below `max_moment`. None if no point is above."""
    wrinkling_moment: float
    """`M_w` of [Troise 2021] (3) [N m]."""
    n_linear: int
    """How many points the slope was fitted on."""
    n_saturated: int
    """How many points `max_moment` was averaged over."""


def fit_characterisation(angle: Any, moment: Any, *, pressure: float, radius: float) -> Characterisation:
    """Fit the moment-angle law to the raw data of a bending test, as [Troise 2021] section 4 did.

    The stiffness is the least-squares slope, through the origin (law (2) has no offset), of the points whose moment is
    below the theoretical wrinkling moment (3). The saturation moment is the mean of the points past the knee, found by
    repeating "average the points with `k |theta|` above the last average" until it stands still. Negative angles count
    by their absolute value (the law is odd).

    Args:
        angle: Hinge angles [rad], shape (n,).
        moment: Moments [N m], shape (n,).
        pressure: Gauge pressure of the test [Pa], positive.
        radius: Tube radius [m], positive.

    Returns:
        The fit and what it rests on.

    Raises:
        ParameterError: If shapes differ, a number is not finite, pressure or radius is not positive, fewer than three points
            lie below wrinkling, or the fitted slope is not positive.
    """
    theta = finite_array("angle", angle, (None,), "rad")
    tau = finite_array("moment", moment, theta.shape, "N m")
    limit = wrinkling_moment(positive_number("pressure", pressure, "Pa"), radius)
    tau = np.where(theta < 0.0, -tau, tau)
    theta = np.abs(theta)
    linear = tau < limit
    n_linear = int(np.count_nonzero(linear))
    spread = float(theta[linear] @ theta[linear])
    if n_linear < 3 or spread == 0.0:
        raise ParameterError("moment", moment, f"data with at least three loaded points below wrinkling at {limit:.4g} N m")
    stiffness = float(theta[linear] @ tau[linear]) / spread
    if stiffness <= 0.0:
        raise ParameterError("moment", moment, "of the same sign as the angle (the fitted slope is not positive)")
    scatter = tau[linear] - stiffness * theta[linear]
    above = tau[~linear]
    saturated, plateau = ~linear, float(above.mean()) if above.size else limit
    for _ in range(100):
        following = (stiffness * theta > plateau) & (tau >= 0.5 * limit)
        if not following.any() or np.array_equal(following, saturated):
            break
        saturated, plateau = following, float(tau[following].mean())
    return Characterisation(
        stiffness=stiffness,
        stiffness_std=math.sqrt(float(scatter @ scatter) / (n_linear - 1) / spread),
        max_moment=plateau if above.size else None,
        mean_moment_above_wrinkling=float(above.mean()) if above.size else None,
        wrinkling_moment=limit,
        n_linear=n_linear,
        n_saturated=int(np.count_nonzero(saturated)) if above.size else 0,
    )
