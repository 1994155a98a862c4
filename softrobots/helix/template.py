"""Drawing a pattern to scale as SVG, and listing it as CSV: the two things that go to the bench, so in millimetres.

One user unit of the SVG is 1 mm. It shows the tube unrolled, from outside, its axis to the right: the sheet with the folds of
the flat tube, the actuator line, what to pinch, tape or stop, a ruler to check the print, the numbers and how to use it. Inside
the group `sheet` coordinates are those of `SheetPoints`. What crosses the seam is drawn on both sides of it (class `copy`).
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:  # it writes itself with these functions
    from softrobots.helix.fabrication import Pattern

_LEFT, _RIGHT, _TOP, _BOTTOM = 18.0, 12.0, 42.0, 56.0  # around the sheet
_NARROWEST = 282.0  # room for three columns of text; fits A4 lying
_COLUMNS = (0.0, 76.0, 172.0)
_TEXT, _SMALL, _LINE_HEIGHT = 3.2, 2.6, 4.8
_RED, _GREY, _BLUE, _YELLOW, _GREEN = "#d00000", "#808080", "#9cc4e4", "#ffd84d", "#008040"
_FILLS = {
    "tape": {"fill": _YELLOW, "fill-opacity": "0.45"},
    "stopper": {"fill": _BLUE},
    "gap": {"stroke-dasharray": "1 0.7"},
}

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


def csv_text(plan: Pattern) -> str:
    """Table of what to mark along the line: see `Pattern.write_csv`."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(_COLUMN_NAMES)
    for number, kind, start, end in _rows(plan):
        points = plan.locate(np.array([start, end]))
        cells: list[object] = [number, kind, _fixed(start), _fixed(end), _fixed(end - start)]
        for place in (0, 1):
            cells += [_fixed(points.x[place]), _fixed(points.y[place]), int(points.wrap[place])]
        writer.writerow(cells)
    return stream.getvalue()


def svg_text(plan: Pattern, window: Window) -> str:
    """Drawing of one page: see `Pattern.write_svg`."""
    around, shown = 1e3 * plan.sheet_width, window.end - window.start
    width, height = max(_LEFT + shown + _RIGHT, _NARROWEST), _TOP + around + _BOTTOM
    root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg", "version": "1.1"})
    root.attrib |= {"width": f"{_n(width)}mm", "height": f"{_n(height)}mm", "viewBox": f"0 0 {_n(width)} {_n(height)}"}
    root.attrib |= {"font-family": "Arial, Helvetica, sans-serif", "font-size": _n(_TEXT)}
    ET.SubElement(root, "title").text = f"Helical actuation: {_NOUNS[plan.method]} pattern"
    ET.SubElement(root, "rect", {"width": "100%", "height": "100%", "fill": "white"})
    _title_block(root, plan, window)
    clip = ET.SubElement(ET.SubElement(root, "clipPath", {"id": "sheet-clip"}), "rect")
    clip.attrib |= {"x": _n(window.start), "y": "0", "width": _n(shown), "height": _n(around)}
    sheet = _group(root, id="sheet", transform=f"translate({_n(_LEFT - window.start)} {_n(_TOP)})", fill="none")
    _sheet(sheet, plan, window)
    _ruler_and_legend(root, plan, window, _TOP + around + 14.0)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


_NOUNS = {"pinch": "pinch", "tape": "tape", "stoppers": "stopper"}


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


# --- The sheet


class _Line(NamedTuple):
    """Straight actuator line in the plane of the sheet, not yet wrapped [mm]."""

    along: float
    across: float
    around: float

    def place(self, arc: float, aside: float, base: float) -> tuple[float, float]:
        """Position `arc` along the line from the base (0, `base`), and `aside` of it, downwards."""
        return arc * self.along - aside * self.across, base + arc * self.across + aside * self.along

    def box(self, start: float, end: float, aside: float, base: float) -> list[tuple[float, float]]:
        """Corners of a rectangle along the line, `aside` to either side."""
        corners = ((start, -aside), (end, -aside), (end, aside), (start, aside))
        return [self.place(arc, across, base) for arc, across in corners]


def _sheet(sheet: ET.Element, plan: Pattern, window: Window) -> None:
    """Outline, folds, actuator line, and what to do along it."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    clipped = {"clip-path": "url(#sheet-clip)"}
    sign = -1.0 if plan.handedness == "left" else 1.0
    line = _Line(math.cos(plan.angle), sign * math.sin(plan.angle), around)
    folds = _group(sheet, id="folds", stroke=_GREY, **{"stroke-width": "0.35", "stroke-dasharray": "5 2"})
    for y in (0.0, 0.5 * around, around):
        _segment(folds, (window.start, y), (window.end, y), **{"class": "fold"})
    marks = _group(sheet, id="marks", stroke="black", **{"stroke-width": "0.25", "stroke-linejoin": "round"}, **clipped)
    _work(marks, plan, window, line)
    red = _group(sheet, id="actuator-line", stroke=_RED, **{"stroke-width": "0.4", "stroke-linecap": "round"}, **clipped)
    for (x0, y0), (x1, y1), wrap in _wrapped(plan, around):
        _segment(red, (x0, y0), (x1, y1), **{"class": "actuator-line", "data-wrap": str(wrap)})
    outline = {"x": "0", "y": "0", "width": _n(length), "height": _n(around), "stroke": "black", "stroke-width": "0.3"}
    box = _group(sheet, **{"clip-path": "url(#sheet-clip)"} if window.pages > 1 else {})
    ET.SubElement(box, "rect", {"id": "sheet-outline", **outline})
    _numbers(sheet, plan, window, line)
    _edges(sheet, plan, window)


def _wrapped(plan: Pattern, around: float) -> list[tuple[tuple[float, float], tuple[float, float], int]]:
    """Straight pieces of the actuator line on the sheet: ends [mm] and wrap."""
    sign = -1.0 if plan.handedness == "left" else 1.0
    slope, length = sign * math.tan(plan.angle), 1e3 * plan.tube_length
    first = 0.5e3 * plan.diameter * plan.start_azimuth
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


def _work(marks: ET.Element, plan: Pattern, window: Window, line: _Line) -> None:
    """Marks of the pinches, pieces of tape, stoppers and gaps."""
    around, half = line.around, _half_mark(line)
    aside = {"tape": 0.5e3 * (plan.tape_width or 0.0), "stopper": 0.25 * half, "gap": 0.25 * half, "pinch": half}
    for number, kind, start, end, base in _shown(plan, window, line):
        place = base + 0.5 * (start + end) * line.across
        reach = aside[kind] + 0.5 * (end - start) + 1.0
        attributes = {"data-number": str(number), "data-start": _n(start), "data-end": _n(end)}
        for shift in (0.0, around, -around):
            if shift and not -reach < place + shift < around + reach:
                continue
            group = _group(marks, **{"class": kind + (" copy" if shift else ""), **attributes})
            if not shift:
                group.set("id", f"{kind}-{number}")
            if kind == "pinch":
                _pinch(group, line, start, end, half, base + shift)
            else:
                _polygon(group, line.box(start, end, aside[kind], base + shift), **_FILLS[kind])


def _numbers(sheet: ET.Element, plan: Pattern, window: Window, line: _Line) -> None:
    """Numbers of pinches and gaps, as many as have room, above them where there is room above."""
    around, half = line.around, _half_mark(line)
    apart = 1e3 * plan.spacing * line.along
    every = next((n for n in (1, 2, 5, 10, 20, 50, 100, 200, 500) if n * apart >= 7.0), 1000)
    halo = {"stroke": "white", "stroke-width": "0.8", "stroke-linejoin": "round", "paint-order": "stroke"}
    for number, kind, start, end, base in _shown(plan, window, line):
        if kind not in ("pinch", "gap") or not (number == 1 or number % every == 0):
            continue
        middle, out = 0.5 * (start + end), (half if kind == "pinch" else 0.25 * half) + 2.4
        places = [line.place(middle, side * out, base) for side in (-1.0, 1.0)]
        room = (window.start + 2.5, window.end - 2.5), (2.0, around - 2.0)
        for x, y in places:
            if room[0][0] <= x <= room[0][1] and room[1][0] <= y <= room[1][1]:
                _text(sheet, str(number), x, y + 0.9, size=_SMALL, anchor="middle", **{"class": "number", **halo})
                break


def _shown(plan: Pattern, window: Window, line: _Line) -> Iterator[tuple[int, str, float, float, float]]:
    """Number, kind, start, end of what a page shows, and where the line through its middle would meet x = 0 [mm]."""
    for number, kind, start, end in _rows(plan):
        middle, reach = 0.5 * (start + end), 500.0 * (end - start) + 15.0
        if window.start - reach <= 1e3 * middle * line.along <= window.end + reach:
            base = 1e3 * (float(plan.locate(middle).y) - middle * line.across)
            yield number, kind, 1e3 * start, 1e3 * end, base


def _half_mark(line: _Line) -> float:
    """Half the length of the mark of a pinch [mm]; less where wraps are near to each other."""
    return min(0.1 * line.around, 12.0, 0.2 * line.around * line.along)


def _pinch(group: ET.Element, line: _Line, start: float, end: float, half: float, base: float) -> None:
    """Two marks square to the line, the wall between them that is folded away, and arrows that bring them together."""
    group.set("stroke-width", _n(min(0.25, 0.2 * (end - start))))
    _polygon(group, line.box(start, end, half, base), stroke="none", fill="black", **{"fill-opacity": "0.07"})
    for name, arc in (("start", start), ("end", end)):
        _segment(group, line.place(arc, -half, base), line.place(arc, half, base), **{"class": f"mark {name}"})
    length = end - start
    head, aside = min(0.25 * length, 1.4), 0.75 * half
    for arc, tip in ((start, start + 0.45 * length), (end, end - 0.45 * length)):
        back = tip - math.copysign(head, tip - arc)
        places = [(arc, aside), (tip, aside), (back, aside - 0.5 * head), (tip, aside), (back, aside + 0.5 * head)]
        path = " L ".join(f"{_n(x)} {_n(y)}" for x, y in (line.place(a, n, base) for a, n in places))
        ET.SubElement(group, "path", {"class": "arrow", "d": f"M {path}"})


def _edges(sheet: ET.Element, plan: Pattern, window: Window) -> None:
    """Names of folds and ends, joins of pages, and a scale along the tube."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    for name, y in (("fold A", 0.0), ("fold B", 0.5 * around), ("fold A", around)):
        _text(sheet, name, window.start - 1.5, y + 1.0, size=_SMALL, anchor="end")
    if window.start <= 0.0:
        _text(sheet, "BASE", 0.0, -1.8, **{"font-weight": "bold"})
    if window.end >= length:
        _text(sheet, "TIP", length, -1.8, anchor="end", **{"font-weight": "bold"})
    for x in window.joins:
        green = _group(sheet, **{"class": "join", "stroke": _GREEN, "stroke-width": "0.3", "data-x": _n(x)})
        _segment(green, (x, -4.0), (x, around + 1.5))
        for share in (0.25, 0.75):
            _segment(green, (x - 4.0, share * around), (x + 4.0, share * around))
        _text(sheet, "join", x, -5.0, size=_SMALL, anchor="middle", fill=_GREEN)
    scale = _group(sheet, id="scale", stroke="black", **{"stroke-width": "0.2"})
    for tick in range(math.ceil(window.start / 10.0 - 1e-9), math.floor(window.end / 10.0 + 1e-9) + 1):
        x, long = 10.0 * tick, tick % 5 == 0
        _segment(scale, (x, around + 2.0), (x, around + (4.5 if long else 3.2)))
        if long:
            unit = " mm from the base" if x == 0.0 else ""
            _text(sheet, f"{x:.0f}{unit}", x, around + 7.6, size=_SMALL, anchor="start" if unit else "middle")


# --- The words


def _title_block(root: ET.Element, plan: Pattern, window: Window) -> None:
    """What the drawing is for, and its numbers."""
    block = _group(root, id="title-block")
    page = f" - page {window.page} of {window.pages}" if window.pages > 1 else ""
    heading = f"Helical actuation of an inflated tube: {_NOUNS[plan.method]} pattern{page}"
    _text(block, heading, _LEFT, 9.0, size=5.0, **{"font-weight": "bold"})
    shape, noun = plan.shape, "gaps" if plan.method == "stoppers" else "pinches"
    taken = "gap" if plan.method == "stoppers" else "pinched"
    columns = (
        (
            f"Tube diameter D {_mm(plan.diameter)}",
            f"Tube length {_mm(plan.tube_length)}, uninflated",
            f"Sheet {_mm(plan.tube_length)} x {_mm(plan.sheet_width)}",
            f"Helix: {plan.handedness}-handed",
        ),
        (
            f"Actuator line at {math.degrees(plan.angle):.3f} degrees to the axis of the tube",
            f"Line length {_mm(plan.line_length)}, plain {_mm(plan.plain_start)} at base, {_mm(plan.plain_end)} at tip",
            f"{plan.count} {noun}, spacing {_mm(plan.spacing)} along the line",
            f"Each period: {_mm(plan.remaining_length)} stays, {_mm(plan.pinch_length)} {taken}",
        ),
        (
            f"Contraction {plan.contraction:.4f}; {plan.resulting_contraction:.4f} with plain ends",
            f"Outer radius Ro {_mm(shape.outer_radius)}",
            f"Inner radius Ri {_mm(shape.inner_radius)}",
            f"Turn height {_mm(shape.turn_height)}, {plan.turns:.3f} turns",
        ),
    )
    for x, lines in zip(_COLUMNS, columns, strict=True):
        for row, words in enumerate(lines):
            _text(block, words, _LEFT + x, 16.5 + _LINE_HEIGHT * row)


def _ruler_and_legend(root: ET.Element, plan: Pattern, window: Window, top: float) -> None:
    """A ruler of 100 mm, and how to use the drawing."""
    ruler = _group(root, id="check-ruler", stroke="black", **{"stroke-width": "0.3"})
    _segment(ruler, (_LEFT, top + 3.0), (_LEFT + 100.0, top + 3.0), **{"class": "ruler"})
    for tick in range(11):
        x = _LEFT + 10.0 * tick
        _segment(ruler, (x, top + (0.0 if tick % 5 == 0 else 1.5)), (x, top + 3.0), **{"class": "tick"})
    _text(root, "This ruler is 100 mm long: print at 100 %, not fitted to the page, and measure it.", _LEFT + 104.0, top + 3.0)
    legend = _group(root, id="legend")
    for row, words in enumerate(_instructions(plan, window)):
        indent = 0.5 * _TEXT * (len(words) - len(words.lstrip()))
        _text(legend, words.lstrip(), _LEFT + 0.45 * indent, top + 11.0 + _LINE_HEIGHT * row)


def _instructions(plan: Pattern, window: Window) -> tuple[str, ...]:
    """How to use the drawing, line by line."""
    glue = "Glue the pages together, join on join. " if window.pages > 1 else ""
    first = (
        f"1. {glue}The sheet is the tube unrolled, seen from outside. Cut it out and wrap it around the flat tube, before",
        "    inflating: the lines A lie on one edge of the flat tube (both are the same line), B on the other. Mark through it.",
    )
    if plan.method == "stoppers":
        lengths = plan.stoppers @ np.array([-1.0, 1.0])
        return (
            *first,
            f"2. Fix a stopper on each blue bar along the red line, {_mm(plan.remaining_length)} long, the first "
            f"{_mm(lengths[0])}, the last {_mm(lengths[-1])}.",
            "    Leave the dashed gaps (numbered) free. Lay the string through all stoppers and fasten it to the last one.",
            "3. Inflate, and pull the string until every gap has closed. Only then is the shape the one that is planned.",
        )
    fix = "2. Each numbered pair of marks is one pinch: fold the grey wall between them away, square to the red line,"
    held = "    lay the marks on each other and fix the fold. It needs to hold at the red line; let it run out to both sides."
    if plan.tape_length is not None and plan.tape_width is not None:
        size = f"{_mm(plan.tape_length)} long and {_mm(plan.tape_width)} wide"
        held = f"    and lay the marks on each other. Hold each by a tape {size}, half on either side (yellow: all that it touches)."
    last = "3. Inflate, or let the tube grow. It curls towards the red line, which becomes the inner path of the helix."
    return (*first, fix, held, last)


# --- Elements


def _group(parent: ET.Element, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, "g", attributes)


def _segment(parent: ET.Element, start: tuple[float, float], end: tuple[float, float], **attributes: str) -> None:
    ends = {"x1": _n(start[0]), "y1": _n(start[1]), "x2": _n(end[0]), "y2": _n(end[1])}
    ET.SubElement(parent, "line", {**attributes, **ends})


def _polygon(parent: ET.Element, corners: list[tuple[float, float]], **attributes: str) -> None:
    ET.SubElement(parent, "polygon", {**attributes, "points": " ".join(f"{_n(x)},{_n(y)}" for x, y in corners)})


def _text(
    parent: ET.Element,
    words: str,
    x: float,
    y: float,
    size: float = _TEXT,
    anchor: str = "start",
    fill: str = "black",
    **more: str,
) -> None:
    place = {"x": _n(x), "y": _n(y), "font-size": _n(size), "text-anchor": anchor, "fill": fill, "stroke": "none"}
    ET.SubElement(parent, "text", {**place, **more}).text = words


def _n(value: float) -> str:
    """A number in millimetres, to the nanometre."""
    return f"{value + 0.0:.6f}".rstrip("0").rstrip(".")


def _fixed(length: float) -> str:
    return f"{1e3 * length:.6f}"


def _mm(length: Any) -> str:
    return f"{1e3 * float(length):.2f} mm"
