"""The robot in the browser: meshcat on loopback, and self-contained HTML files."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_integer
from softrobots.core.errors import ParameterError, ViewerError
from softrobots.core.files import new_file
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.vibration import ModeSwing
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.robots import HelixTube
from softrobots.statics.equilibrium import Equilibrium, check_same_model
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.view.animation_frames import Movement, playing_time
from softrobots.view.camera import narrowest
from softrobots.view.meshcat_page.page_text import InlinePage, legend_rows, live_page, page_text
from softrobots.view.meshcat_page.robot import RobotDrawing
from softrobots.view.meshcat_page.server import ServerProcess, connect, send_html
from softrobots.view.meshcat_page.stage import Stage
from softrobots.view.scene import SceneBuilder
from softrobots.view.served_page import ServedPage

_REPETITIONS = 1000  # of an animation: meshcat mixes start and end when it is scrubbed after the last one


class Viewer(ServedPage):
    """A meshcat page that shows one robot; a context manager that ends its server.

    The deformed robot is opaque; the rigid one, with the same motors and relaxed springs, is translucent. Inflated links are
    coloured by the share of the wrinkling moment that is left. Segments with sections are drawn as smooth translucent tubes,
    with the equivalent chain inside, and actuators along their routes (blue pulls, orange pushes, grey is zero, dashed is
    slack). As the last expression of a cell of a notebook it is shown there, as it is at that moment.
    """

    def __init__(self, model: SoftModel, *, port: int | None = None) -> None:
        """Start a server on loopback and draw the robot at rest.

        Args:
            model: The robot.
            port: Port of the page; by default the first free one from 7000.

        Raises:
            ParameterError: If it is no model or no port.
            ViewerError: If the server does not start, e.g. on a port that is taken, or a shape cannot be drawn.
        """
        self._model = check_model(model)
        self._scenes = SceneBuilder(model)
        self._server = ServerProcess(None if port is None else positive_integer("port", port, 65535))
        self._url = self._server.web_url
        try:
            self._page = connect(self._server.zmq_url, self._url)
            root = self._page["softrobots"]
            self._robot = RobotDrawing(root, self._scenes.robot, self._scenes.relaxed(), self._scenes.extent.size)
            extent = self._scenes.extent
            self._stage = Stage(self._page, root, extent)
            upright = np.hypot(*(extent.tip - extent.base)[:2]) < 0.1 * extent.size
            self.look_at(extent.tip + extent.size * np.array([0.3 if upright else -0.1, 0.0, 0.0 if upright else 0.2]))
            send_html(self._page, "page", live_page(model.pinocchio.name))
            self._legend = ""
            self._show_legend()
        except BaseException:
            self.close()
            raise

    @property
    def serving(self) -> bool:
        """Whether the server runs."""
        return self._server.running

    def show(self, equilibrium: Equilibrium) -> None:
        """Show a loaded robot: deformed and rigid, its forces as arrows, its links coloured.

        Args:
            equilibrium: An equilibrium of the viewer's robot.

        Raises:
            ParameterError: If it belongs to another robot.
            ViewerError: If the viewer is closed.
        """
        check_same_model(self._model, equilibrium)
        self._check_open()
        self._robot.show(self._scenes.loaded(equilibrium))
        self._show_legend()

    def trace(self, points: Any) -> None:
        """Draw a path as dots.

        Args:
            points: Positions, shape (n, 3) [m].

        Raises:
            ParameterError: If the shape differs or a number is not finite.
            ViewerError: If the viewer is closed.
        """
        self._check_open()
        self._robot.trace(finite_array("points", points, (None, 3), "m"))
        self._show_legend()

    def mark(self, target: Any) -> None:
        """Draw a cross at a target, and remove the last one.

        Args:
            target: Position, shape (3,) [m]; None: no cross.

        Raises:
            ParameterError: If the shape differs or a number is not finite.
            ViewerError: If the viewer is closed.
        """
        self._check_open()
        self._robot.mark(None if target is None else finite_array("target", target, (3,), "m"))
        self._show_legend()

    def animate(
        self,
        movement: Movement,
        *,
        duration: float | None = None,
        speed: float | None = None,
    ) -> None:
        """Play a trajectory, a path in contact or a motion as a meshcat animation that starts by itself and can be scrubbed.

        Path and forces are included. Links of a motion are coloured by the moments of their springs, and axial forces without
        inertia.

        Args:
            movement: A trajectory, a path in contact, a motion, or the swing of a mode (`VibrationModes.swing`) of the viewer's
                robot.
            duration: Time of the animation [s]; real time by default, 2 s for a mode, 6 s for a path in contact.
            speed: How fast it is played, relative to real time [-], e.g. 0.1; in place of `duration`.

        Raises:
            ParameterError: If it belongs to another robot, duration or speed is not positive, both are given, or a speed for
                a path in contact.
        """
        seconds = playing_time(self._model, movement, duration, speed)
        self._check_open()
        scenes = self._scenes.movement(movement, seconds)
        path = movement.tip_position if isinstance(movement, Motion | ModeSwing) else movement.tip_positions
        self._robot.show(next(iter(scenes.values())))
        self._robot.trace(path)
        self._page.set_animation(self._robot.animate(scenes), play=True, repetitions=_REPETITIONS)
        self.look_at(path.mean(axis=0))
        self._show_legend()

    def animate_growth(self, tube: HelixTube, *, duration: float = 8.0) -> None:
        """Play the growth of a helical tube: it everts at its tip, and the helix forms behind the tip.

        Wall that has come out stays where it is; the rest waits inside (dark) and comes forward at twice the speed of the tip.
        The helix forms over three diameters behind the tip; in the last quarter of the time the whole tube is shown.

        Args:
            tube: The tube that the viewer's model was made of, with chain="sections".
            duration: Time of the animation [s].

        Raises:
            ParameterError: If the tube is not that of the viewer's model, or an argument is out of range.
            ViewerError: If the viewer is closed.
        """
        self._check_open()
        if not isinstance(tube, HelixTube) or tube.urdf() != self._model.urdf:
            raise ParameterError("tube", tube, "the HelixTube that the viewer's model was loaded from")
        scenes = self._scenes.growth(tube, duration)
        whole = self._scenes.relaxed()
        self._robot.show(dataclasses.replace(scenes[0], deformed=whole.deformed, segments=()))
        self._page.set_animation(self._robot.animate(scenes), play=True, repetitions=_REPETITIONS)
        backbone = np.concatenate([segment.backbone for segment in whole.segments])
        self.look_at(backbone.max(axis=0) + backbone.min(axis=0))
        self._show_legend()

    def look_at(self, tip: FloatArray) -> None:
        """Look at all that is drawn, square to the line from the base to the tip and a little from above.

        The base is the world's origin, unless the chain starts farther from it than it is long. The whole robot is in every
        window, in all of an animation.

        Args:
            tip: Position of the tip, or its average, shape (3,) [m].

        Raises:
            ParameterError: If the shape differs or a number is not finite.
        """
        points = self._scenes.corners(self._robot.scenes)
        eye, centre = self._scenes.extent.camera(finite_array("tip", tip, (3,), "m"), points)
        self._stage.look_from(eye, centre, narrowest(points, eye, centre))

    def look_from(self, eye: Any, centre: Any) -> None:
        """Place the camera.

        Args:
            eye: Position of the camera, shape (3,) [m], world axes.
            centre: Point that it looks at, shape (3,) [m], world axes.

        Raises:
            ParameterError: If a shape differs, a number is not finite, or both are the same point.
        """
        self._stage.look_from(eye, centre)

    def html(self, title: str = "softrobots") -> str:
        """Return the page as one self-contained HTML text that works offline, with its animation.

        Args:
            title: Title of the page.

        Raises:
            ViewerError: If the viewer is closed.
        """
        self._check_open()
        return page_text(self._page.static_html(), title, self._robot.legend())

    def write_html(self, path: str | Path, *, title: str = "softrobots", overwrite: bool = False) -> Path:
        """Write `html` to a file, and return its path.

        Raises:
            OutputExists: If the file exists and `overwrite` is false.
        """
        new_file(path, overwrite=overwrite)  # refused before the work
        return self.inline(title=title).write_html(path, overwrite=overwrite)

    def inline(self, height: int = 480, *, title: str = "softrobots") -> InlinePage:
        """Return the page as it is now for a cell of a notebook, where it remains when the viewer is closed.

        Args:
            height: Height in the notebook [px].
            title: Title of the page.

        Raises:
            ParameterError: If the height is no positive integer, at most 10000.
            ViewerError: If the viewer is closed.
        """
        return InlinePage(self.html(title), positive_integer("height", height, 10_000))

    def _repr_html_(self) -> str:
        """Return the page for Jupyter; see `inline`."""
        return self.inline()._repr_html_()

    def close(self) -> None:
        """End the server; the page stays as it is in browsers that show it."""
        page = getattr(self, "_page", None)
        if page is not None:
            page.window.zmq_socket.close(linger=0)
        self._server.end()

    def _show_legend(self) -> None:
        """Update the legend of the served page."""
        rows = legend_rows(self._robot.legend())
        if rows != self._legend:
            send_html(self._page, "legend", rows)
            self._legend = rows

    def _check_open(self) -> None:
        if not self.serving:
            raise ViewerError("the viewer is closed, or its server has ended; open a new one")


def view(model: SoftModel, result: Equilibrium | IkSolution | Movement | None = None, *, port: int | None = None) -> Viewer:
    """Open a viewer and show a result in it.

    Args:
        model: The robot.
        result: An equilibrium to show, a solution of the inverse kinematics to show with its target, or a trajectory, path in
            contact or motion to play; the robot at rest by default.
        port: Port of the page; by default the first free one from 7000.

    Returns:
        The viewer; print its `url` and `tunnel`, and `close` it at the end (or use it in a `with` statement).

    Raises:
        ParameterError: If the result is something else or belongs to another robot, or it is no port.
        ViewerError: If the server does not start.
    """
    viewer = Viewer(model, port=port)
    try:
        if isinstance(result, Movement):
            viewer.animate(result)
        elif result is not None:
            shown = result.equilibrium if isinstance(result, IkSolution) else result
            viewer.show(shown)
            viewer.look_at(shown.tip_position)
            if isinstance(result, IkSolution):
                viewer.mark(result.target)
    except BaseException:
        viewer.close()
        raise
    return viewer
