"""The machine that a benchmark ran on, and the versions of what it ran."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from softrobots.cli.tools.packages import installed_version

PACKAGES = ("pin", "numpy", "numba", "scipy", "mujoco", "pin-pink", "daqp")
"""Packages whose versions are recorded."""


def machine() -> dict[str, str]:
    """Processor, system and versions, by name; packages that are not installed are left out."""
    found = {"processor": _processor(), "cores": str(os.cpu_count() or 1), "system": platform.platform(terse=True)}
    found["Python"] = platform.python_version()
    versions = {name: installed_version(name) for name in PACKAGES}
    return found | {name: version for name, version in versions.items() if version is not None}


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
