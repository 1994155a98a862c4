"""Gas to deploy an inflated link: volume, and the tank that fills it."""

from __future__ import annotations

import math
from typing import Any

from softrobots.core.checks import FloatArray, common_shape, non_negative_array, positive_array, refuse_where


def volume(length: Any, radius: Any) -> Any:
    """Return the volume of an inflated tube, `pi r^2 L` [m^3].

    Args:
        length: Tube length [m], positive, any shape.
        radius: Tube radius [m], positive, a shape that broadcasts with it.

    Returns:
        The volume [m^3], the common shape.

    Raises:
        ParameterError: If an argument is not positive or the shapes do not broadcast.
    """
    radii, lengths = positive_array("radius", radius, "m"), positive_array("length", length, "m")
    common_shape("radius", lengths.shape, radii.shape)
    return math.pi * radii**2 * lengths


def tank_volume(inflated_volume: Any, pressure: Any, tank_pressure: Any, *, ambient_pressure: Any = 0.0) -> Any:
    """Return the volume of a tank that inflates a given volume once, isothermally (Boyle).

    Gas flows until both are at the same absolute pressure `p + p_a`: `(p_tank + p_a) V_tank = (p + p_a)(V_tank + V)`, with
    initially empty tubes. Arguments are numbers, or arrays that broadcast.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Required gauge pressure in it [Pa], positive.
        tank_pressure: Gauge pressure of the full tank [Pa], above `pressure`. The paper mentions 30 MPa.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default), 101325 on the ground.

    Returns:
        The tank volume [m^3], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    inflated, needed, full, ambient = _gas(inflated_volume, pressure, "tank_pressure", tank_pressure, "Pa", ambient_pressure)
    refuse_where("tank_pressure", tank_pressure, full <= needed, "above the pressure {} Pa of the inflated volume", needed)
    return (needed + ambient) * inflated / (full - needed)


def tank_pressure(inflated_volume: Any, pressure: Any, tank_volume: Any, *, ambient_pressure: Any = 0.0) -> Any:
    """Return the gauge pressure of a full tank of given volume that inflates a given volume once, isothermally.

    The inverse of `tank_volume`. Arguments are numbers, or arrays that broadcast.

    Args:
        inflated_volume: Volume to fill [m^3], positive.
        pressure: Required gauge pressure in it [Pa], positive.
        tank_volume: Volume of the tank [m^3], positive.
        ambient_pressure: Absolute pressure outside [Pa]; 0 in space (the default).

    Returns:
        The gauge pressure of the full tank [Pa], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    inflated, needed, tank, ambient = _gas(inflated_volume, pressure, "tank_volume", tank_volume, "m^3", ambient_pressure)
    return needed + (needed + ambient) * inflated / tank


def _gas(volume: Any, pressure: Any, tank_name: str, tank: Any, tank_unit: str, ambient: Any) -> tuple[FloatArray, ...]:
    """Volume to fill, pressure in it, one number of the tank, and ambient pressure, as arrays that broadcast."""
    arrays = (
        positive_array("inflated_volume", volume, "m^3"),
        positive_array("pressure", pressure, "Pa"),
        positive_array(tank_name, tank, tank_unit),
        non_negative_array("ambient_pressure", ambient, "Pa"),
    )
    common_shape(tank_name, *(array.shape for array in arrays))
    return arrays
