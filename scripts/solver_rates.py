"""How often the solvers find the answer, over random cases: equilibria at several loads, and load estimation.

Motor angles are uniform in [-pi, pi], force directions uniform on the sphere. The loads go far beyond wrinkling (the prototype
wrinkles at 4 to 25 N m, that is at about 4 to 20 N): they test the solvers, not the robot.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import new_file, write_text


def random_cases(load: float, count: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield motor angles, shape (3,) [rad], and forces of size `load`, shape (3,) [N]."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        direction = random.normal(size=3)
        yield random.uniform(-np.pi, np.pi, 3), load * direction / np.linalg.norm(direction)


def equilibrium_rate(model: sr.SoftModel, load: float, method: str, count: int, seed: int) -> float:
    """Share of cases that end in an equilibrium certified stable [%]."""
    found = 0
    cases = random_cases(load, count, seed)
    for motors, force in tqdm(cases, total=count, desc=f"equilibrium, {method}, {load:g} N", leave=False):
        try:
            found += sr.solve_equilibrium(model, motors, force, method=method).stable
        except sr.EquilibriumNotFound:
            continue
    return 100.0 * found / count


def estimation_rate(model: sr.SoftModel, load: float, method: str, count: int, seed: int) -> float:
    """Share of cases in which the true force comes back to 1e-6 relative [%]."""
    found = 0
    cases = random_cases(load, count, seed)
    for motors, force in tqdm(cases, total=count, desc=f"load estimation, {method}, {load:g} N", leave=False):
        torques = sr.solve_equilibrium(model, motors, force, tolerance=1e-13).motor_torques
        try:
            estimate = sr.estimate_load(model, motors, torques, method=method, restart=False)
        except sr.LoadNotFound:
            continue
        found += float(np.linalg.norm(estimate.force - force)) <= 1e-6 * load
    return 100.0 * found / count


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=_count, default=10_000, help="random cases a load (%(default)s)")
    parser.add_argument(
        "--loads", type=_size, nargs="+", default=[18, 50, 100, 150, 200], help="force sizes [N] (18 50 100 150 200)"
    )
    parser.add_argument("--estimation-loads", type=_size, nargs="+", default=[5, 18, 50], help="force sizes [N] (5 18 50)")
    parser.add_argument("--seed", type=int, default=0, help="of the random cases (%(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rates to a new file")
    arguments = parser.parse_args(argv)
    return exit_status(lambda: run(arguments))


def run(arguments: argparse.Namespace) -> None:
    """Measure the rates, write them if asked, and print them as two tables."""
    if arguments.json is not None:
        new_file(arguments.json, overwrite=False)  # tells at once
    model = sr.load_model(sr.InflatableArm())
    count, seed = arguments.cases, arguments.seed
    equilibria = {
        method: {load: equilibrium_rate(model, load, method, count, seed) for load in arguments.loads}
        for method in ("newton", "fixed_point")
    }
    estimates = {
        method: {load: estimation_rate(model, load, method, count, seed) for load in arguments.estimation_loads}
        for method in ("newton", "alternation")
    }
    if arguments.json is not None:
        record = {"cases": count, "seed": seed, "equilibrium": equilibria, "load_estimation": estimates}
        write_text(arguments.json, json.dumps(record, indent=2) + "\n", overwrite=False)
    print(f"{count} random cases a load, seed {seed}; loads beyond wrinkling test the solvers, not the robot\n")
    print("Equilibria certified stable [%]\n\n" + _table(equilibria))
    print("\nTrue force recovered to 1e-6 from motor torques [%]\n\n" + _table(estimates))


def _count(text: str) -> int:
    value = int(text)
    if value <= 0:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number of cases")
    return value


def _size(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"{text} is not a positive, finite force [N]")
    return value


def _table(rates: dict[str, dict[float, float]]) -> str:
    loads = list(next(iter(rates.values())))
    lines = ["| method | " + " | ".join(f"{load:g} N" for load in loads) + " |", "|---|" + "---|" * len(loads)]
    lines += [f"| {method} | " + " | ".join(f"{rate:.2f}" for rate in row.values()) + " |" for method, row in rates.items()]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
