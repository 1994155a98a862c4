"""Code for a long chain: a body for each kind of element, and loops over the elements.

Three ways per evaluation, each a loop: outwards with the axes (`enter`), back with the loads and the elimination (`leave`),
outwards again with the steps (`take`). Elements of a kind share their code; numbers in which they differ stand in a table, and
what an element needs again on a later way is kept in its record in the workspace. The cost is proportional to the number of
elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.kernels.blocks import Block, hoist
from softrobots.kernels.elements import Load, constants, vector
from softrobots.kernels.elimination import Beyond, release
from softrobots.kernels.expressions import Expression, Scalar
from softrobots.kernels.layout import Layout
from softrobots.kernels.recursion import Balance, TracedElement, enter, leave
from softrobots.kernels.unknowns import Unknowns, softness_of

MOST_MULTIPLIERS = 3
"""Bending about two axes and elongation: what muscle lengths hold of a segment."""


@dataclass(frozen=True)
class Passing:
    """Places in the workspace of what elements pass on to each other."""

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
    def force(self) -> int:
        """Force and gravity in the axes behind the leading motors (6)."""
        return self.steps + 3

    @property
    def base(self) -> int:
        """Axes and origin of the frame behind the leading motors (12)."""
        return self.force + 6

    @property
    def end(self) -> int:
        """The first place behind."""
        return self.base + 12


@dataclass
class Kind:
    """Elements that share their code."""

    number: int
    """Number of the kind, in names of functions."""
    rows: list[int]
    """Its elements."""
    blocks: list[Block]
    """`enter`, `leave`, `take`; markers of segments lack the first."""
    table: list[float]
    """Numbers in which the elements differ, element by element."""
    width: int
    """How many of them an element has."""
    record: int
    """Size of the record of an element."""


class TableColumns:
    """Numbers of several elements of a kind: those that are the same in all are constants, others go into a table."""

    def __init__(self, block: Block, name: str, count: int) -> None:
        """Begin a table for `count` elements."""
        self._block, self._name, self._count = block, name, count
        self._columns: list[tuple[float, ...]] = []

    def entry(self, values: Sequence[Any]) -> Scalar:
        """The number of the element that the code is run for."""
        if len(set(values)) == 1:
            return float(values[0])
        column = tuple(float(value) for value in values)
        if column not in self._columns:
            self._columns.append(column)
        return self._block.table(self._name, self._columns.index(column), "row")

    def entries(self, values: Any) -> Any:
        """The same for arrays, shape (count, ...)."""
        array = np.asarray(values, dtype=np.float64)
        made = constants(np.zeros(array.shape[1:]))
        for index in np.ndindex(*array.shape[1:]):
            made[index] = self.entry(array[(slice(None), *index)].tolist())
        return made

    @property
    def width(self) -> int:
        """Numbers an element."""
        return len(self._columns)

    @property
    def numbers(self) -> list[float]:
        """The table, element by element."""
        return [column[row] for row in range(self._count) for column in self._columns]


def element_kinds(unknowns: Unknowns, layout: Layout, passing: Passing, *, weight: bool) -> list[Kind]:
    """Trace the code of every kind of element behind the leading motors.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        passing: Places of what elements pass on.
        weight: Whether there is gravity.

    Returns:
        The kinds.
    """
    groups: dict[Any, list[int]] = {}
    for row in range(unknowns.leading_motors, len(unknowns.chain.elements)):
        groups.setdefault(_signature(unknowns, row), []).append(row)
    return [_trace_kind(number, rows, unknowns, layout, passing, weight=weight) for number, rows in enumerate(groups.values())]


def _signature(unknowns: Unknowns, row: int) -> tuple[Any, ...]:
    """What must be the same for two elements to share code."""
    one = unknowns.traced(row, lambda _: 0.0, lambda _: 0.0, lambda _: 0.0)
    zeros = (np.asarray(one.rotation, dtype=np.float64) == 0.0).tolist()
    held = unknowns.multipliers_at(row)
    return one.kind, one.moving, one.held, held, str(zeros), bool(np.any(one.translation != 0.0))


def _trace_kind(number: int, rows: list[int], unknowns: Unknowns, layout: Layout, passing: Passing, *, weight: bool) -> Kind:
    names = ("at", "row", "q")
    way_out = Block(f"enter_{number}", "Go through an element outwards.", names)
    trace = way_out.trace
    way_in = Block(f"leave_{number}", "Go through it inwards and eliminate its coordinates.", names, trace)
    take = Block(f"take_{number}", "Find its steps.", names, trace)
    columns = TableColumns(way_out, f"TABLE_{number}", len(rows))
    element = _common(rows, unknowns, way_out, layout, columns)
    axes_loads = way_out.loads(passing.axes, 9)
    entered = enter(element, vector(axes_loads).reshape(3, 3))
    way_out.store_all(passing.axes, entered.end.ravel().tolist())

    state, loads, beyond, balance = _arriving(way_in, element, passing, unknowns.multipliers_at(rows[0]), weight=weight)
    guard = way_in.load(layout.single("guard"))
    left = leave(element, entered, loads, beyond, balance, guard=guard)
    way_in.store_all(passing.lever, [one for load in left.loads for one in load.lever])
    _store_beyond(way_in, passing, left.beyond)
    way_in.store_all(passing.sums, [balance.energy, balance.weight, balance.room, left.beyond.softest, left.beyond.negatives])

    turn_loads = take.loads(passing.turn, 3 + unknowns.multipliers_at(rows[0]))
    sum_loads = take.loads(passing.steps, 3)
    turn = vector(turn_loads)
    if left.eliminated is not None:
        steps = left.eliminated.steps(0, turn)
        sums: list[Scalar] = list(sum_loads)
        for place, step in enumerate(steps):
            held = element.held[place]
            residual = left.gradient[place] if held is None else left.gradient[place] + turn[3 + held]
            sums = [sums[0] + left.gradient[place] * step, sums[1] + residual * residual, sums[2] + step * step]
            take.store(layout.step - layout.unknown + place, step, "q")
        take.store_all(passing.turn, (turn + left.twists @ steps)[:3].tolist())
        take.store_all(passing.steps, sums)
    second = [*turn_loads, *sum_loads]
    size = hoist([way_in, take], way_out, [*state, guard, *second], 0, "at", overwritten=axes_loads)
    size += hoist([take], way_in, second, size, "at", overwritten=state)
    return Kind(number, rows, [way_out, way_in, take], columns.numbers, columns.width, size)


def _common(rows: list[int], unknowns: Unknowns, block: Block, layout: Layout, columns: TableColumns) -> TracedElement:
    """An element of a kind, with table entries for the numbers in which its elements differ."""
    ones = [unknowns.traced(row, lambda _: 0.0, lambda _: 0.0, lambda _: 0.0) for row in rows]
    first = ones[0]
    unknown = iter(block.loads(0, max(len(first.moving), 1), "q"))
    coordinates = [
        next(unknown) if place in first.moving or not first.moving else columns.entry([one.coordinates[place] for one in ones])
        for place in range(len(first.coordinates))
    ]
    pulls = [
        block.load(layout.pull - layout.unknown + place, "q") if unknowns.pulled else 0.0 for place in range(len(first.moving))
    ]
    return replace(
        first,
        rotation=columns.entries([one.rotation for one in ones]),
        translation=columns.entries([one.translation for one in ones]),
        bodies=[
            (columns.entry([one.bodies[place][0] for one in ones]), columns.entries([one.bodies[place][1] for one in ones]))
            for place in range(len(first.bodies))
        ],
        mass_beyond=columns.entry([one.mass_beyond for one in ones]),
        coordinates=coordinates,
        stiffness=columns.entries([one.stiffness for one in ones]).tolist(),
        rest=columns.entries([one.rest for one in ones]).tolist(),
        pull=pulls,
        length=columns.entry([one.length for one in ones]),
    )


def _arriving(
    block: Block, element: TracedElement, passing: Passing, multipliers: int, *, weight: bool
) -> tuple[list[Expression], list[Load], Beyond, Balance]:
    """What an element finds on the way back."""
    levers = block.loads(passing.lever, 6 if weight else 3)
    forces = block.loads(passing.force, 6 if weight else 3)
    loads = [Load(vector(forces[:3]), vector(levers[:3]), 1.0)]
    if weight:
        loads.append(Load(vector(forces[3:]), vector(levers[3:]), element.mass_beyond))
    n = 3 + multipliers
    upper = block.loads(passing.matrix, n * (n + 1) // 2)
    column = block.loads(passing.column, n)
    sums = block.loads(passing.sums, 5)
    matrix = constants(np.zeros((n, n)))
    for (row, other), value in zip(_upper(n), upper, strict=True):
        matrix[row, other] = matrix[other, row] = value
    beyond = Beyond(matrix, [vector(column)], sums[3], sums[4])
    return [*levers, *upper, *column, *sums], loads, beyond, Balance(sums[0], sums[1], sums[2])


def _store_beyond(block: Block, passing: Passing, beyond: Beyond) -> None:
    n = len(beyond.matrix)
    block.store_all(passing.matrix, [beyond.matrix[row, other] for row, other in _upper(n)])
    block.store_all(passing.column, beyond.columns[0].tolist())


def _upper(n: int) -> list[tuple[int, int]]:
    """Places of the upper triangle by columns: those of three rows come first."""
    return [(row, column) for column in range(n) for row in range(column + 1)]


def segment_blocks(unknowns: Unknowns, passing: Passing, segment: int) -> tuple[list[Block], int]:
    """Trace what happens at the ends of a segment whose sums are held.

    Args:
        unknowns: The chain.
        passing: Places of what elements pass on.
        segment: Its number.

    Returns:
        `hold` at its tip, `release` at its base on the way back, `let_go` there on the way out; and the size of the record.
    """
    softness = softness_of(unknowns, segment)
    count = len(softness)
    hold = Block(f"hold_{segment}", "Begin with the multipliers of a segment: nothing is coupled with them yet.")
    hold.store_all(passing.matrix + 6, [0.0] * (count * (count + 7) // 2))
    hold.store_all(passing.column + 3, [0.0] * count)
    back = Block(f"release_{segment}", "Eliminate the multipliers of a segment.", ("at",))
    n = 3 + count
    upper, column = back.loads(passing.matrix, n * (n + 1) // 2), back.loads(passing.column, n)
    signs = back.loads(passing.sums + 3, 2)
    matrix = constants(np.zeros((n, n)))
    for (row, other), value in zip(_upper(n), upper, strict=True):
        matrix[row, other] = matrix[other, row] = value
    made, beyond = release(Beyond(matrix, [vector(column)], signs[0], signs[1]), count, softness)
    _store_beyond(back, passing, beyond)
    back.store_all(passing.sums + 3, [beyond.softest, beyond.negatives])
    out = Block(f"let_go_{segment}", "Find the multipliers of a segment.", ("at",), back.trace)
    turn = out.loads(passing.turn, 3)
    out.store_all(passing.turn + 3, made.steps(0, vector(turn)).tolist())
    size = hoist([out], back, turn, 0, "at", overwritten=[*upper, *column])
    return [hold, back, out], size
