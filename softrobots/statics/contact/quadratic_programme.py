"""Strictly convex quadratic programmes, by daqp.

Arnstrom, Bemporad, Axehill: A dual active-set solver for embedded quadratic programming using recursive LDL^T updates, IEEE
Trans. Automatic Control 67, 2022.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray

_TIGHT = {"primal_tol": 1e-13, "dual_tol": 1e-13}
_FREE = 1e30  # bound that does not bind
_MANY = 16  # rows beyond which they are taken in one after another
_BROKEN = 1e-13  # of a row by its size
_INDEPENDENT = 1e-6  # least eigenvalue of the products of rows of size 1 that are solved for at once
_SOLVED, _EQUALITY = 1, 5  # exit flag and kind of constraint of daqp


def solve_programme(
    hessian: FloatArray,
    pull: FloatArray,
    gradients: FloatArray,
    bounds: FloatArray,
    equal: Any = None,
    box: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray] | None:
    """Minimise `s^T H s / 2 + f^T s` with `A s >= b`, and `A s = b` in some rows, and `|s| <= box`.

    Returns:
        The solution, and the multipliers of the rows; None if there is none.
    """
    if len(bounds) > _MANY and equal is None:
        return _by_rows(hessian, pull, gradients, bounds, box)
    return _solved(hessian, pull, gradients, bounds, equal, box)


def solve_guessed(
    factors: Any, pull: FloatArray, gradients: FloatArray, bounds: FloatArray, held: Any
) -> tuple[FloatArray, FloatArray] | None:
    """The same in closed form, where the rows that are equations can be guessed: those of `held`, else the one broken most.

    Args:
        factors: Factors of the Hessian, an `eigenpy.LDLT`.
        pull: As in `solve_programme`, like gradients and bounds.
        gradients: Constraints.
        bounds: Their bounds.
        held: Rows that may be equations, shape (m,), truth values.

    Returns:
        As `solve_programme`; None if the guess is wrong, or the rows nearly depend on each other.
    """
    forces: Any
    free, chosen = -factors.solve(pull).ravel(), held.nonzero()[0]  # Eigen returns one row as a matrix
    lacking, multipliers = bounds - gradients.dot(free), np.zeros(len(bounds))
    if not len(chosen):
        chosen = lacking.argmax(keepdims=True) if len(bounds) else chosen
        if not len(bounds) or lacking[chosen[0]] <= 0.0:
            return free, multipliers
    if len(chosen) == 1:
        row = gradients[chosen[0]]
        gives = factors.solve(row).ravel()
        give = float(row.dot(gives))
        forces = float(lacking[chosen[0]]) / give if give > 0.0 else -1.0
        if forces < 0.0:
            return None
        solution = free + forces * gives
    else:
        rows = gradients.take(chosen, 0)
        gives = factors.solve(rows.T).reshape(len(free), -1)
        forces = _independent(rows.dot(gives), lacking.take(chosen))
        if forces is None or min(forces.tolist()) < 0.0:
            return None
        solution = free + gives.dot(forces)
    multipliers[chosen] = forces
    lacking = bounds - gradients.dot(solution)
    lacking[chosen] = 0.0
    if max(lacking.tolist()) > 0.0 and (lacking > _BROKEN * np.sqrt(np.vecdot(gradients, gradients))).any():
        return None
    return solution, multipliers


def _independent(matrix: FloatArray, right: FloatArray) -> FloatArray | None:
    """Solve with the matrix of the products of some rows; None if they nearly depend on each other."""
    sizes = np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
    values, vectors = np.linalg.eigh(matrix / sizes / sizes[:, None])
    return (vectors @ ((vectors.T @ (right / sizes)) / values)) / sizes if values[0] > _INDEPENDENT else None


def _by_rows(
    hessian: FloatArray, pull: FloatArray, gradients: FloatArray, bounds: FloatArray, box: FloatArray | None
) -> tuple[FloatArray, FloatArray] | None:
    """The same, rows taken in where the solution of the others breaks them: most of many surfaces are not touched."""
    chosen = np.zeros(len(bounds), dtype=bool)
    sizes = np.sqrt(np.vecdot(gradients, gradients))
    while True:
        places = chosen.nonzero()[0]
        found = _solved(hessian, pull, gradients[places], bounds[places], None, box)
        if found is None:
            return None
        broken = ~chosen & (gradients.dot(found[0]) - bounds < -_BROKEN * sizes)
        if not broken.any():
            multipliers = np.zeros(len(bounds))
            multipliers[places] = found[1]
            return found[0], multipliers
        chosen |= broken


def _solved(
    hessian: FloatArray, pull: FloatArray, gradients: FloatArray, bounds: FloatArray, equal: Any, box: FloatArray | None
) -> tuple[FloatArray, FloatArray] | None:
    """Solve with daqp."""
    import daqp

    m, limits = len(bounds), np.zeros(0) if box is None else box
    if m + len(limits) == 0:
        return np.asarray(np.linalg.solve(hessian, -pull)), np.zeros(0)
    above, sense = np.concatenate([limits, np.full(m, _FREE)]), np.zeros(len(limits) + m, dtype=np.int32)
    below = np.concatenate([-limits, bounds])
    if equal is not None:
        above[equal], sense[equal] = bounds[equal], _EQUALITY
    matrices = (np.ascontiguousarray(one) for one in (hessian, pull, gradients))
    solution, _, flag, info = daqp.solve(*matrices, above, below, sense, **_TIGHT)
    return (np.array(solution), np.maximum(-np.array(info["lam"])[len(limits) :], 0.0)) if flag == _SOLVED else None
