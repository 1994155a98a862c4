"""How a robot looks on a page, whatever draws it: its colours, the parts of its body, the size of its arrows, its legend."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.view.body import SegmentBody, tube
from softrobots.view.robot_shapes import Shape
from softrobots.view.scene import WRINKLING_COLOURS, Scene

RIGID_COLOUR = (0.40, 0.50, 0.62, 0.20)
"""Red, green, blue, opacity of the rigid arm."""
PATH_COLOUR = 0x1A1A1A
"""Near black of the path: none of the colours of wrinkling and muscles."""
FORCE_COLOUR = 0x009E73
"""Green of the forces."""
FLOOR_COLOUR = 0xB8C0C8
"""Light grey of the lines on the floor."""
TUBE_COLOUR = (0.85, 0.74, 0.50, 0.32)
"""Red, green, blue, opacity of the tube, through which the chain is seen."""
PULL_COLOUR = (0.00, 0.45, 0.70, 1.0)
"""Blue of muscles that pull."""
PUSH_COLOUR = (0.90, 0.45, 0.00, 1.0)
"""Orange of muscles that push; the two differ in lightness too."""
TAIL_COLOUR = (0.25, 0.25, 0.28, 0.8)
"""Dark grey of the wall inside a growing tube."""

ARROW_LENGTH = 0.2
"""Length of the arrow of the unit force, relative to the size of the robot; other arrows are in proportion."""
ARROW_WIDTH = 0.009
"""Radius of the shaft of an arrow, relative to the size of the robot; its head is 2.5 times as wide and 7 times as long."""

_MUSCLE_RADIUS = 0.09  # of the radius of the body

Colour = tuple[float, ...] | int
"""Red, green, blue and perhaps opacity in [0, 1], or a number as in HTML."""
LegendEntry = tuple[Colour, str]
"""Colour and meaning of something that is drawn."""


def rgb(colour: Colour) -> tuple[int, int, int]:
    """Return red, green and blue of a colour, each from 0 to 255."""
    if isinstance(colour, int):
        return colour >> 16 & 255, colour >> 8 & 255, colour & 255
    red, green, blue = (round(255 * share) for share in colour[:3])
    return red, green, blue


class BodyPart(NamedTuple):
    """A tube, a muscle or a line of a continuous body."""

    segment: SegmentBody
    """Its segment."""
    line: str | None
    """Name of the muscle or line; None: the tube."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity."""
    meaning: str
    """Text of the legend."""

    @property
    def path(self) -> str:
        """A name that is unique in the robot, with slashes."""
        return f"segment_{self.segment.number}/" + ("tube" if self.line is None else f"lines/{self.line}")

    def surface(self, sides: int = 24) -> tuple[FloatArray, FloatArray]:
        """Return corners and triangles, as `SegmentBody.surface`; lines have six sides."""
        segment = self.segment
        if self.line is None:
            return segment.surface(sides)
        points = (segment.muscles | segment.lines)[self.line]
        return tube(segment.poses[:, :3, :3], points, _MUSCLE_RADIUS * segment.radius, 6)


def body_parts(scene: Scene, segments: Sequence[SegmentBody] | None = None) -> Iterator[BodyPart]:
    """Yield the parts of the body of a scene, or of other segments with the same muscles."""
    for segment in scene.segments if segments is None else segments:
        yield BodyPart(segment, None, TUBE_COLOUR, "body")
        for name in segment.muscles:
            pushes = name in scene.pushing
            meaning = "muscle that pushes" if pushes else "muscle that pulls"
            yield BodyPart(segment, name, PUSH_COLOUR if pushes else PULL_COLOUR, meaning)
        for name in segment.lines:
            yield BodyPart(segment, name, PULL_COLOUR, name)


def legend(
    shapes: Iterable[Shape], scene: Scene, animated: Iterable[Scene] = (), *, path: bool = False, target: bool = False
) -> list[LegendEntry]:
    """Return colour and meaning of everything that is drawn.

    Args:
        shapes: The shapes of the robot.
        scene: What is shown.
        animated: The scenes of an animation.
        path: Whether the path of the tip is drawn.
        target: Whether a target is drawn.
    """
    shapes = tuple(shapes)
    entries: list[LegendEntry] = [(RIGID_COLOUR, scene.reference)] * any(shape.elastic for shape in shapes)
    if all(shape.inflated_link is None for shape in shapes):
        entries += [(shape.colour, "equivalent rigid chain") for shape in shapes if shape.of_section][:1]
    body: dict[str, Colour] = {}
    states = (scene, *animated)
    for state in states:
        body |= {part.meaning: part.colour for part in body_parts(state)}
        if state.segments and state.grown is not None and state.grown < 1.0:
            body["wall that has not come out"] = TAIL_COLOUR
    entries += [(colour, meaning) for meaning, colour in body.items()]
    entries += [(PATH_COLOUR, "path of the tip")] * path + [(PATH_COLOUR, "target (cross)")] * target
    entries += [(FORCE_COLOUR, "force")] * any(state.arrows for state in states)
    above = 1.0
    for least, rgb in WRINKLING_COLOURS if scene.wrinkling else ():
        text = f"{100 * above:.0f} - {100 * least:.0f} % of the wrinkling moment left" if least > -np.inf else "wrinkled"
        entries.append((rgb, text))
        above = least
    return entries
