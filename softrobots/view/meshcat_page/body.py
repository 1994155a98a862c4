"""The continuous body of a robot on a meshcat page: smooth tubes with their muscles."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from softrobots.view.body import SegmentBody, tube
from softrobots.view.meshcat_page.shapes import material
from softrobots.view.scene import Scene

TUBE_COLOUR = (0.85, 0.74, 0.50, 0.32)
"""Red, green, blue, opacity of the tube, through which the chain is seen."""
PULL_COLOUR = (0.00, 0.45, 0.70)
"""Blue of muscles that pull."""
PUSH_COLOUR = (0.90, 0.45, 0.00)
"""Orange of muscles that push; the two differ in lightness too."""

TAIL_COLOUR = (0.25, 0.25, 0.28, 0.8)
"""Dark grey of the wall inside a growing tube."""

_TAIL = 0.28  # radius of that wall, of the radius of the body
_MARKS = 24  # marks on the whole wall
_MUSCLE_RADIUS = 0.09  # of the radius of the body


class BodyDrawing:
    """The tubes and muscles under one node of a page."""

    def __init__(self, root: Any) -> None:
        """Draw under `root`."""
        self._root = root
        self.entries: dict[str, tuple[float, ...]] = {}
        """Colour of what is drawn by meaning, for the legend."""

    def draw(self, scene: Scene) -> None:
        """Replace the body; a scene without segments has none."""
        self._clear()
        self._draw(self._root["now"], scene.segments, scene.pushing)

    def animate(self, animation: Any, scenes: Mapping[int, Scene]) -> None:
        """Draw the body of every scene and let an animation show one after the other: meshcat can switch visibility, not bend.

        The tip of a growing tube is drawn round, and the wall that has not everted yet as a dark string inside.

        Args:
            animation: A meshcat animation.
            scenes: Scenes by number of frame.
        """
        self._clear()
        numbers = sorted(scenes)
        for place, number in enumerate(numbers):
            node = self._root[f"frame_{place}"]
            if place > 0:  # hidden before its shapes arrive, or they flash. A saved page starts to play before it sets
                node.set_property("visible", False)  # properties: the first body must not be made visible after that
            scene = scenes[number]
            if scene.grown is None:
                self._draw(node, scene.segments, scene.pushing, 16)
            else:
                short = [segment.thinned(0.1 * segment.radius) for segment in scene.segments]
                self._draw(node, short, scene.pushing, 14)
                self._draw_eversion(node, short[-1], scene.grown)
            # All tracks last as long as the animation: meshcat restarts a shorter one when the time is set beyond its end.
            # Bodies change half a frame early: the chain inside, which moves in between, is never far from them.
            last = place == len(numbers) - 1
            begin, end = number - 0.5 * (place > 0), numbers[-1] + 1 if last else numbers[place + 1] - 0.5
            for when in sorted({numbers[0], begin, min(end, numbers[-1]), numbers[-1]}):
                animation.at_frame(node, when).set_property("visible", "boolean", begin <= when < end)

    def _clear(self) -> None:
        self._root.delete()
        self.entries = {}

    def _draw(self, node: Any, segments: Sequence[SegmentBody], pushing: Collection[str], sides: int = 24) -> None:
        for segment in segments:
            self.entries["body"] = TUBE_COLOUR
            at = node[f"segment_{segment.number}"]
            at["tube"].set_object(_mesh(*segment.surface(sides)), material(TUBE_COLOUR))
            for name in segment.muscles:
                colour = PUSH_COLOUR if name in pushing else PULL_COLOUR
                self.entries["muscle that pushes" if name in pushing else "muscle that pulls"] = colour
                self._draw_line(at["lines"][name], segment, name, colour)
            for name in segment.lines:
                self.entries[name] = PULL_COLOUR
                self._draw_line(at["lines"][name], segment, name, PULL_COLOUR)

    def _draw_line(self, node: Any, segment: SegmentBody, name: str, colour: tuple[float, ...]) -> None:
        node.set_object(_mesh(*segment.muscle_surface(name, _MUSCLE_RADIUS * segment.radius, 6)), material((*colour, 1.0)))

    def _draw_eversion(self, node: Any, segment: SegmentBody, share: float) -> None:
        """The round tip, and the wall inside, which moves at twice the speed of the tip, with marks on it."""
        node["dome"].set_object(_mesh(*segment.dome()), material(TUBE_COLOUR))
        if share >= 1.0:
            return
        self.entries["wall that has not come out"] = TAIL_COLOUR
        points = segment.backbone
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
        grown = float(along[-1])
        tail = tube(segment.poses[:, :3, :3], points, _TAIL * segment.radius, 8)
        node["tail"].set_object(_mesh(*tail), material(TAIL_COLOUR))
        for mark in range(1, _MARKS + 1):
            place = (2.0 - mark / _MARKS / max(share, 1e-6)) * grown
            if 0.0 < place < grown:
                at = int(np.searchsorted(along, place))
                rows = [max(at - 1, 0), min(at, len(points) - 1)]
                ring = tube(segment.poses[rows, :3, :3], points[rows], 1.6 * _TAIL * segment.radius, 8)
                node[f"mark_{mark}"].set_object(_mesh(*ring), material(TAIL_COLOUR))


def _mesh(points: Any, triangles: Any) -> Any:
    import meshcat.geometry as geometry

    return geometry.TriangularMeshGeometry(points.astype(np.float32), triangles.astype(np.uint32))
