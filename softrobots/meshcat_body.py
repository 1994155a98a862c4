"""The continuous body of a robot in the browser view: smooth tubes with their muscles, in meshcat's terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.body import SegmentBody
from softrobots.meshcat_shapes import material

TUBE_COLOUR = (0.85, 0.74, 0.50, 0.32)
"""Red, green, blue, opacity of the tube; the chain inside shows through."""
PULL_COLOUR = (0.00, 0.45, 0.70)
"""Blue of muscles that pull."""
PUSH_COLOUR = (0.90, 0.45, 0.00)
"""Orange of muscles that push; the two differ in lightness too."""

_MUSCLE_RADIUS = 0.09  # of the radius of the body


class BodyDrawing:
    """The tubes and muscles under one node of a meshcat page."""

    def __init__(self, root: Any) -> None:
        """Draw under `root`."""
        self._root = root
        self.entries: dict[str, tuple[float, ...]] = {}
        """What is drawn, for the legend: colour by meaning."""

    def draw(self, segments: Sequence[SegmentBody], tensions: dict[str, float]) -> None:
        """Replace what is drawn.

        Args:
            segments: The body.
            tensions: Tension by muscle name [N]; muscles without are drawn as if they pulled.
        """
        self.clear()
        self._draw(self._root["now"], segments, tensions)

    def clear(self) -> None:
        """Remove the body."""
        self._root.delete()
        self.entries = {}

    def animate(self, animation: Any, frames: Mapping[int, tuple[Sequence[SegmentBody], dict[str, float]]]) -> None:
        """Draw one body a frame and let an animation show them in turn: meshcat can switch visibility, but bend nothing.

        Args:
            animation: A meshcat animation.
            frames: Body and tensions by number of frame.
        """
        self.clear()
        numbers = sorted(frames)
        for place, number in enumerate(numbers):
            node = self._root[f"frame_{place}"]
            if place > 0:  # before its shapes arrive, or they flash. A saved page starts to play before it sets properties: the
                node.set_property("visible", False)  # first body, which is visible anyway, must not be told so again then
            self._draw(node, *frames[number])
            # All tracks last as long as the animation: meshcat starts a shorter one anew when it is sought beyond its end.
            for when in sorted({numbers[0], number, numbers[min(place + 1, len(numbers) - 1)], numbers[-1]}):
                shown = when == number
                animation.at_frame(node, when).set_property("visible", "boolean", shown)

    def _draw(self, node: Any, segments: Sequence[SegmentBody], tensions: dict[str, float]) -> None:
        for segment in segments:
            self.entries["body"] = TUBE_COLOUR
            at = node[f"segment_{segment.number}"]
            at["tube"].set_object(_mesh(*segment.surface()), material(TUBE_COLOUR))
            for name in segment.muscles:
                pushes = tensions.get(name, 0.0) < 0.0
                colour = PUSH_COLOUR if pushes else PULL_COLOUR
                self.entries["muscle that pushes" if pushes else "muscle that pulls"] = colour
                tube = segment.muscle_surface(name, _MUSCLE_RADIUS * segment.radius)
                at[name].set_object(_mesh(*tube), material((*colour, 1.0)))


def _mesh(points: Any, triangles: Any) -> Any:
    import meshcat.geometry as geometry

    return geometry.TriangularMeshGeometry(points.astype(np.float32), triangles.astype(np.uint32))
