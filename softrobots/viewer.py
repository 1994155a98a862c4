"""The robot in the browser: meshcat on loopback, and self-contained HTML files."""

from __future__ import annotations

import contextlib
import socket
import time
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from softrobots.animation_frames import FRAME_RATE, Frame, even_frames, growth_frames, waypoint_frames
from softrobots.body import body, body_at
from softrobots.checks import FloatArray, finite_array, positive_integer, positive_number
from softrobots.equilibrium import Equilibrium, check_same_model
from softrobots.errors import ParameterError, ViewerError
from softrobots.files import new_file, write_text
from softrobots.kinematics import backbone, frame_placement
from softrobots.meshcat_arrows import ArrowDrawing
from softrobots.meshcat_body import BodyDrawing
from softrobots.meshcat_chain import ChainDrawing
from softrobots.meshcat_server import connect, end_server, start_server
from softrobots.meshcat_shapes import (
    FORCE_COLOUR,
    PATH_COLOUR,
    RIGID_COLOUR,
    floor_lines,
    with_legend,
    wrinkling_rows,
)
from softrobots.model import SoftModel, check_model
from softrobots.robots import HelixTube
from softrobots.scene import Scene, wrinkling_level
from softrobots.trajectory import Trajectory


class Viewer:
    """A meshcat page that shows one robot; a context manager that ends its server.

    The deformed robot is opaque; the rigid one, with the same motors and relaxed springs, is translucent. Inflated links are
    coloured by the share of the wrinkling moment that is left. Segments with sections are drawn as smooth translucent tubes,
    with their muscles (blue pulls, orange pushes) and the equivalent chain inside.
    """

    def __init__(self, model: SoftModel) -> None:
        """Start a server on the first free loopback port from 7000 and draw the robot at rest.

        Args:
            model: The robot.

        Raises:
            ViewerError: If the server does not start or the robot has shapes that cannot be drawn.
        """
        self._model = check_model(model)
        scene = Scene(model)
        self._server, zmq_url, self._url = start_server()
        try:
            self._page = connect(zmq_url, self._url)
            self._root = self._page["softrobots"]
            self._start, self._size = _extent(model)
            self._arrows = ArrowDrawing(self._root["load"], self._size)
            self._ghost = _ghost(model)
            self._loaded = self._traced = False
            self._segments = bool(model.structure.section_table)
            self._chain = ChainDrawing(self._root, model, scene)
            self._body = BodyDrawing(self._root["body"])
            ground = scene.ground()
            self._prepare(-0.15 * self._size if ground is None else ground)
            self.show_configuration(model.configuration(model.relaxed_motors))
            self._body.draw(body_at(model, model.relaxed_motors, model.rest), {})
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Viewer:
        """Return the viewer."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End the server."""
        self.close()

    @property
    def url(self) -> str:
        """Address of the page; reachable from this machine only."""
        return self._url

    @property
    def port(self) -> int:
        """The port that is really used; 7000 if it was free."""
        return int(self._url.split(":")[2].split("/")[0])

    @property
    def tunnel(self) -> str:
        """Command to type on another machine to see the page there, at the same address."""
        return f"ssh -L {self.port}:127.0.0.1:{self.port} {socket.gethostname()}"

    def show(self, equilibrium: Equilibrium) -> None:
        """Show a loaded robot: deformed and rigid, its forces as arrows, its links coloured.

        Args:
            equilibrium: An equilibrium of the viewer's robot.

        Raises:
            ParameterError: If it belongs to another robot.
            ViewerError: If the viewer is closed.
        """
        self._check(equilibrium)
        self._chain.show_sections(True)
        self._chain.place(equilibrium.q, self._model.configuration(equilibrium.q_motors))
        self._chain.colour(_levels(equilibrium) or [])
        self._body.draw(body(equilibrium), _tensions(equilibrium))
        self._arrows.draw(equilibrium)
        self._ghost, self._loaded = _ghost(self._model), True

    def show_configuration(self, q: FloatArray) -> None:
        """Show the robot at a configuration of Pinocchio, shape (nq,), without load: no arrows, no wrinkling, the chain alone.

        Raises:
            ParameterError: If the shape differs or a number is not finite.
        """
        q = finite_array("q", q, (self._model.pinocchio.nq,))
        self._check_open()
        self._chain.show_sections(True)
        self._chain.place(q, q)
        self._chain.colour([0] * len(self._model.spring_groups))
        self._body.clear()
        self._arrows.clear()
        self._ghost, self._loaded = _ghost(self._model), False

    def trace(self, points: Any) -> None:
        """Draw a path as dots.

        Args:
            points: Positions, shape (n, 3) [m].

        Raises:
            ParameterError: If the shape differs or a number is not finite.
            ViewerError: If the viewer is closed.
        """
        import meshcat.geometry as geometry

        self._check_open()
        positions = finite_array("points", points, (None, 3), "m")
        rgb = np.array([PATH_COLOUR >> 16 & 255, PATH_COLOUR >> 8 & 255, PATH_COLOUR & 255]) / 255.0
        colours = np.tile(rgb[:, None], (1, len(positions)))
        cloud = geometry.PointCloud(positions.T.astype(np.float32), colours.astype(np.float32), size=0.012)
        self._root["path"].set_object(cloud)
        self._traced = True

    def animate(self, trajectory: Trajectory, *, duration: float | None = None, repetitions: int = 1000) -> None:
        """Play a trajectory as a meshcat animation, path and forces included; it starts by itself and can be scrubbed.

        Args:
            trajectory: A trajectory of the viewer's robot.
            duration: Time of the animation [s]; the time of the trajectory by default.
            repetitions: How often it plays. (At the end of the last one meshcat goes back to the start, and then mixes the two
                when the slider is moved; hence not once by default.)

        Raises:
            ParameterError: If it belongs to another robot, or the duration is not positive.
        """
        import meshcat.animation

        if not isinstance(trajectory, Trajectory):
            raise ParameterError("trajectory", trajectory, "a Trajectory")
        self._check(trajectory.equilibria[0])
        span = float(trajectory.times[-1] - trajectory.times[0])
        seconds = (span or 1.0) if duration is None else positive_number("duration", duration, "s")
        positive_integer("repetitions", repetitions)
        self.show(trajectory.equilibria[0])
        self.look_at(trajectory.tip_positions.mean(axis=0))
        self.trace(trajectory.tip_positions)
        animation = meshcat.animation.Animation(default_framerate=FRAME_RATE)
        frames = even_frames(trajectory, seconds) if self._segments else waypoint_frames(trajectory, seconds)
        for frame in frames:
            self._add_frame(animation, frame)
        if self._segments:
            self._body.animate(
                animation,
                {
                    frame.number: (body_at(self._model, frame.q_motors, frame.q_springs, 6), _tensions(frame.equilibrium))
                    for frame in frames
                },
            )
        self._page.set_animation(animation, play=True, repetitions=repetitions)

    def animate_growth(self, tube: HelixTube, *, duration: float = 8.0, front: float | None = None, hold: float = 0.25) -> None:
        """Play the growth of a helical tube: it everts at its tip, and the helix forms behind the tip.

        Wall that has come out stays where it is; the rest waits inside (dark) and comes forward at twice the speed of the tip.

        Args:
            tube: The tube that the viewer's model was made of, with chain="sections".
            duration: Time of the animation [s].
            front: Length of tube behind the tip over which the helix forms [m]; three diameters by default, 0: at the tip.
            hold: Share of the time at the end during which the whole tube is shown, in [0, 1).

        Raises:
            ParameterError: If the tube is not that of the viewer's model, or an argument is out of range.
            ViewerError: If the viewer is closed.
        """
        import meshcat.animation

        self._check_open()
        if not isinstance(tube, HelixTube) or tube.urdf() != self._model.urdf:
            raise ParameterError("tube", tube, "the HelixTube that the viewer's model was loaded from")
        frames = growth_frames(tube, duration, 3.0 * tube.diameter if front is None else front, hold)
        self.show_configuration(self._model.configuration((), self._model.rest))
        self._ghost = "the whole tube"
        self._chain.show_sections(False)  # the links of sections that have not come out would stick out of the tip
        whole = body_at(self._model, frames[-1].q_motors, self._model.rest)
        middle = np.concatenate([segment.backbone for segment in whole])
        self.look_at(middle.max(axis=0) + middle.min(axis=0))
        animation = meshcat.animation.Animation(default_framerate=FRAME_RATE)
        for frame in frames:
            self._add_frame(animation, frame)
        bodies = {f.number: (body_at(self._model, f.q_motors, f.q_springs, 3), _tensions(None)) for f in frames}
        self._body.animate(animation, bodies, everting={frame.number: frame.grown for frame in frames})
        self._page.set_animation(animation, play=True, repetitions=1000)

    def look_at(self, tip: FloatArray) -> None:
        """Put the middle between base and tip where the camera looks, and the camera square to the arm, a little above.

        The base is the world's origin, unless the chain starts farther from it than it is long.

        Args:
            tip: Where the tip is, or is on average, shape (3,) [m].
        """
        along, middle = tip - self._start, 0.5 * (self._start + tip)
        azimuth = np.arctan2(along[1], along[0]) - np.deg2rad(78.0)
        size = max(self._size, 0.95 * float(np.linalg.norm(along)))  # a robot that is bent at rest may be stretched out here
        away = 0.94 * size * np.array([0.92 * np.cos(azimuth), 0.92 * np.sin(azimuth), 0.39])
        self.look_from(middle + away, middle)

    def look_from(self, eye: Any, centre: Any) -> None:
        """Put the camera somewhere.

        Args:
            eye: Where the camera is, shape (3,) [m], world axes.
            centre: What it looks at, shape (3,) [m], world axes; not where it is.

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

    def html(self, title: str = "softrobots") -> str:
        """Return the page as one self-contained HTML text that works offline, with its animation.

        Args:
            title: Title of the page.

        Raises:
            ViewerError: If the viewer is closed.
        """
        self._check_open()
        return with_legend(self._page.static_html(), title, self._legend())

    def _legend(self) -> list[tuple[tuple[float, ...] | int, str]]:
        """Colour and meaning of what is drawn."""
        entries: list[tuple[tuple[float, ...] | int, str]] = [(RIGID_COLOUR, self._ghost)] * self._chain.has_rigid
        if self._segments and not self._model.spring_groups:
            entries += [(colour, "equivalent rigid chain") for colour in self._chain.section_colours[:1]]
        entries += [(colour, text) for text, colour in self._body.entries.items()]
        entries += [(PATH_COLOUR, "path of the tip")] * self._traced + [(FORCE_COLOUR, "force")] * bool(self._arrows.names)
        return entries + (list(wrinkling_rows()) if self._model.spring_groups and self._loaded else [])

    def write_html(self, path: str | Path, *, title: str = "softrobots", overwrite: bool = False) -> Path:
        """Write `html` to a file.

        Args:
            path: The file.
            title: Title of the page.
            overwrite: Replace an existing file.

        Returns:
            The path.

        Raises:
            OutputExists: If the file exists and `overwrite` is false.
        """
        new_file(path, overwrite=overwrite)  # tells at once
        return write_text(path, self.html(title), overwrite=overwrite)

    def wait(self) -> None:
        """Serve until Ctrl-C or until the server ends."""
        with contextlib.suppress(KeyboardInterrupt):
            while self._server.poll() is None:
                time.sleep(0.2)

    def close(self) -> None:
        """End the server; the page stays as it is in browsers that show it."""
        page = getattr(self, "_page", None)
        if page is not None:
            page.window.zmq_socket.close(linger=0)
        end_server(self._server)

    def _check(self, equilibrium: Any) -> None:
        check_same_model(self._model, equilibrium)
        self._check_open()

    def _check_open(self) -> None:
        if self._server.poll() is not None:
            raise ViewerError("the viewer is closed, or its server has ended; open a new one")

    def _prepare(self, ground: float) -> None:
        """White background, floor at a height [m], and the camera; meshcat's camera looks at the origin, so the scene moves."""
        import meshcat.geometry as geometry

        size = self._size
        self._page["/Background"].set_property("top_color", [1.0, 1.0, 1.0])
        self._page["/Background"].set_property("bottom_color", [0.90, 0.92, 0.94])
        self._page["/Axes"].set_property("visible", False)
        self._page["/Grid"].set_property("visible", False)
        q = self._model.configuration(self._model.relaxed_motors)
        tip = np.array(frame_placement(self._model, q, self._model.tip).translation)
        upright = np.hypot(*(tip - self._start)[:2]) < 0.1 * size
        self.look_at(tip + [0.3 * size if upright else -0.1 * size, 0.0, 0.0 if upright else 0.2 * size])
        along = floor_lines(size, ground)
        ends = np.concatenate([along, along[:, [1, 0, 2]]])
        lines = geometry.PointsGeometry(ends.T.astype(np.float32))
        self._root["floor"].set_object(geometry.LineSegments(lines, geometry.LineBasicMaterial(color=0xB8C0C8)))

    def _add_frame(self, animation: Any, frame: Frame) -> None:
        deformed = self._model.embed(self._model.coordinates.at(frame.q_motors, frame.q_springs).joints)
        rigid = self._model.embed(self._model.coordinates.at(frame.q_motors, self._model.rest).joints)
        self._chain.add_frame(animation, frame.number, deformed, rigid, _levels(frame.equilibrium))
        if frame.equilibrium is not None:
            self._arrows.add_frame(animation, frame.number, frame.equilibrium, deformed)


def view(model: SoftModel, result: Equilibrium | Trajectory | None = None) -> Viewer:
    """Open a viewer and show a result in it.

    Args:
        model: The robot.
        result: An equilibrium to show or a trajectory to play; the robot at rest by default.

    Returns:
        The viewer; print its `url` and `tunnel`, and `close` it at the end (or use it in a `with` statement).

    Raises:
        ParameterError: If the result is something else or belongs to another robot.
        ViewerError: If the server does not start.
    """
    viewer = Viewer(model)
    try:
        if isinstance(result, Trajectory):
            viewer.animate(result)
        elif result is not None:
            viewer.show(result)
            viewer.look_at(result.tip_position)
    except BaseException:
        viewer.close()
        raise
    return viewer


def _extent(model: SoftModel) -> tuple[FloatArray, float]:
    """Where the camera takes the base to be, shape (3,) [m], and the largest distance of the chain from its start at rest [m].

    The distance is the scale of the picture; of a straight robot it is its reach.
    """
    points = backbone(model, model.configuration(model.relaxed_motors))
    size = max(float(np.linalg.norm(points - points[0], axis=1).max()), 0.05 * model.reach)
    return points[0] if float(np.linalg.norm(points[0])) > size else np.zeros(3), size


def _ghost(model: SoftModel) -> str:
    """What the translucent robot is."""
    if not model.muscles:
        return "rigid arm, same motor angles" if model.n_motors else "without load"
    return "without load, same muscle lengths" if model.muscle_input == "lengths" else "straight, at rest"


def _tensions(equilibrium: Equilibrium | None) -> dict[str, float]:
    if equilibrium is None:
        return {}
    names = (muscle.name for muscle in equilibrium.model.muscles)
    return dict(zip(names, equilibrium.muscle_forces.tolist(), strict=True))


def _levels(equilibrium: Equilibrium | None) -> list[int] | None:
    """Level of wrinkling of each inflated link; None without load."""
    if equilibrium is None:
        return None
    return [wrinkling_level(equilibrium, link) for link in range(len(equilibrium.model.spring_groups))]
