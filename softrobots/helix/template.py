"""Printed template of a pattern: the unrolled tube to scale on one sheet as SVG, and a table of the marks as CSV.

One user unit of the SVG is 1 mm. Around the drawing of the sheet (`template_drawing`) stand a title with the numbers of the
plan, a ruler to check the print, and instructions.
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from softrobots.core.errors import ParameterError
from softrobots.core.files import csv_text, write_text
from softrobots.helix.design import in_mm
from softrobots.helix.pattern import Pattern, checked_pattern
from softrobots.helix.template_drawing import TEXT, draw_sheet, element, marks, mm, segment, text

_THINNEST, _THICKEST, _LONGEST = 1e-3, 10.0, 200.0  # tubes that can be drawn [m]
_LEFT, _RIGHT, _TOP, _BOTTOM = 18.0, 12.0, 42.0, 54.0  # margins around the sheet [mm]
_TEXT_WIDTH = 252.0  # of title and instructions [mm]
_LINE_HEIGHT = 4.8
_TITLE_COLUMNS = (0.0, 76.0, 172.0)
_INDENT = 3.6
_TABLE_COLUMNS = (
    *("number", "kind", "start_mm", "end_mm", "length_mm"),
    *("start_x_mm", "start_y_mm", "start_wrap", "end_x_mm", "end_y_mm", "end_wrap"),
)


def write_template(pattern: Pattern, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """Draw the unrolled tube to scale on one sheet, as SVG; printing programs cut long sheets into pages.

    Args:
        pattern: The plan.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If `pattern` is not a `Pattern`, `path` is not a path, or the tube is thinner than 1 mm, thicker than
            10 m or longer than 200 m.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    _check_drawable(checked_pattern(pattern))
    return write_text(path, _svg_text(pattern), overwrite=overwrite)


def write_template_table(pattern: Pattern, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
    """List the marks along the actuator line as CSV, in millimetres.

    Columns: `number`; `kind` ("pinch", "tape", "gap" or "stopper"); `start_mm`, `end_mm`, `length_mm` along the line of the
    uninflated tube; and for start and end `x_mm` along the tube, `y_mm` around it and `wrap`, as in `SheetPoints`.

    Args:
        pattern: The plan.
        path: File to write.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If `pattern` is not a `Pattern`, or `path` is not a path.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    table = []
    for number, kind, start, end in marks(checked_pattern(pattern)):
        cells: list[object] = [number, kind, *(f"{1e3 * length:.6f}" for length in (start, end, end - start))]
        points = pattern.locate(np.array([start, end]))
        for x, y, wrap in zip(points.x, points.y, points.wrap, strict=True):
            cells += [f"{1e3 * x:.6f}", f"{1e3 * y:.6f}", int(wrap)]
        table.append(cells)
    return write_text(path, csv_text(_TABLE_COLUMNS, table), overwrite=overwrite)


def _check_drawable(pattern: Pattern) -> None:
    """Raise ParameterError for a tube too thin, too thick or too long to draw."""
    if not _THINNEST <= pattern.diameter <= _THICKEST:
        raise ParameterError("diameter", pattern.diameter, f"from {_THINNEST} to {_THICKEST} m for a drawing")
    if pattern.tube_length > _LONGEST:
        raise ParameterError("tube_length", pattern.tube_length, f"at most {_LONGEST} m for a drawing")


def _svg_text(plan: Pattern) -> str:
    """The drawing."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    width, height = _LEFT + max(length, _TEXT_WIDTH) + _RIGHT, _TOP + around + _BOTTOM
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "version": "1.1"})
    root.attrib |= {"width": f"{mm(width)}mm", "height": f"{mm(height)}mm", "viewBox": f"0 0 {mm(width)} {mm(height)}"}
    root.attrib |= {"font-family": "Arial, Helvetica, sans-serif", "font-size": mm(TEXT)}
    element(root, "rect", fill="white", x=0.0, y=0.0, width=width, height=height)
    _draw_title(root, plan, _LEFT)
    clip = element(root, "clipPath", id="sheet-clip")
    element(clip, "rect", x=0.0, y=0.0, width=length, height=around)
    sheet = element(root, "g", id="sheet", transform=f"translate({mm(_LEFT)} {mm(_TOP)})", fill="none", stroke="black")
    draw_sheet(sheet, plan)
    _draw_ruler_and_instructions(root, plan, _LEFT, _TOP + around + 13.0)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _draw_title(root: ET.Element, plan: Pattern, left: float) -> None:
    """Draw the title and the numbers of the plan, down to 31 mm from the top."""
    block = element(root, "g", id="title-block")
    noun = {"pinch": "pinch", "tape": "tape", "stoppers": "stopper"}[plan.method]
    text(block, f"Helical actuation of an inflated tube: {noun} pattern", (left, 9.0), size=5.0, font_weight="bold")
    shape, (removed, noun_plural) = plan.shape, ("gap", "gaps") if plan.method == "stoppers" else ("pinched", "pinches")
    columns = (
        (
            f"Tube diameter D {in_mm(plan.diameter)}",
            f"Tube length {in_mm(plan.tube_length)}, uninflated",
            f"Sheet {in_mm(plan.tube_length)} x {in_mm(plan.sheet_width)}",
            f"Helix: {plan.handedness}-handed",
        ),
        (
            f"Actuator line at {math.degrees(plan.angle):.3f} degrees to the axis of the tube",
            f"Line {in_mm(plan.line_length)}",
            f"{plan.count} {noun_plural}, spacing {in_mm(plan.spacing)} along the line",
            f"Each period: {in_mm(plan.remaining_length)} stays, {in_mm(plan.pinch_length)} {removed}",
        ),
        (
            f"Contraction {plan.contraction:.4f}",
            f"Outer radius Ro {in_mm(shape.outer_radius)}",
            f"Inner radius Ri {in_mm(shape.inner_radius)}",
            f"Turn height {in_mm(shape.turn_height)}, {plan.turns:.3f} turns",
        ),
    )
    for x, lines in zip(_TITLE_COLUMNS, columns, strict=True):
        for row, line in enumerate(lines):
            text(block, line, (left + x, 16.5 + _LINE_HEIGHT * row))


def _draw_ruler_and_instructions(root: ET.Element, plan: Pattern, left: float, top: float) -> None:
    """Draw a ruler of 100 mm and the instructions, 32 mm in all."""
    ruler = element(root, "g", id="check-ruler", stroke="black", stroke_width=0.3)
    segment(ruler, (left, top + 3.0), (left + 100.0, top + 3.0), class_="ruler")
    for tick in range(11):
        x = left + 10.0 * tick
        segment(ruler, (x, top + (0.0 if tick % 5 == 0 else 1.5)), (x, top + 3.0), class_="tick")
    text(ruler, "This ruler is 100 mm long: print at 100 %, not fitted to the page, and measure it.", (left + 104.0, top + 3.0))
    legend = element(root, "g", id="legend")
    y = top + 11.0
    for number, lines in enumerate(_instructions(plan), 1):
        text(legend, f"{number}.", (left, y))
        for line in lines:
            text(legend, line, (left + _INDENT, y))
            y += _LINE_HEIGHT


def _instructions(plan: Pattern) -> tuple[tuple[str, ...], ...]:
    """Steps of one or two lines."""
    wrap = (
        "The sheet is the tube unrolled, seen from outside. Cut it out and wrap it around the flat, empty tube:",
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
