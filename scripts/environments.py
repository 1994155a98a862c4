"""Run the tests on every Python that this machine has, and on the lowest versions that pyproject.toml allows.

Environments:

- `3.10`, `3.11`, ...: that Python with the newest of every package, all extras;
- `lowest`: the lowest supported Python with the lowest version of everything that pyproject.toml names, all extras;
- `plain`: the lowest supported Python with the lowest versions and no extras: tests of optional tools are skipped.

Each is a new virtual environment beside a copy of the checkout, made by uv. Interpreters are looked for on the PATH and among
those of pyenv. Prints a table; the exit status is 1 if a test fails anywhere. Takes about eight minutes an environment.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import make_folder, write_text
from softrobots.core.json_text import read_json
from softrobots.core.progress import with_progress
from studies.shared.clean_checkout import copy_checkout, find_uv, make_environment
from studies.shared.folders import free_folder
from studies.shared.recorded_run import FOLDER, check_page, write_record

CHECKOUT = Path(__file__).resolve().parent.parent
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
"""Supported versions of Python."""
SHOWN = ("pin", "numpy", "numba", "mujoco", "drake")
"""Packages whose versions are columns of the table."""


@dataclass(frozen=True)
class Environment:
    """What is installed."""

    name: str
    """Its name on the command line."""
    python: str
    """Version of Python, e.g. "3.10"."""
    lowest: bool
    """Whether every package that pyproject.toml names comes in its lowest version."""
    extra: str
    """Extra that is installed: `dev` (everything) or `test`."""


@dataclass(frozen=True)
class Outcome:
    """What the tests said."""

    environment: str
    """Name of the environment."""
    python: str
    """Full version of Python."""
    versions: dict[str, str]
    """Installed packages."""
    passed: int
    """Number of tests that passed."""
    skipped: int
    """Number of tests that were skipped."""
    failed: tuple[str, ...]
    """Names of the tests that did not pass."""
    minutes: float
    """Time of the tests [min]."""
    date: str
    """Day of the run."""
    reasons: dict[str, int] = field(default_factory=dict)
    """Why tests were skipped, and how many for each reason."""


ENVIRONMENTS = {python: Environment(python, python, lowest=False, extra="dev") for python in PYTHONS} | {
    "lowest": Environment("lowest", PYTHONS[0], lowest=True, extra="dev"),
    "plain": Environment("plain", PYTHONS[0], lowest=True, extra="test"),
}


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"environments, of {', '.join(ENVIRONMENTS)} (those whose Python is installed)"
    result.add_argument("--environment", nargs="+", choices=list(ENVIRONMENTS), metavar="NAME", help=help_text)
    result.add_argument("--tests", nargs="+", default=["tests"], metavar="FILE", help="test files (all)")
    help_text = "new or empty folder for the reports of the tests (JUnit XML), the output, and results.json"
    result.add_argument("--output", type=Path, metavar="FOLDER", help=help_text)
    help_text = "write the table of docs/validation.md in a checkout (this one); others keep their last row"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def interpreters() -> dict[str, Path]:
    """Find a working interpreter of each supported version: on the PATH, then among those of pyenv."""
    folders = [Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep) if folder]
    folders += sorted(Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")).glob("versions/*/bin"))
    found: dict[str, Path] = {}
    for python in PYTHONS:
        for file in (folder / f"python{python}" for folder in folders):
            if file.is_file() and python not in found and _works(file, python):
                found[python] = file
    return found


def _works(file: Path, python: str) -> bool:
    """Whether an interpreter runs, is of that version and can make environments (a shim or a bare one may not)."""
    text = "import sys, ensurepip; print('%d.%d' % sys.version_info[:2])"
    done = subprocess.run([file, "-c", text], capture_output=True, text=True, check=False)
    return done.returncode == 0 and done.stdout.strip() == python


def run_tests(environment: Environment, interpreter: Path, tests: list[str], reports: Path) -> Outcome:
    """Make an environment, run the tests in it, and read their report.

    Raises:
        OutputError: If the environment cannot be made, or the tests end early or do not write a report.
    """
    log = reports / f"{environment.name}.log"
    with tempfile.TemporaryDirectory(prefix="softrobots_") as temporary, log.open("w", encoding="utf-8") as output:
        copy = Path(temporary) / "checkout"
        copy_checkout(CHECKOUT, copy)
        python = make_environment(copy, interpreter, ["-e", f".[{environment.extra}]"], output, lowest=environment.lowest)
        listed = subprocess.run(
            [find_uv(), "pip", "list", "-q", "--format", "json", "--python", python], check=True, capture_output=True
        )
        version = subprocess.run(
            [python, "-c", "import platform; print(platform.python_version())"], check=True, capture_output=True, text=True
        ).stdout.strip()
        report = (reports / f"{environment.name}.xml").resolve()
        command = [str(python), "-m", "pytest", "-q", "-n", "auto", "-p", "no:cacheprovider", f"--junitxml={report}", *tests]
        # In CI a missing tool fails its test; without the extras it may be missing.
        variables = {**os.environ, "CI": "true" if environment.extra == "dev" else "", "VIRTUAL_ENV": str(python.parent.parent)}
        variables.pop("PYTHONDONTWRITEBYTECODE", None)  # or each of hundreds of processes compiles the package anew
        began = time.perf_counter()
        status = subprocess.run(command, cwd=copy, env=variables, stdout=output, stderr=output, check=False).returncode
        minutes = (time.perf_counter() - began) / 60.0
    if status not in (0, 1) or not report.is_file():  # 0: all passed, 1: some failed; else not all of them ran
        raise sr.OutputError(f"the tests of {environment.name} ended early, with status {status}; see {log}")
    cases = list(ElementTree.parse(report).iter("testcase"))
    bad = [case for case in cases if case.find("failure") is not None or case.find("error") is not None]
    skipped = [text.get("message", "") for case in cases if (text := case.find("skipped")) is not None]
    return Outcome(
        environment=environment.name,
        python=version,
        versions={package["name"]: package["version"] for package in json.loads(listed.stdout)},
        passed=len(cases) - len(bad) - len(skipped),
        skipped=len(skipped),
        failed=tuple(f"{case.get('classname')}::{case.get('name')}" for case in bad),
        minutes=round(minutes, 2),
        date=f"{datetime.now(timezone.utc):%Y-%m-%d}",
        reasons=dict(Counter(skipped).most_common()),
    )


def table(outcomes: list[Outcome]) -> str:
    """Format the outcomes as Markdown."""
    head = ["environment", "Python", *SHOWN, "passed", "skipped", "failed", "minutes", "date"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for found in outcomes:
        versions = [found.versions.get(name, "-") for name in SHOWN]
        counts = [str(found.passed), str(found.skipped), str(len(found.failed)), f"{found.minutes:.1f}", found.date]
        lines.append(f"| {' | '.join([found.environment, found.python, *versions, *counts])} |")
    lines += [""] if any(found.reasons for found in outcomes) else []
    for found in outcomes:
        if found.reasons and ENVIRONMENTS[found.environment].extra == "dev":
            text = "; ".join(f"{count}: {reason}" for reason, count in found.reasons.items())
            lines.append(f"- skipped in {found.environment}: {text}")
        elif found.reasons:
            lines.append(f"- skipped in {found.environment}: what needs an optional package, for {len(found.reasons)} reasons")
    return "\n".join(lines)


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; tell whether every test passed."""
    find_uv()  # tells at once what is missing
    if arguments.docs is not None:
        if arguments.tests != ["tests"]:
            raise sr.ParameterError("--tests", arguments.tests, "left out with --docs")
        check_page(arguments.docs, "environments")
    there = interpreters()
    chosen = [ENVIRONMENTS[name] for name in arguments.environment or ENVIRONMENTS]
    lacking = [environment for environment in chosen if environment.python not in there]
    if lacking and (arguments.environment is not None or lacking == chosen):
        raise sr.NameNotFound("installed Python", lacking[0].python, there)
    for environment in lacking:
        print(f"{environment.name}: no Python {environment.python} on this machine", file=sys.stderr)
    chosen = [environment for environment in chosen if environment not in lacking]
    folder = free_folder(arguments.output or Path("output") / f"environments_{time.strftime('%Y%m%d_%H%M%S')}")
    make_folder(folder)
    outcomes: list[Outcome] = []
    for environment in with_progress(chosen, True, label="environments", unit="environment"):
        outcomes.append(run_tests(environment, there[environment.python], arguments.tests, folder))
        for test in outcomes[-1].failed:
            print(f"{environment.name}: {test} failed", file=sys.stderr)
        result = {"environments": [asdict(outcome) for outcome in outcomes]}  # after each: the next may not be made
        write_text(folder / "results.json", json.dumps(result, indent=1) + "\n", overwrite=len(outcomes) > 1)
    print(f"\n{table(outcomes)}\n\nreports: {folder}")
    good = all(outcome.passed and not outcome.failed for outcome in outcomes)
    if arguments.docs is not None and not good:
        print("not recorded: a test failed", file=sys.stderr)
    elif arguments.docs is not None:
        record(arguments.docs, outcomes)
    return good


def record(checkout: Path, outcomes: list[Outcome]) -> None:
    """Write the table of the page: these outcomes, and the recorded ones of other environments."""
    file = checkout / FOLDER / "environments.json"
    known: dict[str, Outcome] = {}
    if file.is_file():
        known = {row["environment"]: Outcome(**row) for row in read_json(file, 10_000_000)["environments"]}
    known |= {outcome.environment: outcome for outcome in outcomes}
    rows = [known[name] for name in ENVIRONMENTS if name in known]
    result = {"environments": [asdict(row) for row in rows]}
    write_record(checkout, "environments", table(rows), result, command="python scripts/environments.py")


def main(argv: list[str] | None = None) -> int:
    """Run from the command line: 1 if a test fails, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
