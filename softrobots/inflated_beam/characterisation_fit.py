"""Fit of the moment-angle law to the raw data of a bending test, with errors that hold for noise of any size at each point."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, finite_number, positive_number
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.result_file import KINDS, Kind, counts
from softrobots.core.summary import Part, Summarised, facts, field_facts
from softrobots.inflated_beam.beam import wrinkling_moment
from softrobots.inflated_beam.fitted_line import FittedLine, student_quantile

CONFIDENCE = 0.95
"""Probability with which the true stiffness lies in `Characterisation.stiffness_interval`."""

_SIGNIFICANT = 12.0  # ratio F by which a plateau must reduce the sum of squares
_BELOW = 0.995  # probability with which the mean moment past the knee must lie below the line


@dataclass(frozen=True, repr=False)
class Characterisation(Summarised):
    """Result of `fit_characterisation`."""

    stiffness: float
    """Slope `k` of the points below wrinkling [N m/rad]."""
    stiffness_std: float
    """Its standard error (HC3), whether the noise is constant or grows with the reading [N m/rad]."""
    stiffness_interval: tuple[float, float]
    """Interval in which the true stiffness lies with a probability of 95 % (HC2, Student's t) [N m/rad]."""
    angle_offset: float
    """Zero error of the angle: its reading where the moment vanishes [rad]; the given one if it was given."""
    angle_offset_std: float
    """Its standard error (HC3) [rad]; 0 if it was given."""
    max_moment: float | None
    """Mean moment of the points past the knee `M_max / k` [N m]; None if there is no plateau."""
    mean_moment_above_wrinkling: float | None
    """Mean moment of all points above the wrinkling moment, the literal definition of the paper's `M_max` [N m]; it includes
    the rising points between `M_w` and `M_max`, so it is below `max_moment`. None if no point is above."""
    wrinkling_moment: float
    """`M_w` of [Troise 2021] (3) [N m]."""
    n_linear: int
    """Number of points in the fit of the slope."""
    n_saturated: int
    """Number of points in the mean `max_moment`; noise may put a point beside the knee into both."""

    def summary_facts(self) -> list[tuple[str, str]]:
        """Return stiffness, zero error, plateau and limits, each with what it is."""
        labels = {
            "stiffness": "stiffness k",
            "stiffness_std": "  standard error",
            "stiffness_interval": "  interval of 95 %",
            "angle_offset": "zero error of the angle",
            "angle_offset_std": "  standard error",
            "max_moment": "plateau M_max",
            "mean_moment_above_wrinkling": "mean above wrinkling",
            "n_linear": "points on the slope",
            "n_saturated": "points on the plateau",
            "wrinkling_moment": "wrinkling (3) at",
        }
        return [(label, words) for label, (_, words) in zip(labels.values(), field_facts(self, *labels), strict=True)]

    def summary_parts(self) -> list[Part]:
        """Return them as a table."""
        return [facts(self.summary_facts())]


def fit_characterisation(
    angle: Any, moment: Any, *, pressure: float, radius: float, angle_offset: float | None = None
) -> Characterisation:
    r"""Fit the moment-angle law to the raw data of a bending test, as [Troise 2021] section 4 did, and its zero error.

    Below wrinkling :math:`\tau = k (\theta - \theta_0)`. The paper's law (2) has no offset; a line through the origin turns a
    zero error of 3 mrad into 4 % of stiffness. The knee between slope and plateau is the split of the points, ordered by the
    size of the angle, into such a line and a constant with the least sum of squares. There is a plateau if the split reduces
    the sum significantly (ratio F above 12), the moment past the knee rises with less than half the slope, and its mean, which
    is the saturation moment, lies below the line by Welch's test at 99.5 %. (Noise that grows with the reading passes the
    first two.) The stiffness is the slope of the points whose moment by the fit is below the theoretical wrinkling moment (3),
    and below the plateau by its standard deviation: noise chose the knee, and would choose points beside it, too. The law is
    odd: moments at negative angles count with the other sign.

    Standard errors are those of a sandwich (HC3; MacKinnon and White 1985, doi:10.1016/0304-4076(85)90158-7), which hold
    for noise that grows with the reading, too:

    .. math:: s_k = \sqrt{\sum_i \left( \frac{x_i e_i}{1 - h_i} \right)^2} \Big/ \sum_i x_i^2

    with the residuals `e`, the angles `x` from their mean (from the offset, if that is given) and the leverages `h`. HC3 is a
    little large for few points, and a quantile of `n - 2` too small; the interval is that of Bell and McCaffrey 2002: the root
    `1 - h` once (HC2), Student's t with the degrees of freedom that this sum has.

    Args:
        angle: Hinge angles [rad], shape (n,).
        moment: Moments [N m], shape (n,).
        pressure: Gauge pressure of the test [Pa], positive.
        radius: Tube radius [m], positive.
        angle_offset: Zero error of the angle, if it is known [rad], 0 for the paper's line through the origin; None: fitted.

    Returns:
        The fit.

    Raises:
        ParameterError: If shapes differ, a number is not finite, pressure or radius is not positive, fewer than three points
            lie below wrinkling or one of them determines the line alone, or the fitted slope is not positive.
    """
    theta = finite_array("angle", angle, (None,), "rad")
    tau = finite_array("moment", moment, theta.shape, "N m")
    fitted = angle_offset is None
    known = 0.0 if angle_offset is None else finite_number("angle_offset", angle_offset, "rad")
    limit = float(wrinkling_moment(positive_number("pressure", pressure, "Pa"), positive_number("radius", radius, "m")))
    if np.count_nonzero(theta - known) < 3:
        raise ParameterError("angle", angle, "at least three angles different from zero")
    law = _Law.of(theta - known, tau, limit, fitted, moment)
    if fitted:  # again about the zero that was found: points on both sides count by their angle from there
        known = law.line.zero
        law = _Law.of(theta - known, tau, limit, fitted, moment)
    line, above = law.line, law.folded[law.folded >= limit]
    margin = student_quantile(0.5 + 0.5 * CONFIDENCE, line.slope_freedoms) * line.slope_error
    return Characterisation(
        stiffness=line.slope,
        stiffness_std=line.slope_std,
        stiffness_interval=(line.slope - margin, line.slope + margin),
        angle_offset=known + line.zero,
        angle_offset_std=line.zero_std,
        max_moment=float(law.folded[law.knee :].mean()) if law.knee < len(theta) else None,
        mean_moment_above_wrinkling=float(above.mean()) if above.size else None,
        wrinkling_moment=limit,
        n_linear=law.n_linear,
        n_saturated=len(theta) - law.knee,
    )


class _Law(NamedTuple):
    """A line and perhaps a plateau through points ordered by the size of their angle."""

    folded: FloatArray
    """Moments, those at negative angles with the other sign, shape (n,) [N m]."""
    knee: int
    """Number of points before the plateau; n if there is none."""
    line: FittedLine
    """Line of the points below wrinkling."""
    n_linear: int
    """Number of those."""

    @classmethod
    def of(cls, theta: FloatArray, tau: FloatArray, limit: float, free: bool, moment: Any) -> _Law:
        """Fit both; a line through the origin unless it is free. Errors name the moments as they were given."""
        order = np.lexsort((np.where(theta < 0.0, -tau, tau), np.abs(theta)))  # independent of the order of the input
        theta, tau = theta[order], tau[order]
        folded = np.where(theta < 0.0, -tau, tau)
        knee = _knee(theta, tau, free)
        before = np.arange(len(theta)) < knee
        line = _rising(FittedLine.of(theta[before], tau[before], free), moment, limit)
        saturated = folded[knee:]
        plateau = float(saturated.mean() - saturated.std(ddof=1)) if len(saturated) else math.inf
        chosen = np.abs(line.at(theta)) < plateau
        through = FittedLine.of(theta[chosen], tau[chosen], free)
        if through is None:  # too few: a knee close to the zero
            chosen, through = before, line
        while True:  # line and set of points below wrinkling depend on each other; a point left out stays out
            line = _rising(through, moment, limit)
            below = chosen & (np.abs(line.at(theta)) < limit)
            if np.array_equal(below, chosen):
                return cls(folded, knee, line, int(np.count_nonzero(chosen)))
            chosen = below
            through = FittedLine.of(theta[chosen], tau[chosen], free)


def _rising(line: FittedLine | None, moment: Any, limit: float) -> FittedLine:
    """The line, or ParameterError if the points do not determine one that rises."""
    if line is None:
        enough = f"data with at least three loaded points below wrinkling at {limit:.4g} N m, none of them far from all others"
        raise ParameterError("moment", moment, enough)
    if line.slope <= 0.0:
        raise ParameterError("moment", moment, "of the same sign as the angle (the fitted slope is not positive)")
    return line


def _knee(theta: FloatArray, tau: FloatArray, free: bool) -> int:
    """Number of points before the plateau, of points ordered by the size of the angle; all of them if there is no plateau.

    A plateau has at least three points, reduces the sum of squares significantly, rises with less than half the slope before
    it, and lies below the line.
    """
    n = len(theta)
    folded = np.where(theta < 0.0, -tau, tau)
    split = np.arange(3, n + 1)  # candidates: this many points before the knee
    sums = np.cumsum([theta * tau, theta, tau, theta * theta, tau * tau, folded], axis=1)[:, 2:]  # before it
    theta_tau, thetas, taus, theta_squares, tau_squares, moments = sums
    share = free / split  # of the squares that the level of a free line takes off
    products = theta_tau - share * thetas * taus
    squares = theta_squares - share * thetas**2
    line = tau_squares - share * taus**2 - products**2 / np.maximum(squares, np.finfo(np.float64).tiny)
    after = n - split
    constant = tau_squares[-1] - tau_squares - (moments[-1] - moments) ** 2 / np.maximum(after, 1)
    left = np.where((after >= 3) | (after == 0), line + np.where(after > 0, constant, 0.0), np.inf)
    best = int(np.argmin(left))
    knee, rounding = int(split[best]), 1e-12 * float(tau @ tau)
    if not left[-1] - left[best] > _SIGNIFICANT * max(left[best], rounding) / max(n - 3 - free, 1) + rounding:
        return n
    rising = FittedLine.of(theta[:knee], tau[:knee], free)
    return knee if rising is not None and _is_plateau(np.abs(theta[knee:]), folded[knee:], rising) else n


def _is_plateau(theta: FloatArray, tau: FloatArray, rising: FittedLine) -> bool:
    """Whether points rise with less than half the slope of a line, and their mean lies below it by the test of Welch."""
    around = theta - theta.mean()
    if not float(around @ tau) < 0.5 * rising.slope * float(around @ around):
        return False
    middle = float(theta.mean())
    expected, expected_variance = float(rising.at(middle)), rising.variance(middle)
    n, variance = len(tau), float(tau.var(ddof=1)) / len(tau)
    total = expected_variance + variance
    lacking = expected - float(tau.mean())
    if total == 0.0:
        return lacking > 0.0
    freedoms = total**2 / (expected_variance**2 / rising.freedoms + variance**2 / (n - 1))
    return lacking > student_quantile(_BELOW, freedoms) * math.sqrt(total)


def _unpack(fields: Mapping[str, Any]) -> Characterisation:
    """Result of named arrays; one that no fit has is refused."""
    names = ["stiffness", "stiffness_std", "angle_offset", "angle_offset_std", "wrinkling_moment"]
    low, high = finite_array("stiffness_interval", fields["stiffness_interval"], (2,), "N m/rad").tolist()
    names += [name for name in ("max_moment", "mean_moment_above_wrinkling") if name in fields]
    numbers = dict.fromkeys(("max_moment", "mean_moment_above_wrinkling")) | {n: finite_number(n, fields[n]) for n in names}
    n_linear, n_saturated = (counts(fields, name)[0] for name in ("n_linear", "n_saturated"))
    found = Characterisation(**numbers, stiffness_interval=(low, high), n_linear=n_linear, n_saturated=n_saturated)  # type: ignore[arg-type]
    positive = min(found.stiffness, found.wrinkling_moment) > 0.0 and min(found.stiffness_std, found.angle_offset_std) >= 0.0
    if not (
        positive and low <= found.stiffness <= high and n_linear >= 3 and (n_saturated > 0) == (found.max_moment is not None)
    ):
        raise FileFormatError("its numbers are not those of a fit")
    return found


KINDS.update(characterisation=Kind(Characterisation, asdict, _unpack))
