"""A small picture of a pose as SVG, which notebooks show beside the table of a result; it needs no other package."""

from __future__ import annotations

from html import escape
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.robots.fields import XacroRobot
from softrobots.view.appearance import LINE_COLOUR, TUBE_COLOUR, rgb, shared_scale
from softrobots.view.camera import picture_axes
from softrobots.view.figures.canvas import CONTACT, FORCE, GREY, INK
from softrobots.view.figures.pose import DrawnPose, Posed, model_of, with_robot_loaded
from softrobots.view.tension_scale import round_down, tension_colour

_WIDE, _HIGH, _EDGE = 340.0, 240.0, 14.0  # [px]
_DARKER = 0.7  # of a colour: that of an edge
_MOST_POINTS = 80  # of a line


def inline_picture(result: Posed | XacroRobot) -> str:
    """Return a picture of a result as an SVG element: the robot in parallel projection, with a scale and a description.

    It is empty for a robot with meshes, which take longer to read than a cell should take, and for one that cannot be drawn.
    """
    try:
        posed = with_robot_loaded(result)
        return "" if "<mesh" in model_of(posed).urdf else _svg(DrawnPose.of(posed))
    except SoftRobotsError:  # the table beside it says what there is
        return ""


class _Paper(NamedTuple):
    """Where points of the world are on the picture."""

    view: FloatArray  # columns: to the right, downwards, towards the eye, shape (3, 3)
    scale: float  # [px/m]
    corner: FloatArray  # what is in the upper left corner inside the edge, shape (2,) [m]

    @classmethod
    def around(cls, points: FloatArray, eye: FloatArray) -> _Paper:
        """Fit points, shape (n, 3) [m], seen from a direction, shape (3,)."""
        back, aside, up = picture_axes(eye)
        view = np.column_stack([aside, -up, back])
        low, high = (points @ view)[:, :2].min(axis=0), (points @ view)[:, :2].max(axis=0)
        room = np.array([_WIDE - 2.0 * _EDGE, _HIGH - 3.0 * _EDGE])
        scale = float(np.min(room / np.maximum(high - low, 1e-3)))
        return cls(view, scale, 0.5 * (low + high) - 0.5 * room / scale)

    def at(self, points: FloatArray) -> FloatArray:
        """Place points, shape (n, 3) [m], on the picture, shape (n, 2) [px]."""
        return np.asarray(_EDGE + self.scale * ((points @ self.view)[:, :2] - self.corner))

    def depth(self, points: FloatArray) -> float:
        """Return how near points are to the eye on average [m]."""
        return float((points @ self.view[:, 2]).mean())

    def line(self, points: FloatArray, colour: str, width: float, more: str = "") -> str:
        """Draw a line through points, shape (n, 3) [m]."""
        kept = np.unique(np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS)).round().astype(int))
        style = f'fill="none" stroke="{colour}" stroke-width="{width:.3g}" stroke-linejoin="round" {more}'
        return _path(self.at(points[kept]), "", style) if len(kept) else ""


def _svg(pose: DrawnPose) -> str:
    """Draw a pose: solids and tubes from the farthest to the nearest, then what is seen through them."""
    scene, size, solids, arrows = pose.scene, pose.builder.extent.size, [*pose.solids(inside=False)], [*pose.arrows()]
    seen = [corners for corners, _, _ in solids if np.ptp(corners, axis=0).max() <= 1.5 * size]
    seen += [one.backbone + shift for one in scene.segments for shift in one.radius * np.concatenate([np.eye(3), -np.eye(3)])]
    seen += [start + share * along for start, along, _ in arrows for share in np.array([[0.0], [1.0]])]
    paper = _Paper.around(np.vstack([*seen, pose.line, pose.other, pose.path, pose.tip, pose.target]), pose.eye)
    bodies = []
    for corners, _, colour in solids:
        style = f'fill="{_css(colour)}" fill-opacity="{colour[3]:.2g}" stroke="{_css(_DARKER * colour[:3])}" stroke-width="0.6"'
        depth = paper.depth(corners) if colour[3] > 0.5 else -np.inf  # obstacles, as of glass, are behind
        bodies.append((depth, _path(_outline(paper.at(corners)), "Z", style)))
    wall = np.array(TUBE_COLOUR[:3])
    for segment in scene.segments:
        wide, points = 2.0 * segment.radius * paper.scale, segment.backbone
        drawn = paper.line(points, _css(_DARKER * wall), wide) + paper.line(points, _css(0.5 + 0.5 * wall), 0.97 * wide - 0.8)
        drawn += "".join(paper.line(one, _css(LINE_COLOUR), 1.5) for one in segment.lines.values())
        bodies.append((paper.depth(points), drawn))
    parts, end = [text for _, text in sorted(bodies, key=lambda body: body[0])], shared_scale([scene])
    for curve, tension, slack in scene.actuators:
        dashes = 'stroke-dasharray="4 3"' if slack else ""
        parts.append(paper.line(curve.shown, _css(tension_colour(tension, end)), 1.6, dashes))
    parts.append(paper.line(pose.other, GREY, 2.0, 'stroke-dasharray="1.5 3.5"'))
    parts.append(paper.line(pose.line, INK, 1.1))
    parts.append(paper.line(pose.path, INK, 1.1, 'stroke-dasharray="5 3"'))
    for start, along, of_contact in arrows:
        first, last = paper.at(np.stack([start, start + along]))
        parts.append(_arrow(first, last, CONTACT if of_contact else FORCE))
    for contact in scene.contacts.values():
        parts.append(_dot(paper.at(contact.point[None])[0], CONTACT))
    parts.append(_dot(paper.at(pose.tip[None])[0], INK))
    for x, y in paper.at(pose.target):
        parts.append(f'<path d="M{x - 5:.1f} {y - 5:.1f}l10 10m0 -10l-10 10" stroke="{INK}" stroke-width="2"/>')
    length = round_down(0.35 * _WIDE / paper.scale)
    parts.append(f'<path d="M{_EDGE} {_HIGH - 10}h{length * paper.scale:.2f}" stroke="{INK}" stroke-width="2"/>')
    parts.append(f'<text x="{_EDGE}" y="{_HIGH - 15}" font-family="sans-serif" font-size="12" fill="{INK}">{length:g} m</text>')
    words = _words(pose)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDE:g}" height="{_HIGH:g}" role="img" aria-label="{words}">'
    return f'{head}<title>{words}</title><rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>'


def _words(pose: DrawnPose) -> str:
    """The description of a picture for those who do not see it."""
    x, y, z = np.round(pose.tip, 4) + 0.0
    forces = [f"{'contact' if arrow.of_contact else 'force'} {arrow.force:.3g} N" for arrow in pose.scene.arrows.values()]
    return escape(f"{pose.name}, tip at ({x:g}, {y:g}, {z:g}) m{''.join(f', {force}' for force in forces)}")


def _path(points: FloatArray, end: str, style: str) -> str:
    return f'<path d="M{"L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist())}{end}" {style}/>'


def _dot(place: FloatArray, colour: str) -> str:
    return f'<circle cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="3" fill="{colour}"/>'


def _arrow(start: FloatArray, end: FloatArray, colour: str) -> str:
    """An arrow on the picture; its head is smaller than a short arrow."""
    way = end - start
    length = max(float(np.linalg.norm(way)), 1e-9)
    along, head = way / length, min(9.0, length)
    across = np.array([-along[1], along[0]])
    corners = np.array([end, end - head * (along + 0.45 * across), end - head * (along - 0.45 * across)])
    shaft = _path(np.array([start, end - 0.7 * head * along]), "", f'stroke="{colour}" stroke-width="2.4"')
    return shaft + _path(corners, "Z", f'fill="{colour}"')


def _outline(points: FloatArray) -> FloatArray:
    """The convex outline of points on the picture, shape (n, 2) [px], after Andrew's monotone chain."""
    ordered = np.unique(np.round(points, 1), axis=0).tolist()
    halves: list[list[list[float]]] = []
    for row in (ordered, ordered[::-1]):
        half: list[list[float]] = []
        for place in row:
            while len(half) > 1 and _turn(half[-2], half[-1], place) <= 0.0:
                half.pop()
            half.append(place)
        halves.append(half[:-1] or half)
    return np.array(halves[0] + halves[1])


def _turn(first: list[float], second: list[float], third: list[float]) -> float:
    """Twice the area of a triangle, positive if it turns from x to y."""
    return (second[0] - first[0]) * (third[1] - first[1]) - (second[1] - first[1]) * (third[0] - first[0])


def _css(colour: FloatArray | tuple[float, ...]) -> str:
    red, green, blue = rgb(tuple(colour[:3]))
    return f"#{red:02x}{green:02x}{blue:02x}"
