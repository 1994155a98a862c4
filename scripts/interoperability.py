"""The same robots in other tools: where they stand in equilibrium, and where their links are, against Pinocchio.

Equilibrium: three robots in five poses, weightless and under gravity, with a force on the tip, motors at rest. Each simulator
gets the file that softrobots exports for it, and the force. Two answers are compared with Pinocchio's: where the simulator's
own generalised forces balance, and where 60 s of its simulation end, joints damped near critical. Which joint springs of a
URDF, MJCF or SDF file arrive there is measured: joints are displaced, and those that push back are counted.

Kinematics: each URDF file in urdf/, at 20 random configurations, in every tool that loads URDF.

Prints the tables, and writes every number as JSON if told. Takes minutes, half of one with --no-simulation. Ends with status 1
if a tool does not agree within its tolerance.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, new_file, write_text
from softrobots.view.figures import canvas
from studies.interop.measurement import POSES, ROBOTS, agreed, measure
from studies.interop.results import as_json, read_results, write_docs
from studies.interop.tables import document
from studies.interop.tools import TOOLS
from studies.shared.checkout import CHECKOUT


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"tools to ask, of {', '.join(TOOLS)} (those that are installed)"
    result.add_argument("--tools", nargs="+", choices=list(TOOLS), metavar="TOOL", help=help_text)
    help_text = "robots of the equilibria, of %(choices)s (all)"
    result.add_argument("--robots", nargs="+", choices=list(ROBOTS), default=list(ROBOTS), metavar="ROBOT", help=help_text)
    result.add_argument("--poses", type=int, default=POSES, help="poses of each robot, 1 to 5 (%(default)s)")
    result.add_argument("--no-simulation", action="store_true", help="compare where forces balance only, which is quick")
    only = result.add_mutually_exclusive_group()
    only.add_argument("--equilibrium-only", action="store_true", help="leave out the kinematics")
    only.add_argument("--kinematics-only", action="store_true", help="leave out springs and equilibria")
    result.add_argument(
        "--from", type=Path, dest="saved", metavar="FILE", help="make tables and pictures of saved results instead"
    )
    result.add_argument("--output", type=Path, metavar="FILE", help="also write the results to a new JSON file")
    help_text = "write docs/interoperability.json, docs/images/interoperability.png and the tables in docs/other_tools.md"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; return whether every tool agrees."""
    if not 1 <= arguments.poses <= POSES:
        raise sr.ParameterError("--poses", arguments.poses, f"from 1 to {POSES}")
    if arguments.docs is not None:
        canvas.require_matplotlib()  # tells at once what is missing
    if arguments.output is not None:
        new_file(arguments.output, overwrite=False)
    results = measure(arguments) if arguments.saved is None else read_results(arguments.saved)
    passed = agreed(results)
    print(f"\n{document(results)}\n\n{'all agree' if passed else 'FAILED: a tool does not agree'}")
    if arguments.output is not None:
        print(f"\nwritten: {write_text(arguments.output, as_json(results), overwrite=False)}")
    if arguments.docs is not None:
        print(f"\nwritten: {', '.join(map(str, write_docs(results, make_folder(arguments.docs))))}")
    return passed


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; 0 if every tool agrees, 1 if not, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
