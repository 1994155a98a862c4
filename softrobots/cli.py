"""The command `softrobots`: one subcommand a job, each in a module of `softrobots.commands`."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from softrobots import __version__
from softrobots.command_line import exit_status
from softrobots.commands import COMMANDS


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(
        prog="softrobots",
        description="Soft robots as robot descriptions that robotics tools can load, with certified statics.",
        epilog="`softrobots COMMAND --help` explains a command.",
    )
    made.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
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
    made = parser()
    arguments, rest = made.parse_known_args(argv)
    if rest:  # argparse wants all positional words in one place; parameters may also follow an option
        if not hasattr(arguments, "parameters") or any(word.startswith("-") or "=" not in word for word in rest):
            made.error(f"unrecognized arguments: {' '.join(rest)}")
        arguments.parameters += rest
    try:
        status = exit_status(lambda: arguments.run(arguments))
        sys.stdout.flush()
    except BrokenPipeError:  # whoever read the output has seen enough, e.g. head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    return status


if __name__ == "__main__":
    sys.exit(main())
