"""The functions of a long chain: the same names as those of a short one, made of loops over the elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softrobots.compiled.chain.constrained_segments import segment_blocks
from softrobots.compiled.chain.elements import Load, constants, vector
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.looped_chain import Kind, element_kinds
from softrobots.compiled.chain.looped_tip import CONTROL as LOOK
from softrobots.compiled.chain.looped_tip import tip_frame
from softrobots.compiled.chain.recursion_layout import RecursionLayout, TipLayout
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.chain.unrolled_chain import place_base
from softrobots.compiled.program.passes import decide, go_on, point_numbers
from softrobots.compiled.settings import LEAST_SIZE
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar, larger
from softrobots.model.serial_chain import ChainJoint


@dataclass(frozen=True)
class LoopedProgram:
    """The parts of the code."""

    blocks: list[Block]
    """Straight-line functions that find equilibria."""
    look: list[Block]
    """Those that look at the tip of one."""
    tables: dict[str, tuple[float, ...] | tuple[int, ...]]
    """Tables that they and the loops read."""
    places: dict[str, int]
    """Places in the workspace of the bounds of the loops, and how many steps a loop has."""
    lane_size: int
    """Size of the workspace that equilibria need."""
    size: int
    """Size of the workspace."""
    tip: TipLayout
    """Places in it of what a look finds."""
    stages: dict[str, list[tuple[int, str]]]
    """Of each of the three ways, `outward`, `inward`, `take`, and of those of a look: what is called for elements of which
    kind."""

    def loops(self, suffix: str = "") -> str:
        """Functions that go over the elements.

        Args:
            suffix: Ends the names of all functions: "_lanes" for those that work on many cases, which have no look at the tip.
        """
        ways = [way for way in self.stages if not suffix or way in _WAYS]
        texts = [*(self._way(way, suffix) for way in ways), _CONTROL.replace("_SUFFIX", suffix)]
        return "\n\n\n".join(texts if suffix else [*texts, LOOK])

    def _way(self, way: str, suffix: str) -> str:
        # The bounds come from the workspace: compilers would unroll a loop whose length they know, for minutes.
        place = " * LANES" if suffix else ""
        back = way.startswith("inward")
        lines = [
            f"def {way}_all{suffix}(w: Array) -> None:",
            f'    """{_WAYS[way.removesuffix("_tip")]}"""',
            "    i = N_ELEMENTS - 1" if back else "    i = 0",
            f"    while i {'>=' if back else '<'} w[{'FIRST' if back else 'COUNT'}{place}]:",
            "        kind = KIND[i]",
        ]
        word = "if"
        for kind, call in self.stages[way]:
            lines += [f"        {word} kind == {kind}:", f"            {call.replace('(', suffix + '(', 1)}"]
            word = "elif"
        return "\n".join([*lines, f"        i {'-' if back else '+'}= 1"])


_WAYS = {
    "outward": "Go outwards with the axes.",
    "inward": "Go back with the loads and eliminate.",
    "step": "Go outwards with the steps.",
}

_CONTROL = '''def evaluate_SUFFIX(w: Array) -> None:
    """Evaluate the point: Newton step, energy, residual, pivots."""
    start_outward_SUFFIX(w)
    outward_all_SUFFIX(w)
    start_inward_SUFFIX(w)
    inward_all_SUFFIX(w)
    step_all_SUFFIX(w)
    finish_SUFFIX(w)


def newton_pass_SUFFIX(w: Array) -> None:
    """Evaluate the point, and go on to the next."""
    evaluate_SUFFIX(w)
    decide_SUFFIX(w)
    for i in range(N):
        advance_SUFFIX(w, i)


def first_pass_SUFFIX(w: Array) -> None:
    """Prepare, evaluate the robot at its start, and go on from there."""
    prepare_SUFFIX(w)
    start_SUFFIX(w)
    if N_CONSTRAINTS == 0:
        for i in range(N):
            relax_SUFFIX(w, i)
    newton_pass_SUFFIX(w)'''


def looped_program(unknowns: Unknowns, layout: Layout, *, weight: bool) -> LoopedProgram:
    """Trace the functions that find equilibria of a long chain.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        weight: Whether there is gravity.

    Returns:
        The program.
    """
    recursion = RecursionLayout(layout.prepared)
    tables: dict[str, tuple[float, ...] | tuple[int, ...]] = {}
    stages: dict[str, list[tuple[int, str]]] = {}
    kinds = element_kinds(unknowns, layout, recursion, weight=weight)
    # Before the records: the share of the step that a pass goes, and the bounds of the loops.
    blocks, sequence, lane_size = _sequence(unknowns, layout, recursion, kinds, recursion.end + 3, stages)
    tip = TipLayout(lane_size, layout.motors, layout.unknowns, len(unknowns.chain.held))
    looking = element_kinds(unknowns, layout, recursion, weight=weight, tip=tip)
    look, look_sequence, size = _sequence(unknowns, layout, recursion, looking, tip.end, stages, tip)
    tables |= {f"TABLE_{kind.number}": tuple(kind.table) for kind in kinds if kind.table}
    for name, column in zip(("KIND", "AT", "ROW", "PLACE"), zip(*sequence, strict=True), strict=True):
        tables[name] = tuple(column)
    tables["AT_TIP"] = tuple(at for _, at, _, _ in look_sequence)
    bounds = {"FIRST": recursion.end + 1, "COUNT": recursion.end + 2, "N_ELEMENTS": len(sequence)}
    frame = _frame(unknowns, layout, recursion, len(sequence), weight=weight)
    look = tip_frame(unknowns, layout, recursion, tip, weight=weight) + look
    return LoopedProgram(frame + blocks, look, tables, bounds | tip.constants(), lane_size, size, tip, stages)


def _sequence(
    unknowns: Unknowns,
    layout: Layout,
    recursion: RecursionLayout,
    kinds: list[Kind],
    record: int,
    stages: dict[str, list[tuple[int, str]]],
    tip: TipLayout | None = None,
) -> tuple[list[Block], list[tuple[int, int, int, int]], int]:
    """Put the elements in order, with the ends of held segments between them.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        recursion: Places of what elements pass on.
        kinds: The kinds of elements.
        record: Place of the first record.
        stages: What is called for which kind; added to.
        tip: For a look at the tip: its places.

    Returns:
        The straight-line functions; by step of a loop: kind, place of the record, of the table row, coordinate; and the first
        place behind the records.
    """
    way, look, at = ("", "", "AT[i]") if tip is None else ("_tip", "tip_", "AT_TIP[i]")
    outward_calls, inward_calls, step_calls = (stages.setdefault(one + way, []) for one in _WAYS)
    steps: dict[int, tuple[int, int, int, int]] = {}  # by element
    for kind in kinds:
        for place, row in enumerate(kind.rows):
            steps[row] = (kind.number, record, place * kind.width, _coordinate(unknowns, layout, row))
            record += kind.record
        for name, calls in (("outward", outward_calls), ("inward", inward_calls), ("step", step_calls)):
            calls.append((kind.number, f"{name}_{look}{kind.number}(w, {at}, ROW[i], PLACE[i])"))
    blocks = [block for kind in kinds for block in kind.blocks]
    sequence = [steps[row] for row in sorted(steps)]
    ends = list(zip(range(len(unknowns.segment_spans)), unknowns.segment_spans, strict=True))
    for segment, (first, last) in reversed(ends):
        made, size = segment_blocks(unknowns, recursion, segment, tip)
        blocks += made
        base, end = len(kinds) + 2 * segment, len(kinds) + 2 * segment + 1
        leading = unknowns.leading_motors
        sequence.insert(last + 1 - leading, (end, 0, 0, 0))
        sequence.insert(first - leading, (base, record, 0, 0))
        record += size
        inward_calls += [
            (end, f"add_multipliers_{look}{segment}(w)"),
            (base, f"eliminate_multipliers_{look}{segment}(w, {at})"),
        ]
        step_calls.append((base, f"solve_multipliers_{look}{segment}(w, {at})"))
    return blocks, sequence, record


def _coordinate(unknowns: Unknowns, layout: Layout, row: int) -> int:
    """Place of the first coordinate of an element in the workspace."""
    element = unknowns.chain.elements[row]
    if isinstance(element, ChainJoint) and element.motor is not None:
        return element.motor
    return layout.unknown + unknowns.place[unknowns.moving(row)[0]]


def _frame(unknowns: Unknowns, layout: Layout, recursion: RecursionLayout, count: int, *, weight: bool) -> list[Block]:
    """The straight-line functions around the loops."""
    return [
        _prepare(unknowns, layout, recursion, count),
        _start_outward(recursion),
        _start_inward(unknowns, recursion, weight=weight),
        _finish(unknowns, layout, recursion, weight=weight),
        _decide(unknowns, layout, recursion),
        _advance(layout, recursion),
        _start(layout),
        _relax(unknowns, layout),
    ]


def _prepare(unknowns: Unknowns, layout: Layout, recursion: RecursionLayout, count: int) -> Block:
    block = Block("prepare", "Compute what depends on motors and load only.")
    leading = [
        unknowns.traced(row, lambda motor: block.load(motor), lambda _: 0.0, lambda _: 0.0)
        for row in range(unknowns.leading_motors)
    ]
    axes, origin = place_base(leading)
    for place, load in ((0, layout.force), (3, layout.gravity)):
        block.store_all(recursion.force + place, (axes.T @ vector(block.loads(load, 3))).tolist())
    block.store_all(recursion.base, [*axes.ravel().tolist(), *origin.tolist()])
    block.store_all(recursion.end + 1, [0.0, float(count)])
    return block


def _start_outward(recursion: RecursionLayout) -> Block:
    block = Block("start_outward", "Stand at the base.")
    block.store_all(recursion.axes, constants(np.eye(3)).ravel().tolist())
    return block


def _start_inward(unknowns: Unknowns, recursion: RecursionLayout, *, weight: bool) -> Block:
    block = Block("start_inward", "Stand at the tip, with nothing beyond.")
    axes = vector(block.loads(recursion.axes, 9)).reshape(3, 3)
    lever = (axes @ constants(unknowns.chain.tip_translation)).tolist()
    block.store_all(recursion.lever, [*lever, 0.0, 0.0, 0.0] if weight else lever)
    block.store_all(recursion.matrix, [0.0] * 6)
    block.store_all(recursion.column, [0.0] * 3)
    block.store_all(recursion.turn, [0.0] * 3)
    block.store_all(recursion.sums, [0.0, 0.0, 1.0, 1.0, 0.0])
    block.store_all(recursion.steps, [0.0, 0.0, 0.0])
    return block


def _finish(unknowns: Unknowns, layout: Layout, recursion: RecursionLayout, *, weight: bool) -> Block:
    block = Block("finish", "Put together what the loops have summed up.")
    sums, steps = block.loads(recursion.sums, 5), block.loads(recursion.steps, 3)
    levers, forces = block.loads(recursion.lever, 6), block.loads(recursion.force, 6)
    loads = [Load(vector(forces[:3]), vector(levers[:3]), 1.0), Load(vector(forces[3:]), vector(levers[3:]), 0.0)]
    energy: Scalar = sums[0] - sum((one.force @ one.lever for one in loads[: 2 if weight else 1]), 0.0)
    load = _square(block.loads(layout.force, 3)) * unknowns.chain.reach**2 + sums[1]
    if unknowns.pulled:
        load = load + _square(block.loads(layout.pull, layout.unknowns))
    numbers = point_numbers(
        slope=steps[0],
        error=steps[1],
        length=steps[2],
        energy=energy,
        elastic=sums[0],
        load=larger(load, LEAST_SIZE**2),
        range_margin=sums[2],
        min_pivot=sums[3],
        n_negative_pivots=sums[4],
    )
    for name, value in numbers.items():
        block.store(layout.single(name), value)
    base = block.loads(recursion.base, 12)
    block.store_all(layout.tip, (vector(base[9:]) + vector(base[:9]).reshape(3, 3) @ loads[0].lever).tolist())
    return block


def _decide(unknowns: Unknowns, layout: Layout, recursion: RecursionLayout) -> Block:
    block = Block("decide", "Decide what becomes of the case.")
    names = ("energy", "slope", "error", "length", "size", "rounding", "min_pivot", "n_negative_pivots", "range_margin")
    point: dict[str, Scalar] = {name: block.load(layout.single(name)) for name in names}
    mode, share = decide(
        block,
        layout,
        point,
        n_constraints=len(unknowns.chain.held),
        spring_rounding=unknowns.spring_rounding,
        mode=block.load(layout.single("mode")),
        bound=block.load(layout.single("bound")),
    )
    del mode
    block.store(recursion.end, share)
    return block


def _advance(layout: Layout, recursion: RecursionLayout) -> Block:
    block = Block("advance", "Go on with one unknown, if the case goes on.", ("i",))
    unknown, step = block.load(layout.unknown, "i"), block.load(layout.step, "i")
    share, mode = block.load(recursion.end), block.load(layout.single("mode"))
    block.store(layout.unknown, go_on(mode, unknown, share, step), "i")
    return block


def _start(layout: Layout) -> Block:
    block = Block("start", "Begin a case.")
    for name, value in (("mode", 0.0), ("bound", 1e300), ("pivot_shift", 0.0)):
        block.store(layout.single(name), value)
    return block


def _relax(unknowns: Unknowns, layout: Layout) -> Block:
    block = Block("relax", "Put an unknown where its spring is relaxed.", ("i",))
    rest = {float(unknowns.chain.rest[strain]) for strain in unknowns.strains}
    block.store(layout.unknown, rest.pop() if len(rest) == 1 else block.table("REST", 0, "i"), "i")
    return block


def _square(values: Sequence[Scalar]) -> Scalar:
    return sum((one * one for one in values), 0.0)
