"""`softrobots urdf`: generate the URDF of a robot, list robots and parameters, check a description."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from softrobots.commands.robot_parameters import (
    first_sentence,
    make_robot,
    parse_parameters,
    robot_parameters,
    xacro_parameters,
)
from softrobots.description import expand
from softrobots.errors import NameNotFound, ParameterError
from softrobots.files import write_text
from softrobots.interop.checks import check_description
from softrobots.interop.kinematics import is_urdf_file
from softrobots.interop.urdf_rules import Finding
from softrobots.robots import ROBOTS, Robot
from softrobots.sources import read_source

SHOWN = 8
"""Problems of one kind that are told one by one."""

_EXAMPLES = """examples:
  softrobots urdf --list                                       the robots
  softrobots urdf pcc_arm --list                               the parameters of one, with unit and default
  softrobots urdf inflatable_arm link_lengths=[0.5,0.4] stiffness=200 -o arm.urdf
  softrobots urdf helix_tube contraction=0.8 --check           check what would be generated; writes nothing
  softrobots urdf my_robot.urdf --check                        check a file
  softrobots urdf my_robot.urdf.xacro length=0.3 > my_robot.urdf
  softrobots urdf my_robot.xml -o my_robot.urdf                translate MJCF or SDF
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "urdf",
        help="generate the URDF of a robot with its springs inside, or check a URDF file",
        description="Generate the URDF of a robot from its parameters, or check a robot description: yourdfpy's kinematics "
        "against Pinocchio's, masses, limits, springs, and the rules that a file must follow to load everywhere.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "robot",
        nargs="?",
        metavar="ROBOT",
        help=f"{', '.join(ROBOTS)}; a xacro, MJCF or SDF file; or, to check it, a URDF file",
    )
    parser.add_argument(
        "parameters", nargs="*", metavar="FIELD=VALUE", help="parameters of the robot, or arguments of the xacro file"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the URDF there instead of printing it")
    parser.add_argument("--overwrite", action="store_true", help="allow -o to replace a file")
    parser.add_argument("--check", action="store_true", help="check the description; exit with status 1 if anything is wrong")
    parser.add_argument("--list", action="store_true", help="list the robots, or the parameters of ROBOT")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> bool:
    """Do what the arguments ask for; return whether a check, if one is asked for, finds all well."""
    _refuse_contradictions(arguments)
    if arguments.list:
        sys.stdout.write(_listing(arguments.robot))
        return True
    source = robot_source(arguments.robot, arguments.parameters)
    if isinstance(source, Path) and (arguments.output is not None or not arguments.check):
        requirement = "a robot, a xacro, MJCF or SDF file; a URDF file can only be checked, with --check"
        raise ParameterError("ROBOT", str(source), requirement)
    if arguments.check and not report(check_description(source)):
        return False
    text, _ = read_source(source)
    if arguments.output is not None:
        sys.stdout.write(f"{write_text(arguments.output, text, overwrite=arguments.overwrite)}: written\n")
    elif not arguments.check:
        sys.stdout.write(text)
    return True


def report(findings: tuple[Finding, ...]) -> bool:
    """Print findings, a line each, and return whether all is well."""
    for finding in findings:
        lines = [f"wrong  {finding.what}: {text}" for text in finding.problems]
        if not lines and len(finding.remarks) == 1:
            lines = [f"ok     {finding.what}: {finding.remarks[0]}"]
        else:
            lines = [*(lines or [f"ok     {finding.what}"]), *(f"       {text}" for text in finding.remarks)]
        hidden = [f"       {len(lines) - SHOWN} more like these"] if len(lines) > SHOWN else []
        sys.stdout.write("".join(f"{line}\n" for line in (*lines[:SHOWN], *hidden)))
    return all(finding.ok for finding in findings)


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    if arguments.robot is None and not arguments.list:
        raise ParameterError("ROBOT", "(nothing)", f"one of {', '.join(ROBOTS)}, or a file")
    if arguments.list and (arguments.parameters or arguments.output or arguments.check):
        raise ParameterError("--list", "given", "given without parameters, -o and --check")
    if arguments.overwrite and arguments.output is None:
        raise ParameterError("--overwrite", "given", "given together with -o FILE")


def _listing(robot: str | None) -> str:
    """Names and meanings of the robots, or of the parameters of one."""
    if robot is None:
        width = max(map(len, ROBOTS))
        return "".join(f"{name:<{width}}  {first_sentence(name)}\n" for name in ROBOTS)
    parameters = robot_parameters(robot) if robot in ROBOTS else xacro_parameters(_file(robot))
    return "\n".join(f"{parameter.name}={parameter.default}\n    {parameter.text}" for parameter in parameters) + "\n"


def robot_source(robot: str, parameters: list[str]) -> Robot | Path | str:
    """What the words stand for: a robot, the path of a URDF file, or the URDF text that another file expands or translates to.

    Args:
        robot: Name of a robot of `ROBOTS`, or a path.
        parameters: Parameters of the robot or of the xacro file, each `field=value`.

    Raises:
        NameNotFound: If there is no such robot, file or parameter.
        ParameterError: If a parameter is refused.
        DescriptionError: If xacro refuses the file, or it is of no kind that can be read.
        MissingDependency: If it is MJCF or SDF and the package that reads that is not installed.
    """
    if robot in ROBOTS:
        return make_robot(robot, parameters)
    file = _file(robot)
    if file.suffix == ".xacro":
        return expand(file, parse_parameters(parameters, xacro_parameters(file), file.name))
    if parameters:
        raise ParameterError("parameters", " ".join(parameters), f"left out: {file} is no xacro file")
    return file if is_urdf_file(file) else read_source(file)[0]


def _file(name: str) -> Path:
    if not Path(name).is_file():
        raise NameNotFound("robot or file", name, ROBOTS)
    return Path(name)
