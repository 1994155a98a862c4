"""Groups of elements of a chain whose motion is traced together: a section, a motor, or spring joints at one point."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.dry_friction import Rubbing
from softrobots.compiled.chain.elements import constants
from softrobots.compiled.chain.looped_elements import element_signature, table_element
from softrobots.compiled.chain.muscle_terms import pulls_on
from softrobots.compiled.chain.recursion import range_margin
from softrobots.compiled.chain.traced_elements import TracedElement
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.motion.bent_sections import BentSections
from softrobots.compiled.motion.motion_layout import MotionPlan
from softrobots.compiled.motion.moving_joints import CompositeBody, JointState, RigidBody, SectionState, joint_state, round_part
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.compiled.trace.expressions import Scalar, if_less
from softrobots.core.checks import FloatArray
from softrobots.model.serial_chain import ChainBody, ChainJoint, bodies_of

OUT_OF_RANGE = 1e200
"""Torque on a section beyond its range: a step that ends there does not converge."""

_MOST_JOINTS = 4  # of a group: its cost grows with their square


class MovingGroup:
    """Inputs of the groups of a kind: table entries for the numbers in which they differ, loads from the workspace."""

    def __init__(
        self,
        plan: MotionPlan,
        block: Block,
        groups: Sequence[tuple[int, ...]],
        columns: TableColumns,
        parts: Sequence[ElementParts],
        state: int | None = None,
    ) -> None:
        """Read the elements of the groups, base to tip, and their `moving_parts`.

        In the block `q` is the place of the first unknown, or of the motor. The unknowns at all stages, and what actuators do
        to them, stand from `state` on, if the block loops over stages.
        """
        unknowns, layout = plan.unknowns, plan.layout
        self.elements: list[TracedElement] = []
        """The elements, with their coordinates."""
        self.bodies: list[RigidBody] = []
        """The bodies of all of them."""
        self.rates: list[list[Scalar]] = []
        """Velocities of the coordinates of each element."""
        self.changes: list[list[Scalar]] = []
        """Their accelerations."""
        self.bent: BentSections | None = None
        """What finds the joints of a section, where others are found beside them."""
        self.own: list[Scalar] = []
        """`h/2 D + h^2/4 K` of each unknown."""
        self.curvatures: dict[tuple[int, int], Scalar] = {}
        """By places of two unknowns: what tensions times second derivatives of lengths, and friction, add to `K`."""
        self.torques: list[Scalar] = []
        """Torque of spring, damper and muscles on each unknown."""
        self.turn = constants(parts[groups[0][-1]].turn)
        """Axes of its end in those of its last element, shape (3, 3)."""
        self.reach = columns.entries([parts[group[-1]].reach for group in groups])
        """From its end to the beginning of the next group, or to the tip, in the axes of its end [m]."""
        half, quarter = (one * (1.0 / plan.massive(block)) for one in plan.factors(block))
        place, routes = 0, plan.routes
        beside = [] if routes is None else [routes.unknowns.moving(row) for row in routes.routes.beside]
        within = {strain: number for strains in beside for number, strain in enumerate(strains)}
        self._spacing, self._base = spacing, base = 1 if state is None else 2, block.each(plan.row("q"))
        firsts = [*plan.strains[:3], 0 if routes is None else routes.pulls]
        if state is not None:
            firsts = [state + 2 * len(unknowns.strains) * number for number in range(4)]
        for rows in zip(*groups, strict=True):
            ones = [unknowns.traced(row) for row in rows]
            element = replace(table_element(ones, columns), rotation=columns.entries([parts[row].rotation for row in rows]))
            rest = columns.entries([one.rest for one in ones])
            coordinates = [columns.entry([one.coordinates[axis] for one in ones]) for axis in range(len(element.coordinates))]
            rates: list[Scalar] = [0.0] * len(coordinates)
            changes: list[Scalar] = [0.0] * len(coordinates)
            if unknowns.motor(rows[0]) is not None:
                coordinates[0], rates[0], changes[0] = (
                    block.load(first, "q") for first in (0, layout.motor_velocities, layout.motor_accelerations)
                )
            for number, axis in enumerate(element.moving):
                coordinates[axis], rates[axis], changes[axis] = (
                    block.load(first + spacing * place, base) for first in firsts[:3]
                )
                damping = block.load(plan.strains[3] + place, "q")
                stiffness = element.stiffness[number]
                self.own.append(half * damping + quarter * stiffness)
                torque = (coordinates[axis] - rest[number]) * stiffness
                if routes is None or not routes.held:  # else dampers act on the free coordinates
                    torque = torque + damping * rates[axis]
                column = within.get(unknowns.moving(rows[0])[number])
                if routes is not None and column is not None:
                    torque = torque + block.load(firsts[3] + spacing * place, base)
                    for row in range(column + 1) if not routes.held else ():
                        pair = place - column + row, place
                        at = routes.curvatures + len(unknowns.strains) * column + pair[0]
                        self.curvatures[pair] = block.load(at, "q")
                self.torques.append(torque)
                place += 1
            segment = unknowns.segment_at(rows[0])
            if segment is not None and routes is None:
                tensions = [block.load(unknowns.chain.n_motors + muscle) for muscle in segment.muscles]
                pulls = pulls_on(element.muscles, coordinates, tensions, [], 0)
                for number, axis in enumerate(element.moving):
                    self.torques[number - len(element.moving)] += pulls.load[axis]
            self.elements.append(replace(element, coordinates=coordinates))
            self.rates.append(rates)
            self.changes.append(changes)
            self.bodies += [_body(alike, columns) for alike in zip(*(parts[row].bodies for row in rows), strict=True)]
        if layout.rubbing:
            self._rub(plan, block, columns, [group_rubbing(unknowns, group) for group in groups])

    def _rub(self, plan: MotionPlan, block: Block, columns: TableColumns, rubbing: Sequence[Rubbing | None]) -> None:
        """Add the dry friction of a step, and write how far it leaves the strains from the sliders; see `friction_steps`."""
        alike = [one for one in rubbing if one is not None]
        if not alike:
            return
        layout, places = plan.layout, alike[0].places
        at_rest = [block.load(layout.beyond + place, "q") for place in places]
        four = [block.load(plan.strains[0] + place, "q") * 4.0 for place in range(len(self.torques))]
        friction = Rubbing(columns.entry([one.limit for one in alike]), places, at_rest).at(four)
        for row, place in enumerate(places):
            self.torques[place] = self.torques[place] + friction.torque[place]
            block.store(layout.lag + place, four[place] - friction.sliders[row], "q")
            for pair in [(one, place) for one in places[: row + 1]]:
                self.curvatures[pair] = friction.stiffness[pair] * 4.0 + self.curvatures.get(pair, 0.0)

    def joints(self, block: Block, cosines: int, sines: int) -> tuple[list[JointState], Any]:
        """Return the joints, and the derivatives of their positions by the coordinates, shape (n, k).

        Cosines and sines of the unknowns stand at places in the workspace.
        """
        first = self.elements[0]
        if first.kind == "section":
            given = first.coordinates, self.rates[0], self.changes[0], first.length
            section = SectionState(*given) if self.bent is None else self.bent.state(block, *given, list(first.moving))
            beyond = if_less(0.0, range_margin(first, section.screw), 0.0, OUT_OF_RANGE)
            self.torques[0] = self.torques[0] + beyond
            return section.joints, section.slopes[:, list(first.moving)]
        joints = []
        for place, (element, rates, changes) in enumerate(zip(self.elements, self.rates, self.changes, strict=True)):
            joint = joint_state(element.kind == "slide", element.coordinates[0], rates[0], changes[0])
            if element.kind == "turn" and element.moving:
                cosine, sine = (block.load(one + self._spacing * place, self._base) for one in (cosines, sines))
                joint = joint._replace(cosine=cosine, sine=sine)
            joints.append(joint)
        return joints, constants(np.eye(len(joints), len(self.own)))

    def elements_at(self, block: Block, strains: int) -> list[TracedElement]:
        """Return the elements at the unknowns that stand from a place on."""
        placed, place = [], 0
        for element in self.elements:
            coordinates = [*element.coordinates]
            for axis in element.moving:
                coordinates[axis] = block.load(strains + place, "q")
                place += 1
            placed.append(replace(element, coordinates=coordinates))
        return placed


def group_rubbing(unknowns: Unknowns, group: Sequence[int]) -> Rubbing | None:
    """Return the dry friction of a group, without sliders; None if it has none."""
    return Rubbing.of(unknowns.chain.friction, [strain for row in group for strain in unknowns.moving(row)])


def _body(bodies: Sequence[ChainBody], columns: TableColumns) -> RigidBody:
    """Return the body of the elements of a kind; all are round about the same axis, or none is."""
    rounds = [round_part(body.inertia) for body in bodies]
    others = [body.inertia if part is None else np.zeros((3, 3)) for body, part in zip(bodies, rounds, strict=True)]
    parts = [part or (0, 0.0, 0.0) for part in rounds]
    return RigidBody(
        mass=columns.entry([float(body.mass) for body in bodies]),
        moment=columns.entries([body.first_moment for body in bodies]),
        inertia=columns.entries(others),
        round_axis=parts[0][0],
        across=columns.entry([across for _, across, _ in parts]),
        along=columns.entry([along for _, _, along in parts]),
        centre=columns.entries([body.first_moment / (body.mass or 1.0) for body in bodies]),
    )


def motion_groups(unknowns: Unknowns) -> list[tuple[int, ...]]:
    """Return the elements of each group behind the leading motors, base to tip."""
    groups: list[tuple[int, ...]] = []
    before = -2  # place of the spring joint before, if it is one
    first = {row for row, _ in unknowns.chain.wound}  # the joints of a section along which routes wind stay together
    for row in range(unknowns.leading_motors, len(unknowns.chain.elements)):
        one = unknowns.traced(row)
        spring = one.kind != "section" and unknowns.motor(row) is None
        place = unknowns.place[unknowns.moving(row)[0]] if spring else -2
        if (
            spring
            and place == before + 1
            and row not in first
            and not np.any(one.translation != 0.0)
            and len(groups[-1]) < _MOST_JOINTS
        ):
            groups[-1] = (*groups[-1], row)
        else:
            groups.append((row,))
        before = place
    return groups


class ElementParts(NamedTuple):
    """Constants of an element in the axes that its group works with."""

    bodies: Sequence[ChainBody]
    """Its bodies; see `moving_bodies`."""
    rotation: FloatArray
    """Its axes in those in which its group begins, or in those of the element before, shape (3, 3)."""
    turn: FloatArray
    """Of the last element of a group: axes of the end of the group in its own, shape (3, 3)."""
    reach: FloatArray
    """Of the last element of a group: from its origin to the next group, in the axes of the end, shape (3,) [m]."""


def moving_parts(unknowns: Unknowns) -> list[ElementParts]:
    """Return the constants of each element.

    A group of a straight rod ends in axes that are parallel at zero to those in which it begins, so that equal groups share
    their code, whatever came before.
    """
    bodies, turn = moving_bodies(unknowns), np.eye(3)
    parts = [
        ElementParts(bodies[row], element.rotation, np.eye(3), reach_behind(unknowns, row))
        for row, element in enumerate(unknowns.chain.elements)
    ]
    for group in motion_groups(unknowns):
        first, last = group[0], group[-1]
        parts[first] = parts[first]._replace(rotation=turn.T @ parts[first].rotation)
        whole = functools.reduce(np.matmul, [parts[row].rotation for row in group])
        turn = whole.T if np.all(np.isin(whole, (-1.0, 0.0, 1.0))) else np.eye(3)
        parts[last] = parts[last]._replace(turn=turn, reach=turn.T @ parts[last].reach)
    return parts


def moving_bodies(unknowns: Unknowns) -> list[list[ChainBody]]:
    """Return the bodies of each element, where they cost least.

    How far a round body has turned about its own axis changes only its spin about it. So of a body that is round about the
    axis of its own joint only the inertia about this axis stays there, and all else is fixed to the element before.
    """
    elements = unknowns.chain.elements
    bodies = [list(bodies_of(element)) for element in elements]
    for row, element in enumerate(elements):
        part = round_part(bodies[row][0].inertia)
        moment = bodies[row][0].first_moment
        if isinstance(element, ChainJoint) and not element.slides and part and part[0] == 2 and not np.any(moment[:2]):
            mass, along = bodies[row][0].mass, np.diag([0.0, 0.0, part[1] + part[2]])
            bodies[row] = [ChainBody(0.0, np.zeros(3), along)]
            if row > unknowns.leading_motors:
                own, before = CompositeBody(mass, moment, np.diag([part[1], part[1], 0.0])), bodies[row - 1][-1]
                own = own.seen_from(element.rotation, element.translation)
                first_moment, inertia = before.first_moment + own.moment, before.inertia + own.inertia
                bodies[row - 1][-1] = ChainBody(before.mass + mass, first_moment, inertia)
    return bodies


def group_signature(unknowns: Unknowns, row: int, parts: ElementParts) -> tuple[Any, ...]:
    """Return the properties that elements with the same code share."""
    rounds = [part and part[0] for part in (round_part(body.inertia) for body in parts.bodies)]
    segment, (kind, moving, *_, muscles) = unknowns.segment_at(row), element_signature(unknowns, row)
    wound = any(first <= row <= last for first, last in unknowns.chain.wound)
    pulled = segment and (unknowns.routed or segment.muscles)
    zeros = [(array == 0.0).tolist() for array in (parts.rotation, parts.reach)]
    return kind, moving, muscles, str(rounds), pulled, wound, str(zeros), str(parts.turn.tolist())


def reach_behind(unknowns: Unknowns, row: int) -> FloatArray:
    """Return the origin of the next element at zero, or the tip, in the frame behind an element [m]."""
    elements = unknowns.chain.elements
    return elements[row + 1].translation if row + 1 < len(elements) else unknowns.chain.tip_translation
