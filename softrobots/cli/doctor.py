"""`softrobots doctor`: what is installed, and whether the tools agree on the shipped files."""

from __future__ import annotations

import argparse
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import softrobots
from softrobots.cli.reports.answers import add_json, print_answer
from softrobots.cli.tools.checks import row_problems
from softrobots.cli.tools.kinematics import COUNT, PlacedLinks, compare_kinematics
from softrobots.cli.tools.packages import EXTRAS, installed_version, missing_of_extras, required_packages
from softrobots.compiled.run.backends import available_backend, cache_folder, cache_is_kept
from softrobots.core.errors import SoftRobotsError, ViewerError
from softrobots.core.summary import aligned
from softrobots.description.paths import urdf_folder, xacro_folder
from softrobots.robots import ROBOTS
from softrobots.view.meshcat_page.server import ServerProcess

_PAGE_TIME = 10.0  # [s], longest wait for the page


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "doctor",
        help="show what is installed, and whether tools agree",
        description="Show which packages are installed and which extras are complete, whether the page of the viewer can be "
        "served (by a server on loopback that is started and ended), and how far yourdfpy's kinematics of the shipped URDF "
        "files is from Pinocchio's. Exit status 0 if all that is required is fine, 1 if not.",
    )
    add_json(parser)
    parser.set_defaults(run=run)


class _Report(NamedTuple):
    """The findings so far."""

    answer: dict[str, Any]
    """For a machine."""
    lines: list[str]
    """For a person."""
    wrong: list[str]
    """Required things that are wrong."""

    def add(self, title: str, rows: Sequence[tuple[str, ...]]) -> None:
        """Add a table."""
        self.lines.extend(["", title] if title else [])
        self.lines.extend(aligned(rows, indent="  "))


def run(arguments: argparse.Namespace) -> bool:
    """Print the report; return False if something required is missing or wrong."""
    report = _Report({}, [], [])
    folder = _places(report)
    _packages(report)
    if folder is not None and not report.wrong:
        _page(report)
        _kinematics(folder, report)
    report.answer.update(wrong=report.wrong, ok=not report.wrong)
    end = ["wrong:", *(f"  {text}" for text in report.wrong)] if report.wrong else ["all well"]
    print_answer(arguments, report.answer, [*report.lines, "", *end])
    return not report.wrong


def _places(report: _Report) -> Path | None:
    """Versions, and where things are; the folder of the URDF files."""
    versions = {"softrobots": softrobots.__version__, "python": platform.python_version(), "platform": platform.platform()}
    report.answer.update(versions)
    report.lines.append(f"softrobots {versions['softrobots']}, Python {versions['python']}, {versions['platform']}")
    try:
        urdf, xacro = urdf_folder(), xacro_folder()
    except SoftRobotsError as error:
        report.wrong.append(str(error))
        return None
    cache, kept = cache_folder(), cache_is_kept()
    lost = "" if kept else "; for this process alone: the folder for caches cannot be written"
    compiled = f"{cache} (compiled solvers, by {available_backend()}{lost})"
    package = Path(softrobots.__file__).parent
    places = {"package": package, "xacro": xacro, "urdf": urdf, "cache": cache}
    report.answer.update(places=places, cache_writable=kept, backend=available_backend())
    report.add("", [(name, str(where)) for name, where in (places | {"cache": compiled}).items()])
    return urdf


def _packages(report: _Report) -> None:
    """Every required package, installed or not, and every extra."""
    try:
        packages = required_packages()
    except SoftRobotsError as error:
        report.wrong.append(str(error))
        return
    missing = missing_of_extras(packages)
    report.wrong.extend(f"{package.name}: {package.advice}" for package in packages if not package.ok and not package.extras)
    report.answer["packages"] = [{**package._asdict(), "ok": package.ok, "advice": package.advice} for package in packages]
    report.answer["extras"] = {
        name: {"purpose": purpose, "missing": missing[name], "complete": not missing[name]} for name, purpose in EXTRAS.items()
    }
    rows = []
    for package in packages:
        advice = package.advice if package.wanted or package.ok else "not for this Python"
        rows.append((package.name, package.version or "-", ", ".join(package.extras) or "required", advice))
    report.add("Packages", rows)
    states = {name: f"lacks {', '.join(names)}" if names else "complete" for name, names in missing.items()}
    report.add("Extras: pip install 'softrobots[EXTRA]'", [(name, states[name], EXTRAS[name]) for name in EXTRAS])


def _page(report: _Report) -> None:
    """Whether the page of the viewer can be served: start a server, request its page, end it."""
    url, problem = "", ""
    try:
        server = ServerProcess()
    except ViewerError as error:
        problem = str(error)
    else:
        url = server.web_url
        try:
            problem = _fetch(url)
        finally:
            server.end()
    report.answer["page"] = {"served": not problem, "url": url, "problem": problem}
    report.add("Page of the viewer", [("served" if not problem else "not served", problem or f"at {url}, and ended again")])
    if problem:
        report.wrong.append(f"the page of the viewer cannot be served: {problem}")


def _fetch(url: str) -> str:
    """What is wrong with a page on loopback; empty if it is meshcat's."""
    from urllib.request import ProxyHandler, build_opener

    try:
        with build_opener(ProxyHandler({})).open(url, timeout=_PAGE_TIME) as answer:  # loopback needs no proxy
            text = answer.read().decode("utf-8", "replace")
    except OSError as error:
        return f"{url}: {error}"
    return "" if "meshcat" in text.lower() else f"{url} answers with something else than meshcat's page"


def _kinematics(folder: Path, report: _Report) -> None:
    """Where yourdfpy places the links of the shipped files."""
    from tqdm import tqdm

    rows: list[PlacedLinks] = []
    for name in tqdm(ROBOTS, desc="kinematics", unit="robot", leave=False, disable=None):
        try:
            rows.append(compare_kinematics(folder / f"{name}.urdf"))
        except SoftRobotsError as error:
            report.wrong.append(str(error))
    tool = {"tool": "yourdfpy", "version": str(installed_version("yourdfpy"))}
    report.answer["kinematics"] = [
        {"file": row.file, **tool, "position_error": row.position_error, "rotation_error": row.rotation_error}
        | {"problems": row_problems(row)}
        for row in rows
    ]
    cells = []
    for row in rows:
        measured = (f"{row.position_error:.1e} m", f"{row.rotation_error:.1e} rad", f"{row.links} links, {row.joints} joints")
        cells.append((row.file, *tool.values(), *measured, *row_problems(row)))
    report.add(f"Largest difference from Pinocchio's kinematics at {COUNT} random configurations", cells)
    report.wrong.extend(f"{row.file}: {text}" for row in rows for text in row_problems(row))
