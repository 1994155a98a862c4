"""The command `softrobots`: one subcommand a job, each in a module of `softrobots.cli`."""

from __future__ import annotations

import argparse
import difflib
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

from softrobots.cli import bench, completion, doctor, export, helix, ik, load, pcc, solve, urdf, view
from softrobots.cli.options.command_line import exit_status, take_negative_numbers
from softrobots.cli.options.option_names import told_by_option
from softrobots.core.errors import ParameterError
from softrobots.version import __version__

COMMANDS = (urdf, export, solve, load, ik, pcc, helix, view, bench, doctor, completion)
"""Modules of the subcommands, in the order of the help."""


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Help whose paragraphs are filled, and whose examples keep their lines unless one is too long."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n\n".join(
            _examples(part, width)
            if part.startswith("examples:")
            else textwrap.fill(part, width, initial_indent=indent, subsequent_indent=indent)
            for part in text.strip().split("\n\n")
        )


def _examples(text: str, width: int) -> str:
    """Examples that fit: comments stand above where they do not fit beside, and long commands go on as a shell reads them."""
    head, *lines = text.split("\n")
    if all(len(line) <= width for line in lines):
        return text
    told = [head]
    for line in lines:
        command, *comment = re.split(r" {3,}", line.strip())
        told += [f"  # {words}" for words in comment]
        parts = [f"  {command}"]
        if len(parts[0]) > width:
            parts = [""]
            for words in re.split(r" (?=--?[a-z]|>)", command):  # an option with its values
                longer = f"{parts[-1]} {words}" if parts[-1] else f"  {words}"
                if len(longer) + 2 <= width:
                    parts[-1] = longer
                else:
                    parts.append(f"      {words}")
        told.append(" \\\n".join(parts))
    return "\n".join(told)


class Parser(argparse.ArgumentParser):
    """A parser that takes -1e-3 for a number, wants options in full, and tells the nearest word for one it does not know."""

    def __init__(self, **options: Any) -> None:
        """Make a parser; those of its subcommands are of the same kind."""
        super().__init__(**(options | {"allow_abbrev": False, "formatter_class": Formatter}))
        take_negative_numbers(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Parse words, and refuse those that are left over."""
        arguments, rest = super().parse_known_args(args, namespace)
        if rest:
            hint = _nearest(rest[0].partition("=")[0], self._option_string_actions)
            if hasattr(arguments, "parameters") and any("=" in word for word in rest if not word.startswith("-")):
                hint = "; parameters of the robot stand behind --set: --set NAME=VALUE"
            self.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return arguments, rest

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [str(name) for name in action.choices]
            told = f"invalid choice: {value!r}{_nearest(str(value), names)}; choose from {', '.join(names)}"
            raise argparse.ArgumentError(action, told)


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = Parser(
        prog="softrobots",
        description="Soft robots as robot descriptions that robotics tools can load, with certified statics.",
        epilog="`softrobots COMMAND --help` explains a command.",
    )
    made.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    made.set_defaults(whole=made)  # for `softrobots completion`
    subparsers = made.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands")
    for command in COMMANDS:
        command.add_parser(subparsers)
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand.

    Args:
        argv: Words of the command line; by default those of the process.

    Returns:
        The exit status, as `command_line.exit_status` tells.
    """
    return exit_status(lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> object:
    """Run a subcommand; what is wrong with an option is told by its name."""
    arguments = parser().parse_args(argv)
    try:
        return arguments.run(arguments)
    except ParameterError as error:
        raise told_by_option(error, arguments) from error


def _nearest(word: str, names: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(names), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


if __name__ == "__main__":
    sys.exit(main())
