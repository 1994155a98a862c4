"""`-o FILE` and `--plot FILE.png` of a command: refused before the work if they cannot be written, written at the end."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file, write_text
from softrobots.core.result_file import save_csv, save_result
from softrobots.export.mcap_log import require_mcap, write_mcap
from softrobots.export.ros_messages import to_ros2_yaml
from softrobots.view.figures import canvas

RESULT_FILES = (".npz", ".json", ".csv")
"""Endings of files with the numbers of a result."""

ROS_FILES = (".yaml", ".mcap")
"""Endings of files for ROS 2."""

ROS_FORMS = (
    "as .npz or .json, for softrobots.load_result, as a .csv table, as .yaml, a message of ROS 2, or as .mcap, a log of "
    "ROS 2 and Foxglove (extra mcap)"
)
"""What is saved in files with an ending of `RESULT_FILES` or `ROS_FILES`."""


def add_output(
    parser: argparse.ArgumentParser, what: str, forms: str = "as .npz or .json, for softrobots.load_result, or as a .csv table"
) -> None:
    """Add `-o`, which saves `what` in some forms, `RESULT_FILES` by default; `--overwrite` comes with `add_plot`."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"save {what} {forms} (not saved)")


def check_files(arguments: argparse.Namespace, *endings: str) -> None:
    """Refuse a file of `-o`, or of `--plot` if the command has it, that cannot be written.

    Raises:
        ParameterError: If the name of the first has none of the endings, by default those of `RESULT_FILES`.
        OutputExists: If it exists and `--overwrite` is not given, or it is a folder.
        OutputError: If its folder cannot be created.
        MissingDependency: If it is a log, and what writes it is not installed.
        SoftRobotsError: What `check_plot` raises.
    """
    if arguments.output is not None:
        check_ending("-o", arguments.output, *(endings or RESULT_FILES))
        if arguments.output.suffix.lower() == ".mcap":
            require_mcap()
        new_file(arguments.output, overwrite=arguments.overwrite)
    if "plot" in arguments:
        check_plot(arguments)


def save(arguments: argparse.Namespace, result: Any) -> list[Path]:
    """Save the result of a solver if `-o` is given; return the files written.

    Raises:
        OutputExists: If the file exists by now.
        OutputError: If it cannot be written.
    """
    if arguments.output is None:
        return []
    writers: dict[str, Callable[..., Path]] = {".csv": save_csv, ".mcap": write_mcap, ".yaml": _write_message}
    write: Callable[..., Path] = writers.get(arguments.output.suffix.lower(), save_result)
    return [write(result, arguments.output, overwrite=arguments.overwrite)]


def _write_message(result: Any, path: Path, *, overwrite: bool) -> Path:
    return write_text(path, to_ros2_yaml(result), overwrite=overwrite)


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--plot`, which draws `what`, and `--overwrite`."""
    help_text = f"draw {what} into this new PNG file (none; needs matplotlib, extra plot)"
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help=help_text)
    parser.add_argument("--overwrite", action="store_true", help="allow files to be replaced")


def check_plot(arguments: argparse.Namespace, option: str = "plot") -> None:
    """Refuse a picture of `--plot`, or of another option, that cannot be drawn or written.

    Raises:
        ParameterError: If the file name does not end in .png.
        OutputExists: If the file exists and `--overwrite` is not given, or it is a folder.
        OutputError: If its folder cannot be created.
        MissingDependency: If matplotlib is not installed.
    """
    file: Path | None = getattr(arguments, option)
    if file is None:
        return
    check_ending(f"--{option}", file, ".png")
    canvas.require_matplotlib()
    new_file(file, overwrite=arguments.overwrite)


def write_plot(arguments: argparse.Namespace, draw: Callable[[], Any], option: str = "plot") -> list[Path]:
    """Write the figure that `draw` returns if `--plot`, or another option, is given; return the files written.

    Raises:
        OutputExists: If the file exists by now.
        OutputError: If it cannot be written.
    """
    file: Path | None = getattr(arguments, option)
    return [] if file is None else [canvas.write_png(draw(), file, overwrite=arguments.overwrite)]


def check_ending(option: str, file: Path, *endings: str) -> None:
    """Raise a ParameterError for the file of an option whose name has none of the endings."""
    if file.suffix.lower() not in endings:
        raise ParameterError(option, str(file), f"a file name that ends in {' or '.join(endings)}")
