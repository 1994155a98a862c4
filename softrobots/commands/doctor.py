"""`softrobots doctor`: what is installed, whether the shipped files are up to date, and whether the tools agree on them."""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import softrobots
from softrobots.browser import find_chromium
from softrobots.errors import SoftRobotsError, ViewerError
from softrobots.generated import generated_files
from softrobots.interop.checks import row_problems
from softrobots.interop.kinematics import KinematicsRow, compare_kinematics
from softrobots.interop.packages import package_states
from softrobots.interop.tools import installed_tools
from softrobots.kernels.machines import available_backend, cache_folder
from softrobots.paths import urdf_folder, xacro_folder
from softrobots.robots import ROBOTS


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "doctor",
        help="tell what is installed, and whether files and tools agree",
        description="Tell which packages are installed, whether the shipped URDF files are what xacro generates, and how far "
        "yourdfpy's kinematics of them is from Pinocchio's. Exit status 0 if all that is required is fine.",
    )
    parser.add_argument("--all", action="store_true", help="compare the kinematics of every installed tool")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> bool:
    """Print the report; return whether all that is required is there and right."""
    trouble: list[str] = []
    folders = _folders(trouble)
    _packages(trouble)
    if folders is not None and not trouble:
        _files(folders, trouble)
        _kinematics(folders, installed_tools() if arguments.all else ("yourdfpy",), trouble)
    _print("", *(["wrong:", *(f"  {text}" for text in trouble)] if trouble else ["all well"]))
    return not trouble


def _folders(trouble: list[str]) -> Path | None:
    """Where things are; the folder of the URDF files."""
    _print(f"softrobots {softrobots.__version__}, Python {platform.python_version()}, {platform.platform()}")
    try:
        urdf, xacro = urdf_folder(), xacro_folder()
    except SoftRobotsError as error:
        trouble.append(str(error))
        return None
    try:
        browser = find_chromium()
    except ViewerError as error:
        browser = f"none, so no pictures of the viewer: {error}"
    places = {"package": Path(softrobots.__file__).parent, "xacro": xacro, "URDF": urdf, "browser": browser}
    places |= {"cache": f"{cache_folder()} (compiled solvers, by {available_backend()})"}
    _table([(what, str(where)) for what, where in places.items()])
    return urdf


def _packages(trouble: list[str]) -> None:
    """Every package, installed or not."""
    states = package_states()
    trouble += [f"{state.package.name}: {state.advice}" for state in states if not state.ok and not state.package.extra]
    _print("", "Packages")
    _table(
        [
            (state.package.name, state.version or "-", state.package.extra or "required", state.advice or state.package.purpose)
            for state in states
        ]
    )


def _files(folder: Path, trouble: list[str]) -> None:
    """The shipped URDF files against xacro."""
    from tqdm import tqdm

    _print("", "URDF files, and what xacro generates now")
    rows = []
    for file in tqdm(generated_files(folder), total=len(ROBOTS), desc="xacro", unit="file", leave=False):
        rows.append((file.path.name, "the same" if file.up_to_date else "differs"))
        if not file.up_to_date:
            trouble.append(f"{file.path} is not what xacro generates")
    _table(rows)


def _kinematics(folder: Path, tools: Sequence[str], trouble: list[str]) -> None:
    """Where the tools put the links of the shipped files."""
    from tqdm import tqdm

    _print("", "Largest difference from Pinocchio's kinematics at 20 random configurations")
    rows: list[KinematicsRow] = []
    pairs = [(folder / f"{name}.urdf", tool) for name in ROBOTS for tool in tools]
    for path, tool in tqdm(pairs, desc="kinematics", unit="robot", leave=False):
        try:
            rows += compare_kinematics(path, [tool])
        except SoftRobotsError as error:
            trouble.append(str(error))
    _table([(row.file, row.tool, row.version, *_measured(row), *row_problems(row)) for row in rows])
    trouble += [f"{row.file}: {text}" for row in rows for text in row_problems(row)]


def _measured(row: KinematicsRow) -> tuple[str, str, str]:
    return f"{row.position_error:.1e} m", f"{row.rotation_error:.1e} rad", f"{row.links} links, {row.joints} joints"


def _table(rows: Iterable[tuple[str, ...]]) -> None:
    """Print rows with aligned columns."""
    kept = list(rows)
    widths = [max(len(row[i]) for row in kept if i < len(row)) for i in range(max(map(len, kept), default=0))]
    for row in kept:
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=False))
        _print("  " + "  ".join(cells).rstrip())


def _print(*lines: str) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()
