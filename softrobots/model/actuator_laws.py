r"""Laws of the kinds of actuators: tension by length and input, with derivatives, energy and limits.

| kind | input `u` | tension `T` at the length `l` |
|---|---|---|
| `length` | length [m] | what holds `l = u` (`softrobots.model.muscle_lengths`) |
| `tension` | tension [N] | `u` |
| `elastic` | length of the motor [m] | `max(0, pretension + stiffness (l - u))`: slack when pushed |
| `pressure` | pressure [Pa] | `-u area` |
| `mckibben` | pressure [Pa] | :math:`\max(0, u \frac{\pi D_0^2}{4} (a (l/l_0)^2 - b))` (Chou and Hannaford 1996) |

with :math:`a = 3 / \tan^2 \alpha_0`, :math:`b = 1 / \sin^2 \alpha_0`, the diameter `D_0` and the braid angle :math:`\alpha_0`
at the rest length `l_0`. Each has the energy whose derivative by `l` is `T`; where an actuator goes slack the energy has a
continuous slope, and the tangent the value of the slack side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softrobots.core.checks import FloatArray
from softrobots.core.suspicion import MOST_STRETCH, stretched_too_far
from softrobots.description.urdf_tags import ActuatorTag

UNITS = {"length": "m", "tension": "N", "elastic": "m", "pressure": "Pa", "mckibben": "Pa"}
"""Unit of the input of each kind."""

UNFELT = ("tension", "pressure")
"""Kinds whose tension does not depend on the length: they feel no load."""

IntArray = NDArray[np.intp]

ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
"""Rounding of lengths, relative to them."""


class Tensions(NamedTuple):
    """What actuators exert, arrays of shape (n_muscles,)."""

    tension: FloatArray
    """Tension, negative where they push [N]."""
    by_length: FloatArray
    """Its derivative by the length [N/m]."""
    by_input: FloatArray
    """Its derivative by the input [N/m, 1 or m^2]."""
    energy: FloatArray
    """Energy whose derivative by the length is the tension [J]."""


class ActuatorLaws:
    """The laws of the actuators of a robot, of any kinds but `length`."""

    def __init__(self, tags: Sequence[ActuatorTag]) -> None:
        """Sort the actuators by kind."""
        self.kinds = tuple(tag.kind for tag in tags)
        """Kind of each."""
        self.given = np.array([tag.kind == "tension" for tag in tags], dtype=bool)
        """Of which the input is the tension itself, shape (n_muscles,)."""
        self._names = [tag.name for tag in tags]
        self._rest = np.array([tag.rest_length for tag in tags])
        self._of = {kind: np.flatnonzero([one == kind for one in self.kinds]) for kind in dict.fromkeys(self.kinds)}
        self._stiffness, self._pretension, self._area = (
            np.array([getattr(tag, name) for tag in tags]) for name in ("stiffness", "pretension", "area")
        )
        braided = [tag.kind == "mckibben" for tag in tags]
        self._pull = np.array([pull_factors(tag) if has else (0.0, 0.0) for tag, has in zip(tags, braided, strict=True)])
        self.rounding = 8.0 * ROUNDING * float(np.linalg.norm(self._stiffness * self._rest))
        """Rounding of the load of stiff tendons [N]: that of some lengths times the stiffness."""

    def at(self, elongations: FloatArray, inputs: FloatArray) -> Tensions:
        """Return the tensions at lengths beyond those at rest [m] and at inputs, each shape (..., n_muscles)."""
        found = Tensions(*np.zeros((4, *elongations.shape)))
        for kind, places in self._of.items():
            parts = getattr(self, f"_{kind}")(places, elongations[..., places], inputs[..., places])
            for array, part in zip(found, parts, strict=True):
                array[..., places] = part
        return found

    def taken_up(self, elongations: FloatArray, inputs: FloatArray, tension: float) -> FloatArray:
        """Return inputs at which slack elastic tendons have a small tension [N] at the same lengths."""
        places, taut = self._of.get("elastic", np.zeros(0, dtype=np.intp)), np.array(inputs)
        knee = self._rest[places] + elongations[places] + self._pretension[places] / self._stiffness[places]
        little = tension / self._stiffness[places]
        taut[places] = np.where(inputs[places] > knee - 1e-2 * little, knee - little, inputs[places])
        return taut

    def pushed(self, tensions: FloatArray) -> list[str]:
        """Return the names of those that push with these tensions, shape (n_muscles,) [N], but go slack instead."""
        never = tensions < -1e-9 * float(np.abs(tensions).max())  # rounding
        kinds = zip(self._names, self.kinds, never, strict=True)
        return [name for name, kind, negative in kinds if negative and kind in ("elastic", "mckibben")]

    def refusal(self, inputs: FloatArray) -> str | None:
        """Return the requirement that inputs fail; None if there is none."""
        places = self._of.get("elastic", np.zeros(0, dtype=np.intp))
        if np.any(inputs[places] <= 0.0):
            return "positive lengths of the motors of elastic actuators [m]"
        if np.any(inputs[places] > MOST_STRETCH * self._rest[places]):
            names = [self._names[place] for place in places]
            return stretched_too_far(names, inputs[places].tolist(), self._rest[places].tolist())
        if np.any(inputs[self._of.get("mckibben", [])] < 0.0):
            return "pressures of McKibben muscles >= 0 [Pa]"
        return None

    def _tension(self, places: IntArray, beyond: FloatArray, inputs: FloatArray) -> tuple[FloatArray | float, ...]:
        return inputs, 0.0, 1.0, inputs * beyond

    def _elastic(self, places: IntArray, beyond: FloatArray, inputs: FloatArray) -> tuple[FloatArray | float, ...]:
        stiffness = self._stiffness[places]
        pull = self._pretension[places] + stiffness * (beyond - (inputs - self._rest[places]))
        tension = np.maximum(pull, 0.0)
        slope = np.where(pull > ROUNDING * stiffness * self._rest[places], stiffness, 0.0)
        return tension, slope, -slope, tension * tension / (2.0 * stiffness)

    def _pressure(self, places: IntArray, beyond: FloatArray, inputs: FloatArray) -> tuple[FloatArray | float, ...]:
        area = self._area[places]
        return -inputs * area, 0.0, -area, -inputs * area * beyond

    def _mckibben(self, places: IntArray, beyond: FloatArray, inputs: FloatArray) -> tuple[FloatArray | float, ...]:
        (square, least), rest = self._pull[places].T, self._rest[places]
        share, slack = 1.0 + beyond / rest, np.sqrt(least / square)
        taut = share > slack * (1.0 + ROUNDING)
        force = np.where(taut, square * share**2 - least, 0.0)
        slope = np.where(taut, 2.0 * square * share / rest, 0.0)
        work = (square * (share**2 + share * slack + slack**2) / 3.0 - least) * (share - slack) * rest
        return inputs * force, inputs * slope, force, np.where(taut, inputs * work, 0.0)


def pull_factors(tag: ActuatorTag) -> tuple[float, float]:
    """Return `pi D0^2/4 (a, b)` of a McKibben muscle [m^2]; see the module."""
    section = 0.25 * math.pi * tag.diameter**2
    return 3.0 * section / math.tan(tag.braid_angle) ** 2, section / math.sin(tag.braid_angle) ** 2


def input_limits(tag: ActuatorTag) -> tuple[float, float]:
    """Lower and upper limit of the input [m, N or Pa]."""
    if tag.kind == "tension":
        return tag.weakest, tag.strongest
    return (tag.shortest, tag.longest) if UNITS[tag.kind] == "m" else (0.0, tag.max_pressure)


def input_scale(tag: ActuatorTag, distance: float, bend: float) -> float:
    """Change of the input that is worth about a radian of motion [m, N or Pa].

    Args:
        tag: The actuator.
        distance: Change of its length per angle of bending [m/rad].
        bend: Bending per tension [rad/N].
    """
    if tag.kind == "length":
        return distance
    if tag.kind == "elastic":
        return distance + 1.0 / (bend * tag.stiffness)
    if tag.kind == "pressure":
        return 1.0 / (bend * tag.area)
    if tag.kind == "mckibben":
        square, least = pull_factors(tag)
        return 1.0 / (bend * max(abs(square - least), 1e-3 * least))
    return 1.0 / bend


def relaxed_input(tag: ActuatorTag) -> float:
    """Input of an actuator at rest: its rest length, or no tension or pressure."""
    return tag.rest_length if UNITS[tag.kind] == "m" else 0.0


def length_limits(tag: ActuatorTag) -> tuple[float, float]:
    """Limits of the length itself, where it is not free [m]."""
    return (tag.shortest, tag.longest) if tag.kind in ("length", "tension") else (-math.inf, math.inf)


def wanted_tension(tag: ActuatorTag) -> float:
    """Least tension that a search leaves [N]: the pretension of an elastic tendon, else none, as far as the limits allow."""
    return min(max(0.0, tag.weakest, tag.pretension if tag.kind == "elastic" else 0.0), tag.strongest)


def tension_limits(tag: ActuatorTag) -> tuple[float, float]:
    """Limits of the tension [N]; of a pressure its own limits are enough."""
    return (-math.inf, math.inf) if UNITS[tag.kind] == "Pa" else (tag.weakest, tag.strongest)
