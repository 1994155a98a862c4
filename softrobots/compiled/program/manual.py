"""The docstring of a generated module: what a caller writes into the workspace, and what comes out.

It is printed with the code, and stands at the head of the C file.
"""

from __future__ import annotations

import textwrap
from typing import NamedTuple

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.chain.recursion_layout import TipLayout
from softrobots.compiled.chain.unknowns import Unknowns, strains_of
from softrobots.compiled.statuses import Status
from softrobots.constant_curvature.strain_chain import STRAINS
from softrobots.model.serial_chain import ChainJoint, ChainSection

_WIDTH = 112  # of a line, with the asterisk of a comment in C before it


class Place(NamedTuple):
    """Numbers of the workspace that a caller writes or reads."""

    name: str
    """Name of the constant that tells where they begin."""
    size: int
    """How many they are."""
    meaning: str
    """What they are, with the unit."""


def given(unknowns: Unknowns, layout: Layout, *, weight: bool) -> list[Place]:
    """What comes in.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        weight: Whether there is gravity.
    """
    n, searches = layout.unknowns, unknowns.moved_by_motors
    made = [Place("MOTORS", layout.motors, f"motor joints [rad or m]: {_motors(unknowns)}")] if layout.motors else []
    made.append(Place("FORCE", 3, "force on the tip [N], world axes"))
    if weight:
        made.append(Place("GRAVITY", 3, "gravity [m/s^2], world axes"))
    if unknowns.pulled:
        made.append(Place("PULL", n, "load of the muscle tensions on each unknown [N m or N]; put_muscles writes it"))
    if unknowns.chain.held:
        made.append(Place("START", n, "unknowns that have the muscle lengths [rad or m]; put_muscles writes them"))
    starts = "for settle_from, reach and follow" if searches else "for settle_from"
    held = ", with the muscle lengths in them, as START has" if unknowns.chain.held else ""
    made.append(Place("UNKNOWN", n, f"where to start [rad or m]; {starts}{held}"))
    if searches:
        made.append(Place("TORQUES", layout.motors, "load on each motor, minus what it exerts [N m or N]; for estimate"))
        made.append(Place("TARGET", 3, "target of the tip [m], world axes; for reach"))
        made.append(Place("TOLERATED", 1, "largest distance from a target [m], such as 1e-9; for reach and follow"))
    return made


def found(unknowns: Unknowns, layout: Layout, tip: TipLayout | None) -> list[Place]:
    """What comes out.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        tip: Places of what a look at the tip finds; None without such a look.
    """
    n, m = layout.unknowns, layout.motors
    made = [
        Place("UNKNOWN", n, f"the unknowns [rad or m]: {_strains(unknowns)}"),
        Place("TIP", 3, "the loaded tip [m], world axes"),
        Place("ERROR", 1, "square of the out-of-balance torque [N^2 m^2]"),
    ]
    if unknowns.moved_by_motors:
        made += [
            Place("FORCE", 3, "the force [N], world axes; of estimate"),
            Place("UNEXPLAINED", 1, "square of the motor torques that it does not explain [N^2 m^2]; of estimate"),
            Place("OBSERVED", 1, "square of the smallest singular value of the elastostatic Jacobian [m^2]; of estimate"),
            Place("MOTORS", m, "the motors [rad or m]; of reach"),
            Place("MISSING", 1, "square of the distance from the target [m^2]; of reach"),
        ]
    if tip is not None:
        rows = "row by row; of look_at_tip"
        made += [Place("TIP_COLUMNS", 3 * n, f"how the unknowns follow a force on the tip, (3, N) {rows} [rad/N or m/N]")]
        if m:
            made.append(Place("JACOBIAN", 3 * m, f"elastostatic Jacobian of the motor joints, (3, N_MOTORS) {rows} [m/rad]"))
            made.append(Place("MOTOR_TORQUES", m, "load on each motor joint [N m or N]; of look_at_tip"))
        if tip.n_constraints:
            held = tip.n_constraints
            made.append(Place("CONSTRAINT_LOADS", held, "load on each sum that muscle lengths hold [N m or N]; of look_at_tip"))
            made.append(
                Place("CONSTRAINT_COLUMNS", 3 * held, f"how the tip follows those sums, (3, {held}) {rows} [m/rad or -]")
            )
    return made


def manual(unknowns: Unknowns, layout: Layout, tip: TipLayout | None, *, weight: bool) -> str:
    """The docstring.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        tip: Places of what a look at the tip finds; None without such a look.
        weight: Whether there is gravity.
    """
    places = layout.constants() | ({} if tip is None else tip.constants())
    lines = [
        f"Statics of {_on_a_line(unknowns.chain.name)}{', with gravity' if weight else ', weightless'}: generated code.",
        "",
        "Functions work on an array of WORKSPACE_SIZE numbers that is all zeros at first and may be used again.",
        "settle and its like return a status; only with 0 are the numbers an answer:",
        "",
        *(f"    {status.value}  {status.name:<14} {status.explanation}" for status in Status),
    ]
    for title, rows in (("in", given(unknowns, layout, weight=weight)), ("out", found(unknowns, layout, tip))):
        lines += ["", f"What comes {title}: name, first place, how many, what.", ""]
        for row in rows:
            head = f"    {row.name:<13} {places[row.name]:>5} {row.size:>5}  "
            lines += textwrap.wrap(head + row.meaning, _WIDTH, subsequent_indent=" " * len(head), break_on_hyphens=False)
    return "\n".join(lines)


def public_names(unknowns: Unknowns, layout: Layout, tip: TipLayout | None, *, weight: bool) -> list[str]:
    """Names of all places that the manual explains, each once.

    Args:
        unknowns: The chain.
        layout: The places in the workspace.
        tip: Places of what a look at the tip finds; None without such a look.
        weight: Whether there is gravity.
    """
    return list(dict.fromkeys(row.name for row in (*given(unknowns, layout, weight=weight), *found(unknowns, layout, tip))))


def _motors(unknowns: Unknowns) -> str:
    joints = [one for one in unknowns.chain.elements if isinstance(one, ChainJoint) and one.motor is not None]
    return _listed([one.name for one in sorted(joints, key=lambda one: one.motor or 0)])


def _strains(unknowns: Unknowns) -> str:
    names: dict[int, str] = {}
    for element in unknowns.chain.elements:
        if isinstance(element, ChainSection):
            names |= {strain: f"{element.name} {STRAINS[place]}" for place, strain in enumerate(strains_of(element))}
        elif element.strain is not None:
            names[element.strain] = element.name
    return _listed([names[strain] for strain in unknowns.strains])


def _listed(names: list[str]) -> str:
    """All of a few; of many the first and the last."""
    return ", ".join(map(_on_a_line, names if len(names) <= 12 else [*names[:8], "...", names[-1]]))


def _on_a_line(name: str) -> str:
    """A name out of somebody's file; what cannot be printed is told by its number."""
    return name if name.isprintable() else name.encode("unicode_escape").decode()
