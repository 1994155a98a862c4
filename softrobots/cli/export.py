"""`softrobots export`: write a robot for another tool, with its springs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from softrobots.cli.options.command_line import add_gravity, add_numbers, gravity_of
from softrobots.cli.options.load_argument import add_environment, environment_of
from softrobots.cli.options.robot_argument import add_model, add_motors, model_of, motors_of, source_of
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.core.files import new_file
from softrobots.export.formats import FORMATS, export_model, guess_format
from softrobots.robots import XacroRobot

_EXAMPLES = """examples:
  softrobots export inflatable_arm -o arm.xml --gravity
  softrobots export arm.urdf -o arm.sdf --welded --motors 0.3 0.6 -0.8
  softrobots export inflatable_arm --environment room.yaml --friction 0.4 -o arm_in_room.xml
  softrobots export pcc_arm_lumped --set hinges=6 -o pcc.xml
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
    )
    add_model(parser)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", required=True, help="the file to write (required)")
    help_text = "; ".join(f"{name} ({row.suffix}): {row.meaning}" for name, row in FORMATS.items())
    parser.add_argument("--format", choices=FORMATS, help=f"{help_text} (by the suffix of FILE)")
    add_motors(parser)
    parser.add_argument(
        "--welded", action="store_true", help="fix the motors where they are, make springs of muscles and tendons"
    )
    help_text = (
        "damping of the springs: that of the file; a time [s], by which their stiffness is multiplied; critical, for the "
        "slowest mode, which settles without swinging; or numbers by joint [N m s/rad or N s/m] (file)"
    )
    parser.add_argument("--damping", type=_damping, metavar="file|TIME|critical|JOINT=D,..", help=help_text)
    help_text = "damping ratio of the slowest mode at rest, instead of --damping [-] (what --damping says)"
    add_numbers(parser, "--damping-ratio", "Z", help_text)
    add_gravity(parser)
    add_environment(parser)
    add_numbers(parser, "--friction", "MU", "coefficient of friction of the obstacles [-] (0)")
    help_text = "copy mesh files there, converted where the tool does not read them (their own places on this computer)"
    parser.add_argument("--mesh-folder", type=Path, metavar="FOLDER", help=help_text)
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Write the file, and print what was written."""
    name = arguments.format or guess_format(arguments.output)
    chosen = {
        "actuators": "welded" if arguments.welded else None,
        "damping": arguments.damping,
        "damping_ratio": arguments.damping_ratio,
        "gravity": gravity_of(arguments),
        "environment": environment_of(arguments),
        "friction": arguments.friction,
        "mesh_folder": arguments.mesh_folder,
    }
    options = {option: value for option, value in chosen.items() if value is not None}
    new_file(arguments.output, overwrite=arguments.overwrite)  # refused before the work
    source = source_of(arguments)
    if "robot" in FORMATS[name].options and isinstance(source, XacroRobot):
        options["robot"] = source  # for the sources of its numbers
    model = model_of(arguments, source)
    if arguments.motors is not None:
        options["q_motors"] = motors_of(model, arguments.motors)
    path = export_model(model, arguments.output, name, overwrite=arguments.overwrite, **options)
    structure = model.structure
    counts = {"sections": len(structure.section_table) if structure.constant_strain else 0}
    counts |= {"springs": len(structure.spring_joints), "actuators": model.n_motors}
    answer = {"files": [path], "robot": model.pinocchio.name, "format": name, **counts, "welded": arguments.welded}
    answer["obstacles"] = list(options["environment"].names) if "environment" in options else []
    sections = f"{counts['sections']} sections, " if counts["sections"] else ""
    kept = f"{sections}{counts['springs']} springs, {model.n_motors}{' welded' if arguments.welded else ''} actuators"
    kept += f", {len(answer['obstacles'])} obstacles" if answer["obstacles"] else ""
    print_answer(arguments, answer, [f"{path}: {model.pinocchio.name}, {kept}; {name}, for {FORMATS[name].meaning}"])


def _damping(word: str) -> str | float | dict[str, float]:
    """A word as it is, a number as a number, JOINT=D,.. as a mapping."""
    try:
        if "=" in word:
            return {name: float(number) for name, _, number in (part.partition("=") for part in word.split(","))}
        return float(word)
    except ValueError:
        return word
