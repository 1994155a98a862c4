"""What the elements of a long chain pass on to each other, and where it stands in the workspace."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softrobots.compiled.chain.elements import constants, vector
from softrobots.compiled.chain.elimination import Beyond
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Expression


@dataclass(frozen=True)
class Passing:
    """Places of what elements pass on, behind the numbers of the case.

    Muscle lengths hold at most three sums of a segment: bending about two axes, and elongation. So many multipliers there are.
    """

    first: int
    """Where they begin."""

    @property
    def axes(self) -> int:
        """Axes behind the last element entered (9)."""
        return self.first

    @property
    def lever(self) -> int:
        """Levers of force and weight (6)."""
        return self.axes + 9

    @property
    def matrix(self) -> int:
        """`P` of the elimination, upper triangle by columns (21)."""
        return self.lever + 6

    @property
    def column(self) -> int:
        """`s` of the elimination (6)."""
        return self.matrix + 21

    @property
    def turn(self) -> int:
        """Turn of all nearer to the base, and multipliers (6)."""
        return self.column + 6

    @property
    def sums(self) -> int:
        """Elastic energy, squared weight, room, smallest pivot, number of negative ones (5)."""
        return self.turn + 6

    @property
    def steps(self) -> int:
        """Slope, squared residual, squared step (3)."""
        return self.sums + 5

    @property
    def gaps(self) -> int:
        """How far the held sums of a segment are from where they should be (3)."""
        return self.steps + 3

    @property
    def held_torques(self) -> int:
        """Sums of the torques that hold them; on the way out the mean of each (3)."""
        return self.gaps + 3

    @property
    def force(self) -> int:
        """Force and gravity in the axes behind the leading motors (6)."""
        return self.held_torques + 3

    @property
    def base(self) -> int:
        """Axes and origin of the frame behind the leading motors (12)."""
        return self.force + 6

    @property
    def end(self) -> int:
        """The first place behind."""
        return self.base + 12


@dataclass(frozen=True)
class TipPlaces:
    """Places behind those that equilibria need; `m` motor joints, `n` unknowns, `h` held sums, world axes, row by row."""

    first: int
    """Where they begin."""
    motors: int
    """Number of motor joints."""
    unknowns: int
    """Number of unknowns."""
    held: int
    """Number of held sums."""

    @property
    def jacobian(self) -> int:
        """Elastostatic Jacobian of the motor joints (3, m) [m/rad or m/m]."""
        return self.first

    @property
    def motor_torques(self) -> int:
        """Load on each motor joint (m) [N m or N]."""
        return self.jacobian + 3 * self.motors

    @property
    def columns(self) -> int:
        """How the unknowns follow a force on the tip, `K^-1 J_k^T` (3, n) [rad/N or m/N]."""
        return self.motor_torques + self.motors

    @property
    def held_loads(self) -> int:
        """Load on each held sum (h) [N m or N]."""
        return self.columns + 3 * self.unknowns

    @property
    def held_columns(self) -> int:
        """Derivative of the tip with respect to the held sums (3, h) [m/rad or -]."""
        return self.held_loads + self.held

    @property
    def twists(self) -> int:
        """Turn per motor joint of what is beyond it, in the axes behind the leading motors (3, m)."""
        return self.held_columns + 3 * self.held

    @property
    def column(self) -> int:
        """`s` of the elimination of the three right-hand sides (18); see `long_chain.Passing`."""
        return self.twists + 3 * self.motors

    @property
    def turn(self) -> int:
        """Their turns of all nearer to the base, and multipliers (18)."""
        return self.column + 18

    @property
    def bends(self) -> int:
        """Their sums of `c x` over the strains so far (9)."""
        return self.turn + 18

    @property
    def end(self) -> int:
        """The first place behind."""
        return self.bends + 9

    def constants(self) -> dict[str, int]:
        """Names of the results for generated code."""
        return {
            "JACOBIAN": self.jacobian,
            "MOTOR_TORQUES": self.motor_torques,
            "TIP_COLUMNS": self.columns,
            "HELD_LOADS": self.held_loads,
            "HELD_COLUMNS": self.held_columns,
        }


def sides(first: int, others: int | None) -> list[int]:
    """Places of what there is once a right-hand side: of the balance, and of the three of the tip."""
    return [first] if others is None else [first, *(others + 6 * axis for axis in range(3))]


def load_beyond(block: Block, passing: Passing, n: int, tip: TipPlaces | None) -> tuple[Beyond, list[Expression]]:
    """What the elements beyond hand on, with `n` components, and the numbers of which matrix and columns are made."""
    upper = block.loads(passing.matrix, n * (n + 1) // 2)
    columns = [block.loads(place, n) for place in sides(passing.column, None if tip is None else tip.column)]
    matrix = constants(np.zeros((n, n)))
    for (row, other), value in zip(_upper(n), upper, strict=True):
        matrix[row, other] = matrix[other, row] = value
    softest, negatives = block.loads(passing.sums + 3, 2)
    beyond = Beyond(matrix, [vector(column) for column in columns], softest, negatives)
    return beyond, [*upper, *(one for column in columns for one in column)]


def store_beyond(block: Block, passing: Passing, beyond: Beyond, tip: TipPlaces | None) -> None:
    """Write what an element hands on."""
    n = len(beyond.matrix)
    block.store_all(passing.matrix, [beyond.matrix[row, other] for row, other in _upper(n)])
    for place, column in zip(sides(passing.column, None if tip is None else tip.column), beyond.columns, strict=True):
        block.store_all(place, column.tolist())


def _upper(n: int) -> list[tuple[int, int]]:
    """Places of the upper triangle by columns: those of three rows come first."""
    return [(row, column) for column in range(n) for row in range(column + 1)]
