"""What surrounds a robot on a meshcat page: background, floor and camera."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import finite_array
from softrobots.core.errors import ParameterError
from softrobots.view.appearance import FLOOR_COLOUR
from softrobots.view.camera import WIDTH
from softrobots.view.scene import Extent


class Stage:
    """The surroundings of one robot. Meshcat's camera always looks at the origin, so the robot is moved there."""

    def __init__(self, page: Any, root: Any, extent: Extent) -> None:
        """Draw a white background and the floor; `look_from` places the camera.

        Args:
            page: The meshcat page.
            root: Its node that holds everything of the robot.
            extent: Size and place of the robot at rest.
        """
        import meshcat.geometry as geometry

        self._page, self._root = page, root
        page["/Background"].set_property("top_color", [1.0, 1.0, 1.0])
        page["/Background"].set_property("bottom_color", [0.90, 0.92, 0.94])
        page["/Axes"].set_property("visible", False)
        page["/Grid"].set_property("visible", False)
        lines = geometry.PointsGeometry(extent.floor().T.astype(np.float32))
        self._root["floor"].set_object(geometry.LineSegments(lines, geometry.LineBasicMaterial(color=FLOOR_COLOUR)))

    def look_from(self, eye: Any, centre: Any, narrowest: float = WIDTH) -> None:
        """See `softrobots.view.viewer.Viewer.look_from`; `narrowest` is that of `softrobots.view.camera`.

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
        camera = self._page["/Cameras/default/rotated/<object>"]
        camera.set_property("position", [x, z, -y])
        camera.set_property("narrowest", narrowest)  # read by `fit.js`
