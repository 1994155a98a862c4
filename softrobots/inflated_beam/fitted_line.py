"""Least-squares line through the points of a bending test, with its standard errors and intervals; quantiles of Student's t."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray

_EQUAL = 1e-24  # share of the squares of angles below which their differences are rounding
_ALONE = 1e-9  # 1 minus the leverage of a point below which it determines the line alone


def student_quantile(probability: float, freedoms: float) -> float:
    """Return the number below which a variable of Student's t distribution lies with a probability."""
    from scipy.special import stdtrit  # here, because importing it takes longer than all of this package

    return float(stdtrit(freedoms, probability))


class FittedLine(NamedTuple):
    """Least-squares line, and how much each point moves it by its own scatter (the terms of HC3)."""

    slope: float
    """Slope [N m/rad]."""
    centre: float
    """Mean of the angles; 0 of a line through the origin [rad]."""
    level: float
    """Moment there [N m]."""
    slope_scatter: FloatArray
    """Scatter of the slope by each point, shape (n,) [N m/rad]."""
    level_scatter: FloatArray
    """Scatter of the level by each point, shape (n,) [N m]."""
    freedoms: int
    """Number of points minus number of fitted numbers."""
    slope_error: float
    """Standard error HC2 of the slope, free of bias where the noise is constant [N m/rad]."""
    slope_freedoms: float
    """Its degrees of freedom, at most `freedoms`: a sandwich leans on the points far from the centre."""

    @classmethod
    def of(cls, x: FloatArray, y: FloatArray, free: bool) -> FittedLine | None:
        r"""Fit a line, through the origin unless it is free; None for fewer than three points, or if one determines it alone.

        Under constant noise, HC2 is a sum of squares with :math:`(\operatorname{tr} A M)^2 / \operatorname{tr} (A M)^2` degrees
        of freedom, Bell and McCaffrey 2002: `M` the projection onto the residuals, `A` the diagonal of their weights.
        """
        n = len(x)
        if n < 3:
            return None
        centre, level = (float(x.mean()), float(y.mean())) if free else (0.0, 0.0)
        around = x - centre
        spread = float(around @ around)
        if spread <= _EQUAL * float(x @ x):
            return None
        along = around**2 / spread
        lacking = 1.0 - along - free / n  # 1 minus the leverage
        if lacking.min() < _ALONE:
            return None
        slope = float(around @ y) / spread
        scatter = (y - level - slope * around) / lacking
        by_point, freedoms, weights = around * scatter / spread, n - 1 - free, along / lacking
        squares = float(weights**2 @ (2.0 * lacking - 1.0) + (weights @ along) ** 2)
        squares += free / n * float(2.0 * (weights @ around) ** 2 / spread + weights.sum() ** 2 / n)
        effective = min(max(1.0 / squares, 1.0), freedoms) if squares > 0.0 else 1.0
        error = math.sqrt(float(by_point**2 @ lacking))
        return cls(slope, centre, level, by_point, free * scatter / n, freedoms, error, effective)

    @property
    def slope_std(self) -> float:
        """Standard error of the slope [N m/rad]."""
        return float(np.linalg.norm(self.slope_scatter))

    @property
    def zero(self) -> float:
        """Angle at which the line vanishes [rad]."""
        return self.centre - self.level / self.slope

    @property
    def zero_std(self) -> float:
        """Standard error of that angle [rad]."""
        return float(np.linalg.norm(self.level / self.slope * self.slope_scatter - self.level_scatter)) / self.slope

    def at(self, angle: Any) -> Any:
        """Moment at angles, any shape [N m]."""
        return self.level + self.slope * (angle - self.centre)

    def variance(self, angle: float) -> float:
        """Variance of the moment at an angle [N^2 m^2]."""
        scatter = self.level_scatter + (angle - self.centre) * self.slope_scatter
        return float(scatter @ scatter)
