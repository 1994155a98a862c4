"""Simulate released rods for ten seconds, as pairs of hinges, flexures and sections, and print how far off their tips are.

The rods stand upright under their weight; a force on the tip pulls it aside and lets it go. Each cell is the mean distance,
over ten seconds, of the tip from that of a reference rod of the tests (`tests/support/planar_rod.py`), with compiled steps by
default; then follow the distance of the reference from itself with one polynomial less, and by how much the simulations of
pairs and flexures are faster than the motion (seconds of motion by seconds of the processor; with steps of a given length the
least of several runs). Pairs bend and twist, sections and flexures of TPU stretch, too. Takes about ten minutes.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import sys
import time
from typing import Any

import numpy as np

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import finite_number, positive_integer, positive_number

FORMS = ("lumped", "flexures", "sections")
"""Chains that are compared."""
ROW = 0.05
"""Time between two tips [s]."""
RUNS = 15
"""Runs with steps of a given length, of which the fastest counts."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = "pairs of hinges, flexures or sections (%(default)s)"
    result.add_argument("--count", type=int, default=30, metavar="N", help=help_text)
    result.add_argument("--duration", type=float, default=10.0, metavar="T", help="of the motion [s] (%(default)g)")
    help_text = "steps of this length [s] (chosen by the error)"
    result.add_argument("--time-step", type=float, metavar="H", help=help_text)
    result.add_argument("--order", type=int, choices=(2, 4), default=2, help="of steps of a given length (%(default)d)")
    help_text = "of the pull to a plane of the hinges; the reference has no such planes [rad] (%(default)g)"
    result.add_argument("--angle", type=float, default=0.0, metavar="A", help=help_text)
    return result


def reference(rod: Any, force: float, duration: float) -> np.ndarray:
    """Path of the tip, with steps that are stable and short for the fastest mode, shape (n, 2) [m]."""
    rate = rod.frequencies()[-1]
    step = min(1.0 / rate, 2.0 / (rod.retardation * rate**2) if rod.retardation else np.inf)
    return np.asarray(rod.tips(rod.equilibrium((force, 0.0)), duration, round(duration / ROW), int(np.ceil(ROW / step))))


def off(
    rod: Any, form: str, count: int, force: float, path: np.ndarray, steps: dict[str, Any], angle: float = 0.0
) -> tuple[float, float]:
    """Mean distance of the tip of one of our chains from a path [m], and seconds of the processor for a second of motion."""
    model = sr.load_model(
        sr.PccArm(
            segment_lengths=(rod.length,), muscle_azimuths=(), radius=rod.radius, linear_density=rod.density * rod.area,
            bending_stiffness=rod.bending, torsional_stiffness=rod.bending / 1.5, axial_stiffness=rod.young * rod.area,
            chain=form, elastic_sections=count, hinges=count, extension=form == "flexures" and rod.stretches > 0,
        )
    )  # fmt: skip
    gravity, duration, solver = (0.0, rod.gravity[0], rod.gravity[1]), ROW * (len(path) - 1), sr.compile(model)
    aside = np.array([math.cos(angle), math.sin(angle), 0.0])
    start = sr.solve_equilibrium(model, (), force=force * aside, gravity=gravity)
    options: dict[str, Any] = {
        "start": start, "gravity": gravity, "damping_time": rod.retardation, "output_step": ROW, **steps,
    }  # fmt: skip
    solver.simulate(ROW, (), **options)  # compiles
    taken = np.inf
    for _ in range(RUNS if steps else 1):
        began = time.process_time()
        moved = solver.simulate(duration, (), **options)
        taken = min(taken, time.process_time() - began)
    tips = np.outer(path[:, 0], aside) + np.outer(path[:, 1], (0.0, 0.0, 1.0))
    return float(np.linalg.norm(moved.tip_position - tips, axis=1).mean()), taken / duration


def main(argv: list[str] | None = None) -> int:
    """Print the table and return the exit status."""
    args = parser().parse_args(argv)

    def run() -> None:
        steps: dict[str, Any] = {}
        if args.time_step is not None:
            steps = {"time_step": positive_number("time_step", args.time_step, "s"), "order": args.order}
        count, duration = positive_integer("count", args.count), positive_number("duration", args.duration, "s")
        _table(count, duration, steps, finite_number("angle", args.angle, "rad"))

    return exit_status(run)


def _table(count: int, duration: float, steps: dict[str, Any], angle: float) -> None:
    from tests.support.planar_rod import PlanarRod

    steel = PlanarRod(0.6, 0.8e-3, 200e9, 7850.0, gravity=(0.0, -9.81))
    tpu = PlanarRod(0.4, 5e-3, 70e6, 1200.0, stretches=6, gravity=(0.0, -9.81))
    print("| rod | tip aside | damping time | pairs | flexures | sections | reference | pairs, real time | flexures |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name, rod, force in (("steel", steel, 0.15), ("steel", steel, 0.6), ("TPU", tpu, 0.1), ("TPU", tpu, 0.3)):
        for damping, bends, most in ((0.0, 12, 6), (1e-3, 9, 3)):
            fine = dataclasses.replace(rod, retardation=damping, bends=bends, stretches=min(rod.stretches, most))
            path, aside = reference(fine, force, duration), fine.tip(fine.equilibrium((force, 0.0)))[0]
            coarse = reference(dataclasses.replace(fine, bends=bends - 1), force, duration)
            damped = dataclasses.replace(rod, retardation=damping)
            found = {form: off(damped, form, count, force, path, steps, angle) for form in FORMS}
            cells = [f"{1e3 * error:.2g} mm" for error, _ in found.values()]
            cells.append(f"{1e3 * np.linalg.norm(path - coarse, axis=1).mean():.1g} mm")
            words = f"{1e3 * damping:g} ms" if damping else "none"
            rates = [1.0 / found[form][1] for form in ("lumped", "flexures")]
            cells += [f"{rate:.0f}" if rate > 9.5 else f"{rate:.1f}" for rate in rates]
            print(f"| {name} | {aside:.2f} m | {words} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
