"""`softrobots view`: a robot in the browser, still, moving, or following commands."""

from __future__ import annotations

import argparse
import contextlib
import sys
import webbrowser
from collections.abc import Sequence
from typing import Any

from softrobots.cli.options.command_line import address_lines
from softrobots.cli.options.load_argument import loads_of
from softrobots.cli.options.robot_argument import model_of, motors_of, source_of
from softrobots.cli.options.view_options import EXAMPLES, add_view_options, refuse_contradictions
from softrobots.cli.reports.answers import add_json, print_answer
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
from softrobots.view.figures.vibrations import SWING
from softrobots.view.live.input import commands_from
from softrobots.view.live.loop import LiveView, follow, state_line, tip_force
from softrobots.view.served_page import ServedPage
from softrobots.view.viewer import Viewer, view


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "view",
        help="show a robot in the browser",
        description="Show a robot in the browser, served on this machine only, until Ctrl-C: loaded, at a target, as a saved "
        "result, growing, or following commands. Or write the page, which works offline.",
        epilog=EXAMPLES,
    )
    add_view_options(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Show the robot until Ctrl-C, or write a page."""
    refuse_contradictions(arguments)
    for file in (arguments.html, arguments.interactive):
        if file is not None:
            new_file(file, overwrite=arguments.overwrite)  # refused before the work
    if arguments.growth:
        _grow(arguments)
        return
    result = _result(arguments)
    if isinstance(result, Movement):
        if arguments.live is not None or arguments.sliders or arguments.interactive is not None:
            given = "nothing that moves with --live, --sliders or --interactive, which move the robot"
            raise ParameterError("--result", str(arguments.result), given)
        with Viewer(result.model, port=arguments.port) as viewer:
            viewer.animate(result, speed=arguments.speed)
            _show(arguments, viewer, result.model, _words(result))
        return
    if arguments.speed is not None:
        raise ParameterError("--speed", arguments.speed, "given with a --result that moves: a trajectory, a motion or modes")
    equilibrium = result.equilibrium if isinstance(result, IkSolution) else result
    if arguments.live is not None or arguments.sliders:
        tip_force(equilibrium)  # refused before the work
    if arguments.interactive is not None:
        _write_interactive(arguments, equilibrium)
        return
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


def _write_interactive(arguments: argparse.Namespace, equilibrium: Equilibrium) -> None:
    """Write the page that solves by itself, with an equilibrium as its first pose."""
    from softrobots.view.interactive_page import interactive

    load = equilibrium.load
    if load.environment is not None:
        raise ParameterError(
            "--environment", str(arguments.environment), "left out with --interactive: its page has no obstacles"
        )
    page = interactive(equilibrium.model, q_motors=equilibrium.q_motors, force=tip_force(equilibrium), gravity=load.gravity)
    file = page.write_html(arguments.interactive, overwrite=arguments.overwrite)
    print_answer(arguments, {"files": [file]}, [state_line(equilibrium), f"{file}: written"])


def _show(arguments: argparse.Namespace, viewer: Viewer, model: SoftModel, state: str) -> None:
    """Serve a page, or write it."""
    if arguments.html is None:
        _serve(arguments, viewer, state)
        return
    page = viewer.write_html(arguments.html, title=str(model.pinocchio.name), overwrite=arguments.overwrite)
    print_answer(arguments, {"files": [page]}, [state, f"{page}: written"])


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
