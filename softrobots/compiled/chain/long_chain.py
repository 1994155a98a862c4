"""Code for a long chain: a body for each kind of element, and loops over the elements.

Three ways per evaluation, each a loop: outwards with the axes (`enter`), back with the loads and the elimination (`leave`),
outwards again with the steps (`take`). Elements of a kind share their code; numbers in which they differ stand in a table, and
what an element needs again on a later way is kept in its record in the workspace. The cost is proportional to the number of
elements.

A look at the tip (`softrobots.compiled.chain.long_tip`) goes the same ways with three more right-hand sides: how the tip moves
with the unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Load, constants, vector
from softrobots.compiled.chain.elimination import Beyond
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.passing import Passing, TipPlaces, load_beyond, sides, store_beyond
from softrobots.compiled.chain.recursion import Balance, Left, TracedElement, enter, leave
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.trace.blocks import Block, hoist
from softrobots.compiled.trace.expressions import Expression, Scalar


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


def element_kinds(
    unknowns: Unknowns, layout: Layout, passing: Passing, *, weight: bool, tip: TipPlaces | None = None
) -> list[Kind]:
    """Trace the code of every kind of element behind the leading motors.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        passing: Places of what elements pass on.
        weight: Whether there is gravity.
        tip: For a look at the tip: the places of what that passes on and finds.

    Returns:
        The kinds.
    """
    groups: dict[Any, list[int]] = {}
    for row in range(unknowns.leading_motors, len(unknowns.chain.elements)):
        groups.setdefault(_signature(unknowns, row), []).append(row)
    return [
        _trace_kind(number, rows, unknowns, layout, passing, weight=weight, tip=tip)
        for number, rows in enumerate(groups.values())
    ]


def _signature(unknowns: Unknowns, row: int) -> tuple[Any, ...]:
    """What must be the same for two elements to share code."""
    one = unknowns.traced(row, lambda _: 0.0, lambda _: 0.0, lambda _: 0.0)
    zeros = (np.asarray(one.rotation, dtype=np.float64) == 0.0).tolist()
    held = unknowns.multipliers_at(row)
    return one.kind, one.moving, one.held, held, str(zeros), bool(np.any(one.translation != 0.0))


def _trace_kind(
    number: int,
    rows: list[int],
    unknowns: Unknowns,
    layout: Layout,
    passing: Passing,
    *,
    weight: bool,
    tip: TipPlaces | None,
) -> Kind:
    names, look = ("at", "row", "q"), "" if tip is None else "tip_"
    way_out = Block(f"enter_{look}{number}", "Go through an element outwards.", names)
    trace = way_out.trace
    way_in = Block(f"leave_{look}{number}", "Go through it inwards and eliminate its coordinates.", names, trace)
    take = Block(f"take_{look}{number}", "Find its steps.", names, trace)
    columns = TableColumns(way_out, f"TABLE_{number}", len(rows))
    element = _common(rows, unknowns, way_out, layout, columns)
    axes_loads = way_out.loads(passing.axes, 9)
    entered = enter(element, vector(axes_loads).reshape(3, 3))
    way_out.store_all(passing.axes, entered.end.ravel().tolist())

    multipliers = unknowns.multipliers_at(rows[0])
    state, loads, beyond, balance = _arriving(way_in, element, passing, multipliers, weight=weight, tip=tip)
    guard = way_in.load(layout.single("guard"))
    left = leave(element, entered, loads, beyond, balance, tip_columns=tip is not None, guard=guard if tip is None else 0.0)
    way_in.store_all(passing.lever, [one for load in left.loads for one in load.lever])
    store_beyond(way_in, passing, left.beyond, tip)
    if tip is None:
        state = [*state, *_add_held(way_in, element, left, passing, multipliers)]
        way_in.store_all(
            passing.sums, [balance.energy, balance.weight, balance.room, left.beyond.softest, left.beyond.negatives]
        )
        second = _take_step(take, element, left, layout, passing, multipliers)
    else:
        second = _take_tip(take, way_in, left, layout, passing, tip, multipliers)
    size = hoist([way_in, take], way_out, [*state, guard, *second], 0, "at", overwritten=axes_loads)
    size += hoist([take], way_in, second, size, "at", overwritten=state)
    return Kind(number, rows, [way_out, way_in, take], columns.numbers, columns.width, size)


def _add_held(block: Block, element: TracedElement, left: Left, passing: Passing, multipliers: int) -> list[Expression]:
    """Add an element to the held sums of its segment, and to the torques that hold them; return what they were before."""
    gaps, torques = block.loads(passing.gaps, multipliers), block.loads(passing.held_torques, multipliers)
    with_own: list[list[Scalar]] = [list(gaps), list(torques)]
    for place, held in enumerate(element.held):
        if held is not None:
            with_own[0][held] = with_own[0][held] + (element.coordinates[element.moving[place]] - element.rest[place])
            with_own[1][held] = with_own[1][held] + left.gradient[place]
    block.store_all(passing.gaps, with_own[0])
    block.store_all(passing.held_torques, with_own[1])
    return [*gaps, *torques]


def _take_step(
    take: Block, element: TracedElement, left: Left, layout: Layout, passing: Passing, multipliers: int
) -> list[Expression]:
    """Find the Newton step of an element; return what it reads that the elements before have written."""
    turn_loads, sum_loads = take.loads(passing.turn, 3 + multipliers), take.loads(passing.steps, 3)
    if left.eliminated is not None:
        turn = vector(turn_loads)
        steps = left.eliminated.steps(0, turn)
        sums: list[Scalar] = list(sum_loads)
        means = take.loads(passing.held_torques, multipliers)
        for place, step in enumerate(steps):
            held = element.held[place]
            residual = left.gradient[place] if held is None else left.gradient[place] - means[held]
            sums = [sums[0] + left.gradient[place] * step, sums[1] + residual * residual, sums[2] + step * step]
            take.store(layout.step - layout.unknown + place, step, "q")
        take.store_all(passing.turn, (turn + left.twists @ steps)[:3].tolist())
        take.store_all(passing.steps, sums)
        return [*turn_loads, *sum_loads, *means]
    return [*turn_loads, *sum_loads]


def _take_tip(
    take: Block, way_in: Block, left: Left, layout: Layout, passing: Passing, tip: TipPlaces, multipliers: int
) -> list[Expression]:
    """Find how an element follows a force on the tip; for a motor, what is known of the Jacobian before the last element."""
    turn_loads = [take.loads(place, 3 + multipliers) for place in sides(passing.turn, tip.turn)]
    bend_loads = [take.loads(tip.bends + 3 * axis, 3) for axis in range(3)]
    if left.eliminated is None:
        twist, bend = left.motion.twists[:, 0], left.motion.bends[:, 0]
        way_in.store(tip.motor_torques, left.motion.torque[0], "q")
        for axis, (nearer, turn) in enumerate(zip(bend_loads, turn_loads[1:], strict=True)):
            follow = left.motion.moves[axis, 0] - twist @ vector(nearer) + bend @ vector(turn[:3])
            take.store(tip.jacobian + axis * tip.motors, follow, "q")
            way_in.store(tip.twists + axis * tip.motors, twist[axis], "q")
    else:
        steps = [left.eliminated.steps(side, vector(turn)) for side, turn in enumerate(turn_loads)]
        for place, turn, step in zip(sides(passing.turn, tip.turn), turn_loads, steps, strict=True):
            take.store_all(place, (vector(turn) + left.twists @ step)[:3].tolist())
        for axis, (nearer, step) in enumerate(zip(bend_loads, steps[1:], strict=True)):
            take.store_all(tip.columns + axis * tip.unknowns - layout.unknown, step.tolist(), "q")
            take.store_all(tip.bends + 3 * axis, (vector(nearer) + left.motion.bends @ step).tolist())
    return [one for part in (*turn_loads, *bend_loads) for one in part]


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
        rest=_relaxed(ones, block, layout, columns),
        pull=pulls,
        length=columns.entry([one.length for one in ones]),
    )


def _relaxed(ones: Sequence[TracedElement], block: Block, layout: Layout, columns: TableColumns) -> list[Scalar]:
    """Where the unknowns of a kind are relaxed.

    For held ones that is their start, which spreads the held sums as the stiffness wants it: from there the springs load all of
    a sum alike. So only the multipliers feel what it takes to hold the sum, and the residual is not blurred by it.
    """
    at_rest: list[Scalar] = columns.entries([one.rest for one in ones]).tolist()
    start = layout.start - layout.unknown
    return [
        rest if held is None else block.load(start + place, "q")
        for place, (rest, held) in enumerate(zip(at_rest, ones[0].held, strict=True))
    ]


def _arriving(
    block: Block, element: TracedElement, passing: Passing, multipliers: int, *, weight: bool, tip: TipPlaces | None
) -> tuple[list[Expression], list[Load], Beyond, Balance]:
    """What an element finds on the way back."""
    levers = block.loads(passing.lever, 6 if weight else 3)
    forces = block.loads(passing.force, 6 if weight else 3)
    loads = [Load(vector(forces[:3]), vector(levers[:3]), 1.0)]
    if weight:
        loads.append(Load(vector(forces[3:]), vector(levers[3:]), element.mass_beyond))
    sums = block.loads(passing.sums, 5)
    beyond, state = load_beyond(block, passing, 3 + multipliers, tip)
    return [*levers, *state, *sums], loads, beyond, Balance(sums[0], sums[1], sums[2])
