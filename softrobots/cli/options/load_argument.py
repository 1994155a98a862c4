"""Loads of a command: `--force`, `--moment`, `--frame`, `--wrench`, `--gravity`, and obstacles, `--environment`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from softrobots.cli.options.command_line import add_load, add_numbers, gravity_of
from softrobots.core.checks import finite_array
from softrobots.core.errors import ParameterError
from softrobots.environment.environment import Environment
from softrobots.model.soft_model import SoftModel

_WORDS = ("LINK", "FX", "FY", "FZ", "MX", "MY", "MZ")


def add_loads(parser: argparse.ArgumentParser) -> None:
    """Add the options of a load; see `loads_of`. Loads are dead: they keep their direction in the world."""
    add_load(parser)
    add_numbers(parser, "--moment", "MX MY MZ", "moment on the tip, world axes [N m] (0 0 0)")
    parser.add_argument("--frame", metavar="LINK", help="link on which --force and --moment act (the tip)")
    help_text = "another force [N] and moment [N m] at the origin of a link, world axes; may be given several times (none)"
    parser.add_argument("--wrench", nargs=7, action="append", default=[], metavar=_WORDS, help=help_text)


def add_environment(parser: argparse.ArgumentParser) -> None:
    """Add `--environment`; see `environment_of`."""
    help_text = "obstacles that the robot may lean on: a file in YAML or JSON, or a world in URDF, SDF or MJCF (none)"
    parser.add_argument("--environment", type=Path, metavar="FILE", help=help_text)


def environment_of(arguments: argparse.Namespace) -> Environment | None:
    """Return the obstacles of the option of `add_environment`; None without it.

    Raises:
        SoftRobotsError: Whatever `Environment.from_file` raises.
    """
    file = getattr(arguments, "environment", None)  # motion among obstacles is for simulators: `simulate` has no such option
    return None if file is None else Environment.from_file(file)


def loads_of(arguments: argparse.Namespace, model: SoftModel) -> dict[str, Any]:
    """Return the load of these options as keyword arguments of `solve_equilibrium` and `solve_ik`.

    Raises:
        ParameterError: If the six values after a link are not finite numbers, or the moment is not finite.
        SoftRobotsError: Whatever `Environment.from_file` raises.
    """
    wrenches: dict[str, Any] = {}
    for link, *words in arguments.wrench:
        try:
            numbers = [float(word) for word in words]
        except ValueError as error:
            raise ParameterError("--wrench", " ".join(words), f"{' '.join(_WORDS)}: a link and six numbers") from error
        wrenches[link] = wrenches.get(link, 0.0) + finite_array("--wrench", numbers, (6,), "N, N m")
    if arguments.moment is not None:
        at = model.tip if arguments.frame is None else arguments.frame
        moment = finite_array("--moment", arguments.moment, (3,), "N m")
        wrenches[at] = wrenches.get(at, 0.0) + np.array([0.0, 0.0, 0.0, *moment])
    load = {"force": arguments.force, "wrench": wrenches or None, "frame": arguments.frame}
    return {**load, "gravity": gravity_of(arguments), "environment": environment_of(arguments)}
