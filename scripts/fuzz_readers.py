"""Damage valid files at random and read them: each must be refused with a SoftRobotsError, or be read as a valid file.

Every reader of files that the package has is a line of the table READERS: valid files, how they are damaged, and how they are
read. A case is a number: the same number and seed make the same file. Cases run in processes of their own with a limit of
CPU time and memory, so that a crash of a library or a hang is seen, counted, and reported with its number:

    python scripts/fuzz_readers.py --reader URDF --cases 2000
    python scripts/fuzz_readers.py --case URDF:1234 --output offending.urdf

Counted are: refused (a SoftRobotsError), valid (read, and every number of the result is finite), other (another exception, or
a number that is not finite), ended (the process ended: a crash, or too much CPU time), beyond (it took more CPU time or memory
than the reader may, also when it was read a second time). All but the first two are defects.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
from functools import partial
from pathlib import Path

from tqdm import tqdm

import softrobots as sr
from softrobots.cli.options.command_line import exit_status
from softrobots.core.files import new_file, write_atomically
from studies.fuzzing.campaign import campaign, table
from studies.fuzzing.readers import READERS, case
from studies.fuzzing.worker import Worker, limit_memory, tried, work, write_case
from studies.shared.checkout import CHECKOUT
from studies.shared.recorded_run import check_page, command_of, write_record

SCRIPT = Path(__file__).resolve()
NAME = "fuzzing"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    result = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    help_text = f"readers, of {', '.join(READERS)} (all)"
    result.add_argument("--reader", nargs="+", choices=tuple(READERS), metavar="NAME", help=help_text)
    result.add_argument("--cases", type=int, default=20000, metavar="N", help="cases for each reader (%(default)s)")
    result.add_argument("--first", type=int, default=0, metavar="N", help="number of the first case (%(default)s)")
    result.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the damages (%(default)s)")
    result.add_argument("--seconds", type=float, default=10.0, metavar="S", help="CPU time that ends a case [s] (%(default)s)")
    result.add_argument(
        "--megabytes", type=float, default=1024.0, metavar="MB", help="memory that a case may take [MB] (%(default)s)"
    )
    result.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, metavar="N", help="how many work on it (%(default)s)"
    )
    result.add_argument("--case", metavar="READER:NUMBER", help="write the file of this case to --output, and read it here")
    help_text = "read this file instead, and print what becomes of it, a line of JSON each; may be repeated"
    result.add_argument("--read", action="append", metavar="READER:FILE", help=help_text)
    result.add_argument("--output", type=Path, metavar="FILE", help="new file: that of --case, or a JSON file of the tallies")
    result.add_argument(
        "--docs",
        type=Path,
        nargs="?",
        const=CHECKOUT,
        metavar="CHECKOUT",
        help="record the table in docs/validation.md of a checkout (this one); without --reader",
    )
    result.add_argument("--work", choices=tuple(READERS), help=argparse.SUPPRESS)
    return result


def run(arguments: argparse.Namespace) -> bool:
    """Run the campaign, a case or given files; return False if a defect is found."""
    if arguments.work:
        work(arguments.work, arguments.seed, arguments.seconds, arguments.megabytes)
        return True
    for option, least in (("cases", 1), ("first", 0), ("seed", 0), ("processes", 1)):
        if getattr(arguments, option) < least:
            raise sr.ParameterError(f"--{option}", getattr(arguments, option), f"at least {least}")
    for option in ("seconds", "megabytes"):
        if not getattr(arguments, option) > 0.0:
            raise sr.ParameterError(f"--{option}", getattr(arguments, option), "positive")
    if arguments.case is not None:
        return one_case(arguments)
    if arguments.read:
        return given_files(arguments)
    if arguments.docs is not None:
        if arguments.reader is not None or arguments.first:
            raise sr.ParameterError("--docs", str(arguments.docs), "given without --reader and --first")
        check_page(arguments.docs, NAME)
    target = None if arguments.output is None else new_file(arguments.output, overwrite=False)
    tallies = []
    for reader in arguments.reader or READERS:
        numbers = range(arguments.first, arguments.first + arguments.cases)
        limits = (arguments.seed, arguments.seconds, arguments.megabytes)
        new_worker = partial(Worker, SCRIPT, reader, *limits)
        tally = campaign(reader, iter(tqdm(numbers, desc=reader, unit="file")), arguments.processes, new_worker)
        tallies.append(tally)
        for number, message in tally.defects:
            print(f"{reader}:{number} {' '.join(message.split())[:300]}")
        print(f"{tally.row} slowest {reader}:{tally.slowest[1]}, largest {reader}:{tally.largest[1]}", flush=True)
    result = {"seed": arguments.seed, "cases": arguments.cases, "readers": [tally.row for tally in tallies]}
    print("\n" + table(tallies))
    if target is not None:
        content = json.dumps({**result, "found": {tally.reader: tally.defects for tally in tallies}}, indent=1).encode()
        write_atomically(target, lambda file: file.write(content))
    if arguments.docs is not None and any(tally.defects for tally in tallies):
        print("not recorded: a defect was found", file=sys.stderr)
    elif arguments.docs is not None:
        command = command_of("fuzz_readers", parser(), arguments, "cases", "first", "seed")
        write_record(arguments.docs, NAME, table(tallies), result, command=command)
    return not any(tally.defects for tally in tallies)


def one_case(arguments: argparse.Namespace) -> bool:
    """Write the file of a case, and read it in this process, with a traceback if it is a defect."""
    reader, _, number = arguments.case.rpartition(":")
    if reader not in READERS or not number.isdigit():
        raise sr.ParameterError("--case", arguments.case, f"READER:NUMBER with one of {', '.join(READERS)}")
    content = case(reader, int(number), arguments.seed)
    if arguments.output is None:
        raise sr.ParameterError("--output", None, "given: the file to be written")
    target = new_file(arguments.output, overwrite=False)
    write_atomically(target, lambda file: file.write(content))
    print(f"written to {target}: {len(content)} bytes", flush=True)
    with tempfile.TemporaryDirectory(prefix="softrobots-") as folder:
        try:
            READERS[reader].read(write_case(Path(folder), READERS[reader], content))
        except sr.SoftRobotsError as error:
            print(f"refused: {error}")
            return True
    print("valid")
    return True


def given_files(arguments: argparse.Namespace) -> bool:
    """Read given files in this process, within the limits; imports count towards the first file that needs them."""
    files = [(name, Path(file)) for name, _, file in (word.partition(":") for word in arguments.read)]
    for name, file in files:
        if name not in READERS or not str(file):
            raise sr.ParameterError("--read", f"{name}:{file}", f"READER:FILE with one of {', '.join(READERS)}")
    limit_memory(arguments.megabytes)
    defects = 0
    for name, file in files:
        signal.setitimer(signal.ITIMER_PROF, arguments.seconds)
        outcome = tried(READERS[name], file)
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        defects += outcome.kind == "other"
        print(json.dumps({"file": str(file), **outcome._asdict()}), flush=True)
    return defects == 0


def main(argv: list[str] | None = None) -> int:
    """Run from the command line; bad input ends with status 2."""
    arguments = parser().parse_args(argv)
    return exit_status(lambda: run(arguments))


if __name__ == "__main__":
    sys.exit(main())
