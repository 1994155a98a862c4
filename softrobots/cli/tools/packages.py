"""The packages that softrobots needs, and those of its extras: which are installed."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from typing import NamedTuple

from softrobots.cli.tools.known_tools import installed_version


class Package(NamedTuple):
    """A package on PyPI."""

    name: str
    """Its name there."""
    minimum: str
    """The oldest version that will do."""
    extra: str
    """The extra of softrobots that it is part of; empty: required."""
    purpose: str
    """What it is for."""
    last_python: tuple[int, int] | None = None
    """The last Python that it has wheels for; None: it has them for all."""
    also: str = ""
    """Another extra that it is part of."""

    @property
    def wanted(self) -> bool:
        """Whether it can be had for this Python."""
        return self.last_python is None or sys.version_info[:2] <= self.last_python


EXTRAS = {
    "plot": "plots: --plot, the figures of scripts",
    "fast": "compiled solvers by numba",
    "helix": "actuators that vary along the tube",
    "viser": "sliders in the browser: softrobots view ROBOT --sliders",
    "pictures": "pictures of the browser view",
    "robots": "the UR5 and other third-party robots",
    "interop": "simulators; load_model reads MJCF and SDF",
    "interop-kinematics": "tools to compare kinematics with: softrobots doctor --all",
    "cluster": "sweeps on many machines",
    "bench": "rigid inverse kinematics to compare speed with",
    "docs": "the documentation as a site: scripts/build_docs.py",
}
"""What each extra of `pyproject.toml` gives; `dev` is all of them and the tools of development."""

PACKAGES = (
    Package("pin", "4.0", "", "Pinocchio: kinematics, Jacobians, gravity"),
    Package("eigenpy", "3.13", "", "Pinocchio's bridge to Eigen, and its factorisation of small matrices"),
    Package("numpy", "2.2", "", "arrays"),
    Package("xacro", "2.1.1", "", "the generator of every URDF"),
    Package("yourdfpy", "0.0.60", "", "a second opinion on URDF files"),
    Package("meshcat", "0.3.2", "", "the browser view"),
    Package("threadpoolctl", "3.5", "", "one thread for linear algebra"),
    Package("tqdm", "4.66", "", "progress bars"),
    Package("pyyaml", "6.0.3", "", "files of parameters: --parameters"),
    Package("shtab", "1.13", "", "completion of the command in shells"),
    Package("matplotlib", "3.10.8", "plot", "plots", also="docs"),
    Package("scipy", "1.13", "helix", "actuators that vary along the tube"),
    Package("numba", "0.61.2", "fast", "compiled solvers"),
    Package("dask", "2024.8", "cluster", "sweeps on many machines"),
    Package("example-robot-data", "6", "robots", "third-party robots"),
    Package("pin-pink", "4.4", "bench", "rigid inverse kinematics, to compare with"),
    Package("daqp", "0.11", "bench", "its quadratic programmes"),
    Package("mujoco", "3.2.7", "interop", "simulator"),
    Package("drake", "1.43", "interop", "simulator", last_python=(3, 14)),
    Package("pybullet", "3.2.7", "interop", "simulator; no wheels above Python 3.11", last_python=(3, 11)),
    Package("urchin", "0.0.30", "interop-kinematics", "kinematics"),
    Package("ikpy", "4.2", "interop-kinematics", "kinematics"),
    Package("roboticstoolbox-python", "1.4", "interop-kinematics", "kinematics"),
    Package("viser", "1.1", "viser", "sliders in the browser", also="interop-kinematics"),
    Package("playwright", "1.45", "pictures", "pictures of the browser view, by an installed chromium"),
    Package("pillow", "11", "pictures", "animated pictures"),
    Package("mkdocs-material", "9.7", "docs", "the documentation site"),
    Package("mkdocstrings", "1.0.6", "docs", "its reference, from docstrings"),
    Package("mkdocs-jupyter", "0.26.3", "docs", "its notebook"),
    Package("latex2mathml", "3.81", "docs", "its equations"),
    Package("ruff", "0.6", "docs", "its signatures"),
)
"""Every package that softrobots imports, as `pyproject.toml` asks for it."""


class PackageState(NamedTuple):
    """Whether a package is there."""

    package: Package
    """The package."""
    version: str | None
    """The installed version, or None."""

    @property
    def ok(self) -> bool:
        """Whether it is installed and new enough."""
        return self.version is not None and _numbers(self.version) >= _numbers(self.package.minimum)

    @property
    def advice(self) -> str:
        """What to do about it; empty if there is nothing to do."""
        if self.ok:
            return ""
        wanted = f"softrobots[{self.package.extra}]" if self.package.extra else f"{self.package.name}>={self.package.minimum}"
        found = "missing" if self.version is None else f"{self.version} is older than {self.package.minimum}"
        return f"{found}: pip install -U '{wanted}'" if self.version else f"{found}: pip install '{wanted}'"


class ExtraState(NamedTuple):
    """Whether an extra is complete."""

    name: str
    """The extra."""
    purpose: str
    """What it gives."""
    missing: tuple[str, ...]
    """Packages of it that are missing or too old, of those that can be had for this Python."""

    @property
    def complete(self) -> bool:
        """Whether nothing is missing."""
        return not self.missing


def extra_states(states: Sequence[PackageState]) -> tuple[ExtraState, ...]:
    """Whether each extra of `EXTRAS` is complete, from the states of all packages."""
    lacking = [state.package for state in states if not state.ok and state.package.wanted]
    return tuple(
        ExtraState(extra, purpose, tuple(package.name for package in lacking if extra in (package.extra, package.also)))
        for extra, purpose in EXTRAS.items()
    )


def package_states() -> tuple[PackageState, ...]:
    """The state of every package of `PACKAGES`; nothing is imported."""
    return tuple(PackageState(package, installed_version(package.name)) for package in PACKAGES)


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, `1.2.3rc1` as (1, 2, 3)."""
    found = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in found[0].split(".")) if found else ()
