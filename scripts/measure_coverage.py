"""Measure how much of the package the tests run: lines and branches, with the processes that the tests start.

Runs the suite under coverage.py (a third slower than without), prints a table by folder of the package and the files with most
that is not run, and lists every exclusion with its reason. The exit status is 1 if a test fails, if lines and branches
together are below the limit, or if an exclusion has no reason.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.checks import non_negative_number
from softrobots.core.files import new_file, write_text
from studies.shared.recorded_run import check_page, write_record

CHECKOUT = Path(__file__).resolve().parent.parent
# As coverage.py itself has it: with or without the colon, in small letters or capitals.
PRAGMA = "# pragma: no cover"
EXCLUDED = re.compile(r"#\s*pragma[:\s]?\s*no\s*(?:cover|branch)\b(?P<reason>.*)$", re.MULTILINE | re.IGNORECASE)


class Counts(NamedTuple):
    """What there is and what is run."""

    lines: int = 0
    """Statements."""
    lines_run: int = 0
    """Statements that ran."""
    branches: int = 0
    """Ways out of statements that have several."""
    branches_run: int = 0
    """Those that were taken."""

    @property
    def percent(self) -> float:
        """Share of lines and branches, together, that ran [%]."""
        return 100.0 * (self.lines_run + self.branches_run) / max(self.lines + self.branches, 1)


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--limit", type=float, default=95.0, metavar="PERCENT", help="of lines and branches (%(default)g)")
    result.add_argument("--tests", nargs="+", default=["tests"], metavar="FILE", help="test files (all)")
    result.add_argument("--files", type=int, default=10, metavar="N", help="files with most that is not run (%(default)s)")
    result.add_argument("--output", type=Path, metavar="FILE", help="also write coverage.py's JSON report into this new file")
    help_text = "write the table of docs/validation.md in a checkout (this one); without --tests"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def measure(tests: list[str]) -> tuple[bool, dict[str, Any]]:
    """Run the tests under coverage.py; tell whether they passed, and its report.

    Raises:
        MissingDependency: If coverage is not installed.
    """
    with tempfile.TemporaryDirectory(prefix="softrobots_") as folder:
        report = Path(folder) / "coverage.json"
        variables = {**os.environ, "COVERAGE_FILE": str(Path(folder) / "data"), "OMP_NUM_THREADS": "1"}

        def coverage(*words: str) -> int:
            command = [sys.executable, "-m", "coverage", *words]
            return subprocess.run(command, cwd=CHECKOUT, env=variables, stdout=sys.stderr, check=False).returncode

        if coverage("--version"):
            raise sr.MissingDependency("coverage", "dev")
        passed = coverage("run", "-m", "pytest", "-q", "-n", "auto", *tests) == 0
        coverage("combine", "-q", "--keep")
        coverage("json", "-q", "-o", str(report))
        return passed, json.loads(report.read_text(encoding="utf-8"))


def counts_of(summary: dict[str, Any]) -> Counts:
    """Take the counts of a file or of all from coverage.py's report."""
    return Counts(summary["num_statements"], summary["covered_lines"], summary["num_branches"], summary["covered_branches"])


def by_folder(report: dict[str, Any]) -> dict[str, Counts]:
    """Add up the files of each folder of the package; modules at its top stand together."""
    found: dict[str, Counts] = defaultdict(Counts)
    for name, file in report["files"].items():
        parts = Path(name).parts
        folder = "/".join(parts[:2]) + "/" if len(parts) > 2 else "softrobots/*.py"
        found[folder] = Counts(*(a + b for a, b in zip(found[folder], counts_of(file["summary"]), strict=True)))
    return dict(sorted(found.items()))


def exclusions() -> list[tuple[str, str]]:
    """Where something of the package is excluded from the count, and why: settings of coverage.py, comments in the code."""
    found = excluded_by_settings(CHECKOUT / "pyproject.toml")
    for file in sorted((CHECKOUT / "softrobots").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        for match in EXCLUDED.finditer(text):
            number = text.count("\n", 0, match.start()) + 1
            found.append((f"{file.relative_to(CHECKOUT)}:{number}", match["reason"].strip(" :-")))
    return found


def excluded_by_settings(file: Path) -> list[tuple[str, str]]:
    """What coverage.py leaves out by its settings, its own among them, and the comment behind each, which is the reason.

    Args:
        file: pyproject.toml.
    """
    from coverage import Coverage

    settings, lines = Coverage(config_file=str(file)), file.read_text(encoding="utf-8").splitlines()
    found = []
    for option in ("run:omit", "report:omit", "report:include", "report:exclude_lines", "report:exclude_also"):
        values = settings.get_option(option) or []
        for value in values if isinstance(values, list) else [values]:
            if value != PRAGMA:  # what it leaves out is found in the code
                reasons = [line.partition(json.dumps(value))[2] for line in lines if json.dumps(value) in line]
                found.append((f"{option.partition(':')[2]} {value}", reasons[0].partition("#")[2].strip() if reasons else ""))
    return found


def table(report: dict[str, Any], excluded: list[tuple[str, str]]) -> str:
    """Format the counts and the exclusions as Markdown."""
    lines = ["| | lines | run | branches | taken | lines and branches |", "|---|---|---|---|---|---|"]
    for name, found in [*by_folder(report).items(), ("**all**", counts_of(report["totals"]))]:
        cells = [name, *map(str, found), f"{found.percent:.1f} %"]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "Left out of the count:", ""] if excluded else ["", "Nothing is left out of the count."]
    return "\n".join(lines + [f"- `{where}`: {reason or '**no reason given**'}" for where, reason in excluded])


def least_run(report: dict[str, Any], count: int) -> str:
    """Name the files with most that is not run, and their lines."""
    files = report["files"].items()
    missed = {name: file["missing_lines"] for name, file in files}
    ways = {name: [way for way in file["missing_branches"] if way[0] not in missed[name]] for name, file in files}
    worst = sorted(missed, key=lambda name: -len(missed[name]) - len(ways[name]))[:count]
    return "\n".join(f"{name}: lines {missed[name]}, branches {ways[name]}" for name in worst if missed[name] or ways[name])


def run(arguments: argparse.Namespace) -> bool:
    """Do the whole job; tell whether the tests passed and the limit holds."""
    limit = non_negative_number("--limit", arguments.limit, "%")
    if arguments.docs is not None:
        if arguments.tests != ["tests"]:
            raise sr.ParameterError("--tests", arguments.tests, "left out with --docs")
        check_page(arguments.docs, "coverage")
    target = None if arguments.output is None else new_file(arguments.output, overwrite=False)
    began = time.perf_counter()
    passed, report = measure(arguments.tests)
    minutes = (time.perf_counter() - began) / 60.0
    if target is not None:
        write_text(target, json.dumps(report, indent=1) + "\n", overwrite=False)
    excluded = exclusions()
    share = counts_of(report["totals"]).percent
    print(f"\n{least_run(report, arguments.files)}\n\n{table(report, excluded)}\n\n{minutes:.1f} minutes")
    if not passed:
        print("tests failed", file=sys.stderr)
    good = passed and share >= limit and all(reason for _, reason in excluded)
    if arguments.docs is not None and not good:
        print(f"not recorded: tests must pass and cover {limit:g} %, exclusions have a reason", file=sys.stderr)
    elif arguments.docs is not None:
        result = {name: counts._asdict() for name, counts in by_folder(report).items()}
        totals = {"percent": round(share, 2), "limit": limit, "minutes": round(minutes, 1)}
        command = "python scripts/measure_coverage.py"
        write_record(arguments.docs, "coverage", table(report, excluded), {**totals, "folders": result}, command=command)
    return good


def main(argv: list[str] | None = None) -> int:
    """Run from the command line: 1 if the limit does not hold, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
