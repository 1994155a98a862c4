"""Moment-angle law of an inflated link: the paper's measured table, and the fit to raw data of a bending test."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, common_shape, finite_array, positive_array, positive_number
from softrobots.core.errors import ParameterError
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
"""Mean stiffness of the prototype link [N m/rad], as printed in [Troise 2021]; the six rows average 172.7117."""


def required_tabulated_pressure(moment: Any, radius: Any) -> Any:
    """Return the smallest pressure of [Troise 2021] Table 3 whose wrinkling moment is at least `moment`.

    Args:
        moment: Bending moment [N m], zero or positive, a number or an array.
        radius: Tube radius [m], positive, a number or an array that broadcasts with it.

    Returns:
        The pressure [Pa], the common shape. Where the moment exceeds the highest row, infinity; None for a single number.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    exact = required_pressure(moment, radius)
    pressures = np.append([row.pressure for row in TABLE_3], np.inf)
    found = pressures[np.searchsorted(pressures, exact)]
    return found if np.ndim(found) else float(found) if np.isfinite(found) else None


def moment(angle: Any, *, stiffness: Any, max_moment: Any) -> Any:
    """Return the moment of a link bent by an angle: `tau = sign(theta) min(k |theta|, M_max)`, [Troise 2021] section 4.

    Args:
        angle: Hinge angle [rad], a number or an array.
        stiffness: Stiffness `k` [N m/rad], positive, a number or an array that broadcasts.
        max_moment: Saturation moment `M_max` [N m], positive, a number or an array that broadcasts.

    Returns:
        Moment [N m], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    theta = finite_array("angle", angle, None, "rad")
    k, most = positive_array("stiffness", stiffness, "N m/rad"), positive_array("max_moment", max_moment, "N m")
    common_shape("max_moment", common_shape("stiffness", theta.shape, k.shape), most.shape)
    return np.clip(k * theta, -most, most)


@dataclass(frozen=True)
class Characterisation:
    """Result of `fit_characterisation`."""

    stiffness: float
    """Slope of the points below wrinkling, through the origin [N m/rad]."""
    stiffness_std: float
    """Its standard error [N m/rad]."""
    max_moment: float | None
    """Mean moment of the points past the knee `M_max / k` [N m]; None if fewer than three points are there."""
    mean_moment_above_wrinkling: float | None
    """Mean moment of all points above the wrinkling moment, the literal definition of the paper's `M_max` [N m]; it includes
    the rising points between `M_w` and `M_max`, so it is below `max_moment`. None if no point is above."""
    wrinkling_moment: float
    """`M_w` of [Troise 2021] (3) [N m]."""
    n_linear: int
    """Number of points in the fit of the slope."""
    n_saturated: int
    """Number of points in the mean `max_moment`."""


def fit_characterisation(angle: Any, moment: Any, *, pressure: float, radius: float) -> Characterisation:
    """Fit the moment-angle law to the raw data of a bending test, as [Troise 2021] section 4 did.

    The knee between slope and plateau is the split of the points, ordered by angle, into a line through the origin and a
    constant with the least sum of squares. The stiffness is the slope (law (2) has no offset) of the points before the knee and
    below the theoretical wrinkling moment (3), selected by the angle, `k |theta| < M_w`: the noisy moment would select points
    of the plateau too. The saturation moment is the mean past the knee. Negative angles count by their absolute value (the law
    is odd).

    Args:
        angle: Hinge angles [rad], shape (n,).
        moment: Moments [N m], shape (n,).
        pressure: Gauge pressure of the test [Pa], positive.
        radius: Tube radius [m], positive.

    Returns:
        The fit.

    Raises:
        ParameterError: If shapes differ, a number is not finite, pressure or radius is not positive, fewer than three points
            lie below wrinkling, or the fitted slope is not positive.
    """
    theta = finite_array("angle", angle, (None,), "rad")
    tau = finite_array("moment", moment, theta.shape, "N m")
    limit = float(wrinkling_moment(positive_number("pressure", pressure, "Pa"), positive_number("radius", radius, "m")))
    tau = np.where(theta < 0.0, -tau, tau)
    theta = np.abs(theta)
    order = np.lexsort((tau, theta))  # by angle, then by moment: independent of the order of the input
    theta, tau = theta[order], tau[order]
    if np.count_nonzero(theta) < 3:
        raise ParameterError("angle", angle, "at least three angles different from zero")
    knee = _knee(theta, tau)
    plateau = float(tau[knee:].mean()) if knee < len(theta) else None
    linear = np.arange(len(theta)) < knee
    while True:  # slope and set of points below wrinkling depend on each other; a point left out stays out
        stiffness = _slope(theta, tau, linear, moment, limit)
        below = linear & (stiffness * theta < limit)
        if np.array_equal(below, linear):
            break
        linear = below
    scatter = tau[linear] - stiffness * theta[linear]
    spread, n_linear = float(theta[linear] @ theta[linear]), int(np.count_nonzero(linear))
    above = tau[tau >= limit]
    return Characterisation(
        stiffness=stiffness,
        stiffness_std=math.sqrt(float(scatter @ scatter) / (n_linear - 1) / spread),
        max_moment=plateau,
        mean_moment_above_wrinkling=float(above.mean()) if above.size else None,
        wrinkling_moment=limit,
        n_linear=n_linear,
        n_saturated=len(theta) - knee,
    )


def _knee(theta: FloatArray, tau: FloatArray) -> int:
    """Number of points before the plateau, of points ordered by angle; all of them if there is no plateau.

    A plateau has at least three points, rises with less than half the slope before it, and reduces the sum of squares
    significantly (F-test, ratio 12).
    """
    n = len(theta)
    split = np.arange(3, n + 1)  # candidates: this many points before the knee

    def before(values: FloatArray) -> FloatArray:
        return np.asarray(np.cumsum(values)[split - 1])

    products, squares, moments = before(theta * tau), before(theta**2), before(tau)
    line = before(tau**2) - products**2 / np.maximum(squares, np.finfo(np.float64).tiny)
    after = n - split
    constant = np.sum(tau**2) - before(tau**2) - (np.sum(tau) - moments) ** 2 / np.maximum(after, 1)
    left = np.where((after >= 3) | (after == 0), line + np.where(after > 0, constant, 0.0), np.inf)
    best = int(np.argmin(left))
    rounding = 1e-12 * float(tau @ tau)
    gained = left[-1] - left[best]
    past = theta[split[best] :] - theta[split[best] :].mean() if after[best] else np.zeros(0)
    rise, slope = float(past @ tau[split[best] :]), float(products[best] / max(squares[best], np.finfo(np.float64).tiny))
    if rise >= 0.5 * slope * float(past @ past):  # still rising at half the slope: softer, but no plateau
        return n
    return int(split[best]) if gained > 12.0 * max(left[best], rounding) / max(n - 3, 1) + rounding else n


def _slope(theta: FloatArray, tau: FloatArray, linear: Any, moment: Any, limit: float) -> float:
    """Least-squares slope through the origin of the chosen points."""
    spread = float(theta[linear] @ theta[linear])
    if np.count_nonzero(linear) < 3 or spread == 0.0:
        raise ParameterError("moment", moment, f"data with at least three loaded points below wrinkling at {limit:.4g} N m")
    slope = float(theta[linear] @ tau[linear]) / spread
    if slope <= 0.0:
        raise ParameterError("moment", moment, "of the same sign as the angle (the fitted slope is not positive)")
    return slope
