"""Placements of a chain in equilibrium, traced: what a page draws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from softrobots.compiled.chain.elements import Screw, Vector, turned, vector
from softrobots.compiled.chain.slack_hinges import with_slack_hinges
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.drivers import shape_drivers
from softrobots.compiled.program.generated_module import Program, functions_of, text_of
from softrobots.compiled.trace.blocks import Block
from softrobots.compiled.trace.expressions import Scalar
from softrobots.model.serial_chain import ChainJoint, strains_of

_KINDS = ("turn", "slide", "section")


class Shape(NamedTuple):
    """A program with placements."""

    text: str
    """Its text."""
    springs: int
    """Place of the elastic coordinates."""
    loads: int
    """Place of the loads on the springs of all strains [N m or N]."""
    placements: int
    """Place of the first placement, of twelve numbers each."""
    size: int
    """Size of the workspace."""
    frames: list[dict[str, object]]
    """Name, kind and share of each placement."""


def with_shape(program: Program, unknowns: Unknowns, points: int) -> Shape:
    """Append `look_at_shape` to a program, with `points` placements along each section; see `shape_drivers`."""
    chain = unknowns.chain
    strains, springs = program.size, program.size + len(chain.rest)
    loads = springs + len(chain.elastic)
    placements = loads + len(chain.rest)
    records, kinds, coordinates, frames, each = [], [], [], [], 0
    shares = [(k + 1) / points for k in range(points)]
    axes = np.eye(3)  # of the chain's frame in Pinocchio's of the same joint
    for element in chain.elements:
        start, shift = axes @ element.rotation, axes @ element.translation
        axes = np.eye(3)
        if isinstance(element, ChainJoint):
            axes = element.axes
            behind = axes.T.ravel().tolist()
            kinds.append(_KINDS.index("slide" if element.slides else "turn"))
            coordinates.append(strains + strains_of(element)[0] if element.motor is None else element.motor)
            frames.append({"name": element.name, "kind": "joint", "share": 1})
        else:
            behind = [element.length, *[0.0] * 8]
            kinds.append(_KINDS.index("section"))
            coordinates.append(strains + element.strain)
            each = element.n_strains
            frames += [{"name": element.name, "kind": "section", "share": share} for share in shares]
        records += [*start.ravel().tolist(), *shift.tolist(), *behind]
    kinds.append(_KINDS.index("slide"))  # the tip, which does not move
    coordinates.append(placements + 12 * (len(frames) + 2))  # a zero
    records += [*(axes @ chain.tip_rotation).ravel().tolist(), *(axes @ chain.tip_translation).tolist(), *np.eye(3).ravel()]
    frames.append({"name": "tip", "kind": "tip", "share": 1})
    rows, columns = np.nonzero(chain.elastic)
    values = {
        "STRAINS": strains,
        "LOADS": loads,
        "SPRINGS": springs,
        "PLACEMENTS": placements,
        "N_STRAINS": len(chain.rest),
        "N_SPRINGS": len(chain.elastic),
        "N_ELASTIC": len(rows),
        "N_PLACED": len(kinds),
        "N_POINTS": points,
        "STRAIN_REST": tuple(chain.rest.tolist()),
        "STRAIN_STIFFNESS": tuple(chain.stiffness.tolist()),
        "UNKNOWN_STRAIN": unknowns.strains,
        "ELASTIC_ROW": tuple(rows.tolist()),
        "ELASTIC_STRAIN": tuple(columns.tolist()),
        "ELASTIC_SHARE": tuple(chain.elastic[rows, columns].tolist()),
        "PLACED_KIND": tuple(kinds),
        "PLACED_COORDINATE": tuple(coordinates),
        "PLACED_RECORD": tuple(map(float, records)),
        "SHARES": tuple(shares),
    }
    lines = [f"{name} = {value if value != () else (0,)!r}" for name, value in values.items()]
    blocks = [*(_place(kind, each).text() for kind in _KINDS), _slack_walls(unknowns, strains, loads).text()]
    functions = map(text_of, functions_of(shape_drivers))
    text = "\n\n\n".join([program.text.rstrip(), "\n".join(lines), *blocks, *functions]) + "\n"
    return Shape(text, springs, loads, placements + 12, placements + 12 * (len(frames) + 1) + 1, frames)


def _place(kind: str, each: int) -> Block:
    """Trace the placement behind an element, or at a share of a section.

    `before` is the placement before the element; a section has `each` strains.
    """
    block = Block(f"place_{kind}", "Write a placement.", ("at", "row", "before", "q", "k"))
    axes, origin = _matrix(block.loads(0, 9, "before")), vector(block.loads(9, 3, "before"))
    record = [block.table("PLACED_RECORD", place, "row") for place in range(21)]
    origin, axes = origin + axes @ vector(record[9:12]), axes @ _matrix(record[:9])
    if kind == "section":
        share = block.table("SHARES", 0, "k")
        z = vector([*block.loads(0, each, "q"), *[0.0] * (4 - each)])
        screw = Screw([one * share for one in z], record[12] * share)
        origin, axes = origin + axes @ screw.position, axes @ screw.rotation
    else:
        position = block.load(0, "q")
        if kind == "turn":
            axes = turned(axes, position)
        else:
            origin = origin + axes[:, 2] * position
        axes = axes @ _matrix(record[12:])
    block.store_all(0, axes.ravel().tolist(), "at")
    block.store_all(9, origin.tolist(), "at")
    return block


def _slack_walls(unknowns: Unknowns, strains: int, loads: int) -> Block:
    """Trace the loads on the springs of hinges whose wall goes slack, at the strains in the workspace."""
    block, chain = Block("bend_slack_walls", "Write the loads of springs that are not linear."), unknowns.chain
    if unknowns.slack_hinges:
        rows = range(len(chain.elements))
        elements = [unknowns.traced(row, block.load, lambda place: block.load(strains + place)) for row in rows]
        for row, one in enumerate(with_slack_hinges(unknowns, elements, chain)):
            if one.law is not None:
                block.store(loads + strains_of(chain.elements[row])[0], one.law.torque)
    return block


def _matrix(values: Sequence[Scalar]) -> Vector:
    return vector(values).reshape(3, 3)
