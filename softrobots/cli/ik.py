"""`softrobots ik`: motors that put the loaded tip at a target, or move it along a path."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pinocchio as pin

from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.options.load_argument import add_environment, add_loads, loads_of
from softrobots.cli.options.output_files import (
    RESULT_FILES,
    ROS_FILES,
    ROS_FORMS,
    add_output,
    add_plot,
    check_files,
    save,
    write_plot,
)
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.reports.robot_answers import solution_answer, trajectory_answer
from softrobots.core.checks import finite_array
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.inverse_kinematics import ELBOWS, solve_ik
from softrobots.statics.time_law import read_waypoints
from softrobots.statics.tip_search import POSITION_TOLERANCE
from softrobots.statics.trajectory import METHODS, follow_trajectory
from softrobots.view.figures.picture import plot

_EXAMPLES = """examples:
  softrobots ik inflatable_arm --target 0.9 0.3 0.2 --force 0 10 -15 --elbow up
  softrobots ik inflatable_arm --waypoints path.csv --force 0 10 -15 -o followed.csv --plot poses.png
  softrobots ik pcc_arm --target 0.3 -0.2 0.9 --orientation 0.5 0 1 --gravity
  softrobots ik inflatable_arm --set wrist=[0.08,0.12] --target 0.9 0.3 0.1 --rpy 0 1.57 0 --force 0 10 -15
  softrobots ik inflatable_arm --target 0.9 0.3 0.2 --gravity --json
  softrobots ik inflatable_arm --target 0.9 0.3 0.2 --gravity --environment room.yaml
"""

_STARTS = 24


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "ik",
        help="find motors that put the loaded tip at a target, or along a path",
        description="Find motor coordinates at which the loaded, deformed tip is at a target, or follows waypoints. Of the "
        "solutions found it prints the one that changes the start least, and the others. Exit status 0 if every target is "
        "reached, 1 if not, 2 after bad input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    what = parser.add_mutually_exclusive_group(required=True)
    add_numbers(what, "--target", "X Y Z", "position of the loaded tip, world axes [m] (this or --waypoints is required)")
    help_text = (
        "CSV file of positions of the loaded tip, columns t, x, y, z [s, m]; without t 0.05 s apart; with columns roll, pitch, "
        "yaw as in URDF [rad], of poses"
    )
    what.add_argument("--waypoints", type=Path, metavar="FILE.csv", help=help_text)
    how = parser.add_mutually_exclusive_group()
    help_text = "direction of the tip's z axis at --target, of any length [-] (any); a wrist's hand points along x: use --rpy"
    add_numbers(how, "--orientation", "X Y Z", help_text)
    add_numbers(how, "--rpy", "R P Y", "orientation of the tip at --target, roll, pitch and yaw as in URDF [rad] (any)")
    add_loads(parser)
    add_environment(parser)
    help_text = "where the search starts: motor joints, then muscles, base to tip, or each as NAME=Q [rad, m, N or Pa] "
    help_text += "(relaxed)"
    add_motors(parser, help_text, "--start")
    help_text = (
        "side of the last motor joint, without a wrist, above or below the line from the first one to the tip; of a path at "
        "its start (either)"
    )
    parser.add_argument("--elbow", choices=ELBOWS, help=help_text)
    help_text = "newton, fixed_point of the paper, or paper: its closed loop, for --waypoints (%(default)s)"
    parser.add_argument("--method", choices=METHODS, default="newton", help=help_text)
    help_text = f"largest distance of the tip from a target [m] ({POSITION_TOLERANCE:g}); not for --method paper"
    add_numbers(parser, "--tolerance", "D", help_text)
    parser.add_argument("--starts", type=int, metavar="N", help=f"number of searches for --target [-] ({_STARTS})")
    help_text = "go on from the nearest solution where a waypoint cannot be reached by a continuous motion (an error)"
    parser.add_argument("--allow-jumps", action="store_true", help=help_text)
    add_output(parser, "the solution or trajectory", ROS_FORMS)
    add_plot(parser, "the loaded shape, with the path of the tip")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Solve and print the answer."""
    _refuse_contradictions(arguments)
    check_files(arguments, *RESULT_FILES, *ROS_FILES)
    path = None if arguments.waypoints is None else read_waypoints(arguments.waypoints)
    model = statics_model_of(arguments)
    options = {
        **loads_of(arguments, model),
        "q_motors0": None if arguments.start is None else motors_of(model, arguments.start, "--start"),
        "elbow": arguments.elbow,
        "method": arguments.method,
        "tolerance": POSITION_TOLERANCE if arguments.tolerance is None else arguments.tolerance,
    }
    if path is None:
        _reach(arguments, model, options)
        return
    trajectory = follow_trajectory(
        model, path.targets, **options, times=path.times, allow_jumps=arguments.allow_jumps, progress="waypoints"
    )
    files = save(arguments, trajectory) + write_plot(arguments, lambda: plot(trajectory))
    print_answer(arguments, trajectory_answer(trajectory), trajectory.summary(None), files)


def _reach(arguments: argparse.Namespace, model: SoftModel, options: dict[str, Any]) -> None:
    orientation = arguments.orientation
    if arguments.rpy is not None:
        orientation = pin.rpy.rpyToMatrix(*finite_array("--rpy", arguments.rpy, (3,), "rad"))
    starts = _STARTS if arguments.starts is None else arguments.starts
    try:
        solution = solve_ik(model, arguments.target, orientation=orientation, starts=starts, **options)
    except ParameterError as error:
        if arguments.rpy is None or error.field != "orientation":
            raise
        raise ParameterError("--rpy", arguments.rpy, error.requirement) from error
    files = save(arguments, solution) + write_plot(arguments, lambda: plot(solution))
    print_answer(arguments, solution_answer(solution), solution.summary(None), files)


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    """Refuse options that have no effect with the others."""
    single = arguments.target is not None
    paper = arguments.method == "paper"
    given = {
        "--orientation": (arguments.orientation is not None and not single, "--target"),
        "--rpy": (arguments.rpy is not None and not single, "--target"),
        "--starts": (arguments.starts is not None and not single, "--target"),
        "--allow-jumps": (arguments.allow_jumps and single, "--waypoints"),
        "--method": (paper and single, "--waypoints, or another method"),
        "--tolerance": (arguments.tolerance is not None and paper, "another method than paper"),
    }
    for option, (wrong, requirement) in given.items():
        if wrong:
            value = getattr(arguments, option.removeprefix("--").replace("-", "_"))
            raise ParameterError(option, value, f"given with {requirement}")
