"""Closed-form solutions of systems with up to six equations or unknowns, traced."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, vector
from softrobots.compiled.trace.expressions import Scalar

_ROOT_STEPS = 5


def solve_small(matrix: Any, right: Vector) -> Vector:
    """Solve a system of up to six rows or columns: least squares with more rows, minimum norm with more columns."""
    rows, columns = matrix.shape
    if rows > columns:
        return inverse_small(matrix.T @ matrix) @ (matrix.T @ right)
    if rows < columns or rows > 3:
        return matrix.T @ (inverse_small(matrix @ matrix.T) @ right)
    return inverse_small(matrix) @ right


def inverse_small(matrix: Any) -> Any:
    """Return the inverse by cofactors, shape (n, n) with n up to three, or of a symmetric matrix with n up to six by blocks.

    Huge but finite for singular matrices.
    """
    n = len(matrix)
    if n > 3:
        first = inverse_small(matrix[:3, :3])
        coupling = first @ matrix[:3, 3:]
        last = inverse_small(matrix[3:, 3:] - matrix[3:, :3] @ coupling)
        corner = -coupling @ last
        return np.block([[first - corner @ coupling.T, corner], [corner.T, last]])
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
        return _reciprocal(np.trace(inverse_small(product)))
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
