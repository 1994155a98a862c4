"""A viser scene that takes the calls of a meshcat page.

`ViserTree` records objects, transforms and visibility by path, and the camera. `commit` compares them with what viser shows and
sends the difference: a tube that bends is a change of corners, not a new tube.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.view.viser_page.shapes import Drawn, drawn_of

_CAMERA = "/Cameras/default/rotated/<object>"  # path of the camera on a meshcat page

_AMBIENT, _SUN = 2.2, 2.0  # strength of the light from everywhere and from above


@dataclass
class _Wanted:
    """The recorded state of a path."""

    drawn: Drawn | None = None
    transform: FloatArray = field(default_factory=lambda: np.eye(4))
    visible: bool = True


@dataclass
class _Shown:
    """The state of a path that viser shows."""

    handle: Any
    drawn: Drawn
    pose: FloatArray


class ViserTree:
    """Objects by path, as on a meshcat page; for one thread at a time."""

    def __init__(self, server: Any) -> None:
        """Show on a `viser.ViserServer`."""
        self._server = server
        self.wanted: dict[str, _Wanted] = {}
        """The recorded state by path."""
        self._shown: dict[str, _Shown] = {}
        # Viser's default light is a photograph; under even light colours look like those of the legend.
        scene = server.scene
        scene.configure_environment_map(None)
        scene.configure_default_lights(False)
        scene.add_light_ambient("/light/ambient", intensity=_AMBIENT)
        scene.add_light_directional("/light/sun", intensity=_SUN, position=(-0.3, -0.6, 1.0))

    def __getitem__(self, path: str) -> ViserNode:
        """Node at a path."""
        return ViserNode(self, path)

    def look_from(self, eye: FloatArray) -> None:
        """Place the camera of browsers that connect later at a point, shape (3,) [m], looking at the origin."""
        self._server.initial_camera.position = eye
        self._server.initial_camera.look_at = np.zeros(3)

    def commit(self) -> None:
        """Send all changes since the last call in one message."""
        places: dict[str, tuple[FloatArray, bool]] = {"": (np.eye(4), True)}
        with self._server.atomic():
            for path in [path for path in self._shown if path not in self.wanted]:
                self._shown.pop(path).handle.remove()
            for path, wanted in self.wanted.items():
                if wanted.drawn is not None:
                    self._show(path, wanted.drawn, *self._place(path, places))

    def _place(self, path: str, places: dict[str, tuple[FloatArray, bool]]) -> tuple[FloatArray, bool]:
        """World pose and visibility of a path, with those of all nodes above it."""
        if path not in places:
            pose, visible = self._place(path.rpartition("/")[0], places)
            wanted = self.wanted.get(path)
            places[path] = (pose, visible) if wanted is None else (pose @ wanted.transform, visible and wanted.visible)
        return places[path]

    def _show(self, path: str, drawn: Drawn, pose: FloatArray, visible: bool) -> None:
        shown = self._shown.get(path)
        if shown is not None and not shown.drawn.becomes(drawn):
            self._shown.pop(path).handle.remove()
            shown = None
        if shown is None:
            if visible:  # an object that is never visible is never sent
                handle = drawn.add(self._server.scene, f"/{path}", wxyz=_quaternion(pose), position=pose[:3, 3])
                self._shown[path] = _Shown(handle, drawn, pose)
            return
        shown.handle.visible = visible
        if visible:
            if shown.drawn is not drawn:
                drawn.change(shown.handle)
                shown.drawn = drawn
            if not np.array_equal(shown.pose, pose):
                shown.handle.wxyz, shown.handle.position = _quaternion(pose), pose[:3, 3]
                shown.pose = pose


class ViserNode:
    """A node of a tree, with the methods of a `meshcat.Visualizer` that drawings use."""

    def __init__(self, tree: ViserTree, path: str) -> None:
        """Stand for a path, e.g. "softrobots/deformed/link_1"."""
        self._tree, self._path = tree, path

    def __getitem__(self, path: str) -> ViserNode:
        """Node at a path below."""
        return ViserNode(self._tree, f"{self._path}/{path}")

    def set_object(self, meshcat_object: Any, material: Any = None) -> None:
        """Put an object there.

        Args:
            meshcat_object: A geometry, or points or lines with their material, of `meshcat.geometry`.
            material: Material of the geometry.

        Raises:
            ViewerError: If it is something else.
        """
        self._own().drawn = drawn_of(meshcat_object, material)

    def set_transform(self, matrix: FloatArray) -> None:
        """Put everything there at a pose, shape (4, 4) [m], in the axes of the node above."""
        self._own().transform = np.array(matrix)

    def set_property(self, name: str, value: Any) -> None:
        """Show or hide everything there, or place the camera; other properties of meshcat are ignored.

        Args:
            name: "visible", or "position" of the camera.
            value: Whether it can be seen; or where the camera is, with y up, shape (3,) [m].
        """
        if self._path == _CAMERA and name == "position":
            x, z, y = value
            self._tree.look_from(np.array([x, -y, z]))
        elif name == "visible" and not self._path.startswith("/"):
            self._own().visible = bool(value)

    def delete(self) -> None:
        """Remove everything there."""
        below = f"{self._path}/"
        for path in [path for path in self._tree.wanted if path == self._path or path.startswith(below)]:
            del self._tree.wanted[path]

    def _own(self) -> _Wanted:
        return self._tree.wanted.setdefault(self._path, _Wanted())


def _quaternion(pose: FloatArray) -> FloatArray:
    """Rotation of a pose as viser takes it: w, x, y, z."""
    x, y, z, w = pin.Quaternion(pose[:3, :3]).coeffs().tolist()
    return np.array([w, x, y, z])
