"""Strictly convex quadratic programmes over gaps in functions that numba compiles: dense factors, and an active set.

The set is that of the products of the pressed rows, :math:`A_P H^{-1} A_P^T` (Lawson and Hanson, Solving Least Squares
Problems, 1974, chapter 23).
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

BROKEN, DEPENDENT = 1e-13, 1e-9
"""Largest penetration by the size of its row; least pivot of rows that do not depend on each other."""


def factorise(matrix: Any, n: Any, least: Any) -> Any:
    """Replace a matrix by its Cholesky factor, below the diagonal; whether every pivot is above `least` of its diagonal."""
    column, first = np.zeros(n), np.zeros(n)
    for k in range(n):
        first[k] = matrix[k, k]
    for k in range(n):
        pivot = matrix[k, k]
        if not pivot > least * first[k]:
            return False
        matrix[k, k] = sqrt(pivot)
        for i in range(k + 1, n):
            matrix[i, k] /= matrix[k, k]
            column[i] = matrix[i, k]
        for i in range(k + 1, n):
            factor, row = column[i], matrix[i]
            for j in range(k + 1, i + 1):
                row[j] -= factor * column[j]
    return True


def forward(factor: Any, n: Any, x: Any) -> None:
    """Solve with the factor in place."""
    for i in range(n):
        total, row = x[i], factor[i]
        for j in range(i):
            total -= row[j] * x[j]
        x[i] = total / row[i]


def backward(factor: Any, n: Any, x: Any) -> None:
    """Solve with its transpose in place."""
    for i in range(n - 1, -1, -1):
        x[i] /= factor[i, i]
        value, row = x[i], factor[i]
        for j in range(i):
            x[j] -= row[j] * value


def dot(a: Any, b: Any) -> Any:
    """Sum of products."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


def scale_rows(rows: Any, soft: Any, scaled: Any, widths: Any) -> None:
    """Write gradients in coordinates in which the springs have stiffness 1, and their sizes."""
    for c in range(len(rows)):
        for i in range(len(soft)):
            scaled[c, i] = rows[c, i] * soft[i]
        widths[c] = sqrt(dot(scaled[c], scaled[c]))


def stiffened(tangent: Any, soft: Any, shift: Any, matrix: Any) -> Any:
    """Factorise the tangent stiffness where springs have stiffness 1, with `shift`; whether it is positive."""
    for i in range(len(soft)):
        for j in range(i + 1):
            matrix[i, j] = soft[i] * tangent[i, j] * soft[j]
        matrix[i, i] += shift
    return factorise(matrix, len(soft), 1e-3 if shift > 0.0 else 0.0)


def add_row(factor: Any, row: Any, place: Any, chosen: Any, across: Any, pressed: Any) -> Any:
    """Take a row among the pressed ones; how many they are now."""
    chosen[pressed] = place
    for i in range(len(row)):
        across[pressed, i] = row[i]
    forward(factor, len(row), across[pressed])
    return pressed + 1


def programme(factor: Any, pull: Any, gaps: Any, rows: Any, sizes: Any, forces: Any, step: Any) -> Any:
    """Minimise over the gaps that stay open; whether it is done. `forces`, a guess of what presses, become multipliers."""
    n, count, free, guessed = len(pull), len(gaps), np.zeros(len(pull)), True
    pressed = 0 * n  # no constant, for which numba would compile all again
    for i in range(n):
        free[i] = -pull[i]
    forward(factor, n, free)
    chosen, across, gram, new = np.zeros(n, dtype=np.int64), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    for c in range(count):
        if forces[c] > 0.0:
            if pressed == n:
                return False
            pressed = add_row(factor, rows[c], c, chosen, across, pressed)
        forces[c] = 0.0
    for _ in range(4 * count + 4 * n + 8):
        for a in range(pressed):
            new[a] = -gaps[chosen[a]] - dot(across[a], free)
            for b in range(a + 1):
                gram[a, b] = dot(across[a], across[b])
        if not factorise(gram, pressed, DEPENDENT):
            return False
        forward(gram, pressed, new)
        backward(gram, pressed, new)
        share, lowest = 1.0, -1
        for a in range(pressed):
            if new[a] < 0.0:
                ratio = forces[chosen[a]] / (forces[chosen[a]] - new[a])
                if guessed and (lowest < 0 or new[a] < new[lowest]):
                    lowest = a
                elif not guessed and ratio < share:
                    share, lowest = ratio, a
        for a in range(pressed):
            if not (guessed and lowest >= 0):
                forces[chosen[a]] = max(0.0, forces[chosen[a]] + share * (new[a] - forces[chosen[a]]))
        if lowest >= 0:  # leaves; of a guess the one that pulls most
            forces[chosen[lowest]] = 0.0
            pressed -= 1
            for a in range(lowest, pressed):
                chosen[a] = chosen[a + 1]
                for i in range(n):
                    across[a, i] = across[a + 1, i]
            continue
        guessed = False
        for i in range(n):
            step[i] = free[i]
            for a in range(pressed):
                step[i] += new[a] * across[a, i]
        backward(factor, n, step)
        worst, which = BROKEN, -1
        for c in range(count):
            lacking = -(gaps[c] + dot(rows[c], step)) if forces[c] == 0.0 else 0.0
            if lacking > worst * sizes[c]:
                worst, which = lacking / sizes[c], c
        if which < 0 or pressed == n:
            return which < 0
        pressed = add_row(factor, rows[which], which, chosen, across, pressed)
    return False
