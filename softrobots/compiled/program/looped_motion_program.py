"""Functions of the motion of a looped chain: straight-line functions of the groups, and loops over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, vector
from softrobots.compiled.chain.unrolled_chain import place_base
from softrobots.compiled.drivers import guide_motion_drivers
from softrobots.compiled.drivers.guide_drivers import angle_at, mean_decay, turn_at
from softrobots.compiled.motion.bent_sections import COLUMNS, TOGETHER
from softrobots.compiled.motion.gauss_step import copy_block, place_block
from softrobots.compiled.motion.looped_motion import SOLVERS, GroupLayout, group_kinds, load_frame, store_frame
from softrobots.compiled.motion.motion_groups import motion_groups, reach_behind
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.moving_joints import MovingFrame, joint_state, moved
from softrobots.compiled.motion.stage_pairs import STEPS, PairPlaces, start_pairs
from softrobots.compiled.program.generated_module import functions_of, text_of
from softrobots.compiled.program.looped_program import loop_text
from softrobots.compiled.program.motion_actuators import actuator_parts
from softrobots.compiled.program.motion_control import control_text
from softrobots.compiled.program.motion_parts import MotionParts
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.complex_numbers import symmetric_form
from softrobots.compiled.trace.expressions import cosine, sine

_PASSES = {
    "move": "Outward pass: motion of the bodies.",
    "articulate": "Inward pass: articulated inertias and factors.",
    "resist": "Inward pass: torques out of balance.",
    "correct": "Outward pass: correction of the accelerations.",
    "place": "Outward pass with positions alone.",
}
_REDUCE = "Inward pass: elimination of the torques at both stages."
_INWARD = ("articulate", "resist", "reduce", "couple", "reduce_coupled")


def looped_motion(plan: MotionPlan) -> MotionParts:
    """Trace the functions of a looped chain."""
    unknowns, layout, routes = plan.unknowns, plan.layout, plan.routes
    in_stages, n = layout.in_stages, len(unknowns.strains)
    passes = _PASSES | ({"reduce": _REDUCE} if plan.reduces else {})
    if plan.couples:
        passes |= {coupled: passes[name] for name, coupled in zip(*SOLVERS, strict=True)}
    first, free = (layout.prepared, 0) if routes is None else (routes.end, layout.unknowns * (in_stages and routes.held))
    places = GroupLayout(first, n, free, 2 if in_stages else 1)
    actuators = None if routes is None else actuator_parts(plan, routes)
    most = max(sum(len(unknowns.moving(row)) for row in group) for group in motion_groups(unknowns))
    pairs = PairPlaces(places.end, most) if plan.couples else None
    kinds = group_kinds(plan, places, pairs)
    record, sequence = places.end if pairs is None else pairs.end, {}
    calls: dict[str, list[tuple[int, str]]] = {name: [] for name in passes}
    for kind in kinds:
        for place, row in enumerate(kind.rows):
            motor = unknowns.motor(row)
            first = unknowns.place[unknowns.moving(row)[0]] if motor is None else motor
            sequence[row] = (kind.number, record, place * kind.columns.width, first)
            record += kind.record
        names = [block.name for block in kind.blocks]
        for name, pass_calls in calls.items():
            steps = STEPS if name == "couple" else [name]
            own = [one for step in steps for one in names if one.rpartition("_")[0] == step]
            more = ", BENT[i]" if kind.bent and name == "move" else ""
            pass_calls += [(kind.number, f"{one}(w, AT[i], ROW[i], PLACE[i]{more})") for one in own]
    bent, together = dict.fromkeys(sequence, 0), list[tuple[int, ...]]()
    taken = "".join(f", {name}[i]" for name in COLUMNS[2:])
    joints = [(kind.number, f"take_{kind.number}(w, BENT_AT[i]{taken})") for kind in kinds if kind.bent]
    joints += [(kind.number, f"bend_{kind.number}(w, BENT_AT[i])") for kind in kinds if kind.bent]
    for kind in kinds:
        for one in range(0, len(kind.rows) if kind.bent else 0, TOGETHER):
            rows = kind.rows[one : one + TOGETHER]
            bent |= {row: record + 2 * place for place, row in enumerate(rows)}
            rows += rows[-1:] * (TOGETHER - len(rows))  # the last one also stands for those that are missing
            together.append((kind.number, record, *(place for row in rows for place in sequence[row][2:])))
            record += kind.bent
    bends = any(unknowns.traced(row).kind == "turn" and unknowns.traced(row).moving for row in sequence)
    tables: dict[str, object] = {"FIRST": places.bounds, "COUNT": places.bounds + 1, "N_ELEMENTS": len(sequence)}
    tables |= {f"GROUP_{kind.number}": tuple(kind.columns.numbers) for kind in kinds if kind.columns.width}
    if together:
        tables |= dict(zip(COLUMNS, zip(*together, strict=True), strict=True))
        tables |= {"BENT": tuple(bent[group[0]] for group in motion_groups(unknowns))}
        tables |= {"BENT_COUNT": places.bounds + 2, "BENT_N_ELEMENTS": len(together)}
    ordered = [sequence[group[0]] for group in motion_groups(unknowns)]
    tables |= dict(zip(("KIND", "AT", "ROW", "PLACE"), zip(*ordered, strict=True), strict=True))
    frame = [
        _prepare(plan, places, len(ordered), len(together)),
        _start_move(places, pairs),
        *([_bend(places, places.state if in_stages else plan.strains[0])] if bends else []),
        _start_articulate(plan, places),
        _start_resist(plan, places),
        _start_place(plan, places, len(ordered)),
        _finish_place(plan, places),
        *_stage_blocks(plan, places),
        *([] if pairs is None else [_start_couple(plan, pairs)]),
        *([] if actuators is None else [_start_reduce(places), *actuators.blocks]),
        *([_add_mass(plan, places)] if layout.full_damping else []),
    ]
    held = routes is not None and routes.held
    if layout.rubbing:
        strains, rates = plan.strains[:2] if held else (layout.position, layout.velocity)
        tables |= {"STRAIN_CORRECTION": plan.correction, "TORQUES": plan.torques[0], "STRAINS_AT": strains, "RATES_AT": rates}
    tables |= {"N_STRAINS": n, "N_BENDS": n * places.stages, "N_STAGES": places.stages, "RATES": _rates(plan, places)}
    tables |= {} if actuators is None else actuators.tables
    control = (("" if actuators is None else actuators.after) + control_text(plan, bends, bool(together))).strip()
    drivers = (turn_at, angle_at, mean_decay, *functions_of(guide_motion_drivers)) if plan.guides else ()
    loops, lane_loops = (
        [
            *([] if actuators is None else actuators.loops(suffix)),
            *(loop_text(name, purpose, calls[name], back=name in _INWARD, suffix=suffix) for name, purpose in passes.items()),
            *([loop_text("bend", "Joints of sections.", joints, back=False, suffix=suffix, prefix="BENT_")] * bool(together)),
            *map(text_of, drivers),
            control.replace("_SUFFIX", suffix).replace("w[COUPLED]", flag),
        ]
        for suffix, flag in (("", "w[COUPLED]"), ("_lanes", "w[COUPLED * LANES]"))
    )
    blocks = {block.name: block for block in (*frame, *(block for kind in kinds for block in kind.blocks))}
    return MotionParts([*blocks.values()], record, tables, loops, lane_loops)


def _prepare(plan: MotionPlan, places: GroupLayout, count: int, together: int) -> Block:
    block = Block("motion_prepare", "Compute what depends on motors, force, gravity and time step only.")
    unknowns, layout, zero = plan.unknowns, plan.layout, constants(np.zeros(3))
    frame = MovingFrame(constants(np.eye(3)), zero, zero, -vector(block.loads(layout.gravity, 3)))
    for row, element in enumerate(unknowns.leading(block)):
        motor = unknowns.motor(row) or 0
        rate, change = (block.load(first + motor) for first in (layout.motor_velocities, layout.motor_accelerations))
        frame = frame.shifted(range(3), element.translation.tolist())
        turned = replace(frame, axes=frame.axes @ element.rotation)
        frame, _, _ = moved(turned, joint_state(element.kind == "slide", element.coordinates[0], rate, change))
    frame = frame.shifted(range(3), reach_behind(unknowns, unknowns.leading_motors - 1).tolist())
    store_frame(block, places.base, frame)
    block.store_all(places.bounds, [0.0, float(count), float(together)])
    return block


def _start_move(places: GroupLayout, pairs: PairPlaces | None) -> Block:
    block = Block("start_move", "Start at the base.")
    for stage in range(places.stages):
        store_frame(block, places.frame + stage, load_frame(block, places.base), places.stages)
    block.store_all(0 if pairs is None else pairs.point, [0.0] * (0 if pairs is None else 6))
    return block


def _start_couple(plan: MotionPlan, pairs: PairPlaces) -> Block:
    block = Block("start_couple", "Start at the tip with its force, without bodies beyond.")
    quarter = symmetric_form(plan.factors(block)[1] * (1.0 / plan.massive(block)))
    start_pairs(block, pairs, _tip_force(plan, block), quarter)
    return block


def _stage_blocks(plan: MotionPlan, places: GroupLayout) -> list[Block]:
    """Trace the functions that place both stages of a step."""
    layout, routes = plan.layout, plan.routes
    if not layout.in_stages:
        return []
    placed = [places.placed + 2 * layout.unknowns * number for number in range(3)]
    blocks = [place_block(layout, placed)]
    if routes is not None:
        taken = zip((layout.unknown, layout.rate, layout.acceleration), placed, strict=True)
        strains = (*plan.strains[:3], routes.pulls)
        kept = [(places.state + 2 * places.unknowns * number, one) for number, one in enumerate(strains)]
        blocks += [
            copy_block("take_stage", "Take an unknown at a stage.", [*taken], "i", "at"),
            copy_block("keep_stage", "Keep a strain at a stage.", kept if routes.held else kept[3:], "at", "i"),
        ]
    return blocks


def _rates(plan: MotionPlan, places: GroupLayout) -> int:
    """Return the place of the rates of the unknowns at all stages."""
    return places.placed + 2 * plan.layout.unknowns if plan.layout.in_stages else plan.layout.rate


def _bend(places: GroupLayout, strains: int) -> Block:
    """They do not depend on each other, so that compilers vectorise the loop."""
    block = Block("bend", "Compute cosine and sine of an unknown.", ("i",))
    angle = block.load(strains, "i")
    block.store(places.cosine, cosine(angle), "i")
    block.store(places.sine, sine(angle), "i")
    return block


def _start_articulate(plan: MotionPlan, places: GroupLayout) -> Block:
    block = Block("start_articulate", "Start at the tip with its force, without bodies beyond.")
    block.store_all(places.inertia, [0.0] * (places.pull - places.inertia))
    block.store_all(places.pull, [*_tip_force(plan, block), *[0.0] * 9])
    return block


def _start_resist(plan: MotionPlan, places: GroupLayout) -> Block:
    block = Block("start_resist", "Start at the tip with its force, and clear all sums.")
    for stage in range(places.stages):
        block.store_spaced(places.wrench + stage, [0.0, 0.0, 0.0, *_tip_force(plan, block)], places.stages)
    block.store_all(places.sums, [0.0] * 6 * places.stages)
    block.store_all(places.answer, [0.0] * 6 * places.stages)
    return block


def _add_mass(plan: MotionPlan, places: GroupLayout) -> Block:
    block = Block("add_mass", "Add a part of Rayleigh's term for the mass.", ("i", "at", "j"))
    layout, routes = plan.layout, plan.routes
    to = plan.torques[0] if routes is None or not routes.held else routes.dampers
    rate = block.load(_rates(plan, places), "j")
    block.store(to, block.load(to, "i") + block.load(layout.mass_damping, "at") * rate, "i")
    return block


def _start_reduce(places: GroupLayout) -> Block:
    block = Block("start_reduce", "Clear the sums over the torques out of balance.")
    block.store_all(places.sums, [0.0] * 6 * places.stages)
    block.store_all(places.answer, [0.0] * 6 * places.stages)
    return block


def _tip_force(plan: MotionPlan, block: Block) -> Vector:
    """Return the force that the tip needs, minus the load on it."""
    return -vector(block.loads(plan.layout.force, 3))


def _start_place(plan: MotionPlan, places: GroupLayout, count: int) -> Block:
    block = Block("start_place", "Start behind the leading motors.")
    axes, origin = place_base(plan.unknowns.leading(block))
    reach = constants(reach_behind(plan.unknowns, plan.unknowns.leading_motors - 1))
    block.store_all(places.frame, axes.ravel().tolist())
    block.store_all(places.origin, (origin + axes @ reach).tolist())
    block.store_all(places.bounds, [0.0, float(count)])
    return block


def _finish_place(plan: MotionPlan, places: GroupLayout) -> Block:
    block = Block("finish_place", "Write the tip.")
    block.store_all(plan.layout.tip, block.loads(places.origin, 3))
    return block
