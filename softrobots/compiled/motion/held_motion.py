r"""The strains of a robot with given lengths in motion: free coordinates, and combinations that the lengths hold.

With the held sums `S` and the free coordinates `y` the strains are :math:`z = W S + F y`; `y = E z`, `E W = 0`. The lengths `l`
give `P (l(z) - l) = 0`, see `softrobots.model.muscle_lengths`, where `P` and `W` are the factors of `spread`, `W P`, here with
orthonormal rows of `P`, segment by segment. So

.. math:: P l_z \dot z = P \dot l, \quad P l_z \ddot z = P (\ddot l - \dot z^T l_{zz} \dot z)

Torques `r` on the strains are :math:`F^T (r - (P l_z)^T \mu)` on `y`, with the tensions :math:`\mu` that leave nothing on the
held sums, :math:`(P l_z W)^T \mu = W^T r`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.core.checks import FloatArray
from softrobots.model.muscle_paths import MusclePaths

_RANK = 1e-9  # least singular value that counts, relative to the largest
_ZERO = 1e-14  # entries that are rounding, relative to the largest of their row


def in_motion(unknowns: Unknowns) -> Unknowns:
    """Return a chain as motion takes it: with given lengths or friction of guides, which steps add, all of them are routes."""
    chain, rubs = unknowns.chain, unknowns.chain.guides is not None
    return replace(unknowns, chain=replace(chain, guides=None) if rubs else chain, as_routes=rubs or bool(chain.constrained))


def moving_coordinates(unknowns: Unknowns) -> tuple[int, ...]:
    """Return the elastic coordinates that are the unknowns of motion: the unknown strains, or what given lengths leave free."""
    unknowns = in_motion(unknowns)
    if not unknowns.held_lengths:
        return unknowns.strains
    free = np.abs(unknowns.chain.free[list(unknowns.strains)]).max(axis=0, initial=0.0)
    return tuple(np.flatnonzero(free > 0.0).tolist())


class HeldMotion(NamedTuple):
    """The matrices, for the strains that are not locked (n)."""

    moving: tuple[int, ...]
    """The elastic coordinates that move (f)."""
    free: FloatArray
    """`F`, shape (n, f)."""
    elastic: FloatArray
    """`E`, shape (f, n)."""
    shares: FloatArray
    """`W`, shape (n, c)."""
    slopes: FloatArray
    """`P`, shape (c, M)."""
    linear: bool
    """Whether the lengths are linear in the strains that are not locked."""


def held_motion(unknowns: Unknowns) -> HeldMotion:
    """Return the matrices of a robot with given lengths."""
    chain, strains = unknowns.chain, list(unknowns.strains)
    moving = moving_coordinates(unknowns)
    free, elastic = chain.free[np.ix_(strains, moving)], chain.elastic[np.ix_(moving, strains)]
    shares, slopes = [], []
    for segment in unknowns.segments:
        muscles = sorted(segment.muscles)
        columns, own = held_factors(chain.spread[np.ix_(strains, muscles)])
        rows = np.zeros((len(own), len(chain.actuators)))
        rows[:, muscles] = own
        shares.append(columns)
        slopes.append(rows)
    return HeldMotion(
        moving,
        _clean(free),
        _clean(elastic),
        _clean(np.concatenate(shares, axis=1)),
        _clean(np.concatenate(slopes)),
        _are_linear(chain.muscle_paths, strains),
    )


def held_factors(spread: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return `W` and `P`, shapes (n, c) and (c, m), of strains by the lengths of a segment, shape (n, m)."""
    left, values, right = np.linalg.svd(spread, full_matrices=False)
    rank = int((values > _RANK * values.max(initial=0.0)).sum())
    return left[:, :rank] * values[:rank], right[:rank]


def _are_linear(paths: MusclePaths, strains: list[int]) -> bool:
    """Tell whether no route goes, or is turned by one of the strains, around its backbone."""
    turning = np.abs(paths.across).max(axis=1) > 0.0
    return not (np.any(turning & np.isin(paths.places, strains)) or np.any(paths.turned))


def _clean(matrix: FloatArray) -> FloatArray:
    """Return a matrix without entries that are rounding."""
    return np.where(np.abs(matrix) > _ZERO * np.abs(matrix).max(axis=1, initial=0.0, keepdims=True), matrix, 0.0)
