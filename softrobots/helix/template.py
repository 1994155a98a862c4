"""Drawing a pattern to scale as SVG, and listing it as CSV: the two things that go to the bench, so in millimetres.

One user unit of the SVG is 1 mm. It shows the tube unrolled, from outside, its axis to the right: the sheet with the folds of
the flat tube, the actuator line, and what to pinch, tape or stop. Inside the group `sheet` coordinates are those of
`SheetPoints`. What crosses the seam is drawn on both sides of it (class `copy`).
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from softrobots.core.files import csv_text
from softrobots.helix.pattern import Pattern
from softrobots.helix.shapes import turning_sign
from softrobots.helix.svg import SMALL, TEXT, Point, group, mm, polygon, polyline, rectangle, segment, text
from softrobots.helix.template_notes import WIDTH, ruler_and_legend, title_block

_LEFT, _RIGHT, _TOP, _BOTTOM = 18.0, 12.0, 42.0, 54.0  # around the sheet
_FILLS = {
    "tape": {"fill": "#ffd84d", "fill-opacity": "0.45"},
    "stopper": {"fill": "#9cc4e4"},
    "gap": {"stroke-dasharray": "1 0.7"},
}
_ON_SHEET = {"clip-path": "url(#sheet-clip)"}
_COLUMN_NAMES = (
    *("number", "kind", "start_mm", "end_mm", "length_mm"),
    *("start_x_mm", "start_y_mm", "start_wrap", "end_x_mm", "end_y_mm", "end_wrap"),
)


class Window(NamedTuple):
    """What part of the sheet a page shows."""

    start: float
    """Along the tube [mm]."""
    end: float
    """Along the tube [mm]."""
    page: int = 1
    """Number of this page."""
    pages: int = 1
    """Number of pages."""
    joins: tuple[float, ...] = ()
    """Where the page is joined to its neighbours, along the tube [mm]."""


def table_text(plan: Pattern) -> str:
    """Table of what to mark along the line as CSV: see `write_template_table`."""
    table = []
    for number, kind, start, end in _rows(plan):
        cells: list[object] = [number, kind, *(f"{1e3 * length:.6f}" for length in (start, end, end - start))]
        points = plan.locate(np.array([start, end]))
        for x, y, wrap in zip(points.x, points.y, points.wrap, strict=True):
            cells += [f"{1e3 * x:.6f}", f"{1e3 * y:.6f}", int(wrap)]
        table.append(cells)
    return csv_text(_COLUMN_NAMES, table)


def svg_text(plan: Pattern, window: Window) -> str:
    """Drawing of one page: see `write_template`."""
    around, shown = 1e3 * plan.sheet_width, window.end - window.start
    width, height = _LEFT + max(shown, WIDTH) + _RIGHT, _TOP + around + _BOTTOM
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "version": "1.1"})
    root.attrib |= {"width": f"{mm(width)}mm", "height": f"{mm(height)}mm", "viewBox": f"0 0 {mm(width)} {mm(height)}"}
    root.attrib |= {"font-family": "Arial, Helvetica, sans-serif", "font-size": mm(TEXT)}
    rectangle(root, (0.0, 0.0), width, height, fill="white")
    title_block(root, plan, _LEFT, f" - page {window.page} of {window.pages}" if window.pages > 1 else "")
    rectangle(ET.SubElement(root, "clipPath", {"id": "sheet-clip"}), (window.start, 0.0), shown, around)
    sheet = group(root, id="sheet", transform=f"translate({mm(_LEFT - window.start)} {mm(_TOP)})", fill="none", stroke="black")
    _sheet(sheet, plan, window)
    ruler_and_legend(root, plan, _LEFT, _TOP + around + 13.0, paged=window.pages > 1)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _rows(plan: Pattern) -> list[tuple[int, str, float, float]]:
    """Number, kind, start and end [m] of everything along the line, in the order of its starts."""
    kind = "gap" if plan.method == "stoppers" else "pinch"
    rows = [(n, kind, float(a), float(b)) for n, (a, b) in enumerate(zip(plan.starts.arc, plan.ends.arc, strict=True), 1)]
    if plan.tape_length is not None:
        side = 0.5 * plan.tape_length
        rows += [(n, "tape", a - side, b + side) for n, _, a, b in rows]
    if plan.method == "stoppers":
        rows += [(n, "stopper", float(a), float(b)) for n, (a, b) in enumerate(plan.stoppers, 1)]
    return sorted(rows, key=lambda row: row[2])


class _Line(NamedTuple):
    """Straight actuator line in the plane of the sheet, not wrapped."""

    along: float
    """Cosine of its angle."""
    across: float
    """Sine of its angle, with the sign of the turning."""

    def place(self, arc: float, aside: float, base: float) -> Point:
        """Position `arc` along the line from (0, `base`), and `aside` of it, downwards [mm]."""
        return arc * self.along - aside * self.across, base + arc * self.across + aside * self.along

    def box(self, start: float, end: float, aside: float, base: float) -> list[Point]:
        """Corners of a rectangle along the line, `aside` to either side."""
        return [self.place(*place, base) for place in ((start, -aside), (end, -aside), (end, aside), (start, aside))]


def _sheet(sheet: ET.Element, plan: Pattern, window: Window) -> None:
    """Outline, folds, actuator line, and what to do along it."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    line = _Line(math.cos(plan.angle), turning_sign(plan.handedness) * math.sin(plan.angle))
    half_mark = min(0.1 * around, 12.0, 0.2 * around * line.along)  # less where wraps are near to each other
    folds = group(sheet, id="folds", **{"stroke": "#808080", "stroke-width": "0.35", "stroke-dasharray": "5 2"})
    for y in (0.0, 0.5 * around, around):
        segment(folds, (window.start, y), (window.end, y), **{"class": "fold"})
    marks = group(sheet, id="marks", **{"stroke-width": "0.25", "stroke-linejoin": "round"}, **_ON_SHEET)
    _work(marks, plan, window, line, half_mark)
    red = group(sheet, id="actuator-line", **{"stroke": "#d00000", "stroke-width": "0.4"}, **_ON_SHEET)
    for start, end, wrap in _wrapped(plan, around):
        segment(red, start, end, **{"class": "actuator-line", "data-wrap": str(wrap)})
    box = group(sheet, **{"stroke-width": "0.3"}, **(_ON_SHEET if window.pages > 1 else {}))
    rectangle(box, (0.0, 0.0), length, around, id="sheet-outline")
    _numbers(sheet, plan, window, line, half_mark)
    _edges(sheet, plan, window)


def _wrapped(plan: Pattern, around: float) -> list[tuple[Point, Point, int]]:
    """Straight pieces of the actuator line on the sheet: ends [mm] and wrap."""
    sign, length = turning_sign(plan.handedness), 1e3 * plan.tube_length
    slope, first = sign * math.tan(plan.angle), 0.5e3 * plan.diameter * plan.start_azimuth
    last = first + slope * length
    low, high = min(first, last), max(first, last)
    crossings = [k * around for k in range(math.floor(low / around) + 1, math.ceil(high / around))]
    levels = [first, *(crossings if sign > 0.0 else reversed(crossings)), last]
    pieces = []
    for start, end in itertools.pairwise(levels):
        wrap = math.floor(0.5 * (start + end) / around)
        x0, x1 = (0.0, length) if first == last else ((start - first) / slope, (end - first) / slope)
        pieces.append(((x0, start - wrap * around), (x1, end - wrap * around), wrap))
    return pieces


def _work(marks: ET.Element, plan: Pattern, window: Window, line: _Line, half_mark: float) -> None:
    """Marks of the pinches, pieces of tape, stoppers and gaps."""
    around, bar = 1e3 * plan.sheet_width, 0.25 * half_mark
    aside = {"pinch": half_mark, "tape": 0.5e3 * (plan.tape_width or 0.0), "stopper": bar, "gap": bar}
    for number, kind, start, end, base in _shown(plan, window, line):
        middle, reach = base + 0.5 * (start + end) * line.across, aside[kind] + 0.5 * (end - start) + 1.0
        attributes = {"data-number": str(number), "data-start": mm(start), "data-end": mm(end)}
        for shift in (0.0, around, -around):
            if shift and not -reach < middle + shift < around + reach:
                continue
            name = {"class": f"{kind} copy"} if shift else {"class": kind, "id": f"{kind}-{number}"}
            made = group(marks, **name, **attributes)
            if kind == "pinch":
                _pinch(made, line, start, end, half_mark, base + shift)
            else:
                polygon(made, line.box(start, end, aside[kind], base + shift), **_FILLS[kind])


def _pinch(made: ET.Element, line: _Line, start: float, end: float, half_mark: float, base: float) -> None:
    """Two marks square to the line, the wall between them that is folded away, and arrows that bring them together."""
    length = end - start
    made.set("stroke-width", mm(min(0.25, 0.2 * length)))
    polygon(made, line.box(start, end, half_mark, base), stroke="none", fill="black", **{"fill-opacity": "0.07"})
    for name, arc in (("start", start), ("end", end)):
        segment(made, line.place(arc, -half_mark, base), line.place(arc, half_mark, base), **{"class": f"mark {name}"})
    head, aside = min(0.25 * length, 1.4), 0.75 * half_mark
    for arc, tip in ((start, start + 0.45 * length), (end, end - 0.45 * length)):
        back = tip - math.copysign(head, tip - arc)
        places = ((arc, aside), (tip, aside), (back, aside - 0.5 * head), (tip, aside), (back, aside + 0.5 * head))
        polyline(made, [line.place(*place, base) for place in places], **{"class": "arrow"})


def _numbers(sheet: ET.Element, plan: Pattern, window: Window, line: _Line, half_mark: float) -> None:
    """Numbers of pinches and gaps, as many as have room; above them, or below where there is none above."""
    around, apart = 1e3 * plan.sheet_width, 1e3 * plan.spacing * line.along
    every = next((n for n in (1, 2, 5, 10, 20, 50, 100, 200, 500) if n * apart >= 7.0), 1000)
    halo = {"class": "number", "stroke": "white", "stroke-width": "0.8", "paint-order": "stroke"}
    for number, kind, start, end, base in _shown(plan, window, line):
        if kind not in ("pinch", "gap") or not (number == 1 or number % every == 0):
            continue
        aside = (half_mark if kind == "pinch" else 0.25 * half_mark) + 2.4
        for side in (-aside, aside):
            x, y = line.place(0.5 * (start + end), side, base)
            if window.start + 2.5 <= x <= window.end - 2.5 and 2.0 <= y <= around - 2.0:
                text(sheet, str(number), (x, y + 0.9), size=SMALL, anchor="middle", attributes=halo)
                break


def _shown(plan: Pattern, window: Window, line: _Line) -> Iterator[tuple[int, str, float, float, float]]:
    """Number, kind, start and end of what a page shows, and where the line through its middle meets x = 0 [mm]."""
    rows = _rows(plan)
    middles = np.array([0.5 * (start + end) for _, _, start, end in rows])
    bases = 1e3 * (plan.locate(middles).y - middles * line.across)
    for (number, kind, start, end), middle, base in zip(rows, middles, bases, strict=True):
        reach = 500.0 * (end - start) + 15.0
        if window.start - reach <= 1e3 * middle * line.along <= window.end + reach:
            yield number, kind, 1e3 * start, 1e3 * end, float(base)


def _edges(sheet: ET.Element, plan: Pattern, window: Window) -> None:
    """Names of folds and ends, joins of pages, and a scale along the tube."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    for name, y in (("fold A", 0.0), ("fold B", 0.5 * around), ("fold A", around)):
        text(sheet, name, (window.start - 1.5, y + 1.0), size=SMALL, anchor="end")
    if window.page == 1:
        text(sheet, "BASE", (0.0, -1.8), bold=True)
    if window.page == window.pages:
        text(sheet, "TIP", (length, -1.8), anchor="end", bold=True)
    for x in window.joins:
        green = group(sheet, **{"class": "join", "stroke": "#008040", "stroke-width": "0.3", "data-x": mm(x)})
        segment(green, (x, -4.0), (x, around + 1.5))
        for share in (0.25, 0.75):
            segment(green, (x - 4.0, share * around), (x + 4.0, share * around))
        text(green, "join", (x, -5.0), size=SMALL, anchor="middle")
    scale = group(sheet, id="scale", **{"stroke-width": "0.2"})
    for tick in range(math.ceil(window.start / 10.0 - 1e-9), math.floor(window.end / 10.0 + 1e-9) + 1):
        x, long = 10.0 * tick, tick % 5 == 0
        segment(scale, (x, around + 2.0), (x, around + (4.5 if long else 3.2)))
        if tick == 0:
            text(scale, "0 mm from the base", (x, around + 7.6), size=SMALL)
        elif long:
            text(scale, f"{x:.0f}", (x, around + 7.6), size=SMALL, anchor="middle")
