"""Gas to deploy an inflated link: volume, and the tank that fills it."""

from __future__ import annotations

import math

from softrobots.core.checks import non_negative_number, positive_number
from softrobots.core.errors import ParameterError


def volume(length: float, radius: float) -> float:
    """Return the volume of an inflated tube, `pi r^2 L` [m^3].

    Args:
        length: Tube length [m], positive.
        radius: Tube radius [m], positive.

    Raises:
        ParameterError: If an argument is not positive.
    """
    return math.pi * positive_number("radius", radius, "m") ** 2 * positive_number("length", length, "m")


def tank_volume(inflated_volume: float, pressure: float, tank_pressure: float, *, ambient_pressure: float = 0.0) -> float:
    """Return the volume of a tank that inflates a given volume once, isothermally (Boyle).

    Gas flows until both are at the same absolute pressure `p + p_a`: `(p_tank + p_a) V_tank = (p + p_a)(V_tank + V)`, with
    initially empty tubes.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Required gauge pressure in it [Pa], positive.
        tank_pressure: Gauge pressure of the full tank [Pa], above `pressure`. The paper mentions 30 MPa.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default), 101325 on the ground.

    Returns:
        The tank volume [m^3].

    Raises:
        ParameterError: If an argument is out of range.
    """
    inflated_volume = positive_number("inflated_volume", inflated_volume, "m^3")
    pressure = positive_number("pressure", pressure, "Pa")
    tank_pressure = positive_number("tank_pressure", tank_pressure, "Pa")
    if tank_pressure <= pressure:
        raise ParameterError("tank_pressure", tank_pressure, f"above the pressure {pressure} Pa of the inflated volume")
    ambient_pressure = non_negative_number("ambient_pressure", ambient_pressure, "Pa")
    return (pressure + ambient_pressure) * inflated_volume / (tank_pressure - pressure)


def tank_pressure(inflated_volume: float, pressure: float, tank_volume: float, *, ambient_pressure: float = 0.0) -> float:
    """Return the gauge pressure of a full tank of given volume that inflates a given volume once, isothermally.

    The inverse of `tank_volume`.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Required gauge pressure in it [Pa], positive.
        tank_volume: Volume of the tank [m^3], positive.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

    Returns:
        The gauge pressure of the full tank [Pa].

    Raises:
        ParameterError: If an argument is out of range.
    """
    inflated_volume = positive_number("inflated_volume", inflated_volume, "m^3")
    pressure = positive_number("pressure", pressure, "Pa")
    tank_volume = positive_number("tank_volume", tank_volume, "m^3")
    ambient_pressure = non_negative_number("ambient_pressure", ambient_pressure, "Pa")
    return pressure + (pressure + ambient_pressure) * inflated_volume / tank_volume
