"""`softrobots solve`: the equilibrium of a loaded robot, with its certificates."""

from __future__ import annotations

import argparse
from typing import Any

from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.options.load_argument import add_environment, add_loads, loads_of
from softrobots.cli.options.output_files import add_output, add_plot, check_files, save, write_plot
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.reports.robot_answers import equilibrium_answer
from softrobots.core.checks import finite_array
from softrobots.statics.elastic_state import TOLERANCE
from softrobots.statics.elastostatics import METHODS
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.view.figures.picture import plot

_EXAMPLES = """examples:
  softrobots solve inflatable_arm --motors 0.3 0.6 -0.8 --force 0 10 -15
  softrobots solve inflatable_arm --set stiffness=200 --gravity --json
  softrobots solve inflatable_arm --force 0 10 -15 --wrench link_1 0 0 -5 0 0 0 -o sagging.npz
  softrobots solve pcc_arm --motors 0.50 0.53 0.55 0.54 0.51 0.52 --gravity --plot shape.png
  softrobots solve inflatable_arm --motors 0.3 0.6 -0.8 --gravity --environment room.yaml
  softrobots solve my_arm.urdf --spring wrist=40 --spring elbow=25,0.1 --tip tool --gravity
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "solve",
        help="find the equilibrium of a loaded robot",
        description="Find the static equilibrium of the springs at given motors, the one that energy descent reaches "
        "from the relaxed springs. Exit status 0 if one is found, also if it is not certified stable or a link is wrinkled: "
        "the answer says so. 1 if none is found, 2 after bad input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    add_motors(parser)
    add_loads(parser)
    add_environment(parser)
    parser.add_argument(
        "--method", choices=METHODS, default="newton", help="the solver; fixed_point is the paper's (%(default)s)"
    )
    help_text = "elastic coordinates where the descent starts, in the order of the answer [rad or m] (relaxed)"
    add_numbers(parser, "--start", "Y", help_text, nargs="+")
    help_text = f"largest residual, relative to the size of the load [-] ({TOLERANCE:g})"
    add_numbers(parser, "--tolerance", "T", help_text, default=TOLERANCE)
    add_output(parser, "the equilibrium")
    add_plot(parser, "the loaded shape")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Solve and print the answer."""
    check_files(arguments)
    model = statics_model_of(arguments)
    motors = motors_of(model, arguments.motors)
    start = None if arguments.start is None else finite_array("--start", arguments.start, (model.n_springs,), "rad or m")
    equilibrium = solve_equilibrium(
        model,
        motors,
        **loads_of(arguments, model),
        method=arguments.method,
        q_springs0=start,
        tolerance=arguments.tolerance,
    )
    files = save(arguments, equilibrium) + write_plot(arguments, lambda: plot(equilibrium))
    print_answer(arguments, equilibrium_answer(equilibrium), equilibrium.summary(None), files)
