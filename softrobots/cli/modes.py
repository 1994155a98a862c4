"""`softrobots modes`: how a loaded robot vibrates."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from softrobots.cli.options.command_line import add_damping, add_numbers
from softrobots.cli.options.load_argument import add_environment, add_loads, loads_of
from softrobots.cli.options.output_files import add_output, add_plot, check_ending, check_files, save, write_plot
from softrobots.cli.options.robot_argument import add_model, add_motors, motors_of, one_or_each, statics_model_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.core.checks import positive_integer
from softrobots.core.files import new_file
from softrobots.core.summary import text_of
from softrobots.dynamics.motion_summary import modes_parts
from softrobots.dynamics.vibration import VibrationModes, vibration_modes
from softrobots.model.actuators import load_units
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.view.figures.vibrations import SWING, mode_shapes
from softrobots.view.viewer import Viewer

_EXAMPLES = """examples:
  softrobots modes inflatable_arm --motors 0.3 0.6 -0.8 --gravity --plot modes.png
  softrobots modes pcc_arm --gravity --count 4 --page modes.html        modes_1.html to modes_4.html
  softrobots modes inflatable_arm --gravity --servo-stiffness 2000 --set rotor_inertia=0.05 -o modes.csv
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "modes",
        help="find the frequencies at which a loaded robot vibrates",
        description="Find the equilibrium, and the natural frequencies, shapes and damping ratios of small vibrations about "
        "it. Exit status 0 if it vibrates, 1 if there is no equilibrium or a neutral one, 2 if it is unstable or after bad "
        "input.",
        epilog=_EXAMPLES,
    )
    add_model(parser)
    add_motors(parser)
    add_loads(parser)
    add_environment(parser)
    add_damping(parser)
    help_text = "stiffness with which motors hold their place, one for all or one for each [N m/rad or N/m] (they are held)"
    add_numbers(parser, "--servo-stiffness", "K", help_text, nargs="+")
    help_text = "how many modes are shown, drawn and animated, slowest first [-] (%(default)s)"
    parser.add_argument("--count", type=int, default=6, metavar="N", help=help_text)
    add_output(parser, "all modes")
    add_plot(parser, "the shapes of the modes")
    help_text = "write an animated page of each mode, FILE_1.html and so on, in slow motion; they work offline (none)"
    parser.add_argument("--page", type=Path, metavar="FILE.html", help=help_text)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Find the modes and print the answer."""
    check_files(arguments)
    positive_integer("--count", arguments.count)
    model = statics_model_of(arguments)
    pages = _pages(arguments, model.n_springs)
    placed = slice(model.actuators.n_placed)
    coordinates = model.actuators.units[placed]
    units = [f"{load}/{coordinate}" for load, coordinate in zip(load_units(coordinates), coordinates, strict=True)]
    servos = one_or_each("--servo-stiffness", arguments.servo_stiffness, model.motor_joints[placed], units)
    equilibrium = solve_equilibrium(model, motors_of(model, arguments.motors), **loads_of(arguments, model))
    modes = vibration_modes(
        model, equilibrium, damping_time=arguments.damping_time, mass_damping=arguments.mass_damping, servo_stiffness=servos
    )
    files = save(arguments, modes) + write_plot(arguments, lambda: mode_shapes(modes, shown=arguments.count))
    pages = pages[: len(modes.frequencies)]
    if pages:
        with Viewer(model) as viewer:
            for mode, page in enumerate(pages, start=1):
                viewer.animate(modes.swing(mode, SWING * model.reach))
                title = f"{model.pinocchio.name}, mode {mode}, {modes.frequencies[mode - 1]:.4g} Hz"
                viewer.write_html(page, title=title, overwrite=arguments.overwrite)
    print_answer(arguments, _answer(modes), text_of(modes_parts(modes, arguments.count), None), files + pages)


def _pages(arguments: argparse.Namespace, modes: int) -> list[Path]:
    """A page for each mode that is shown, refused before the work if it cannot be written."""
    page: Path | None = arguments.page
    if page is None:
        return []
    check_ending("--page", page, ".html")
    files = [page.with_stem(f"{page.stem}_{number}") for number in range(1, min(arguments.count, modes) + 1)]
    return [new_file(file, overwrite=arguments.overwrite) for file in files]


def _answer(modes: VibrationModes) -> dict[str, Any]:
    units = {
        "frequencies": "Hz",
        "damping_ratios": "-",
        "effective_masses": "kg, kg m^2",
        "tip_shapes": "1/sqrt(kg), rad/(sqrt(kg) m)",
        "shapes": "rad/(sqrt(kg) m) or 1/sqrt(kg)",
        "motor_shapes": "rad/(sqrt(kg) m) or 1/sqrt(kg)",
    }
    springs, motors = modes.model.spring_joints, modes.model.motor_joints
    return {**{name: getattr(modes, name) for name in units}, "springs": springs, "motors": motors, "units": units}
