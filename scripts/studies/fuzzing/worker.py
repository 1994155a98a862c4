"""Processes that read damaged files within limits of CPU time and memory."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import softrobots as sr
from studies.fuzzing.readers import READERS, Reader, case
from studies.shared.checkout import CHECKOUT


class Outcome(NamedTuple):
    """The result of a case."""

    kind: str
    """"refused", "valid", "other", "ended" or "beyond"."""
    seconds: float
    """CPU time [s]."""
    megabytes: float
    """Memory that the process took in addition, at most [MB]."""
    message: str
    """The message of the error, or how the process ended."""


def tried(reader: Reader, file: Path) -> Outcome:
    """Read one file in this process.

    Args:
        reader: The reader.
        file: The file.
    """
    before = _memory("VmRSS")
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # resets the peak
    start = time.process_time()
    try:
        reader.read(file)
        kind, message = "valid", ""
    except sr.SoftRobotsError as error:
        kind, message = "refused", str(error)
    except Exception as error:  # a defect, to be reported
        kind, message = "other", f"{type(error).__name__}: {error}"
    return Outcome(kind, time.process_time() - start, max(0.0, _memory("VmHWM") - before), message[:500])


def _memory(field: str) -> float:
    """Return a line of /proc/self/status [MB]; where there is none, the peak of the process."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith(f"{field}:"):
                return float(line.split()[1]) / 1024.0
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def work(reader: str, seed: int, seconds: float, megabytes: float) -> None:
    """Read numbers of cases from stdin, and write outcomes to stdout.

    The kernel ends the process when a case takes more CPU time than it may, also inside of a library.
    """
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)  # parsers print there
    with tempfile.TemporaryDirectory(prefix="softrobots-") as name:
        _read_valid_files(READERS[reader], Path(name))
        limit_memory(megabytes)
        print("ready", file=answers, flush=True)
        for line in sys.stdin:
            try:
                content = case(reader, int(line), seed)
            except Exception as error:  # a defect of the campaign, which is reported too
                outcome = Outcome("other", 0.0, 0.0, f"the case cannot be made: {error!r}")
            else:
                signal.setitimer(signal.ITIMER_PROF, seconds)
                outcome = tried(READERS[reader], write_case(Path(name), READERS[reader], content))
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            print(json.dumps(outcome), file=answers, flush=True)


def _read_valid_files(reader: Reader, folder: Path) -> None:
    """Read the valid files, so that imports do not count towards a case."""
    for content in reader.corpus():
        with contextlib.suppress(Exception):
            reader.read(write_case(folder, reader, content))


def limit_memory(megabytes: float) -> None:
    """Let this process take so much more memory [MB]."""
    most = int((_memory("VmSize") + megabytes) * 2**20)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def write_case(folder: Path, reader: Reader, content: bytes) -> Path:
    """Write the file of a case."""
    file = folder / f"case{reader.suffix}"
    file.write_bytes(content)
    return file


class Worker:
    """A process that reads damaged files."""

    def __init__(self, script: str | Path, reader: str, seed: int, seconds: float, megabytes: float) -> None:
        """Set the command; the process starts with the first case.

        Args:
            script: The script whose option `--work` calls `work`.
            reader: Name in `READERS`.
            seed: Seed of the campaign.
            seconds: CPU time that ends a case [s].
            megabytes: Memory that a case may take [MB].
        """
        self._command = [sys.executable, str(script), "--work", reader, "--seed", str(seed)]
        self._command += ["--seconds", str(seconds), "--megabytes", str(megabytes)]
        self._patience = 60.0 + 20.0 * seconds  # [s], for a process that waits without using CPU time
        self._process: subprocess.Popen[str] | None = None

    def outcome(self, number: int) -> Outcome:
        """Read the file of a case.

        Raises:
            RuntimeError: If the process does not start.
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
        """End the process; return how it ended before, or an empty text."""
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
            return "it did not end, and used no CPU time"
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
        ready, _, _ = select.select([process.stdout], [], [], self._patience)  # type: ignore[type-var]
        return process.stdout.readline() if ready else ""  # type: ignore[union-attr]
