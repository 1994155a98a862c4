"""Docstring of a generated module, also the head of its C file: inputs and results in the workspace."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from softrobots.compiled.chain.layout import TipLayout
from softrobots.compiled.chain.plan import Plan
from softrobots.compiled.chain.unknowns import Unknowns
from softrobots.compiled.statuses import Status
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.model.serial_chain import ChainJoint, ChainSection, strains_of

_WIDTH = 112  # of a line, without the asterisk of a comment in C


class Place(NamedTuple):
    """Numbers of the workspace that callers write or read."""

    name: str
    """Name of the constant with the first place."""
    size: int
    """Number of places."""
    meaning: str
    """Meaning and unit."""


def manual(plan: Plan, tip: TipLayout | None) -> tuple[str, list[str]]:
    """Return the docstring, and the names of all places in it; `tip`: those of the response of the tip."""
    unknowns, layout = plan.unknowns, plan.layout
    places = layout.constants() | ({} if tip is None else tip.constants())
    given, found = _inputs(plan), _results(plan, tip)
    lines = [
        f"Statics of {on_a_line(unknowns.chain.name)}{', with gravity' if plan.weight else ', weightless'}: generated code.",
        "",
        "Functions work on an array of WORKSPACE_SIZE numbers, initially zero, which may be used for several cases.",
        "settle, settle_from, estimate and reach return a status; the results are valid only if it is 0:",
        "",
        *(f"    {status.value}  {status.name:<14} {status.explanation}" for status in Status),
    ]
    return "\n".join([*lines, *place_table(given, found, places)]), list(dict.fromkeys(row.name for row in (*given, *found)))


def place_table(given: Sequence[Place], found: Sequence[Place], places: Mapping[str, int]) -> list[str]:
    """Return lines that tell inputs and results and where they stand."""
    lines = []
    for title, rows in (("Inputs", given), ("Results", found)):
        lines += ["", f"{title}: name, first place, number of places, meaning.", ""]
        for row in rows:
            head = f"    {row.name:<13} {places[row.name]:>5} {row.size:>5}  "
            lines += textwrap.wrap(head + row.meaning, _WIDTH, subsequent_indent=" " * len(head), break_on_hyphens=False)
    return lines


def _inputs(plan: Plan) -> list[Place]:
    """Return the inputs."""
    unknowns, layout = plan.unknowns, plan.layout
    n, searches = layout.unknowns, unknowns.moved_by_motors
    places = [Place("MOTORS", layout.motors, f"motor joints [rad or m]: {motor_names(unknowns)}")] if layout.motors else []
    places.append(Place("FORCE", 3, "force on the tip [N], world axes"))
    if plan.weight:
        places.append(Place("GRAVITY", 3, "gravity [m/s^2], world axes"))
    if layout.muscles:
        places.append(Place("ACTUATORS", layout.muscles, f"{inputs_of(unknowns)}; put_muscles writes them"))
    if unknowns.n_constraints:
        places.append(Place("START", n, "unknowns with the muscle lengths [rad or m]; put_muscles writes them"))
    starts = "for settle_from, reach and follow" if searches else "for settle_from"
    held = ", with the muscle lengths, as in START" if unknowns.n_constraints else ""
    places.append(Place("UNKNOWN", n, f"start of the search [rad or m]; {starts}{held}"))
    if layout.rubbing:
        places.append(
            Place(
                "SLIDERS",
                n,
                "sliders of dry friction, at the places of the unknowns that bend [rad]: at rest, then the last SLID",
            )
        )
    if layout.guides:
        meaning = "length of actuators beyond each guide at its slider, from rest [m]: 0 at first, then the last ANCHORED"
        places.append(Place("ANCHORS", layout.guides, meaning))
    if searches:
        places.append(Place("TORQUES", layout.motors, "load on each motor, minus what it exerts [N m or N]; for estimate"))
        turned = ", and its rotation matrix, row by row" if plan.poses else ""
        places.append(Place("TARGET", layout.target_size, f"target of the tip [m]{turned}, world axes; for reach"))
        places.append(Place("TOLERATED", 1, "largest distance from a target [m], such as 1e-9; for reach and follow"))
    return places


def _results(plan: Plan, tip: TipLayout | None) -> list[Place]:
    """Return the results."""
    unknowns, n, m = plan.unknowns, plan.layout.unknowns, plan.layout.motors
    places = [
        Place("UNKNOWN", n, f"the unknowns [rad or m]: {strain_names(unknowns)}"),
        Place("TIP", 3, "the loaded tip [m], world axes"),
        Place("ERROR", 1, "square of the out-of-balance torque [N^2 m^2]"),
    ]
    if plan.layout.rubbing:
        places.append(Place("SLID", n, "the sliders after the step from SLIDERS to this equilibrium [rad]"))
    if plan.layout.guides:
        places.append(Place("ANCHORED", plan.layout.guides, "the same lengths after that step [m]"))
    if unknowns.moved_by_motors:
        places += [
            Place("FORCE", 3, "the force [N], world axes; of estimate"),
            Place("UNEXPLAINED", 1, "square of the motor torques without its share [N^2 m^2]; of estimate"),
            Place("OBSERVED", 1, "square of the smallest singular value of the elastostatic Jacobian [m^2]; of estimate"),
            Place("MOTORS", m, "the motors [rad or m]; of reach"),
            Place("MISSING", 1, "square of the distance from the target [m^2]; of reach"),
        ]
        if plan.poses:
            measure = "square of the sine, beyond a quarter turn one minus the cosine"
            places.append(Place("TURNED", 1, f"angle from the target orientation: {measure} [-]; of reach"))
    if tip is not None:
        rows = "row by row; of look_at_tip"
        places += [Place("TIP_COLUMNS", 3 * n, f"derivative of the unknowns by a tip force, (3, N) {rows} [rad/N or m/N]")]
        if m:
            places.append(Place("JACOBIAN", 3 * m, f"elastostatic Jacobian of the motor joints, (3, N_MOTORS) {rows} [m/rad]"))
            places.append(Place("MOTOR_TORQUES", m, "load on each motor joint [N m or N]; of look_at_tip"))
        if tip.n_constraints:
            held = tip.n_constraints
            places.append(Place("CONSTRAINT_LOADS", held, "load on each constrained sum [N m or N]; of look_at_tip"))
            places.append(
                Place("CONSTRAINT_COLUMNS", 3 * held, f"derivative of the tip by those sums, (3, {held}) {rows} [m/rad or -]")
            )
    return places


def inputs_of(unknowns: Unknowns) -> str:
    """Return what the inputs of the actuators along the body are."""
    kinds = {
        "tension": "tensions [N]",
        "elastic": "lengths of motors [m]",
        "length": "lengths [m]",
        "pressure": "pressures [Pa]",
        "mckibben": "pressures [Pa]",
    }
    return " or ".join(dict.fromkeys(kinds[one.kind] for one in unknowns.chain.actuators))


def motor_names(unknowns: Unknowns) -> str:
    """Return the names of the motor joints."""
    joints = [one for one in unknowns.chain.elements if isinstance(one, ChainJoint) and one.motor is not None]
    return _listed([one.name for one in sorted(joints, key=lambda one: one.motor or 0)])


def strain_names(unknowns: Unknowns) -> str:
    """Return the names of the unknowns."""
    names: dict[int, str] = {}
    for element in (one for row in unknowns.chain.elements for one in getattr(row, "joints", (row,))):
        if isinstance(element, ChainSection):
            names |= {strain: f"{element.name} {STRAINS[place]}" for place, strain in enumerate(strains_of(element))}
        elif element.strain is not None:
            names[element.strain] = element.name
    return _listed([names[strain] for strain in unknowns.strains])


def _listed(names: list[str]) -> str:
    """Return all of a few names; of many the first eight and the last."""
    return ", ".join(map(on_a_line, names if len(names) <= 12 else [*names[:8], "...", names[-1]]))


def on_a_line(name: str) -> str:
    """Return a name from a file with escapes for characters that cannot be printed."""
    return name if name.isprintable() else name.encode("unicode_escape").decode()
