"""`softrobots simulate`: the motion of a robot under moving motors and loads."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.options.load_argument import add_loads, loads_of
from softrobots.cli.options.output_files import add_output, add_plot, check_ending, check_output, check_plot, save
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.reports.motion_report import motion_answer, motion_lines
from softrobots.core.checks import FloatArray, finite_array, increasing
from softrobots.core.csv_table import read_table
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.core.files import new_file
from softrobots.core.result_file import load_result
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.simulation import simulate
from softrobots.dynamics.time_inputs import curve
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.loads import Load
from softrobots.statics.time_law import read_waypoints
from softrobots.statics.trajectory import Trajectory, follow_trajectory
from softrobots.view.figures import canvas, motions
from softrobots.view.viewer import Viewer

_EXAMPLES = """examples:
  softrobots simulate inflatable_arm --duration 2 --gravity --release 0 6 -8 --plot tip.png --page ringing.html
  softrobots simulate inflatable_arm --waypoints path.csv --duration 4 --gravity --start equilibrium -o motion.npz
  softrobots simulate inflatable_arm --trajectory followed.npz --force 0 10 -15 --gravity --strobe moves.png
  softrobots simulate helix_tube --duration 3 --force-table gust.csv --damping-time 0.01 --json
"""

_PICTURES: dict[str, tuple[Callable[[Motion], Any], str]] = {
    "plot": (motions.tip_over_time, ""),
    "energies": (motions.energies, "the energies and their balance over time"),
    "strobe": (motions.strobe, "the robot at several times, later ones darker,"),
}
"""Options of pictures, what draws them, and what they show."""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "simulate",
        help="simulate the motion of a robot",
        description="Simulate how a robot moves and rings under prescribed motors, loads and gravity, with steps chosen so "
        "that the tip is right within a tolerance. Exit status 0 if the whole motion is found, 1 if not, 2 after bad input, "
        "130 after Ctrl-C, which writes what there is.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    help_text = "time to simulate [s] (that of --trajectory or --waypoints; required without them)"
    add_numbers(parser, "--duration", "T", help_text)
    moved = parser.add_mutually_exclusive_group()
    add_motors(moved, "motors that stay where they are: motor joints, then muscles, base to tip [rad, m or N] (relaxed)")
    help_text = (
        "motors over time: a trajectory of `softrobots ik -o`, as .npz or .csv, or a .csv table with a column t [s] and one "
        "with the name of each motor [rad, m or N], joined by a cubic spline from rest to rest"
    )
    moved.add_argument("--trajectory", type=Path, metavar="FILE", help=help_text)
    help_text = (
        "CSV file of positions of the loaded tip, columns t, x, y, z [s, m], that motors follow as in `softrobots ik`, sag "
        "compensated, inertia not"
    )
    moved.add_argument("--waypoints", type=Path, metavar="FILE.csv", help=help_text)
    add_loads(parser)
    help_text = "also a force on the tip over time: columns t, fx, fy, fz [s, N], linear between its rows (none)"
    parser.add_argument("--force-table", type=Path, metavar="FILE.csv", help=help_text)
    help_text = (
        "where it starts: relaxed springs, the equilibrium of the load at the start, or a saved equilibrium or motion, which "
        "goes on (relaxed)"
    )
    parser.add_argument("--start", metavar="relaxed|equilibrium|FILE", help=help_text)
    help_text = "start in equilibrium with this force more on the tip, and let go, world axes [N] (none)"
    add_numbers(parser, "--release", "FX FY FZ", help_text)
    add_numbers(parser, "--damping-time", "T", "damping of springs over their stiffness [s] (damping of the file)")
    add_numbers(parser, "--mass-damping", "A", "damping in proportion to the mass [1/s] (0)", default=0.0)
    add_numbers(parser, "--time-step", "T", "fixed steps of this length [s] (steps chosen for the tolerance)")
    add_numbers(parser, "--tolerance", "D", "largest error of the tip [m] (5e-4 of the reach); not with --time-step")
    add_numbers(parser, "--output-step", "T", "time between two rows of the result [s] (a 200th of the duration)")
    add_output(parser, "the motion as NPZ or .json, for softrobots.load_result, or as a .csv table")
    add_plot(parser, "the tip over time")
    for name, (_, what) in _PICTURES.items():
        if what:
            parser.add_argument(f"--{name}", type=Path, metavar="FILE.png", help=f"draw {what} into this PNG file (none)")
    parser.add_argument("--page", type=Path, metavar="FILE.html", help="write an animated page, which works offline (none)")
    add_numbers(parser, "--speed", "S", "how fast --page plays, relative to real time [-] (1)")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Simulate and print the answer."""
    _check_files(arguments)
    model = statics_model_of(arguments)
    load = Load.of(model, **loads_of(arguments, model))
    gust = None if arguments.force_table is None else _force_table(arguments.force_table)
    motors, duration = _motors(arguments, model, load)
    begin = motors(0.0) if callable(motors) else motors.q_motors[0] if isinstance(motors, Trajectory) else motors
    first = (
        load
        if gust is None
        else load.plus(model.tip, np.append([np.interp(0.0, gust[0], one) for one in gust[1].T], np.zeros(3)))
    )
    motion = simulate(
        model,
        duration,
        motors,
        start=_start(arguments, model, begin, first),
        force=gust,
        wrench=dict(load.wrenches),
        gravity=load.gravity,
        damping_time=arguments.damping_time,
        mass_damping=arguments.mass_damping,
        time_step=arguments.time_step,
        tolerance=arguments.tolerance,
        output_step=arguments.output_step,
        progress=True,
    )
    files = save(arguments, motion) + _write_pictures(arguments, motion)
    print_answer(arguments, motion_answer(motion, load), motion_lines(motion, load), files)
    if motion.interrupted:
        raise KeyboardInterrupt


def _check_files(arguments: argparse.Namespace) -> None:
    """Refuse files that cannot be written, and options without effect, before the work."""
    check_output(arguments, ".npz", ".json", ".csv")
    check_plot(arguments)
    for name in _PICTURES:
        file = getattr(arguments, name)
        if file is not None:
            check_ending(f"--{name}", file, ".png")
            canvas.require_matplotlib()
            new_file(file, overwrite=arguments.overwrite)
    if arguments.page is not None:
        check_ending("--page", arguments.page, ".html")
        new_file(arguments.page, overwrite=arguments.overwrite)
    given = {
        "--speed": (arguments.speed is not None and arguments.page is None, "--page"),
        "--release": (arguments.release is not None and arguments.start is not None, "no --start, which it is"),
        "--tolerance": (arguments.tolerance is not None and arguments.time_step is not None, "no --time-step"),
    }
    for option, (wrong, requirement) in given.items():
        if wrong:
            value = getattr(arguments, option.removeprefix("--"))
            raise ParameterError(option, value, f"given with {requirement}")


def _motors(arguments: argparse.Namespace, model: SoftModel, load: Load) -> tuple[Any, float]:
    """The motors over time, and the duration [s]."""
    motors: Any = None
    end: float | None = None
    if arguments.trajectory is not None:
        csv = arguments.trajectory.suffix.lower() == ".csv"
        motors, end = _motor_table(arguments.trajectory, model) if csv else _saved_trajectory(arguments.trajectory)
    elif arguments.waypoints is not None:
        path = read_waypoints(arguments.waypoints)
        options: dict[str, Any] = {"wrench": dict(load.wrenches), "gravity": load.gravity, "times": path.times}
        motors, end = follow_trajectory(model, path.targets, **options, progress="waypoints"), float(np.ptp(path.times))
    else:
        motors = motors_of(model, arguments.motors)
    duration = end if arguments.duration is None else arguments.duration
    if duration is None:
        raise ParameterError("--duration", None, "given [s], or --trajectory or --waypoints")
    return motors, duration


def _saved_trajectory(file: Path) -> tuple[Trajectory, float]:
    found = load_result(file)
    if not isinstance(found, Trajectory):
        raise ParameterError("--trajectory", str(file), f"a saved trajectory, not a {type(found).__name__}")
    return found, float(found.times[-1] - found.times[0])


def _motor_table(file: Path, model: SoftModel) -> tuple[Callable[[float], FloatArray], float]:
    """Motors over time from a table: a cubic spline from rest to rest, at rest before and after."""
    times, positions = _table(file, model.motor_joints)
    if len(times) < 2:
        raise FileFormatError(f"{file} has {len(times)} rows; at least two are required")
    return curve(times - times[0], positions), float(times[-1] - times[0])


def _force_table(file: Path) -> tuple[FloatArray, FloatArray]:
    """Times, shape (n,) [s], and forces on the tip, shape (n, 3) [N]."""
    return _table(file, ("fx", "fy", "fz"))


def _table(file: Path, names: Any) -> tuple[FloatArray, FloatArray]:
    """Increasing times and other columns of a CSV file."""
    numbers = read_table(file, ("t", *names)).numbers
    try:
        return increasing("t", numbers[:, 0], "s"), numbers[:, 1:]
    except ParameterError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _start(arguments: argparse.Namespace, model: SoftModel, motors: FloatArray, load: Load) -> Any:
    """The state that the motion starts from; None: relaxed."""
    if arguments.release is not None:
        load = load.plus(model.tip, np.append(finite_array("--release", arguments.release, (3,), "N"), np.zeros(3)))
    elif arguments.start in (None, "relaxed"):
        return None
    elif arguments.start != "equilibrium":
        found = load_result(arguments.start)
        if not isinstance(found, Equilibrium | Motion):
            kind = type(found).__name__
            raise ParameterError(
                "--start", arguments.start, f"relaxed, equilibrium, or a saved equilibrium or motion, not a {kind}"
            )
        return found
    return solve_equilibrium(model, motors, wrench=dict(load.wrenches), gravity=load.gravity)


def _write_pictures(arguments: argparse.Namespace, motion: Motion) -> list[Path]:
    """Write the pictures and the page that are asked for."""
    files = []
    for name, (draw, _) in _PICTURES.items():
        if getattr(arguments, name) is not None:
            files.append(canvas.write_png(draw(motion), getattr(arguments, name), overwrite=arguments.overwrite))
    if arguments.page is not None:
        with Viewer(motion.model) as viewer:
            viewer.animate(motion, speed=arguments.speed)
            files.append(
                viewer.write_html(arguments.page, title=str(motion.model.pinocchio.name), overwrite=arguments.overwrite)
            )
    return files
