"""Options that name the robot of a command: `ROBOT`, `--set`, `--parameters`, and springs, tip and muscles of its model."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import refuse_too_large
from softrobots.cli.options.robot_parameters import check_names, make_robot, parse_parameters, xacro_parameters
from softrobots.cli.tools.kinematics import is_urdf_file
from softrobots.core.checks import FloatArray
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.description.expansion import expand
from softrobots.description.sources import read_source
from softrobots.model.loader import load_model
from softrobots.model.muscles import MUSCLE_INPUTS
from softrobots.model.soft_model import SoftModel
from softrobots.robots import ROBOTS, Robot, XacroRobot
from softrobots.robots.fields import argument_text
from softrobots.robots.parameter_file import read_parameters
from softrobots.robots.placed_robot import RobotPlacement


def add_robot(parser: argparse.ArgumentParser, *, optional: bool = False, option: bool = False) -> None:
    """Add `ROBOT`, which may be `optional`, or `--robot`, `--set` and `--parameters` to a parser; see `source_of`."""
    help_text = f"{', '.join(ROBOTS)}; a file of parameters that names one of them; or a URDF, xacro, MJCF or SDF file"
    if option:
        parser.add_argument("--robot", required=True, metavar="ROBOT", help=f"{help_text} (required)")
    else:
        parser.add_argument("robot", nargs="?" if optional else None, metavar="ROBOT", help=help_text)
    parser.add_argument(
        "--set",
        dest="parameters",
        nargs="+",
        action="extend",
        type=assignment,
        default=[],
        metavar="NAME=VALUE",
        help="parameters of the robot, or arguments of the xacro file; `softrobots urdf ROBOT --list` shows names, units and "
        "defaults",
    )
    help_text = "read parameters from a YAML or JSON file; those of --set win (none)"
    parser.add_argument("--parameters", dest="parameter_file", type=Path, metavar="FILE", help=help_text)


def add_model(parser: argparse.ArgumentParser, *, optional: bool = False, option: bool = False) -> None:
    """Add the options of `add_robot`, and `--spring`, `--tip` and `--muscles`, to a parser; see `model_of`."""
    add_robot(parser, optional=optional, option=option)
    help_text = "spring of a joint: stiffness K [N m/rad or N/m], relaxed at REST [rad or m] (that of the file, or 0); once "
    help_text += "for each joint; JOINT=none takes a spring away; other joints keep the springs of the file"
    parser.add_argument("--spring", action="append", type=spring, default=[], metavar="JOINT=K[,REST]", help=help_text)
    parser.add_argument("--tip", metavar="LINK", help="link that is the tip (the one that the file names, or its only end)")
    help_text = "input of muscles of given length or tension: lengths [m] or tensions [N] (as the description says)"
    parser.add_argument("--muscles", choices=MUSCLE_INPUTS, default=None, help=help_text)


def add_motors(
    parser: argparse._ActionsContainer,
    help_text: str = "motor joints, then muscles, base to tip, or each as NAME=Q [rad, m, N or Pa] (relaxed)",
    option: str = "--motors",
) -> None:
    """Add `--motors`, or an option like it; see `motors_of`."""
    parser.add_argument(option, type=named_number, nargs="+", metavar="Q", help=help_text)


def named_number(word: str) -> float | tuple[str, float]:
    """Parse a number, or NAME=NUMBER into both."""
    name, equals, number = word.rpartition("=")
    try:
        return (name, float(number)) if equals else float(word)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{word!r}: a number or NAME=NUMBER is required") from error


def assignment(word: str) -> str:
    """Check a word behind `--set` and return it; argparse passes all words up to the next option."""
    name, equals, _ = word.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"{word!r}: NAME=VALUE is required, and ROBOT before --set")
    return word


def spring(word: str) -> tuple[str, float | tuple[float, float] | None]:
    """Parse JOINT=K, JOINT=K,REST or JOINT=none into the joint and its spring, as `load_model` takes it."""
    joint, equals, numbers = word.rpartition("=")
    stiffness, _, rest = numbers.partition(",")
    try:
        number = None if numbers == "none" else float(stiffness)
        values = (number, float(rest)) if number is not None and rest else number
    except ValueError:
        equals = ""
    if not joint or not equals:
        raise argparse.ArgumentTypeError(f"{word!r}: JOINT=K, JOINT=K,REST or JOINT=none is required")
    return joint, values


def source_of(arguments: argparse.Namespace, *, placed: bool = True) -> Robot | Path | str:
    """Return what the arguments of `add_robot` name: a robot, the path of a URDF file, or URDF text made from another file.

    Args:
        arguments: The parsed arguments.
        placed: Whether the robot stands where a file of parameters says, with its markers; otherwise a warning tells that not.

    Raises:
        NameNotFound: If there is no such robot, file or parameter.
        ParameterError: If a parameter is refused, or the file of parameters is for another robot.
        FileFormatError: If the file of parameters cannot be read.
        DescriptionError: If xacro refuses the file, or it is of no kind that can be read.
        MissingDependency: If it is MJCF or SDF and the package that reads that is not installed.
    """
    robot, parameters = arguments.robot, arguments.parameters
    values: dict[str, Any] = {}
    if arguments.parameter_file is None and robot not in ROBOTS and Path(robot).suffix.lower() in (".yaml", ".yml", ".json"):
        owner, values = read_parameters(robot_file(robot))
        if owner not in ROBOTS:
            raise ParameterError("ROBOT", robot, f"a file of parameters with a line robot: NAME, of {', '.join(ROBOTS)}")
        robot = owner
    if arguments.parameter_file is not None:
        owner, values = read_parameters(arguments.parameter_file)
        if owner not in (None, robot, Path(robot).name):
            raise ParameterError("ROBOT", robot, f"{owner}, for which {arguments.parameter_file} is")
    placement = RobotPlacement.taken_from(values) if robot in ROBOTS else RobotPlacement()
    if placement.values() and not placed:
        warnings.warn(f"base and markers of {arguments.parameter_file or arguments.robot} are left out", stacklevel=1)
        placement = RobotPlacement()
    if robot in ROBOTS:
        return placement.place(make_robot(robot, parameters, values))
    file = robot_file(robot)
    if file.suffix == ".xacro":
        known = xacro_parameters(file)
        check_names(values, known, file.name)
        texts = {name: argument_text(value) for name, value in values.items()}
        return expand(file, texts | parse_parameters(parameters, known, file.name))
    for option, given in (("--parameters", arguments.parameter_file), ("--set", " ".join(parameters))):
        if given:
            raise ParameterError(option, str(given), f"left out: {file} is no xacro file")
    return file if is_urdf_file(file) else read_source(file)[0]


def model_of(arguments: argparse.Namespace, source: Robot | Path | str | None = None) -> SoftModel:
    """Return the model of the robot that the arguments of `add_model` name.

    Args:
        arguments: The parsed arguments.
        source: The result of `source_of`, if it is known.

    Raises:
        SoftRobotsError: Whatever `source_of` and `load_model` raise.
        ParameterError: If a joint is given two springs.
    """
    springs: dict[str, float | tuple[float, float] | None] = {}
    for joint, values in arguments.spring:
        if joint in springs:
            raise ParameterError("--spring", joint, "given once for each joint")
        springs[joint] = values
    source = source_of(arguments) if source is None else source
    return load_model(source, springs=springs or None, tip=arguments.tip, muscles=arguments.muscles)


def statics_model_of(arguments: argparse.Namespace, *, placed: bool = True) -> SoftModel:
    """Return the same model for a command that solves; robots too large for Pinocchio's workspace are refused beforehand.

    See `source_of` for `placed`.

    Raises:
        SoftRobotsError: Whatever `source_of` and `load_model` raise.
        ParameterError: If the robot has too many joints, or a joint is given two springs.
    """
    source = source_of(arguments, placed=placed)
    if isinstance(source, XacroRobot):
        given = {"--set": " ".join(arguments.parameters), "--parameters": arguments.parameter_file, "ROBOT": arguments.robot}
        option = next(name for name, value in given.items() if value)
        refuse_too_large(source, option, str(given[option]))
    return model_of(arguments, source)


def motors_of(model: SoftModel, words: Sequence[Any] | None, option: str = "--motors") -> FloatArray:
    """Return the actuator coordinates given by an option, or the relaxed ones without it, shape (n_motors,) [rad, m, N or Pa].

    Raises:
        ParameterError: If there are more or fewer numbers than actuators (which are named), or they are out of range.
        NameNotFound: If there is no actuator of a name.
    """
    if words is None:
        return np.array(model.relaxed_motors)
    named = [word for word in words if isinstance(word, tuple)]
    if not named:
        return model.checked_motors(words, option)
    if len(dict(named)) < len(words):
        given = " ".join("{}={:g}".format(*word) if isinstance(word, tuple) else f"{word:g}" for word in words)
        raise ParameterError(option, given, "numbers in order, or NAME=NUMBER once for each actuator")
    return model.checked_motors(dict(named), option)


def check_one_each(option: str, words: Sequence[float], names: Sequence[str], units: Sequence[str]) -> None:
    """Refuse more or fewer numbers of an option than there are actuators.

    Raises:
        ParameterError: If the counts differ; lists the actuators with their units.
    """
    if len(words) != len(names):
        named = ", ".join(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))
        raise ParameterError(
            option, list(words), f"{len(names)} numbers: {named}" if named else "left out: the robot has no motors"
        )


def one_or_each(option: str, numbers: Sequence[float] | None, names: Sequence[str], units: Sequence[str]) -> Any:
    """Return one number for all, or numbers for each of some coordinates, as the library takes them; None if not given.

    Raises:
        ParameterError: If there are several, but not one for each; lists the coordinates with their units.
    """
    if numbers is None or len(numbers) == 1:
        return None if numbers is None else numbers[0]
    check_one_each(option, numbers, names, units)
    return numbers


def robot_file(name: str) -> Path:
    """Return the path of a robot's file.

    Raises:
        NameNotFound: If it does not exist; lists the robots.
    """
    try:
        exists = Path(name).is_file()
    except OSError:  # a name too long for a file, or a folder without permission
        exists = False
    if not exists:
        raise NameNotFound("robot or file", name, ROBOTS)
    return Path(name)
