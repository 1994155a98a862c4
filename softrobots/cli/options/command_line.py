"""What the command and the scripts share: options of load and damping, the limit of size, and the exit status of a run."""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from softrobots.core.errors import NotConverged, ParameterError, SoftRobotsError
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.robots import XacroRobot
from softrobots.statics.loads import EARTH_GRAVITY


def take_negative_numbers(parser: argparse.ArgumentParser) -> None:
    """Make a parser read -1e-3 as a number, as Python 3.14 does; older versions take it for an option."""
    parser._negative_number_matcher = re.compile(r"-\.?\d")


def add_numbers(parser: argparse._ActionsContainer, option: str, names: str, help_text: str, **settings: Any) -> None:
    """Add an option of a number, called `names` in the help, or of as many numbers as `names` has words."""
    metavar = tuple(names.split())
    count = {"nargs": len(metavar), "metavar": metavar} if len(metavar) > 1 else {"metavar": names}
    parser.add_argument(option, type=float, help=help_text, **count, **settings)


def add_load(parser: argparse.ArgumentParser, force: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    """Add `--force` [N] with a default, and `--gravity` [m/s^2]; see `gravity_of`."""
    default = " ".join(f"{number:g}" for number in force)
    add_numbers(parser, "--force", "FX FY FZ", f"force on the tip [N] ({default})", default=tuple(force))
    add_gravity(parser)


def add_gravity(parser: argparse.ArgumentParser) -> None:
    """Add `--gravity` [m/s^2], which takes negative numbers in any form; see `gravity_of`."""
    take_negative_numbers(parser)
    add_numbers(parser, "--gravity", "G", "gravity, three numbers [m/s^2]; without numbers: 0 0 -9.81 (weightless)", nargs="*")


def add_damping(parser: argparse.ArgumentParser) -> None:
    """Add `--damping-time` [s] and `--mass-damping` [1/s]; see `softrobots.dynamics.damping`."""
    add_numbers(parser, "--damping-time", "T", "damping of springs over their stiffness [s] (damping of the file)")
    add_numbers(parser, "--mass-damping", "A", "damping in proportion to the mass [1/s] (0)", default=0.0)


def gravity_of(arguments: argparse.Namespace) -> Any:
    """Return the gravity of `--gravity`: its numbers, the Earth's without numbers, None without the option."""
    return arguments.gravity if arguments.gravity != [] else EARTH_GRAVITY


def refuse_too_large(robot: XacroRobot, option: str, value: Any) -> None:
    """Refuse a robot that is too large for Pinocchio's workspace, before xacro spends minutes on it.

    Raises:
        ParameterError: If the robot has more than `MAX_DOF` joints; names the option that sets its size, and its value.
    """
    if robot.n_joints > MAX_DOF:
        raise ParameterError(option, value, f"so few that the chain has at most {MAX_DOF} joints, not {robot.n_joints}")


def address_lines(url: str, tunnel: str) -> tuple[str, str]:
    """Return two lines: the address of a page on this machine, and the command that makes it reachable from another one."""
    return f"serving {url} (Ctrl-C ends)", f"from another machine: {tunnel}"


def exit_status(run: Callable[[], object]) -> int:
    """Run a command or script and return its exit status; print an error, and each warning once, as one line on stderr.

    Args:
        run: The whole job. It returns False if a check found something wrong; other results mean success.

    Returns:
        0; 1 if a check failed or there is no solution (`NotConverged`); 2 after any other `SoftRobotsError` or if the output
        cannot be written; 130 after Ctrl-C; 141 if the reader of the output has gone, e.g. `head`.
    """
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # closed, as by >&-
            setattr(sys, stream, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    try:
        try:
            return _status(run)
        finally:
            sys.stdout.flush()  # also after a help text, which ends in SystemExit
    except BrokenPipeError:
        _discard_output()
        return 141
    except OSError as error:  # e.g. a full disk behind >; the files of a command raise OutputError instead
        _print_error(f"error: {'' if error.filename else 'cannot write the answer: '}{error}")
        _discard_output()
        return 2


def _status(run: Callable[[], object]) -> int:
    told: set[str] = set()

    def tell(message: Any, *_: Any, **__: Any) -> None:
        if str(message) not in told:
            told.add(str(message))
            _print_error(f"warning: {message}")

    try:
        with warnings.catch_warnings():
            warnings.showwarning = tell
            return 1 if run() is False else 0
    except SoftRobotsError as error:
        _print_error(f"error: {error}")
        return 1 if isinstance(error, NotConverged) else 2
    except KeyboardInterrupt:
        _print_error("interrupted")
        return 130


def _print_error(line: str) -> None:
    with contextlib.suppress(OSError):  # a full disk behind 2>
        sys.stderr.write(f"{line}\n")


def _discard_output() -> None:
    """Discard buffered output, which Python would otherwise complain about when it exits."""
    with contextlib.suppress(io.UnsupportedOperation):  # stdout is no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
