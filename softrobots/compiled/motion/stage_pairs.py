r"""Factors of a step with the matrix of each of its two stages, traced: twelve components at once.

The matrix of `softrobots.compiled.motion.articulated` in other terms: the bodies beyond a group of joints as one rigid body at
each stage, less what their coordinates take off, a matrix `R` of both stages, shape (12, 12), symmetric once the rows of the
second stage change their sign. With accelerations `S` of the coordinates and the forces `F` that they take, about the base,

.. math:: C = R S - F, \quad D = S^T F + \tfrac h2 D_d + \tfrac{h^2}4 K - S^T R S

and the group hands on :math:`R + C D^{-1} C^T`. No points of reference move, so that rows of `R` are sums of whole rows, which
vector instructions of a processor work on. Components of both stages stand side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softrobots.compiled.chain.elements import Vector, constants, cross, symmetric, upper_triangle, vector
from softrobots.compiled.chain.elimination import Eliminated, Outboard, eliminate
from softrobots.compiled.chain.layout import assign_places
from softrobots.compiled.motion.articulated import ArticulatedGroup, GroupMotion, Pull, moved_wrench
from softrobots.compiled.motion.moving_joints import CompositeBody
from softrobots.compiled.trace.blocks import Block

STEPS = ("compose", "push", "pivot", "eliminate", "update")
"""Functions of a group, in this order."""

_NAMES = ("at", "row", "q")
_PARTS = ("part", 12)


@dataclass(frozen=True)
class PairPlaces:
    """Places of what groups hand on and share, behind the others; numbers of both stages side by side."""

    first: int
    """First of the places."""
    most: int
    """Largest number of unknowns of a group (m)."""
    point: int = field(init=False)
    """Where the last group of the outward pass ends, from the base [m] (3, 2)."""
    beyond: int = field(init=False)
    """Mass, first moment and inertia of all beyond, force on them and products of levers and forces (22, 2)."""
    matrix: int = field(init=False)
    """`R` (12, 12)."""
    signs: int = field(init=False)
    """By stage: 1, or -1 at the second, for the components of the stage, else 0 (2, 12)."""
    turns: int = field(init=False)
    """By stage: what dead forces that turn with it are multiplied by (2, 12)."""
    push: int = field(init=False)
    """`F` of both stages (m, 12)."""
    bend: int = field(init=False)
    """Derivatives of torques by a turn of all nearer to the base (m, 12); zero but for the first six."""
    own: int = field(init=False)
    """`S^T F` of both stages (m, m, 2)."""
    bent: int = field(init=False)
    """The same of the derivatives of torques (m, m, 2)."""
    moved: int = field(init=False)
    """`R S` (2 m, 12)."""
    coupling: int = field(init=False)
    """`L^-1 C^T` (2 m, 12)."""
    end: int = field(init=False)
    """The first place behind."""

    def __post_init__(self) -> None:
        """Compute the places."""
        m, rows = self.most, dict(point=6, beyond=44, matrix=144, signs=24, turns=24)
        shared = dict(push=12 * m, bend=12 * m, own=2 * m * m, bent=2 * m * m, moved=24 * m, coupling=24 * m)
        assign_places(self, self.first, **rows, **shared, end=0)


class Factors:
    """Places of the factors of a group of `m` unknowns, first in its record."""

    def __init__(self, m: int) -> None:
        """Compute them: `S` (m, 12), gain (2 m, 12), inverse pivots (2 m), `L` row by row to the left of the diagonal."""
        self.count, self.gain, self.inverse, self.lower = m, 12 * m, 36 * m, 38 * m
        self.size = self.lower + m * (2 * m - 1)

    def motion(self, block: Block, q: int) -> list[Any]:
        """Return `S` of a coordinate, those of the second stage behind the others, shape (6,)."""
        stage, j = divmod(q, self.count)
        return block.spaced(12 * j + stage, 6, 2, "at")

    def lower_at(self, block: Block) -> Any:
        """Return `L`, shape (2 m, 2 m)."""
        lower = constants(np.eye(2 * self.count))
        for place, (column, row) in enumerate(zip(*np.triu_indices(2 * self.count, 1), strict=True)):
            lower[row, column] = block.load(self.lower + place, "at")
        return lower

    def group(self, block: Block) -> ArticulatedGroup:
        """Return what reads them; stages one behind the other."""
        n, zero = 2 * self.count, constants(np.zeros(3))
        gain, motions = constants(np.zeros((n, 12))), constants(np.zeros((12, n)))
        for q in range(n):
            for part in range(12):
                gain[q, 6 * (part % 2) + part // 2] = block.load(self.gain + 12 * q + part, "at")
            first = 6 * (q // self.count)
            motions[first : first + 6, q] = self.motion(block, q)
        eliminated = Eliminated(self.lower_at(block), list(block.loads(self.inverse, n, "at")), None, [])
        return ArticulatedGroup(eliminated, gain, motions, [zero, zero], [zero, zero])


def start_pairs(block: Block, places: PairPlaces, force: Vector, quarter: Any) -> None:
    """Trace the start at the tip; `quarter`: `h^2/4` for two stages, shape (2, 2)."""
    tip = [*[0.0] * 10, *force, *[0.0] * 9]
    for stage in range(2):
        block.store_spaced(places.beyond + stage, tip, 2)
        signs, turns = constants(np.zeros((6, 2))), constants(np.zeros((6, 2)))
        signs[:, stage], turns[:3] = (-1.0) ** stage, quarter[:, stage]
        block.store_all(places.signs + 12 * stage, signs.ravel())
        block.store_all(places.turns + 12 * stage, turns.ravel())
    block.store_all(places.matrix, [0.0] * 144)


def compose(block: Block, places: PairPlaces, motion: GroupMotion, end: Vector) -> None:
    """Trace the forces that accelerations of the coordinates take, at each stage; `end`: where the last joint is."""
    values, joints = vector(block.spaced(places.beyond, 22, 2, block.each())), motion.joints
    beyond, pull = (
        CompositeBody(values[0], values[1:4], symmetric(values[4:10], 3)),
        Pull(values[10:13], values[13:].reshape(3, 3)),
    )
    n, still = len(joints), constants(np.eye(3))
    motions, pushes, bends = (constants(np.zeros((rows, n))) for rows in (6, 6, 3))
    own, bent = constants(np.zeros((n, n))), constants(np.zeros((n, n)))
    steps = [motion.reach, *(joint.shift for joint in joints[::-1])]
    for number, by in zip(reversed(range(n)), steps[:-1], strict=True):
        if by is not None:
            beyond, pull = beyond.seen_from(still, by), pull.moved(by)
            end = end if number == n - 1 else end - by
        joint, body = joints[number], joints[number].body
        beyond = beyond + CompositeBody(body.mass, joint.axes @ body.moment, body.turned(joint.axes))
        pull, axis = pull.with_force(joint.force, joint.axes @ body.centre), joint.axis
        bends[:, number] = pull.bend(joint)
        if joint.shift is None:
            push, moves = (beyond.inertia @ axis, cross(axis, beyond.moment)), (axis, cross(end, axis))
        else:
            push, moves = (cross(beyond.moment, axis), axis * beyond.mass), (axis * 0.0, axis)
        pushes[:, number], motions[:, number] = moved_wrench(np.concatenate(push), end), np.concatenate(moves)
        for place in range(number, n):
            own[number, place] = own[place, number] = motions[:, number] @ pushes[:, place]
            bent[number, place] = bent[place, number] = motions[:3, number] @ bends[:, place]
    if steps[-1] is not None:
        beyond, pull = beyond.seen_from(still, steps[-1]), pull.moved(steps[-1])
    inertia = [beyond.inertia[index] for index in upper_triangle(3)]
    handed = [beyond.mass, *beyond.moment, *inertia, *pull.force, *pull.spread.ravel()]
    block.store_spaced(places.beyond, handed, 2, block.each())
    slopes, m = motion.slopes, motion.slopes.shape[1]
    for place in range(m):
        block.store_spaced(12 * place, (motions @ slopes)[:, place], 2, block.each("at"))
        block.store_spaced(places.push + 12 * place, (pushes @ slopes)[:, place], 2, block.each())
        block.store_spaced(places.bend + 12 * place, (bends @ slopes)[:, place], 2, block.each())
    for first, values in ((places.own, own), (places.bent, bent)):
        block.store_spaced(first, (slopes.T @ (values @ slopes)).ravel(), 2, block.each())


def pivot(block: Block, places: PairPlaces, factors: Factors, own: Sequence[Any], quarter: Any) -> None:
    """Trace the elimination of the coordinates themselves; `own`, of each for two stages, as `quarter`, shape (2, 2)."""
    m, n = factors.count, 2 * factors.count
    matrix = constants(np.zeros((n, n)))
    for row, column in upper_triangle(n):
        (s, i), (t, j) = divmod(row, m), divmod(column, m)
        moved = block.spaced(places.moved + 12 * column + s, 6, 2)
        value = block.load(places.bent + 2 * (m * i + j) + (s if i <= j else t)) * quarter[s, t]
        value = value - vector(factors.motion(block, row)) @ vector(moved)
        if i == j:
            value = value + own[i][s, t]
        if s == t:
            value = value + block.load(places.own + 2 * (m * i + j) + s) * (-1.0) ** s
        matrix[row, column] = matrix[column, row] = value
    none = constants(np.zeros((0, n)))
    found, _ = eliminate(Outboard(constants(np.zeros((0, 0))), [], 1.0, 0.0), none, none, matrix, [], [1.0] * n)
    block.store_all(factors.inverse, found.inverse_pivots, "at")
    block.store_all(factors.lower, [found.lower[row, column] for column, row in zip(*np.triu_indices(n, 1), strict=True)], "at")


def part_blocks(places: PairPlaces, factors: Factors) -> list[Block]:
    """Return the functions of all groups of as many unknowns that work on rows of twelve."""
    m = factors.count
    push, cut, update = (
        Block(f"{name}_{m}", purpose, _NAMES, loop=_PARTS)
        for name, purpose in (
            ("push", "Forces that all beyond the group leave out, by its coordinates."),
            ("eliminate", "Forces by the coordinates that are left, and the gain."),
            ("update", "Hand on what the coordinates take off."),
        )
    )
    rows = [push.load(places.matrix + 12 * row, "part") for row in range(12)]
    for q in range(2 * m):
        push.store(places.moved + 12 * q, vector(factors.motion(push, q)) @ vector(rows[q // m :: 2]), "part")
    lower, coupling = factors.lower_at(cut), list[Any]()
    for q in range(2 * m):
        stage, j = divmod(q, m)
        force = cut.load(places.push + 12 * j, "part") * cut.load(places.signs + 12 * stage, "part")
        force = force + cut.load(places.bend + 12 * j, "part") * cut.load(places.turns + 12 * stage, "part")
        left = cut.load(places.moved + 12 * q, "part") - force
        coupling.append(left - sum((lower[q, one] * before for one, before in enumerate(coupling)), 0.0))
        cut.store(places.coupling + 12 * q, coupling[-1], "part")
        cut.store(factors.gain + 12 * q, coupling[-1] * cut.load(factors.inverse + q, "at"), cut.each("at"))
    gain = vector([update.load(factors.gain + 12 * q, update.each("at")) for q in range(2 * m)])
    for row in range(12):
        taken = vector([update.load(places.coupling + 12 * q + row) for q in range(2 * m)]) @ gain
        update.store(places.matrix + 12 * row, update.load(places.matrix + 12 * row, "part") + taken, "part")
    return [push, cut, update]
