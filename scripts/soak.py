"""Solve random and hard cases by the hundred thousand, and check every answer with statics written a second time.

Robots of every kind, loads from 0 to 1000 N, straight and folded elbows, the tip on the motor axis, springs of 1e-3 to 1e6
of the usual stiffness, rods of 1 to 200 sections; equilibria, load estimation and inverse kinematics, by the general solvers
and the compiled ones. Of every answer the balance is computed again, of many the stability; every failure must be an error
that says so. Exit status 1 if a law is broken; the cases are printed, and `--case` runs one again.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from softrobots.cli.options.command_line import exit_status
from softrobots.core.errors import ParameterError
from softrobots.core.files import new_file, write_text
from studies.shared.recorded_run import check_page, command_of, write_record
from studies.soak.families import FAMILIES
from studies.soak.running import again, as_json, family_of, soak, table

CHECKOUT = Path(__file__).resolve().parent.parent
CASES = 1_000_000
_TOLD = 20  # broken cases that are printed


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cores = os.cpu_count() or 1
    names = [family.name for family in FAMILIES]
    result.add_argument("--cases", type=int, default=CASES, metavar="N", help="about how many cases (%(default)s)")
    result.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random numbers (%(default)s)")
    result.add_argument(
        "--processes", type=int, default=cores, metavar="N", help="how many work on it (one a core: %(default)s)"
    )
    help_text = f"families of cases ({', '.join(names)})"
    result.add_argument("--families", nargs="+", choices=names, default=names, metavar="NAME", help=help_text)
    result.add_argument("--case", metavar="FAMILY:NUMBER", help="run one case again, and tell everything about it")
    result.add_argument("--json", type=Path, metavar="FILE", help="write the counts to a new file")
    help_text = "record the table in docs/validation.md of a checkout (this one); without --families"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> bool:
    """Soak, and tell what came of it; whether no law is broken."""
    if arguments.case is not None:
        return _run_again(arguments.case, arguments.seed)
    target = None if arguments.json is None else new_file(arguments.json, overwrite=False)
    if arguments.docs is not None:
        if set(arguments.families) != {family.name for family in FAMILIES}:
            raise ParameterError("--docs", str(arguments.docs), "given without --families")
        check_page(arguments.docs, "soak")
    families = [family_of(name) for name in dict.fromkeys(arguments.families)]
    tallies = soak(arguments.cases, seed=arguments.seed, processes=arguments.processes, families=families, progress=True)
    rows, numbers = table(tallies), as_json(tallies, seed=arguments.seed)
    print(rows)
    for name, tally in tallies.items():
        for number, law in tally.broken[:_TOLD]:
            print(f"broken: {law}\n  python scripts/soak.py --seed {arguments.seed} --case {name}:{number}")
    if target is not None:
        print(write_text(target, json.dumps(numbers, indent=1, allow_nan=False) + "\n", overwrite=False))
    if arguments.docs is not None:
        command = command_of("soak", parser(), arguments, "cases", "seed")
        for file in write_record(arguments.docs, "soak", rows, numbers, command=command):
            print(file)
    return not any(tally.broken for tally in tallies.values())


def _run_again(words: str, seed: int) -> bool:
    name, _, number = words.partition(":")
    if not number.isdecimal():
        raise ParameterError("--case", words, "a family and the number of a case, as arm:17")
    tally, text = again(name, int(number), seed=seed)
    print(text)
    for _, law in tally.broken:
        print(f"broken: {law}")
    return not tally.broken


def main(argv: list[str] | None = None) -> int:
    """Run from the command line."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
