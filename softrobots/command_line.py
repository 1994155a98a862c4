"""What the scripts share at the command line: the load, the size of a robot, what was written, and how a run ends."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from softrobots.errors import NotConverged, ParameterError, SoftRobotsError
from softrobots.loads import EARTH_GRAVITY
from softrobots.model import MAX_DOF


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


def add_load(parser: argparse.ArgumentParser, force: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    """Give a parser `--force` [N] with a default, and `--gravity` [m/s^2]; see `gravity_of`."""
    told = " ".join(f"{number:g}" for number in force)
    parser.add_argument(
        "--force", type=float, nargs=3, metavar=("FX", "FY", "FZ"), default=tuple(force), help=f"force on the tip [N] ({told})"
    )
    add_gravity(parser)


def add_gravity(parser: argparse.ArgumentParser) -> None:
    """Give a parser `--gravity` [m/s^2]; see `gravity_of`."""
    told = "gravity, three numbers [m/s^2]; without numbers: 0 0 -9.81 (weightless)"
    parser.add_argument("--gravity", type=float, nargs="*", metavar="G", help=told)


def gravity_of(arguments: argparse.Namespace) -> Any:
    """Gravity that `--gravity` asks for: the numbers given, the Earth's without numbers, None without the option."""
    return arguments.gravity if arguments.gravity != [] else EARTH_GRAVITY


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
    """Run a script and tell how it ended; an error is a line on stderr.

    Args:
        run: The whole job. It returns False if it checked something that is wrong; whatever else it returns is fine.

    Returns:
        0, or 1 if a check failed or there is no answer (`NotConverged`), 2 after any other error of ours, 130 after Ctrl-C.
    """
    try:
        if run() is False:
            return 1
    except SoftRobotsError as error:
        sys.stderr.write(f"error: {error}\n")
        return 1 if isinstance(error, NotConverged) else 2
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return 130
    return 0
