"""Code of the motion of a looped chain: functions for each kind of group of elements, called in loops over the groups.

Four passes, each a loop: outward with the motion of the bodies, inward with the factors
(`softrobots.compiled.motion.articulated`), inward with the residual, outward with the correction. Numbers in which groups of a
kind differ stand in a table; values for a later pass in the record of the group in the workspace.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Screw, Vector, constants, symmetric, turned, upper_triangle, vector
from softrobots.compiled.chain.elimination import Eliminated
from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.chain.looped_chain import Kind
from softrobots.compiled.motion.articulated import (
    ArticulatedGroup,
    GroupMotion,
    JointLine,
    Pull,
    articulate,
    carried_inward,
    carried_outward,
    moved_wrench,
)
from softrobots.compiled.motion.bent_sections import BentSections
from softrobots.compiled.motion.gauss_step import corrections, right_hand_side
from softrobots.compiled.motion.group_record import GroupRecord
from softrobots.compiled.motion.motion_groups import (
    ElementParts,
    MovingGroup,
    group_rubbing,
    group_signature,
    motion_groups,
    moving_parts,
)
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.moving_joints import MovingFrame, moved, wrench
from softrobots.compiled.motion.stage_pairs import STEPS, Factors, PairPlaces, compose, part_blocks, pivot
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.compiled.trace.complex_numbers import of_parts, parts_of, symmetric_form

SOLVERS = ("articulate", "reduce", "correct"), ("couple", "reduce_coupled", "correct_coupled")
"""Passes that factor and solve: with the matrix of the last stage for all of them, or with that of each stage."""


@dataclass(frozen=True)
class GroupLayout:
    """Places of what groups hand on, behind the numbers of the case."""

    first: int
    """First of the places."""
    unknowns: int
    """Number of unknown strains."""
    free: int = 0
    """Number of free coordinates of a robot with given lengths at both stages."""
    stages: int = 1
    """Stages of a step, whose numbers stand side by side; with two of them those of the elimination are complex."""
    frame: int = field(init=False)
    """Axes, angular velocity, angular acceleration and acceleration behind the last group of the outward pass (18, stages)."""
    origin: int = field(init=False)
    """Position of its origin, where the tip is asked for [m] (3)."""
    inertia: int = field(init=False)
    """Articulated inertia of all beyond, upper triangle by columns (21, or real parts and imaginary ones)."""
    pull: int = field(init=False)
    """Forces on all beyond: their sum, and the products of levers and forces (12)."""
    wrench: int = field(init=False)
    """Moment and force that all bodies beyond need (6, stages)."""
    sums: int = field(init=False)
    """`s` of the elimination (6), stage by stage."""
    answer: int = field(init=False)
    """Angular and linear acceleration that the corrections so far add up to (6), stage by stage."""
    base: int = field(init=False)
    """Frame behind the leading motors (18)."""
    cosine: int = field(init=False)
    """Cosine of each unknown that is an angle of a joint (n, stages)."""
    sine: int = field(init=False)
    """Its sine (n, stages)."""
    coordinates: int = field(init=False)
    """Free coordinates, their rates and accelerations (3, free, stages)."""
    state: int = field(init=False)
    """The strains, their rates and accelerations, and torques of actuators, at both stages (4, n, stages)."""
    bounds: int = field(init=False)
    """First and last bound of the loops, and how often several sections are bent at once (3)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        n, s = self.unknowns, self.stages
        passes = dict(frame=18 * s, origin=3, inertia=21 * s, pull=12, wrench=6 * s, sums=6 * s, answer=6 * s)
        state = dict(coordinates=3 * self.free * s, state=4 * n * s if s > 1 else 0)
        assign_places(self, self.first, **passes, base=18, cosine=n * s, sine=n * s, **state, bounds=3, end=0)

    @property
    def placed(self) -> int:
        """Place of the unknowns at both stages, their rates and accelerations: free coordinates or strains."""
        return self.coordinates if self.free else self.state

    @property
    def loop(self) -> tuple[str, int] | None:
        """The loop over the stages."""
        return None if self.stages == 1 else ("stage", self.stages)


def group_kinds(plan: MotionPlan, places: GroupLayout, pairs: PairPlaces | None) -> list[Kind]:
    """Trace the code of every kind of group; `rows` of a kind are the first elements of its groups."""
    kinds: dict[Any, list[tuple[int, ...]]] = {}
    parts = moving_parts(plan.unknowns)
    for group in motion_groups(plan.unknowns):
        rubbing = group_rubbing(plan.unknowns, group)
        signature = *(group_signature(plan.unknowns, row, parts[row]) for row in group), rubbing and rubbing.places
        kinds.setdefault(signature, []).append(group)
    return [_trace_kind(number, groups, plan, places, pairs, parts) for number, groups in enumerate(kinds.values())]


def _trace_kind(
    number: int,
    groups: list[tuple[int, ...]],
    plan: MotionPlan,
    places: GroupLayout,
    pairs: PairPlaces | None,
    parts: Sequence[ElementParts],
) -> Kind:
    names = ("at", "row", "q")
    bent = BentSections(number) if places.stages > 1 and plan.unknowns.traced(groups[0][0]).kind == "section" else None
    given = names if bent is None else (*names, "bent")
    out = Block(f"move_{number}", "Outward pass of a group: motion of its bodies.", given, loop=places.loop)
    resist = back = Block(f"resist_{number}", "Inward pass: torques out of balance.", names, out.trace, loop=places.loop)
    place = Block(f"place_{number}", "Outward pass with positions alone.", names, out.trace)
    stages, columns = places.stages, TableColumns(out, f"GROUP_{number}", len(groups))
    group = MovingGroup(plan, out, groups, columns, parts, places.state if stages > 1 else None)
    group.bent, both = bent, Factors(len(group.own))
    record = GroupRecord(stages, both.size if pairs else 0)
    moving, end = _trace_move(out, record, places, pairs, group)
    total, loads = moved_wrench(vector(back.spaced(places.wrench, 6, stages, back.each())), moving.reach), []
    for joint, own in zip(moving.joints[::-1], moving.wrenches[::-1], strict=True):
        total = total + own
        loads.append(joint.load(total))
        total = total if joint.shift is None else moved_wrench(total, joint.shift)
    back.store_spaced(places.wrench, total.tolist(), stages, back.each())
    gradient = [slope @ vector(loads[::-1]) + torque for slope, torque in zip(moving.slopes.T, moving.torques, strict=True)]
    blocks, layout, n = [out, resist, place], plan.layout, places.unknowns
    if plan.reduces:
        written, read = plan.torques
        back.store_spaced(written, gradient, stages, back.each(plan.row("q")))
        sides = [vector(back.spaced(read + stage, len(gradient), stages, plan.row("q"))) for stage in range(stages)]
        gradient = right_hand_side(*sides) if layout.in_stages else [*sides[0]]
    quarter = plan.factors(out)[1] * (1.0 / plan.massive(out))
    for coupled, (factoring, reducing, correcting) in enumerate(SOLVERS[: 1 + plan.couples]):
        step = Block(f"{correcting}_{number}", "Outward pass: correction of the accelerations.", names, out.trace)
        if plan.reduces:
            back = Block(f"{reducing}_{number}", "Inward pass: elimination of the torques at all stages.", names, out.trace)
            blocks.append(back)
        m, is_complex = len(gradient), layout.in_stages and not coupled
        if coupled and pairs is not None:
            first = Block(f"{STEPS[0]}_{number}", "Forces by accelerations of the group.", names, out.trace, loop=places.loop)
            compose(first, pairs, moving, end)
            factor = Block(f"{STEPS[2]}_{number}", "Factor the coordinates of the group.", names, out.trace)
            pivot(factor, pairs, both, [symmetric_form(one) for one in group.own], symmetric_form(quarter))
            factors = both.group(back)
            blocks += [first, *part_blocks(pairs, both)]
        else:
            factor = Block(f"{factoring}_{number}", "Inward pass: articulated inertia and factors.", names, out.trace)
            factors = _trace_factors(factor, record, plan, places, group, moving.at(record, factor, stages - 1))
        side = [-one if place >= m else one for place, one in enumerate(parts_of(gradient))] if coupled else gradient
        yielded, sums = carried_inward(factors, side, _loaded(back, places.sums, 6 * stages, is_complex))
        back.store_all(places.sums, parts_of(sums) if is_complex else sums)
        kept = record.keep(back, yielded)
        steps, answer = carried_outward(factors, kept, _loaded(step, places.answer, 6 * stages, is_complex))
        step.store_all(places.answer, parts_of(answer) if is_complex else answer)
        shares = vector(of_parts(steps)) if coupled else steps
        shares = shares * (1.0 / plan.massive(step)) if m and layout.full_damping else shares
        for stage, one in enumerate(corrections(shares) if layout.in_stages else (shares.tolist(),)):
            step.store_all(plan.correction + stage * n, one, "q")
        blocks += [factor, step]
    _trace_place(place, places, group, plan.strains[0])
    kind = Kind(number, [group[0] for group in groups], blocks, columns, record.size)
    return kind if bent is None else replace(kind, blocks=[*blocks, bent.take, bent.bend], bent=bent.size)


def _loaded(block: Block, place: int, count: int, is_complex: bool) -> Vector:
    """Read numbers, or half as many complex ones."""
    values = block.loads(place, count)
    return vector(of_parts(values) if is_complex else values)


def _trace_move(
    out: Block, record: GroupRecord, places: GroupLayout, pairs: PairPlaces | None, group: MovingGroup
) -> tuple[GroupMotion, Vector]:
    """Trace the outward pass; return what reads what it keeps, and where the group ends, from the base."""
    frame = load_frame(out, places.frame, places.stages, out.each())
    end = constants(np.zeros(3)) if pairs is None else vector(out.spaced(pairs.point, 3, 2, out.each()))
    states, slopes = group.joints(out, places.cosine, places.sine)
    turns = {place: element.rotation for place, element in enumerate(group.elements)}
    joints, wrenches = [], []
    for place, (state, body) in enumerate(zip(states, group.bodies, strict=True)):
        if place in turns:
            frame = replace(frame, axes=frame.axes @ turns[place])
        frame, axis, shift = moved(frame, state)
        end = end if shift is None else end + shift
        wrenches.append(record.keep(out, np.concatenate(wrench(frame, body)[::-1])))
        kept_shift = None if shift is None else record.keep(out, shift)
        axes, needed = constants(np.zeros((3, 3))), body.needed_axes
        axes[:, needed] = record.keep(out, frame.axes[:, needed])
        joints.append(JointLine(record.keep(out, axis), kept_shift, axes, body, wrenches[-1][3:]))
    frame = replace(frame, axes=frame.axes @ group.turn)
    reach = frame.axes @ group.reach
    store_frame(out, places.frame, frame.shifted(range(3), group.reach), places.stages, out.each())
    if pairs is not None:
        out.store_spaced(pairs.point, end + reach, 2, out.each())
        end = record.keep(out, end)
    return GroupMotion(joints, wrenches, *(record.keep(out, one) for one in (reach, slopes, vector(group.torques)))), end


def _trace_factors(
    factor: Block, record: GroupRecord, plan: MotionPlan, places: GroupLayout, group: MovingGroup, motion: GroupMotion
) -> ArticulatedGroup:
    """Trace the factors of a group; return what reads them and copies of what the next outward pass overwrites."""
    quarter, is_complex = plan.factors(factor)[1] * (1.0 / plan.massive(factor)), plan.layout.in_stages
    inertia = symmetric(_loaded(factor, places.inertia, 21 * (1 + is_complex), is_complex), 6)
    pull = Pull(vector(factor.loads(places.pull, 3)), vector(factor.loads(places.pull + 3, 9)).reshape(3, 3))
    own = np.diag(vector(group.own))
    for (row, column), value in group.curvatures.items():
        own[row, column] = own[column, row] = own[row, column] + value * quarter
    found, inertia, pull = articulate(inertia, pull, motion, own, quarter)
    triangle = [inertia[index] for index in upper_triangle(6)]
    factor.store_all(places.inertia, parts_of(triangle) if is_complex else triangle)
    factor.store_all(places.pull, [*pull.force, *pull.spread.ravel()])
    one = found.eliminated
    lower, inverses = (record.keep(factor, part) for part in (one.lower, one.inverse_pivots))
    copies = (record.keep(factor, part) for part in (found.gain, found.motions, *found.shift, *found.reach))
    gain, motions, shift, reach = copies
    return ArticulatedGroup(Eliminated(lower, inverses.tolist(), one.coupling, []), gain, motions, [shift], [reach])


def _trace_place(block: Block, places: GroupLayout, group: MovingGroup, strains: int) -> None:
    axes, origin = vector(block.loads(places.frame, 9)).reshape(3, 3), vector(block.loads(places.origin, 3))
    for element in group.elements_at(block, strains):
        axes = axes @ element.rotation
        if element.kind == "section":
            screw = Screw(element.coordinates, element.length)
            origin, axes = origin + axes @ screw.position, axes @ screw.rotation
        elif element.kind == "slide":
            origin = origin + axes[:, 2] * element.coordinates[0]
        else:
            axes = turned(axes, element.coordinates[0])
    axes = axes @ group.turn
    block.store_all(places.frame, axes.ravel().tolist())
    block.store_all(places.origin, (origin + axes @ group.reach).tolist())


def load_frame(block: Block, place: int, spacing: int = 1, base: str = "") -> MovingFrame:
    """Read a frame."""
    values = vector(block.spaced(place, 18, spacing, base))
    return MovingFrame(values[:9].reshape(3, 3), values[9:12], values[12:15], values[15:])


def store_frame(block: Block, place: int, frame: MovingFrame, spacing: int = 1, base: str = "") -> None:
    """Write a frame."""
    block.store_spaced(place, [*frame.axes.ravel().tolist(), *frame.spin, *frame.turning, *frame.lift], spacing, base)
