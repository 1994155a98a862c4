r"""How well fitted parameters are known: covariances from rows and from blocks, intervals, outliers.

A fit minimises :math:`r^T r + (p - m)^T \Lambda (p - m)` with weighted residuals `r` (measured minus predicted, in standard
deviations), their Jacobian `J` by the fitted coordinates `p` (the logarithm of a logarithmic parameter; either sign of `J`)
and the information :math:`\Lambda` of the priors, one over the square of their standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import LARGEST, FloatArray, finite_array, non_negative_array
from softrobots.core.errors import ParameterError

CONFIDENCE = 0.95
"""Probability with which a true value lies in its interval."""

UNDETERMINED = 1e-7
"""Singular value of the Jacobian with columns of norm 1, relative to the largest, below which a combination of parameters
is not determined: well above the error of a Jacobian by differences (1e-9), well below what noise leaves useful."""

_PARTAKES = 1e-4  # component of a parameter in an undetermined combination of norm 1 above which it is undetermined, too
_LARGEST_STD = np.array([0.5, 1.0])  # of a logarithm that tells the lower, and the upper end of an interval
_ALONE = 1e-9  # 1 minus the leverage below which a row, or a block, determines a combination alone


@dataclass(frozen=True)
class Uncertainty:
    """Covariance of fitted coordinates, with combinations that are not determined held where they are."""

    covariance: FloatArray
    """Shape (P, P), in the units of the coordinates; a relative variance for a logarithmic parameter."""
    freedoms: float
    """Degrees of freedom of Student's t; infinite if the standard deviations are known."""
    determined: NDArray[np.bool_]
    """Whether the data and the priors determine a parameter, shape (P,); the intervals of others are infinite."""

    @property
    def std(self) -> FloatArray:
        """Standard errors, shape (P,); infinite where not determined."""
        return np.asarray(np.where(self.determined, np.sqrt(np.diag(self.covariance)), np.inf))

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the errors, shape (P, P); 0 beside the diagonal for a parameter without variance."""
        std = np.sqrt(np.diag(self.covariance))
        safe = np.where(std > 0.0, std, 1.0)
        found: FloatArray = np.clip(self.covariance / np.outer(safe, safe), -1.0, 1.0)
        np.fill_diagonal(found, 1.0)
        return found

    def intervals(self, values: Any, logarithmic: Any = False, confidence: float = CONFIDENCE) -> FloatArray:
        """Return lower and upper ends of the intervals of the parameters by Student's t, shape (P, 2).

        Of logarithmic parameters they are those of the logarithm, but where it is told badly, and the parameter may as well be
        zero, the lower end (and beyond a standard error of 1 the upper one, too) is that of the parameter itself, or zero.

        Args:
            values: Values of the parameters (not their logarithms), shape (P,).
            logarithmic: Which of them are fitted by their logarithm, shape (P,) or one for all.
            confidence: Probability with which a true value lies within.
        """
        from scipy.special import stdtrit  # here, because importing it takes longer than all of this package

        quantile = min(float(stdtrit(self.freedoms, 0.5 + 0.5 * confidence)), LARGEST)  # finite: no margin of zero is NaN
        margin = quantile * self.std[:, None] * np.array([-1.0, 1.0])
        middle, ratio = np.asarray(values, dtype=np.float64)[:, None], np.reshape(logarithmic, (-1, 1))
        by_logarithm = ratio & (self.std[:, None] <= _LARGEST_STD)
        ends = middle + np.where(ratio & (middle != 0.0), np.abs(middle), 1.0) * margin
        ends = np.where(ratio, np.maximum(ends, 0.0), ends)
        with np.errstate(over="ignore"):  # with hardly a degree of freedom the upper end is infinite
            return np.asarray(np.where(by_logarithm, middle * np.exp(np.where(by_logarithm, margin, 0.0)), ends))


def uncertainty_from_rows(jacobian: Any, residuals: Any, *, prior: Any = 0.0, std_known: bool = True) -> Uncertainty:
    r"""Return the covariance of a fit whose rows have independent errors.

    :math:`A^{-1} (s^2 J^T J + \Lambda) A^{-1}` with :math:`A = J^T J + \Lambda`; :math:`s^2 = 1` if the standard deviations
    of the measurements are known, else the reduced chi-square :math:`r^T r / (n - \mathrm{tr}(A^{-1} J^T J))`. Without
    priors this is :math:`s^2 (J^T J)^{-1}`, with n - P degrees of freedom.

    Args:
        jacobian: J, shape (rows, P).
        residuals: Weighted residuals, shape (rows,).
        prior: Diagonal of :math:`\Lambda`, shape (P,), 0 where there is no prior.
        std_known: Whether the weights are the true standard deviations, or only their ratios.

    Raises:
        ParameterError: If a shape or number does not fit, or the scale of the errors shall be found and there are not more
            rows than parameters.
    """
    fit = _Fit.of(jacobian, residuals, prior)
    freedoms, scale = np.inf, 1.0
    if not std_known:
        freedoms = len(fit.residuals) - float(np.sum(fit.rows**2))
        if freedoms < 1e-6:
            raise ParameterError("residuals", residuals, f"more rows than parameters ({fit.rows.shape[1]}) if std is unknown")
        scale = float(fit.residuals @ fit.residuals) / freedoms
    return fit.uncertainty(fit.rows.T @ fit.rows * scale, freedoms)


def uncertainty_from_blocks(jacobian: Any, residuals: Any, blocks: Any, *, prior: Any = 0.0) -> Uncertainty:
    r"""Return the covariance of a fit whose errors are independent between blocks of rows, and anything within them.

    The sandwich of clusters with the correction by leverage (CR3: the jackknife over blocks; Bell and McCaffrey 2002, Survey
    Methodology 28(2)), as HC3 is for rows:

    .. math:: A^{-1} \Big( \frac{G - 1}{G} \sum_g J_g^T (1 - H_g)^{-1} r_g r_g^T (1 - H_g)^{-1} J_g + \Lambda \Big) A^{-1},
        \quad H_g = J_g A^{-1} J_g^T

    with G - 1 degrees of freedom. The plain sandwich of residuals covers 78 to 88 % instead of 95 with 10 to 20 blocks.
    It needs no standard deviation, only their ratios. What a single block determines alone has no interval.

    Args:
        jacobian: J, shape (rows, P).
        residuals: Weighted residuals, shape (rows,).
        blocks: Label of the block of each row, shape (rows,).
        prior: Diagonal of :math:`\Lambda`, shape (P,), 0 where there is no prior.

    Raises:
        ParameterError: If a shape or number does not fit, or there are fewer than two blocks.
    """
    fit = _Fit.of(jacobian, residuals, prior)
    if np.shape(blocks) != fit.residuals.shape:
        raise ParameterError("blocks", blocks, f"one label for each of the {len(fit.residuals)} rows")
    labels, block_of = np.unique(np.asarray(blocks), return_inverse=True)
    if len(labels) < 2:
        raise ParameterError("blocks", blocks, "at least two different labels")
    scores, alone, sizes = [], [], np.bincount(block_of)
    order, ends = np.argsort(block_of, kind="stable"), np.cumsum(sizes)
    for size in np.unique(sizes):  # blocks of one size at once
        rows = order[ends[sizes == size, None] - np.arange(size, 0, -1)]
        left, share, right = np.linalg.svd(fit.rows[rows], full_matrices=False)
        lacking = 1.0 - share**2
        along = (fit.residuals[rows][:, None] @ left)[:, 0] * share / np.maximum(lacking, _ALONE)
        scores.append((along[:, None] @ right)[:, 0])
        alone.append(right[lacking < _ALONE])
    factor = (len(labels) - 1) / len(labels)
    found = np.vstack(scores)
    return fit.uncertainty(factor * found.T @ found, len(labels) - 1.0, np.vstack(alone))


def standardised_residuals(jacobian: Any, residuals: Any, *, prior: Any = 0.0, least: float = 1e-3) -> FloatArray:
    """Return residuals over their own standard deviation, which is smaller where a row pulls the fit to itself, shape (rows,).

    Each is divided by the square root of 1 minus its leverage, and all by a robust scale: 1.4826 times the median of their
    sizes, which equals the standard deviation of normal errors and does not feel outliers. A row that determines a
    combination of parameters alone has 0.

    Args:
        jacobian: J, shape (rows, P).
        residuals: Weighted residuals, shape (rows,).
        prior: As for `uncertainty_from_rows`.
        least: Smallest scale, so that rounding errors of a perfect fit are no outliers.
    """
    fit = _Fit.of(jacobian, residuals, prior)
    lacking = 1.0 - np.sum(fit.rows**2, axis=1)
    own = np.where(lacking > _ALONE, fit.residuals / np.sqrt(np.maximum(lacking, _ALONE)), 0.0)
    return own / max(1.4826 * float(np.median(np.abs(own))) if len(own) else 0.0, least)


def outliers(jacobian: Any, residuals: Any, *, prior: Any = 0.0, least: float = 1e-3) -> NDArray[np.int_]:
    """Return the indices of rows too far off to be noise, the worst first.

    Their `standardised_residuals` are so large that normal errors would exceed them anywhere among all rows with a
    probability of 5 % (Bonferroni): beyond 3.9 for 500 rows.
    """
    from scipy.special import ndtri

    size = np.abs(standardised_residuals(jacobian, residuals, prior=prior, least=least))
    limit = -ndtri((1.0 - CONFIDENCE) / (2.0 * max(len(size), 1)))
    order = np.argsort(-size, kind="stable")
    return np.asarray(order[size[order] > limit])


@dataclass(frozen=True)
class _Fit:
    """A checked fit, its Jacobian in coordinates in which `A` is the identity."""

    residuals: FloatArray
    rows: FloatArray
    """J in those coordinates, shape (rows, rank)."""
    prior: FloatArray
    """Information of the priors in them, shape (rank, rank)."""
    back: FloatArray
    """The fitted coordinates by those, shape (P, rank)."""
    lost: FloatArray
    """Combinations of the fitted coordinates, in units of one over their columns' norms, without any information."""
    scale: FloatArray
    """One over those norms, shape (P,)."""

    @classmethod
    def of(cls, jacobian: Any, residuals: Any, prior: Any) -> _Fit:
        given = finite_array("jacobian", jacobian, (None, None))
        known = information(prior, given.shape[1])
        scale, singular, right = scaled_directions(given, known)
        kept = singular > UNDETERMINED * singular.max(initial=0.0)
        back = scale[:, None] * right[kept].T / singular[kept]
        return cls(
            residuals=finite_array("residuals", residuals, given.shape[:1]),
            rows=given @ back,
            prior=back.T @ (known[:, None] * back),
            back=back,
            lost=right[~kept],
            scale=scale,
        )

    def uncertainty(self, scatter: FloatArray, freedoms: float, alone: FloatArray | None = None) -> Uncertainty:
        """The covariance for a scatter of the data, shape (rank, rank); `alone` are directions that only one block tells."""
        lost = self.lost
        if alone is not None and len(alone):
            there = alone @ self.back.T / np.where(self.scale > 0.0, self.scale, 1.0)
            lost = np.vstack([lost, there / np.linalg.norm(there, axis=1, keepdims=True)])
        determined = (np.abs(lost) < _PARTAKES).all(axis=0) & (self.scale > 0.0)
        return Uncertainty(self.back @ (scatter + self.prior) @ self.back.T, freedoms, determined)


def information(prior: Any, count: int) -> FloatArray:
    """Return the information of priors as shape (count,), from one number for all or one for each."""
    known = non_negative_array("prior", prior, "1/std^2")
    if known.shape not in ((), (count,)):
        raise ParameterError("prior", prior, f"one number, or one for each of the {count} parameters")
    return np.array(np.broadcast_to(known, (count,)))


def scaled_directions(jacobian: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the singular value decomposition of a Jacobian and priors with columns of norm 1.

    Returns:
        One over the norms of the columns, 0 for a column of zeros, shape (P,); the singular values, decreasing, shape
        (P,); and their directions in rows, shape (P, P).
    """
    stacked = np.vstack([jacobian, np.diag(np.sqrt(prior))])
    norms = np.linalg.norm(stacked, axis=0)
    scale = np.divide(1.0, norms, out=np.zeros_like(norms), where=norms > 0.0)
    _, singular, right = np.linalg.svd(np.linalg.qr(stacked * scale, mode="r"))
    return scale, singular, right
