"""Solutions of small systems, traced: in closed form with up to three equations or unknowns, by elimination with more."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, vector
from softrobots.compiled.trace.expressions import Scalar

_ROOT_STEPS = 5


def solve_small(matrix: Any, right: Vector) -> Vector:
    """Solve a system: least squares with more rows than columns, minimum norm with more columns."""
    rows, columns = matrix.shape
    if min(rows, columns) > 3:
        return matrix.T @ solve_positive(matrix @ matrix.T, right)
    if rows > columns:
        return inverse_small(matrix.T @ matrix) @ (matrix.T @ right)
    if rows < columns:
        return matrix.T @ (inverse_small(matrix @ matrix.T) @ right)
    return inverse_small(matrix) @ right


def solve_positive(matrix: Any, right: Vector) -> Vector:
    """Solve a system with a positive definite matrix, shape (n, n): huge but finite numbers for a singular one."""
    lower, inverse_pivots = _factors(matrix)
    n = len(inverse_pivots)
    solution = list(right)
    for i in range(n):
        for j in range(i):
            solution[i] = solution[i] - lower[i, j] * solution[j]
    solution = [value * pivot for value, pivot in zip(solution, inverse_pivots, strict=True)]
    for i in reversed(range(n)):
        for j in range(i + 1, n):
            solution[i] = solution[i] - lower[j, i] * solution[j]
    return vector(solution)


def _factors(matrix: Any) -> tuple[Any, list[Scalar]]:
    """Return `L`, unit lower triangular, and `1 / D` of a positive definite matrix `L D L^T`."""
    rest, n = matrix.copy(), len(matrix)
    lower, inverse_pivots = constants(np.eye(n)), []
    for j in range(n):
        inverse_pivots.append(_reciprocal(rest[j, j]))
        for i in range(j + 1, n):
            lower[i, j] = rest[i, j] * inverse_pivots[j]
            for k in range(j + 1, i + 1):
                rest[i, k] = rest[i, k] - lower[i, j] * rest[k, j]
    return lower, inverse_pivots


def inverse_small(matrix: Any) -> Any:
    """Return the inverse by cofactors, shape (n, n) with n up to three; huge but finite for singular matrices."""
    n = len(matrix)
    if n == 1:
        return np.array([[_reciprocal(matrix[0, 0])]], dtype=object)
    if n == 2:
        (a, b), (c, d) = matrix
        return np.array([[d, -b], [-c, a]], dtype=object) * _reciprocal(a * d - b * c)
    rows = [cross(matrix[:, 1], matrix[:, 2]), cross(matrix[:, 2], matrix[:, 0]), cross(matrix[:, 0], matrix[:, 1])]
    return np.array(rows, dtype=object) * _reciprocal(matrix[:, 0] @ rows[0])


def _reciprocal(value: Scalar) -> Scalar:
    return 1.0 / (value + 1e-300)  # plain floats raise at zero


def smallest_square(matrix: Any) -> Scalar:
    """Return the square of the smallest singular value of a matrix, shape (m, n), from below.

    Up to three rows or columns: the smallest root of the characteristic polynomial of the smaller product with the transpose,
    by Newton's method from zero, which converges from below; accurate to a factor near one. More: one over the trace of the
    inverse of that product, at least a share 1/n of the square.
    """
    product = matrix @ matrix.T if matrix.shape[0] <= matrix.shape[1] else matrix.T @ matrix
    n = len(product)
    if n > 3:
        return _reciprocal(sum(solve_positive(product, unit)[i] for i, unit in enumerate(constants(np.eye(n)))))
    if n == 1:
        return product[0, 0]  # type: ignore[no-any-return]
    trace = sum((product[i, i] for i in range(1, n)), product[0, 0])
    if n == 2:
        pairs = product[0, 0] * product[1, 1] - product[0, 1] * product[0, 1]
        return _smallest_root(vector([pairs, -trace, 1.0]))
    pairs = sum((product[i, i] * product[j, j] - product[i, j] * product[i, j] for i, j in ((0, 1), (0, 2), (1, 2))), 0.0)
    last = product[0] @ cross(product[1], product[2])
    return _smallest_root(vector([last, -pairs, trace, -1.0]))


def _smallest_root(coefficients: Vector) -> Scalar:
    """Newton's method from zero for a polynomial with real, non-negative roots; coefficients from the constant one on."""
    root: Scalar = 0.0
    for _ in range(_ROOT_STEPS):
        value, slope = constants(np.zeros(2))
        for coefficient in coefficients[::-1]:
            slope = slope * root + value
            value = value * root + coefficient
        root = root - value / (slope + 1e-300)
    return root
