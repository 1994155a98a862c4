"""The words on a template: what it is for, its numbers, a ruler to check the print, and how to use it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

import numpy as np

from softrobots.helix.helix_design import in_mm
from softrobots.helix.pattern import Pattern
from softrobots.helix.svg import group, segment, text

WIDTH = 252.0
"""Room that the words need [mm]."""

_LINE_HEIGHT = 4.8
_COLUMNS = (0.0, 76.0, 172.0)
_INDENT = 3.6


def title_block(root: ET.Element, plan: Pattern, left: float, page: str) -> None:
    """Write what the drawing is for, and its numbers, down to 31 mm from the top."""
    block = group(root, id="title-block")
    noun = {"pinch": "pinch", "tape": "tape", "stoppers": "stopper"}[plan.method]
    text(block, f"Helical actuation of an inflated tube: {noun} pattern{page}", (left, 9.0), size=5.0, bold=True)
    shape, (taken, several) = plan.shape, ("gap", "gaps") if plan.method == "stoppers" else ("pinched", "pinches")
    columns = (
        (
            f"Tube diameter D {in_mm(plan.diameter)}",
            f"Tube length {in_mm(plan.tube_length)}, uninflated",
            f"Sheet {in_mm(plan.tube_length)} x {in_mm(plan.sheet_width)}",
            f"Helix: {plan.handedness}-handed",
        ),
        (
            f"Actuator line at {math.degrees(plan.angle):.3f} degrees to the axis of the tube",
            f"Line {in_mm(plan.line_length)}, plain {in_mm(plan.plain_start)} at base, {in_mm(plan.plain_end)} at tip",
            f"{plan.count} {several}, spacing {in_mm(plan.spacing)} along the line",
            f"Each period: {in_mm(plan.remaining_length)} stays, {in_mm(plan.pinch_length)} {taken}",
        ),
        (
            f"Contraction {plan.contraction:.4f}; {plan.resulting_contraction:.4f} with plain ends",
            f"Outer radius Ro {in_mm(shape.outer_radius)}",
            f"Inner radius Ri {in_mm(shape.inner_radius)}",
            f"Turn height {in_mm(shape.turn_height)}, {plan.turns:.3f} turns",
        ),
    )
    for x, lines in zip(_COLUMNS, columns, strict=True):
        for row, line in enumerate(lines):
            text(block, line, (left + x, 16.5 + _LINE_HEIGHT * row))


def ruler_and_legend(root: ET.Element, plan: Pattern, left: float, top: float, *, paged: bool) -> None:
    """Draw a ruler of 100 mm and write how to use the drawing, 32 mm in all."""
    ruler = group(root, id="check-ruler", stroke="black", **{"stroke-width": "0.3"})
    segment(ruler, (left, top + 3.0), (left + 100.0, top + 3.0), **{"class": "ruler"})
    for tick in range(11):
        x = left + 10.0 * tick
        segment(ruler, (x, top + (0.0 if tick % 5 == 0 else 1.5)), (x, top + 3.0), **{"class": "tick"})
    text(ruler, "This ruler is 100 mm long: print at 100 %, not fitted to the page, and measure it.", (left + 104.0, top + 3.0))
    legend = group(root, id="legend")
    y = top + 11.0
    for number, lines in enumerate(_instructions(plan, paged), 1):
        text(legend, f"{number}.", (left, y))
        for line in lines:
            text(legend, line, (left + _INDENT, y))
            y += _LINE_HEIGHT


def _instructions(plan: Pattern, paged: bool) -> tuple[tuple[str, ...], ...]:
    """How to use the drawing: steps of one or two lines."""
    glue = "Glue the pages together, join on join. " if paged else ""
    wrap = (
        f"{glue}The sheet is the tube unrolled, seen from outside. Cut it out and wrap it around the flat, empty tube:",
        "the lines A lie on one edge of the flat tube (both are the same line), B on the other. Mark the tube through it.",
    )
    if plan.method == "stoppers":
        first, last = (in_mm(length) for length in (plan.stoppers @ np.array([-1.0, 1.0]))[[0, -1]])
        length = in_mm(plan.remaining_length)
        fix = (
            f"Fix a stopper on each blue bar along the red line: {length} long, the first {first}, the last {last}.",
            "Leave the dashed gaps (numbered) free. Lay the string through all stoppers and fasten it to the last one.",
        )
        return wrap, fix, ("Inflate, and pull the string until every gap has closed. Only then is the shape the planned one.",)
    fold = "Each numbered pair of marks is one pinch: fold the grey wall between them away, square to the red line,"
    hold = "lay the marks on each other and fix the fold. It needs to hold at the red line; let it run out to both sides."
    if plan.tape_length is not None and plan.tape_width is not None:
        piece = f"{in_mm(plan.tape_length)} long and {in_mm(plan.tape_width)} wide"
        hold = f"and lay the marks on each other. Hold each fold by a tape {piece}, half on either side (yellow beside grey)."
    grow = "Inflate, or let the tube grow. It curls towards the red line, which becomes the inner path of the helix."
    return wrap, (fold, hold), (grow,)
