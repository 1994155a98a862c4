"""The colours of tensions: one scale from pushes over zero to pulls for pages and figures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from softrobots.core.checks import FloatArray
from softrobots.description.urdf_tags import ActuatorTag
from softrobots.model.actuators import slack_tendons
from softrobots.view.actuator_curves import ActuatorCurve

PULL_COLOURS = ((0.46, 0.73, 0.95), (0.00, 0.24, 0.66))
"""Red, green, blue of the weakest and of the strongest pull: blue, from light to dark."""
PUSH_COLOURS = ((0.98, 0.65, 0.28), (0.66, 0.22, 0.00))
"""Those of the weakest and of the strongest push: orange, from light to dark."""
ZERO_COLOUR = (0.45, 0.45, 0.45)
"""Grey of an actuator without tension."""

NEUTRAL = 1e-3
"""Share of the end of the scale below which a tension is grey."""
ZERO = 1e-9
"""Share of the end of the scale below which a tension is told as zero."""


class DrawnActuator(NamedTuple):
    """An actuator of a scene."""

    curve: ActuatorCurve
    """Its curve."""
    tension: float | None = None
    """Its tension, negative where it pushes [N]; None without load."""
    slack: bool = False
    """Whether it is a tendon that hangs slack."""


def drawn_actuators(tags: Sequence[ActuatorTag], curves: Sequence[ActuatorCurve], tensions: FloatArray) -> list[DrawnActuator]:
    """Return actuators on their curves with their tensions, shape (n,) [N]."""
    return [DrawnActuator(*row) for row in zip(curves, tensions.tolist(), slack_tendons(tags, tensions), strict=True)]


def round_up(number: float) -> float:
    """The smallest of 1, 2 and 5 times a power of ten that is not below a positive number (to rounding)."""
    return 1.0 / round_down(1.0 / number)


def round_down(number: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten that is not above a positive number (to rounding)."""
    power = math.floor(math.log10(number * (1.0 + 1e-9)))
    return max(float(f"{digit}e{power}") for digit in (1, 2, 5) if digit * 10.0**power <= number * (1.0 + 1e-9))


def scale_end(tensions: Iterable[float | None]) -> float:
    """Return the tension at both ends of the scale [N]: a round number that no tension exceeds."""
    largest = max((abs(tension) for tension in tensions if tension is not None), default=0.0)
    return round_up(largest) if largest > 1e-12 else 1.0


def tension_colour(tension: float | None, end: float) -> tuple[float, float, float, float]:
    """Return the colour of a tension [N] on a scale with an end [N]; grey where it is not known."""
    share = 0.0 if tension is None else min(abs(tension) / end, 1.0)
    if tension is None or share < NEUTRAL:
        return *ZERO_COLOUR, 1.0
    ends = zip(*(PULL_COLOURS if tension > 0.0 else PUSH_COLOURS), strict=True)
    red, green, blue = (light + share * (dark - light) for light, dark in ends)
    return red, green, blue, 1.0
