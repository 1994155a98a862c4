"""A live view: a robot in the browser that follows commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import ParameterError, SoftRobotsError, ViewerError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.inverse_kinematics import IkSolution
from softrobots.view.live.commands import Wanted
from softrobots.view.warm_start import next_equilibrium, next_solution


class Page(Protocol):
    """What shows the robot, such as a `softrobots.Viewer`."""

    @property
    def serving(self) -> bool:
        """Whether it is served."""

    def show(self, equilibrium: Equilibrium) -> None:
        """Show a loaded robot."""

    def mark(self, target: Any) -> None:
        """Mark a target, shape (3,) [m]; None: none."""


class Commands(Protocol):
    """A source of commands; see `softrobots.view.live.input`."""

    def read(self, live: LiveView) -> Wanted | None:
        """Wait a fraction of a second, and return the commanded state; None if no command came.

        Raises:
            SoftRobotsError: If a command is wrong. More can be read after it.
        """


class LiveView:
    """A robot on a page, and its last commanded state."""

    def __init__(self, page: Page, shown: Equilibrium | IkSolution) -> None:
        """Start with a robot that is shown already.

        Args:
            page: What shows it.
            shown: The loaded robot, or the solution whose target it keeps; loaded by a tip force and gravity only.

        Raises:
            ParameterError: If it is loaded otherwise.
        """
        equilibrium = shown.equilibrium if isinstance(shown, IkSolution) else shown
        target = shown.target if isinstance(shown, IkSolution) else None
        gravity = equilibrium.load.gravity
        self.page = page
        self.start = Wanted(
            equilibrium.q_motors,
            target,
            tip_force(equilibrium),
            None if gravity is None else read_only(finite_array("gravity", gravity, (3,), "m/s^2")),
        )
        """The first state."""
        self.wanted = self.start
        """The state that is shown."""
        self.equilibrium = self._first = equilibrium
        """The loaded robot that is shown."""

    def apply(self, wanted: Wanted) -> Equilibrium:
        """Show the robot in a commanded state; without such an equilibrium nothing changes.

        Args:
            wanted: The state.

        Returns:
            The loaded robot.

        Raises:
            ParameterError: If numbers are wrong in kind or number, or a target is given to a robot without actuators.
            TargetUnreachable: If the tip does not reach the target.
            EquilibriumNotFound: If there is no equilibrium.
            ViewerError: If the page is closed.
        """
        if wanted is self.start:
            equilibrium = self._first  # a warm start could end on another branch
        elif wanted.target is None:
            equilibrium = next_equilibrium(self.equilibrium, wanted.motors, wanted.force, gravity=wanted.gravity)
        else:
            equilibrium = next_solution(self.equilibrium, wanted.target, wanted.force, gravity=wanted.gravity).equilibrium
        self.page.show(equilibrium)
        self.page.mark(wanted.target)
        self.wanted, self.equilibrium = wanted._replace(motors=equilibrium.q_motors), equilibrium
        return equilibrium


def follow(live: LiveView, commands: Commands, tell: Callable[[str], object], complain: Callable[[str], object]) -> None:
    """Follow commands until they end or the page is closed. A command that fails is reported, and the next one is read.

    Args:
        live: The view.
        commands: Where commands come from.
        tell: Prints a line for each robot that is shown.
        complain: Prints a line for each command that fails.

    Raises:
        ViewerError: If the page is closed on the way.
    """
    while live.page.serving:
        try:
            wanted = commands.read(live)
            if wanted is None:
                continue
            if wanted.done:
                return
            tell(state_line(live.apply(wanted)))
        except ViewerError:
            raise
        except SoftRobotsError as error:
            complain(f"error: {error}")


def state_line(equilibrium: Equilibrium) -> str:
    """Return one line about a loaded robot: tip, actuators, tensions, slack, stability, wrinkling, residual."""
    words = [f"tip {_spelled(equilibrium.tip_position)} m"]
    if len(equilibrium.q_motors):
        words.append(f"motors {_spelled(equilibrium.q_motors)}" + ("" if equilibrium.within_limits else " (beyond limits)"))
    if len(equilibrium.muscle_forces):
        words.append(f"tensions {_spelled(equilibrium.muscle_forces)} N")
    if any(equilibrium.muscle_slack):
        rows = zip(equilibrium.model.muscles, equilibrium.muscle_slack, strict=True)
        words.append("slack " + " ".join(muscle.name for muscle, slack in rows if slack))
    words.append("stable" if equilibrium.stable else equilibrium.stability.kind)
    if equilibrium.model.spring_groups:
        words.append("wrinkled" if equilibrium.wrinkled else "not wrinkled")
    return ", ".join((*words, f"residual {equilibrium.residual:.1e} N m"))


def tip_force(equilibrium: Equilibrium) -> FloatArray:
    """Return the tip force, shape (3,) [N], of a robot without other loads than gravity.

    Raises:
        ParameterError: If there is another force, or a moment.
    """
    model, wrenches = equilibrium.model, equilibrium.load.wrenches
    if any(wrench.any() for name, wrench in wrenches.items() if name != model.tip) or not equilibrium.conservative:
        given = {name: wrench.tolist() for name, wrench in wrenches.items()}
        raise ParameterError("load", given, "a force on the tip and gravity only, to be changed by commands")
    return read_only(np.array(wrenches[model.tip][:3]) if model.tip in wrenches else np.zeros(3))


def _spelled(values: FloatArray) -> str:
    rounded = (values.round(4) + 0.0).tolist()  # no negative zero
    return " ".join(f"{value:.4f}" if abs(value) < 100.0 else f"{value:.7g}" for value in rounded)
