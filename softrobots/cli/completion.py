"""`softrobots completion`: the script that lets a shell complete the command."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from softrobots.robots import ROBOTS

SHELLS = ("bash", "zsh", "tcsh")
"""The supported shells."""

_EXAMPLES = """examples:
  source <(softrobots completion bash)                                                  bash, this session
  softrobots completion bash > ~/.local/share/bash-completion/completions/softrobots    bash, from the next one on
  softrobots completion zsh > ~/.zfunc/_softrobots                                      zsh, with ~/.zfunc in fpath
  softrobots completion tcsh > ~/.softrobots.tcsh                                       tcsh, sourced by ~/.tcshrc
"""

_FUNCTION = "_softrobots_robot_or_file"  # the word "file" in it tells shtab's bash script to treat what it finds as files
_PREAMBLES = {
    "bash": f"""{_FUNCTION}() {{
  compgen -W "{" ".join(ROBOTS)}" -- "$1"
  compgen -f -- "$1"
}}""",
    "zsh": f"""{_FUNCTION}() {{
  _alternative 'robots:robot:({" ".join(ROBOTS)})' 'files:file:_files'
}}""",
    "tcsh": "",
}
_ROBOT = {"bash": _FUNCTION, "zsh": _FUNCTION, "tcsh": f"({' '.join(ROBOTS)})"}  # tcsh knows names or files, not both


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "completion",
        help="print the script that lets a shell complete this command",
        description="Print the script with which a shell completes commands, options, robots, choices and files.",
        epilog=_EXAMPLES,
    )
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"{', '.join(SHELLS[:-1])} or {SHELLS[-1]}")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print the script."""
    import shtab

    for action in _actions(arguments.whole):
        if action.dest == "robot":
            action.complete = _ROBOT  # type: ignore[attr-defined]
        elif action.type is Path:
            folder = "FOLDER" in str(action.metavar)
            action.complete = shtab.DIRECTORY if folder else shtab.FILE  # type: ignore[attr-defined]
    sys.stdout.write(shtab.complete(arguments.whole, arguments.shell, preamble=_PREAMBLES[arguments.shell]) + "\n")


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Arguments of a parser and of those of its subcommands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from _actions(inner)
