"""The kinematics of a URDF file in every tool that loads one, against Pinocchio's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from softrobots.cli.tools.kinematics import PlacedLinks, compare_kinematics
from softrobots.robots import Robot
from studies.interop.placed_links import open_in
from studies.interop.tools import find_tool, installed_tools


@dataclass(frozen=True, kw_only=True)
class KinematicsRow(PlacedLinks):
    """How a tool places the links of a file, and what it is."""

    tool: str
    """Name of the tool."""
    version: str
    """Its version."""
    precision: float
    """Largest error that the tool is allowed [m and rad]."""
    limits: str
    """What the tool cannot do with a URDF file."""

    @property
    def agrees(self) -> bool:
        """Whether every link and joint is there, and every link where Pinocchio has it."""
        return self.agrees_within(self.precision)


def compare_tools(source: Robot | Path | str, tools: Sequence[str] | None = None, **options: Any) -> tuple[KinematicsRow, ...]:
    """Compare where tools place the links of a URDF with where Pinocchio places them.

    Args:
        source: What `read_source` takes.
        tools: Names of tools, of `TOOLS`; by default all that are installed.
        options: Number of configurations and seed, as for `compare_kinematics`.

    Returns:
        A row for each tool.

    Raises:
        SoftRobotsError: Whatever `compare_kinematics` raises.
        NameNotFound: If there is no such tool.
        MissingDependency: If a tool of `tools` is not installed.
    """
    chosen = [find_tool(name) for name in (installed_tools() if tools is None else tools)]
    for tool in chosen:
        tool.load()
    placed = ((tool, compare_kinematics(source, partial(open_in, tool), **options)) for tool in chosen)
    return tuple(
        KinematicsRow(**vars(row), tool=tool.name, version=str(tool.version), precision=tool.precision, limits=tool.limits)
        for tool, row in placed
    )
