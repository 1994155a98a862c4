"""Damage valid files at random and read them: each must be refused with a SoftRobotsError, or be read as a valid file.

Every reader of files that the package has is a line of the table READERS: valid files, how they are damaged, and how they are
read. A case is a number: the same number and seed make the same file again. Cases run in processes of their own with a limit of
CPU time and memory, so that a crash of a library or a hang is seen, counted, and told with its number:

    python scripts/fuzz_readers.py --reader URDF --cases 2000
    python scripts/fuzz_readers.py --case URDF:1234 --output offending.urdf

Counted are: refused (a SoftRobotsError), valid (read, and what comes of it is finite), other (another exception, or a number
that is not finite), ended (the process ended: a crash, or too much CPU time), beyond (it took more CPU time or memory than the
reader may, also when it was read a second time). All but the first two are defects.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SCRIPT = Path(__file__).resolve()
CHECKOUT = SCRIPT.parent.parent
if str(CHECKOUT) not in sys.path:
    sys.path.insert(0, str(CHECKOUT))  # the damages and the valid files are those of the tests

import softrobots as sr  # noqa: E402
from softrobots.cli.options.command_line import exit_status  # noqa: E402
from softrobots.core.files import new_file, write_atomically  # noqa: E402
from studies.recorded_run import check_page, command_of, write_record  # noqa: E402
from tests.support import hostile_data as data  # noqa: E402
from tests.support import hostile_descriptions as descriptions  # noqa: E402
from tests.support.hostile import Damage, damaged_bytes, damaged_xml  # noqa: E402

NAME = "fuzzing"
DEFECTS = ("other", "ended", "beyond")
"""What must not become of a file."""


class Reader(NamedTuple):
    """A reader of files, and how it is tried."""

    corpus: Callable[[], list[bytes]]
    """Makes the valid files; every one must be read without an error."""
    damage: Damage
    """Makes a damaged file of a valid one."""
    read: Callable[[Path], object]
    """Reads a file. It raises a SoftRobotsError where it refuses one, and another exception where what it has read is wrong."""
    suffix: str
    """What the names of such files end with."""
    seconds: float = 1.0
    """CPU time that a file may take [s]."""
    megabytes: float = 200.0
    """Memory that it may take in addition [MB]."""


READERS: dict[str, Reader] = {
    "URDF": Reader(descriptions.urdf_corpus, damaged_xml, descriptions.read_description, ".urdf"),
    "URDF text": Reader(descriptions.urdf_corpus, damaged_xml, descriptions.read_text, ".txt"),
    "MJCF": Reader(descriptions.mjcf_corpus, damaged_xml, descriptions.read_description, ".xml"),
    "SDF": Reader(descriptions.sdf_corpus, damaged_xml, descriptions.read_description, ".sdf"),
    # A xacro file is a program, which ends after so many steps; the robot that others are mounted on goes through one, too.
    "xacro": Reader(descriptions.xacro_corpus, damaged_xml, descriptions.read_xacro, ".xacro", 5.0, 300.0),
    "mount": Reader(descriptions.mounted_corpus, damaged_xml, descriptions.read_mounted, ".urdf", 5.0, 300.0),
    "STL": Reader(descriptions.stl, damaged_bytes, descriptions.read_mesh, ".stl"),
    "OBJ": Reader(descriptions.obj, damaged_bytes, descriptions.read_mesh, ".obj"),
    "DAE": Reader(descriptions.dae, damaged_xml, descriptions.read_mesh, ".dae"),
    **{name: Reader(*parts) for name, parts in data.READERS.items()},
}
"""Every reader of files, by name."""


def case(reader: str, number: int, seed: int) -> bytes:
    """The file of a case; the first cases are the valid files themselves.

    Args:
        reader: Name in `READERS`.
        number: Number of the case, from 0.
        seed: Seed of the campaign.
    """
    valid = READERS[reader].corpus()
    if number < len(valid):
        return valid[number]
    rng = np.random.default_rng([seed, zlib.crc32(reader.encode()), number])
    return READERS[reader].damage(valid[rng.integers(len(valid))], rng)


class Outcome(NamedTuple):
    """What became of a case."""

    kind: str
    """"refused", "valid", "other", "ended" or "beyond"."""
    seconds: float
    """CPU time [s]."""
    megabytes: float
    """Memory that the process took in addition, at most [MB]."""
    told: str
    """The message of the error, or how the process ended."""


def tried(reader: Reader, file: Path) -> Outcome:
    """Read one file in this process.

    Args:
        reader: The reader.
        file: The file.
    """
    before = _memory("VmRSS")
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the highest mark starts anew
    start = time.process_time()
    try:
        reader.read(file)
        kind, told = "valid", ""
    except sr.SoftRobotsError as error:
        kind, told = "refused", str(error)
    except Exception as error:  # that is what is looked for
        kind, told = "other", f"{type(error).__name__}: {error}"
    return Outcome(kind, time.process_time() - start, max(0.0, _memory("VmHWM") - before), told[:500])


def _memory(field: str) -> float:
    """A line of /proc/self/status [MB]; where there is none, the most that the process ever had."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith(f"{field}:"):
                return float(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def work(reader: str, seed: int, seconds: float, megabytes: float) -> None:
    """Be a worker: read numbers of cases from stdin, write outcomes to stdout.

    The kernel ends the process when a case takes more CPU time than it may, also inside of a library.
    """
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)  # parsers print their reasons there
    with tempfile.TemporaryDirectory(prefix="softrobots-") as name:
        _warm_up(READERS[reader], Path(name))
        _limit_memory(megabytes)
        print("ready", file=answers, flush=True)
        for line in sys.stdin:
            try:
                content = case(reader, int(line), seed)
            except Exception as error:  # no fault of the reader, but not to be passed over
                outcome = Outcome("other", 0.0, 0.0, f"the case cannot be made: {error!r}")
            else:
                signal.setitimer(signal.ITIMER_PROF, seconds)
                outcome = tried(READERS[reader], _put(Path(name), READERS[reader], content))
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            print(json.dumps(outcome), file=answers, flush=True)


def _warm_up(reader: Reader, folder: Path) -> None:
    """Read the valid files: whatever must be imported for that is there then, and is not counted."""
    for content in reader.corpus():
        with contextlib.suppress(Exception):
            reader.read(_put(folder, reader, content))


def _limit_memory(megabytes: float) -> None:
    most = int((_memory("VmSize") + megabytes) * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _put(folder: Path, reader: Reader, content: bytes) -> Path:
    file = folder / f"case{reader.suffix}"
    file.write_bytes(content)
    return file


class Worker:
    """A process that reads damaged files."""

    def __init__(self, reader: str, seed: int, seconds: float, megabytes: float) -> None:
        """Remember what it is for; it starts with the first case."""
        self._command = [sys.executable, str(SCRIPT), "--work", reader, "--seed", str(seed)]
        self._command += ["--seconds", str(seconds), "--megabytes", str(megabytes)]
        self._patience = 60.0 + 20.0 * seconds  # for one that waits without working, on a busy machine
        self._process: subprocess.Popen[str] | None = None

    def outcome(self, number: int) -> Outcome:
        """Have a case read.

        Raises:
            RuntimeError: If the process does not even start.
        """
        process = self._process or self._start()
        try:
            process.stdin.write(f"{number}\n")  # type: ignore[union-attr]
            process.stdin.flush()  # type: ignore[union-attr]
            answer = self._answer(process)
        except BrokenPipeError:
            answer = ""
        if answer:
            return Outcome(*json.loads(answer))
        return Outcome("ended", 0.0, 0.0, self.end())

    def end(self) -> str:
        """End the process and say how it had ended before, if it had."""
        process, self._process = self._process, None
        if process is None:
            return ""
        with contextlib.suppress(OSError):
            process.stdin.close()  # type: ignore[union-attr]
        try:
            code = process.wait(1.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return "it waited for something"
        finally:
            process.stdout.close()  # type: ignore[union-attr]
        if -code == signal.SIGPROF:
            return "too much CPU time"
        return f"signal {signal.Signals(-code).name}" if code < 0 else f"status {code}"

    def _start(self) -> subprocess.Popen[str]:
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "error::RuntimeWarning"}
        process = subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=CHECKOUT
        )
        self._process = process
        if self._answer(process) != "ready\n":
            raise RuntimeError(f"{' '.join(self._command)} does not start: {self.end()}")
        return process

    def _answer(self, process: subprocess.Popen[str]) -> str:
        ready, _, _ = select.select([process.stdout], [], [], self._patience)
        return process.stdout.readline() if ready else ""  # type: ignore[union-attr]


def _fit(reader: Reader, outcome: Outcome) -> Outcome:
    """What became of a case, and whether it took more than it may."""
    if outcome.kind not in DEFECTS and (outcome.seconds > reader.seconds or outcome.megabytes > reader.megabytes):
        taken = f"{outcome.seconds:.2f} s of {reader.seconds:g}, {outcome.megabytes:.0f} MB of {reader.megabytes:g}"
        return outcome._replace(kind="beyond", told=f"{taken}: {outcome.told}")
    return outcome


class Tally(NamedTuple):
    """What became of the cases of a reader."""

    reader: str
    counts: dict[str, int]
    slowest: tuple[float, int]
    """CPU time [s], and the number of the case."""
    largest: tuple[float, int]
    """Memory [MB], likewise."""
    found: list[tuple[int, str]]
    """Cases that are defects, with what was told; the first hundred."""

    @property
    def row(self) -> dict[str, Any]:
        """As JSON has it."""
        counts = {kind: self.counts.get(kind, 0) for kind in ("refused", "valid", *DEFECTS)}
        return {
            "reader": self.reader,
            "inputs": sum(counts.values()),
            **counts,
            "slowest_s": round(self.slowest[0], 3),
            "allowed_s": READERS[self.reader].seconds,
            "most_memory_mb": round(self.largest[0], 1),
            "allowed_mb": READERS[self.reader].megabytes,
        }


def campaign(arguments: argparse.Namespace, reader: str, numbers: Iterator[int]) -> Tally:
    """Try the cases of a reader, in as many processes as there are cores.

    Args:
        arguments: The command line.
        reader: Name in `READERS`.
        numbers: Numbers of the cases.
    """
    counts: dict[str, int] = {}
    found: list[tuple[int, str]] = []
    slowest, largest, lock = (0.0, 0), (0.0, 0), threading.Lock()

    def take() -> int | None:
        with lock:
            return next(numbers, None)

    failures: list[BaseException] = []

    def serve() -> None:
        nonlocal slowest, largest
        worker = Worker(reader, arguments.seed, arguments.seconds, arguments.megabytes)
        try:
            while not failures and (number := take()) is not None:
                outcome = _fit(READERS[reader], worker.outcome(number))
                if outcome.kind == "beyond":  # once more: the machine may have had something else to do
                    outcome = _fit(READERS[reader], worker.outcome(number))
                valid_refused = number < n_valid and outcome.kind != "valid"
                with lock:
                    kind = "other" if valid_refused and outcome.kind == "refused" else outcome.kind
                    counts[kind] = counts.get(kind, 0) + 1
                    if kind in DEFECTS and len(found) < 100:
                        found.append((number, f"{kind}: {'a valid file is refused: ' if valid_refused else ''}{outcome.told}"))
                    slowest = max(slowest, (outcome.seconds, number))
                    largest = max(largest, (outcome.megabytes, number))
        except BaseException as error:  # handed to the main thread
            failures.append(error)
        finally:
            worker.end()

    n_valid = len(READERS[reader].corpus())
    threads = [threading.Thread(target=serve, daemon=True) for _ in range(arguments.processes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]
    return Tally(reader, counts, slowest, largest, sorted(found))


def table(tallies: Sequence[Tally]) -> str:
    """What the page shows, in Markdown."""
    head = "| reader | inputs | refused | valid | other exceptions | process ended | beyond time or memory "
    lines = [f"{head}| slowest [s] | allowed [s] | most memory [MB] | allowed [MB] |", "|---|" + "---:|" * 10]
    for row in (tally.row for tally in tallies):
        lines.append(f"| {' | '.join(str(value) for value in row.values())} |")
    return "\n".join(lines) + "\n"


def parser() -> argparse.ArgumentParser:
    """Build the command line."""
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    told = f"readers, of {', '.join(READERS)} (all)"
    made.add_argument("--reader", nargs="+", choices=tuple(READERS), metavar="NAME", help=told)
    made.add_argument("--cases", type=int, default=20000, metavar="N", help="cases for each reader (%(default)s)")
    made.add_argument("--first", type=int, default=0, metavar="N", help="number of the first case (%(default)s)")
    made.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the damages (%(default)s)")
    made.add_argument("--seconds", type=float, default=10.0, metavar="S", help="CPU time that ends a case [s] (%(default)s)")
    made.add_argument(
        "--megabytes", type=float, default=1024.0, metavar="MB", help="memory that a case may take [MB] (%(default)s)"
    )
    made.add_argument(
        "--processes", type=int, default=os.cpu_count() or 1, metavar="N", help="how many work on it (%(default)s)"
    )
    made.add_argument("--case", metavar="READER:NUMBER", help="write the file of this case to --output, and read it here")
    told = "read this file instead, and print what becomes of it, a line of JSON each; may be repeated"
    made.add_argument("--read", action="append", metavar="READER:FILE", help=told)
    made.add_argument("--output", type=Path, metavar="FILE", help="new file: that of --case, or a JSON file of the tallies")
    made.add_argument(
        "--docs",
        type=Path,
        nargs="?",
        const=CHECKOUT,
        metavar="CHECKOUT",
        help="record the table in docs/validation.md of a checkout (this one); without --reader",
    )
    made.add_argument("--work", choices=tuple(READERS), help=argparse.SUPPRESS)
    return made


def run(arguments: argparse.Namespace) -> bool:
    """Do what is asked; false if a defect is found."""
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
        return these_files(arguments)
    if arguments.docs is not None:
        if arguments.reader is not None or arguments.first:
            raise sr.ParameterError("--docs", str(arguments.docs), "given without --reader and --first")
        check_page(arguments.docs, NAME)
    target = None if arguments.output is None else new_file(arguments.output, overwrite=False)
    from tqdm import tqdm

    tallies = []
    for reader in arguments.reader or READERS:
        numbers = range(arguments.first, arguments.first + arguments.cases)
        tally = campaign(arguments, reader, iter(tqdm(numbers, desc=reader, unit="file")))
        tallies.append(tally)
        for number, told in tally.found:
            print(f"{reader}:{number} {' '.join(told.split())[:300]}")
        print(f"{tally.row} slowest {reader}:{tally.slowest[1]}, largest {reader}:{tally.largest[1]}", flush=True)
    result = {"seed": arguments.seed, "cases": arguments.cases, "readers": [tally.row for tally in tallies]}
    print("\n" + table(tallies))
    if target is not None:
        content = json.dumps({**result, "found": {tally.reader: tally.found for tally in tallies}}, indent=1).encode()
        write_atomically(target, lambda file: file.write(content))
    if arguments.docs is not None and any(tally.found for tally in tallies):
        print("not recorded: a defect was found", file=sys.stderr)
    elif arguments.docs is not None:
        command = command_of("fuzz_readers", parser(), arguments, "cases", "first", "seed")
        write_record(arguments.docs, NAME, table(tallies), result, command=command)
    return not any(tally.found for tally in tallies)


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
            READERS[reader].read(_put(Path(folder), READERS[reader], content))
        except sr.SoftRobotsError as error:
            print(f"refused: {error}")
            return True
    print("valid")
    return True


def these_files(arguments: argparse.Namespace) -> bool:
    """Read files of somebody in this process, within the limits; what is imported for it counts where it is first needed."""
    asked = [(name, Path(file)) for name, _, file in (word.partition(":") for word in arguments.read)]
    for name, file in asked:
        if name not in READERS or not str(file):
            raise sr.ParameterError("--read", f"{name}:{file}", f"READER:FILE with one of {', '.join(READERS)}")
    _limit_memory(arguments.megabytes)
    defects = 0
    for name, file in asked:
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
