"""The command `softrobots`: one subcommand a job, each in a module of `softrobots.commands`."""

from __future__ import annotations

import argparse
import difflib
import os
import re
import sys
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

from softrobots import __version__
from softrobots.command_line import exit_status
from softrobots.commands import COMMANDS


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Help whose description is filled, and whose examples stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if text.startswith("examples:"):
            return super()._fill_text(text, width, indent)
        return "\n\n".join(
            textwrap.fill(part, width, initial_indent=indent, subsequent_indent=indent) for part in text.split("\n\n")
        )


class Parser(argparse.ArgumentParser):
    """A parser that takes -1e-3 for a number, wants options in full, and tells the nearest word for one it does not know."""

    def __init__(self, **options: Any) -> None:
        """Make a parser; those of its subcommands are of the same kind."""
        super().__init__(**(options | {"allow_abbrev": False, "formatter_class": Formatter}))
        self._negative_number_matcher = re.compile(r"-\.?\d")  # that of Python 3.14; before it, -1e-3 was an option

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
        The exit status, as `command_line.exit_status` tells; 141 if nobody reads the output any more.
    """
    arguments = parser().parse_args(argv)
    try:
        status = exit_status(lambda: arguments.run(arguments))
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read the output has seen enough, e.g. head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    return status


def _nearest(word: str, names: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(names), n=1)
    return f" (did you mean {near[0]!r}?)" if near else ""


if __name__ == "__main__":
    sys.exit(main())
