"""The continuous body of a robot on a meshcat page: smooth tubes with their actuators."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from softrobots.view.appearance import TAIL_COLOUR, TUBE_COLOUR, BodyPart, body_parts, shared_scale
from softrobots.view.body import SegmentBody, tube
from softrobots.view.meshcat_page.shapes import material
from softrobots.view.scene import Scene

_TAIL = 0.28  # radius of that wall, of the radius of the body
_MARKS = 24  # marks on the whole wall


class BodyDrawing:
    """The tubes and actuators under one node of a page."""

    def __init__(self, root: Any) -> None:
        """Draw under `root`."""
        self._root = root

    def draw(self, scene: Scene) -> None:
        """Replace the body; a scene without segments has none."""
        self._root.delete()
        _draw(self._root["now"], body_parts(scene))

    def animate(self, animation: Any, scenes: Mapping[int, Scene]) -> None:
        """Draw the body of every scene and let an animation show one after the other: meshcat can switch visibility, not bend.

        The tip of a growing tube is drawn round, and the wall that has not everted yet as a dark string inside. The scenes are
        given by number of frame.
        """
        self._root.delete()
        numbers, end = sorted(scenes), shared_scale(scenes.values())
        for place, number in enumerate(numbers):
            node = self._root[f"frame_{place}"]
            if place > 0:  # hidden before its shapes arrive, or they flash. A saved page starts to play before it sets
                node.set_property("visible", False)  # properties: the first body must not be made visible after that
            scene = scenes[number]
            if scene.grown is None:
                _draw(node, body_parts(scene, end, sides=16))
            else:
                short = [segment.thinned(0.1 * segment.radius) for segment in scene.segments]
                _draw(node, body_parts(scene, end, short, 14))
                _draw_eversion(node, short[-1], scene.grown)
            # All tracks last as long as the animation: meshcat restarts a shorter one when the time is set beyond its end.
            # Bodies change half a frame early: the chain inside, which moves in between, is never far from them.
            last = place == len(numbers) - 1
            begin, end = number - 0.5 * (place > 0), numbers[-1] + 1 if last else numbers[place + 1] - 0.5
            for when in sorted({numbers[0], begin, min(end, numbers[-1]), numbers[-1]}):
                animation.at_frame(node, when).set_property("visible", "boolean", begin <= when < end)


def _draw(node: Any, parts: Iterable[BodyPart]) -> None:
    for part in parts:
        node[part.path].set_object(_mesh(*part.surface()), material(part.colour))


def _draw_eversion(node: Any, segment: SegmentBody, share: float) -> None:
    """The round tip, and the wall inside, which moves at twice the speed of the tip, with marks on it."""
    node["dome"].set_object(_mesh(*segment.dome()), material(TUBE_COLOUR))
    if share >= 1.0:
        return
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
