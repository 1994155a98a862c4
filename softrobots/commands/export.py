"""`softrobots export`: write a robot for another tool, with its springs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from softrobots.command_line import add_gravity, gravity_of
from softrobots.commands.urdf import robot_source
from softrobots.export.damping import DAMPING
from softrobots.export.formats import FORMATS, export_model, guess_format
from softrobots.export.number_sources import PackagedRobot
from softrobots.files import new_file
from softrobots.loader import load_model
from softrobots.muscles import MUSCLE_INPUTS
from softrobots.robots import ROBOTS

_EXAMPLES = """examples:
  softrobots export inflatable_arm -o arm.xml --gravity
  softrobots export arm.urdf -o arm.sdf --welded --motors 0.3 0.6 -0.8
  softrobots export pcc_arm_lumped hinges=6 -o pcc.xml
  softrobots export pcc_arm_lumped --muscles forces --welded --motors 20 5 5 10 0 0 -o pcc.sdf
  softrobots export helix_tube_lumped --format pybullet -o helix.py
  softrobots export ur5.urdf --spring wrist_1_joint=40 --spring wrist_3_joint=25,0.1 --tip tool0 -o ur5.xml
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "export",
        help="write a robot for a simulator, with its springs",
        description="Write a robot for another tool, with springs, damping and actuators: no tool reads springs from URDF.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("robot", metavar="ROBOT", help=f"{', '.join(ROBOTS)}, or a file")
    parser.add_argument("parameters", nargs="*", metavar="FIELD=VALUE", help="parameters of the robot (softrobots urdf --list)")
    told = "a spring of a joint of somebody's URDF, K [N m/rad or N/m], relaxed at REST [rad or m] (0); once for each joint"
    parser.add_argument("--spring", action="append", type=_spring, default=[], metavar="JOINT=K[,REST]", help=told)
    parser.add_argument("--tip", metavar="LINK", help="the link that is the tip (as the file says, or its only end)")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="the file to write")
    told = "; ".join(f"{name} ({row.suffix}): {row.meaning}" for name, row in FORMATS.items())
    parser.add_argument("--format", choices=FORMATS, help=f"{told}. By default what the suffix of FILE says")
    parser.add_argument(
        "--motors", type=float, nargs="+", metavar="Q", help="motor joints, then muscles, base to tip [rad, m or N] (relaxed)"
    )
    parser.add_argument(
        "--welded", action="store_true", help="fix the motors where they are, put tensions of muscles into the springs"
    )
    parser.add_argument("--muscles", choices=MUSCLE_INPUTS, default="lengths", help="what is given of muscles (%(default)s)")
    parser.add_argument("--damping", choices=DAMPING, help="of the springs: critical for the slowest mode, or that of the file")
    add_gravity(parser)
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Write the file, and tell what was written."""
    name = arguments.format or guess_format(arguments.output)
    given = {
        "q_motors": arguments.motors,
        "actuators": "welded" if arguments.welded else None,
        "damping": arguments.damping,
        "gravity": gravity_of(arguments),
    }
    options = {option: value for option, value in given.items() if value is not None}
    new_file(arguments.output, overwrite=arguments.overwrite)  # tells at once
    source = robot_source(arguments.robot, arguments.parameters)
    if "robot" in FORMATS[name].options and isinstance(source, PackagedRobot):
        options["robot"] = source  # for the sources of its numbers
    model = load_model(source, springs=dict(arguments.spring) or None, tip=arguments.tip, muscles=arguments.muscles)
    path = export_model(model, arguments.output, name, overwrite=arguments.overwrite, **options)
    sections = f"{len(model.structure.section_table)} sections, " if model.structure.sections is not None else ""
    welded = " welded" if arguments.welded else ""
    kept = f"{sections}{len(model.structure.spring_joints)} springs, {model.n_motors}{welded} actuators"
    sys.stdout.write(f"{path}: {model.pinocchio.name}, {kept}; {name}, for {FORMATS[name].meaning}\n")


def _spring(word: str) -> tuple[str, tuple[float, float]]:
    """A spring as it is typed, JOINT=K or JOINT=K,REST."""
    joint, equals, numbers = word.rpartition("=")
    stiffness, _, rest = numbers.partition(",")
    try:
        spring = float(stiffness), float(rest or 0.0)
    except ValueError:
        equals = ""
    if not joint or not equals:
        raise argparse.ArgumentTypeError(f"{word!r}: JOINT=K or JOINT=K,REST is required")
    return joint, spring
