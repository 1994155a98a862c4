"""Units that files of measurements may have, and what one of each is in SI units."""

from __future__ import annotations

import math

UNITS: dict[str, dict[str, float]] = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0, "turn": 2.0 * math.pi},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": 9.80665, "lbf": 4.4482216152605},
    "torque": {"N m": 1.0, "N cm": 1e-2, "N mm": 1e-3, "mN m": 1e-3},
    "mass": {"kg": 1.0, "g": 1e-3, "lb": 0.45359237},
    "pressure": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "bar": 1e5, "mbar": 1e2, "psi": 6894.757293168361},
    "acceleration": {"m/s^2": 1.0, "mm/s^2": 1e-3},
    "frequency": {"Hz": 1.0, "rad/s": 0.5 / math.pi},
    "ratio": {"1": 1.0, "%": 0.01},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
}
"""Factors to SI units (angles to radians, frequencies to hertz) by quantity and unit."""
