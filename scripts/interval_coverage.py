"""How often the 95 % intervals of fitted parameters hold the true value: many fits of one arm to measurements with noise.

The arm stands in 20 random postures under random forces; a camera sees its tip with normal errors of 2 mm. Each fit starts from
the same wrong values and has errors of its own. Intervals are those of rows, in every second fit with a standard deviation that
is known, and those of blocks, of which each posture is one. Prints a table; some minutes for 1,000 fits.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import positive_integer
from softrobots.core.files import new_file, write_text

NAMES = ("link[*].stiffness", "link[2].link_lengths", "motor[2].offset")
"""What is fitted."""
TRUE = (150.0, 200.0, 0.58, 0.03)
"""The true values [N m/rad, N m/rad, m, rad]."""
STD = 2e-3
"""Standard deviation of the errors of each coordinate of the tip [m]."""
KINDS = ("rows, std known", "rows, std unknown", "blocks")
"""Kinds of intervals."""


def coverage(count: int, seed: int) -> dict[str, dict[str, float]]:
    """Return the share of fits whose interval holds the true value [%], by kind of interval and parameter."""
    random, n = np.random.default_rng(seed), 20
    start = sr.InflatableArm(stiffness=172.0)
    loaded = sr.load_model(start)
    true = replace(start, stiffness=TRUE[:2], link_lengths=(0.6, TRUE[2]))
    model, offset = sr.load_model(true), np.array([0.0, TRUE[3], 0.0])
    motors, forces = random.uniform(-0.9, 0.9, (n, 3)), random.normal(0.0, 8.0, (n, 3))
    gravity = sr.EARTH_GRAVITY
    pairs = zip(motors + offset, forces, strict=True)
    tips = np.array([sr.solve_equilibrium(model, at, force, gravity=gravity).tip_position for at, force in pairs])
    held: dict[str, dict[str, list[bool]]] = {}
    for number in tqdm(range(count), leave=False):
        known = number % 2 == 0
        seen = tips + STD * random.standard_normal(tips.shape)
        rows = sr.Measurements(motors, force=forces, gravity=gravity, tip_position=seen, std=STD if known else None)
        found = sr.identify(loaded, rows, NAMES)
        for kind, intervals in ((KINDS[not known], found.intervals), (KINDS[2], found.block_intervals)):
            for (name, (low, high)), value in zip(intervals.items(), TRUE, strict=True):
                held.setdefault(kind, {}).setdefault(name, []).append(low <= value <= high)
    return {kind: {name: 100.0 * float(np.mean(each)) for name, each in held[kind].items()} for kind in KINDS}


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fits", type=int, default=1000, help="number of fits (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="seed of postures and errors (%(default)s)")
    parser.add_argument("--output", type=Path, metavar="FILE", help="new file for the numbers as JSON (none)")
    arguments = parser.parse_args(argv)

    def run() -> bool:
        positive_integer("--fits", arguments.fits)
        if arguments.output is not None:
            new_file(arguments.output, overwrite=False)
        found = coverage(arguments.fits, arguments.seed)
        print(f"| intervals, {arguments.fits} fits | " + " | ".join(found[KINDS[0]]) + " |")
        print("|---|" + "---|" * len(TRUE))
        for kind, shares in found.items():
            print(f"| {kind} | " + " | ".join(f"{share:.1f} %" for share in shares.values()) + " |")
        if arguments.output is not None:
            text = json.dumps({"fits": arguments.fits, "seed": arguments.seed, "coverage": found}, indent=1)
            write_text(arguments.output, text + "\n", overwrite=False)
        return True

    return exit_status(run)


if __name__ == "__main__":
    sys.exit(main())
