"""`--plot FILE.png` of the commands: refused before any work if it cannot be written, drawn at the end."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file
from softrobots.statics.equilibrium import Equilibrium


def add_plot(parser: argparse.ArgumentParser, what: str) -> None:
    """Give a parser `--plot` and `--overwrite`; see `check_plot` and `write_plot`.

    Args:
        parser: The parser.
        what: What is drawn, for the help.
    """
    told = f"draw {what} into this new PNG file (none; needs matplotlib, extra plot)"
    parser.add_argument("--plot", type=Path, metavar="FILE.png", help=told)
    parser.add_argument("--overwrite", action="store_true", help="allow files to be replaced")


def check_plot(arguments: argparse.Namespace) -> None:
    """Tell at once if the picture that `--plot` asks for cannot be made.

    Raises:
        ParameterError: If the file name does not end in .png.
        OutputExists: If the file is there and `--overwrite` is not given, or it is a folder.
        OutputError: If its folder cannot be made.
        MissingDependency: If matplotlib is not installed.
    """
    if arguments.plot is None:
        return
    from softrobots.view.figures.canvas import require_matplotlib

    if arguments.plot.suffix.lower() != ".png":
        raise ParameterError("--plot", str(arguments.plot), "a file name that ends in .png")
    require_matplotlib()
    new_file(arguments.plot, overwrite=arguments.overwrite)


def write_plot(arguments: argparse.Namespace, draw: Callable[[], Any]) -> list[Path]:
    """Draw the picture that `--plot` asks for; return the files that were written: one, or none without `--plot`.

    Args:
        arguments: The arguments.
        draw: Makes the figure.

    Raises:
        OutputExists: If the file is there by now.
        OutputError: If it cannot be written.
    """
    if arguments.plot is None:
        return []
    from softrobots.view.figures.canvas import write_png

    return [write_png(draw(), arguments.plot, overwrite=arguments.overwrite)]


def shape_figure(equilibrium: Equilibrium) -> Any:
    """The loaded robot, as `loaded_robot.loaded_shape` draws it; plots are imported when one is asked for.

    Raises:
        MissingDependency: If matplotlib is not installed.
    """
    from softrobots.view.figures.loaded_robot import loaded_shape

    return loaded_shape(equilibrium)
