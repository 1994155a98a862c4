"""The command `softrobots` and its subcommands, each a module of `softrobots.cli`."""

from __future__ import annotations

import argparse
import re
import sys
import textwrap
from collections.abc import Sequence
from typing import Any, NoReturn

from softrobots.cli import (
    bench,
    branches,
    characterise,
    completion,
    doctor,
    export,
    helix,
    identify,
    ik,
    load,
    modes,
    pcc,
    simulate,
    solve,
    urdf,
    view,
)
from softrobots.cli.options.command_line import exit_status, take_negative_numbers
from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.version import __version__

COMMANDS = (
    *(urdf, export, solve, branches, load, ik, simulate, modes, characterise, identify, pcc, helix, view, bench, doctor),
    completion,
)
"""Modules of the subcommands, in the order of the help."""


_ALIASES = {
    "model": "robot",
    "path": "output",
    "priors": "prior",
    "validation": "hold_out",
    "springs": "spring",
    "q_motors": "motors",
    "q_motors0": "start",
    "motor_torques": "torques",
    "orientation": "direction",
    "segment_lengths": "rest",
    "muscle_distance": "distance",
    "muscle_azimuths": "azimuths",
    "muscle_contraction": "contraction",
    "muscle_extension": "extension",
    "offset": "offsets",
    "length": "arcs",
    "bending": "arcs",
    "azimuth": "arcs",
}
"""Arguments of the library whose option has another name, where a command has that option."""

_FIRST = """`softrobots COMMAND --help` explains a command, with examples.

examples:
  softrobots urdf --list                                        the robots by name; a URDF, MJCF or SDF file is one, too
  softrobots solve inflatable_arm --motors 0.3 0.6 -0.8 --force 0 10 -15   the certified equilibrium
  softrobots view inflatable_arm --interactive page.html        a page in which it is solved as you drag"""

_SPELLED = {"robot": "ROBOT", "lengths": "L", "arcs": "--arc"}
"""Options whose spelling is not their name with dashes before it."""


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Help with filled paragraphs, and examples that keep their lines unless one is too long."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n\n".join(
            _examples(part, width)
            if part.startswith("examples:")
            else textwrap.fill(part, width, initial_indent=indent, subsequent_indent=indent)
            for part in text.strip().split("\n\n")
        )


def _examples(text: str, width: int) -> str:
    """Wrap examples to a width: comments move above the command, long commands continue after a backslash."""
    head, *lines = text.split("\n")
    if all(len(line) <= width for line in lines):
        return text
    shown = [head]
    for line in lines:
        command, *comment = re.split(r" {3,}", line.strip())
        shown += [f"  # {words}" for words in comment]
        parts = [f"  {command}"]
        if len(parts[0]) > width:
            parts = [""]
            for words in re.split(r" (?=--?[a-z]|>)", command):  # an option with its values
                longer = f"{parts[-1]} {words}" if parts[-1] else f"  {words}"
                if len(longer) + 2 <= width:
                    parts[-1] = longer
                else:
                    parts.append(f"      {words}")
        shown.append(" \\\n".join(parts))
    return "\n".join(shown)


class Parser(argparse.ArgumentParser):
    """A parser that reads -1e-3 as a number, takes no abbreviated options, and suggests the nearest word for an unknown one."""

    def __init__(self, **options: Any) -> None:
        """Build a parser; those of its subcommands are of the same class."""
        super().__init__(**(options | {"allow_abbrev": False, "formatter_class": Formatter}))
        take_negative_numbers(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse words; refuse unknown ones with a hint."""
        arguments, rest = super().parse_known_args(args, namespace)
        if rest:
            hint = NameNotFound("option", rest[0].partition("=")[0], self._option_string_actions).hint
            if hasattr(arguments, "parameters") and any("=" in word for word in rest if not word.startswith("-")):
                hint = "; parameters of the robot follow --set: --set NAME=VALUE"
            self.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return arguments, rest

    def error(self, message: str) -> NoReturn:
        """Say what is wrong in one line, as all other errors; the usage of a command would hide it."""
        self.exit(2, f"error: {message}; {self.prog} --help explains\n")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [str(name) for name in action.choices]
            hint = NameNotFound("choice", value, names).hint
            message = f"invalid choice: {value!r}{hint}; choose from {', '.join(names)}"
            raise argparse.ArgumentError(action, message)


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    command_parser = Parser(
        prog="softrobots",
        description="Soft robots as robot descriptions that robotics tools can load, with certified statics.",
        epilog=_FIRST,
    )
    command_parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    command_parser.set_defaults(whole=command_parser)  # for `softrobots completion`
    subparsers = command_parser.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands")
    for command in COMMANDS:
        command.add_parser(subparsers)
    return command_parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Args:
        argv: Words of the command line; by default those of the process.

    Returns:
        The exit status; see `command_line.exit_status`.
    """
    return exit_status(lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> object:
    """Run a subcommand; a ParameterError names the option instead of the library's argument."""
    if not (sys.argv[1:] if argv is None else argv):
        parser().print_help()
        sys.exit(2)
    arguments = parser().parse_args(argv)
    try:
        return arguments.run(arguments)
    except ParameterError as error:
        raise _naming_option(error, arguments) from error


def _naming_option(error: ParameterError, arguments: argparse.Namespace) -> ParameterError:
    """The error with the option in place of the library's argument, or the same error if no option of the command is meant."""
    given = vars(arguments)
    field = error.field.partition("[")[0]  # without the key of an item
    name = field if field in given else _ALIASES.get(field, "")
    if name not in given or str(error) != str(ParameterError(error.field, error.value, error.requirement)):
        return error
    value = given[name] if name in _SPELLED else error.value
    return ParameterError(_SPELLED.get(name, f"--{name.replace('_', '-')}"), value, error.requirement)


if __name__ == "__main__":
    sys.exit(main())
