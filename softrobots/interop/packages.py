"""The packages that softrobots needs, and those of its extras: which are installed."""

from __future__ import annotations

import re
from typing import NamedTuple

from softrobots.interop.tools import installed_version


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


PACKAGES = (
    Package("pin", "3.8", "", "Pinocchio: kinematics, Jacobians, gravity"),
    Package("eigenpy", "3.12", "", "Pinocchio's bridge to Eigen, and its factorisation of small matrices"),
    Package("numpy", "2.0", "", "arrays"),
    Package("xacro", "2.1.1", "", "the generator of every URDF"),
    Package("yourdfpy", "0.0.57", "", "a second opinion on URDF files"),
    Package("meshcat", "0.3.2", "", "the browser view"),
    Package("threadpoolctl", "3.5", "", "one thread for linear algebra"),
    Package("tqdm", "4.66", "", "progress bars"),
    Package("matplotlib", "3.8", "plot", "plots"),
    Package("scipy", "1.13", "helix", "actuators that vary along the tube"),
    Package("numba", "0.60", "fast", "compiled solvers"),
    Package("dask", "2024.8", "cluster", "sweeps on many machines"),
    Package("example-robot-data", "6", "robots", "third-party robots"),
    Package("pin-pink", "4.4", "bench", "rigid inverse kinematics, to compare with"),
    Package("daqp", "0.11", "bench", "its quadratic programmes"),
    Package("mujoco", "3.2.7", "interop", "simulator"),
    Package("drake", "1.43", "interop", "simulator"),
    Package("pybullet", "3.2.7", "interop", "simulator; no wheels above Python 3.11"),
    Package("urchin", "0.0.30", "interop-kinematics", "kinematics"),
    Package("ikpy", "4.2", "interop-kinematics", "kinematics"),
    Package("roboticstoolbox-python", "1.4", "interop-kinematics", "kinematics"),
    Package("viser", "1.0", "interop-kinematics", "browser view with sliders"),
    Package("playwright", "1.45", "dev", "pictures of the browser view"),
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


def package_states() -> tuple[PackageState, ...]:
    """The state of every package of `PACKAGES`; nothing is imported."""
    return tuple(PackageState(package, installed_version(package.name)) for package in PACKAGES)


def _numbers(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, `1.2.3rc1` as (1, 2, 3)."""
    found = re.match(r"\d+(\.\d+)*", version)
    return tuple(int(part) for part in found[0].split(".")) if found else ()
