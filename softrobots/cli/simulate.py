"""`softrobots simulate`: the motion of a robot under moving motors and loads."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import add_damping, add_numbers
from softrobots.cli.options.load_argument import add_loads, loads_of
from softrobots.cli.options.output_files import (
    RESULT_FILES,
    ROS_FILES,
    ROS_FORMS,
    add_output,
    add_plot,
    check_files,
    check_plot,
    save,
    write_plot,
)
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.reports.robot_answers import motion_answer
from softrobots.core.checks import FloatArray, finite_array, positive_number
from softrobots.core.csv_table import Table, read_table
from softrobots.core.errors import FileFormatError, NotConverged, ParameterError
from softrobots.core.result_file import load_result
from softrobots.core.summary import text_of
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.simulation import simulate
from softrobots.dynamics.time_inputs import MotorPath, TimeLoad, curve
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.equilibrium_summary import loaded_robot
from softrobots.statics.loads import Load
from softrobots.statics.trajectory import Trajectory
from softrobots.view.figures import motions

_EXAMPLES = """examples:
  softrobots simulate inflatable_arm --duration 2 --gravity --release 0 6 -8 --plot tip.png -o ringing.npz
  softrobots simulate inflatable_arm --trajectory followed.npz --force 0 10 -15 --gravity --strobe moves.png
  softrobots simulate helix_tube --duration 3 --force-table gust.csv --damping-time 0.01 --json
  softrobots view --result ringing.npz --html ringing.html        an animated page of a motion that is saved
"""

_PICTURES: dict[str, Callable[[Motion], Any]] = {
    "plot": motions.tip_over_time,
    "energies": motions.energies,
    "strobe": motions.strobe,
}
"""Options of pictures, and what draws them."""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "simulate",
        help="simulate the motion of a robot",
        description="Simulate how a robot moves and rings under prescribed motors, loads and gravity, with steps chosen so "
        "that the tip is right within a tolerance. Exit status 0 if the whole motion is found, 1 if not, 2 after bad input, "
        "130 after Ctrl-C; what there is of a motion is written in any case.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    add_numbers(parser, "--duration", "T", "time to simulate [s] (that of --trajectory; required without it)")
    moved = parser.add_mutually_exclusive_group()
    add_motors(moved, "motors that stay where they are: motor joints, then muscles, base to tip [rad, m, N or Pa] (relaxed)")
    help_text = (
        "motors over time: a trajectory of `softrobots ik -o`, as .npz or .csv, or a .csv table with a column t [s] and one "
        "with the name of each motor [rad, m, N or Pa], joined by a cubic spline from rest to rest"
    )
    moved.add_argument("--trajectory", type=Path, metavar="FILE", help=help_text)
    add_loads(parser)
    help_text = "also a tip force over time: columns t, fx, fy, fz [s, N], linear between rows, a jump where t repeats (none)"
    parser.add_argument("--force-table", type=Path, metavar="FILE.csv", help=help_text)
    help_text = (
        "where it starts: relaxed springs, the equilibrium of the load at the start, or a saved equilibrium or motion, which "
        "goes on (relaxed)"
    )
    parser.add_argument("--start", metavar="relaxed|equilibrium|FILE", help=help_text)
    help_text = "start in equilibrium with this force more on the tip, and let go, world axes [N] (none)"
    add_numbers(parser, "--release", "FX FY FZ", help_text)
    add_damping(parser)
    add_numbers(parser, "--time-step", "T", "fixed steps of this length [s] (steps chosen for the tolerance)")
    help_text = (
        "order of the error in the length of the steps: 4 where motors and loads stand still (2 with --time-step, where they "
        "move, where springs have plateaus and with dry friction, else 4)"
    )
    parser.add_argument("--order", type=int, choices=(2, 4), help=help_text)
    add_numbers(parser, "--tolerance", "D", "largest error of the tip [m] (5e-4 of the reach); not with --time-step")
    add_numbers(parser, "--output-step", "T", "time between two rows of the result [s] (a 200th of the duration)")
    add_output(parser, "the motion", ROS_FORMS)
    add_plot(parser, "the tip over time")
    help_text = "draw the energies and their balance over time into this PNG file (none)"
    parser.add_argument("--energies", type=Path, metavar="FILE.png", help=help_text)
    help_text = "draw the robot at several times, later ones darker, into this PNG file (none)"
    parser.add_argument("--strobe", type=Path, metavar="FILE.png", help=help_text)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Simulate and print the answer."""
    _check_files(arguments)
    model = statics_model_of(arguments)
    load = Load.of(model, **loads_of(arguments, model))
    motors, duration = _motors(arguments, model)
    table = arguments.force_table
    gust = None if table is None else _columns(read_table(table, ("t", "fx", "fy", "fz")))
    start, failure = _start(arguments, model, motors, duration, gust, load), None
    try:
        motion = simulate(
            model,
            duration,
            motors,
            start=start,
            force=gust,
            wrench=dict(load.wrenches),
            gravity=load.gravity,
            damping_time=arguments.damping_time,
            mass_damping=arguments.mass_damping,
            time_step=arguments.time_step,
            tolerance=arguments.tolerance,
            output_step=arguments.output_step,
            order=arguments.order,
            progress=True,
        )
    except NotConverged as error:
        motion, failure = error.best, error
    files = save(arguments, motion)
    for option, draw in _PICTURES.items():
        files += write_plot(arguments, partial(draw, motion), option)
    lines = text_of([loaded_robot(model, load), *motion.summary_parts()[1:]], None)
    print_answer(arguments, motion_answer(motion, load), lines, files)
    if failure is not None:
        raise failure
    if motion.interrupted:
        raise KeyboardInterrupt


def _check_files(arguments: argparse.Namespace) -> None:
    """Refuse files that cannot be written, and options without effect, before the work."""
    check_files(arguments, *RESULT_FILES, *ROS_FILES)
    for option in _PICTURES:
        check_plot(arguments, option)
    if arguments.release is not None and arguments.start is not None:
        raise ParameterError("--release", arguments.release, "given with no --start, because it is one")
    if arguments.tolerance is not None and arguments.time_step is not None:
        raise ParameterError("--tolerance", arguments.tolerance, "given with no --time-step")


def _motors(arguments: argparse.Namespace, model: SoftModel) -> tuple[Any, float]:
    """The motors over time, and the duration [s]."""
    motors: Any = None
    duration, file = arguments.duration, arguments.trajectory
    if file is None:
        if duration is None:
            raise ParameterError("--duration", None, "given [s], or --trajectory")
        motors, end = motors_of(model, arguments.motors), duration
    elif file.suffix.lower() == ".csv":
        times, positions = _columns(read_table(file, ("t", *model.motor_joints)))
        if len(times) < 2 or np.any(np.diff(times) <= 0.0):
            raise FileFormatError(f"{file}: its times t must be increasing [s]; at least two are required")
        motors, end = curve(times - times[0], positions), float(np.ptp(times))
    else:
        motors = load_result(file)
        if not isinstance(motors, Trajectory):
            raise ParameterError("--trajectory", str(file), f"a saved trajectory, not a {type(motors).__name__}")
        end = float(np.ptp(motors.times))
    return motors, positive_number("--duration", end if duration is None else duration, "s")


def _columns(table: Table) -> tuple[FloatArray, FloatArray]:
    """Times, shape (n,) [s], and the other columns."""
    return table.numbers[:, 0], table.numbers[:, 1:]


def _start(arguments: argparse.Namespace, model: SoftModel, motors: Any, duration: float, gust: Any, load: Load) -> Any:
    """The state from which the motion starts; None: relaxed."""
    if arguments.release is None:
        if arguments.start in (None, "relaxed"):
            return None
        if arguments.start != "equilibrium":
            found = load_result(arguments.start)
            required = f"relaxed, equilibrium, or a saved equilibrium or motion, not a {type(found).__name__}"
            if not isinstance(found, Equilibrium | Motion):
                raise ParameterError("--start", arguments.start, required)
            return found
    wrenches = TimeLoad(model, gust, load.wrenches, duration)(0.0)
    first = Load(wrenches, load.gravity)
    if arguments.release is not None:
        first = first.plus(model.tip, np.append(finite_array("--release", arguments.release, (3,), "N"), np.zeros(3)))
    begin = MotorPath(model, motors, duration)(0.0)
    return solve_equilibrium(model, begin, wrench=dict(first.wrenches), gravity=first.gravity)
