"""`softrobots branches`: where a push buckles a robot, and every branch of equilibria beyond."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from softrobots.cli.options.command_line import add_gravity, add_numbers, gravity_of
from softrobots.cli.options.output_files import add_output, add_plot, check_files, save, write_plot
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.core.errors import NoCriticalLoad
from softrobots.core.summary import text_of
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch, branch_parts
from softrobots.statics.buckling.post_buckling import post_buckling_branches
from softrobots.view.figures.equilibria import branches

_EXAMPLES = """examples:
  softrobots branches inflatable_arm --direction -1 0 0 --plot branches.png
  softrobots branches inflatable_arm --set max_moment=21.76 --direction -1 0 0 --max-force 150 -o branches.npz
  softrobots branches my_rod.urdf --direction 0 0 -1 --gravity --json
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "branches",
        help="follow the equilibria of a robot that buckles",
        description="Follow the equilibrium under a growing force to where it loses its stability, and every branch of "
        "equilibria that leaves it, stable or not. Exit status 0 if there is such a force, 1 if none, 2 after bad input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    add_motors(parser)
    help_text = "direction of the growing force, any length, world axes [-] (required)"
    add_numbers(parser, "--direction", "X Y Z", help_text, required=True)
    parser.add_argument("--frame", metavar="LINK", help="link that is pushed (the tip)")
    add_gravity(parser)
    add_numbers(parser, "--max-force", "F", "force at which branches end [N] (1.25 times the critical one)")
    help_text = "largest distance between two points of a branch [rad or m] (%(default)s)"
    add_numbers(parser, "--largest-step", "S", help_text, default=0.05)
    add_output(parser, "the branches")
    add_plot(parser, "the way of the tip across the push and the stability over the force")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> bool:
    """Follow the branches and print the answer; tell whether there are any."""
    check_files(arguments)
    model = statics_model_of(arguments)
    motors = motors_of(model, arguments.motors)
    options = {"frame": arguments.frame, "gravity": gravity_of(arguments), "largest_step": arguments.largest_step}
    try:
        found = post_buckling_branches(model, motors, arguments.direction, max_force=arguments.max_force, **options)
    except NoCriticalLoad as error:
        answer = {"branches": [], "stable_up_to": error.max_force, "units": {"stable_up_to": "N"}}
        print_answer(arguments, answer, [f"no branches: {error}"], [])
        return False
    files = save(arguments, found) + write_plot(arguments, lambda: branches(found))
    print_answer(arguments, _answer(found), text_of(branch_parts(found), None), files)
    return True


def _answer(found: Sequence[EquilibriumBranch]) -> dict[str, Any]:
    units = {"forces": "N", "crossings": "N", "tip_positions": "m", "energy": "J", "softest": "-", "q_springs": "rad or m"}
    names = ("label", "ended", "forces", "crossings", "energy", "softest", "stable", "neutral")
    rows = [
        {
            **{name: getattr(branch, name) for name in names},
            "q_springs": [one.q_springs for one in branch.equilibria],
            "tip_positions": [one.tip_position for one in branch.equilibria],
        }
        for branch in found
    ]
    return {"branches": rows, "units": units}
