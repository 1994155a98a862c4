"""Grip force of a helical tube around the instrumented cylinder of [Blumenschein 2018], from the chain in contact.

The chain is solved around two half-cylinders that stand 3 mm apart, for the paper's three deflections and in four directions
of the cut; force and bounds of the closed form stand beside it. Prints a Markdown table; about three minutes.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from tqdm import tqdm

from softrobots.cli.options.command_line import exit_status
from studies.contact.helix_grip import CYLINDER, GAPS, fitted_grip

CUTS = np.arange(4) * np.pi / 4


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    text = "bending stiffness of the wall [N m^2], one or several (%(default)s)"
    options.add_argument("--stiffness", type=float, nargs="+", default=[0.0025, 0.005, 0.01], metavar="EI", help=text)
    options.add_argument("--pressure", type=float, default=10e3, help="gauge pressure [Pa] (%(default)s)")
    options.add_argument("--sections", type=int, default=32, help="sections of the chain (%(default)s)")
    return options


def cell(forces: list[float], lost: int) -> str:
    """Mean force over the cuts with its range, and in how many of them the tube let go."""
    if not forces:
        return "lets go"
    text = f"{np.mean(forces):.2f} ({min(forces):.2f} to {max(forces):.2f})"
    return f"{text}, lets go at {lost} of {len(CUTS)} cuts" if lost else text


def run(arguments: argparse.Namespace) -> None:
    """Print the table."""
    cases = [(stiffness, deflection) for stiffness in arguments.stiffness for deflection in CYLINDER.deflections]
    gaps = " | ".join(f"gap {1e3 * gap:g} mm [N]" for gap in GAPS)
    lines = [f"| EI [N m^2] | deflection | {gaps} | (a) [N] | (b) [N] |", "|" + "---|" * (4 + len(GAPS))]
    for stiffness, deflection in tqdm(cases, unit="tube"):
        grip = fitted_grip(deflection, sections=arguments.sections, bending_stiffness=stiffness, pressure=arguments.pressure)
        forces: list[list[float]] = [[] for _ in GAPS]
        for azimuth in CUTS:
            for row, found in zip(forces, grip.around(GAPS, azimuth), strict=False):
                row.append(float(np.mean(grip.force(found, azimuth))))
        closed = CYLINDER.force(arguments.pressure, deflection)
        cells = " | ".join(cell(row, len(CUTS) - len(row)) for row in forces)
        bounds = f"{float(closed.unwrapping):.2f} | {float(closed.contact):.2f}"
        lines.append(f"| {stiffness:g} | {1e3 * deflection:g} mm | {cells} | {bounds} |")
    print("\n".join(lines))


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
