"""`softrobots bench`: how fast the solvers are on this machine, each job against what one would use instead."""

from __future__ import annotations

import argparse
import dataclasses
import json
from pathlib import Path
from typing import Any

from softrobots.benchmark.jobs import JOBS, PLAIN, measure
from softrobots.benchmark.race import Settings, quick_settings, short_settings
from softrobots.benchmark.results import HEAD, Results, as_json, cells, machine_text
from softrobots.commands.answers import add_json, aligned, tell
from softrobots.errors import ParameterError
from softrobots.files import new_file, write_text

_EXAMPLES = f"""examples:
  softrobots bench                                   equilibria against baselines that need no extras; seconds
  softrobots bench --only estimation trajectory      other jobs, in small sizes
  softrobots bench --full -o mine.json               everything, as scripts/benchmark.py does; minutes

Jobs for --only: {", ".join(JOBS)}.

All alternatives of a job run in turn on one thread; costs are CPU time of a case, ratios are taken within a round,
and what is told are medians. Answers are compared before anything is timed. What needs a package that is not installed
is named as skipped. Nothing fails because it is slow. The first run compiles, some seconds more; the code is kept
(`softrobots doctor` tells where). `scripts/benchmark.py --from FILE` makes tables and pictures of saved results.

This measures computers. The characterisation bench, in which a UR5 pushes an inflated link, is scripts/ur5_bench.py.

With --json: one object as -o saves it. rows: job, ours, baseline, value with low and high (smallest and largest in a
round) in the unit named, our_seconds and baseline_seconds [s a case], bound, target and met where there is a target,
skipped; curves: sizes and seconds [s a case]; machine; settings; notes.
"""


def add_parser(subparsers: Any) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "bench",
        help="measure how fast the solvers are on this machine",
        description="How fast the solvers are on this machine: equilibria of the inflatable arm, one by one and in batches, "
        "against the same in plain Python with Pinocchio and in plain NumPy.",
        epilog=_EXAMPLES,
    )
    told = "run these jobs, against everything that is installed (a short one of equilibria; with --full: all)"
    parser.add_argument("--only", nargs="+", choices=list(JOBS), metavar="JOB", help=told)
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--full", action="store_true", help="the sizes that the published figures have; minutes (small sizes)")
    told = "tiny sizes, to see that everything runs; the figures mean nothing"
    size.add_argument("--quick", action="store_true", help=told)
    parser.add_argument("--rounds", type=int, metavar="N", help="rounds of each race [-] (5; with --full: 9)")
    told = "with --full: also compile and time Pinocchio's forward kinematics in C++ (needs g++ and libeigen3-dev)"
    parser.add_argument("--cpp", action="store_true", help=told)
    parser.add_argument("-o", "--output", type=Path, metavar="FILE.json", help="also write the results to a new file (none)")
    parser.add_argument("--overwrite", action="store_true", help="allow FILE to be replaced")
    add_json(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Measure and tell."""
    if arguments.rounds is not None and arguments.rounds < 1:
        raise ParameterError("--rounds", arguments.rounds, "at least 1")
    if arguments.cpp and not arguments.full:
        raise ParameterError("--cpp", True, "given with --full")
    if arguments.output is not None:
        new_file(arguments.output, overwrite=arguments.overwrite)  # tells at once
    jobs = arguments.only or (list(JOBS) if arguments.full else [PLAIN])
    results = measure(_settings(arguments), jobs)
    text, lines = as_json(results), _lines(results)
    if arguments.output is not None:
        lines += ["", f"{write_text(arguments.output, text, overwrite=arguments.overwrite)}: written"]
    tell(arguments, json.loads(text), lines)


def _settings(arguments: argparse.Namespace) -> Settings:
    """The sizes that the options ask for."""
    if arguments.quick:
        return quick_settings(arguments.rounds or 5, progress=True, cpp=False)
    if arguments.full:
        made = Settings(progress=True, cpp=arguments.cpp)
        return made if arguments.rounds is None else dataclasses.replace(made, rounds=arguments.rounds)
    return short_settings(arguments.rounds or 5, progress=True)


def _lines(results: Results) -> list[str]:
    """The results for a person: machine, a table of what was measured, and what was skipped."""
    measured = [row for row in results.rows if not row.skipped]
    lines = [machine_text(results), ""]
    if measured:
        told = [HEAD, *(tuple(cell.strip("*") for cell in cells(row)) for row in measured)]
        columns = [column for column in zip(*told, strict=True) if any(column[1:])]  # no targets, no column of them
        lines += aligned(zip(*columns, strict=True))
    for curve in results.curves:
        costs = ", ".join(f"{size}: {seconds:.3g} s" for size, seconds in zip(curve.sizes, curve.seconds, strict=True))
        lines.append(f"{curve.picture}, {curve.label}: {costs}")
    skipped = dict.fromkeys(row.skipped for row in results.rows if row.skipped)
    if skipped:
        lines += ["", "skipped:", *(f"  {reason}" for reason in skipped)]
    if results.notes:
        lines += ["", *results.notes]
    return lines
