"""Vibration that a fast move of the arm leaves, with the shapers for its modes: measured in simulated motion."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

import softrobots as sr

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
    share = np.linspace(0.0, 1.0, 201)
    bare = SimpleNamespace(times=DURATION * share, q_motors=begin + sr.quintic(share)[:, None] * (end - begin))
    settled = sr.solve_equilibrium(model, end, gravity=sr.EARTH_GRAVITY)
    shaper, numbers = CASES[name]
    shaped = sr.shape_input(bare, sr.vibration_modes(model, settled), shaper=shaper, numbers=numbers)
    start = sr.solve_equilibrium(model, begin, gravity=sr.EARTH_GRAVITY)
    options: dict[str, Any] = {"start": start, "gravity": sr.EARTH_GRAVITY, "time_step": STEP, "output_step": STEP}
    return shaped, sr.simulate(model, float(shaped.times[-1]) + AFTER, shaped, **options)


def left(shaped: sr.ShapedTrajectory, moved: sr.Motion, rest: Any) -> float:
    """Largest distance of the tip from where it comes to rest, after the motors have stopped [m]."""
    after = moved.time >= shaped.times[-1] - 1e-9
    return float(np.linalg.norm(moved.tip_position[after] - rest, axis=1).max())


def study() -> list[dict[str, Any]]:
    """A row for each shaper: time that it adds, modes, and for each size the vibration [m] and its share of the bare one."""
    model = sr.load_model(sr.InflatableArm())
    rest = sr.solve_equilibrium(model, TO, gravity=sr.EARTH_GRAVITY).tip_position
    rows: list[dict[str, Any]] = []
    for name in CASES:
        row: dict[str, Any] = {"shaper": name, "left_m": []}
        for size in SIZES:
            shaped, moved = move(model, size, name)
            row["left_m"].append(left(shaped, moved, rest))
        row |= {"longer_s": shaped.shaper.duration, "modes": [number + 1 for number in shaped.numbers]}
        row["percent"] = [100.0 * a / b for a, b in zip(row["left_m"], (rows or [row])[0]["left_m"], strict=True)]
        rows.append(row)
    return rows
