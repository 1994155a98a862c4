"""What the scripts share at the command line beside `softrobots.cli.options.command_line`."""

from __future__ import annotations

import argparse
import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

from softrobots.cli.options.command_line import address_lines
from softrobots.core.errors import FileFormatError, OutputExists, ParameterError
from studies.shared.folders import discard


def add_resume(parser: argparse.ArgumentParser) -> None:
    """Add `--resume` to a parser; see `blocks_beside`."""
    help_text = "go on with the finished blocks that an interrupted run with the same --output left beside it, if any"
    parser.add_argument("--resume", action="store_true", help=help_text)


@contextlib.contextmanager
def blocks_beside(output: Path, arguments: argparse.Namespace) -> Iterator[Path]:
    """Keep the finished blocks of a long run in a folder beside its output; delete the folder if the run succeeds.

    Args:
        output: What the run writes.
        arguments: With `resume`, and `output` as it was given.

    Yields:
        The folder.

    Raises:
        ParameterError: If `--resume` is given without `--output`.
        OutputExists: If blocks of an interrupted run are there and `--resume` is not given.
        OutputError: If the folder cannot be deleted in the end.
    """
    if arguments.resume and arguments.output is None:
        raise ParameterError("--resume", True, "given with --output, the one of the interrupted run")
    named = output if output.name not in ("", "..") else output.resolve()  # "." has no name to begin with
    folder = named.with_name(f"{named.name}.blocks")
    if folder.exists() and not arguments.resume:
        raise OutputExists(
            f"{folder} holds the finished blocks of an interrupted run: --resume goes on from there; to start anew, delete it"
        )
    try:
        yield folder
    except BaseException as error:
        if folder.exists() and not isinstance(error, ParameterError | FileFormatError | OutputExists):  # refused: of no use
            with contextlib.suppress(OSError):
                sys.stderr.write(f"the finished blocks are kept in {folder}: --resume --output {output} goes on from there\n")
        raise
    discard(folder)


def tell_written(folder: Path) -> None:
    """Print the names of the files in a folder of results."""
    sys.stdout.write(f"\nwritten to {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}\n")


class Served(Protocol):
    """A page that a browser can open, such as a `softrobots.Viewer`."""

    @property
    def url(self) -> str:
        """Its address."""

    @property
    def tunnel(self) -> str:
        """The command that makes it reachable from another machine."""

    def wait(self) -> None:
        """Serve until Ctrl-C."""


def serve(page: Served) -> None:
    """Print the address of a page and serve it until Ctrl-C, for `--meshcat`."""
    sys.stdout.write("".join(f"{line}\n" for line in ("", *address_lines(page.url, page.tunnel))))
    sys.stdout.flush()
    page.wait()
