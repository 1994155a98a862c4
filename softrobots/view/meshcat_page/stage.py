"""What is around a robot in the browser view: background, floor and camera, in meshcat's terms."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.kinematics import backbone, frame_placement
from softrobots.view.meshcat_page.shapes import floor_lines


class Stage:
    """The surroundings of one robot. Meshcat's camera looks at the origin, so the scene moves."""

    def __init__(self, page: Any, root: Any, model: SoftModel) -> None:
        """Prepare the page of a robot.

        Args:
            page: The meshcat page.
            root: Its node that everything of ours is under.
            model: The robot.
        """
        self._page, self._root, self._model = page, root, model
        self._start, self.size = _extent(model)
        """`size` is the scale of the picture [m], the reach of a robot that is straight at rest."""

    def prepare(self, ground: float | None) -> None:
        """White background, floor at a height [m] (a little below the origin if there is none), and the camera."""
        import meshcat.geometry as geometry

        size, model = self.size, self._model
        self._page["/Background"].set_property("top_color", [1.0, 1.0, 1.0])
        self._page["/Background"].set_property("bottom_color", [0.90, 0.92, 0.94])
        self._page["/Axes"].set_property("visible", False)
        self._page["/Grid"].set_property("visible", False)
        tip = np.array(frame_placement(model, model.configuration(model.relaxed_motors), model.tip).translation)
        upright = np.hypot(*(tip - self._start)[:2]) < 0.1 * size
        self.look_at(tip + [0.3 * size if upright else -0.1 * size, 0.0, 0.0 if upright else 0.2 * size])
        along = floor_lines(size, -0.15 * size if ground is None else ground)
        ends = np.concatenate([along, along[:, [1, 0, 2]]])
        lines = geometry.PointsGeometry(ends.T.astype(np.float32))
        self._root["floor"].set_object(geometry.LineSegments(lines, geometry.LineBasicMaterial(color=0xB8C0C8)))

    def look_at(self, tip: FloatArray) -> None:
        """See `softrobots.view.viewer.Viewer.look_at`."""
        along, middle = tip - self._start, 0.5 * (self._start + tip)
        azimuth = np.arctan2(along[1], along[0]) - np.deg2rad(78.0)
        size = max(self.size, 0.95 * float(np.linalg.norm(along)))  # a robot that is bent at rest may be stretched out here
        away = 0.94 * size * np.array([0.92 * np.cos(azimuth), 0.92 * np.sin(azimuth), 0.39])
        self.look_from(middle + away, middle)

    def look_from(self, eye: Any, centre: Any) -> None:
        """See `softrobots.view.viewer.Viewer.look_from`.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or both are the same point.
        """
        middle = finite_array("centre", centre, (3,), "m")
        away = finite_array("eye", eye, (3,), "m") - middle
        if not away.any():
            raise ParameterError("eye", eye, "another point than the centre")
        shift = np.eye(4)
        shift[:3, 3] = -middle
        self._root.set_transform(shift)
        x, y, z = away.tolist()
        # meshcat's camera has y up: (x, z, -y) of the scene.
        self._page["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])


def _extent(model: SoftModel) -> tuple[FloatArray, float]:
    """Where the camera takes the base to be, shape (3,) [m], and the largest distance of the chain from its start at rest [m].

    The distance is the scale of the picture; of a straight robot it is its reach.
    """
    points = backbone(model, model.configuration(model.relaxed_motors))
    size = max(float(np.linalg.norm(points - points[0], axis=1).max()), 0.05 * model.reach)
    return points[0] if float(np.linalg.norm(points[0])) > size else np.zeros(3), size
