"""Vibration that a fast move of the arm leaves, with the shapers for its modes: measured in simulated motion."""

from __future__ import annotations

from typing import Any

import numpy as np

import softrobots as sr
from studies.motion.examples import point_to_point, swing

FROM, TO = (0.3, 0.6, -0.8), (0.8, 0.3, -0.3)
"""Motor angles where the move begins and ends [rad]."""
DURATION, AFTER, STEP = 0.5, 1.0, 2e-3
"""Time of the bare move, time over which the vibration after a move is measured, and step of time [s]."""
SIZES = (1.0, 0.5, 0.1)
"""Sizes of the move, as shares of the whole, all with the same end."""
CASES = {"none": ("zv", ()), "ZV": ("zv", None), "ZVD": ("zvd", None), "ZVD, both modes": ("zvd", (0, 1)), "EI": ("ei", None)}
"""Shaper, and numbers of its modes (None: those that matter)."""


def move(model: sr.SoftModel, size: float, name: str) -> tuple[sr.ShapedTrajectory, sr.Motion]:
    """Simulate the move with a shaper of `CASES`, under weight, until `AFTER` its end."""
    end = np.array(TO)
    begin = end + size * (np.array(FROM) - end)
    bare = point_to_point(begin, end, DURATION, 201)
    settled = sr.solve_equilibrium(model, end, gravity=sr.EARTH_GRAVITY)
    shaper, numbers = CASES[name]
    shaped = sr.shape_input(bare, sr.vibration_modes(model, settled), shaper=shaper, numbers=numbers)
    start = sr.solve_equilibrium(model, begin, gravity=sr.EARTH_GRAVITY)
    options: dict[str, Any] = {"start": start, "gravity": sr.EARTH_GRAVITY, "time_step": STEP, "output_step": STEP}
    return shaped, sr.simulate(model, float(shaped.times[-1]) + AFTER, shaped, **options)


def study() -> list[dict[str, Any]]:
    """A row for each shaper: time that it adds, modes, and for each size the vibration [m] and its share of the bare one."""
    model = sr.load_model(sr.InflatableArm())
    rows: list[dict[str, Any]] = []
    for name in CASES:
        row: dict[str, Any] = {"shaper": name, "left_m": []}
        for size in SIZES:
            shaped, moved = move(model, size, name)
            row["left_m"].append(swing(moved))
        row |= {"longer_s": shaped.shaper.duration, "modes": [number + 1 for number in shaped.numbers]}
        row["percent"] = [100.0 * a / b for a, b in zip(row["left_m"], (rows or [row])[0]["left_m"], strict=True)]
        rows.append(row)
    return rows
