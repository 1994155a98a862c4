"""How a robot looks on a page, whatever draws it: its colours, the parts of its body, the size of its arrows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

from softrobots.core.checks import FloatArray
from softrobots.view.actuator_curves import THREAD
from softrobots.view.body import SegmentBody, tube
from softrobots.view.scene import Scene
from softrobots.view.tension_scale import scale_end, tension_colour

RIGID_COLOUR = (0.40, 0.50, 0.62, 0.20)
"""Red, green, blue, opacity of the rigid arm."""
PATH_COLOUR = 0x1A1A1A
"""Near black of the path: none of the colours of wrinkling and tensions."""
FORCE_COLOUR = 0x009E73
"""Green of the forces."""
CONTACT_COLOUR = 0x6633F2
"""Violet of the points where a robot touches something, and of the forces there."""
CAPSULE_COLOUR = (0.40, 0.20, 0.95, 0.12)
"""Red, green, blue, opacity of the capsules of a robot, which are what touches obstacles."""
OBSTACLE_COLOUR = (0.40, 0.80, 0.80, 0.30)
"""Red, green, blue, opacity of obstacles, as of glass."""
FLOOR_COLOUR = 0xB8C0C8
"""Light grey of the lines on the floor."""
TUBE_COLOUR = (0.85, 0.74, 0.50, 0.32)
"""Red, green, blue, opacity of the tube, through which the chain is seen."""
LINE_COLOUR = (0.00, 0.45, 0.70, 1.0)
"""Blue of lines that are only drawn, as the actuator of a helix."""
TAIL_COLOUR = (0.25, 0.25, 0.28, 0.8)
"""Dark grey of the wall inside a growing tube."""

DOT_SIZE = 0.011
"""Size of the dots of a path, relative to the size of the robot."""
ARROW_LENGTH = 0.2
"""Length of the arrow of the unit force, relative to the size of the robot; other arrows are in proportion."""
ARROW_WIDTH = 0.009
"""Radius of the shaft of an arrow, relative to the size of the robot; its head is 2.5 times as wide and 7 times as long."""
CONTACT_SIZE = 0.014
"""Radius of the ball at a contact, relative to the size of the robot."""

Colour = tuple[float, ...] | int
"""Red, green, blue and perhaps opacity in [0, 1], or a number as in HTML."""


def rgb(colour: Colour) -> tuple[int, int, int]:
    """Return red, green and blue of a colour, each from 0 to 255."""
    if isinstance(colour, int):
        return colour >> 16 & 255, colour >> 8 & 255, colour & 255
    red, green, blue = (round(255 * share) for share in colour[:3])
    return red, green, blue


class BodyPart(NamedTuple):
    """A tube, an actuator or a line of a continuous body."""

    path: str
    """A name that is unique in the robot, with slashes; parts of one path have as many corners in every shape of the robot."""
    colour: tuple[float, float, float, float]
    """Red, green, blue, opacity."""
    surface: Callable[[], tuple[FloatArray, FloatArray]]
    """Returns corners and triangles, as `SegmentBody.surface`."""


def body_parts(
    scene: Scene, end: float | None = None, segments: Sequence[SegmentBody] | None = None, sides: int = 24
) -> Iterator[BodyPart]:
    """Yield the parts of the body of a scene.

    Args:
        scene: The scene.
        end: End of the scale of tensions [N]; that of the scene by default.
        segments: Segments that are drawn in place of those of the scene.
        sides: Corners of the cross-section of the body; actuators and lines have six.
    """
    for segment in scene.segments if segments is None else segments:
        yield BodyPart(f"segment_{segment.number}/tube", TUBE_COLOUR, partial(segment.surface, sides))
        for name, points in segment.lines.items():
            surface = partial(tube, segment.poses[:, :3, :3], points, THREAD * segment.radius, 6)
            yield BodyPart(f"segment_{segment.number}/lines/{name}", LINE_COLOUR, surface)
    end = shared_scale([scene]) if end is None else end
    for curve, tension, slack in scene.actuators:
        path = f"actuators/{curve.name}{'/slack' * slack}"
        yield BodyPart(path, tension_colour(tension, end), curve.dashed_surface if slack else curve.surface)


def shared_scale(scenes: Iterable[Scene]) -> float:
    """Return the end of the scale of tensions of some scenes [N]."""
    return scale_end(actuator.tension for scene in scenes for actuator in scene.actuators)
