"""Compare models of the same robot: tip error against the number of segments, with the observed order of convergence.

Chains of rigid links (pseudo-rigid links, lumped hinges, sections of constant strain) and the lumped chain in MuJoCo, against a
Kirchhoff rod by a boundary-value solve (scipy.integrate.solve_bvp). Robots:

- inflatable_link: one inflated link, horizontal, under a small and a large tip force;
- pcc_arm: two segments with muscles of given length, hanging, under a tip force and its weight;
- helix_tube: a tube that is a helix at rest, of one turn and of 2.7, under a tip force and its weight;
- steel_rod: a rod under random forces and moments at its middle and its tip, bent by up to about 90 degrees out of plane.

Prints Markdown tables; about five minutes. Needs a checkout and SciPy (extra `dev`): the rods are those of the tests.
"""

from __future__ import annotations

import argparse
import json
import sys
from functools import partial
from pathlib import Path

from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_text
from softrobots.view.figures import canvas
from studies.agreement.comparison import compare
from studies.agreement.pictures import figure
from studies.agreement.robots import STUDIES
from studies.agreement.tables import table
from studies.interop.tools import find_tool
from studies.shared.checkout import CHECKOUT
from studies.shared.folders import free_folder
from studies.shared.recorded_run import check_page, command_of, write_record

PAGE = "agreement.md"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = "robots, of %(choices)s (all)"
    result.add_argument("--robot", nargs="+", choices=list(STUDIES), default=list(STUDIES), metavar="ROBOT", help=help_text)
    result.add_argument("--cases", type=int, default=100, help="random loads of the steel rod (%(default)s)")
    result.add_argument("--seed", type=int, default=2026, help="seed of these loads (%(default)s)")
    result.add_argument("--no-mujoco", action="store_true", help="do without MuJoCo")
    result.add_argument("--json", action="store_true", help="print the numbers as one JSON object instead of tables")
    help_text = "new or empty folder for agreement.json, agreement.md and agreement.png (none)"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = "write tables of docs/agreement.md, docs/validation/agreement.json and the picture of a checkout (this one)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> None:
    """Do the whole job."""
    for option, value, least in (("--cases", arguments.cases, 1), ("--seed", arguments.seed, 0)):
        if value < least:
            raise sr.ParameterError(option, value, f"at least {least}")
    if arguments.docs is not None:
        if arguments.robot != list(STUDIES) or arguments.no_mujoco:
            raise sr.ParameterError("--docs", arguments.docs, "given without --robot and --no-mujoco")
        check_page(arguments.docs, "agreement", page=PAGE)
    if arguments.output is not None or arguments.docs is not None:
        canvas.require_matplotlib()
    folder = None if arguments.output is None else free_folder(arguments.output)
    if not arguments.no_mujoco:
        find_tool("MuJoCo").load()
    results = {}
    for robot in dict.fromkeys(arguments.robot):
        for name, study in STUDIES[robot](arguments.cases, arguments.seed).items():
            results[name] = compare(study, partial(tqdm, desc=name, unit="model"), mujoco=not arguments.no_mujoco)
    record = {"cases": arguments.cases, "seed": arguments.seed, "studies": results}
    text, shown = json.dumps(record, indent=1, allow_nan=False), table(results)
    if folder is not None:
        make_folder(folder)
        write_text(folder / "agreement.json", text + "\n", overwrite=False)
        write_text(folder / "agreement.md", shown + "\n", overwrite=False)
        canvas.write_png(figure(results), folder / "agreement.png", overwrite=False)
    if arguments.docs is not None:
        canvas.write_png(figure(results), arguments.docs / "docs" / "images" / "agreement.png", overwrite=True)
        command = command_of("agreement", parser(), arguments, "cases", "seed")
        write_record(arguments.docs, "agreement", shown, record, command=command, page=PAGE)
    print(text if arguments.json else f"\n{shown}")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0, or 2 after bad input, 1 if an equilibrium is not found."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
