r"""Actuators on routes in motion: places of their numbers, and the strains that given lengths leave free.

The matrix of a step is that of the robot without actuators, `A`, bordered by the rows `b_m` of the lengths that change a
tension or are given. With the tensions' derivatives `k_m` by the lengths, `q = h^2/4` and :math:`X = A^{-1} B^T`, the
correction for torques `r` is

.. math:: x = -A^{-1} r - X \lambda, \quad (1 + q K B X) \lambda = -q K B A^{-1} r

and of given lengths :math:`B X \lambda = -B A^{-1} r`, which leaves `B x = 0` (Golub and Van Loan, Matrix Computations, 2013,
section 2.1.4). `X` costs a pass over the chain for each row. The stiffness of the tensions is that of every evaluation, so that
tendons may go slack between two of them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.chain.routes import Routes
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.motion.held_motion import HeldMotion, held_motion
from softrobots.compiled.trace.blocks import Block, TableColumns


@dataclass(frozen=True)
class MotionRoutes:
    """Places behind `first`: of the routes, and of the border of the matrix.

    `n` unknown strains, `c` rows of the border, `M` actuators, `k` stages.
    """

    unknowns: Unknowns
    """The chain."""
    first: int
    """First of the places."""
    parts: int = 1
    """Stages of a step, and parts of a number of the elimination: 2 where it is complex."""
    pulls: int = field(init=False)
    """Torque of the actuators on each strain (n) [N m or N]."""
    curvatures: int = field(init=False)
    """Tensions times second derivatives of the lengths by strains of an element, column by column (most of an element, n)."""
    stiffness: int = field(init=False)
    """Derivative of each tension by the length, of the rows of the border (c) [N/m]."""
    arms: int = field(init=False)
    """The rows of the border (c, n), with given lengths at all stages (k, c, n)."""
    torques: int = field(init=False)
    """What is out of balance on the strains (n, k) [N m or N]."""
    sides: int = field(init=False)
    """The same, or a row of the border, to be eliminated (n, k)."""
    answers: int = field(init=False)
    """`X`, row by row (c, n), or real and imaginary parts."""
    products: int = field(init=False)
    """`B X` (c, c), or real and imaginary parts."""
    system: int = field(init=False)
    """The factors of the matrix of the multipliers (c, c), or real and imaginary parts."""
    multipliers: int = field(init=False)
    """The multipliers (c), or real and imaginary parts."""
    bound: int = field(init=False)
    """Bound of the loops over routes."""
    strain: int = field(init=False)
    """The strains (n) [rad or m]; from here on with given lengths only."""
    strain_rate: int = field(init=False)
    """Their rates (n)."""
    strain_change: int = field(init=False)
    """Their accelerations (n)."""
    correction: int = field(init=False)
    """Correction of their accelerations at all stages (k, n)."""
    damper: int = field(init=False)
    """Torque of one damper."""
    dampers: int = field(init=False)
    """Torque of the dampers on each free coordinate at all stages (n, k)."""
    sums: int = field(init=False)
    """The combinations of strains that the lengths hold (c)."""
    gaps: int = field(init=False)
    """What they miss, or how they change (c)."""
    closing: int = field(init=False)
    """Derivative of the gaps by the sums and its factors, at all stages (k, c, c)."""
    slopes: int = field(init=False)
    """Derivative of each length by the strains (M, n)."""
    swerves: int = field(init=False)
    """Acceleration of each length at constant rates of the strains (M) [m/s^2]."""
    swerving: int = field(init=False)
    """The same of the segment that is passed (M)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        n, c, k, muscles = len(self.unknowns.strains), self.rows, self.parts, len(self.unknowns.chain.actuators)
        arms = (k if self.held else 1) * c * n
        sizes = dict(pulls=n, curvatures=0 if self.held else n * self.routes.stride, stiffness=c, arms=arms, torques=k * n)
        sizes |= dict(sides=k * n, answers=k * c * n, products=k * c * c, system=k * c * c, multipliers=k * c, bound=1)
        held = dict(strain=n, strain_rate=n, strain_change=n, correction=k * n, damper=1, dampers=k * n, sums=c, gaps=c)
        held |= dict(closing=k * c * c, slopes=muscles * n, swerves=muscles, swerving=muscles)
        sizes |= {name: size if self.held else 0 for name, size in held.items()}
        assign_places(self, self.routes.end, **sizes, end=0)

    @cached_property
    def routes(self) -> Routes:
        """The routes."""
        return Routes(self.unknowns, self.first)

    def table(self, block: Block, name: str, count: int) -> TableColumns:
        """Begin a table of numbers of `count` elements."""
        return TableColumns(block, name, count)

    @property
    def held(self) -> bool:
        """Whether lengths are given."""
        return self.unknowns.held_lengths

    @cached_property
    def lengths(self) -> HeldMotion:
        """The strains at given lengths."""
        return held_motion(self.unknowns)

    @property
    def border(self) -> int:
        """Place of the rows at the last stage."""
        return self.arms + (self.parts - 1) * self.rows * len(self.unknowns.strains) * self.held

    @property
    def stretched(self) -> list[int]:
        """The actuators whose tension changes with the length, or whose length is given, segment by segment."""
        return [muscle for segment in self.routes.segments for muscle in segment.stretched]

    @property
    def rows(self) -> int:
        """Number of rows of the border."""
        return self.lengths.shares.shape[1] if self.held else len(self.stretched)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """First unknown strain of each row of the border, and the one behind the last."""
        unknowns, arms = self.unknowns, self.unknowns.chain.muscle_paths
        touched = np.array([np.isin(np.arange(arms.count), arms.places[arms.muscle == one]) for one in self.stretched])
        touched = touched.reshape(-1, arms.count)[:, list(unknowns.strains)]
        if self.held:
            touched = np.abs(self.lengths.slopes[:, self.stretched]) @ touched > 0.0
        places = [np.flatnonzero(row) for row in touched]
        return [(int(one.min()), int(one.max()) + 1) if len(one) else (0, 0) for one in places]


def sparse(name: str, matrix: Any) -> dict[str, object]:
    """Return the tables of a matrix: where each row begins, columns and values of what is not zero."""
    rows, columns = np.nonzero(matrix)
    first = np.searchsorted(rows, np.arange(len(matrix) + 1)).tolist()
    values = matrix[rows, columns].tolist()
    return {f"{name}_FIRST": tuple(first), f"{name}_PLACE": tuple(columns.tolist()) or (0,), name: tuple(values) or (0.0,)}
