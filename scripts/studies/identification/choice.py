"""What it is worth to choose the poses that are measured, against random ones: the arm of `coverage`, before it is measured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import softrobots as sr
from studies.identification.coverage import GRAVITY, PARAMETERS, TRUTH, postures
from studies.shared.markdown import line

NUMBERS = (5, 10, 20, 40)
"""Numbers of poses that are chosen."""
CANDIDATES = 1000
"""Number of candidates: random postures with 0, 1 or 2 kg at the tip."""


def study(seed: int) -> dict[str, Any]:
    """Choose poses of random candidates; half widths of the intervals to expect, as geometric means over the parameters."""
    q_motors, masses = postures(CANDIDATES, seed)
    rows = []
    for n in NUMBERS:
        best = sr.informative_poses(TRUTH, PARAMETERS, q_motors, n, std={"tip_position": 1e-3}, mass=masses, gravity=GRAVITY)
        chosen, random, twice, _ = best.margins.values()
        ratios = {"random": chosen / random, "twice": chosen / twice}
        names = dict(zip(best.names, chosen.tolist(), strict=True))
        means = {name: float(np.exp(np.mean(np.log(ratio)))) for name, ratio in ratios.items()}
        worst = {f"worst_{name}": float(ratio.max()) for name, ratio in ratios.items()}
        rows.append({"n": n, "half_widths": names, **means, **worst})
    return {"candidates": CANDIDATES, "seed": seed, "rows": rows}


def table(result: Mapping[str, Any]) -> str:
    """The half widths with chosen poses, and their ratio to those of random ones, in Markdown."""
    names = ("link[1].stiffness", "link[2].stiffness", "hinge_offset")
    heads = ["poses", *(f"`{name}`" for name in names), "base, place", "base, angles"]
    heads += ["of as many at random", "(largest)", "of twice as many at random", "(largest)"]
    lines = [line(heads), line(["---:"] * len(heads))]
    for row in result["rows"]:
        half = row["half_widths"]
        cells = [f"{100.0 * half[name]:.3g} %" for name in names]
        cells += [f"{1e3 * max(half[f'base.{part}.{axis}'] for axis in 'xyz'):.2f} {unit}"
                  for part, unit in (("position", "mm"), ("rotation", "mrad"))]  # fmt: skip
        cells += [f"{row[name]:.2f}" for name in ("random", "worst_random", "twice", "worst_twice")]
        lines.append(line([row["n"], *cells]))
    return "\n".join(lines)
