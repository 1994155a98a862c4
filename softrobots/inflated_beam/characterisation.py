"""Moment-angle law of an inflated link, and the table that the paper measured."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import common_shape, finite_array, positive_array
from softrobots.inflated_beam.beam import required_pressure


class CharacterisationRow(NamedTuple):
    """One row of [Troise 2021], Table 3 (measured on the prototype link)."""

    pressure: float
    """Gauge pressure [Pa]."""
    stiffness: float
    """Fitted stiffness `k` [N m/rad]."""
    stiffness_std: float
    """Its standard deviation [N m/rad]."""
    max_moment: float | None
    """Mean moment beyond wrinkling [N m]; None where the paper prints N/A."""


TABLE_3 = (
    CharacterisationRow(10e3, 182.56, 3.37, 4.99),
    CharacterisationRow(20e3, 187.30, 1.48, 9.45),
    CharacterisationRow(30e3, 155.89, 2.66, 14.99),
    CharacterisationRow(40e3, 174.42, 6.22, 18.77),
    CharacterisationRow(50e3, 169.44, 5.51, 21.76),
    CharacterisationRow(60e3, 166.66, 4.99, None),
)
"""Characterisation of the prototype link, [Troise 2021] Table 3."""

MEAN_STIFFNESS = 172.71
"""Mean stiffness of the prototype link [N m/rad], as printed in [Troise 2021]; the six rows average 172.7117."""


def required_tabulated_pressure(moment: Any, radius: Any) -> Any:
    """Return the smallest pressure of [Troise 2021] Table 3 whose wrinkling moment is at least `moment`.

    Args:
        moment: Bending moment [N m], zero or positive, a number or an array.
        radius: Tube radius [m], positive, a number or an array that broadcasts with it.

    Returns:
        The pressure [Pa], the common shape. Where the moment exceeds the highest row, infinity; None for a single number.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    exact = required_pressure(moment, radius)
    pressures = np.append([row.pressure for row in TABLE_3], np.inf)
    found = pressures[np.searchsorted(pressures, exact)]
    return found if np.ndim(found) else float(found) if np.isfinite(found) else None


def moment(angle: Any, *, stiffness: Any, max_moment: Any) -> Any:
    """Return the moment of a link bent by an angle: `tau = sign(theta) min(k |theta|, M_max)`, [Troise 2021] section 4.

    Args:
        angle: Hinge angle [rad], a number or an array.
        stiffness: Stiffness `k` [N m/rad], positive, a number or an array that broadcasts.
        max_moment: Saturation moment `M_max` [N m], positive, a number or an array that broadcasts.

    Returns:
        Moment [N m], the common shape.

    Raises:
        ParameterError: If an argument is out of range or the shapes do not broadcast.
    """
    theta = finite_array("angle", angle, None, "rad")
    k, most = positive_array("stiffness", stiffness, "N m/rad"), positive_array("max_moment", max_moment, "N m")
    common_shape("max_moment", common_shape("stiffness", theta.shape, k.shape), most.shape)
    return np.clip(k * theta, -most, most)
