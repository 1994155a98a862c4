"""The packages that softrobots requires, from its own metadata, and which of them are installed."""

from __future__ import annotations

import re
import sys
from importlib import metadata
from typing import NamedTuple

from softrobots.core.errors import SoftRobotsError

EXTRAS = {
    "plot": "plots: --plot, the figures of scripts",
    "fast": "compiled solvers by numba",
    "jax": "derivatives in JAX: softrobots.jax",
    "torch": "derivatives in PyTorch: softrobots.torch",
    "control": "linear models as state spaces of python-control",
    "pandas": "tables as DataFrames: softrobots.to_dataframe",
    "mcap": "logs for ROS 2 and Foxglove: -o FILE.mcap",
    "viser": "sliders in the browser: softrobots view ROBOT --sliders",
    "pictures": "pictures of pages, which scripts take",
    "robots": "the UR5 and other third-party robots",
    "interop": "simulators; load_model reads MJCF and SDF",
    "interop-kinematics": "tools to compare kinematics with: scripts/interoperability.py",
    "cluster": "sweeps on many machines",
    "bench": "rigid inverse kinematics to compare speed with",
    "docs": "the documentation as a site: scripts/build_docs.py",
}
"""Purpose of each extra of `pyproject.toml` that a user may want; `dev` and `test` are for development."""


class Package(NamedTuple):
    """A requirement of softrobots, and its state here."""

    name: str
    """Name on PyPI."""
    minimum: str
    """The oldest version that is sufficient."""
    extras: tuple[str, ...]
    """Extras of softrobots that require it, in the order of `EXTRAS`; empty if every installation does."""
    below_python: tuple[int, int] | None
    """The first Python that it is not required for; None if it is required for all."""
    version: str | None
    """The installed version, or None."""

    @property
    def wanted(self) -> bool:
        """Whether it is required for this Python."""
        return self.below_python is None or sys.version_info[:2] < self.below_python

    @property
    def ok(self) -> bool:
        """Whether it is installed and new enough."""
        return self.version is not None and _numbers(self.version) >= _numbers(self.minimum)

    @property
    def advice(self) -> str:
        """How to install or upgrade it; empty if it is fine."""
        if self.ok:
            return ""
        wanted = f"softrobots[{self.extras[0]}]" if self.extras else f"{self.name}>={self.minimum}"
        if self.version is None:
            return f"missing: pip install '{wanted}'"
        return f"{self.version} is older than {self.minimum}: pip install -U '{wanted}'"


def required_packages() -> tuple[Package, ...]:
    """Return every package that softrobots or an extra of `EXTRAS` requires, required ones first; nothing is imported.

    Raises:
        SoftRobotsError: If softrobots itself is not installed, but runs from a bare folder.
    """
    try:
        lines = metadata.requires("softrobots") or []
    except metadata.PackageNotFoundError as error:
        raise SoftRobotsError("softrobots has no metadata here: install it with pip") from error
    packages: dict[str, Package] = {}
    for extra in ("", *EXTRAS):
        for line in lines:
            name, minimum, needed_by, below = _parsed(line)
            if needed_by == extra:
                extras = (*(packages[name].extras if name in packages else ()), *([extra] if extra else []))
                packages[name] = Package(name, minimum, extras, below, installed_version(name))
    return tuple(packages.values())


def installed_version(package: str) -> str | None:
    """Return the version of an installed package, by its name on PyPI; None if it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


def missing_of_extras(packages: tuple[Package, ...]) -> dict[str, list[str]]:
    """Return the packages that each extra lacks: those missing or too old, of those that this Python can have."""
    lacking = [package for package in packages if not package.ok and package.wanted]
    return {extra: [package.name for package in lacking if extra in package.extras] for extra in EXTRAS}


def _parsed(line: str) -> tuple[str, str, str, tuple[int, int] | None]:
    """Name, oldest version, extra or "", and first Python without it, of a line of our own metadata."""
    requirement, _, marker = line.partition(";")
    name = re.match(r"[\w.-]+", requirement)
    minimum = re.search(r">=\s*([\d.]+)", requirement)
    extra = re.search(r"extra == ['\"]([\w-]+)", marker)
    below = re.search(r"python_version < ['\"](\d+)\.(\d+)", marker)
    return (
        name[0] if name else "",
        minimum[1] if minimum else "0",
        extra[1] if extra else "",
        (int(below[1]), int(below[2])) if below else None,
    )


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, `1.2.3rc1` as (1, 2, 3)."""
    match = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in match[0].split(".")) if match else ()
