"""How often the 95 % intervals of fitted parameters hold the true values: a known arm, measured with noise and fitted often."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from typing import Any

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots.core.checks import FloatArray
from studies.shared.markdown import line

TRUTH = sr.InflatableArm(stiffness=(180.0, 240.0), hinge_offset=0.06)
"""The arm that is measured."""
START = sr.InflatableArm(stiffness=200.0, hinge_offset=0.05)
"""The arm from which each fit starts; its base stands in the origin, as that of the true one."""
PARAMETERS = ("link[*].stiffness", "hinge_offset", "base.position", "base.rotation")
"""What is fitted."""
POSTURES, REPEATS = 40, 3
"""Random postures with a load, each of which is a block of measurements, and how often each is measured."""
NOISES = {"independent": (1e-3, 0.0), "in blocks": (5e-4, 1e-3)}
"""Standard deviations of each component of each row, and of what all rows of a posture have in common [m]."""
GRAVITY = (0.0, 0.0, -9.81)
"""Of all measurements [m/s^2]."""
COLUMNS = ("mean", "scatter", "rows", "blocks")
"""What is told of each parameter: mean and standard deviation of the fitted values, rates of intervals that hold the truth."""


def postures(count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return random motor angles, shape (count, 3) [rad], and masses at the tip, shape (count,) [kg]."""
    random = np.random.default_rng(seed)
    return random.uniform(-1.0, 1.0, (count, 3)) * (1.5, 1.0, 1.5), random.choice([0.0, 1.0, 2.0], count)


@cache
def true_tips(seed: int) -> FloatArray:
    """Where the tip is in the postures, shape (POSTURES, 3) [m]."""
    model, cases = sr.load_model(TRUTH), zip(*postures(POSTURES, seed), strict=True)
    solved = [sr.solve_equilibrium(model, q, (0.0, 0.0, -9.81 * mass), gravity=GRAVITY) for q, mass in cases]
    return np.array([one.tip_position for one in solved])


def fitted(seed: int, noise: str, number: int) -> tuple[dict[str, float], list[list[bool]]]:
    """One fit: its values, and whether the intervals from rows and from blocks hold the truth."""
    random = np.random.default_rng((seed, *noise.encode(), number))
    (own, common), blocks = NOISES[noise], np.repeat(np.arange(POSTURES), REPEATS)
    (q_motors, masses), tips = postures(POSTURES, seed), true_tips(seed) + common * random.standard_normal((POSTURES, 3))
    rows = sr.Measurements(
        q_motors[blocks], mass=masses[blocks], gravity=GRAVITY, labels=[f"posture {one}" for one in blocks],
        tip_position=tips[blocks] + own * random.standard_normal((len(blocks), 3)),
    )  # fmt: skip
    fit = sr.identify(START, rows, PARAMETERS)
    kinds = (fit.intervals, fit.block_intervals)
    return fit.values, [[low <= true(name) <= high for name, (low, high) in ends.items()] for ends in kinds]


def true(name: str) -> float:
    """The true value of a parameter."""
    return {"link[1].stiffness": 180.0, "link[2].stiffness": 240.0, "hinge_offset": 0.06}.get(name, 0.0)


def study(fits: int, seed: int, processes: int = 1) -> dict[str, Any]:
    """Fit noisy measurements many times; the fitted values and how often each interval holds the truth.

    Args:
        fits: Number of fits for each kind of noise.
        seed: Seed of postures and noise.
        processes: How many work on it; the result does not depend on it.
    """
    found: dict[str, Any] = {}
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for noise in NOISES:
            done = pool.map(partial(fitted, seed, noise), range(fits), chunksize=10)
            values, held = zip(*tqdm(done, total=fits, desc=f"{noise} noise", unit="fit"), strict=True)
            numbers = np.array([list(one.values()) for one in values])
            columns = [numbers.mean(axis=0), numbers.std(axis=0), *np.mean(held, axis=0)]
            found[noise] = [
                {"parameter": name, "truth": true(name), **dict(zip(COLUMNS, row, strict=True))}
                for name, row in zip(values[0], np.transpose(columns).tolist(), strict=True)
            ]
    return {"fits": fits, "seed": seed, "noises": found}


def table(result: Mapping[str, Any]) -> str:
    """The coverage of each parameter in Markdown."""
    heads = [f"{noise} noise: intervals by {kind}" for noise in result["noises"] for kind in ("rows", "blocks")]
    lines = [line(["parameter", "truth", *heads]), line(["---"] + ["---:"] * (1 + len(heads)))]
    for rows in zip(*result["noises"].values(), strict=True):
        rates = [f"{100.0 * row[kind]:.1f} %" for row in rows for kind in ("rows", "blocks")]
        lines.append(line([f"`{rows[0]['parameter']}`", f"{rows[0]['truth']:g}", *rates]))
    return "\n".join(lines)
