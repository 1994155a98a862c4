"""Functions of a looped chain: named as those of an unrolled one, with loops over the elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

from softrobots.compiled.chain.constrained_segments import segment_blocks
from softrobots.compiled.chain.layout import Layout, TipLayout
from softrobots.compiled.chain.looped_chain import Kind, element_kinds
from softrobots.compiled.chain.looped_response import CONTROL as RESPONSE_CONTROL
from softrobots.compiled.chain.looped_response import response_frame
from softrobots.compiled.chain.looped_tip import CONTROL as TIP_CONTROL
from softrobots.compiled.chain.looped_tip import tip_frame
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.looped_frame import looped_frame
from softrobots.compiled.routes.ends import held_blocks, keep_lengths, leave_segment, start_lengths
from softrobots.compiled.routes.loops import LENGTHS, PULLS, RUB, around, components_text, guided, loops_of
from softrobots.compiled.routes.terms import component_blocks, form_of, length_blocks, route_forms
from softrobots.compiled.trace.blocks import Block


@dataclass(frozen=True)
class LoopedProgram:
    """Parts of the code: of equilibria and the response of their tip, or of the response to given loads and motions."""

    blocks: list[Block]
    """Straight-line functions that find equilibria, or the response to given loads and motions."""
    tip_blocks: list[Block]
    """Straight-line functions of the response of the tip."""
    constants: dict[str, object]
    """Tables of numbers that differ between elements, places in the workspace, and the number of steps of a loop."""
    lane_size: int
    """Size of the workspace that those need."""
    size: int
    """Size of the workspace."""
    tip: TipLayout
    """Places of the response in it."""
    calls: dict[str, list[tuple[int, str]]]
    """By pass (`outward`, `inward`, `step`, and with `_tip` those of the response of the tip): kind of element and call."""
    route_loops: tuple[list[tuple[str, str]], list[tuple[str, str]]]
    """Loops over actuators, text and name of the form of elements, of equilibria and of the response of their tip."""

    def loops(self, suffix: str = "") -> str:
        """Return the functions that loop over the elements; those of batches end in "_lanes", without response of the tip."""
        passes = [name for name in self.calls if not suffix or name in _PASSES]
        routes = [loops_of(*loop, suffix) for loop in self.route_loops[0] + ([] if suffix else self.route_loops[1])]
        control = (RESPONSE_CONTROL if self.tip.given else _CONTROL).replace("_SUFFIX", suffix)
        texts = [
            *([RUB] if "GUIDE_AT" in self.constants else []),
            *routes,
            *(self._loop(name, suffix) for name in passes),
            control,
        ]
        return "\n\n\n".join(texts if suffix or self.tip.given else [*texts, TIP_CONTROL])

    def _loop(self, name: str, suffix: str) -> str:
        back = name.startswith("inward")
        return loop_text(name, _PASSES[name.removesuffix("_tip")], self.calls[name], back=back, suffix=suffix)


def loop_text(
    name: str, purpose: str, calls: Sequence[tuple[int, str]], *, back: bool, suffix: str = "", prefix: str = ""
) -> str:
    """Return the function of a pass: a loop over the elements that calls the function of the kind of each.

    The bounds come from the workspace: compilers would unroll a loop whose length they know, for minutes. The names of the
    tables and of the bounds begin with `prefix`.
    """
    place = " * LANES" if suffix else ""
    lines = [
        f"def {name}_all{suffix}(w: Array) -> None:",
        f'    """{purpose}"""',
        f"    i = {prefix}N_ELEMENTS - 1" if back else "    i = 0",
        f"    while i {'>=' if back else '<'} w[{'FIRST' if back else prefix + 'COUNT'}{place}]:",
        f"        kind = {prefix}KIND[i]",
    ]
    word = "if"
    for kind in dict.fromkeys(kind for kind, _ in calls):
        own = [call.replace("(", suffix + "(", 1) for number, call in calls if number == kind]
        lines += [f"        {word} kind == {kind}:", *(f"            {call}" for call in own)]
        word = "elif"
    return "\n".join([*lines, f"        i {'-' if back else '+'}= 1"])


_Step: TypeAlias = "tuple[int, int, int, int, int]"
_PREPARATION = ("prepare", "start_outward", "start_inward")
_PASSES = {
    "outward": "Outward pass: axes.",
    "inward": "Inward pass: loads and elimination.",
    "step": "Step pass: steps of the coordinates.",
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
    """Evaluate the point, and take a Newton step."""
    evaluate_SUFFIX(w)
    decide_SUFFIX(w)
    for i in range(N):
        advance_SUFFIX(w, i)


def first_pass_SUFFIX(w: Array) -> None:
    """Prepare, evaluate the robot at its start, and take a Newton step."""
    prepare_SUFFIX(w)
    start_SUFFIX(w)
    if N_CONSTRAINTS + N_SLIDERS == 0:
        for i in range(N):
            relax_SUFFIX(w, i)
    newton_pass_SUFFIX(w)'''


def looped_program(plan: Plan) -> LoopedProgram:
    """Trace the functions that find equilibria of a looped chain, and those of the response of its tip."""
    unknowns, layout = plan.unknowns, plan.layout
    calls: dict[str, list[tuple[int, str]]] = {}
    kinds = element_kinds(plan)
    # Before the records stand the share of the step, the bounds of the loops, and the places of routes.
    blocks, sequence, lane_size = _sequence(plan, kinds, plan.routes.end, calls)
    tip = TipLayout(lane_size, layout.motors, layout.unknowns, unknowns.n_constraints)
    tip_plan = replace(plan, tip=tip)
    tip_blocks, tip_sequence, size = _sequence(tip_plan, element_kinds(tip_plan), tip.end, calls)
    constants = _constants(plan, kinds, sequence) | tip.constants() | {"AT_TIP": tuple(at for _, at, *_ in tip_sequence)}
    route_blocks, loops, tables = _along_routes(plan)
    components, tip_loops = components_text(held=unknowns.held_lengths, rubbing=plan.routes.guided), []
    for name, form in route_forms(plan).items():
        tip_blocks += component_blocks(tip_plan, name, form)
        tip_loops.append((components, f"tip_{name}"))
    blocks = looped_frame(plan, len(sequence)) + blocks + route_blocks
    tip_blocks = tip_frame(plan, tip) + tip_blocks
    return LoopedProgram(blocks, tip_blocks, constants | tables, lane_size, size, tip, calls, (loops, tip_loops))


def looped_response(plan: Plan) -> LoopedProgram:
    """Trace the functions of the response of a looped chain to given loads and motions."""
    tip = TipLayout(plan.routes.end, plan.layout.motors, plan.layout.unknowns, plan.unknowns.n_constraints, given=True)
    plan = replace(plan, tip=tip)
    calls: dict[str, list[tuple[int, str]]] = {}
    kinds = element_kinds(plan)
    blocks, sequence, size = _sequence(plan, kinds, tip.end, calls)
    route_blocks, loops, tables = _along_routes(plan)
    frame = [block for block in looped_frame(plan, len(sequence)) if block.name in _PREPARATION]
    blocks = frame + response_frame(plan, tip) + blocks + route_blocks
    return LoopedProgram(blocks, [], _constants(plan, kinds, sequence) | tables, size, size, tip, calls, (loops, []))


def _constants(plan: Plan, kinds: Sequence[Kind], sequence: Sequence[_Step]) -> dict[str, object]:
    """Return the tables of the elements, and the bounds of the loops."""
    end = plan.recursion.end
    constants: dict[str, object] = {"FIRST": end + 1, "COUNT": end + 2, "N_ELEMENTS": len(sequence)}
    constants |= {"GUIDE_ENERGY": plan.recursion.sums} if plan.routes.guided else {}
    constants |= {f"TABLE_{kind.number}": tuple(kind.columns.numbers) for kind in kinds if kind.columns.numbers}
    steps = dict(zip(("KIND", "AT", "ROW", "PLACE", "ELEMENT"), zip(*sequence, strict=True), strict=True))
    return constants | {name: values for name, values in steps.items() if name != "ELEMENT" or plan.unknowns.routed}


def _along_routes(plan: Plan) -> tuple[list[Block], list[tuple[str, str]], dict[str, object]]:
    """Return the straight-line functions, the loops and the tables of actuators on routes."""
    blocks: list[Block] = []
    loops: list[tuple[str, str]] = []
    tables: dict[str, object] = {}
    lengths, pulls = (guided(LENGTHS), guided(PULLS)) if plan.routes.guided else (LENGTHS, PULLS)
    for name, form in route_forms(plan).items():
        added, columns = length_blocks(plan, name, form)
        blocks += added + component_blocks(plan, name, form)
        loops += [
            (lengths.replace("POINT_WIDTH", str(columns.width)) if columns else pulls, name),
            (components_text(held=plan.unknowns.held_lengths, rubbing=plan.routes.guided), name),
        ]
        if columns:
            tables |= plan.routes.tables() | ({f"POINT_TABLE_{name}": tuple(columns.numbers)} if columns.numbers else {})
    return blocks, loops, tables


def _sequence(
    plan: Plan, kinds: list[Kind], record: int, calls: dict[str, list[tuple[int, str]]]
) -> tuple[list[Block], list[_Step], int]:
    """Put the elements in order, with the ends of segments with muscles between them.

    Args:
        plan: The chain and its places.
        kinds: The kinds of elements.
        record: Place of the first record.
        calls: Calls of each pass, extended here.

    Returns:
        The straight-line functions; kind, place of the record, row of the table, coordinate and element of each step of a loop;
        and the first place behind the records.
    """
    unknowns, layout, infix = plan.unknowns, plan.layout, plan.infix
    suffix, at = ("_tip", "AT_TIP[i]") if infix else ("", "AT[i]")
    outward_calls, inward_calls, step_calls = (calls.setdefault(name + suffix, []) for name in _PASSES)
    steps: dict[int, _Step] = {}  # by element
    forms = {form: name for name, form in route_forms(plan).items()}
    for kind in kinds:
        for place, row in enumerate(kind.rows):
            steps[row] = (kind.number, record, place * kind.columns.width, _coordinate(unknowns, layout, row), row)
            record += kind.record
        routed = kind.rows[0] in plan.routes.beside
        form = forms[form_of(plan, kind.rows[0])] if routed else ""
        for name, pass_calls in (("outward", outward_calls), ("inward", inward_calls), ("step", step_calls)):
            before, after = around(name, form, infix) if routed else ([], [])
            own = f"{name}_{infix}{kind.number}(w, {at}, ROW[i], PLACE[i])"
            pass_calls += [(kind.number, call) for call in (*before, own, *after)]
    blocks = [block for kind in kinds for block in kind.blocks]
    sequence = [steps[row] for row in sorted(steps)]
    leading = unknowns.leading_motors
    for number, segment in reversed(list(enumerate(unknowns.segments))):
        base = len(kinds) + 2 * number
        end = base + 1
        sequence.insert(segment.last + 1 - leading, (end, 0, 0, 0, 0))
        if unknowns.routed:
            what, held = "lengths", unknowns.held_lengths
            added, size = held_blocks(plan, number, segment) if held else ([], 0)
            blocks += [start_lengths(plan, number, segment), leave_segment(plan, number)]
            blocks += [] if infix else [keep_lengths(plan, number, segment)]
            outward_calls.append((end, f"keep_lengths_{number}(w)"))
            inward_calls.append((end, f"start_lengths_{infix}{number}(w)"))
            if plan.routes.guided and not infix:
                inward_calls.append((end, f"rub(w, {number})"))
            step_calls.append((end, f"leave_segment_{infix}{number}(w)"))
        else:
            what, held = "multipliers", bool(segment.groups)
            added, size = segment_blocks(plan, number, segment)
            inward_calls.append((end, f"add_multipliers_{infix}{number}(w)"))
        blocks += added
        if held:
            sequence.insert(segment.first - leading, (base, record, 0, 0, 0))
            record += size
            inward_calls.append((base, f"eliminate_{what}_{infix}{number}(w, {at})"))
            step_calls.append((base, f"solve_{what}_{infix}{number}(w, {at})"))
    return blocks, sequence, record


def _coordinate(unknowns: Unknowns, layout: Layout, row: int) -> int:
    """Return the place of the first coordinate of an element in the workspace."""
    motor = unknowns.motor(row)
    return layout.unknown + unknowns.place[unknowns.moving(row)[0]] if motor is None else motor
