"""Run the studies by random cases with all their cases, of which the gate tries a part, and record what came of it.

A test that is marked `shortened(gate, all)` has the fixture `cases`: the first number where the tests run as usual, the second
one here. All are tests as any other: `python -m pytest -m shortened --all-cases` runs the same. Exit status 1 if one fails.
Takes about five minutes on two cores.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, dataclass
from pathlib import Path

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, write_record

NAME = "long_proofs"


@dataclass
class Proof:
    """A study, with all its parameters."""

    test: str
    """File and name, as `test_x::test_y`."""
    gate: int = 0
    """Cases that the gate tries."""
    cases: int = 0
    """Cases that were tried."""
    failed: int = 0
    """How many of its tests failed."""


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cores = os.cpu_count() or 1
    help_text = "how many processes work on it (one a core: %(default)s)"
    result.add_argument("--processes", type=int, default=cores, metavar="N", help=help_text)
    help_text = "record the table in docs/validation.md of a checkout (this one)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def read_report(report: Path) -> list[Proof]:
    """Read what pytest has written (JUnit XML): a line for each study, in the order of their names."""
    found: dict[str, Proof] = {}
    for test in ElementTree.parse(report).iter("testcase"):
        name = f"{test.get('classname', '').rpartition('.')[2]}::{test.get('name', '').partition('[')[0]}"
        proof = found.setdefault(name, Proof(name))
        numbers = {one.get("name"): int(one.get("value", "0")) for one in test.iter("property")}
        proof.gate += numbers.get("gate", 0)
        proof.cases += numbers.get("all", 0)
        proof.failed += test.find("failure") is not None or test.find("error") is not None
    return [found[name] for name in sorted(found)]


def table(proofs: list[Proof]) -> str:
    """Format them as Markdown."""
    lines = ["| study | cases in the gate | cases | tests failed |", "|---|---:|---:|---:|"]
    lines += [f"| `{one.test}` | {one.gate} | {one.cases} | {one.failed} |" for one in proofs]
    return "\n".join(lines)


def run(arguments: argparse.Namespace) -> bool:
    """Run the studies; tell whether all passed."""
    if arguments.processes < 1:
        raise sr.ParameterError("--processes", arguments.processes, "at least 1")
    if arguments.docs is not None:
        check_page(arguments.docs, NAME)
    with tempfile.TemporaryDirectory(prefix="softrobots_") as folder:
        report = Path(folder) / "report.xml"
        options = ["-q", "-n", str(arguments.processes), "--timeout=3600", f"--junitxml={report}"]
        command = [sys.executable, "-m", "pytest", *options, "-m", "shortened", "--all-cases"]
        status = subprocess.run(command, cwd=CHECKOUT, check=False).returncode
        if status not in (0, 1) or not report.is_file():  # 0: all passed, 1: some failed; else not all of them ran
            raise sr.OutputError(f"the tests ended early, with status {status}")
        proofs = read_report(report)
    print(f"\n{table(proofs)}")
    if arguments.docs is not None and status == 1:
        print("not recorded: a test failed", file=sys.stderr)
    elif arguments.docs is not None:
        result = {"proofs": [asdict(proof) for proof in proofs]}
        write_record(arguments.docs, NAME, table(proofs), result, command="python scripts/long_proofs.py")
    return status == 0


def main(argv: list[str] | None = None) -> int:
    """Run from the command line: 1 if a test fails, 2 after bad input."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
