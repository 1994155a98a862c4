"""Solve random robots among random obstacles and check every answer by distances written a second time.

Arms, arms of muscles and of tendons; half-spaces, spheres, boxes, cylinders and capsules beside the robot and around it; loads
on the tip and weight. Of every answer the balance is computed again with the forces of its contacts, and the distance of every
capsule from every obstacle: no penetration, no pull, no gap under a force, normals that are slopes of the distance; springs
disturbed at random must not have less energy. Every failure must be an error that says so; where a part that no spring moves is
inside of an obstacle, it counts as no room. Exit status 1 if a law is broken; `--case` runs one case again.
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
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, command_of, write_record
from studies.soak.contact_cases import draw, judge
from studies.soak.contact_running import family_of, soak_contact, table
from studies.soak.plain_contact import PlainBody
from studies.soak.plain_statics import PlainStatics
from studies.soak.running import as_json

NAME = "soak_contact"
_TOLD = 20  # broken cases that are printed


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--cases", type=int, default=100_000, metavar="N", help="about how many cases (%(default)s)")
    result.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random numbers (%(default)s)")
    help_text = "how many work on it (one a core: %(default)s)"
    result.add_argument("--processes", type=int, default=os.cpu_count() or 1, metavar="N", help=help_text)
    result.add_argument("--case", metavar="FAMILY:NUMBER", help="run one case again, and tell everything about it")
    result.add_argument("--json", type=Path, metavar="FILE", help="write the counts to a new file")
    help_text = "record the table in docs/validation.md of a checkout (this one)"
    result.add_argument("--docs", type=Path, nargs="?", const=CHECKOUT, metavar="CHECKOUT", help=help_text)
    return result


def run(arguments: argparse.Namespace) -> bool:
    """Soak, and tell what came of it; whether no law is broken."""
    if arguments.case is not None:
        return _run_again(arguments.case, arguments.seed)
    target = None if arguments.json is None else new_file(arguments.json, overwrite=False)
    if arguments.docs is not None:
        check_page(arguments.docs, NAME)
    tallies = soak_contact(arguments.cases, seed=arguments.seed, processes=arguments.processes, progress=True)
    rows, numbers = table(tallies), as_json(tallies, seed=arguments.seed)
    print(rows)
    for name, tally in tallies.items():
        for number, law in tally.broken[:_TOLD]:
            print(f"broken: {law}\n  python scripts/soak_contact.py --seed {arguments.seed} --case {name}:{number}")
    if target is not None:
        print(write_text(target, json.dumps(numbers, indent=1, allow_nan=False) + "\n", overwrite=False))
    if arguments.docs is not None:
        command = command_of(NAME, parser(), arguments, "cases", "seed")
        for file in write_record(arguments.docs, NAME, rows, numbers, command=command):
            print(file)
    return not any(tally.broken for tally in tallies.values())


def _run_again(words: str, seed: int) -> bool:
    name, _, number = words.partition(":")
    if not number.isdecimal():
        raise ParameterError("--case", words, "a family and the number of a case, as arm:17")
    family = family_of(name)
    case, environment = draw(family, PlainBody(PlainStatics(family.robot())), seed, int(number))
    for field, row in case._asdict().items():
        print(f"{field}: {row[0].tolist()}")
    print(environment.to_yaml())
    tally = judge(family, seed, range(int(number), int(number) + 1))
    print(", ".join(tally.outcomes))
    for _, law in tally.broken:
        print(f"broken: {law}")
    return not tally.broken


def main(argv: list[str] | None = None) -> int:
    """Run from the command line."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
