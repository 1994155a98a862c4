"""`-o FILE` of the commands that solve: refused before any work if it cannot be written, saved at the end."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file
from softrobots.core.result_file import save_result
from softrobots.statics.saved_results import save_csv


def add_output(parser: argparse.ArgumentParser, told: str) -> None:
    """Give a parser `-o`; `--overwrite` comes with `plot_option.add_plot`.

    Args:
        parser: The parser.
        told: What is saved, for the help.
    """
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=f"save {told} (not saved)")


def check_output(arguments: argparse.Namespace, *endings: str) -> None:
    """Tell at once if the file that `-o` asks for cannot be written.

    Args:
        arguments: The arguments.
        endings: How its name may end.

    Raises:
        ParameterError: If the file name ends otherwise.
        OutputExists: If the file is there and `--overwrite` is not given, or it is a folder.
        OutputError: If its folder cannot be made.
    """
    if arguments.output is None:
        return
    if arguments.output.suffix.lower() not in endings:
        raise ParameterError("-o", str(arguments.output), f"a file name that ends in {' or '.join(endings)}")
    new_file(arguments.output, overwrite=arguments.overwrite)


def save(arguments: argparse.Namespace, result: Any) -> list[Path]:
    """Save what `-o` asks for; return the files that were written: one, or none without `-o`.

    Raises:
        OutputExists: If the file is there by now.
        OutputError: If it cannot be written.
    """
    if arguments.output is None:
        return []
    write = save_csv if arguments.output.suffix.lower() == ".csv" else save_result
    return [write(result, arguments.output, overwrite=arguments.overwrite)]
