"""What the scripts share at the command line: the load, the size of a robot, what was written, and how a run ends."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from softrobots.core.checkpoint import discard
from softrobots.core.errors import FileFormatError, NotConverged, OutputExists, ParameterError, SoftRobotsError
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.statics.loads import EARTH_GRAVITY


class Sized(Protocol):
    """A robot that knows its size before it is made."""

    @property
    def n_joints(self) -> int:
        """Number of movable joints."""


class Served(Protocol):
    """A page that a browser can open."""

    @property
    def url(self) -> str:
        """Its address."""

    @property
    def port(self) -> int:
        """Its port."""

    @property
    def tunnel(self) -> str:
        """The command that makes it reachable from another machine."""

    def wait(self) -> None:
        """Serve until Ctrl-C."""


def take_negative_numbers(parser: argparse.ArgumentParser) -> None:
    """Make a parser take -1e-3 for a number, as that of Python 3.14 does; before it, that was an option."""
    parser._negative_number_matcher = re.compile(r"-\.?\d")


def add_load(parser: argparse.ArgumentParser, force: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    """Give a parser `--force` [N] with a default, and `--gravity` [m/s^2]; see `gravity_of`."""
    told = " ".join(f"{number:g}" for number in force)
    parser.add_argument(
        "--force", type=float, nargs=3, metavar=("FX", "FY", "FZ"), default=tuple(force), help=f"force on the tip [N] ({told})"
    )
    add_gravity(parser)


def add_gravity(parser: argparse.ArgumentParser) -> None:
    """Give a parser `--gravity` [m/s^2], negative numbers in any form too; see `gravity_of`."""
    take_negative_numbers(parser)
    told = "gravity, three numbers [m/s^2]; without numbers: 0 0 -9.81 (weightless)"
    parser.add_argument("--gravity", type=float, nargs="*", metavar="G", help=told)


def gravity_of(arguments: argparse.Namespace) -> Any:
    """Gravity that `--gravity` asks for: the numbers given, the Earth's without numbers, None without the option."""
    return arguments.gravity if arguments.gravity != [] else EARTH_GRAVITY


def add_resume(parser: argparse.ArgumentParser) -> None:
    """Give a parser `--resume`; see `blocks_beside`."""
    told = "go on with the finished blocks that an interrupted run with the same --output left beside it, if there are any"
    parser.add_argument("--resume", action="store_true", help=told)


@contextlib.contextmanager
def blocks_beside(output: Path, arguments: argparse.Namespace) -> Iterator[Path]:
    """The folder for the finished blocks of a long run, for the time of the run; it is deleted if all goes well.

    Args:
        output: What the run writes.
        arguments: With `resume`, and `output` as it was given.

    Yields:
        The folder, beside the output.

    Raises:
        ParameterError: If `--resume` is given without `--output`.
        OutputExists: If blocks of an interrupted run are there and `--resume` is not given.
        OutputError: If they cannot be deleted in the end.
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
            _tell(f"the finished blocks are kept in {folder}: --resume --output {output} goes on from there")
        raise
    discard(folder)


def refuse_too_large(robot: Sized, option: str, value: Any) -> None:
    """Refuse a robot that Pinocchio's workspace is not made for, before xacro spends minutes on it.

    Args:
        robot: The robot.
        option: The option that made it so large, for the error.
        value: Its value.

    Raises:
        ParameterError: If the robot has more than `MAX_DOF` joints.
    """
    if robot.n_joints > MAX_DOF:
        raise ParameterError(option, value, f"so few that the chain has at most {MAX_DOF} joints, not {robot.n_joints}")


def tell_written(folder: Path) -> None:
    """Print the names of the files in a folder of results."""
    sys.stdout.write(f"\nwritten to {folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}\n")


def address_lines(page: Served) -> tuple[str, str]:
    """Where a page is, from this machine and from another one."""
    return f"serving {page.url} (Ctrl-C ends)", f"from another machine: {page.tunnel}"


def serve(page: Served) -> None:
    """Print where a page is, and serve it until Ctrl-C: what `--meshcat` asks for."""
    sys.stdout.write("".join(f"{line}\n" for line in ("", *address_lines(page))))
    sys.stdout.flush()
    page.wait()


def exit_status(run: Callable[[], object]) -> int:
    """Run a script and tell how it ended; an error is a line on stderr, also if the output itself cannot be written.

    Args:
        run: The whole job. It returns False if it checked something that is wrong; whatever else it returns is fine.

    Returns:
        0, or 1 if a check failed or there is no answer (`NotConverged`), 2 after any other error of ours or if the output
        cannot be written, 130 after Ctrl-C, 141 if nobody reads the output any more.
    """
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # closed, as by >&-: nobody wants to read
            setattr(sys, stream, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    try:
        try:
            return _status(run)
        finally:
            sys.stdout.flush()  # also of a help text, which ends in SystemExit
    except BrokenPipeError:  # whoever read the output has seen enough, e.g. head
        _give_up_output()
        return 141
    except OSError as error:  # e.g. a full disk behind >; files that we write ourselves end in errors of ours
        _tell(f"error: {'' if error.filename else 'cannot write the answer: '}{error}")
        _give_up_output()
        return 2


def _status(run: Callable[[], object]) -> int:
    try:
        return 1 if run() is False else 0
    except SoftRobotsError as error:
        _tell(f"error: {error}")
        return 1 if isinstance(error, NotConverged) else 2
    except KeyboardInterrupt:
        _tell("interrupted")
        return 130


def _tell(line: str) -> None:
    with contextlib.suppress(OSError):  # a full disk behind 2>
        sys.stderr.write(f"{line}\n")


def _give_up_output() -> None:
    """Let go what is not written yet, or Python would complain of it at its end."""
    with contextlib.suppress(io.UnsupportedOperation):  # not a file at all
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
