"""A robot in the browser with sliders for motors or muscles, tip force and gravity; every change is solved and drawn."""

from __future__ import annotations

import atexit
import threading
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, positive_integer, positive_number
from softrobots.core.errors import ParameterError, ViewerError
from softrobots.environment.environment import Environment
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.view.legend import legend
from softrobots.view.scene import SceneBuilder
from softrobots.view.served_page import LOOPBACK, ServedPage
from softrobots.view.slider_ranges import visible_force
from softrobots.view.viser_page.drawing import ViserDrawing
from softrobots.view.viser_page.server import start_server
from softrobots.view.viser_page.slider_panel import Setting, SliderPanel
from softrobots.view.warm_start import next_equilibrium


class SliderPage(ServedPage):
    """A page with sliders for one robot, served by viser on loopback only; a context manager that ends its server.

    The equilibrium is solved at every change, from the one that is shown: a robot that has snapped through stays on its branch
    until it is reset. Changes during a solution are not queued: the newest is solved next. Where there is no equilibrium, the
    page says so and keeps showing the last one.
    """

    def __init__(
        self,
        model: SoftModel,
        *,
        q_motors: Any = None,
        force: Any = None,
        gravity: Any = None,
        port: int | None = None,
        full_force: float | None = None,
        environment: Environment | None = None,
    ) -> None:
        """Solve the start, then start a server in threads of this process and draw it.

        Args:
            model: The robot.
            q_motors: Actuator coordinates at the start, shape (n_motors,) [rad, m, N or Pa]; relaxed by default.
            force: Force on the tip at the start, shape (3,) [N], world axes; none by default.
            gravity: Gravity, shape (3,) [m/s^2], world axes, which can be switched off; by default it is off, and the Earth's
                when it is switched on.
            port: Port of the page; the first free one from 8080 by default.
            full_force: Largest force of each slider, to both sides [N]; by default a round number that bends the robot
                visibly, or the largest component of `force` if that is more.
            environment: Obstacles that the robot touches without friction; None: free space.

        Raises:
            ParameterError: If an argument has the wrong shape, is not finite or out of range.
            EquilibriumNotFound: If there is no equilibrium at the start.
            MissingDependency: If viser is not installed.
            ViewerError: If the port is not free, or a shape cannot be drawn.
        """
        self._model = check_model(model)
        motors = model.relaxed_motors if q_motors is None else q_motors
        push = finite_array("force", (0.0, 0.0, 0.0) if force is None else force, (3,), "N")
        self._gravity = finite_array("gravity", EARTH_GRAVITY if gravity is None else gravity, (3,), "m/s^2")
        self._environment = environment
        self._full = visible_force(model) if full_force is None else positive_number("full_force", full_force, "N")
        if full_force is None:
            self._full = max(self._full, float(np.abs(push).max()))
        self._start = Setting(self._checked_motors(motors), self._checked_force(push), gravity is not None)
        wanted_port = None if port is None else positive_integer("port", port, 65535)
        self._equilibrium = self._solve_from_rest(self._start)
        self._last: Setting | None = self._start
        self._problem: Exception | None = None
        self._scenes = SceneBuilder(model)
        self._lock, self._wake, self._closed = threading.Lock(), threading.Event(), threading.Event()
        self._worker = threading.Thread(target=self._follow, name="softrobots sliders", daemon=True)
        self._server = start_server(model.pinocchio.name, wanted_port)
        try:
            self._url = f"http://{LOOPBACK}:{self._server.get_port()}/"
            self._drawing = ViserDrawing(self._server, self._scenes.robot.shapes, self._scenes.extent, 0.5 * self._full)
            seen = self._scenes.corners([self._scenes.loaded(self._equilibrium)])
            self._drawing.look_at(self._equilibrium.tip_position, seen)
            self._panel = SliderPanel(self._server.gui, model, self._start, self._full, changed=self._wake.set)
            self._draw()
            self._report()
        except BaseException:
            self._server.stop()
            raise
        self._worker.start()
        atexit.register(self.close)

    @property
    def serving(self) -> bool:
        """Whether the server runs."""
        return not self._closed.is_set()

    @property
    def equilibrium(self) -> Equilibrium:
        """The equilibrium that is shown."""
        return self._equilibrium

    def set(self, *, q_motors: Any = None, force: Any = None, gravity: bool | None = None) -> Equilibrium:
        """Move the sliders, solve and draw; what is left out stays.

        Args:
            q_motors: Actuator coordinates, shape (n_motors,) [rad, m, N or Pa].
            force: Force on the tip, shape (3,) [N], world axes.
            gravity: Whether there is gravity.

        Returns:
            The equilibrium that is shown then.

        Raises:
            ParameterError: If an argument has the wrong shape, is not finite, or is beyond the ends of a slider.
            EquilibriumNotFound: If there is none; the page says so too.
            ViewerError: If the page is closed.
        """
        motors = None if q_motors is None else self._checked_motors(q_motors)
        push = None if force is None else self._checked_force(finite_array("force", force, (3,), "N"))
        if gravity is not None and not isinstance(gravity, bool):
            raise ParameterError("gravity", gravity, "True or False; the vector is an argument of SliderPage")
        with self._lock:
            if self._closed.is_set():
                raise ViewerError("the page is closed; open a new one")
            given: dict[str, Any] = {"q_motors": motors, "force": push, "gravity": gravity}
            setting = self._panel.setting._replace(**{name: value for name, value in given.items() if value is not None})
            self._panel.move_to(setting)
            self._solve(setting)
            if self._problem is not None:
                raise self._problem
            return self._equilibrium

    def close(self) -> None:
        """End the server and its threads; the page stays as it is in browsers that show it."""
        with self._lock:
            if self._closed.is_set():
                return
            self._closed.set()
        self._wake.set()
        atexit.unregister(self.close)
        self._worker.join()
        self._server.stop()

    def _follow(self) -> None:
        """Follow the sliders until the page is closed; of several changes the newest counts."""
        while self._wake.wait() and not self._closed.is_set():
            self._wake.clear()
            with self._lock:
                if self._panel.take_reset():
                    self._panel.move_to(self._start)
                    self._equilibrium, self._last = self._solve_from_rest(self._start), None
                setting = self._panel.setting
                if self._last is not None and not self._model.actuators.independent:
                    setting = setting._replace(q_motors=_fitting(self._model, self._last.q_motors, setting.q_motors))
                    self._panel.move_to(setting)
                self._solve(setting)

    def _solve(self, setting: Setting) -> None:
        """Solve and draw a setting unless it is the last one; on failure the page says why."""
        try:
            if setting != self._last:
                self._last, self._problem = setting, None
                gravity = self._gravity if setting.gravity else None
                self._equilibrium = next_equilibrium(self._equilibrium, setting.q_motors, setting.force, gravity=gravity)
                self._draw()
        except Exception as error:  # any error: the thread must go on with the next change
            self._problem = error
        self._report()

    def _solve_from_rest(self, setting: Setting) -> Equilibrium:
        """Solve from relaxed springs."""
        gravity = self._gravity if setting.gravity else None
        obstacles = self._environment
        return solve_equilibrium(self._model, setting.q_motors, setting.force, gravity=gravity, environment=obstacles)

    def _draw(self) -> None:
        """Draw the equilibrium."""
        self._scene = self._scenes.loaded(self._equilibrium)
        self._drawing.show(self._scene)

    def _report(self) -> None:
        """Write facts and legend into the panel."""
        rows = legend(self._scenes.robot.shapes, self._scene)
        self._panel.report(self._equilibrium, rows, "" if self._problem is None else str(self._problem))

    def _checked_motors(self, value: Any) -> tuple[float, ...]:
        motors = self._model.checked_motors(value)
        low, high = self._model.motor_limits.T
        if not np.all((motors >= low) & (motors <= high)):
            raise ParameterError("q_motors", value, f"within the limits: {', '.join(self._model.actuators.described)}")
        return tuple(motors.tolist())

    def _checked_force(self, force: FloatArray) -> tuple[float, ...]:
        if np.any(np.abs(force) > self._full):
            raise ParameterError("force", force, f"within the ends of its sliders, +-{self._full:g} N (full_force)")
        return tuple(force.tolist())


def _fitting(model: SoftModel, last: tuple[float, ...], values: tuple[float, ...]) -> tuple[float, ...]:
    """Muscle lengths that a shape of the robot has: those that changed are kept, the others follow, within limits."""
    here, basis = np.array(last), model.actuators.basis
    change = np.array(values) - here
    moved = change != 0.0
    step = basis @ np.linalg.lstsq(basis[moved], change[moved], rcond=None)[0]
    return tuple(model.actuators.go(here, step).tolist())
