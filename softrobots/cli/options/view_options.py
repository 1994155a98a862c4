"""What `softrobots view` takes, and which of its options exclude each other."""

from __future__ import annotations

import argparse
from pathlib import Path

from softrobots.cli.options.command_line import add_numbers
from softrobots.cli.options.load_argument import add_environment, add_loads
from softrobots.cli.options.robot_argument import add_model, add_motors
from softrobots.core.errors import ParameterError

EXAMPLES = """examples:
  softrobots view inflatable_arm --motors 0.3 0.6 -0.8 --force 0 10 -15
  softrobots view inflatable_arm --target 0.9 0.3 0.2 --gravity --live keyboard
  softrobots view pcc_arm --live wanted.json                   follows a file, e.g. {"force": [0, 5, 0], "gravity": true}
  softrobots view pcc_arm --sliders
  softrobots view inflatable_arm --interactive arm.html        a file that solves by itself, on a phone too
  softrobots view helix_tube --growth --html growth.html
  softrobots view --result trajectory.npz --speed 0.25 --html slow.html
  softrobots view --result branches.npz --branch=+spring_1_up
"""

_NOT_WITH = {
    "--result": ("ROBOT", "--set", "--parameters", "--spring", "--tip", "--motors", "--target", "--growth", "a load"),
    "--growth": ("--motors", "--target", "a load", "--live", "--sliders", "--interactive"),
    "--interactive": ("--live", "--sliders", "--html", "--open", "--port"),
    "--html": ("--live", "--sliders", "--open", "--port"),
    "--sliders": ("--live",),
    "--live": ("--json",),
}
_SWITCHES = "motors target result branch growth live sliders interactive html speed overwrite open port json"
_ONLY_WITH = {
    "--branch": ("--result",),
    "--speed": ("--result",),
    "--overwrite": ("--html", "--interactive"),
}


def add_view_options(parser: argparse.ArgumentParser) -> None:
    """Add robot, load, result, and how to show it."""
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
    help_text = (
        "write a page that solves by itself in any browser: sliders and dragging move the robot, without a server (none)"
    )
    parser.add_argument("--interactive", type=Path, metavar="FILE.html", help=help_text)
    parser.add_argument("--html", type=Path, metavar="FILE", help="write the page instead of serving it (served)")
    add_numbers(parser, "--speed", "S", "how fast a trajectory or motion is played, relative to real time [-] (1)")
    parser.add_argument("--overwrite", action="store_true", help="allow --html and --interactive to replace files")
    parser.add_argument("--open", action="store_true", help="open the page in the browser of this machine")
    parser.add_argument("--port", type=int, metavar="N", help="port of the page (the first free one from 7000; sliders: 8080)")


def refuse_contradictions(arguments: argparse.Namespace) -> None:
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
    if arguments.port is not None and not 0 < arguments.port < 65536:
        raise ParameterError("--port", arguments.port, "from 1 to 65535")
