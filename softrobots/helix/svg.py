"""Elements of an SVG drawing whose user unit is 1 mm."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence

TEXT = 3.2
"""Size of ordinary text [mm]."""

SMALL = 2.6
"""Size of names and numbers beside what they belong to [mm]."""

Point = tuple[float, float]
"""Position on the drawing, y downwards [mm]."""


def group(parent: ET.Element, **attributes: str) -> ET.Element:
    """Add an empty group."""
    return ET.SubElement(parent, "g", attributes)


def segment(parent: ET.Element, start: Point, end: Point, **attributes: str) -> None:
    """Add a straight line."""
    ends = {"x1": mm(start[0]), "y1": mm(start[1]), "x2": mm(end[0]), "y2": mm(end[1])}
    ET.SubElement(parent, "line", {**attributes, **ends})


def polyline(parent: ET.Element, points: Sequence[Point], **attributes: str) -> None:
    """Add a line through points."""
    ET.SubElement(parent, "polyline", {**attributes, "points": _listed(points)})


def polygon(parent: ET.Element, corners: Sequence[Point], **attributes: str) -> None:
    """Add a closed polygon."""
    ET.SubElement(parent, "polygon", {**attributes, "points": _listed(corners)})


def rectangle(parent: ET.Element, corner: Point, width: float, height: float, **attributes: str) -> None:
    """Add a rectangle from its upper left corner."""
    place = {"x": mm(corner[0]), "y": mm(corner[1]), "width": mm(width), "height": mm(height)}
    ET.SubElement(parent, "rect", {**attributes, **place})


def text(
    parent: ET.Element,
    words: str,
    place: Point,
    *,
    size: float = TEXT,
    anchor: str = "start",
    bold: bool = False,
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Add a line of text, its baseline at `place`."""
    made = {
        "x": mm(place[0]),
        "y": mm(place[1]),
        "font-size": mm(size),
        "text-anchor": anchor,
        "fill": "black",
        "stroke": "none",
    }
    made |= {**({"font-weight": "bold"} if bold else {}), **(attributes or {})}
    ET.SubElement(parent, "text", made).text = words


def mm(value: float) -> str:
    """A number in millimetres, to the nanometre, without needless zeros."""
    return f"{value + 0.0:.6f}".rstrip("0").rstrip(".")


def _listed(points: Sequence[Point]) -> str:
    return " ".join(f"{mm(x)},{mm(y)}" for x, y in points)
