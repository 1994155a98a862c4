"""`softrobots view`: a robot in the browser, still, moving, or following commands."""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softrobots.cli.options.command_line import add_numbers, address_lines
from softrobots.cli.options.load_argument import add_environment, add_loads, loads_of
from softrobots.cli.options.output_files import check_ending
from softrobots.cli.options.robot_argument import add_model, add_motors, model_of, motors_of, source_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.core.checks import finite_number
from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file
from softrobots.core.result_file import load_result
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.vibration import ModeSwing, VibrationModes
from softrobots.model.soft_model import SoftModel
from softrobots.robots import HelixTube
from softrobots.statics.buckling.equilibrium_branch import EquilibriumBranch
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.equilibrium import Equilibrium, solve_equilibrium
from softrobots.statics.imposed_displacement import ImposedDisplacement
from softrobots.statics.inverse_kinematics import IkSolution, solve_ik
from softrobots.statics.load_estimation import LoadEstimate
from softrobots.statics.trajectory import Trajectory
from softrobots.view.animation_frames import Movement
from softrobots.view.browser import find_chromium, take_picture
from softrobots.view.figures.vibrations import SWING
from softrobots.view.live.input import commands_from
from softrobots.view.live.loop import LiveView, follow, state_line, tip_force
from softrobots.view.served_page import ServedPage
from softrobots.view.viewer import Viewer, view

_EXAMPLES = """examples:
  softrobots view inflatable_arm --motors 0.3 0.6 -0.8 --force 0 10 -15
  softrobots view inflatable_arm --target 0.9 0.3 0.2 --gravity --live keyboard
  softrobots view pcc_arm --live wanted.json                   follows a file, e.g. {"force": [0, 5, 0], "gravity": true}
  softrobots view pcc_arm --sliders
  softrobots view helix_tube --growth --html growth.html
  softrobots view --result trajectory.npz --picture end.png --at 1
  softrobots view --result branches.npz --branch=+spring_1_up
"""

_NOT_WITH = {
    "--result": ("ROBOT", "--set", "--parameters", "--spring", "--tip", "--motors", "--target", "--growth", "a load"),
    "--growth": ("--motors", "--target", "a load", "--live", "--sliders"),
    "--html": ("--live", "--sliders", "--open", "--port"),
    "--picture": ("--live", "--sliders", "--open", "--port"),
    "--sliders": ("--live",),
    "--live": ("--json",),
}
_SWITCHES = "motors target result branch growth live sliders html picture at speed overwrite open port json"
_ONLY_WITH = {
    "--branch": ("--result",),
    "--speed": ("--result",),
    "--overwrite": ("--html", "--picture"),
    "--at": ("--picture",),
}


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "view",
        help="show a robot in the browser",
        description="Show a robot in the browser, served on this machine only, until Ctrl-C: loaded, at a target, as a saved "
        "result, growing, or following commands. Or write the page, which works offline, or a picture of it.",
        epilog=_EXAMPLES,
    )
    add_model(parser, optional=True)
    help_text = "motor joints, then muscles, base to tip [rad, m, N or Pa]; with --target, where the search starts (relaxed)"
    add_motors(parser, help_text)
    add_loads(parser)
    add_environment(parser)
    add_numbers(parser, "--target", "X Y Z", "move the loaded tip to this position by inverse kinematics [m] (no target)")
    help_text = (
        "show a saved result, e.g. of `softrobots solve -o`, `ik -o`, `modes -o` or `simulate -o`, in place of ROBOT (none)"
    )
    parser.add_argument("--result", type=Path, metavar="FILE.npz", help=help_text)
    help_text = "the branch of a --result of `softrobots branches`, as --branch=LABEL: its last stable point (its only one)"
    parser.add_argument("--branch", metavar="LABEL", help=help_text)
    parser.add_argument("--growth", action="store_true", help="show how a helical tube grows, without load")
    help_text = (
        "follow commands (none): `keyboard`, single keys of a terminal or lines of a pipe (? lists them), or a watched file"
    )
    parser.add_argument("--live", metavar="keyboard|FILE", help=help_text)
    parser.add_argument(
        "--sliders", action="store_true", help="a page with sliders for motors and load (needs viser, extra viser)"
    )
    parser.add_argument("--html", type=Path, metavar="FILE", help="write the page instead of serving it (served)")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="take a picture of the page with Chromium (served)")
    add_numbers(parser, "--at", "SHARE", "where --picture stops an animation, from 0, its start, to 1, its end [-] (0)")
    add_numbers(parser, "--speed", "S", "how fast a trajectory or motion is played, relative to real time [-] (1)")
    parser.add_argument("--overwrite", action="store_true", help="allow --html and --picture to replace files")
    parser.add_argument("--open", action="store_true", help="open the page in the browser of this machine")
    parser.add_argument("--port", type=int, metavar="N", help="port of the page (the first free one from 7000; sliders: 8080)")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Show the robot until Ctrl-C, or write a page or a picture."""
    _refuse_contradictions(arguments)
    if arguments.picture is not None:
        check_ending("--picture", arguments.picture, ".png")
    for file in (arguments.html, arguments.picture):
        if file is not None:
            new_file(file, overwrite=arguments.overwrite)  # refused before the work
    if arguments.picture is not None:
        find_chromium()
    if arguments.growth:
        _grow(arguments)
        return
    result = _result(arguments)
    if isinstance(result, Movement):
        if arguments.live is not None or arguments.sliders:
            raise ParameterError(
                "--result", str(arguments.result), "nothing that moves with --live or --sliders, which move the robot"
            )
        with Viewer(result.model, port=arguments.port) as viewer:
            viewer.animate(result, speed=arguments.speed)
            _show(arguments, viewer, result.model, _words(result))
        return
    if arguments.speed is not None:
        raise ParameterError("--speed", arguments.speed, "given with a --result that moves: a trajectory, a motion or modes")
    equilibrium = result.equilibrium if isinstance(result, IkSolution) else result
    if arguments.live is not None or arguments.sliders:
        tip_force(equilibrium)  # refused before the work
    if arguments.sliders:
        _slide(arguments, equilibrium)
        return
    with view(equilibrium.model, result, port=arguments.port) as viewer:
        if arguments.live is None:
            _show(arguments, viewer, equilibrium.model, state_line(equilibrium))
        else:
            _follow(arguments, viewer, LiveView(viewer, result))


def _words(movement: Movement) -> str:
    """What moves, in a few words."""
    if isinstance(movement, ModeSwing):
        return f"mode 1 of {len(movement.modes.frequencies)}, {1.0 / movement.period:.4g} Hz"
    if isinstance(movement, Motion):
        return f"a motion of {movement.time[-1]:g} s"
    if isinstance(movement, ContactPath):
        return f"a path in contact of {len(movement.equilibria)} equilibria"
    return f"a trajectory of {len(movement.times)} waypoints"


def _result(arguments: argparse.Namespace) -> Equilibrium | IkSolution | Movement:
    """The saved result, or the solution for the load or target of the arguments."""
    if arguments.result is None:
        model = model_of(arguments)
        load, motors = loads_of(arguments, model), motors_of(model, arguments.motors)
        if arguments.target is None:
            return solve_equilibrium(model, motors, **load)
        return solve_ik(model, arguments.target, q_motors0=None if arguments.motors is None else motors, **load)
    result = load_result(arguments.result)
    if isinstance(result, tuple) and isinstance(result[0], EquilibriumBranch):
        if arguments.branch is None and len(result) > 1:
            labels = ", ".join(branch.label for branch in result)
            raise ParameterError("--result", str(arguments.result), f"given with --branch=LABEL; available: {labels}")
        return _point_of(result, arguments.branch)
    if arguments.branch is not None:
        raise ParameterError("--branch", arguments.branch, "left out: the result has no branches")
    if isinstance(result, ImposedDisplacement | LoadEstimate):
        return result.equilibrium
    if isinstance(result, VibrationModes):
        return result.swing(1, SWING * result.model.reach)
    if isinstance(result, Equilibrium | IkSolution | Trajectory | ContactPath | Motion):
        return result
    kind = type(result).__name__
    raise ParameterError(
        "--result",
        str(arguments.result),
        f"an equilibrium, a solution, an estimate, branches, a trajectory, a path in contact, a motion or modes, not a {kind}",
    )


def _point_of(branches: Sequence[EquilibriumBranch], label: str | None) -> Equilibrium:
    """The last stable equilibrium of a branch, or its last one if none is."""
    by_label = {branch.label: branch for branch in branches}
    if label is not None and label not in by_label:
        raise ParameterError("--branch", label, f"one of {', '.join(by_label)}, as --branch=LABEL")
    branch = by_label[label] if label is not None else branches[0]
    stable = [one for one, certified in zip(branch.equilibria, branch.stable, strict=True) if certified]
    return (stable or branch.equilibria)[-1]


def _grow(arguments: argparse.Namespace) -> None:
    """Show the growth of a tube."""
    tube = source_of(arguments)
    if not isinstance(tube, HelixTube) or tube.chain != "sections":
        raise ParameterError("ROBOT", arguments.robot, "helix_tube, with chain=sections, for --growth")
    model = model_of(arguments, tube)
    with Viewer(model, port=arguments.port) as viewer:
        viewer.animate_growth(tube)
        _show(arguments, viewer, model, f"a tube that grows to {tube.length:g} m")


def _slide(arguments: argparse.Namespace, equilibrium: Equilibrium) -> None:
    """Serve a page with sliders."""
    from softrobots.view.slider_page import SliderPage

    with SliderPage(
        equilibrium.model,
        q_motors=equilibrium.q_motors,
        force=tip_force(equilibrium),
        gravity=equilibrium.load.gravity,
        environment=equilibrium.load.environment,
        port=arguments.port,
    ) as page:
        _serve(arguments, page, state_line(equilibrium))


def _show(arguments: argparse.Namespace, viewer: Viewer, model: SoftModel, state: str) -> None:
    """Serve a page, or write it and take its picture."""
    if arguments.html is None and arguments.picture is None:
        _serve(arguments, viewer, state)
        return
    with tempfile.TemporaryDirectory() as folder:
        file = arguments.html or Path(folder) / "page.html"
        page = viewer.write_html(file, title=str(model.pinocchio.name), overwrite=arguments.overwrite)
        if arguments.picture is not None:
            take_picture(page, arguments.picture, share=arguments.at or 0.0)
    files = [file for file in (arguments.html, arguments.picture) if file is not None]
    print_answer(arguments, {"files": files}, [state, *(f"{file}: written" for file in files)])


def _serve(arguments: argparse.Namespace, page: ServedPage, state: str) -> None:
    """Print the address of a page, and serve it until Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        _print_address(arguments, page, state)
        page.wait()


def _follow(arguments: argparse.Namespace, viewer: Viewer, live: LiveView) -> None:
    """Follow commands until they end, or Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        _print_address(arguments, viewer, state_line(live.equilibrium))
        with commands_from(arguments.live, live, _print_line) as commands:
            follow(live, commands, _print_line, _print_error)


def _print_address(arguments: argparse.Namespace, page: ServedPage, state: str) -> None:
    answer = {"url": page.url, "port": page.port, "tunnel": page.tunnel}
    print_answer(arguments, answer, [state, *address_lines(page.url, page.tunnel)])
    if arguments.open and not webbrowser.open(page.url):
        _print_error("no browser of this machine could be opened")


def _print_line(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _print_error(line: str) -> None:
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    """Refuse options that contradict each other, and values out of range."""
    given = {
        "ROBOT": arguments.robot is not None,
        "--set": bool(arguments.parameters),
        "--parameters": arguments.parameter_file is not None,
        "--spring": bool(arguments.spring),
        "--tip": arguments.tip is not None,
        "a load": any(arguments.force) or bool(arguments.wrench) or (arguments.moment, arguments.gravity) != (None, None),
        **{f"--{name}": getattr(arguments, name) not in (None, False) for name in _SWITCHES.split()},
    }
    if not given["ROBOT"] and not given["--result"]:
        raise ParameterError("ROBOT", "(nothing)", "a robot or a file, or a saved --result given instead")
    for option, others in _NOT_WITH.items():
        both = [other for other in others if given[option] and given[other]]
        if both:
            raise ParameterError(option, "given", f"given without {', '.join(both)}")
    for option, others in _ONLY_WITH.items():
        if given[option] and not any(given[other] for other in others):
            raise ParameterError(option, "given", f"given together with {' or '.join(others)}")
    if arguments.at is not None and not 0.0 <= finite_number("--at", arguments.at) <= 1.0:
        raise ParameterError("--at", arguments.at, "from 0 to 1")
    if arguments.port is not None and not 0 < arguments.port < 65536:
        raise ParameterError("--port", arguments.port, "from 1 to 65535")
