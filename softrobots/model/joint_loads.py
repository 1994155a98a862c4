r"""Generalised forces of a load in joint coordinates, with their derivative kept as factors.

For a world-fixed force `f` at a point of a chain, with linear and angular Jacobian columns `v_i`, `w_i`, the derivative of
:math:`J_v^T f` is :math:`(f \times w_i) \cdot v_j` for `i <= j`, and symmetric. For a world-fixed moment `mu` that of
:math:`J_w^T \mu` is :math:`w_i \cdot (\mu \times w_j)` for `j < i`, else 0: not symmetric. Both are products of thin matrices
masked by the order of the joints; a chain of sections combines the columns first and multiplies then.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, read_only


class Entries(NamedTuple):
    """Rows and columns of a matrix over the joints, shape (nv, nv)."""

    places: Any
    """Place of each entry in the flat matrix, shape (n, m), integers."""
    ordered: Any
    """The same with the indices of each entry in ascending order."""
    below: FloatArray
    """Which entries are below the diagonal, shape (n, m): 1 or 0."""

    @classmethod
    def of(cls, rows: Any, columns: Any, nv: int) -> Entries:
        """Entries of given rows, shape (n,), and columns, shape (m,)."""
        rows = rows[:, None]
        ordered = nv * np.minimum(rows, columns) + np.maximum(rows, columns)
        return cls(nv * rows + columns, ordered, read_only((columns < rows).astype(np.float64)))


class JointLoad(NamedTuple):
    """A load as joint torques, with the factors of its derivative."""

    torque: FloatArray
    """Torque on the joints, `sum J^T w - g(q)`, shape (nv,) [N m or N]."""
    angular: FloatArray
    """Angular Jacobians of all wrenches, stacked, shape (3 k, nv)."""
    by_force: FloatArray
    """`-f x` of their linear Jacobians: rows times `angular` give the derivative of the forces, shape (3 k, nv) [N m]."""
    by_moment: FloatArray | None
    """`mu x` of their angular Jacobians, shape (3 k, nv) [N m]; None without moments."""
    gravity_derivative: FloatArray | None
    """Derivative of the gravity torque, shape (nv, nv); None if weightless."""
    potential: float
    """Potential energy of forces and gravity, `-sum f . p + U_g` [J]; moments have none."""
    scale: float
    """Size of the load, `sum |f| reach + |moment|` plus the norm of the gravity torque [N m]."""

    @property
    def none(self) -> bool:
        """Whether there is no wrench and no gravity."""
        return self.gravity_derivative is None and len(self.angular) == 0

    def derivative(self, entries: Entries) -> FloatArray:
        """Return entries of the derivative of `torque` with respect to the joint coordinates, shape of `entries`."""
        matrix: FloatArray = self.angular.T.dot(self.by_force).take(entries.ordered)
        if self.by_moment is not None:
            matrix += self.angular.T.dot(self.by_moment).take(entries.places) * entries.below
        if self.gravity_derivative is not None:
            matrix += self.gravity_derivative.take(entries.places)
        return matrix

    def within(self, columns: FloatArray) -> FloatArray:
        """Return the diagonal blocks, shape (n, m, m), of the derivative of forces and moments for groups of joints.

        The joints of each group, base to tip, are a row of `columns`, shape (n, m), integers.
        """
        upper, strictly_upper = _triangles(columns.shape[1])
        angular, by_force = (matrix[:, columns].transpose(1, 0, 2) for matrix in (self.angular, self.by_force))
        back = np.swapaxes(angular, -1, -2)
        blocks = (back @ by_force) * upper
        blocks += np.swapaxes(blocks * strictly_upper, -1, -2)
        if self.by_moment is not None:
            blocks += (back @ self.by_moment[:, columns].transpose(1, 0, 2)) * strictly_upper.T
        return np.asarray(blocks)


@lru_cache(maxsize=16)
def _triangles(n: int) -> tuple[FloatArray, FloatArray]:
    """Masks of the upper triangle with and without the diagonal, shape (n, n)."""
    return read_only(np.triu(np.ones((n, n)))), read_only(np.triu(np.ones((n, n)), 1))
