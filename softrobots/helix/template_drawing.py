"""Drawing of the unrolled tube to scale, as SVG elements in millimetres.

The tube is shown from outside, its axis to the right: the sheet with the folds of the flat tube, the actuator line, and the
pinches, tapes, stoppers and gaps. Inside the group `sheet` coordinates are those of `SheetPoints`. Marks that cross the seam
are drawn on both sides of it (class `copy`).
"""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from softrobots.helix.pattern import Pattern
from softrobots.helix.shapes import turning_sign

TEXT = 3.2
"""Size of ordinary text [mm]."""

_SMALL = 2.6  # size of labels [mm]
_FILLS = {
    "tape": {"fill": "#ffd84d", "fill_opacity": "0.45"},
    "stopper": {"fill": "#9cc4e4"},
    "gap": {"stroke_dasharray": "1 0.7"},
}
_ON_SHEET = {"clip_path": "url(#sheet-clip)"}

Point = tuple[float, float]
"""Position on the drawing, y downwards [mm]."""


def draw_sheet(sheet: ET.Element, plan: Pattern) -> None:
    """Draw the sheet: outline, folds, actuator line, and the marks along it."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    line = _Line(math.cos(plan.angle), turning_sign(plan.handedness) * math.sin(plan.angle))
    half_mark = min(0.1 * around, 12.0, 0.2 * around * line.along)  # less where wraps are near to each other
    folds = element(sheet, "g", id="folds", stroke="#808080", stroke_width=0.35, stroke_dasharray="5 2")
    for y in (0.0, 0.5 * around, around):
        segment(folds, (0.0, y), (length, y), class_="fold")
    _draw_marks(sheet, plan, line, half_mark)
    red = element(sheet, "g", id="actuator-line", stroke="#d00000", stroke_width=0.4, **_ON_SHEET)
    for start, end, wrap in _wrapped(plan, around):
        segment(red, start, end, class_="actuator-line", data_wrap=str(wrap))
    box = element(sheet, "g", stroke_width=0.3)
    element(box, "rect", id="sheet-outline", x=0.0, y=0.0, width=length, height=around)
    _draw_numbers(sheet, plan, line, half_mark)
    _draw_edges(sheet, plan)


def marks(plan: Pattern) -> list[tuple[int, str, float, float]]:
    """Return number, kind, start and end [m] of all pinches, tapes, gaps and stoppers along the line, ordered by start."""
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
        """Position at `arc` along the line from (0, `base`), and `aside` from it, downwards [mm]."""
        return arc * self.along - aside * self.across, base + arc * self.across + aside * self.along

    def box(self, start: float, end: float, aside: float, base: float) -> str:
        """Corners of a rectangle along the line that reaches `aside` to either side of it."""
        corners = ((start, -aside), (end, -aside), (end, aside), (start, aside))
        return _coordinates([self.place(*corner, base) for corner in corners])


def _wrapped(plan: Pattern, around: float) -> list[tuple[Point, Point, int]]:
    """Straight pieces of the actuator line on the sheet: both ends [mm] and the wrap."""
    sign, length = turning_sign(plan.handedness), 1e3 * plan.tube_length
    slope = sign * math.tan(plan.angle)
    last = slope * length
    crossings = [sign * k * around for k in range(1, math.ceil(abs(last) / around))]
    levels = [0.0, *crossings, last]
    pieces = []
    for start, end in itertools.pairwise(levels):
        wrap = math.floor(0.5 * (start + end) / around)
        x0, x1 = (0.0, length) if last == 0.0 else (start / slope, end / slope)
        pieces.append(((x0, start - wrap * around), (x1, end - wrap * around), wrap))
    return pieces


def _draw_marks(sheet: ET.Element, plan: Pattern, line: _Line, half_mark: float) -> None:
    """Draw the pinches, pieces of tape, stoppers and gaps."""
    box = element(sheet, "g", id="marks", stroke_width=0.25, stroke_linejoin="round", **_ON_SHEET)
    around, bar = 1e3 * plan.sheet_width, 0.25 * half_mark
    aside = {"pinch": half_mark, "tape": 0.5e3 * (plan.tape_width or 0.0), "stopper": bar, "gap": bar}
    for number, kind, start, end, base in _placed(plan, line):
        middle, reach = base + 0.5 * (start + end) * line.across, aside[kind] + 0.5 * (end - start) + 1.0
        attributes = {"data_number": str(number), "data_start": mm(start), "data_end": mm(end)}
        for shift in (0.0, around, -around):
            if shift and not -reach < middle + shift < around + reach:
                continue
            name = {"class": f"{kind} copy"} if shift else {"class": kind, "id": f"{kind}-{number}"}
            mark = element(box, "g", **name, **attributes)
            if kind == "pinch":
                _draw_pinch(mark, line, start, end, half_mark, base + shift)
            else:
                element(mark, "polygon", **_FILLS[kind], points=line.box(start, end, aside[kind], base + shift))


def _draw_pinch(mark: ET.Element, line: _Line, start: float, end: float, half_mark: float, base: float) -> None:
    """Draw two marks square to the line, the wall between them that is folded away, and arrows that bring them together."""
    length = end - start
    mark.set("stroke-width", mm(min(0.25, 0.2 * length)))
    element(mark, "polygon", stroke="none", fill="black", fill_opacity=0.07, points=line.box(start, end, half_mark, base))
    for name, arc in (("start", start), ("end", end)):
        segment(mark, line.place(arc, -half_mark, base), line.place(arc, half_mark, base), class_=f"mark {name}")
    head, aside = min(0.25 * length, 1.4), 0.75 * half_mark
    for arc, tip in ((start, start + 0.45 * length), (end, end - 0.45 * length)):
        back = tip - math.copysign(head, tip - arc)
        places = ((arc, aside), (tip, aside), (back, aside - 0.5 * head), (tip, aside), (back, aside + 0.5 * head))
        element(mark, "polyline", class_="arrow", points=_coordinates([line.place(*place, base) for place in places]))


def _draw_numbers(sheet: ET.Element, plan: Pattern, line: _Line, half_mark: float) -> None:
    """Draw the numbers of pinches and gaps above the line, or below if there is no room; only each n-th of a dense pattern."""
    around, length, spacing = 1e3 * plan.sheet_width, 1e3 * plan.tube_length, 1e3 * plan.spacing * line.along
    label_step = next((n for n in (1, 2, 5, 10, 20, 50, 100, 200, 500) if n * spacing >= 7.0), 1000)
    halo = {"class": "number", "stroke": "white", "stroke_width": "0.8", "paint_order": "stroke"}
    for number, kind, start, end, base in _placed(plan, line):
        if kind not in ("pinch", "gap") or not (number == 1 or number % label_step == 0):
            continue
        aside = (half_mark if kind == "pinch" else 0.25 * half_mark) + 2.4
        for side in (-aside, aside):
            x, y = line.place(0.5 * (start + end), side, base)
            if 2.5 <= x <= length - 2.5 and 2.0 <= y <= around - 2.0:
                text(sheet, str(number), (x, y + 0.9), size=_SMALL, anchor="middle", **halo)
                break


def _placed(plan: Pattern, line: _Line) -> Iterator[tuple[int, str, float, float, float]]:
    """Number, kind, start and end of the marks, and where the line through their middle meets x = 0 [mm]."""
    rows = marks(plan)
    middles = np.array([0.5 * (start + end) for _, _, start, end in rows])
    bases = 1e3 * (plan.locate(middles).y - middles * line.across)
    for (number, kind, start, end), base in zip(rows, bases, strict=True):
        yield number, kind, 1e3 * start, 1e3 * end, float(base)


def _draw_edges(sheet: ET.Element, plan: Pattern) -> None:
    """Draw the names of folds and ends, and a scale along the tube."""
    around, length = 1e3 * plan.sheet_width, 1e3 * plan.tube_length
    for name, y in (("fold A", 0.0), ("fold B", 0.5 * around), ("fold A", around)):
        text(sheet, name, (-1.5, y + 1.0), size=_SMALL, anchor="end")
    text(sheet, "BASE", (0.0, -1.8), font_weight="bold")
    text(sheet, "TIP", (length, -1.8), anchor="end", font_weight="bold")
    scale = element(sheet, "g", id="scale", stroke_width=0.2)
    for tick in range(math.floor(length / 10.0 + 1e-9) + 1):
        x, long = 10.0 * tick, tick % 5 == 0
        segment(scale, (x, around + 2.0), (x, around + (4.5 if long else 3.2)))
        if tick == 0:
            text(scale, "0 mm from the base", (x, around + 7.6), size=_SMALL)
        elif long:
            text(scale, f"{x:.0f}", (x, around + 7.6), size=_SMALL, anchor="middle")


def element(parent: ET.Element, tag: str, **attributes: str | float) -> ET.Element:
    """Add an SVG element; numbers are lengths [mm], `stroke_width` stands for `stroke-width` and `class_` for `class`."""
    values = {name: value if isinstance(value, str) else mm(value) for name, value in attributes.items()}
    return ET.SubElement(parent, tag, {name.rstrip("_").replace("_", "-"): value for name, value in values.items()})


def segment(parent: ET.Element, start: Point, end: Point, **attributes: str) -> None:
    """Add a straight line."""
    element(parent, "line", **attributes, x1=start[0], y1=start[1], x2=end[0], y2=end[1])


def text(
    parent: ET.Element, words: str, place: Point, size: float = TEXT, anchor: str = "start", **attributes: str | float
) -> None:
    """Add a line of text, its baseline at `place`."""
    style: dict[str, str | float] = {"font_size": size, "text_anchor": anchor, "fill": "black", "stroke": "none"}
    element(parent, "text", x=place[0], y=place[1], **{**style, **attributes}).text = words


def mm(value: float) -> str:
    """A number in millimetres, to the nanometre, without needless zeros."""
    return f"{value + 0.0:.6f}".rstrip("0").rstrip(".")


def _coordinates(points: Sequence[Point]) -> str:
    return " ".join(f"{mm(x)},{mm(y)}" for x, y in points)
