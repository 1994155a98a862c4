r"""The directions of the strains that given muscle lengths hold, and those that they leave free.

The linear part of the lengths is :math:`A z`. The strains are :math:`z = W S + F y`, with the held sums `S` and the free
coordinates `y`, such that

.. math:: A F = 0, \quad W^T K F = 0, \quad W^T K W \text{ and } F^T K F \text{ diagonal}, \quad
          S = P\,(A z), \quad P A W = 1

for the stiffness `K` of the springs. Lengths of more muscles than there are directions are met in the least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.model.muscle_paths import MUSCLE_STRAINS, MusclePaths
from softrobots.model.sections import Segments
from softrobots.model.springs import Springs

_RANK = 1e-9  # least singular value that counts, relative to the largest
_EQUAL = 1e-12  # arms along the sections of a segment, relative
_NULL = 1e-13  # entries of an inverse, relative to the largest of their row
_SHARES = (0.5, 0.1, 0.01, 1e-3, 1e-6)  # least square of the part of a strain that is free and new


class HeldDirections(NamedTuple):
    """The directions; see the module."""

    groups: tuple[tuple[int, ...], ...]
    """Strains whose sum is each of `S`; empty where those are other combinations."""
    slopes: FloatArray
    """`P`, shape (n_held, n_muscles) [rad/m or -]."""
    shares: FloatArray
    """`W`, shape (n_strains, n_held)."""
    free: FloatArray
    """`F`, shape (n_strains, n_free)."""
    names: tuple[str, ...]
    """Names of the free coordinates."""
    turning: tuple[bool, ...]
    """Which of them are angles."""


def held_directions(paths: MusclePaths, springs: Springs, segments: Segments, touched: Sequence[int]) -> HeldDirections:
    """Find the directions that muscle lengths hold.

    Muscles that run straight along whole segments, and enough of them, hold the sums of bending and elongation over each
    segment. Others hold the directions that the singular values of :math:`A K^{-1/2}` tell.

    Args:
        paths: Their routes.
        springs: Springs of the strains.
        segments: Places of the section coordinates of each segment.
        touched: Numbers of the segments that muscles run along, ascending.
    """
    sums = [
        (number, key, list(segments[number][key])) for number in touched for key in MUSCLE_STRAINS if key in segments[number]
    ]
    columns = [paths.matrix[:, places] for *_, places in sums]
    arms = np.array([column[:, 0] for column in columns]).T
    equal = all(np.ptp(column, axis=1).max() <= _EQUAL * np.abs(column).max(initial=1e-300) for column in columns)
    if not paths.straight or not equal or np.linalg.matrix_rank(arms, tol=_RANK * float(np.abs(arms).max())) < len(sums):
        return _of_singular_values(paths.matrix, springs)
    slopes = np.linalg.pinv(arms)
    slopes[np.abs(slopes) < _NULL * np.abs(slopes).max(axis=1, keepdims=True)] = 0.0
    count = len(springs.names)
    shares, modes, names, turning = np.zeros((count, len(sums))), [], [], []
    for place, (number, key, places) in enumerate(sums):
        softness = 1.0 / springs.stiffness[places]
        shares[places, place] = softness / softness.sum()
        for mode, differences in enumerate(_differences(springs.stiffness[places]).T, start=1):
            modes.append(np.zeros(count))
            modes[-1][places] = differences
            names.append(f"segment_{number}_{key}_mode_{mode}")
            turning.append(key != "stretch")
    held = {strain for *_, places in sums for strain in places}
    loose = [strain for strain in range(count) if strain not in held]
    return HeldDirections(
        tuple(tuple(places) for *_, places in sums),
        slopes,
        shares,
        np.concatenate([np.eye(count)[loose], np.array(modes).reshape(-1, count)]).T,
        (*(springs.names[strain] for strain in loose), *names),
        (*springs.turning[loose].tolist(), *turning),
    )


def _of_singular_values(matrix: FloatArray, springs: Springs) -> HeldDirections:
    """Held directions of any lengths; each free coordinate that they touch begins as a strain, and is named after it."""
    softness = 1.0 / np.sqrt(springs.stiffness)
    left, values, right = np.linalg.svd(matrix * softness, full_matrices=False)
    rank = int((values > _RANK * values.max(initial=0.0)).sum())
    left, values, right = left[:, :rank], values[:rank], right[:rank]
    touched = np.abs(matrix).max(axis=0) > 0.0
    loose = np.flatnonzero(~touched).tolist()
    basis, chosen = _complement(right[:, touched], np.flatnonzero(touched))
    stiffness = float(np.median(springs.stiffness[touched & springs.turning])) if np.any(touched & springs.turning) else 1.0
    mixed = np.zeros((len(softness), len(chosen)))
    mixed[touched] = basis * softness[touched, None] * np.sqrt(stiffness)
    return HeldDirections(
        (),
        left.T,
        softness[:, None] * right.T / values,
        np.concatenate([np.eye(len(softness))[:, loose], mixed], axis=1),
        (*(springs.names[strain] for strain in loose), *(f"{springs.names[strain]}_free" for strain in chosen)),
        (*springs.turning[loose].tolist(), *(True for _ in chosen)),
    )


def _complement(rows: FloatArray, numbers: Any) -> tuple[FloatArray, list[int]]:
    """Orthonormal columns orthogonal to orthonormal rows, and the number of the axis that each begins as.

    The axes are taken in order, so that the result repeats; those of which little is new come later.
    """
    size = rows.shape[1]
    basis, chosen = np.array(rows), []
    for least in _SHARES:
        for axis in range(size):
            if len(basis) == size or numbers[axis] in chosen:
                continue
            vector = np.eye(size)[axis]
            for _ in range(2):  # once more for rounding
                vector = vector - basis.T @ (basis @ vector)
            square = float(vector @ vector)
            if square > least:
                basis = np.concatenate([basis, vector[None] / np.sqrt(square)])
                chosen.append(int(numbers[axis]))
    return basis[len(rows) :].T, chosen


def _differences(stiffness: FloatArray) -> FloatArray:
    """Orthonormal columns of sum zero, shape (n, n - 1), that diagonalise the stiffness; cosines where it is uniform."""
    n = len(stiffness)
    places = (np.arange(n) + 0.5)[:, None]
    cosines = np.sqrt(2.0 / n) * np.cos(np.pi * places * np.arange(1, n) / n)
    if np.ptp(stiffness) <= 1e-12 * float(stiffness.max()):
        return np.asarray(cosines)
    vectors: Any = np.linalg.eigh(cosines.T @ (stiffness[:, None] * cosines))[1]
    return np.asarray(cosines @ vectors)
