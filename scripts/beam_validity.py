"""Compare the pseudo-rigid links of the inflatable arm with inflated beams: where they hold, and what lumping costs.

The beam is that of Troise et al. 2021, equation (1), and the same as a geometrically exact rod by a boundary-value solve
(scipy.integrate.solve_bvp): it bends with (E + P/S) I and shears with P + j G S.

- One link under a transverse force at its end, over pressure and force: tip deflection and rotation of (1) and of pseudo-rigid
  links against the exact beam; the line where the link wrinkles; where each leaves the exact beam by 1 and by 5 %.
- The arm of two links in random postures under random forces up to wrinkling: tip error of the pseudo-rigid arms against two
  beams with motors between; then against beams that also twist and stretch.

Prints Markdown tables; about two minutes. Needs a checkout and SciPy (extra `dev`): the rods are those of the tests.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_text
from softrobots.view.figures import canvas
from studies.beam_validity.arm import study_arm
from studies.beam_validity.link import study_link
from studies.beam_validity.pictures import arm_figure, link_figure
from studies.beam_validity.tables import table
from studies.shared.checkout import CHECKOUT, test_support
from studies.shared.folders import free_folder
from studies.shared.recorded_run import check_page, command_of, write_record

PAGE = "agreement.md"
PICTURES = ("beam_validity.png", "arm_lumping.png")
PRESSURES = (5_000, *range(10_000, 60_001, 10_000))
"""Of the map [Pa]."""
LOADS = (1, *range(4, 101, 4))
"""Tip forces of the map [N]."""
DIGITS = 6
"""Of the recorded numbers."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--cases", type=int, default=400, help="postures and forces of the arm (%(default)s)")
    result.add_argument("--seed", type=int, default=2026, help="seed of these (%(default)s)")
    result.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    help_text = f"new or empty folder for beam_validity.json, beam_validity.md and {' and '.join(PICTURES)} (none)"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = "write tables into docs/agreement.md, docs/validation/beam_validity.json and pictures, of a checkout (this)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def rounded(value: Any) -> Any:
    """The same with all numbers to `DIGITS` digits."""
    if isinstance(value, Mapping):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    for option, value, least in (("--cases", arguments.cases, 1), ("--seed", arguments.seed, 0)):
        if value < least:
            raise sr.ParameterError(option, value, f"at least {least}")
    if arguments.docs is not None:
        check_page(arguments.docs, "beam_validity", page=PAGE)
    if arguments.output is not None or arguments.docs is not None:
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    rods = test_support("inflated_rods")
    link = study_link(rods, PRESSURES, LOADS)
    arm, errors = study_arm(rods, arguments.cases, arguments.seed)
    result = rounded({"link": link, "arm": arm})
    text = json.dumps(result, indent=1, allow_nan=False)
    print(text if arguments.json else f"\n{table(result)}")
    if folder is None and arguments.docs is None:
        return
    figures = dict(zip(PICTURES, (link_figure(link), arm_figure(rods, arm, errors)), strict=True))
    if folder is not None:
        make_folder(folder)
        write_text(folder / "beam_validity.json", text + "\n", overwrite=False)
        write_text(folder / "beam_validity.md", table(result) + "\n", overwrite=False)
        for name, figure in figures.items():
            canvas.write_png(figure, folder / name, overwrite=False)
    if arguments.docs is not None:
        for name, figure in figures.items():
            canvas.write_png(figure, arguments.docs / "docs" / "images" / name, overwrite=True)
        command = command_of("beam_validity", parser(), arguments, "cases", "seed")
        write_record(arguments.docs, "beam_validity", table(result), result, command=command, page=PAGE)


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
