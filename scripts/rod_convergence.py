"""Compare the rigid chains of a continuum arm with rod theory: tip error against the number of sections, with its order.

Two rods, each as sections of constant strain and as lumped hinges (corrected, and in the middle of their sections):

- a clamped rod under a tip force, against the planar elastica (elliptic integrals);
- a steel rod under random forces and moments at its middle and its tip, bent by up to about 90 degrees out of plane, against a
  Kirchhoff rod (scipy.integrate.solve_bvp, tolerance 1e-9). Models with an even number of sections: half before the middle.

Prints Markdown tables and the time of a solve. Needs SciPy (extra `dev`) and a checkout: the rod solutions are those of the
tests. With --output the numbers and a picture are written, as in docs/rod_convergence.json and docs/images/rod_convergence.png.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import softrobots as sr
from softrobots import plots
from softrobots.files import new_file

ROOT = Path(__file__).resolve().parent.parent
FORMS = {
    "sections": {"chain": "sections"},
    "lumped": {"chain": "lumped", "extension": False},
    "lumped, midpoint": {"chain": "lumped", "extension": False, "hinge_rule": "midpoint"},
}
"""Forms of the chain."""
PLANAR = (1, 2, 4, 8, 16, 32)
SPATIAL = (4, 10, 20, 30, 50)
LOAD = 4.0
"""Tip force of the planar rod, F l^2 / EI."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--cases", type=int, default=100, help="random load cases of the steel rod (%(default)s)")
    made.add_argument("--seed", type=int, default=2026, help="seed of the load cases (%(default)s)")
    made.add_argument("--output", type=Path, metavar="FOLDER", help="folder for rod_convergence.json and images/ (none)")
    made.add_argument("--overwrite", action="store_true", help="replace those files if they are there")
    return made


def passive_rod(rod: Any, lengths: tuple[float, ...], each: int, form: str) -> sr.SoftModel:
    """Load a rod without muscles, with `each` sections or hinges a segment."""
    return sr.load_model(
        sr.PccArm(
            segment_lengths=lengths, offset=0.0, muscle_azimuths=(), bending_stiffness=rod.bending_stiffness,
            torsional_stiffness=rod.torsional_stiffness, axial_stiffness=rod.axial_stiffness or 1e9, linear_density=0.0158,
            radius=0.0008, elastic_sections=each, hinges=each, **FORMS[form],
        )
    )  # fmt: skip


def planar(rods: Any, progress: Callable[[Any], Any]) -> dict[str, list[float]]:
    """Tip error over the length, by form, for each number of sections."""
    rod = rods.Rod(1.0, 1.0, 0.8)
    force = LOAD * rod.bending_stiffness / rod.length**2
    x, z, _ = rods.elastica_tip(rod.bending_stiffness, rod.length, force)
    errors: dict[str, list[float]] = {form: [] for form in FORMS}
    for form, n in progress([(form, n) for form in FORMS for n in PLANAR]):
        tip = sr.solve_equilibrium(passive_rod(rod, (rod.length,), n, form), (), (force, 0.0, 0.0)).tip_position
        errors[form].append(float(math.hypot(tip[0] - x, tip[2] - z)) / rod.length)
    return errors


def spatial(rods: Any, cases: int, seed: int, progress: Callable[[Any], Any]) -> dict[str, list[dict[str, float]]]:
    """Tip errors and times of the steel rod, by form, for each number of sections."""
    rod = rods.steel_rod()
    wrenches = rods.random_wrenches(np.random.default_rng(seed), rod, cases)
    exact = [rods.rod_tip(rod, tip, mid) for tip, mid in progress(wrenches)]
    rows: dict[str, list[dict[str, float]]] = {form: [] for form in FORMS}
    for form, n in progress([(form, n) for form in FORMS for n in SPATIAL]):
        model = passive_rod(rod, (rod.length / 2, rod.length / 2), n // 2, form)
        sr.solve_equilibrium(model, ())  # makes Pinocchio's workspace
        errors, angles, times = [], [], []
        for (tip, mid), (position, rotation) in zip(wrenches, exact, strict=True):
            start = time.perf_counter()
            found = sr.solve_equilibrium(model, (), wrench={"tip": tip, "segment_1": mid})
            times.append(time.perf_counter() - start)
            errors.append(float(np.linalg.norm(found.tip_position - position)))
            turn = rotation.T @ np.array(found.transform_tip_to_world.rotation)
            angles.append(
                float(np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2)
            )
        rows[form].append(
            {
                "mean_mm": 1e3 * float(np.mean(errors)),
                "max_mm": 1e3 * float(np.max(errors)),
                "mean_mrad": 1e3 * float(np.mean(angles)),
                "median_ms": 1e3 * float(np.median(times)),
            }
        )
    return rows


def orders(numbers: tuple[int, ...], errors: list[float]) -> list[float]:
    """Observed order of convergence between neighbours."""
    return [math.log(errors[i] / errors[i + 1]) / math.log(numbers[i + 1] / numbers[i]) for i in range(len(numbers) - 1)]


def tables(result: dict[str, Any]) -> str:
    """Format the numbers as Markdown."""
    lines = ["| form | " + " | ".join(map(str, PLANAR)) + " | order |", "|---" * (len(PLANAR) + 2) + "|"]
    for form, errors in result["planar"].items():
        cells = [f"{error:.1e}" for error in errors]
        lines.append(f"| {form} | " + " | ".join(cells) + f" | {orders(PLANAR, errors)[-1]:.2f} |")
    lines += ["", "| form | " + " | ".join(map(str, SPATIAL)) + " | order |", "|---" * (len(SPATIAL) + 2) + "|"]
    for form, rows in result["spatial"].items():
        cells = [f"{row['mean_mm']:.3f} ({row['max_mm']:.2f})" for row in rows]
        order = orders(SPATIAL, [row["mean_mm"] for row in rows])[-1]
        lines.append(f"| {form} | " + " | ".join(cells) + f" | {order:.2f} |")
    return "\n".join(lines)


def timing(result: dict[str, Any]) -> str:
    """Format the times as Markdown."""
    lines = ["| form | " + " | ".join(map(str, SPATIAL)) + " |", "|---" * (len(SPATIAL) + 1) + "|"]
    for form, rows in result["spatial"].items():
        lines.append(f"| {form} | " + " | ".join(f"{row['median_ms']:.1f}" for row in rows) + " |")
    return "\n".join(lines)


def figure(result: dict[str, Any]) -> Any:
    """Draw the errors over the number of sections, with the slope of order two."""
    made = plots.new_figure((10.0, 4.4))
    left, right = made.subplots(1, 2)
    for number, form in enumerate(FORMS):
        style = {"color": plots.COLOURS[number], "marker": "os^"[number], "ls": ("-", "--", ":")[number], "label": form}
        left.loglog(PLANAR, result["planar"][form], **style)
        right.loglog(SPATIAL, [row["mean_mm"] for row in result["spatial"][form]], **style)
    right.axhline(0.1, color="0.4", lw=1.0)
    right.annotate("0.1 mm", (SPATIAL[0], 0.1), textcoords="offset points", xytext=(0, 4), color="0.3")
    for axes, numbers, start in ((left, PLANAR, result["planar"]["sections"][0]), (right, SPATIAL, None)):
        level = 2.0 * (start or result["spatial"]["lumped"][0]["mean_mm"])
        axes.loglog(numbers, [level * (numbers[0] / n) ** 2 for n in numbers], color="0.6", lw=1.0, label="order 2")
        axes.set_xticks(numbers, [str(n) for n in numbers])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.legend(fontsize=9)
    left.set(xlabel="sections [-]", ylabel="tip error / length [-]", title=f"Planar elastica, F l²/EI = {LOAD:g}")
    right.set(xlabel="sections [-]", ylabel="mean tip error [mm]", title="Steel rod, 0.6 m, random wrenches")
    return made


def main(argv: list[str] | None = None) -> int:
    """Run from the command line."""
    arguments = parser().parse_args(argv)
    if arguments.cases < 1 or arguments.seed < 0:
        parser().error("--cases must be at least 1 and --seed at least 0")
    sys.path.insert(0, str(ROOT))  # for the rods of the tests
    try:
        from tqdm import tqdm

        from tests import rods
    except ImportError as error:
        print(f"error: {error}; this script needs a checkout and the extra 'dev' (SciPy)", file=sys.stderr)
        return 2
    files = []
    try:
        if arguments.output is not None:
            names = ("rod_convergence.json", "images/rod_convergence.png")
            files = [new_file(arguments.output / name, overwrite=arguments.overwrite) for name in names]
    except sr.SoftRobotsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    result = {
        "cases": arguments.cases,
        "seed": arguments.seed,
        "planar": planar(rods, lambda items: tqdm(items, desc="planar", unit="model")),
        "spatial": spatial(rods, arguments.cases, arguments.seed, lambda items: tqdm(items, desc="spatial")),
    }
    print(f"\nTip error over length, planar elastica, F l^2/EI = {LOAD:g}; then mean (largest) tip error [mm] of")
    print(f"{arguments.cases} random load cases of the steel rod; columns are numbers of sections or hinges")
    print(f"(a few cases say little about the order)\n\n{tables(result)}")
    print(f"\nMedian time of a solve [ms]\n\n{timing(result)}")
    if files:
        files[0].write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        figure(result).savefig(files[1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
