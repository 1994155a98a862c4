"""Effect of single keys in a live view, independent of terminals."""

from __future__ import annotations

import contextlib
import math

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import NameNotFound, NeutralEquilibrium, ParameterError
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from softrobots.statics.sensitivity import compliance
from softrobots.view.live.commands import Wanted

KEYS = """\
arrows              left, right: along x; up, down: along z; page up, page down: along y (as x X, z Z, y Y do)
t  f                the keys above move the target of the tip; move the force on the tip
1 ... 9, + and -    choose an actuator; turn, lengthen or tighten it
< and >             halve, double the step
g                   gravity on or off
r                   as at the start
:                   type a command, such as `target 0.9 0.3 0.2`; `:help` lists them
?                   these lines
q                   end (as Ctrl-C does)"""
"""Help on the keys."""

_MOVES = {
    "right": (0, 1.0), "left": (0, -1.0), "page up": (1, 1.0), "page down": (1, -1.0), "up": (2, 1.0), "down": (2, -1.0),
    "x": (0, 1.0), "X": (0, -1.0), "y": (1, 1.0), "Y": (1, -1.0), "z": (2, 1.0), "Z": (2, -1.0),
}  # fmt: skip
_TARGET_SHARE, _FORCE_SHARE, _MOTOR_SHARE = 0.02, 0.01, 0.05  # of reach, of force for reach, of motor_scale
_FURTHEST = 2.0**20  # largest factor of a step: a key that is held down gives no infinite step


class KeyMoves:
    """Turns keys into states; keeps what they move and the sizes of steps."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        """Choose visible steps.

        Args:
            equilibrium: The loaded robot at the start.
        """
        model = equilibrium.model
        self._motor, self._force = 0, not model.n_motors
        self._factor = 1.0  # of all steps
        self._target_step = _round_step(_TARGET_SHARE * model.reach)
        self._motor_steps = [_round_step(_MOTOR_SHARE * scale) for scale in model.motor_scale.tolist()]
        self._force_step, softness = 1.0, 0.0
        with contextlib.suppress(NeutralEquilibrium):
            softness = float(np.linalg.norm(compliance(model, equilibrium)[:3, :3], 2)) if model.n_springs else 0.0
        if 0.0 < softness < math.inf:
            self._force_step = _round_step(_FORCE_SHARE * model.reach / softness)

    @property
    def hint(self) -> str:
        """One line about what the keys move."""
        steps = [self._factor * step for step in self._motor_steps]
        motors = f"; + and - actuator {self._motor + 1} by {steps[self._motor]:g}" if steps else ""
        step = self._factor * (self._force_step if self._force else self._target_step)
        what = f"force by {step:g} N" if self._force else f"target by {step:g} m"
        return f"arrows move the {what}{motors}; ? lists the keys"

    def press(self, key: str, now: Wanted, start: Wanted, equilibrium: Equilibrium) -> Wanted:
        """Return the state after a key.

        Args:
            key: A character, or the name of a key: "up", "down", "left", "right", "page up", "page down".
            now: The state before it.
            start: The state that `r` restores.
            equilibrium: The loaded robot, from whose tip a target starts to move.

        Returns:
            The state; `now` itself if the key only changes what keys move, `start` itself after `r`.

        Raises:
            NameNotFound: If the key does nothing.
            ParameterError: If the robot has no such actuator, or a target is to be moved and it has none.
        """
        if key in _MOVES:
            return self._moved(*_MOVES[key], now, equilibrium)
        if key in ("+", "-"):
            return self._turned(1.0 if key == "+" else -1.0, now)
        if key == "r":
            return start
        if key == "g":
            on = read_only(np.array(EARTH_GRAVITY)) if start.gravity is None else start.gravity
            return now._replace(gravity=on if now.gravity is None else None)
        if key in ("t", "f"):
            if key == "t" and not self._motor_steps:
                raise ParameterError("t", "the target", "left: this robot has no actuators to reach a target with")
            self._force = key == "f"
        elif key in ("<", ">"):
            self._factor = min(max(self._factor * (0.5 if key == "<" else 2.0), 1.0 / _FURTHEST), _FURTHEST)
        elif key in "123456789":
            self._choose(int(key) - 1)
        else:
            raise NameNotFound("key", key, ("arrows", *"tfgr123456789+-<>:?q"))
        return now

    def _moved(self, axis: int, sign: float, now: Wanted, equilibrium: Equilibrium) -> Wanted:
        """The force or the target moved by a step along an axis."""
        step = sign * self._factor * (self._force_step if self._force else self._target_step) * np.eye(3)[axis]
        if self._force:
            return now._replace(force=read_only(now.force + step))
        return now._replace(target=read_only((equilibrium.tip_position if now.target is None else now.target) + step))

    def _turned(self, sign: float, now: Wanted) -> Wanted:
        """The chosen actuator moved by a step."""
        self._choose(self._motor)
        motors: FloatArray = np.array(now.motors)
        motors[self._motor] += sign * self._factor * self._motor_steps[self._motor]
        return now._replace(motors=read_only(motors), target=None)

    def _choose(self, motor: int) -> None:
        if motor >= len(self._motor_steps):
            raise ParameterError("actuator", motor + 1, f"one of the {len(self._motor_steps)} of this robot")
        self._motor = motor


def _round_step(step: float) -> float:
    """The number 1, 2 or 5 times a power of ten that is nearest to a step by ratio."""
    power = 10.0 ** math.floor(math.log10(step))
    return float(min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(math.log(digit * power / step))) * power)
