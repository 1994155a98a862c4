"""The tools that load URDF: what they are called, how precise they are, and what they cannot do."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

from softrobots.cli.tools.kinematics import PRECISION
from softrobots.cli.tools.packages import installed_version
from softrobots.core.errors import MissingDependency, NameNotFound, SoftRobotsError


@dataclass(frozen=True)
class Tool:
    """A tool that loads URDF files and places their links."""

    name: str
    """What it is called."""
    module: str
    """The module that is imported."""
    package: str
    """Its name on PyPI."""
    extra: str
    """The extra of softrobots that installs it; empty if every installation has it."""
    precision: float
    """How far its poses may lie from Pinocchio's [m and rad]."""
    limits: str = ""
    """What it cannot do with a URDF file."""

    @property
    def version(self) -> str | None:
        """The installed version, or None."""
        return installed_version(self.package)

    def load(self) -> ModuleType:
        """Import and return its module.

        Raises:
            MissingDependency: If it is part of an extra and not installed.
            SoftRobotsError: If it is installed but cannot be imported.
        """
        try:
            return importlib.import_module(self.module)
        except ImportError as error:
            if self.version is None and self.extra:
                raise MissingDependency(self.package, self.extra) from error
            raise SoftRobotsError(f"{self.package} {self.version or ''} cannot be imported: {error}") from error


SINGLE = 1e-5
"""Precision of the tools with single precision inside [m and rad]."""

_TABLE = (
    Tool("yourdfpy", "yourdfpy", "yourdfpy", "", PRECISION, "no mimic of a mimic"),
    Tool(
        "MuJoCo",
        "mujoco",
        "mujoco",
        "interop",
        PRECISION,
        "reads no joint spring from URDF; no package:// meshes; drops links behind fixed joints unless the file forbids it",
    ),
    Tool("Drake", "pydrake", "drake", "interop", PRECISION, "reads no joint spring from URDF; no STL for collision"),
    Tool(
        "PyBullet",
        "pybullet",
        "pybullet",
        "interop",
        SINGLE,
        "at most 122 movable joints, and 127 with the fixed ones; single precision; lines of the file below 8192 characters; "
        "reads no joint spring from URDF; no wheels above Python 3.11",
    ),
    Tool("urchin", "urchin", "urchin", "interop-kinematics", PRECISION, "kinematics only; no mimic of a mimic"),
    Tool("ikpy", "ikpy.chain", "ikpy", "interop-kinematics", PRECISION, "kinematics only; one serial chain; no mimic"),
    Tool(
        "roboticstoolbox",
        "roboticstoolbox",
        "roboticstoolbox-python",
        "interop-kinematics",
        PRECISION,
        "kinematics only; no mimic; of package:// meshes only those of its own data",
    ),
    Tool("viser", "viser.extras", "viser", "interop-kinematics", PRECISION, "shows only; loads through yourdfpy"),
)

TOOLS: Mapping[str, Tool] = {tool.name: tool for tool in _TABLE}
"""Every tool by its name."""


def find_tool(name: str) -> Tool:
    """The tool of that name.

    Raises:
        NameNotFound: If there is none.
    """
    if name not in TOOLS:
        raise NameNotFound("tool", name, TOOLS)
    return TOOLS[name]


def installed_tools() -> tuple[str, ...]:
    """Names of the tools that are installed, in the order of the table."""
    return tuple(name for name, tool in TOOLS.items() if tool.version is not None)
