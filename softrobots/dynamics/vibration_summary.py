"""Summary of vibration modes: the slowest ones, where they move the tip, and the mass that shakes."""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.summary import Part, Table


def modes_parts(modes: Any, count: int = 6) -> list[Part]:
    """Return the parts of the summary of `VibrationModes`: a table of the slowest, and the mass that shakes with the base."""
    shown = min(count, len(modes.frequencies))
    rows = [("mode", "frequency [Hz]", "damping ratio", "tip moves along", "effective mass x, y, z [kg]")]
    for place in range(shown):
        masses = "  ".join(f"{mass:.4f}" for mass in modes.effective_masses[place, :3])
        numbers = f"{modes.frequencies[place]:.6g}", f"{modes.damping_ratios[place]:.4g}"
        rows.append((str(place + 1), *numbers, _direction(modes.tip_shapes[:, place], modes.model.reach), masses))
    left = len(modes.frequencies) - shown
    more = f"and {left} faster ones, up to {modes.frequencies[-1]:.6g} Hz\n" if left else ""
    shaken = "  ".join(f"{mass:.4f}" for mass in modes.effective_masses.sum(axis=0)[:3])
    return [Table(rows), f"{more}mass that shakes with the base along x, y, z, in all modes: {shaken} kg"]


def _direction(moved: FloatArray, reach: float) -> str:
    """Where the tip goes in a mode, as a unit vector, or that it turns only."""
    size = float(np.linalg.norm(moved[:3]))
    if size <= 1e-6 * reach * float(np.linalg.norm(moved[3:])):
        return "nowhere: it turns"
    return "  ".join(f"{part:6.3f}" for part in moved[:3].round(9) / size + 0.0)
