"""`softrobots urdf`: generate the URDF of a robot, list robots and parameters, check a description."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softrobots.cli.options.robot_argument import add_robot, robot_file, source_of
from softrobots.cli.options.robot_parameters import first_sentence, robot_parameters, write_robot, xacro_parameters
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.tools.checks import check_description
from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file, write_text
from softrobots.core.summary import aligned
from softrobots.description.sources import read_source
from softrobots.description.urdf_rules import Finding
from softrobots.robots import ROBOTS, Robot

SHOWN = 8
"""Largest number of problems of one kind that are listed."""

_EXAMPLES = """examples:
  softrobots urdf --list                                       the robots
  softrobots urdf pcc_arm --list                               the parameters of one, with unit and default
  softrobots urdf inflatable_arm --set link_lengths=[0.5,0.4] stiffness=200 -o arm.urdf
  softrobots urdf inflatable_arm --set stiffness=200 --save-parameters arm.yaml
  softrobots urdf inflatable_arm --parameters arm.yaml --set pressure=40e3 -o arm.urdf
  softrobots urdf helix_tube --set contraction=0.8 --check     check what would be generated; writes nothing
  softrobots urdf my_robot.urdf --check                        check a file
  softrobots urdf my_robot.urdf.xacro --set length=0.3 > my_robot.urdf
  softrobots urdf my_robot.xml -o my_robot.urdf                translate MJCF or SDF
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "urdf",
        help="generate the URDF of a robot with its springs inside, or check a URDF file",
        description="Generate the URDF of a robot from its parameters, or check a robot description: yourdfpy's kinematics "
        "against Pinocchio's, masses, limits, springs, and the rules that a file must follow to load everywhere. A URDF file "
        "can only be checked.",
        epilog=_EXAMPLES,
    )
    add_robot(parser, optional=True)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="write the URDF there instead of printing it")
    parser.add_argument("--overwrite", action="store_true", help="allow files to be replaced")
    help_text = (
        "write all parameters of the robot to a file that --parameters reads, YAML or JSON, instead of printing the URDF"
    )
    parser.add_argument("--save-parameters", type=Path, metavar="FILE", help=help_text)
    parser.add_argument("--check", action="store_true", help="check the description; exit with status 1 if anything is wrong")
    parser.add_argument("--list", action="store_true", help="list the robots, or the parameters of ROBOT")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> bool:
    """List, check, generate or translate; return False if a check finds something wrong."""
    _refuse_contradictions(arguments)
    if arguments.list:
        _list(arguments)
        return True
    source = source_of(arguments)
    if isinstance(source, Path) and (arguments.output is not None or not arguments.check):
        requirement = "a robot, or a xacro, MJCF or SDF file; a URDF file can only be checked, with --check"
        raise ParameterError("ROBOT", str(source), requirement)
    if arguments.save_parameters is not None and (arguments.robot not in ROBOTS or isinstance(source, str)):
        requirement = f"given for one of {', '.join(ROBOTS)}, without base and markers"
        raise ParameterError("--save-parameters", str(arguments.save_parameters), requirement)
    for file in (arguments.output, arguments.save_parameters):
        if file is not None:
            new_file(file, overwrite=arguments.overwrite)  # refused before the work
    findings = check_description(source) if arguments.check else ()
    all_ok = all(finding.ok for finding in findings)
    lines = _report(findings)
    answer: dict[str, Any] = {}
    if arguments.check:
        rows = [{**finding._asdict(), "ok": finding.ok} for finding in findings]
        answer = {"ok": all_ok, "findings": rows, "files": []}
    if all_ok:
        answer |= _write(arguments, source)
    lines += [f"{file}: written" for file in answer.get("files", ())]
    if answer:
        print_answer(arguments, answer, lines)
    else:
        sys.stdout.write(read_source(source)[0])
    return all_ok


def _write(arguments: argparse.Namespace, source: Robot | Path | str) -> dict[str, list[Path]]:
    """Write the files of -o and --save-parameters; return their paths under "files"."""
    files = []
    if arguments.output is not None:
        files.append(write_text(arguments.output, read_source(source)[0], overwrite=arguments.overwrite))
    if arguments.save_parameters is not None:
        file, overwrite = arguments.save_parameters, arguments.overwrite
        files.append(write_robot(file, arguments.robot, source, {}, overwrite=overwrite))
    return {"files": files} if files else {}


def _report(findings: Sequence[Finding]) -> list[str]:
    """Findings, a line each."""
    report = []
    for finding in findings:
        lines = [f"wrong  {finding.what}: {text}" for text in finding.problems]
        if not lines and len(finding.remarks) == 1:
            lines = [f"ok     {finding.what}: {finding.remarks[0]}"]
        else:
            lines = [*(lines or [f"ok     {finding.what}"]), *(f"       {text}" for text in finding.remarks)]
        report += lines[:SHOWN] + ([f"       {len(lines) - SHOWN} more like these"] if len(lines) > SHOWN else [])
    return report


def _refuse_contradictions(arguments: argparse.Namespace) -> None:
    if arguments.robot is None and not arguments.list:
        raise ParameterError("ROBOT", "(nothing)", f"one of {', '.join(ROBOTS)}, or a file")
    files = arguments.output is not None or arguments.save_parameters is not None
    if arguments.list and (arguments.parameters or arguments.parameter_file or files or arguments.check):
        raise ParameterError("--list", "given", "given without --set, --parameters, --save-parameters, -o and --check")
    if arguments.overwrite and not files:
        raise ParameterError("--overwrite", "given", "given together with -o FILE or --save-parameters FILE")
    if arguments.json and not (arguments.list or arguments.check or files):
        raise ParameterError("--json", "given", "given with --list, --check or -o FILE; what is printed otherwise is URDF")


def _list(arguments: argparse.Namespace) -> None:
    """Print names and meanings of the robots, or of the parameters of one."""
    if arguments.robot is None:
        robots = {name: first_sentence(name) for name in ROBOTS}
        print_answer(arguments, {"robots": robots}, aligned(robots.items()))
        return
    known = arguments.robot in ROBOTS
    parameters = robot_parameters(arguments.robot) if known else xacro_parameters(robot_file(arguments.robot))
    lines = [line for parameter in parameters for line in (f"{parameter.name}={parameter.default}", f"    {parameter.text}")]
    print_answer(arguments, {"robot": arguments.robot, "parameters": [parameter._asdict() for parameter in parameters]}, lines)
