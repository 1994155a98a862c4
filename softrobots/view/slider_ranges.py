"""Ranges of sliders: round numbers between the limits of actuators, and the largest force on the tip."""

from __future__ import annotations

import math

import numpy as np

from softrobots.core.errors import NeutralEquilibrium, NotConverged
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.sensitivity import compliance
from softrobots.view.tension_scale import round_down

_STEPS = 400  # least number of steps of a slider
_AROUND = {"rad": math.pi, "m": 1.0, "N": 100.0, "Pa": 1e5}  # half the range of an actuator without limits, by its unit
_BENDING = 0.25  # linear deflection of the relaxed tip under the largest force, of the robot's size
_ANY_FORCE = 10.0  # [N], the largest force on a robot that does not bend


def slider_grid(low: float, high: float) -> tuple[float, float, float]:
    """First value, last value and step of a slider: round numbers within two limits.

    Args:
        low: Lower limit.
        high: Upper limit, not below.

    Returns:
        Multiples of a step of 1, 2 or 5 times a power of ten, at least 400 of them between the limits; the limits themselves
        where nothing is between them.
    """
    if high <= low:
        return low, low, 1.0
    step = round_down((high - low) / _STEPS)
    digits = max(0, -math.floor(math.log10(step)))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return round(first * step, digits), round(last * step, digits), step


def actuator_ends(model: SoftModel) -> list[tuple[float, float]]:
    """Return the ends of each slider: the limits of its actuator; a missing one lies a default range from the other, or zero.

    The default range of a length is that around the length at rest.
    """
    limits = zip(model.motor_limits.tolist(), model.actuators.units, model.relaxed_motors.tolist(), strict=True)
    return [_ends(low, high, unit, relaxed) for (low, high), unit, relaxed in limits]


def visible_force(model: SoftModel) -> float:
    """A round force that moves the tip of the relaxed robot by a part of its size in its most compliant direction [N]."""
    try:
        relaxed = solve_equilibrium(model, model.relaxed_motors)
        largest = float(np.linalg.eigvalsh(compliance(model, relaxed)[:3, :3])[-1])
    except (NeutralEquilibrium, NotConverged):
        return _ANY_FORCE
    force = _BENDING * model.reach / max(largest, 1e-300)
    if not 1e-6 < force < 1e6:
        return _ANY_FORCE
    return round_down(force)


def _ends(low: float, high: float, unit: str, relaxed: float) -> tuple[float, float]:
    around = 0.5 * relaxed if unit == "m" and relaxed > 0.0 else _AROUND[unit]
    if math.isinf(low) and math.isinf(high):
        return -around, around
    if math.isinf(high):
        return low, max(low, relaxed - around) + 2.0 * around
    return high - 2.0 * around if math.isinf(low) else low, high
