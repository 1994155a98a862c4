"""Places of the sums that a looped recursion hands from element to element."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softrobots.compiled.chain.elements import constants, vector
from softrobots.compiled.chain.elimination import Outboard
from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression


@dataclass(frozen=True)
class RecursionLayout:
    """Places of the sums, behind the numbers of the case.

    Muscle lengths constrain at most three sums of a segment: bending about two axes, and elongation. So there are at most three
    multipliers.
    """

    first: int
    """First of the places."""
    axes: int = field(init=False)
    """Axes behind the last element of the outward pass (9)."""
    lever: int = field(init=False)
    """Levers of force and weight (6)."""
    matrix: int = field(init=False)
    """`P` of the elimination, upper triangle by columns (21)."""
    column: int = field(init=False)
    """`s` of the elimination (6)."""
    turn: int = field(init=False)
    """Turn of all elements nearer to the base, and multipliers (6)."""
    sums: int = field(init=False)
    """Elastic energy, squared weight, range margin, smallest pivot, number of negative pivots (5)."""
    steps: int = field(init=False)
    """Slope, squared residual, squared step (3)."""
    gaps: int = field(init=False)
    """Difference of the constrained sums of a segment from their given values (3)."""
    constraint_torques: int = field(init=False)
    """Sums of the torques of the constraints; in the step pass the mean of each (3)."""
    force: int = field(init=False)
    """Force and gravity in the axes behind the leading motors (6)."""
    base: int = field(init=False)
    """Axes and origin of the frame behind the leading motors (12)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        sums = dict(sums=5, steps=3, gaps=3, constraint_torques=3)
        assign_places(self, self.first, axes=9, lever=6, matrix=21, column=6, turn=6, **sums, force=6, base=12, end=0)


@dataclass(frozen=True)
class TipLayout:
    """Places of the response of the tip; `m` motor joints, `n` unknowns, `h` constraints, world axes, row by row."""

    first: int
    """First of the places."""
    motors: int
    """Number of motor joints."""
    unknowns: int
    """Number of unknowns."""
    n_constraints: int
    """Number of constrained sums."""
    jacobian: int = field(init=False)
    """Elastostatic Jacobian of the motor joints (3, m) [m/rad or m/m]."""
    motor_torques: int = field(init=False)
    """Load on each motor joint (m) [N m or N]."""
    tip_columns: int = field(init=False)
    """Derivative of the unknowns with respect to a force on the tip, `K^-1 J_k^T` (3, n) [rad/N or m/N]."""
    constraint_loads: int = field(init=False)
    """Load on each constrained sum (h) [N m or N]."""
    constraint_columns: int = field(init=False)
    """Derivative of the tip with respect to the constrained sums (3, h) [m/rad or -]."""
    twists: int = field(init=False)
    """Turn per motor joint of all beyond it, in the axes behind the leading motors (3, m)."""
    column: int = field(init=False)
    """`s` of the elimination of the three right-hand sides (18); see `RecursionLayout`."""
    turn: int = field(init=False)
    """Their turns of all elements nearer to the base, and multipliers (18)."""
    bends: int = field(init=False)
    """Their sums of `c x` over the strains so far (9)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        m, n, h = self.motors, self.unknowns, self.n_constraints
        results = dict(jacobian=3 * m, motor_torques=m, tip_columns=3 * n, constraint_loads=h, constraint_columns=3 * h)
        assign_places(self, self.first, **results, twists=3 * m, column=18, turn=18, bends=9, end=0)

    def constants(self) -> dict[str, int]:
        """Return the places of the results by their names in generated code."""
        names = ("jacobian", "motor_torques", "tip_columns", "constraint_loads", "constraint_columns")
        return {name.upper(): getattr(self, name) for name in names}


def sides(first: int, others: int | None) -> list[int]:
    """Return the place of a vector for each right-hand side: of the balance, and of the three of the tip if there are any."""
    return [first] if others is None else [first, *(others + 6 * axis for axis in range(3))]


def load_outboard(block: Block, recursion: RecursionLayout, n: int, tip: TipLayout | None) -> tuple[Outboard, list[Expression]]:
    """Read the sums of the outboard elements, with `n` components; return them and the elements of matrix and columns."""
    upper = block.loads(recursion.matrix, n * (n + 1) // 2)
    columns = [block.loads(place, n) for place in sides(recursion.column, None if tip is None else tip.column)]
    matrix = constants(np.zeros((n, n)))
    for (row, other), value in zip(_upper(n), upper, strict=True):
        matrix[row, other] = matrix[other, row] = value
    min_pivot, n_negative_pivots = block.loads(recursion.sums + 3, 2)
    outboard = Outboard(matrix, [vector(column) for column in columns], min_pivot, n_negative_pivots)
    return outboard, [*upper, *(one for column in columns for one in column)]


def store_outboard(block: Block, recursion: RecursionLayout, outboard: Outboard, tip: TipLayout | None) -> None:
    """Write the sums that an element hands on."""
    n = len(outboard.matrix)
    block.store_all(recursion.matrix, [outboard.matrix[row, other] for row, other in _upper(n)])
    for place, column in zip(sides(recursion.column, None if tip is None else tip.column), outboard.columns, strict=True):
        block.store_all(place, column.tolist())


def _upper(n: int) -> list[tuple[int, int]]:
    """Indices of the upper triangle by columns: those of three rows come first."""
    return [(row, column) for column in range(n) for row in range(column + 1)]
