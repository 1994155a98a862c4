"""The script of a robot: the kernel in JavaScript, what it is to know of the robot, and `solver.js`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from softrobots.compiled.browser.links import inflated_links
from softrobots.compiled.browser.tensions import tension_places
from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.program.generated_module import Program
from softrobots.compiled.program.shape_program import with_shape
from softrobots.compiled.statuses import Status
from softrobots.compiled.translate.javascript import to_javascript
from softrobots.compiled.translate.lines import comment
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.model.muscle_lengths import CONSISTENT
from softrobots.model.serial_chain import ChainSection, SerialChain, strains_of
from softrobots.model.soft_model import SoftModel


def script(model: SoftModel, unknowns: Unknowns, program: Program, *, gravity: bool, points: int) -> str:
    """Return the script; see `CompiledStatics.js_source`."""
    layout, muscles = program.layout, len(unknowns.chain.muscle_paths.rest)
    shape = with_shape(program, unknowns, points)
    functions = ("settle", "settle_from", "evaluate", "look_at_shape", *(["put_muscles"] if muscles else []))
    places = ("FORCE", "UNKNOWN", "START", "TIP", "ERROR", "MIN_PIVOT", "STRAINS", "NOT_A_NUMBER")
    kernel = to_javascript(shape.text, exported=(*functions, *places))
    low, high = model.motor_limits.T
    relaxed = model.relaxed_motors
    rows = zip(model.actuators.names, model.actuators.units, low.tolist(), high.tolist(), relaxed.tolist(), strict=True)
    robot = {
        "name": unknowns.chain.name,
        "size": shape.size,
        "joints": layout.motors,
        "muscles": muscles,
        "unknowns": layout.unknowns,
        "started": unknowns.n_constraints > 0,
        "gravity": gravity,
        "gravityPlace": layout.gravity,
        "springsPlace": shape.springs,
        "placementsPlace": shape.placements,
        "actuators": [
            {"name": name, "unit": unit, "lower": _finite(lower), "upper": _finite(upper), "relaxed": rest}
            for name, unit, lower, upper, rest in rows
        ],
        "springs": [{"name": name, "unit": unit} for name, unit in _springs(unknowns.chain)],
        "statuses": [{"name": status.name, "text": status.explanation} for status in Status],
        "frames": shape.frames,
        "loadsPlace": shape.loads,
        "strains": len(unknowns.chain.rest),
        "tensions": tension_places(Plan(unknowns, gravity)),
        "links": inflated_links(model, unknowns.chain, shape.frames),
        "consistent": CONSISTENT,
        "misfit": _misfit(unknowns.chain),
        "memory": _memory(unknowns, layout),
    }
    pieces = [
        comment([f"Equilibria of {unknowns.chain.name}, written by softrobots: makeSolver() returns a solver."]),
        'var makeSolver = (() => {\n"use strict";',
        kernel,
        f"const ROBOT = {json.dumps(robot, allow_nan=False)};",
        Path(__file__).with_name("solver.js").read_text(encoding="utf-8"),
        "return makeSolver;\n})();\n",
    ]
    return "\n\n".join(pieces).replace("</", "<\\/").replace("<!--", "<\\!--")  # a page can hold it as it is


def _springs(chain: SerialChain) -> list[tuple[str, str]]:
    """Return name and unit of each elastic coordinate; that of several strains is named by the first of them."""
    strains: dict[int, tuple[str, str]] = {}
    for element in chain.elements:
        if isinstance(element, ChainSection):
            units = (*["rad"] * 3, "m")
            own = [(f"{element.name} {strain}", unit) for strain, unit in zip(STRAINS, units, strict=True)]
            strains |= dict(zip(strains_of(element), own, strict=False))
        elif element.strain is not None:
            strains[element.strain] = element.name, "m" if element.slides else "rad"
    found = []
    for row in chain.elastic:
        name, unit = strains[int(np.flatnonzero(row)[0])]
        found.append((name if np.count_nonzero(row) == 1 else f"{name} and others", unit))
    return found


def _misfit(chain: SerialChain) -> list[list[float]] | None:
    """Return what changes of given lengths miss the nearest shape by, of each change; None where lengths are not given.

    Straight muscles along a segment only: of others only the solver tells.
    """
    if not chain.constrained:
        return None
    arms = chain.muscle_paths.at(chain.rest).arms
    return [[float(one) for one in row] for row in np.eye(len(arms)) - arms @ chain.spread]


def _memory(unknowns: Unknowns, layout: Layout) -> list[dict[str, object]]:
    """Return what dry friction remembers: its place before a step and after it, and the numbers of a robot at rest."""
    if not layout.rubbing:
        return []
    rest = [float(unknowns.chain.rest[one]) for one in unknowns.strains]
    places = ((layout.sliders, layout.slid, rest), (layout.anchors, layout.anchored, [0.0] * layout.guides))
    return [{"before": before, "after": after, "rest": numbers} for before, after, numbers in places]


def _finite(limit: float) -> float | None:
    return limit if abs(limit) < 1e300 else None
