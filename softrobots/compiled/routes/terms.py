r"""Actuators on routes beside an element, traced: their lengths, and what they add to its elimination.

With the slopes `a_m` of the lengths `l_m` that change a tension, :math:`k_m = \mathrm d T_m / \mathrm d l_m`, the tangent
stiffness has :math:`\sum k_m a_m a_m^T`, which couples all elements along an actuator: the length is one more component of the
turn (`softrobots.compiled.chain.elimination`), with the slopes as turns per coordinate, and `P` begins with :math:`-k_m` there.
With `w` for the turn itself and `m`, `n` for lengths, an element has

.. math:: C_w = c + P_{ww} \Omega + \sum_m P_{wm} a_m^T, \quad C_m = \Omega^T P_{wm} + \sum_n P_{mn} a_n

Constant tensions need no component: they act with the slopes and second derivatives of the lengths alone.

Where actuators rub in their guides (`softrobots.model.dry_friction`), a guide `g` that sticks adds the square of the length
beyond it times :math:`\kappa_g`. Coordinates `i` nearer to the base than `j` are so coupled by
:math:`(k_m + \sum_{g \le i} \kappa_g)\, a_i a_j`: all guides of an actuator need one component, the change of its tension from
the base on, with `P` zero at the tip, :math:`\Omega_m = u_i`, :math:`c_m = -a_i`, and for the pieces `h` of an element

.. math:: u = \sum_h w_h a_h, \quad w_h = k_m + \sum_{g < h} \kappa_g + \kappa_h / 2
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import constants, is_zero, outer, upper_triangle, vector
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.routes import POINT_RECORD, Routed
from softrobots.compiled.trace.blocks import Block, TableColumns
from softrobots.compiled.trace.expressions import Scalar, if_less, larger, smaller, square_root
from softrobots.model.serial_chain import strains_of

SHORTEST = 1e-3
"""Length of a route along its tangent at rest at the end of its range, relative to its length there."""


class Form(NamedTuple):
    """Elements of routed segments that have the same unknowns."""

    section: bool
    """Whether they are sections or hinges; else joints, of lumped sections where all actuators beside them run straight."""
    moving: tuple[int, ...]
    """Indices of their unknown coordinates."""


class _Point(NamedTuple):
    """A point of a route: `length + arms . z` along its tangent at rest, `turned + around . z` and `radial . z` across it."""

    length: Scalar
    arms: Any
    turned: Scalar
    around: Any
    radial: Any
    separable: Scalar
    """1 if it is of a straight route along a lumped section, whose length is taken to second order."""
    locked: Sequence[Scalar]
    """Values of the coordinates that are not unknown."""


def form_of(plan: Routed, row: int) -> Form:
    """Return the form of an element of a routed segment."""
    one = plan.unknowns.traced(row)
    return Form(one.kind in ("section", "hinge"), one.moving)


def route_forms(plan: Routed) -> dict[str, Form]:
    """Return the forms of the elements of routed segments, by name."""
    return {str(number): form for number, form in enumerate(dict.fromkeys(form_of(plan, row) for row in plan.routes.beside))}


def length_blocks(plan: Routed, name: str, form: Form, swerving: int | None = None) -> tuple[list[Block], TableColumns | None]:
    """Trace the functions of the outward pass, and of the load; and return the table of points, None without any.

    They clear the slopes of an actuator, add a point of a route to its length and slopes, add the load of an actuator, and the
    second derivatives of a point. In motion with given lengths another one adds the acceleration of a length at constant rates,
    which stand at `q`, to that of its actuator from the place `swerving` on.
    """
    routes, k = plan.routes, len(form.moving)
    clear = Block(f"clear_slopes_{name}", "Clear the slopes of an actuator.", ("at",))
    clear.store_all(0, [0.0] * k, "at")
    load = Block(f"add_pull_{name}", "Add the tension of an actuator times its slopes.", ("at", "number"))
    if not routes.guided:
        tension = load.load(routes.tensions, "number")
        for place, slope in enumerate(load.loads(0, k, "at")):
            load.store(routes.load + place, load.load(routes.load + place) + tension * slope)
    begin = Block(f"clear_pulls_{name}", "Clear the sums over the actuators beside an element.")
    begin.store_all(routes.load, [0.0] * k)
    begin.store_all(routes.curvature, [0.0] * (k * (k + 1) // 2))
    add = Block(f"add_length_{name}", "Add a point to length and slopes of an actuator.", ("row", "q", "at", "number", "point"))
    found = form_point(plan, name, form, add)
    if found is None:
        return [clear, load, begin], None
    point, columns = found
    if form.section:
        _add_section_point(plan, form, add, point)
    else:
        z = add.load(0, "q")
        across, back = z * point.around[0] + point.turned, 1.0 / point.length
        excess = (across * across - point.turned * point.turned) * back * 0.5
        add.store(routes.lengths, add.load(routes.lengths, "number") + (z * point.arms[0] + excess), "number")
        add.store(0, add.load(0, "at") + (point.arms[0] + point.around[0] * across * back), "at")
    bend = Block(
        f"add_curvature_{name}", "Add tension times second derivatives of a point.", ("row", "number", "point"), add.trace
    )
    pulling = bend.load(POINT_RECORD + 1, "point") if routes.guided else bend.load(routes.tensions, "number")
    curvature = _second(form, bend, point) * pulling
    for place, index in enumerate(upper_triangle(k)):
        if not is_zero(curvature[index]):
            bend.store(routes.curvature + place, bend.load(routes.curvature + place) + curvature[index])
    blocks = [clear, load, begin, add, bend, *([_guide_block(plan, name, form, point, add)] if routes.guided else [])]
    if swerving is not None:
        turn = Block(f"add_swerve_{name}", "Add the acceleration of a length.", ("row", "q", "number", "point"), add.trace)
        rates = vector(turn.loads(0, k, "q"))
        turn.store(swerving, turn.load(swerving, "number") + rates @ _second(form, turn, point) @ rates, "number")
        blocks.append(turn)
    return blocks, columns


def form_point(plan: Routed, name: str, form: Form, block: Block) -> tuple[_Point, TableColumns] | None:
    """Return a point of a route beside elements of a form, as entries of the table of all, and the table; None if none is."""
    chain, given = plan.unknowns.chain, plan.unknowns.chain.muscle_paths
    paths, rows = plan.routes.paths(), {row for row in plan.routes.beside if form_of(plan, row) == form}
    first = next((pair for pair in paths if pair[0] in rows), None)
    if first is None:
        return None
    paths = [pair if pair[0] in rows else first for pair in paths]  # the other rows of the table are not read
    columns = plan.table(block, f"POINT_TABLE_{name}", len(paths))
    own = []  # places of the coordinates of the element in the path
    for row, path in paths:
        places = given.places[path].tolist()
        own.append([places.index(strain) for strain in strains_of(chain.elements[row])])
    numbers = [path for _, path in paths]
    arms, around, radial = (
        columns.entries([array[path, place] for path, place in zip(numbers, own, strict=True)])
        for array in (given.arms, given.across[:, 0], given.across[:, 1])
    )
    locked = [[float(chain.rest[strain]) for strain in strains_of(chain.elements[row])] for row, _ in paths]
    turns = [
        [given.turned[path] if np.any(given.across[path, 0, place]) else 0.0] for path, place in zip(numbers, own, strict=True)
    ]
    point = _Point(
        columns.entry([float(given.length[path]) for path in numbers]),
        arms,
        columns.entries(turns)[0],
        around,
        radial,
        columns.entry([float(given.separable[path]) for path in numbers]),
        [0.0 if place in form.moving else columns.entry([one[place] for one in locked]) for place in range(len(locked[0]))],
    )
    return point, columns


def _add_section_point(plan: Routed, form: Form, block: Block, point: _Point) -> None:
    """Trace length and slopes of a point beside a section, and keep the direction of the tangent, and one over its length.

    That of a separable one is the direction at rest.
    """
    routes, z = plan.routes, vector(point.locked)
    z[list(form.moving)] = block.loads(0, len(form.moving), "q")
    ahead = point.arms @ z
    along, around, radial = ahead + point.length, point.around @ z + point.turned, point.radial @ z
    across = around * around + radial * radial

    def either(straight: Scalar, other: Scalar) -> Scalar:
        return if_less(0.5, point.separable, straight, other)

    size = either(point.length, along if is_zero(across) else square_root(along * along + across))
    back = 1.0 / size
    excess: Scalar = 0.0
    if not is_zero(across):
        excess = (across - point.turned * point.turned) / (size + either(size, larger(along, 0.0)))
    direction = [either(1.0, along * back), around * back, radial * back]
    slopes = point.arms * direction[0] + point.around * direction[1] + point.radial * direction[2]
    block.store(routes.lengths, block.load(routes.lengths, "number") + (ahead + excess), "number")
    for place, axis in enumerate(form.moving):
        block.store(place, block.load(place, "at") + slopes[axis], "at")
    block.store(routes.margin, smaller(block.load(routes.margin), either(1.0, along - point.length * SHORTEST)))
    block.store_all(0, [direction[0], either(0.0, direction[1]), direction[2], back], "point")
    if routes.guided:
        block.store(POINT_RECORD, ahead + excess, "point")
        block.store(POINT_RECORD + 5, direction[1], "point")


def _guide_block(plan: Routed, name: str, form: Form, point: _Point, add: Block) -> Block:
    """Trace what the tension of a piece and the guides that stick, in order from the base on, add to an element.

    `at` is the place of `u` of the pieces so far.
    """
    routes, k = plan.routes, len(form.moving)
    block = Block(f"add_guide_{name}", "Add the piece of an actuator at a guide that rubs.", ("row", "at", "point"), add.trace)
    directions = [block.load(place, "point") for place in (0, POINT_RECORD + 5, 2)]
    tension, beyond, own = block.loads(POINT_RECORD + 1, 3, "point")
    parts = zip((point.arms, point.around, point.radial), directions, strict=True)
    slopes = sum((part[list(form.moving)] * direction for part, direction in parts), constants(np.zeros(k)))
    before = vector(block.loads(0, k, "at"))
    for place, slope in enumerate(slopes):
        block.store(routes.load + place, block.load(routes.load + place) + tension * slope)
        block.store(place, before[place] + beyond * slope, "at")
    coupled = outer(before, slopes) + outer(slopes, before) + outer(slopes, slopes * own)
    for place, index in enumerate(upper_triangle(k)):
        block.store(routes.curvature + place, block.load(routes.curvature + place) + coupled[index])
    return block


def _second(form: Form, block: Block, point: _Point) -> Any:
    """Trace the second derivatives of the length at a point, shape (k, k)."""
    if not form.section:
        return outer(point.around, point.around) * (1.0 / point.length)
    along, around, radial, back = block.loads(0, 4, "point")
    arms, turning, widening = (part[list(form.moving)] for part in (point.arms, point.around, point.radial))
    if all(map(is_zero, widening)):  # the change of the tangent across itself has one direction
        aside = turning * along - arms * around if not all(map(is_zero, turning)) else turning
        return outer(aside, aside) * back
    ahead = arms * along + turning * around + widening * radial
    return (outer(arms, arms) + outer(turning, turning) + outer(widening, widening) - outer(ahead, ahead)) * back


def component_blocks(plan: Plan, name: str, form: Form) -> list[Block]:
    """Trace the functions of lengths as components of the turn, on the inward and on the step pass.

    `at` is the place of the slopes of length `m`, `to` that of its `C_m`, and `cross` that of its `P_wm`, from the first;
    `other` is the place of the slopes, or of `C`, of length `n`, `pair` and `mirrored` those of `P_mn` and `P_nm`.
    """
    routes, k, sides = plan.routes, len(form.moving), range(len(plan.turns))
    stride, count, held = routes.stride, routes.components, plan.unknowns.held_lengths
    name = f"_{plan.infix}{name}"

    def add(block: Block, place: int, values: Any, base: str = "") -> None:
        for number, value in enumerate(values):
            block.store(place + number, block.load(place + number, base) + value, base)

    def per_side(block: Block, place: int) -> list[Any]:
        return [vector(block.loads(place + stride * side, k)) for side in sides]

    clear = Block(f"clear_meeting{name}", "Clear what lengths add to the elimination of an element.")
    clear.store_all(routes.push, [0.0] * (3 * k))
    clear.store_all(routes.own, [0.0] * (k * (k + 1) // 2))
    for side in sides:
        clear.store_all(routes.sides + stride * side, [0.0] * k)

    turn = Block(f"meet_turn{name}", "Add the coupling of a length with the turn, and its sums.", ("at", "to", "m", "cross"))
    slopes = vector(turn.loads(0, k, "at"))
    add(turn, routes.push, outer(vector(turn.loads(routes.cross, 3, "cross")), slopes).ravel())
    for side in sides:
        add(turn, routes.sides + stride * side, slopes * turn.load(routes.sums + count * side, "m"))
    turn.store_all(0, [0.0] * k, "to")

    length = Block(f"meet_length{name}", "Add the coupling of a length with another one.", ("other", "to", "pair"))
    add(length, 0, vector(length.loads(0, k, "other")) * length.load(routes.square, "pair"), "to")

    hold = Block(f"hold_length{name}", "Begin the coupling of a given length.", ("at", "to"))
    begun: list[Scalar] = [*hold.loads(0, k, "to")] if routes.guided else [0.0] * k
    hold.store_all(0, [old - one for old, one in zip(begun, hold.loads(0, k, "at"), strict=True)], "to")

    own = Block(f"meet_own{name}", "Add the coupling of an element with itself by a length.", ("at", "to"))
    product = outer(vector(own.loads(0, k, "at")), vector(own.loads(0, k, "to")))
    add(own, routes.own, [product[index] for index in upper_triangle(k)])

    hand = Block(
        f"hand_on_turn{name}", "Eliminate an element from the coupling of a length with the turn.", ("to", "m", "cross")
    )
    twists, lower = (
        vector(hand.loads(place, size)).reshape(-1, k) for place, size in ((routes.twists, 3 * k), (routes.lower, k * k))
    )
    crossing = vector(hand.loads(routes.cross, 3, "cross"))
    met = vector(hand.loads(0, k, "to")) + crossing @ twists
    for i in range(k):
        for j in range(i):
            met[i] = met[i] - lower[i, j] * met[j]
    hand.store_all(0, met.tolist(), "to")
    scaled = met * vector(hand.loads(routes.inverse, k))
    add(hand, routes.cross, scaled @ vector(hand.loads(routes.coupling, 3 * k)).reshape(k, 3), "cross")
    for side, column in enumerate(per_side(hand, routes.columns)):
        add(hand, routes.sums + count * side, [scaled @ column], "m")

    pair = Block(
        f"hand_on_length{name}", "Eliminate an element from the coupling of two lengths.", ("to", "other", "pair", "mirrored")
    )
    both = vector(pair.loads(0, k, "to")) * vector(pair.loads(0, k, "other")) @ vector(pair.loads(routes.inverse, k))
    coupled = pair.load(routes.square, "pair") + both
    pair.store(routes.square, coupled, "pair")
    pair.store(routes.square, coupled, "mirrored")

    begin = Block(f"clear_before{name}", "Clear what steps nearer to the base add through lengths.")
    before = Block(f"step_before{name}", "Add what steps nearer to the base do through a length.", ("to", "m"))
    after = Block(f"step_after{name}", "Add the steps of an element to a length.", ("at", "m", "q"))
    layout, tip = plan.layout, plan.tip
    steps = [layout.step, *(() if tip is None else tip.each(tip.tip_columns, tip.unknowns))]
    for side, place in enumerate(steps):
        begin.store_all(routes.before + stride * side, [0.0] * k)
        add(
            before,
            routes.before + stride * side,
            vector(before.loads(0, k, "to")) * before.load(routes.turns + count * side, "m"),
        )
        step = vector(after.loads(place - layout.unknown, k, "q"))
        add(after, routes.turns + count * side, [vector(after.loads(0, k, "at")) @ step], "m")
    meeting = [*([turn, length, own] if routes.guided or not held else []), *([hold] if routes.guided or held else [])]
    return [clear, *meeting, hand, pair, begin, before, after]
