"""Validate the geometry of the helical tube: every section boundary of its chains against the analytic helix.

Three sets of tubes, each as sections of constant strain and as lumped hinges: the committed URDF files, a grid of actuators
(the paper's angles and contractions, two diameters, both hands, one and four turns), and random actuators. Each is written as
URDF, read by Pinocchio, and put at zero. The frames at the ends of the sections (lumped: at the hinges) and at the tip are
compared with the closed form of softrobots.helix, in position and orientation.

Prints a Markdown table, and writes it as JSON, every tube as a line of a CSV file, and a picture into a new folder; about two
minutes. Ends with status 1 if an error exceeds the tolerance.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from datetime import datetime
from pathlib import Path

from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_bytes, write_text
from softrobots.view.figures import canvas
from studies.helix_validation.comparison import measure, summary
from studies.helix_validation.report import csv_of, figure, table
from studies.helix_validation.tubes import committed, drawn, grid
from studies.shared.folders import free_folder

NAMES = ("helix_validation.json", "helix_validation.csv", "helix_validation.png")
DOCS = Path(__file__).resolve().parent.parent / "docs" / "images"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--cases", type=int, default=20, help="number of random actuators (%(default)s)")
    options.add_argument("--seed", type=int, default=2026, help="seed of the random actuators (%(default)s)")
    options.add_argument("--no-grid", action="store_true", help="leave out the grid of 120 actuators")
    help_text = "largest error that passes, in metres and in radians (%(default)g)"
    options.add_argument("--tolerance", type=float, default=1e-12, help=help_text)
    help_text = "new or empty folder of the results (output/helix_validation_<time>)"
    options.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = "write the picture into this folder (docs/images) too, replacing it"
    options.add_argument("--docs", type=Path, nargs="?", const=DOCS, metavar="FOLDER", help=help_text)
    options.add_argument("--no-plots", action="store_true", help="leave out the picture, which needs matplotlib")
    return options


def run(arguments: argparse.Namespace) -> bool:
    """Compare all tubes and write the results; return whether every tube is on its helix."""
    for option, value in (("--cases", arguments.cases), ("--seed", arguments.seed)):
        if value < 0:
            raise sr.ParameterError(option, value, "zero or more")
    if not 0.0 < arguments.tolerance < math.inf:
        raise sr.ParameterError("--tolerance", arguments.tolerance, "positive")
    if arguments.docs is not None and arguments.no_plots:
        raise sr.ParameterError("--docs", arguments.docs, "given without --no-plots")
    if not arguments.no_plots:
        canvas.require_matplotlib()  # raises at once if it is missing
    folder = free_folder(arguments.output or Path("output") / f"helix_validation_{datetime.now():%Y%m%d_%H%M%S}")
    cases = [*committed(), *([] if arguments.no_grid else grid()), *drawn(arguments.cases, arguments.seed)]
    rows = [measure(case) for case in tqdm(cases, desc="tubes", unit="tube")]
    lines = summary(rows)
    passed = all(max(row.distance, row.angle) <= arguments.tolerance for row in rows)
    print(f"\nDistance of the boundaries of the chains from the analytic helix; tolerance {arguments.tolerance:g} m and rad")
    print(f"\n{table(lines)}\n\n{'passed' if passed else 'FAILED: an error exceeds the tolerance'}")
    make_folder(folder)
    document = {"seed": arguments.seed, "tolerance": arguments.tolerance, "passed": passed, "table": lines}
    files = [write_text(folder / NAMES[0], json.dumps(document, indent=2) + "\n", overwrite=False)]
    files.append(write_text(folder / NAMES[1], csv_of(rows), overwrite=False))
    if not arguments.no_plots:
        files.append(canvas.write_png(figure(rows, arguments.tolerance), folder / NAMES[2], overwrite=False))
        if arguments.docs:  # the same bytes: the layout of a figure moves when it is drawn again
            files.append(write_bytes(arguments.docs / NAMES[2], files[-1].read_bytes(), overwrite=True))
    print(f"\nwritten: {', '.join(map(str, files))}")
    return passed


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0 if every tube is on its helix, 1 if not, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
