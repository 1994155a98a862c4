"""A campaign: many damaged files for one reader, and their outcomes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from studies.fuzzing.readers import READERS, Reader
from studies.fuzzing.worker import Outcome, Worker
from studies.shared.markdown import line

DEFECTS = ("other", "ended", "beyond")
"""Outcomes that are defects."""


def _checked(reader: Reader, outcome: Outcome) -> Outcome:
    """Return the outcome, or "beyond" if the case took more time or memory than allowed."""
    if outcome.kind not in DEFECTS and (outcome.seconds > reader.seconds or outcome.megabytes > reader.megabytes):
        taken = f"{outcome.seconds:.2f} s of {reader.seconds:g}, {outcome.megabytes:.0f} MB of {reader.megabytes:g}"
        return outcome._replace(kind="beyond", message=f"{taken}: {outcome.message}")
    return outcome


class Tally(NamedTuple):
    """Outcomes of the cases of a reader."""

    reader: str
    counts: dict[str, int]
    slowest: tuple[float, int]
    """CPU time [s], and the number of the case."""
    largest: tuple[float, int]
    """Memory [MB], likewise."""
    defects: list[tuple[int, str]]
    """Number and message of the defects, the first hundred."""

    @property
    def row(self) -> dict[str, Any]:
        """The tally for JSON and the table."""
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


def campaign(reader: str, numbers: Iterator[int], processes: int, new_worker: Callable[[], Worker]) -> Tally:
    """Try the cases of a reader in several processes.

    Args:
        reader: Name in `READERS`.
        numbers: Numbers of the cases.
        processes: Number of processes.
        new_worker: Makes a process.
    """
    counts: dict[str, int] = {}
    defects: list[tuple[int, str]] = []
    slowest, largest, lock = (0.0, 0), (0.0, 0), threading.Lock()

    def take() -> int | None:
        with lock:
            return next(numbers, None)

    failures: list[BaseException] = []

    def serve() -> None:
        nonlocal slowest, largest
        worker = new_worker()
        try:
            while not failures and (number := take()) is not None:
                outcome = _checked(READERS[reader], worker.outcome(number))
                if outcome.kind == "beyond":  # repeated, as the machine may have been busy
                    outcome = _checked(READERS[reader], worker.outcome(number))
                valid_refused = number < n_valid and outcome.kind != "valid"
                with lock:
                    kind = "other" if valid_refused and outcome.kind == "refused" else outcome.kind
                    counts[kind] = counts.get(kind, 0) + 1
                    if kind in DEFECTS and len(defects) < 100:
                        defects.append(
                            (number, f"{kind}: {'a valid file is refused: ' if valid_refused else ''}{outcome.message}")
                        )
                    slowest = max(slowest, (outcome.seconds, number))
                    largest = max(largest, (outcome.megabytes, number))
        except BaseException as error:  # handed to the main thread
            failures.append(error)
        finally:
            worker.end()

    n_valid = len(READERS[reader].corpus())
    threads = [threading.Thread(target=serve, daemon=True) for _ in range(processes)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]
    return Tally(reader, counts, slowest, largest, sorted(defects))


def table(tallies: Sequence[Tally]) -> str:
    """Return the tallies as a Markdown table."""
    head = "| reader | inputs | refused | valid | other exceptions | process ended | beyond time or memory "
    lines = [f"{head}| slowest [s] | allowed [s] | most memory [MB] | allowed [MB] |", "|---|" + "---:|" * 10]
    for row in (tally.row for tally in tallies):
        lines.append(line(row.values()))
    return "\n".join(lines) + "\n"
